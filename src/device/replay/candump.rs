//! candump logs: `(1616161616.123456) can0 3A0#000000005C0F6400`, one frame per line.

use std::io::BufRead;
use std::time::Duration;

use super::{RelativeStamps, is_cut, read_line};
use crate::device::{Link, LinkError, LinkStatus, Traffic};
use crate::time::HostTime;

/// One data frame or error frame of a candump log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CandumpRecord {
    /// Stamp, ns since the Unix epoch.
    pub stamp_ns: u64,
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

/// Reads one line of a log of `candump -l` or `-L`, with or without its end.
///
/// Three identifier digits mean 11 bit, eight mean 29 bit. `None` for anything else: damaged lines, remote frames
/// (they carry no data) and CAN FD. The stamp may have 1 to 9 decimals. A direction mark after the frame is allowed.
///
/// Written here because the parser of `socketcan` exists on Linux only and stops at the first bad line.
pub fn parse_candump_line(line: &[u8]) -> Option<CandumpRecord> {
    let mut fields = std::str::from_utf8(line).ok()?.split_ascii_whitespace();
    let stamp = fields.next()?.strip_prefix('(')?.strip_suffix(')')?;
    let _interface = fields.next()?;
    let (id, payload) = fields.next()?.split_once('#')?;
    if !matches!(fields.next(), None | Some("R" | "T")) {
        return None;
    }
    let (word, extended) = (hex(id)?, id.len() == 8);
    let id_fits = match id.len() {
        3 => word <= 0x7FF,
        8 => word < 2 * ERROR_FLAG,
        _ => false,
    };
    if !id_fits || payload.len() > 16 || payload.len() % 2 != 0 {
        return None;
    }
    let mut data = [0; 8];
    for (byte, digits) in data.iter_mut().zip(payload.as_bytes().chunks(2)) {
        *byte = u8::try_from(hex(std::str::from_utf8(digits).ok()?)?).ok()?;
    }
    let error = extended && word & ERROR_FLAG != 0;
    let id = if error { word & !ERROR_FLAG } else { word };
    Some(CandumpRecord { stamp_ns: stamp_ns(stamp)?, id, extended, error, data, length: payload.len() / 2 })
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
    seconds
        .parse::<u64>()
        .ok()?
        .checked_mul(1_000_000_000)?
        .checked_add(decimals.parse::<u64>().ok()? * scale)
}

/// Plays a candump log. Lines that are no frame are skipped and their bytes counted, a last one that was cut for itself;
/// error frames are counted by what they say.
#[derive(Debug)]
pub struct CandumpReplay<R> {
    name: String,
    reader: R,
    stamps: RelativeStamps,
    line: Vec<u8>,
    frame: CandumpRecord,
    status: LinkStatus,
}

impl<R: BufRead + Send> CandumpReplay<R> {
    /// Plays `reader`; `name` is for error texts.
    pub fn new(name: String, reader: R) -> Self {
        let frame =
            CandumpRecord { stamp_ns: 0, id: 0, extended: false, error: false, data: [0; 8], length: 0 };
        let (stamps, status) = (RelativeStamps::default(), LinkStatus::default());
        Self { name, reader, stamps, line: Vec::new(), frame, status }
    }
}

impl<R: BufRead + Send> Link for CandumpReplay<R> {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        while read_line(&self.name, &mut self.reader, &mut self.line)? {
            match parse_candump_line(&self.line) {
                None if is_cut(&self.line) => self.status.unfinished_bytes += self.line.len() as u64,
                None => self.status.bytes_skipped += self.line.len() as u64,
                Some(frame) if frame.error => self.status.note_error_frame(frame.id, frame.data()),
                Some(frame) => {
                    self.status.note_data_frame();
                    self.frame = frame;
                    let at = self.stamps.at(Some(frame.stamp_ns));
                    let CandumpRecord { id, extended, .. } = frame;
                    return Ok(Some((at, Traffic::CanFrame { id, extended, data: self.frame.data() })));
                }
            }
        }
        Err(LinkError::EndOfRecording)
    }

    fn status(&self) -> LinkStatus {
        self.status
    }
}
