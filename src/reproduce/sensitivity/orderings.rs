//! The paper's orderings with the noise of a realistic IMU.

use std::sync::atomic::AtomicBool;

use serde::Serialize;

use super::Threshold;
use super::threshold::fall_threshold;
use super::variations::noisy_imu;
use crate::report::CharacterMetrics;
use crate::reproduce::{ExperimentError, experiment};

/// Runs of one seed.
pub(super) const RUNS: u64 = 9;

/// What one noise seed makes of the orderings.
#[derive(Clone, Debug, Serialize)]
pub struct SeedVerdict {
    /// The seed.
    pub seed: u64,
    /// Peak gravity tilt after 30 rpm for 15 s, deg.
    pub peak_gravity_tilt_deg: Option<f64>,
    /// Peak CoM sway, likewise.
    pub peak_com_sway_deg: Option<f64>,
    /// Largest foot tilt after 30 rpm for 15 s, deg.
    pub peak_foot_tilt_deg: Option<f64>,
    /// 10 < 20 < 30 rpm, and no fall.
    pub by_speed: bool,
    /// 10 < 15 s, and 20 s is a fall.
    pub by_duration: bool,
    /// After 17 s canals of 2.85 s fall and are worst, and 11.4 s are mildest.
    pub by_time_constant: bool,
    /// After 17 s canals of 5.7 s stay up.
    pub usual_stands: bool,
    /// Green sways more than blue, after the spin and after the push.
    pub green_above_blue: bool,
    /// Shortest spin at 30 rpm after which green falls.
    pub fall_threshold: Threshold,
}

impl SeedVerdict {
    /// Runs the orderings with one seed.
    pub(super) fn of(seed: u64, stop: &AtomicBool) -> Result<Self, ExperimentError> {
        let imu = noisy_imu(seed);
        let both = |scenario: &str| -> Result<(CharacterMetrics, CharacterMetrics), ExperimentError> {
            let analysis = experiment(&imu.applied_to(scenario)?, stop, |_, _| ())?.analysis;
            Ok((analysis.green, analysis.blue))
        };
        let (base, base_blue) = both("spin-30rpm-15s")?;
        let (push, push_blue) = both("push-4ns")?;
        let green = |scenario: &str| Ok::<_, ExperimentError>(both(scenario)?.0);
        let (slow, middle) = (green("spin-10rpm-15s")?, green("spin-20rpm-15s")?);
        let (short, long) = (green("spin-30rpm-10s")?, green("spin-30rpm-20s")?);
        let (susceptible, usual) = (green("spin-30rpm-17s-tau-2-85")?, green("spin-30rpm-17s")?);
        let hardy = green("spin-30rpm-17s-tau-11-4")?;
        Ok(Self {
            seed,
            peak_gravity_tilt_deg: base.peak_gravity_tilt_deg,
            peak_com_sway_deg: base.peak_com_sway_deg,
            peak_foot_tilt_deg: base.peak_foot_tilt_deg,
            by_speed: milder(&slow, &middle) && milder(&middle, &base) && stands(&base),
            by_duration: milder(&short, &base) && milder(&base, &long) && !stands(&long),
            by_time_constant: !stands(&susceptible) && milder(&usual, &susceptible) && milder(&hardy, &usual),
            usual_stands: stands(&usual),
            green_above_blue: milder(&base_blue, &base) && milder(&push_blue, &push),
            fall_threshold: fall_threshold(&imu, stop)?,
        })
    }

    /// Whether every ordering holds; that 5.7 s stay up is no ordering.
    pub fn holds(&self) -> bool {
        self.by_speed && self.by_duration && self.by_time_constant && self.green_above_blue
    }
}

fn stands(metrics: &CharacterMetrics) -> bool {
    metrics.fell_at_s.is_none()
}

/// Whether `one` swayed and tilted less than `other`; who falls fares worse, and the earlier the worse.
fn milder(one: &CharacterMetrics, other: &CharacterMetrics) -> bool {
    match (one.fell_at_s, other.fell_at_s) {
        (None, None) => {
            one.peak_com_sway_deg < other.peak_com_sway_deg
                && one.peak_gravity_tilt_deg < other.peak_gravity_tilt_deg
        }
        (Some(one_s), Some(other_s)) => one_s > other_s,
        (fell, _) => fell.is_none(),
    }
}
