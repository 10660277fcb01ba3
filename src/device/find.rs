//! Which node to open: the one that was named, or the one at which a USB device turned up again.

use std::fs;
use std::path::{Path, PathBuf};

use super::DeviceError;
use super::discover::{DiscoveredPort, PortKind, UsbIdentity};

/// A port named by this and a serial number is whichever node the USB device with that number has.
const USB_PREFIX: &str = "usb=";

/// Opens a serial port, and the same USB device again when its node has another name.
///
/// A device without a serial number cannot be told from another of its kind: its node has to keep its name. Names below
/// `/dev/serial/by-id` do.
#[derive(Debug)]
pub struct PortFinder<F> {
    /// The port as the user named it.
    port: String,
    /// The device behind it, once it was open.
    known: Option<UsbIdentity>,
    list: F,
}

impl<F: FnMut() -> Vec<DiscoveredPort>> PortFinder<F> {
    /// A finder for `port`; `list` tells which ports there are.
    pub fn new(port: &str, list: F) -> Self {
        Self { port: port.to_owned(), known: None, list }
    }

    /// Opens the port with `open`, which is given a node.
    ///
    /// # Errors
    /// What `open` says, or [`DeviceError::NoSuchPort`] when no device has the serial number asked for, or another device
    /// has taken the name of the one that was open.
    pub fn open<L>(&mut self, open: impl FnOnce(&str) -> Result<L, DeviceError>) -> Result<L, DeviceError> {
        let ports = (self.list)();
        let node = self.node(&ports)?;
        let link = open(&node)?;
        if let Some(found) = usb_at(&ports, &node).filter(|usb| usb.serial_number.is_some()) {
            self.known = Some(found.clone());
        }
        Ok(link)
    }

    /// The node to open now.
    fn node(&self, ports: &[DiscoveredPort]) -> Result<String, DeviceError> {
        if let Some(node) = self.known.as_ref().and_then(|known| node_of(ports, |usb| is_same(usb, known))) {
            // The user's own name for it, if it still leads there.
            let still_leads_there = canonical(&self.port) == canonical(node);
            return Ok(if still_leads_there { self.port.clone() } else { node.to_owned() });
        }
        let node = match self.port.strip_prefix(USB_PREFIX) {
            Some(serial_number) => {
                let is_wanted = |usb: &UsbIdentity| usb.serial_number.as_deref() == Some(serial_number);
                node_of(ports, is_wanted).map(str::to_owned)
            }
            // Another device may have taken the name of the one that is gone.
            None if self.known.is_some() && usb_at(ports, &self.port).is_some() => None,
            None => Some(self.port.clone()),
        };
        node.ok_or_else(|| DeviceError::NoSuchPort { port: self.port.clone(), hint: serial_numbers(ports) })
    }
}

/// Whether two USB devices are one: same maker, product and serial number.
fn is_same(one: &UsbIdentity, other: &UsbIdentity) -> bool {
    let key = |usb: &UsbIdentity| (usb.vid, usb.pid, usb.serial_number.clone());
    one.serial_number.is_some() && key(one) == key(other)
}

/// Every USB serial port: its node and its device.
fn usb_ports(ports: &[DiscoveredPort]) -> impl Iterator<Item = (&str, &UsbIdentity)> {
    ports.iter().filter_map(|port| match &port.kind {
        PortKind::Serial { usb: Some(usb) } => Some((port.selector.strip_prefix("serial:")?, usb)),
        _ => None,
    })
}

/// The first node whose device is the one wanted. A device with two ports has two nodes; the first one is taken.
fn node_of(ports: &[DiscoveredPort], is_wanted: impl Fn(&UsbIdentity) -> bool) -> Option<&str> {
    usb_ports(ports).find(|(_, usb)| is_wanted(usb)).map(|(node, _)| node)
}

/// The USB device at a node, which may be named by a link.
pub(super) fn usb_at<'a>(ports: &'a [DiscoveredPort], node: &str) -> Option<&'a UsbIdentity> {
    let node = canonical(node);
    usb_ports(ports).find(|(other, _)| canonical(other) == node).map(|(_, usb)| usb)
}

/// A path without links; what does not exist stays as it is.
fn canonical(path: &str) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| Path::new(path).to_owned())
}

fn serial_numbers(ports: &[DiscoveredPort]) -> String {
    let known: Vec<&str> = usb_ports(ports).filter_map(|(_, usb)| usb.serial_number.as_deref()).collect();
    if known.is_empty() {
        return "no USB serial port with a serial number is connected; `otolith devices --list` lists ports"
            .to_owned();
    }
    format!("serial numbers connected: {}", known.join(", "))
}

#[cfg(test)]
mod tests;
