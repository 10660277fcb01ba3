//! Bias-corrected rates and their integrals.

use nalgebra::Vector3;

use super::{Sample, Span};

/// After a pause of the data of this length nobody knows what happened in it, s: nothing is integrated over it, it ends a
/// rest, and a movement back and forth with it inside is none that is measured.
pub(super) const PAUSE_S: f64 = 1.0;
/// Longest pause of the data within a movement whose integral is trusted, s.
pub const TRUSTED_GAP_S: f64 = 0.25;

/// The gyro bias over a movement: between two rests it drifts on a straight line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bias {
    /// Time (s) and bias (rad/s) in the rest before, if there is one.
    pub before: Option<(f64, Vector3<f64>)>,
    /// The same in the rest after.
    pub after: Option<(f64, Vector3<f64>)>,
}

impl Bias {
    /// The bias at a time, rad/s, imu frame; zero when there is no rest.
    pub fn at(&self, time_s: f64) -> Vector3<f64> {
        match (self.before, self.after) {
            (Some((start_s, before)), Some((end_s, after))) => {
                let share = ((time_s - start_s) / (end_s - start_s)).clamp(0.0, 1.0);
                before + (after - before) * if share.is_finite() { share } else { 0.0 }
            }
            (Some((_, bias)), None) | (None, Some((_, bias))) => bias,
            (None, None) => Vector3::zeros(),
        }
    }

    /// Whether any rest gave it.
    pub fn is_known(&self) -> bool {
        self.before.is_some() || self.after.is_some()
    }
}

/// The integral of the bias-corrected rate over a stretch of samples, by the trapezoidal rule.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turning {
    /// Integral of the rate, rad, imu frame: the angle turned, as far as the axis stays where it is.
    pub angle: Vector3<f64>,
    /// Integral of the rate's size, rad.
    pub path: f64,
}

impl Turning {
    /// Integrates over `span` and the step from the sample before it; a step of more than 1 s counts for nothing.
    pub fn over(samples: &[Sample], span: Span, bias: &Bias) -> Self {
        let mut turning = Self::default();
        for pair in samples[span.first.saturating_sub(1)..span.end].windows(2) {
            let [from, to] = [&pair[0], &pair[1]].map(|sample| sample.omega_imu - bias.at(sample.time_s));
            let step_s = pair[1].time_s - pair[0].time_s;
            let half_step_s = if step_s <= PAUSE_S { 0.5 * step_s } else { 0.0 };
            turning.angle += (from + to) * half_step_s;
            turning.path += (from.norm() + to.norm()) * half_step_s;
        }
        turning
    }
}
