//! Middleware that damages traffic on purpose, the same way for the same seed.

use std::io;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::buffer::TrafficBuffer;
use super::{DeviceError, Link, LinkError, LinkStatus, Noise, Traffic};
use crate::time::HostTime;

mod wrong_baud;

pub use wrong_baud::WrongBaud;

/// A span of the run, in the time of the traffic's stamps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultSpan {
    /// Start, s from the start of the run.
    pub at_s: f64,
    /// Length, s.
    pub length_s: f64,
}

impl FaultSpan {
    fn start(&self) -> HostTime {
        HostTime::from_secs_f64(self.at_s)
    }

    fn end(&self) -> HostTime {
        HostTime::from_secs_f64(self.at_s + self.length_s)
    }

    fn contains(&self, at: HostTime) -> bool {
        (self.start()..self.end()).contains(&at)
    }
}

/// What goes wrong. The default is nothing. All probabilities lie in 0 to 1 and count per piece of traffic.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FaultPlan {
    /// Seed of all chances.
    pub seed: u64,
    /// Probability that a piece is lost.
    pub drop: f64,
    /// Probability, per byte, that one of its bits flips. A CAN frame with a flipped bit is lost, because the
    /// controller checks it; bytes arrive flipped.
    pub bit_flip_per_byte: f64,
    /// Probability that a piece arrives twice.
    pub duplicate: f64,
    /// Probability that a piece, and with it all behind it, arrives late.
    pub delay: f64,
    /// Longest such delay, s; each is uniform from zero to this.
    pub delay_s: f64,
    /// Probability that the connection is lost at a piece, for `disconnect_s`.
    pub disconnect: f64,
    /// Length of such a loss, s.
    pub disconnect_s: f64,
    /// Spans in which nothing arrives until their end, when everything arrives at once.
    pub stalls: Vec<FaultSpan>,
    /// Spans in which the connection is lost and so is all traffic.
    pub disconnects: Vec<FaultSpan>,
    /// The host listens at the wrong speed: every piece of bytes is misread. The line is idle between pieces.
    pub wrong_baud: Option<WrongBaud>,
}

impl FaultPlan {
    /// Checks every range.
    ///
    /// # Errors
    /// [`DeviceError::Range`] naming the first value out of its range.
    pub fn validate(&self) -> Result<(), DeviceError> {
        const LONGEST_S: f64 = 86_400.0;
        for (what, probability) in [
            ("drop", self.drop),
            ("bit_flip_per_byte", self.bit_flip_per_byte),
            ("duplicate", self.duplicate),
            ("delay", self.delay),
            ("disconnect", self.disconnect),
        ] {
            DeviceError::check_range(what, probability, 0.0..=1.0)?;
        }
        DeviceError::check_range("delay_s", self.delay_s, 0.0..=LONGEST_S)?;
        DeviceError::check_range("disconnect_s", self.disconnect_s, 0.0..=LONGEST_S)?;
        for span in self.stalls.iter().chain(&self.disconnects) {
            DeviceError::check_range("at_s", span.at_s, 0.0..=LONGEST_S)?;
            DeviceError::check_range("length_s", span.length_s, 0.0..=LONGEST_S)?;
        }
        self.wrong_baud.map_or(Ok(()), |wrong| wrong.validate())
    }
}

/// A link with faults. A lost connection looks as it does behind [`super::reconnect::Reconnecting`]: silence, and
/// [`LinkStatus::down`].
///
/// Put [`super::pacer::Paced`] outside to feel delays and stalls in real time.
#[derive(Debug)]
pub struct FaultInjector<L> {
    link: L,
    plan: FaultPlan,
    noise: Noise,
    piece: TrafficBuffer,
    /// What the wrong baud rate makes of the piece.
    misread: Vec<u8>,
    /// The piece in `piece` is due once more, with this stamp.
    again: Option<HostTime>,
    /// Latest stamp given out: a late piece holds up those behind it.
    last: HostTime,
    /// End of a loss by chance.
    down_until: HostTime,
    down: bool,
    losses: u64,
    reconnects: u64,
}

impl<L: Link> FaultInjector<L> {
    /// Damages the traffic of `link` as `plan` says.
    ///
    /// # Errors
    /// [`DeviceError::Range`] for a value out of its range.
    pub fn new(link: L, plan: FaultPlan) -> Result<Self, DeviceError> {
        plan.validate()?;
        Ok(Self {
            link,
            noise: Noise::new(plan.seed),
            plan,
            piece: TrafficBuffer::default(),
            misread: Vec::new(),
            again: None,
            last: HostTime(0),
            down_until: HostTime(0),
            down: false,
            losses: 0,
            reconnects: 0,
        })
    }

    /// True while the connection is lost, by plan or by chance.
    fn is_down(&mut self, at: HostTime) -> bool {
        if self.noise.chance(self.plan.disconnect) {
            self.down_until = at + Duration::from_secs_f64(self.plan.disconnect_s);
        }
        let down = at < self.down_until || self.plan.disconnects.iter().any(|span| span.contains(at));
        self.losses += u64::from(down && !self.down);
        self.reconnects += u64::from(self.down && !down);
        self.down = down;
        down
    }

    /// When a piece stamped `at` arrives.
    fn arrival(&mut self, at: HostTime) -> HostTime {
        let mut arrival = at;
        if self.noise.chance(self.plan.delay) {
            arrival = arrival + Duration::from_secs_f64(self.noise.uniform() * self.plan.delay_s);
        }
        for stall in self.plan.stalls.iter().filter(|stall| stall.contains(at)) {
            arrival = arrival.max(stall.end());
        }
        self.last = self.last.max(arrival);
        self.last
    }

    /// Reads the piece in hand at the wrong speed; false when nothing is left of it.
    fn misread(&mut self) -> bool {
        let (Some(wrong), Traffic::Bytes(sent)) = (&self.plan.wrong_baud, self.piece.traffic()) else {
            return true;
        };
        self.misread.clear();
        wrong.misread(sent, &mut self.misread);
        self.piece.store(Traffic::Bytes(&self.misread));
        !self.misread.is_empty()
    }

    /// Flips bits of the piece in hand; true if there was at least one.
    fn flip_bits(&mut self) -> bool {
        let mut flipped = false;
        if self.plan.bit_flip_per_byte > 0.0 {
            for byte in self.piece.data_mut() {
                if self.noise.chance(self.plan.bit_flip_per_byte) {
                    *byte ^= 1 << (self.noise.next_u32() % 8);
                    flipped = true;
                }
            }
        }
        flipped
    }
}

impl<L: Link> Link for FaultInjector<L> {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        if let Some(at) = self.again.take() {
            return Ok(Some((at, self.piece.traffic())));
        }
        let Some((at, traffic)) = self.link.receive(timeout)? else { return Ok(None) };
        self.piece.store(traffic);
        if self.is_down(at) || self.noise.chance(self.plan.drop) || !self.misread() {
            return Ok(None);
        }
        let flipped = self.flip_bits();
        if flipped && matches!(self.piece.traffic(), Traffic::CanFrame { .. }) {
            return Ok(None);
        }
        let at = self.arrival(at);
        self.again = self.noise.chance(self.plan.duplicate).then_some(at);
        Ok(Some((at, self.piece.traffic())))
    }

    fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
        if self.down { Ok(()) } else { self.link.send(traffic) }
    }

    fn status(&self) -> LinkStatus {
        let inner = self.link.status();
        LinkStatus {
            down: inner.down || self.down,
            last_loss: if self.losses > 0 { Some(io::ErrorKind::NotConnected) } else { inner.last_loss },
            losses: inner.losses + self.losses,
            reconnects: inner.reconnects + self.reconnects,
            ..inner
        }
    }

    fn port(&self) -> Option<&str> {
        self.link.port()
    }
}

#[cfg(test)]
mod tests;
