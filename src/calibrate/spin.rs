//! What a spin of the chair tells: its axis, and with a counted turn the factor on the rate.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::mounting::ForceInSpin;
use super::rest::{ForceAtRest, GyroAtRest, angle_to, tilt_from_z};
use super::{Direction, Study, Up};
use crate::survey::{Estimate, Mean, Movement, Plateau, Scales, TRUSTED_GAP_S, TurningForce};
use crate::units::DEG_PER_RAD;

/// Share of the fast rate (its 90th percentile) from which a sample counts for the axis.
const FAST_SHARE: f64 = 0.5;
/// Factors on the rate that are believed; beyond them the turns were miscounted.
const SCALE_LIMITS: (f64, f64) = (0.8, 1.25);
/// Standard uncertainty of a factor on the rate that nobody measured: data sheets of consumer sensors allow 1 to 3 %.
const UNKNOWN_SCALE_SIGMA: f64 = 0.02;
/// Offset of an accelerometer along gravity that nobody can tell from its scale, m/s²: 10 mg, a usual one.
const HIDDEN_OFFSET_M_S2: f64 = 0.1;

/// The axis of the longest spin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SpinAxis {
    /// Axis, unit, imu frame: pointing up where there is an accelerometer, else along the rotation.
    pub axis_imu: [f64; 3],
    /// Standard uncertainty of its direction, per direction across it, degrees.
    pub sigma_deg: f64,
    /// Mean rate of the fast part about the axis, deg/s: positive is to the left.
    pub rate_deg_s: f64,
    /// Angle turned about the axis, bias removed, deg.
    pub turned_deg: f64,
    /// Angle of the axis to the nearer end of the sensor's z axis, degrees.
    pub tilt_from_sensor_z_deg: Estimate,
    /// Angle of the axis to the specific force at rest, degrees: the lean of the axis plus the accelerometer's offset.
    pub tilt_from_gravity_deg: Option<Estimate>,
}

/// Factor on the bias-corrected rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GyroScale {
    /// Counted angle over measured angle. Measured about the axis of the spin, taken for all axes.
    pub scale: Estimate,
    /// Angle counted, degrees.
    pub counted_deg: f64,
    /// Angle measured, degrees.
    pub measured_deg: Estimate,
}

/// The longest spin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spin<'a> {
    movement: &'a Movement,
    plateau: Option<Plateau>,
    pub(super) axis: Direction,
    pub(super) finding: SpinAxis,
}

impl<'a> Study<'a> {
    /// Axis of the longest spin.
    ///
    /// The mean rate of the fast part has the axis' direction; scatter across it, the error of the bias and the rate give
    /// the error.
    pub(super) fn spin(&mut self, gravity: Option<&ForceAtRest>) -> Option<Spin<'a>> {
        let Some(movement) = self.segments.longest_spin() else {
            self.refuse(
                "spin axis",
                "there is no spin: nowhere does the sensor turn by 90 deg or more in one direction",
                "turn the chair by at least one whole turn between two rests, or take up from --up gravity",
                self.settings.up == Up::Spin,
            );
            return None;
        };
        if !movement.bias.is_known() {
            return None;
        }
        let along = movement.turning.angle.normalize();
        let rates: Vec<Vector3<f64>> = movement
            .span
            .of(self.samples)
            .iter()
            .map(|sample| sample.omega_imu - movement.bias.at(sample.time_s))
            .collect();
        let mut sorted: Vec<f64> = rates.iter().map(|rate| rate.dot(&along)).collect();
        sorted.sort_by(f64::total_cmp);
        let fast_rate = FAST_SHARE * sorted[sorted.len() * 9 / 10];
        let fast: Vec<Vector3<f64>> =
            rates.into_iter().filter(|rate| rate.dot(&along) >= fast_rate).collect();
        let mean = Mean::of_one_direction(&fast)?;
        let rate = mean.mean.norm();
        let up = gravity.map(|gravity| gravity.mean.mean);
        let sense = if up.is_some_and(|up| up.dot(&mean.mean) < 0.0) { -1.0 } else { 1.0 };
        let direction = mean.mean * (sense / rate);
        let across = Matrix3::identity() - direction * direction.transpose();
        let covariance =
            across * (mean.covariance + self.segments.bias_covariance(self.samples, movement)) * across
                / (rate * rate);
        let of_gravity = gravity.and_then(ForceAtRest::direction);
        let finding = SpinAxis {
            axis_imu: direction.into(),
            sigma_deg: (0.5 * covariance.trace()).sqrt() * DEG_PER_RAD,
            rate_deg_s: sense * rate * DEG_PER_RAD,
            turned_deg: movement.turning.angle.dot(&direction) * DEG_PER_RAD,
            tilt_from_sensor_z_deg: tilt_from_z(&direction, &covariance),
            tilt_from_gravity_deg: of_gravity
                .map(|gravity| angle_to(&direction, &(covariance + gravity.covariance), &gravity.direction)),
        };
        self.note_disagreement(&finding);
        let plateau = Plateau::find(self.samples, movement);
        Some(Spin { movement, plateau, axis: Direction { direction, covariance }, finding })
    }

    fn note_disagreement(&mut self, finding: &SpinAxis) {
        if let Some(angle) = finding.tilt_from_gravity_deg.filter(|angle| angle.value > 2.0 * angle.sigma) {
            self.notes.push(format!(
                "the axis of the spin and gravity at rest are {:.2} deg apart (sigma {:.2}): the axis leans, or the \
                 accelerometer has an offset; up is taken from the {}",
                angle.value,
                angle.sigma,
                match self.settings.up {
                    _ if self.settings.poses.is_some() => "poses",
                    Up::Spin => "spin",
                    Up::Shake => "shake",
                    Up::Gravity => "gravity",
                }
            ));
        }
        // Turning to another pose is a spin, too.
        if self.settings.poses.is_none() && self.segments.spins().count() > 1 {
            self.notes.push("there are several spins: the one that turns furthest is used".to_owned());
        }
    }

    /// Factor on the rate from a counted turn.
    ///
    /// The bias is taken from the rests on both sides and drifts on a line between them; its error grows with the length
    /// of the spin, that of the sensor's noise with the square root of it.
    pub(super) fn gyro_scale(&mut self, spin: Option<&Spin>, gyro: Option<&GyroAtRest>) -> Option<GyroScale> {
        const HINT: &str = "rest, turn the chair by whole turns from mark to mark, rest, and count the turns";
        let counted = self.settings.counted?;
        let (Some(spin), Some(gyro)) = (spin, gyro) else {
            self.refuse("gyro scale", "it needs a spin and a rest next to it", HINT, true);
            return None;
        };
        let axis = &spin.axis.direction;
        let span = spin.movement.span;
        let measured = spin.movement.turning.angle.dot(axis).abs();
        let scale = counted.angle.abs() / measured;
        if !(SCALE_LIMITS.0..=SCALE_LIMITS.1).contains(&scale) {
            let why = format!(
                "{:.1} deg were counted and {:.1} deg measured: no gyroscope is that far off",
                counted.angle.abs() * DEG_PER_RAD,
                measured * DEG_PER_RAD
            );
            self.refuse(
                "gyro scale",
                why,
                "--turned-deg is 360 for each whole turn of the longest spin",
                true,
            );
            return None;
        }
        let gap_s = span.longest_gap_s(self.samples);
        let clipped = span.of(self.samples).iter().filter(|sample| sample.clipped).count();
        if gap_s > TRUSTED_GAP_S || clipped > 0 {
            let why = format!(
                "in the spin {clipped} samples are clipped and the longest pause is {gap_s:.2} s: the angle is not measured"
            );
            self.refuse("gyro scale", why, "turn slower, and see that no samples are lost", true);
            return None;
        }
        let duration_s = span.duration_s(self.samples);
        let along = |matrix: &Matrix3<f64>| (axis.transpose() * matrix * axis)[(0, 0)];
        let bias_variance = along(&self.segments.bias_covariance(self.samples, spin.movement));
        let sigma = (bias_variance * duration_s * duration_s + along(&gyro.walk) * duration_s).sqrt();
        let relative = libm::hypot(sigma / measured, counted.sigma / counted.angle.abs());
        Some(GyroScale {
            scale: Estimate { value: scale, sigma: scale * relative },
            counted_deg: counted.angle.abs() * DEG_PER_RAD,
            measured_deg: Estimate { value: measured, sigma }.scaled(DEG_PER_RAD),
        })
    }

    /// The specific force of the spin, taken apart.
    pub(super) fn turning_force(
        &mut self,
        spin: Option<&Spin>,
        scale: Option<&GyroScale>,
        gravity: Option<&ForceAtRest>,
    ) -> Option<ForceInSpin> {
        let (spin, gravity) = (spin?, gravity?);
        let Some(plateau) = &spin.plateau else {
            self.refuse(
                "lever arm",
                "the rate never kept steady for 1 s",
                "turn the chair at a steady rate for a few turns",
                false,
            );
            return None;
        };
        let force_scale = self.settings.gravity / gravity.mean.mean.norm();
        let scales = Scales {
            gyro: scale.map_or(Estimate { value: 1.0, sigma: UNKNOWN_SCALE_SIGMA }, |found| found.scale),
            specific_force: Estimate {
                value: force_scale,
                // Poses have taken the offset off.
                sigma: match self.settings.poses {
                    Some(_) => 0.0,
                    None => force_scale * HIDDEN_OFFSET_M_S2 / self.settings.gravity,
                },
            },
        };
        let rests = &self.segments.rests;
        let fit = TurningForce::fit(
            self.samples,
            rests,
            (spin.movement, plateau),
            (&spin.axis.direction, &spin.axis.covariance),
            &scales,
        );
        if fit.is_none() {
            self.refuse(
                "lever arm",
                "rest and spin do not separate it from the accelerometer's offset and the lean of the axis",
                "turn the chair by at least one whole turn at a steady rate, with rests before and after",
                false,
            );
        }
        let (scale, gravity) = (force_scale, self.settings.gravity);
        Some(ForceInSpin { parts: fit?, scale, gravity })
    }
}
