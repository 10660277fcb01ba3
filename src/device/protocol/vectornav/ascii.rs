//! `$VNxxx,field,field*HH\r\n`: sentences, their checksums and the measurements in them.

use nalgebra::Vector3;

use crate::device::protocol::crc::xmodem;
use crate::device::protocol::frames::Look;

/// Longest sentence taken as one, bytes: the longest answer of a device has about 200.
const LONGEST: usize = 256;
/// `$VNxxx`.
const NAME_END: usize = 6;

/// Whether a sentence begins at the `$` in front.
pub(super) fn look(bytes: &[u8]) -> Look {
    let Some(star) = bytes.iter().position(|&byte| byte == b'*') else { return unfinished(bytes) };
    let sentence = unfinished(&bytes[..star]);
    if sentence != Look::Incomplete || star < NAME_END {
        return if sentence == Look::Incomplete { Look::NoFrame } else { sentence };
    }
    let digits = bytes[star + 1..].iter().take(4).take_while(|byte| byte.is_ascii_hexdigit()).count();
    let end = star + 1 + digits;
    let line_end = match (bytes.get(end), bytes.get(end + 1)) {
        (None, _) | (Some(b'\r'), None) => return Look::Incomplete,
        (Some(b'\r'), Some(b'\n')) => 2,
        (Some(b'\r' | b'\n'), _) => 1,
        // `*XX` asks for no check; only a command does, and what cannot be judged is not taken.
        (Some(b'X'), _) if digits == 0 => return Look::NoFrame,
        _ => return Look::Damaged,
    };
    let written = bytes[star + 1..end].iter().try_fold(0, |sum, &digit| {
        let value = (digit as char).to_digit(16)?;
        Some(sum << 4 | value)
    });
    let body = &bytes[1..star];
    let expected = match digits {
        2 => u32::from(xor8(body)),
        4 => u32::from(xmodem(body)),
        _ => return Look::Damaged,
    };
    if written == Some(expected) { Look::Frame(end + line_end) } else { Look::Damaged }
}

/// Judges a sentence that has not come to its `*`: incomplete as long as every byte fits one.
fn unfinished(bytes: &[u8]) -> Look {
    let fits = |(at, &byte): (usize, &u8)| match at {
        0..3 => byte == b"$VN"[at],
        3..NAME_END => byte.is_ascii_uppercase() || byte.is_ascii_digit(),
        NAME_END => byte == b',',
        _ => (b' '..=b'~').contains(&byte) && byte != b'$',
    };
    match bytes.iter().enumerate().position(|place| !fits(place)) {
        Some(at) if at <= NAME_END => Look::NoFrame,
        Some(_) => Look::Damaged,
        None if bytes.len() > LONGEST => Look::Damaged,
        None => Look::Incomplete,
    }
}

fn xor8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum ^ byte)
}

/// A sentence with its checksum and line end, as a device takes it.
pub(in crate::device) fn sentence(body: &str) -> Vec<u8> {
    format!("${body}*{:02X}\r\n", xor8(body.as_bytes())).into_bytes()
}

/// The bodies (between `$` and `*`) of all good sentences in `bytes`, whatever stands between them.
pub(in crate::device) fn bodies(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let starts = bytes.iter().enumerate().filter(|(_, byte)| **byte == b'$');
    starts.filter_map(|(at, _)| match look(&bytes[at..]) {
        Look::Frame(length) => Some(body(&bytes[at..at + length])),
        _ => None,
    })
}

/// Whether a good sentence stands anywhere in `bytes`.
pub(in crate::device) fn has_sentence(bytes: &[u8]) -> bool {
    bodies(bytes).next().is_some()
}

/// What stands between `$` and `*` of a good sentence.
pub(super) fn body(sentence: &[u8]) -> &[u8] {
    let star = sentence.iter().position(|&byte| byte == b'*').unwrap_or(sentence.len());
    sentence.get(1..star).unwrap_or_default()
}

/// The code of a `VNERR` body; `None` for any other body.
///
/// The codes are printed with two digits. Taken as hexadecimal, and as decimal where that is no code: no two codes
/// look alike.
pub(in crate::device) fn error_code(body: &[u8]) -> Option<u8> {
    let digits = std::str::from_utf8(body.strip_prefix(b"VNERR,")?).ok()?;
    let known = |code: &u8| error_meaning(*code).is_some();
    let hexadecimal = u8::from_str_radix(digits, 16).ok().filter(known);
    hexadecimal.or_else(|| digits.parse().ok().filter(known)).or(Some(0))
}

/// What a code of `VNERR` means; `None` for one that is in no manual.
pub(in crate::device) fn error_meaning(code: u8) -> Option<&'static str> {
    Some(match code {
        1 => "hard fault",
        2 => "serial buffer overflow: it is written to faster than it reads",
        3 => "a command had a wrong checksum",
        4 => "it does not know a command",
        5 => "a command had too few parameters",
        6 => "a command had too many parameters",
        7 => "a command had a parameter it does not take",
        8 => "it does not have a register",
        9 => "a register may not be written",
        10 => "it was restarted by its watchdog",
        11 => "output buffer overflow: more output than the line carries",
        12 => "the baud rate is too low for the output",
        255 => "so many errors that some were not reported",
        _ => return None,
    })
}

/// Fields of a sentence before its first measurement of each kind; `None` where it has no specific force.
const MEASUREMENTS: [(&[u8; 3], Option<usize>, usize); 11] = [
    (b"YMR", Some(6), 9),
    (b"QMR", Some(7), 10),
    (b"MAR", Some(3), 6),
    (b"IMU", Some(3), 6),
    (b"QAR", Some(4), 7),
    // The accelerations of these two are without gravity: no specific force.
    (b"YBA", None, 6),
    (b"YIA", None, 6),
    (b"QTR", None, 4),
    (b"GYR", None, 0),
    // Whether gravity is in the accelerations of these two is not known here.
    (b"ISL", None, 12),
    (b"ISE", None, 12),
];

/// Sentences of measurements without an angular rate.
const WITHOUT_RATE: [&[u8; 3]; 17] = [
    b"YPR", b"QTN", b"QTM", b"QTA", b"QMA", b"DCM", b"MAG", b"ACC", b"DTV", b"INS", b"INE", b"GPS", b"GPE",
    b"G2S", b"G2E", b"RTK", b"HVE",
];

/// The measurements of one sentence, sensor frame, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measured {
    /// The three letters after `VN`.
    pub(super) name: [u8; 3],
    pub(super) omega_imu: Vector3<f64>,
    pub(super) specific_force_imu: Option<Vector3<f64>>,
}

/// What a body says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Said {
    /// An angular rate, and a specific force if the sentence has one.
    Measured(Measured),
    /// A sentence of measurements with fields that are missing or do not read.
    Unreadable,
    /// The device reports an error.
    Error(u8),
    /// A sentence of measurements without an angular rate: the three letters after `VN`.
    WithoutRate([u8; 3]),
    /// Answers and everything else.
    Other,
}

/// Reads a body. Fields behind the measurements are left alone: a device may append a count or its status.
pub(super) fn read(body: &[u8]) -> Said {
    if let Some(code) = error_code(body) {
        return Said::Error(code);
    }
    let is_this = |name: &[u8; 3]| body.get(2..5) == Some(&name[..]);
    let Some(&(name, force_at, omega_at)) = MEASUREMENTS.iter().find(|(name, ..)| is_this(name)) else {
        let without_rate = WITHOUT_RATE.iter().find(|name| is_this(name));
        return without_rate.map_or(Said::Other, |name| Said::WithoutRate(**name));
    };
    let mut numbers = [None; 15];
    let fields = body.split(|&byte| byte == b',').skip(1);
    for (number, field) in numbers.iter_mut().zip(fields) {
        *number = std::str::from_utf8(field).ok().and_then(|text| text.parse().ok());
    }
    let vector = |at: usize| match numbers[at..at + 3] {
        [Some(x), Some(y), Some(z)] => Some(Vector3::new(x, y, z)),
        _ => None,
    };
    let specific_force_imu = force_at.and_then(vector);
    match vector(omega_at) {
        Some(omega_imu) if specific_force_imu.is_some() == force_at.is_some() => {
            Said::Measured(Measured { name: *name, omega_imu, specific_force_imu })
        }
        _ => Said::Unreadable,
    }
}
