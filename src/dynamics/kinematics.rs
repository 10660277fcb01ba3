//! Poses, velocities and velocity-product accelerations of all bodies in one pass.

use nalgebra::{Matrix3, Vector3};

use super::spatial::Motion;
use crate::character::{BODIES, CharacterModel, CharacterState, DOF, GenVec};

/// Positions, axes and velocities at one state. Positions are relative to `origin` unless said otherwise.
#[derive(Clone, Debug)]
pub struct Kinematics {
    /// Reference point of all spatial vectors: the root's origin, world axes, m.
    pub origin: Vector3<f64>,
    /// Attitude of each body, body to world.
    pub rot_world_body: [Matrix3<f64>; BODIES],
    /// Origin of each body relative to `origin`, m.
    pub position: [Vector3<f64>; BODIES],
    /// Centre of mass of each body relative to `origin`, m.
    pub com_offset: [Vector3<f64>; BODIES],
    /// Unit motion of each degree of freedom.
    pub axis: [Motion; DOF],
    /// Rate of change of `axis` at the present velocity.
    pub axis_rate: [Motion; DOF],
    /// Spatial velocity of each body.
    pub velocity: [Motion; BODIES],
    /// Spatial acceleration of each body at zero generalised acceleration (velocity products; no gravity).
    pub bias_acceleration: [Motion; BODIES],
}

impl Default for Kinematics {
    fn default() -> Self {
        Self {
            origin: Vector3::zeros(),
            rot_world_body: [Matrix3::identity(); BODIES],
            position: [Vector3::zeros(); BODIES],
            com_offset: [Vector3::zeros(); BODIES],
            axis: [Motion::default(); DOF],
            axis_rate: [Motion::default(); DOF],
            velocity: [Motion::default(); BODIES],
            bias_acceleration: [Motion::default(); BODIES],
        }
    }
}

impl Kinematics {
    /// Recomputes everything for `state`.
    pub fn update(&mut self, model: &CharacterModel, state: &CharacterState) {
        self.root(state);
        self.com_offset[0] = self.rot_world_body[0] * model.bodies[0].com;
        for index in 1..BODIES {
            let body = &model.bodies[index];
            let rot_parent = self.rot_world_body[body.parent];
            let mut position = self.position[body.parent] + rot_parent * body.origin_in_parent;
            let mut rot = rot_parent * body.rot_parent_body;
            let mut velocity = self.velocity[body.parent];
            let mut bias = self.bias_acceleration[body.parent];
            for dof in body.first_dof..body.first_dof + body.dofs {
                let joint = &model.joints[dof - 6];
                // Most hinges turn about the body's own origin, which then stays where it is.
                let has_arm = joint.anchor != Vector3::zeros();
                let anchor = if has_arm { position + rot * joint.anchor } else { position };
                let axis = rot * joint.axis;
                let motion = Motion { angular: axis, linear: anchor.cross(&axis) };
                let rate = velocity.cross(&motion);
                let speed = state.velocity[dof];
                bias = bias.plus_scaled(speed, &rate);
                velocity = velocity.plus_scaled(speed, &motion);
                self.axis[dof] = motion;
                self.axis_rate[dof] = rate;
                rot = turned(&rot, &joint.axis, state.joint_angles[dof - 6]);
                position = if has_arm { anchor - rot * joint.anchor } else { anchor };
            }
            self.rot_world_body[index] = rot;
            self.position[index] = position;
            self.com_offset[index] = position + rot * body.com;
            self.velocity[index] = velocity;
            self.bias_acceleration[index] = bias;
        }
    }

    fn root(&mut self, state: &CharacterState) {
        let rot = state.root_attitude.to_rotation_matrix().into_inner();
        self.origin = state.root_position;
        self.rot_world_body[0] = rot;
        self.position[0] = Vector3::zeros();
        let linear = state.velocity.fixed_rows::<3>(0).into_owned();
        let omega = rot * state.velocity.fixed_rows::<3>(3);
        let velocity = Motion { angular: omega, linear };
        for i in 0..3 {
            self.axis[i] = Motion { angular: Vector3::zeros(), linear: Vector3::ith(i, 1.0) };
            self.axis_rate[i] = Motion::default();
            let axis = Motion { angular: rot.column(i).into_owned(), linear: Vector3::zeros() };
            self.axis[3 + i] = axis;
            self.axis_rate[3 + i] = velocity.cross(&axis);
        }
        self.velocity[0] = velocity;
        // d/dt of (ω, ṗ) at a fixed point is (0, -ω × ṗ): the point of the body there moves on.
        self.bias_acceleration[0] = Motion { angular: Vector3::zeros(), linear: linear.cross(&omega) };
    }

    /// Centre of mass of the whole character, world axes, m.
    pub fn com(&self, model: &CharacterModel) -> Vector3<f64> {
        let weighted: Vector3<f64> =
            (0..BODIES).map(|i| model.bodies[i].mass * self.com_offset[i]).sum::<Vector3<f64>>();
        self.origin + weighted / model.mass()
    }

    /// Centre of contact sphere `point`, world axes, m.
    pub fn contact_position(&self, model: &CharacterModel, point: usize) -> Vector3<f64> {
        self.origin + self.contact_offset(model, point)
    }

    /// Centre of contact sphere `point` relative to `origin`, m.
    pub fn contact_offset(&self, model: &CharacterModel, point: usize) -> Vector3<f64> {
        let contact = &model.contacts[point];
        self.position[contact.body] + self.rot_world_body[contact.body] * contact.position
    }

    /// Position of the vestibular organ relative to `origin`, m.
    pub fn vestibule_offset(&self, model: &CharacterModel) -> Vector3<f64> {
        self.position[model.head] + self.rot_world_body[model.head] * model.vestibule
    }

    /// Velocity-product acceleration of the point at `offset` on `body`, world axes, m/s²: `J̇ q̇` of that point.
    pub fn point_bias_acceleration(&self, body: usize, offset: &Vector3<f64>) -> Vector3<f64> {
        self.point_acceleration(body, &self.bias_acceleration[body], offset)
    }

    /// Acceleration of the point at `offset` on `body` whose spatial acceleration is `acceleration`.
    pub fn point_acceleration(
        &self,
        body: usize,
        acceleration: &Motion,
        offset: &Vector3<f64>,
    ) -> Vector3<f64> {
        let velocity = &self.velocity[body];
        acceleration.at(offset) + velocity.angular.cross(&velocity.at(offset))
    }

    /// Spatial acceleration of `body` for the generalised acceleration `qdd`.
    pub fn body_acceleration(&self, model: &CharacterModel, body: usize, qdd: &GenVec) -> Motion {
        let mut acceleration = self.bias_acceleration[body];
        for &dof in model.body_chain(body) {
            acceleration = acceleration.plus_scaled(qdd[dof], &self.axis[dof]);
        }
        acceleration
    }
}

/// `rot * R(axis, angle)`: the attitude after a hinge has turned by `angle` about `axis` (body axes).
#[inline]
fn turned(rot: &Matrix3<f64>, axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    let (s, c) = libm::sincos(angle);
    // Hinges along a body axis mix two columns only; that is every hinge of the shipped character.
    if axis.x == 1.0 {
        mixed::<1, 2>(rot, s, c)
    } else if axis.y == 1.0 {
        mixed::<2, 0>(rot, s, c)
    } else if axis.z == 1.0 {
        mixed::<0, 1>(rot, s, c)
    } else {
        let k = axis.cross_matrix();
        rot * (Matrix3::identity() + s * k + (1.0 - c) * (k * k))
    }
}

/// `rot` with columns J and K turned into one another by the angle of sine `s` and cosine `c`.
#[inline]
fn mixed<const J: usize, const K: usize>(rot: &Matrix3<f64>, s: f64, c: f64) -> Matrix3<f64> {
    let mut out = *rot;
    for row in 0..3 {
        let (y, z) = (rot[(row, J)], rot[(row, K)]);
        out[(row, J)] = c * y + s * z;
        out[(row, K)] = c * z - s * y;
    }
    out
}
