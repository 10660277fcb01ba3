//! What the sensor shows at rest: gyro bias and noise, gravity.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::{Direction, Study, in_degrees};
use crate::imu::points_down;
use crate::survey::{Estimate, Mean, Span, VectorEstimate, angle_between};
use crate::units::DEG_PER_RAD;

/// The gyroscope at rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct GyroAtRest {
    /// Mean over all rests, rad/s.
    mean: Vector3<f64>,
    /// Covariance of the mean.
    covariance: Matrix3<f64>,
    /// Variance that the noise gives the integral of the rate, rad²/s: that of the mean of a rest times its length, so
    /// that noise whose neighbours are alike counts for what it is.
    pub(super) walk: Matrix3<f64>,
    /// One-sided amplitude density, rad/s/√Hz.
    pub(super) noise_density: VectorEstimate,
}

impl GyroAtRest {
    /// The bias with its errors.
    pub(super) fn bias(&self) -> VectorEstimate {
        VectorEstimate::new(&self.mean, &self.covariance)
    }
}

/// What the accelerometer reads at rest next to the spin.
#[derive(Clone, Copy, Debug)]
pub(super) struct ForceAtRest {
    /// Mean, m/s², imu frame.
    pub(super) mean: Mean,
}

/// What the accelerometer reads at rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gravity {
    /// Mean specific force, m/s², imu frame.
    pub specific_force_m_s2: VectorEstimate,
    /// Its norm, m/s².
    pub norm_m_s2: Estimate,
    /// Gravity over the norm: the factor on the specific force. One pose cannot tell scale from offset.
    pub scale: Estimate,
    /// Angle of the specific force to the nearer end of the sensor's z axis, degrees.
    pub tilt_from_sensor_z_deg: Estimate,
}

impl ForceAtRest {
    /// Its direction: up, as far as the accelerometer has no offset.
    pub(super) fn direction(&self) -> Option<Direction> {
        let norm = self.mean.mean.norm();
        let up = self.mean.mean.try_normalize(1e-9)?;
        let across = Matrix3::identity() - up * up.transpose();
        Some(Direction { direction: up, covariance: across * self.mean.covariance * across / (norm * norm) })
    }

    /// What a run should be told about a sensor that lies upside down.
    pub(super) fn downwards(&self) -> Option<String> {
        let tilt = angle_between(&self.mean.mean, &Vector3::z()) * DEG_PER_RAD;
        (tilt > 90.0).then(|| points_down(tilt))
    }

    pub(super) fn finding(&self, gravity: f64) -> Gravity {
        let Mean { mean, covariance, .. } = &self.mean;
        let norm = mean.norm();
        let up = mean / norm;
        let sigma = (up.transpose() * covariance * up)[(0, 0)].max(0.0).sqrt();
        Gravity {
            specific_force_m_s2: self.mean.estimate(),
            norm_m_s2: Estimate { value: norm, sigma },
            scale: Estimate { value: gravity / norm, sigma: gravity * sigma / (norm * norm) },
            tilt_from_sensor_z_deg: tilt_from_z(&up, &(covariance / (norm * norm))),
        }
    }
}

/// Angle of a direction to the nearer end of z, degrees.
pub(super) fn tilt_from_z(direction: &Vector3<f64>, covariance: &Matrix3<f64>) -> Estimate {
    let z = Vector3::z() * if direction.z < 0.0 { -1.0 } else { 1.0 };
    angle_to(direction, covariance, &z)
}

/// Angle between an uncertain direction and a given one, degrees. The error counts along the way between both.
pub(super) fn angle_to(direction: &Vector3<f64>, covariance: &Matrix3<f64>, to: &Vector3<f64>) -> Estimate {
    let variance = match (to - direction * to.dot(direction)).try_normalize(1e-9) {
        Some(way) => (way.transpose() * covariance * way)[(0, 0)],
        None => covariance.trace() / 2.0,
    };
    in_degrees(angle_between(direction, to), variance)
}

impl Study<'_> {
    /// Bias and noise of the gyroscope from all rests.
    pub(super) fn gyro_at_rest(&mut self, rate_hz: f64) -> Option<GyroAtRest> {
        let rests: Vec<(Span, Mean)> = self
            .segments
            .rests
            .iter()
            .filter_map(|rest| Some((*rest, Mean::of(&rest.omegas(self.samples))?)))
            .collect();
        if rests.is_empty() {
            self.refuse(
                "gyro bias",
                "there is no rest: nowhere do rate and specific force stay still for 0.75 s",
                "let the sensor rest for 3 s before and after the movements; --rest-rate-max-deg-s is the largest bias",
                true,
            );
            return None;
        }
        let total: usize = rests.iter().map(|(_, mean)| mean.count).sum();
        let share = |mean: &Mean| mean.count as f64 / total as f64;
        let mean: Vector3<f64> = rests.iter().map(|(_, rest)| rest.mean * share(rest)).sum();
        let inner: Matrix3<f64> = rests.iter().map(|(_, r)| r.covariance * (share(r) * share(r))).sum();
        // A bias that drifts from rest to rest by more than its errors is known as well as it stays the same.
        let drift = Vector3::from_fn(|i, _| {
            let (count, squares) = (rests.len() as f64, |d: f64| d * d);
            let excess = rests.iter().map(|(_, r)| squares(r.mean[i] - mean[i]) - r.covariance[(i, i)]);
            excess.sum::<f64>().max(0.0) / ((count - 1.0).max(1.0) * count)
        });
        let walk: Matrix3<f64> =
            rests.iter().map(|(span, r)| r.covariance * (share(r) * span.duration_s(self.samples))).sum();
        let squares: Vec<Vector3<f64>> = rests
            .iter()
            .flat_map(|(span, rest)| {
                span.of(self.samples).iter().map(move |sample| {
                    let deviation = sample.omega_imu - rest.mean;
                    deviation.component_mul(&deviation)
                })
            })
            .collect();
        let variance = Mean::of(&squares)?;
        let density = (2.0 / rate_hz.max(1e-9)).sqrt();
        let std = variance.mean.map(|v| v.max(0.0).sqrt());
        let std_sigma = Vector3::from_fn(|i, _| {
            let sigma = variance.covariance[(i, i)].max(0.0).sqrt();
            if std[i] > 0.0 { sigma / (2.0 * std[i]) } else { 0.0 }
        });
        Some(GyroAtRest {
            mean,
            covariance: inner + Matrix3::from_diagonal(&drift),
            walk,
            noise_density: VectorEstimate { value: std.into(), sigma: std_sigma.into() }.scaled(density),
        })
    }

    /// Specific force in the rests next to the longest spin, or else in the first rest.
    pub(super) fn gravity(&mut self) -> Option<ForceAtRest> {
        let rests: Vec<Span> = match self.segments.longest_spin() {
            Some(spin) => self.segments.rests_around(spin).collect(),
            None => self.segments.rests.first().copied().into_iter().collect(),
        };
        let forces: Vec<Vector3<f64>> =
            rests.iter().flat_map(|rest| rest.specific_forces(self.samples)).collect();
        let mean = Mean::of(&forces).filter(|mean| mean.mean.norm() > 1e-9);
        if mean.is_none() && self.samples.iter().all(|sample| sample.specific_force_imu.is_none()) {
            self.refuse(
                "gravity",
                "there is no accelerometer: neither up nor the factor on the specific force can be found",
                "use a log that holds the specific force as well",
                true,
            );
        } else if mean.is_none() && !self.segments.rests.is_empty() {
            self.refuse(
                "gravity",
                "there is no rest next to the spin: what the accelerometer reads there cannot be told from motion",
                "let the chair rest for 3 s before and after the spin",
                true,
            );
        }
        Some(ForceAtRest { mean: mean? })
    }
}
