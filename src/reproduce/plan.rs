//! Which scenarios to run, and running them on all cores.

use std::sync::atomic::AtomicBool;

use super::stills::Stills;
use super::{Experiment, ExperimentError, Figure, Runs, chair_of, experiment, in_parallel};
use crate::config::Config;

/// How often progress is told, ticks.
const STRIDE: u64 = 500;

/// Scenarios to run.
#[derive(Clone, Debug)]
pub struct Plan {
    scenarios: Vec<(&'static str, Config)>,
}

impl Plan {
    /// Everything that `figures` show or have claims about, each scenario once.
    ///
    /// # Errors
    /// A scenario that cannot be used, which a test excludes.
    pub fn of(figures: &[Figure]) -> Result<Self, ExperimentError> {
        let mut scenarios: Vec<(&'static str, Config)> = Vec::new();
        for &name in figures.iter().flat_map(|figure| figure.scenarios()) {
            if scenarios.iter().all(|(known, _)| *known != name) {
                scenarios.push((name, Config::scenario(name)?));
            }
        }
        Ok(Self { scenarios })
    }

    /// Number of scenarios.
    pub fn len(&self) -> usize {
        self.scenarios.len()
    }

    /// Whether there is nothing to run.
    pub fn is_empty(&self) -> bool {
        self.scenarios.is_empty()
    }

    /// Simulated time of all scenarios, ms.
    pub fn simulated_ms(&self) -> u64 {
        let chairs = self.scenarios.iter().filter_map(|(_, config)| chair_of(config).ok());
        chairs.map(|chair| (1000.0 * chair.duration_s()) as u64).sum()
    }

    /// Runs them on all cores; the results do not depend on how many there are. `progress` hears of simulated ms.
    ///
    /// # Errors
    /// The first scenario that cannot be run. When `stop` is set the runs are cut short.
    pub fn run(&self, stop: &AtomicBool, progress: impl Fn(u64) + Sync) -> Result<Runs, ExperimentError> {
        let done = in_parallel(&self.scenarios, |(name, config)| {
            let mut stills = Stills::default();
            let run = experiment(config, stop, |core, output| {
                stills.see(core, output);
                if output.tick.0 % STRIDE == STRIDE - 1 {
                    progress(STRIDE);
                }
            })?;
            Ok((*name, Experiment { stills, ..run }))
        });
        done.into_iter().collect::<Result<_, _>>().map(Runs)
    }
}
