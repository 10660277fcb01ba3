//! The lines of slcan (the LAWICEL protocol): text, one frame or command each, ended by a carriage return.
//!
//! | line | is |
//! |---|---|
//! | `tIIIL` + 2 L digits | data frame, 11-bit identifier, L bytes; `TIIIIIIIIL...` with 29 bits |
//! | `rIIIL`, `RIIIIIIIIL` | remote frame |
//! | the same + 4 digits | with the adapter's stamp, ms, 0 to 59999 |
//! | empty, `z`, `Z` | done; a frame was sent |
//! | `V...`, `N...`, `F...` | answer to a question |
//! | BEL, alone or inside a line | error |
//!
//! No heap, no I/O, and any bytes are legal input.

use std::fmt;

/// Longest line there is: a full extended frame with a stamp, and its end.
pub const MAX_LINE: usize = 1 + 8 + 1 + 16 + 4 + 1;

const END: u8 = b'\r';
const BEL: u8 = 0x07;

/// Bitrates of the commands `S0` to `S8`, bit/s.
pub const BITRATES: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// The bitrates as a text for hints.
pub(in crate::device) fn bitrate_list() -> String {
    let names: Vec<String> = BITRATES.iter().map(u32::to_string).collect();
    names.join(", ")
}

/// What the host tells an adapter. `Display` writes it without the end of the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// `S0` to `S8`: index into [`BITRATES`].
    Bitrate(u8),
    /// `O`: open the channel.
    Open,
    /// `C`: close the channel.
    Close,
    /// `V`: tell hardware and software version.
    Version,
    /// `N`: tell the serial number.
    SerialNumber,
    /// `Z0`, `Z1`: stamps off or on.
    Stamps(bool),
}

impl Command {
    /// The command for a bitrate in bit/s; `None` when slcan has none for it.
    pub fn bitrate(bitrate: u32) -> Option<Self> {
        let index = BITRATES.iter().position(|known| *known == bitrate)?;
        u8::try_from(index).ok().map(Command::Bitrate)
    }

    /// The command a line without its end holds; `None` for anything else. For the adapter's side.
    pub fn parse(line: &[u8]) -> Option<Self> {
        match line {
            [b'S', digit @ b'0'..=b'8'] => Some(Command::Bitrate(digit - b'0')),
            b"O" => Some(Command::Open),
            b"C" => Some(Command::Close),
            b"V" => Some(Command::Version),
            b"N" => Some(Command::SerialNumber),
            b"Z0" => Some(Command::Stamps(false)),
            b"Z1" => Some(Command::Stamps(true)),
            _ => None,
        }
    }

    /// The line with its end.
    pub fn line(self) -> String {
        format!("{self}\r")
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Command::Bitrate(index) => write!(f, "S{index}"),
            Command::Open => f.write_str("O"),
            Command::Close => f.write_str("C"),
            Command::Version => f.write_str("V"),
            Command::SerialNumber => f.write_str("N"),
            Command::Stamps(on) => write!(f, "Z{}", u8::from(*on)),
        }
    }
}

/// One classic CAN frame as a line carries it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlcanFrame {
    /// Identifier without flag bits.
    pub id: u32,
    /// True for a 29-bit identifier.
    pub extended: bool,
    /// True for a remote frame: it has a length and no data.
    pub remote: bool,
    /// The adapter's stamp, ms, where it sends one. Wraps at 60000.
    pub stamp_ms: Option<u16>,
    data: [u8; 8],
    length: u8,
}

impl SlcanFrame {
    /// A data frame; `None` when identifier or data are too long.
    pub fn new(id: u32, extended: bool, data: &[u8]) -> Option<Self> {
        let length = u8::try_from(data.len()).ok()?;
        let mut frame = Self::remote(id, extended, length)?;
        frame.remote = false;
        frame.data[..data.len()].copy_from_slice(data);
        Some(frame)
    }

    /// A remote frame that asks for `length` bytes; `None` when identifier or length are too large.
    pub fn remote(id: u32, extended: bool, length: u8) -> Option<Self> {
        let largest = if extended { 0x1FFF_FFFF } else { 0x7FF };
        (id <= largest && length <= 8).then_some(Self {
            id,
            extended,
            remote: true,
            stamp_ms: None,
            data: [0; 8],
            length,
        })
    }

    /// Payload, at most 8 bytes; none in a remote frame.
    pub fn data(&self) -> &[u8] {
        if self.remote { &[] } else { &self.data[..usize::from(self.length)] }
    }

    /// Data length code: bytes carried, or asked for by a remote frame.
    pub fn length(&self) -> u8 {
        self.length
    }

    /// Writes the line with its end and returns its length.
    pub fn encode(&self, out: &mut [u8; MAX_LINE]) -> usize {
        let mut length = 0;
        let mut put = |byte: u8| {
            // Never longer than the longest line.
            if let Some(slot) = out.get_mut(length) {
                *slot = byte;
                length += 1;
            }
        };
        put(match (self.remote, self.extended) {
            (false, false) => b't',
            (false, true) => b'T',
            (true, false) => b'r',
            (true, true) => b'R',
        });
        put_hex(self.id, if self.extended { 8 } else { 3 }, &mut put);
        put_hex(u32::from(self.length), 1, &mut put);
        for byte in self.data() {
            put_hex(u32::from(*byte), 2, &mut put);
        }
        if let Some(stamp_ms) = self.stamp_ms {
            put_hex(u32::from(stamp_ms), 4, &mut put);
        }
        put(END);
        length
    }

    /// Reads a line without its end; `None` when it is no frame.
    pub fn parse(line: &[u8]) -> Option<Self> {
        let (&kind, digits) = line.split_first()?;
        let (extended, remote) = match kind {
            b't' => (false, false),
            b'T' => (true, false),
            b'r' => (false, true),
            b'R' => (true, true),
            _ => return None,
        };
        let (id, digits) = take_hex(digits, if extended { 8 } else { 3 })?;
        let (length, mut digits) = take_hex(digits, 1)?;
        let mut frame = Self::remote(id, extended, u8::try_from(length).ok()?)?;
        frame.remote = remote;
        if !remote {
            for byte in &mut frame.data[..usize::from(frame.length)] {
                let (value, rest) = take_hex(digits, 2)?;
                *byte = u8::try_from(value).ok()?;
                digits = rest;
            }
        }
        if !digits.is_empty() {
            let (stamp_ms, rest) = take_hex(digits, 4)?;
            frame.stamp_ms = u16::try_from(stamp_ms).ok();
            digits = rest;
        }
        digits.is_empty().then_some(frame)
    }
}

fn put_hex(value: u32, digits: u32, put: &mut impl FnMut(u8)) {
    for place in (0..digits).rev() {
        let nibble = (value >> (4 * place) & 0xF) as u8;
        put(if nibble < 10 { b'0' + nibble } else { b'A' + nibble - 10 });
    }
}

/// The value of the first `count` digits, of either case, and what follows them.
fn take_hex(digits: &[u8], count: usize) -> Option<(u32, &[u8])> {
    let (mine, rest) = digits.split_at_checked(count)?;
    let value =
        mine.iter().try_fold(0, |value, digit| Some(value << 4 | char::from(*digit).to_digit(16)?))?;
    Some((value, rest))
}

/// What a byte has completed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlcanEvent {
    /// A frame.
    Frame(SlcanFrame),
    /// A command or a frame of ours was taken.
    Accepted,
    /// A command or a frame of ours was not taken, or the adapter lost something.
    Refused,
    /// So many bytes, ends of lines included, that are nothing known.
    Skipped(usize),
}

/// Finds the lines in a stream of bytes, cut anywhere.
///
/// The letters that begin a frame occur nowhere else in one, so a frame is found even when the line before it has lost
/// its end.
#[derive(Clone, Debug, Default)]
pub struct SlcanDecoder {
    line: [u8; MAX_LINE],
    /// Bytes of the line so far, or since they were reported as too many.
    filled: usize,
    /// The line is longer than any; some of it has been reported.
    too_long: bool,
}

impl SlcanDecoder {
    /// Takes the next byte. A frame's first letter in the middle of another line reports what came before it, and bytes
    /// without an end are reported as soon as they are too many: at a wrong baud rate no end may ever come.
    pub fn push(&mut self, byte: u8) -> Option<SlcanEvent> {
        match byte {
            END => Some(self.finish()),
            BEL => {
                (self.filled, self.too_long) = (0, false);
                Some(SlcanEvent::Refused)
            }
            b't' | b'T' | b'r' | b'R' => {
                let before = std::mem::take(&mut self.filled);
                self.too_long = false;
                self.keep(byte);
                (before > 0).then_some(SlcanEvent::Skipped(before))
            }
            // Some firmware ends its lines with both.
            b'\n' if self.filled == 0 && !self.too_long => None,
            _ => {
                self.keep(byte);
                (self.filled == MAX_LINE).then(|| {
                    (self.filled, self.too_long) = (0, true);
                    SlcanEvent::Skipped(MAX_LINE)
                })
            }
        }
    }

    fn keep(&mut self, byte: u8) {
        self.line[self.filled] = byte;
        self.filled += 1;
    }

    fn finish(&mut self) -> SlcanEvent {
        let filled = std::mem::take(&mut self.filled);
        let whole = !std::mem::take(&mut self.too_long);
        match self.line.get(..filled).filter(|_| whole) {
            Some([] | [b'z' | b'Z']) => SlcanEvent::Accepted,
            Some([b'V' | b'N' | b'F', answer @ ..]) if answer.iter().all(u8::is_ascii_alphanumeric) => {
                SlcanEvent::Accepted
            }
            Some(line) => SlcanFrame::parse(line).map_or(SlcanEvent::Skipped(filled + 1), SlcanEvent::Frame),
            None => SlcanEvent::Skipped(filled + 1),
        }
    }
}

#[cfg(test)]
mod tests;
