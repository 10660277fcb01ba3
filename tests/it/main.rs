//! One integration binary: everything that needs more than one module, or recorded data.

// A helper of a test may fail the test.
#![allow(clippy::unwrap_used, clippy::expect_used)]

/// Says that a test was skipped, past the harness, which shows the output of failed tests only.
fn say_skipped(why: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stderr(), "skipped: {why}");
}

/// A file of the shared recordings; `None` where they are not at hand, which is said, and fails in CI.
fn shared_capture(name: &str) -> Option<Vec<u8>> {
    let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/imu-logs")).join(name);
    match std::fs::read(&path) {
        Ok(bytes) => Some(bytes),
        Err(error) if std::env::var_os("CI").is_some() => panic!("{}: {error}", path.display()),
        Err(_) => {
            say_skipped("../shared is not here");
            None
        }
    }
}

mod candump;
#[path = "../common/chair_can.rs"]
mod chair_can;
mod cli;
mod closed_loop;
mod configs;
mod core_robust;
mod damage;
mod decoder_robust;
mod device_vectors;
mod fault_matrix;
mod imu_logs;
mod layering;
mod motions;
mod observer_cases;
mod observer_golden;
mod observer_laws;
mod probe;
#[cfg(unix)]
mod pty;
mod xbus_mip;
