//! What every decoder of foreign bytes must survive: any bytes, any cuts, and damage that costs the frames it hits alone.

use proptest::prelude::*;

use super::{DecodeCounters, ImuReading, PacketDecoder};
use crate::device::Traffic;

/// Everything that `decoder` makes of these pieces, to their end.
pub(super) fn decode<'a>(
    mut decoder: impl PacketDecoder,
    pieces: impl IntoIterator<Item = &'a [u8]>,
) -> (Vec<ImuReading>, DecodeCounters, Vec<String>) {
    let mut readings = Vec::new();
    for piece in pieces {
        decoder.push(Traffic::Bytes(piece), &mut |reading| readings.push(reading));
    }
    decoder.finish(&mut |reading| readings.push(reading));
    (readings, decoder.counters(), decoder.notes())
}

/// One damage of a stream.
#[derive(Clone, Copy, Debug)]
pub(super) enum Damage {
    Flip(u8),
    Insert(u8),
    Delete,
}

pub(super) fn damage() -> impl Strategy<Value = Damage> {
    prop_oneof![
        (0u8..8).prop_map(|bit| Damage::Flip(1 << bit)),
        any::<u8>().prop_map(Damage::Insert),
        Just(Damage::Delete),
    ]
}

/// The frames one after another, damaged at shares of their whole length, and which of them were hit.
pub(super) fn damaged(frames: &[Vec<u8>], damages: &[(f64, Damage)]) -> (Vec<u8>, Vec<bool>) {
    let total: usize = frames.iter().map(Vec::len).sum();
    let (mut stream, mut hit, mut at) = (Vec::new(), vec![false; frames.len()], 0);
    for (number, frame) in frames.iter().enumerate() {
        for (index, &byte) in frame.iter().enumerate() {
            let here = damages.iter().find(|(share, _)| (share * total as f64) as usize == at);
            at += 1;
            match here.map(|(_, damage)| damage) {
                None => {}
                // A byte between two frames hits neither.
                Some(Damage::Insert(_)) if index == 0 => {}
                // Nobody can tell which of two equal bytes is missing.
                Some(Damage::Delete) if index + 1 == frame.len() => {
                    let next = frames.get(number + 1).filter(|next| next[0] == byte);
                    hit[number + usize::from(next.is_some())] = true;
                }
                Some(_) => hit[number] = true,
            }
            match here.map(|(_, damage)| *damage) {
                None => stream.push(byte),
                Some(Damage::Flip(bits)) => stream.push(byte ^ bits),
                Some(Damage::Insert(other)) => stream.extend([other, byte]),
                Some(Damage::Delete) => {}
            }
        }
    }
    (stream, hit)
}

/// Whether every one of `expected` occurs in `found`, in this order.
pub(super) fn holds_in_order(found: &[ImuReading], expected: &[ImuReading]) -> bool {
    let mut found = found.iter();
    expected.iter().all(|reading| found.any(|other| other == reading))
}
