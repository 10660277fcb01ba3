//! Device time from ticks of 16 bits and TIME messages of 32 bits, in 10 µs units.

/// How far a frame may lie behind the newest one. Later frames of one device are not older than earlier ones by
/// more than its transmit queue is long; the rest of the tick's period is left to look ahead.
const BEHIND: u16 = 8192;

/// Longest silence between two TIME messages; a longer step is a device that started again (10 min).
const LONGEST_SILENCE: u32 = 60_000_000;

/// What TIME says about the ticks before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// They agree.
    Agrees,
    /// The device's clock has started again.
    Restarted,
}

/// The device's clock, unwrapped. Its low 16 bits always equal the device's tick.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TickClock {
    newest: Option<u64>,
    last_time: Option<(u32, u64)>,
}

impl TickClock {
    /// A clock that knows nothing.
    pub(super) const fn new() -> Self {
        Self { newest: None, last_time: None }
    }

    /// Time of a tick: the one closest to the newest time known, at most [`BEHIND`] before it.
    ///
    /// After a silence of more than 573 ms it is too early by a multiple of 655.36 ms until the next TIME. The
    /// first tick of a stream starts the count at its own value.
    pub(super) fn extended(&mut self, tick: u16) -> u64 {
        let Some(newest) = self.newest else {
            self.newest = Some(u64::from(tick));
            return u64::from(tick);
        };
        let behind = (newest as u16).wrapping_sub(tick);
        if behind <= BEHIND {
            newest.saturating_sub(u64::from(behind))
        } else {
            let ahead = newest + u64::from(tick.wrapping_sub(newest as u16));
            self.newest = Some(ahead);
            ahead
        }
    }

    /// Takes the content of a TIME message and checks the ticks against it.
    pub(super) fn check(&mut self, time_10us: u32) -> Verdict {
        let Some((last_device, last_unwrapped)) = self.last_time else {
            // Counting from the first tick goes on: time must not jump because TIME comes late. Only a stream
            // that begins with TIME has the device's own epoch.
            let unwrapped = match self.newest {
                None => *self.newest.insert(u64::from(time_10us)),
                Some(_) => self.extended(time_10us as u16),
            };
            self.last_time = Some((time_10us, unwrapped));
            return Verdict::Agrees;
        };
        let step = time_10us.wrapping_sub(last_device);
        let unwrapped = last_unwrapped + u64::from(step);
        let newest = self.newest.unwrap_or(unwrapped);
        if step > LONGEST_SILENCE || newest > unwrapped + u64::from(BEHIND) {
            *self = Self {
                newest: Some(u64::from(time_10us)),
                last_time: Some((time_10us, u64::from(time_10us))),
            };
            return Verdict::Restarted;
        }
        self.newest = Some(newest.max(unwrapped));
        self.last_time = Some((time_10us, unwrapped));
        Verdict::Agrees
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_unwrap_forward_and_slightly_back() {
        let mut clock = TickClock::new();
        assert_eq!(clock.extended(65_500), 65_500);
        assert_eq!(clock.extended(64), 65_600);
        assert_eq!(clock.extended(65_500), 65_500, "36 ticks late");
        assert_eq!(clock.extended(164), 65_700, "a late tick does not turn the clock back");
    }

    #[test]
    fn first_tick_after_a_late_start_never_underflows() {
        let mut clock = TickClock::new();
        assert_eq!(clock.extended(3), 3);
        assert_eq!(clock.extended(65_530), 0);
    }

    #[test]
    fn time_carries_over_a_silence_longer_than_the_tick() {
        let mut clock = TickClock::new();
        assert_eq!(clock.check(1_000_000), Verdict::Agrees);
        assert_eq!(clock.extended((1_000_100 % 65_536) as u16), 1_000_100);
        assert_eq!(clock.check(1_500_000), Verdict::Agrees);
        assert_eq!(clock.extended((1_500_100 % 65_536) as u16), 1_500_100);
    }

    #[test]
    fn time_wraps_after_32_bits() {
        let mut clock = TickClock::new();
        assert_eq!(clock.check(u32::MAX - 9), Verdict::Agrees);
        assert_eq!(clock.check(9_990), Verdict::Agrees);
        assert_eq!(clock.extended(9_990), (1 << 32) + 9_990);
    }

    #[test]
    fn counting_goes_on_when_time_comes_late() {
        let mut clock = TickClock::new();
        let first = clock.extended((7_000_000u32 % 65_536) as u16);
        assert_eq!(clock.check(7_000_050), Verdict::Agrees);
        assert_eq!(clock.extended((7_000_100u32 % 65_536) as u16), first + 100);
    }

    #[test]
    fn a_restart_is_seen_by_the_time_or_by_the_ticks() {
        let mut clock = TickClock::new();
        clock.check(1_000_000);
        assert_eq!(clock.check(500), Verdict::Restarted);
        assert_eq!(clock.extended(600), 600);

        // Power-up 50 ms before: TIME alone still goes forward, the ticks do not.
        let mut clock = TickClock::new();
        clock.check(5_000);
        clock.extended(14_900);
        clock.extended(100);
        assert_eq!(clock.check(10_000), Verdict::Restarted);
        assert_eq!(clock.extended(10_100), 10_100);
    }
}
