//! The tolerant walk over a whole file: what is good, what is damaged, and where.

use std::collections::BTreeMap;
use std::io;
use std::ops::Range;

use mcap::records::{MessageIndexEntry, Record, op};
use mcap::{MAGIC, McapError};

use super::census::Census;
use super::chunk::{Chunk, ChunkSpan, MAX_RECORD, RECORD_HEAD};
use super::damage::Finding;
use super::source::Source;
use super::tail::{DATA_END_RECORD, Tail, read_tail};

/// What a walk found.
#[derive(Debug, Default)]
pub(super) struct Contents {
    pub chunks: Vec<ChunkSpan>,
    /// Texts of attachments by name.
    pub attachments: BTreeMap<String, String>,
    pub census: Census,
    pub findings: Vec<Finding>,
}

/// Walks over all of `source`. The outer error is the disk's; the inner one: this is no MCAP file.
pub(super) fn scan(source: &mut Source) -> io::Result<Result<Contents, NotMcap>> {
    let mut contents = Contents::default();
    let start = source.read(0..MAGIC.len() as u64)?;
    if start != MAGIC {
        // One damaged byte must not make a recording unreadable: ours go on with a header record.
        let header = source.read(MAGIC.len() as u64..MAGIC.len() as u64 + RECORD_HEAD)?;
        let whole = header.first() == Some(&op::HEADER) && header.ends_with(&[0; 6]);
        if !whole {
            return Ok(Err(NotMcap));
        }
        contents.find(0..MAGIC.len() as u64, "the opening magic is wrong");
    }
    let tail = read_tail(source)?;
    let limit = tail.as_ref().map_or(source.len(), |tail| tail.data_end);
    let mut walk = Walk {
        at: MAGIC.len() as u64,
        verified: MAGIC.len() as u64,
        limit,
        finished: tail.is_ok(),
        open_index: Some(BTreeMap::new()),
        findings_before_chunk: 0,
        source,
        contents,
    };
    let reached_end = walk.run()?;
    let mut contents = walk.contents;
    match tail {
        Ok(Tail { statistics: Some(statistics), .. }) => contents.census.expect_totals(&statistics),
        Ok(_) => {}
        Err(damage) if reached_end => contents.find(damage.bytes, &damage.what),
        // The walk has said where the file ends early.
        Err(_) => {}
    }
    Ok(Ok(contents))
}

/// The file does not begin like an MCAP file.
#[derive(Debug)]
pub(super) struct NotMcap;

impl Contents {
    fn find(&mut self, bytes: Range<u64>, what: &str) {
        self.findings.push(Finding { offset: bytes.start, end: bytes.end, what: what.to_owned() });
    }
}

/// What one record in the data section turned out to be.
enum Step {
    /// Fine or damaged inside; the next record begins there.
    Next(u64),
    /// The data end record.
    End,
    /// Not a record that can stand there: something here or before has broken the chain of lengths.
    Broken,
}

struct Walk<'a> {
    source: &'a mut Source,
    contents: Contents,
    /// Where the next record should begin.
    at: u64,
    /// Everything before was checked: a search for the next chunk begins here.
    verified: u64,
    /// First byte after the data section if known, else the length of the file.
    limit: u64,
    /// True when the end of the file is whole.
    finished: bool,
    /// Message index records that must follow the last chunk; `None` behind a damaged one: nobody knows.
    open_index: Option<BTreeMap<u16, Vec<MessageIndexEntry>>>,
    /// Number of findings when the last good chunk was counted.
    findings_before_chunk: usize,
}

impl Walk<'_> {
    /// Walks to the data end record; false when there is none.
    fn run(&mut self) -> io::Result<bool> {
        while self.at < self.limit {
            match self.record()? {
                Step::Next(next) => self.at = next,
                Step::End => return Ok(true),
                Step::Broken => {
                    if !self.resume()? {
                        return Ok(false);
                    }
                }
            }
        }
        Ok(self.ends_early(self.limit))
    }

    /// Goes on behind a broken record: at the next good chunk, or at the end of the data. False when neither is left.
    fn resume(&mut self) -> io::Result<bool> {
        if let Some((span, chunk)) = self.next_chunk(self.verified)? {
            let damaged = self.verified.min(self.at)..span.offset.max(self.at + ChunkSpan::FRONT);
            self.contents.find(damaged, "broken records");
            self.accept(span, chunk);
            self.at = span.end();
            return Ok(true);
        }
        let data_end = self.limit.saturating_sub(DATA_END_RECORD);
        if self.finished && self.at < data_end {
            self.contents.find(self.verified..data_end, "broken records");
            self.at = data_end;
            return Ok(true);
        }
        Ok(self.ends_early(self.verified))
    }

    /// Notes that the data section lacks its end, with nothing readable from `from` on; always false.
    fn ends_early(&mut self, from: u64) -> bool {
        if self.finished {
            let last = from.min(self.limit - DATA_END_RECORD);
            self.contents.find(last..self.limit, "the record that ends the data is damaged");
        } else {
            let what = "the file ends early: it was cut, or the recording was not finished";
            self.contents.find(from..self.limit, what);
        }
        false
    }

    /// Looks at the record at `self.at`.
    fn record(&mut self) -> io::Result<Step> {
        let body_at = self.at + RECORD_HEAD;
        let Ok(head) = <[u8; 9]>::try_from(self.source.read(self.at..body_at)?) else {
            return Ok(Step::Broken);
        };
        let [opcode, len @ ..] = head;
        let len = u64::from_le_bytes(len);
        let next = body_at.saturating_add(len);
        if next > self.limit || len > MAX_RECORD {
            return Ok(Step::Broken);
        }
        if opcode == op::CHUNK {
            return self.chunk(next);
        }
        let body = self.source.read(body_at..next)?;
        match (opcode, mcap_record(opcode, &body)) {
            (op::ATTACHMENT, _) => self.attachment(&body, next),
            // No checksum of their own: the one of the data section tells whether they are right.
            (op::HEADER, Some(Record::Header(_))) if self.at == MAGIC.len() as u64 => {}
            (op::METADATA, Some(Record::Metadata(_))) => {}
            (op::MESSAGE_INDEX, Some(Record::MessageIndex(index))) => {
                if body.len() != 6 + 16 * index.records.len() {
                    return Ok(Step::Broken);
                }
                let fits = self.open_index.as_mut().is_none_or(|open| {
                    open.remove(&index.channel_id).is_some_and(|entries| entries == index.records)
                });
                if !fits {
                    self.contents.find(self.at..next, "a message index does not fit the chunk before it");
                }
            }
            (op::DATA_END, Some(Record::DataEnd(end))) if body.len() == 4 && self.may_end(next) => {
                self.data_end(end.data_section_crc)?;
                return Ok(Step::End);
            }
            _ => return Ok(Step::Broken),
        }
        Ok(Step::Next(next))
    }

    /// The data section may end at `next`: where the checked end of the file says, if there is one.
    fn may_end(&self, next: u64) -> bool {
        !self.finished || next == self.limit
    }

    fn chunk(&mut self, next: u64) -> io::Result<Step> {
        let front = self.source.read(self.at..self.at + ChunkSpan::FRONT)?;
        let Some([span, _]) = ChunkSpan::parse(self.at, &front).filter(|[shorter, longer]| shorter == longer)
        else {
            return Ok(Step::Broken);
        };
        match Chunk::read(self.source, span)? {
            Ok(chunk) => self.accept(span, chunk),
            Err(error) => {
                self.open_index = None;
                self.contents.find(self.at..next, &format!("a chunk is damaged: {}", describe(&error)));
            }
        }
        Ok(Step::Next(next))
    }

    /// Takes the contents of a good chunk.
    fn accept(&mut self, span: ChunkSpan, mut chunk: Chunk) {
        if !chunk.times_match() {
            self.contents.find(span.offset..span.offset + ChunkSpan::FRONT, "the times of a chunk are wrong");
        }
        self.open_index = Some(std::mem::take(&mut chunk.index));
        self.verified = span.end();
        let damage_known = self.contents.findings.len() > self.findings_before_chunk;
        for what in self.contents.census.count(&chunk, damage_known) {
            self.contents.find(span.offset..span.end(), &what);
        }
        self.findings_before_chunk = self.contents.findings.len();
        self.contents.chunks.push(span);
    }

    fn attachment(&mut self, body: &[u8], next: u64) {
        match parse_attachment(body) {
            Some((name, text)) => {
                self.contents.attachments.insert(name, text);
                self.verified = next;
            }
            None => self.contents.find(self.at..next, "an attachment is damaged"),
        }
    }

    fn data_end(&mut self, stated_crc: u32) -> io::Result<()> {
        let known = !self.contents.findings.is_empty();
        if stated_crc != 0 && !known && self.source.crc(0..self.at)? != stated_crc {
            let what =
                "the checksum of the data section is wrong although all chunks and attachments are right";
            self.contents.find(0..self.at + DATA_END_RECORD, what);
        }
        Ok(())
    }

    /// The first chunk at or after `from` whose contents check.
    fn next_chunk(&mut self, from: u64) -> io::Result<Option<(ChunkSpan, Chunk)>> {
        const WINDOW: u64 = 1 << 16;
        let mut at = from;
        while at < self.limit {
            // Fronts that straddle two windows are seen whole in the first.
            let bytes = self.source.read(at..self.limit.min(at + WINDOW + ChunkSpan::FRONT))?;
            let starts =
                bytes.iter().take(WINDOW as usize).enumerate().filter(|(_, byte)| **byte == op::CHUNK);
            for (index, _) in starts {
                let spans = ChunkSpan::parse(at + index as u64, &bytes[index..]);
                for span in spans.into_iter().flatten().filter(|span| span.fits(self.limit)) {
                    if let Ok(chunk) = Chunk::read(self.source, span)? {
                        return Ok(Some((span, chunk)));
                    }
                }
            }
            at += WINDOW;
        }
        Ok(None)
    }
}

/// The record, where the library can parse it safely and whole.
fn mcap_record(opcode: u8, body: &[u8]) -> Option<Record<'_>> {
    match opcode {
        op::HEADER | op::METADATA | op::MESSAGE_INDEX | op::DATA_END => mcap::parse_record(opcode, body).ok(),
        _ => None,
    }
}

fn describe(error: &McapError) -> String {
    match error {
        McapError::BadChunkCrc { .. } => "its checksum is wrong".to_owned(),
        error => error.to_string(),
    }
}

/// Name and text of an attachment whose checksum is right. (The library's parser trusts lengths too much.)
fn parse_attachment(body: &[u8]) -> Option<(String, String)> {
    let (fields, crc) = body.split_last_chunk::<4>()?;
    if crc32fast::hash(fields) != u32::from_le_bytes(*crc) {
        return None;
    }
    let (_times, rest) = fields.split_at_checked(16)?;
    let (name, rest) = split_string(rest)?;
    let (_media_type, rest) = split_string(rest)?;
    let (len, data) = rest.split_first_chunk::<8>()?;
    (u64::from_le_bytes(*len) == data.len() as u64).then_some(())?;
    Some((name.to_owned(), String::from_utf8_lossy(data).into_owned()))
}

fn split_string(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (len, rest) = bytes.split_first_chunk::<4>()?;
    let (text, rest) = rest.split_at_checked(u32::from_le_bytes(*len) as usize)?;
    Some((std::str::from_utf8(text).ok()?, rest))
}
