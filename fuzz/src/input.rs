//! How a target reads its input: first what to do with the stream, then the stream.

/// Most places to cut at.
const MOST_CUTS: usize = 15;

/// A stream, and where to cut it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Input<'a> {
    /// Four bits for the target to use.
    pub(crate) flags: u8,
    cuts: &'a [u8],
    pub(crate) stream: &'a [u8],
}

impl<'a> Input<'a> {
    /// The first byte holds flags (high) and the number of cuts (low), each a byte; the stream follows.
    pub(crate) fn read(data: &'a [u8]) -> Self {
        let (&first, rest) = data.split_first().unwrap_or((&0, &[]));
        let count = (usize::from(first) & MOST_CUTS).min(rest.len());
        let (cuts, stream) = rest.split_at(count);
        Self { flags: first >> 4, cuts, stream }
    }

    /// The stream in pieces of the lengths the cuts say, over and over; single bytes if there are none.
    pub(crate) fn pieces(self) -> impl Iterator<Item = &'a [u8]> {
        let mut rest = self.stream;
        let mut lengths = self.lengths();
        std::iter::from_fn(move || {
            let length = lengths.next()?.min(rest.len());
            let (piece, after) = rest.split_at(length);
            rest = after;
            (length > 0).then_some(piece)
        })
    }

    /// Lengths to cut at, without end: 1 to 128 in steps of 1, then to 2048 in steps of 16.
    pub(crate) fn lengths(self) -> impl Iterator<Item = usize> + 'a {
        let cuts = if self.cuts.is_empty() { &[0] } else { self.cuts };
        cuts.iter().cycle().map(|cut| match usize::from(*cut) {
            small @ 0..128 => small + 1,
            large => (large - 127) * 16,
        })
    }
}

/// An input with this stream, cut in pieces of so many bytes.
pub(crate) fn with_cuts(flags: u8, cuts: &[u8], stream: &[u8]) -> Vec<u8> {
    let count = cuts.len().min(MOST_CUTS);
    [&[flags << 4 | count as u8][..], &cuts[..count], stream].concat()
}
