//! Integration tests: one binary, one module per subject.

#[cfg(unix)]
mod pty;
