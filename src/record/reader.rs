//! Reading a recording, whole or damaged.

use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::census::{Channels, RecordedTick, TickJoiner};
use super::chunk::{Chunk, ChunkSpan, Message};
use super::damage::DamageReport;
use super::scan::{Contents, scan};
use super::source::{Origin, Source};
use super::topic::Topic;
use super::{RecordError, RecordingHeader, layout};
use crate::device::Traffic;
use crate::time::HostTime;

/// An opened recording. Opening reads the file once, checks all of it and remembers the places of the good chunks;
/// the iterators then read chunk by chunk.
#[derive(Debug)]
pub struct Recording {
    index: Index,
    header: Option<RecordingHeader>,
    summary: Option<String>,
    damage: DamageReport,
}

/// Where the good chunks are.
#[derive(Clone, Debug)]
struct Index {
    path: PathBuf,
    origin: Origin,
    chunks: Arc<[ChunkSpan]>,
    channels: Channels,
}

impl Recording {
    /// Opens and checks the recording in `path`.
    ///
    /// # Errors
    /// [`RecordError::Io`], [`RecordError::Empty`], [`RecordError::NotMcap`], [`RecordError::OtherLayout`] and
    /// [`RecordError::NothingUsable`].
    /// Any other damage is no error: see [`Recording::damage`].
    pub fn open(path: &Path) -> Result<Self, RecordError> {
        Self::open_origin(path, Origin::File(path.to_owned()))
    }

    /// Opens and checks a recording held in memory; `name` stands for its path in messages.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn from_bytes(name: &str, bytes: impl Into<Arc<[u8]>>) -> Result<Self, RecordError> {
        Self::open_origin(Path::new(name), Origin::Memory(bytes.into()))
    }

    fn open_origin(path: &Path, origin: Origin) -> Result<Self, RecordError> {
        let read_error = |error| io_error(path, error);
        let mut source = Source::open(&origin).map_err(read_error)?;
        let bytes = source.len();
        if bytes == 0 {
            return Err(RecordError::Empty { path: path.to_owned() });
        }
        let Ok(contents) = scan(&mut source).map_err(read_error)? else {
            let start = source.read(0..8).map_err(read_error)?;
            return Err(RecordError::NotMcap {
                path: path.to_owned(),
                found: start.escape_ascii().to_string(),
            });
        };
        let Contents { chunks, attachments, census, findings } = contents;
        let nothing_read = census.ticks.read == 0 && census.traffic.read == 0;
        if let Some(got) = census.other_layout.filter(|_| nothing_read) {
            return Err(RecordError::OtherLayout { path: path.to_owned(), got, expected: layout::LAYOUT });
        }
        let header = census
            .header
            .as_ref()
            .and_then(RecordingHeader::from_entries)
            .or_else(|| RecordingHeader::from_entries(&attachments));
        if header.is_none() && nothing_read {
            let reason = findings.first().map_or("no data of ours".to_owned(), ToString::to_string);
            return Err(RecordError::NothingUsable { path: path.to_owned(), bytes, reason });
        }
        let damage = DamageReport {
            complete: findings.is_empty(),
            findings,
            ticks_read: census.ticks.read,
            ticks_lost_at_least: census.ticks.lost,
            traffic_read: census.traffic.read,
            traffic_lost_at_least: census.traffic.lost,
        };
        let index = Index { path: path.to_owned(), origin, chunks: chunks.into(), channels: census.channels };
        Ok(Self { index, header, summary: census.summary, damage })
    }

    /// Configuration, models and build; `None` if both copies are lost.
    pub fn header(&self) -> Option<&RecordingHeader> {
        self.header.as_ref()
    }

    /// The summary (JSON) written at the end, if there is one.
    pub fn summary(&self) -> Option<&str> {
        self.summary.as_deref()
    }

    /// What is damaged and what is lost.
    pub fn damage(&self) -> &DamageReport {
        &self.damage
    }

    /// All readable ticks in the order of recording.
    ///
    /// # Errors
    /// [`RecordError::Io`] when the file cannot be opened again. So do the items when it can no longer be read, and
    /// [`RecordError::Changed`].
    pub fn ticks(&self) -> Result<Ticks, RecordError> {
        let messages = self.messages(&[Topic::TickInput, Topic::TickOutput])?;
        Ok(Ticks { messages, joiner: TickJoiner::default() })
    }

    /// All readable pieces of raw traffic in the order of arrival.
    ///
    /// # Errors
    /// As [`Recording::ticks`].
    pub fn traffic(&self) -> Result<TrafficPieces, RecordError> {
        Ok(TrafficPieces { messages: self.messages(&[Topic::Traffic])? })
    }

    /// All readable events in the order of recording.
    ///
    /// # Errors
    /// As [`Recording::ticks`].
    pub fn events(&self) -> Result<Events, RecordError> {
        Ok(Events { messages: self.messages(&[Topic::Event])? })
    }

    fn messages(&self, wanted: &'static [Topic]) -> Result<Messages, RecordError> {
        let source = Source::open(&self.index.origin).map_err(|error| io_error(&self.index.path, error))?;
        Ok(Messages { source, index: self.index.clone(), wanted, next_chunk: 0, queue: VecDeque::new() })
    }
}

/// Messages of the wanted topics, one chunk in memory at a time.
struct Messages {
    source: Source,
    index: Index,
    wanted: &'static [Topic],
    next_chunk: usize,
    queue: VecDeque<(Topic, Message)>,
}

impl std::fmt::Debug for Messages {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Messages").field("path", &self.index.path).finish_non_exhaustive()
    }
}

impl Iterator for Messages {
    type Item = Result<(Topic, Message), RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(message) = self.queue.pop_front() {
                return Some(Ok(message));
            }
            let span = *self.index.chunks.get(self.next_chunk)?;
            self.next_chunk += 1;
            if let Err(error) = self.load(span) {
                self.next_chunk = self.index.chunks.len();
                return Some(Err(error));
            }
        }
    }
}

impl Messages {
    fn load(&mut self, span: ChunkSpan) -> Result<(), RecordError> {
        let chunk = Chunk::read(&mut self.source, span).map_err(|error| io_error(&self.index.path, error))?;
        let changed = RecordError::Changed { path: self.index.path.clone(), offset: span.offset };
        for message in chunk.map_err(|_| changed)?.messages {
            if let Some(topic) =
                self.index.channels.topic(&message).filter(|topic| self.wanted.contains(topic))
            {
                self.queue.push_back((topic, message));
            }
        }
        Ok(())
    }
}

/// Iterator over the ticks of a [`Recording`].
#[derive(Debug)]
pub struct Ticks {
    messages: Messages,
    joiner: TickJoiner,
}

impl Iterator for Ticks {
    type Item = Result<RecordedTick, RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        // What cannot be decoded was reported when the file was opened.
        loop {
            match self.messages.next()? {
                Err(error) => return Some(Err(error)),
                Ok((Topic::TickInput, message)) => drop(self.joiner.input(&message)),
                Ok((_, message)) => {
                    if let Ok(Some(tick)) = self.joiner.output(&message) {
                        return Some(Ok(tick));
                    }
                }
            }
        }
    }
}

/// A piece of raw traffic and when it arrived.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedTraffic {
    /// Arrival, time since the start of the recorded run.
    pub at: HostTime,
    message: Vec<u8>,
}

impl RecordedTraffic {
    /// The piece itself.
    pub fn traffic(&self) -> Traffic<'_> {
        layout::decode_traffic(&self.message).unwrap_or(Traffic::Bytes(&[]))
    }
}

/// Iterator over the raw traffic of a [`Recording`].
#[derive(Debug)]
pub struct TrafficPieces {
    messages: Messages,
}

impl Iterator for TrafficPieces {
    type Item = Result<RecordedTraffic, RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.messages.next()? {
                Err(error) => return Some(Err(error)),
                Ok((_, message)) if layout::decode_traffic(&message.data).is_ok() => {
                    return Some(Ok(RecordedTraffic { at: message.log_time, message: message.data }));
                }
                Ok(_) => {}
            }
        }
    }
}

/// Iterator over the events of a [`Recording`]: when and what.
#[derive(Debug)]
pub struct Events {
    messages: Messages,
}

impl Iterator for Events {
    type Item = Result<(HostTime, String), RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let (_, message) = match self.messages.next()? {
                Ok(message) => message,
                Err(error) => return Some(Err(error)),
            };
            if let Ok(text) = layout::decode_text(&message.data) {
                return Some(Ok((message.log_time, text.to_owned())));
            }
        }
    }
}

fn io_error(path: &Path, source: io::Error) -> RecordError {
    RecordError::Io { path: path.to_owned(), action: "read it", source }
}
