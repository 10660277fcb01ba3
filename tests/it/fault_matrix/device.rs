//! A device at the end of a cable, in stream time.

use std::io::ErrorKind;
use std::sync::Arc;
use std::time::Duration;

use otolith::device::discover::{Access, DiscoveredPort, PortKind, UsbIdentity};
use otolith::device::{DeviceError, Link, LinkError, LinkStatus, Traffic};
use otolith::time::{Clock, HostTime};

use super::fault_bench::StreamClock;
use super::streams::Packet;

/// Where the device is plugged in at first.
pub(super) const NODE: &str = "/dev/ttyUSB0";
/// Where it is when it comes back as another node.
pub(super) const OTHER_NODE: &str = "/dev/ttyUSB1";

/// The link's state at a time, ms.
pub(super) type StatusAt = Arc<dyn Fn(u64) -> LinkStatus + Send + Sync>;

/// From when to when a device is unplugged, ms, and where it is found afterwards.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outage {
    pub(super) out_ms: u64,
    pub(super) back_ms: u64,
    pub(super) node: &'static str,
    /// Whether it has the serial number by which it is known again.
    pub(super) has_serial_number: bool,
}

/// Sends its packets whether somebody listens or not.
pub(super) struct Device {
    pub(super) packets: Vec<Packet>,
    pub(super) outage: Option<Outage>,
    pub(super) status: StatusAt,
    pub(super) clock: Arc<StreamClock>,
}

impl Device {
    /// Where it is plugged in.
    fn node(&self) -> Option<&'static str> {
        let now_ms = self.clock.ms();
        match self.outage {
            Some(outage) if now_ms >= outage.back_ms => Some(outage.node),
            Some(outage) if now_ms >= outage.out_ms => None,
            _ => Some(NODE),
        }
    }

    /// The list of ports.
    pub(super) fn ports(&self) -> Vec<DiscoveredPort> {
        let has_serial_number = self.outage.is_none_or(|outage| outage.has_serial_number);
        let port = self.node().map(|node| DiscoveredPort {
            selector: format!("serial:{node}"),
            kind: PortKind::Serial {
                usb: Some(UsbIdentity {
                    vid: 0x0403,
                    pid: 0x6001,
                    serial_number: has_serial_number.then(|| "A1".to_owned()),
                    manufacturer: None,
                    product: None,
                }),
            },
            access: Access::Granted,
        });
        port.into_iter().collect()
    }

    /// Opens the port at `node`. What was sent before is gone.
    pub(super) fn open(self: &Arc<Self>, node: &str) -> Result<Port, DeviceError> {
        if self.node() != Some(node) {
            return Err(DeviceError::NoSuchPort { port: node.to_owned(), hint: String::new() });
        }
        let now_ms = self.clock.ms();
        let next = self.packets.iter().position(|packet| packet.at_ms >= now_ms);
        let next = next.unwrap_or(self.packets.len());
        Ok(Port { device: Arc::clone(self), node: node.to_owned(), next })
    }
}

/// An open port: gives packets as the clock comes to them.
pub(super) struct Port {
    device: Arc<Device>,
    node: String,
    next: usize,
}

impl Link for Port {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        let Device { packets, clock, .. } = &*self.device;
        if self.device.node() != Some(&self.node) {
            return Err(LinkError::Lost { port: self.node.clone(), source: ErrorKind::BrokenPipe.into() });
        }
        let Some(packet) = packets.get(self.next).filter(|packet| packet.at_ms <= clock.ms()) else {
            return Ok(None);
        };
        self.next += 1;
        Ok(Some((clock.now(), packet.traffic())))
    }

    fn status(&self) -> LinkStatus {
        (self.device.status)(self.device.clock.ms())
    }

    fn port(&self) -> Option<&str> {
        Some(&self.node)
    }
}
