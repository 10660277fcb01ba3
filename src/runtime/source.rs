//! The receiving side: link, decoder and IMU path as one thing that hands out head samples.

use std::time::Duration;

use crate::device::protocol::{DecodeCounters, ImuReading, PacketDecoder};
use crate::device::{DeviceError, Link, LinkError, LinkStatus, Traffic, bandwidth};
use crate::imu::{AlignmentReport, ClockMode, HeadSample, ImuCounters, ImuPipeline};
use crate::time::HostTime;

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
    /// Announced rate, Hz, and bytes of a sample on the line, as last held against each other.
    announced: Option<(f64, f64)>,
    recognised: bool,
    last_at: HostTime,
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
            link,
            decoder,
            pipeline,
            baud,
            status: LinkStatus::default(),
            announced: None,
            recognised: false,
            last_at: HostTime::default(),
        }
    }

    /// Waits at most `timeout` for traffic and passes on what it means.
    ///
    /// # Errors
    /// The announced sample rate does not fit the line.
    pub fn poll(&mut self, timeout: Duration, sink: &mut dyn SourceSink) -> Result<Polled, DeviceError> {
        let Self { link, decoder, pipeline, .. } = self;
        let polled = match link.receive(timeout) {
            Ok(Some((at, traffic))) => {
                self.last_at = at;
                sink.traffic(at, traffic);
                decoder.push(traffic, &mut |reading: ImuReading| {
                    pipeline.push(&reading, at, &mut |sample| sink.sample(sample));
                });
                Polled::Traffic
            }
            // Reconnecting links report a loss in their status and go on; silence is not an error.
            Ok(None) | Err(LinkError::Lost { .. }) => Polled::Silence,
            Err(LinkError::EndOfRecording) => {
                self.end(sink);
                return Ok(Polled::Ended);
            }
        };
        self.note_changes(sink);
        self.check_announcement(sink)?;
        let mut bytes = [0; 64];
        if let Some(length) = self.decoder.poll_transmit(self.last_at.0 / 1000, &mut bytes) {
            // A request that cannot be sent is not retried: the next one follows in a second.
            let _unsent = self.link.send(Traffic::Bytes(&bytes[..length]));
        }
        Ok(polled)
    }

    fn end(&mut self, sink: &mut dyn SourceSink) {
        let Self { decoder, pipeline, .. } = self;
        let at = self.last_at;
        // A log may end without a line break; to every other decoder one more byte is nothing.
        if decoder.protocol() == crate::device::protocol::detect::TEXT {
            decoder.push(Traffic::Bytes(b"\n"), &mut |reading: ImuReading| {
                pipeline.push(&reading, at, &mut |sample| sink.sample(sample));
            });
        }
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
            sink.event(self.last_at, "connection is back");
            self.decoder.rejoin();
        }
        self.status = status;
        if !self.recognised && self.decoder.counters().packets > 0 && self.decoder.protocol() != "unknown" {
            self.recognised = true;
            sink.event(self.last_at, &format!("protocol {}", self.decoder.protocol()));
        }
    }

    /// Holds the rate the device announces against what its line can carry, whenever either is learnt anew.
    fn check_announcement(&mut self, sink: &mut dyn SourceSink) -> Result<(), DeviceError> {
        let Some(rate_hz) = self.decoder.announced_rate_hz() else { return Ok(()) };
        let known = self.announced.replace((rate_hz, self.decoder.wire_bytes_per_sample().unwrap_or(0.0)));
        if known == self.announced {
            return Ok(());
        }
        if known.is_none_or(|(before, _)| before != rate_hz) {
            self.pipeline.announce_rate(rate_hz);
            sink.event(self.last_at, &format!("device announces {rate_hz} samples/s"));
        }
        if let (Some(baud), Some(bytes)) = (self.baud, self.decoder.wire_bytes_per_sample()) {
            bandwidth::check_serial(baud, rate_hz, bytes)?;
        }
        Ok(())
    }

    /// Name of the protocol, or `unknown`.
    pub fn protocol(&self) -> &'static str {
        self.decoder.protocol()
    }

    /// What was counted on the way.
    pub fn facts(&self) -> SourceFacts {
        SourceFacts {
            protocol: self.decoder.protocol(),
            decode: self.decoder.counters(),
            link: self.link.status(),
            imu: self.pipeline.counters(),
            alignment: self.pipeline.report().copied(),
            clock: self.pipeline.clock_mode(),
            clock_drift_ppm: self.pipeline.clock_drift_ppm(),
        }
    }
}

/// Everything a source has counted and found.
#[derive(Clone, Copy, Debug)]
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
}
