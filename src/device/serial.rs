//! Live serial ports.

use std::io::{self, Read, Write};
use std::sync::Arc;
use std::time::Duration;

use serialport::{
    ClearBuffer, DataBits, ErrorKind, FlowControl, Parity, SerialPort, SerialPortBuilder, StopBits,
};

use super::probe::Tunable;
use super::{DeviceError, Link, LinkError, LinkStatus, Traffic};
use crate::time::{Clock, HostTime};

/// Most bytes of one piece: what the kernel's line discipline can hold.
const BUFFER_BYTES: usize = 4096;
/// Longest wait for room in the output queue. A request that does not fit in time is dropped, not queued.
const WRITE_TIMEOUT: Duration = Duration::from_millis(20);

/// An open serial port, 8N1, exclusively ours.
///
/// Each read takes everything that has arrived, so a late reader catches up instead of falling behind. A read
/// that ends without bytes is silence; any error but a time-out or a signal means the port is gone.
pub struct SerialLink {
    name: String,
    port: Box<dyn SerialPort>,
    baud: u32,
    low_latency: bool,
    clock: Arc<dyn Clock>,
    buffer: Box<[u8; BUFFER_BYTES]>,
    unsent: u64,
}

impl std::fmt::Debug for SerialLink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SerialLink").field("name", &self.name).finish_non_exhaustive()
    }
}

/// Opens a port, and whether its driver has agreed to hand bytes on at once.
#[cfg(target_os = "linux")]
fn open_port(builder: SerialPortBuilder) -> serialport::Result<(Box<dyn SerialPort>, bool)> {
    let port = builder.open_native()?;
    let low_latency = super::low_latency::request(&port);
    Ok((Box::new(port), low_latency))
}

#[cfg(not(target_os = "linux"))]
fn open_port(builder: SerialPortBuilder) -> serialport::Result<(Box<dyn SerialPort>, bool)> {
    Ok((builder.open()?, false))
}

impl SerialLink {
    /// Opens `name` at `baud` bit/s and asks its driver for low latency.
    ///
    /// # Errors
    /// Missing port (with the ports that exist), no permission, in use, or what else the system said.
    pub fn open(name: &str, baud: u32, clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        let builder = serialport::new(name, baud)
            .data_bits(DataBits::Eight)
            .parity(Parity::None)
            .stop_bits(StopBits::One)
            .flow_control(FlowControl::None)
            .timeout(Duration::ZERO);
        let (port, low_latency) = open_port(builder).map_err(|error| open_error(name, &error))?;
        let buffer = Box::new([0; BUFFER_BYTES]);
        Ok(Self { name: name.to_owned(), port, baud, low_latency, clock, buffer, unsent: 0 })
    }

    fn lost(&self, source: io::Error) -> LinkError {
        LinkError::Lost { port: self.name.clone(), source }
    }

    /// Reads what is there into `buffer[filled..]`; 0 is silence.
    fn read_some(&mut self, filled: usize, timeout: Duration) -> Result<usize, LinkError> {
        self.port.set_timeout(timeout).map_err(|error| self.lost(error.into()))?;
        match self.port.read(&mut self.buffer[filled..]) {
            // End of file: the other side of a pseudo-terminal is closed.
            Ok(0) => Err(self.lost(io::ErrorKind::UnexpectedEof.into())),
            Ok(count) => Ok(count),
            Err(error) if is_silence(&error) => Ok(0),
            Err(error) => Err(self.lost(error)),
        }
    }
}

/// True for the errors that only mean "nothing in time".
fn is_silence(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

impl Link for SerialLink {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        let mut filled = self.read_some(0, timeout)?;
        if filled == 0 {
            return Ok(None);
        }
        let at = self.clock.now();
        // More may have come while the first read returned. Asked for before it is read, because a read that times
        // out costs an error with a text on the heap. An error here shows again at the next call, after the bytes
        // in hand are delivered.
        while filled < BUFFER_BYTES && self.port.bytes_to_read().is_ok_and(|waiting| waiting > 0) {
            match self.read_some(filled, Duration::ZERO) {
                Ok(0) | Err(_) => break,
                Ok(count) => filled += count,
            }
        }
        Ok(Some((at, Traffic::Bytes(&self.buffer[..filled]))))
    }

    fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
        let Traffic::Bytes(bytes) = traffic else { return Ok(()) };
        self.port.set_timeout(WRITE_TIMEOUT).map_err(|error| self.lost(error.into()))?;
        match self.port.write_all(bytes) {
            Ok(()) => Ok(()),
            Err(error) if is_silence(&error) => {
                self.unsent += 1;
                Ok(())
            }
            Err(error) => Err(self.lost(error)),
        }
    }

    fn status(&self) -> LinkStatus {
        LinkStatus { unsent: self.unsent, low_latency: self.low_latency, ..LinkStatus::default() }
    }

    fn port(&self) -> Option<&str> {
        Some(&self.name)
    }
}

impl Tunable for SerialLink {
    fn set_baud(&mut self, baud: u32) -> bool {
        if baud != self.baud {
            if self.port.set_baud_rate(baud).is_err() {
                return false;
            }
            self.baud = baud;
            // What stays in the buffer is only misread once more.
            let _kept = self.port.clear(ClearBuffer::Input);
        }
        true
    }
}

/// True when `port` is the name of a pseudo-terminal, which has no speed.
pub fn is_pseudo_terminal(port: &str) -> bool {
    std::fs::canonicalize(port).is_ok_and(|path| path.starts_with("/dev/pts"))
}

fn open_error(name: &str, error: &serialport::Error) -> DeviceError {
    let port = name.to_owned();
    match error.kind() {
        ErrorKind::Io(io::ErrorKind::NotFound) => DeviceError::NoSuchPort { port, hint: existing_ports() },
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => DeviceError::NoPermission { port },
        // serialport reports EBUSY and a failed lock with this kind, and nothing else on Unix.
        ErrorKind::NoDevice => DeviceError::Busy { port },
        kind => {
            let io_kind = if let ErrorKind::Io(kind) = kind { kind } else { io::ErrorKind::Other };
            let hint =
                "is it a serial port, and does it support this baud rate? `otolith devices` lists ports";
            DeviceError::Open {
                port,
                source: io::Error::new(io_kind, error.to_string()),
                hint: hint.to_owned(),
            }
        }
    }
}

/// Most ports named in an error text: some machines have dozens of built-in ones.
const NAMED_PORTS: usize = 8;

fn existing_ports() -> String {
    let ports = serialport::available_ports().unwrap_or_default();
    if ports.is_empty() {
        return "no serial port was found; is the device plugged in? `otolith devices` lists ports"
            .to_owned();
    }
    let names: Vec<&str> = ports.iter().map(|port| port.port_name.as_str()).take(NAMED_PORTS).collect();
    let rest = if ports.len() > NAMED_PORTS { ", ... (`otolith devices` lists all)" } else { "" };
    format!("serial ports here: {}{rest}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::SystemClock;

    fn open(name: &str) -> DeviceError {
        SerialLink::open(name, 115_200, Arc::new(SystemClock::start_now())).expect_err("cannot be opened")
    }

    #[test]
    fn a_missing_port_is_named_with_the_ports_there_are() {
        let text = open("/dev/no-such-port").to_string();
        assert!(text.starts_with("/dev/no-such-port: there is no such port\n\nhint: "), "{text}");
        assert!(text.contains("serial port"), "{text}");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_is_no_port_says_so() {
        let text = open("/dev/null").to_string();
        assert!(text.starts_with("/dev/null: cannot open it: "), "{text}");
    }

    #[test]
    fn permission_and_lock_have_their_own_texts() {
        let denied =
            serialport::Error::new(ErrorKind::Io(io::ErrorKind::PermissionDenied), "Permission denied");
        assert!(open_error("/dev/ttyUSB0", &denied).to_string().contains("usermod -aG dialout"));
        let busy = serialport::Error::new(ErrorKind::NoDevice, "Device or resource busy");
        assert!(open_error("/dev/ttyUSB0", &busy).to_string().contains("in use by another program"));
    }
}
