//! Fields of the serial messages and where they lie in the payload.

use crate::message::{EncodeError, PayloadError};

mod exchange;
mod report;
mod sample;

pub use exchange::{Ack, Cmd, Sync};
pub use report::{Hello, Status, Text};
pub use sample::{BATCH_MAX_ROWS, Batch16, Sample16, SampleF32};

/// Errs unless the payload of a `kind` is `expected` bytes long.
fn check_length(kind: u8, payload: &[u8], expected: usize) -> Result<(), PayloadError> {
    if payload.len() == expected {
        Ok(())
    } else {
        Err(PayloadError::Length { kind, expected, got: payload.len() })
    }
}

/// Errs if the variable part of a `kind` is longer than `most`.
fn check_fits(kind: u8, got: usize, most: usize) -> Result<(), EncodeError> {
    if got <= most { Ok(()) } else { Err(EncodeError { kind, got, most }) }
}

/// The longest valid UTF-8 beginning of `bytes`.
fn utf8_prefix(bytes: &[u8]) -> &str {
    bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid())
}
