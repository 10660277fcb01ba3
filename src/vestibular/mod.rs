//! What the head feels to what the brain believes: observers of spatial orientation.
//!
//! Head frame: x forward, y left, z up. Gravity vectors point down: upright rest is `(0, 0, -|g|)`.

use nalgebra::Vector3;

/// Motion of the head as the inner ear's organs are driven by it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadMotion {
    /// Angular velocity, rad/s, head frame.
    pub omega_head: Vector3<f64>,
    /// Gravito-inertial force g - a (Eq. 4), m/s², head frame: minus what an accelerometer reads.
    pub gif_head: Vector3<f64>,
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
pub trait OrientationObserver: Send {
    /// Starts again at rest or in steady rotation: believed gravity is `gravity_head`, the canals are adapted to
    /// `motion.omega_head`, and `motion` is the input at time zero.
    fn reset(&mut self, gravity_head: Vector3<f64>, motion: &HeadMotion);
    /// Advances by `dt_s` to the input `motion`; between the previous input and this one the input is linear in time.
    fn step(&mut self, motion: &HeadMotion, dt_s: f64) -> Perception;
    /// What is believed now.
    fn perception(&self) -> Perception;
}
