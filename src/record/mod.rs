//! Recording and reading back: one MCAP file that holds everything a run learned and said.
//!
//! # Format
//!
//! MCAP with profile `ros2`: every message is CDR, every schema a `ros2msg` text, so ordinary tools open all of it.
//!
//! | id | topic | schema | what | log time |
//! |---|---|---|---|---|
//! | 1 | `/imu` | `sensor_msgs/msg/Imu` | IMU samples | when the sample was taken |
//! | 2 | `/otolith/traffic` | `otolith_msgs/msg/Traffic` | raw pieces of device traffic | arrival |
//! | 3 | `/otolith/tick_input` | `otolith_msgs/msg/TickInput` | what the core learned | simulated time |
//! | 4 | `/otolith/tick_output` | `otolith_msgs/msg/TickOutput` | what the core said, after its input | simulated time |
//! | 5 | `/otolith/event` | `std_msgs/msg/String` | link lost, respawn, gap, late ticks | when it happened |
//! | 6 | `/otolith/summary` | `std_msgs/msg/String` | JSON, the last message | end |
//! | 7 | `/otolith/header` | `std_msgs/msg/String` | JSON object, name to text, the first message | 0 |
//!
//! The byte tables are the schema texts in `msg/`; floats keep their exact bits. Times count from the start of the run.
//! The MCAP `sequence` of a message is its running number within the channel: a jump is a loss, while tick numbers
//! may also jump because ticks were late.
//!
//! # Damage
//!
//! Data go to disk in zstd chunks of at most 64 KiB or 100 ms, each with a CRC, written whole, behind each other:
//! a killed program loses the last chunk. Configuration and models stand at the start twice: as attachments with a
//! CRC, and in a first chunk of their own. Chunk times and message indexes are compared with the chunk; what remains
//! is covered by the CRCs of the data section and of the summary section, and by comparing the magic.

use std::collections::BTreeMap;

mod cdr;
mod census;
mod chunk;
mod damage;
mod error;
mod layout;
mod reader;
mod scan;
mod source;
mod tail;
mod topic;
mod verify;
mod writer;

pub use census::RecordedTick;
pub use damage::{DamageReport, Finding};
pub use error::RecordError;
pub use reader::{Events, RecordedTraffic, Recording, Ticks, TrafficPieces};
pub use verify::{Difference, VerifyReport, verify};
pub use writer::{FileReport, Recorder};

/// What a recording must hold besides its data so that it can be replayed alone.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordingHeader {
    /// Effective configuration, TOML.
    pub config: String,
    /// Texts of the model file and of the files about the sensor, by name.
    pub models: BTreeMap<String, String>,
    /// Version of the program that recorded.
    pub version: String,
    /// Fingerprint of its build: bit equality is promised between equal fingerprints.
    pub fingerprint: String,
}

impl RecordingHeader {
    const CONFIG: &str = "config.toml";
    const VERSION: &str = "version.txt";
    const FINGERPRINT: &str = "fingerprint.txt";
    const MODELS: &str = "models/";

    /// A header for a recording by this version of the program.
    pub fn new(config: String, models: BTreeMap<String, String>, fingerprint: String) -> Self {
        Self { config, models, version: env!("CARGO_PKG_VERSION").to_owned(), fingerprint }
    }

    /// The header as named texts: the names of the attachments.
    fn entries(&self) -> BTreeMap<String, String> {
        let mut entries: BTreeMap<String, String> = self
            .models
            .iter()
            .map(|(name, text)| (format!("{}{name}", Self::MODELS), text.clone()))
            .collect();
        entries.insert(Self::CONFIG.to_owned(), self.config.clone());
        entries.insert(Self::VERSION.to_owned(), self.version.clone());
        entries.insert(Self::FINGERPRINT.to_owned(), self.fingerprint.clone());
        entries
    }

    /// The header of a file with these texts; `None` without a configuration. Other texts are ignored.
    fn from_entries(entries: &BTreeMap<String, String>) -> Option<Self> {
        let text = |name: &str| entries.get(name).cloned();
        let model = |(name, text): (&String, &String)| {
            name.strip_prefix(Self::MODELS).map(|name| (name.to_owned(), text.clone()))
        };
        Some(Self {
            config: text(Self::CONFIG)?,
            models: entries.iter().filter_map(model).collect(),
            version: text(Self::VERSION).unwrap_or_default(),
            fingerprint: text(Self::FINGERPRINT).unwrap_or_default(),
        })
    }
}

#[cfg(test)]
mod tests;
