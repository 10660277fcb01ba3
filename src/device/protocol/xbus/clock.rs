//! SampleTimeFine, the device's clock in ticks of 100 µs.

use crate::device::protocol::DeviceTime;

/// Length of a tick, µs.
const TICK_US: u64 = 100;
/// Ticks after which the clock of the MTi-1 and MTi-600 returns to zero.
const FULL_TURN: u64 = 1 << 32;
/// Ticks after which the clock of the MTi-10 and MTi-100 does: a day.
const DAY_TURN: u64 = 864_000_000;
/// From so close to the end of the day to so close to its start is a return to zero and no device switched on anew,
/// ticks: ten minutes.
const NEAR: u64 = 6_000_000;

/// Follows the clock of one device, and finds out which of the two lengths it has.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampleClock {
    last: Option<u64>,
    turn: u64,
}

impl Default for SampleClock {
    fn default() -> Self {
        Self { last: None, turn: FULL_TURN }
    }
}

impl SampleClock {
    /// Takes the time of a sample; gives it with the step from the sample before, µs: negative where the clock has gone
    /// back, zero at the first sample.
    pub(super) fn take(&mut self, ticks: u32) -> (DeviceTime, i64) {
        let ticks = u64::from(ticks);
        let last = self.last.replace(ticks).unwrap_or(ticks);
        if ticks >= DAY_TURN {
            self.turn = FULL_TURN;
        } else if ticks < NEAR && (DAY_TURN - NEAR..DAY_TURN).contains(&last) {
            self.turn = DAY_TURN;
        }
        let at = |ticks| DeviceTime { micros: ticks * TICK_US, wraps_after_us: Some(self.turn * TICK_US) };
        (at(ticks), at(ticks).micros_since(at(last)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps between samples, µs.
    fn steps(ticks: &[u32]) -> Vec<i64> {
        let mut clock = SampleClock::default();
        let steps: Vec<_> = ticks.iter().map(|ticks| clock.take(*ticks).1).collect();
        assert_eq!(steps[0], 0);
        steps[1..].to_vec()
    }

    #[test]
    fn both_lengths_are_told_apart_where_they_end() {
        assert_eq!(steps(&[4_294_967_200, 4, 104]), [10_000, 10_000]);
        assert_eq!(steps(&[863_999_950, 50, 150]), [10_000, 10_000]);
        assert_eq!(steps(&[863_999_950, 864_000_050, 864_000_150]), [10_000, 10_000]);
        let mut clock = SampleClock::default();
        let turn = |clock: &mut SampleClock, ticks| clock.take(ticks).0.wraps_after_us;
        assert_eq!(turn(&mut clock, 863_999_999), Some(429_496_729_600));
        assert_eq!(turn(&mut clock, 1), Some(86_400_000_000));
        assert_eq!(turn(&mut clock, 900_000_000), Some(429_496_729_600));
        assert_eq!(clock.take(900_000_001).0.micros, 90_000_000_100);
    }

    #[test]
    fn a_device_switched_on_anew_has_gone_back() {
        assert_eq!(steps(&[1_000_000, 100, 200]), [-99_990_000, 10_000]);
        assert_eq!(steps(&[800_000_000, 100]), [-79_999_990_000]);
        assert_eq!(steps(&[77, 77]), [0]);
    }
}
