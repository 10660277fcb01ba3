//! Telemetry logs of ground stations: 8 bytes of time (µs since the Unix epoch, big-endian) before each MAVLink frame.

use std::io::{self, Read};
use std::time::Duration;

use super::RelativeStamps;
use crate::device::protocol::mavlink::frame::{self, Judgement, Trust};
use crate::device::{Link, LinkError, LinkStatus, Traffic};
use crate::time::HostTime;

const STAMP: usize = 8;
/// What has to be seen to judge a frame: its stamp, itself, and the stamp and first byte of the next.
const WINDOW: usize = STAMP + frame::LONGEST + STAMP + 1;
/// Bytes held; more than a window, so that the file is not read byte by byte.
const BUFFER: usize = 4096;
/// A longer step from one stamp to the next is a damaged stamp or a log that was continued another day, µs. No time
/// passes in the replay then.
const LONGEST_STEP_US: u64 = 3_600_000_000;

/// Whether `start`, the first bytes of a file, are of a telemetry log: two frames with good checksums, one right after
/// the other, each after a stamp, within an hour.
pub(super) fn is_tlog(start: &[u8]) -> bool {
    let frame_at = |at: usize| {
        let held = start.get(at..)?;
        stamped_frame(held, false).map(|length| (stamp_us(held), at + STAMP + length))
    };
    (0..start.len()).filter_map(frame_at).any(|(stamp, next)| {
        frame_at(next).is_some_and(|(next_stamp, _)| next_stamp.abs_diff(stamp) <= LONGEST_STEP_US)
    })
}

fn stamp_us(held: &[u8]) -> u64 {
    held.first_chunk().map_or(0, |bytes| u64::from_be_bytes(*bytes))
}

/// Length of the good frame that stands behind the stamp at the front of `held`. A frame of a message that is known to
/// nobody here counts only if a frame follows or, where `held` goes to the end of the file, nothing.
fn stamped_frame(held: &[u8], to_end: bool) -> Option<usize> {
    match frame::judge(held.get(STAMP..)?) {
        Judgement::Frame(length, Trust::UnknownMessage) => {
            let end = STAMP + length;
            let ends_file = to_end && end == held.len();
            let goes_on = held.get(end + STAMP).is_some_and(|byte| frame::is_sync(*byte));
            (ends_file || goes_on).then_some(length)
        }
        Judgement::Frame(length, _) => Some(length),
        _ => None,
    }
}

/// Plays a telemetry log frame by frame, each with its own time; the stamps are taken out.
///
/// What stands between good frames is given out too, with the time of the frame before it, so that the decoder counts
/// what is damaged.
#[derive(Debug)]
pub struct TlogReplay<R> {
    name: String,
    reader: R,
    buffer: [u8; BUFFER],
    start: usize,
    end: usize,
    at_end: bool,
    stamps: RelativeStamps,
    last_stamp_us: Option<u64>,
    status: LinkStatus,
}

impl<R: Read + Send> TlogReplay<R> {
    /// Plays `reader`; `name` is for error texts.
    pub fn new(name: String, reader: R) -> Self {
        let stamps = RelativeStamps::default();
        Self {
            name,
            reader,
            buffer: [0; BUFFER],
            start: 0,
            end: 0,
            at_end: false,
            stamps,
            last_stamp_us: None,
            status: LinkStatus::default(),
        }
    }

    /// Reads on until a whole window is held or the file has ended.
    fn fill(&mut self) -> Result<(), LinkError> {
        if self.at_end || self.end - self.start >= WINDOW {
            return Ok(());
        }
        self.buffer.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.start = 0;
        while self.end < WINDOW && !self.at_end {
            match self.reader.read(&mut self.buffer[self.end..]) {
                Ok(count) => {
                    self.end += count;
                    self.at_end = count == 0;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(source) => return Err(LinkError::Lost { port: self.name.clone(), source }),
            }
        }
        Ok(())
    }

    /// Time in the replay of a frame with this stamp.
    fn at(&mut self, stamp_us: u64) -> HostTime {
        let step_us = self.last_stamp_us.replace(stamp_us).map_or(0, |last| last.abs_diff(stamp_us));
        if step_us > LONGEST_STEP_US {
            self.stamps.restart();
        }
        self.stamps.at(Some(stamp_us.saturating_mul(1000)))
    }

    /// Takes `length` bytes off the front and gives out all but the first `hidden` of them.
    fn piece(&mut self, hidden: usize, length: usize) -> &[u8] {
        let from = self.start + hidden;
        self.start += length;
        &self.buffer[from..self.start]
    }
}

impl<R: Read + Send> Link for TlogReplay<R> {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        self.fill()?;
        let held = &self.buffer[self.start..self.end];
        if held.len() <= STAMP {
            // The log ends with a frame, or within a stamp.
            self.status.unfinished_bytes += held.len() as u64;
            self.start = self.end;
            return Err(LinkError::EndOfRecording);
        }
        if let Some(length) = stamped_frame(held, self.at_end) {
            let at = self.at(stamp_us(held));
            return Ok(Some((at, Traffic::Bytes(self.piece(STAMP, STAMP + length)))));
        }
        // Only as far as the next good frame would be seen whole.
        let judged = if self.at_end { held.len() } else { held.len() - (WINDOW - 1) };
        let good = (1..judged).find(|&at| stamped_frame(&held[at..], self.at_end).is_some());
        let length = good.unwrap_or(judged);
        // A damaged frame has a stamp before it as every frame has.
        let stamped = length > STAMP && held.get(STAMP).is_some_and(|byte| frame::is_sync(*byte));
        let hidden = if stamped { STAMP } else { 0 };
        let at = self.stamps.at(None);
        Ok(Some((at, Traffic::Bytes(self.piece(hidden, length)))))
    }

    fn status(&self) -> LinkStatus {
        self.status
    }
}
