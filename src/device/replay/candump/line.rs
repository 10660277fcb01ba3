//! One line of `candump`, in the layout of its log files or of its screen.

use crate::device::protocol::text::BYTE_ORDER_MARK;

/// One data frame or error frame of a candump log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CandumpRecord {
    /// Stamp, ns: since the Unix epoch, the first frame or the frame before, as `candump` was told; `None` without.
    pub stamp_ns: Option<u64>,
    /// Identifier without flag bits.
    pub id: u32,
    /// True for a 29-bit identifier.
    pub extended: bool,
    /// True for an error frame of the controller instead of a frame of the bus.
    pub error: bool,
    data: [u8; 8],
    length: usize,
}

impl CandumpRecord {
    /// Payload, at most 8 bytes.
    pub fn data(&self) -> &[u8] {
        &self.data[..self.length]
    }
}

/// Flag of an error frame in the identifier field of a log (`CAN_ERR_FLAG`).
const ERROR_FLAG: u32 = 0x2000_0000;

/// Reads one line that `candump` wrote, with or without its end:
///
/// | made by | line |
/// |---|---|
/// | `-l`, `-L` | `(1616161616.123456) can0 3A0#000000005C0F6400`; with `-x` followed by `R` or `T` |
/// | no option | `  can0  3A0   [8]  00 00 00 00 5C 0F 64 00` |
/// | `-t a`, `-t z`, `-t d` | ` (1616161616.123456)  can0  3A0   [8]  00 ..` (z: since the first frame, d: since the last) |
/// | `-t A` | ` (2021-03-19 18:13:36.123456)  can0  3A0   [8]  00 ..` |
/// | `-x` | ` .. can0  RX - -  3A0   [8]  00 ..` |
/// | `-a` | ` .. [8]  00 00 00 00 5C 0F 64 00   '....\\.d.'` |
///
/// Three identifier digits mean 11 bit, eight mean 29 bit. `None` for anything else: damaged lines, remote frames
/// (they carry no data) and CAN FD. The stamp may have 1 to 9 decimals.
///
/// Written here because the parser of `socketcan` exists on Linux only and stops at the first bad line.
pub fn parse_candump_line(line: &[u8]) -> Option<CandumpRecord> {
    let (stamp_ns, rest) = cut_stamp(line)?;
    let mut fields = rest.split_ascii_whitespace();
    let _interface = fields.next()?;
    let first = fields.next()?;
    let frame = match first.split_once('#') {
        // Logs have a stamp in every line: without one it is something else with a `#` in it.
        Some((id, payload)) => stamp_ns.and_then(|_| log_frame(id, payload, fields)),
        None => screen_frame(first, fields),
    };
    frame.map(|frame| CandumpRecord { stamp_ns, ..frame })
}

/// The stamp of a line, ns, whatever stands behind it; see [`CandumpRecord::stamp_ns`].
pub(super) fn stamp_of_line(line: &[u8]) -> Option<u64> {
    cut_stamp(line)?.0
}

/// The stamp of a line, where there is one, and what stands behind it.
fn cut_stamp(line: &[u8]) -> Option<(Option<u64>, &str)> {
    let text = std::str::from_utf8(line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(line)).ok()?;
    match text.trim_ascii_start().strip_prefix('(') {
        Some(stamped) => {
            let (stamp, rest) = stamped.split_once(')')?;
            Some((Some(stamp_ns(stamp)?), rest.strip_prefix([' ', '\t'])?))
        }
        None => Some((None, text)),
    }
}

fn log_frame<'a>(
    id: &str,
    payload: &str,
    mut behind: impl Iterator<Item = &'a str>,
) -> Option<CandumpRecord> {
    if !payload.is_ascii()
        || !payload.len().is_multiple_of(2)
        || !matches!(behind.next(), None | Some("R" | "T"))
    {
        return None;
    }
    let digits = (0..payload.len()).step_by(2).map(|at| &payload[at..at + 2]);
    CandumpRecord::default().with_id(id)?.with_data(digits)
}

fn screen_frame<'a>(first: &'a str, mut fields: impl Iterator<Item = &'a str>) -> Option<CandumpRecord> {
    let id = match first {
        // Direction, bit rate switch, error state.
        "RX" | "TX" => fields.nth(2)?,
        id => id,
    };
    let length = fields.next()?.strip_prefix('[')?.strip_suffix(']')?;
    let [length @ b'0'..=b'8'] = length.as_bytes() else { return None };
    let length = usize::from(length - b'0');
    let frame = CandumpRecord::default().with_id(id)?.with_data(fields.by_ref().take(length))?;
    let is_end = |behind: &str| behind.starts_with('\'') || behind == "ERRORFRAME";
    (frame.length == length && fields.next().is_none_or(is_end)).then_some(frame)
}

impl CandumpRecord {
    fn with_id(self, digits: &str) -> Option<Self> {
        let (word, extended) = (hex(digits)?, digits.len() == 8);
        let fits = match digits.len() {
            3 => word <= 0x7FF,
            8 => word < 2 * ERROR_FLAG,
            _ => false,
        };
        let error = extended && word & ERROR_FLAG != 0;
        let id = if error { word & !ERROR_FLAG } else { word };
        fits.then_some(Self { id, extended, error, ..self })
    }

    fn with_data<'a>(mut self, bytes: impl Iterator<Item = &'a str>) -> Option<Self> {
        for digits in bytes {
            let byte = u8::try_from(hex(digits)?).ok().filter(|_| digits.len() == 2)?;
            *self.data.get_mut(self.length)? = byte;
            self.length += 1;
        }
        Some(self)
    }
}

/// Hexadecimal digits only: `from_str_radix` alone would also take a sign.
fn hex(digits: &str) -> Option<u32> {
    let all_hex = digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    u32::from_str_radix(digits, 16).ok().filter(|_| all_hex)
}

fn stamp_ns(stamp: &str) -> Option<u64> {
    let (seconds, decimals) = stamp.split_once('.')?;
    if !(1..=9).contains(&decimals.len()) || !decimals.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let scale = 10u64.pow(9 - decimals.len() as u32);
    let seconds = if seconds.contains(':') { date_s(seconds)? } else { seconds.parse().ok()? };
    seconds.checked_mul(1_000_000_000)?.checked_add(decimals.parse::<u64>().ok()? * scale)
}

/// Seconds from 1970 to a date and time of an unknown zone.
fn date_s(date: &str) -> Option<u64> {
    let epoch = jiff::civil::date(1970, 1, 1).at(0, 0, 0, 0);
    let date: jiff::civil::DateTime = date.parse().ok()?;
    u64::try_from(date.duration_since(epoch).as_secs()).ok()
}
