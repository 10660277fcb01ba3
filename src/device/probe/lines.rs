//! Whether bytes are lines of text with numbers.

use std::time::Duration;

use crate::time::HostTime;

/// Fewer numbers than this are no sample of an IMU.
const FEWEST_NUMBERS: usize = 4;
/// So many lines in a row with the same count of numbers are no chance.
const CERTAIN_LINES: u64 = 3;
/// So many characters, all printable, are a reason to wait for the end of the line.
const PROMISING_CHARACTERS: u64 = 8;
/// Longest line of a sample.
const LONGEST_LINE: usize = 512;

/// Looks for lines with four or more numbers, the same count in each.
///
/// The first line counts from the first line end on: what came before it may have been cut.
#[derive(Debug, Default)]
pub(super) struct NumberLines {
    line: Vec<u8>,
    /// A line end has been seen.
    in_step: bool,
    /// Printable characters and line ends in a row.
    printable: u64,
    numbers: usize,
    /// Lines in a row with this count of numbers.
    lines: u64,
    first_at: HostTime,
    last_at: HostTime,
}

impl NumberLines {
    pub(super) fn push(&mut self, at: HostTime, bytes: &[u8]) {
        for &byte in bytes {
            match byte {
                b'\n' => self.end_line(at),
                b' '..=b'~' | b'\t' | b'\r' if self.line.len() < LONGEST_LINE => {
                    self.printable += 1;
                    self.line.push(byte);
                }
                _ => {
                    self.line.clear();
                    (self.in_step, self.printable, self.lines) = (false, 0, 0);
                }
            }
        }
    }

    fn end_line(&mut self, at: HostTime) {
        self.printable += 1;
        let numbers = numbers_in(&self.line);
        let is_empty = self.line.iter().all(u8::is_ascii_whitespace);
        self.line.clear();
        if !std::mem::replace(&mut self.in_step, true) || is_empty {
            return;
        }
        if numbers < FEWEST_NUMBERS {
            self.lines = 0;
        } else if self.lines > 0 && numbers == self.numbers {
            self.lines += 1;
        } else {
            (self.numbers, self.lines, self.first_at) = (numbers, 1, at);
        }
        self.last_at = at;
    }

    /// Numbers per line, once that is clear.
    pub(super) fn columns(&self) -> Option<usize> {
        (self.lines >= CERTAIN_LINES).then_some(self.numbers)
    }

    /// True while everything of late is printable.
    pub(super) fn is_promising(&self) -> bool {
        self.printable >= PROMISING_CHARACTERS
    }

    /// Time from the first to the last of the lines in a row.
    pub(super) fn span(&self) -> Duration {
        if self.lines > 0 { self.last_at.saturating_since(self.first_at) } else { Duration::ZERO }
    }

    /// Lines per second.
    pub(super) fn rate_hz(&self) -> Option<f64> {
        let span_s = self.span().as_secs_f64();
        (self.lines > 1 && span_s > 0.0).then(|| (self.lines - 1) as f64 / span_s)
    }
}

/// Numbers between separators, finite ones only. None in a sentence of NMEA 0183, `$...*hh`: a satellite receiver sends
/// such lines, and they hold positions.
fn numbers_in(line: &[u8]) -> usize {
    let Ok(line) = std::str::from_utf8(line) else { return 0 };
    let is_sentence =
        line.starts_with(['$', '!']) && line.trim_end().rsplit('*').next().is_some_and(|sum| sum.len() == 2);
    if is_sentence {
        return 0;
    }
    let words = line.split([',', ';', '\t', ' ', '\r']);
    words.filter(|word| word.parse::<f64>().is_ok_and(f64::is_finite)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(text: &str) -> Option<usize> {
        let mut lines = NumberLines::default();
        text.as_bytes().chunks(7).for_each(|piece| lines.push(HostTime(0), piece));
        lines.columns()
    }

    #[test]
    fn three_whole_lines_with_the_same_count_are_text() {
        assert_eq!(columns("5\n1,2,3,4\r\n1,2,3,5\r\n-1.5e0,2,3,4\r\n"), Some(4));
        assert_eq!(columns("1 2 3 4 5 6\n1 2 3 4 5 6\n1 2 3 4 5 6\n1 2 3"), None, "the first may be cut");
        assert_eq!(columns("hello\ntime\tgx\n1;2;3;4\n1;2;3;4\n\n1;2;3;4\n"), Some(4));
        assert_eq!(columns("x\n1 2 3\n1 2 3\n1 2 3\n1 2 3\n"), None, "too few numbers");
        assert_eq!(columns("x\n1 2 3 4\n1 2 3 4 5\n1 2 3 4\n1 2 3 4 5\n"), None, "not the same count");
        assert_eq!(columns("x\n1 2 3 4\n1 2 3 4\n1 2 \u{1}3 4\n1 2 3 4\n1 2 3 4\n"), None, "not printable");
        let position = "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n";
        assert_eq!(columns(&position.repeat(5)), None, "a satellite receiver");
        assert_eq!(columns("x\nnan 2 3 4\nnan 2 3 4\nnan 2 3 4\n"), None);
    }

    #[test]
    fn printable_bytes_are_promising_until_one_is_not() {
        let mut lines = NumberLines::default();
        lines.push(HostTime(0), b"1234567");
        assert!(!lines.is_promising());
        lines.push(HostTime(0), b"8");
        assert!(lines.is_promising());
        lines.push(HostTime(0), &[0xFE]);
        assert!(!lines.is_promising());
    }
}
