//! Integration tests: one binary, one module per subject.

// Helpers of tests may panic like tests.
#![allow(clippy::expect_used, clippy::unwrap_used)]

#[cfg(target_os = "linux")]
mod can;
#[cfg(unix)]
mod pty;
