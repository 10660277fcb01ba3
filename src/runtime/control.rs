//! The control thread of a live run: absolute deadlines at 1 kHz.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossbeam_channel::Receiver;

use super::live::{LiveSettings, Signals};
use super::queue::{Entry, Notes};
use super::sched::{enter_real_time, thread_cpu_time};
use super::status::LiveStatus;
use super::{Core, RunOutcome};
use crate::imu::{HeadSample, LinkHealth, Resampler};
use crate::report::TickTimes;
use crate::tick::TickInput;
use crate::time::{Clock, HostTime, TICK_NS, Tick};

/// The control thread. Its ticks allocate nothing and wait for nothing but the next deadline; sending into a queue may
/// wake the thread on the other side.
pub(super) struct ControlLoop {
    pub(super) core: Core,
    pub(super) resampler: Resampler,
    pub(super) samples: Receiver<HeadSample>,
    pub(super) notes: Notes,
    pub(super) clock: Arc<dyn Clock>,
    pub(super) signals: Arc<Signals>,
    pub(super) status: Arc<LiveStatus>,
    pub(super) source_ended: Arc<AtomicBool>,
    pub(super) tally: Tally,
}

/// What the loop counts while it runs.
#[derive(Default)]
pub(super) struct Tally {
    times: TickTimes,
    health: LinkHealth,
    late_ticks: u64,
    overruns: u64,
    /// Ticks lost to a full queue since the last one that went through.
    ticks_lost: u32,
    /// Largest age of the newest sample at a tick, s; `None` before the first sample.
    max_sample_age_s: Option<f64>,
}

impl ControlLoop {
    /// Runs until the source has ended, `duration_s` is over or the run is stopped.
    pub(super) fn run(mut self, settings: &LiveSettings, duration_s: Option<f64>) -> RunOutcome {
        let refusals = enter_real_time(settings.real_time_priority, settings.lock_memory);
        for refusal in &refusals {
            self.notes.note(Entry::Event(self.clock.now(), refusal.clone()));
        }
        self.status.refuse(refusals);
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
                self.tally.overruns += skipped;
                tick = Tick(tick.0 + skipped);
                self.notes.note(Entry::Skipped(due, skipped));
            } else if late_ns > TICK_NS {
                self.tally.late_ticks += 1;
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
            times: self.tally.times,
            overruns: self.tally.overruns,
            late_ticks: self.tally.late_ticks,
            dropped: resample.dropped,
            max_sample_age_s: self.tally.max_sample_age_s,
            resample,
        }
    }

    /// Notes how old the newest sample is: an age that grows is a device that falls behind or is silent.
    fn note_age(&mut self) {
        let Some(newest) = self.resampler.newest() else { return };
        let age_s = self.clock.now().saturating_since(newest).as_secs_f64();
        self.tally.max_sample_age_s = Some(self.tally.max_sample_age_s.map_or(age_s, |max| max.max(age_s)));
        self.status.store_backlog(age_s, self.notes.lost_so_far());
    }

    /// One tick; false when the source has ended and its last sample has been used.
    fn tick(&mut self, tick: Tick, at: HostTime) -> bool {
        let ended = self.source_ended.load(Ordering::Acquire);
        while let Ok(sample) = self.samples.try_recv() {
            self.resampler.push(sample);
        }
        if !ended {
            self.note_age();
        }
        if ended && self.resampler.newest().is_none_or(|newest| newest < at) {
            return false;
        }
        let before = thread_cpu_time();
        let (chair, link) = self.resampler.at(at);
        let respawn = self.signals.respawn.swap(false, Ordering::Relaxed);
        let input = TickInput { tick, chair, link, respawn };
        let output = self.core.step(&input);
        self.tally.times.record(thread_cpu_time().saturating_sub(before));
        if link != self.tally.health {
            self.tally.health = link;
            self.notes.note(Entry::Link(at, link));
        }
        self.status.store(&input, &output);
        if self.notes.note(Entry::Tick(input, output, self.tally.ticks_lost)) {
            self.tally.ticks_lost = 0;
        } else {
            self.tally.ticks_lost += 1;
        }
        true
    }
}
