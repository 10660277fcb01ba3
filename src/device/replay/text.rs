//! Text logs: one line, one piece of traffic.

use std::io::BufRead;
use std::time::Duration;

use super::{LineStamper, RelativeStamps, read_line};
use crate::device::bandwidth::time_on_line;
use crate::device::{Link, LinkError, Traffic};
use crate::time::HostTime;

/// Plays a text log line by line, line ends included.
///
/// A last line without a line end gets one, so that a decoder waiting for it sees the line.
pub struct TextReplay<R> {
    name: String,
    reader: R,
    baud: u32,
    stamp_line: Option<LineStamper>,
    stamps: RelativeStamps,
    line: Vec<u8>,
    bytes_read: u64,
}

impl<R> std::fmt::Debug for TextReplay<R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TextReplay")
            .field("name", &self.name)
            .field("stamps", &self.stamps)
            .finish_non_exhaustive()
    }
}

impl<R: BufRead + Send> TextReplay<R> {
    /// Plays `reader`; `name` is for error texts. Without `stamp_line`, lines come as fast as `baud` carries them.
    pub fn new(name: String, reader: R, baud: u32, stamp_line: Option<LineStamper>) -> Self {
        let stamps = RelativeStamps::default();
        Self { name, reader, baud, stamp_line, stamps, line: Vec::new(), bytes_read: 0 }
    }
}

impl<R: BufRead + Send> Link for TextReplay<R> {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        if !read_line(&self.name, &mut self.reader, &mut self.line)? {
            return Err(LinkError::EndOfRecording);
        }
        self.bytes_read += self.line.len() as u64;
        let at_end = self.reader.fill_buf().is_ok_and(<[u8]>::is_empty);
        if at_end && self.line.last() != Some(&b'\n') {
            self.line.push(b'\n');
        }
        let at = match &mut self.stamp_line {
            Some(stamp_line) => self.stamps.at(stamp_line(&self.line)),
            None => time_on_line(self.bytes_read, self.baud),
        };
        Ok(Some((at, Traffic::Bytes(&self.line))))
    }
}
