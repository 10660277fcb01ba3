//! One line of a text log to one reading.

use nalgebra::Vector3;

use super::MAX_LINE;
use super::mapping::{Column, Delimiter, Field, TextMapping};
use crate::device::protocol::ImuReading;

/// Numbers of a row at most: gyro, specific force, time.
const MAX_FIELDS: usize = 7;
/// What some programs put before the first line of UTF-8.
pub(in crate::device) const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

/// What a line turned out to be.
#[derive(Clone, Copy, Debug)]
pub(super) enum Line {
    /// Blank, a comment or the header.
    Empty,
    /// A row of data that does not read.
    Bad,
    /// A row of data; the time is that of the time column, s.
    Row { time_s: Option<f64>, reading: ImuReading },
}

/// Reads lines one after the other; learns the columns from the header and the column count from the first line.
#[derive(Clone, Debug)]
pub(super) struct RowReader {
    mapping: TextMapping,
    pub(super) fields: Vec<Field>,
    pub(super) delimiter: Delimiter,
    /// Column of each field, from 0; `None` until a header with all names was read.
    pub(super) columns: Option<[usize; MAX_FIELDS]>,
    pub(super) header_pending: bool,
    /// Columns a row needs at least.
    least_columns: usize,
}

impl RowReader {
    pub(super) fn new(mapping: &TextMapping) -> Self {
        let mut reader = Self {
            fields: mapping.fields(),
            delimiter: mapping.delimiter(),
            columns: None,
            header_pending: mapping.header,
            least_columns: 0,
            mapping: mapping.clone(),
        };
        if !mapping.header {
            reader.columns = reader.find_columns(&[]);
        }
        reader
    }

    /// Reads the next line, with or without its line feed. One that is no text is bad and teaches nothing.
    pub(super) fn read(&mut self, line: &[u8]) -> Line {
        let line = line.strip_suffix(b"\n").unwrap_or(line);
        if line.len() > MAX_LINE || !is_text(line) {
            return Line::Bad;
        }
        let line = line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(line);
        if self.is_empty(line) {
            return Line::Empty;
        }
        if self.header_pending {
            self.columns = self.find_columns(line);
            // A title or the like: the header comes after it.
            if self.columns.is_none() {
                return Line::Bad;
            }
            self.header_pending = false;
            self.least_columns = split(line, self.delimiter).count();
            return Line::Empty;
        }
        self.read_row(line).unwrap_or(Line::Bad)
    }

    fn read_row(&mut self, line: &[u8]) -> Option<Line> {
        let (values, count) = self.numbers(line)?;
        // A row cut short still has numbers in the mapped columns if those stand in front.
        if count < self.least_columns || self.mapping.column_count.is_some_and(|expected| count != expected) {
            return None;
        }
        if self.least_columns == 0 {
            self.least_columns = count;
        }
        let clipped = self.fields.iter().zip(values).any(|(field, value)| value.abs() >= field.full_scale);
        let mut si = [0.0; MAX_FIELDS];
        for ((si, value), field) in si.iter_mut().zip(values).zip(&self.fields) {
            *si = value * field.factor;
        }
        let has_specific_force = self.mapping.has_specific_force();
        let time_at = if has_specific_force { 6 } else { 3 };
        Some(Line::Row {
            time_s: (self.fields.len() > time_at).then_some(si[time_at]),
            reading: ImuReading {
                device_time: None,
                omega_imu: Vector3::new(si[0], si[1], si[2]),
                specific_force_imu: has_specific_force.then(|| Vector3::new(si[3], si[4], si[5])),
                clipped,
            },
        })
    }

    /// The mapped numbers of a row in the log's units, and how many columns it has; `None` if one is missing, no
    /// number, or not finite.
    fn numbers(&self, line: &[u8]) -> Option<([f64; MAX_FIELDS], usize)> {
        let columns = self.columns?;
        let columns = &columns[..self.fields.len()];
        let mut values = [f64::NAN; MAX_FIELDS];
        let mut count = 0;
        for (column, text) in split(line, self.delimiter).enumerate() {
            count += 1;
            for (value, _) in values.iter_mut().zip(columns).filter(|(_, wanted)| **wanted == column) {
                *value = number(text, self.delimiter)?;
            }
        }
        values[..columns.len()].iter().all(|value| value.is_finite()).then_some((values, count))
    }

    /// Whether a mapped column of this row is there and empty.
    pub(super) fn lacks_a_value(&self, line: &[u8]) -> bool {
        let Some(columns) = self.columns else { return false };
        let columns = &columns[..self.fields.len()];
        split(line, self.delimiter)
            .enumerate()
            .any(|(column, text)| text.is_empty() && columns.contains(&column))
    }

    /// Blank and comment lines.
    pub(super) fn is_empty(&self, line: &[u8]) -> bool {
        let text = line.trim_ascii();
        text.is_empty()
            || self.mapping.comment.as_ref().is_some_and(|comment| text.starts_with(comment.as_bytes()))
    }

    /// Column of each field, from 0. Names are looked up in the header line.
    pub(super) fn find_columns(&self, header: &[u8]) -> Option<[usize; MAX_FIELDS]> {
        let mut columns = [0; MAX_FIELDS];
        for (found, field) in columns.iter_mut().zip(&self.fields) {
            *found = self.find_column(field, header)?;
        }
        Some(columns)
    }

    pub(super) fn find_column(&self, field: &Field, header: &[u8]) -> Option<usize> {
        match &field.column {
            Column::Number(number) => Some(number - 1),
            Column::Name(name) => {
                split(header, self.delimiter).position(|title| title == name.trim().as_bytes())
            }
        }
    }
}

impl TextMapping {
    /// A reader of the times of this log's lines, for stamping them as they are replayed.
    pub fn line_times(&self) -> LineTimes {
        LineTimes { rows: RowReader::new(self), period_s: self.rate_hz().map(|rate| 1.0 / rate), index: 0 }
    }
}

/// Times of the lines of a log, given one after the other from the first.
#[derive(Clone, Debug)]
pub struct LineTimes {
    rows: RowReader,
    period_s: Option<f64>,
    index: u64,
}

impl LineTimes {
    /// Time of a line in seconds as the log has it (it may be negative or large); the row's index over the rate
    /// where there is no time column. `None` for blank lines, comments, the header and rows that do not read.
    pub fn time_of_line(&mut self, line: &[u8]) -> Option<f64> {
        let Line::Row { time_s, .. } = self.rows.read(line) else { return None };
        let index = self.index;
        self.index += 1;
        time_s.or_else(|| self.period_s.map(|period| index as f64 * period))
    }
}

/// Whether a line or a piece of one has no control characters but tabs and carriage returns.
pub(super) fn is_text(piece: &[u8]) -> bool {
    piece.iter().all(|byte| !byte.is_ascii_control() || matches!(byte, b'\t' | b'\r'))
}

/// Fields of a line without surrounding blanks and quotes.
pub(super) fn split(line: &[u8], delimiter: Delimiter) -> impl Iterator<Item = &[u8]> {
    let mut rest = Some(line.trim_ascii_end());
    std::iter::from_fn(move || {
        let mut text = rest?;
        if delimiter == Delimiter::Blank {
            text = text.trim_ascii_start();
        }
        let mut quoted = false;
        let end = text.iter().position(|&byte| {
            quoted ^= byte == b'"';
            !quoted
                && match delimiter {
                    Delimiter::Byte(delimiter) => byte == delimiter,
                    Delimiter::Blank => matches!(byte, b' ' | b'\t'),
                }
        });
        rest = end.map(|end| &text[end + 1..]);
        let field = text[..end.unwrap_or(text.len())].trim_ascii();
        Some(field.strip_prefix(b"\"").and_then(|inner| inner.strip_suffix(b"\"")).unwrap_or(field))
    })
}

/// Longest number with a decimal comma, bytes.
const LONGEST_NUMBER: usize = 64;

/// A finite number. Where the comma does not separate columns it may be the decimal one, as programs write that follow
/// the language of the user; separators of thousands are never read.
pub(super) fn number(text: &[u8], delimiter: Delimiter) -> Option<f64> {
    let mut with_point = [0; LONGEST_NUMBER];
    let comma = text.iter().position(|byte| *byte == b',').filter(|_| delimiter != Delimiter::Byte(b','));
    let text = match comma {
        Some(comma) if text.get(comma + 1).is_some_and(u8::is_ascii_digit) => {
            let copy = with_point.get_mut(..text.len())?;
            copy.copy_from_slice(text);
            copy[comma] = b'.';
            copy
        }
        _ => text,
    };
    std::str::from_utf8(text).ok()?.parse::<f64>().ok().filter(|value| value.is_finite())
}
