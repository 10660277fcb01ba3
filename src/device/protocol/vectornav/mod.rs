//! VectorNav VN-100, VN-200 and VN-300: binary frames and ASCII sentences, which may come on one line in turn.
//!
//! Binary (little-endian; sizes and places of the fields follow from the masks, see `fields.rs`):
//!
//! | bytes | meaning |
//! |---|---|
//! | `FA` | sync |
//! | u8 | groups: bit 0 group 1 (common) .. bit 6 group 7; bit 7 announces a second group byte, of which nothing is known here |
//! | u16 each | one mask of fields per group, lowest group first |
//! | .. | the fields, in the order of groups and bits |
//! | u16, **big-endian** | CRC-16/XMODEM over everything after `FA`; run over the checksum too it gives 0 |
//!
//! Used: TimeStartup u64 ns (group 1 or 2), Accel, AngularRate (groups 1 and 3), and where they are missing Imu
//! (group 1), UncompAccel, UncompGyro (group 3); SensSat (group 3). Vectors are 3 × f32, m/s² and rad/s.
//!
//! ASCII: `$VNxxx,..*HH\r\n`, XOR of everything between `$` and `*`, or CRC-16 in four digits. It has no device time.
//!
//! The sensor frame is the device's: x forward, y right, z down. At rest it measures -9.8 m/s² on z, which is specific
//! force. Source: `devices.md` 3.3 (UM001; the vendor's programming library).

use std::cell::Cell;

use nalgebra::Vector3;

pub(in crate::device) mod ascii;
mod fields;

use super::followed::Followed;
use super::frames::{FrameScanner, Look};
use super::period::PeriodWatch;
use super::{DecodeCounters, DeviceTime, ImuReading, PacketDecoder};
use crate::device::Traffic;
use crate::device::protocol::crc::xmodem;
use ascii::Said;
use fields::{Field, Head, Layout};

/// Bits of SensSat that belong to the accelerometer and the gyroscope.
const SATURATED_MOTION: u16 = 0x01F8;
/// So many heads of the same unknown kind in a row are no accident.
const CERTAINLY_UNKNOWN: u64 = 8;
/// Longest head of a binary frame: sync byte, groups, seven masks.
const HEAD_BYTES: usize = 16;

/// Decodes VectorNav's binary frames and ASCII sentences.
///
/// Of several outputs on one line one is used: binary before ASCII, then one with an accelerometer, then one with
/// device time, then the first. Losses are counted by gaps in TimeStartup, which ASCII does not have.
#[derive(Debug, Default)]
pub struct VectorNavDecoder {
    scanner: FrameScanner<{ fields::LONGEST }>,
    content: Content,
    undecodable: Cell<Undecodable>,
}

impl VectorNavDecoder {
    /// A decoder that has seen nothing yet.
    pub fn new() -> Self {
        Self::default()
    }
}

/// Heads of binary frames that announce fields of unknown size.
#[derive(Clone, Copy, Debug, Default)]
struct Undecodable {
    groups: u8,
    /// Times this group byte came without another between.
    in_row: u64,
    most_in_row: u64,
}

impl Undecodable {
    fn saw(self, groups: u8) -> Self {
        let in_row = if groups == self.groups { self.in_row + 1 } else { 1 };
        Self { groups, in_row, most_in_row: self.most_in_row.max(in_row) }
    }
}

fn look(bytes: &[u8], undecodable: &Cell<Undecodable>) -> Look {
    match bytes {
        [fields::SYNC, rest @ ..] => match Layout::read(bytes) {
            Head::Incomplete => Look::Incomplete,
            Head::NoFrame => Look::NoFrame,
            Head::UnknownSize => {
                undecodable.set(undecodable.get().saw(rest.first().copied().unwrap_or_default()));
                Look::NoFrame
            }
            Head::Complete(layout) => match bytes.get(1..layout.frame_bytes) {
                None => Look::Incomplete,
                Some(checked) if xmodem(checked) == 0 => Look::Frame(layout.frame_bytes),
                Some(_) => Look::Damaged,
            },
        },
        [b'$', ..] => ascii::look(bytes),
        _ => Look::NoFrame,
    }
}

/// One output of the device: the head of its frames, or `$` and the name of its sentences.
type Output = [u8; HEAD_BYTES];

fn output(head: &[u8]) -> Output {
    let mut output = [0; HEAD_BYTES];
    output.iter_mut().zip(head).for_each(|(to, from)| *to = *from);
    output
}

/// Counts of errors by code: 1 to 12 as they are, 255 last, those in no manual first.
type ErrorCounts = [u64; 14];

/// What the frames say, apart from how they are found.
#[derive(Debug, Default)]
struct Content {
    followed: Followed<Output>,
    period: PeriodWatch,
    /// Output and device time of the last sample with one, µs.
    last: Option<(Output, u64)>,
    /// Measurements that are missing or no numbers.
    unreadable: u64,
    errors: ErrorCounts,
    uncompensated: bool,
    /// The last output without an angular rate.
    without_rate: Option<Output>,
}

impl Content {
    fn take(&mut self, frame: &[u8], on_reading: &mut dyn FnMut(ImuReading)) {
        if frame.first() == Some(&b'$') {
            self.take_sentence(frame, on_reading);
        } else if let Head::Complete(layout) = Layout::read(frame) {
            self.take_binary(&layout, frame, on_reading);
        }
    }

    fn take_sentence(&mut self, sentence: &[u8], on_reading: &mut dyn FnMut(ImuReading)) {
        match ascii::read(ascii::body(sentence)) {
            Said::Measured(measured) => {
                let [a, b, c] = measured.name;
                let quality = quality(false, measured.specific_force_imu.is_some(), false);
                if self.followed.takes(quality, output(&[b'$', a, b, c])) {
                    // Of the sentences, only this one is from before the device's own calibration (UM001).
                    self.uncompensated = measured.name == *b"IMU";
                    on_reading(ImuReading {
                        device_time: None,
                        omega_imu: measured.omega_imu,
                        specific_force_imu: measured.specific_force_imu,
                        clipped: false,
                    });
                }
            }
            Said::Unreadable => self.unreadable += 1,
            Said::Error(code) => {
                let last = self.errors.len() - 1;
                self.errors[usize::from(code).min(last)] += 1;
            }
            Said::WithoutRate([a, b, c]) => self.without_rate = Some(output(&[b'$', a, b, c])),
            Said::Other => {}
        }
    }

    fn take_binary(&mut self, layout: &Layout, frame: &[u8], on_reading: &mut dyn FnMut(ImuReading)) {
        let first = |fields: &[Field]| fields.iter().find_map(|field| layout.field(frame, *field));
        let both = layout.field(frame, fields::COMMON_IMU);
        let compensated = first(&[fields::IMU_ANGULAR_RATE, fields::COMMON_ANGULAR_RATE]);
        let uncompensated = || first(&[fields::IMU_UNCOMP_GYRO]).or(both.and_then(|both| both.get(12..)));
        let Some(omega) = compensated.or_else(uncompensated) else {
            self.without_rate = Some(output(layout.header(frame)));
            return;
        };
        let force = first(&[fields::IMU_ACCEL, fields::COMMON_ACCEL, fields::IMU_UNCOMP_ACCEL]).or(both);
        let nanos = first(&[fields::COMMON_TIME_STARTUP, fields::TIME_TIME_STARTUP]).and_then(|field| {
            let bytes = field.first_chunk()?;
            Some(u64::from_le_bytes(*bytes))
        });
        let output = output(layout.header(frame));
        if !self.followed.takes(quality(true, force.is_some(), nanos.is_some()), output) {
            return;
        }
        self.uncompensated = compensated.is_none();
        let (omega_imu, specific_force_imu) = (vector(omega), force.map(vector));
        let device_time = nanos.map(|nanos| DeviceTime { micros: nanos / 1000, wraps_after_us: None });
        if let Some(DeviceTime { micros, .. }) = device_time {
            self.watch(output, micros);
        }
        let saturated = layout.field(frame, fields::IMU_SENS_SAT).and_then(|field| field.first_chunk());
        let clipped = saturated.is_some_and(|flags| u16::from_le_bytes(*flags) & SATURATED_MOTION != 0);
        on_reading(ImuReading { device_time, omega_imu, specific_force_imu, clipped });
    }

    /// Looks for a gap since the last sample of the same output.
    fn watch(&mut self, output: Output, micros: u64) {
        match self.last.replace((output, micros)) {
            // Back in time is zero, which starts the watch anew.
            Some((before, last)) if before == output => self.period.step(micros.saturating_sub(last)),
            _ => self.period.restart(),
        }
    }
}

/// How good an output is: binary, with an accelerometer, with device time, in this order.
fn quality(binary: bool, force: bool, time: bool) -> u8 {
    4 * u8::from(binary) + 2 * u8::from(force) + u8::from(time)
}

/// The first three floats of a field.
fn vector(field: &[u8]) -> Vector3<f64> {
    let (floats, _) = field.as_chunks::<4>();
    let float =
        |axis: usize| floats.get(axis).map_or(f64::NAN, |bytes| f64::from(f32::from_le_bytes(*bytes)));
    Vector3::new(float(0), float(1), float(2))
}

impl PacketDecoder for VectorNavDecoder {
    fn protocol(&self) -> &'static str {
        super::detect::VECTORNAV
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        self.scanner.take(
            traffic,
            |held| look(held, &self.undecodable),
            |frame| self.content.take(frame, on_reading),
        );
    }

    fn counters(&self) -> DecodeCounters {
        DecodeCounters {
            missing: self.content.period.missing(),
            unknown: self.content.unreadable,
            device_errors: self.content.errors.iter().sum(),
            ..self.scanner.counters().into()
        }
    }

    fn rejoin(&mut self) {
        self.scanner.rejoin();
        self.content.followed.restart();
        self.content.last = None;
    }

    fn finish(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        self.scanner
            .finish(|held| look(held, &self.undecodable), |frame| self.content.take(frame, on_reading));
    }

    fn notes(&self) -> Vec<String> {
        let Content { followed, errors, uncompensated, without_rate, .. } = &self.content;
        let mut notes = Vec::new();
        match (followed.stream(), without_rate) {
            (Some(output), _) => notes.extend(note_on(&output)),
            (None, Some([b'$', name @ ..])) => notes.push(format!(
                "VN{} sentences carry no angular rate: choose VNYMR, VNQMR, VNIMU or a binary output",
                name_of(name)
            )),
            (None, Some(_)) => {
                notes.push("no angular rate: add AngularRate to the binary output".to_owned());
            }
            (None, None) => {}
        }
        if *uncompensated {
            notes.push(
                "the output in use is from before the device's own calibration (uncompensated)".to_owned(),
            );
        }
        if followed.unused() > 0 {
            let unused = followed.unused();
            notes.push(format!("{unused} samples of other outputs on the same line were not used"));
        }
        if self.undecodable.get().most_in_row >= CERTAINLY_UNKNOWN {
            let groups = self.undecodable.get().groups;
            notes.push(format!(
                "binary frames with fields of unknown size (group byte 0x{groups:02X}) cannot be cut out of the \
                 stream: leave satellite lists, raw GNSS data and groups above 7 out of the output"
            ));
        }
        for (index, count) in errors.iter().enumerate().filter(|(_, count)| **count > 0) {
            let code = if index == errors.len() - 1 { 255 } else { index as u8 };
            let meaning = ascii::error_meaning(code).unwrap_or("in no manual");
            notes.push(format!("the device reported error {code} ({meaning}) {count} times"));
        }
        notes
    }
}

/// The three letters after `VN` of a sentence.
fn name_of(output: &[u8]) -> String {
    output.iter().take(3).map(|letter| char::from(*letter)).collect()
}

/// What the output in use does not carry.
fn note_on(output: &Output) -> Option<String> {
    if let [b'$', name @ ..] = output {
        let name = name_of(name);
        return Some(format!(
            "VN{name} sentences carry no device time, and their losses cannot be counted: a binary output with \
             TimeStartup does both"
        ));
    }
    let Head::Complete(layout) = Layout::read(output) else { return None };
    let timed = [fields::COMMON_TIME_STARTUP, fields::TIME_TIME_STARTUP];
    let has_time = timed.iter().any(|field| layout.has(*field));
    (!has_time).then(|| "no device time: add TimeStartup to the binary output".to_owned())
}

#[cfg(test)]
mod tests;
