//! A SocketCAN interface as a link.

use std::io;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use socketcan::{
    CanFrame, CanSocket, EmbeddedFrame, ExtendedId, Frame, Id, Socket, SocketOptions, StandardId,
};

use super::bus::BusState;
use super::stamp::ArrivalTimes;
use crate::device::buffer::TrafficBuffer;
use crate::device::discover::is_up;
use crate::device::{DeviceError, Link, LinkError, LinkStatus, Traffic};
use crate::time::{Clock, HostTime, age_of};

/// Receive queue asked for, bytes. A full queue drops frames, so it is made large.
const RECEIVE_QUEUE_BYTES: usize = 1 << 20;
/// How often, at most, the kernel is asked what it does not tell with the frames.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// Words of the kernel's answer to `SO_MEMINFO` (`linux/sock_diag.h`).
const MEMINFO_WORDS: usize = 9;

/// An open SocketCAN interface, classic frames, with error frames switched on and counted by what they say.
///
/// Frames carry the kernel's receive stamp, on our clock. An interface that is down keeps its socket and works again
/// when it comes up. One that was deleted (adapter unplugged) reports ENODEV a single time and is silent for ever
/// after: that first report is a loss, once the frames that came before it are read. Frames the kernel drops because its queue is full are not announced; their
/// number is asked for (`SO_MEMINFO`), and the protocol's own counts tell which are missing.
pub struct CanLink {
    name: String,
    socket: CanSocket,
    clock: Arc<dyn Clock>,
    frame: TrafficBuffer,
    arrivals: ArrivalTimes,
    next_look: HostTime,
    /// The interface was deleted; a loss as soon as the queue is empty.
    gone: Option<io::Error>,
    status: LinkStatus,
}

impl std::fmt::Debug for CanLink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CanLink")
            .field("name", &self.name)
            .field("status", &self.status)
            .finish_non_exhaustive()
    }
}

impl CanLink {
    /// Opens the interface `name`. One that is down opens, and says so in its status.
    ///
    /// # Errors
    /// No CAN in the kernel, no such interface, or what else the system said.
    pub fn open(name: &str, clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        // Index 0 is "any interface": this fails exactly when the kernel has no CAN, which a look-up of the
        // name would report as a missing interface.
        CanSocket::open_iface(0).map_err(|error| open_error(name, error))?;
        let socket = CanSocket::open(name).map_err(|error| open_error(name, error))?;
        let setup = || -> io::Result<()> {
            socket.set_nonblocking(true)?;
            socket.set_recv_timestamp(true)?;
            socket.set_error_filter_accept_all()
        };
        setup().map_err(|error| open_error(name, error))?;
        // A smaller queue than asked for is no reason to refuse: losses are counted.
        let _ = socket.as_raw_socket().set_recv_buffer_size(RECEIVE_QUEUE_BYTES);
        Ok(Self {
            name: name.to_owned(),
            socket,
            clock,
            frame: TrafficBuffer::default(),
            arrivals: ArrivalTimes::default(),
            next_look: HostTime::default(),
            gone: None,
            status: LinkStatus::default(),
        })
    }

    /// Sorts an error of a read or write: `Ok` to go on (counted if it was not silence), `Err` when the socket is of
    /// no use any more.
    fn absorb(&mut self, error: io::Error) -> Result<(), LinkError> {
        match error.kind() {
            io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted => Ok(()),
            // Something that is no classic frame.
            io::ErrorKind::InvalidData => {
                self.status.bus_errors += 1;
                Ok(())
            }
            _ if error.raw_os_error() == Some(libc::ENETDOWN) => {
                self.status.bus_errors += 1;
                self.status.bus_state = BusState::InterfaceDown;
                Ok(())
            }
            _ if matches!(error.raw_os_error(), Some(libc::ENODEV | libc::ENXIO)) => {
                // What had arrived before is still to be read. Without a kind of its own it would be an
                // "uncategorized error" in the events.
                self.gone = Some(io::Error::new(io::ErrorKind::NotFound, error));
                Ok(())
            }
            _ => Err(self.lost(error)),
        }
    }

    fn lost(&self, source: io::Error) -> LinkError {
        LinkError::Lost { port: self.name.clone(), source }
    }

    /// Waits until there is something to read, `timeout` at most. A signal ends the wait early, which is silence
    /// like any other: the caller asks again.
    fn wait(&self, timeout: Duration) -> io::Result<()> {
        let timeout = Timespec::try_from(timeout).map_err(|_| io::ErrorKind::InvalidInput)?;
        poll(&mut [PollFd::new(&self.socket, PollFlags::IN)], Some(&timeout))?;
        Ok(())
    }

    /// Asks for what the kernel does not tell by itself: frames dropped, and an interface that is up again.
    fn look_around(&mut self) {
        let now = self.clock.now();
        if now < self.next_look {
            return;
        }
        self.next_look = now + LOOK_EVERY;
        self.status.overflowed = self.dropped_by_kernel().unwrap_or(self.status.overflowed);
        if self.status.bus_state == BusState::InterfaceDown
            && is_up(&Path::new("/sys/class/net").join(&self.name)) == Some(true)
        {
            // A controller starts with its counters at zero.
            self.status.bus_state = BusState::ErrorActive;
        }
    }

    /// Frames this socket has lost to a full queue; `None` on a kernel before 4.12.
    fn dropped_by_kernel(&self) -> Option<u64> {
        let mut words = [0; 4 * MEMINFO_WORDS];
        let length =
            self.socket.get_socket_option_bytes(libc::SOL_SOCKET, libc::SO_MEMINFO, &mut words).ok()?;
        let dropped = words.get(..length)?.last_chunk::<4>()?;
        (length == words.len()).then(|| u64::from(u32::from_ne_bytes(*dropped)))
    }

    /// Takes in a frame of the queue; true if it is one to hand on.
    fn take(&mut self, frame: &CanFrame) -> bool {
        match frame {
            CanFrame::Data(frame) => {
                let (id, extended) = (frame.raw_id(), frame.is_extended());
                self.frame.store(Traffic::CanFrame { id, extended, data: frame.data() });
                self.status.note_data_frame();
                true
            }
            // A remote frame asks for data and carries none.
            CanFrame::Remote(_) => false,
            CanFrame::Error(frame) => {
                self.status.note_error_frame(frame.error_bits(), frame.data());
                false
            }
        }
    }
}

impl Link for CanLink {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        self.look_around();
        let mut read = self.socket.read_frame_with_timestamps();
        if matches!(&read, Err(error) if error.kind() == io::ErrorKind::WouldBlock) {
            if let Some(error) = self.gone.take() {
                return Err(self.lost(error));
            }
            read = self.wait(timeout).and_then(|()| self.socket.read_frame_with_timestamps());
        }
        match read {
            Ok((frame, stamps)) => {
                // The wall clock first: what comes between the two readings makes a frame late, never early.
                let age = stamps.socket.and_then(age_of);
                let at = self.arrivals.arrival(self.clock.now(), age);
                Ok(self.take(&frame).then(|| (at, self.frame.traffic())))
            }
            Err(error) => self.absorb(error).map(|()| None),
        }
    }

    fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
        let Traffic::CanFrame { id, extended, data } = traffic else { return Ok(()) };
        let id: Option<Id> = if extended {
            ExtendedId::new(id).map(Id::from)
        } else {
            u16::try_from(id).ok().and_then(StandardId::new).map(Id::from)
        };
        let Some(frame) = id.and_then(|id| CanFrame::new(id, data)) else {
            self.status.unsent += 1;
            return Ok(());
        };
        let Err(error) = self.socket.write_frame(&frame) else { return Ok(()) };
        self.status.unsent += 1;
        // A full output queue is no reason to give up the interface.
        if error.raw_os_error() == Some(libc::ENOBUFS) {
            return Ok(());
        }
        self.absorb(error)
    }

    fn status(&self) -> LinkStatus {
        LinkStatus { stamps_refused: self.arrivals.refused(), ..self.status }
    }
}

fn open_error(name: &str, error: io::Error) -> DeviceError {
    let port = name.to_owned();
    match error.raw_os_error() {
        Some(libc::EAFNOSUPPORT) => DeviceError::Unsupported {
            port,
            problem: "this kernel has no CAN support",
            hint: "load it with `sudo modprobe can can-raw vcan`, or use a kernel that has it; \
                   `slcan:PORT` needs no CAN in the kernel, `replay:FILE` plays a candump log",
        },
        Some(libc::ENODEV) => {
            let hint = format!(
                "`ip link` lists interfaces; bring a real one up with \
                 `sudo ip link set {name} up type can bitrate 500000`, or make a virtual one with \
                 `sudo ip link add {name} type vcan && sudo ip link set {name} up`"
            );
            DeviceError::NoSuchPort { port, hint }
        }
        _ => DeviceError::Open {
            port,
            source: error,
            hint: "`ip -details link` shows the state of the interface".to_owned(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::SystemClock;

    #[test]
    fn open_errors_say_what_to_do() {
        for (code, expected) in [
            (libc::EAFNOSUPPORT, "can0: this kernel has no CAN support\n\nhint: load it with `sudo modprobe"),
            (libc::ENODEV, "can0: there is no such port\n\nhint: `ip link` lists interfaces"),
            (libc::EPERM, "can0: cannot open it: "),
        ] {
            let text = open_error("can0", io::Error::from_raw_os_error(code)).to_string();
            assert!(text.starts_with(expected), "{text}");
        }
    }

    #[test]
    fn a_missing_interface_is_an_error() {
        let clock = Arc::new(SystemClock::start_now());
        let text = CanLink::open("no-such-can", clock).expect_err("there is none").to_string();
        assert!(text.contains("no-such-can: ") && text.contains("\n\nhint: "), "{text}");
    }
}
