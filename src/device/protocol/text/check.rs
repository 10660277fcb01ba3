//! Whether a log and a mapping fit: the decoder counts what it cannot read, this says why.

use super::MAX_LINE;
use super::error::TextError;
use super::mapping::TextMapping;
use super::row::{BYTE_ORDER_MARK, Line, RowReader, is_text, number, split};

impl TextMapping {
    /// Checks the beginning of a log against this mapping: a few kilobytes, at least its first rows.
    ///
    /// The decoder itself never fails; it counts. This is for saying at once that log and mapping do not fit.
    /// `log` and `mapping_file` only name the files in errors.
    ///
    /// # Errors
    /// [`TextError::Empty`] if there is no line of data, [`TextError::MissingColumn`] if no line is a header with all
    /// names or the first line is shorter than a mapped column number, [`TextError::ColumnCount`] if its length is not the one
    /// demanded.
    pub fn check_log(&self, log: &str, mapping_file: &str, start: &[u8]) -> Result<(), TextError> {
        let reader = RowReader::new(self);
        let without_mark = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start);
        let mut lines = without_mark.split(|&byte| byte == b'\n').filter(|line| !reader.is_empty(line));
        let header = lines.clone().find(|line| self.header && reader.find_columns(line).is_some());
        let first =
            header.or_else(|| lines.next()).ok_or_else(|| TextError::Empty { log: log.to_owned() })?;
        let count = split(first, reader.delimiter).count();
        for field in &reader.fields {
            if reader.find_column(field, first).is_none_or(|column| column >= count) {
                let titles =
                    split(first, reader.delimiter).map(|title| String::from_utf8_lossy(title).into_owned());
                return Err(TextError::MissingColumn {
                    log: log.to_owned(),
                    mapping: mapping_file.to_owned(),
                    key: field.key.to_owned(),
                    column: field.column.to_string(),
                    found: if self.header {
                        titles.map(|title| format!("\"{title}\"")).collect::<Vec<_>>().join(", ")
                    } else {
                        format!("{count} columns")
                    },
                });
            }
        }
        match self.column_count {
            Some(expected) if expected != count => Err(TextError::ColumnCount {
                log: log.to_owned(),
                mapping: mapping_file.to_owned(),
                found: count,
                expected,
            }),
            _ => Ok(()),
        }
    }

    /// Checks the header line alone, where the mapping asks for one; see [`TextMapping::check_log`].
    ///
    /// # Errors
    /// Those of [`TextMapping::check_log`].
    pub fn check_header(&self, log: &str, mapping_file: &str, start: &[u8]) -> Result<(), TextError> {
        if self.header { self.check_log(log, mapping_file, start) } else { Ok(()) }
    }

    /// Reads a whole log and reports its first row that does not read; returns the number of rows.
    ///
    /// Neither the last line is judged nor rows with nothing in a mapped column: a log that was cut off, or a sensor
    /// that had nothing to say, is a counted loss and not a wrong file.
    ///
    /// # Errors
    /// [`TextError::BadRow`] with line, column and what stands there.
    pub fn check_rows(&self, log: &str, bytes: &[u8]) -> Result<u64, TextError> {
        let mut reader = RowReader::new(self);
        let mut lines = bytes.trim_ascii_end().split(|&byte| byte == b'\n').enumerate().peekable();
        let mut rows = 0;
        while let Some((index, line)) = lines.next() {
            match reader.read(line) {
                Line::Empty => {}
                Line::Bad if reader.header_pending => {}
                Line::Bad if lines.peek().is_none() || reader.lacks_a_value(line) => {}
                Line::Bad => {
                    return Err(TextError::BadRow {
                        log: log.to_owned(),
                        line: index + 1,
                        what: what_is_wrong(&reader, line),
                    });
                }
                Line::Row { .. } => rows += 1,
            }
        }
        Ok(rows)
    }
}

/// Why a row does not read, in words.
fn what_is_wrong(reader: &RowReader, line: &[u8]) -> String {
    if line.len() > MAX_LINE || !is_text(line) {
        return format!("it has control characters, or more than {MAX_LINE} bytes");
    }
    let texts: Vec<&[u8]> = split(line, reader.delimiter).collect();
    let Some(columns) = reader.columns else {
        return "it stands before the header".to_owned();
    };
    for (field, &column) in reader.fields.iter().zip(&columns) {
        match texts.get(column) {
            None => return format!("column {} ({}) is missing", column + 1, field.key),
            Some(text) if number(text, reader.delimiter).is_none() => {
                let text = String::from_utf8_lossy(text);
                return format!(
                    "column {} ({}) is \"{text}\", expected a finite number",
                    column + 1,
                    field.key
                );
            }
            Some(_) => {}
        }
    }
    format!("{} columns, another number than the lines before or column_count", texts.len())
}
