//! What the head feels to what the brain believes: observers of spatial orientation.
//!
//! Head frame: x forward, y left, z up. Gravity vectors point down: upright rest is `(0, 0, -|g|)`. The model is
//! covariant under every proper rotation of its axes, and silently wrong in mirrored ones.
//!
//! Sources: "the paper" is *Motion Sickness Simulation Based on Sensorimotor Control*, Eqs. 1-10; its model is
//! Newman's (2009), which descends from Merfeld & Zupan (2002).
//!
//! | file            | content                                                              |
//! |-----------------|----------------------------------------------------------------------|
//! | `canal`         | semicircular canals, Eq. 8, and the closed canal loop, Eqs. 7, 9, 10 |
//! | `otolith`       | gravito-inertial rotation error, Eq. 2, closed otolith loop, Eqs. 3-6 |
//! | `newman`        | the observer: state, derivative, integration                         |
//! | `parameters`    | its gains and time constants, checked                                |
//! | `presets`       | published parameter sets by name                                     |
//! | `ideal`         | the observer that is never wrong                                     |
//! | `gravity`       | gravity carried along by a turning head; angle between directions    |
//! | `perceive`      | rows of head motion to rows of percepts                              |

mod canal;
mod gravity;
mod ideal;
mod newman;
mod otolith;
mod parameters;
mod perceive;
mod presets;

use nalgebra::Vector3;

pub use canal::{CanalState, omega_prime};
pub use gravity::{angle_between, carry_gravity};
pub use ideal::IdealObserver;
pub use newman::NewmanObserver;
pub use otolith::{accel_believed, gif_expected, gif_rotation_error};
pub use parameters::{ObserverParameters, ParameterError};
pub use perceive::{HeadMotionRow, Perceiver, PerceptRow};
pub use presets::{DEFAULT_PRESET, PRESET_NAMES};

/// Motion of the head as the inner ear's organs are driven by it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadMotion {
    /// Angular velocity, rad/s, head frame.
    pub omega_head: Vector3<f64>,
    /// Gravito-inertial force g - a (Eq. 4), m/s², head frame: minus what an accelerometer reads.
    pub gif_head: Vector3<f64>,
}

impl HeadMotion {
    /// The motion a fraction `at` (0: `self`, 1: `later`) of the way to `later`, linear in between.
    pub fn interpolated(&self, later: &HeadMotion, at: f64) -> HeadMotion {
        HeadMotion {
            omega_head: self.omega_head.lerp(&later.omega_head, at),
            gif_head: self.gif_head.lerp(&later.gif_head, at),
        }
    }

    /// Whether every component is a finite number.
    pub fn is_finite(&self) -> bool {
        self.omega_head.iter().chain(self.gif_head.iter()).all(|component| component.is_finite())
    }
}

/// What an observer believes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perception {
    /// Believed gravity, m/s², head frame, pointing down.
    pub gravity_head: Vector3<f64>,
    /// Believed angular velocity, rad/s, head frame.
    pub omega_head: Vector3<f64>,
    /// Believed linear acceleration, m/s², head frame.
    pub accel_head: Vector3<f64>,
}

/// An observer of spatial orientation.
///
/// Inputs must be finite: a device's nonsense is counted and held back before it gets here.
pub trait OrientationObserver: Send {
    /// Starts again at rest or in steady rotation: believed gravity is `gravity_head`, the canals are adapted to
    /// `motion.omega_head`, and `motion` is the input at time zero.
    fn reset(&mut self, gravity_head: Vector3<f64>, motion: &HeadMotion);
    /// Advances by `dt_s` to the input `motion`; between the previous input and this one the input is linear in time.
    ///
    /// `dt_s = 0` is a jump of the input: time stands still and only the input changes.
    fn step(&mut self, motion: &HeadMotion, dt_s: f64) -> Perception;
    /// What is believed now.
    fn perception(&self) -> Perception;
}
