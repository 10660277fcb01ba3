//! How far the verdicts depend on what the paper leaves open: the fall threshold against parameters and noise.

mod orderings;
mod table;
mod threshold;
mod variations;

use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use super::{ExperimentError, in_parallel};

pub use orderings::SeedVerdict;
pub use threshold::Threshold;

/// Seeds of the noisy IMU.
const SEEDS: std::ops::RangeInclusive<u64> = 1..=20;
/// Spin durations of the fine scan, tenths of a second.
const SCAN_TENTHS: std::ops::RangeInclusive<u32> = 160..=200;

/// What happens with one parameter changed.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What was changed.
    pub parameter: &'static str,
    /// To what.
    pub value: String,
    /// Peak gravity tilt after 30 rpm for 15 s, deg; `None` when green falls.
    pub peak_gravity_tilt_deg: Option<f64>,
    /// Peak CoM sway, likewise.
    pub peak_com_sway_deg: Option<f64>,
    /// Largest foot tilt, likewise.
    pub peak_foot_tilt_deg: Option<f64>,
    /// Shortest spin at 30 rpm after which green falls.
    pub fall_threshold: Threshold,
}

/// The whole study.
#[derive(Clone, Debug, Serialize)]
pub struct Sensitivity {
    /// One parameter at a time.
    pub rows: Vec<Row>,
    /// The orderings with each noise seed.
    pub seeds: Vec<SeedVerdict>,
    /// Spin durations at 30 rpm, s, and whether green fell, without noise.
    pub scan: Vec<(f64, bool)>,
}

/// One piece of work.
enum Job {
    Row(variations::Variation),
    Seed(u64),
    Scan(f64),
}

enum Done {
    Row(Row),
    Seed(SeedVerdict),
    Scan(f64, bool),
}

/// Number of runs that [`sensitivity`] announces to its `progress`.
pub fn planned_runs() -> u64 {
    jobs().iter().map(Job::planned_runs).sum()
}

/// Runs the study on all cores; `progress` hears of the number of runs each piece of work was planned with.
///
/// # Errors
/// A variation that the core refuses. When `stop` is set the results are worthless.
pub fn sensitivity(stop: &AtomicBool, progress: impl Fn(u64) + Sync) -> Result<Sensitivity, ExperimentError> {
    let done = in_parallel(&jobs(), |job| {
        let done = job.run(stop);
        progress(job.planned_runs());
        done
    });
    let mut study = Sensitivity { rows: Vec::new(), seeds: Vec::new(), scan: Vec::new() };
    for piece in done {
        match piece? {
            Done::Row(row) => study.rows.push(row),
            Done::Seed(seed) => study.seeds.push(seed),
            Done::Scan(spin_s, fell) => study.scan.push((spin_s, fell)),
        }
    }
    Ok(study)
}

fn jobs() -> Vec<Job> {
    let rows = variations::all().into_iter().map(Job::Row);
    let seeds = SEEDS.map(Job::Seed);
    let scan = SCAN_TENTHS.map(|tenths| Job::Scan(f64::from(tenths) * 0.1));
    seeds.chain(rows).chain(scan).collect()
}

impl Job {
    fn planned_runs(&self) -> u64 {
        match self {
            Self::Row(_) => 1 + threshold::RUNS,
            Self::Seed(_) => orderings::RUNS + threshold::RUNS,
            Self::Scan(_) => 1,
        }
    }

    fn run(&self, stop: &AtomicBool) -> Result<Done, ExperimentError> {
        match self {
            _ if stop.load(Ordering::Relaxed) => Ok(Done::Scan(0.0, false)),
            Self::Row(variation) => variation.row(stop).map(Done::Row),
            Self::Seed(seed) => SeedVerdict::of(*seed, stop).map(Done::Seed),
            Self::Scan(spin_s) => {
                let fell = threshold::falls(&variations::Variation::none(), *spin_s, stop)?;
                Ok(Done::Scan(*spin_s, fell))
            }
        }
    }
}
