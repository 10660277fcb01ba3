//! Good streams with damage of the fuzzer's choice: whatever is accepted was in the undamaged stream, unless the damage
//! happened to make a frame with a right checksum.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use otolith::device::protocol::detect::decoder_by_name;

use crate::frames::{CHECKED, Checked};
use crate::seeds;
use crate::serial::{account, decode, decoder};

/// Bytes of one change: kind, place (two), value.
const CHANGE: usize = 4;

/// Byte 0 is the protocol, byte 1 seeds the content of the frames, changes follow.
pub(crate) fn run(data: &[u8]) {
    let &[protocol, content, ref changes @ ..] = data else { return };
    let (checked, good) = &protocols()[usize::from(protocol) % protocols().len()];
    let frames = stream_of(checked, good, content);
    let mut hurt = frames.concat();
    for change in changes.chunks_exact(CHANGE).take(32) {
        apply(&mut hurt, [change[0], change[1], change[2], change[3]]);
    }

    let after = decode(&mut decoder(checked.protocol, 1), hurt.chunks(1 + usize::from(content)));
    account(checked, &after.counters, &hurt);
    let originals: BTreeSet<&[u8]> = frames.iter().map(Vec::as_slice).collect();
    let made = checked.places(&hurt).any(|(at, length)| !originals.contains(&hurt[at..at + length]));
    if made {
        return;
    }
    // Its rates are made of two angles: another one when the frame between is lost.
    if checked.protocol == "bno08x-rvc" {
        return;
    }
    // With damage another of several outputs may be followed, or half of a sample: all that any of them says is known.
    let mut known = Vec::new();
    for frames in frames.chunks(1).chain(frames.windows(2)).chain([&frames[..]]) {
        let alone = decode(&mut decoder(checked.protocol, 1), frames.iter().map(Vec::as_slice));
        known.extend(alone.readings().copied());
    }
    for part in [0..3, 3..6] {
        let known: BTreeSet<&[u64]> = known.iter().map(|reading| &reading[part.clone()]).collect();
        for reading in after.readings() {
            assert!(known.contains(&reading[part.clone()]), "{}: an altered reading", checked.protocol);
        }
    }
}

/// A protocol with good frames of it.
type WithFrames = (&'static Checked, Vec<Vec<u8>>);

/// The protocols there are, with good frames of each.
fn protocols() -> &'static [WithFrames] {
    static PROTOCOLS: OnceLock<Vec<WithFrames>> = OnceLock::new();
    PROTOCOLS.get_or_init(|| {
        let known = CHECKED.iter().filter(|checked| decoder_by_name(checked.protocol).is_ok());
        known.map(|checked| (checked, seeds::good_frames(checked))).collect()
    })
}

/// Frames of a device one after the other, with the content of `number`.
fn stream_of(checked: &Checked, good: &[Vec<u8>], number: u8) -> Vec<Vec<u8>> {
    // Ours begin with the one that tells the scale: another scale would alter every reading.
    if checked.protocol == "otolith-serial" {
        return good.to_vec();
    }
    let mut state = u64::from(number);
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    (0..8).flat_map(|_| good).take(16).map(|frame| checked.remade(frame, &mut random)).collect()
}

fn apply(stream: &mut Vec<u8>, [kind, high, low, value]: [u8; CHANGE]) {
    if stream.is_empty() {
        return;
    }
    let at = usize::from(u16::from_be_bytes([high, low])) % stream.len();
    let end = (at + 1 + usize::from(value)).min(stream.len());
    match kind % 7 {
        0 => stream[at] ^= 1 << (value % 8),
        1 => stream.insert(at, value),
        2 => drop(stream.drain(at..end)),
        3 => stream.truncate(at),
        4 => {
            let twice = stream[at..end].to_vec();
            stream.splice(end..end, twice).for_each(drop);
        }
        5 => stream[at] = value,
        _ => stream.rotate_left(at),
    }
}

pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let change = |protocol: u8, kind: u8| vec![protocol, kind, kind, 0, 40, kind];
    (0..CHECKED.len() as u8).flat_map(|protocol| (0..7).map(move |kind| change(protocol, kind))).collect()
}
