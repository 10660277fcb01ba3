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
use std::path::PathBuf;

mod cdr;
mod census;
mod chunk;
mod layout;
mod reader;
mod scan;
mod source;
mod tail;
mod topic;
mod verify;
mod writer;

pub use census::RecordedTick;
pub use reader::{Events, RecordedTraffic, Recording, Ticks, TrafficPieces};
pub use scan::{DamageReport, Finding};
pub use verify::{Difference, VerifyReport, verify};
pub use writer::{FileReport, Recorder};

/// What a recording must hold besides its data so that it can be replayed alone.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordingHeader {
    /// Effective configuration, TOML.
    pub config: String,
    /// Texts of the model files, by file name.
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

/// Why a recording could not be written or read at all.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file is there and may not be overwritten.
    #[error("{}: the file exists already\n\nhint: choose another name, or overwrite it with --force", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The folder for a new file is missing.
    #[error("{}: there is no folder {} to write into\n\nhint: create it first: mkdir -p {}",
        path.display(), folder.display(), folder.display())]
    NoFolder {
        /// The file.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
    },
    /// The operating system refused.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The recording could not be encoded.
    #[error("{}: cannot write the recording: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the MCAP library said.
        source: Box<mcap::McapError>,
    },
    /// The file holds nothing.
    #[error("{}: the file is empty: 0 bytes, expected a recording\n\nhint: the disk may have been full, or the recording was stopped before it began", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The file is something else.
    #[error("{}: not a recording: it starts with {found:?}, expected the MCAP magic {:?}\n\nhint: text logs need a mapping file: --log-map configs/logs/NAME.toml", path.display(), "\\x89MCAP0\\r\\n")]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Its first bytes, escaped.
        found: String,
    },
    /// The file is, or was, MCAP, but neither configuration nor data of ours can be read.
    #[error("{}: nothing usable in {bytes} bytes: {reason}\n\nhint: only recordings made by otolith can be replayed", path.display())]
    NothingUsable {
        /// The file.
        path: PathBuf,
        /// Its length.
        bytes: u64,
        /// The first damage found.
        reason: String,
    },
    /// A part that was good a moment ago is not any more.
    #[error("{}: the file changed at byte {offset} while it was being read", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
    },
}

#[cfg(test)]
mod tests;
