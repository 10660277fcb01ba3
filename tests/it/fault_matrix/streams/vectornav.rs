//! VectorNav: binary frames and ASCII sentences.

use serde_json::Value;

use super::checksum::crc_1021;
use super::{Content, Counting, Packet, Sample, Stream, entry, known, packet_of};

pub(super) fn streams() -> [Stream; 2] {
    [binary(), ascii()]
}

/// TimeStartup, Accel, AngularRate and SensSat.
fn binary() -> Stream {
    const TIME: usize = 6;
    const RATE: usize = TIME + 8 + 12;
    const SATURATION: usize = RATE + 12;
    let list: Value =
        serde_json::from_str(include_str!("../../../golden/devices/vectornav-frames.json")).expect("JSON");
    let foreign = vec![packet_of(&entry(&list["frames"], "gyroscope saturated"))];
    let encode = |samples: &[Sample], foreign: &[Vec<u8>]| {
        let packet = |(k, sample): (usize, &Sample)| {
            let mut bytes = foreign[0].clone();
            let mut set = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
            set(TIME, &(1000 * sample.device_us).to_le_bytes());
            let rate = match sample.content {
                Content::NotANumber => f32::NAN,
                _ => 1e-4 * (k % 7) as f32,
            };
            set(RATE, &rate.to_le_bytes());
            set(RATE + 4, &[0; 8]);
            if sample.content != Content::Saturated {
                set(SATURATION, &[0; 2]);
            }
            let end = bytes.len() - 2;
            let crc = crc_1021(0, &bytes[1..end]);
            bytes[end..].copy_from_slice(&crc.to_be_bytes());
            Packet::whole(sample, bytes)
        };
        samples.iter().enumerate().map(packet).collect()
    };
    let origin = "Frames of a test vector made after the document, time and values set anew";
    Stream { foreign, ..Stream::new("vectornav, binary", origin, || known("vectornav"), encode) }
}

/// Sentences, which have neither time nor number.
fn ascii() -> Stream {
    let list: Value =
        serde_json::from_str(include_str!("../../../golden/devices/vectornav-lines.json")).expect("JSON");
    let line = entry(&list["lines"], "vendor example")["text"].as_str().expect("a line").to_owned();
    let encode = |samples: &[Sample], foreign: &[Vec<u8>]| {
        let packet = |sample: &Sample| {
            let mut bytes = foreign[0].clone();
            if sample.content == Content::NotANumber {
                let body = String::from_utf8_lossy(&bytes).replace("-00.000018", "nan");
                let (body, _) = body.split_once('*').expect("a checksum");
                let xor = body[1..].bytes().fold(0, |sum, byte| sum ^ byte);
                bytes = format!("{body}*{xor:02X}\r\n").into_bytes();
            }
            Packet::whole(sample, bytes)
        };
        samples.iter().map(packet).collect()
    };
    let origin = "A sentence printed in the maker's example program, again and again";
    Stream {
        counting: Counting::Nothing,
        delimited: true,
        has_device_time: false,
        tells_clipping: false,
        foreign: vec![line.into_bytes()],
        ..Stream::new("vectornav, ASCII", origin, || known("vectornav"), encode)
    }
}
