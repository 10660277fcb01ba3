//! The nine messages of the serial line, as values: payload bytes to fields and back.

use core::fmt;

pub use crate::payload::{Ack, BATCH_MAX_ROWS, Batch16, Cmd, Hello, Sample16, SampleF32, Status, Sync, Text};
use crate::{MAX_PAYLOAD, VERSION};

/// Message types: the first byte of a frame.
pub mod kind {
    /// Identity and scales, once a second and on request.
    pub const HELLO: u8 = 0x01;
    /// One sample in sensor counts.
    pub const SAMPLE16: u8 = 0x10;
    /// Several equally spaced samples in sensor counts.
    pub const BATCH16: u8 = 0x11;
    /// One sample in SI units.
    pub const SAMPLE_F32: u8 = 0x12;
    /// Health of the device, 10 Hz.
    pub const STATUS: u8 = 0x20;
    /// Clock exchange, asked by the host, answered by the device.
    pub const SYNC: u8 = 0x21;
    /// A log line.
    pub const TEXT: u8 = 0x30;
    /// A command to the device.
    pub const CMD: u8 = 0x40;
    /// The device's answer to a command.
    pub const ACK: u8 = 0x41;
}

/// Bits of [`Status::flags`]; the low 16 also travel in CAN's TIME.
pub mod status_flag {
    /// A gyro axis reached the end of its range.
    pub const GYRO_CLIP: u32 = 1 << 0;
    /// An accelerometer axis reached the end of its range.
    pub const ACCEL_CLIP: u32 = 1 << 1;
    /// The last self-test passed.
    pub const SELF_TEST_OK: u32 = 1 << 2;
    /// The sensor's FIFO overran: samples were lost inside the sensor.
    pub const FIFO_OVERRUN: u32 = 1 << 3;
    /// The device's clock is synchronised.
    pub const TIME_SYNCHRONISED: u32 = 1 << 4;
    /// The device is calibrating: keep it still.
    pub const CALIBRATING: u32 = 1 << 5;
}

/// Values of [`Cmd::code`] and [`Ack::code`].
pub mod command {
    /// Start sending samples.
    pub const START: u8 = 1;
    /// Stop sending samples.
    pub const STOP: u8 = 2;
    /// Set the sample rate; argument in mHz.
    pub const SET_RATE: u8 = 3;
    /// Set the gyro's full scale; argument in deg/s.
    pub const SET_GYRO_RANGE: u8 = 4;
    /// Set the accelerometer's full scale; argument in g.
    pub const SET_ACCEL_RANGE: u8 = 5;
    /// Run the self-test.
    pub const SELF_TEST: u8 = 6;
    /// Keep the present settings over a power cycle.
    pub const SAVE: u8 = 7;
    /// Send a HELLO now.
    pub const SEND_HELLO: u8 = 8;
}

/// Values of [`Ack::result`].
pub mod ack_result {
    /// Done.
    pub const OK: u8 = 0;
    /// The device does not know the code.
    pub const UNKNOWN_CODE: u8 = 1;
    /// The argument is out of range; the value in force is unchanged.
    pub const OUT_OF_RANGE: u8 = 2;
    /// Try again later.
    pub const BUSY: u8 = 3;
    /// Tried and failed.
    pub const FAILED: u8 = 4;
}

/// One message. Variable parts borrow from the bytes they were read from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message<'a> {
    /// Identity and scales.
    Hello(Hello<'a>),
    /// One sample in sensor counts.
    Sample16(Sample16),
    /// Several equally spaced samples in sensor counts.
    Batch16(Batch16<'a>),
    /// One sample in SI units.
    SampleF32(SampleF32),
    /// Health of the device.
    Status(Status),
    /// Clock exchange.
    Sync(Sync),
    /// A log line.
    Text(Text<'a>),
    /// A command to the device.
    Cmd(Cmd),
    /// The device's answer to a command.
    Ack(Ack),
}

impl<'a> Message<'a> {
    /// The type byte, one of [`kind`].
    #[must_use]
    pub const fn kind(&self) -> u8 {
        match self {
            Message::Hello(_) => kind::HELLO,
            Message::Sample16(_) => kind::SAMPLE16,
            Message::Batch16(_) => kind::BATCH16,
            Message::SampleF32(_) => kind::SAMPLE_F32,
            Message::Status(_) => kind::STATUS,
            Message::Sync(_) => kind::SYNC,
            Message::Text(_) => kind::TEXT,
            Message::Cmd(_) => kind::CMD,
            Message::Ack(_) => kind::ACK,
        }
    }

    /// Reads the payload of a frame of type `kind`; any bytes are legal input.
    ///
    /// # Errors
    /// [`PayloadError`]: unknown type, a length the type does not have, or a HELLO of another version.
    pub fn decode(kind: u8, payload: &'a [u8]) -> Result<Self, PayloadError> {
        match kind {
            kind::HELLO => Hello::decode(payload).map(Message::Hello),
            kind::SAMPLE16 => Sample16::decode(payload).map(Message::Sample16),
            kind::BATCH16 => Batch16::decode(payload).map(Message::Batch16),
            kind::SAMPLE_F32 => SampleF32::decode(payload).map(Message::SampleF32),
            kind::STATUS => Status::decode(payload).map(Message::Status),
            kind::SYNC => Sync::decode(payload).map(Message::Sync),
            kind::TEXT => Ok(Message::Text(Text { bytes: payload })),
            kind::CMD => Cmd::decode(payload).map(Message::Cmd),
            kind::ACK => Ack::decode(payload).map(Message::Ack),
            _ => Err(PayloadError::UnknownType { kind }),
        }
    }

    /// Writes the payload to the front of `out` and returns its length.
    ///
    /// # Errors
    /// [`EncodeError`] if a name, text or batch does not fit one frame; `out` is then unspecified.
    pub fn encode_payload(&self, out: &mut [u8; MAX_PAYLOAD]) -> Result<usize, EncodeError> {
        match self {
            Message::Hello(hello) => hello.encode(out),
            Message::Sample16(sample) => Ok(sample.encode(out)),
            Message::Batch16(batch) => batch.encode(out),
            Message::SampleF32(sample) => Ok(sample.encode(out)),
            Message::Status(status) => Ok(status.encode(out)),
            Message::Sync(sync) => Ok(sync.encode(out)),
            Message::Text(text) => text.encode(out),
            Message::Cmd(cmd) => Ok(cmd.encode(out)),
            Message::Ack(ack) => Ok(ack.encode(out)),
        }
    }
}

/// Why the payload of a checksum-good frame could not be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PayloadError {
    /// No message of this version has this type.
    UnknownType {
        /// The type byte.
        kind: u8,
    },
    /// The type is known, but its payload has another length.
    Length {
        /// The type byte.
        kind: u8,
        /// Length that the type, or the count inside the payload, asks for.
        expected: usize,
        /// Length of the payload.
        got: usize,
    },
    /// A HELLO of another version of the format.
    Version {
        /// The version it states.
        got: u8,
    },
}

impl fmt::Display for PayloadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownType { kind } => write!(f, "unknown message type {kind:#04x}"),
            Self::Length { kind, expected, got } => {
                write!(f, "message type {kind:#04x}: payload of {got} bytes, expected {expected}")
            }
            Self::Version { got } => write!(f, "the device speaks format version {got}, expected {VERSION}"),
        }
    }
}

impl core::error::Error for PayloadError {}

/// The variable part of a message is too long for one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncodeError {
    /// The type byte.
    pub kind: u8,
    /// Length of the name or text in bytes, or number of rows of the batch.
    pub got: usize,
    /// The most that fits, in the same unit.
    pub most: usize,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, got, most } = self;
        write!(f, "message type {kind:#04x}: variable part of length {got}, at most {most} fit a frame")
    }
}

impl core::error::Error for EncodeError {}
