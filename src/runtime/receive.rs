//! The receiving thread of a live run.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossbeam_channel::{Sender, TrySendError};

use super::live::Signals;
use super::queue::{Entry, Notes, OwnedTraffic};
use super::source::{Polled, Source, SourceSink};
use crate::device::{DeviceError, Traffic};
use crate::imu::HeadSample;
use crate::time::HostTime;

/// How long the thread waits for traffic before it looks at the stop flag.
const TIMEOUT: Duration = Duration::from_millis(20);

/// Feeds `sink` from `source` until it ends or the run is stopped; `ended` then tells the control thread.
///
/// # Errors
/// The device's announced rate does not fit its line; the run is stopped.
pub(super) fn receive(
    mut source: Source,
    mut sink: ReceiveSink,
    signals: &Signals,
    ended: &AtomicBool,
) -> Result<Source, DeviceError> {
    while !signals.stop.load(Ordering::Relaxed) {
        match source.poll(TIMEOUT, &mut sink) {
            Ok(Polled::Traffic | Polled::Silence) => {}
            Ok(Polled::Ended) => break,
            Err(error) => {
                signals.stop.store(true, Ordering::Relaxed);
                return Err(error);
            }
        }
    }
    ended.store(true, Ordering::Release);
    sink.own_up();
    Ok(source)
}

/// Where a live source's output goes.
pub(super) struct ReceiveSink {
    samples: Sender<HeadSample>,
    notes: Notes,
    /// Pieces of traffic lost since the last one that went through.
    traffic_lost: u32,
}

impl ReceiveSink {
    pub(super) fn new(samples: Sender<HeadSample>, notes: Notes) -> Self {
        Self { samples, notes, traffic_lost: 0 }
    }

    /// Leaves word of lost traffic at the place where it is missing.
    fn own_up(&mut self) {
        if self.traffic_lost > 0 && self.notes.note(Entry::TrafficLost(self.traffic_lost)) {
            self.traffic_lost = 0;
        }
    }
}

impl SourceSink for ReceiveSink {
    fn traffic(&mut self, at: HostTime, traffic: Traffic<'_>) {
        self.own_up();
        let owned = match traffic {
            Traffic::Bytes(bytes) => OwnedTraffic::Bytes(bytes.into()),
            Traffic::CanFrame { id, extended, data } => {
                OwnedTraffic::Frame { id, extended, data: data.into() }
            }
        };
        if !self.notes.note(Entry::Traffic(at, owned)) {
            self.traffic_lost += 1;
        }
    }

    fn sample(&mut self, sample: HeadSample) {
        if matches!(self.samples.try_send(sample), Err(TrySendError::Full(_))) {
            self.notes.count_lost();
        }
        self.notes.note(Entry::Sample(sample));
    }

    fn event(&mut self, at: HostTime, text: &str) {
        self.notes.note(Entry::Event(at, text.to_owned()));
    }
}
