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
use crate::motion::Player;
use crate::tick::{CharacterOutput, PlatformMotion, Posture};
use crate::time::TICK_S;
use crate::vestibular::{NewmanObserver, OrientationObserver};

/// Height of the centre of mass at which a fallen body rests, m. Only the feet can touch the ground.
const RESTING_HEIGHT: f64 = 0.25;

/// Fastest hinge (rad/s) and pelvis (rad/s, m/s) that are believed: a pitcher's shoulder, the fastest human joint, turns
/// with 120 rad/s. Torques at their limit would spin a hand past any number once the feet have lost the ground.
const FASTEST: f64 = 200.0;

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
    player: Option<Player>,
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
            player: None,
            posture: Posture::Standing,
            torques: JointVec::zeros(),
            fallen_s: 0.0,
            observer_started: false,
        }
    }

    /// The same character, whose posture follows `player`. It should stand in the first pose of the motion.
    pub fn moved_by(self, player: Player) -> Self {
        Self { player: Some(player), ..self }
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
        if let Some(player) = &mut self.player {
            player.rewind();
        }
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
        let foot_tilt = self.foot_tilt(&ground);

        let mut report = ControlReport::default();
        let mut motors = MotorSet::limp(self.settings.fall.limp_damping);
        if self.posture == Posture::Standing {
            if let Some(player) = &mut self.player {
                self.controller.follow(player.next_reference(platform.rate));
            }
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
            foot_tilt,
            constraint_residual: report.constraint_residual,
            saturated_joints: report.saturated_joints,
            posture: self.posture,
            state_hash: self.state_hash(),
        }
    }

    /// Steps the body; a step that does not end in finite numbers, or in a motion no body makes, is taken back and
    /// counts as a fall.
    fn advance(&mut self, input: &StepInput) {
        let before = self.engine.snapshot();
        self.torques = self.engine.step(input).joint_torques;
        let state = self.engine.state();
        if !state.is_finite() || state.velocity.amax() > FASTEST {
            self.posture = Posture::Fallen;
            let mut last_good = before;
            last_good.state.velocity.fill(0.0);
            self.engine.restore(&last_good);
        }
    }

    /// The body's constants.
    pub fn model(&self) -> &CharacterModel {
        &self.model
    }

    /// Corners of the support polygon around its centroid in the standing pose, forward and left, m.
    pub fn support_outline(&self) -> Vec<[f64; 2]> {
        let engine = Engine::new(self.model.clone(), self.settings.contact, self.standing);
        let ground = GroundSurface::level(self.model.friction);
        let support = perceive(&engine, &ground, &self.model.gravity).support;
        let centre = support.centroid_world;
        support.corners().iter().map(|corner| [corner.x - centre.x, corner.y - centre.y]).collect()
    }

    /// Configuration and velocity of the body.
    pub fn state(&self) -> &CharacterState {
        self.engine.state()
    }

    /// Whether it has played its motion to the end; false without a motion.
    pub fn has_finished_motion(&self) -> bool {
        self.player.as_ref().is_some_and(Player::has_finished)
    }

    /// How far the posture is from the reference it follows: the largest angle of one hinge, rad.
    ///
    /// The reference is that of the last tick's start, so in a motion this holds the way of one tick, too.
    pub fn posture_error(&self) -> f64 {
        (self.controller.reference().angles - self.state().joint_angles).amax()
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

    /// Largest angle of the z axis of either foot's body against the ground's normal, rad, 0..=π.
    fn foot_tilt(&self, ground: &GroundSurface) -> f64 {
        let rot_world_body = &self.engine.kinematics().rot_world_body;
        let tilts = self.model.feet.map(|foot| {
            let sole_normal: Vector3<f64> = rot_world_body[foot].column(2).into();
            angle_between(&sole_normal, &ground.normal)
        });
        tilts[0].max(tilts[1])
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::character::{DOF, Foot};
    use crate::vestibular::ObserverParameters;

    #[test]
    fn the_z_axis_of_a_foot_is_across_its_contact_points() {
        let model = CharacterModel::standing().unwrap();
        for foot in Foot::BOTH {
            let mut points = (0..model.contacts.len()).filter(|&point| Foot::of_contact(point) == foot);
            let first = model.contacts[points.next().unwrap()];
            assert_eq!(first.body, model.feet[foot as usize]);
            for point in points.map(|point| model.contacts[point]) {
                assert_eq!((point.body, point.radius), (first.body, first.radius));
                assert_eq!(point.position.z, first.position.z);
            }
        }
    }

    #[test]
    fn a_foot_tilts_as_far_as_the_root_rolls_or_its_ankle_turns() {
        let model = Arc::new(CharacterModel::standing().unwrap());
        let settings = Arc::new(CoreSettings::default());
        let observer = NewmanObserver::new(ObserverParameters::default()).unwrap();
        let mut upright = CharacterState::from_qpos(&[0.0; DOF + 1]);
        upright.root_position.z = 1.0;
        let mut figure = Figure::new(Vestibular::Trusted, settings, model.clone(), upright, observer);
        let ground = GroundSurface::turntable(0.7, 0.0, 0.0, model.friction);
        let mut tilt = |state: CharacterState| {
            figure.engine.set_state(state);
            figure.foot_tilt(&ground)
        };
        assert_eq!(tilt(upright), 0.0);
        let turned = |axis, angle| {
            let mut state = upright;
            state.root_attitude = nalgebra::UnitQuaternion::from_axis_angle(&axis, angle);
            state
        };
        assert!((tilt(turned(Vector3::z_axis(), 2.0))).abs() < 1e-12, "yaw is no tilt");
        assert!((tilt(turned(Vector3::x_axis(), -0.1)) - 0.1).abs() < 1e-12);
        let mut toes_up = upright;
        toes_up.joint_angles[model.joint("foot_r_y").unwrap()] = -0.2;
        assert!((tilt(toes_up) - 0.2).abs() < 1e-12, "the other foot is flat");
    }

    #[test]
    fn a_motion_no_body_makes_is_a_fall_and_is_taken_back() {
        let model = Arc::new(CharacterModel::standing().unwrap());
        let settings = Arc::new(CoreSettings::default());
        let standing = crate::dynamics::standing_pose(&model, &settings.pose).unwrap();
        let observer = NewmanObserver::new(ObserverParameters::default()).unwrap();
        let mut figure = Figure::new(Vestibular::Perfect, settings, model.clone(), standing, observer);
        let mut spinning = standing;
        spinning.velocity[6 + model.joint("hand_l_y").unwrap()] = 1e4;
        figure.engine.set_state(spinning);
        let output = figure.step(&PlatformMotion::default(), &ChairResidual::default(), None);
        assert_eq!(output.posture, Posture::Fallen);
        let (end, limit) = (figure.state(), FASTEST);
        assert!(end.is_finite() && end.velocity.amax() < limit, "{}", end.velocity.amax());
    }
}
