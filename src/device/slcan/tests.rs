use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use super::*;
use crate::device::reconnect::Reconnecting;
use crate::device::testing::ManualClock;
use crate::time::Clock;

const POLL: Duration = Duration::from_millis(1);

/// How an adapter answers a command; BEL or nothing are possible, too.
type Manners = fn(&str) -> &'static [u8];

fn polite(_command: &str) -> &'static [u8] {
    b"\r"
}

/// An adapter, seen from the host: answers lines as `manners` says, and plays `pieces`.
#[derive(Debug)]
struct Adapter {
    manners: Manners,
    /// What comes next; `None` is a loss.
    pieces: VecDeque<Option<Vec<u8>>>,
    current: Vec<u8>,
    heard: Arc<Mutex<String>>,
}

impl Adapter {
    fn new(manners: Manners, pieces: &[&str]) -> Self {
        let pieces = pieces.iter().map(|piece| Some(piece.as_bytes().to_vec())).collect();
        Self { manners, pieces, current: Vec::new(), heard: Arc::default() }
    }
}

impl Link for Adapter {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        // Frames come only from an open channel: the last command was not heard as a close.
        let open = self.heard.lock().expect("whole").ends_with("O\r");
        let is_answer = self
            .pieces
            .front()
            .is_some_and(|piece| piece.as_ref().is_some_and(|bytes| bytes == b"\r" || bytes == b"\x07"));
        if !open && !is_answer {
            return Ok(None);
        }
        match self.pieces.pop_front() {
            Some(Some(bytes)) => {
                self.current = bytes;
                Ok(Some((HostTime(7), Traffic::Bytes(&self.current))))
            }
            Some(None) => {
                Err(LinkError::Lost { port: "adapter".to_owned(), source: io::ErrorKind::BrokenPipe.into() })
            }
            None => Ok(None),
        }
    }

    fn port(&self) -> Option<&str> {
        Some("/dev/ttyACM0")
    }

    fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
        let Traffic::Bytes(bytes) = traffic else { panic!("an adapter is told bytes") };
        let text = std::str::from_utf8(bytes).expect("ASCII");
        self.heard.lock().expect("whole").push_str(text);
        for line in text.split_terminator('\r') {
            let answer = (self.manners)(line);
            if !answer.is_empty() {
                self.pieces.push_front(Some(answer.to_vec()));
            }
        }
        Ok(())
    }
}

/// All frames until the first silence, as (id, extended, data).
fn all_frames(link: &mut dyn Link) -> Vec<(u32, bool, Vec<u8>)> {
    let mut frames = Vec::new();
    while let Some((at, traffic)) = link.receive(POLL).expect("connected") {
        let Traffic::CanFrame { id, extended, data } = traffic else { panic!("frames only") };
        assert_eq!(at, HostTime(7));
        frames.push((id, extended, data.to_vec()));
    }
    frames
}

#[test]
fn the_channel_is_closed_set_opened_and_closed_again() {
    let adapter = Adapter::new(polite, &["t3A02CAFE\rT1ABCDEF01", "17\rr1238\r"]);
    let heard = Arc::clone(&adapter.heard);
    let mut link = SlcanLink::open(adapter, "adapter", 500_000).expect("opens");
    assert_eq!(*heard.lock().expect("whole"), "\rC\rS6\rO\r");
    let expected = [(0x3A0, false, vec![0xCA, 0xFE]), (0x1ABC_DEF0, true, vec![0x17])];
    assert_eq!(all_frames(&mut link), expected, "a remote frame carries nothing");
    assert_eq!(link.status(), LinkStatus::default());

    heard.lock().expect("whole").clear();
    link.send(Traffic::CanFrame { id: 0x7E0, extended: false, data: &[0xCA, 0xFE] }).expect("sent");
    link.send(Traffic::CanFrame { id: 0x800, extended: false, data: &[] }).expect("dropped");
    assert_eq!(link.status().unsent, 1);
    drop(link);
    assert_eq!(*heard.lock().expect("whole"), "t7E02CAFE\rC\r");
}

#[test]
fn closing_a_closed_channel_may_be_an_error() {
    let manners: Manners = |command| if command == "C" { b"\x07" } else { b"\r" };
    let mut link = SlcanLink::open(Adapter::new(manners, &["t1230\r"]), "adapter", 10_000).expect("opens");
    assert_eq!(all_frames(&mut link), [(0x123, false, vec![])]);
    assert_eq!(link.status().bus_errors, 0);
}

#[test]
fn an_adapter_that_never_answers_is_taken_as_open() {
    // Its first frames come while an answer is waited for, and are not lost.
    let adapter = Adapter::new(|_| b"", &["t1231AA\rt1231BB\r", "t1231CC\r"]);
    let mut link = SlcanLink::open(adapter, "adapter", 1_000_000).expect("opens");
    let data: Vec<Vec<u8>> = all_frames(&mut link).into_iter().map(|(_, _, data)| data).collect();
    assert_eq!(data, [[0xAA], [0xBB], [0xCC]]);
}

#[test]
fn a_refused_bitrate_is_an_error_that_says_so() {
    let manners: Manners = |command| if command == "S7" { b"\x07" } else { b"\r" };
    let adapter = Adapter::new(manners, &[]);
    let heard = Arc::clone(&adapter.heard);
    let text = SlcanLink::open(adapter, "/dev/ttyACM0", 800_000).expect_err("refused").to_string();
    assert!(text.starts_with("/dev/ttyACM0: cannot open it: the adapter refuses `S7`\n\nhint: "), "{text}");
    assert!(heard.lock().expect("whole").ends_with("S7\rC\r"), "left closed");
    let text =
        SlcanLink::open(Adapter::new(polite, &[]), "x", 1234).expect_err("no such bitrate").to_string();
    assert!(text.starts_with("bitrate = 1234 is out of range, expected 10000, 20000"), "{text}");
}

#[test]
fn garbage_and_error_answers_are_counted() {
    let pieces = ["t1239\rt1231AA\r\x07", "nonsense\rt1231BB\r"];
    let mut link = SlcanLink::open(Adapter::new(polite, &pieces), "adapter", 500_000).expect("opens");
    assert_eq!(all_frames(&mut link).len(), 2);
    let status = link.status();
    assert_eq!((status.bytes_skipped, status.bus_errors), (15, 1));
    let words: Vec<String> = status.bus_faults.iter().map(|fault| fault.to_string()).collect();
    assert_eq!(words, ["error answer of the adapter"]);
}

#[test]
fn an_adapter_that_comes_back_is_opened_again() {
    let clock = Arc::new(ManualClock::default());
    let heard: Arc<Mutex<Vec<Arc<Mutex<String>>>>> = Arc::default();
    let adapters = Arc::clone(&heard);
    let opener = move || {
        let mut adapter = Adapter::new(polite, &["t1231AA\rjunk\r"]);
        adapter.pieces.push_back(None);
        adapters.lock().expect("whole").push(Arc::clone(&adapter.heard));
        SlcanLink::open(adapter, "adapter", 500_000)
    };
    let mut link = Reconnecting::open(opener, Arc::clone(&clock) as Arc<dyn Clock>).expect("opens");
    let mut frames = 0;
    while link.status().reconnects < 2 {
        frames += usize::from(link.receive(Duration::from_millis(50)).expect("never an error").is_some());
    }
    assert_eq!((frames, link.status().losses, link.status().bytes_skipped), (2, 2, 10));
    assert_eq!(link.port(), Some("/dev/ttyACM0"));
    for heard in heard.lock().expect("whole").iter().take(2) {
        assert_eq!(*heard.lock().expect("whole"), "\rC\rS6\rO\rC\r");
    }
}
