//! The generic CAN decoder with ready mappings.

use otolith::device::protocol::PacketDecoder;
use otolith::device::protocol::can_map::{CanMap, CanMapDecoder, shipped_can_map};
use serde_json::Value;

use super::checksum::sum;
use super::{Carrier, Content, Counting, Packet, Parts, Sample, Stream, captured, entry};

pub(super) fn streams() -> Vec<Stream> {
    let mut streams = vec![xsens()];
    streams.extend(captured("can/toyota_scion_xb_drive.candump.log", cut_toyota).map(toyota));
    streams
}

fn mapped(name: &str) -> Box<dyn PacketDecoder> {
    let shipped = shipped_can_map(name).expect("shipped");
    let map = CanMap::new(shipped.name, shipped.map, shipped.dbc_name, shipped.dbc).expect("compiles");
    Box::new(CanMapDecoder::new(&map))
}

fn frame(sample: &Sample, id: u32, bytes: Vec<u8>, ends_sample: bool) -> Packet {
    Packet { id: Some(id), sample: ends_sample, ..Packet::whole(sample, bytes) }
}

const TOYOTA: u32 = 0x24;

/// Data of the yaw-rate sensor's frames in a candump log.
fn cut_toyota(log: &[u8]) -> Vec<Vec<u8>> {
    let text = String::from_utf8_lossy(log);
    let data = text.lines().filter_map(|line| line.split_once(" 024#"));
    data.map(|(_, digits)| crate::device_vectors::from_hex(digits.trim())).collect()
}

/// One frame is a sample; it has a checksum, and neither time nor number.
fn toyota(foreign: Vec<Vec<u8>>) -> Stream {
    let encode = |samples: &[Sample], foreign: &[Vec<u8>]| {
        let packet = |(k, sample): (usize, &Sample)| {
            let mut data = foreign[k % foreign.len()].clone();
            if sample.content == Content::Saturated {
                // The yaw rate's ten bits.
                data[0] &= !3;
                data[1] = 0;
                let last = data.len() - 1;
                data[last] = sum(&data[..last]).wrapping_add(TOYOTA as u8 + data.len() as u8);
            }
            frame(sample, TOYOTA, data, true)
        };
        samples.iter().enumerate().map(packet).collect()
    };
    let origin = "Frames of a real drive";
    Stream {
        period_ms: 12,
        carrier: Carrier::Can,
        counting: Counting::Nothing,
        has_device_time: false,
        not_a_number: Err("integers only"),
        foreign,
        ..Stream::new("can-map toyota-yaw", origin, || mapped("toyota-yaw"), encode)
    }
}

/// Time, gyroscope and accelerometer, one frame after the other.
fn xsens() -> Stream {
    let vectors: Value =
        serde_json::from_str(include_str!("../../../golden/devices/vectors.json")).expect("JSON");
    let frames = entry(&vectors, "xsens-can/constructed")["can"].as_array().expect("frames").clone();
    let data = |frame: &Value| crate::device_vectors::from_hex(frame["data"].as_str().expect("digits"));
    let encode = |samples: &[Sample], foreign: &[Vec<u8>]| {
        let mut packets = Vec::new();
        for (k, sample) in samples.iter().enumerate() {
            packets.push(frame(sample, 0x05, (sample.device_us as u32).to_be_bytes().to_vec(), false));
            let x = if sample.content == Content::Saturated { i16::MAX } else { (k % 3) as i16 };
            packets.push(frame(sample, 0x32, [&x.to_be_bytes()[..], &[0; 4]].concat(), false));
            packets.push(frame(sample, 0x34, foreign[2].clone(), true));
        }
        packets
    };
    let origin = "Frames of a test vector made after the DBC file in use, time and gyroscope set anew";
    Stream {
        carrier: Carrier::Can,
        wraps_after_us: Some(1 << 32),
        parts: Parts::InOrder,
        has_checksum: false,
        not_a_number: Err("integers only"),
        foreign: frames.iter().map(data).collect(),
        ..Stream::new("can-map xsens-mti-can", origin, || mapped("xsens-mti-can"), encode)
    }
}
