//! Live: a receiving thread, the 1 kHz control thread, a recording thread. Bounded queues between them drop and count,
//! that of the samples its oldest; nothing ever blocks control.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crossbeam_channel::bounded;

use super::control::{ControlLoop, Tally};
use super::journal::Journal;
use super::queue::{Notes, write_journal};
use super::receive::{ReceiveSink, receive};
use super::source::Source;
use super::status::LiveStatus;
use super::{Core, RunOutcome};
use crate::device::DeviceError;
use crate::imu::Resampler;
use crate::time::Clock;

/// Samples between the receiving and the control thread: 4 s at 1 kHz.
const SAMPLE_QUEUE: usize = 4096;

/// Threads and deadlines of a live run.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LiveSettings {
    /// SCHED_FIFO priority of the control thread; 0 asks for none.
    pub real_time_priority: u8,
    /// Lock the process's memory.
    pub lock_memory: bool,
    /// How far the ticks stand behind the clock, s: samples that arrive in batches are then still interpolated.
    pub input_delay_s: f64,
    /// Ticks that come late by less than this are made up at once; beyond it whole ticks are skipped and counted, s.
    pub catch_up_s: f64,
}

impl Default for LiveSettings {
    /// 20 ms cover the 16 ms batches of common USB bridges; 100 ms of catching up cost 10 ms at ten times real time.
    fn default() -> Self {
        Self { real_time_priority: 60, lock_memory: true, input_delay_s: 0.02, catch_up_s: 0.1 }
    }
}

/// A live setting outside its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("key `live.{key}` is {got}, allowed is {allowed}")]
pub struct LiveSettingsError {
    /// Name of the key.
    pub key: &'static str,
    /// What was given.
    pub got: f64,
    /// Allowed range.
    pub allowed: &'static str,
}

impl LiveSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// The first key outside its range.
    pub fn check(&self) -> Result<(), LiveSettingsError> {
        let ranges = [
            ("real_time_priority", f64::from(self.real_time_priority), 0.0..=99.0, "0 to 99"),
            ("input_delay_s", self.input_delay_s, 0.0..=1.0, "0 to 1 s"),
            ("catch_up_s", self.catch_up_s, 0.001..=10.0, "0.001 to 10 s"),
        ];
        for (key, got, range, allowed) in ranges {
            if !range.contains(&got) {
                return Err(LiveSettingsError { key, got, allowed });
            }
        }
        Ok(())
    }
}

/// Signals from outside into a live run.
#[derive(Debug, Default)]
pub struct Signals {
    /// Set to end the run.
    pub stop: AtomicBool,
    /// Set to stand both characters up again; the run clears it.
    pub respawn: AtomicBool,
}

/// A live run's conditions.
#[derive(Clone)]
pub struct LiveRun {
    /// Threads and deadlines.
    pub settings: LiveSettings,
    /// A newest sample older than this is no longer held, s.
    pub hold_limit_s: f64,
    /// End after this, s.
    pub duration_s: Option<f64>,
    /// The host's clock.
    pub clock: Arc<dyn Clock>,
    /// Signals into the run.
    pub signals: Arc<Signals>,
    /// Where the latest values are shown.
    pub status: Arc<LiveStatus>,
}

impl std::fmt::Debug for LiveRun {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LiveRun").field("settings", &self.settings).finish_non_exhaustive()
    }
}

impl LiveRun {
    /// Runs until the source ends, the duration is over or `signals.stop` is set. Gives back source and journal.
    ///
    /// # Errors
    /// The device's announced rate does not fit its line, or a played file cannot be read on.
    pub fn run(
        &self,
        source: Source,
        core: Core,
        journal: Journal,
    ) -> Result<(Source, Journal, RunOutcome), DeviceError> {
        let signals = &self.signals;
        let (samples_in, samples_out) = bounded(SAMPLE_QUEUE);
        let (notes, entries) = Notes::queue();
        let lost = notes.lost();
        let source_ended = Arc::new(AtomicBool::new(false));

        std::thread::scope(|scope| {
            let writer = scope.spawn(move || write_journal(&entries, journal));
            let receiver = {
                let sink = ReceiveSink::new(samples_in, samples_out.clone(), notes.clone());
                let (status, ended) = (&self.status, source_ended.clone());
                let (signals, clock) = (signals.clone(), self.clock.as_ref());
                scope.spawn(move || receive(source, sink, clock, &signals, status, &ended))
            };
            let control = {
                let loop_ = ControlLoop {
                    core,
                    resampler: Resampler::new(self.hold_limit_s),
                    samples: samples_out,
                    notes,
                    clock: self.clock.clone(),
                    signals: signals.clone(),
                    status: self.status.clone(),
                    source_ended,
                    tally: Tally::default(),
                };
                scope.spawn(move || loop_.run(&self.settings, self.duration_s))
            };
            let mut outcome = joined(control.join());
            signals.stop.store(true, Ordering::Relaxed);
            let source = joined(receiver.join())?;
            let journal = joined(writer.join());
            outcome.dropped += lost.load(Ordering::Relaxed);
            Ok((source, journal, outcome))
        })
    }
}

/// A panic of a thread is a bug: it goes on in the caller instead of leaving half a run behind.
fn joined<T>(result: std::thread::Result<T>) -> T {
    result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}
