//! Running the pure core: live, from a recording, or as fast as the machine goes.

mod control;
mod core;
mod figure;
mod journal;
mod live;
mod offline;
mod queue;
mod receive;
mod sched;
mod source;
mod status;
pub mod trouble;

pub use self::core::{Core, CoreSettings, CoreSettingsError, MAX_CHAIR_FORCE, MAX_CHAIR_RATE, Push};
pub use figure::{Figure, Vestibular};
pub use journal::{Event, Journal};
pub use live::{LiveRun, LiveSettings, LiveSettingsError, Signals};
pub use offline::run_offline;
pub use source::{Polled, Source, SourceFacts, SourceSink};
pub use status::{LiveStatus, StatusLine};

use crate::imu::ResampleCounters;
use crate::report::TickTimes;
use crate::time::Tick;

/// How a run went.
#[derive(Debug)]
pub struct RunOutcome {
    /// Ticks that ran.
    pub ticks: u64,
    /// Number the next tick would have had: simulated time, skipped ticks included.
    pub last_tick: Tick,
    /// CPU time of the control thread in each tick.
    pub times: TickTimes,
    /// Ticks skipped because they were due too long ago.
    pub overruns: u64,
    /// Ticks that ran later than one tick after their time.
    pub late_ticks: u64,
    /// Samples, ticks and pieces of traffic that a full queue lost.
    pub dropped: u64,
    /// Largest age of the newest sample at a tick, s; `None` without samples, and offline, where nothing ages.
    pub max_sample_age_s: Option<f64>,
    /// Counters of the resampler.
    pub resample: ResampleCounters,
}
