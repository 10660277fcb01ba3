//! `otolith inspect`: what a recording, a log or a raw capture holds.

mod inspection;
mod tally;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use super::assemble::{decoder, line_stamper};
use super::failure::{Failure, FailureKind};
use super::replay::{damage_text, open};
use super::show;
use crate::config::{Config, ConfigError, SENSOR_LOG_MAP};
use crate::device::protocol::PacketDecoder;
use crate::device::protocol::detect::{TEXT, decoder_by_name, decoder_for};
use crate::device::protocol::text::{TextDecoder, TextMapping};
use crate::device::replay::{self, FileKind};
use crate::device::{self, DeviceError, LinkError, Selector, Traffic};
use crate::time::{Clock, SystemClock};
use inspection::Inspection;
use tally::Tally;

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
    let mapping = log_mapping(args.log_map.clone())?;
    let selector: Selector = format!("replay:{}", args.file.display()).parse()?;
    let mut decoder = decoder(args.protocol.as_deref(), &selector, mapping.as_ref())?;
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::start_now());
    let mut link = device::open(&selector, &clock, mapping.as_ref().map(line_stamper))?;
    let mut tally = Tally::default();
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
    let recording = open(&args.file)?;
    let config = match recording.header() {
        Some(header) => Config::from_toml(&header.config, &args.file.display().to_string())?,
        None => Config::default(),
    };
    let recorded_map = recording.header().and_then(|header| header.models.get(SENSOR_LOG_MAP));
    let flags = (args.protocol.as_deref(), args.log_map.as_ref());
    let mut decoder = decoder_of_recording(flags, &config, recorded_map.map(String::as_str))?;
    let mut tally = Tally::default();
    for piece in recording.traffic()? {
        let piece = piece?;
        tally.take(decoder.as_mut(), piece.at, piece.traffic());
    }
    let mut inspection = tally.inspection(&args.file, "recording", decoder.as_ref());
    inspection.ticks = Some(recording.damage().ticks_read);
    inspection.damage = Some(recording.damage().clone());
    for event in recording.events()? {
        let (at, text) = event?;
        inspection.events.push(format!("{:.3} s: {text}", at.as_secs_f64()));
    }
    Ok(inspection)
}

/// The decoder for the traffic of a recording, from the flags or else from the recorded configuration and mapping.
pub(super) fn decoder_of_recording(
    (protocol, log_map): (Option<&str>, Option<&PathBuf>),
    config: &Config,
    recorded_map: Option<&str>,
) -> Result<Box<dyn PacketDecoder>, Failure> {
    let selector: Selector = config.device.as_deref().unwrap_or("mock:chair").parse()?;
    let mapping = match (log_map, recorded_map) {
        (Some(_), _) => log_mapping(log_map.cloned())?,
        (None, Some(text)) => Some(TextMapping::from_toml(SENSOR_LOG_MAP, text).map_err(ConfigError::from)?),
        (None, None) => None,
    };
    let protocol = protocol.or(config.protocol.as_deref());
    let decoder: Box<dyn PacketDecoder> = match (protocol, mapping) {
        (Some(TEXT), Some(mapping)) => Box::new(TextDecoder::new(&mapping)),
        (None, Some(mapping)) if matches!(selector, Selector::Replay { .. } | Selector::Serial { .. }) => {
            Box::new(TextDecoder::new(&mapping))
        }
        (Some(name), _) => decoder_by_name(name)?,
        (None, _) => decoder_for(&selector),
    };
    Ok(decoder)
}

fn log_mapping(file: Option<PathBuf>) -> Result<Option<TextMapping>, Failure> {
    Ok(Config { log_map: file, ..Config::default() }.sensor()?.mapping)
}
