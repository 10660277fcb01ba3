//! What can be wrong with a call of `otolith perceive`.

use std::io;
use std::path::PathBuf;

use super::table::COLUMNS;
use crate::vestibular::{PRESET_NAMES, ParameterError};

/// Why there is no percept file. The text says what, where, got and expected; after a blank line, what to do.
#[derive(Debug, thiserror::Error)]
pub enum PerceiveError {
    /// No preset of that name.
    #[error(
        "unknown observer preset `{name}`, expected one of {}\n\n\
         hint: `seed` is the default",
        PRESET_NAMES.join(", ")
    )]
    UnknownPreset {
        /// The name asked for.
        name: String,
    },
    /// The preset's parameters cannot be run.
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    /// It was told to stop.
    #[error("stopped before the end; {path} was not written\n\nhint: run it again", path = path.display())]
    Interrupted {
        /// The output.
        path: PathBuf,
    },
    /// The input cannot be opened.
    #[error(
        "cannot open {path}: {source}\n\n\
         hint: check the path and that you may read the file",
        path = path.display()
    )]
    Open {
        /// The input.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The input stopped being readable, or is no CSV.
    #[error(
        "{path}:{line}: cannot read this row: {source}\n\n\
         hint: expected a comma separated table in UTF-8",
        path = path.display()
    )]
    Read {
        /// The input.
        path: PathBuf,
        /// Line in the file, from 1.
        line: u64,
        /// Why not.
        source: csv::Error,
    },
    /// Nothing in the file but perhaps a header.
    #[error(
        "{path} holds no rows of head motion\n\n\
         hint: expected a header and one row per sample: {columns}",
        path = path.display(),
        columns = COLUMNS.join(",")
    )]
    NoRows {
        /// The input.
        path: PathBuf,
    },
    /// A column is not there.
    #[error(
        "{path}:{line}: column `{column}` is missing, the header has: {found}\n\n\
         hint: all of these are needed, in any order: {columns}",
        path = path.display(),
        columns = COLUMNS.join(",")
    )]
    MissingColumn {
        /// The input.
        path: PathBuf,
        /// Line of the header.
        line: u64,
        /// The missing column.
        column: &'static str,
        /// The header as found.
        found: String,
    },
    /// A column is there more than once.
    #[error(
        "{path}:{line}: column `{column}` appears more than once\n\n\
         hint: remove or rename one of them",
        path = path.display()
    )]
    RepeatedColumn {
        /// The input.
        path: PathBuf,
        /// Line of the header.
        line: u64,
        /// The repeated column.
        column: &'static str,
    },
    /// A value is no number, not finite, absurdly large, or absent.
    #[error(
        "{path}:{line}: column `{column}` is `{got}`, expected a finite number of sensible size\n\n\
         hint: remove the row; a gap in time is integrated across",
        path = path.display()
    )]
    BadValue {
        /// The input.
        path: PathBuf,
        /// Line in the file, from 1.
        line: u64,
        /// The column.
        column: &'static str,
        /// What stands there.
        got: String,
    },
    /// Time stands still or goes back.
    #[error(
        "{path}:{line}: column `t_s` is {got}, expected more than the {before} of the row before\n\n\
         hint: sort the rows by time and remove repeated ones",
        path = path.display()
    )]
    TimeNotIncreasing {
        /// The input.
        path: PathBuf,
        /// Line in the file, from 1.
        line: u64,
        /// Time of this row, s.
        got: f64,
        /// Time of the row before, s.
        before: f64,
    },
    /// A gap so long that the time column is hardly in seconds.
    #[error(
        "{path}:{line}: column `t_s` is {got}, {gap:.0} s after the row before, expected at most \
         {limit:.0} s\n\n\
         hint: is the time column in seconds?",
        path = path.display()
    )]
    GapTooLong {
        /// The input.
        path: PathBuf,
        /// Line in the file, from 1.
        line: u64,
        /// Time of this row, s.
        got: f64,
        /// Time since the row before, s.
        gap: f64,
        /// Longest gap taken, s.
        limit: f64,
    },
    /// Believed gravity would have no direction, or an absurd size.
    #[error(
        "{path}: believed gravity would start at {size:.3e} m/s², which is no gravity\n\n\
         hint: give --initial-gravity-hat X,Y,Z in m/s², for instance 0,0,-9.80665 upright",
        path = path.display()
    )]
    NoGravity {
        /// The input.
        path: PathBuf,
        /// Its size, m/s².
        size: f64,
    },
    /// The output is there already.
    #[error(
        "{path} exists\n\n\
         hint: choose another --out or overwrite it with --force",
        path = path.display()
    )]
    OutputExists {
        /// The output.
        path: PathBuf,
    },
    /// The output cannot be written.
    #[error(
        "cannot write {path}: {source}\n\n\
         hint: check that its folder exists, that you may write there and that the disk is not full",
        path = path.display()
    )]
    Write {
        /// The output.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
}

impl PerceiveError {
    /// Whether the caller's arguments or input are to blame (exit code 2), not the machine (exit code 1).
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Write { .. } | Self::Interrupted { .. } => false,
            Self::Read { source, .. } => !source.is_io_error(),
            _ => true,
        }
    }
}
