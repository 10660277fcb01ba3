//! CAN frames read by a DBC file and a mapping: one decoder for every sensor that has a description.
//!
//! A DBC file says which bits of which frame are which number; a [`CanMapping`] says which number is which axis of an
//! IMU, and which frames make a sample. Both are compiled into a [`CanMap`] before the first frame. These come with
//! the program, by name (`--map NAME`), and lie in `configs/can`:
//!
//! | name | device | frames of a sample | device time | state |
//! |---|---|---|---|---|
//! | `otolith-can` | our own DBC at ±500 deg/s, ±4 g; [`super::native_can`] reads the ranges, too | 0x3A0, 0x3A1 by equal tick | 10 µs, wraps | equal to the native decoder |
//! | `toyota-yaw` | yaw sensor of older Toyota cars | 0x024, with checksum | none | real capture |
//! | `racelogic-imu04` | Racelogic IMU04 | 0x600 to 0x603 | none | from the document |
//! | `bosch-mm5`, `bosch-mm7` | Bosch MM5.10, MM7.10 | 0x174, 0x178, 0x17C | none | from the document |
//! | `bosch-abs-kit` | MM5.10 as the ABS M4/M5 kit sends it | 0x070, 0x080, 0x576 | none | from the document |
//! | `sbg`, `sbg-no-time` | SBG Ellipse | 0x120, 0x121, 0x122; 0x121, 0x122 | µs; none | from the document |
//! | `j1939-imu`, `j1939-imu-xyz` | PGN 61482 and 61485 of any source, in two axis orders | 0xF02A, 0xF02D | none | from the document |
//! | `xsens-mti-can`, `-100us`, `-no-time` | Xsens MTi, time in µs or 100 µs or not sent | 0x005, 0x032, 0x034; 0x006 counts | µs; 100 µs; none | from the document |
//!
//! What is counted: [`DecodeCounters::packets`] are good frames of mapped messages, `bad_checksum` those whose
//! checksum rule fails, `unknown` those too short for their signals, `device_errors` those whose numbers are none
//! (above `max_raw`, NaN), `missing` gaps of the counter, or of the device's clock where no counter comes, and
//! `lone_halves` frames without the others of their sample.
//! Identifiers that are not mapped belong to others on the bus and are not counted.

mod census;
mod dbc;
mod error;
mod mapping;
mod pairing;
mod plan;
mod shipped;
mod signal;

use nalgebra::Vector3;

pub use census::{BusCensus, BusReport, IdReport, PartlyKnown};
pub use dbc::{Dbc, DbcMessage, DbcSignal, Multiplexing};
pub use error::CanMapError;
pub use mapping::CanMapping;
pub use shipped::{CAN_MAPS, ShippedCanMap, can_map_names, shipped_can_map};
pub use signal::{SignalKind, SignalLayout};

use super::period::PeriodWatch;
use super::{DecodeCounters, DeviceInfo, DeviceTime, ImuReading, PacketDecoder};
use crate::device::Traffic;
use crate::units::STANDARD_GRAVITY;
use mapping::{Axis, Checksum};
use pairing::{Assembly, Part};
use plan::{Compiler, Frame, FramePart, Plan, TooShort};

/// Bits of an identifier.
const ALL_ID_BITS: u32 = 0x1FFF_FFFF;
/// The part of a J1939 identifier that says who sent it.
const SOURCE_ADDRESS: u32 = 0xFF;
/// Good frames after which a mapped message that never came is worth a word.
const FRAMES_TO_WAIT: u64 = 20;
/// 2^53 µs are 285 years: beyond them a double no longer counts microseconds.
const LAST_MICROS: f64 = 9.0e15;

/// A mapping with its DBC file, checked against each other and compiled.
#[derive(Clone, Debug)]
pub struct CanMap {
    name: String,
    mapping: CanMapping,
    plan: Plan,
}

/// A message that a mapping reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MappedMessage<'a> {
    /// Name in the DBC file.
    pub name: &'a str,
    /// Identifier without flag bits.
    pub id: u32,
    /// True for a 29-bit identifier.
    pub extended: bool,
    /// Identifier bits that must fit.
    pub id_mask: u32,
    /// Length of the frame by the DBC file, bytes.
    pub size: usize,
    /// Whether no sample is complete without it.
    pub required: bool,
}

impl MappedMessage<'_> {
    /// Whether a frame with this identifier is this message.
    pub fn fits(&self, id: u32, extended: bool) -> bool {
        self.extended == extended && (self.id ^ id) & self.id_mask == 0
    }
}

/// Name and identifier, as people write them.
impl std::fmt::Display for MappedMessage<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let digits = if self.extended { 8 } else { 3 };
        write!(f, "{} (0x{:0digits$X})", self.name, self.id)
    }
}

impl CanMap {
    /// Compiles the mapping `text` with the DBC file `dbc_text`; `name` and `dbc_name` name them in errors.
    ///
    /// # Errors
    /// [`CanMapError`] with file, key and what is allowed: text that does not read, names that the DBC file lacks,
    /// signals that no frame can hold, frames without a rule that joins them to samples.
    pub fn new(name: &str, text: &str, dbc_name: &str, dbc_text: &str) -> Result<Self, CanMapError> {
        let mapping = CanMapping::from_toml(name, text)?;
        let dbc = Dbc::parse(dbc_name, dbc_text)?;
        let plan = Compiler { file: name, mapping: &mapping, dbc_file: dbc_name, dbc: &dbc }.compile()?;
        Ok(Self { name: name.to_owned(), mapping, plan })
    }

    /// Name of the mapping or of its file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The messages it reads.
    pub fn messages(&self) -> impl Iterator<Item = MappedMessage<'_>> {
        let id_mask = self.id_mask();
        self.plan.frames.iter().map(move |frame| MappedMessage {
            name: &frame.name,
            id: frame.id,
            extended: frame.extended,
            id_mask,
            size: frame.size,
            required: !frame.parts.is_empty(),
        })
    }

    fn id_mask(&self) -> u32 {
        self.mapping.id_mask.unwrap_or(ALL_ID_BITS)
    }

    /// What is assumed, in words.
    fn assumptions(&self) -> Vec<String> {
        let absent = self.mapping.absent().iter();
        let upright = self.mapping.assume_upright;
        let zero: Vec<&str> = absent
            .filter(|axis| !(upright && **axis == Axis::ForceZ))
            .filter(|axis| self.mapping.has_specific_force() || Axis::GYRO.contains(axis))
            .map(|axis| axis.key())
            .collect();
        let mut notes = Vec::new();
        if !zero.is_empty() {
            notes.push(format!("not measured and taken as 0: {}", zero.join(", ")));
        }
        if upright {
            notes.push(format!(
                "not measured: specific_force.z; the sensor is assumed to stand upright, +{STANDARD_GRAVITY} m/s2 on z"
            ));
        }
        notes.extend(self.mapping.notes.iter().cloned());
        notes
    }
}

/// Decodes frames as a [`CanMap`] says. Takes no memory after it was made.
///
/// No arrival time is asked for: bursts of a USB adapter would part frames that belong together. Where two messages
/// are paired by order alone and the last frame of one sample and the first of the next are both lost, the halves of
/// two neighbouring samples are joined; a counter, or the message of the device's clock in the order, excludes that.
#[derive(Clone, Debug)]
pub struct CanMapDecoder {
    map: CanMap,
    info: DeviceInfo,
    assembly: Assembly,
    counters: DecodeCounters,
    last_count: Option<u64>,
    /// Whether the counter was ever seen.
    counted: bool,
    /// Losses by the device's clock, for devices that do not count.
    period: PeriodWatch,
    last_micros: Option<u64>,
    /// Source address that is followed where identifiers are masked.
    source: Option<u8>,
    other_sources: u64,
    /// Which of the plan's frames have come, one bit each.
    seen: u32,
}

impl CanMapDecoder {
    /// A decoder for frames as `map` describes them.
    pub fn new(map: &CanMap) -> Self {
        let (gyro_range, accel_range) = map.mapping.full_scales();
        Self {
            info: DeviceInfo {
                name: Some(map.name.clone()),
                gyro_range,
                accel_range,
                ..DeviceInfo::default()
            },
            assembly: Assembly::new(map.plan.rule, map.plan.part_count),
            counters: DecodeCounters::default(),
            last_count: None,
            counted: false,
            period: PeriodWatch::default(),
            last_micros: None,
            source: map.mapping.source_address,
            other_sources: 0,
            seen: 0,
            map: map.clone(),
        }
    }

    fn take_frame(&mut self, id: u32, extended: bool, data: &[u8]) -> Option<Part> {
        let mask = self.map.id_mask();
        let is_frame = |frame: &Frame| frame.extended == extended && (frame.id ^ id) & mask == 0;
        let at = self.map.plan.frames.iter().position(is_frame)?;
        let frame = &self.map.plan.frames[at];
        if extended && mask & SOURCE_ADDRESS == 0 {
            let source = (id & SOURCE_ADDRESS) as u8;
            if *self.source.get_or_insert(source) != source {
                self.other_sources += 1;
                return None;
            }
        }
        if self.map.mapping.checksum == Some(Checksum::Toyota) && !toyota_checksum_fits(id, data) {
            self.counters.bad_checksum += 1;
            return None;
        }
        self.seen |= 1 << at;
        let count = frame.counter(data);
        let part = frame.part(data).and_then(|part| match part {
            Some(part) => Ok(Some((part.index, self.read_part(part, data)?))),
            None => Ok(None),
        });
        let (Ok(count), Ok(part)) = (count, part) else {
            self.counters.unknown += 1;
            return None;
        };
        self.counters.packets += 1;
        if let Some(count) = count {
            self.follow_counter(count);
        }
        match part? {
            (index, Some(part)) => self.assembly.take(index, part),
            (_, None) => {
                self.counters.device_errors += 1;
                None
            }
        }
    }

    /// What a frame says; `Ok(None)` if one of its numbers is none.
    fn read_part(&self, plan: &FramePart, data: &[u8]) -> Result<Option<Part>, TooShort> {
        let mapping = &self.map.mapping;
        let mut part = Part::default();
        let mut is_number = true;
        for axis in &plan.axes {
            let raw = axis.layout.raw(data).ok_or(TooShort)?;
            let value = axis.layout.physical(raw);
            is_number &= value.is_finite() && mapping.max_raw.is_none_or(|max| raw <= max);
            part.clipped |= value.abs() >= axis.full_scale;
            part.values[axis.axis] = value * axis.to_si;
        }
        if let (Some(time), Some((_, unit_s))) = (&plan.time, mapping.time()) {
            let micros = (time.physical(time.raw(data).ok_or(TooShort)?) * unit_s * 1e6).round();
            is_number &= (0.0..LAST_MICROS).contains(&micros);
            part.micros = Some(micros as u64);
        }
        if let Some(counter) = &plan.pair_by {
            part.counter = counter.raw(data).ok_or(TooShort)?;
        }
        Ok(is_number.then_some(part))
    }

    /// Counts the frames between this one and the one before. Half the counter's range and more is a restart.
    fn follow_counter(&mut self, count: u64) {
        let Some((_, wrap)) = self.map.mapping.counter() else { return };
        self.counted = true;
        if let Some(last) = self.last_count.replace(count) {
            let step = (count % wrap + wrap - last % wrap) % wrap;
            if step <= wrap / 2 {
                self.counters.missing += step.saturating_sub(1);
            }
        }
    }

    /// Looks for gaps in the device's clock.
    fn follow_time(&mut self, micros: u64) {
        if let Some(last) = self.last_micros.replace(micros) {
            let step_us = match self.map.mapping.wraps_after_us() {
                Some(wrap) => (micros % wrap + wrap - last % wrap) % wrap,
                None => micros.saturating_sub(last),
            };
            self.period.step(step_us);
        }
    }

    fn reading(&self, sample: &Part) -> ImuReading {
        let [gx, gy, gz, fx, fy, fz] = sample.values;
        let mapping = &self.map.mapping;
        let gravity = if mapping.assume_upright { STANDARD_GRAVITY } else { 0.0 };
        ImuReading {
            device_time: sample
                .micros
                .map(|micros| DeviceTime { micros, wraps_after_us: mapping.wraps_after_us() }),
            omega_imu: Vector3::new(gx, gy, gz),
            specific_force_imu: mapping.has_specific_force().then(|| Vector3::new(fx, fy, fz + gravity)),
            clipped: sample.clipped,
        }
    }
}

/// Whether the last byte is the low byte of the sum of identifier, length and the bytes before.
fn toyota_checksum_fits(id: u32, data: &[u8]) -> bool {
    let Some((last, rest)) = data.split_last() else { return false };
    let header = u64::from((id >> 8) & 0xFF) + u64::from(id & 0xFF) + data.len() as u64;
    let sum = rest.iter().fold(header, |sum, &byte| sum + u64::from(byte));
    sum & 0xFF == u64::from(*last)
}

impl PacketDecoder for CanMapDecoder {
    fn protocol(&self) -> &'static str {
        super::detect::CAN_MAP
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        match traffic {
            Traffic::CanFrame { id, extended, data } => {
                if let Some(sample) = self.take_frame(id, extended, data) {
                    sample.micros.into_iter().for_each(|micros| self.follow_time(micros));
                    on_reading(self.reading(&sample));
                }
            }
            // Of another kind of link: no CAN frame is in it.
            Traffic::Bytes(bytes) => self.counters.bytes_skipped += bytes.len() as u64,
        }
    }

    fn counters(&self) -> DecodeCounters {
        // A device that counts knows better than its clock tells.
        let by_time = if self.counted { 0 } else { self.period.missing() };
        let missing = self.counters.missing + by_time;
        DecodeCounters { missing, lone_halves: self.assembly.lone, ..self.counters }
    }

    fn announced_rate_hz(&self) -> Option<f64> {
        self.map.mapping.rate_hz
    }

    fn device(&self) -> Option<&DeviceInfo> {
        Some(&self.info)
    }

    fn rejoin(&mut self) {
        self.assembly.abandon();
        self.last_count = None;
        self.last_micros = None;
        self.period.restart();
    }

    fn finish(&mut self, _on_reading: &mut dyn FnMut(ImuReading)) {
        self.assembly.abandon();
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.map.assumptions();
        let missing: Vec<String> = self
            .map
            .messages()
            .enumerate()
            .filter(|(at, message)| message.required && self.seen & (1 << at) == 0)
            .map(|(_, message)| message.to_string())
            .collect();
        let waited = self.seen == 0 || self.counters.packets >= FRAMES_TO_WAIT;
        if waited && !missing.is_empty() {
            notes
                .push(format!("not one frame came of {}: no sample is complete without", missing.join(", ")));
        }
        let counted = [
            (self.counters.unknown, "frames were too short for the signals mapped in them"),
            (self.counters.device_errors, "frames held an error value or no number"),
            (self.other_sources, "frames of other source addresses than the one followed were left out"),
        ];
        notes.extend(
            counted.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")),
        );
        notes
    }
}

#[cfg(test)]
mod tests;
