//! Who is on a CAN bus: its identifiers, and which ready mappings fit them.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::device::Traffic;
use crate::device::protocol::PacketDecoder;
use crate::device::protocol::can_map::{CAN_MAPS, CanMap, CanMapDecoder, MappedMessage};
use crate::time::HostTime;

/// Identifiers named in a note; the JSON object has all of them.
const NAMED: usize = 8;
/// Least share of good checksums and of paired frames with which a mapping fits: a log may begin in the middle.
const GOOD_SHARE: f64 = 0.9;

/// What was found on a CAN bus; part of the object of `--json`.
#[derive(Clone, Debug, Serialize)]
pub(super) struct BusReport {
    pub(super) frames: u64,
    pub(super) identifiers: Vec<IdReport>,
    /// Ready mappings that fit, if none was given and the traffic is not our own protocol's.
    pub(super) fitting_maps: Vec<String>,
}

/// What was found of one identifier.
#[derive(Clone, Debug, Serialize)]
pub(super) struct IdReport {
    /// Hexadecimal: three digits of an 11-bit identifier, eight of a 29-bit one.
    pub(super) id: String,
    pub(super) frames: u64,
    pub(super) rate_hz: Option<f64>,
    pub(super) median_interval_ms: Option<f64>,
    pub(super) shortest_bytes: usize,
    pub(super) longest_bytes: usize,
}

/// Takes the frames of a bus one by one.
#[derive(Debug, Default)]
pub(super) struct BusTally {
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

impl BusTally {
    /// A tally that tries every ready mapping on the way.
    pub(super) fn trying_maps() -> Self {
        let maps = CAN_MAPS
            .iter()
            .filter_map(|shipped| CanMap::new(shipped.name, shipped.map, shipped.dbc_name, shipped.dbc).ok());
        let trials = maps.map(|map| Trial { decoder: CanMapDecoder::new(&map), map, samples: 0 }).collect();
        Self { trials, ..Self::default() }
    }

    /// Takes a piece of traffic that arrived at `at`; bytes are none of a bus.
    pub(super) fn take(&mut self, at: HostTime, traffic: Traffic<'_>) {
        let Traffic::CanFrame { id, extended, data } = traffic else { return };
        self.frames += 1;
        self.ids
            .entry((extended, id))
            .and_modify(|tally| tally.take(at, data.len()))
            .or_insert_with(|| IdTally::new(at, data.len()));
        for trial in &mut self.trials {
            trial.decoder.push(traffic, &mut |_| trial.samples += 1);
        }
    }

    /// What was found; `None` if there was not one frame.
    pub(super) fn report(&self) -> Option<BusReport> {
        let mut identifiers: Vec<IdReport> =
            self.ids.iter().map(|(&(extended, id), tally)| tally.report(extended, id)).collect();
        identifiers.sort_by_key(|found| std::cmp::Reverse(found.frames));
        let fitting = self.trials.iter().filter(|trial| self.fits(trial));
        let fitting_maps = fitting.map(|trial| trial.map.name().to_owned()).collect();
        (self.frames > 0).then_some(BusReport { frames: self.frames, identifiers, fitting_maps })
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

impl IdTally {
    fn new(at: HostTime, bytes: usize) -> Self {
        Self { frames: 1, first: at, last: at, intervals_us: Vec::new(), shortest: bytes, longest: bytes }
    }

    fn take(&mut self, at: HostTime, bytes: usize) {
        self.frames += 1;
        let interval_us = at.saturating_since(self.last).as_micros();
        self.intervals_us.push(u32::try_from(interval_us).unwrap_or(u32::MAX));
        self.last = at;
        self.shortest = self.shortest.min(bytes);
        self.longest = self.longest.max(bytes);
    }

    fn report(&self, extended: bool, id: u32) -> IdReport {
        let span_s = self.last.saturating_since(self.first).as_secs_f64();
        let mut sorted = self.intervals_us.clone();
        sorted.sort_unstable();
        IdReport {
            id: if extended { format!("{id:08X}") } else { format!("{id:03X}") },
            frames: self.frames,
            rate_hz: (span_s > 0.0).then(|| (self.frames - 1) as f64 / span_s),
            median_interval_ms: sorted.get(sorted.len() / 2).map(|&us| f64::from(us) * 1e-3),
            shortest_bytes: self.shortest,
            longest_bytes: self.longest,
        }
    }
}

impl BusReport {
    /// Who is on the bus.
    pub(super) fn in_words(&self) -> String {
        let named = self.identifiers.iter().take(NAMED).map(|found| match found.rate_hz {
            Some(rate_hz) => format!("{} ({rate_hz:.1} Hz)", found.id),
            None => found.id.clone(),
        });
        format!(
            "a CAN bus: {} identifiers in {} frames, most often {}",
            self.identifiers.len(),
            self.frames,
            named.collect::<Vec<_>>().join(", ")
        )
    }

    /// What a user who has named no mapping can do with the `file` of this bus.
    pub(super) fn advice(&self, file: &str) -> Vec<String> {
        if self.fitting_maps.is_empty() {
            return vec![
                "no ready mapping fits; describe the sensor by a DBC file and a mapping (examples in configs/can): \
                 --map FILE.toml --dbc FILE.dbc"
                    .to_owned(),
            ];
        }
        let file = shell_word(file);
        let fitting = self.fitting_maps.iter();
        fitting
            .map(|map| format!("the mapping {map} fits this bus: otolith inspect {file} --map {map}"))
            .collect()
    }
}

/// A word as a shell takes it.
fn shell_word(text: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "/._-+:@".contains(letter);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn take(bus: &mut BusTally, ms: u64, id: u32, data: &[u8]) {
        let traffic = Traffic::CanFrame { id, extended: false, data };
        bus.take(HostTime(ms * 1_000_000), traffic);
    }

    #[test]
    fn identifiers_are_counted_with_rate_length_and_median() {
        let mut bus = BusTally::default();
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
        assert!(report.in_words().ends_with("2 identifiers in 6 frames, most often 07A (40.0 Hz), 010"));
    }

    /// The frames of an SBG sensor, then one that is too short: the same identifiers, but of somebody else.
    #[test]
    fn a_mapping_fits_when_all_its_messages_are_there_in_their_length() {
        let mut bus = BusTally::trying_maps();
        for ms in 0..50 {
            take(&mut bus, ms, 0x121, &[0; 6]);
            take(&mut bus, ms, 0x122, &[0; 6]);
        }
        assert_eq!(bus.report().unwrap().fitting_maps, ["sbg-no-time"]);
        let advice = bus.report().unwrap().advice("my log.txt");
        assert!(advice[0].ends_with("otolith inspect 'my log.txt' --map sbg-no-time"), "{advice:?}");
        take(&mut bus, 51, 0x122, &[0; 8]);
        let report = bus.report().unwrap();
        assert!(report.fitting_maps.is_empty() && report.advice("x")[0].contains("--dbc"), "{report:?}");
    }

    #[test]
    fn a_checksum_tells_one_sensor_from_another_of_the_same_identifier() {
        let mut bus = BusTally::trying_maps();
        (0..50).for_each(|ms| take(&mut bus, ms, 0x024, &[0; 8]));
        assert!(bus.report().unwrap().fitting_maps.is_empty());
    }

    #[test]
    fn words_are_quoted_for_the_shell() {
        assert_eq!(shell_word("a/b-1.log"), "a/b-1.log");
        assert_eq!(shell_word("it's"), r"'it'\''s'");
    }
}
