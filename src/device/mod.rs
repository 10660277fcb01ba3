//! Raw traffic of a device, without meaning: bytes of a serial line, frames of a CAN bus.
//!
//! A [`Link`] delivers [`Traffic`] with its arrival time; a [`protocol::PacketDecoder`] turns it into
//! [`protocol::ImuReading`]s. Live port, recording and mock differ only in the `Link`.

use std::time::Duration;

use crate::time::HostTime;

pub mod protocol;

/// One piece of raw traffic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traffic<'a> {
    /// Bytes of a serial line or of a text log, cut anywhere.
    Bytes(&'a [u8]),
    /// One classic CAN data frame: identifier (11 or 29 bit) and up to 8 data bytes.
    CanFrame {
        /// Identifier without flag bits.
        id: u32,
        /// True for a 29-bit identifier.
        extended: bool,
        /// Payload, at most 8 bytes.
        data: &'a [u8],
    },
}

/// Why a link has nothing more to give.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The port went away. Reopening may succeed later.
    #[error("{port}: connection lost: {source}")]
    Lost {
        /// Name of the port as the user gave it.
        port: String,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A finite source is exhausted: the normal end of a replay or of a mock run.
    #[error("end of recording")]
    EndOfRecording,
}

/// A source of raw traffic.
pub trait Link: Send {
    /// Waits at most `timeout` for the next piece of traffic.
    ///
    /// `Ok(None)` is silence; silence and garbage are not errors.
    ///
    /// # Errors
    /// [`LinkError::Lost`] when the port is gone, [`LinkError::EndOfRecording`] at the end of a finite source.
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError>;

    /// Writes bytes to the device. Only a device that has identified itself as ours is ever written to.
    ///
    /// # Errors
    /// [`LinkError::Lost`] when the port is gone. Links that cannot write accept and drop the bytes.
    fn send(&mut self, _traffic: Traffic<'_>) -> Result<(), LinkError> {
        Ok(())
    }
}

impl<L: Link + ?Sized> Link for Box<L> {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        (**self).receive(timeout)
    }

    fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
        (**self).send(traffic)
    }
}
