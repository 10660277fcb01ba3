//! One simulated person: body, inner ear, balance.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use super::core::CoreSettings;
use crate::balance::{BalanceController, Control, ControlReport, FallDetector, MomentumController, perceive};
use crate::character::{CharacterModel, CharacterState, JointVec};
use crate::dynamics::{
    BodyWrench, Dynamics, Engine, GroundSurface, HeadSignals, MotorSet, Simulator, StepInput,
};
use crate::hil::{ChairResidual, compose};
use crate::tick::{CharacterOutput, PlatformMotion, Posture};
use crate::time::TICK_S;
use crate::vestibular::{NewmanObserver, OrientationObserver};

/// Height of the centre of mass at which a fallen body rests, m. Only the feet can touch the ground.
const RESTING_HEIGHT: f64 = 0.25;

/// Whom the balance controller believes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vestibular {
    /// Its vestibular model: the green character.
    Trusted,
    /// The true gravity: the blue character.
    Perfect,
}

/// A character with its observer and its controller: sensors, belief, torques and body of one person.
#[derive(Clone, Debug)]
pub struct Figure {
    vestibular: Vestibular,
    settings: Arc<CoreSettings>,
    model: Arc<CharacterModel>,
    standing: CharacterState,
    engine: Engine,
    observer: NewmanObserver,
    controller: MomentumController,
    detector: FallDetector,
    posture: Posture,
    torques: JointVec,
    fallen_s: f64,
    observer_started: bool,
}

impl Figure {
    /// A character standing at rest in `standing`.
    pub fn new(
        vestibular: Vestibular,
        settings: Arc<CoreSettings>,
        model: Arc<CharacterModel>,
        standing: CharacterState,
        observer: NewmanObserver,
    ) -> Self {
        let engine = Engine::new(model.clone(), settings.contact, standing);
        let controller = MomentumController::new(settings.balance, &engine);
        Self {
            vestibular,
            settings,
            model,
            standing,
            engine,
            observer,
            controller,
            detector: FallDetector::default(),
            posture: Posture::Standing,
            torques: JointVec::zeros(),
            fallen_s: 0.0,
            observer_started: false,
        }
    }

    /// Stands the character up on a platform at `angle` that turns with `rate`; its inner ear starts adapted.
    pub fn stand_up(&mut self, angle: f64, rate: f64) {
        let mut state = self.standing;
        let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
            libm::cos(angle / 2.0),
            0.0,
            0.0,
            libm::sin(angle / 2.0),
        ));
        state.root_position = turn * state.root_position;
        state.root_attitude = turn * state.root_attitude;
        state.set_rigid_rotation(rate);
        self.engine.set_state(state);
        self.controller.reset(&self.engine);
        self.detector = FallDetector::default();
        self.posture = Posture::Standing;
        self.torques = JointVec::zeros();
        self.fallen_s = 0.0;
        self.observer_started = false;
    }

    /// One tick of [`TICK_S`] on the moving platform, with the chair's residual added to what the head senses.
    pub fn step(
        &mut self,
        platform: &PlatformMotion,
        residual: &ChairResidual,
        push: Option<&BodyWrench>,
    ) -> CharacterOutput {
        if self.posture == Posture::Fallen {
            self.fallen_s += TICK_S;
            if self.settings.respawn_after_s.is_some_and(|after| self.fallen_s >= after) {
                self.stand_up(platform.angle, platform.rate);
            }
        }
        let ground = GroundSurface::turntable(
            platform.angle,
            platform.rate,
            platform.acceleration,
            self.model.friction,
        );
        self.sense(&ground, residual);
        let gravity_believed = self.gravity_believed();
        let trusted = match self.vestibular {
            Vestibular::Trusted => gravity_believed,
            Vestibular::Perfect => self.model.gravity,
        };
        let perceived = perceive(&self.engine, &ground, &trusted);
        let centroid = perceived.support.centroid_world;
        let com = perceived.com_world - centroid;
        let sway = libm::atan2(libm::hypot(com.x, com.y), com.z);

        let mut report = ControlReport::default();
        let mut motors = MotorSet::limp(self.settings.fall.limp_damping);
        if self.posture == Posture::Standing {
            let control: Control = self.controller.control(&self.engine, &ground, &perceived);
            report = control.report;
            let residual = report.constraint_residual;
            if self.detector.fallen(&self.settings.fall, sway, perceived.com_world.z, residual, TICK_S) {
                self.posture = Posture::Fallen;
            } else {
                motors = MotorSet::torques(control.torques, self.settings.balance.torque_limit);
            }
        }
        let moves = self.posture == Posture::Standing || perceived.com_world.z > RESTING_HEIGHT;
        if moves {
            self.advance(&StepInput { motors, wrench: push.copied(), ground, dt_s: TICK_S });
        }
        let to_platform = ground.rot_world_surface.transpose();
        let cop = if moves { self.engine.report().cop() } else { None };
        CharacterOutput {
            perception: self.observer.perception(),
            gravity_platform: to_platform * gravity_believed,
            gravity_tilt: angle_between(&gravity_believed, &self.model.gravity),
            com_platform: to_platform * com,
            com_sway: sway,
            cop_platform: cop
                .map(|cop| (to_platform * Vector3::new(cop.x - centroid.x, cop.y - centroid.y, 0.0)).xy()),
            constraint_residual: report.constraint_residual,
            saturated_joints: report.saturated_joints,
            posture: self.posture,
            state_hash: self.state_hash(),
        }
    }

    /// Steps the body; a step that does not end in finite numbers is taken back and counts as a fall.
    fn advance(&mut self, input: &StepInput) {
        let before = self.engine.snapshot();
        self.torques = self.engine.step(input).joint_torques;
        if !self.engine.state().is_finite() {
            self.posture = Posture::Fallen;
            let mut last_good = before;
            last_good.state.velocity.fill(0.0);
            self.engine.restore(&last_good);
        }
    }

    /// Configuration and velocity of the body.
    pub fn state(&self) -> &CharacterState {
        self.engine.state()
    }

    /// Gives the observer this tick's head motion.
    fn sense(&mut self, ground: &GroundSurface, residual: &ChairResidual) {
        let rot_world_head = self.rot_world_head();
        let kinematics = self.engine.kinematics();
        let omega_head = rot_world_head.transpose() * kinematics.velocity[self.model.head].angular;
        let resting = HeadSignals {
            omega_head,
            specific_force_head: -(rot_world_head.transpose() * self.model.gravity),
        };
        if !self.observer_started {
            // Before the first step there is no acceleration yet.
            let motion = compose(&resting, residual, &rot_world_head, &ground.rot_world_surface);
            self.observer.reset(-resting.specific_force_head, &motion);
            self.observer_started = true;
            return;
        }
        // The accelerometer's value belongs to the step just taken, the gyroscope's to its end.
        let head = HeadSignals { omega_head, ..self.engine.report().head };
        let motion = compose(&head, residual, &rot_world_head, &ground.rot_world_surface);
        self.observer.step(&motion, TICK_S);
    }

    fn rot_world_head(&self) -> Matrix3<f64> {
        self.engine.kinematics().rot_world_body[self.model.head]
    }

    /// Believed gravity in world axes.
    fn gravity_believed(&self) -> Vector3<f64> {
        self.rot_world_head() * self.observer.perception().gravity_head
    }

    fn state_hash(&self) -> u64 {
        let state = self.engine.state();
        let numbers = state.qpos();
        let parts = [&numbers[..], state.velocity.as_slice(), self.torques.as_slice()];
        let mix = |hash: u64, number: &f64| (hash ^ number.to_bits()).wrapping_mul(FNV_PRIME);
        parts.into_iter().fold(FNV_OFFSET, |hash, part| part.iter().fold(hash, mix))
    }
}

const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0100_0000_01b3;

/// Angle between two vectors, rad, accurate near 0 and π; 0 when either is zero.
fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::atan2(a.cross(b).norm(), a.dot(b))
}
