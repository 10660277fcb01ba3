//! From a configuration to a source: the one place that joins link, decoder and IMU path.

use std::sync::Arc;

use super::failure::Failure;
use crate::config::{Config, ConfigError, Sensor};
use crate::device::fault::FaultInjector;
use crate::device::protocol::PacketDecoder;
use crate::device::protocol::detect::{TEXT, decoder_by_name, decoder_for};
use crate::device::protocol::text::{TextDecoder, TextMapping};
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
    let sensor = config.sensor()?;
    let live = is_live(selector);
    if live && pace == Pace::Max {
        return Err(Failure::usage(format!(
            "{selector}: a device runs in real time, --pace max is for recordings and mocks\n\nhint: leave --pace out"
        )));
    }
    let (link, decoder) = open_link(config, selector, &sensor, clock)?;
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
    Ok(Source::new(link, decoder, pipeline, baud))
}

/// Whether the device runs in real time whatever the program does.
pub(super) fn is_live(selector: &Selector) -> bool {
    matches!(selector, Selector::Serial { .. } | Selector::Can { .. })
}

/// An open device and the decoder of its traffic.
type Opened = (Box<dyn Link>, Box<dyn PacketDecoder>);

/// Opens the device and picks the decoder of its traffic.
pub(super) fn open_link(
    config: &Config,
    selector: &Selector,
    sensor: &Sensor,
    clock: &Arc<dyn Clock>,
) -> Result<Opened, Failure> {
    check_text_log(config, selector, sensor)?;
    let decoder = decoder(config.protocol.as_deref(), selector, sensor.mapping.as_ref())?;
    let stamper = sensor.mapping.as_ref().filter(|_| decoder.protocol() == TEXT).map(line_stamper);
    Ok((device::open(selector, clock, stamper)?, decoder))
}

/// The decoder that was asked for, or the one that fits the device.
pub(super) fn decoder(
    protocol: Option<&str>,
    selector: &Selector,
    mapping: Option<&TextMapping>,
) -> Result<Box<dyn PacketDecoder>, Failure> {
    let text_log = is_text_log(selector)?;
    // A mapping is given for text only: a log, or a sketch that prints lines.
    let text_fits = text_log || matches!(selector, Selector::Serial { .. });
    match (protocol, mapping) {
        (Some(TEXT), Some(mapping)) => Ok(Box::new(TextDecoder::new(mapping))),
        (None, Some(mapping)) if text_fits => Ok(Box::new(TextDecoder::new(mapping))),
        (Some(TEXT), None) => Err(needs_mapping(selector)),
        (Some(name), _) => Ok(decoder_by_name(name)?),
        (None, None) if text_log => Err(needs_mapping(selector)),
        (None, _) => Ok(decoder_for(selector)),
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

/// Whether the device is a log of text lines.
fn is_text_log(selector: &Selector) -> Result<bool, DeviceError> {
    let Selector::Replay { path, kind, .. } = selector else { return Ok(false) };
    let kind = match kind {
        Some(kind) => *kind,
        None => replay::detect(path)?,
    };
    Ok(kind == FileKind::Text)
}

/// Holds a text log against its mapping: a missing column or a value that is no number is an error before the run,
/// not a row count after it. Of a device the same is only counted.
fn check_text_log(config: &Config, selector: &Selector, sensor: &Sensor) -> Result<(), Failure> {
    let (Selector::Replay { path, .. }, Some(mapping), Some(map_file)) =
        (selector, &sensor.mapping, &config.log_map)
    else {
        return Ok(());
    };
    if !is_text_log(selector)? {
        return Ok(());
    }
    let log = std::fs::read(path).map_err(|source| DeviceError::File { path: path.clone(), source })?;
    let name = path.display().to_string();
    mapping.check_log(&name, &map_file.display().to_string(), &log).map_err(ConfigError::from)?;
    mapping.check_rows(&name, &log).map_err(ConfigError::from)?;
    Ok(())
}
