//! The two tables of `otolith perceive`.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use csv::StringRecord;
use nalgebra::Vector3;
use serde::Serialize;

use super::PerceiveError;
use crate::units::DEG_PER_RAD;
use crate::vestibular::{HeadMotion, HeadMotionRow, PerceptRow};

/// Columns of head motion: time, angular velocity, specific force a - g; head axes.
pub(super) const COLUMNS: [&str; 7] = [
    "t_s",
    "omega_x_rad_s",
    "omega_y_rad_s",
    "omega_z_rad_s",
    "specific_force_x_m_s2",
    "specific_force_y_m_s2",
    "specific_force_z_m_s2",
];

/// Largest angular velocity or specific force taken, rad/s or m/s²: no sensor has it, and far below where f64 overflows.
const LARGEST_MOTION: f64 = 1e6;
/// Longest time between two rows, s. A table in milli- or microseconds has none shorter.
const LONGEST_GAP_S: f64 = 600.0;

/// Reads head motion row by row; stops after the first error.
pub(super) struct HeadMotionReader {
    path: PathBuf,
    records: csv::StringRecordsIntoIter<File>,
    /// Where each of `COLUMNS` stands in a record.
    places: [usize; COLUMNS.len()],
    last_t_s: Option<f64>,
    failed: bool,
}

impl HeadMotionReader {
    /// Opens `path` and finds the columns in its header.
    pub(super) fn open(path: &Path) -> Result<Self, PerceiveError> {
        let open_error = |source| PerceiveError::Open { path: path.to_path_buf(), source };
        let file = File::open(path).map_err(open_error)?;
        if file.metadata().map_err(open_error)?.is_dir() {
            return Err(open_error(io::ErrorKind::IsADirectory.into()));
        }
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(file);
        let header = reader.headers().map_err(|source| read_error(path, source))?.clone();
        if header.is_empty() {
            return Err(PerceiveError::NoRows { path: path.to_path_buf() });
        }
        let line = header.position().map_or(1, csv::Position::line);
        let mut places = [0; COLUMNS.len()];
        for (place, column) in places.iter_mut().zip(COLUMNS) {
            *place = place_of(column, &header, path, line)?;
        }
        let records = reader.into_records();
        Ok(Self { path: path.to_path_buf(), records, places, last_t_s: None, failed: false })
    }

    fn row(&mut self, record: Result<StringRecord, csv::Error>) -> Result<HeadMotionRow, PerceiveError> {
        let record = record.map_err(|source| read_error(&self.path, source))?;
        let line = record.position().map_or(0, csv::Position::line);
        let mut values = [0.0; COLUMNS.len()];
        for ((value, place), column) in values.iter_mut().zip(self.places).zip(COLUMNS) {
            let got = record.get(place).unwrap_or_default();
            let largest = if column == COLUMNS[0] { f64::MAX } else { LARGEST_MOTION };
            *value = got.parse().ok().filter(|number: &f64| number.abs() <= largest).ok_or_else(|| {
                PerceiveError::BadValue { path: self.path.clone(), line, column, got: got.to_owned() }
            })?;
        }
        let [t_s, omega_x, omega_y, omega_z, force_x, force_y, force_z] = values;
        self.check_time(t_s, line)?;
        let motion = HeadMotion {
            omega_head: Vector3::new(omega_x, omega_y, omega_z),
            gif_head: -Vector3::new(force_x, force_y, force_z),
        };
        Ok(HeadMotionRow { t_s, motion })
    }

    fn check_time(&mut self, t_s: f64, line: u64) -> Result<(), PerceiveError> {
        let Some(before) = self.last_t_s.replace(t_s) else { return Ok(()) };
        let (path, gap) = (self.path.clone(), t_s - before);
        if gap <= 0.0 {
            return Err(PerceiveError::TimeNotIncreasing { path, line, got: t_s, before });
        }
        if gap > LONGEST_GAP_S {
            return Err(PerceiveError::GapTooLong { path, line, got: t_s, gap, limit: LONGEST_GAP_S });
        }
        Ok(())
    }
}

impl Iterator for HeadMotionReader {
    type Item = Result<HeadMotionRow, PerceiveError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let record = self.records.next()?;
        let row = self.row(record);
        self.failed = row.is_err();
        Some(row)
    }
}

fn place_of(
    column: &'static str,
    header: &StringRecord,
    path: &Path,
    line: u64,
) -> Result<usize, PerceiveError> {
    let mut places = header.iter().enumerate().filter(|(_, name)| *name == column).map(|(place, _)| place);
    let place = places.next().ok_or_else(|| PerceiveError::MissingColumn {
        path: path.to_path_buf(),
        line,
        column,
        found: header.iter().collect::<Vec<_>>().join(","),
    })?;
    match places.next() {
        None => Ok(place),
        Some(_) => Err(PerceiveError::RepeatedColumn { path: path.to_path_buf(), line, column }),
    }
}

fn read_error(path: &Path, source: csv::Error) -> PerceiveError {
    let line = source.position().map_or(1, csv::Position::line);
    PerceiveError::Read { path: path.to_path_buf(), line, source }
}

/// One row of the output; the fields' names are its header.
#[derive(Serialize)]
pub(super) struct PerceptRecord {
    t_s: f64,
    omega_hat_x_rad_s: f64,
    omega_hat_y_rad_s: f64,
    omega_hat_z_rad_s: f64,
    gravity_hat_x_m_s2: f64,
    gravity_hat_y_m_s2: f64,
    gravity_hat_z_m_s2: f64,
    acceleration_hat_x_m_s2: f64,
    acceleration_hat_y_m_s2: f64,
    acceleration_hat_z_m_s2: f64,
    gravity_tilt_deg: f64,
}

impl From<&PerceptRow> for PerceptRecord {
    fn from(row: &PerceptRow) -> Self {
        let believed = &row.perception;
        Self {
            t_s: row.t_s,
            omega_hat_x_rad_s: believed.omega_head.x,
            omega_hat_y_rad_s: believed.omega_head.y,
            omega_hat_z_rad_s: believed.omega_head.z,
            gravity_hat_x_m_s2: believed.gravity_head.x,
            gravity_hat_y_m_s2: believed.gravity_head.y,
            gravity_hat_z_m_s2: believed.gravity_head.z,
            acceleration_hat_x_m_s2: believed.accel_head.x,
            acceleration_hat_y_m_s2: believed.accel_head.y,
            acceleration_hat_z_m_s2: believed.accel_head.z,
            gravity_tilt_deg: row.gravity_tilt * DEG_PER_RAD,
        }
    }
}
