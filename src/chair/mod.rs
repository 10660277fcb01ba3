//! What a rotating chair really did: rate, ramps, overshoot, ripple, vibration, axis, drift.
//!
//! | quantity | from |
//! |---|---|
//! | rate | bias-corrected angular velocity along the axis, which is the mean direction over the plateau |
//! | plateau, and how far it turned | [`crate::survey`] |
//! | ramps | line through 10 and 90 % of the plateau's rate |
//! | overshoot, settling | rate smoothed over 0.2 s against the plateau's |
//! | ripple | scatter of the rate about the plateau's straight line |
//! | vibration | averaged amplitude spectrum of that scatter, and of the specific force |
//! | wobble | angle of the single sample's axis to the mean axis |
//! | lean | gravity that goes round with the turn ([`crate::survey::TurningForce`]) |
//! | against a commanded profile | [`CommandedProfile`] |
//!
//! What a recording cannot tell is said, not guessed.

use nalgebra::Vector3;
use serde::Serialize;

use crate::imu::RestLimits;
use crate::survey::{Estimate, Sample, Sampling, Segments, Turning, VectorEstimate};

mod commanded;
mod plateau;
mod profile;
mod spectrum;
#[cfg(test)]
mod tests;
mod text;

pub use commanded::{CommandedPlateau, CommandedProfile, ProfileError, ProfileReport};
pub use plateau::{AxisReport, PlateauReport};
pub use profile::{Overshoot, Ramp};
pub use spectrum::{Peak, Spectrum, Vibration};

/// What the chair was told to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Commanded {
    /// Rate of the plateau, deg/s; positive is to the left.
    pub rate_deg_s: Option<f64>,
    /// Length of a ramp, s.
    pub ramp_s: Option<f64>,
}

/// What is known and wanted beforehand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChairSettings {
    /// Gravity at the place, m/s².
    pub gravity: f64,
    /// What the chair was told to do.
    pub commanded: Commanded,
    /// The rate it was told to have over time.
    pub profile: Option<CommandedProfile>,
    /// What counts as rest.
    pub rest: RestLimits,
}

/// Everything a recording says about the chair; the object of `--json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChairReport {
    /// Rates and pauses of the data.
    pub sampling: Sampling,
    /// Integral of the raw rate over all samples, bias and all, deg, imu axes.
    pub integral_imu_deg: [f64; 3],
    /// What the chair was told to do.
    pub commanded: Commanded,
    /// The spin that turned furthest.
    pub spin: Option<SpinReport>,
    /// All spins, in the order of time.
    pub spins: Vec<SpinRow>,
    /// Measured against the commanded profile.
    pub profile: Option<ProfileReport>,
    /// What else should be known.
    pub notes: Vec<String>,
    /// What these data cannot tell, and why.
    pub cannot_tell: Vec<String>,
    /// Curves for a figure.
    #[serde(skip)]
    pub curves: Curves,
}

/// What a figure shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves {
    /// Time (s) and rate about the axis (deg/s).
    pub rate: Vec<(f64, f64)>,
    /// Frequency (Hz) and amplitude (deg/s) of the rate's scatter in the plateau.
    pub rate_spectrum: Vec<(f64, f64)>,
    /// Frequency (Hz) and amplitude (m/s²) of the specific force's scatter in the plateau.
    pub force_spectrum: Vec<(f64, f64)>,
}

/// One spin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpinReport {
    /// When the chair left its rest, s; `None` when it turned from the first sample on.
    pub start_s: Option<f64>,
    /// When it came to rest, s; `None` when it turned to the last sample.
    pub stop_s: Option<f64>,
    /// Angle turned about the axis, bias removed, degrees; positive is to the left.
    pub turned_deg: f64,
    /// Whether positive is to the left; without an accelerometer it is along the sensor axis nearest to the axis of
    /// rotation.
    pub sense_known: bool,
    /// Gyro bias in the rest before, deg/s, imu axes.
    pub gyro_bias_before_deg_s: Option<VectorEstimate>,
    /// The same after.
    pub gyro_bias_after_deg_s: Option<VectorEstimate>,
    /// Standard deviation of the rate about the axis at rest, deg/s: sensor noise and what shakes the building.
    pub noise_at_rest_rms_deg_s: Option<f64>,
    /// The ramp up.
    pub ramp_up: Option<Ramp>,
    /// The ramp down.
    pub ramp_down: Option<Ramp>,
    /// How far the rate shot past the plateau's at the end of the ramp up.
    pub overshoot: Option<Overshoot>,
    /// The steady part.
    pub plateau: Option<PlateauReport>,
    /// The axis of rotation.
    pub axis: AxisReport,
    /// What shakes in the plateau.
    pub vibration: Option<Vibration>,
}

/// One of several spins in short.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SpinRow {
    /// When the chair left its rest, s; `None` when it turned from the first sample on.
    pub start_s: Option<f64>,
    /// When it came to rest, s; `None` when it turned to the last sample.
    pub stop_s: Option<f64>,
    /// Angle turned about the axis, bias removed, degrees; positive is to the left.
    pub turned_deg: f64,
    /// Mean rate of the plateau, deg/s; `None` without one.
    pub rate_deg_s: Option<Estimate>,
    /// The same against the commanded one, deg/s.
    pub commanded: Option<Against>,
    /// Standard deviation of the rate in the plateau, deg/s.
    pub ripple_rms_deg_s: Option<f64>,
    /// How far the rate shot past the plateau's, percent.
    pub overshoot_percent: Option<f64>,
    /// Angle of the axis to the nearer end of the sensor's z axis, degrees.
    pub tilt_from_sensor_z_deg: f64,
}

impl SpinRow {
    fn of(spin: &SpinReport) -> Self {
        let plateau = spin.plateau.as_ref();
        Self {
            start_s: spin.start_s,
            stop_s: spin.stop_s,
            turned_deg: spin.turned_deg,
            rate_deg_s: plateau.map(|plateau| plateau.rate_deg_s),
            commanded: plateau.and_then(|plateau| plateau.commanded),
            ripple_rms_deg_s: plateau.map(|plateau| plateau.ripple_rms_deg_s),
            overshoot_percent: spin.overshoot.map(|overshoot| overshoot.overshoot_percent),
            tilt_from_sensor_z_deg: spin.axis.tilt_from_sensor_z_deg,
        }
    }
}

/// Finds everything `samples` say about the chair. Never fails; `samples` are in the order of time.
pub fn survey_chair(samples: &[Sample], settings: &ChairSettings) -> ChairReport {
    let sampling = Sampling::of(samples);
    let segments = Segments::find(samples, &settings.rest);
    let (mut spin, mut spins, mut cannot_tell, mut curves) =
        (None, Vec::new(), Vec::new(), Curves::default());
    let longest = segments.longest_spin();
    for movement in segments.spins() {
        let (mut told, mut drawn) = (Vec::new(), Curves::default());
        let report = plateau::spin_report(samples, &segments, movement, settings, &mut told, &mut drawn);
        spins.extend(report.as_ref().map(SpinRow::of));
        if longest == Some(movement) {
            (spin, cannot_tell, curves) = (report, told, drawn);
        }
    }
    if spin.is_none() {
        cannot_tell.push(
            "anything about a spin: nowhere does the sensor turn by 90 deg or more in one direction"
                .to_owned(),
        );
    }
    let all = crate::survey::Span { first: 0, end: samples.len() };
    let angle: Vector3<f64> = if samples.is_empty() {
        Vector3::zeros()
    } else {
        Turning::over(samples, all, &crate::survey::Bias::default()).angle
    };
    let profile = settings.profile.as_ref().zip(spin.as_ref()).and_then(|(profile, spin)| {
        let found = profile_report(samples, &segments, profile, spin);
        if found.is_none() {
            cannot_tell
                .push("whether it did as commanded: no plateau of the profile is in the data".to_owned());
        }
        found
    });
    let notes = profile.as_ref().and_then(ProfileReport::doubt).into_iter().chain(downwards(spin.as_ref()));
    let notes = notes.collect();
    ChairReport {
        sampling,
        integral_imu_deg: angle.map(f64::to_degrees).into(),
        commanded: settings.commanded,
        spin,
        spins,
        profile,
        notes,
        cannot_tell,
        curves,
    }
}

/// Holds a spin against the profile. Without an accelerometer left and right are not known: the sense that fits is taken.
fn profile_report(
    samples: &[Sample],
    segments: &Segments,
    profile: &CommandedProfile,
    spin: &SpinReport,
) -> Option<ProfileReport> {
    let axis = Vector3::from(spin.axis.axis_imu);
    let against = |axis: &Vector3<f64>| commanded::against_profile(samples, segments, axis, profile);
    if spin.sense_known {
        return against(&axis);
    }
    let both = [against(&axis), against(&-axis)].into_iter().flatten();
    both.min_by(|a, b| a.rms_error_deg_s.total_cmp(&b.rms_error_deg_s))
}

/// What a run should be told about a sensor that lies upside down.
fn downwards(spin: Option<&SpinReport>) -> Option<String> {
    let spin = spin.filter(|spin| spin.sense_known && spin.axis.axis_imu[2] < 0.0)?;
    Some(crate::imu::points_down(libm::acos(spin.axis.axis_imu[2]).to_degrees()))
}

/// Measured against commanded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Against {
    /// Measured minus commanded, in the unit of the quantity.
    pub error: f64,
    /// The same, of the commanded, percent.
    pub error_percent: f64,
}

impl Against {
    fn of(measured: f64, commanded: f64) -> Self {
        let error = measured - commanded;
        Self { error, error_percent: 100.0 * error / commanded.abs() }
    }
}

/// A value with its error as text.
fn plus_minus(estimate: &Estimate, decimals: usize) -> String {
    format!("{:.decimals$} \u{b1} {:.decimals$}", estimate.value, estimate.sigma)
}
