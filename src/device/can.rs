//! CAN interfaces: SocketCAN on Linux, a clear refusal elsewhere.

#[cfg(target_os = "linux")]
pub use linux::CanLink;
#[cfg(not(target_os = "linux"))]
pub use unsupported::CanLink;

#[cfg(target_os = "linux")]
mod linux {
    use std::io;
    use std::sync::Arc;
    use std::time::Duration;

    use socketcan::{
        CanError, CanFrame, CanSocket, EmbeddedFrame, ExtendedId, Frame, Id, Socket, SocketOptions,
        StandardId,
    };

    use crate::device::buffer::TrafficBuffer;
    use crate::device::{DeviceError, Link, LinkError, LinkStatus, Traffic};
    use crate::time::{Clock, HostTime};

    /// Receive queue asked for, bytes. A full queue drops frames without a word, so it is made large.
    const RECEIVE_QUEUE_BYTES: usize = 1 << 20;

    /// An open SocketCAN interface, classic frames, with error frames switched on and counted.
    ///
    /// An interface that is down keeps its socket and works again when it comes up. One that was deleted (adapter
    /// unplugged) reports ENODEV a single time and is silent for ever after: that first report is a loss.
    pub struct CanLink {
        name: String,
        socket: CanSocket,
        clock: Arc<dyn Clock>,
        frame: TrafficBuffer,
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
        /// Opens the interface `name`.
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
                socket.set_error_filter_accept_all()
            };
            setup().map_err(|error| open_error(name, error))?;
            // A smaller queue than asked for is no reason to refuse: losses show in the protocol's own counts.
            let _ = socket.as_raw_socket().set_recv_buffer_size(RECEIVE_QUEUE_BYTES);
            let frame = TrafficBuffer::default();
            Ok(Self { name: name.to_owned(), socket, clock, frame, status: LinkStatus::default() })
        }

        /// Sorts an error of a read or write: `Ok` to go on (counted if it was not silence), `Err` when the
        /// interface is gone.
        fn absorb(&mut self, error: io::Error) -> Result<(), LinkError> {
            match error.kind() {
                io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted => Ok(()),
                _ if error.raw_os_error() == Some(libc::ENETDOWN) => {
                    self.status.bus_errors += 1;
                    Ok(())
                }
                _ => Err(LinkError::Lost { port: self.name.clone(), source: error }),
            }
        }

        fn count_error_frame(&mut self, error: &CanError) {
            self.status.bus_errors += 1;
            self.status.bus_off += u64::from(error.is_bus_off());
        }
    }

    impl Link for CanLink {
        fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
            // The wait has a resolution of 1 ms and rounds down: without this a short time-out would spin.
            let timeout = timeout.max(Duration::from_millis(1));
            match self.socket.read_frame_timeout(timeout) {
                Ok(CanFrame::Data(frame)) => {
                    let (id, extended) = (frame.raw_id(), frame.is_extended());
                    self.frame.store(Traffic::CanFrame { id, extended, data: frame.data() });
                    Ok(Some((self.clock.now(), self.frame.traffic())))
                }
                // A remote frame asks for data and carries none.
                Ok(CanFrame::Remote(_)) => Ok(None),
                Ok(CanFrame::Error(frame)) => {
                    self.count_error_frame(&frame.into_error());
                    Ok(None)
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
            self.status
        }
    }

    pub(super) fn open_error(name: &str, error: io::Error) -> DeviceError {
        let port = name.to_owned();
        match error.raw_os_error() {
            Some(libc::EAFNOSUPPORT) => DeviceError::Unsupported {
                port,
                problem: "this kernel has no CAN support",
                hint: "load it with `sudo modprobe can can-raw vcan`, or use a kernel that has it; \
                       `replay:FILE` plays a candump log without it",
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
}

#[cfg(not(target_os = "linux"))]
mod unsupported {
    use std::sync::Arc;
    use std::time::Duration;

    use crate::device::{DeviceError, Link, LinkError, Traffic};
    use crate::time::{Clock, HostTime};

    /// Stands for a CAN interface where there is no SocketCAN; it cannot be opened.
    #[derive(Debug)]
    pub enum CanLink {}

    impl CanLink {
        /// Always refuses.
        ///
        /// # Errors
        /// [`DeviceError::Unsupported`].
        pub fn open(name: &str, _clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
            Err(DeviceError::Unsupported {
                port: name.to_owned(),
                problem: "CAN interfaces need SocketCAN, which only Linux has",
                hint: "record with candump on Linux and use `replay:FILE`",
            })
        }
    }

    impl Link for CanLink {
        fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
            match *self {}
        }
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::io;
    use std::sync::Arc;

    use super::linux::open_error;
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
