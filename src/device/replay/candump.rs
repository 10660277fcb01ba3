//! What `candump` writes, one frame per line; see [`parse_candump_line`].

use std::io::BufRead;
use std::time::Duration;

mod line;

use super::{RelativeStamps, is_cut, read_line};
use crate::device::{Link, LinkError, LinkStatus, Traffic};
use crate::time::HostTime;
pub use line::{CandumpRecord, parse_candump_line};

/// Stamps below are no time of day but begin with the log, ns: `candump -t z` and `-t d`.
const LATEST_FROM_START_NS: u64 = 1_000_000_000_000_000;

/// Whether the stamps in the first bytes of a log are the times since the frame before (`candump -t d`), not since the
/// first frame (`-t z`): those go forward nearly always.
pub(super) fn has_delta_stamps(start: &[u8]) -> bool {
    let lines = start.split(|byte| *byte == b'\n').filter_map(parse_candump_line);
    let stamps: Vec<u64> = lines.filter_map(|frame| frame.stamp_ns).collect();
    let steps = stamps.windows(2).skip(1);
    let not_ahead = steps.clone().filter(|pair| pair[1] <= pair[0]).count();
    stamps.iter().all(|stamp| *stamp < LATEST_FROM_START_NS) && 4 * not_ahead > steps.len()
}

/// Whether any frame in the first bytes of a log has a stamp; true where there is no frame.
pub(super) fn is_timed(start: &[u8]) -> bool {
    let frames = || start.split(|byte| *byte == b'\n').filter_map(parse_candump_line);
    frames().next().is_none() || frames().any(|frame| frame.stamp_ns.is_some())
}

/// Plays a candump log. Lines that are no data frame of classic CAN are skipped and their bytes counted, a last one that
/// was cut for itself; error frames are counted by what they say. A frame without a stamp has the time of the one before.
#[derive(Debug)]
pub struct CandumpReplay<R> {
    name: String,
    reader: R,
    stamps: RelativeStamps,
    /// Time of the last frame by stamps that are times since the frame before, ns; `None` where they are not.
    sum_ns: Option<u64>,
    line: Vec<u8>,
    frame: CandumpRecord,
    status: LinkStatus,
}

impl<R: BufRead + Send> CandumpReplay<R> {
    /// Plays `reader`; `name` is for error texts.
    pub fn new(name: String, reader: R) -> Self {
        Self {
            name,
            reader,
            stamps: RelativeStamps::default(),
            sum_ns: None,
            line: Vec::new(),
            frame: CandumpRecord::default(),
            status: LinkStatus::default(),
        }
    }

    /// Takes stamps as times since the frame before, as `candump -t d` writes them.
    #[must_use]
    pub fn with_delta_stamps(self) -> Self {
        Self { sum_ns: Some(0), ..self }
    }

    /// Time of a line in the replay. One that is no data frame counts as well: the next may be dated from it.
    fn at(&mut self, stamp_ns: Option<u64>) -> HostTime {
        if let (Some(sum_ns), Some(step_ns)) = (&mut self.sum_ns, stamp_ns) {
            *sum_ns = sum_ns.saturating_add(step_ns);
        }
        self.stamps.at(self.sum_ns.or(stamp_ns))
    }
}

impl<R: BufRead + Send> Link for CandumpReplay<R> {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        while read_line(&self.name, &mut self.reader, &mut self.line)? {
            match parse_candump_line(&self.line) {
                None if is_cut(&self.line) => self.status.unfinished_bytes += self.line.len() as u64,
                None => {
                    self.status.bytes_skipped += self.line.len() as u64;
                    let _at = self.at(line::stamp_of_line(&self.line));
                }
                Some(frame) if frame.error => {
                    self.status.note_error_frame(frame.id, frame.data());
                    let _at = self.at(frame.stamp_ns);
                }
                Some(frame) => {
                    self.status.note_data_frame();
                    self.frame = frame;
                    let at = self.at(frame.stamp_ns);
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
