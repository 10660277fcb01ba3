//! What could be opened here: serial ports and CAN interfaces. Nothing is opened to find out.

use serde::Serialize;
use serialport::SerialPortType;

use super::Selector;
use super::find::{PortFinder, usb_at};

/// Identity of a USB device.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct UsbIdentity {
    /// Vendor id.
    pub vid: u16,
    /// Product id.
    pub pid: u16,
    /// Serial number.
    pub serial_number: Option<String>,
    /// Name of the maker.
    pub manufacturer: Option<String>,
    /// Name of the product.
    pub product: Option<String>,
}

/// What a port is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase", tag = "kind")]
pub enum PortKind {
    /// A serial port.
    Serial {
        /// Its USB device, if it is one.
        usb: Option<UsbIdentity>,
    },
    /// A SocketCAN interface.
    Can {
        /// True when it is up. The system decides who may bring it up; anybody may listen.
        up: bool,
    },
}

/// Whether this process may open a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Access {
    /// It may.
    Granted,
    /// It may not; on Linux, joining the group of the device (`dialout`) usually helps.
    Denied,
    /// This system does not tell without opening.
    Unknown,
}

/// One port or interface.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DiscoveredPort {
    /// Selector that opens it, such as `serial:/dev/ttyUSB0`.
    pub selector: String,
    /// Kind and identity.
    #[serde(flatten)]
    pub kind: PortKind,
    /// Whether this process may open it.
    pub access: Access,
}

/// Lists serial ports and CAN interfaces, by selector. An empty list is an answer, not an error.
///
/// Ports are judged by their permissions, not by opening them: opening a port raises DTR, which resets many boards.
pub fn discover() -> Vec<DiscoveredPort> {
    let mut ports: Vec<DiscoveredPort> = serialport::available_ports()
        .unwrap_or_default()
        .into_iter()
        .map(|info| {
            let access = access(&info.port_name);
            let usb = match info.port_type {
                SerialPortType::UsbPort(usb) => Some(UsbIdentity {
                    vid: usb.vid,
                    pid: usb.pid,
                    serial_number: usb.serial_number,
                    manufacturer: usb.manufacturer,
                    product: usb.product,
                }),
                _ => None,
            };
            DiscoveredPort {
                selector: format!("serial:{}", info.port_name),
                kind: PortKind::Serial { usb },
                access,
            }
        })
        .collect();
    ports.extend(can_interfaces());
    ports.sort_by(|a, b| a.selector.cmp(&b.selector));
    ports
}

/// What is known of the port `selector` names, which need not be in the list: a link to a port, a pseudo-terminal.
pub fn describe(selector: &Selector) -> DiscoveredPort {
    let ports = discover();
    match selector {
        Selector::Serial { port, .. } => {
            let node = node_of(port);
            DiscoveredPort {
                selector: format!("serial:{port}"),
                kind: PortKind::Serial { usb: usb_at(&ports, &node).cloned() },
                access: access(&node),
            }
        }
        Selector::Can { interface, .. } => {
            let selector = format!("can:{interface}");
            let listed = ports.into_iter().find(|port| port.selector == selector);
            let down = PortKind::Can { up: false };
            listed.unwrap_or(DiscoveredPort { selector, kind: down, access: Access::Granted })
        }
        other => DiscoveredPort {
            selector: other.to_string(),
            kind: PortKind::Serial { usb: None },
            access: Access::Unknown,
        },
    }
}

/// The node that `port` of a `serial:` selector stands for: `port` itself unless it is a serial number.
pub fn node_of(port: &str) -> String {
    PortFinder::new(port, discover).open(|node| Ok(node.to_owned())).unwrap_or_else(|_| port.to_owned())
}

#[cfg(not(target_os = "linux"))]
fn can_interfaces() -> Vec<DiscoveredPort> {
    Vec::new()
}

/// Asks the system, which knows of access control lists too: udev gives those to whoever sits at the machine.
#[cfg(unix)]
fn access(port: &str) -> Access {
    use rustix::fs::Access as Wanted;
    match rustix::fs::access(port, Wanted::READ_OK | Wanted::WRITE_OK) {
        Ok(()) => Access::Granted,
        Err(rustix::io::Errno::ACCESS) => Access::Denied,
        Err(_) => Access::Unknown,
    }
}

#[cfg(not(unix))]
fn access(_port: &str) -> Access {
    Access::Unknown
}

#[cfg(target_os = "linux")]
use linux::can_interfaces;
#[cfg(target_os = "linux")]
pub(super) use linux::is_up;

#[cfg(target_os = "linux")]
mod linux {
    use std::fs;
    use std::path::Path;

    use super::{Access, DiscoveredPort, PortKind};

    /// `ARPHRD_CAN`: hardware type of a CAN interface.
    const CAN_HARDWARE_TYPE: &str = "280";
    /// `IFF_UP`: the interface is up. (`operstate` is no help: virtual CAN always says "unknown".)
    const UP_FLAG: u32 = 1;

    pub(super) fn can_interfaces() -> Vec<DiscoveredPort> {
        interfaces_below(Path::new("/sys/class/net"))
    }

    pub(super) fn interfaces_below(folder: &Path) -> Vec<DiscoveredPort> {
        let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
        let mut found = Vec::new();
        for entry in entries.flatten() {
            let read = |name: &str| fs::read_to_string(entry.path().join(name)).unwrap_or_default();
            if read("type").trim() != CAN_HARDWARE_TYPE {
                continue;
            }
            found.push(DiscoveredPort {
                selector: format!("can:{}", entry.file_name().to_string_lossy()),
                kind: PortKind::Can { up: is_up(&entry.path()) == Some(true) },
                access: Access::Granted,
            });
        }
        found
    }

    /// Whether the network interface with this folder is up; `None` when there is none.
    pub(in crate::device) fn is_up(interface: &Path) -> Option<bool> {
        let flags = fs::read_to_string(interface.join("flags")).ok()?;
        let flags = u32::from_str_radix(flags.trim().trim_start_matches("0x"), 16).ok()?;
        Some(flags & UP_FLAG != 0)
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::linux::interfaces_below;
    use super::*;

    #[test]
    fn can_interfaces_are_told_from_others_with_their_state() {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, kind, flags) in
            [("can0", "280\n", "0x40080\n"), ("vcan1", "280\n", "0x400c1\n"), ("eth0", "1\n", "0x1003\n")]
        {
            let path = folder.path().join(name);
            std::fs::create_dir(&path).expect("created");
            std::fs::write(path.join("type"), kind).expect("written");
            std::fs::write(path.join("flags"), flags).expect("written");
        }
        let mut found = interfaces_below(folder.path());
        found.sort_by(|a, b| a.selector.cmp(&b.selector));
        let kinds: Vec<_> = found.into_iter().map(|port| (port.selector, port.kind)).collect();
        let expected = [("can:can0", false), ("can:vcan1", true)];
        assert_eq!(kinds, expected.map(|(selector, up)| (selector.to_owned(), PortKind::Can { up })));
    }

    #[test]
    fn access_is_what_the_system_grants() {
        use std::os::unix::fs::PermissionsExt;

        let port = tempfile::NamedTempFile::new().expect("a file");
        let path = port.path().to_str().expect("UTF-8");
        assert_eq!((access(path), access("/dev/no-such-port")), (Access::Granted, Access::Unknown));
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o400)).expect("it is ours");
        let for_others = if rustix::process::geteuid().is_root() { Access::Granted } else { Access::Denied };
        assert_eq!(access(path), for_others);
    }

    #[test]
    fn the_list_is_sorted_and_serialises() {
        let ports = discover();
        assert!(ports.windows(2).all(|pair| pair[0].selector <= pair[1].selector));
        let port = DiscoveredPort {
            selector: "serial:/dev/ttyUSB0".into(),
            kind: PortKind::Serial {
                usb: Some(UsbIdentity {
                    vid: 0x0403,
                    pid: 0x6001,
                    serial_number: None,
                    manufacturer: Some("FTDI".into()),
                    product: None,
                }),
            },
            access: Access::Denied,
        };
        let json = serde_json::to_value(&port).expect("serialises");
        assert_eq!(json["selector"], "serial:/dev/ttyUSB0");
        assert_eq!((&json["kind"], &json["access"]), (&"serial".into(), &"denied".into()));
        assert_eq!(json["usb"]["vid"], 0x0403);
    }
}
