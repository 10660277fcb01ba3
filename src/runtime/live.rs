//! Live: a receiving thread, the 1 kHz control thread, a recording thread. Bounded queues between them drop and count;
//! nothing ever blocks control.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};

use super::journal::Journal;
use super::offline::name_of;
use super::sched::{enter_real_time, thread_cpu_time};
use super::source::{Polled, Source, SourceSink};
use super::status::LiveStatus;
use super::{Core, RunOutcome};
use crate::device::{DeviceError, Traffic};
use crate::imu::{HeadSample, LinkHealth, Resampler};
use crate::report::TickTimes;
use crate::tick::{TickInput, TickOutput};
use crate::time::{Clock, HostTime, TICK_NS, Tick};

/// Samples between the receiving and the control thread: 4 s at 1 kHz.
const SAMPLE_QUEUE: usize = 4096;
/// Entries between control and recording: 4 s of ticks and as many other entries.
const JOURNAL_QUEUE: usize = 8192;
/// How long the receiving thread waits for traffic before it looks at the stop flag.
const RECEIVE_TIMEOUT: Duration = Duration::from_millis(20);

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

/// One entry on the way to the journal.
#[allow(clippy::large_enum_variant)] // ticks are the common case, and boxing them would allocate in the control thread
enum Entry {
    /// With the number of ticks lost to a full queue since the one before.
    Tick(TickInput, TickOutput, u32),
    Sample(HeadSample),
    Traffic(HostTime, OwnedTraffic),
    /// Pieces of traffic lost to a full queue here.
    TrafficLost(u32),
    Event(HostTime, String),
    Link(HostTime, LinkHealth),
    Skipped(HostTime, u64),
}

/// A piece of traffic that outlives the link's buffer.
enum OwnedTraffic {
    Bytes(Box<[u8]>),
    Frame { id: u32, extended: bool, data: Box<[u8]> },
}

/// Runs until the source ends, `duration_s` is over or `signals.stop` is set. Gives back source and journal.
///
/// # Errors
/// The device's announced rate does not fit its line.
pub fn run_live(
    source: Source,
    core: Core,
    journal: Journal,
    settings: &LiveSettings,
    hold_limit_s: f64,
    duration_s: Option<f64>,
    clock: &Arc<dyn Clock>,
    signals: &Arc<Signals>,
    status: &Arc<LiveStatus>,
) -> Result<(Source, Journal, RunOutcome), DeviceError> {
    let (samples_in, samples_out) = bounded(SAMPLE_QUEUE);
    let (entries_in, entries_out) = bounded(JOURNAL_QUEUE);
    let lost = Arc::new(AtomicU64::new(0));
    let source_ended = Arc::new(AtomicBool::new(false));

    std::thread::scope(|scope| {
        let writer = scope.spawn(move || write_journal(&entries_out, journal));
        let receiver = {
            let sink = ReceiveSink {
                samples: samples_in,
                entries: entries_in.clone(),
                lost: lost.clone(),
                traffic_lost: 0,
            };
            let (signals, ended) = (signals.clone(), source_ended.clone());
            scope.spawn(move || receive(source, sink, &signals, &ended))
        };
        let control = {
            let loop_ = ControlLoop {
                core,
                resampler: Resampler::new(hold_limit_s),
                samples: samples_out,
                entries: entries_in,
                lost: lost.clone(),
                ticks_lost: 0,
                clock: clock.clone(),
                signals: signals.clone(),
                status: status.clone(),
                source_ended,
                times: TickTimes::new(),
                health: LinkHealth::Waiting,
                late_ticks: 0,
                overruns: 0,
            };
            scope.spawn(move || loop_.run(settings, duration_s))
        };
        let mut outcome = joined(control.join());
        signals.stop.store(true, Ordering::Relaxed);
        let source = joined(receiver.join())?;
        let journal = joined(writer.join());
        outcome.dropped += lost.load(Ordering::Relaxed);
        Ok((source, journal, outcome))
    })
}

/// A panic of a thread is a bug: it goes on in the caller instead of leaving half a run behind.
fn joined<T>(result: std::thread::Result<T>) -> T {
    result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

fn write_journal(entries: &Receiver<Entry>, mut journal: Journal) -> Journal {
    for entry in entries {
        match entry {
            Entry::Tick(input, output, lost_before) => {
                journal.ticks_dropped(lost_before);
                journal.tick(&input, &output);
            }
            Entry::Sample(sample) => journal.sample(&sample),
            Entry::Traffic(at, OwnedTraffic::Bytes(bytes)) => journal.traffic(at, Traffic::Bytes(&bytes)),
            Entry::Traffic(at, OwnedTraffic::Frame { id, extended, data }) => {
                journal.traffic(at, Traffic::CanFrame { id, extended, data: &data });
            }
            Entry::TrafficLost(count) => journal.traffic_dropped(count),
            Entry::Event(at, text) => journal.event(at, &text),
            Entry::Link(at, link) => journal.event(at, &format!("link {}", name_of(link))),
            Entry::Skipped(at, ticks) => journal.event(at, &format!("overrun: {ticks} ticks skipped")),
        }
    }
    journal
}

fn receive(
    mut source: Source,
    mut sink: ReceiveSink,
    signals: &Signals,
    ended: &AtomicBool,
) -> Result<Source, DeviceError> {
    while !signals.stop.load(Ordering::Relaxed) {
        match source.poll(RECEIVE_TIMEOUT, &mut sink) {
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

struct ReceiveSink {
    samples: Sender<HeadSample>,
    entries: Sender<Entry>,
    lost: Arc<AtomicU64>,
    /// Pieces of traffic lost since the last one that went through.
    traffic_lost: u32,
}

impl ReceiveSink {
    fn note(&self, entry: Entry) -> bool {
        let sent = self.entries.try_send(entry).is_ok();
        self.lost.fetch_add(u64::from(!sent), Ordering::Relaxed);
        sent
    }

    /// Leaves word of lost traffic at the place where it is missing.
    fn own_up(&mut self) {
        if self.traffic_lost > 0 && self.entries.try_send(Entry::TrafficLost(self.traffic_lost)).is_ok() {
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
        if !self.note(Entry::Traffic(at, owned)) {
            self.traffic_lost += 1;
        }
    }

    fn sample(&mut self, sample: HeadSample) {
        if matches!(self.samples.try_send(sample), Err(TrySendError::Full(_))) {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
        self.note(Entry::Sample(sample));
    }

    fn event(&mut self, at: HostTime, text: &str) {
        self.note(Entry::Event(at, text.to_owned()));
    }
}

/// The control thread. Nothing in its ticks allocates, locks or waits but the wait for the next deadline.
struct ControlLoop {
    core: Core,
    resampler: Resampler,
    samples: Receiver<HeadSample>,
    entries: Sender<Entry>,
    lost: Arc<AtomicU64>,
    /// Ticks lost since the last one that went through.
    ticks_lost: u32,
    clock: Arc<dyn Clock>,
    signals: Arc<Signals>,
    status: Arc<LiveStatus>,
    source_ended: Arc<AtomicBool>,
    times: TickTimes,
    health: LinkHealth,
    late_ticks: u64,
    overruns: u64,
}

impl ControlLoop {
    fn run(mut self, settings: &LiveSettings, duration_s: Option<f64>) -> RunOutcome {
        for refusal in enter_real_time(settings.real_time_priority, settings.lock_memory) {
            self.note(Entry::Event(self.clock.now(), refusal));
        }
        let start = self.clock.now();
        let delay = Duration::from_secs_f64(settings.input_delay_s);
        let catch_up_ns = (settings.catch_up_s * 1e9) as u64;
        let mut tick = Tick(0);
        let mut ran = 0;
        while !self.signals.stop.load(Ordering::Relaxed)
            && duration_s.is_none_or(|limit| tick.time_s() < limit)
        {
            let due = HostTime(start.0 + tick.0 * TICK_NS);
            self.clock.sleep_until(due);
            let late_ns = self.clock.now().0.saturating_sub(due.0);
            if late_ns > catch_up_ns {
                let skipped = late_ns / TICK_NS;
                self.overruns += skipped;
                tick = Tick(tick.0 + skipped);
                self.note(Entry::Skipped(due, skipped));
            } else if late_ns > TICK_NS {
                self.late_ticks += 1;
            }
            let at = HostTime((start.0 + tick.0 * TICK_NS).saturating_sub(delay.as_nanos() as u64));
            if !self.tick(tick, at) {
                break;
            }
            ran += 1;
            tick = Tick(tick.0 + 1);
        }
        let resample = self.resampler.counters();
        RunOutcome {
            ticks: ran,
            last_tick: tick,
            times: self.times,
            overruns: self.overruns,
            late_ticks: self.late_ticks,
            dropped: resample.dropped,
            resample,
        }
    }

    /// One tick; false when the source has ended and its last sample has been used.
    fn tick(&mut self, tick: Tick, at: HostTime) -> bool {
        let ended = self.source_ended.load(Ordering::Acquire);
        while let Ok(sample) = self.samples.try_recv() {
            self.resampler.push(sample);
        }
        if ended && self.resampler.newest().is_none_or(|newest| newest < at) {
            return false;
        }
        let before = thread_cpu_time();
        let (chair, link) = self.resampler.at(at);
        let respawn = self.signals.respawn.swap(false, Ordering::Relaxed);
        let input = TickInput { tick, chair, link, respawn };
        let output = self.core.step(&input);
        self.times.record(thread_cpu_time().saturating_sub(before));
        if link != self.health {
            self.health = link;
            self.note(Entry::Link(at, link));
        }
        self.status.store(&input, &output);
        if self.note(Entry::Tick(input, output, self.ticks_lost)) {
            self.ticks_lost = 0;
        } else {
            self.ticks_lost += 1;
        }
        true
    }

    fn note(&self, entry: Entry) -> bool {
        let sent = self.entries.try_send(entry).is_ok();
        self.lost.fetch_add(u64::from(!sent), Ordering::Relaxed);
        sent
    }
}
