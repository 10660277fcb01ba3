//! When a frame arrived: the kernel's stamp on our own clock.

use std::time::Duration;

use crate::time::HostTime;

/// Oldest a frame may be by its stamp. The kernel stamps with the wall clock, which may be set at any time: more than
/// this, or a stamp from the future, means that the clock was set, or that this program was stopped.
const OLDEST: Duration = Duration::from_secs(1);

/// Turns the age of a frame into the time it arrived.
///
/// Times never go backwards, so after a smaller step of the wall clock a frame is wrong at most by its distance
/// from the frame before it.
#[derive(Debug, Default)]
pub(super) struct ArrivalTimes {
    last: HostTime,
    refused: u64,
}

impl ArrivalTimes {
    /// Arrival of a frame read at `now` that has waited for `age`; `None` when the stamp lies in the future or is
    /// missing. A stamp that cannot be right counts as refused, and the frame as arrived now.
    pub(super) fn arrival(&mut self, now: HostTime, age: Option<Duration>) -> HostTime {
        let age = age.filter(|age| *age <= OLDEST).unwrap_or_else(|| {
            self.refused += 1;
            Duration::ZERO
        });
        let nanoseconds = u64::try_from(age.as_nanos()).unwrap_or(u64::MAX);
        self.last = self.last.max(HostTime(now.0.saturating_sub(nanoseconds)));
        self.last
    }

    /// Stamps that could not be right.
    pub(super) fn refused(&self) -> u64 {
        self.refused
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn frames_that_waited_get_the_time_they_arrived() {
        let mut times = ArrivalTimes::default();
        let ages = [30, 20, 10, 0];
        let got = ages.map(|ms| times.arrival(HostTime(1000 * MS), Some(Duration::from_millis(ms))).0 / MS);
        assert_eq!((got, times.refused()), ([970, 980, 990, 1000], 0));
    }

    #[test]
    fn a_clock_that_is_set_costs_accuracy_and_never_order() {
        let mut times = ArrivalTimes::default();
        let mut arrival =
            |now_ms: u64, age: Option<Duration>| times.arrival(HostTime(now_ms * MS), age).0 / MS;
        assert_eq!(arrival(1000, Some(Duration::from_millis(1))), 999);
        // Set forward by an hour, by 0.3 s, back.
        assert_eq!(arrival(1002, Some(Duration::from_secs(3600))), 1002);
        assert_eq!(arrival(1004, Some(Duration::from_millis(300))), 1002);
        assert_eq!(arrival(1006, None), 1006);
        assert_eq!(arrival(1007, Some(Duration::ZERO)), 1007);
        assert_eq!(times.refused(), 2);
        // A clock that has just started.
        assert_eq!(ArrivalTimes::default().arrival(HostTime(5), Some(Duration::from_millis(1))), HostTime(0));
    }
}
