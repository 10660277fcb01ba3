//! Frames of MAVLink 2 and 1 and their checksums.

use super::imu;
use super::messages::definition;
use crate::device::protocol::crc::{MCRF4XX_START, mcrf4xx};

const SYNC_V2: u8 = 0xFD;
const SYNC_V1: u8 = 0xFE;
const HEADER_V2: usize = 10;
const HEADER_V1: usize = 6;
const CHECKSUM: usize = 2;
const SIGNATURE: usize = 13;
/// The only incompatibility flag there is: the frame is signed.
const SIGNED: u8 = 0x01;

/// Longest frame: header, 255 bytes of payload, checksum, signature.
pub(in crate::device) const LONGEST: usize = HEADER_V2 + 255 + CHECKSUM + SIGNATURE;

/// True for a byte that a frame begins with.
pub(in crate::device) fn is_sync(byte: u8) -> bool {
    matches!(byte, SYNC_V2 | SYNC_V1)
}

/// How sure a frame is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::device) enum Trust {
    /// The checksum is right.
    #[default]
    Checked,
    /// The checksum is right once zeros are put back at the end of the payload: a program between device and log cut
    /// them off (as MAVLink 2 asks for) without making a new checksum. Not believed of a message whose content is used.
    CutShort,
    /// The message is of no definition known here, so its `crc_extra` is open. One of the 256 there are fits the
    /// checksum, which happens by chance once in 256.
    UnknownMessage,
}

/// What stands at the front of some bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::device) enum Judgement {
    NoFrame,
    Incomplete,
    Damaged,
    /// A frame of so many bytes.
    Frame(usize, Trust),
}

/// Judges whether a frame begins at the first byte.
pub(in crate::device) fn judge(bytes: &[u8]) -> Judgement {
    match bytes.first() {
        Some(&SYNC_V2) => judge_v2(bytes),
        Some(&SYNC_V1) => judge_v1(bytes),
        _ => Judgement::NoFrame,
    }
}

fn judge_v2(bytes: &[u8]) -> Judgement {
    let signed = match bytes.get(2) {
        Some(flags) if flags & !SIGNED != 0 => return Judgement::NoFrame,
        Some(flags) => flags & SIGNED != 0,
        None => return Judgement::Incomplete,
    };
    let checked = HEADER_V2 + usize::from(bytes[1]);
    let length = checked + CHECKSUM + if signed { SIGNATURE } else { 0 };
    if bytes.len() < length {
        return Judgement::Incomplete;
    }
    let id = u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]);
    let received = u16::from_le_bytes([bytes[checked], bytes[checked + 1]]);
    let crc = mcrf4xx(MCRF4XX_START, bytes[1..checked].iter().copied());
    let trust = match definition(id) {
        None => fits_some_extra(crc, received).then_some(Trust::UnknownMessage),
        Some(definition) if mcrf4xx(crc, [definition.crc_extra]) == received => Some(Trust::Checked),
        Some(_) if imu::name(id).is_some() => None,
        Some(definition) => {
            let full = |length: &u8| {
                let zeros = usize::from(*length) - usize::from(bytes[1]);
                let crc = mcrf4xx(MCRF4XX_START, [*length]);
                let crc = mcrf4xx(crc, bytes[2..checked].iter().copied());
                let crc = mcrf4xx(crc, std::iter::repeat_n(0, zeros));
                mcrf4xx(crc, [definition.crc_extra]) == received
            };
            (bytes[1].saturating_add(1)..=definition.longest)
                .any(|length| full(&length))
                .then_some(Trust::CutShort)
        }
    };
    trust.map_or(Judgement::Damaged, |trust| Judgement::Frame(length, trust))
}

/// MAVLink 1 has no cut payloads and no dialects beyond 255, so that the length must be that of the message.
fn judge_v1(bytes: &[u8]) -> Judgement {
    let Some(&id) = bytes.get(5) else { return Judgement::Incomplete };
    let Some(definition) = definition(u32::from(id)).filter(|definition| definition.bytes_v1 == bytes[1])
    else {
        return Judgement::NoFrame;
    };
    let checked = HEADER_V1 + usize::from(bytes[1]);
    let length = checked + CHECKSUM;
    if bytes.len() < length {
        return Judgement::Incomplete;
    }
    let received = u16::from_le_bytes([bytes[checked], bytes[checked + 1]]);
    let crc = mcrf4xx(MCRF4XX_START, bytes[1..checked].iter().copied());
    if mcrf4xx(crc, [definition.crc_extra]) == received {
        Judgement::Frame(length, Trust::Checked)
    } else {
        Judgement::Damaged
    }
}

/// Whether one more byte can turn `crc` into `received`: `received` is then `crc >> 8` with the remainder of some byte.
fn fits_some_extra(crc: u16, received: u16) -> bool {
    let remainder = received ^ (crc >> 8);
    (0..=u8::MAX).any(|extra| mcrf4xx(u16::from(extra), [0]) == remainder)
}

/// A good frame, taken apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame<'a> {
    pub(super) version: u8,
    pub(super) sequence: u8,
    pub(super) system: u8,
    pub(super) component: u8,
    pub(super) message: u32,
    /// Without the zeros that MAVLink 2 cuts off its end.
    pub(super) payload: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Takes apart what [`judge`] called a frame.
    pub(super) fn of(bytes: &'a [u8]) -> Option<Self> {
        let length = usize::from(*bytes.get(1)?);
        match *bytes {
            [SYNC_V2, _, _, _, sequence, system, component, a, b, c, ref rest @ ..] => Some(Self {
                version: 2,
                sequence,
                system,
                component,
                message: u32::from_le_bytes([a, b, c, 0]),
                payload: rest.get(..length)?,
            }),
            [SYNC_V1, _, sequence, system, component, id, ref rest @ ..] => Some(Self {
                version: 1,
                sequence,
                system,
                component,
                message: u32::from(id),
                payload: rest.get(..length)?,
            }),
            _ => None,
        }
    }
}
