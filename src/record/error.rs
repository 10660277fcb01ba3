//! Why a recording cannot be written or read.

use std::path::PathBuf;

/// Why a recording could not be written or read at all.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file is there and may not be overwritten.
    #[error(
        "{}: the file exists already\n\nhint: choose another name, or overwrite it with --force",
        path.display()
    )]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The folder for a new file is missing.
    #[error(
        "{}: there is no folder {} to write into\n\nhint: create it first: mkdir -p {}",
        path.display(), folder.display(), folder.display()
    )]
    NoFolder {
        /// The file.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
    },
    /// The operating system refused.
    #[error(
        "{}: cannot {action}: {source}\n\nhint: check the name, the permissions and the free space",
        path.display()
    )]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The recording could not be encoded.
    #[error(
        "{}: cannot write the recording: {source}\n\nhint: the file up to here can be read; \
         if another recording fails in the same way, this is a defect of otolith",
        path.display()
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// What the MCAP library said.
        source: Box<mcap::McapError>,
    },
    /// The file holds nothing.
    #[error(
        "{}: the file is empty: 0 bytes, expected a recording\n\n\
         hint: the disk may have been full, or the recording was stopped before it began",
        path.display()
    )]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The file is something else.
    #[error(
        "{}: not a recording: it starts with \"{found}\", expected \"{}\"\n\n\
         hint: `replay` takes what --record wrote; a log is played by `otolith run --device replay:FILE`, \
         with --log-map for a text log",
        path.display(), mcap::MAGIC.escape_ascii()
    )]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Its first bytes, escaped.
        found: String,
    },
    /// Another version of otolith wrote the file.
    #[error(
        "{}: the recording has layout {got}, expected {expected}\n\n\
         hint: read it with the version of otolith that wrote it",
        path.display()
    )]
    OtherLayout {
        /// The file.
        path: PathBuf,
        /// Layout of its first message.
        got: u8,
        /// Layout this program writes and reads.
        expected: u8,
    },
    /// The file is, or was, MCAP, but neither configuration nor data of ours can be read.
    #[error(
        "{}: nothing usable in {bytes} bytes: {reason}\n\nhint: only recordings made by otolith can be replayed",
        path.display()
    )]
    NothingUsable {
        /// The file.
        path: PathBuf,
        /// Its length.
        bytes: u64,
        /// The first damage found.
        reason: String,
    },
    /// A part that was good a moment ago is not any more.
    #[error(
        "{}: the file changed at byte {offset} while it was being read\n\n\
         hint: wait until its recording is finished, or copy it first",
        path.display()
    )]
    Changed {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
    },
}
