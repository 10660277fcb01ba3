//! Ctrl-C while `otolith perceive` reads from a pipe.

use std::fs::File;
use std::io::Write;
use std::process::{Child, Command};
use std::time::Duration;

use otolith::time::{Clock, SystemClock};

use super::Place;
use crate::observer_cases::named;
use crate::observer_golden::head_motion_csv;

/// Ends a hang; never decides a test.
const PATIENCE: u32 = 400;

/// The program on a pipe that has given five rows, and its partial output is there.
struct OnPipe {
    child: Child,
    input: File,
    rows: Vec<String>,
    clock: SystemClock,
}

impl OnPipe {
    fn begin(place: &Place) -> Self {
        let made = Command::new("mkfifo").arg(place.path("in.csv")).status().expect("mkfifo exists");
        assert!(made.success());
        let child = place.spawn(&["perceive", "in.csv", "--out", "out.csv"]);
        let mut input = File::options().write(true).open(place.path("in.csv")).expect("is read");
        let csv = head_motion_csv(&named("e_roll30"), 100);
        let rows: Vec<String> = csv.split_inclusive('\n').map(str::to_owned).collect();
        input.write_all(rows[..5].concat().as_bytes()).expect("taken");
        let on_pipe = Self { child, input, rows, clock: SystemClock::start_now() };
        let begun = (0..PATIENCE).any(|_| {
            on_pipe.wait();
            place.names().iter().any(|name| name.ends_with(".partial"))
        });
        assert!(begun, "{:?}", place.names());
        on_pipe
    }

    fn wait(&self) {
        self.clock.sleep_until(self.clock.now() + Duration::from_millis(10));
    }

    fn interrupt(&self) {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args(["-INT", &pid]).status().expect("kill exists").success());
    }
}

#[test]
fn ctrl_c_leaves_no_file_behind() {
    let place = Place::new();
    let mut on_pipe = OnPipe::begin(&place);
    on_pipe.interrupt();
    // The program sees it at the next row; the signal is taken in by a thread, which may need a moment.
    let mut next = (5..on_pipe.rows.len()).cycle();
    while on_pipe.input.write_all(on_pipe.rows[next.next().expect("endless")].as_bytes()).is_ok() {
        on_pipe.wait();
    }
    let output = on_pipe.child.wait_with_output().expect("ends");
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("stopped before the end; out.csv was not written\n\nhint: "), "{stderr}");
    assert_eq!(place.names(), ["in.csv"]);
}

/// A pipe that gives no more rows: the first Ctrl-C waits for one, the second does not.
#[test]
fn a_second_ctrl_c_leaves_no_file_behind_either() {
    let place = Place::new();
    let mut on_pipe = OnPipe::begin(&place);
    let ended = (0..PATIENCE).find_map(|_| {
        on_pipe.interrupt();
        on_pipe.wait();
        on_pipe.child.try_wait().expect("it is ours")
    });
    assert_eq!(ended.and_then(|status| status.code()), Some(130));
    assert_eq!(place.names(), ["in.csv"]);
}
