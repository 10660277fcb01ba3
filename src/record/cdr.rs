//! The little-endian CDR encoding of ROS 2: values at multiples of their size, counted after a 4-byte header.

/// Marks plain little-endian CDR: the first bytes of every message.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Why a message could not be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum DecodeError {
    #[error("it is not little-endian CDR")]
    Encapsulation,
    #[error("it ends after {have} bytes, expected at least {need}")]
    Short { need: usize, have: usize },
    #[error("{extra} bytes follow its last field")]
    Trailing { extra: usize },
    #[error("its layout is version {got}, this program reads version {expected}")]
    Layout { got: u8, expected: u8 },
    #[error("{field} is {value}, which means nothing")]
    Code { field: &'static str, value: u8 },
    #[error("its text is not UTF-8")]
    Text,
}

/// Appends one message to a buffer.
pub(super) struct CdrWriter<'a> {
    bytes: &'a mut Vec<u8>,
}

impl<'a> CdrWriter<'a> {
    /// Starts a message in `bytes`, whose old contents go.
    pub(super) fn start(bytes: &'a mut Vec<u8>) -> Self {
        bytes.clear();
        bytes.extend_from_slice(&ENCAPSULATION);
        Self { bytes }
    }

    fn put<const N: usize>(&mut self, value: [u8; N]) {
        let body = self.bytes.len() - ENCAPSULATION.len();
        self.bytes.resize(ENCAPSULATION.len() + body.next_multiple_of(N), 0);
        self.bytes.extend_from_slice(&value);
    }

    pub(super) fn u8(&mut self, value: u8) {
        self.put([value]);
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.put(value.to_le_bytes());
    }

    pub(super) fn i32(&mut self, value: i32) {
        self.put(value.to_le_bytes());
    }

    pub(super) fn u64(&mut self, value: u64) {
        self.put(value.to_le_bytes());
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.put(value.to_bits().to_le_bytes());
    }

    /// A sequence of bytes: its length, then the bytes. Beyond 4 GiB it is cut.
    pub(super) fn sequence(&mut self, value: &[u8]) {
        let len = u32::try_from(value.len()).unwrap_or(u32::MAX);
        self.u32(len);
        self.bytes.extend_from_slice(&value[..len as usize]);
    }

    /// A text: its length with the closing zero byte, the bytes, the zero byte.
    pub(super) fn string(&mut self, value: &str) {
        let len = u32::try_from(value.len() + 1).unwrap_or(u32::MAX);
        self.u32(len);
        self.bytes.extend_from_slice(&value.as_bytes()[..len as usize - 1]);
        self.bytes.push(0);
    }
}

/// Reads one message field by field.
pub(super) struct CdrReader<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> CdrReader<'a> {
    pub(super) fn start(message: &'a [u8]) -> Result<Self, DecodeError> {
        match message.strip_prefix(&ENCAPSULATION) {
            Some(body) => Ok(Self { body, at: 0 }),
            None => Err(DecodeError::Encapsulation),
        }
    }

    fn slice(&mut self, len: usize) -> Result<&'a [u8], DecodeError> {
        let end = self.at.saturating_add(len);
        let short = DecodeError::Short { need: end, have: self.body.len() };
        let slice = self.body.get(self.at..end).ok_or(short)?;
        self.at = end;
        Ok(slice)
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        self.at = self.at.next_multiple_of(N);
        let mut value = [0; N];
        value.copy_from_slice(self.slice(N)?);
        Ok(value)
    }

    pub(super) fn u8(&mut self) -> Result<u8, DecodeError> {
        self.take::<1>().map(|[value]| value)
    }

    pub(super) fn bool(&mut self, field: &'static str) -> Result<bool, DecodeError> {
        match self.u8()? {
            0 => Ok(false),
            1 => Ok(true),
            value => Err(DecodeError::Code { field, value }),
        }
    }

    pub(super) fn u32(&mut self) -> Result<u32, DecodeError> {
        self.take().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, DecodeError> {
        self.take().map(u64::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Result<f64, DecodeError> {
        self.u64().map(f64::from_bits)
    }

    pub(super) fn sequence(&mut self) -> Result<&'a [u8], DecodeError> {
        let len = self.u32()?;
        self.slice(len as usize)
    }

    pub(super) fn string(&mut self) -> Result<&'a str, DecodeError> {
        let bytes = self.sequence()?;
        let text = bytes.strip_suffix(&[0]).ok_or(DecodeError::Text)?;
        std::str::from_utf8(text).map_err(|_| DecodeError::Text)
    }

    /// Checks that nothing follows the last field.
    pub(super) fn finish(self) -> Result<(), DecodeError> {
        match self.body.len() - self.at {
            0 => Ok(()),
            extra => Err(DecodeError::Trailing { extra }),
        }
    }
}
