//! The CAN backend against a real kernel. Each test makes a virtual interface of its own, which needs root and a
//! kernel with CAN; they run where the environment variable `VCAN` says that both are there.

use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use otolith::device::can::CanLink;
use otolith::device::{Link, LinkError, Selector, Traffic};
use otolith::time::{Clock, SystemClock};

/// Ends hangs; never decides a test.
const PATIENCE: u32 = 500;
const POLL: Duration = Duration::from_millis(20);

fn clock() -> Arc<dyn Clock> {
    Arc::new(SystemClock::start_now())
}

fn run(command: &str) {
    let mut words = command.split_whitespace();
    let program = words.next().expect("a program");
    let done = Command::new(program).args(words).status().expect("started");
    assert!(done.success(), "{command}: {done}");
}

/// A virtual interface that goes with the test.
struct Interface(&'static str);

impl Interface {
    /// `None`, with a note, where there is no CAN.
    fn make(name: &'static str) -> Option<Self> {
        if std::env::var_os("VCAN").is_none() {
            crate::say_skipped("no virtual CAN bus (VCAN is not set)");
            return None;
        }
        run(&format!("ip link add {name} type vcan"));
        run(&format!("ip link set {name} up"));
        Some(Self(name))
    }

    fn open(&self) -> CanLink {
        CanLink::open(self.0, clock()).expect("opens")
    }
}

impl Drop for Interface {
    fn drop(&mut self) {
        // Fails when the test has deleted it already.
        let _ = Command::new("ip").args(["link", "delete", self.0]).output();
    }
}

const FRAME: Traffic<'static> =
    Traffic::CanFrame { id: 0x3A0, extended: false, data: &[1, 2, 3, 4, 5, 6, 7, 8] };

/// The next frame, whatever silences come before it.
fn next(link: &mut dyn Link) -> (u32, bool, Vec<u8>) {
    for _ in 0..PATIENCE {
        if let Some((_, Traffic::CanFrame { id, extended, data })) = link.receive(POLL).expect("up") {
            return (id, extended, data.to_vec());
        }
    }
    panic!("no frame");
}

#[test]
fn frames_pass_between_two_sockets() {
    let Some(interface) = Interface::make("otolith0") else { return };
    let (mut a, mut b) = (interface.open(), interface.open());
    a.send(FRAME).expect("sent");
    assert_eq!(next(&mut b), (0x3A0, false, vec![1, 2, 3, 4, 5, 6, 7, 8]));
    a.send(Traffic::CanFrame { id: 0x1ABC_DEF0, extended: true, data: &[] }).expect("sent");
    assert_eq!(next(&mut b), (0x1ABC_DEF0, true, vec![]));
    assert!(b.receive(Duration::from_millis(5)).expect("up").is_none());
    a.send(Traffic::CanFrame { id: 0x800, extended: false, data: &[] }).expect("dropped");
    assert_eq!(a.status().unsent, 1);
}

#[test]
fn error_frames_are_counted() {
    let Some(interface) = Interface::make("otolith1") else { return };
    let mut link = interface.open();
    run("cansend otolith1 20000040#0000000000000000");
    run("cansend otolith1 3A0#11");
    assert_eq!(next(&mut link), (0x3A0, false, vec![0x11]));
    assert_eq!((link.status().bus_errors, link.status().bus_off), (1, 1));
}

#[test]
fn an_interface_that_was_down_goes_on_with_the_same_socket() {
    let Some(interface) = Interface::make("otolith2") else { return };
    let (mut a, mut b) = (interface.open(), interface.open());
    run("ip link set otolith2 down");
    assert!(b.receive(POLL).expect("down is no loss").is_none());
    assert_eq!(b.status().bus_errors, 1);
    a.send(FRAME).expect("given up quietly");
    run("ip link set otolith2 up");
    a.send(FRAME).expect("sent");
    assert_eq!(next(&mut b).0, 0x3A0);
}

#[test]
fn a_deleted_interface_is_lost_and_found_again() {
    let Some(interface) = Interface::make("otolith3") else { return };
    let mut raw = interface.open();
    let selector: Selector = "can:otolith3".parse().expect("a selector");
    let mut link = otolith::device::open(&selector, &clock(), None).expect("opens");
    run("ip link delete otolith3");
    // The kernel tells that it went down, then that it is gone.
    let error = (0..PATIENCE).find_map(|_| raw.receive(POLL).map(|piece| assert!(piece.is_none())).err());
    assert!(matches!(error, Some(LinkError::Lost { .. })), "{error:?}");
    assert!((0..PATIENCE).any(|_| link.receive(POLL).expect("silence").is_none() && link.status().down));

    let back = Interface::make("otolith3").expect("made before");
    let came_back =
        (0..PATIENCE).any(|_| link.receive(POLL).expect("silence").is_none() && !link.status().down);
    assert!(came_back);
    back.open().send(FRAME).expect("sent");
    assert_eq!(next(&mut link).0, 0x3A0);
    assert_eq!((link.status().losses, link.status().reconnects), (1, 1));
}
