//! The serial backend against a real terminal: a pseudo-terminal whose other end is this test.

use std::io::ErrorKind;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use otolith::device::reconnect::Reconnecting;
use otolith::device::serial::SerialLink;
use otolith::device::{DeviceError, Link, LinkError, Selector, Traffic};
use otolith::time::{Clock, SystemClock};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// Ends hangs; never decides a test.
const PATIENCE: u32 = 500;
const POLL: Duration = Duration::from_millis(20);

/// The device's end of a pseudo-terminal, with a name for the host's end that survives a replug.
pub(crate) struct Device {
    master: OwnedFd,
    link: PathBuf,
}

impl Device {
    pub(crate) fn plug_in(folder: &Path) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
        grantpt(&master).expect("granted");
        unlockpt(&master).expect("unlocked");
        // Raw from the start: what is sent before a program opens the port must not be echoed or cooked.
        let mut settings = tcgetattr(&master).expect("a terminal");
        settings.make_raw();
        tcsetattr(&master, OptionalActions::Now, &settings).expect("set");
        let name = ptsname(&master, Vec::new()).expect("a name").into_string().expect("UTF-8");
        let link = folder.join("ttyIMU");
        // The name may still point to a terminal that is gone.
        let _ = std::fs::remove_file(&link);
        std::os::unix::fs::symlink(name, &link).expect("linked");
        Self { master, link }
    }

    pub(crate) fn port(&self) -> &str {
        self.link.to_str().expect("UTF-8")
    }

    pub(crate) fn write(&self, bytes: &[u8]) {
        let mut rest = bytes;
        while !rest.is_empty() {
            let count = rustix::io::write(&self.master, rest).expect("written");
            rest = &rest[count..];
        }
    }

    /// Everything written to the host's end so far, once nobody holds that end open any more.
    pub(crate) fn read_all(&self) -> String {
        let mut got = Vec::new();
        let mut piece = [0; 4096];
        // A terminal without its other end reads as an error, not as an end of file.
        while let Ok(count @ 1..) = rustix::io::read(&self.master, &mut piece) {
            got.extend_from_slice(&piece[..count]);
        }
        String::from_utf8_lossy(&got).into_owned()
    }

    /// The next `count` bytes written to the host's end.
    pub(crate) fn read(&self, count: usize) -> Vec<u8> {
        let mut got = vec![0; count];
        let mut filled = 0;
        while filled < count {
            filled += rustix::io::read(&self.master, &mut got[filled..]).expect("read");
        }
        got
    }
}

fn clock() -> Arc<dyn Clock> {
    Arc::new(SystemClock::start_now())
}

/// Receives until `count` bytes have come.
fn take(link: &mut dyn Link, count: usize) -> Vec<u8> {
    let mut got = Vec::new();
    for _ in 0..PATIENCE {
        if let Some((_, Traffic::Bytes(bytes))) = link.receive(POLL).expect("connected") {
            got.extend_from_slice(bytes);
        }
        if got.len() >= count {
            return got;
        }
    }
    panic!("{} of {count} bytes", got.len());
}

#[test]
fn all_bytes_arrive_intact_both_ways() {
    let folder = tempfile::tempdir().expect("a folder");
    let device = Device::plug_in(folder.path());
    let mut link = SerialLink::open(device.port(), 921_600, clock()).expect("opens");
    // Every value in every position of a frame's worth, in pieces that leave the terminal's queue room.
    let sent: Vec<u8> = (0..16_384u32).map(|i| (i + i / 256) as u8).collect();
    for piece in sent.chunks(2048) {
        device.write(piece);
        assert_eq!(take(&mut link, piece.len()), piece);
    }
    let request: Vec<u8> = (0..=255).collect();
    link.send(Traffic::Bytes(&request)).expect("sent");
    assert_eq!(device.read(request.len()), request);
    assert_eq!(link.status().unsent, 0);
}

#[test]
fn one_read_takes_everything_that_has_arrived() {
    let folder = tempfile::tempdir().expect("a folder");
    let device = Device::plug_in(folder.path());
    let mut link = SerialLink::open(device.port(), 921_600, clock()).expect("opens");
    for _ in 0..50 {
        device.write(&[7; 40]);
    }
    let mut got = 0;
    let mut pieces = 0;
    while got < 2000 && pieces < PATIENCE {
        if let Some((_, Traffic::Bytes(bytes))) = link.receive(POLL).expect("connected") {
            got += bytes.len();
            pieces += 1;
        }
    }
    // The kernel hands the bytes over in the background, so one piece is usual but two are possible.
    assert!(got == 2000 && pieces < 10, "{got} bytes in {pieces} pieces");
}

#[test]
fn silence_is_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let device = Device::plug_in(folder.path());
    let mut link = SerialLink::open(device.port(), 115_200, clock()).expect("opens");
    for timeout in [Duration::ZERO, Duration::from_millis(5)] {
        assert!(link.receive(timeout).expect("connected").is_none());
    }
}

#[test]
fn a_port_in_use_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let device = Device::plug_in(folder.path());
    let _ours = SerialLink::open(device.port(), 115_200, clock()).expect("opens");
    let error = SerialLink::open(device.port(), 115_200, clock()).expect_err("locked");
    assert!(matches!(error, DeviceError::Busy { .. }), "{error}");
}

#[test]
fn unplugging_is_a_loss() {
    let folder = tempfile::tempdir().expect("a folder");
    let device = Device::plug_in(folder.path());
    let mut link = SerialLink::open(device.port(), 115_200, clock()).expect("opens");
    drop(device.master);
    let error = (0..PATIENCE).find_map(|_| link.receive(POLL).map(|piece| assert!(piece.is_none())).err());
    let Some(LinkError::Lost { port, .. }) = error else { panic!("lost, but got {error:?}") };
    assert!(port.ends_with("ttyIMU"));
    assert!(matches!(link.send(Traffic::Bytes(&[1])), Err(LinkError::Lost { .. })));
}

#[test]
fn a_replugged_device_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let device = Device::plug_in(folder.path());
    let selector: Selector = format!("serial:{}?baud=921600", device.port()).parse().expect("a selector");
    let mut link = otolith::device::open(&selector, &clock(), None).expect("opens");
    device.write(b"before");
    assert_eq!(take(&mut link, 6), b"before");

    std::fs::remove_file(&device.link).expect("removed");
    drop(device);
    let went_down = (0..PATIENCE).any(|_| {
        assert!(link.receive(POLL).expect("a loss is silence").is_none());
        link.status().down
    });
    assert!(went_down);
    assert_eq!((link.status().losses, link.status().reconnects), (1, 0));
    assert!(link.status().last_loss.is_some_and(|kind| kind != ErrorKind::TimedOut));
    link.send(Traffic::Bytes(b"nobody is there")).expect("dropped quietly");

    let device = Device::plug_in(folder.path());
    let came_back = (0..PATIENCE).any(|_| {
        assert!(link.receive(POLL).expect("silence").is_none());
        !link.status().down
    });
    assert!(came_back);
    device.write(b"after");
    assert_eq!(take(&mut link, 5), b"after");
    assert_eq!((link.status().losses, link.status().reconnects), (1, 1));
}

#[test]
fn a_device_that_was_never_there_is_an_error() {
    let opener = || SerialLink::open("/dev/no-such-tty", 115_200, clock());
    let error = Reconnecting::open(opener, clock()).expect_err("not there").to_string();
    assert!(error.starts_with("/dev/no-such-tty: there is no such port"), "{error}");
}
