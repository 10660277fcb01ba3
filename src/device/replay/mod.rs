//! Recordings of other programs as links: text logs, candump logs, telemetry logs, raw serial captures. Streamed, never
//! loaded.
//!
//! Stamps are relative to the first one in the file, never go backwards, and nothing in a file is fatal once it is
//! open: what is no traffic is counted in [`super::LinkStatus::bytes_skipped`].

use std::fmt;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use super::protocol::vectornav;
use super::{DeviceError, Link, LinkError};
use crate::time::HostTime;

mod candump;
mod raw;
mod text;
mod tlog;

pub use candump::{CandumpRecord, CandumpReplay, parse_candump_line};
pub use raw::RawReplay;
pub use text::TextReplay;
pub use tlog::TlogReplay;

/// Reads the time of one line of a text log, ns from any origin; `None` when the line carries none.
pub type LineStamper = Box<dyn FnMut(&[u8]) -> Option<u64> + Send>;

/// What a recorded file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// Lines of text, one sample each.
    Text,
    /// CAN frames as `candump` writes them to a file or to the screen.
    Candump,
    /// Bytes of a serial line, which may be sentences of a device.
    Raw,
    /// MAVLink frames of a ground station's telemetry log, each with a stamp.
    Tlog,
    /// A recording of ours, in an MCAP container. Not played here.
    Mcap,
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FileKind::Text => "text",
            FileKind::Candump => "candump",
            FileKind::Raw => "raw",
            FileKind::Tlog => "tlog",
            FileKind::Mcap => "mcap",
        })
    }
}

/// How far into a file its kind is looked for, bytes.
const PROBE_BYTES: usize = 8192;
/// First bytes of every MCAP file.
const MCAP_MAGIC: &[u8] = b"\x89MCAP";

/// Finds out what `path` holds, from its first bytes; the name counts only for `.mcap`.
///
/// # Errors
/// [`DeviceError::File`], [`DeviceError::EmptyFile`], or [`DeviceError::FileKind`] for a pipe.
pub fn detect(path: &Path) -> Result<FileKind, DeviceError> {
    Ok(kind_of(path, &start(path)?))
}

/// The first bytes of a file, at most 8 KiB.
///
/// # Errors
/// As [`detect`].
pub fn start(path: &Path) -> Result<Vec<u8>, DeviceError> {
    let mut reader = open_file(path)?;
    Ok(reader.fill_buf().map_err(|source| file_error(path, source))?.to_vec())
}

/// Opens a recording as a link. `kind` overrides what the content looks like. A raw capture is stamped by the device's
/// clock; one without, and a text log without `stamp_line`, by the time their bytes take at `baud`.
///
/// # Errors
/// Missing, unreadable or empty file, a pipe, or an MCAP recording, which has a command of its own.
pub fn open(
    path: &Path,
    kind: Option<FileKind>,
    baud: u32,
    stamp_line: Option<LineStamper>,
) -> Result<Box<dyn Link>, DeviceError> {
    let mut reader = open_file(path)?;
    let start = reader.fill_buf().map_err(|source| file_error(path, source))?;
    let kind = kind.unwrap_or_else(|| kind_of(path, start));
    let has_delta_stamps = kind == FileKind::Candump && candump::has_delta_stamps(start);
    let name = path.display().to_string();
    match kind {
        // Lines with a mapping are dated by it, whatever noise stands before the first of them.
        FileKind::Raw if stamp_line.is_some() => {
            Ok(Box::new(TextReplay::new(name, reader, baud, stamp_line)))
        }
        FileKind::Text => Ok(Box::new(TextReplay::new(name, reader, baud, stamp_line))),
        FileKind::Candump if has_delta_stamps => {
            Ok(Box::new(CandumpReplay::new(name, reader).with_delta_stamps()))
        }
        FileKind::Candump => Ok(Box::new(CandumpReplay::new(name, reader))),
        FileKind::Raw => Ok(Box::new(RawReplay::new(name, reader, baud))),
        FileKind::Tlog => Ok(Box::new(TlogReplay::new(name, reader))),
        FileKind::Mcap => Err(DeviceError::FileKind {
            path: path.to_owned(),
            kind: "a recording of otolith (MCAP), not a log of a device",
            hint: "play it with `otolith replay FILE`",
        }),
    }
}

/// Refuses a file that does not say when its samples were taken: played, it would run at a pace that is nobody's.
///
/// A text log is not judged: that is up to its mapping.
///
/// # Errors
/// As [`detect`], and [`DeviceError::FileKind`] for a candump log without stamps and a raw capture whose first samples have
/// no device time.
pub fn check_time(path: &Path, kind: Option<FileKind>) -> Result<(), DeviceError> {
    let start = start(path)?;
    let (timed, kind, hint) = match kind.unwrap_or_else(|| kind_of(path, &start)) {
        FileKind::Candump => (
            candump::is_timed(&start),
            "a candump log without times, expected one with them",
            "record it with `candump -l`, or show the times with `candump -t a`",
        ),
        FileKind::Raw => (
            raw::is_timed(&start),
            "a raw capture whose samples carry no time, expected the device's",
            "let the device send its time, or take it with `otolith run --record`, which dates what arrives",
        ),
        FileKind::Text | FileKind::Tlog | FileKind::Mcap => return Ok(()),
    };
    if timed { Ok(()) } else { Err(DeviceError::FileKind { path: path.to_owned(), kind, hint }) }
}

fn file_error(path: &Path, source: io::Error) -> DeviceError {
    DeviceError::File { path: path.to_owned(), source }
}

fn open_file(path: &Path) -> Result<BufReader<File>, DeviceError> {
    let file = File::open(path).map_err(|source| file_error(path, source))?;
    let metadata = file.metadata().map_err(|source| file_error(path, source))?;
    if metadata.is_dir() {
        return Err(file_error(path, io::ErrorKind::IsADirectory.into()));
    }
    if !metadata.is_file() {
        // It would be read more than once: to find out what it holds, and to play it.
        return Err(DeviceError::FileKind {
            path: path.to_owned(),
            kind: "a pipe or a device, expected a file",
            hint: "save it to a file first; `serial:PORT` reads a port",
        });
    }
    if metadata.len() == 0 {
        return Err(DeviceError::EmptyFile { path: path.to_owned() });
    }
    Ok(BufReader::with_capacity(PROBE_BYTES, file))
}

fn kind_of(path: &Path, start: &[u8]) -> FileKind {
    let named_mcap = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"));
    if start.starts_with(MCAP_MAGIC) || named_mcap {
        FileKind::Mcap
    } else if start.split(|byte| *byte == b'\n').any(|line| parse_candump_line(line).is_some()) {
        FileKind::Candump
    } else if is_text(start) && !vectornav::ascii::has_sentence(start) {
        FileKind::Text
    } else if tlog::is_tlog(start) {
        FileKind::Tlog
    } else {
        FileKind::Raw
    }
}

/// Share of bytes beyond ASCII in a text of an older encoding: a unit such as the degree sign here and there.
const FOREIGN_SHARE: f64 = 0.1;

/// True for text without control characters but the usual white space, in UTF-8 (a character cut at the end is fine)
/// or nearly all in ASCII.
fn is_text(start: &[u8]) -> bool {
    let is_utf8 = std::str::from_utf8(start).err().is_none_or(|error| error.error_len().is_none());
    let foreign = start.iter().filter(|byte| !byte.is_ascii()).count();
    let is_control = |byte: &u8| byte.is_ascii_control() && !matches!(byte, b'\n' | b'\r' | b'\t');
    (is_utf8 || foreign as f64 <= FOREIGN_SHARE * start.len() as f64) && !start.iter().any(is_control)
}

/// Longest line taken as one piece, bytes: a log without line ends must not fill the memory.
const MAX_LINE_BYTES: u64 = 64 * 1024;

/// Reads the next line with its end into `line`; false at the end of the file.
fn read_line(name: &str, reader: &mut impl BufRead, line: &mut Vec<u8>) -> Result<bool, LinkError> {
    line.clear();
    match reader.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', line) {
        Ok(count) => Ok(count > 0),
        Err(source) => Err(LinkError::Lost { port: name.to_owned(), source }),
    }
}

/// Whether the file ended before this line of it did.
fn is_cut(line: &[u8]) -> bool {
    !line.ends_with(b"\n") && (line.len() as u64) < MAX_LINE_BYTES
}

/// Largest step back that is taken for disorder among neighbours, ns; a larger one is a new start of the clock.
const DISORDER_NS: u64 = 1_000_000_000;

/// Turns the stamps of a file into host times: the first is zero and time never goes back.
#[derive(Debug, Default)]
struct RelativeStamps {
    /// Stamp of the file that stands for `base_at`.
    base: Option<u64>,
    base_at: u64,
    last: HostTime,
}

impl RelativeStamps {
    /// The next stamp has nothing to do with those before: it stands for the same time as the last one.
    fn restart(&mut self) {
        self.base = None;
        self.base_at = self.last.0;
    }

    /// Host time of a piece stamped `stamp_ns` in the file; of one without a stamp, that of its forerunner.
    fn at(&mut self, stamp_ns: Option<u64>) -> HostTime {
        let Some(stamp) = stamp_ns else { return self.last };
        let base = *self.base.get_or_insert(stamp);
        let at = match stamp.checked_sub(base) {
            Some(ahead) => self.base_at.saturating_add(ahead),
            None => self.base_at.saturating_sub(base - stamp),
        };
        if at.saturating_add(DISORDER_NS) < self.last.0 {
            // The logger was restarted: go on from here.
            self.restart();
            self.base = Some(stamp);
        } else {
            self.last = self.last.max(HostTime(at));
        }
        self.last
    }
}

#[cfg(test)]
mod tests;
