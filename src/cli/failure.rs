//! What ends a command early, and the exit code that goes with it.

use std::fmt;
use std::io::ErrorKind;
use std::process::ExitCode;

use clap::CommandFactory;

use super::perceive::PerceiveError;
use crate::config::ConfigError;
use crate::device::DeviceError;
use crate::record::RecordError;
use crate::reproduce::{DrawingError, ExperimentError};
use crate::runtime::CoreSettingsError;

/// Kinds of failure; the value is the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureKind {
    /// It could not be done: a disk, a missing answer.
    Failed = 1,
    /// Wrong usage, configuration or input: the user's to mend.
    Usage = 2,
    /// Data was lost or is damaged.
    DataLost = 3,
}

/// Why a command ended early.
#[derive(Debug)]
pub struct Failure {
    kind: FailureKind,
    message: String,
}

impl Failure {
    /// A failure with its text: what, where, got and expected, then a hint.
    pub fn new(kind: FailureKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into() }
    }

    /// Wrong usage.
    pub fn usage(message: impl Into<String>) -> Self {
        Self::new(FailureKind::Usage, message)
    }

    /// The exit code of the process.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.kind as u8)
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<clap::Error> for Failure {
    /// What `clap` says about wrong arguments, in this program's layout: its first paragraph is the message, its tips and
    /// its usage line are the hint.
    fn from(error: clap::Error) -> Self {
        let text = error.render().to_string();
        let line_after = |start: &str| {
            let lines = text.lines().filter_map(|line| line.trim().strip_prefix(start));
            lines.map(str::to_owned).collect::<Vec<_>>()
        };
        let message: Vec<&str> = text.lines().map(str::trim).take_while(|line| !line.is_empty()).collect();
        let message = message.join(" ");
        let message = message.strip_prefix("error: ").unwrap_or(&message);
        let mut hints = line_after("tip: ");
        if hints.is_empty() {
            hints.extend(line_after("Usage: ").iter().map(|usage| format!("usage: {usage}")));
        }
        let is_command = |arg: &String| super::Cli::command().find_subcommand(arg).is_some();
        let mut args = std::env::args_os().skip(1).filter_map(|arg| arg.into_string().ok());
        let command = args.find(is_command).map_or_else(String::new, |name| name + " ");
        hints.push(format!("`otolith {command}--help` says what there is"));
        Self::usage(format!("{message}\n\nhint: {}", hints.join("; ")))
    }
}

impl From<DeviceError> for Failure {
    fn from(error: DeviceError) -> Self {
        let kind = match error {
            DeviceError::EmptyFile { .. } => FailureKind::DataLost,
            _ => FailureKind::Usage,
        };
        Self::new(kind, error.to_string())
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        match error {
            ConfigError::Device(error) => error.into(),
            error => Self::usage(error.to_string()),
        }
    }
}

impl From<CoreSettingsError> for Failure {
    fn from(error: CoreSettingsError) -> Self {
        Self::usage(error.to_string())
    }
}

impl From<ExperimentError> for Failure {
    fn from(error: ExperimentError) -> Self {
        Self::usage(error.to_string())
    }
}

impl From<DrawingError> for Failure {
    fn from(error: DrawingError) -> Self {
        Self::new(FailureKind::Failed, error.to_string())
    }
}

impl From<PerceiveError> for Failure {
    fn from(error: PerceiveError) -> Self {
        let kind = if error.is_bad_input() { FailureKind::Usage } else { FailureKind::Failed };
        Self::new(kind, error.to_string())
    }
}

impl From<RecordError> for Failure {
    fn from(error: RecordError) -> Self {
        let kind = match error {
            RecordError::Exists { .. }
            | RecordError::NoFolder { .. }
            | RecordError::NotMcap { .. }
            | RecordError::OtherLayout { .. } => FailureKind::Usage,
            RecordError::Io { ref source, .. } if is_wrong_path(source.kind()) => FailureKind::Usage,
            RecordError::Io { .. } | RecordError::Write { .. } => FailureKind::Failed,
            _ => FailureKind::DataLost,
        };
        Self::new(kind, error.to_string())
    }
}

/// Whether another path, and not another try, is what helps.
fn is_wrong_path(kind: ErrorKind) -> bool {
    matches!(
        kind,
        ErrorKind::NotFound
            | ErrorKind::NotADirectory
            | ErrorKind::IsADirectory
            | ErrorKind::PermissionDenied
    )
}
