//! MAVLink 2 (and 1): the inertial sensor of an autopilot.
//!
//! | MAVLink 2 | MAVLink 1 | meaning |
//! |---|---|---|
//! | `FD` | `FE` | sync |
//! | u8 | u8 | bytes of payload; MAVLink 2 leaves zeros at its end out |
//! | u8 | - | incompatibility flags: bit 0 signed; a frame with any other is none of ours |
//! | u8 | - | compatibility flags, not needed |
//! | u8 | u8 | sequence number, of all messages of one component |
//! | u8, u8 | u8, u8 | system, component |
//! | u24 LE | u8 | message |
//! | .. | .. | payload |
//! | u16 LE | u16 LE | CRC-16/MCRF4XX over everything after the sync byte, then over the message's `crc_extra` |
//! | 13 bytes | - | signature, if bit 0 of the incompatibility flags says so; not checked, so that damage in it may cost the next frame |
//!
//! | message | used (little-endian) |
//! |---|---|
//! | RAW_IMU 27 | u64 µs, 3 × i16 acceleration, 3 × i16 angular rate; at 26 u8 sensor |
//! | SCALED_IMU 26, SCALED_IMU2 116, SCALED_IMU3 129 | u32 ms, 3 × i16 mg, 3 × i16 mrad/s |
//! | HIGHRES_IMU 105 | u64 µs, 3 × f32 m/s², 3 × f32 rad/s; at 60 u16 fields updated, at 62 u8 sensor |
//! | HEARTBEAT 0 | at 5 u8 autopilot |
//!
//! The sensor frame is the body frame x forward, y right, z down; the accelerometer reads -1 g on z at rest, which is
//! specific force. Rates are set by whoever commands the vehicle (MAV_CMD_SET_MESSAGE_INTERVAL): otolith does not
//! configure autopilots and never writes to one. Source: `devices.md` 3.5 (common.xml).

use std::cell::Cell;

pub(in crate::device) mod frame;
mod imu;
mod messages;
mod sequence;

use super::followed::Followed;
use super::frames::{FrameScanner, Look};
use super::{DecodeCounters, ImuReading, PacketDecoder};
use crate::device::Traffic;
use frame::{Frame, Judgement, Trust};
use imu::ImuMessage;
use sequence::Sequence;

const HEARTBEAT: u32 = 0;
/// Place of the autopilot's kind in a heartbeat.
const AUTOPILOT_AT: usize = 5;
const ARDUPILOT: u8 = 3;
/// Kind in heartbeats of components that are no autopilot.
const NO_AUTOPILOT: u8 = 8;

/// Decodes MAVLink 2 and 1.
///
/// Of the messages of inertial sensors, the first kind seen with values is used, of one component and one sensor.
/// Losses are counted in the sequence numbers of that component.
#[derive(Debug, Default)]
pub struct MavlinkDecoder {
    // One byte more than the longest frame: what follows a frame of an unknown message is part of its check.
    scanner: FrameScanner<{ frame::LONGEST + 1 }>,
    trust: Cell<Trust>,
    content: Content,
}

impl MavlinkDecoder {
    /// A decoder that has seen nothing yet.
    pub fn new() -> Self {
        Self::default()
    }
}

/// Leaves in `trust` how sure the frame is that it finds.
fn look(bytes: &[u8], trust: &Cell<Trust>) -> Look {
    match frame::judge(bytes) {
        Judgement::NoFrame => Look::NoFrame,
        Judgement::Incomplete => Look::Incomplete,
        Judgement::Damaged => Look::Damaged,
        Judgement::Frame(length, found) => {
            if found == Trust::UnknownMessage {
                match bytes.get(length) {
                    None => return Look::Incomplete,
                    Some(next) if !frame::is_sync(*next) => return Look::Damaged,
                    Some(_) => {}
                }
            }
            trust.set(found);
            Look::Frame(length)
        }
    }
}

/// A stream of samples: system, component, message, sensor.
type Stream = (u8, u8, u32, u8);

/// What the frames say, apart from how they are found.
#[derive(Debug)]
struct Content {
    followed: Followed<Stream>,
    /// Of the component in use.
    sequence: Sequence,
    unknown: u64,
    cut_short: u64,
    version_1: u64,
    halves: u64,
    absent: u64,
    /// What heartbeats say each system is.
    autopilots: [u8; 256],
}

impl Default for Content {
    fn default() -> Self {
        Self {
            followed: Followed::default(),
            sequence: Sequence::default(),
            unknown: 0,
            cut_short: 0,
            version_1: 0,
            halves: 0,
            absent: 0,
            autopilots: [NO_AUTOPILOT; 256],
        }
    }
}

impl Content {
    fn take(&mut self, bytes: &[u8], trust: Trust, on_reading: &mut dyn FnMut(ImuReading)) {
        let Some(frame) = Frame::of(bytes) else { return };
        self.version_1 += u64::from(frame.version == 1);
        self.unknown += u64::from(trust == Trust::UnknownMessage);
        self.cut_short += u64::from(trust == Trust::CutShort);
        self.count_losses(&frame);
        if frame.message == HEARTBEAT {
            let autopilot = frame.payload.get(AUTOPILOT_AT).copied().unwrap_or_default();
            if autopilot != NO_AUTOPILOT {
                self.autopilots[usize::from(frame.system)] = autopilot;
            }
        }
        match imu::read(&frame) {
            Some(ImuMessage::Sample { sensor, reading }) => {
                let stream = (frame.system, frame.component, frame.message, sensor);
                let before = self.followed.stream();
                if self.followed.takes(0, stream) {
                    if before != Some(stream) {
                        self.sequence.begin(frame.sequence);
                    }
                    on_reading(reading);
                }
            }
            Some(ImuMessage::Half) => self.halves += 1,
            Some(ImuMessage::Absent) => self.absent += 1,
            Some(ImuMessage::Neither) | None => {}
        }
    }

    /// Frames missing before this one, if it is of the component in use.
    fn count_losses(&mut self, frame: &Frame<'_>) {
        let Some((system, component, ..)) = self.followed.stream() else { return };
        if (frame.system, frame.component) == (system, component) {
            self.sequence.take(frame.sequence);
        }
    }
}

impl PacketDecoder for MavlinkDecoder {
    fn protocol(&self) -> &'static str {
        super::detect::MAVLINK
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        self.scanner.take(
            traffic,
            |held| look(held, &self.trust),
            |frame| self.content.take(frame, self.trust.get(), on_reading),
        );
    }

    fn counters(&self) -> DecodeCounters {
        DecodeCounters {
            missing: self.content.sequence.missing(),
            unknown: self.content.unknown,
            lone_halves: self.content.halves,
            ..self.scanner.counters().into()
        }
    }

    fn rejoin(&mut self) {
        self.scanner.rejoin();
        self.content.followed.restart();
        self.content.sequence.forget();
    }

    fn finish(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        self.scanner.finish(
            |held| look(held, &self.trust),
            |frame| self.content.take(frame, self.trust.get(), on_reading),
        );
    }

    fn notes(&self) -> Vec<String> {
        let content = &self.content;
        let mut notes = Vec::new();
        if let Some(stream) = content.followed.stream() {
            notes.push(content.note_on(stream));
        }
        let counted = [
            (content.followed.unused(), "samples of other messages or sensors were not used"),
            (content.absent, "messages of a sensor held zeros only: it is not there"),
            (content.version_1, "packets are MAVLink 1"),
            (
                content.cut_short,
                "packets were cut shorter (by zeros) than their checksum says; they are counted as good",
            ),
        ];
        notes.extend(
            counted.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")),
        );
        notes
    }
}

impl Content {
    /// Which stream is in use, and how far its units can be believed.
    fn note_on(&self, (system, component, message, sensor): Stream) -> String {
        let name = imu::name(message).unwrap_or_default();
        let stream = format!("samples are {name} of system {system}, component {component}, sensor {sensor}");
        if message != imu::RAW_IMU {
            return stream;
        }
        match self.autopilots[usize::from(system)] {
            ARDUPILOT => {
                format!("{stream}, in mg and mrad/s: its heartbeat says ArduPilot, which sends these")
            }
            NO_AUTOPILOT => format!(
                "{stream}, taken as mg and mrad/s as ArduPilot sends it; no heartbeat has told the autopilot, and the \
                 standard leaves the unit of RAW_IMU open"
            ),
            other => format!(
                "{stream}, taken as mg and mrad/s as ArduPilot sends it; the autopilot is of kind {other}, and the \
                 standard leaves the unit of RAW_IMU open: compare with gravity"
            ),
        }
    }
}

#[cfg(test)]
mod tests;
