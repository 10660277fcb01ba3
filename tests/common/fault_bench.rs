//! A source and a resampler in stream time: the clock stands still while they work, so that what is seen, and when,
//! depends on the stream alone.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use otolith::device::protocol::PacketDecoder;
use otolith::device::{Link, Traffic};
use otolith::imu::{Calibration, HeadSample, ImuPipeline, ImuSettings, LinkHealth, Mount, Resampler};
use otolith::runtime::trouble::Trouble;
use otolith::runtime::{Polled, Source, SourceFacts, SourceSink};
use otolith::time::{Clock, HostTime};

/// Where faults are put: while the sensor is aligned, and after, ms.
pub(crate) const PHASES: [(&str, u64); 2] = [("aligning", 500), ("running", 3_000)];
/// Before this time the samples are held back to align the sensor, ms.
pub(crate) const ALIGNED_MS: u64 = 1_000;
/// Length of a run, ms.
pub(crate) const END_MS: u64 = 6_000;
/// A fault is to be named within this time, or one sample period, ms.
const DETECTED_WITHIN_MS: u64 = 50;
/// All is to be well again within this time after the fault's end, ms.
const RECOVERED_WITHIN_MS: u64 = 500;

/// What names a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sign {
    Trouble(Trouble),
    /// The newest sample is too old: `LinkHealth` is no longer live.
    Stale,
}

impl Sign {
    fn name(self) -> &'static str {
        match self {
            Sign::Trouble(trouble) => trouble.name(),
            Sign::Stale => "stale",
        }
    }
}

/// A clock that goes on only when it is set. Who waits does not wait.
#[derive(Debug, Default)]
pub(crate) struct StreamClock(AtomicU64);

impl StreamClock {
    pub(crate) fn set_ms(&self, ms: u64) {
        self.0.store(ms, Ordering::Relaxed);
    }

    pub(crate) fn ms(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

impl Clock for StreamClock {
    fn now(&self) -> HostTime {
        HostTime(self.ms() * 1_000_000)
    }

    fn sleep_until(&self, _deadline: HostTime) {}
}

struct Feed {
    resampler: Resampler,
    events: Vec<String>,
}

impl SourceSink for Feed {
    fn traffic(&mut self, _at: HostTime, _traffic: Traffic<'_>) {}
    fn sample(&mut self, sample: HeadSample) {
        self.resampler.push(sample);
    }
    fn event(&mut self, _at: HostTime, text: &str) {
        self.events.push(text.to_owned());
    }
}

/// Everything between a link and the samples of the ticks.
pub(crate) struct Bench {
    clock: Arc<StreamClock>,
    source: Source,
    feed: Feed,
    sees_age: bool,
    states: Vec<State>,
}

impl Bench {
    /// A bench that is blind to the signs given: the negative control.
    pub(crate) fn new(
        clock: &Arc<StreamClock>,
        link: Box<dyn Link>,
        decoder: Box<dyn PacketDecoder>,
        blind_to: &[Sign],
    ) -> Self {
        let settings = ImuSettings::default();
        let pipeline = ImuPipeline::new(&settings, Calibration::default(), Mount::default(), 9.81);
        let blind = blind_to.iter().filter_map(|sign| match sign {
            Sign::Trouble(trouble) => Some(*trouble),
            Sign::Stale => None,
        });
        Self {
            clock: Arc::clone(clock),
            source: Source::new(link, decoder, pipeline, None).blind_to(blind),
            feed: Feed { resampler: Resampler::new(settings.hold_limit_s), events: Vec::new() },
            sees_age: !blind_to.contains(&Sign::Stale),
            states: Vec::new(),
        }
    }

    /// Takes in what the link has, as a run does; false if that is nothing within `timeout`.
    pub(crate) fn take_in(&mut self, timeout: Duration) -> bool {
        let polled = self.source.poll(timeout, &mut self.feed).expect("no reason to end the run");
        matches!(polled, Polled::Traffic)
    }

    /// Keeps what shows at the end of this ms, in which nothing more has come.
    pub(crate) fn look(&mut self) {
        let now = self.clock.now();
        self.source.note_silence(now, &mut self.feed);
        // Age is switched off where nobody asks for the time after the newest sample.
        let newest = self.feed.resampler.newest().filter(|_| !self.sees_age);
        let (_, health) = self.feed.resampler.at(newest.map_or(now, |newest| newest.min(now)));
        self.states.push(State { troubles: self.source.troubles().collect(), health });
    }

    /// Nobody looks in this ms: what showed last shows on.
    #[allow(dead_code, reason = "not every binary holds the program up")]
    pub(crate) fn look_away(&mut self) {
        self.states.extend(self.states.last().cloned());
    }

    #[allow(dead_code, reason = "not every binary asks meanwhile")]
    pub(crate) fn facts(&self) -> SourceFacts {
        self.source.facts()
    }

    pub(crate) fn end(self) -> Seen {
        Seen { facts: self.source.facts(), states: self.states, events: self.feed.events }
    }
}

/// What showed at a time.
#[derive(Clone, Debug)]
struct State {
    troubles: Vec<Trouble>,
    health: LinkHealth,
}

impl State {
    fn shows(&self, sign: Sign) -> bool {
        match sign {
            Sign::Trouble(trouble) => self.troubles.contains(&trouble),
            Sign::Stale => matches!(self.health, LinkHealth::Stale | LinkHealth::Lost),
        }
    }

    /// Nothing is named and, once the sensor is aligned, samples come.
    fn is_well(&self, at_ms: u64) -> bool {
        self.troubles.is_empty() && (self.health == LinkHealth::Live || at_ms < ALIGNED_MS + 20)
    }
}

/// What could be seen of a run.
pub(crate) struct Seen {
    /// One for each ms.
    states: Vec<State>,
    pub(crate) facts: SourceFacts,
    #[allow(dead_code, reason = "not every binary reads them")]
    pub(crate) events: Vec<String>,
}

impl Seen {
    /// The first of these signs, and how long after `from_ms` it showed.
    fn first_sign(&self, signs: &[Sign], from_ms: u64) -> Option<(Sign, u64)> {
        let later = self.states.iter().enumerate().skip(from_ms as usize);
        later.into_iter().find_map(|(ms, state)| {
            signs.iter().find(|sign| state.shows(**sign)).map(|sign| (*sign, ms as u64 - from_ms))
        })
    }

    /// Time after `from_ms` from which on all is well; `None` if it is not at the end.
    pub(crate) fn well_after(&self, from_ms: u64) -> Option<u64> {
        let last_bad = self.states.iter().enumerate().rposition(|(ms, state)| !state.is_well(ms as u64));
        let well_from = last_bad.map_or(0, |ms| ms as u64 + 1);
        (well_from < END_MS).then(|| well_from.saturating_sub(from_ms))
    }

    /// Whether any of these signs ever showed.
    pub(crate) fn shows_any(&self, signs: &[Sign]) -> bool {
        self.first_sign(signs, 0).is_some()
    }
}

/// When a fault is there, and what is to name it.
#[derive(Clone, Debug)]
pub(crate) struct Expected {
    pub(crate) begins_ms: u64,
    pub(crate) ends_ms: u64,
    /// Any of these is the name of the fault; none means that nothing must be named.
    pub(crate) signs: Vec<Sign>,
}

impl Expected {
    /// Text of a cell, `name a/b`, or what is wrong with it. `run` runs it, blind to the signs it is given.
    pub(crate) fn cell(
        &self,
        period_ms: u64,
        run: impl Fn(&[Sign]) -> Seen,
    ) -> Result<(String, Seen), String> {
        let seen = run(&[]);
        let well_ms = seen.well_after(self.ends_ms).ok_or("not well at the end")?;
        if well_ms > RECOVERED_WITHIN_MS {
            return Err(format!("well only {well_ms} ms after the end"));
        }
        if self.signs.is_empty() {
            return match seen.states.iter().flat_map(|state| &state.troubles).next() {
                Some(named) => Err(format!("{} is named without cause", named.name())),
                None => Ok(("nothing to name".to_owned(), seen)),
            };
        }
        let (sign, after_ms) = seen.first_sign(&self.signs, self.begins_ms).ok_or("is not named")?;
        if after_ms > DETECTED_WITHIN_MS.max(period_ms) {
            return Err(format!("{sign:?} is named only after {after_ms} ms"));
        }
        if run(&self.signs).shows_any(&self.signs) {
            return Err(format!("{sign:?} is named although it is switched off"));
        }
        Ok((format!("{} {after_ms}/{well_ms}", sign.name()), seen))
    }
}
