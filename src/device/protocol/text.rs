//! Text lines with numbers: CSV logs and sketches that print their samples, read by a [`TextMapping`]. For logs of some
//! programs there is a built-in one, found by [`known_log`].
//!
//! The format has no checksum and no counter: a row that does not read is counted in
//! [`DecodeCounters::bad_checksum`], and rows that never came cannot be seen ([`DecodeCounters::missing`] stays 0;
//! a gap in the time column shows later). A number that was cut short but is still a number cannot be seen either.

mod check;
mod error;
mod known;
mod mapping;
mod row;

pub use error::TextError;
pub use known::{KNOWN_LOGS, KnownLog, known_log};
pub use mapping::TextMapping;
pub use row::LineTimes;

pub(in crate::device) use row::BYTE_ORDER_MARK;
use row::{Line, RowReader, is_text};

use super::{DecodeCounters, DeviceTime, ImuReading, PacketDecoder};
use crate::device::Traffic;

/// Longest line that is read, bytes without its line end. A longer one is skipped.
pub const MAX_LINE: usize = 4096;

/// Decoder of text lines. Bytes may be cut anywhere; lines end with LF or CR LF.
///
/// What stands after the last line end is read as a line by [`PacketDecoder::finish`].
#[derive(Debug)]
pub struct TextDecoder {
    rows: RowReader,
    rate_hz: Option<f64>,
    wraps_after_us: Option<u64>,
    note: Option<String>,
    line: Box<[u8; MAX_LINE]>,
    length: usize,
    /// The present line is too long or has control characters, and has been counted: skip to its end.
    spoiled: bool,
    /// Added to the time column so that a log that starts before zero starts at zero, s.
    time_shift_s: Option<f64>,
    counters: DecodeCounters,
}

impl TextDecoder {
    /// A decoder for lines as `mapping` describes them.
    pub fn new(mapping: &TextMapping) -> Self {
        Self {
            rows: RowReader::new(mapping),
            rate_hz: mapping.rate_hz(),
            wraps_after_us: mapping.wraps_after_us(),
            note: mapping.note.clone(),
            line: Box::new([0; MAX_LINE]),
            length: 0,
            spoiled: false,
            time_shift_s: None,
            counters: DecodeCounters::default(),
        }
    }

    fn push_bytes(&mut self, bytes: &[u8], on_reading: &mut dyn FnMut(ImuReading)) {
        for piece in bytes.split_inclusive(|&byte| byte == b'\n') {
            let text = piece.strip_suffix(b"\n").unwrap_or(piece);
            let end = self.length + text.len();
            let overlong = end > MAX_LINE;
            // Told now and not at the end of the line: what is no text may have no line end for long.
            if !self.spoiled && (overlong || !is_text(text)) {
                self.spoiled = true;
                self.counters.bad_checksum += 1;
            }
            if self.spoiled {
                self.counters.bytes_skipped += (text.len() + self.length) as u64;
                self.length = 0;
            } else {
                self.line[self.length..end].copy_from_slice(text);
                self.length = end;
            }
            if text.len() < piece.len() {
                self.end_line(on_reading);
            }
        }
    }

    fn end_line(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        let line = &self.line[..self.length];
        self.length = 0;
        if std::mem::take(&mut self.spoiled) {
            return;
        }
        match self.rows.read(line) {
            Line::Empty => {}
            Line::Bad => self.counters.bad_checksum += 1,
            Line::Row { time_s, mut reading } => {
                if let Some(time_s) = time_s {
                    let shift_s = *self.time_shift_s.get_or_insert_with(|| (-time_s).max(0.0));
                    let micros = ((time_s + shift_s) * 1e6).round();
                    // 2^53 µs are 285 years: beyond them a double no longer counts microseconds.
                    if !(0.0..9.0e15).contains(&micros) {
                        self.counters.bad_checksum += 1;
                        return;
                    }
                    let wraps_after_us = self.wraps_after_us;
                    reading.device_time = Some(DeviceTime { micros: micros as u64, wraps_after_us });
                }
                self.counters.packets += 1;
                on_reading(reading);
            }
        }
    }
}

impl PacketDecoder for TextDecoder {
    fn protocol(&self) -> &'static str {
        "text"
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        match traffic {
            Traffic::Bytes(bytes) => self.push_bytes(bytes, on_reading),
            // A frame of another kind of link: nothing of it can be text.
            Traffic::CanFrame { .. } => self.counters.unknown += 1,
        }
    }

    fn counters(&self) -> DecodeCounters {
        self.counters
    }

    fn announced_rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    fn finish(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        if self.length > 0 {
            self.end_line(on_reading);
        }
    }

    fn notes(&self) -> Vec<String> {
        self.note.iter().cloned().collect()
    }
}

#[cfg(test)]
mod tests;
