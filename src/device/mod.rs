//! Raw traffic of a device, without meaning: bytes of a serial line, frames of a CAN bus.
//!
//! A [`Link`] delivers [`Traffic`] with its arrival time; a [`protocol::PacketDecoder`] turns it into
//! [`protocol::ImuReading`]s. Live port, recording and mock differ only in the `Link`; reconnecting, recording, pacing
//! and injecting faults are middleware over any of them, and every middleware forwards `send`, `status` and `port`.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use crate::time::{Clock, HostTime};

pub mod bandwidth;
mod buffer;
pub mod can;
pub mod configure;
pub mod discover;
pub mod doctor;
mod error;
pub mod fault;
pub mod find;
mod low_latency;
pub mod mock;
mod noise;
pub mod pacer;
pub mod probe;
pub mod protocol;
pub mod reconnect;
pub mod replay;
pub mod selector;
pub mod serial;
pub mod slcan;
mod status;
#[cfg(test)]
pub(crate) mod testing;

pub use error::DeviceError;
pub use noise::Noise;
pub use replay::LineStamper;
pub use selector::{CanDevice, Selector};
pub use status::LinkStatus;

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
        source: io::Error,
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

    /// State and losses so far. Middleware passes on, and adds to, what it wraps.
    fn status(&self) -> LinkStatus {
        LinkStatus::default()
    }

    /// Name of the port that is open, or was last; it changes when the device turns up elsewhere after a loss. `None`
    /// for what is no port.
    fn port(&self) -> Option<&str> {
        None
    }
}

impl<L: Link + ?Sized> Link for Box<L> {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        (**self).receive(timeout)
    }

    fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
        (**self).send(traffic)
    }

    fn status(&self) -> LinkStatus {
        (**self).status()
    }

    fn port(&self) -> Option<&str> {
        (**self).port()
    }
}

/// Opens what `selector` names.
///
/// Ports and CAN interfaces reconnect by themselves after a loss. Recordings and mocks deliver as fast as they are
/// asked; wrap them in [`pacer::Paced`] for real time. `stamp_line` reads the time of a line of a text log; without
/// it, lines are stamped as a serial line of the selector's baud rate would deliver them.
///
/// # Errors
/// [`DeviceError`] when the device cannot be opened now: a device that is absent from the start is the user's to
/// fix, one that goes away later is not.
pub fn open(
    selector: &Selector,
    clock: &Arc<dyn Clock>,
    stamp_line: Option<LineStamper>,
) -> Result<Box<dyn Link>, DeviceError> {
    match selector {
        Selector::Serial { port, baud } => open_serial(port, *baud, clock, None),
        Selector::Can { interface, .. } => {
            let (interface, clock) = (interface.clone(), Arc::clone(clock));
            let reopen_clock = Arc::clone(&clock);
            let opener = move || can::CanLink::open(&interface, Arc::clone(&reopen_clock));
            Ok(Box::new(reconnect::Reconnecting::open(opener, clock)?))
        }
        Selector::Slcan { port, bitrate, baud, .. } => {
            let (bitrate, baud, line_clock) = (*bitrate, *baud, Arc::clone(clock));
            let mut finder = find::PortFinder::new(port, discover::discover);
            let opener = move || {
                finder.open(|node| {
                    let line = serial::SerialLink::open(node, baud, Arc::clone(&line_clock))?;
                    slcan::SlcanLink::open(line, node, bitrate)
                })
            };
            Ok(Box::new(reconnect::Reconnecting::open(opener, Arc::clone(clock))?))
        }
        Selector::Replay { path, kind, baud } => replay::open(path, *kind, *baud, stamp_line),
        Selector::Mock(params) => Ok(Box::new(mock::MockChair::new(params.clone())?)),
    }
}

/// Opens a serial port and sets the device on it up; again after each loss of the connection.
///
/// After a loss the device may have kept the baud rate of `plan`, or have fallen back to that of the port: both are tried.
///
/// # Errors
/// As [`open`], and what [`configure::apply`] says.
pub fn open_serial(
    port: &str,
    baud: u32,
    clock: &Arc<dyn Clock>,
    plan: Option<configure::Plan>,
) -> Result<Box<dyn Link>, DeviceError> {
    let kept_baud = plan.as_ref().and_then(|plan| plan.steps.iter().rev().find_map(|step| step.baud_after));
    let mut finder = find::PortFinder::new(port, discover::discover);
    let link_clock = Arc::clone(clock);
    let open_at = move |node: &str, baud: u32| {
        let mut link = serial::SerialLink::open(node, baud, Arc::clone(&link_clock))?;
        if let Some(plan) = &plan {
            configure::apply(&mut link, node, plan, link_clock.as_ref())?;
        }
        Ok(link)
    };
    let opener = move || {
        finder.open(|node| {
            open_at(node, baud).or_else(|error| kept_baud.map_or(Err(error), |baud| open_at(node, baud)))
        })
    };
    Ok(Box::new(reconnect::Reconnecting::open(opener, Arc::clone(clock))?))
}
