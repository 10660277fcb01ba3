//! Configuration and velocity of a character: all there is to save.

use nalgebra::{UnitQuaternion, Vector3};

use super::{DOF, GenVec, JointVec, attitude_wxyz};

/// Configuration and velocity. A copy is a snapshot; assigning it back restores.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CharacterState {
    /// Origin of the root body, world axes, m.
    pub root_position: Vector3<f64>,
    /// Attitude of the root body, body to world.
    pub root_attitude: UnitQuaternion<f64>,
    /// Hinge angles, rad.
    pub joint_angles: JointVec,
    /// Generalised velocity: root linear in world axes, root angular in root axes, hinge rates.
    pub velocity: GenVec,
}

impl CharacterState {
    /// State from 42 configuration numbers (position, quaternion w x y z, hinge angles) at rest.
    pub fn from_qpos(qpos: &[f64; DOF + 1]) -> Self {
        Self {
            root_position: Vector3::new(qpos[0], qpos[1], qpos[2]),
            root_attitude: attitude_wxyz(qpos[3], qpos[4], qpos[5], qpos[6]),
            joint_angles: JointVec::from_column_slice(&qpos[7..]),
            velocity: GenVec::zeros(),
        }
    }

    /// The 42 configuration numbers: position, quaternion w x y z, hinge angles.
    pub fn qpos(&self) -> [f64; DOF + 1] {
        let mut qpos = [0.0; DOF + 1];
        qpos[..3].copy_from_slice(self.root_position.as_slice());
        let q = self.root_attitude.quaternion();
        qpos[3..7].copy_from_slice(&[q.w, q.i, q.j, q.k]);
        qpos[7..].copy_from_slice(self.joint_angles.as_slice());
        qpos
    }

    /// True when every number is finite.
    pub fn is_finite(&self) -> bool {
        let finite = |numbers: &[f64]| numbers.iter().all(|value| value.is_finite());
        finite(&self.qpos()) && finite(self.velocity.as_slice())
    }

    /// Gives the character the velocity of a rigid body turning at `rate` rad/s about the world's vertical axis.
    pub fn set_rigid_rotation(&mut self, rate: f64) {
        let omega_world = Vector3::new(0.0, 0.0, rate);
        let linear = omega_world.cross(&self.root_position);
        let angular = self.root_attitude.inverse_transform_vector(&omega_world);
        self.velocity = GenVec::zeros();
        self.velocity.fixed_rows_mut::<3>(0).copy_from(&linear);
        self.velocity.fixed_rows_mut::<3>(3).copy_from(&angular);
    }
}
