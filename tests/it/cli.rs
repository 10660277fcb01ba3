//! The program as a user meets it: arguments in; exit code, stdout, stderr and files out.

mod calibrate;
mod can_map;
mod chair;
mod demo;
#[cfg(unix)]
mod devices;
#[cfg(unix)]
mod doctor;
mod inspect;
mod inspect_logs;
mod inspect_variants;
mod logs;
mod perceive;
#[cfg(unix)]
mod perceive_interrupted;
mod recording;
mod refusals;
mod reproduce;
mod terminal;
mod xbus_mip;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// What one call of the program came to.
struct Run {
    code: i32,
    stdout: String,
    stderr: String,
}

impl Run {
    fn of(command: &mut Command) -> Self {
        let output = command.stdin(Stdio::null()).output().expect("the program starts");
        Self {
            code: output.status.code().expect("it was not killed"),
            stdout: String::from_utf8(output.stdout).expect("UTF-8"),
            stderr: String::from_utf8(output.stderr).expect("UTF-8"),
        }
    }

    /// Exit code 0.
    #[track_caller]
    fn done(self) -> Self {
        assert_eq!(self.code, 0, "{}", self.stderr);
        self
    }

    /// Stdout as one JSON object and nothing else.
    #[track_caller]
    fn json(&self) -> Value {
        let value: Value = serde_json::from_str(&self.stdout)
            .unwrap_or_else(|error| panic!("{error}\n{}\n{}", self.stdout, self.stderr));
        assert!(value.is_object());
        value
    }

    /// Ended with `code` and an error that has a hint and holds every one of `parts`.
    #[track_caller]
    fn complains(&self, code: i32, parts: &[&str]) {
        let text = &self.stderr;
        assert_eq!(self.code, code, "{text}");
        assert!(text.contains("error: ") && !text.contains("panicked"), "{text}");
        let (error, hint) = text.rsplit_once("\n\nhint: ").unwrap_or_else(|| panic!("no hint in: {text}"));
        assert!(!error.ends_with('\n') && !hint.trim_end().contains('\n'), "layout of: {text}");
        for part in parts {
            assert!(text.contains(part), "`{part}` is missing in: {text}");
        }
    }

    /// Complained, and gave no result.
    #[track_caller]
    fn refused(&self, code: i32, parts: &[&str]) {
        self.complains(code, parts);
        assert_eq!(self.stdout, "");
    }
}

/// A folder of its own to run the program in.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).expect("written");
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_otolith"));
        command.args(args).current_dir(self.0.path());
        command
    }

    fn run(&self, args: &[&str]) -> Run {
        Run::of(&mut self.command(args))
    }

    /// The program while it runs, with nothing to read and its output kept.
    fn spawn(&self, args: &[&str]) -> Child {
        let mut command = self.command(args);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().expect("the program starts")
    }

    /// Names of everything in the folder, sorted.
    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).expect("readable");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("readable").file_name().into_string().expect("UTF-8")).collect();
        names.sort();
        names
    }
}

/// A file of the repository.
fn shipped(name: &str) -> String {
    format!("{}/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// A recorded log; `None` where the shared recordings are not at hand.
fn shared_log(name: &str) -> Option<String> {
    let path = format!("{}/../shared/imu-logs/{name}", env!("CARGO_MANIFEST_DIR"));
    if Path::new(&path).exists() {
        return Some(path);
    }
    assert!(std::env::var_os("CI").is_none(), "{path} is missing");
    crate::say_skipped("../shared is not here");
    None
}

/// A short run of the mock chair: 1.5 s in which it turns a little.
const SHORT: [&str; 8] = ["--rest-s", "0.5", "--spin-s", "0.6", "--ramp-s", "0.2", "--after-s", "0.2"];

/// The number at a JSON pointer.
#[track_caller]
fn number(json: &Value, pointer: &str) -> f64 {
    let value = json.pointer(pointer).and_then(Value::as_f64);
    value.unwrap_or_else(|| panic!("no number at {pointer} in {json:#}"))
}

/// The number at a JSON pointer is the expected one.
#[track_caller]
fn near(json: &Value, pointer: &str, expected: f64, tolerance: f64) {
    let found = number(json, pointer);
    assert!(
        (found - expected).abs() <= tolerance,
        "{pointer} is {found}, expected {expected} +- {tolerance}"
    );
}
