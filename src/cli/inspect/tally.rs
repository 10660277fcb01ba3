//! Counts and ranges of the readings in a file.

use std::path::Path;

use nalgebra::Vector3;

use super::inspection::{Inspection, Range};
use crate::device::Traffic;
use crate::device::protocol::detect::PROTOCOLS;
use crate::device::protocol::{ImuReading, PacketDecoder};
use crate::report::LinkCounters;
use crate::time::HostTime;

/// Collects what the readings of a file say.
#[derive(Debug, Default)]
pub(super) struct Tally {
    samples: u64,
    clipped: u64,
    without_force: u64,
    without_time: u64,
    time_s: Option<(f64, f64)>,
    /// Arrival of the last piece.
    pub(super) last_at: HostTime,
    omega: Extent,
    force: Extent,
}

#[derive(Debug, Default)]
struct Extent {
    count: u64,
    min: Vector3<f64>,
    max: Vector3<f64>,
    sum: Vector3<f64>,
}

impl Extent {
    fn take(&mut self, value: &Vector3<f64>) {
        self.min = if self.count == 0 { *value } else { self.min.inf(value) };
        self.max = if self.count == 0 { *value } else { self.max.sup(value) };
        self.sum += value;
        self.count += 1;
    }

    fn range(&self) -> Option<Range> {
        (self.count > 0).then(|| Range {
            min: self.min.into(),
            mean: (self.sum / self.count as f64).into(),
            max: self.max.into(),
        })
    }
}

impl Tally {
    /// Shows a piece of traffic that arrived at `at` to the decoder and takes its readings.
    pub(super) fn take(&mut self, decoder: &mut dyn PacketDecoder, at: HostTime, traffic: Traffic<'_>) {
        self.last_at = at;
        decoder.push(traffic, &mut |reading| self.reading(at, &reading));
    }

    fn reading(&mut self, at: HostTime, reading: &ImuReading) {
        self.samples += 1;
        self.clipped += u64::from(reading.clipped);
        self.omega.take(&reading.omega_imu);
        match &reading.specific_force_imu {
            Some(force) => self.force.take(force),
            None => self.without_force += 1,
        }
        let time_s = match reading.device_time {
            // A clock that wraps is followed by arrival: durations here only describe the file.
            Some(time) if time.wraps_after_us.is_none() => time.micros as f64 * 1e-6,
            Some(_) => at.as_secs_f64(),
            None => {
                self.without_time += 1;
                at.as_secs_f64()
            }
        };
        let first = self.time_s.map_or(time_s, |(first, _)| first);
        self.time_s = Some((first, time_s));
    }

    /// What was found.
    pub(super) fn inspection(&self, file: &Path, kind: &str, decoder: &dyn PacketDecoder) -> Inspection {
        let counters = decoder.counters();
        let duration_s = self.time_s.map(|(first, last)| last - first);
        let rate_hz = duration_s.filter(|s| *s > 0.0).map(|s| self.samples.saturating_sub(1) as f64 / s);
        Inspection {
            file: file.display().to_string(),
            kind: kind.to_owned(),
            protocol: decoder.protocol().to_owned(),
            link: LinkCounters {
                packets: counters.packets,
                bad_checksum: counters.bad_checksum,
                bytes_skipped: counters.bytes_skipped,
                missing: counters.missing,
                gaps: 0,
                dropped: counters.device_dropped,
            },
            samples: self.samples,
            duration_s,
            rate_hz,
            omega_rad_s: self.omega.range(),
            specific_force_m_s2: self.force.range(),
            clipped: self.clipped,
            ticks: None,
            damage: None,
            events: Vec::new(),
            notes: self.notes(decoder, counters.unknown),
        }
    }

    /// What is missing, in words.
    fn notes(&self, decoder: &dyn PacketDecoder, unknown: u64) -> Vec<String> {
        let mut notes = Vec::new();
        if self.samples == 0 {
            notes.push(match decoder.protocol() {
                "unknown" => format!("no sample was found: this is none of {}", PROTOCOLS.join(", ")),
                protocol => format!("no sample of protocol {protocol} was found"),
            });
        }
        if self.samples > 0 && self.without_force == self.samples {
            notes.push("no accelerometer: tilt cannot be measured".to_owned());
        }
        if self.without_time > 0 {
            notes.push("no device time: samples are dated by arrival".to_owned());
        }
        if unknown > 0 {
            notes.push(format!("{unknown} packets of a type this decoder does not know"));
        }
        notes
    }
}
