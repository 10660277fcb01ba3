//! The receiving thread of a live run.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender, TrySendError};

use super::live::Signals;
use super::queue::{Entry, Notes, OwnedTraffic};
use super::source::{Polled, Source, SourceSink};
use super::status::LiveStatus;
use crate::device::{DeviceError, Traffic};
use crate::imu::HeadSample;
use crate::time::{Clock, HostTime};

/// How long the thread waits for traffic before it looks at the stop flag.
const TIMEOUT: Duration = Duration::from_millis(20);

/// Feeds `sink` from `source` until it ends or the run is stopped; `ended` then tells the control thread. `clock` is the one
/// that stamps the traffic. What is wrong meanwhile stands in `status`.
///
/// # Errors
/// The device's announced rate does not fit its line; the run is stopped.
pub(super) fn receive(
    mut source: Source,
    mut sink: ReceiveSink,
    clock: &dyn Clock,
    signals: &Signals,
    status: &LiveStatus,
    ended: &AtomicBool,
) -> Result<Source, DeviceError> {
    while !signals.stop.load(Ordering::Relaxed) {
        let polled = source.poll(TIMEOUT, &mut sink);
        if let Ok(Polled::Silence) = polled {
            source.note_silence(clock.now(), &mut sink);
        }
        status.store_troubles(source.troubles().collect());
        match polled {
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
    /// The far end of the queue of samples: where the oldest is taken out when it is full.
    oldest: Receiver<HeadSample>,
    notes: Notes,
    /// Pieces of traffic lost since the last one that went through.
    traffic_lost: u32,
}

impl ReceiveSink {
    /// A sink whose samples go into the queue `samples`, of which `oldest` is the far end.
    pub(super) fn new(samples: Sender<HeadSample>, oldest: Receiver<HeadSample>, notes: Notes) -> Self {
        Self { samples, oldest, notes, traffic_lost: 0 }
    }

    /// Puts a sample into the queue. Control needs what is true now: a full queue loses its oldest sample, so that a
    /// stall leaves a gap behind and not a delay ahead.
    fn hand_over(&mut self, mut sample: HeadSample) {
        while let Err(TrySendError::Full(returned)) = self.samples.try_send(sample) {
            if self.oldest.try_recv().is_ok() {
                self.notes.count_lost();
            }
            sample = returned;
        }
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
        self.hand_over(sample);
        self.notes.note(Entry::Sample(sample));
    }

    fn event(&mut self, at: HostTime, text: &str) {
        self.notes.note(Entry::Event(at, text.to_owned()));
    }
}

#[cfg(test)]
mod tests {
    use crossbeam_channel::bounded;
    use nalgebra::Vector3;

    use super::*;
    use crate::device::protocol::native_serial::NativeSerialDecoder;
    use crate::device::replay::RawReplay;
    use crate::imu::{Calibration, ImuPipeline, ImuSettings, Mount};
    use crate::runtime::trouble::Trouble;
    use crate::time::SystemClock;
    use crate::vestibular::HeadMotion;

    const STILL: HeadMotion =
        HeadMotion { omega_head: Vector3::new(0.0, 0.0, 0.0), gif_head: Vector3::new(0.0, 0.0, -9.81) };

    #[test]
    fn a_full_queue_loses_its_oldest_samples_and_counts_them() {
        let (samples_in, samples_out) = bounded(4);
        let (notes, _entries) = Notes::queue();
        let lost = notes.lost();
        let mut sink = ReceiveSink::new(samples_in, samples_out.clone(), notes);
        for at in 0..10 {
            sink.sample(HeadSample { at: HostTime(at), motion: STILL });
        }
        let left: Vec<u64> = samples_out.try_iter().map(|sample| sample.at.0).collect();
        assert_eq!((left, lost.load(Ordering::Relaxed)), (vec![6, 7, 8, 9], 6));
    }

    #[test]
    fn what_is_wrong_with_the_device_stands_in_the_status() {
        let pipeline =
            ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), 9.81);
        let bytes = &b"\x00\x05\x11\x22\x33\x44\x00\x05\x11\x22\x33\x44\x00"[..];
        let link = Box::new(RawReplay::new("damaged".to_owned(), bytes, 115_200));
        let source = Source::new(link, Box::new(NativeSerialDecoder::new()), pipeline, None);
        let (samples_in, samples_out) = bounded(4);
        let (notes, _entries) = Notes::queue();
        let (status, ended) = (LiveStatus::default(), AtomicBool::new(false));
        let sink = ReceiveSink::new(samples_in, samples_out, notes);
        let clock = SystemClock::start_now();
        let source = receive(source, sink, &clock, &Signals::default(), &status, &ended).expect("it ends");
        assert!(source.troubles().eq(status.load().troubles.iter()));
        assert!(status.load().troubles.contains(Trouble::DamagedPackets), "{:?}", source.facts().decode);
    }
}
