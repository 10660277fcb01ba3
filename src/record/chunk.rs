//! One chunk: its frame in the file and its checked contents.

use std::collections::BTreeMap;

use mcap::McapError;
use mcap::records::{ChunkHeader, MessageIndexEntry, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::source::Source;
use crate::time::HostTime;

/// Opcode and length in front of every record.
pub(super) const RECORD_HEAD: u64 = 9;
/// Nothing larger is read into memory, compressed or not. Our chunks hold 64 KiB, the first one all models.
pub(super) const MAX_RECORD: u64 = 64 << 20;

/// Two times, two sizes, checksum, and the name "zstd" with its length: the front of a chunk of ours.
const CHUNK_FRONT: usize = 8 + 8 + 8 + 4 + 4 + 4 + 8;
const COMPRESSION: &[u8] = b"\x04\0\0\0zstd";
const COMPRESSION_AT: usize = 8 + 8 + 8 + 4;

/// Place of a chunk record in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ChunkSpan {
    /// Where its opcode stands.
    pub offset: u64,
    /// Length after the record head.
    pub len: u64,
}

impl ChunkSpan {
    /// Bytes of a record that [`ChunkSpan::parse`] must see.
    pub(super) const FRONT: u64 = RECORD_HEAD + CHUNK_FRONT as u64;

    /// The chunk at `offset` whose first `bytes` look like one of ours, by its two statements of its length: the
    /// shorter one first. They are equal unless one is damaged; the longer one may then reach into other records.
    pub(super) fn parse(offset: u64, bytes: &[u8]) -> Option<[Self; 2]> {
        let (len, rest) = bytes.strip_prefix(&[op::CHUNK])?.split_first_chunk::<8>()?;
        let (front, size) = rest.get(..CHUNK_FRONT)?.split_last_chunk::<8>()?;
        if &front[COMPRESSION_AT..] != COMPRESSION {
            return None;
        }
        let outer = u64::from_le_bytes(*len);
        let inner = u64::from_le_bytes(*size).saturating_add(CHUNK_FRONT as u64);
        Some([outer.min(inner), outer.max(inner)].map(|len| Self { offset, len }))
    }

    /// True when it ends in front of `limit` and can be read into memory.
    pub(super) fn fits(self, limit: u64) -> bool {
        self.len <= MAX_RECORD && self.end() <= limit
    }

    /// First byte after the chunk.
    pub(super) fn end(self) -> u64 {
        self.offset.saturating_add(RECORD_HEAD).saturating_add(self.len)
    }
}

/// A message as it stands in a chunk.
#[derive(Debug)]
pub(super) struct Message {
    pub channel: u16,
    pub sequence: u32,
    pub log_time: HostTime,
    pub data: Vec<u8>,
}

/// The contents of a chunk whose checksum was right.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    pub messages: Vec<Message>,
    /// Topic names by channel id, where the chunk declares them.
    pub channels: Vec<(u16, String)>,
    /// What the message index records behind the chunk must say.
    pub index: BTreeMap<u16, Vec<MessageIndexEntry>>,
    /// First and last log time as the front says.
    pub stated_times: (u64, u64),
}

impl Chunk {
    /// Reads, decompresses and checks the chunk at `span`. The outer error is the disk's, the inner one damage.
    pub(super) fn read(source: &mut Source, span: ChunkSpan) -> std::io::Result<Result<Self, McapError>> {
        let mut record = source.read(span.offset..span.end())?;
        // The contents may be good although one of the lengths is damaged.
        if let Some(size) = span.len.checked_sub(CHUNK_FRONT as u64)
            && record.len() as u64 == RECORD_HEAD + span.len
        {
            record[1..9].copy_from_slice(&span.len.to_le_bytes());
            record[ChunkSpan::FRONT as usize - 8..ChunkSpan::FRONT as usize]
                .copy_from_slice(&size.to_le_bytes());
        }
        Ok(Self::parse(&record))
    }

    fn parse(record: &[u8]) -> Result<Self, McapError> {
        let mut chunk = Self::default();
        if let Some(body) = record.get(RECORD_HEAD as usize..)
            && let Record::Chunk { header: ChunkHeader { message_start_time, message_end_time, .. }, .. } =
                mcap::parse_record(op::CHUNK, body)?
        {
            chunk.stated_times = (message_start_time, message_end_time);
        }
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(MAX_RECORD as usize);
        let mut reader = LinearReader::new_with_options(options);
        reader.insert(record.len()).copy_from_slice(record);
        reader.notify_read(record.len());
        let mut offset = 0;
        while let Some(event) = reader.next_event() {
            match event? {
                // All there is was given: 0 more bytes mean the end.
                LinearReadEvent::ReadRequest(_) => reader.notify_read(0),
                LinearReadEvent::Record { data, opcode } => {
                    chunk.take(offset, opcode, data)?;
                    offset += RECORD_HEAD + data.len() as u64;
                }
            }
        }
        Ok(chunk)
    }

    fn take(&mut self, offset: u64, opcode: u8, body: &[u8]) -> Result<(), McapError> {
        match opcode {
            op::MESSAGE | op::CHANNEL => {}
            _ => return Ok(()),
        }
        match mcap::parse_record(opcode, body)? {
            Record::Message { header, data } => {
                let entry = MessageIndexEntry { log_time: header.log_time, offset };
                self.index.entry(header.channel_id).or_default().push(entry);
                self.messages.push(Message {
                    channel: header.channel_id,
                    sequence: header.sequence,
                    log_time: HostTime(header.log_time),
                    data: data.into_owned(),
                });
            }
            Record::Channel(channel) => self.channels.push((channel.id, channel.topic)),
            _ => {}
        }
        Ok(())
    }

    /// True when the times in the front are those of the messages (0 and 0 without messages).
    pub(super) fn times_match(&self) -> bool {
        let times = || self.messages.iter().map(|message| message.log_time.0);
        self.stated_times == (times().min().unwrap_or(0), times().max().unwrap_or(0))
    }
}
