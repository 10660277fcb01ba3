//! The file of a commanded profile.

use std::fmt::Display;
use std::path::Path;

use csv::{ReaderBuilder, StringRecord, Trim};

use crate::chair::{CommandedProfile, ProfileError};
use crate::cli::failure::Failure;

/// Names of the column of the rate, with their factors to deg/s.
const RATES: [(&str, f64); 2] = [("rate_deg_s", 1.0), ("rate_rpm", 6.0)];
const HINT: &str =
    "the columns are time_s and rate_deg_s (or rate_rpm); two rows of the same time make a step";

/// Reads the profile; `start_s` is the log's time of its zero, if that was given.
pub(super) fn read(path: &Path, start_s: Option<f64>) -> Result<CommandedProfile, Failure> {
    let fail = |what: &dyn Display| Failure::usage(format!("{}: {what}\n\nhint: {HINT}", path.display()));
    if let Some(got) = start_s.filter(|start_s| !start_s.is_finite()) {
        return Err(fail(&format!("--commanded-start-s is {got}, expected a finite number of seconds")));
    }
    let mut reader = ReaderBuilder::new().trim(Trim::All).from_path(path).map_err(|error| fail(&error))?;
    let header = reader.headers().map_err(|error| fail(&error))?.clone();
    let column = |name: &str| header.iter().position(|title| title == name);
    let rate = RATES.iter().find_map(|(name, factor)| Some((column(name)?, *name, *factor)));
    let (Some(time), Some((rate, rate_name, factor))) = (column("time_s"), rate) else {
        let got: Vec<&str> = header.iter().collect();
        return Err(fail(&format!("expected columns time_s and rate_deg_s, got {}", got.join(", "))));
    };
    let (mut points, mut lines) = (Vec::new(), Vec::new());
    for record in reader.records() {
        let record = record.map_err(|error| fail(&error))?;
        let line = record.position().map_or(0, csv::Position::line);
        let number = |column: usize, name: &str, record: &StringRecord| {
            let text = record.get(column).unwrap_or_default();
            let value = text.parse::<f64>();
            value.map_err(|_| fail(&format!("line {line}: {name} is {text:?}, expected a number")))
        };
        points.push((number(time, "time_s", &record)?, factor * number(rate, rate_name, &record)?));
        lines.push(line);
    }
    CommandedProfile::new(points, start_s).map_err(|error| match error {
        ProfileError::GoesBack(row) | ProfileError::NotFinite(row) => {
            fail(&format!("line {}: {error}", lines[row]))
        }
        ProfileError::NoPlateau | ProfileError::TooLong(_) => fail(&error),
    })
}
