//! Our own protocol on its links, and text lines.

use otolith::device::protocol::text::{TextDecoder, TextMapping};
use otolith::device::slcan::SlcanLink;
use otolith::device::slcan::codec::{MAX_LINE, SlcanFrame};
use otolith::runtime::trouble::Trouble;
use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::can::{CanMessage, HalfSample, Ids, Ranges, Time};
use otolith_firmware_protocol::message::{Hello, Message, SampleF32};
use otolith_firmware_protocol::stream::encode_frame;

use super::{Carrier, Content, Counting, Packet, Parts, Sample, Stream, known};

pub(super) fn streams() -> [Stream; 4] {
    [serial(), can(), slcan(), text()]
}

fn serial() -> Stream {
    let origin = "Our own protocol on a serial line";
    Stream {
        period_ms: 1,
        wraps_after_us: Some(1 << 32),
        counting: Counting::Sequence8,
        delimited: true,
        ..Stream::new("otolith-serial", origin, || known("otolith-serial"), encode_serial)
    }
}

fn encode_serial(samples: &[Sample], _captured: &[Vec<u8>]) -> Vec<Packet> {
    let hello = Hello {
        flags: 0,
        device_id: 7,
        firmware: 1,
        rate_millihertz: 1_000_000,
        gyro_scale: 2.66e-4,
        accel_scale: 1.2e-3,
        gyro_range_dps: 500,
        accel_range_g: 4,
        caps: 0,
        name: b"matrix",
    };
    let mut packets: Vec<Packet> = Vec::new();
    let mut say = |at_ms, message: &Message<'_>, sample| {
        let mut buffer = [0; MAX_FRAME];
        let bytes = encode_frame(message, packets.len() as u8, &mut buffer).expect("fits").to_vec();
        packets.push(Packet { at_ms, id: None, bytes, sample, counted: true });
    };
    for (k, sample) in samples.iter().enumerate() {
        if k % 1000 == 0 {
            say(sample.at_ms, &Message::Hello(hello), false);
        }
        let gyro_x = match sample.content {
            Content::Rest => 1e-4 * (k % 7) as f32,
            Content::Saturated => 9.0,
            Content::NotANumber => f32::NAN,
        };
        let t_us = sample.device_us as u32;
        let values = SampleF32 { t_us, gyro: [gyro_x, 0.0, 0.0], accel: [0.0, 0.0, 9.807] };
        say(sample.at_ms, &Message::SampleF32(values), true);
    }
    packets
}

fn can() -> Stream {
    let origin = "Our own protocol on a CAN bus";
    Stream {
        period_ms: 5,
        carrier: Carrier::Can,
        wraps_after_us: Some(10 << 32),
        counting: Counting::Sequence,
        parts: Parts::ByTick,
        has_checksum: false,
        not_a_number: Err("integers only"),
        ..Stream::new("otolith-can", origin, || known("otolith-can"), encode_can)
    }
}

fn encode_can(samples: &[Sample], _captured: &[Vec<u8>]) -> Vec<Packet> {
    let ids = Ids::of_node(0).expect("fits");
    let mut packets = Vec::new();
    let mut frames_sent = 0_u16;
    for (k, sample) in samples.iter().enumerate() {
        let mut say = |message: CanMessage, ends_sample| {
            let (id, bytes) = ids.frame(&message);
            packets.push(Packet {
                id: Some(u32::from(id)),
                sample: ends_sample,
                // The device counts the halves of its samples.
                counted: matches!(message, CanMessage::Gyro(_) | CanMessage::Accel(_)),
                ..Packet::whole(sample, bytes.to_vec())
            });
        };
        let ticks = sample.device_us / 10;
        // Not at first: what comes while an adapter is being opened is not heard.
        if k % 200 == 2 {
            say(CanMessage::Ranges(Ranges { gyro_range_dps: 500, accel_range_g: 4, rate_hz: 200 }), false);
        }
        if k % 20 == 0 {
            say(CanMessage::Time(Time { time_10us: ticks as u32, frames_sent, status: 0 }), false);
        }
        let x = if sample.content == Content::Saturated { i16::MAX } else { (k % 7) as i16 };
        say(CanMessage::Gyro(HalfSample { xyz: [x, 0, 0], tick: ticks as u16 }), false);
        say(CanMessage::Accel(HalfSample { xyz: [0, 0, 8192], tick: ticks as u16 }), true);
        frames_sent = frames_sent.wrapping_add(2);
    }
    packets
}

/// The same frames as lines of an adapter.
fn slcan() -> Stream {
    let encode = |samples: &[Sample], foreign: &[Vec<u8>]| {
        let line = |packet: Packet| {
            let id = packet.id.expect("a frame");
            let mut line = [0; MAX_LINE];
            let length = SlcanFrame::new(id, false, &packet.bytes).expect("fits").encode(&mut line);
            Packet { id: None, bytes: line[..length].to_vec(), ..packet }
        };
        encode_can(samples, foreign).into_iter().map(line).collect()
    };
    let origin = "The same frames as lines of a serial adapter";
    Stream {
        carrier: Carrier::Slcan,
        delimited: true,
        open_line: |port| Ok(Box::new(SlcanLink::open(port, "adapter", 500_000)?)),
        name: "otolith-can over slcan",
        origin,
        encode,
        ..can()
    }
}

fn text() -> Stream {
    let encode = |samples: &[Sample], _foreign: &[Vec<u8>]| {
        let line = |(k, sample): (usize, &Sample)| {
            let gyro_x = match sample.content {
                Content::Rest => format!("{:.4}", 1e-4 * (k % 7) as f64),
                Content::Saturated => "9.0".to_owned(),
                Content::NotANumber => "nan".to_owned(),
            };
            Packet::whole(sample, format!("{},{gyro_x},0,0,0.001,0,1.000\n", sample.device_us).into_bytes())
        };
        samples.iter().enumerate().map(line).collect()
    };
    let origin = "Lines as a sketch prints them";
    Stream {
        wraps_after_us: Some(1 << 32),
        counting: Counting::Nothing,
        has_checksum: false,
        delimited: true,
        // A log line with `nan` is a line that does not read.
        not_a_number: Ok(Trouble::DamagedPackets),
        ..Stream::new("text", origin, decode_text, encode)
    }
}

fn decode_text() -> Box<dyn otolith::device::protocol::PacketDecoder> {
    let mapping = "column_count = 7\n[time]\ncolumn = 1\nunit = \"us\"\nwraps_after = 4294967296\n\
        [gyro]\ncolumns = [2, 3, 4]\nunit = \"rad/s\"\nfull_scale = 9.0\n\
        [specific_force]\ncolumns = [5, 6, 7]\nunit = \"g\"";
    Box::new(TextDecoder::new(&TextMapping::from_toml("matrix", mapping).expect("a mapping")))
}
