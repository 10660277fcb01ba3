//! `otolith inspect`: what a recording, a log or a raw capture holds.

use std::fmt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use nalgebra::Vector3;
use serde::Serialize;

use super::assemble::{decoder, line_stamper};
use super::failure::{Failure, FailureKind};
use super::replay::damage_text;
use super::show;
use crate::config::Config;
use crate::device::protocol::detect::{AutoDecoder, TEXT};
use crate::device::protocol::{ImuReading, PacketDecoder};
use crate::device::replay::{self, FileKind};
use crate::device::{self, LinkError, Selector, Traffic};
use crate::record::{DamageReport, Recording};
use crate::report::LinkCounters;
use crate::time::{Clock, HostTime, SystemClock};
use crate::units::DEG_PER_RAD;

/// Say what a recording, a log or a raw capture holds.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    otolith inspect run.mcap\n  \
    otolith inspect capture.bin --protocol otolith-serial --json\n  \
    otolith inspect log.txt --log-map configs/logs/turntable-lsm9ds1.toml")]
pub(super) struct InspectArgs {
    /// The file.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Protocol instead of finding it out: otolith-serial, otolith-can, text.
    #[arg(long, value_name = "NAME")]
    protocol: Option<String>,
    /// Columns of a text log.
    #[arg(long, value_name = "FILE.toml")]
    log_map: Option<PathBuf>,
}

/// What was found in a file; the object of `--json`.
#[derive(Debug, Serialize)]
struct Inspection {
    file: String,
    kind: String,
    protocol: String,
    link: LinkCounters,
    samples: u64,
    duration_s: Option<f64>,
    rate_hz: Option<f64>,
    omega_rad_s: Option<Range>,
    specific_force_m_s2: Option<Range>,
    clipped: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    ticks: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    damage: Option<DamageReport>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    events: Vec<String>,
    notes: Vec<String>,
}

/// Smallest, mean and largest value of each axis, sensor frame.
#[derive(Clone, Copy, Debug, Serialize)]
struct Range {
    min: [f64; 3],
    mean: [f64; 3],
    max: [f64; 3],
}

pub(super) fn run(args: &InspectArgs, json: bool) -> Result<ExitCode, Failure> {
    let inspection =
        if replay::detect(&args.file)? == FileKind::Mcap { recording(args)? } else { log(args)? };
    show::result(&inspection, json)?;
    match &inspection.damage {
        Some(damage) if !damage.complete => {
            Err(Failure::new(FailureKind::DataLost, format!("{}: {}", inspection.file, damage_text(damage))))
        }
        _ => Ok(ExitCode::SUCCESS),
    }
}

/// A log or a raw capture, through its decoder.
fn log(args: &InspectArgs) -> Result<Inspection, Failure> {
    let config = Config { log_map: args.log_map.clone(), ..Config::default() };
    let mapping = config.sensor()?.mapping;
    let selector: Selector = format!("replay:{}", args.file.display()).parse()?;
    let mut decoder = decoder(args.protocol.as_deref(), &selector, mapping.as_ref())?;
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::start_now());
    let mut link = device::open(&selector, &clock, mapping.as_ref().map(line_stamper))?;
    let mut tally = Tally::default();
    loop {
        match link.receive(Duration::ZERO) {
            Ok(Some((at, traffic))) => tally.take(decoder.as_mut(), at, traffic),
            Ok(None) => {}
            Err(LinkError::EndOfRecording | LinkError::Lost { .. }) => break,
        }
    }
    if decoder.protocol() == TEXT {
        // The last line may end without a break.
        tally.take(decoder.as_mut(), tally.last_at, Traffic::Bytes(b"\n"));
    }
    let kind = format!("{:?}", replay::detect(&args.file)?).to_lowercase();
    let mut inspection = tally.inspection(&args.file, &kind, decoder.as_ref());
    inspection.link.bytes_skipped += link.status().bytes_skipped;
    Ok(inspection)
}

/// A recording of ours: its ticks and events, and its raw traffic through the decoder.
fn recording(args: &InspectArgs) -> Result<Inspection, Failure> {
    let recording = Recording::open(&args.file)?;
    let config = match recording.header() {
        Some(header) => Config::from_toml(&header.config, &args.file.display().to_string())?,
        None => Config::default(),
    };
    let selector: Selector = config.device.as_deref().unwrap_or("mock:chair").parse()?;
    let log_map = args.log_map.clone();
    let mapping = Config { log_map, ..Config::default() }.sensor()?.mapping;
    let mut notes = Vec::new();
    let mut decoder = match decoder(args.protocol.as_deref(), &selector, mapping.as_ref()) {
        Ok(decoder) => decoder,
        Err(error) => {
            notes.push(format!("raw traffic not decoded: {error}"));
            Box::new(AutoDecoder::new())
        }
    };
    let mut tally = Tally::default();
    for piece in recording.traffic()? {
        let piece = piece?;
        tally.take(decoder.as_mut(), piece.at, piece.traffic());
    }
    let mut inspection = tally.inspection(&args.file, "recording", decoder.as_ref());
    inspection.notes.extend(notes);
    inspection.ticks = Some(recording.damage().ticks_read);
    inspection.damage = Some(recording.damage().clone());
    for event in recording.events()? {
        let (at, text) = event?;
        inspection.events.push(format!("{:.3} s: {text}", at.as_secs_f64()));
    }
    Ok(inspection)
}

/// Collects what the readings of a file say.
#[derive(Debug, Default)]
struct Tally {
    samples: u64,
    clipped: u64,
    without_force: u64,
    without_time: u64,
    time_s: Option<(f64, f64)>,
    last_at: HostTime,
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
    fn take(&mut self, decoder: &mut dyn PacketDecoder, at: HostTime, traffic: Traffic<'_>) {
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

    fn inspection(&self, file: &Path, kind: &str, decoder: &dyn PacketDecoder) -> Inspection {
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
            notes.push(format!("no sample was found (protocol {})", decoder.protocol()));
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

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {}, protocol {}", self.file, self.kind, self.protocol)?;
        let link = &self.link;
        writeln!(
            f,
            "  packets {}, bad checksum {}, bytes skipped {}, missing {}",
            link.packets, link.bad_checksum, link.bytes_skipped, link.missing
        )?;
        write!(f, "  samples {}", self.samples)?;
        if let (Some(duration_s), Some(rate_hz)) = (self.duration_s, self.rate_hz) {
            write!(f, " in {duration_s:.3} s: {rate_hz:.2} Hz")?;
        }
        writeln!(f, ", clipped {}", self.clipped)?;
        if let Some(ticks) = self.ticks {
            writeln!(f, "  ticks {ticks}")?;
        }
        let ranges = [
            ("angular velocity, deg/s", self.omega_rad_s, DEG_PER_RAD),
            ("specific force, m/s2", self.specific_force_m_s2, 1.0),
        ];
        for (what, range, unit) in ranges {
            let Some(range) = range else { continue };
            writeln!(f, "  {what}:")?;
            for (i, axis) in ["x", "y", "z"].iter().enumerate() {
                let [min, mean, max] = [range.min[i], range.mean[i], range.max[i]].map(|value| value * unit);
                writeln!(f, "    {axis}  {min:10.3} to {max:10.3}, mean {mean:10.4}")?;
            }
        }
        for event in &self.events {
            writeln!(f, "  event at {event}")?;
        }
        for note in &self.notes {
            writeln!(f, "  note: {note}")?;
        }
        Ok(())
    }
}
