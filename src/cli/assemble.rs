//! From a configuration to a source: the one place that joins link, decoder and IMU path.

use std::path::Path;
use std::sync::Arc;

use super::failure::Failure;
use crate::config::{Config, ConfigError, Sensor};
use crate::device::can::can_details;
use crate::device::configure::Plan;
use crate::device::fault::FaultInjector;
use crate::device::protocol::PacketDecoder;
use crate::device::protocol::can_map::CanMapDecoder;
use crate::device::protocol::detect::{CAN_MAP, TEXT, check_fits, decoder_for};
use crate::device::protocol::text::{self, KnownLog, TextDecoder, TextMapping};
use crate::device::replay::{self, FileKind};
use crate::device::{self, DeviceError, LineStamper, Link, Selector, pacer::Paced};
use crate::imu::ImuPipeline;
use crate::runtime::Source;
use crate::time::Clock;

/// How fast a run goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Pace {
    /// In real time.
    Real,
    /// As fast as the machine goes.
    Max,
}

/// Opens the device of `config` and everything between it and head samples.
pub(super) fn open_source(
    config: &Config,
    selector: &Selector,
    gravity: f64,
    pace: Pace,
    clock: &Arc<dyn Clock>,
) -> Result<Source, Failure> {
    let live = is_live(selector);
    if live && pace == Pace::Max {
        return Err(Failure::usage(format!(
            "{selector}: a device runs in real time, --pace max is for recordings and mocks\n\nhint: leave --pace out"
        )));
    }
    let Opened { link, decoder, sensor } = open_link(config, selector, clock)?;
    let link: Box<dyn Link> = match &config.faults {
        Some(plan) => Box::new(FaultInjector::new(link, plan.clone())?),
        None => link,
    };
    let link: Box<dyn Link> = match pace {
        Pace::Real if !live => Box::new(Paced::new(link, clock.clone(), 1.0)?),
        _ => link,
    };
    let baud = match selector {
        Selector::Serial { baud, .. } => Some(*baud),
        _ => None,
    };
    let pipeline = ImuPipeline::new(&config.imu, sensor.calibration, sensor.mount, gravity);
    let source = Source::new(link, decoder, pipeline, baud);
    Ok(match bus_bitrate(selector) {
        Some(bitrate) => source.on_can_bus(bitrate),
        None => source,
    })
}

/// Bit rate of the CAN bus a selector names, where the system or the selector knows it.
fn bus_bitrate(selector: &Selector) -> Option<u32> {
    match selector {
        Selector::Can { interface, .. } => can_details(interface)?.bitrate,
        Selector::Slcan { bitrate, .. } => Some(*bitrate),
        _ => None,
    }
}

/// The commands `--configure` asks for, with the port they are for and its baud rate.
fn plan<'a>(config: &Config, selector: &'a Selector) -> Result<Option<(&'a str, u32, Plan)>, Failure> {
    let Some(text) = &config.configure else { return Ok(None) };
    let request = text.parse().map_err(DeviceError::Configure)?;
    let (Selector::Serial { port, baud }, Some(protocol)) = (selector, &config.protocol) else {
        return Err(Failure::usage(format!(
            "--configure {text} needs a serial port and the name of its protocol, got {selector} and {}\n\n\
             hint: `otolith devices` says what a port speaks; name it with --protocol",
            config.protocol.as_deref().unwrap_or("none")
        )));
    };
    Ok(Some((port, *baud, Plan::new(protocol, &request, *baud)?)))
}

/// Whether the device runs in real time whatever the program does.
pub(super) fn is_live(selector: &Selector) -> bool {
    matches!(selector, Selector::Serial { .. } | Selector::Can { .. } | Selector::Slcan { .. })
}

/// An open device, the decoder of its traffic, and what is known about its sensor.
pub(super) struct Opened {
    pub(super) link: Box<dyn Link>,
    pub(super) decoder: Box<dyn PacketDecoder>,
    pub(super) sensor: Sensor,
}

/// Opens the device, sets it up if asked to, and picks the decoder of its traffic.
pub(super) fn open_link(
    config: &Config,
    selector: &Selector,
    clock: &Arc<dyn Clock>,
) -> Result<Opened, Failure> {
    let mut sensor = config.sensor()?;
    let known = known_log(config, selector)?;
    if let Some(known) = known {
        sensor.mapping = Some(known.mapping().map_err(ConfigError::from)?);
    }
    if let Some(mapping) = &sensor.mapping {
        let map_file = config.log_map.as_ref().map(|path| path.display().to_string());
        let map_file = map_file.or(known.map(|known| known.file.to_owned())).unwrap_or_default();
        check_text_log(selector, mapping, &map_file)?;
    }
    let mut decoder = decoder(config.protocol.as_deref(), selector, &sensor)?;
    if config.allow_degraded {
        decoder.allow_degraded();
    }
    let stamper = sensor.mapping.as_ref().filter(|_| decoder.protocol() == TEXT).map(line_stamper);
    if let (Selector::Replay { path, kind, .. }, None) = (selector, &stamper) {
        replay::check_time(path, *kind)?;
    }
    let link = match plan(config, selector)? {
        Some((port, baud, plan)) => device::open_serial(port, baud, clock, Some(plan))?,
        None => device::open(selector, clock, stamper)?,
    };
    Ok(Opened { link, decoder, sensor })
}

/// The decoder that was asked for, or the one that fits the device.
pub(super) fn decoder(
    protocol: Option<&str>,
    selector: &Selector,
    sensor: &Sensor,
) -> Result<Box<dyn PacketDecoder>, Failure> {
    let text_log = is_text_log(selector)?;
    if let (Some(map), Some(CAN_MAP) | None) = (&sensor.can_map, protocol)
        && !text_log
    {
        check_fits(selector, CAN_MAP)?;
        return Ok(Box::new(CanMapDecoder::new(map)));
    }
    // A mapping is given for text only: a log, or a sketch that prints lines, which may begin with noise.
    let text_fits = text_log
        || matches!(selector, Selector::Serial { .. })
        || file_kind(selector)? == Some(FileKind::Raw);
    match (protocol, &sensor.mapping) {
        (Some(TEXT), Some(mapping)) => {
            check_fits(selector, TEXT)?;
            Ok(Box::new(TextDecoder::new(mapping)))
        }
        (None, Some(mapping)) if text_fits => Ok(Box::new(TextDecoder::new(mapping))),
        (Some(TEXT), None) => Err(needs_mapping(selector)),
        (None, None) if text_log => Err(needs_mapping(selector)),
        (name, _) => Ok(decoder_for(selector, name)?),
    }
}

fn needs_mapping(selector: &Selector) -> Failure {
    let error = DeviceError::NeedsMapping;
    match selector {
        Selector::Replay { path, .. } => Failure::usage(format!("{}: {error}", path.display())),
        selector => Failure::usage(format!("{selector}: {error}")),
    }
}

/// Stamps lines with their own time column, ns.
pub(super) fn line_stamper(mapping: &TextMapping) -> LineStamper {
    // Logs may start at a negative time; stamps are relative to the first one anyway.
    const OFFSET_S: f64 = 1e6;
    let mut times = mapping.line_times();
    Box::new(move |line| times.time_of_line(line).map(|seconds| ((seconds + OFFSET_S).max(0.0) * 1e9) as u64))
}

/// The built-in mapping for the device's lines: for a text log with a header that is known, unless the configuration
/// names a mapping or another protocol.
pub(super) fn known_log(config: &Config, selector: &Selector) -> Result<Option<KnownLog>, Failure> {
    let Selector::Replay { path, .. } = selector else { return Ok(None) };
    let text_may_be_meant = config.protocol.as_deref().is_none_or(|protocol| protocol == TEXT);
    if config.log_map.is_some() || !text_may_be_meant || !is_text_log(selector)? {
        return Ok(None);
    }
    let found = text::known_log(&path.display().to_string(), &replay::start(path)?);
    Ok(found.map_err(ConfigError::from)?)
}

/// Whether the device is a log of text lines.
fn is_text_log(selector: &Selector) -> Result<bool, DeviceError> {
    Ok(file_kind(selector)? == Some(FileKind::Text))
}

/// What kind of file the device is, if it is one.
fn file_kind(selector: &Selector) -> Result<Option<FileKind>, DeviceError> {
    let Selector::Replay { path, kind, .. } = selector else { return Ok(None) };
    Ok(Some(match kind {
        Some(kind) => *kind,
        None => replay::detect(path)?,
    }))
}

/// Holds the header of a text log against the mapping that was named for it: without its columns every row would be a
/// bad one.
pub(super) fn check_header(log: &Path, mapping: &TextMapping, map_file: &Path) -> Result<(), Failure> {
    let (log_name, map_name) = (log.display().to_string(), map_file.display().to_string());
    Ok(mapping.check_header(&log_name, &map_name, &replay::start(log)?).map_err(ConfigError::from)?)
}

/// Holds a text log against its mapping: a missing column or a value that is no number is an error before the run,
/// not a row count after it. Of a device the same is only counted.
fn check_text_log(selector: &Selector, mapping: &TextMapping, map_file: &str) -> Result<(), Failure> {
    let Selector::Replay { path, .. } = selector else { return Ok(()) };
    if !is_text_log(selector)? {
        return Ok(());
    }
    let log = std::fs::read(path).map_err(|source| DeviceError::File { path: path.clone(), source })?;
    let name = path.display().to_string();
    mapping.check_log(&name, map_file, &log).map_err(ConfigError::from)?;
    mapping.check_rows(&name, &log).map_err(ConfigError::from)?;
    Ok(())
}
