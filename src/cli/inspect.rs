//! `otolith inspect`: what a recording, a log or a raw capture holds.

mod bus;
mod inspection;
mod tally;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use super::assemble::{check_header, decoder, known_log, line_stamper};
use super::decoder_flags::DecoderFlags;
use super::failure::{Failure, FailureKind};
use super::replay::{damage_text, open};
use super::show;
use crate::config::{Config, ConfigError, SENSOR_CAN_DBC, SENSOR_CAN_MAP, SENSOR_LOG_MAP};
use crate::device::protocol::PacketDecoder;
use crate::device::protocol::can_map::{CanMap, CanMapDecoder};
use crate::device::protocol::detect::{CAN_MAP, TEXT, decoder_for};
use crate::device::protocol::text::{TextDecoder, TextMapping};
use crate::device::replay::{self, FileKind};
use crate::device::{self, DeviceError, LinkError, LinkStatus, Selector};
use crate::time::{Clock, SystemClock};
use inspection::Inspection;
use tally::Tally;

/// Say what a recording, a log or a raw capture holds.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    otolith inspect run.mcap\n  \
    otolith inspect capture.bin --protocol otolith-serial --json\n  \
    otolith inspect phyphox.csv\n  \
    otolith inspect log.txt --log-map configs/logs/turntable-lsm9ds1.toml\n  \
    otolith inspect candump.log --map toyota-yaw\n  \
    otolith inspect candump.log --map my-sensor.toml --dbc my-sensor.dbc\n\n\
    Without --map a candump log of somebody else's bus is described: its identifiers, and the ready mappings that fit.")]
pub(super) struct InspectArgs {
    /// The file.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    flags: DecoderFlags,
}

impl InspectArgs {
    /// A tally that proposes mappings unless one is given.
    fn tally(&self) -> Tally {
        if self.flags.map.is_some() { Tally::default() } else { Tally::trying_can_maps() }
    }
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
    let config = args.flags.config();
    let mut sensor = config.sensor()?;
    let selector: Selector = format!("replay:{}", args.file.display()).parse()?;
    let known = known_log(&config, &selector)?;
    if let Some(known) = known {
        sensor.mapping = Some(known.mapping().map_err(ConfigError::from)?);
    }
    let mut decoder = decoder(args.flags.protocol.as_deref(), &selector, &sensor)?;
    if let (Some(mapping), Some(map_file), TEXT) = (&sensor.mapping, &config.log_map, decoder.protocol()) {
        check_header(&args.file, mapping, map_file)?;
    }
    if args.flags.allow_degraded {
        decoder.allow_degraded();
    }
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::start_now());
    let stamper = sensor.mapping.as_ref().filter(|_| decoder.protocol() == TEXT).map(line_stamper);
    let mut link = device::open(&selector, &clock, stamper)?;
    let kind = replay::detect(&args.file)?;
    let mut tally = if kind == FileKind::Raw { args.tally().without_arrivals() } else { args.tally() };
    loop {
        match link.receive(Duration::ZERO) {
            Ok(Some((at, traffic))) => tally.take(decoder.as_mut(), at, traffic),
            Ok(None) => {}
            Err(LinkError::EndOfRecording) => break,
            Err(LinkError::Lost { port, source }) => {
                return Err(DeviceError::File { path: port.into(), source }.into());
            }
        }
    }
    tally.finish(decoder.as_mut());
    let status = link.status();
    let mut inspection = tally.inspection(&args.file, &kind.to_string(), decoder.as_ref(), &status);
    inspection.notes.extend(link_notes(&status));
    if let Some(known) = known {
        inspection.notes.push(format!("columns as in the built-in {}", known.file));
    }
    Ok(inspection)
}

/// What a link has counted, in words.
fn link_notes(status: &LinkStatus) -> Vec<String> {
    let mut notes = Vec::new();
    if status.bytes_skipped > 0 {
        let bytes = status.bytes_skipped;
        notes.push(format!(
            "{bytes} bytes of lines that are no data frame of classic CAN (remote, CAN FD, damaged)"
        ));
    }
    if status.bus_errors > 0 {
        let mut said: Vec<String> = status.bus_faults.iter().map(|fault| fault.to_string()).collect();
        if status.bus_off > 0 {
            said.push(format!("bus off {} times", status.bus_off));
        }
        let colon = if said.is_empty() { "" } else { ": " };
        notes.push(format!("{} error frames{colon}{}", status.bus_errors, said.join(", ")));
    }
    notes
}

/// A recording of ours: its ticks and events, and its raw traffic through the decoder.
fn recording(args: &InspectArgs) -> Result<Inspection, Failure> {
    let recording = open(&args.file)?;
    let config = match recording.header() {
        Some(header) => Config::from_toml(&header.config, &args.file.display().to_string())?,
        None => Config::default(),
    };
    let nothing = BTreeMap::new();
    let recorded = recording.header().map_or(&nothing, |header| &header.models);
    let mut decoder = decoder_of_recording(&args.flags, &config, recorded)?;
    let mut tally = args.tally();
    for piece in recording.traffic()? {
        let piece = piece?;
        tally.take(decoder.as_mut(), piece.at, piece.traffic());
    }
    tally.finish(decoder.as_mut());
    let mut inspection = tally.inspection(&args.file, "recording", decoder.as_ref(), &LinkStatus::default());
    inspection.ticks = Some(recording.damage().ticks_read);
    inspection.damage = Some(recording.damage().clone());
    for event in recording.events()? {
        let (at, text) = event?;
        inspection.events.push(format!("{:.3} s: {text}", at.as_secs_f64()));
    }
    Ok(inspection)
}

/// The decoder for the traffic of a recording, from the flags or else from the recorded configuration and mappings;
/// `recorded` are the texts that the recording holds, by name.
pub(super) fn decoder_of_recording(
    flags: &DecoderFlags,
    config: &Config,
    recorded: &BTreeMap<String, String>,
) -> Result<Box<dyn PacketDecoder>, Failure> {
    let selector: Selector = config.device.as_deref().unwrap_or("mock:chair").parse()?;
    let mut sensor = flags.config().sensor()?;
    if let (None, Some(text)) = (&sensor.mapping, recorded.get(SENSOR_LOG_MAP)) {
        sensor.mapping = Some(TextMapping::from_toml(SENSOR_LOG_MAP, text).map_err(ConfigError::from)?);
    }
    let can = (recorded.get(SENSOR_CAN_MAP), recorded.get(SENSOR_CAN_DBC));
    if let (None, (Some(map), Some(dbc))) = (&sensor.can_map, can) {
        let can_map = CanMap::new(SENSOR_CAN_MAP, map, SENSOR_CAN_DBC, dbc).map_err(ConfigError::from)?;
        sensor.can_map = Some(can_map);
    }
    let protocol = flags.protocol.as_deref().or(config.protocol.as_deref());
    let mut decoder: Box<dyn PacketDecoder> = match (protocol, &sensor.mapping, &sensor.can_map) {
        (Some(CAN_MAP), _, Some(can_map)) => Box::new(CanMapDecoder::new(can_map)),
        (Some(TEXT), Some(mapping), _) => Box::new(TextDecoder::new(mapping)),
        (Some(name), _, _) => decoder_for(&selector, Some(name))?,
        (None, _, Some(can_map)) => Box::new(CanMapDecoder::new(can_map)),
        (None, Some(mapping), None)
            if matches!(selector, Selector::Replay { .. } | Selector::Serial { .. }) =>
        {
            Box::new(TextDecoder::new(mapping))
        }
        (None, _, None) => decoder_for(&selector, None)?,
    };
    if flags.allow_degraded || config.allow_degraded {
        decoder.allow_degraded();
    }
    Ok(decoder)
}
