//! Helpers of this layer's unit tests.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use super::buffer::TrafficBuffer;
use super::{Link, LinkError, Traffic};
use crate::time::{Clock, HostTime};

/// A clock that moves only when somebody waits on it.
#[derive(Debug, Default)]
pub(crate) struct ManualClock(AtomicU64);

impl ManualClock {
    pub(crate) fn set(&self, now: HostTime) {
        self.0.store(now.0, Ordering::SeqCst);
    }
}

impl Clock for ManualClock {
    fn now(&self) -> HostTime {
        HostTime(self.0.load(Ordering::SeqCst))
    }

    fn sleep_until(&self, deadline: HostTime) {
        self.0.fetch_max(deadline.0, Ordering::SeqCst);
    }
}

/// A link that plays a script: pieces, silences, losses; then the end of the recording.
#[derive(Debug, Default)]
pub(crate) struct ScriptLink {
    script: VecDeque<Event>,
    current: TrafficBuffer,
    pub(crate) sent: Vec<Vec<u8>>,
}

#[derive(Debug)]
pub(crate) enum Event {
    Piece(HostTime, Vec<u8>),
    Silence,
    Lost,
}

impl ScriptLink {
    pub(crate) fn new(script: impl IntoIterator<Item = Event>) -> Self {
        Self { script: script.into_iter().collect(), ..Self::default() }
    }

    /// `count` pieces of 20 bytes each, one per ms; every byte is the low part of the piece's number.
    pub(crate) fn pieces(count: u64) -> Self {
        Self::new((0..count).map(|i| Event::Piece(HostTime(i * 1_000_000), vec![i as u8; 20])))
    }
}

impl Link for ScriptLink {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        match self.script.pop_front() {
            Some(Event::Piece(at, bytes)) => {
                self.current.store(Traffic::Bytes(&bytes));
                Ok(Some((at, self.current.traffic())))
            }
            Some(Event::Silence) => Ok(None),
            Some(Event::Lost) => Err(lost()),
            None => Err(LinkError::EndOfRecording),
        }
    }

    fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
        if let Traffic::Bytes(bytes) = traffic {
            self.sent.push(bytes.to_vec());
        }
        Ok(())
    }
}

fn lost() -> LinkError {
    LinkError::Lost { port: "script".into(), source: std::io::ErrorKind::BrokenPipe.into() }
}

/// Every piece until the end of the recording, with its stamp; silences are skipped.
pub(crate) fn drain(link: &mut dyn Link) -> Vec<(HostTime, Vec<u8>)> {
    let mut pieces = Vec::new();
    loop {
        match link.receive(Duration::from_millis(10)) {
            Ok(Some((at, Traffic::Bytes(data) | Traffic::CanFrame { data, .. }))) => {
                pieces.push((at, data.to_vec()))
            }
            Ok(None) => {}
            Err(LinkError::EndOfRecording) => return pieces,
            Err(error) => panic!("{error}"),
        }
    }
}

/// The golden frames of the wire format.
pub(crate) fn golden_frames() -> serde_json::Value {
    let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/firmware-protocol/tests/golden.json"));
    serde_json::from_str(text).expect("the golden file is JSON")
}

/// Bytes of a string of hexadecimal digits.
pub(crate) fn from_hex(digits: &str) -> Vec<u8> {
    let digits = digits.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).expect("ASCII"));
    digits.map(|pair| u8::from_str_radix(pair, 16).expect("hexadecimal")).collect()
}
