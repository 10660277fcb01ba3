//! The step: free motion, contacts, motors, integration.

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use super::bias::{VelocityForces, velocity_forces};
use super::contact::{ContactMemory, ContactSettings, ContactStage};
use super::contact_solver::ContactMethod;
use super::factor::TreeFactor;
use super::inertia::Inertias;
use super::kinematics::Kinematics;
use super::motor::{MAX_MOTOR_ROUNDS, MotorSolve};
use super::spatial::Wrench;
use super::{BodyWrench, Dynamics, Simulator, Snapshot, StepInput, StepReport};
use crate::character::{CharacterModel, CharacterState, DOF, GenVec};

/// The rigid-body engine: one character, its state and every intermediate result.
#[derive(Clone, Debug)]
pub struct Engine {
    model: Arc<CharacterModel>,
    settings: ContactSettings,
    state: CharacterState,
    memory: ContactMemory,
    work: Box<Workspace>,
    report: StepReport,
}

/// Intermediate results, valid for the present state.
#[derive(Clone, Debug, Default)]
struct Workspace {
    kinematics: Kinematics,
    inertias: Inertias,
    velocity_forces: VelocityForces,
    factor: TreeFactor,
    contacts: ContactStage,
}

impl Engine {
    /// An engine at `state`.
    pub fn new(model: Arc<CharacterModel>, settings: ContactSettings, state: CharacterState) -> Self {
        let work = Box::default();
        let mut engine = Self {
            model,
            settings,
            state,
            memory: ContactMemory::default(),
            work,
            report: StepReport::default(),
        };
        engine.refresh();
        engine
    }

    fn refresh(&mut self) {
        let Workspace { kinematics, inertias, velocity_forces: forces, .. } = &mut *self.work;
        kinematics.update(&self.model, &self.state);
        inertias.update(&self.model, kinematics);
        *forces = velocity_forces(&self.model, kinematics, inertias);
    }

    /// Generalised force of a wrench on one body.
    fn external_force(&self, wrench: &BodyWrench) -> GenVec {
        let kinematics = &self.work.kinematics;
        let arm = kinematics.com_offset[wrench.body];
        let about_reference =
            Wrench { moment: wrench.moment + arm.cross(&wrench.force), force: wrench.force };
        let mut force = GenVec::zeros();
        for &dof in self.model.body_chain(wrench.body) {
            force[dof] = kinematics.axis[dof].dot(&about_reference);
        }
        force
    }

    /// Forces that do not depend on the motors.
    fn passive_forces(&self, input: &StepInput) -> GenVec {
        let mut force = -(self.work.velocity_forces.generalised + self.gravity_forces(&self.model.gravity));
        if let Some(wrench) = &input.wrench {
            force += self.external_force(wrench);
        }
        force
    }

    /// Velocity after the step for the present set of motors, contacts solved.
    fn solve_velocity(&mut self, input: &StepInput, motors: &MotorSolve, passive: &GenVec) -> GenVec {
        let model = &*self.model;
        let Workspace { kinematics, inertias, factor, contacts, .. } = &mut *self.work;
        let addition = (!motors.is_plain(&input.motors)).then(|| motors.diagonal(&input.motors, input.dt_s));
        factor.factor(model, &inertias.mass_matrix, addition.as_ref());

        let mut change = *passive;
        let torque =
            motors.explicit_torque(&input.motors) - motors.start_drag(&input.motors, &self.state.velocity);
        for (j, t) in torque.iter().enumerate() {
            change[6 + j] += t;
        }
        change *= input.dt_s;
        factor.half_solve(model, &mut change);
        for k in 0..DOF {
            change[k] *= factor.inverse_diagonal[k];
        }
        contacts.problem.impulse = self.memory.impulse;
        contacts.assemble(
            model,
            kinematics,
            factor,
            &input.ground,
            &self.settings,
            &self.memory,
            &change,
            input.dt_s,
        );
        self.report.contact_method = contacts.problem.solve(self.settings.sweeps, self.settings.settled);
        if self.report.contact_method != ContactMethod::None {
            contacts.apply(model, factor, &mut change);
        }
        factor.forward_solve(model, &mut change);
        self.state.velocity + change
    }

    fn integrate(&mut self, velocity: &GenVec, dt_s: f64) {
        let state = &mut self.state;
        state.velocity = *velocity;
        state.root_position += dt_s * velocity.fixed_rows::<3>(0);
        let omega = velocity.fixed_rows::<3>(3).into_owned();
        state.root_attitude *= rotation_of(&(dt_s * omega));
        // Products of unit quaternions drift off the sphere by rounding only: renormalising each step keeps them on it.
        state.root_attitude.renormalize();
        state.joint_angles += dt_s * velocity.fixed_rows::<{ crate::character::JOINTS }>(6);
    }
}

/// Unit quaternion of a rotation vector (exponential map).
fn rotation_of(vector: &Vector3<f64>) -> UnitQuaternion<f64> {
    let angle = vector.norm();
    let half_sinc = if angle < 1e-8 { 0.5 } else { libm::sin(0.5 * angle) / angle };
    let v = half_sinc * vector;
    UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(libm::cos(0.5 * angle), v.x, v.y, v.z))
}

impl Dynamics for Engine {
    fn model(&self) -> &CharacterModel {
        &self.model
    }

    fn state(&self) -> &CharacterState {
        &self.state
    }

    fn kinematics(&self) -> &Kinematics {
        &self.work.kinematics
    }

    fn inertias(&self) -> &Inertias {
        &self.work.inertias
    }

    fn velocity_forces(&self) -> &VelocityForces {
        &self.work.velocity_forces
    }
}

impl Simulator for Engine {
    fn set_state(&mut self, state: CharacterState) {
        self.restore(&Snapshot { state, contacts: ContactMemory::default() });
    }

    fn step(&mut self, input: &StepInput) -> &StepReport {
        let passive = self.passive_forces(input);
        let mut motors = MotorSolve::new(&self.model, &self.state, input.dt_s);
        let mut velocity = self.solve_velocity(input, &motors, &passive);
        let mut rounds = 0;
        let mut settled = motors.is_plain(&input.motors) || motors.settle(&input.motors, &velocity);
        while !settled && rounds < MAX_MOTOR_ROUNDS {
            rounds += 1;
            velocity = self.solve_velocity(input, &motors, &passive);
            settled = motors.settle(&input.motors, &velocity);
        }
        self.report.motor_rounds = rounds;
        self.report.motors_settled = settled;
        self.report.joint_torques = motors.realised(&input.motors, &velocity);
        self.report.qdd = (velocity - self.state.velocity) / input.dt_s;
        self.report.head = self.head_signals(&self.report.qdd);
        let work = &self.work;
        self.report.contacts =
            work.contacts.finish(&work.kinematics, &input.ground, &mut self.memory, input.dt_s);
        self.integrate(&velocity, input.dt_s);
        self.refresh();
        &self.report
    }

    fn report(&self) -> &StepReport {
        &self.report
    }

    fn snapshot(&self) -> Snapshot {
        Snapshot { state: self.state, contacts: self.memory }
    }

    fn restore(&mut self, snapshot: &Snapshot) {
        self.state = snapshot.state;
        self.memory = snapshot.contacts;
        self.report = StepReport::default();
        self.refresh();
    }
}
