//! Frames of the checksummed serial protocols, judged apart from the decoders: every checksum here is computed
//! without tables from its definition. Shared by the fuzz targets and by `tests/it/damage.rs`.

/// A protocol whose frames carry a checksum.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Checked {
    /// Name, as `--protocol` takes it.
    pub(crate) protocol: &'static str,
    /// Altered content passes by chance once in two to this power.
    pub(crate) bits: i32,
    /// A byte that ends a frame wherever it stands.
    pub(crate) delimiter: Option<u8>,
    /// Frames whose type is unknown to the decoder are counted, although their checksum is weaker, and not used.
    pub(crate) unknown_is_weak: bool,
    /// All frames have this length.
    pub(crate) fixed_length: Option<u64>,
    /// Length of the frame at the front with the right checksum. May find one that the decoder rejects for another reason.
    pub(crate) valid: fn(&[u8]) -> Option<usize>,
    /// Where a good frame has bytes that say neither what it is nor how long: measured data, and the checksum.
    pub(crate) content: fn(&[u8]) -> Vec<usize>,
    /// Makes the checksum right again after a change of content.
    pub(crate) seal: fn(&mut [u8]),
}

const PLAIN: Checked = Checked {
    protocol: "",
    bits: 16,
    delimiter: None,
    unknown_is_weak: false,
    fixed_length: None,
    valid: |_| None,
    content: |_| Vec::new(),
    seal: |_| {},
};

/// Every one of them.
pub(crate) const CHECKED: [Checked; 8] = [
    Checked {
        protocol: "otolith-serial",
        delimiter: Some(0),
        valid: otolith::valid,
        content: otolith::content,
        seal: otolith::seal,
        ..PLAIN
    },
    Checked {
        protocol: "openimu",
        valid: openimu::valid,
        content: |frame| (5..frame.len()).collect(),
        seal: openimu::seal,
        ..PLAIN
    },
    Checked {
        protocol: "bno08x-rvc",
        bits: 8,
        fixed_length: Some(19),
        valid: |bytes| {
            let frame = bytes.get(..19).filter(|frame| frame.starts_with(&[0xAA, 0xAA]))?;
            (sum(&frame[2..18]) == frame[18]).then_some(19)
        },
        content: |frame| (2..frame.len()).collect(),
        seal: |frame| frame[18] = sum(&frame[2..18]),
        ..PLAIN
    },
    Checked {
        protocol: "witmotion",
        bits: 8,
        fixed_length: Some(11),
        valid: |bytes| {
            let frame = bytes.get(..11).filter(|frame| frame[0] == 0x55 && frame[1] >> 4 == 5)?;
            (sum(&frame[..10]) == frame[10]).then_some(11)
        },
        content: |frame| (2..frame.len()).collect(),
        seal: |frame| frame[10] = sum(&frame[..10]),
        ..PLAIN
    },
    Checked {
        protocol: "xbus",
        bits: 8,
        valid: xbus::valid,
        content: xbus::content,
        seal: |frame| {
            let last = frame.len() - 1;
            frame[last] = 0_u8.wrapping_sub(sum(&frame[1..last]));
        },
        ..PLAIN
    },
    Checked { protocol: "mip", valid: mip::valid, content: mip::content, seal: mip::seal, ..PLAIN },
    Checked {
        protocol: "vectornav",
        valid: vectornav::valid,
        content: vectornav::content,
        seal: |frame| {
            let (checked, crc) = frame.split_at_mut(frame.len() - 2);
            crc.copy_from_slice(&crc_1021(0, &checked[1..]).to_be_bytes());
        },
        ..PLAIN
    },
    Checked {
        protocol: "mavlink",
        unknown_is_weak: true,
        valid: mavlink::valid,
        content: mavlink::content,
        seal: mavlink::seal,
        ..PLAIN
    },
];

/// The entry of a protocol.
pub(crate) fn checked(protocol: &str) -> Option<&'static Checked> {
    CHECKED.iter().find(|checked| checked.protocol == protocol)
}

impl Checked {
    /// Every place where a frame with the right checksum begins, and its length.
    pub(crate) fn places<'a>(&'a self, stream: &'a [u8]) -> impl Iterator<Item = (usize, usize)> + 'a {
        let may_begin = |at: usize| self.delimiter.is_none_or(|end| at == 0 || stream[at - 1] == end);
        (0..stream.len())
            .filter(move |&at| may_begin(at))
            .filter_map(|at| Some((at, (self.valid)(&stream[at..])?)))
    }

    /// The same frame with other content.
    pub(crate) fn remade(&self, frame: &[u8], mut random: impl FnMut() -> u8) -> Vec<u8> {
        let mut other = frame.to_vec();
        for at in (self.content)(frame) {
            // Of what ends a frame, there is none within one.
            other[at] =
                std::iter::repeat_with(&mut random).find(|byte| Some(*byte) != self.delimiter).unwrap_or(1);
        }
        (self.seal)(&mut other);
        other
    }
}

/// The low byte of the sum.
fn sum(bytes: &[u8]) -> u8 {
    (bytes.iter().map(|byte| u32::from(*byte)).sum::<u32>() % 256) as u8
}

/// CRC with polynomial 0x1021, most significant bit first. The eight steps of a byte at once: bit k of what is shifted out
/// comes back at k, k + 5 and k + 12, and its upper half once more through its lower.
fn crc_1021(start: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(start, |crc, byte| {
        let out = crc >> 8 ^ u16::from(*byte);
        let out = out ^ out >> 4;
        crc << 8 ^ out << 12 ^ out << 5 ^ out
    })
}

/// The same polynomial, least significant bit first, as MAVLink has it.
fn crc_1021_reflected(bytes: impl Iterator<Item = u8>) -> u16 {
    bytes.fold(0xFFFF, |crc: u16, byte| {
        let out = crc as u8 ^ byte;
        let out = u16::from(out ^ out << 4);
        crc >> 8 ^ out << 8 ^ out << 3 ^ out >> 4
    })
}

mod otolith {
    //! `COBS(type | seq | payload | crc16, low byte first) 0x00`.

    use super::crc_1021;

    /// Places of the COBS codes in a piece, and the place after its end as they say it.
    fn codes(piece: &[u8]) -> (Vec<usize>, usize) {
        let (mut at, mut codes) = (0, Vec::new());
        while at < piece.len() && piece[at] != 0 {
            codes.push(at);
            at += usize::from(piece[at]);
        }
        (codes, at)
    }

    /// What a piece stands for; `None` if it is no COBS.
    fn body(piece: &[u8]) -> Option<Vec<u8>> {
        let (codes, end) = codes(piece);
        let mut body = piece.to_vec();
        codes.iter().for_each(|at| body[*at] = 0);
        (end == piece.len() && end > 0).then(|| body.split_off(1))
    }

    pub(super) fn valid(bytes: &[u8]) -> Option<usize> {
        let end = bytes.iter().position(|byte| *byte == 0)?;
        let body = body(&bytes[..end]).filter(|body| body.len() >= 4)?;
        let (checked, crc) = body.split_at(body.len() - 2);
        (crc_1021(0xFFFF, checked).to_le_bytes() == crc).then_some(end + 1)
    }

    pub(super) fn content(frame: &[u8]) -> Vec<usize> {
        let (codes, end) = codes(&frame[..frame.len() - 1]);
        (3..end).filter(|at| !codes.contains(at)).collect()
    }

    pub(super) fn seal(frame: &mut [u8]) {
        let end = frame.len() - 1;
        let Some(mut block) = body(&frame[..end]) else { return };
        let crc_at = block.len() - 2;
        let crc = crc_1021(0xFFFF, &block[..crc_at]);
        block[crc_at..].copy_from_slice(&crc.to_le_bytes());
        let mut code_at = 0;
        for (at, byte) in (1..).zip(block) {
            if byte == 0 {
                frame[code_at] = (at - code_at) as u8;
                code_at = at;
            } else {
                frame[at] = byte;
            }
        }
        frame[code_at] = (end - code_at) as u8;
    }
}

mod openimu {
    //! `55 55`, type, length, payload, CRC from 0x1D0F over all but the first two.

    use super::crc_1021;

    pub(super) fn valid(bytes: &[u8]) -> Option<usize> {
        let end = match bytes {
            [0x55, 0x55, _, _, length, ..] => 7 + usize::from(*length),
            _ => return None,
        };
        let (checked, crc) = bytes.get(..end)?.split_at(end - 2);
        (crc_1021(0x1D0F, &checked[2..]).to_be_bytes() == crc).then_some(end)
    }

    pub(super) fn seal(frame: &mut [u8]) {
        let (checked, crc) = frame.split_at_mut(frame.len() - 2);
        crc.copy_from_slice(&crc_1021(0x1D0F, &checked[2..]).to_be_bytes());
    }
}

mod xbus {
    //! `FA`, bus, message, length (`FF` and 16 bits for long ones), data, a byte that makes the sum of all but `FA` zero.

    use super::sum;

    fn data(bytes: &[u8]) -> Option<std::ops::Range<usize>> {
        match *bytes {
            [0xFA, _, _, 0xFF, high, low, ..] => Some(6..6 + usize::from(u16::from_be_bytes([high, low]))),
            [0xFA, _, _, length, ..] => Some(4..4 + usize::from(length)),
            _ => None,
        }
    }

    pub(super) fn valid(bytes: &[u8]) -> Option<usize> {
        let end = data(bytes)?.end + 1;
        (sum(bytes.get(1..end)?) == 0).then_some(end)
    }

    /// Data are items: identifier (two bytes), size, so many bytes.
    pub(super) fn content(frame: &[u8]) -> Vec<usize> {
        let mut places = vec![frame.len() - 1];
        let Some(data) = data(frame) else { return places };
        let mut at = data.start;
        while at + 3 < data.end {
            let end = at + 3 + usize::from(frame[at + 2]);
            places.extend(at + 3..end);
            at = end;
        }
        places
    }
}

mod mip {
    //! `75 65`, descriptor set, length, fields, Fletcher's checksum over all before it.

    fn fletcher(bytes: &[u8]) -> [u8; 2] {
        let (mut first, mut second) = (0_u32, 0_u32);
        for byte in bytes {
            first += u32::from(*byte);
            second += first;
        }
        [(first % 256) as u8, (second % 256) as u8]
    }

    pub(super) fn valid(bytes: &[u8]) -> Option<usize> {
        let end = match bytes {
            [0x75, 0x65, _, length, ..] => 6 + usize::from(*length),
            _ => return None,
        };
        let (checked, checksum) = bytes.get(..end)?.split_at(end - 2);
        (fletcher(checked) == checksum).then_some(end)
    }

    /// Fields begin with their length and their descriptor.
    pub(super) fn content(frame: &[u8]) -> Vec<usize> {
        let end = frame.len() - 2;
        let mut places = vec![end, end + 1];
        let mut at = 4;
        while at < end && frame[at] > 2 {
            let next = at + usize::from(frame[at]);
            places.extend(at + 2..next);
            at = next;
        }
        places
    }

    pub(super) fn seal(frame: &mut [u8]) {
        let (checked, checksum) = frame.split_at_mut(frame.len() - 2);
        checksum.copy_from_slice(&fletcher(checked));
    }
}

mod vectornav {
    //! `FA`, groups, a mask for each, fields, CRC over all but the first; or a sentence `$VN..*HH`.

    use super::crc_1021;

    /// Longest binary frame that is looked for, bytes.
    const LONGEST: usize = 1024;

    /// How long a binary frame is follows from its masks. That is left open here: the shortest length that fits counts.
    pub(super) fn valid(bytes: &[u8]) -> Option<usize> {
        match bytes {
            [0xFA, groups, ..] => {
                let least = 4 + 2 * groups.count_ones() as usize;
                let mut crc = crc_1021(0, bytes.get(1..least - 1)?);
                (least..=LONGEST.min(bytes.len())).find(|end| {
                    crc = crc_1021(crc, &bytes[end - 1..*end]);
                    crc == 0
                })
            }
            [b'$', b'V', b'N', ..] => {
                let star = bytes.iter().take(LONGEST).position(|byte| *byte == b'*')?;
                let number = |digits: usize| {
                    let text = std::str::from_utf8(bytes.get(star + 1..star + 1 + digits)?).ok()?;
                    u16::from_str_radix(text, 16).ok()
                };
                let body = &bytes[1..star];
                let xor = body.iter().fold(0, |xor, byte| xor ^ u16::from(*byte));
                (number(2) == Some(xor) || number(4) == Some(crc_1021(0, body))).then_some(star + 3)
            }
            _ => None,
        }
    }

    pub(super) fn content(frame: &[u8]) -> Vec<usize> {
        (2 + 2 * frame[1].count_ones() as usize..frame.len()).collect()
    }
}

mod mavlink {
    //! Version 2 `FD` (header of 10 bytes) and version 1 `FE` (of 6), CRC over all but the first byte, and over a byte
    //! that belongs to the message type.

    use super::crc_1021_reflected;

    /// That byte of the messages with IMU data, by identifier.
    const EXTRA: [(u32, u8); 5] = [(26, 170), (27, 144), (105, 93), (116, 76), (129, 46)];

    fn extra(bytes: &[u8]) -> Option<u8> {
        let id = match *bytes {
            [0xFD, _, _, _, _, _, _, a, b, c, ..] => u32::from_le_bytes([a, b, c, 0]),
            [0xFE, _, _, _, _, id, ..] => u32::from(id),
            _ => return None,
        };
        EXTRA.iter().find(|(known, _)| *known == id).map(|(_, extra)| *extra)
    }

    fn crc(checked: &[u8], extra: u8) -> [u8; 2] {
        crc_1021_reflected(checked[1..].iter().copied().chain([extra])).to_le_bytes()
    }

    /// Every frame of a message that is not in the list counts as good: the decoder may know its byte.
    pub(super) fn valid(bytes: &[u8]) -> Option<usize> {
        let (head, signature) = match *bytes {
            [0xFD, _, flags, ..] => (10, if flags & 1 == 1 { 13 } else { 0 }),
            [0xFE, ..] => (6, 0),
            _ => return None,
        };
        let end = head + usize::from(*bytes.get(1)?);
        let received = bytes.get(end..end + 2)?;
        let good = extra(bytes).is_none_or(|extra| crc(&bytes[..end], extra) == received);
        good.then_some(end + 2 + signature)
    }

    pub(super) fn content(frame: &[u8]) -> Vec<usize> {
        let is_ours = frame[0] == 0xFD && extra(frame).is_some();
        if is_ours { (10..frame.len()).collect() } else { Vec::new() }
    }

    pub(super) fn seal(frame: &mut [u8]) {
        let Some(extra) = extra(frame) else { return };
        let (checked, received) = frame.split_at_mut(frame.len() - 2);
        received.copy_from_slice(&crc(checked, extra));
    }
}
