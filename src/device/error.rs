//! What can go wrong before traffic flows. Trouble while it flows is counted, see [`super::LinkStatus`].

use std::io;
use std::path::PathBuf;

use super::configure::ConfigureError;

/// Why a device could not be opened or set up. The text says what, where, got and expected, then a hint.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// A selector that cannot be understood.
    #[error("device selector `{selector}`: {problem}\n\nhint: {hint}")]
    Selector {
        /// The selector as given.
        selector: String,
        /// What is wrong with it: got and expected.
        problem: String,
        /// What to write instead.
        hint: String,
    },
    /// A setting outside its range.
    #[error(
        "{what} = {got} is out of range, expected {expected}\n\nhint: give a value in this range; the unit is part of the name"
    )]
    Range {
        /// Name of the setting.
        what: String,
        /// The value given.
        got: String,
        /// The values allowed.
        expected: String,
    },
    /// No port or interface of that name.
    #[error("{port}: there is no such port\n\nhint: {hint}")]
    NoSuchPort {
        /// The port as given.
        port: String,
        /// The ports that exist.
        hint: String,
    },
    /// The port exists but this user may not open it.
    #[error(
        "{port}: permission denied\n\nhint: join the group that owns the port (`ls -l {port}` names it), then log out \
         and in again; on most systems `sudo usermod -aG dialout $USER`"
    )]
    NoPermission {
        /// The port as given.
        port: String,
    },
    /// Another program holds the port.
    #[error(
        "{port}: in use by another program\n\nhint: close it (another otolith, a serial monitor, ModemManager); \
         `fuser {port}` names it"
    )]
    Busy {
        /// The port as given.
        port: String,
    },
    /// The port could not be opened or set up for another reason.
    #[error("{port}: cannot open it: {source}\n\nhint: {hint}")]
    Open {
        /// The port as given.
        port: String,
        /// What the operating system said.
        source: io::Error,
        /// What to try.
        hint: String,
    },
    /// The port was open and went away before it could be of use.
    #[error("{port}: the connection was lost: {source}\n\nhint: {hint}")]
    Lost {
        /// The port as given.
        port: String,
        /// What the operating system said.
        source: io::Error,
        /// What to try.
        hint: String,
    },
    /// This machine has no such kind of link at all.
    #[error("{port}: {problem}\n\nhint: {hint}")]
    Unsupported {
        /// The port as given.
        port: String,
        /// What is missing.
        problem: &'static str,
        /// What to do instead.
        hint: &'static str,
    },
    /// A recording that cannot be read.
    #[error("{}: cannot read it: {source}\n\nhint: check the path; `replay:FILE` takes a text log, a candump log, a telemetry log (tlog) or raw bytes", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// A recording without a single byte.
    #[error("{}: the file is empty (0 bytes), expected a recording\n\nhint: record it again, or check that the copy was complete", path.display())]
    EmptyFile {
        /// The file.
        path: PathBuf,
    },
    /// A recording of a kind that needs something else to be read.
    #[error("{}: this is {kind}\n\nhint: {hint}", path.display())]
    FileKind {
        /// The file.
        path: PathBuf,
        /// What the file looks like.
        kind: &'static str,
        /// How to read it.
        hint: &'static str,
    },
    /// A protocol name nobody knows.
    #[error("protocol `{got}` is not known\n\nhint: known protocols: {known}")]
    UnknownProtocol {
        /// The name as given.
        got: String,
        /// All names.
        known: String,
    },
    /// A text log without a description of its columns.
    #[error(
        "the protocol `text` needs a mapping of columns to quantities\n\nhint: name one with `--log-map FILE.toml`; \
         examples are in configs/logs"
    )]
    NeedsMapping,
    /// A device that cannot be set up as asked.
    #[error(transparent)]
    Configure(#[from] ConfigureError),
    /// CAN frames without a description of their signals.
    #[error(
        "the protocol `can-map` needs a mapping of signals to quantities\n\nhint: name one with `--map NAME` (ready are \
         {ready}) or `--map FILE.toml`; `otolith inspect LOG` says which ones fit a candump log"
    )]
    NeedsCanMap {
        /// Names of the ready mappings.
        ready: String,
    },
    /// The serial line cannot carry what the device announces. See [`super::bandwidth`].
    #[error(
        "serial line too slow: {rate_hz} samples/s of at least {bytes_per_sample:.1} bytes are {load_percent:.0} % of \
         {baud} baud, the limit is {limit_percent:.0} %\n\nhint: {hint}"
    )]
    SerialTooSlow {
        /// Baud rate of the line.
        baud: u32,
        /// Announced sample rate, Hz.
        rate_hz: f64,
        /// Bytes on the wire per sample.
        bytes_per_sample: f64,
        /// Share of the line's capacity, percent.
        load_percent: f64,
        /// Largest share accepted, percent.
        limit_percent: f64,
        /// The next baud or sample rate that fits.
        hint: String,
    },
    /// The CAN bus cannot carry what the device announces. See [`super::bandwidth`].
    #[error(
        "CAN bus too slow: these frames take {least_percent:.0} to {most_percent:.0} % of {bitrate} bit/s, depending on \
         their bits; the limit is {limit_percent:.0} %\n\nhint: {hint}"
    )]
    CanTooSlow {
        /// Bit rate of the bus, bit/s.
        bitrate: u32,
        /// Share of the bus without stuffing, percent.
        least_percent: f64,
        /// Share of the bus with worst stuffing, percent.
        most_percent: f64,
        /// Largest share accepted, percent.
        limit_percent: f64,
        /// The next bit rate, or the share of the frames, that fits.
        hint: String,
    },
}

impl DeviceError {
    /// `value` itself when it lies in `range`, otherwise [`DeviceError::Range`] naming `what`. NaN is out of range.
    pub(crate) fn check_range(
        what: &str,
        value: f64,
        range: std::ops::RangeInclusive<f64>,
    ) -> Result<f64, DeviceError> {
        if range.contains(&value) {
            return Ok(value);
        }
        Err(DeviceError::Range {
            what: what.to_owned(),
            got: format!("{value:?}"),
            expected: format!("{} to {}", range.start(), range.end()),
        })
    }
}
