//! Middleware that reopens a link after a loss.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use super::{DeviceError, Link, LinkError, LinkStatus, Traffic};
use crate::time::{Clock, HostTime};

/// Wait before the first attempt to reopen.
pub const FIRST_RETRY: Duration = Duration::from_millis(100);
/// Wait between attempts while the port is not there: it is looked at, and nothing is asked of a device.
pub const ABSENT_RETRY: Duration = Duration::from_millis(200);
/// Longest wait before a port that is there but gives nothing is opened again.
pub const LONGEST_RETRY: Duration = Duration::from_secs(2);

/// When to try again, and what has happened so far.
#[derive(Debug)]
struct Outage {
    /// Pause before the port is opened once more.
    pause: Duration,
    /// When to try again; meaningful while `status.down`.
    retry_at: HostTime,
    status: LinkStatus,
}

impl Outage {
    fn note_loss(&mut self, now: HostTime, kind: io::ErrorKind) {
        self.status.down = true;
        self.status.losses += 1;
        self.status.last_loss = Some(kind);
        self.plan_retry(now);
    }

    fn plan_retry(&mut self, now: HostTime) {
        self.retry_at = now + self.pause;
        self.pause = (self.pause * 2).min(LONGEST_RETRY);
    }
}

/// A link that comes back: after [`LinkError::Lost`] it is silent and tries to reopen.
///
/// A loss is never an error of `receive`; it shows in [`LinkStatus`]. The call that reopens gives no traffic, so that its
/// caller can see that the link is another one before the first traffic of it. The pause doubles from [`FIRST_RETRY`] to
/// [`LONGEST_RETRY`] and starts again at the first traffic, so a port that fails at once or refuses is not hammered. One
/// that is not there is looked for every [`ABSENT_RETRY`], so a device that comes back is soon noticed however long it was
/// away.
pub struct Reconnecting<L, F> {
    opener: F,
    clock: Arc<dyn Clock>,
    link: Option<L>,
    outage: Outage,
    /// What links that are gone had counted.
    past: LinkStatus,
}

impl<L: std::fmt::Debug, F> std::fmt::Debug for Reconnecting<L, F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reconnecting")
            .field("link", &self.link)
            .field("outage", &self.outage)
            .finish_non_exhaustive()
    }
}

impl<L: Link, F: FnMut() -> Result<L, DeviceError> + Send> Reconnecting<L, F> {
    /// Opens the link for the first time.
    ///
    /// # Errors
    /// What `opener` says: the first failure is the user's to see.
    pub fn open(mut opener: F, clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        let link = Some(opener()?);
        let outage = Outage { pause: FIRST_RETRY, retry_at: HostTime(0), status: LinkStatus::default() };
        Ok(Self { opener, clock, link, outage, past: LinkStatus::default() })
    }

    /// Reopens if it is time; otherwise waits, `timeout` at most.
    fn bring_up(&mut self, timeout: Duration) {
        // Only now is the lost link closed: `receive` had lent out its buffer when it failed.
        if let Some(dead) = self.link.take() {
            self.past = dead.status().after(&self.past);
        }
        let now = self.clock.now();
        if now < self.outage.retry_at {
            self.clock.sleep_until(self.outage.retry_at.min(now + timeout));
            return;
        }
        match (self.opener)() {
            Ok(link) => {
                self.link = Some(link);
                self.outage.status.down = false;
                self.outage.status.reconnects += 1;
            }
            Err(error) => {
                let now = self.clock.now();
                if matches!(error, DeviceError::NoSuchPort { .. }) {
                    self.outage.retry_at = now + ABSENT_RETRY;
                } else {
                    self.outage.plan_retry(now);
                }
            }
        }
    }
}

impl<L: Link, F: FnMut() -> Result<L, DeviceError> + Send> Link for Reconnecting<L, F> {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        if self.outage.status.down {
            self.bring_up(timeout);
            return Ok(None);
        }
        let Some(link) = &mut self.link else { return Ok(None) };
        match link.receive(timeout) {
            Ok(Some(piece)) => {
                self.outage.pause = FIRST_RETRY;
                Ok(Some(piece))
            }
            Err(LinkError::Lost { source, .. }) => {
                self.outage.note_loss(self.clock.now(), source.kind());
                Ok(None)
            }
            other => other,
        }
    }

    fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
        let Some(link) = self.link.as_mut().filter(|_| !self.outage.status.down) else { return Ok(()) };
        match link.send(traffic) {
            Err(LinkError::Lost { source, .. }) => {
                self.outage.note_loss(self.clock.now(), source.kind());
                Ok(())
            }
            other => other,
        }
    }

    fn status(&self) -> LinkStatus {
        let LinkStatus { down, last_loss, losses, reconnects, .. } = self.outage.status;
        let inner = self.link.as_ref().map(Link::status).unwrap_or_default();
        LinkStatus { down, last_loss, losses, reconnects, ..inner.after(&self.past) }
    }

    fn port(&self) -> Option<&str> {
        self.link.as_ref().and_then(Link::port)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::testing::{Event, ManualClock, ScriptLink};

    fn refused() -> DeviceError {
        DeviceError::Busy { port: "script".into() }
    }

    fn absent() -> DeviceError {
        DeviceError::NoSuchPort { port: "script".into(), hint: String::new() }
    }

    /// Opens in turn: a link that is lost after one piece, two failures, a link with one piece.
    fn flaky(
        clock: &Arc<ManualClock>,
        failure: fn() -> DeviceError,
    ) -> Reconnecting<ScriptLink, impl FnMut() -> Result<ScriptLink, DeviceError>> {
        let mut attempt = 0;
        let opener = move || {
            attempt += 1;
            match attempt {
                1 => Ok(ScriptLink::new([Event::Silence, Event::Piece(HostTime(1), vec![1]), Event::Lost])),
                2 | 3 => Err(failure()),
                _ => Ok(ScriptLink::new([Event::Piece(HostTime(2), vec![2])])),
            }
        };
        Reconnecting::open(opener, Arc::clone(clock) as Arc<dyn Clock>).expect("opens at first")
    }

    #[test]
    fn a_lost_link_comes_back_after_growing_pauses() {
        let clock = Arc::new(ManualClock::default());
        let mut link = flaky(&clock, refused);
        let timeout = Duration::from_millis(50);
        assert!(link.receive(timeout).expect("silence is no loss").is_none());
        assert!(!link.status().down);
        assert!(link.receive(timeout).expect("up").is_some());
        assert!(link.receive(timeout).expect("a loss is silence").is_none());
        assert_eq!((link.status().down, link.status().losses), (true, 1));
        assert_eq!(link.status().last_loss, Some(io::ErrorKind::BrokenPipe));

        // Attempts at 100, 300 and 700 ms; each call waits at most its timeout.
        let back = loop {
            let before = clock.now();
            if let Some((at, Traffic::Bytes(bytes))) = link.receive(timeout).expect("never an error") {
                break (at, bytes.to_vec());
            }
            assert!(clock.now().saturating_since(before) <= timeout);
        };
        assert_eq!(back, (HostTime(2), vec![2]));
        assert_eq!(clock.now(), HostTime(700_000_000));
        let status = link.status();
        assert_eq!((status.down, status.losses, status.reconnects), (false, 1, 1));
    }

    #[test]
    fn a_port_that_is_not_there_is_looked_for_at_an_even_pace() {
        let clock = Arc::new(ManualClock::default());
        let mut attempts = 0;
        let opener = || {
            attempts += 1;
            if attempts == 1 { Ok(ScriptLink::new([Event::Lost])) } else { Err(absent()) }
        };
        let mut link = Reconnecting::open(opener, Arc::clone(&clock) as Arc<dyn Clock>).expect("opens");
        while clock.now() <= HostTime(20_000_000_000) {
            assert!(link.receive(Duration::from_millis(50)).expect("silence").is_none());
        }
        drop(link);
        // At 0.1 s, then every 0.2 s.
        assert_eq!(attempts, 1 + 100);
    }

    #[test]
    fn a_port_that_takes_long_to_refuse_gets_its_pause_all_the_same() {
        let clock = Arc::new(ManualClock::default());
        let (mut first, slow) = (true, Arc::clone(&clock));
        let opener = move || {
            if std::mem::take(&mut first) {
                return Ok(ScriptLink::new([Event::Lost]));
            }
            slow.sleep_until(slow.now() + Duration::from_secs(2));
            Err(refused())
        };
        let mut link = Reconnecting::open(opener, Arc::clone(&clock) as Arc<dyn Clock>).expect("opens");
        for _ in 0..2 {
            assert!(link.receive(Duration::from_millis(100)).expect("silence").is_none());
        }
        assert_eq!(clock.now(), HostTime(100_000_000));
        assert!(link.receive(Duration::from_millis(50)).expect("silence").is_none());
        assert_eq!(clock.now(), HostTime(2_100_000_000), "refused after 2 s");
        assert!(link.receive(Duration::from_millis(150)).expect("silence").is_none());
        assert_eq!(clock.now(), HostTime(2_250_000_000), "it waits for 2.3 s");
    }

    #[test]
    fn the_first_failure_is_an_error() {
        let clock: Arc<dyn Clock> = Arc::new(ManualClock::default());
        assert!(Reconnecting::<ScriptLink, _>::open(|| Err(refused()), clock).is_err());
    }

    #[test]
    fn a_port_that_fails_at_once_is_not_hammered() {
        let clock = Arc::new(ManualClock::default());
        let mut opened = 0;
        let opener = || {
            opened += 1;
            Ok(ScriptLink::new([Event::Lost]))
        };
        let mut link = Reconnecting::open(opener, Arc::clone(&clock) as Arc<dyn Clock>).expect("opens");
        while clock.now() < HostTime(20_000_000_000) {
            assert!(link.receive(Duration::from_millis(100)).expect("silence").is_none());
        }
        drop(link);
        // 0.1 + 0.2 + 0.4 + 0.8 + 1.6 s, then every 2 s.
        assert!((13..=15).contains(&opened), "opened {opened} times in 20 s");
    }
}
