//! The shortest spin at 30 rpm after which green falls.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use super::variations::Variation;
use crate::device::Selector;
use crate::device::mock::MockParams;
use crate::reproduce::{ExperimentError, chair_of, experiment};
use crate::tick::Posture;

/// Between which spin durations it is looked for, s.
const RANGE_S: (f64, f64) = (4.0, 30.0);
/// How closely it is found, s.
const RESOLUTION_S: f64 = 0.1;
/// Runs it takes at most: both ends, and the halvings of the range down to the resolution.
pub(super) const RUNS: u64 = 2 + 9;

/// Where it lies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Threshold {
    /// Green falls already after the shortest spin tried, s.
    Below(f64),
    /// Green recovers from spins shorter than this by a tenth of a second, and falls after it, s.
    At(f64),
    /// Green recovers from the longest spin tried, s.
    Above(f64),
}

impl fmt::Display for Threshold {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Below(s) => write!(f, "below {s:.0} s"),
            Self::At(s) => write!(f, "{s:.1} s"),
            Self::Above(s) => write!(f, "above {s:.0} s"),
        }
    }
}

/// Halves the range between a spin that green recovers from and one after which it falls. Where falls and recoveries
/// alternate it finds one of the borders.
pub(super) fn fall_threshold(variation: &Variation, stop: &AtomicBool) -> Result<Threshold, ExperimentError> {
    let (mut recovers_s, mut falls_s) = RANGE_S;
    if falls(variation, recovers_s, stop)? {
        return Ok(Threshold::Below(recovers_s));
    }
    if !falls(variation, falls_s, stop)? {
        return Ok(Threshold::Above(falls_s));
    }
    while falls_s - recovers_s > RESOLUTION_S && !stop.load(Ordering::Relaxed) {
        let middle_s = 0.5 * (recovers_s + falls_s);
        if falls(variation, middle_s, stop)? {
            falls_s = middle_s;
        } else {
            recovers_s = middle_s;
        }
    }
    Ok(Threshold::At(falls_s))
}

/// Whether green falls within the 25 s after a spin of `spin_s`, or in it.
pub(super) fn falls(variation: &Variation, spin_s: f64, stop: &AtomicBool) -> Result<bool, ExperimentError> {
    let mut config = variation.config()?;
    let chair = MockParams { spin_s, ..chair_of(&config)? };
    config.device = Some(Selector::Mock(chair).to_string());
    let ended = AtomicBool::new(stop.load(Ordering::Relaxed));
    let run = experiment(&config, &ended, |_, output| {
        let fallen = output.green.posture == Posture::Fallen;
        // What a fallen character does is of no interest here.
        ended.store(fallen || stop.load(Ordering::Relaxed), Ordering::Relaxed);
    })?;
    Ok(run.analysis.green.fell_at_s.is_some())
}
