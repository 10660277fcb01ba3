//! A stretch of raw IMU samples and what moves in it: rests, spins, rockings, plateaus, means with their errors.
//!
//! Everything is in the sensor's own axes: neither calibrated nor mounted. [`crate::calibrate`] takes the sensor's
//! constants from it, [`crate::chair`] what the chair did.

use nalgebra::Vector3;

mod force;
mod mean;
mod plateau;
mod segments;
mod turning;

pub use force::{Scales, TurningForce};
pub use mean::{Estimate, Mean, VectorEstimate, coverage_factor};
pub use plateau::Plateau;
pub use segments::{Movement, MovementKind, Segments, Span};
pub use turning::{Bias, TRUSTED_GAP_S, Turning};

/// Most samples that are held: about half an hour at 1 kHz, 130 MB.
pub const MAX_SAMPLES: usize = 2_000_000;

/// One reading of the sensor on the host's time, raw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// When, s from any origin; later than the sample before.
    pub time_s: f64,
    /// Angular velocity as read, rad/s, imu frame.
    pub omega_imu: Vector3<f64>,
    /// Specific force as read, m/s², imu frame; `None` without an accelerometer.
    pub specific_force_imu: Option<Vector3<f64>>,
    /// An axis stood at the end of its range.
    pub clipped: bool,
}

/// Rates and pauses of a stretch of samples.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Sampling {
    /// Samples.
    pub samples: usize,
    /// From the first to the last, s.
    pub duration_s: f64,
    /// Samples per second by the median interval, Hz.
    pub rate_hz: f64,
    /// Longest interval, s.
    pub longest_gap_s: f64,
    /// Samples with an axis at the end of its range.
    pub clipped: usize,
    /// Samples without an accelerometer value.
    pub without_specific_force: usize,
}

impl Sampling {
    /// Measures `samples`; all zero for fewer than two.
    pub fn of(samples: &[Sample]) -> Self {
        let mut steps_s: Vec<f64> = samples.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect();
        let duration_s = steps_s.iter().sum();
        let longest_gap_s = steps_s.iter().copied().fold(0.0, f64::max);
        let median_s = median(&mut steps_s);
        Self {
            samples: samples.len(),
            duration_s,
            rate_hz: if median_s > 0.0 { 1.0 / median_s } else { 0.0 },
            longest_gap_s,
            clipped: samples.iter().filter(|sample| sample.clipped).count(),
            without_specific_force: samples
                .iter()
                .filter(|sample| sample.specific_force_imu.is_none())
                .count(),
        }
    }
}

/// The middle one of `values` once sorted (the upper one of two); zero for none.
pub fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Angle between two directions, rad, 0 to pi; zero if one of them has no length.
pub fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::atan2(a.cross(b).norm(), a.dot(b))
}

/// Angle between a direction and an axis whose sense does not count, rad, 0 to a quarter turn.
pub fn angle_to_line(direction: &Vector3<f64>, line: &Vector3<f64>) -> f64 {
    let angle = angle_between(direction, line);
    angle.min(core::f64::consts::PI - angle)
}

#[cfg(test)]
mod tests;
