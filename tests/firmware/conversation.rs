//! A host that talks to the device with the encoder and decoder of `firmware-protocol`.

use std::sync::Arc;

use otolith::device::serial::SerialLink;
use otolith::device::{Link as _, Traffic};
use otolith::time::SystemClock;
use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::message::{Ack, Cmd, Hello, Message, Sample16, Status, Sync};
use otolith_firmware_protocol::stream::{Counters, Event, StreamDecoder, StreamEncoder};

use crate::device::Device;
use crate::{MOST_POLLS, POLL};

/// The host's end of a conversation with the device.
pub(crate) struct Conversation {
    pub(crate) link: SerialLink,
    pub(crate) encoder: StreamEncoder,
    decoder: StreamDecoder,
    /// Everything heard, in order.
    pub(crate) heard: Vec<Heard>,
}

/// A message of the device, on its own.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Heard {
    Hello { name: String, rate_millihertz: u32, gyro_scale: f32, accel_scale: f32 },
    Sample(Sample16),
    Status(Status),
    Sync(Sync),
    Text(String),
    Ack(Ack),
}

impl Heard {
    fn from(message: &Message<'_>) -> Self {
        match message {
            Message::Hello(hello @ Hello { rate_millihertz, gyro_scale, accel_scale, .. }) => Self::Hello {
                name: hello.name_str().to_owned(),
                rate_millihertz: *rate_millihertz,
                gyro_scale: *gyro_scale,
                accel_scale: *accel_scale,
            },
            Message::Sample16(sample) => Self::Sample(*sample),
            Message::Status(status) => Self::Status(*status),
            Message::Sync(sync) => Self::Sync(*sync),
            Message::Text(text) => Self::Text(String::from_utf8(text.bytes.to_vec()).unwrap()),
            Message::Ack(ack) => Self::Ack(*ack),
            other => panic!("the device never sends {other:?}"),
        }
    }
}

impl Conversation {
    pub(crate) fn open(device: &Device) -> Self {
        let clock = Arc::new(SystemClock::start_now());
        let link = SerialLink::open(device.port.to_str().unwrap(), 115_200, clock).unwrap();
        let (encoder, decoder) = (StreamEncoder::new(), StreamDecoder::new());
        Self { link, encoder, decoder, heard: Vec::new() }
    }

    pub(crate) fn say(&mut self, message: &Message<'_>) {
        let mut frame = [0; MAX_FRAME];
        self.link.send(Traffic::Bytes(self.encoder.encode(message, &mut frame).unwrap())).unwrap();
    }

    pub(crate) fn ask(&mut self, code: u8, arg: u32, token: u8) -> Ack {
        let from = self.heard.len();
        self.say(&Message::Cmd(Cmd { code, arg, token }));
        let at = self.listen_from(from, |heard| matches!(heard, Heard::Ack(_)));
        let Heard::Ack(ack) = self.heard[at] else { unreachable!() };
        ack
    }

    /// What the device sends next after its last answer to a command.
    pub(crate) fn right_after_the_answer(&mut self) -> Heard {
        let answer = self.heard.iter().rposition(|heard| matches!(heard, Heard::Ack(_))).unwrap();
        let next = self.listen_from(answer + 1, |_| true);
        self.heard[next].clone()
    }

    /// Listens until something heard since `from` is `wanted`, and gives its place.
    pub(crate) fn listen_from(&mut self, from: usize, wanted: impl Fn(&Heard) -> bool) -> usize {
        let mut looked_at = from;
        for _ in 0..MOST_POLLS {
            if let Some(at) = self.heard[looked_at..].iter().position(&wanted) {
                return looked_at + at;
            }
            looked_at = self.heard.len();
            if let Some((_, Traffic::Bytes(bytes))) = self.link.receive(POLL).unwrap() {
                self.decoder.push(bytes, |event| match event {
                    Event::Message { message, .. } => self.heard.push(Heard::from(&message)),
                    Event::Dropped { joined_mid_frame: true, .. } => {}
                    other => panic!("{other:?}"),
                });
            }
        }
        panic!("not heard; the last was {:?}", self.heard.last());
    }

    /// Listens for the next of a kind.
    pub(crate) fn listen(&mut self, wanted: impl Fn(&Heard) -> bool) -> &Heard {
        let at = self.listen_from(self.heard.len(), wanted);
        &self.heard[at]
    }

    pub(crate) fn next_status(&mut self) -> Status {
        let Heard::Status(status) = *self.listen(|heard| matches!(heard, Heard::Status(_))) else {
            unreachable!()
        };
        status
    }

    /// Listens to the device until its clock has gone on by `seconds`.
    pub(crate) fn listen_for(&mut self, seconds: f64) {
        let end_us = self.next_status().t_us + (seconds * 1e6) as u64;
        self.listen(|heard| matches!(heard, Heard::Status(status) if status.t_us >= end_us));
    }

    pub(crate) fn samples_from(&self, from: usize) -> Vec<Sample16> {
        let sample = |heard: &Heard| if let Heard::Sample(sample) = heard { Some(*sample) } else { None };
        self.heard[from..].iter().filter_map(sample).collect()
    }

    /// The next few samples are exactly `period_us` apart, give or take the timer's half microsecond.
    pub(crate) fn samples_come_every(&mut self, period_us: u32) {
        let from = self.heard.len();
        self.listen_for(0.5);
        let samples = self.samples_from(from);
        // The first may still be one of the old rate.
        let times: Vec<u32> = samples.iter().skip(1).map(|sample| sample.t_us).collect();
        assert!(times.len() > 8, "{times:?}");
        for pair in times.windows(2) {
            assert!((pair[1] - pair[0]).abs_diff(period_us) <= 1, "{period_us}: {times:?}");
        }
    }

    /// Nothing was lost or damaged; `seq` has counted every frame.
    pub(crate) fn ends_without_a_loss(self) {
        let counters = self.decoder.counters();
        let frames = self.heard.len() as u64;
        // The port may be opened in the middle of a frame of the firmware's last life.
        let joined = Counters { framing_errors: 0, crc_errors: 0, bytes_skipped: 0, ..counters };
        assert_eq!(joined, Counters { frames, ..Counters::default() });
        assert!(counters.framing_errors + counters.crc_errors <= 1, "{counters:?}");
    }
}
