//! Messages of Xbus: how they are found in a stream, cut up and built.

use super::{kind, number};
use crate::device::protocol::frames::{FrameScanner, Look, hides_a_frame};

const PREAMBLE: u8 = 0xFA;
/// Bus identifier of the one device on the line.
const MASTER: u8 = 0xFF;
/// In place of a length: the length follows in 16 bits.
const EXTENDED: u8 = 0xFF;
/// Most data bytes of a message with extended length.
const LONGEST_DATA: usize = 2048;
/// Most data bytes of a message without.
const LONGEST_PLAIN_DATA: usize = 254;
/// Preamble, bus and message identifier, extended length, data, checksum.
pub(super) const LONGEST_MESSAGE: usize = 6 + LONGEST_DATA + 1;
/// Identifier and size of an item of MTData2.
const ITEM_HEAD: usize = 3;

/// The measured data.
pub(super) const MT_DATA2: u8 = 0x36;
/// Measured data of devices before MTData2, whose layout is set elsewhere.
pub(super) const MT_DATA: u8 = 0x32;
/// The device has been switched on.
pub(super) const WAKE_UP: u8 = 0x3E;
/// The device refuses a command, or has failed.
pub(in crate::device) const ERROR: u8 = 0x42;
/// The settings, sent at the start.
const CONFIGURATION: u8 = 0x0D;
/// Answer to a command that reads or sets the output configuration: up to 32 entries of 4 bytes.
const OUTPUT_CONFIGURATION: u8 = 0xC1;
/// Answer that lists the filter profiles: up to 5 of 22 bytes.
const FILTER_PROFILES: u8 = 0x63;
/// Answer with the settings of synchronisation: up to 10 of 12 bytes.
const SYNC_SETTINGS: u8 = 0x2D;
/// Most data bytes of another answer: a product code has 20.
const LONGEST_OTHER_ANSWER: usize = 24;
/// The device measures.
pub(super) const GO_TO_MEASUREMENT_ACK: u8 = 0x11;

/// One message of a good checksum.
#[derive(Clone, Copy, Debug)]
pub(in crate::device) struct Message<'a> {
    /// Message identifier (MID).
    pub(in crate::device) id: u8,
    /// Everything between length and checksum.
    pub(in crate::device) data: &'a [u8],
}

impl<'a> Message<'a> {
    /// Cuts up what [`look`] has called a frame.
    pub(super) fn of_frame(frame: &'a [u8]) -> Option<Self> {
        let (id, start) = match frame {
            [_, _, id, EXTENDED, ..] => (*id, 6),
            [_, _, id, ..] => (*id, 4),
            _ => return None,
        };
        Some(Self { id, data: frame.get(start..frame.len().checked_sub(1)?)? })
    }
}

/// One item of MTData2.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item<'a> {
    /// Data identifier (DID): kind in the upper 12 bits, axes and number format in the lower 4.
    pub(super) id: u16,
    pub(super) data: &'a [u8],
}

/// The items of an MTData2 message, up to the first that is cut short.
pub(super) fn items(mut data: &[u8]) -> impl Iterator<Item = Item<'_>> {
    std::iter::from_fn(move || {
        let (&[high, low, size], rest) = data.split_first_chunk::<ITEM_HEAD>()?;
        let (item, rest) = rest.split_at_checked(usize::from(size))?;
        data = rest;
        Some(Item { id: u16::from_be_bytes([high, low]), data: item })
    })
}

/// Bytes of an item, for the kinds this decoder reads.
fn size_of_item(id: u16) -> Option<usize> {
    match kind::of(id) {
        kind::PACKET_COUNTER => Some(2),
        kind::UTC_TIME => Some(12),
        kind::SAMPLE_TIME_FINE | kind::STATUS_WORD => Some(4),
        kind::ACCELERATION | kind::ACCELERATION_HR | kind::RATE_OF_TURN | kind::RATE_OF_TURN_HR => {
            Some(3 * number::size(id))
        }
        _ => None,
    }
}

/// Whether `shown`, the first bytes of the data of an MTData2 message of `length` data bytes, can be items that fill it.
fn items_fit(shown: &[u8], length: usize) -> bool {
    let mut at = 0;
    while at < length {
        let Some(&[high, low, size]) = shown.get(at..at + ITEM_HEAD).and_then(|head| head.first_chunk())
        else {
            return at + ITEM_HEAD <= length;
        };
        let size = usize::from(size);
        if size_of_item(u16::from_be_bytes([high, low])).is_some_and(|expected| expected != size) {
            return false;
        }
        at += ITEM_HEAD + size;
    }
    at == length
}

/// The data lengths a message of the device may have; none for what only a host sends.
///
/// The answer to a command has the command's identifier plus one, which is odd. Of those without a length of their own
/// here, only short ones are taken: by chance every other message identifier is odd, and a long one that is none would
/// hold up several packets.
fn allows(id: u8, length: usize) -> bool {
    match id {
        MT_DATA2 => (ITEM_HEAD..=LONGEST_DATA).contains(&length),
        MT_DATA => length <= LONGEST_PLAIN_DATA,
        WAKE_UP => length <= 4,
        ERROR => (1..=16).contains(&length),
        CONFIGURATION => (118..=LONGEST_PLAIN_DATA).contains(&length),
        OUTPUT_CONFIGURATION => length <= 128 && length.is_multiple_of(4),
        FILTER_PROFILES => length <= 110 && length.is_multiple_of(22),
        SYNC_SETTINGS => length <= 120 && length.is_multiple_of(12),
        _ => id % 2 == 1 && length <= LONGEST_OTHER_ANSWER,
    }
}

/// Whether a message identifier is one of the device's own.
fn is_of_device(id: u8) -> bool {
    matches!(id, MT_DATA2 | MT_DATA | WAKE_UP | ERROR) || id % 2 == 1
}

/// What the bytes at the front of the buffer are.
///
/// A message that cannot end as its items say, or that hides a good one, is given up as soon as that is seen: a length
/// damaged on the line does not hold up the messages behind it.
pub(super) fn look(bytes: &[u8]) -> Look {
    match look_at_one(bytes) {
        found @ (Look::Incomplete | Look::Frame(_)) => {
            let end = if let Look::Frame(end) = found { end } else { bytes.len() };
            let inside = bytes.get(4..end).unwrap_or_default();
            let hides = hides_a_frame(inside, [PREAMBLE, MASTER, MT_DATA2], look_at_one);
            if hides { Look::Damaged } else { found }
        }
        found => found,
    }
}

fn look_at_one(bytes: &[u8]) -> Look {
    let (id, start, length) = match *bytes {
        [PREAMBLE] | [PREAMBLE, MASTER] => return Look::Incomplete,
        [PREAMBLE, MASTER, id] if is_of_device(id) => return Look::Incomplete,
        [PREAMBLE, MASTER, MT_DATA2, EXTENDED] => return Look::Incomplete,
        [PREAMBLE, MASTER, MT_DATA2, EXTENDED, high] if usize::from(high) << 8 <= LONGEST_DATA => {
            return Look::Incomplete;
        }
        [PREAMBLE, MASTER, MT_DATA2, EXTENDED, high, low, ..] => {
            let length = usize::from(u16::from_be_bytes([high, low]));
            if length <= LONGEST_PLAIN_DATA {
                return Look::NoFrame;
            }
            (MT_DATA2, 6, length)
        }
        [PREAMBLE, MASTER, id, length, ..] if length != EXTENDED => (id, 4, usize::from(length)),
        _ => return Look::NoFrame,
    };
    if !allows(id, length) {
        return Look::NoFrame;
    }
    let shown = &bytes[start..bytes.len().min(start + length)];
    if id == MT_DATA2 && !items_fit(shown, length) {
        return Look::Damaged;
    }
    match bytes.get(1..start + length + 1) {
        None => Look::Incomplete,
        Some(summed) if sum(summed) == 0 => Look::Frame(start + length + 1),
        Some(_) => Look::Damaged,
    }
}

/// Sum of bytes modulo 256.
fn sum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}

/// Calls `on_message` with every message in `bytes`, which may begin and end within one.
pub(in crate::device) fn each_message(bytes: &[u8], mut on_message: impl FnMut(Message<'_>)) {
    let mut scanner = FrameScanner::<LONGEST_MESSAGE>::default();
    let mut on_frame = |frame: &[u8]| {
        if let Some(message) = Message::of_frame(frame) {
            on_message(message);
        }
    };
    scanner.push(bytes, look, &mut on_frame);
    scanner.finish(look, &mut on_frame);
}

/// The bytes of a message to the device; data beyond 254 bytes, more than any command takes, are cut off.
pub(in crate::device) fn message(id: u8, data: &[u8]) -> Vec<u8> {
    let data = &data[..data.len().min(LONGEST_PLAIN_DATA)];
    let mut bytes = vec![PREAMBLE, MASTER, id, data.len() as u8];
    bytes.extend_from_slice(data);
    bytes.push(0u8.wrapping_sub(sum(&bytes[1..])));
    bytes
}
