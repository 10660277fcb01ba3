//! Raw serial captures: bytes without any time.

use std::io::{self, BufRead};
use std::time::Duration;

use crate::device::bandwidth::time_on_line;
use crate::device::{Link, LinkError, Traffic};
use crate::time::HostTime;

/// Bytes per piece: small, because a piece is stamped as a whole, with the time of its last byte.
const PIECE_BYTES: usize = 64;

/// Plays raw bytes as an always busy serial line of the given baud rate would have delivered them.
#[derive(Debug)]
pub struct RawReplay<R> {
    name: String,
    reader: R,
    baud: u32,
    piece: [u8; PIECE_BYTES],
    bytes_read: u64,
}

impl<R: BufRead + Send> RawReplay<R> {
    /// Plays `reader` at `baud` bit/s, 8N1; `name` is for error texts.
    pub fn new(name: String, reader: R, baud: u32) -> Self {
        Self { name, reader, baud, piece: [0; PIECE_BYTES], bytes_read: 0 }
    }
}

impl<R: BufRead + Send> Link for RawReplay<R> {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        let filled = match self.reader.read(&mut self.piece) {
            Ok(0) => return Err(LinkError::EndOfRecording),
            Ok(filled) => filled,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => return Ok(None),
            Err(source) => return Err(LinkError::Lost { port: self.name.clone(), source }),
        };
        self.bytes_read += filled as u64;
        Ok(Some((time_on_line(self.bytes_read, self.baud), Traffic::Bytes(&self.piece[..filled]))))
    }
}
