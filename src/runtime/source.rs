//! The receiving side: link, decoder and IMU path as one thing that hands out head samples.

use std::time::Duration;

use crate::device::can::bus::BusState;
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
    /// Rate the device announced, Hz.
    announced_hz: Option<f64>,
    /// Least bytes a sample took on the line so far.
    least_bytes: f64,
    line_checked: bool,
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
            announced_hz: None,
            least_bytes: f64::INFINITY,
            line_checked: false,
            recognised: false,
            last_at: HostTime::default(),
        }
    }

    /// Waits at most `timeout` for traffic and passes on what it means.
    ///
    /// # Errors
    /// The announced sample rate does not fit the line, or a played file cannot be read on.
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
        self.note_bus_changes(&status, sink);
        self.status = status;
        if !self.recognised && self.decoder.counters().packets > 0 && self.decoder.protocol() != "unknown" {
            self.recognised = true;
            sink.event(self.last_at, &format!("protocol {}", self.decoder.protocol()));
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
        if status.overflowed > 0 && before.overflowed == 0 {
            sink.event(at, "CAN frames were not taken in time and dropped by the kernel");
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
        SourceFacts {
            protocol: self.decoder.protocol(),
            decode: self.decoder.counters(),
            link: self.link.status(),
            imu: self.pipeline.counters(),
            alignment: self.pipeline.report().copied(),
            clock: self.pipeline.clock_mode(),
            clock_drift_ppm: self.pipeline.clock_drift_ppm(),
            sync: self.decoder.sync_estimate(),
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
    /// What the device answered to clock requests.
    pub sync: Option<SyncEstimate>,
}

#[cfg(test)]
mod tests {
    use otolith_firmware_protocol::MAX_FRAME;
    use otolith_firmware_protocol::message::{Batch16, Hello, Message};
    use otolith_firmware_protocol::stream::StreamEncoder;

    use super::*;
    use crate::device::can::bus::BusFault;
    use crate::device::protocol::native_serial::NativeSerialDecoder;
    use crate::imu::{Calibration, ImuSettings, Mount};

    /// Gives one frame at a time, then fails as a file does that cannot be read on.
    struct Frames(Vec<Vec<u8>>, Vec<u8>);

    impl Link for Frames {
        fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
            if self.0.is_empty() {
                let source = std::io::ErrorKind::InvalidData.into();
                return Err(LinkError::Lost { port: "log.bin".to_owned(), source });
            }
            self.1 = self.0.remove(0);
            Ok(Some((HostTime(0), Traffic::Bytes(&self.1))))
        }
    }

    /// Shows one status after the other, and is silent.
    struct States(Vec<LinkStatus>);

    impl Link for States {
        fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
            if self.0.len() > 1 {
                self.0.remove(0);
            }
            Ok(None)
        }

        fn status(&self) -> LinkStatus {
            self.0[0]
        }
    }

    #[derive(Default)]
    struct Events(Vec<String>);

    impl SourceSink for Events {
        fn traffic(&mut self, _at: HostTime, _traffic: Traffic<'_>) {}
        fn sample(&mut self, _sample: HeadSample) {}
        fn event(&mut self, _at: HostTime, text: &str) {
            self.0.push(text.to_owned());
        }
    }

    #[test]
    fn what_a_bus_says_becomes_an_event_once() {
        let mut status = LinkStatus::default();
        let mut states = vec![status, status];
        let mut then = |change: &dyn Fn(&mut LinkStatus)| {
            change(&mut status);
            states.extend([status, status]);
        };
        then(&|status| status.bus_state = BusState::BusOff);
        then(&|status| status.bus_faults.insert(BusFault::NoAcknowledgement));
        then(&|status| status.bus_faults.insert(BusFault::NoAcknowledgement));
        then(&|status| status.bus_faults.insert(BusFault::StuffError));
        then(&|status| status.bus_state = BusState::ErrorActive);
        then(&|status| status.overflowed = 5);
        then(&|status| status.overflowed = 6);
        then(&|status| status.stamps_refused = 1);
        let polls = states.len();
        let mut source = source(Box::new(States(states)), None);
        let mut events = Events::default();
        for _ in 0..polls {
            source.poll(Duration::ZERO, &mut events).expect("silence");
        }
        let firsts: Vec<&str> = events.0.iter().map(|text| text.split(';').next().unwrap_or("")).collect();
        assert_eq!(
            firsts,
            [
                "CAN controller: bus-off",
                "CAN bus: no acknowledgement",
                "CAN bus: stuff error",
                "CAN controller: error-active",
                "CAN frames were not taken in time and dropped by the kernel",
                "receive stamps of the kernel cannot be right",
            ]
        );
    }

    struct Nowhere;

    impl SourceSink for Nowhere {
        fn traffic(&mut self, _at: HostTime, _traffic: Traffic<'_>) {}
        fn sample(&mut self, _sample: HeadSample) {}
        fn event(&mut self, _at: HostTime, _text: &str) {}
    }

    /// A device that announces 1 kHz and sends batches of these sizes.
    fn batches(sizes: &[usize], baud: u32) -> Source {
        let mut encoder = StreamEncoder::new();
        let mut out = [0; MAX_FRAME];
        let hello = Hello {
            flags: 0,
            device_id: 1,
            firmware: 1,
            rate_millihertz: 1_000_000,
            gyro_scale: 1e-3,
            accel_scale: 1e-3,
            gyro_range_dps: 500,
            accel_range_g: 4,
            caps: 0,
            name: b"batch",
        };
        let mut frames = vec![encoder.encode(&Message::Hello(hello), &mut out).unwrap().to_vec()];
        for (k, &size) in sizes.iter().enumerate() {
            let rows = vec![Batch16::row([0; 3], [0, 0, 9807]); size];
            let batch = Message::Batch16(Batch16 { t_us: 1000 * k as u32, dt_us: 1000, rows: &rows });
            frames.push(encoder.encode(&batch, &mut out).unwrap().to_vec());
        }
        source(Box::new(Frames(frames, Vec::new())), Some(baud))
    }

    fn source(link: Box<dyn Link>, baud: Option<u32>) -> Source {
        let pipeline =
            ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), 9.81);
        Source::new(link, Box::new(NativeSerialDecoder::new()), pipeline, baud)
    }

    fn poll_all(source: &mut Source) -> DeviceError {
        loop {
            if let Err(error) = source.poll(Duration::ZERO, &mut Nowhere) {
                return error;
            }
        }
    }

    #[test]
    fn short_batches_among_long_ones_are_no_reason_to_stop() {
        let error = poll_all(&mut batches(&[1, 5, 5, 5, 5, 5, 1, 1, 1], 230_400));
        assert!(matches!(error, DeviceError::File { .. }), "the end of the file, not the line: {error}");
    }

    #[test]
    fn a_line_too_slow_for_the_announced_rate_is_refused() {
        let error = poll_all(&mut batches(&[1, 1, 1, 1, 1, 1], 230_400));
        assert!(matches!(error, DeviceError::SerialTooSlow { .. }), "{error}");
    }
}
