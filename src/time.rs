//! Times and clocks. The only file that reads a clock or sleeps.

use std::time::{Duration, Instant, SystemTime};

/// Length of one control tick, s. The control rate is fixed at 1 kHz.
pub const TICK_S: f64 = 1e-3;
/// Length of one control tick, ns.
pub const TICK_NS: u64 = 1_000_000;

/// Nanoseconds of the host's monotonic clock since the start of the run (of the recording, when replaying).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct HostTime(pub u64);

impl HostTime {
    /// The time `seconds` after the start. Negative and non-finite values become 0.
    pub fn from_secs_f64(seconds: f64) -> Self {
        Self((seconds.max(0.0) * 1e9).round() as u64)
    }

    /// Seconds since the start.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// `self - earlier`; zero when `earlier` is later.
    pub fn saturating_since(self, earlier: HostTime) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }
}

impl std::ops::Add<Duration> for HostTime {
    type Output = HostTime;
    fn add(self, rhs: Duration) -> HostTime {
        HostTime(self.0.saturating_add(u64::try_from(rhs.as_nanos()).unwrap_or(u64::MAX)))
    }
}

/// Number of a control tick. Simulated time is exactly `tick x 1 ms`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tick(pub u64);

impl Tick {
    /// Simulated time of this tick, s.
    pub fn time_s(self) -> f64 {
        self.0 as f64 * TICK_S
    }

    /// Simulated time of this tick as a host time.
    pub fn host_time(self) -> HostTime {
        HostTime(self.0 * TICK_NS)
    }
}

/// A monotonic clock that can wait.
pub trait Clock: Send + Sync {
    /// Time since the start of the run.
    fn now(&self) -> HostTime;
    /// Returns at `deadline` or later; at once when it has passed.
    fn sleep_until(&self, deadline: HostTime);
}

/// The host's monotonic clock; zero is the moment of construction.
#[derive(Clone, Copy, Debug)]
pub struct SystemClock {
    start: Instant,
}

impl SystemClock {
    /// A clock that reads zero now.
    #[allow(clippy::disallowed_methods)]
    pub fn start_now() -> Self {
        Self { start: Instant::now() }
    }
}

impl Clock for SystemClock {
    fn now(&self) -> HostTime {
        HostTime(u64::try_from(self.start.elapsed().as_nanos()).unwrap_or(u64::MAX))
    }

    #[allow(clippy::disallowed_methods)]
    fn sleep_until(&self, deadline: HostTime) {
        let remaining = deadline.saturating_since(self.now());
        if !remaining.is_zero() {
            std::thread::sleep(remaining);
        }
    }
}

/// How long ago `stamp` of the wall clock was; `None` when it lies in the future, because the clock was set back.
#[allow(clippy::disallowed_methods)]
pub fn age_of(stamp: SystemTime) -> Option<Duration> {
    SystemTime::now().duration_since(stamp).ok()
}

/// The date and time now, UTC, as `20261122-163005`: for names of new folders.
pub fn utc_now_compact() -> String {
    jiff::Timestamp::now().strftime("%Y%m%d-%H%M%S").to_string()
}
