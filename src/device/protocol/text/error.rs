//! What can be wrong with a mapping file, or between it and a log.

/// A mapping or a log that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TextError {
    /// The mapping is not TOML, or has an unknown key, unit or a wrong type.
    #[error(
        "{file}: {source}\nhint: a mapping has delimiter, header, comment, column_count, rate_hz, note and the tables \
         [time], [gyro] and [specific_force]; see configs/logs/"
    )]
    Toml {
        /// Name of the mapping file as the user gave it.
        file: String,
        /// What the TOML reader said, with line and column.
        source: Box<toml::de::Error>,
    },
    /// A value of the mapping that cannot be.
    #[error(
        "{file}: {key} is {got}, allowed is {allowed}\n\nhint: see the example mappings in configs/logs/"
    )]
    Value {
        /// Name of the mapping file as the user gave it.
        file: String,
        /// The key, dotted.
        key: String,
        /// The value as read.
        got: String,
        /// What may stand there.
        allowed: &'static str,
    },
    /// A mapped column is not in the log.
    #[error("{log}: no column {column} for {key}, found are {found}\n\nhint: correct {key} in {mapping}")]
    MissingColumn {
        /// Name of the log.
        log: String,
        /// Name of the mapping file.
        mapping: String,
        /// The key that names the column.
        key: String,
        /// The column asked for.
        column: String,
        /// What the log has.
        found: String,
    },
    /// The first line has not the number of columns that the mapping demands.
    #[error(
        "{log}: the first line has {found} columns, expected {expected}\n\nhint: correct column_count in {mapping}"
    )]
    ColumnCount {
        /// Name of the log.
        log: String,
        /// Name of the mapping file.
        mapping: String,
        /// Columns of the first line.
        found: usize,
        /// Columns that the mapping demands.
        expected: usize,
    },
    /// A row that does not read.
    #[error(
        "{log}, line {line}: {what}\n\nhint: correct or delete the line; a live device's bad rows are only counted"
    )]
    BadRow {
        /// Name of the log.
        log: String,
        /// Number of the line, from 1.
        line: usize,
        /// Column, what stands there and what was expected.
        what: String,
    },
    /// A log of a known program that cannot be read without more being known, or not at all.
    #[error("{log}: {what}\n\nhint: {hint}")]
    Unusable {
        /// Name of the log.
        log: String,
        /// What it is and what it lacks.
        what: &'static str,
        /// What to do.
        hint: &'static str,
    },
    /// The log has no line but blank ones and comments.
    #[error("{log}: no line with data\n\nhint: the file is empty or holds only comments")]
    Empty {
        /// Name of the log.
        log: String,
    },
}
