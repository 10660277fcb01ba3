//! A sensor's constants and its mounting, out of a rest, a spin and a nod, or out of six poses.
//!
//! | quantity | from |
//! |---|---|
//! | gyro bias, noise density | rest |
//! | factor on the specific force | its norm at rest against gravity |
//! | up (head z) | axis of the spin, its sense from gravity; or a shake, or gravity alone, where asked for |
//! | heading (head y) | axis of the nod across up, its sense from the nod's first half being forward |
//! | factor on the rate | a counted turn over the integral of the rate about the axis |
//! | accelerometer offset across the axis, lean of the axis, lever arm | [`crate::survey::TurningForce`] |
//! | bias and factor of each accelerometer axis, and the mounting where they are named | six poses at rest |
//!
//! Every estimate carries a standard uncertainty ([`crate::survey::Estimate`]). What the data do not determine is
//! refused with the reason and the motion that is missing; the rest is reported all the same.

use nalgebra::Vector3;
use serde::Serialize;

use crate::imu::RestLimits;
use crate::survey::{Estimate, Sample, Sampling, Segments, VectorEstimate};
use mounting::written_arm;
use rest::ForceAtRest;

mod files;
mod guide;
mod heading;
mod mounting;
mod poses;
mod rest;
mod rocking;
mod spin;
#[cfg(test)]
mod tests;

pub use files::{calibration_toml, mount_toml};
pub use guide::{Guide, Step};
pub use heading::Heading;
pub use mounting::{LeverArm, MountEstimate};
pub use poses::AccelerometerEstimate;
pub use rest::Gravity;
pub use spin::{GyroScale, SpinAxis};

/// Largest standard uncertainty of a lever arm that is written to a mount, m.
pub const LEVER_ARM_SIGMA_MAX_M: f64 = 0.05;
/// Largest standard uncertainty of an accelerometer offset that is written to a calibration, m/s² (0.3 deg of tilt).
pub const OFFSET_SIGMA_MAX_M_S2: f64 = 0.05;

/// Where the head's up is taken from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    /// The axis of a spin of the chair.
    #[default]
    Spin,
    /// The axis of a shake of the head.
    Shake,
    /// Gravity at rest: right as far as the chair stands upright and the accelerometer has no offset.
    Gravity,
}

/// An angle the chair was seen to turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CountedTurn {
    /// The angle, rad; the sign is ignored.
    pub angle: f64,
    /// Standard uncertainty of the counting, rad.
    pub sigma: f64,
}

/// What is known and wanted beforehand.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrateSettings {
    /// Gravity at the place, m/s².
    pub gravity: f64,
    /// How far the longest spin turned, if it was counted.
    pub counted: Option<CountedTurn>,
    /// Where up is taken from.
    pub up: Up,
    /// Sensor axis said to point forward, unit: it stands for a nod.
    pub forward_imu: Option<Vector3<f64>>,
    /// Six poses instead of a nod: the head's direction (unit, head frame) that is up in each, in the order of time; empty
    /// where they are not named.
    pub poses: Option<Vec<Vector3<f64>>>,
    /// What counts as rest.
    pub rest: RestLimits,
}

/// Something the data do not determine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Refusal {
    /// What.
    pub what: &'static str,
    /// The reason.
    pub why: String,
    /// The motion, or the flag, that is missing.
    pub hint: &'static str,
    /// Without it the mount, or a quantity that was asked for, is missing.
    pub needed: bool,
}

/// A stretch of the data and what it was taken for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Motion {
    /// `rest`, `spin`, `nod`, `shake`, `rocking` about a slanting axis, or `other`.
    pub kind: &'static str,
    /// Beginning, s.
    pub start_s: f64,
    /// End, s.
    pub end_s: f64,
    /// Angle turned in the end, degrees.
    pub turned_deg: f64,
}

/// Everything that was found; the object of `--json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Findings {
    /// Rates and pauses of the data.
    pub sampling: Sampling,
    /// What they were taken for.
    pub motions: Vec<Motion>,
    /// Gyro reading at rest, rad/s, imu frame.
    pub gyro_bias_rad_s: Option<VectorEstimate>,
    /// One-sided amplitude density of the gyro's noise, rad/s/√Hz, imu axes: its standard deviation over √(half the
    /// sample rate), so right as far as the sensor lets that band pass.
    pub gyro_noise_density_rad_s_sqrt_hz: Option<VectorEstimate>,
    /// What the accelerometer reads at rest.
    pub gravity: Option<Gravity>,
    /// Bias and factor of the accelerometer's axes.
    pub accelerometer: Option<AccelerometerEstimate>,
    /// The axis the chair turns about.
    pub spin_axis: Option<SpinAxis>,
    /// Factor on the rate.
    pub gyro_scale: Option<GyroScale>,
    /// Direction of the head's y axis.
    pub heading: Option<Heading>,
    /// Sensor against the axis.
    pub lever_arm: Option<LeverArm>,
    /// How the sensor is mounted.
    pub mount: Option<MountEstimate>,
    /// What could not be determined.
    pub refusals: Vec<Refusal>,
    /// What else should be known.
    pub notes: Vec<String>,
}

/// Finds everything `samples` determine.
///
/// Never fails: samples that determine nothing give refusals. `samples` are in the order of time and at most
/// [`crate::survey::MAX_SAMPLES`].
pub fn calibrate(samples: &[Sample], settings: &CalibrateSettings) -> Findings {
    let segments = Segments::find(samples, &settings.rest);
    match &settings.poses {
        Some(named) => calibrate_by_poses(samples, &segments, settings, named),
        None => calibrate_by_motions(samples, &segments, settings),
    }
}

fn calibrate_by_motions(samples: &[Sample], segments: &Segments, settings: &CalibrateSettings) -> Findings {
    let mut study = Study::new(samples, segments, settings);
    let sampling = Sampling::of(samples);
    let gyro = study.gyro_at_rest(sampling.rate_hz);
    let gravity = study.gravity();
    let spin = study.spin(gravity.as_ref());
    let scale = study.gyro_scale(spin.as_ref(), gyro.as_ref());
    let up = study.up(spin.as_ref(), gravity.as_ref(), gyro.as_ref());
    let heading = study.heading(up.as_ref(), gyro.as_ref());
    let force = study.turning_force(spin.as_ref(), scale.as_ref(), gravity.as_ref());
    let (mount, lever_arm) = study.mounting(up.as_ref(), heading.as_ref(), force.as_ref());
    let motions = study.motions(up.as_ref().map(|up| up.direction));
    if mount.is_none() {
        study.notes.extend(gravity.as_ref().and_then(ForceAtRest::downwards));
    }
    Findings {
        sampling,
        motions,
        gyro_bias_rad_s: gyro.as_ref().map(|gyro| gyro.bias()),
        gyro_noise_density_rad_s_sqrt_hz: gyro.as_ref().map(|gyro| gyro.noise_density),
        gravity: gravity.map(|gravity| gravity.finding(settings.gravity)),
        accelerometer: None,
        spin_axis: spin.map(|spin| spin.finding),
        gyro_scale: scale,
        heading: heading.map(|heading| heading.finding),
        lever_arm,
        mount,
        refusals: study.refusals,
        notes: study.notes,
    }
}

/// Of poses the accelerometer and, where they are named, the mounting; of a counted turn the factor on the rate and, with
/// the accelerometer known, the lever arm.
fn calibrate_by_poses(
    samples: &[Sample],
    segments: &Segments,
    settings: &CalibrateSettings,
    named: &[Vector3<f64>],
) -> Findings {
    let mut study = Study::new(samples, segments, settings);
    let sampling = Sampling::of(samples);
    let gyro = study.gyro_at_rest(sampling.rate_hz);
    let poses = poses::find_poses(samples, segments);
    let accelerometer = study.accelerometer(&poses);
    let posed = match named {
        [] => None,
        _ => study.posed_mount(&poses, named, accelerometer.as_ref()),
    };
    let corrected: Vec<Sample> = match &accelerometer {
        Some(known) => {
            let force = |sample: &Sample| sample.specific_force_imu.map(|force| known.corrected(&force));
            samples.iter().map(|sample| Sample { specific_force_imu: force(sample), ..*sample }).collect()
        }
        None => samples.to_vec(),
    };
    study.samples = &corrected;
    let counted = settings.counted.is_some();
    let gravity = if counted { study.gravity() } else { None };
    let spin = if counted { study.spin(gravity.as_ref()) } else { None };
    let scale = study.gyro_scale(spin.as_ref(), gyro.as_ref());
    let force = study.turning_force(spin.as_ref(), scale.as_ref(), gravity.as_ref());
    let lever_arm = study.lever_arm(force.as_ref(), posed.as_ref().map(|(rotation, _)| rotation.matrix()));
    let motions = study.motions(None);
    Findings {
        sampling,
        motions,
        gyro_bias_rad_s: gyro.as_ref().map(|gyro| gyro.bias()),
        gyro_noise_density_rad_s_sqrt_hz: gyro.as_ref().map(|gyro| gyro.noise_density),
        gravity: None,
        accelerometer: accelerometer.map(|known| known.finding),
        spin_axis: spin.map(|spin| spin.finding),
        gyro_scale: scale,
        heading: None,
        lever_arm,
        mount: posed
            .map(|(_, mount)| MountEstimate { lever_arm_m: written_arm(lever_arm.as_ref()), ..mount }),
        refusals: study.refusals,
        notes: study.notes,
    }
}

/// The data of one calibration and what has been said about them.
struct Study<'a> {
    samples: &'a [Sample],
    segments: &'a Segments,
    settings: &'a CalibrateSettings,
    refusals: Vec<Refusal>,
    notes: Vec<String>,
}

impl<'a> Study<'a> {
    fn new(samples: &'a [Sample], segments: &'a Segments, settings: &'a CalibrateSettings) -> Self {
        Self { samples, segments, settings, refusals: Vec::new(), notes: Vec::new() }
    }

    fn refuse(&mut self, what: &'static str, why: impl Into<String>, hint: &'static str, needed: bool) {
        self.refusals.push(Refusal { what, why: why.into(), hint, needed });
    }
}

/// A direction with the covariance of its error (which lies across it), imu frame.
#[derive(Clone, Copy, Debug)]
struct Direction {
    direction: Vector3<f64>,
    covariance: nalgebra::Matrix3<f64>,
}

/// An angle estimate in degrees.
fn in_degrees(value: f64, variance: f64) -> Estimate {
    Estimate { value, sigma: variance.max(0.0).sqrt() }.scaled(crate::units::DEG_PER_RAD)
}
