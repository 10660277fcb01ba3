//! WitMotion's serial protocol.

use super::checksum::sum;
use super::{Content, Counting, Packet, Parts, Sample, Stream, entry, known, packet_of};

const FRAME: usize = 11;

/// As it comes from the factory, and with the time packet that `--configure` switches on.
pub(super) fn streams() -> [Stream; 2] {
    let vectors = serde_json::from_str(include_str!("../../../golden/devices/vectors.json")).expect("JSON");
    let foreign = vec![packet_of(&entry(&vectors, "witmotion-serial/constructed"))];
    let stream = |name, origin, encode| Stream {
        parts: Parts::InOrder,
        not_a_number: Err("integers only"),
        foreign: foreign.clone(),
        ..Stream::new(name, origin, || known("witmotion"), encode)
    };
    [
        Stream {
            counting: Counting::Nothing,
            has_device_time: false,
            ..stream(
                "witmotion",
                "Packets of a test vector made after the document, values set anew",
                |samples, foreign| encode(samples, foreign, false),
            )
        },
        stream(
            "witmotion with time",
            "The same, each sample with a time packet before it, as the document describes it",
            |samples, foreign| encode(samples, foreign, true),
        ),
    ]
}

fn encode(samples: &[Sample], foreign: &[Vec<u8>], dated: bool) -> Vec<Packet> {
    let mut packets = Vec::new();
    for (k, sample) in samples.iter().enumerate() {
        let mut say = |mut bytes: Vec<u8>, ends_sample| {
            bytes[FRAME - 1] = sum(&bytes[..FRAME - 1]);
            packets.push(Packet { sample: ends_sample, ..Packet::whole(sample, bytes) });
        };
        let (force, rate) = foreign[0].split_at(FRAME);
        if dated {
            let seconds = sample.device_us / 1_000_000;
            let [low, high] = ((sample.device_us / 1000 % 1000) as u16).to_le_bytes();
            let time = [26, 11, 22, 10, (seconds / 60) as u8, (seconds % 60) as u8, low, high];
            say([&[0x55, 0x50], &time[..], &[0]].concat(), false);
        }
        say(force.to_vec(), false);
        let mut rate = rate.to_vec();
        let x = if sample.content == Content::Saturated { i16::MAX } else { 1 + (k % 7) as i16 };
        rate[2..4].copy_from_slice(&x.to_le_bytes());
        rate[6..8].copy_from_slice(&[0, 0]);
        say(rate, true);
    }
    packets
}
