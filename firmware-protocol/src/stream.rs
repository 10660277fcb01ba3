//! Frames in a byte stream: `COBS(type | seq | payload | crc16) 0x00`.
//!
//! A zero byte ends every frame and occurs nowhere else, so whatever was damaged, the next zero is the end of the
//! damage. A dropped frame leaves a gap in the sequence numbers, which count every frame of any type modulo 256.

use crate::MAX_FRAME;
use crate::cobs;
use crate::crc::crc16;
use crate::message::{EncodeError, Message, PayloadError};

/// Writes one frame with its delimiter to the front of `out` and returns it.
///
/// Pure; [`StreamEncoder`] adds the sequence number.
///
/// # Errors
/// [`EncodeError`] if a name, text or batch does not fit one frame.
pub fn encode_frame<'b>(
    message: &Message<'_>,
    seq: u8,
    out: &'b mut [u8; MAX_FRAME],
) -> Result<&'b [u8], EncodeError> {
    // One byte in front for COBS, three behind for CRC and delimiter.
    let [_, kind_at, seq_at, payload @ .., _, _, _] = out;
    *kind_at = message.kind();
    *seq_at = seq;
    let crc_at = 3 + message.encode_payload(payload)?;
    let crc = crc16(&out[1..crc_at]);
    out[crc_at..crc_at + 2].copy_from_slice(&crc.to_le_bytes());
    let delimiter_at = crc_at + 2;
    cobs::encode_in_place(&mut out[..delimiter_at]);
    out[delimiter_at] = 0;
    Ok(&out[..=delimiter_at])
}

/// Numbers frames and writes them.
#[derive(Clone, Debug, Default)]
pub struct StreamEncoder {
    next_seq: u8,
}

impl StreamEncoder {
    /// An encoder whose first frame has sequence number 0.
    #[must_use]
    pub const fn new() -> Self {
        Self { next_seq: 0 }
    }

    /// An encoder whose first frame has the given sequence number.
    #[must_use]
    pub const fn starting_at(seq: u8) -> Self {
        Self { next_seq: seq }
    }

    /// Writes the next frame with its delimiter to the front of `out` and returns it.
    ///
    /// # Errors
    /// [`EncodeError`] if a name, text or batch does not fit one frame; no sequence number is used up.
    pub fn encode<'b>(
        &mut self,
        message: &Message<'_>,
        out: &'b mut [u8; MAX_FRAME],
    ) -> Result<&'b [u8], EncodeError> {
        let frame = encode_frame(message, self.next_seq, out)?;
        self.next_seq = self.next_seq.wrapping_add(1);
        Ok(frame)
    }
}

/// What a [`StreamDecoder`] has counted. Nothing is lost silently.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Checksum-good frames of any type.
    pub frames: u64,
    /// Pieces between delimiters that are no frame: broken COBS, too short or too long.
    pub framing_errors: u64,
    /// Pieces with a wrong checksum.
    pub crc_errors: u64,
    /// Frames missing by sequence number; a loss of a multiple of 256 in a row does not show here.
    pub lost: u64,
    /// Of `frames`, those of a type or version this decoder does not know.
    pub unknown: u64,
    /// Of `frames`, those of a known type whose payload has the wrong length.
    pub malformed: u64,
    /// Bytes of dropped pieces, delimiters included.
    pub bytes_skipped: u64,
}

/// Why a piece between two delimiters was dropped. All but [`DropReason::Crc`] count as framing errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DropReason {
    /// Longer than any frame. Reported as soon as it is certain, once per piece.
    TooLong,
    /// A COBS code points past the end of the piece.
    Cobs,
    /// Too short for type, sequence number and checksum.
    TooShort,
    /// The checksum is wrong.
    Crc,
}

/// What a [`StreamDecoder`] found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event<'a> {
    /// A good frame.
    Message {
        /// Its sequence number.
        seq: u8,
        /// Frames missing between it and the last good one.
        lost_before: u8,
        /// Its content.
        message: Message<'a>,
    },
    /// A checksum-good frame that this version cannot read.
    Unreadable {
        /// Its sequence number.
        seq: u8,
        /// Frames missing between it and the last good one.
        lost_before: u8,
        /// Its type byte.
        kind: u8,
        /// Its payload.
        payload: &'a [u8],
        /// What is wrong with it.
        error: PayloadError,
    },
    /// A piece that is not a good frame.
    Dropped {
        /// Why.
        reason: DropReason,
        /// True for the piece before the first delimiter: the stream was joined in the middle of a frame, and the
        /// error says nothing about the line.
        joined_mid_frame: bool,
    },
}

/// Finds frames in a byte stream. Any bytes are legal input; one delimiter after any damage resynchronises.
#[derive(Clone, Debug)]
pub struct StreamDecoder {
    /// The piece since the last delimiter, without what [`StreamDecoder::push`] can still see in its input.
    piece: [u8; cobs::MAX_ENCODED],
    piece_length: usize,
    /// The piece outgrew every frame and has been reported; its rest is only counted.
    too_long: bool,
    seen_delimiter: bool,
    last_seq: Option<u8>,
    counters: Counters,
}

impl Default for StreamDecoder {
    fn default() -> Self {
        Self::new()
    }
}

impl StreamDecoder {
    /// A decoder that has seen nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            piece: [0; cobs::MAX_ENCODED],
            piece_length: 0,
            too_long: false,
            seen_delimiter: false,
            last_seq: None,
            counters: Counters {
                frames: 0,
                framing_errors: 0,
                crc_errors: 0,
                lost: 0,
                unknown: 0,
                malformed: 0,
                bytes_skipped: 0,
            },
        }
    }

    /// Everything counted so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// Forgets the unfinished piece and the last sequence number, keeps the counters: the port was reopened.
    pub fn rejoin(&mut self) {
        *self = Self { counters: self.counters, ..Self::new() };
    }

    /// Takes the next bytes, cut anywhere, and calls `on_event` for each piece that ends in them.
    pub fn push(&mut self, mut bytes: &[u8], mut on_event: impl FnMut(Event<'_>)) {
        while let Some(end) = bytes.iter().position(|&byte| byte == 0) {
            self.append(&bytes[..end], &mut on_event);
            self.finish(&mut on_event);
            bytes = &bytes[end + 1..];
        }
        self.append(bytes, &mut on_event);
    }

    /// Adds bytes without a delimiter to the piece.
    fn append(&mut self, bytes: &[u8], on_event: &mut impl FnMut(Event<'_>)) {
        if self.too_long {
            self.counters.bytes_skipped += bytes.len() as u64;
        } else if let Some(free) = self.piece[self.piece_length..].get_mut(..bytes.len()) {
            free.copy_from_slice(bytes);
            self.piece_length += bytes.len();
        } else {
            // Counted now and not at the delimiter: a line without any zero is no silence.
            self.too_long = true;
            self.counters.framing_errors += 1;
            self.counters.bytes_skipped += (self.piece_length + bytes.len()) as u64;
            let joined_mid_frame = !self.seen_delimiter;
            on_event(Event::Dropped { reason: DropReason::TooLong, joined_mid_frame });
        }
    }

    /// Ends the piece at a delimiter.
    fn finish(&mut self, on_event: &mut impl FnMut(Event<'_>)) {
        let length = core::mem::take(&mut self.piece_length);
        let joined_mid_frame = !core::mem::replace(&mut self.seen_delimiter, true);
        if core::mem::take(&mut self.too_long) {
            self.counters.bytes_skipped += 1;
            return;
        }
        if length == 0 {
            return; // Two delimiters in a row are legal.
        }
        match open(&mut self.piece[..length]) {
            Ok((kind, seq, payload)) => {
                let lost_before = self.last_seq.map_or(0, |last| seq.wrapping_sub(last).wrapping_sub(1));
                self.last_seq = Some(seq);
                self.counters.frames += 1;
                self.counters.lost += u64::from(lost_before);
                on_event(match Message::decode(kind, payload) {
                    Ok(message) => Event::Message { seq, lost_before, message },
                    Err(error) => {
                        match error {
                            PayloadError::Length { .. } => self.counters.malformed += 1,
                            PayloadError::UnknownType { .. } | PayloadError::Version { .. } => {
                                self.counters.unknown += 1;
                            }
                        }
                        Event::Unreadable { seq, lost_before, kind, payload, error }
                    }
                });
            }
            Err(reason) => {
                match reason {
                    DropReason::Crc => self.counters.crc_errors += 1,
                    _ => self.counters.framing_errors += 1,
                }
                self.counters.bytes_skipped += length as u64 + 1;
                on_event(Event::Dropped { reason, joined_mid_frame });
            }
        }
    }
}

/// Undoes COBS in place and checks the frame; gives type, sequence number and payload.
fn open(piece: &mut [u8]) -> Result<(u8, u8, &[u8]), DropReason> {
    let body = cobs::decode_in_place(piece).map_err(|_| DropReason::Cobs)?;
    let [kind, seq, payload @ .., crc_low, crc_high] = body else { return Err(DropReason::TooShort) };
    if crc16(&body[..body.len() - 2]) != u16::from_le_bytes([*crc_low, *crc_high]) {
        return Err(DropReason::Crc);
    }
    Ok((*kind, *seq, payload))
}
