//! Results to stdout, everything else to stderr; a closed pipe is no error.

use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use super::failure::{Failure, FailureKind};

/// Prints a result: one JSON object, or its text.
pub(super) fn result<T: Serialize + Display>(value: &T, json: bool) -> Result<(), Failure> {
    if json { self::json(value) } else { text(&value.to_string()) }
}

/// Prints one JSON object.
pub(super) fn json<T: Serialize>(value: &T) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|error| Failure::new(FailureKind::Failed, format!("cannot write JSON: {error}")))?;
    self::text(&text)
}

/// Prints text to stdout.
pub(super) fn text(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::new(
            FailureKind::Failed,
            format!("cannot write to stdout: {error}\n\nhint: check the free space where stdout goes to"),
        )),
        _ => Ok(()),
    }
}

/// Says something that is no result.
pub(super) fn note(text: &str) {
    // There is nowhere left to report a closed stderr to.
    let _closed = writeln!(std::io::stderr(), "{text}");
}

/// A progress bar over `total_ms` of simulated time, or a spinner; invisible when stderr is no terminal.
pub(super) fn progress(total_ms: Option<u64>) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(total_ms, ProgressDrawTarget::stderr_with_hz(10));
    let template = match total_ms {
        Some(_) => "{bar:32} {percent:>3} %  {msg}",
        None => "{spinner} {msg}",
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    if total_ms.is_none() {
        bar.enable_steady_tick(Duration::from_millis(200));
    }
    bar
}
