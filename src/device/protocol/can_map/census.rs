//! Who is on a CAN bus: its identifiers, and which ready mappings fit them.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{CAN_MAPS, CanMap, CanMapDecoder, MappedMessage};
use crate::device::Traffic;
use crate::device::protocol::PacketDecoder;
use crate::time::HostTime;

/// Most identifiers told apart: a bus has hundreds, noise has any number.
const MAX_IDS: usize = 4096;
/// Least share of good checksums and of paired frames with which a mapping fits: a log may begin in the middle.
const GOOD_SHARE: f64 = 0.9;

/// What was found on a CAN bus.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BusReport {
    /// Frames of all identifiers.
    pub frames: u64,
    /// The identifiers, most frequent first.
    pub identifiers: Vec<IdReport>,
    /// Names of the ready mappings that fit.
    pub fitting_maps: Vec<String>,
    /// Ready mappings that do not fit, but know some of the identifiers.
    pub partly_known: Vec<PartlyKnown>,
}

/// What was found of one identifier.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IdReport {
    /// Hexadecimal: three digits of an 11-bit identifier, eight of a 29-bit one.
    pub id: String,
    /// Its frames.
    pub frames: u64,
    /// Frames per second by their arrival; `None` for a single one.
    pub rate_hz: Option<f64>,
    /// Median time between two frames, ms.
    pub median_interval_ms: Option<f64>,
    /// Length of the shortest frame.
    pub shortest_bytes: usize,
    /// Length of the longest frame.
    pub longest_bytes: usize,
}

/// A ready mapping that knows identifiers of a bus whose frames are not as it expects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PartlyKnown {
    /// Name of the mapping.
    pub map: String,
    /// The identifiers it knows, as in [`IdReport::id`].
    pub identifiers: Vec<String>,
}

/// Intervals of an identifier that are kept for their median; those of the first frames stand for all.
const MAX_INTERVALS: usize = 4096;

/// Takes the frames of a bus one by one.
#[derive(Debug, Default)]
pub struct BusCensus {
    frames: u64,
    ids: BTreeMap<(bool, u32), IdTally>,
    trials: Vec<Trial>,
}

#[derive(Debug)]
struct IdTally {
    frames: u64,
    first: HostTime,
    last: HostTime,
    intervals_us: Vec<u32>,
    shortest: usize,
    longest: usize,
}

/// A ready mapping tried on the traffic.
#[derive(Debug)]
struct Trial {
    map: CanMap,
    decoder: CanMapDecoder,
    samples: u64,
}

impl BusCensus {
    /// A tally that tries every ready mapping on the way.
    pub fn trying_maps() -> Self {
        let maps = CAN_MAPS
            .iter()
            .filter_map(|shipped| CanMap::new(shipped.name, shipped.map, shipped.dbc_name, shipped.dbc).ok());
        let trials = maps.map(|map| Trial { decoder: CanMapDecoder::new(&map), map, samples: 0 }).collect();
        Self { trials, ..Self::default() }
    }

    /// Takes a piece of traffic that arrived at `at`; bytes are none of a bus.
    pub fn take(&mut self, at: HostTime, traffic: Traffic<'_>) {
        let Traffic::CanFrame { id, extended, data } = traffic else { return };
        self.frames += 1;
        let is_full = self.ids.len() >= MAX_IDS;
        match self.ids.get_mut(&(extended, id)) {
            Some(tally) => tally.take(at, data.len()),
            None if is_full => {}
            None => {
                self.ids.insert((extended, id), IdTally::new(at, data.len()));
            }
        }
        for trial in &mut self.trials {
            trial.decoder.push(traffic, &mut |_| trial.samples += 1);
        }
    }

    /// What was found; `None` if there was not one frame.
    pub fn report(&self) -> Option<BusReport> {
        let mut identifiers: Vec<IdReport> =
            self.ids.iter().map(|(&(extended, id), tally)| tally.report(extended, id)).collect();
        identifiers.sort_by_key(|found| std::cmp::Reverse(found.frames));
        let (fitting, others): (Vec<_>, Vec<_>) = self.trials.iter().partition(|trial| self.fits(trial));
        let partly_known = others.into_iter().map(|trial| self.known_to(trial));
        (self.frames > 0).then(|| BusReport {
            frames: self.frames,
            identifiers,
            fitting_maps: fitting.into_iter().map(|trial| trial.map.name().to_owned()).collect(),
            partly_known: partly_known.filter(|known| !known.identifiers.is_empty()).collect(),
        })
    }

    /// The identifiers on the bus that a mapping knows.
    fn known_to(&self, trial: &Trial) -> PartlyKnown {
        let known = |extended: bool, id: u32| trial.map.messages().any(|message| message.fits(id, extended));
        let ids = self.ids.keys().filter(|(extended, id)| known(*extended, *id));
        PartlyKnown {
            map: trial.map.name().to_owned(),
            identifiers: ids.map(|&(extended, id)| id_text(extended, id)).collect(),
        }
    }

    /// Frames of all identifiers.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Different identifiers so far.
    pub fn identifiers(&self) -> usize {
        self.ids.len()
    }

    /// Whether all messages of the mapping are there with the length they should have, and make samples.
    fn fits(&self, trial: &Trial) -> bool {
        let has = |message: &MappedMessage<'_>| {
            let mut of_message =
                self.ids.iter().filter(|((extended, id), _)| message.fits(*id, *extended)).peekable();
            of_message.peek().is_some()
                && of_message
                    .all(|(_, tally)| tally.shortest == message.size && tally.longest == message.size)
        };
        let counters = trial.decoder.counters();
        let spoiled = counters.bad_checksum + counters.lone_halves + counters.device_errors;
        let seen = (counters.packets + counters.bad_checksum) as f64;
        trial.samples > 0
            && spoiled as f64 <= (1.0 - GOOD_SHARE) * seen
            && trial.map.messages().filter(|message| message.required).all(|message| has(&message))
    }
}

/// An identifier as people write it.
fn id_text(extended: bool, id: u32) -> String {
    if extended { format!("{id:08X}") } else { format!("{id:03X}") }
}

impl IdTally {
    fn new(at: HostTime, bytes: usize) -> Self {
        Self { frames: 1, first: at, last: at, intervals_us: Vec::new(), shortest: bytes, longest: bytes }
    }

    fn take(&mut self, at: HostTime, bytes: usize) {
        self.frames += 1;
        let interval_us = at.saturating_since(self.last).as_micros();
        if self.intervals_us.len() < MAX_INTERVALS {
            self.intervals_us.push(u32::try_from(interval_us).unwrap_or(u32::MAX));
        }
        self.last = at;
        self.shortest = self.shortest.min(bytes);
        self.longest = self.longest.max(bytes);
    }

    fn report(&self, extended: bool, id: u32) -> IdReport {
        let span_s = self.last.saturating_since(self.first).as_secs_f64();
        let mut sorted = self.intervals_us.clone();
        sorted.sort_unstable();
        IdReport {
            id: id_text(extended, id),
            frames: self.frames,
            rate_hz: (span_s > 0.0).then(|| (self.frames - 1) as f64 / span_s),
            median_interval_ms: sorted.get(sorted.len() / 2).map(|&us| f64::from(us) * 1e-3),
            shortest_bytes: self.shortest,
            longest_bytes: self.longest,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn take(bus: &mut BusCensus, ms: u64, id: u32, data: &[u8]) {
        let traffic = Traffic::CanFrame { id, extended: false, data };
        bus.take(HostTime(ms * 1_000_000), traffic);
    }

    #[test]
    fn identifiers_are_counted_with_rate_length_and_median() {
        let mut bus = BusCensus::default();
        assert!(bus.report().is_none());
        for ms in [0, 10, 20, 90, 100] {
            take(&mut bus, ms, 0x7A, &[0; 8][..if ms == 20 { 3 } else { 8 }]);
        }
        take(&mut bus, 5, 0x10, &[]);
        let report = bus.report().unwrap();
        assert_eq!((report.frames, report.identifiers.len()), (6, 2));
        let most = &report.identifiers[0];
        assert_eq!(
            (most.id.as_str(), most.frames, most.shortest_bytes, most.longest_bytes),
            ("07A", 5, 3, 8)
        );
        assert_eq!((most.rate_hz, most.median_interval_ms), (Some(40.0), Some(10.0)));
        assert_eq!((report.identifiers[1].rate_hz, report.identifiers[1].median_interval_ms), (None, None));
    }

    /// The frames of an SBG sensor, then one that is too short: the same identifiers, but of somebody else.
    #[test]
    fn a_mapping_fits_when_all_its_messages_are_there_in_their_length() {
        let mut bus = BusCensus::trying_maps();
        for ms in 0..50 {
            take(&mut bus, ms, 0x121, &[0; 6]);
            take(&mut bus, ms, 0x122, &[0; 6]);
        }
        assert_eq!(bus.report().unwrap().fitting_maps, ["sbg-no-time"]);
        take(&mut bus, 51, 0x122, &[0; 8]);
        let report = bus.report().unwrap();
        assert!(report.fitting_maps.is_empty(), "{report:?}");
        let partly = ["sbg", "sbg-no-time"].map(|map| PartlyKnown {
            map: map.to_owned(),
            identifiers: vec!["121".to_owned(), "122".to_owned()],
        });
        assert_eq!(report.partly_known, partly);
    }

    #[test]
    fn a_checksum_tells_one_sensor_from_another_of_the_same_identifier() {
        let mut bus = BusCensus::trying_maps();
        (0..50).for_each(|ms| take(&mut bus, ms, 0x024, &[0; 8]));
        assert!(bus.report().unwrap().fitting_maps.is_empty());
    }
}
