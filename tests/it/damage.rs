//! How often damaged frames pass: never more often than the checksum lets them, and never for a single flipped bit.
//! Checksums are judged by `fuzz/src/frames.rs`, which shares nothing with the decoders.

#[path = "../../fuzz/src/frames.rs"]
mod frames;

use frames::{CHECKED, Checked};
use otolith::device::protocol::DecodeCounters;
use otolith::device::protocol::detect::{Bus, PROTOCOLS, decoder_by_name};
use otolith::device::{Noise, Traffic};
use serde_json::Value;

/// Frames to damage, of real captures and documents; of our own protocol those of its reference implementation.
fn good_frames(checked: &Checked) -> Vec<Vec<u8>> {
    let ours: Value =
        serde_json::from_str(include_str!("../../firmware-protocol/tests/golden.json")).unwrap();
    let foreign: Value = serde_json::from_str(include_str!("../golden/devices/vectors.json")).unwrap();
    let vectors = if checked.protocol == "otolith-serial" { &ours["serial"] } else { &foreign };
    let hex = vectors.as_array().unwrap().iter().filter_map(|vector| vector["hex"].as_str());
    let mut good = Vec::new();
    for bytes in hex.map(crate::device_vectors::from_hex) {
        let mut at = 0;
        while let Some(length) = (checked.valid)(&bytes[at..]) {
            // Commands and answers are too short to be damaged in more than one place.
            let frame = &bytes[at..at + length];
            if (checked.content)(frame).len() >= 8 && decode(checked, frame).packets == 1 {
                good.push(frame.to_vec());
            }
            at += length;
        }
    }
    assert!(!good.is_empty(), "no frame of {}", checked.protocol);
    good
}

/// The protocols this program has, of those whose frames are described.
fn protocols() -> impl Iterator<Item = &'static Checked> {
    CHECKED.iter().filter(|checked| decoder_by_name(checked.protocol).is_ok())
}

fn decode(checked: &Checked, bytes: &[u8]) -> DecodeCounters {
    let mut decoder = decoder_by_name(checked.protocol).unwrap();
    decoder.push(Traffic::Bytes(bytes), &mut |_| ());
    decoder.finish(&mut |_| ());
    decoder.counters()
}

/// Frames that were taken for good.
fn accepted(checked: &Checked, counters: &DecodeCounters) -> u64 {
    counters.packets - if checked.unknown_is_weak { counters.unknown } else { 0 }
}

/// Bytes and places of chance.
struct Random(Noise);

impl Random {
    fn new(seed: u64) -> Self {
        Self(Noise::new(seed))
    }

    fn byte(&mut self) -> u8 {
        self.0.next_u32() as u8
    }

    fn below(&mut self, limit: usize) -> usize {
        self.0.next_u32() as usize % limit
    }

    /// A piece of `length` bytes at least `least` long.
    fn piece(&mut self, length: usize, least: usize) -> std::ops::Range<usize> {
        let size = least + self.below(length - least + 1);
        let start = self.below(length - size + 1);
        start..start + size
    }
}

/// What a bad line, a lost or a double piece make of a frame. `other` is a frame of the same stream.
///
/// What is overwritten is at least four bytes of chance: of less, a checksum either misses nothing or, like the sum of
/// two bytes with one flipped bit each, much more than its share.
fn damaged(frame: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = frame.to_vec();
    let at = random.below(frame.len());
    match random.below(7) {
        0 => bytes[at] ^= 1 << random.below(8),
        1 => random.piece(frame.len(), 4).for_each(|at| bytes[at] = random.byte()),
        2 => bytes.splice(at..at, (0..1 + random.below(4)).map(|_| random.byte())).for_each(drop),
        3 => drop(bytes.drain(random.piece(frame.len(), 1))),
        4 => bytes.truncate(at),
        5 => {
            let twice = frame[random.piece(frame.len(), 1)].to_vec();
            bytes.splice(at..at, twice).for_each(drop);
        }
        _ => bytes.splice(at.., other[at.min(other.len())..].iter().copied()).for_each(drop),
    }
    bytes
}

/// What came of many damaged frames.
#[derive(Default)]
struct Tally {
    frames: u64,
    /// Checksums that were compared over damaged bytes: the wrong ones and the frames below.
    candidates: u64,
    accepted: u64,
    /// Frames before and behind the damage that were lost with it.
    neighbours_lost: u64,
}

/// Bytes between a damaged frame and the next, so that what is lengthened does not run into that. They are of chance: a
/// frame of zeros would have the right sum.
fn gap(checked: &Checked, random: &mut Random) -> Vec<u8> {
    let mut gap: Vec<u8> =
        (0..300).map(|_| random.byte()).filter(|byte| Some(*byte) != checked.delimiter).collect();
    gap.extend(checked.delimiter);
    if let Some(delimiter) = checked.delimiter {
        gap.insert(0, delimiter);
    }
    gap
}

fn tally(checked: &Checked, frames: u64) -> Tally {
    let (good, mut random) = (good_frames(checked), Random::new(1));
    let mut tally = Tally::default();
    while tally.frames < frames {
        let [before, frame, other, behind] =
            [(); 4].map(|()| checked.remade(&good[random.below(good.len())], || random.byte()));
        let hurt = [damaged(&frame, &other, &mut random), gap(checked, &mut random)].concat();
        let still_whole = |whole: &Vec<u8>| hurt.windows(whole.len()).any(|window| window == whole);
        if still_whole(&frame) || still_whole(&other) {
            continue;
        }
        let stream = [before, hurt, behind].concat();
        let counters = decode(checked, &stream);
        assert!(
            counters.packets <= checked.places(&stream).count() as u64,
            "{}: {stream:02x?}",
            checked.protocol
        );
        if let Some(length) = checked.fixed_length {
            let told = counters.packets * length + counters.bytes_skipped + counters.unfinished_bytes;
            assert_eq!(told, stream.len() as u64, "{}: {stream:02x?}", checked.protocol);
        }
        let passed = accepted(checked, &counters);
        tally.frames += 1;
        tally.accepted += passed.saturating_sub(2);
        tally.neighbours_lost += 2_u64.saturating_sub(passed);
        tally.candidates += counters.bad_checksum + passed.saturating_sub(2);
    }
    tally
}

/// Checks all protocols and gives a row for each: protocol, damaged frames, candidates, accepted, expected at most.
fn check(frames: u64) -> Vec<String> {
    let row = |checked: &Checked| {
        let tally = tally(checked, frames);
        let bound = tally.candidates as f64 / f64::from(1 << checked.bits);
        // Five standard deviations of a count with this mean; of a mean below one, those of one.
        let limit = bound + 5.0 * bound.max(1.0).sqrt();
        let Tally { frames, candidates, accepted, neighbours_lost } = tally;
        let name = checked.protocol;
        assert!(
            accepted as f64 <= limit,
            "{name}: {accepted} of {candidates} accepted, {bound:.1} expected at most"
        );
        assert!(neighbours_lost as f64 <= limit, "{name}: {neighbours_lost} undamaged frames lost");
        format!("| `{name}` | {frames} | {candidates} | {accepted} | {bound:.1} | {neighbours_lost} |")
    };
    protocols().map(row).collect()
}

#[test]
fn damaged_frames_pass_no_more_often_than_their_checksum_lets_them() {
    check(30_000);
}

#[test]
#[ignore = "takes minutes; `.ci/long` runs it"]
fn millions_of_damaged_frames_pass_no_more_often_than_their_checksum_lets_them() {
    // On lines of their own, whatever the harness has begun to write.
    println!("\n{}", check(5_000_000).join("\n"));
}

#[test]
fn no_frame_with_one_flipped_bit_passes() {
    for checked in protocols() {
        let (good, mut random) = (good_frames(checked), Random::new(2));
        let mut flips = 0;
        for round in 0..30 {
            let [before, frame, behind] =
                [0, round, 0].map(|k| checked.remade(&good[k % good.len()], || random.byte()));
            for (at, bit) in
                (checked.content)(&frame).into_iter().flat_map(|at| (0..8).map(move |bit| (at, bit)))
            {
                let mut hurt = frame.clone();
                hurt[at] ^= 1 << bit;
                if Some(hurt[at]) == checked.delimiter {
                    continue;
                }
                let counters = decode(checked, &[&before[..], &hurt, &behind].concat());
                let found = (accepted(checked, &counters), counters.bad_checksum > 0);
                assert_eq!(found, (2, true), "{}: bit {bit} of byte {at} of {frame:02x?}", checked.protocol);
                flips += 1;
            }
        }
        assert!(flips > 1000, "{}: {flips}", checked.protocol);
    }
}

#[test]
fn the_checksums_here_are_those_of_the_devices() {
    for checked in protocols() {
        for frame in good_frames(checked) {
            let mut sealed = frame.clone();
            (checked.seal)(&mut sealed);
            assert_eq!(sealed, frame, "{}", checked.protocol);
        }
    }
}

#[test]
fn every_protocol_with_a_checksum_is_here() {
    let serial = PROTOCOLS.iter().filter(|protocol| protocol.bus == Bus::Serial);
    for protocol in serial.filter(|protocol| decoder_by_name(protocol.name).is_ok()) {
        assert!(frames::checked(protocol.name).is_some(), "describe the frames of {}", protocol.name);
    }
}
