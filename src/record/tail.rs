//! The end of a finished file: summary section, footer, closing magic.

use std::io;
use std::ops::Range;

use mcap::MAGIC;
use mcap::records::{Footer, Record, Statistics, op};

use super::chunk::{MAX_RECORD, RECORD_HEAD};
use super::source::Source;

/// Two offsets and a checksum.
const FOOTER_BODY: u64 = 20;
/// Footer record and closing magic.
const FOOTER_AND_MAGIC: u64 = RECORD_HEAD + FOOTER_BODY + MAGIC.len() as u64;
/// The data end record: the last of the data section.
pub(super) const DATA_END_RECORD: u64 = RECORD_HEAD + 4;

/// What a checked end says.
#[derive(Debug)]
pub(super) struct Tail {
    /// First byte after the data section.
    pub data_end: u64,
    /// Messages by channel, if written.
    pub statistics: Option<Statistics>,
}

/// What is wrong with the end.
#[derive(Debug)]
pub(super) struct TailDamage {
    pub bytes: Range<u64>,
    pub what: String,
}

/// Reads and checks the end of the file. The outer error is the disk's.
pub(super) fn read_tail(source: &mut Source) -> io::Result<Result<Tail, TailDamage>> {
    let len = source.len();
    let Some(footer_at) = len.checked_sub(FOOTER_AND_MAGIC) else {
        return Ok(Err(missing(len..len)));
    };
    let bytes = source.read(footer_at..len)?;
    let (record, magic) = bytes.split_at((RECORD_HEAD + FOOTER_BODY) as usize);
    let Some(footer) = parse_footer(record) else {
        return Ok(Err(missing(footer_at..len)));
    };
    if magic != MAGIC {
        return Ok(Err(missing(len - MAGIC.len() as u64..len)));
    }
    let data_end = if footer.summary_start == 0 { footer_at } else { footer.summary_start };
    if data_end > footer_at || data_end < MAGIC.len() as u64 + DATA_END_RECORD {
        let what = format!("the footer says that the summary begins at byte {data_end}: that cannot be");
        return Ok(Err(TailDamage { bytes: footer_at..len, what }));
    }
    // The checksum covers everything up to itself, with the first bytes of the footer.
    let covered = data_end..len - MAGIC.len() as u64 - 4;
    if footer.summary_crc != 0 && source.crc(covered)? != footer.summary_crc {
        let what = "the checksum of the summary section is wrong".to_owned();
        return Ok(Err(TailDamage { bytes: data_end..len, what }));
    }
    let statistics = read_statistics(source, data_end..footer_at)?;
    Ok(Ok(Tail { data_end, statistics }))
}

fn missing(bytes: Range<u64>) -> TailDamage {
    let what = "the end of the file (footer and closing magic) is missing or damaged".to_owned();
    TailDamage { bytes, what }
}

fn parse_footer(record: &[u8]) -> Option<Footer> {
    let (head, body) = record.split_at_checked(RECORD_HEAD as usize)?;
    let (opcode, len) = head.split_first()?;
    if *opcode != op::FOOTER || *len != FOOTER_BODY.to_le_bytes() {
        return None;
    }
    match mcap::parse_record(op::FOOTER, body) {
        Ok(Record::Footer(footer)) => Some(footer),
        _ => None,
    }
}

fn read_statistics(source: &mut Source, summary: Range<u64>) -> io::Result<Option<Statistics>> {
    let mut at = summary.start;
    while let Ok(head) = <[u8; 9]>::try_from(source.read(at..at + RECORD_HEAD)?) {
        let [opcode, len @ ..] = head;
        let len = u64::from_le_bytes(len);
        let next = at.saturating_add(RECORD_HEAD).saturating_add(len);
        if next > summary.end {
            break;
        }
        if opcode == op::STATISTICS && len <= MAX_RECORD {
            let body = source.read(at + RECORD_HEAD..next)?;
            return Ok(match mcap::parse_record(op::STATISTICS, &body) {
                Ok(Record::Statistics(statistics)) => Some(statistics),
                _ => None,
            });
        }
        at = next;
    }
    Ok(None)
}
