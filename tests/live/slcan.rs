//! A CAN bus behind a slcan adapter: the adapter is this test, on a pseudo-terminal.
//!
//! Light enough to run beside the other live tests.

use otolith::device::slcan::codec::{Command as SlcanCommand, MAX_LINE, SlcanFrame};
use otolith::device::{Link, Traffic};
use otolith::time::{Clock, SystemClock};
use std::sync::Arc;

use super::*;
use crate::chair_can::{Chair, Frame, candump_log};

/// Ends hangs; never decides a test.
const PATIENCE: u32 = 1000;
const POLL: Duration = Duration::from_millis(20);

/// A device that answers commands as a LAWICEL adapter does.
struct Adapter {
    port: Port,
    line: Vec<u8>,
    open: bool,
    commands: Vec<SlcanCommand>,
}

impl Adapter {
    fn plug_in(link: &Path) -> Self {
        Self { port: Port::plug_in(link), line: Vec::new(), open: false, commands: Vec::new() }
    }

    /// Reads and answers what has come.
    fn serve(&mut self) {
        let mut piece = [0; 256];
        // A terminal whose other end is not open reads as an error.
        let count = rustix::io::read(&self.port.master, &mut piece).unwrap_or(0);
        for byte in &piece[..count] {
            if *byte != b'\r' {
                self.line.push(*byte);
                continue;
            }
            let line = std::mem::take(&mut self.line);
            self.write(if self.accepts(&line) { b"\r" } else { b"\x07" });
            let command = SlcanCommand::parse(&line);
            self.open = match command {
                Some(SlcanCommand::Open) => true,
                Some(SlcanCommand::Close) => false,
                _ => self.open,
            };
            self.commands.extend(command);
        }
    }

    /// Closing a closed channel and setting the bitrate of an open one are errors.
    fn accepts(&self, line: &[u8]) -> bool {
        match SlcanCommand::parse(line) {
            Some(SlcanCommand::Close) => self.open,
            Some(SlcanCommand::Bitrate(_) | SlcanCommand::Open) => !self.open,
            Some(_) => true,
            None => line.is_empty(),
        }
    }

    fn serve_until(&mut self, what: &str, reached: impl Fn(&Self) -> bool) {
        for _ in 0..PATIENCE {
            self.serve();
            if reached(self) {
                return;
            }
            std::thread::sleep(POLL);
        }
        panic!("{what}: not seen; heard {:?}", self.commands);
    }

    fn write(&self, bytes: &[u8]) {
        // Of an adapter, too, everything must fit: this host is supposed to keep up.
        assert_eq!(rustix::io::write(&self.port.master, bytes), Ok(bytes.len()));
    }

    fn send(&self, frame: &Frame) {
        let frame = SlcanFrame::new(u32::from(frame.id), false, &frame.data).unwrap();
        let mut line = [0; MAX_LINE];
        let length = frame.encode(&mut line);
        self.write(&line[..length]);
    }

    /// Plays `frames` in real time from now on, as long as the channel is open.
    fn play(&mut self, frames: &[Frame]) {
        let start = Instant::now();
        for frame in frames {
            let due = Duration::from_micros(u64::from(frame.t_us));
            std::thread::sleep(due.saturating_sub(start.elapsed()));
            self.serve();
            if self.open {
                self.send(frame);
            }
        }
    }
}

const OPENED: [SlcanCommand; 3] = [SlcanCommand::Close, SlcanCommand::Bitrate(5), SlcanCommand::Open];

#[test]
fn a_chair_behind_a_slcan_adapter_makes_green_sway_for_20_s_and_not_a_frame_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("ttyACM");
    let chair = Chair { rate_hz: 200, spin_s: 12.0, after_s: 8.0 };
    let mut adapter = Adapter::plug_in(&link);
    let device = format!("slcan:{}?bitrate=250000", link.display());
    let program = std::thread::spawn(move || {
        let output = otolith(&["run", "--device", &device, "--duration-s", "24", "--json"]);
        (output.status.code(), summary(&output))
    });
    adapter.serve_until("an open channel", |adapter| adapter.open);
    let frames = chair.frames();
    adapter.play(&frames);
    adapter.serve_until("the channel closed at the end", |adapter| !adapter.open);
    let (code, run) = program.join().unwrap();
    println!("timing {} device {} events {}", run["timing"], run["device"], run["events"]);
    assert_eq!(code, Some(0));
    assert_eq!(adapter.commands, [&OPENED[..], &[SlcanCommand::Close]].concat());
    nothing_lost(&run);
    assert_eq!(number(&run, "/samples"), chair.samples() as f64);
    for count in ["/link/bytes_skipped", "/device/bus_errors", "/device/losses"] {
        assert_eq!(number(&run, count), 0.0, "{count}");
    }
    assert!(number(&run, "/duration_s") >= 20.0);
    let log = folder.path().join("chair.log");
    std::fs::write(&log, candump_log(&frames)).unwrap();
    let replay =
        otolith(&["run", "--device", &format!("replay:{}", log.display()), "--pace", "max", "--json"]);
    same_peaks(&run, &summary(&replay));
    assert!(number(&run, "/green/peak_com_sway_deg") > 1.0);
}

#[test]
fn an_adapter_that_is_unplugged_is_opened_again_when_it_is_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ttyACM");
    let frames = Chair { rate_hz: 200, spin_s: 1.0, after_s: 0.0 }.frames();
    let (first, second) = (frames[0], frames[1]);
    let (device_path, done) = (path.clone(), Arc::new(Mutex::new(false)));
    let host_done = Arc::clone(&done);
    let adapter = Adapter::plug_in(&path);
    let device = std::thread::spawn(move || {
        let mut adapter = adapter;
        adapter.serve_until("an open channel", |adapter| adapter.open);
        adapter.send(&first);
        // Bytes not yet read are lost with the terminal.
        adapter.serve_until("the frame taken", |_| *host_done.lock().unwrap());
        drop(adapter);
        let mut adapter = Adapter::plug_in(&device_path);
        adapter.serve_until("an open channel again", |adapter| adapter.open);
        adapter.write(b"no line of slcan\r\x07");
        adapter.send(&second);
        adapter.serve_until("the channel closed", |adapter| !adapter.open);
        adapter.commands
    });
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::start_now());
    let selector = format!("slcan:{}?bitrate=250000", path.display()).parse().unwrap();
    let mut link = otolith::device::open(&selector, &clock, None).unwrap();
    let next = |link: &mut dyn Link| {
        for _ in 0..PATIENCE {
            if let Some((_, Traffic::CanFrame { id, data, .. })) = link.receive(POLL).unwrap() {
                return (id as u16, data.to_vec());
            }
        }
        panic!("no frame");
    };
    assert_eq!(next(&mut *link), (first.id, first.data.to_vec()));
    *done.lock().unwrap() = true;
    assert_eq!(next(&mut *link), (second.id, second.data.to_vec()));
    let status = link.status();
    assert_eq!((status.losses, status.reconnects), (1, 1));
    assert_eq!((status.bytes_skipped, status.bus_errors), (17, 1));
    drop(link);
    assert_eq!(device.join().unwrap(), [&OPENED[..], &[SlcanCommand::Close]].concat());
}
