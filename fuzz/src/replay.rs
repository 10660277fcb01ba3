//! Recordings of other programs: played alike however the file is read, in order of time, nothing made up.

use std::io::{BufReader, Cursor};
use std::time::Duration;

use otolith::device::replay::{CandumpReplay, RawReplay, TextReplay, TlogReplay, parse_candump_line};
use otolith::device::{Link, LinkError, LinkStatus, Traffic};
use otolith::time::HostTime;

use crate::input::Input;
use crate::serial::{decode, decoder};

const BAUD: u32 = 115_200;

/// The input's stream as a file that is read in pieces of so many bytes.
fn file(input: Input<'_>, capacity: usize) -> BufReader<Cursor<Vec<u8>>> {
    BufReader::with_capacity(capacity, Cursor::new(input.stream.to_vec()))
}

/// A piece of traffic, kept: time, frame, bytes.
type Piece = (HostTime, Option<(u32, bool)>, Vec<u8>);

/// Everything a link gives out until its end.
fn play(mut link: impl Link) -> (Vec<Piece>, LinkStatus) {
    let (mut pieces, mut last) = (Vec::new(), HostTime(0));
    loop {
        match link.receive(Duration::ZERO) {
            Ok(Some((at, traffic))) => {
                assert!(at >= last, "time goes back from {last:?} to {at:?}");
                last = at;
                pieces.push(match traffic {
                    Traffic::Bytes(bytes) => (at, None, bytes.to_vec()),
                    Traffic::CanFrame { id, extended, data } => {
                        assert!(data.len() <= 8 && id < if extended { 1 << 29 } else { 1 << 11 });
                        (at, Some((id, extended)), data.to_vec())
                    }
                });
            }
            Ok(None) => {}
            Err(LinkError::EndOfRecording) => return (pieces, link.status()),
            Err(error) => panic!("{error}"),
        }
    }
}

/// The bytes of all pieces.
fn bytes(pieces: &[Piece]) -> Vec<u8> {
    pieces.iter().flat_map(|(.., bytes)| bytes.clone()).collect()
}

/// The capacity of the other buffer.
fn other(input: Input<'_>) -> usize {
    input.lengths().next().unwrap_or(1)
}

pub(crate) fn text(data: &[u8]) {
    let input = Input::read(data);
    // The line's first byte is its time; some lines have none.
    let stamper =
        || Box::new(|line: &[u8]| line.first().filter(|byte| **byte > 32).map(|byte| u64::from(*byte) << 28));
    let open = |capacity| TextReplay::new("log".to_owned(), file(input, capacity), BAUD, Some(stamper()));
    let whole = play(open(1 << 16));
    assert_eq!(whole, play(open(other(input))), "buffers make a difference");
    let played = bytes(&whole.0);
    let missing_end = !matches!(input.stream.last(), None | Some(b'\n'));
    assert!(
        played.starts_with(input.stream) && played.len() == input.stream.len() + usize::from(missing_end)
    );
    play(TextReplay::new("log".to_owned(), file(input, other(input)), BAUD, None));
}

pub(crate) fn candump(data: &[u8]) {
    let input = Input::read(data);
    let open = |capacity| CandumpReplay::new("log".to_owned(), file(input, capacity));
    let (pieces, status) = play(open(1 << 16));
    assert_eq!((pieces.clone(), status), play(open(other(input))), "buffers make a difference");
    let lines = || input.stream.split_inclusive(|byte| *byte == b'\n');
    // The longest lines are cut by the reader; the fuzzer's are shorter.
    let frames: Vec<_> = lines().filter_map(parse_candump_line).collect();
    let errors = frames.iter().filter(|frame| frame.error).count();
    let skipped: usize = lines().filter(|line| parse_candump_line(line).is_none()).map(<[u8]>::len).sum();
    let expected = (frames.len() - errors, errors as u64, skipped as u64);
    let not_played = status.bytes_skipped + status.unfinished_bytes;
    assert_eq!((pieces.len(), status.bus_errors, not_played), expected);
    let cut = lines().next_back().filter(|line| !line.ends_with(b"\n") && parse_candump_line(line).is_none());
    assert_eq!(status.unfinished_bytes, cut.map_or(0, <[u8]>::len) as u64);
    for (frame, (_, id, data)) in frames.iter().filter(|frame| !frame.error).zip(&pieces) {
        assert_eq!((Some((frame.id, frame.extended)), frame.data()), (*id, &data[..]));
    }
    // Stamps that are steps give other times to the same frames.
    let (stepped, _) = play(open(1 << 16).with_delta_stamps());
    assert!(stepped.iter().map(|(_, id, data)| (id, data)).eq(pieces.iter().map(|(_, id, data)| (id, data))));
}

pub(crate) fn raw(data: &[u8]) {
    let input = Input::read(data);
    let open = |capacity| RawReplay::new("capture".to_owned(), file(input, capacity), BAUD);
    for capacity in [1 << 16, other(input)] {
        assert_eq!(bytes(&play(open(capacity)).0), input.stream);
    }
}

/// How garbage is cut up depends on how much of the file is at hand; what the decoder finds in it does not.
pub(crate) fn tlog(data: &[u8]) {
    let input = Input::read(data);
    let found = |capacity| {
        let (pieces, _) = play(TlogReplay::new("log".to_owned(), file(input, capacity)));
        assert!(bytes(&pieces).len() <= input.stream.len());
        let pieces = pieces.iter().map(|(.., bytes)| bytes.as_slice());
        decode(&mut decoder("mavlink", 0), pieces).counters.packets
    };
    assert_eq!(found(1 << 16), found(other(input)), "buffers make a difference");
}
