//! Middleware that plays traffic in real time.

use std::sync::Arc;
use std::time::Duration;

use super::buffer::TrafficBuffer;
use super::{DeviceError, Link, LinkError, LinkStatus, Traffic};
use crate::time::{Clock, HostTime};

/// Releases each piece of traffic no earlier than its stamp, and stamps it anew with the clock.
///
/// Stamp zero is the moment of the first `receive`. With `speed` 2 the traffic runs twice as fast.
pub struct Paced<L> {
    link: L,
    clock: Arc<dyn Clock>,
    speed: f64,
    /// Clock reading that stands for stamp zero.
    origin: Option<HostTime>,
    /// Release time of the piece held in `piece`.
    due: Option<HostTime>,
    piece: TrafficBuffer,
}

impl<L: std::fmt::Debug> std::fmt::Debug for Paced<L> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Paced").field("link", &self.link).field("speed", &self.speed).finish_non_exhaustive()
    }
}

impl<L: Link> Paced<L> {
    /// Plays `link` at `speed` times real time.
    ///
    /// # Errors
    /// [`DeviceError::Range`] unless `speed` lies in 0.001 to 1000.
    pub fn new(link: L, clock: Arc<dyn Clock>, speed: f64) -> Result<Self, DeviceError> {
        let speed = DeviceError::check_range("speed", speed, 1e-3..=1e3)?;
        Ok(Self { link, clock, speed, origin: None, due: None, piece: TrafficBuffer::default() })
    }
}

impl<L: Link> Link for Paced<L> {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        let deadline = self.clock.now() + timeout;
        let origin = *self.origin.get_or_insert_with(|| self.clock.now());
        let due = match self.due {
            Some(due) => due,
            None => {
                let Some((stamp, traffic)) = self.link.receive(timeout)? else { return Ok(None) };
                self.piece.store(traffic);
                *self.due.insert(origin + Duration::from_nanos((stamp.0 as f64 / self.speed) as u64))
            }
        };
        if due > deadline {
            self.clock.sleep_until(deadline);
            return Ok(None);
        }
        self.clock.sleep_until(due);
        self.due = None;
        Ok(Some((self.clock.now(), self.piece.traffic())))
    }

    fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
        self.link.send(traffic)
    }

    fn status(&self) -> LinkStatus {
        self.link.status()
    }

    fn port(&self) -> Option<&str> {
        self.link.port()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::testing::{ManualClock, ScriptLink, drain};

    fn paced(speed: f64) -> (Arc<ManualClock>, Paced<ScriptLink>) {
        let clock = Arc::new(ManualClock::default());
        clock.set(HostTime(5_000_000));
        let link = Paced::new(ScriptLink::pieces(100), Arc::clone(&clock) as Arc<dyn Clock>, speed);
        (clock, link.expect("a speed in range"))
    }

    #[test]
    fn pieces_come_at_their_stamps_from_the_first_call_on() {
        let (clock, mut link) = paced(1.0);
        let stamps: Vec<u64> = drain(&mut link).into_iter().map(|(at, _)| at.0).collect();
        let expected: Vec<u64> = (0..100).map(|i| 5_000_000 + i * 1_000_000).collect();
        assert_eq!(stamps, expected);
        assert_eq!(clock.now(), HostTime(104_000_000));
    }

    #[test]
    fn speed_scales_the_stamps() {
        let (_, mut link) = paced(4.0);
        assert_eq!(drain(&mut link)[8].0, HostTime(5_000_000 + 2_000_000));
    }

    #[test]
    fn a_call_never_waits_past_its_timeout_and_loses_nothing() {
        let (clock, mut link) = paced(0.1);
        let timeout = Duration::from_millis(3);
        let mut count = 0;
        loop {
            let before = clock.now();
            match link.receive(timeout) {
                Ok(Some(_)) => count += 1,
                Ok(None) => {}
                Err(_) => break,
            }
            assert!(clock.now().saturating_since(before) <= timeout);
        }
        assert_eq!(count, 100);
    }

    #[test]
    fn a_late_reader_gets_everything_at_once() {
        let (clock, mut link) = paced(1.0);
        assert!(link.receive(Duration::ZERO).expect("plays").is_some());
        clock.set(HostTime(200_000_000));
        for _ in 1..100 {
            let (at, _) = link.receive(Duration::ZERO).expect("plays").expect("due already");
            assert_eq!(at, HostTime(200_000_000));
        }
    }

    #[test]
    fn a_speed_that_is_none_is_refused() {
        for speed in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let clock = Arc::new(ManualClock::default());
            let error =
                Paced::new(ScriptLink::pieces(1), clock, speed).expect_err("out of range").to_string();
            assert!(error.starts_with("speed = "), "{error}");
        }
    }
}
