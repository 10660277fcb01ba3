//! Commands that set a device up, for `--configure`. Nothing here is ever sent without it.
//!
//! One file per protocol turns a [`Request`] into a [`Plan`] of bytes to write and answers to wait for; it is pure.

pub mod mip;
pub mod xbus;

/// What the user asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Request {
    /// Samples per second.
    pub rate_hz: Option<f64>,
    /// Baud rate the device shall change to, bit/s.
    pub baud: Option<u32>,
    /// Keep the settings when the power goes off.
    pub save: bool,
}

/// What the bytes received since a command was sent say about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Nothing yet.
    NotYet,
    /// The device has done it.
    Done,
    /// The device refused, and why.
    Refused(String),
}

/// One command.
#[derive(Clone, Debug)]
pub struct Step {
    /// What it does, for people.
    pub what: String,
    /// The bytes.
    pub bytes: Vec<u8>,
    /// Judges everything received since the bytes were sent, which may begin or end within a packet and have measured
    /// data in between; `None` where the protocol knows no answer.
    pub answer: Option<fn(&[u8]) -> Answer>,
    /// From this command on the line runs at this baud rate, bit/s.
    pub baud_after: Option<u32>,
}

/// The commands for one request, in order.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The commands.
    pub steps: Vec<Step>,
    /// Samples per second when it is done.
    pub rate_hz: f64,
    /// Bytes a sample takes on the line when it is done.
    pub bytes_per_sample: f64,
}

/// Why a request cannot be met.
#[derive(Debug, thiserror::Error)]
pub enum ConfigureError {
    /// A value the device does not offer.
    #[error("--configure {key}={got}: {protocol} does not offer this, expected {expected}\n\nhint: {hint}")]
    NotOffered {
        /// Name of the protocol.
        protocol: &'static str,
        /// The key of `--configure`.
        key: &'static str,
        /// The value given.
        got: String,
        /// The values there are.
        expected: String,
        /// What to do.
        hint: String,
    },
}
