//! Counts and ranges of the readings in a file.

use std::path::Path;

use nalgebra::Vector3;

use super::bus;
use super::inspection::{Inspection, Range};
use crate::device::protocol::can_map::{BusCensus, BusReport};
use crate::device::protocol::detect::{Bus, CAN_MAP, detected_names};
use crate::device::protocol::{DecodeCounters, DeviceTime, ImuReading, PacketDecoder};
use crate::device::{LinkStatus, Traffic};
use crate::imu::Intervals;
use crate::report::LinkCounters;
use crate::time::HostTime;

/// Collects what the readings of a file say.
#[derive(Debug, Default)]
pub(super) struct Tally {
    samples: u64,
    clipped: u64,
    not_finite: u64,
    without_force: u64,
    without_time: u64,
    /// Arrival of the first and of the last sample.
    arrivals: Option<(HostTime, HostTime)>,
    /// The device's clock at the last sample that carried it.
    last_time: Option<DeviceTime>,
    /// Time by the device's clock since its first sample, µs.
    device_us: i64,
    /// Nothing but the device dates the samples: the traffic is a raw capture.
    without_arrivals: bool,
    /// Intervals between samples, by the device's clock where both have one, else by arrival.
    intervals: Intervals,
    /// Arrival of the last piece.
    last_at: HostTime,
    omega: Extent,
    force: Extent,
    bus: BusCensus,
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
    /// A tally that looks for a ready mapping of CAN signals on the way.
    pub(super) fn trying_can_maps() -> Self {
        Self { bus: BusCensus::trying_maps(), ..Self::default() }
    }

    /// The same for a raw capture, whose bytes have no time of arrival.
    #[must_use]
    pub(super) fn without_arrivals(self) -> Self {
        Self { without_arrivals: true, ..self }
    }

    /// Shows a piece of traffic that arrived at `at` to the decoder and takes its readings.
    pub(super) fn take(&mut self, decoder: &mut dyn PacketDecoder, at: HostTime, traffic: Traffic<'_>) {
        self.last_at = at;
        self.bus.take(at, traffic);
        decoder.push(traffic, &mut |reading| self.reading(at, &reading));
    }

    /// The file has ended.
    pub(super) fn finish(&mut self, decoder: &mut dyn PacketDecoder) {
        let at = self.last_at;
        decoder.finish(&mut |reading| self.reading(at, &reading));
    }

    fn reading(&mut self, at: HostTime, reading: &ImuReading) {
        self.samples += 1;
        let last = self.arrivals.filter(|_| !self.without_arrivals).map(|(_, last)| last);
        let arrival_s = last.map(|last| at.saturating_since(last).as_secs_f64());
        self.arrivals = Some((self.arrivals.map_or(at, |(first, _)| first), at));
        self.clipped += u64::from(reading.clipped);
        let values = reading.omega_imu.iter().chain(reading.specific_force_imu.iter().flatten());
        if !values.into_iter().all(|value| value.is_finite()) {
            self.not_finite += 1;
            return;
        }
        self.omega.take(&reading.omega_imu);
        match &reading.specific_force_imu {
            Some(force) => self.force.take(force),
            None => self.without_force += 1,
        }
        let device_s = match reading.device_time {
            Some(time) => self.device_time(time),
            None => {
                self.without_time += 1;
                None
            }
        };
        // Samples of one piece have no time between them, a clock that was set has none that is known.
        if let Some(interval_s) = device_s.or(arrival_s).filter(|interval_s| *interval_s > 0.0) {
            self.intervals.take(interval_s);
        }
    }

    /// Follows the device's clock through its wraps; a step back is one. Gives the step, s.
    fn device_time(&mut self, time: DeviceTime) -> Option<f64> {
        let step_us = time.micros_since(self.last_time.replace(time)?);
        self.device_us = self.device_us.saturating_add(step_us);
        Some(step_us as f64 * 1e-6)
    }

    /// Time from the first sample to the last, s, and how many they are: by the device's clock if every sample carries
    /// it, else by arrival, and without that the samples that carry it.
    fn span(&self) -> Option<(f64, u64)> {
        let (first, last) = self.arrivals?;
        let dated = self.samples - self.without_time;
        if self.without_time == 0 || (self.without_arrivals && dated > 1) {
            return Some((self.device_us as f64 * 1e-6, dated));
        }
        (!self.without_arrivals).then(|| (last.saturating_since(first).as_secs_f64(), self.samples))
    }

    /// What was found; `link` is what the file's reader has counted.
    pub(super) fn inspection(
        &self,
        file: &Path,
        kind: &str,
        decoder: &dyn PacketDecoder,
        link: &LinkStatus,
    ) -> Inspection {
        let mut counters = decoder.counters();
        counters.bytes_skipped += link.bytes_skipped;
        counters.unfinished_bytes += link.unfinished_bytes;
        let mut can = self.bus.report();
        if let Some(can) = can.as_mut().filter(|_| self.samples > 0) {
            (can.fitting_maps, can.partly_known) = (Vec::new(), Vec::new());
        }
        let span = self.span();
        let rate_hz = span.filter(|(s, _)| *s > 0.0).map(|(s, samples)| samples.saturating_sub(1) as f64 / s);
        Inspection {
            file: file.display().to_string(),
            kind: kind.to_owned(),
            protocol: decoder.protocol().to_owned(),
            link: LinkCounters {
                packets: counters.packets,
                bad_checksum: counters.bad_checksum,
                bytes_skipped: counters.bytes_skipped,
                missing: counters.missing,
                gaps: self.intervals.gaps(),
                dropped: counters.device_dropped,
            },
            samples: self.samples,
            duration_s: span.map(|(s, _)| s),
            rate_hz,
            omega_rad_s: self.omega.range(),
            specific_force_m_s2: self.force.range(),
            clipped: self.clipped,
            unfinished_bytes: counters.unfinished_bytes,
            ticks: None,
            damage: None,
            events: Vec::new(),
            notes: self.notes(file, decoder, &counters, can.as_ref()),
            can,
        }
    }

    /// What is missing, in words.
    fn notes(
        &self,
        file: &Path,
        decoder: &dyn PacketDecoder,
        counters: &DecodeCounters,
        can: Option<&BusReport>,
    ) -> Vec<String> {
        let mut notes = Vec::new();
        match (decoder.protocol(), can) {
            _ if self.samples > 0 => {}
            ("unknown", Some(can)) => notes.push(bus::in_words(can)),
            ("unknown", None) => {
                notes.push(format!("no sample was found: this is none of {}", detected_names(Bus::Serial)));
            }
            (protocol, _) => notes.push(format!("no sample of protocol {protocol} was found")),
        }
        if let Some(can) = can.filter(|_| self.samples == 0 && decoder.protocol() != CAN_MAP) {
            notes.extend(bus::advice(can, &file.display().to_string()));
        }
        if self.samples > 0 && self.without_force == self.samples {
            notes.push("no accelerometer: tilt cannot be measured".to_owned());
        }
        if self.without_time > 0 {
            let all_at_once = self.samples > 1 && self.span().is_none_or(|(s, _)| s == 0.0);
            notes.push(if all_at_once {
                "no time at all: neither the device nor the file dates the samples".to_owned()
            } else if self.without_arrivals {
                format!("{} samples have no device time, and the file has none either", self.without_time)
            } else {
                "no device time: samples are dated by arrival".to_owned()
            });
        }
        // Of a bus that nobody understands everything is said above.
        let unknown_packets = if decoder.protocol() == "unknown" { 0 } else { counters.unknown };
        let counted = [
            (self.not_finite, "samples with values that are no numbers"),
            (counters.repeated, "packets came twice or late"),
            (unknown_packets, "packets of a type this decoder does not know"),
            (counters.withheld, "samples came before the device had told their scale"),
            (counters.lone_halves, "halves of a sample came without the other half"),
            (counters.device_errors, "errors reported by the device"),
            (counters.unfinished_bytes, "bytes of an unfinished packet at the end"),
        ];
        notes.extend(
            counted.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")),
        );
        notes.extend(decoder.notes());
        notes
    }
}
