//! CAN through a serial adapter that speaks slcan (CANable, USBtin, LAWICEL and many others): no CAN in the kernel and
//! no root needed.

pub mod codec;

use std::io;
use std::time::Duration;

use codec::{Command, MAX_LINE, SlcanDecoder, SlcanEvent, SlcanFrame};

use super::can::bus::BusFault;
use super::{DeviceError, Link, LinkError, LinkStatus, Traffic};
use crate::time::HostTime;

/// Bitrate of a `slcan:` selector that gives none: the most common one.
pub const DEFAULT_BITRATE: u32 = 500_000;
/// Baud rate of a `slcan:` selector that gives none. Adapters on native USB take any.
pub const DEFAULT_BAUD: u32 = 115_200;

/// Silence after which a line has nothing more to say about what it was told before.
const SETTLED: Duration = Duration::from_millis(100);
/// Pieces taken, at most, until the line has settled.
const SETTLING_PIECES: usize = 20;
/// Wait for one piece of the answer to a command.
const ANSWER_WAIT: Duration = Duration::from_millis(50);
/// Pieces, or silences, looked at for an answer. Some adapters never answer, which is no reason to refuse them.
const ANSWER_PIECES: usize = 4;

/// A CAN bus behind a slcan adapter on `line`, a link of bytes.
///
/// Opening closes the adapter's channel (another program may have left it open), sets the bitrate and opens the
/// channel; dropping closes it. This is all that is ever written without being asked to: the adapter is part of the
/// link, and the devices behind it get nothing. An open channel acknowledges the frames of others, as every node does.
///
/// Frames are stamped when their bytes arrive. Stamps of the adapter (`Z1`) are understood and ignored: 1 ms is coarser
/// than our protocol's own clock, and they wrap every 60 s. They are never switched on, as they cost line capacity.
/// Lines that are nothing known are counted in `bytes_skipped`, error answers in `bus_errors`.
#[derive(Debug)]
pub struct SlcanLink<L: Link> {
    line: L,
    decoder: SlcanDecoder,
    /// Bytes received and not yet decoded, from `next` on, and when they came.
    pending: Vec<u8>,
    next: usize,
    at: HostTime,
    /// The frame handed out, or `held` while the adapter is being opened.
    frame: SlcanFrame,
    held: bool,
    status: LinkStatus,
}

/// What became of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    Accepted,
    Refused,
    Silence,
}

impl<L: Link> SlcanLink<L> {
    /// Opens the adapter's channel at `bitrate`, bit/s. `name` is for error texts.
    ///
    /// # Errors
    /// [`DeviceError::Range`] for a bitrate slcan has no command for, [`DeviceError::Open`] when the adapter refuses it,
    /// [`DeviceError::Lost`] when it goes away meanwhile. An adapter that does not answer is taken as open.
    pub fn open(line: L, name: &str, bitrate: u32) -> Result<Self, DeviceError> {
        let set_bitrate = Command::bitrate(bitrate).ok_or_else(|| DeviceError::Range {
            what: "bitrate".to_owned(),
            got: bitrate.to_string(),
            expected: codec::bitrate_list(),
        })?;
        let mut link = Self {
            line,
            decoder: SlcanDecoder::default(),
            pending: Vec::new(),
            next: 0,
            at: HostTime::default(),
            frame: SlcanFrame::default(),
            held: false,
            status: LinkStatus::default(),
        };
        let refused = link.set_up(set_bitrate).map_err(|error| DeviceError::Lost {
            port: name.to_owned(),
            source: io::Error::other(error.to_string()),
            hint: "the adapter went away while it was opened; check its plug".to_owned(),
        })?;
        match refused {
            None => Ok(link),
            Some(command) => Err(DeviceError::Open {
                port: name.to_owned(),
                source: io::Error::other(format!("the adapter refuses `{command}`")),
                hint: format!(
                    "it may not know this bitrate ({bitrate} bit/s), or be no slcan adapter; `serial:{name}` is for IMUs \
                     on the serial line itself"
                ),
            }),
        }
    }

    /// Close, bitrate, open. Gives the command that was refused, if one was.
    fn set_up(&mut self, set_bitrate: Command) -> Result<Option<Command>, LinkError> {
        // The first line end ends whatever half line a program before us may have left in the adapter.
        self.line.send(Traffic::Bytes(b"\r"))?;
        self.line.send(Traffic::Bytes(Command::Close.line().as_bytes()))?;
        // Adapters differ in what they answer to these two, and frames may still be on their way: none of it may be
        // taken for the answer to what follows.
        for _ in 0..SETTLING_PIECES {
            if self.line.receive(SETTLED)?.is_none() {
                break;
            }
        }
        for command in [set_bitrate, Command::Open] {
            if self.ask(command)? == Answer::Refused {
                return Ok(Some(command));
            }
        }
        Ok(None)
    }

    /// Sends a command and waits for the answer. A frame ends the wait too: the channel is open.
    fn ask(&mut self, command: Command) -> Result<Answer, LinkError> {
        self.line.send(Traffic::Bytes(command.line().as_bytes()))?;
        for _ in 0..ANSWER_PIECES {
            self.take_piece(ANSWER_WAIT)?;
            while let Some(event) = self.next_event() {
                match event {
                    SlcanEvent::Accepted => return Ok(Answer::Accepted),
                    SlcanEvent::Refused => return Ok(Answer::Refused),
                    SlcanEvent::Frame(frame) if command == Command::Open && !frame.remote => {
                        self.frame = frame;
                        self.held = true;
                        return Ok(Answer::Accepted);
                    }
                    SlcanEvent::Frame(_) | SlcanEvent::Skipped(_) => {}
                }
            }
        }
        Ok(Answer::Silence)
    }

    /// Takes the next piece of the line into `pending`, which must be used up.
    fn take_piece(&mut self, timeout: Duration) -> Result<(), LinkError> {
        self.pending.clear();
        self.next = 0;
        if let Some((at, Traffic::Bytes(bytes))) = self.line.receive(timeout)? {
            self.pending.extend_from_slice(bytes);
            self.at = at;
        }
        Ok(())
    }

    /// Decodes `pending` up to the next event.
    fn next_event(&mut self) -> Option<SlcanEvent> {
        while let Some(&byte) = self.pending.get(self.next) {
            self.next += 1;
            if let Some(event) = self.decoder.push(byte) {
                return Some(event);
            }
        }
        None
    }

    /// The next data frame in `pending`, into `frame`. What comes before it is counted.
    fn next_frame(&mut self) -> bool {
        while let Some(event) = self.next_event() {
            match event {
                SlcanEvent::Frame(frame) if !frame.remote => {
                    self.frame = frame;
                    return true;
                }
                // A remote frame asks for data and carries none; an accepted frame or command is as it should be.
                SlcanEvent::Frame(_) | SlcanEvent::Accepted => {}
                SlcanEvent::Refused => {
                    self.status.bus_errors += 1;
                    self.status.bus_faults.insert(BusFault::AdapterError);
                }
                SlcanEvent::Skipped(count) => self.status.bytes_skipped += count as u64,
            }
        }
        false
    }
}

impl<L: Link> Link for SlcanLink<L> {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        let mut found = std::mem::take(&mut self.held) || self.next_frame();
        if !found {
            self.take_piece(timeout)?;
            found = self.next_frame();
        }
        let SlcanFrame { id, extended, .. } = self.frame;
        Ok(found.then(|| (self.at, Traffic::CanFrame { id, extended, data: self.frame.data() })))
    }

    fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
        let Traffic::CanFrame { id, extended, data } = traffic else { return Ok(()) };
        let Some(frame) = SlcanFrame::new(id, extended, data) else {
            self.status.unsent += 1;
            return Ok(());
        };
        let mut line = [0; MAX_LINE];
        let length = frame.encode(&mut line);
        self.line.send(Traffic::Bytes(&line[..length]))
    }

    fn status(&self) -> LinkStatus {
        self.line.status().after(&self.status)
    }

    fn port(&self) -> Option<&str> {
        self.line.port()
    }
}

impl<L: Link> Drop for SlcanLink<L> {
    fn drop(&mut self) {
        // A port that is gone has no channel to close.
        let _gone = self.line.send(Traffic::Bytes(Command::Close.line().as_bytes()));
    }
}

#[cfg(test)]
mod tests;
