//! The pure core: one tick of two characters on one turntable. No clock, no I/O, no lock, no heap.

use std::sync::Arc;

use nalgebra::Vector3;

use super::figure::{Figure, Vestibular};
use crate::balance::{BalanceSettings, FallSettings, SettingsError};
use crate::character::CharacterModel;
use crate::dynamics::{BodyWrench, ContactSettings, PoseError, PoseSettings, standing_pose};
use crate::hil::{ChairResidual, Turntable, TurntableSettings};
use crate::motion::{MotionError, MotionSettings, Player, Trajectory};
use crate::tick::{TickInput, TickOutput};
use crate::time::{TICK_S, Tick};
use crate::vestibular::{HeadMotion, NewmanObserver, ObserverParameters, ParameterError};

/// A push on the thorax.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Push {
    /// When it begins, s.
    pub start_s: f64,
    /// How long it lasts, s.
    pub duration_s: f64,
    /// Force forward (x) and to the left (y), world axes, N.
    pub force: [f64; 2],
}

/// Everything that decides how the core behaves.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CoreSettings {
    /// The vestibular model.
    pub observer: ObserverParameters,
    /// Gains of the balance controller.
    pub balance: BalanceSettings,
    /// When a character has fallen.
    pub fall: FallSettings,
    /// Contact of the feet.
    pub contact: ContactSettings,
    /// The turntable that follows the chair.
    pub turntable: TurntableSettings,
    /// The initial pose.
    pub pose: PoseSettings,
    /// How far the vestibular organ lies from where the model has it, head axes, m. Its lever arm about the spin axis
    /// decides what green feels.
    pub vestibule_shift: [f64; 3],
    /// A push on both characters.
    pub push: Option<Push>,
    /// Stand a fallen character up again after this time, s.
    pub respawn_after_s: Option<f64>,
    /// The motion both characters make, once after each time they were stood up; they stand when absent.
    pub motion: Option<MotionSettings>,
    /// Begin the motion this long after the character was stood up, s; when absent it begins after a spin.
    pub motion_start_s: Option<f64>,
}

/// Settings the core cannot run with.
#[derive(Debug, thiserror::Error)]
pub enum CoreSettingsError {
    /// A gain outside its range.
    #[error(transparent)]
    Balance(#[from] SettingsError),
    /// A pose the model cannot take.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// An observer that cannot run.
    #[error(transparent)]
    Observer(#[from] ParameterError),
    /// A motion that cannot be made.
    #[error("motion: {0}")]
    Motion(#[from] MotionError),
    /// Another number outside its range.
    #[error("key `{key}` is {got}, allowed is {allowed}")]
    Range {
        /// Name of the key.
        key: &'static str,
        /// What was given.
        got: f64,
        /// Allowed range.
        allowed: &'static str,
    },
}

impl CoreSettings {
    /// Checks every number.
    ///
    /// # Errors
    /// The first key outside its range.
    pub fn check(&self) -> Result<(), CoreSettingsError> {
        self.balance.check()?;
        self.motion.as_ref().map_or(Ok(()), MotionSettings::check)?;
        let contact = &self.contact;
        let in_range = [
            ("fall.sway_limit_deg", self.fall.sway_limit_deg, 1.0..=60.0, "1 to 60 deg"),
            ("fall.growing_for_s", self.fall.growing_for_s, 0.0..=10.0, "0 to 10 s"),
            ("fall.least_com_height", self.fall.least_com_height, 0.0..=2.0, "0 to 2 m"),
            ("fall.residual_limit", self.fall.residual_limit, 0.0..=1e6, "0 to 1e6 N"),
            ("fall.residual_for_s", self.fall.residual_for_s, 0.0..=10.0, "0 to 10 s"),
            ("fall.limp_damping", self.fall.limp_damping, 0.1..=1e4, "0.1 to 10000 N m s/rad"),
            ("contact.margin", contact.margin, 1e-5..=0.05, "1e-5 to 0.05 m"),
            ("contact.error_reduction", contact.error_reduction, 0.0..=1.0, "0 to 1"),
            ("contact.push_out_limit", contact.push_out_limit, 0.0..=10.0, "0 to 10 m/s"),
            ("contact.relative_compliance", contact.relative_compliance, 1e-8..=100.0, "1e-8 to 100"),
            ("contact.anchor_gain", contact.anchor_gain, 0.0..=1.0, "0 to 1"),
            ("contact.settled", contact.settled, 0.0..=0.1, "0 to 0.1"),
            ("contact.sweeps", contact.sweeps as f64, 1.0..=1000.0, "1 to 1000"),
            ("turntable.filter_s", self.turntable.filter_s, 0.0..=1.0, "0 to 1 s"),
            (
                "turntable.recovery_acceleration",
                self.turntable.recovery_acceleration,
                0.01..=100.0,
                "0.01 to 100 rad/s2",
            ),
            ("respawn_after_s", self.respawn_after_s.unwrap_or(1.0), 0.0..=3600.0, "0 to 3600 s"),
            ("vestibule_shift[0]", self.vestibule_shift[0], -0.2..=0.2, "-0.2 to 0.2 m"),
            ("vestibule_shift[1]", self.vestibule_shift[1], -0.2..=0.2, "-0.2 to 0.2 m"),
            ("vestibule_shift[2]", self.vestibule_shift[2], -0.2..=0.2, "-0.2 to 0.2 m"),
            ("motion_start_s", self.motion_start_s.unwrap_or(0.0), 0.0..=1e6, "0 to 1e6 s"),
            ("push.start_s", self.push.map_or(0.0, |p| p.start_s), 0.0..=1e6, "0 to 1e6 s"),
            ("push.duration_s", self.push.map_or(0.1, |p| p.duration_s), 1e-3..=10.0, "0.001 to 10 s"),
            ("push.force[0]", self.push.map_or(0.0, |p| p.force[0]), -5000.0..=5000.0, "-5000 to 5000 N"),
            ("push.force[1]", self.push.map_or(0.0, |p| p.force[1]), -5000.0..=5000.0, "-5000 to 5000 N"),
        ];
        for (key, got, range, allowed) in in_range {
            if !range.contains(&got) {
                return Err(CoreSettingsError::Range { key, got, allowed });
            }
        }
        Ok(())
    }
}

/// Yaw rate of the first measurement above which the chair already turns, rad/s. Below it both characters, who have
/// stood at rest so far, just go on standing.
const STARTS_TURNING: f64 = 0.05;
/// Angular rate past which a chair motion is not believed, rad/s: no chair turns 16 times a second.
pub const MAX_CHAIR_RATE: f64 = 100.0;
/// Specific force past which a chair motion is not believed, m/s².
pub const MAX_CHAIR_FORCE: f64 = 1000.0;

fn is_plausible(chair: &HeadMotion) -> bool {
    // Comparisons with NaN are false.
    chair.omega_head.norm() <= MAX_CHAIR_RATE && chair.gif_head.norm() <= MAX_CHAIR_FORCE
}

/// What plays the motion of `settings`, if there is one.
fn player(settings: &CoreSettings, model: &CharacterModel) -> Result<Option<Player>, MotionError> {
    let Some(motion) = &settings.motion else { return Ok(None) };
    let trajectory = Trajectory::new(model, &settings.pose, motion)?;
    trajectory.check_height(settings.fall.least_com_height)?;
    Ok(Some(Player::new(Arc::new(trajectory), settings.motion_start_s)))
}

/// Two characters on one turntable: a pure function of its settings and of every input so far.
#[derive(Clone, Debug)]
pub struct Core {
    settings: Arc<CoreSettings>,
    gravity: Vector3<f64>,
    thorax: usize,
    turntable: Turntable,
    started: bool,
    green: Figure,
    blue: Figure,
}

impl Core {
    /// A core with both characters at rest: standing, or in the first pose of their motion.
    ///
    /// # Errors
    /// Settings out of range, a pose that names hinges the model does not have, or a motion it cannot make.
    pub fn new(settings: CoreSettings, mut model: CharacterModel) -> Result<Self, CoreSettingsError> {
        settings.check()?;
        model.vestibule += Vector3::from(settings.vestibule_shift);
        let standing = standing_pose(&model, &settings.pose)?;
        let player = player(&settings, &model)?;
        let observer = NewmanObserver::new(settings.observer)?;
        let (settings, model) = (Arc::new(settings), Arc::new(model));
        let figure = |vestibular| {
            let (settings, model) = (settings.clone(), model.clone());
            match &player {
                None => Figure::new(vestibular, settings, model, standing, observer),
                Some(player) => Figure::new(vestibular, settings, model, *player.first_pose(), observer)
                    .moved_by(player.clone()),
            }
        };
        Ok(Self {
            gravity: model.gravity,
            thorax: model.thorax,
            turntable: Turntable::turning(settings.turntable, 0.0),
            started: false,
            green: figure(Vestibular::Trusted),
            blue: figure(Vestibular::Perfect),
            settings,
        })
    }

    /// One tick of 1 ms.
    ///
    /// A chair motion that is not finite, or past [`MAX_CHAIR_RATE`] or [`MAX_CHAIR_FORCE`], counts as none.
    pub fn step(&mut self, input: &TickInput) -> TickOutput {
        let chair = input.chair.as_ref().filter(|chair| is_plausible(chair));
        let first = chair.filter(|_| !self.started).map(|chair| chair.omega_head.z);
        self.started |= first.is_some();
        if let Some(rate) = first.filter(|rate| rate.abs() > STARTS_TURNING) {
            // The stream begins while the chair already turns: platform, bodies and canals start with it.
            self.turntable = Turntable::turning(self.settings.turntable, rate);
            self.stand_up();
        } else if input.respawn {
            self.stand_up();
        }
        let measured = chair.map(|chair| chair.omega_head.z);
        let platform = self.turntable.follow(measured, TICK_S);
        let residual = ChairResidual::of(chair, &platform, &self.gravity);
        let push = self.push_at(input.tick);
        let green = self.green.step(&platform, &residual, push.as_ref());
        let blue = self.blue.step(&platform, &residual, push.as_ref());
        self.turntable.advance(&platform, TICK_S);
        TickOutput { tick: input.tick, platform, green, blue }
    }

    /// The character that trusts its vestibular model.
    pub fn green(&self) -> &Figure {
        &self.green
    }

    /// The character that perceives perfectly.
    pub fn blue(&self) -> &Figure {
        &self.blue
    }

    fn stand_up(&mut self) {
        let (angle, rate) = (self.turntable.angle(), self.turntable.rate());
        self.green.stand_up(angle, rate);
        self.blue.stand_up(angle, rate);
    }

    fn push_at(&self, tick: Tick) -> Option<BodyWrench> {
        let push = self.settings.push?;
        let t = tick.time_s();
        (t >= push.start_s && t < push.start_s + push.duration_s).then(|| BodyWrench {
            body: self.thorax,
            force: Vector3::new(push.force[0], push.force[1], 0.0),
            moment: Vector3::zeros(),
        })
    }
}
