use std::cell::RefCell;
use std::sync::Arc;
use std::time::Duration;

use super::*;
use crate::device::discover::Access;
use crate::device::reconnect::Reconnecting;
use crate::device::testing::{Event, ManualClock, ScriptLink};
use crate::device::{Link, LinkError, Traffic};
use crate::time::{Clock, HostTime};

fn usb(node: &str, serial_number: Option<&str>) -> DiscoveredPort {
    let usb = UsbIdentity {
        vid: 0x0403,
        pid: 0x6001,
        serial_number: serial_number.map(str::to_owned),
        manufacturer: None,
        product: None,
    };
    DiscoveredPort {
        selector: format!("serial:{node}"),
        kind: PortKind::Serial { usb: Some(usb) },
        access: Access::Granted,
    }
}

/// The nodes a finder opens when the list of ports is, in turn, each of `lists`.
fn opened(port: &str, lists: &[Vec<DiscoveredPort>]) -> Vec<String> {
    let lists = RefCell::new(lists.iter().cloned());
    let mut finder = PortFinder::new(port, || lists.borrow_mut().next().expect("a list for every call"));
    let count = lists.borrow().len();
    (0..count)
        .map(|_| finder.open(|node| Ok(node.to_owned())).unwrap_or_else(|error| error.to_string()))
        .collect()
}

#[test]
fn a_device_with_a_serial_number_is_found_at_its_new_node() {
    let (a, b) = (Some("A1"), Some("B2"));
    let before = vec![usb("/dev/ttyUSB0", a), usb("/dev/ttyUSB1", b)];
    let moved = vec![usb("/dev/ttyUSB1", b), usb("/dev/ttyUSB2", a)];
    let swapped = vec![usb("/dev/ttyUSB0", b), usb("/dev/ttyUSB1", a)];
    let lists = [before, moved, swapped, vec![]];
    // The last time it is gone: all there is to try is the name that was given.
    assert_eq!(
        opened("/dev/ttyUSB0", &lists),
        ["/dev/ttyUSB0", "/dev/ttyUSB2", "/dev/ttyUSB1", "/dev/ttyUSB0"]
    );
}

#[test]
fn a_stranger_at_the_name_of_a_lost_device_is_not_opened() {
    let (ours, stranger) = (usb("/dev/ttyUSB0", Some("A1")), usb("/dev/ttyUSB0", Some("B2")));
    let back = usb("/dev/ttyUSB1", Some("A1"));
    let lists = [vec![ours], vec![stranger.clone()], vec![usb("/dev/ttyUSB0", None)], vec![stranger, back]];
    let opened = opened("/dev/ttyUSB0", &lists);
    assert_eq!((opened[0].as_str(), opened[3].as_str()), ("/dev/ttyUSB0", "/dev/ttyUSB1"));
    for refused in &opened[1..3] {
        assert!(refused.starts_with("/dev/ttyUSB0: there is no such port"), "{refused}");
    }
}

#[test]
fn a_device_without_a_serial_number_has_to_keep_its_node() {
    let lists = [vec![usb("/dev/ttyUSB0", None)], vec![usb("/dev/ttyUSB1", None)], vec![]];
    assert_eq!(opened("/dev/ttyUSB0", &lists), ["/dev/ttyUSB0"; 3]);
}

#[test]
fn a_serial_number_is_a_name() {
    let ports = |node: &str| vec![usb("/dev/ttyUSB7", Some("X")), usb(node, Some("A1"))];
    let nodes = opened("usb=A1", &[ports("/dev/ttyUSB3"), ports("/dev/ttyACM0")]);
    assert_eq!(nodes, ["/dev/ttyUSB3", "/dev/ttyACM0"]);
    let missing = opened("usb=Z9", &[ports("/dev/ttyUSB3"), vec![]]);
    assert!(missing[0].starts_with("usb=Z9: there is no such port\n\nhint: serial numbers connected: X, A1"));
    assert!(missing[1].contains("no USB serial port with a serial number"), "{}", missing[1]);
}

#[cfg(unix)]
#[test]
fn the_users_link_to_a_node_is_kept_while_it_leads_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    std::fs::write(path("ttyUSB0"), "").expect("made");
    std::os::unix::fs::symlink(path("ttyUSB0"), path("imu")).expect("linked");
    let here = vec![usb(&path("ttyUSB0"), Some("A1"))];
    let moved = vec![usb(&path("ttyUSB1"), Some("A1"))];
    let nodes = opened(&path("imu"), &[here.clone(), here, moved]);
    assert_eq!(nodes, [path("imu"), path("imu"), path("ttyUSB1")]);
}

/// A link that knows at which node it was opened.
#[derive(Debug)]
struct At(String, ScriptLink);

impl Link for At {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        self.1.receive(timeout)
    }

    fn port(&self) -> Option<&str> {
        Some(&self.0)
    }
}

#[test]
fn a_lost_device_goes_on_at_another_node() {
    let clock = Arc::new(ManualClock::default());
    let mut lists = [usb("/dev/ttyUSB0", Some("A1")), usb("/dev/ttyUSB1", Some("A1"))].into_iter();
    let mut finder = PortFinder::new("/dev/ttyUSB0", move || lists.next().into_iter().collect());
    let opener = move || {
        let events = [Event::Piece(HostTime(1), vec![7]), Event::Lost];
        finder.open(|node| Ok(At(node.to_owned(), ScriptLink::new(events))))
    };
    let mut link = Reconnecting::open(opener, Arc::clone(&clock) as Arc<dyn Clock>).expect("opens");
    assert_eq!(link.port(), Some("/dev/ttyUSB0"));
    let timeout = Duration::from_millis(100);
    assert!(link.receive(timeout).expect("up").is_some());
    while link.status().reconnects == 0 {
        assert!(link.receive(timeout).is_ok());
    }
    assert_eq!((link.port(), link.status().losses), (Some("/dev/ttyUSB1"), 1));
}
