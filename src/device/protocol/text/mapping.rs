//! Mapping files: which column of a text log is what, in which unit.

use super::error::TextError;
use crate::device::protocol::quantity::{ForceUnit, RateUnit, TimeUnit};

/// Highest column number that may be mapped; lines hold at most 4096 bytes.
const MAX_COLUMN: usize = 1024;

/// A column by its number, from 1, or by the name in the header line.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(untagged)]
pub(super) enum Column {
    /// Position, from 1.
    Number(usize),
    /// Name, as in the header without quotes.
    Name(String),
}

impl std::fmt::Display for Column {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Name(name) => write!(f, "\"{name}\""),
        }
    }
}

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct TimeTable {
    column: Column,
    unit: TimeUnit,
    wraps_after: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct VectorTable<U> {
    columns: [Column; 3],
    unit: U,
    #[serde(default = "all_positive")]
    signs: [i8; 3],
    full_scale: Option<f64>,
}

fn all_positive() -> [i8; 3] {
    [1; 3]
}

/// How to read a text log: the parsed and checked mapping file.
///
/// ```toml
/// delimiter = ","        # or ";" "\t" "|" ":" " ", or "blank" for runs of spaces and tabs; default ","
///                        # where it is not ",", numbers may have a decimal comma
/// header = true          # a line names the columns, the first that has all names below; default false
/// comment = "#"          # lines that start so are skipped; default none
/// column_count = 7       # rows with another count are bad; default: not fewer than the first line has
/// rate_hz = 100.0        # sample rate, needed where there is no [time]
/// note = "..."           # what to know about such logs; shown by `otolith inspect`
/// [time]
/// column = "t"           # name in the header, or number from 1
/// unit = "s"             # s, ms, us, ns; 100us for counters of ten thousandths
/// wraps_after = 4294967296       # the column returns to zero after so many units; default never
/// [gyro]
/// columns = ["gx", "gy", "gz"]   # sensor axes x, y, z
/// unit = "deg/s"                 # deg/s, rad/s
/// signs = [1, 1, -1]             # default 1, 1, 1
/// full_scale = 2000.0            # same unit; readings at or beyond it count as clipped; default none
/// [specific_force]               # may be missing; +1 g on the upward axis at rest
/// columns = [5, 6, 7]
/// unit = "g"                     # m/s^2, g, mg
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextMapping {
    #[serde(default = "comma")]
    delimiter: String,
    #[serde(default)]
    pub(super) header: bool,
    pub(super) comment: Option<String>,
    pub(super) column_count: Option<usize>,
    rate_hz: Option<f64>,
    pub(super) note: Option<String>,
    time: Option<TimeTable>,
    gyro: VectorTable<RateUnit>,
    specific_force: Option<VectorTable<ForceUnit>>,
}

fn comma() -> String {
    ",".to_owned()
}

/// What stands between two fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Delimiter {
    Byte(u8),
    /// Any run of spaces and tabs.
    Blank,
}

/// One number to read: where it stands and what to multiply it with.
#[derive(Clone, Debug)]
pub(super) struct Field {
    /// The key of the mapping, for errors.
    pub(super) key: &'static str,
    pub(super) column: Column,
    /// Factor to SI, with the sign.
    pub(super) factor: f64,
    /// Absolute value in the log's unit from which on the sensor is clipped.
    pub(super) full_scale: f64,
}

impl TextMapping {
    /// Reads a mapping from TOML text; `file` only names it in errors.
    ///
    /// # Errors
    /// [`TextError::Toml`] for broken text, unknown keys and units, [`TextError::Value`] for values that cannot be:
    /// column numbers below 1, names without a header, signs other than 1 and -1, neither time nor rate.
    pub fn from_toml(file: &str, text: &str) -> Result<Self, TextError> {
        let mapping: Self = toml::from_str(text)
            .map_err(|source| TextError::Toml { file: file.to_owned(), source: Box::new(source) })?;
        mapping.check(file)?;
        Ok(mapping)
    }

    /// Nominal sample rate, Hz, where the mapping gives one.
    pub fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// Period of the time column, µs, where it wraps.
    pub(super) fn wraps_after_us(&self) -> Option<u64> {
        let time = self.time.as_ref()?;
        time.wraps_after.map(|wrap| (wrap * time.unit.seconds() * 1e6).round().max(1.0) as u64)
    }

    fn check(&self, file: &str) -> Result<(), TextError> {
        let value = |key: &str, got: String, allowed: &'static str| {
            Err(TextError::Value { file: file.to_owned(), key: key.to_owned(), got, allowed })
        };
        if !matches!(self.delimiter.as_str(), "," | ";" | "\t" | "|" | ":" | " " | "blank") {
            let allowed = r#"",", ";", "\t", "|", ":", " " or "blank" (runs of spaces and tabs)"#;
            return value("delimiter", format!("{:?}", self.delimiter), allowed);
        }
        if self.comment.as_ref().is_some_and(String::is_empty) {
            return value("comment", "\"\"".to_owned(), "the characters that start a comment line");
        }
        match self.rate_hz {
            Some(rate) if !(0.1..=20_000.0).contains(&rate) => {
                return value("rate_hz", rate.to_string(), "0.1 to 20000 Hz");
            }
            None if self.time.is_none() => {
                return value(
                    "rate_hz",
                    "missing".to_owned(),
                    "a rate, or a [time] table with column and unit",
                );
            }
            _ => {}
        }
        for field in self.fields() {
            match &field.column {
                Column::Number(number) if !(1..=MAX_COLUMN).contains(number) => {
                    return value(field.key, number.to_string(), "1 to 1024: columns are counted from 1");
                }
                Column::Number(number) if self.column_count.is_some_and(|count| *number > count) => {
                    return value(field.key, number.to_string(), "at most column_count");
                }
                Column::Name(_) if !self.header => {
                    return value(field.key, field.column.to_string(), "a number from 1, or header = true");
                }
                _ => {}
            }
            if field.full_scale.is_nan() || field.full_scale <= 0.0 {
                return value(field.key, field.full_scale.to_string(), "a full_scale above 0");
            }
        }
        if let Some(wrap) =
            self.time.as_ref().and_then(|time| time.wraps_after).filter(|wrap| wrap.is_nan() || *wrap <= 0.0)
        {
            return value("time.wraps_after", wrap.to_string(), "a number of time units above 0");
        }
        let signs = self.gyro.signs.iter().chain(self.specific_force.iter().flat_map(|force| &force.signs));
        match signs.into_iter().find(|sign| !matches!(sign, 1 | -1)) {
            Some(sign) => value("signs", sign.to_string(), "1 or -1 for each axis"),
            None => Ok(()),
        }
    }

    pub(super) fn delimiter(&self) -> Delimiter {
        match self.delimiter.as_bytes() {
            [byte] => Delimiter::Byte(*byte),
            _ => Delimiter::Blank,
        }
    }

    /// The numbers of a row: gyro x y z, then specific force x y z, then time; the last four may be missing.
    pub(super) fn fields(&self) -> Vec<Field> {
        let mut fields = vector_fields("gyro.columns", &self.gyro, self.gyro.unit.radians_per_second());
        if let Some(force) = &self.specific_force {
            fields.extend(vector_fields(
                "specific_force.columns",
                force,
                force.unit.metres_per_second_squared(),
            ));
        }
        if let Some(time) = &self.time {
            let (column, factor) = (time.column.clone(), time.unit.seconds());
            fields.push(Field { key: "time.column", column, factor, full_scale: f64::INFINITY });
        }
        fields
    }

    pub(super) fn has_specific_force(&self) -> bool {
        self.specific_force.is_some()
    }
}

fn vector_fields<U>(key: &'static str, table: &VectorTable<U>, factor: f64) -> Vec<Field> {
    let full_scale = table.full_scale.unwrap_or(f64::INFINITY);
    table
        .columns
        .iter()
        .zip(table.signs)
        .map(|(column, sign)| Field {
            key,
            column: column.clone(),
            factor: factor * f64::from(sign),
            full_scale,
        })
        .collect()
}
