//! The receiving side: link, decoder and IMU path as one thing that hands out head samples.

use std::time::Duration;

use super::trouble::{Change, Counts, Silence, Trouble, TroubleWatch};
use crate::device::can::bus::BusState;
use crate::device::protocol::detect::{LONGEST_FRAME_BYTES, OTOLITH_CAN};
use crate::device::protocol::{DecodeCounters, ImuReading, PacketDecoder, SyncEstimate};
use crate::device::{DeviceError, Link, LinkError, LinkStatus, Traffic, bandwidth};
use crate::imu::{AlignmentReport, ClockMode, HeadSample, ImuCounters, ImuPipeline};
use crate::time::HostTime;

/// Good frames after which the line's load is judged: a device may begin with a short batch.
const FRAMES_BEFORE_LINE_CHECK: u64 = 5;

/// Takes what a source produces.
pub trait SourceSink {
    /// One piece of raw traffic.
    fn traffic(&mut self, at: HostTime, traffic: Traffic<'_>);
    /// One sample in chair axes.
    fn sample(&mut self, sample: HeadSample);
    /// Something to note: the connection was lost, came back, the protocol was recognised.
    fn event(&mut self, at: HostTime, text: &str);
}

/// What came of one look at the link.
#[derive(Debug)]
pub enum Polled {
    /// Traffic was taken in.
    Traffic,
    /// Nothing within the timeout.
    Silence,
    /// The source is exhausted; everything held back has been given out.
    Ended,
}

/// A device with everything between its bytes and head samples.
pub struct Source {
    link: Box<dyn Link>,
    decoder: Box<dyn PacketDecoder>,
    pipeline: ImuPipeline,
    /// Baud rate of a real serial line, to hold against the rate the device announces.
    baud: Option<u32>,
    status: LinkStatus,
    /// Bit rate of the CAN bus, where it is known.
    can_bitrate: Option<u32>,
    /// Name of the port when it was last open.
    port: Option<String>,
    /// Rate the device announced, Hz.
    announced_hz: Option<f64>,
    /// Least bytes a sample took on the line so far.
    least_bytes: f64,
    line_checked: bool,
    recognised: bool,
    last_at: HostTime,
    /// When the newest readings came.
    last_reading_at: HostTime,
    silence: Silence,
    troubles: TroubleWatch,
}

impl std::fmt::Debug for Source {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Source").field("protocol", &self.decoder.protocol()).finish_non_exhaustive()
    }
}

impl Source {
    /// A source; `baud` is given for a serial line only.
    pub fn new(
        link: Box<dyn Link>,
        decoder: Box<dyn PacketDecoder>,
        pipeline: ImuPipeline,
        baud: Option<u32>,
    ) -> Self {
        Self {
            port: link.port().map(str::to_owned),
            link,
            decoder,
            pipeline,
            baud,
            status: LinkStatus::default(),
            can_bitrate: None,
            announced_hz: None,
            least_bytes: f64::INFINITY,
            line_checked: false,
            recognised: false,
            last_at: HostTime::default(),
            last_reading_at: HostTime::default(),
            silence: Silence::default(),
            troubles: TroubleWatch::default(),
        }
    }

    /// The same without an eye for some troubles: the negative control of its tests.
    pub fn blind_to(self, troubles: impl IntoIterator<Item = Trouble>) -> Self {
        Self { troubles: TroubleWatch::blind_to(troubles), ..self }
    }

    /// The troubles present now, gravest first.
    pub fn troubles(&self) -> impl Iterator<Item = Trouble> {
        self.troubles.present()
    }

    /// The same on a CAN bus of this bit rate: the rate that our own device announces is held against it.
    #[must_use]
    pub fn on_can_bus(mut self, bitrate: u32) -> Self {
        self.can_bitrate = Some(bitrate);
        self
    }

    /// Waits at most `timeout` for traffic and passes on what it means.
    ///
    /// # Errors
    /// The announced sample rate does not fit the line, or a played file cannot be read on.
    pub fn poll(&mut self, timeout: Duration, sink: &mut dyn SourceSink) -> Result<Polled, DeviceError> {
        let Self { link, decoder, pipeline, last_reading_at, silence, .. } = self;
        let polled = match link.receive(timeout) {
            Ok(Some((at, traffic))) => {
                self.last_at = at;
                sink.traffic(at, traffic);
                decoder.push(traffic, &mut |reading: ImuReading| {
                    (*last_reading_at, silence.lasts) = (at, false);
                    pipeline.push(&reading, at, &mut |sample| sink.sample(sample));
                });
                Polled::Traffic
            }
            Ok(None) => Polled::Silence,
            // Ports and interfaces reconnect by themselves; what is lost here is a file that cannot be read on.
            Err(LinkError::Lost { port, source }) => {
                return Err(DeviceError::File { path: port.into(), source });
            }
            Err(LinkError::EndOfRecording) => {
                self.end(sink);
                return Ok(Polled::Ended);
            }
        };
        self.note_changes(sink);
        self.check_announcement(sink)?;
        self.note_constant_delay();
        let mut bytes = [0; 64];
        if let Some(length) = self.decoder.poll_transmit(self.last_at.0 / 1000, &mut bytes) {
            // A request that cannot be sent is not retried: the next one follows in a second.
            let _unsent = self.link.send(Traffic::Bytes(&bytes[..length]));
        }
        Ok(polled)
    }

    /// Tells that nothing more has come up to `now`.
    ///
    /// During the alignment no sample is given out whose age would show that they stopped coming: then it is a trouble of
    /// its own, unless a lost connection or a bus that is off or down explains it. Before the second sample, and where
    /// nobody tells the time, as of a file, there is no silence.
    pub fn note_silence(&mut self, now: HostTime, sink: &mut dyn SourceSink) {
        let Some(longest_pause_s) = self.pipeline.longest_pause_s() else { return };
        let explained =
            |trouble| matches!(trouble, Trouble::ConnectionLost | Trouble::InterfaceDown | Trouble::BusOff);
        let pause_s = now.saturating_since(self.last_reading_at).as_secs_f64();
        if pause_s > longest_pause_s && !self.troubles.present().any(explained) {
            self.silence.count += u64::from(!self.silence.lasts);
            self.silence.lasts = true;
            // What is told from here on is told later than this.
            self.last_at = self.last_at.max(now);
            self.look_for_troubles(now, sink);
        }
    }

    fn end(&mut self, sink: &mut dyn SourceSink) {
        let Self { decoder, pipeline, .. } = self;
        let at = self.last_at;
        decoder.finish(&mut |reading: ImuReading| {
            pipeline.push(&reading, at, &mut |sample| sink.sample(sample));
        });
        pipeline.finish(&mut |sample| sink.sample(sample));
    }

    /// Turns changes of the connection's state into events.
    fn note_changes(&mut self, sink: &mut dyn SourceSink) {
        let status = self.link.status();
        if status.losses > self.status.losses {
            let why = status.last_loss.map_or_else(String::new, |kind| format!(": {kind}"));
            sink.event(self.last_at, &format!("connection lost{why}; trying to reopen"));
        }
        if status.reconnects > self.status.reconnects {
            let port = self.link.port().map(str::to_owned);
            let elsewhere = port.as_ref().filter(|_| port != self.port);
            let where_ = elsewhere.map_or_else(String::new, |port| format!(", found again as {port}"));
            sink.event(self.last_at, &format!("connection is back{where_}"));
            self.port = port;
            self.decoder.rejoin();
        }
        self.note_bus_changes(&status, sink);
        self.status = status;
        self.look_for_troubles(self.last_at, sink);
        if !self.recognised && self.decoder.counters().packets > 0 && self.decoder.protocol() != "unknown" {
            self.recognised = true;
            sink.event(self.last_at, &format!("protocol {}", self.decoder.protocol()));
            for note in self.decoder.notes() {
                sink.event(self.last_at, &note);
            }
        }
    }

    fn look_for_troubles(&mut self, now: HostTime, sink: &mut dyn SourceSink) {
        let counts = Counts {
            decode: self.judged_counters(),
            link: self.status,
            imu: self.pipeline.counters(),
            silence: self.silence,
        };
        self.troubles.look(now, &counts, |change| match change {
            // Told with the reason when the link's state changes.
            Change::Begun(Trouble::ConnectionLost | Trouble::InterfaceDown | Trouble::BusOff)
            | Change::Over(Trouble::ConnectionLost | Trouble::InterfaceDown | Trouble::BusOff, _) => {}
            Change::Begun(trouble) => sink.event(now, &format!("trouble: {}", trouble.name())),
            Change::Over(trouble, count) => sink.event(now, &format!("over: {count} {}", trouble.name())),
        });
    }

    /// What the decoder has counted. As long as no protocol is known and it may be too early, nothing counts as damaged or
    /// stray: the frame that has begun is all those decoders cannot read whose it is not.
    fn judged_counters(&self) -> DecodeCounters {
        let counters = self.decoder.counters();
        let is_early = counters.packets == 0 && counters.bytes_skipped < LONGEST_FRAME_BYTES;
        if is_early && self.decoder.protocol() == "unknown" {
            return DecodeCounters { bad_checksum: 0, bytes_skipped: 0, ..counters };
        }
        counters
    }

    /// Tells the clock what is known about the delay every sample has.
    fn note_constant_delay(&mut self) {
        if let (Some(baud), Some(bytes)) = (self.baud, self.decoder.wire_bytes_per_sample()) {
            self.pipeline.assume_constant_delay(bandwidth::time_on_line(bytes.ceil() as u64, baud).0);
        }
        if let Some(exchange) = self.decoder.sync_estimate() {
            self.pipeline.take_exchange(exchange);
        }
    }

    /// Turns what a CAN bus and its controller say into events: each change of state, each kind of trouble once.
    fn note_bus_changes(&self, status: &LinkStatus, sink: &mut dyn SourceSink) {
        let (at, before) = (self.last_at, &self.status);
        if status.bus_state != before.bus_state && status.bus_state != BusState::Unknown {
            let state = status.bus_state;
            sink.event(at, &format!("CAN controller: {state}{}", state.advice()));
        }
        for fault in status.bus_faults.without(before.bus_faults).iter() {
            sink.event(at, &format!("CAN bus: {fault}"));
        }
        if status.stamps_refused > 0 && before.stamps_refused == 0 {
            sink.event(at, "receive stamps of the kernel cannot be right; the time of reading is used");
        }
    }

    /// Holds the rate the device announces against what its line can carry: once, from the densest of its first frames.
    fn check_announcement(&mut self, sink: &mut dyn SourceSink) -> Result<(), DeviceError> {
        let Some(rate_hz) = self.decoder.announced_rate_hz() else { return Ok(()) };
        if self.announced_hz.replace(rate_hz) != Some(rate_hz) {
            self.pipeline.announce_rate(rate_hz);
            sink.event(self.last_at, &format!("device announces {rate_hz} samples/s"));
        }
        if let Some(bitrate) = self.can_bitrate.filter(|_| self.decoder.protocol() == OTOLITH_CAN) {
            bandwidth::check_can(bitrate, &bandwidth::native_can_streams(rate_hz))?;
        }
        let (Some(baud), Some(bytes)) = (self.baud, self.decoder.wire_bytes_per_sample()) else {
            return Ok(());
        };
        if self.pipeline.counters().readings == 0 {
            // Not even the densest frame there is would fit.
            bandwidth::check_serial(baud, rate_hz, bytes)?;
            return Ok(());
        }
        self.least_bytes = self.least_bytes.min(bytes);
        if !self.line_checked && self.decoder.counters().packets >= FRAMES_BEFORE_LINE_CHECK {
            self.line_checked = true;
            bandwidth::check_serial(baud, rate_hz, self.least_bytes)?;
        }
        Ok(())
    }

    /// Name of the protocol, or `unknown`.
    pub fn protocol(&self) -> &'static str {
        self.decoder.protocol()
    }

    /// What was counted on the way.
    pub fn facts(&self) -> SourceFacts {
        let alignment = self.pipeline.report().copied();
        let about_mount = alignment.as_ref().and_then(AlignmentReport::note);
        SourceFacts {
            protocol: self.decoder.protocol(),
            decode: self.decoder.counters(),
            link: self.link.status(),
            imu: self.pipeline.counters(),
            alignment,
            clock: self.pipeline.clock_mode(),
            clock_drift_ppm: self.pipeline.clock_drift_ppm(),
            sync: self.decoder.sync_estimate(),
            constant_delay: self.pipeline.constant_delay(),
            notes: self.decoder.notes().into_iter().chain(about_mount).collect(),
        }
    }
}

/// Everything a source has counted and found.
#[derive(Clone, Debug, Default)]
pub struct SourceFacts {
    /// Name of the protocol.
    pub protocol: &'static str,
    /// Counters of the decoder.
    pub decode: DecodeCounters,
    /// State and losses of the link.
    pub link: LinkStatus,
    /// Counters of the IMU path.
    pub imu: ImuCounters,
    /// What the first second said about the sensor.
    pub alignment: Option<AlignmentReport>,
    /// Whose clock dates the samples.
    pub clock: ClockMode,
    /// Drift of the device's clock against the host's.
    pub clock_drift_ppm: f64,
    /// What the device answered to clock requests.
    pub sync: Option<SyncEstimate>,
    /// The delay taken off every sample, ns, and whether clock requests measured it.
    pub constant_delay: (u64, bool),
    /// What decoder and alignment say about the device in words.
    pub notes: Vec<String>,
}

#[cfg(test)]
mod tests;
