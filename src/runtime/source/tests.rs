use std::sync::{Arc, Mutex};

use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::can::{CanMessage, Ids, Ranges};
use otolith_firmware_protocol::message::{Batch16, Hello, Message, SampleF32};
use otolith_firmware_protocol::stream::StreamEncoder;

use super::*;
use crate::device::can::bus::BusFault;
use crate::device::protocol::detect::{AutoDecoder, Bus as Line};
use crate::device::protocol::native_can::NativeCanDecoder;
use crate::device::protocol::native_serial::NativeSerialDecoder;
use crate::device::reconnect::Reconnecting;
use crate::device::testing::{Event, ManualClock, ScriptLink};
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

struct Nowhere;

impl SourceSink for Nowhere {
    fn traffic(&mut self, _at: HostTime, _traffic: Traffic<'_>) {}
    fn sample(&mut self, _sample: HeadSample) {}
    fn event(&mut self, _at: HostTime, _text: &str) {}
}

/// A device that announces 1 kHz.
const HELLO: Message<'static> = Message::Hello(Hello {
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
});

fn frame(encoder: &mut StreamEncoder, message: &Message<'_>) -> Vec<u8> {
    encoder.encode(message, &mut [0; MAX_FRAME]).unwrap().to_vec()
}

/// A sample at rest.
fn rest(t_us: u32) -> Message<'static> {
    Message::SampleF32(SampleF32 { t_us, gyro: [0.0; 3], accel: [0.0, 0.0, 9.807] })
}

/// A device that sends batches of these sizes.
fn batches(sizes: &[usize], baud: u32) -> Source {
    let mut encoder = StreamEncoder::new();
    let mut frames = vec![frame(&mut encoder, &HELLO)];
    for (k, &size) in sizes.iter().enumerate() {
        let rows = vec![Batch16::row([0; 3], [0, 0, 9807]); size];
        let batch = Message::Batch16(Batch16 { t_us: 1000 * k as u32, dt_us: 1000, rows: &rows });
        frames.push(frame(&mut encoder, &batch));
    }
    let pipeline = ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), 9.81);
    let link = Box::new(Frames(frames, Vec::new()));
    Source::new(link, Box::new(NativeSerialDecoder::new()), pipeline, Some(baud))
}

fn poll_all(source: &mut Source) -> DeviceError {
    loop {
        if let Err(error) = source.poll(Duration::ZERO, &mut Nowhere) {
            return error;
        }
    }
}

/// Troubles of a device whose protocol is to be found out and whose bytes come seven at a time.
fn troubles_while_finding_out(bytes: &[u8]) -> Vec<String> {
    let pieces = bytes.chunks(7).map(<[u8]>::to_vec).collect();
    let pipeline = ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), 9.81);
    let decoder = Box::new(AutoDecoder::on(&[Line::Serial]));
    let mut source = Source::new(Box::new(Frames(pieces, Vec::new())), decoder, pipeline, None);
    let mut events = Events::default();
    while source.poll(Duration::ZERO, &mut events).is_ok() {}
    events.0.retain(|text| text.starts_with("trouble") || text.starts_with("over"));
    events.0
}

#[test]
fn what_others_cannot_read_is_no_trouble_of_a_device() {
    // The document's example of a VectorNav frame; the others find junk and damage in it.
    let frame =
        [0xFA, 1, 8, 0, 0x93, 0x50, 0x2E, 0x42, 0x83, 0x3E, 0xF1, 0x3F, 0x48, 0xB5, 4, 0xBB, 0x92, 0x88];
    assert_eq!(troubles_while_finding_out(&frame.repeat(100)), [""; 0]);
    let noise: Vec<u8> = (0..5000u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    assert!(troubles_while_finding_out(&noise).contains(&"trouble: bytes of no packet".to_owned()));
}

#[test]
fn short_batches_among_long_ones_are_no_reason_to_stop() {
    let error = poll_all(&mut batches(&[1, 5, 5, 5, 5, 5, 1, 1, 1], 230_400));
    assert!(matches!(error, DeviceError::File { .. }), "the end of the file, not the line: {error}");
}

/// A frame of a CAN bus again and again.
struct Bus(u32, [u8; 8]);

impl Link for Bus {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        Ok(Some((HostTime(0), Traffic::CanFrame { id: self.0, extended: false, data: &self.1 })))
    }
}

/// A port that was lost and has turned up elsewhere, again and again.
struct Moving(u64);

impl Link for Moving {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        self.0 += 1;
        Ok(None)
    }

    fn status(&self) -> LinkStatus {
        LinkStatus { losses: self.0, reconnects: self.0, ..LinkStatus::default() }
    }

    fn port(&self) -> Option<&str> {
        Some(["/dev/ttyUSB0", "/dev/ttyUSB1", "/dev/ttyUSB1"][self.0 as usize])
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
fn a_bus_too_slow_for_the_announced_rate_is_refused() {
    let ranges = Ranges { gyro_range_dps: 500, accel_range_g: 4, rate_hz: 1000 };
    let (id, data) = Ids::default().frame(&CanMessage::Ranges(ranges));
    let poll = |bitrate| {
        let pipeline =
            ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), 9.81);
        let link = Box::new(Bus(id.into(), data));
        let source = Source::new(link, Box::new(NativeCanDecoder::new(None)), pipeline, None);
        source.on_can_bus(bitrate).poll(Duration::ZERO, &mut Nowhere)
    };
    assert!(poll(500_000).is_ok());
    let error = poll(250_000).unwrap_err();
    assert!(matches!(error, DeviceError::CanTooSlow { bitrate: 250_000, .. }), "{error}");
}

#[test]
fn a_port_found_again_elsewhere_is_named_once() {
    let pipeline = ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), 9.81);
    let mut source = Source::new(Box::new(Moving(0)), Box::new(NativeSerialDecoder::new()), pipeline, None);
    let mut events = Events::default();
    for _ in 0..2 {
        source.poll(Duration::ZERO, &mut events).unwrap();
    }
    let lost = "connection lost; trying to reopen";
    let found = "connection is back, found again as /dev/ttyUSB1";
    assert_eq!(events.0, [lost, found, lost, "connection is back"]);
}

#[test]
fn a_line_too_slow_for_the_announced_rate_is_refused() {
    let error = poll_all(&mut batches(&[1, 1, 1, 1, 1, 1], 230_400));
    assert!(matches!(error, DeviceError::SerialTooSlow { .. }), "{error}");
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
    let pipeline = ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), 9.81);
    let mut source =
        Source::new(Box::new(States(states)), Box::new(NativeSerialDecoder::new()), pipeline, None);
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
            "trouble: frames dropped by the kernel",
            "receive stamps of the kernel cannot be right",
        ]
    );
}

/// A link that is lost after half a frame; the next one begins with the other half of another.
#[test]
fn what_comes_over_a_new_link_does_not_end_what_came_over_the_lost_one() {
    let mut encoder = StreamEncoder::new();
    let [hello, first, second] = [HELLO, rest(1000), rest(2000)].map(|message| frame(&mut encoder, &message));
    let mut links = [
        ScriptLink::new([Event::Piece(HostTime(1), [&hello, &first[..10]].concat()), Event::Lost]),
        ScriptLink::new([Event::Piece(HostTime(2), [&first[10..], &second].concat())]),
    ]
    .into_iter();
    let clock = Arc::new(ManualClock::default());
    let opener = move || Ok(links.next().expect("a link"));
    let link = Reconnecting::open(opener, clock).expect("opens");
    let pipeline = ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), 9.81);
    let mut source = Source::new(Box::new(link), Box::new(NativeSerialDecoder::new()), pipeline, None);
    while !matches!(source.poll(Duration::from_millis(50), &mut Nowhere), Ok(Polled::Ended)) {}
    assert_eq!((source.facts().link.reconnects, source.facts().imu.readings), (1, 1));
}

/// What a [`Tap`] is to give.
#[derive(Default)]
struct Supply {
    pieces: Vec<(HostTime, Vec<u8>)>,
    status: LinkStatus,
}

/// Gives what is put into it, and its state.
#[derive(Clone, Default)]
struct Tap(Arc<Mutex<Supply>>, Vec<u8>);

impl Link for Tap {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        let pieces = &mut self.0.lock().expect("whole").pieces;
        if pieces.is_empty() {
            return Ok(None);
        }
        let (at, bytes) = pieces.remove(0);
        self.1 = bytes;
        Ok(Some((at, Traffic::Bytes(&self.1))))
    }

    fn status(&self) -> LinkStatus {
        self.0.lock().expect("whole").status
    }
}

#[test]
fn samples_that_stop_coming_are_a_trouble_until_the_sensor_is_aligned() {
    let ms = |ms: u64| HostTime(ms * 1_000_000);
    let pipeline = ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), 9.81);
    let tap = Tap::default();
    let mut source = Source::new(Box::new(tap.clone()), Box::new(NativeSerialDecoder::new()), pipeline, None);
    let mut encoder = StreamEncoder::new();
    tap.0.lock().expect("whole").pieces.push((ms(0), frame(&mut encoder, &HELLO)));
    let mut events = Events::default();
    // Samples every 10 ms from the first time to before the second, and then silence up to a third: what is said of it.
    let mut play = |from: u64, until: u64, silent_at: u64, status: LinkStatus| {
        for at in (from..until).step_by(10) {
            let sample = frame(&mut encoder, &rest(1000 * at as u32));
            tap.0.lock().expect("whole").pieces.push((ms(at), sample));
        }
        tap.0.lock().expect("whole").status = status;
        while !matches!(source.poll(Duration::ZERO, &mut events), Ok(Polled::Silence)) {}
        source.note_silence(ms(silent_at), &mut events);
        events.0.retain(|event| event.ends_with("no samples"));
        std::mem::take(&mut events.0)
    };
    let nothing: [&str; 0] = [];
    let good = LinkStatus::default();
    assert_eq!(play(0, 0, 900, good), nothing, "none has come yet");
    assert_eq!(play(1000, 1010, 9000, good), nothing, "one sample has no rate");
    assert_eq!(play(1010, 1110, 1140, good), nothing, "40 ms");
    assert_eq!(play(0, 0, 1141, good), ["trouble: no samples"]);
    assert_eq!(play(0, 0, 1500, good), nothing, "it goes on");
    assert_eq!(play(1500, 1770, 1780, good), ["over: 1 no samples"]);
    let lost = LinkStatus { down: true, losses: 1, ..good };
    assert_eq!(play(0, 0, 1900, lost), nothing, "the loss explains it");
    let back = LinkStatus { reconnects: 1, down: false, ..lost };
    assert_eq!(play(1900, 2300, 2310, back), nothing);
    assert_eq!(play(2300, 2400, 9000, back), nothing, "samples that are given out have an age");
}
