//! Rigid-body dynamics of the character: our own Featherstone core behind the traits [`Dynamics`] and [`Simulator`].
//!
//! Conventions: world axes x forward, y left, z up; generalised velocity = root linear (world axes), root angular
//! (root axes), hinge rates; spatial vectors in world axes about the root's origin. Nothing here allocates after
//! construction, reads a clock or depends on the order of anything but the model file.

use nalgebra::{SMatrix, Vector2, Vector3};

use crate::character::{CONTACTS, CharacterModel, CharacterState, DOF, GenVec, JointVec};

mod bias;
mod contact;
mod contact_solver;
mod dense;
mod engine;
mod factor;
mod ground;
mod inertia;
mod kinematics;
mod motor;
pub mod spatial;
mod standing_pose;
#[cfg(test)]
mod tests;

pub use bias::VelocityForces;
pub use contact::{ContactMemory, ContactSettings, PointContact};
pub use contact_solver::ContactMethod;
pub(crate) use dense::{add_scaled, cholesky_solve, dot};
pub use engine::Engine;
pub use factor::TreeFactor;
pub use ground::GroundSurface;
pub use inertia::{Inertias, TreeMatrix};
pub use kinematics::Kinematics;
pub use motor::{MAX_MOTOR_ROUNDS, MotorSet};
use spatial::Wrench;
pub use standing_pose::{PoseError, PoseSettings, standing_pose};

/// A 6 x 41 Jacobian: angular rows, then linear rows, world axes.
pub type Jacobian = SMatrix<f64, 6, DOF>;

/// Load below which no centre of pressure is reported, N.
pub const COP_LOAD_LIMIT: f64 = 20.0;

/// What a controller may ask about the body at its present state.
pub trait Dynamics {
    /// The character.
    fn model(&self) -> &CharacterModel;
    /// The present configuration and velocity.
    fn state(&self) -> &CharacterState;
    /// Poses, axes and velocities at the present state.
    fn kinematics(&self) -> &Kinematics;
    /// Inertias, mass matrix and momentum map at the present state.
    fn inertias(&self) -> &Inertias;
    /// Velocity-product forces `C(q, q̇)` (no gravity) and the momentum rate they stand for.
    fn velocity_forces(&self) -> &VelocityForces;

    /// Centre of mass, world axes, m.
    fn com(&self) -> Vector3<f64> {
        self.kinematics().origin + self.inertias().com_offset()
    }

    /// Momentum: linear, and angular about the centre of mass, world axes.
    fn momentum(&self) -> (Vector3<f64>, Vector3<f64>) {
        let com = self.inertias().com_offset();
        let mut total = Wrench::default();
        for dof in 0..DOF {
            let column = &self.inertias().momentum[dof];
            let rate = self.state().velocity[dof];
            total += Wrench { moment: rate * column.moment, force: rate * column.force };
        }
        (total.force, total.moment - com.cross(&total.force))
    }

    /// Jacobian of the point at `offset` (world axes, from the reference point) on `body`.
    fn jacobian(&self, body: usize, offset: &Vector3<f64>) -> Jacobian {
        let mut jacobian = Jacobian::zeros();
        for &dof in self.model().body_chain(body) {
            let axis = &self.kinematics().axis[dof];
            jacobian.fixed_view_mut::<3, 1>(0, dof).copy_from(&axis.angular);
            jacobian.fixed_view_mut::<3, 1>(3, dof).copy_from(&axis.at(offset));
        }
        jacobian
    }

    /// `J̇ q̇` of the point at `offset` on `body`: angular, then linear acceleration at zero generalised acceleration.
    fn jdot_qdot(&self, body: usize, offset: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let kinematics = self.kinematics();
        (kinematics.bias_acceleration[body].angular, kinematics.point_bias_acceleration(body, offset))
    }

    /// `G(q)` for a uniform gravity: minus the first three columns of M times `gravity`.
    fn gravity_forces(&self, gravity: &Vector3<f64>) -> GenVec {
        GenVec::from_fn(|dof, _| -self.inertias().momentum[dof].force.dot(gravity))
    }

    /// `tau = M qdd + C(q, q̇) + G(q)`, no contact.
    fn inverse_dynamics(&self, qdd: &GenVec, gravity: &Vector3<f64>) -> GenVec {
        let (model, kinematics, inertias) = (self.model(), self.kinematics(), self.inertias());
        bias::inverse_dynamics(model, kinematics, inertias, self.velocity_forces(), qdd, gravity)
    }

    /// What a gyroscope and an accelerometer at the vestibular organ read for the acceleration `qdd`, head axes.
    fn head_signals(&self, qdd: &GenVec) -> HeadSignals {
        let (model, kinematics) = (self.model(), self.kinematics());
        let offset = kinematics.vestibule_offset(model);
        let acceleration = kinematics.body_acceleration(model, model.head, qdd);
        let a = kinematics.point_acceleration(model.head, &acceleration, &offset);
        let to_head = kinematics.rot_world_body[model.head].transpose();
        HeadSignals {
            omega_head: to_head * kinematics.velocity[model.head].angular,
            specific_force_head: to_head * (a - model.gravity),
        }
    }

    /// Kinetic and potential energy (zero at the world's origin), J. Rotor inertia of the hinges is included.
    fn energy(&self) -> (f64, f64) {
        let v = &self.state().velocity;
        let kinetic = 0.5 * v.dot(&self.inertias().mass_matrix.times(self.model(), v));
        (kinetic, -self.model().mass() * self.model().gravity.dot(&self.com()))
    }
}

/// A body that can be stepped through time.
pub trait Simulator: Dynamics {
    /// Sets configuration and velocity and forgets the contacts.
    fn set_state(&mut self, state: CharacterState);
    /// Advances by `input.dt_s` and leaves everything of [`Dynamics`] fresh for the new state.
    fn step(&mut self, input: &StepInput) -> &StepReport;
    /// What the last step did.
    fn report(&self) -> &StepReport;
    /// Everything needed to continue from here later.
    fn snapshot(&self) -> Snapshot;
    /// Continues from a snapshot.
    fn restore(&mut self, snapshot: &Snapshot);
}

/// State of a simulation between two steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// Configuration and velocity.
    pub state: CharacterState,
    /// Warm start and anchors of the contacts.
    pub contacts: ContactMemory,
}

/// Inertial signals at the vestibular organ, head axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeadSignals {
    /// Angular velocity, rad/s.
    pub omega_head: Vector3<f64>,
    /// Specific force a - g, m/s².
    pub specific_force_head: Vector3<f64>,
}

/// A force and a moment on one body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyWrench {
    /// Index of the body.
    pub body: usize,
    /// Force at the body's centre of mass, world axes, N.
    pub force: Vector3<f64>,
    /// Moment, world axes, N m.
    pub moment: Vector3<f64>,
}

/// Everything that acts on the body during one step.
#[derive(Clone, Copy, Debug)]
pub struct StepInput {
    /// What the joints are asked to do.
    pub motors: MotorSet,
    /// A push, if any.
    pub wrench: Option<BodyWrench>,
    /// The ground.
    pub ground: GroundSurface,
    /// Length of the step, s.
    pub dt_s: f64,
}

/// What happened in one step.
#[derive(Clone, Copy, Debug)]
pub struct StepReport {
    /// Force and place of each contact point.
    pub contacts: [PointContact; CONTACTS],
    /// Generalised acceleration (v⁺ - v) / h.
    pub qdd: GenVec,
    /// Torques the motors really gave, N m.
    pub joint_torques: JointVec,
    /// How the contacts were solved.
    pub contact_method: ContactMethod,
    /// Rounds of the motors' active set; 0 with plain torques.
    pub motor_rounds: usize,
    /// False when the active set did not settle within [`MAX_MOTOR_ROUNDS`].
    pub motors_settled: bool,
    /// Inertial signals of the vestibular organ: gyroscope at the start, accelerometer during the step.
    pub head: HeadSignals,
}

impl Default for StepReport {
    fn default() -> Self {
        Self {
            contacts: [PointContact::default(); CONTACTS],
            qdd: GenVec::zeros(),
            joint_torques: JointVec::zeros(),
            contact_method: ContactMethod::None,
            motor_rounds: 0,
            motors_settled: true,
            head: HeadSignals::default(),
        }
    }
}

impl StepReport {
    /// Load on the feet along the world's vertical, N.
    pub fn load(&self) -> f64 {
        self.contacts.iter().map(|contact| contact.force.z).sum()
    }

    /// Centre of pressure on level ground, world axes, m; `None` below [`COP_LOAD_LIMIT`].
    pub fn cop(&self) -> Option<Vector2<f64>> {
        let load = self.load();
        let moment: Vector2<f64> = self.contacts.iter().map(|c| c.force.z * c.position.xy()).sum();
        (load > COP_LOAD_LIMIT).then(|| moment / load)
    }
}
