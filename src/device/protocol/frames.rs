//! Cuts frames out of a stream of bytes, for protocols whose frames begin with a fixed pattern.

use super::DecodeCounters;
use crate::device::Traffic;

/// What the bytes at the front of the buffer are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// No frame begins here.
    NoFrame,
    /// A frame may begin here; more bytes will tell. Say so only as long as every byte seen fits a frame: what is
    /// held up here holds up the good frames behind it.
    Incomplete,
    /// A frame began here and its checksum is wrong.
    Damaged,
    /// A good frame of this many bytes, at least 1 and at most those shown.
    Frame(usize),
}

/// What a [`FrameScanner`] has counted. Every byte pushed is in a good frame, skipped, unfinished, or still held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ScanCounters {
    /// Good frames.
    pub(super) frames: u64,
    /// Frames with a wrong checksum. Their bytes are among `bytes_skipped`, but for those of good frames inside.
    pub(super) bad_checksum: u64,
    /// Bytes outside good frames.
    pub(super) bytes_skipped: u64,
    /// Bytes of a frame that had begun at the end.
    pub(super) unfinished_bytes: u64,
}

/// The part of a decoder's counters that the scanner knows.
impl From<ScanCounters> for DecodeCounters {
    fn from(scanned: ScanCounters) -> Self {
        Self {
            packets: scanned.frames,
            bad_checksum: scanned.bad_checksum,
            bytes_skipped: scanned.bytes_skipped,
            unfinished_bytes: scanned.unfinished_bytes,
            ..Self::default()
        }
    }
}

/// Collects up to `N` bytes, the longest frame of the protocol, and looks for a frame at every position in turn, so
/// that damage costs the damaged frame alone. No heap.
#[derive(Clone, Debug)]
pub(super) struct FrameScanner<const N: usize> {
    buffer: [u8; N],
    start: usize,
    end: usize,
    counters: ScanCounters,
}

impl<const N: usize> Default for FrameScanner<N> {
    fn default() -> Self {
        Self { buffer: [0; N], start: 0, end: 0, counters: ScanCounters::default() }
    }
}

impl<const N: usize> FrameScanner<N> {
    pub(super) fn counters(&self) -> ScanCounters {
        self.counters
    }

    /// Takes traffic of any kind: a CAN frame holds no frame of a serial line, its bytes are skipped. See
    /// [`FrameScanner::push`].
    pub(super) fn take(
        &mut self,
        traffic: Traffic<'_>,
        look: impl Fn(&[u8]) -> Look,
        on_frame: impl FnMut(&[u8]),
    ) {
        match traffic {
            Traffic::Bytes(bytes) => self.push(bytes, look, on_frame),
            Traffic::CanFrame { data, .. } => self.counters.bytes_skipped += data.len() as u64,
        }
    }

    /// Takes bytes, cut anywhere, and calls `on_frame` with each good frame. `look` is shown everything held from a
    /// position on, at least one byte.
    pub(super) fn push(
        &mut self,
        mut bytes: &[u8],
        look: impl Fn(&[u8]) -> Look,
        mut on_frame: impl FnMut(&[u8]),
    ) {
        while !bytes.is_empty() {
            if self.start > 0 {
                self.buffer.copy_within(self.start..self.end, 0);
                self.end -= self.start;
                self.start = 0;
            }
            let count = bytes.len().min(N - self.end);
            self.buffer[self.end..self.end + count].copy_from_slice(&bytes[..count]);
            self.end += count;
            bytes = &bytes[count..];
            self.drain(&look, &mut on_frame);
        }
    }

    /// Cuts off frames until more bytes are needed. Leaves room for at least one byte.
    fn drain(&mut self, look: &impl Fn(&[u8]) -> Look, on_frame: &mut impl FnMut(&[u8])) {
        while self.start < self.end {
            let held = &self.buffer[self.start..self.end];
            match look(held) {
                Look::Frame(length) => {
                    let length = length.clamp(1, held.len());
                    self.counters.frames += 1;
                    on_frame(&held[..length]);
                    self.start += length;
                }
                Look::Incomplete if held.len() < N => return,
                Look::Incomplete | Look::NoFrame => self.skip(1),
                Look::Damaged => {
                    self.counters.bad_checksum += 1;
                    self.skip(1);
                }
            }
        }
    }

    fn skip(&mut self, count: usize) {
        self.start += count;
        self.counters.bytes_skipped += count as u64;
    }

    /// The stream has ended: an unfinished frame that hides good ones was none; one that does not is counted.
    pub(super) fn finish(&mut self, look: impl Fn(&[u8]) -> Look, mut on_frame: impl FnMut(&[u8])) {
        while self.start < self.end {
            let hidden = (self.start + 1..self.end)
                .find(|&at| matches!(look(&self.buffer[at..self.end]), Look::Frame(_)));
            let Some(hidden) = hidden else { break };
            self.skip(hidden - self.start);
            self.drain(&look, &mut on_frame);
        }
        self.counters.unfinished_bytes += (self.end - self.start) as u64;
        self.start = self.end;
    }

    /// Forgets the unfinished frame: the connection was lost in it.
    pub(super) fn rejoin(&mut self) {
        self.skip(self.end - self.start);
    }
}

/// Whether a good frame, which starts with `begin`, lies whole in what would be the inside of another: then the other is
/// none. For frames whose length may be damaged: one that is too long is given up with the first good frame behind its
/// start, not only once all its bytes are there.
pub(super) fn hides_a_frame<const N: usize>(
    inside: &[u8],
    begin: [u8; N],
    look: impl Fn(&[u8]) -> Look,
) -> bool {
    let mut starts = inside.windows(N).enumerate().filter(|(_, window)| *window == begin);
    starts.any(|(at, _)| matches!(look(&inside[at..]), Look::Frame(_)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// `A5 length payload.. sum`, length counts the payload, the sum all before it.
    fn look(bytes: &[u8]) -> Look {
        match bytes {
            [0xA5] => Look::Incomplete,
            [0xA5, length, ..] if *length > 20 => Look::NoFrame,
            [0xA5, length, ..] => {
                let length = usize::from(*length);
                match bytes.get(..length + 3) {
                    None => Look::Incomplete,
                    Some(frame) if sum(&frame[..length + 2]) == frame[length + 2] => Look::Frame(length + 3),
                    Some(_) => Look::Damaged,
                }
            }
            _ => Look::NoFrame,
        }
    }

    fn sum(bytes: &[u8]) -> u8 {
        bytes.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
    }

    fn frame(payload: &[u8]) -> Vec<u8> {
        let mut frame = vec![0xA5, payload.len() as u8];
        frame.extend_from_slice(payload);
        frame.push(sum(&frame));
        frame
    }

    fn scan(pieces: &[&[u8]]) -> (Vec<Vec<u8>>, ScanCounters) {
        let (mut scanner, mut frames) = (FrameScanner::<23>::default(), Vec::new());
        for piece in pieces {
            scanner.push(piece, look, |frame| frames.push(frame.to_vec()));
        }
        scanner.finish(look, |frame| frames.push(frame.to_vec()));
        (frames, scanner.counters())
    }

    #[test]
    fn a_damaged_frame_costs_itself_alone() {
        let (a, mut b, c) = (frame(&[1, 2, 3]), frame(&[4, 5]), frame(&[6; 20]));
        b[3] ^= 0x10;
        let stream = [&[7, 7][..], &a, &b, &c, &[0xA5, 9, 1]].concat();
        let (frames, counters) = scan(&[&stream]);
        assert_eq!(frames, [a, c]);
        let expected = ScanCounters { frames: 2, bad_checksum: 1, bytes_skipped: 7, unfinished_bytes: 3 };
        assert_eq!(counters, expected);
    }

    #[test]
    fn a_false_start_at_the_end_does_not_hide_a_frame() {
        let stream = [&[0xA5, 20][..], &frame(&[1, 2])].concat();
        let (frames, counters) = scan(&[&stream]);
        assert_eq!((frames, counters.bytes_skipped, counters.unfinished_bytes), (vec![frame(&[1, 2])], 2, 0));
    }

    proptest! {
        #[test]
        fn every_byte_is_accounted_for_however_it_is_cut(
            bytes in proptest::collection::vec(prop_oneof![Just(0xA5), 0u8..8, any::<u8>()], 0..300),
            cut in 1usize..40,
        ) {
            let pieces: Vec<&[u8]> = bytes.chunks(cut).collect();
            let (frames, counters) = scan(&pieces);
            prop_assert_eq!(scan(&[&bytes]), (frames.clone(), counters));
            let framed: usize = frames.iter().map(Vec::len).sum();
            let told = framed as u64 + counters.bytes_skipped + counters.unfinished_bytes;
            prop_assert_eq!((told, counters.frames), (bytes.len() as u64, frames.len() as u64));
        }
    }
}
