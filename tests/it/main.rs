//! One integration binary: everything that needs more than one module, or recorded data.

// A helper of a test may fail the test.
#![allow(clippy::unwrap_used, clippy::expect_used)]

/// Says that a test was skipped, past the harness, which shows the output of failed tests only.
fn say_skipped(why: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stderr(), "skipped: {why}");
}

#[cfg(target_os = "linux")]
mod can;
mod candump;
mod cli;
mod closed_loop;
mod configs;
mod core_robust;
mod imu_logs;
mod layering;
mod motions;
mod observer_cases;
mod observer_golden;
mod observer_laws;
#[cfg(unix)]
mod pty;
mod xbus_mip;
