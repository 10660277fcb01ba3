//! Writing a recording.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::time::Duration;

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Attachment, McapError, WriteOptions, Writer};

use super::topic::Topic;
use super::{RecordError, RecordingHeader, layout};
use crate::device::Traffic;
use crate::imu::HeadSample;
use crate::tick::{TickInput, TickOutput};
use crate::time::HostTime;

/// A chunk goes to disk when it holds this much, bytes before compression ...
const CHUNK_BYTES: usize = 64 * 1024;
/// ... or spans this much.
const CHUNK_SPAN: Duration = Duration::from_millis(100);
/// Bytes around each message in a chunk: opcode, length, channel, sequence and two times.
const MESSAGE_OVERHEAD: usize = 31;
/// What a finished recording holds.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct FileReport {
    /// The file.
    pub path: PathBuf,
    /// Its length.
    pub bytes: u64,
    /// Ticks in it.
    pub ticks: u64,
    /// IMU samples in it.
    pub imu_samples: u64,
    /// Pieces of raw traffic in it.
    pub traffic_pieces: u64,
    /// Events in it.
    pub events: u64,
}

/// Writes one recording. Errors are final: after the first one, stop recording.
///
/// Dropping it without [`Recorder::finish`] still leaves a complete file, without a summary.
pub struct Recorder {
    path: PathBuf,
    mcap: Writer<NoSeek<BufWriter<File>>>,
    /// Messages written, by channel id.
    written: [u64; Topic::ALL.len() + 1],
    /// Running number of the next message, by channel id: written and dropped ones.
    sequence: [u32; Topic::ALL.len() + 1],
    message: Vec<u8>,
    chunk_bytes: usize,
    chunk_start: Option<HostTime>,
    /// Latest time of any message.
    latest: HostTime,
}

impl std::fmt::Debug for Recorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Recorder {
    /// Creates the file and writes configuration and models to disk.
    ///
    /// # Errors
    /// [`RecordError::Exists`] without `force`, [`RecordError::NoFolder`], [`RecordError::Io`] and
    /// [`RecordError::Write`].
    pub fn create(path: &Path, force: bool, header: &RecordingHeader) -> Result<Self, RecordError> {
        let file = create_file(path, force)?;
        let start = || -> Result<_, McapError> {
            let mut mcap = WriteOptions::new()
                .profile("ros2")
                .library(concat!("otolith ", env!("CARGO_PKG_VERSION")))
                .compression_threads(0)
                // Without seeking a chunk is built in memory and written whole: the file only ever grows.
                .disable_seeking(true)
                .chunk_size(None)
                .create(NoSeek::new(BufWriter::new(file)))?;
            for (name, text) in header.entries() {
                mcap.attach(&text_attachment(name, text))?;
            }
            add_channels(&mut mcap)?;
            Ok(mcap)
        };
        let mut recorder = Self {
            path: path.to_owned(),
            mcap: start().map_err(|error| write_error(path, error))?,
            written: Default::default(),
            sequence: Default::default(),
            message: Vec::new(),
            chunk_bytes: 0,
            chunk_start: None,
            latest: HostTime(0),
        };
        let copy = serde_json::json!(header.entries()).to_string();
        recorder.text(Topic::Header, HostTime(0), &copy)?;
        recorder.flush()?;
        Ok(recorder)
    }

    /// Records a piece of raw traffic that arrived at `at`.
    ///
    /// # Errors
    /// [`RecordError::Io`] or [`RecordError::Write`] when it does not reach the disk.
    pub fn traffic(&mut self, at: HostTime, traffic: Traffic<'_>) -> Result<(), RecordError> {
        layout::encode_traffic(&mut self.message, traffic);
        self.append(Topic::Traffic, at)?;
        self.flush_when_due(at)
    }

    /// Records an IMU sample in chair axes.
    ///
    /// # Errors
    /// As [`Recorder::traffic`].
    pub fn chair_sample(&mut self, sample: &HeadSample) -> Result<(), RecordError> {
        layout::encode_imu(&mut self.message, sample);
        self.append(Topic::Imu, sample.at)?;
        self.flush_when_due(sample.at)
    }

    /// Records one tick.
    ///
    /// # Errors
    /// As [`Recorder::traffic`].
    pub fn tick(&mut self, input: &TickInput, output: &TickOutput) -> Result<(), RecordError> {
        let at = input.tick.host_time();
        layout::encode_input(&mut self.message, input);
        self.append(Topic::TickInput, at)?;
        layout::encode_output(&mut self.message, output);
        self.append(Topic::TickOutput, at)?;
        self.flush_when_due(at)
    }

    /// Notes that `count` ticks were computed but never reached the recorder, so that readers can tell: the ticks
    /// that follow cannot be recomputed without them.
    pub fn ticks_dropped(&mut self, count: u32) {
        self.skip(Topic::TickInput, count);
        self.skip(Topic::TickOutput, count);
    }

    /// Notes that `count` pieces of traffic arrived but never reached the recorder.
    pub fn traffic_dropped(&mut self, count: u32) {
        self.skip(Topic::Traffic, count);
    }

    /// Records that something happened at `at`.
    ///
    /// # Errors
    /// As [`Recorder::traffic`].
    pub fn event(&mut self, at: HostTime, text: &str) -> Result<(), RecordError> {
        self.text(Topic::Event, at, text)
    }

    /// Sends what is pending to disk. Only needed when data pause: they flush themselves while they flow.
    ///
    /// # Errors
    /// As [`Recorder::traffic`].
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.chunk_bytes = 0;
        self.chunk_start = None;
        self.mcap.flush().map_err(|error| write_error(&self.path, error))
    }

    /// Writes the summary (JSON) and completes the file.
    ///
    /// # Errors
    /// As [`Recorder::traffic`].
    pub fn finish(mut self, summary_json: &str) -> Result<FileReport, RecordError> {
        self.text(Topic::Summary, self.latest, summary_json)?;
        self.flush()?;
        self.mcap.finish().map_err(|error| write_error(&self.path, error))?;
        let written = |topic: Topic| self.written[usize::from(topic.id())];
        let metadata = fs::metadata(&self.path).map_err(|error| io_error(&self.path, "measure it", error))?;
        Ok(FileReport {
            bytes: metadata.len(),
            ticks: written(Topic::TickOutput),
            imu_samples: written(Topic::Imu),
            traffic_pieces: written(Topic::Traffic),
            events: written(Topic::Event),
            path: self.path.clone(),
        })
    }

    fn skip(&mut self, topic: Topic, count: u32) {
        let next = &mut self.sequence[usize::from(topic.id())];
        *next = next.wrapping_add(count);
    }

    fn text(&mut self, topic: Topic, at: HostTime, text: &str) -> Result<(), RecordError> {
        layout::encode_text(&mut self.message, text);
        self.append(topic, at)?;
        self.flush_when_due(at)
    }

    /// Appends `self.message` to the open chunk.
    fn append(&mut self, topic: Topic, at: HostTime) -> Result<(), RecordError> {
        let channel = usize::from(topic.id());
        let header = MessageHeader {
            channel_id: topic.id(),
            sequence: self.sequence[channel],
            log_time: at.0,
            publish_time: at.0,
        };
        self.mcap
            .write_to_known_channel(&header, &self.message)
            .map_err(|error| write_error(&self.path, error))?;
        self.sequence[channel] = self.sequence[channel].wrapping_add(1);
        self.written[channel] += 1;
        self.chunk_bytes += MESSAGE_OVERHEAD + self.message.len();
        self.chunk_start.get_or_insert(at);
        self.latest = self.latest.max(at);
        Ok(())
    }

    fn flush_when_due(&mut self, now: HostTime) -> Result<(), RecordError> {
        let old = self.chunk_start.is_some_and(|start| now.saturating_since(start) >= CHUNK_SPAN);
        if old || self.chunk_bytes >= CHUNK_BYTES { self.flush() } else { Ok(()) }
    }
}

fn create_file(path: &Path, force: bool) -> Result<File, RecordError> {
    let mut options = OpenOptions::new();
    options.write(true);
    if force {
        options.create(true).truncate(true);
    } else {
        options.create_new(true);
    }
    options.open(path).map_err(|error| match (error.kind(), path.parent()) {
        (io::ErrorKind::AlreadyExists, _) => RecordError::Exists { path: path.to_owned() },
        (io::ErrorKind::NotFound, Some(folder)) => {
            RecordError::NoFolder { path: path.to_owned(), folder: folder.to_owned() }
        }
        _ => io_error(path, "create the file", error),
    })
}

fn text_attachment(name: String, text: String) -> Attachment<'static> {
    Attachment {
        log_time: 0,
        create_time: 0,
        name,
        media_type: "text/plain".to_owned(),
        data: text.into_bytes().into(),
    }
}

fn add_channels<W: io::Write + io::Seek>(mcap: &mut Writer<W>) -> Result<(), McapError> {
    for topic in Topic::ALL {
        let (name, text) = topic.schema();
        let schema = mcap.add_schema(name, "ros2msg", text.as_bytes())?;
        mcap.add_channel_with_id(topic.id(), schema, topic.name(), "cdr", &BTreeMap::new())?;
    }
    Ok(())
}

fn io_error(path: &Path, action: &'static str, source: io::Error) -> RecordError {
    RecordError::Io { path: path.to_owned(), action, source }
}

fn write_error(path: &Path, error: McapError) -> RecordError {
    match error {
        McapError::Io(error) => io_error(path, "write to it", error),
        error => RecordError::Write { path: path.to_owned(), source: Box::new(error) },
    }
}
