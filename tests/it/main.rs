//! All integration tests in one binary.

// A helper of a test may fail the test.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod observer_cases;
mod observer_golden;
mod observer_laws;
