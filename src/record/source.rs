//! Reading pieces of a file at given places.

use std::fs::File;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// Where a recording comes from; can be opened again.
#[derive(Clone, Debug)]
pub(super) enum Origin {
    File(PathBuf),
    Memory(Arc<[u8]>),
}

trait ReadSeek: Read + Seek + Send {}
impl<T: Read + Seek + Send> ReadSeek for T {}

/// An opened [`Origin`] of known length.
pub(super) struct Source {
    reader: Box<dyn ReadSeek>,
    len: u64,
}

impl Source {
    pub(super) fn open(origin: &Origin) -> io::Result<Self> {
        let mut reader: Box<dyn ReadSeek> = match origin {
            Origin::File(path) => Box::new(File::open(path)?),
            Origin::Memory(bytes) => Box::new(Cursor::new(Arc::clone(bytes))),
        };
        let len = reader.seek(SeekFrom::End(0))?;
        Ok(Self { reader, len })
    }

    /// Length in bytes when it was opened.
    pub(super) fn len(&self) -> u64 {
        self.len
    }

    /// The bytes of `range`, less where the file ends before.
    pub(super) fn read(&mut self, range: Range<u64>) -> io::Result<Vec<u8>> {
        let end = range.end.min(self.len);
        let len = end.saturating_sub(range.start);
        let mut bytes = Vec::with_capacity(usize::try_from(len).unwrap_or(0));
        self.reader.seek(SeekFrom::Start(range.start))?;
        self.reader.by_ref().take(len).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    /// CRC-32 of the bytes of `range`.
    pub(super) fn crc(&mut self, range: Range<u64>) -> io::Result<u32> {
        const BLOCK: u64 = 1 << 20;
        let mut hasher = crc32fast::Hasher::new();
        let mut at = range.start;
        while at < range.end {
            let block = self.read(at..range.end.min(at + BLOCK))?;
            if block.is_empty() {
                break;
            }
            hasher.update(&block);
            at += block.len() as u64;
        }
        Ok(hasher.finalize())
    }
}
