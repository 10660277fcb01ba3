//! What damage on the line costs.

use otolith::device::Noise;
use proptest::prelude::*;

use super::{decode, vector};
use crate::shared_capture;

/// The vendors' frames with a sample, as protocol and bytes.
fn frames() -> [(&'static str, Vec<u8>); 3] {
    [
        ("xbus", vector("xsens-xbus/doc")),
        ("mip", vector("microstrain-mip/doc")),
        ("mip", vector("microstrain-mip/capture")),
    ]
}

/// Good packets once `damaged` and two good frames have come, no byte more.
fn good_after(protocol: &str, damaged: &[u8], good: &[u8]) -> u64 {
    let mut decoder = otolith::device::protocol::detect::decoder_by_name(protocol).expect("known");
    for bytes in [damaged, good, good] {
        decoder.push(otolith::device::Traffic::Bytes(bytes), &mut |_| {});
    }
    decoder.counters().packets
}

#[test]
fn whatever_is_flipped_cut_out_or_put_in_the_next_packet_is_read() {
    for (protocol, frame) in frames() {
        for bit in 0..8 * frame.len() {
            let mut hurt = frame.clone();
            hurt[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(good_after(protocol, &hurt, &frame), 2, "{protocol}: bit {bit}");
        }
        for from in 0..frame.len() {
            for to in from + 1..=frame.len() {
                let hurt = [&frame[..from], &frame[to..]].concat();
                assert_eq!(good_after(protocol, &hurt, &frame), 2, "{protocol}: without {from}..{to}");
            }
            for byte in [0x00, 0x10, 0x36, 0x65, 0x75, 0x80, 0xFA, 0xFF] {
                let hurt = [&frame[..from], &[byte], &frame[from..]].concat();
                // Put in before the first byte, or repeating it, the byte leaves the frame whole.
                let whole = hurt.ends_with(&frame);
                let good = good_after(protocol, &hurt, &frame);
                assert_eq!(good, 2 + u64::from(whole), "{protocol}: {byte:02x} at {from}");
            }
        }
    }
}

/// The frames of a capture without damage. Both protocols tell the length in the fourth byte.
fn cut_up(capture: &[u8], overhead: usize) -> Vec<&[u8]> {
    let (mut frames, mut rest) = (Vec::new(), capture);
    while let Some(length) = rest.get(3) {
        let (frame, after) = rest.split_at(usize::from(*length) + overhead);
        frames.push(frame);
        rest = after;
    }
    frames
}

#[test]
fn of_a_damaged_capture_only_the_damaged_packets_are_lost() {
    for (protocol, name, junk, overhead) in
        [("xbus", "xsens_mtdata2_100hz_gnss.bin", 22, 5), ("mip", "microstrain_mip_125hz.bin", 0, 6)]
    {
        let Some(capture) = shared_capture(&format!("serial_raw/{name}")) else { return };
        let frames = cut_up(&capture[junk..], overhead);
        let mut noise = Noise::new(7);
        let (mut stream, mut whole, mut hit) = (Vec::new(), Vec::new(), 0);
        for (index, frame) in frames.iter().enumerate() {
            // The first stay whole, so that what is missing is counted from a known state on, and so does the last.
            if index < 40 || index % 7 != 3 {
                stream.extend_from_slice(frame);
                whole.extend_from_slice(frame);
                continue;
            }
            hit += 1;
            let at = noise.next_u32() as usize % frame.len();
            match noise.next_u32() % 3 {
                0 => {
                    stream.extend_from_slice(frame);
                    let end = stream.len();
                    stream[end - frame.len() + at] ^= 1 << (noise.next_u32() % 8);
                }
                1 => stream.extend([&frame[..at], &frame[at + 1..]].concat()),
                _ => stream.extend([&frame[..at + 1], &[0x33], &frame[at + 1..]].concat()),
            }
        }
        let (readings, counters) = decode(protocol, &stream, 61);
        let (expected, _) = decode(protocol, &whole, 61);
        let through = counters.packets - (frames.len() - hit) as u64;
        println!("{protocol}: {hit} packets damaged, {through} came through");
        // A byte cut out or put in is right by chance like any other damage.
        assert!(through as f64 <= hit as f64 / 50.0, "{protocol}: {through} of {hit}");
        let lost = expected.iter().filter(|reading| !readings.contains(reading)).count();
        assert_eq!(lost, 0, "{protocol}");
        if protocol == "xbus" {
            assert_eq!(counters.missing + through, hit as u64, "the counter tells of every one");
        }
    }
}

/// Bytes in which the protocols' own stand out, whole frames among them.
fn stream() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        4 => proptest::collection::vec(any::<u8>(), 0..40),
        2 => Just(vec![0xFA, 0xFF, 0x36]),
        1 => Just(vec![0xFA, 0xFF, 0x36, 0xFF, 0x04]),
        2 => Just(vec![0x75, 0x65, 0x80]),
        3 => (0usize..3).prop_map(|index| frames()[index].1.clone()),
        2 => (0usize..3, 0usize..50).prop_map(|(index, end)| frames()[index].1[..end].to_vec()),
    ];
    proptest::collection::vec(piece, 0..30).prop_map(|pieces| pieces.concat())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_bytes_mean_the_same_however_they_are_cut_and_none_is_unaccounted_for(
        bytes in stream(),
        cut in 1usize..80,
    ) {
        for protocol in ["xbus", "mip"] {
            let whole = decode(protocol, &bytes, bytes.len().max(1));
            prop_assert_eq!(&whole, &decode(protocol, &bytes, cut));
            let counters = whole.1;
            prop_assert!(counters.bytes_skipped + counters.unfinished_bytes <= bytes.len() as u64);
            let quiet = counters.packets == 0;
            prop_assert!(!quiet || counters.bytes_skipped + counters.unfinished_bytes == bytes.len() as u64);
        }
    }
}
