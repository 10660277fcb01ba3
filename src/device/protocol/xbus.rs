//! Xbus with MTData2: Xsens (Movella) MTi on a serial line.
//!
//! A message, all numbers big-endian:
//!
//! | bytes | what |
//! |---|---|
//! | 1 | preamble `FA` |
//! | 1 | bus identifier (BID) `FF` |
//! | 1 | message identifier (MID) |
//! | 1 or 3 | length of the data: one byte, or `FF` and 16 bits (255 to 2048) |
//! | n | data |
//! | 1 | checksum: everything after the preamble, checksum included, sums to 0 modulo 256 |
//!
//! MID 36 (MTData2) holds items of `DID u16 | size u8 | data`; the lowest four bits of a data identifier tell number
//! format (0 float32, 1 fp12.20, 2 fp16.32, 3 float64) and axes (+4 NED, +8 NWU: of orientations only).
//!
//! | DID | what | used as |
//! |---|---|---|
//! | 1020 | PacketCounter u16, counts every MTData2 | loss |
//! | 1010 | UtcTime u32 ns, u16 year, u8 month, day, hour, minute, second, flags | device time without 1060 |
//! | 1060 | SampleTimeFine u32, 100 µs | device time, of packets with a sample alone: in GNSS packets it is another time |
//! | 4020, 4040 | acceleration 3 × m/s² (4040: high rate) | specific force |
//! | 8020, 8040 | rate of turn 3 × rad/s (8040: high rate) | angular velocity |
//! | E020 | status u32; bits 8 to 10 accelerometer, 11 to 13 gyroscope at the end of its range | clipped |
//! | 4010, 8030 | increments over a sample | nothing: what they are without 4020 or 8020 is said in words |
//! | 4030 | acceleration without gravity | nothing: it is no specific force |
//!
//! Other messages are packets without samples: 3E WakeUp, 42 Error, and the answers to commands, whose MID is odd.
//!
//! Source: MT Low Level Communication Protocol Documentation (MT0101P), as in `spec/devices.md`, section 3.2.

use nalgebra::Vector3;

use super::calendar::Moment;
use super::frames::FrameScanner;
use super::halves::Halves;
use super::period::PeriodWatch;
use super::{DecodeCounters, DeviceTime, ImuReading, PacketDecoder};
use crate::device::Traffic;

mod clock;
pub(in crate::device) mod frame;
mod kind;
mod number;

use clock::SampleClock;
use frame::Message;

/// Bits 8 to 13 of the status word: an axis of the accelerometer or gyroscope is at the end of its range. Bits 14 to 16
/// are the magnetometer's.
const CLIPPED: u32 = 0x3F00;
/// A packet up to this far behind the newest was overtaken; one further back comes from a device that started anew.
const LATEST_PACKETS: u16 = 16;
/// The same by the device's clock, µs.
const LATEST_US: i64 = 1_000_000;
/// A packet counter that moves on by more, half of what it can hold, has gone back: the device has started anew.
const LONGEST_GAP: u16 = 1 << 15;

/// Decodes MTData2.
///
/// A packet with angular velocity and specific force is a sample; see `halves` for one without the other. Specific
/// force is in sensor axes, +9.81 m/s² on the axis that points up at rest.
#[derive(Debug, Default)]
pub struct XbusDecoder {
    scanner: FrameScanner<{ frame::LONGEST_MESSAGE }>,
    content: Content,
}

impl XbusDecoder {
    /// A decoder that has seen nothing yet.
    pub fn new() -> Self {
        Self::default()
    }
}

/// What an MTData2 packet holds of what is used here.
#[derive(Clone, Copy, Debug, Default)]
struct Packet {
    counter: Option<u16>,
    ticks: Option<u32>,
    utc_us: Option<u64>,
    omega: Option<Vector3<f64>>,
    force: Option<Vector3<f64>>,
    clipped: bool,
}

/// Kinds of output the device has sent, for words about those that are missing.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    packets: bool,
    omega: bool,
    force: bool,
    free_acceleration: bool,
    delta_v: bool,
    delta_q: bool,
    legacy: bool,
}

/// What the messages say, apart from how they are found.
#[derive(Debug, Default)]
struct Content {
    halves: Halves,
    clock: SampleClock,
    /// UTC at the last sample of a device without the other clock.
    utc: Option<DeviceTime>,
    /// Packet counter of the last packet.
    counter: Option<u16>,
    /// Packets that are missing by the counter.
    missing: u64,
    /// Loss by the clock, for a device that sends no packet counter.
    period: PeriodWatch,
    seen: Seen,
    /// Messages in the layout before MTData2.
    unreadable: u64,
    device_errors: u64,
    last_error: Option<u8>,
    /// Bytes on the wire of the last packet with a sample.
    bytes_per_sample: Option<usize>,
}

impl Content {
    fn take(&mut self, frame: &[u8], on_reading: &mut dyn FnMut(ImuReading)) {
        let Some(message) = Message::of_frame(frame) else { return };
        match message.id {
            frame::MT_DATA2 => self.take_packet(message.data, frame.len(), on_reading),
            frame::MT_DATA => {
                self.seen.legacy = true;
                self.unreadable += 1;
            }
            frame::ERROR => {
                self.device_errors += 1;
                self.last_error = message.data.first().copied();
            }
            // The counter starts anew.
            frame::WAKE_UP | frame::GO_TO_MEASUREMENT_ACK => self.counter = None,
            _ => {}
        }
    }

    fn take_packet(&mut self, data: &[u8], wire_bytes: usize, on_reading: &mut dyn FnMut(ImuReading)) {
        let packet = self.read(data);
        let motion = self.halves.join(packet.omega, packet.force);
        // Only a packet of the inertial sensors carries the time of this sample.
        let (device_time, step_us) = motion.and_then(|_| self.time(&packet)).unzip();
        self.count(packet.counter, step_us);
        let Some((omega_imu, specific_force_imu)) = motion else { return };
        self.bytes_per_sample = Some(wire_bytes);
        on_reading(ImuReading { device_time, omega_imu, specific_force_imu, clipped: packet.clipped });
    }

    /// Time of a sample, with the step from the sample before, µs.
    fn time(&mut self, packet: &Packet) -> Option<(DeviceTime, i64)> {
        if let Some(ticks) = packet.ticks {
            return Some(self.clock.take(ticks));
        }
        let time = DeviceTime { micros: packet.utc_us?, wraps_after_us: None };
        let step_us = self.utc.replace(time).map_or(0, |last| time.micros_since(last));
        Some((time, step_us))
    }

    fn read(&mut self, data: &[u8]) -> Packet {
        let mut packet = Packet::default();
        let (mut omega_hr, mut force_hr) = (None, None);
        for item in frame::items(data) {
            match kind::of(item.id) {
                kind::PACKET_COUNTER => {
                    packet.counter = item.data.first_chunk().map(|bytes| u16::from_be_bytes(*bytes));
                }
                kind::SAMPLE_TIME_FINE => packet.ticks = word(item.data),
                kind::UTC_TIME => packet.utc_us = utc_us(item.data),
                kind::STATUS_WORD => {
                    packet.clipped = word(item.data).is_some_and(|word| word & CLIPPED != 0);
                }
                kind::ACCELERATION => packet.force = number::vector(item.id, item.data),
                kind::ACCELERATION_HR => force_hr = number::vector(item.id, item.data),
                kind::RATE_OF_TURN => packet.omega = number::vector(item.id, item.data),
                kind::RATE_OF_TURN_HR => omega_hr = number::vector(item.id, item.data),
                kind::FREE_ACCELERATION => self.seen.free_acceleration = true,
                kind::DELTA_V => self.seen.delta_v = true,
                kind::DELTA_Q => self.seen.delta_q = true,
                _ => {}
            }
        }
        packet.omega = packet.omega.or(omega_hr);
        packet.force = packet.force.or(force_hr);
        self.seen.packets = true;
        self.seen.omega |= packet.omega.is_some();
        self.seen.force |= packet.force.is_some();
        packet
    }

    /// Counts what is missing before a packet. `step_us` is the step of the clock, where the packet has a sample and
    /// its time.
    fn count(&mut self, counter: Option<u16>, step_us: Option<i64>) {
        let has_restarted = step_us.is_some_and(|step_us| step_us < 0);
        if let Some(counter) = counter {
            let step = self.counter.map(|last| counter.wrapping_sub(last));
            let overtaken = step_us.is_none_or(|step_us| step_us > -LATEST_US);
            if step.is_some_and(|step| step > u16::MAX - LATEST_PACKETS) && overtaken {
                // The gap it left has been counted.
                self.missing = self.missing.saturating_sub(1);
                return;
            }
            self.counter = Some(counter);
            if let Some(step @ 1..=LONGEST_GAP) = step.filter(|_| !has_restarted) {
                self.missing += u64::from(step - 1);
            }
        } else if let Some(step_us) = step_us.filter(|_| self.counter.is_none()) {
            self.period.step(u64::try_from(step_us).unwrap_or(0));
        }
    }

    fn notes(&self) -> Vec<String> {
        let seen = &self.seen;
        let mut notes = Vec::new();
        if let Some(code) = self.last_error {
            notes.push(format!("the device reported error {code:#04x}: {}", error_text(code)));
        }
        if seen.legacy {
            notes.push(
                "the device sends MTData, which does not tell its layout: set it to MTData2".to_owned(),
            );
        }
        if seen.packets && !seen.omega {
            let instead = if seen.delta_q { "orientation increments (8030) only" } else { "no rotation" };
            notes.push(format!("{instead}: the output configuration lacks RateOfTurn (8020)"));
        }
        if seen.packets && !seen.force {
            let instead = match (seen.free_acceleration, seen.delta_v) {
                (true, _) => "free acceleration (4030) only: gravity is removed, so it is no specific force",
                (false, true) => "velocity increments (4010) only, which are no specific force",
                (false, false) => "no specific force",
            };
            notes.push(format!("{instead}: the output configuration lacks Acceleration (4020)"));
        }
        notes
    }
}

fn word(data: &[u8]) -> Option<u32> {
    data.first_chunk().map(|bytes| u32::from_be_bytes(*bytes))
}

/// UtcTime as µs since 2000, whether or not it has been set by a satellite receiver: it goes on evenly either way.
fn utc_us(data: &[u8]) -> Option<u64> {
    let &[n3, n2, n1, n0, y1, y0, month, day, hour, minute, second, _flags] = data else { return None };
    let year = u8::try_from(u16::from_be_bytes([y1, y0]).checked_sub(2000)?).ok()?;
    let micros = u32::from_be_bytes([n3, n2, n1, n0]) / 1000;
    Moment { year, month, day, hour, minute, second, micros }.micros_since_2000()
}

/// What an error message of the device says.
pub(in crate::device) fn error_text(code: u8) -> &'static str {
    match code {
        0x03 => "period out of range",
        0x04 => "message not valid",
        0x1E => "timer overflow: output rate too high, or too many commands while it measures",
        0x20 => "baud rate not offered",
        0x21 => "parameter not valid or out of range",
        0x28 => "device error: new firmware may help",
        0x29 => "more data than the line carries: baud rate too low",
        0x2A => "buffer overflow: the line was blocked too long",
        _ => "unknown code",
    }
}

impl PacketDecoder for XbusDecoder {
    fn protocol(&self) -> &'static str {
        super::detect::XBUS
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        let Self { scanner, content, .. } = self;
        scanner.take(traffic, frame::look, |frame| content.take(frame, on_reading));
    }

    fn counters(&self) -> DecodeCounters {
        let content = &self.content;
        DecodeCounters {
            missing: content.missing + content.period.missing(),
            unknown: content.unreadable,
            lone_halves: content.halves.lone(),
            device_errors: content.device_errors,
            ..self.scanner.counters().into()
        }
    }

    fn wire_bytes_per_sample(&self) -> Option<f64> {
        self.content.bytes_per_sample.map(|bytes| bytes as f64)
    }

    fn rejoin(&mut self) {
        self.scanner.rejoin();
        self.content.counter = None;
        self.content.period.restart();
    }

    fn finish(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        let Self { scanner, content, .. } = self;
        scanner.finish(frame::look, |frame| content.take(frame, on_reading));
    }

    fn notes(&self) -> Vec<String> {
        self.content.notes()
    }
}

#[cfg(test)]
mod tests;
