//! MIP: MicroStrain inertial sensors (3DM-GX3 to GX5, CX5, CV5, CV7, GQ7) on a serial line.
//!
//! A packet, all numbers big-endian:
//!
//! | bytes | what |
//! |---|---|
//! | 2 | synchronisation `75 65` |
//! | 1 | descriptor set |
//! | 1 | length of the payload |
//! | n | payload: fields of `length u8 (counts itself) | descriptor u8 | data` |
//! | 2 | Fletcher's checksum over all bytes before: two 8-bit sums modulo 256 |
//!
//! Fields of set 80 (sensor data):
//!
//! | field | what | used as |
//! |---|---|---|
//! | 04 | acceleration 3 × f32 g | specific force |
//! | 05 | gyroscope 3 × f32 rad/s | angular velocity |
//! | D5 | reference time u64 ns | device time, and loss: there is no sequence number |
//! | D3, 12 | GPS time (12: older devices) f64 s of the week, u16 week, u16 flags | device time without D5 |
//! | 18 | flags u16: bits 0 to 2 accelerometer, 4 to 6 gyroscope over range | clipped |
//! | 07, 08 | increments over a sample | nothing: what they are without 04 or 05 is said in words |
//!
//! Answers to commands come in the command's set, with field F1: the command and an error code. Packets of other
//! documented sets (81, 82, 91 to 95, A0) hold no samples; those of no documented set are unknown.
//!
//! Source: MIP protocol as in the vendor's mip_sdk (e5a847d): packets, `data_sensor`, `data_shared`, `mip_result`.

use nalgebra::Vector3;

use super::frames::FrameScanner;
use super::halves::Halves;
use super::period::PeriodWatch;
use super::{DecodeCounters, DeviceTime, ImuReading, PacketDecoder};
use crate::device::Traffic;
use crate::units::STANDARD_GRAVITY;

mod field;
pub(in crate::device) mod frame;

use frame::Packet;

/// Flags of field 18 that mean accelerometer or gyroscope; the others are magnetometer and pressure.
const CLIPPED: u16 = 0x0077;
/// Flag of field D3: the time of the week is valid.
const TIME_OF_WEEK_VALID: u16 = 0x0001;
const SECONDS_PER_WEEK: f64 = 604_800.0;

/// Decodes MIP.
///
/// A packet with angular velocity and specific force is a sample; see `halves` for one without the other. The sensor's
/// z axis points down in its own drawing, so that at rest the specific force is -9.81 m/s² on it: that is the mount's to
/// turn.
#[derive(Debug, Default)]
pub struct MipDecoder {
    scanner: FrameScanner<{ frame::LONGEST_PACKET }>,
    content: Content,
}

impl MipDecoder {
    /// A decoder that has seen nothing yet.
    pub fn new() -> Self {
        Self::default()
    }
}

/// An error the device answered a command with.
#[derive(Clone, Copy, Debug)]
struct Refusal {
    set: u8,
    command: u8,
    code: u8,
}

/// What a packet of set 80 holds of what is used here.
#[derive(Clone, Copy, Debug, Default)]
struct Sensors {
    reference_us: Option<u64>,
    gps_us: Option<u64>,
    omega: Option<Vector3<f64>>,
    force: Option<Vector3<f64>>,
    clipped: bool,
}

/// What the packets say, apart from how they are found.
#[derive(Debug, Default)]
struct Content {
    halves: Halves,
    period: PeriodWatch,
    /// Device time of the last sample, µs.
    last_us: Option<u64>,
    /// Packets of sets that are not documented.
    unreadable: u64,
    refusals: u64,
    last_refusal: Option<Refusal>,
    sensor_packets: u64,
    filter_packets: u64,
    seen_omega: bool,
    seen_force: bool,
    seen_increments: bool,
    /// Bytes on the wire of the last packet with a sample.
    bytes_per_sample: Option<usize>,
}

impl Content {
    fn take(&mut self, frame: &[u8], on_reading: &mut dyn FnMut(ImuReading)) {
        let Some(packet) = Packet::of_frame(frame) else { return };
        if packet.set == frame::SENSOR_DATA {
            self.take_sensors(packet, frame.len(), on_reading);
        } else if frame::is_command_set(packet.set) {
            self.take_answers(packet);
        } else if packet.set == frame::FILTER_DATA {
            self.filter_packets += 1;
        } else if !frame::is_known_set(packet.set) {
            self.unreadable += 1;
        }
    }

    fn take_answers(&mut self, packet: Packet<'_>) {
        for field in packet.fields() {
            if let (frame::ACKNOWLEDGEMENT, &[command, code @ 1..=u8::MAX]) = (field.descriptor, field.data) {
                self.refusals += 1;
                self.last_refusal = Some(Refusal { set: packet.set, command, code });
            }
        }
    }

    fn take_sensors(
        &mut self,
        packet: Packet<'_>,
        wire_bytes: usize,
        on_reading: &mut dyn FnMut(ImuReading),
    ) {
        let sensors = self.read(packet);
        let Some((omega_imu, specific_force_imu)) = self.halves.join(sensors.omega, sensors.force) else {
            return;
        };
        let micros = sensors.reference_us.or(sensors.gps_us);
        if let Some(micros) = micros {
            let step_us = self.last_us.replace(micros).and_then(|last_us| micros.checked_sub(last_us));
            self.period.step(step_us.unwrap_or(0));
        }
        self.bytes_per_sample = Some(wire_bytes);
        let device_time = micros.map(|micros| DeviceTime { micros, wraps_after_us: None });
        on_reading(ImuReading { device_time, omega_imu, specific_force_imu, clipped: sensors.clipped });
    }

    fn read(&mut self, packet: Packet<'_>) -> Sensors {
        let mut sensors = Sensors::default();
        for field in packet.fields() {
            match field.descriptor {
                field::ACCELERATION => {
                    sensors.force = vector(field.data).map(|force| force * STANDARD_GRAVITY);
                }
                field::ANGULAR_RATE => sensors.omega = vector(field.data),
                field::REFERENCE_TIME => {
                    sensors.reference_us =
                        field.data.first_chunk().map(|bytes| u64::from_be_bytes(*bytes) / 1000);
                }
                field::GPS_TIME | field::GPS_TIMESTAMP => {
                    let time = gps_time_us(field.data, field.descriptor == field::GPS_TIME);
                    sensors.gps_us = sensors.gps_us.or(time);
                }
                field::OVER_RANGE => {
                    let flags = field.data.first_chunk().map(|bytes| u16::from_be_bytes(*bytes));
                    sensors.clipped = flags.is_some_and(|flags| flags & CLIPPED != 0);
                }
                field::DELTA_THETA | field::DELTA_VELOCITY => self.seen_increments = true,
                _ => {}
            }
        }
        self.sensor_packets += 1;
        self.seen_omega |= sensors.omega.is_some();
        self.seen_force |= sensors.force.is_some();
        sensors
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some(Refusal { set, command, code }) = self.last_refusal {
            notes.push(format!(
                "the device refused command {set:02X}/{command:02X}: {code:#04x}, {}",
                error_text(code)
            ));
        }
        if self.sensor_packets == 0 && self.filter_packets > 0 {
            notes.push(
                "estimates of the filter (set 82) only: put acceleration (04), angular rate (05) and reference time (D5) of \
                 set 80 into the message format"
                    .to_owned(),
            );
        }
        let instead = if self.seen_increments { "increments (07, 08) only" } else { "no such data" };
        for (seen, what) in [(self.seen_omega, "angular rate (05)"), (self.seen_force, "acceleration (04)")] {
            if self.sensor_packets > 0 && !seen {
                notes.push(format!("{instead}: the message format of set 80 lacks {what}"));
            }
        }
        notes
    }
}

/// Three big-endian 32-bit floats.
fn vector(data: &[u8]) -> Option<Vector3<f64>> {
    match data.as_chunks() {
        (&[x, y, z], []) => Some(Vector3::new(x, y, z).map(|bytes| f64::from(f32::from_be_bytes(bytes)))),
        _ => None,
    }
}

/// Microseconds since the beginning of GPS time; `None` where the time is not valid. Field 12, unlike D3, holds the
/// device's own time until it has that of GPS.
fn gps_time_us(data: &[u8], must_be_flagged: bool) -> Option<u64> {
    let (of_week_s, rest) = data.split_first_chunk()?;
    let &[week, flags] = rest.as_chunks().0 else { return None };
    let (of_week_s, week) = (f64::from_be_bytes(*of_week_s), u16::from_be_bytes(week));
    if must_be_flagged && u16::from_be_bytes(flags) & TIME_OF_WEEK_VALID == 0 {
        return None;
    }
    let is_time = (0.0..=SECONDS_PER_WEEK).contains(&of_week_s);
    is_time.then(|| ((f64::from(week) * SECONDS_PER_WEEK + of_week_s) * 1e6).round() as u64)
}

/// What the error of an acknowledgement says.
pub(in crate::device) fn error_text(code: u8) -> &'static str {
    match code {
        0x01 => "unknown command",
        0x02 => "checksum of the command wrong",
        0x03 => "parameter not valid",
        0x04 => "command failed",
        0x05 => "command took too long",
        _ => "unknown code",
    }
}

impl PacketDecoder for MipDecoder {
    fn protocol(&self) -> &'static str {
        super::detect::MIP
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        let Self { scanner, content, .. } = self;
        scanner.take(traffic, frame::look, |frame| content.take(frame, on_reading));
    }

    fn counters(&self) -> DecodeCounters {
        let content = &self.content;
        DecodeCounters {
            missing: content.period.missing(),
            unknown: content.unreadable,
            lone_halves: content.halves.lone(),
            device_errors: content.refusals,
            ..self.scanner.counters().into()
        }
    }

    fn wire_bytes_per_sample(&self) -> Option<f64> {
        self.content.bytes_per_sample.map(|bytes| bytes as f64)
    }

    fn rejoin(&mut self) {
        self.scanner.rejoin();
        self.content.last_us = None;
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
