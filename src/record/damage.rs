//! What is wrong with a recording, and where.

use std::fmt;

/// One damaged place.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Finding {
    /// First damaged byte, or first byte of the part that holds the damage.
    pub offset: u64,
    /// First byte after that part.
    pub end: u64,
    /// What is wrong with it.
    pub what: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "bytes {} to {}: {}", self.offset, self.end, self.what)
    }
}

/// The state of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct DamageReport {
    /// Damaged places in the order of discovery.
    pub findings: Vec<Finding>,
    /// Ticks that can be read.
    pub ticks_read: u64,
    /// Ticks known to be lost; a cut file may have held more.
    pub ticks_lost_at_least: u64,
    /// Pieces of raw traffic that can be read.
    pub traffic_read: u64,
    /// Pieces of raw traffic known to be lost.
    pub traffic_lost_at_least: u64,
    /// True when the file is whole: finished, every checksum right, nothing lost.
    pub complete: bool,
}
