//! The momentum controller: Eqs. 12-22 of the main paper in the believed frame.

use nalgebra::{SVector, Vector3};

use super::cone::ForceDistribution;
use super::kkt::{self, Targets};
use super::{BalanceController, BalanceSettings, Control, ControlReport, PerceivedBalance};
use crate::character::{CONTACTS, Foot, GenVec, JOINTS, JointVec};
use crate::dynamics::{Dynamics, GroundSurface};

/// The posture to hold or the motion to follow (Eq. 16), and the height that belongs to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Hinge angles, rad.
    pub angles: JointVec,
    /// Hinge rates, rad/s.
    pub rates: JointVec,
    /// Hinge accelerations, rad/s².
    pub accelerations: JointVec,
    /// Height of the centre of mass above the ground, m.
    pub height: f64,
    /// Its rate, m/s.
    pub height_rate: f64,
    /// Its acceleration, m/s².
    pub height_acceleration: f64,
}

impl Reference {
    /// Hold `angles` and the centre of mass at `height`.
    pub fn hold(angles: JointVec, height: f64) -> Self {
        let (rates, accelerations) = (JointVec::zeros(), JointVec::zeros());
        Self { angles, rates, accelerations, height, height_rate: 0.0, height_acceleration: 0.0 }
    }
}

/// Momentum control with static contact, forces inside the friction cones, and a believed gravity.
#[derive(Clone, Debug)]
pub struct MomentumController {
    settings: BalanceSettings,
    reference: Reference,
    distribution: ForceDistribution,
}

impl MomentumController {
    /// A controller that keeps the posture and the centre-of-mass height `body` has now.
    pub fn new<D: Dynamics>(settings: BalanceSettings, body: &D) -> Self {
        let reference = Reference::hold(body.state().joint_angles, body.com().z);
        Self { settings, reference, distribution: ForceDistribution::default() }
    }

    /// Changes the posture or motion to follow.
    pub fn follow(&mut self, reference: Reference) {
        self.reference = reference;
    }

    /// The posture or motion that is followed.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// Desired momentum rates: Eqs. 19 to 21 in the believed frame.
    ///
    /// Departures from the paper, all from `spec/balance.md`: the vertical row is a height PD around the
    /// reference posture's height; the desired centre of
    /// pressure is the support's centroid itself; velocities are inertial, so the reference moves with the ground.
    fn momentum_rates(
        &self,
        ground: &GroundSurface,
        perceived: &PerceivedBalance,
        mass: f64,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let s = &self.settings;
        let centroid = perceived.support.centroid_world;
        let (com, velocity) = (perceived.com_world, perceived.com_velocity_world);
        let reference_velocity = ground.velocity_at(&centroid);
        let mut acceleration = s.com_stiffness * (centroid - perceived.com_projected_world)
            + s.com_damping * (reference_velocity - velocity);
        let reference = &self.reference;
        acceleration.z = s.height_stiffness * (reference.height - com.z)
            + s.height_damping * (reference.height_rate - velocity.z)
            + reference.height_acceleration;
        let linear = mass * acceleration;
        let angular = (centroid - com).cross(&(linear - mass * perceived.gravity_world));
        (linear, angular)
    }

    /// Accelerations that keep each foot on the ground it stands on.
    fn foot_targets<D: Dynamics>(
        &self,
        body: &D,
        ground: &GroundSurface,
    ) -> [(Vector3<f64>, Vector3<f64>); 2] {
        let (model, kinematics) = (body.model(), body.kinematics());
        Foot::BOTH.map(|foot| {
            let index = model.feet[foot as usize];
            let offset = kinematics.position[index];
            let world = kinematics.origin + offset;
            let velocity = &kinematics.velocity[index];
            let gain = self.settings.support_damping;
            let angular = ground.angular_acceleration - gain * (velocity.angular - ground.angular_velocity);
            let slip = velocity.at(&offset) - ground.velocity_at(&world);
            (angular, ground.acceleration_at(&world) - gain * slip)
        })
    }

    fn posture_target<D: Dynamics>(&self, body: &D) -> JointVec {
        let state = body.state();
        let rates = state.velocity.fixed_rows::<JOINTS>(6);
        let s = &self.settings;
        self.reference.accelerations
            + s.posture_stiffness * (self.reference.angles - state.joint_angles)
            + s.posture_damping * (self.reference.rates - rates)
    }

    /// Torques for the accelerations `qdd` in a world with the believed gravity (Eq. 22): the root rows become ground
    /// forces inside the friction cones, the hinge rows become torques.
    fn torques<D: Dynamics>(
        &mut self,
        body: &D,
        ground: &GroundSurface,
        gravity: &Vector3<f64>,
        qdd: &GenVec,
    ) -> Control {
        let (model, kinematics) = (body.model(), body.kinematics());
        let tau = body.inverse_dynamics(qdd, gravity);
        let moment = kinematics.rot_world_body[0] * tau.fixed_rows::<3>(3);
        let wrench = SVector::<f64, 6>::new(tau[0], tau[1], tau[2], moment.x, moment.y, moment.z);
        let points: [Vector3<f64>; CONTACTS] = std::array::from_fn(|i| {
            kinematics.contact_offset(model, i) - model.contacts[i].radius * ground.normal
        });
        let s = &self.settings;
        let support =
            self.distribution.share(&points, &ground.normal, &wrench, s.friction, s.least_point_force);

        let mut torques = JointVec::from_fn(|j, _| tau[6 + j]);
        for foot in Foot::BOTH {
            let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
            for i in (0..CONTACTS).filter(|i| Foot::of_contact(*i) == foot) {
                force += support.force[i];
                moment += points[i].cross(&support.force[i]);
            }
            for &dof in model.body_chain(model.feet[foot as usize]).iter().filter(|dof| **dof >= 6) {
                let axis = &kinematics.axis[dof];
                torques[dof - 6] -= axis.angular.dot(&moment) + axis.linear.dot(&force);
            }
        }
        let limit = s.torque_limit;
        let saturated_joints = torques.as_slice().iter().filter(|t| t.abs() > limit).count().min(255) as u8;
        torques.as_mut_slice().iter_mut().for_each(|t| *t = t.clamp(-limit, limit));
        let report = ControlReport { constraint_residual: support.unsupplied.norm(), saturated_joints };
        Control { torques, report }
    }
}

impl<D: Dynamics> BalanceController<D> for MomentumController {
    fn control(&mut self, body: &D, ground: &GroundSurface, perceived: &PerceivedBalance) -> Control {
        let mass = body.inertias().composite[0].mass;
        let (linear_rate, angular_rate) = self.momentum_rates(ground, perceived, mass);
        let targets = Targets {
            linear_rate,
            angular_rate,
            joints: self.posture_target(body),
            feet: self.foot_targets(body, ground),
        };
        let qdd = kkt::solve(body, &targets, &self.settings);
        self.torques(body, ground, &perceived.gravity_world, &qdd)
    }

    fn reset(&mut self, body: &D) {
        let height = body.com().z;
        self.reference = Reference { height, height_rate: 0.0, height_acceleration: 0.0, ..self.reference };
        self.distribution = ForceDistribution::default();
    }
}
