//! Head samples at irregular times to one head motion per tick.

use std::collections::VecDeque;

use super::health::{AgeLimits, LinkMonitor, ResampleCounters};
use super::intervals::{Intervals, LONGEST_USUAL_S};
use super::{HeadSample, LinkHealth};
use crate::time::HostTime;
use crate::vestibular::HeadMotion;

/// Samples the buffer holds; a stream of 1 kHz may run 4 s ahead of the ticks.
pub const RESAMPLE_CAPACITY: usize = 4096;
/// A newest sample up to this old is fresh whatever the rate, s: batches of a USB bridge and stalls of a shared machine
/// stay below it mostly.
pub(super) const FRESH_S: f64 = 0.04;

/// Interpolates head samples to the times of the ticks.
///
/// Between two samples the motion is linear in time. After the newest sample, and inside a gap longer than the hold
/// limit, the last motion is held: [`LinkHealth::Live`] for one and a half usual intervals (at least 40 ms, or
/// half the hold limit if that is less), [`LinkHealth::Stale`] up to the hold limit, then there is none ([`LinkHealth::Lost`]). A live run and its
/// replay, where the far side of a gap is already known, treat it alike. The hold limit is the one given or three
/// usual intervals, whichever is longer, so that a slow sensor is not lost between its samples.
///
/// No heap operation after construction.
#[derive(Debug)]
pub struct Resampler {
    /// Increasing in time; never longer than [`RESAMPLE_CAPACITY`].
    samples: VecDeque<HeadSample>,
    newest: Option<HostTime>,
    hold_limit_s: f64,
    intervals: Intervals,
    monitor: LinkMonitor,
    counters: ResampleCounters,
}

impl Resampler {
    /// An empty resampler; see [`super::ImuSettings::hold_limit_s`].
    pub fn new(hold_limit_s: f64) -> Self {
        Self {
            samples: VecDeque::with_capacity(RESAMPLE_CAPACITY),
            newest: None,
            hold_limit_s,
            intervals: Intervals::default(),
            monitor: LinkMonitor::default(),
            counters: ResampleCounters::default(),
        }
    }

    /// Takes in a sample. One that is not later than the one before is dropped and counted; so is the oldest one
    /// when the buffer is full.
    pub fn push(&mut self, sample: HeadSample) {
        if let Some(newest) = self.newest {
            if sample.at <= newest {
                self.counters.out_of_order += 1;
                return;
            }
            self.intervals.take(sample.at.saturating_since(newest).as_secs_f64());
        }
        self.newest = Some(sample.at);
        if self.samples.len() == RESAMPLE_CAPACITY {
            self.samples.pop_front();
            self.counters.dropped += 1;
        }
        self.samples.push_back(sample);
    }

    /// Motion at `tick_time`, and the state of the link then.
    ///
    /// Ask in order of time: samples that a later one has overtaken are forgotten. Before the first sample there is
    /// no motion and the link is waiting.
    pub fn at(&mut self, tick_time: HostTime) -> (Option<HeadMotion>, LinkHealth) {
        while self.samples.get(1).is_some_and(|next| next.at <= tick_time) {
            self.samples.pop_front();
        }
        let limits = self.limits();
        let Some(before) = self.samples.front().copied() else {
            return (None, self.monitor.observe(None, limits));
        };
        if before.at > tick_time {
            // The very first sample is still to come, or the one before this tick was pushed out of the buffer.
            let overtaken = self.counters.dropped > 0;
            let health = self.monitor.observe(overtaken.then_some(0.0), limits);
            return (overtaken.then_some(before.motion), health);
        }
        let age_s = tick_time.saturating_since(before.at).as_secs_f64();
        if let Some(after) = self.samples.get(1) {
            let span_s = after.at.saturating_since(before.at).as_secs_f64();
            if span_s <= limits.hold_s {
                let motion = interpolate(&before.motion, &after.motion, age_s / span_s);
                return (Some(motion), self.monitor.observe(Some(0.0), limits));
            }
        }
        let health = self.monitor.observe(Some(age_s), limits);
        ((health != LinkHealth::Lost).then_some(before.motion), health)
    }

    /// Time of the newest sample taken in.
    pub fn newest(&self) -> Option<HostTime> {
        self.newest
    }

    /// Everything counted so far.
    pub fn counters(&self) -> ResampleCounters {
        let (stale_episodes, lost_episodes) = self.monitor.episodes();
        ResampleCounters { gaps: self.intervals.gaps(), stale_episodes, lost_episodes, ..self.counters }
    }

    fn limits(&self) -> AgeLimits {
        let usual_s = self.intervals.usual_s().unwrap_or(0.0).min(LONGEST_USUAL_S);
        let hold_s = self.hold_limit_s.max(3.0 * usual_s);
        AgeLimits { fresh_s: (1.5 * usual_s).max(FRESH_S.min(0.5 * self.hold_limit_s)), hold_s }
    }
}

fn interpolate(before: &HeadMotion, after: &HeadMotion, fraction: f64) -> HeadMotion {
    HeadMotion {
        omega_head: before.omega_head.lerp(&after.omega_head, fraction),
        gif_head: before.gif_head.lerp(&after.gif_head, fraction),
    }
}

#[cfg(test)]
mod tests;
