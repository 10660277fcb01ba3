//! As fast as the machine goes: one thread, simulated time, no clock in the result.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::journal::Journal;
use super::sched::thread_cpu_time;
use super::source::{Polled, Source, SourceSink};
use super::{Core, RunOutcome};
use crate::device::{DeviceError, Traffic};
use crate::imu::{HeadSample, LinkHealth, Resampler};
use crate::report::TickTimes;
use crate::tick::{TickInput, TickOutput};
use crate::time::{HostTime, Tick};

/// Runs until the source ends, `duration_s` is over or `stop` is set.
///
/// Tick k stands at k ms after the source's first stamp. Like a live run it knows at each tick only what has arrived by
/// then, and one sample more: between samples the motion is interpolated, none is held. `watch` sees the core after each
/// tick.
///
/// # Errors
/// The device's announced rate does not fit its line.
pub fn run_offline(
    source: &mut Source,
    core: &mut Core,
    journal: &mut Journal,
    hold_limit_s: f64,
    duration_s: Option<f64>,
    stop: &AtomicBool,
    mut watch: impl FnMut(&Core, &TickOutput),
) -> Result<RunOutcome, DeviceError> {
    let mut feed =
        Feed { journal, resampler: Resampler::new(hold_limit_s), newest: None, heard: HostTime::default() };
    let mut times = TickTimes::new();
    let mut ended = false;
    let mut health = LinkHealth::Waiting;
    let mut tick = Tick(0);
    while !stop.load(Ordering::Relaxed) && duration_s.is_none_or(|limit| tick.time_s() < limit) {
        let at = tick.host_time();
        while !ended && feed.newest.unwrap_or(feed.heard) < at {
            ended = matches!(source.poll(Duration::ZERO, &mut feed)?, Polled::Ended);
            if stop.load(Ordering::Relaxed) {
                break;
            }
        }
        if ended && feed.newest.unwrap_or_default() < at {
            break;
        }
        let (chair, link) = feed.resampler.at(at);
        if link != health {
            health = link;
            feed.journal.event(at, &format!("link {}", name_of(link)));
        }
        let input = TickInput { tick, chair, link, respawn: false };
        let before = thread_cpu_time();
        let output = core.step(&input);
        times.record(thread_cpu_time().saturating_sub(before));
        feed.journal.tick(&input, &output);
        watch(core, &output);
        tick = Tick(tick.0 + 1);
    }
    let resample = feed.resampler.counters();
    Ok(RunOutcome {
        ticks: tick.0,
        last_tick: tick,
        times,
        overruns: 0,
        late_ticks: 0,
        dropped: resample.dropped,
        max_sample_age_s: None,
        resample,
    })
}

/// Name of a link state in events.
pub(super) fn name_of(link: LinkHealth) -> &'static str {
    match link {
        LinkHealth::Waiting => "waiting",
        LinkHealth::Live => "live",
        LinkHealth::Stale => "stale: holding the last sample",
        LinkHealth::Lost => "lost: the turntable brakes until samples return",
    }
}

struct Feed<'a> {
    journal: &'a mut Journal,
    resampler: Resampler,
    newest: Option<HostTime>,
    /// Stamp of the newest traffic.
    heard: HostTime,
}

impl SourceSink for Feed<'_> {
    fn traffic(&mut self, at: HostTime, traffic: Traffic<'_>) {
        self.heard = self.heard.max(at);
        self.journal.traffic(at, traffic);
    }

    fn sample(&mut self, sample: HeadSample) {
        self.newest = Some(self.newest.map_or(sample.at, |newest| newest.max(sample.at)));
        self.resampler.push(sample);
        self.journal.sample(&sample);
    }

    fn event(&mut self, at: HostTime, text: &str) {
        self.journal.event(at, text);
    }
}
