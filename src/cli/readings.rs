//! Raw readings of a device, a log or a recording, dated and collected: the sensor's own axes, before any alignment.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use super::assemble::{Opened, is_live, open_link};
use super::console::stop_on_ctrl_c;
use super::decoder_flags::DecoderFlags;
use super::failure::{Failure, FailureKind};
use super::inspect::decoder_of_recording;
use super::replay::{damage_text, open};
use super::show;
use crate::config::{Config, ConfigError};
use crate::device::protocol::{ImuReading, PacketDecoder};
use crate::device::replay::{self, FileKind};
use crate::device::{DeviceError, Link, LinkError, Selector, Traffic};
use crate::imu::{ClockSync, OrderWatch, Place};
use crate::runtime::Signals;
use crate::survey::{MAX_SAMPLES, Sample};
use crate::time::{Clock, HostTime, SystemClock};

/// Longest wait for traffic, so that Ctrl-C is heard.
const PATIENCE: Duration = Duration::from_millis(100);
/// A live device that gives no sample for so long is spoken of.
const SILENCE: Duration = Duration::from_secs(3);

/// Where readings come from.
#[derive(Debug, clap::Args)]
pub(super) struct ReadingsArgs {
    /// A recording, a log or a raw capture.
    #[arg(value_name = "FILE", required_unless_present = "device", conflicts_with = "device")]
    file: Option<PathBuf>,
    /// Device: serial:PORT?baud=N, can:IFACE, slcan:PORT, replay:FILE, mock:chair.
    #[arg(long, value_name = "SELECTOR")]
    device: Option<String>,
    #[command(flatten)]
    flags: DecoderFlags,
    /// End after this much time: of a live device from its opening on, else from the first sample on.
    #[arg(long, value_name = "S")]
    duration_s: Option<f64>,
}

/// The readings of one source.
pub(super) struct Readings {
    /// Name of the source.
    pub(super) source: String,
    /// Name of the protocol.
    pub(super) protocol: &'static str,
    /// In the order of time.
    pub(super) samples: Vec<Sample>,
    /// What was left out, and what became of the connection.
    pub(super) notes: Vec<String>,
    /// What is damaged in the recording they come from.
    damage: Option<String>,
}

impl Readings {
    /// Fails when the readings come from a damaged recording: what was found in the rest of it stands.
    pub(super) fn check_whole(&self) -> Result<(), Failure> {
        match &self.damage {
            Some(damage) => Err(Failure::new(FailureKind::DataLost, format!("{}: {damage}", self.source))),
            None => Ok(()),
        }
    }
}

impl ReadingsArgs {
    /// Collects the readings; `watch` sees what there is so far and says when it is enough.
    pub(super) fn collect(&self, mut watch: impl FnMut(&[Sample]) -> bool) -> Result<Readings, Failure> {
        if let Some(got) = self.duration_s.filter(|s| !(s.is_finite() && *s > 0.0)) {
            return Err(Failure::usage(format!(
                "--duration-s is {got}, expected more than 0 s\n\nhint: give a number of seconds, or leave --duration-s out"
            )));
        }
        let readings = match (&self.file, &self.device) {
            (Some(file), _) if replay::detect(file)? == FileKind::Mcap => self.recorded(file)?,
            (Some(file), _) => {
                let name = file.display().to_string();
                self.received(&name, format!("replay:{name}").parse()?, &mut watch)?
            }
            (None, Some(device)) => self.received(device, device.parse()?, &mut watch)?,
            (None, None) => return Err(ConfigError::NoDevice.into()),
        };
        if readings.samples.is_empty() {
            return Err(Failure::new(
                FailureKind::Failed,
                format!(
                    "{}: not one sample was found (protocol {})\n\n\
                     hint: `otolith inspect FILE` says what is in a file; --protocol names a decoder, --log-map the \
                     columns of a text log",
                    readings.source, readings.protocol
                ),
            ));
        }
        Ok(readings)
    }

    /// The device is a real one and somebody must move it.
    pub(super) fn is_live(&self) -> Result<bool, Failure> {
        match &self.device {
            Some(device) => Ok(is_live(&device.parse()?)),
            None => Ok(false),
        }
    }

    fn received(
        &self,
        name: &str,
        selector: Selector,
        watch: &mut dyn FnMut(&[Sample]) -> bool,
    ) -> Result<Readings, Failure> {
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::start_now());
        let Opened { mut link, mut decoder, .. } = open_link(&self.flags.config(), &selector, &clock)?;
        let signals = Arc::new(Signals::default());
        stop_on_ctrl_c(&signals)?;
        // The time of a device that falls silent must end, too.
        let live = is_live(&selector);
        let ends_at =
            self.duration_s.filter(|_| live).map(|s| clock.now() + Duration::from_secs_f64(s.min(1e9)));
        let mut collector = Collector::new(name, self.duration_s.filter(|_| !live));
        let mut line = live.then(|| LineWatch { name, heard_at: clock.now(), silent: false, down: false });
        let mut seen = 0;
        while !signals.stop.load(Ordering::Relaxed)
            && !collector.full()?
            && ends_at.is_none_or(|end| clock.now() < end)
        {
            if !collector.take_from(link.as_mut(), decoder.as_mut())? {
                break;
            }
            let more = collector.samples.len() > seen;
            seen = collector.samples.len();
            if let Some(line) = &mut line {
                line.look(clock.now(), more, link.status().down);
            }
            if more && watch(&collector.samples) {
                break;
            }
        }
        collector.finish(decoder.as_mut());
        let mut readings = collector.readings(decoder.as_ref());
        let losses = link.status().losses;
        if losses > 0 {
            let times = if losses == 1 { "once".to_owned() } else { format!("{losses} times") };
            readings.notes.push(format!("the connection was lost {times}: nothing is known of that time"));
        }
        Ok(readings)
    }

    /// A recording of ours: its raw traffic once more.
    fn recorded(&self, file: &Path) -> Result<Readings, Failure> {
        let recording = open(file)?;
        let name = file.display().to_string();
        let config = match recording.header() {
            Some(header) => Config::from_toml(&header.config, &name)?,
            None => Config::default(),
        };
        let nothing = BTreeMap::new();
        let recorded = recording.header().map_or(&nothing, |header| &header.models);
        let mut decoder = decoder_of_recording(&self.flags, &config, recorded)?;
        let mut collector = Collector::new(&name, self.duration_s);
        for piece in recording.traffic()? {
            if collector.full()? {
                break;
            }
            let piece = piece?;
            collector.take(decoder.as_mut(), piece.at, piece.traffic());
        }
        collector.finish(decoder.as_mut());
        let damage = (!recording.damage().complete).then(|| damage_text(recording.damage()));
        Ok(Readings { damage, ..collector.readings(decoder.as_ref()) })
    }
}

/// Tells whoever waits at a live device what becomes of it.
struct LineWatch<'a> {
    name: &'a str,
    heard_at: HostTime,
    silent: bool,
    down: bool,
}

impl LineWatch<'_> {
    /// One look: whether there are more samples than before, whether the connection is lost.
    fn look(&mut self, now: HostTime, more: bool, down: bool) {
        if down != self.down {
            self.down = down;
            let what = if down { "connection lost, waiting for the device" } else { "connection is back" };
            show::note(&format!("{}: {what}", self.name));
        }
        if more || down {
            (self.heard_at, self.silent) = (now, false);
        } else if !self.silent && now.saturating_since(self.heard_at) >= SILENCE {
            self.silent = true;
            show::note(&format!(
                "{}: not one sample for {} s: `otolith doctor {}` looks for the reason",
                self.name,
                SILENCE.as_secs(),
                self.name
            ));
        }
    }
}

/// Dates readings and keeps them.
struct Collector {
    source: String,
    duration_s: Option<f64>,
    clock: ClockSync,
    announced_hz: Option<f64>,
    reconnects: u64,
    last_at: HostTime,
    order: OrderWatch,
    samples: Vec<Sample>,
    not_finite: u64,
    out_of_order: u64,
}

impl Collector {
    fn new(source: &str, duration_s: Option<f64>) -> Self {
        Self {
            source: source.to_owned(),
            duration_s,
            clock: ClockSync::new(None),
            announced_hz: None,
            reconnects: 0,
            last_at: HostTime::default(),
            order: OrderWatch::default(),
            samples: Vec::new(),
            not_finite: 0,
            out_of_order: 0,
        }
    }

    /// One look at the link; false at the end of a finite source.
    fn take_from(&mut self, link: &mut dyn Link, decoder: &mut dyn PacketDecoder) -> Result<bool, Failure> {
        match link.receive(PATIENCE) {
            Ok(Some((at, traffic))) => self.take(decoder, at, traffic),
            Ok(None) => {}
            Err(LinkError::EndOfRecording) => return Ok(false),
            Err(LinkError::Lost { port, source }) => {
                return Err(DeviceError::File { path: port.into(), source }.into());
            }
        }
        let reconnects = link.status().reconnects;
        if reconnects > self.reconnects {
            self.reconnects = reconnects;
            decoder.rejoin();
        }
        let mut bytes = [0; 64];
        if let Some(length) = decoder.poll_transmit(self.last_at.0 / 1000, &mut bytes) {
            // A request that cannot be sent is not retried: the next one follows in a second.
            let _unsent = link.send(Traffic::Bytes(&bytes[..length]));
        }
        Ok(true)
    }

    /// Shows a piece of traffic to the decoder and keeps its readings; what is not finite is left out.
    fn take(&mut self, decoder: &mut dyn PacketDecoder, at: HostTime, traffic: Traffic<'_>) {
        self.last_at = at;
        let rate_hz = decoder.announced_rate_hz();
        if rate_hz.is_some() && self.announced_hz != rate_hz {
            self.announced_hz = rate_hz;
            self.clock.assume_rate(rate_hz);
        }
        decoder.push(traffic, &mut |reading| self.keep(&reading));
    }

    /// What only the end of the traffic completes.
    fn finish(&mut self, decoder: &mut dyn PacketDecoder) {
        decoder.finish(&mut |reading| self.keep(&reading));
    }

    fn keep(&mut self, reading: &ImuReading) {
        let mut values = reading.omega_imu.iter().chain(reading.specific_force_imu.iter().flatten());
        if !values.all(|value| value.is_finite()) {
            self.not_finite += 1;
        } else if self.order.judge(reading) != Place::InOrder {
            self.out_of_order += 1;
        } else {
            self.samples.push(Sample {
                time_s: self.clock.host_time(reading.device_time, self.last_at).as_secs_f64(),
                omega_imu: reading.omega_imu,
                specific_force_imu: reading.specific_force_imu,
                clipped: reading.clipped,
            });
        }
    }

    /// Whether the time is up.
    fn full(&self) -> Result<bool, Failure> {
        if self.samples.len() > MAX_SAMPLES {
            return Err(Failure::usage(format!(
                "{}: more than {MAX_SAMPLES} samples, which is as many as are held in memory\n\n\
                 hint: end earlier with --duration-s",
                self.source
            )));
        }
        let covered_s = match self.samples.as_slice() {
            [first, .., last] => last.time_s - first.time_s,
            _ => 0.0,
        };
        Ok(self.duration_s.is_some_and(|duration_s| covered_s >= duration_s))
    }

    fn readings(self, decoder: &dyn PacketDecoder) -> Readings {
        let left_out = [
            (self.not_finite, "samples hold a value that is no number and are left out"),
            (self.out_of_order, "samples came twice or too late and are left out"),
        ];
        let notes = left_out.into_iter().filter(|(count, _)| *count > 0);
        Readings {
            source: self.source,
            protocol: decoder.protocol(),
            samples: self.samples,
            notes: notes.map(|(count, what)| format!("{count} {what}")).collect(),
            damage: None,
        }
    }
}
