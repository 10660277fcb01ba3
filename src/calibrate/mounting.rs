//! The mount: axes of the head in the sensor, and the lever arm.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::heading::FoundHeading;
use super::{Direction, LEVER_ARM_SIGMA_MAX_M, OFFSET_SIGMA_MAX_M_S2, Study, in_degrees};
use crate::survey::{Estimate, TurningForce, VectorEstimate};
use crate::units::DEG_PER_RAD;

/// How the sensor is mounted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MountEstimate {
    /// `rot_head_imu`, row by row: takes imu to head coordinates.
    pub matrix: [[f64; 3]; 3],
    /// Standard uncertainty of the rotation about head x, y and z, degrees; of z zero where the heading was given.
    pub sigma_deg: [f64; 3],
    /// Head point (on the axis, on the sensor's height) minus sensor, head axes, m; `None` when it is known too badly.
    pub lever_arm_m: Option<[f64; 3]>,
}

/// Where the sensor sits against the axis of the chair, and what else the accelerometer shows in a spin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeverArm {
    /// From the axis to the sensor, across the axis, imu frame, m.
    pub sensor_from_axis_imu_m: VectorEstimate,
    /// The same in head axes (x forward, y left); `None` without a heading.
    pub sensor_from_axis_head_m: Option<VectorEstimate>,
    /// Its length, m.
    pub radius_m: Estimate,
    /// Small enough an error to be written to the mount.
    pub written: bool,
    /// Offset of the accelerometer across the axis, in its raw readings, m/s², imu frame.
    pub offset_imu_m_s2: VectorEstimate,
    /// The offset is known well enough to be written to the calibration.
    pub offset_written: bool,
    /// Angle of the axis to the vertical, degrees.
    pub lean_deg: Estimate,
}

impl Study<'_> {
    /// Puts up, heading and lever arm together.
    pub(super) fn mounting(
        &mut self,
        up: Option<&Direction>,
        heading: Option<&FoundHeading>,
        force: Option<&ForceInSpin>,
    ) -> (Option<MountEstimate>, Option<LeverArm>) {
        let rotation = up.zip(heading).map(|(up, heading)| {
            let forward = heading.left.cross(&up.direction);
            Matrix3::from_rows(&[forward.transpose(), heading.left.transpose(), up.direction.transpose()])
        });
        let lever_arm = self.lever_arm(force, rotation.as_ref());
        let mount = rotation.zip(up).zip(heading).map(|((rotation, up), heading)| {
            let of_up = rotation * up.covariance * rotation.transpose();
            // An error of up by e moves the foot of a nod axis that is not level sideways.
            let slope = heading.along_up / (1.0 - heading.along_up * heading.along_up).max(1e-9).sqrt();
            let variances = [of_up[(1, 1)], of_up[(0, 0)], heading.variance + slope * slope * of_up[(0, 0)]];
            MountEstimate {
                matrix: core::array::from_fn(|row| core::array::from_fn(|column| rotation[(row, column)])),
                sigma_deg: variances.map(|variance| in_degrees(0.0, variance).sigma),
                lever_arm_m: written_arm(lever_arm.as_ref()),
            }
        });
        (mount, lever_arm)
    }

    /// The lever arm, in head axes where `rotation` (imu to head) is known.
    pub(super) fn lever_arm(
        &mut self,
        force: Option<&ForceInSpin>,
        rotation: Option<&Matrix3<f64>>,
    ) -> Option<LeverArm> {
        let arm = lever_arm(force?, rotation);
        if !arm.written {
            let sigma = arm.sensor_from_axis_imu_m.sigma.into_iter().fold(0.0, f64::max);
            self.refuse(
                "lever arm",
                format!("it is {:.3} m, give or take {sigma:.3} m: it is not written", arm.radius_m.value),
                "turn faster or longer: at 30 rpm 1 cm is felt as 0.1 m/s2, at 4 rpm as 0.002",
                false,
            );
        }
        Some(arm)
    }
}

/// The lever arm as a mount holds it, where it is known well enough.
pub(super) fn written_arm(arm: Option<&LeverArm>) -> Option<[f64; 3]> {
    let in_head = arm.filter(|arm| arm.written)?.sensor_from_axis_head_m?;
    Some([-in_head.value[0], -in_head.value[1], 0.0])
}

/// The specific force of the spin with what turns it into raw readings.
#[derive(Clone, Copy, Debug)]
pub(super) struct ForceInSpin {
    pub(super) parts: TurningForce,
    /// Factor that was on the raw specific force.
    pub(super) scale: f64,
    /// Gravity, m/s².
    pub(super) gravity: f64,
}

fn lever_arm(force: &ForceInSpin, rotation: Option<&Matrix3<f64>>) -> LeverArm {
    let ForceInSpin { parts, scale, gravity } = force;
    let sensor_from_axis_imu_m = VectorEstimate::new(&parts.arm, &parts.arm_covariance);
    let in_head = |rotation: &Matrix3<f64>| {
        VectorEstimate::new(
            &(rotation * parts.arm),
            &(rotation * parts.arm_covariance * rotation.transpose()),
        )
    };
    let (offset, covariance) = (parts.offset / *scale, parts.offset_covariance / (scale * scale));
    LeverArm {
        sensor_from_axis_imu_m,
        sensor_from_axis_head_m: rotation.map(in_head),
        radius_m: length(&parts.arm, &parts.arm_covariance),
        written: largest_sigma(&parts.arm_covariance) <= LEVER_ARM_SIGMA_MAX_M,
        offset_imu_m_s2: VectorEstimate::new(&offset, &covariance),
        offset_written: largest_sigma(&covariance) <= OFFSET_SIGMA_MAX_M_S2,
        lean_deg: length(&(parts.lean / *gravity), &(parts.lean_covariance / (gravity * gravity)))
            .scaled(DEG_PER_RAD),
    }
}

/// Length of an uncertain vector; of one near zero the error is that of its worst component.
fn length(vector: &Vector3<f64>, covariance: &Matrix3<f64>) -> Estimate {
    let value = vector.norm();
    let worst = largest_sigma(covariance);
    let sigma = match vector.try_normalize(1e-12) {
        Some(along) if value > 2.0 * worst => {
            (along.transpose() * covariance * along)[(0, 0)].max(0.0).sqrt()
        }
        _ => worst,
    };
    Estimate { value, sigma }
}

/// Square root of the largest variance in any direction.
fn largest_sigma(covariance: &Matrix3<f64>) -> f64 {
    covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
}
