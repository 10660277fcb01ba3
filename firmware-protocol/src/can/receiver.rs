//! From frames of a shared bus to samples of one device.

use super::clock::{TickClock, Verdict};
use super::{CanError, CanMessage, HalfSample, Ids, TICK_US, Time};

/// One sample put together from its two halves, in counts of DESC's full scale / 32768. Sensor frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanSample {
    /// Device time, µs, in steps of 10, unwrapped. It counts from the device's power-up if TIME was the first
    /// message, else from an arbitrary moment; only [`CanEvent::DeviceRestarted`] sets it back.
    pub time_us: u64,
    /// Angular rate about x, y, z, counts.
    pub gyro: [i16; 3],
    /// Specific force along x, y, z, counts.
    pub accel: [i16; 3],
}

/// What a [`CanReceiver`] found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanEvent {
    /// A pair of GYRO and ACCEL.
    Sample(CanSample),
    /// Any other message.
    Message(CanMessage),
    /// The device's clock has started again; the TIME that showed it follows. Samples since the last TIME may carry
    /// times of the old count.
    DeviceRestarted,
    /// A frame of this device that this version cannot read.
    Unreadable {
        /// Offset of its identifier from the base.
        offset: u16,
        /// What is wrong with it.
        error: CanError,
    },
}

/// What a [`CanReceiver`] has counted. Nothing is lost silently.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CanCounters {
    /// Frames of this device that could be read.
    pub frames: u64,
    /// Pairs of GYRO and ACCEL.
    pub samples: u64,
    /// Halves whose partner did not come.
    pub lone_halves: u64,
    /// Halves that came once more, as a bus may deliver them after an error in the last bit of a frame; not used.
    pub repeated: u64,
    /// GYRO and ACCEL frames that the device sent and that did not arrive, by TIME's count. Final once a TIME has
    /// followed; a loss of a multiple of 65536 between two TIME messages does not show.
    pub lost: u64,
    /// Frames of this device with a page or version this receiver does not know.
    pub unknown: u64,
    /// Frames of this device with a length other than 8.
    pub malformed: u64,
    /// Frames of others: normal on a shared bus.
    pub foreign: u64,
    /// Starts of the device's clock after the first.
    pub restarts: u64,
}

/// Which half of a sample waits for the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Half {
    Gyro,
    Accel,
}

/// Compares TIME's `frames_sent` with the halves that arrived.
#[derive(Clone, Copy, Debug)]
struct EndToEnd {
    /// `frames_sent` of the last TIME.
    sent: Option<u16>,
    /// Halves since then.
    received: u64,
    /// Sent minus received since the count began. Below `lost` for a while if a half overtook its TIME.
    balance: i64,
}

/// Follows one device on a CAN bus. Any frames are legal input.
#[derive(Clone, Debug)]
pub struct CanReceiver {
    ids: Ids,
    clock: TickClock,
    waiting: Option<(Half, HalfSample)>,
    /// The last GYRO and the last ACCEL, to know them when they come again.
    newest: [Option<HalfSample>; 2],
    end_to_end: EndToEnd,
    counters: CanCounters,
}

impl CanReceiver {
    /// A receiver for the device with these identifiers.
    #[must_use]
    pub const fn new(ids: Ids) -> Self {
        Self {
            ids,
            clock: TickClock::new(),
            waiting: None,
            newest: [None; 2],
            end_to_end: EndToEnd { sent: None, received: 0, balance: 0 },
            counters: CanCounters {
                frames: 0,
                samples: 0,
                lone_halves: 0,
                repeated: 0,
                lost: 0,
                unknown: 0,
                malformed: 0,
                foreign: 0,
                restarts: 0,
            },
        }
    }

    /// Everything counted so far.
    #[must_use]
    pub const fn counters(&self) -> CanCounters {
        self.counters
    }

    /// Takes the next data frame with an 11-bit identifier and calls `on_event` for what it completes: at most two
    /// events. Frames with 29-bit identifiers belong to others; do not pass them.
    pub fn push(&mut self, id: u32, data: &[u8], mut on_event: impl FnMut(CanEvent)) {
        let Some(offset) = self.ids.offset_of(id) else {
            self.counters.foreign += 1;
            return;
        };
        let message = match CanMessage::decode(offset, data) {
            Ok(message) => message,
            Err(error) => {
                match error {
                    CanError::Length { .. } => self.counters.malformed += 1,
                    _ => self.counters.unknown += 1,
                }
                on_event(CanEvent::Unreadable { offset, error });
                return;
            }
        };
        self.counters.frames += 1;
        match message {
            CanMessage::Gyro(half) => self.pair(Half::Gyro, half, on_event),
            CanMessage::Accel(half) => self.pair(Half::Accel, half, on_event),
            CanMessage::Time(time) => {
                self.check_time(time, &mut on_event);
                on_event(CanEvent::Message(message));
            }
            _ => on_event(CanEvent::Message(message)),
        }
    }

    /// Joins a half with the one that waits, or lets it wait.
    fn pair(&mut self, kind: Half, half: HalfSample, mut on_event: impl FnMut(CanEvent)) {
        if self.newest[kind as usize].replace(half) == Some(half) {
            self.counters.repeated += 1;
            return;
        }
        self.end_to_end.received += 1;
        let (gyro, accel) = match (self.waiting.take(), kind) {
            (Some((Half::Gyro, gyro)), Half::Accel) if gyro.tick == half.tick => (gyro.xyz, half.xyz),
            (Some((Half::Accel, accel)), Half::Gyro) if accel.tick == half.tick => (half.xyz, accel.xyz),
            (abandoned, _) => {
                self.counters.lone_halves += u64::from(abandoned.is_some());
                self.waiting = Some((kind, half));
                return;
            }
        };
        self.counters.samples += 1;
        let time_us = self.clock.extended(half.tick) * TICK_US;
        on_event(CanEvent::Sample(CanSample { time_us, gyro, accel }));
    }

    /// Checks ticks and number of frames against the device's own account.
    fn check_time(&mut self, time: Time, on_event: &mut impl FnMut(CanEvent)) {
        let count = &mut self.end_to_end;
        let received = core::mem::take(&mut count.received);
        let sent_before = count.sent.replace(time.frames_sent);
        if self.clock.check(time.time_10us) == Verdict::Restarted {
            // The device's count started again too: this interval cannot be judged.
            count.balance = self.counters.lost as i64;
            self.counters.restarts += 1;
            on_event(CanEvent::DeviceRestarted);
        } else if let Some(before) = sent_before {
            let sent = time.frames_sent.wrapping_sub(before);
            count.balance += i64::from(sent) - received as i64;
            self.counters.lost = self.counters.lost.max(count.balance.max(0) as u64);
        }
    }
}
