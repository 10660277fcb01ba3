//! Raw serial captures: bytes without any time but the device's own.

use std::io::{self, BufRead};
use std::time::Duration;

use crate::device::bandwidth::time_on_line;
use crate::device::protocol::detect::{AutoDecoder, Bus};
use crate::device::protocol::{DeviceTime, PacketDecoder};
use crate::device::{Link, LinkError, Traffic};
use crate::time::HostTime;

/// Bytes per piece: small, because a piece is stamped as a whole, with the time of its last byte.
const PIECE_BYTES: usize = 64;
/// A longer step of the device's clock is no silence but a clock that was set, or a damaged frame, µs.
const LONGEST_STEP_US: i64 = 10_000_000;

/// Whether any sample in the first bytes of a capture has a device time; true where there is no sample.
pub(super) fn is_timed(start: &[u8]) -> bool {
    let (mut samples, mut dated) = (0_u64, 0_u64);
    AutoDecoder::on(&[Bus::Serial]).push(Traffic::Bytes(start), &mut |reading| {
        samples += 1;
        dated += u64::from(reading.device_time.is_some());
    });
    samples == 0 || dated > 0
}

/// Plays raw bytes at the pace of the device's clock, where a protocol that is found by itself carries one, and otherwise
/// as an always busy serial line of the given baud rate would have delivered them.
///
/// A line is never always busy, so the baud rate says nothing about when a sample was taken. Bytes without a sample have
/// the stamp of the sample before.
#[derive(Debug)]
pub struct RawReplay<R> {
    name: String,
    reader: R,
    baud: u32,
    piece: [u8; PIECE_BYTES],
    decoder: AutoDecoder,
    /// The device's clock at its last sample.
    device_time: Option<DeviceTime>,
    at: HostTime,
}

impl<R: BufRead + Send> RawReplay<R> {
    /// Plays `reader`, where it has no device time at `baud` bit/s, 8N1; `name` is for error texts.
    pub fn new(name: String, reader: R, baud: u32) -> Self {
        Self {
            name,
            reader,
            baud,
            piece: [0; PIECE_BYTES],
            decoder: AutoDecoder::on(&[Bus::Serial]),
            device_time: None,
            at: HostTime::default(),
        }
    }

    /// Time from the piece before to this one of `length` bytes.
    fn step(&mut self, length: usize) -> Duration {
        let mut newest = None;
        self.decoder.push(Traffic::Bytes(&self.piece[..length]), &mut |reading| {
            newest = reading.device_time.or(newest);
        });
        let on_line = Duration::from_nanos(time_on_line(length as u64, self.baud).0);
        let before = self.device_time;
        self.device_time = newest.or(before);
        match (before, newest) {
            (Some(_), None) => Duration::ZERO,
            (Some(before), Some(now)) => match now.micros_since(before) {
                step_us @ 0..=LONGEST_STEP_US => Duration::from_micros(step_us.unsigned_abs()),
                _ => on_line,
            },
            (None, _) => on_line,
        }
    }
}

impl<R: BufRead + Send> Link for RawReplay<R> {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        let length = match self.reader.read(&mut self.piece) {
            Ok(0) => return Err(LinkError::EndOfRecording),
            Ok(length) => length,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => return Ok(None),
            Err(source) => return Err(LinkError::Lost { port: self.name.clone(), source }),
        };
        self.at = self.at + self.step(length);
        Ok(Some((self.at, Traffic::Bytes(&self.piece[..length]))))
    }
}
