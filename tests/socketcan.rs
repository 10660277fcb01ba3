//! The CAN backend and the program against a real kernel and the programs of can-utils.
//!
//! This needs root and a kernel with CAN; the tests run where the environment variable `VCAN` says that both are there,
//! as in the guest of `.ci/uml/uml-run`. Each makes an interface of its own, and they run one at a time: the guest has one
//! slow CPU. Times are printed, never asserted.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::expect_used)]
// Waits for other programs.
#![allow(clippy::disallowed_methods)]

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, Once};
use std::time::Duration;

use otolith::device::can::CanLink;
use otolith::device::{Link, Traffic};
use otolith::time::{Clock, SystemClock};
use serde_json::Value;

#[path = "common/chair_can.rs"]
mod chair_can;
#[path = "common/fault_bench.rs"]
mod fault_bench;
#[path = "socketcan/link.rs"]
mod link;
#[path = "socketcan/matrix.rs"]
mod matrix;
#[path = "socketcan/program.rs"]
mod program;
#[path = "socketcan/slcand.rs"]
mod slcand;

/// Ends hangs; never decides a test.
const PATIENCE: u32 = 1500;
const POLL: Duration = Duration::from_millis(20);

fn clock() -> Arc<dyn Clock> {
    Arc::new(SystemClock::start_now())
}

static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
static SAID: Once = Once::new();

/// Where there is a kernel with CAN: the right to use it. Says so if not, once and past the harness, which shows the
/// output of failed tests only.
fn turn() -> Option<MutexGuard<'static, ()>> {
    if std::env::var_os("VCAN").is_none() {
        SAID.call_once(|| {
            let why = "VCAN is not set, which says that the kernel has CAN and that we are root";
            let _ = writeln!(std::io::stderr(), "skipped: all of socketcan: {why} (`.ci/run socketcan`)");
        });
        return None;
    }
    // A test that failed leaves nothing behind.
    Some(ONE_AT_A_TIME.lock().unwrap_or_else(|poisoned| poisoned.into_inner()))
}

fn command(line: &str) -> Command {
    let mut words = line.split_whitespace();
    let mut command = Command::new(words.next().expect("a program"));
    command.args(words);
    command
}

fn run(line: &str) {
    let done = command(line).status().expect("started");
    assert!(done.success(), "{line}: {done}");
}

/// Waits for something that will come.
fn wait_until(what: &str, mut happened: impl FnMut() -> bool) {
    for _ in 0..PATIENCE {
        if happened() {
            return;
        }
        std::thread::sleep(POLL);
    }
    panic!("{what}: not seen");
}

/// A virtual interface that goes with the test.
struct Interface(&'static str);

impl Interface {
    fn make(name: &'static str) -> Self {
        run(&format!("ip link add {name} type vcan"));
        run(&format!("ip link set {name} up"));
        Self(name)
    }

    fn open(&self) -> CanLink {
        CanLink::open(self.0, clock()).expect("opens")
    }

    /// Waits until somebody receives everything on this interface.
    fn wait_for_listener(&self) {
        wait_until("a listener", || {
            let lists = std::fs::read_to_string("/proc/net/can/rcvlist_all").expect("readable");
            lists.lines().any(|line| line.split_whitespace().next() == Some(self.0))
        });
    }
}

impl Drop for Interface {
    fn drop(&mut self) {
        // Fails when the test has deleted it already.
        let _ = Command::new("ip").args(["link", "delete", self.0]).output();
    }
}

/// The next frame, whatever silences come before it.
fn next(link: &mut dyn Link) -> (u32, bool, Vec<u8>) {
    for _ in 0..PATIENCE {
        if let Some((_, Traffic::CanFrame { id, extended, data })) = link.receive(POLL).expect("up") {
            return (id, extended, data.to_vec());
        }
    }
    panic!("no frame");
}

/// `candump` on an interface, ended with the test.
struct Candump {
    child: Child,
    lines: std::io::Lines<BufReader<std::process::ChildStdout>>,
}

impl Candump {
    fn listen(interface: &str) -> Self {
        let mut child =
            command(&format!("candump -L {interface}")).stdout(Stdio::piped()).spawn().expect("started");
        let lines = BufReader::new(child.stdout.take().expect("piped")).lines();
        Self { child, lines }
    }

    /// The frame of its next line, as `cansend` takes it.
    fn next(&mut self) -> String {
        let line = self.lines.next().expect("candump goes on").expect("text");
        line.split_whitespace().nth(2).unwrap_or_else(|| panic!("{line}")).to_owned()
    }
}

impl Drop for Candump {
    fn drop(&mut self) {
        let _ended = self.child.kill();
        let _status = self.child.wait();
    }
}

/// The program on a device, in real time.
struct Program {
    child: Child,
}

impl Program {
    fn start(device: &str) -> Self {
        let child = Command::new(env!("CARGO_BIN_EXE_otolith"))
            // Ended by a signal; the duration ends hangs.
            .args(["run", "--device", device, "--json", "--duration-s", "200"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("started");
        Self { child }
    }

    fn signal(&self, name: &str) {
        run(&format!("kill -{name} {}", self.child.id()));
    }

    /// Gives it time to take in what was sent, and ends it as Ctrl-C does: exit code and summary.
    fn end(self) -> (Option<i32>, Value) {
        std::thread::sleep(Duration::from_secs(3));
        self.signal("INT");
        let output = self.child.wait_with_output().expect("ended");
        let stderr = String::from_utf8_lossy(&output.stderr);
        let summary: Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {stderr}"));
        let facts = ["timing", "link", "device", "events"].map(|key| summary[key].to_string());
        println!("{}", facts.join("\n"));
        (output.status.code(), summary)
    }
}

fn number(value: &Value, path: &str) -> f64 {
    value.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} in {value}"))
}

/// Writes a log for `canplayer`.
fn write_log(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("written");
    path
}
