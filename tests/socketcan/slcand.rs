//! Our slcan codec as an adapter on a pseudo-terminal, the kernel's slcan driver as its host.

use std::os::fd::OwnedFd;

use otolith::device::slcan::codec::{
    Command as SlcanCommand, MAX_LINE, SlcanDecoder, SlcanEvent, SlcanFrame,
};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::*;

/// The adapter's end of the terminal.
struct Adapter {
    master: OwnedFd,
    name: String,
    received: Vec<u8>,
}

impl Adapter {
    fn new() -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
        grantpt(&master).expect("granted");
        unlockpt(&master).expect("unlocked");
        let name = ptsname(&master, Vec::new()).expect("a name").into_string().expect("UTF-8");
        Self { master, name, received: Vec::new() }
    }

    fn write(&self, text: &[u8]) {
        assert_eq!(rustix::io::write(&self.master, text).expect("written"), text.len());
    }

    /// The next line the host has written, without its end.
    fn line(&mut self) -> Vec<u8> {
        for _ in 0..PATIENCE {
            if let Some(end) = self.received.iter().position(|byte| *byte == b'\r') {
                let mut line: Vec<u8> = self.received.drain(..=end).collect();
                line.pop();
                return line;
            }
            let wait = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
            let mut waiting = [PollFd::new(&self.master, PollFlags::IN)];
            if poll(&mut waiting, Some(&wait)).expect("polled") > 0 {
                let mut piece = [0; 256];
                // Nobody has the other end open yet.
                let count = rustix::io::read(&self.master, &mut piece).unwrap_or(0);
                self.received.extend_from_slice(&piece[..count]);
            }
        }
        panic!("no line; so far {:?}", String::from_utf8_lossy(&self.received));
    }
}

fn encoded(frame: &SlcanFrame) -> Vec<u8> {
    let mut out = [0; MAX_LINE];
    let length = frame.encode(&mut out);
    out[..length].to_vec()
}

fn decoded(line: &[u8]) -> SlcanFrame {
    let mut decoder = SlcanDecoder::default();
    let events: Vec<SlcanEvent> = line.iter().chain(b"\r").filter_map(|byte| decoder.push(*byte)).collect();
    match events[..] {
        [SlcanEvent::Frame(frame)] => frame,
        _ => panic!("{events:?} of {:?}", String::from_utf8_lossy(line)),
    }
}

/// Ends `slcand` with the test, which ends its interface.
struct Slcand(Child);

impl Drop for Slcand {
    fn drop(&mut self) {
        let _ended = self.0.kill();
        let _status = self.0.wait();
    }
}

#[test]
fn the_kernels_driver_understands_our_lines_and_we_its() {
    let Some(_turn) = turn() else { return };
    let mut adapter = Adapter::new();
    let _slcand = Slcand(
        command(&format!("slcand -F -o -c -s6 -S 115200 {} slcan0", adapter.name))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("started"),
    );
    for expected in [SlcanCommand::Close, SlcanCommand::Bitrate(6), SlcanCommand::Open] {
        assert_eq!(SlcanCommand::parse(&adapter.line()), Some(expected));
        adapter.write(b"\r");
    }
    wait_until("the interface", || Path::new("/sys/class/net/slcan0").exists());
    run("ip link set slcan0 up");
    let interface = Interface("slcan0");
    let mut candump = Candump::listen("slcan0");
    interface.wait_for_listener();

    // Ours to the kernel.
    let frames = [
        (SlcanFrame::new(0x7E0, false, &[0xCA, 0xFE]), "7E0#CAFE"),
        (SlcanFrame::new(0x1234_5678, true, &[1, 2, 3, 4, 5, 6, 7, 8]), "12345678#0102030405060708"),
        (SlcanFrame::new(5, true, &[]), "00000005#"),
        (SlcanFrame::remote(0x123, false, 4), "123#R4"),
        (SlcanFrame::remote(0x1ABC_DEF0, true, 0), "1ABCDEF0#R"),
    ];
    for (frame, expected) in frames {
        adapter.write(&encoded(&frame.expect("fits")));
        assert_eq!(candump.next(), expected);
    }

    // The kernel's to us. The next frame waits until the last has been taken.
    for (text, id, extended, remote, data) in [
        ("7E0#CAFE", 0x7E0, false, false, &[0xCA, 0xFE][..]),
        ("12345678#1122334455667788", 0x1234_5678, true, false, &[17, 34, 51, 68, 85, 102, 119, 136]),
        ("123#R8", 0x123, false, true, &[]),
        ("00000123#R", 0x123, true, true, &[]),
    ] {
        run(&format!("cansend slcan0 {text}"));
        let frame = decoded(&adapter.line());
        assert_eq!((frame.id, frame.extended, frame.remote, frame.data()), (id, extended, remote, data));
        adapter.write(b"\r");
    }

    // A real socket on it.
    let mut link = interface.open();
    adapter.write(b"t1231AA\r");
    assert_eq!(next(&mut link), (0x123, false, vec![0xAA]));
    println!("{:?}", otolith::device::can::can_details("slcan0"));
}
