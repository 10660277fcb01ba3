//! Packets of MIP: how they are found in a stream, cut up and built.

use super::field;
use crate::device::protocol::frames::{FrameScanner, Look, hides_a_frame};

const SYNC: [u8; 2] = [0x75, 0x65];
/// Synchronisation, descriptor set, length.
const HEAD: usize = 4;
const CHECKSUM: usize = 2;
/// Length and descriptor of a field, both counted by the length.
const FIELD_HEAD: usize = 2;
/// The longest packet: its payload has at most 255 bytes.
pub(super) const LONGEST_PACKET: usize = HEAD + 255 + CHECKSUM;

/// Descriptor set of the inertial sensors' data.
pub(super) const SENSOR_DATA: u8 = 0x80;
/// Descriptor set of the navigation filter's estimates.
pub(super) const FILTER_DATA: u8 = 0x82;
/// Answer to a command, in the command's set: the command and an error, 0 for done.
pub(in crate::device) const ACKNOWLEDGEMENT: u8 = 0xF1;

/// One packet of a good checksum.
#[derive(Clone, Copy, Debug)]
pub(in crate::device) struct Packet<'a> {
    /// Descriptor set.
    pub(in crate::device) set: u8,
    payload: &'a [u8],
}

/// One field of a packet.
#[derive(Clone, Copy, Debug)]
pub(in crate::device) struct Field<'a> {
    /// Field descriptor.
    pub(in crate::device) descriptor: u8,
    pub(in crate::device) data: &'a [u8],
}

impl<'a> Packet<'a> {
    /// Cuts up what [`look`] has called a frame.
    pub(super) fn of_frame(frame: &'a [u8]) -> Option<Self> {
        let payload = frame.get(HEAD..frame.len().checked_sub(CHECKSUM)?)?;
        Some(Self { set: *frame.get(2)?, payload })
    }

    /// Its fields, up to the first that is cut short.
    pub(in crate::device) fn fields(self) -> impl Iterator<Item = Field<'a>> {
        let mut rest = self.payload;
        std::iter::from_fn(move || {
            let length = usize::from(*rest.first()?);
            let (field, after) = rest.split_at_checked(length)?;
            let (&[_, descriptor], data) = field.split_first_chunk::<FIELD_HEAD>()?;
            rest = after;
            Some(Field { descriptor, data })
        })
    }
}

/// Whether a descriptor set is documented, for the device's packets as much as for the answers to commands.
pub(super) fn is_known_set(set: u8) -> bool {
    is_command_set(set) || matches!(set, SENSOR_DATA | FILTER_DATA | 0x81 | 0x91..=0x95 | 0xA0)
}

/// Whether a descriptor set is one of commands: base, 3DM, filter, GNSS, RTK, aiding, system.
pub(super) fn is_command_set(set: u8) -> bool {
    matches!(set, 0x01 | 0x0C | 0x0D | 0x0E | 0x0F | 0x13 | 0x7F)
}

/// Length that a field of a set must have, for those this decoder reads.
fn length_of_field(set: u8, descriptor: u8) -> Option<usize> {
    let data = match (set, descriptor) {
        (SENSOR_DATA, field::ACCELERATION | field::ANGULAR_RATE) => 12,
        (SENSOR_DATA, field::GPS_TIMESTAMP | field::GPS_TIME) => 12,
        (SENSOR_DATA, field::REFERENCE_TIME) => 8,
        (SENSOR_DATA, field::OVER_RANGE) | (_, ACKNOWLEDGEMENT) => 2,
        _ => return None,
    };
    Some(FIELD_HEAD + data)
}

/// Whether `shown`, the first bytes of a payload of `length` bytes, can be fields that fill it.
fn fields_fit(set: u8, shown: &[u8], length: usize) -> bool {
    let mut at = 0;
    while at < length {
        let Some(&field) = shown.get(at) else { return at + FIELD_HEAD <= length };
        let field = usize::from(field);
        let expected = shown.get(at + 1).and_then(|descriptor| length_of_field(set, *descriptor));
        if field < FIELD_HEAD || expected.is_some_and(|expected| expected != field) {
            return false;
        }
        at += field;
    }
    at == length
}

/// What the bytes at the front of the buffer are.
///
/// A packet that cannot end as its fields say, or that hides a good one, is given up as soon as that is seen: a length
/// damaged on the line does not hold up the packets behind it.
pub(super) fn look(bytes: &[u8]) -> Look {
    match look_at_one(bytes) {
        found @ (Look::Incomplete | Look::Frame(_)) => {
            let end = if let Look::Frame(end) = found { end } else { bytes.len() };
            let inside = bytes.get(HEAD..end).unwrap_or_default();
            if hides_a_frame(inside, SYNC, look_at_one) { Look::Damaged } else { found }
        }
        found => found,
    }
}

fn look_at_one(bytes: &[u8]) -> Look {
    let known = bytes.len().min(SYNC.len());
    if bytes[..known] != SYNC[..known] {
        return Look::NoFrame;
    }
    let &[_, _, set, length, ..] = bytes else { return Look::Incomplete };
    let end = HEAD + usize::from(length);
    if !fields_fit(set, &bytes[HEAD..bytes.len().min(end)], usize::from(length)) {
        return Look::Damaged;
    }
    match bytes.get(end..end + CHECKSUM) {
        None => Look::Incomplete,
        Some(sent) if sent == checksum(&bytes[..end]) => Look::Frame(end + CHECKSUM),
        Some(_) => Look::Damaged,
    }
}

/// Fletcher's checksum with 8-bit sums modulo 256.
fn checksum(bytes: &[u8]) -> [u8; 2] {
    bytes.iter().fold([0u8; 2], |[sum, sum_of_sums], byte| {
        let sum = sum.wrapping_add(*byte);
        [sum, sum_of_sums.wrapping_add(sum)]
    })
}

/// Calls `on_packet` with every packet in `bytes`, which may begin and end within one.
pub(in crate::device) fn each_packet(bytes: &[u8], mut on_packet: impl FnMut(Packet<'_>)) {
    let mut scanner = FrameScanner::<LONGEST_PACKET>::default();
    let mut on_frame = |frame: &[u8]| {
        if let Some(packet) = Packet::of_frame(frame) {
            on_packet(packet);
        }
    };
    scanner.push(bytes, look, &mut on_frame);
    scanner.finish(look, &mut on_frame);
}

/// The bytes of a packet of one field; data beyond 253 bytes, more than any command takes, are cut off.
pub(in crate::device) fn packet(set: u8, descriptor: u8, data: &[u8]) -> Vec<u8> {
    let data = &data[..data.len().min(usize::from(u8::MAX) - FIELD_HEAD)];
    let field = (FIELD_HEAD + data.len()) as u8;
    let mut bytes = vec![SYNC[0], SYNC[1], set, field, field, descriptor];
    bytes.extend_from_slice(data);
    let checksum = checksum(&bytes);
    bytes.extend_from_slice(&checksum);
    bytes
}
