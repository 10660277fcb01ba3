//! Every fault on every kind of stream, in its first second and later: named in time, over in time, counted once, and
//! not named when the one that should name it is switched off. In simulated time; the table is docs/fault-matrix.md.

mod faults;
mod streams;

use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use otolith::device::{Link, LinkError, LinkStatus, Traffic};
use otolith::imu::{Calibration, HeadSample, ImuPipeline, ImuSettings, LinkHealth, Mount, Resampler};
use otolith::runtime::trouble::Trouble;
use otolith::runtime::{Polled, Source, SourceFacts, SourceSink};
use otolith::time::HostTime;

use faults::{ALIGNED_MS, Case, FAULTS, Missing, Sign, StatusAt, case};
use streams::{Packet, Stream};

/// Streams there are when the recordings are at hand.
const STREAMS: usize = 6;
/// Length of a run, ms.
const END_MS: u64 = 6_000;
/// A fault is to be named within this time, or one sample period, ms.
const DETECTED_WITHIN_MS: u64 = 50;
/// All is to be well again within this time after the fault's end, ms.
const RECOVERED_WITHIN_MS: u64 = 500;
/// Where faults are put: while the sensor is aligned, and after.
const PHASES: [(&str, u64); 2] = [("aligning", 500), ("running", 3_000)];

/// Plays packets as a simulated clock comes to them.
struct Played {
    packets: Vec<Packet>,
    next: usize,
    now_ms: Arc<AtomicU64>,
    status: StatusAt,
}

impl Link for Played {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        let now_ms = self.now_ms.load(Ordering::Relaxed);
        let Some(packet) = self.packets.get(self.next).filter(|packet| packet.at_ms <= now_ms) else {
            return Ok(None);
        };
        self.next += 1;
        Ok(Some((HostTime(now_ms * 1_000_000), packet.traffic())))
    }

    fn status(&self) -> LinkStatus {
        (self.status)(self.now_ms.load(Ordering::Relaxed))
    }
}

struct Feed {
    resampler: Resampler,
}

impl SourceSink for Feed {
    fn traffic(&mut self, _at: HostTime, _traffic: Traffic<'_>) {}
    fn sample(&mut self, sample: HeadSample) {
        self.resampler.push(sample);
    }
    fn event(&mut self, _at: HostTime, _text: &str) {}
}

/// What could be seen of a run.
struct Seen {
    /// One for each ms.
    states: Vec<State>,
    facts: SourceFacts,
}

/// Runs a stream through source and resampler, blind to the signs given.
fn run(stream: &Stream, case: &Case, blind_to: &[Sign]) -> Seen {
    let settings = ImuSettings::default();
    let now_ms = Arc::new(AtomicU64::new(0));
    let (packets, status) = (case.packets.clone(), Arc::clone(&case.status));
    let link = Played { packets, next: 0, now_ms: Arc::clone(&now_ms), status };
    let pipeline = ImuPipeline::new(&settings, Calibration::default(), Mount::default(), 9.81);
    let blind = blind_to.iter().filter_map(|sign| match sign {
        Sign::Trouble(trouble) => Some(*trouble),
        Sign::Silence => None,
    });
    let mut source = Source::new(Box::new(link), (stream.decoder)(), pipeline, None).blind_to(blind);
    let mut feed = Feed { resampler: Resampler::new(settings.hold_limit_s) };
    let mut states = Vec::new();
    for ms in 0..END_MS {
        now_ms.store(ms, Ordering::Relaxed);
        while matches!(source.poll(Duration::ZERO, &mut feed), Ok(Polled::Traffic)) {}
        let now = HostTime(ms * 1_000_000);
        // Silence is switched off where nobody asks for the time after the newest sample.
        let newest = feed.resampler.newest().filter(|_| blind_to.contains(&Sign::Silence));
        let (_, health) = feed.resampler.at(newest.map_or(now, |newest| newest.min(now)));
        states.push(State { troubles: source.troubles().collect(), health });
    }
    Seen { states, facts: source.facts() }
}

/// What could be seen at a time.
struct State {
    troubles: Vec<Trouble>,
    health: LinkHealth,
}

impl State {
    fn shows(&self, sign: Sign) -> bool {
        match sign {
            Sign::Trouble(trouble) => self.troubles.contains(&trouble),
            Sign::Silence => matches!(self.health, LinkHealth::Stale | LinkHealth::Lost),
        }
    }

    /// Nothing is named and, once the sensor is aligned, samples come.
    fn is_well(&self, at_ms: u64) -> bool {
        self.troubles.is_empty() && (self.health == LinkHealth::Live || at_ms < ALIGNED_MS + 20)
    }
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
    fn well_after(&self, from_ms: u64) -> Option<u64> {
        let last_bad = self.states.iter().enumerate().rposition(|(ms, state)| !state.is_well(ms as u64));
        let well_from = last_bad.map_or(0, |ms| ms as u64 + 1);
        (well_from < END_MS).then(|| well_from.saturating_sub(from_ms))
    }
}

/// One cell: its text, or what is wrong with it.
fn cell(fault: &str, stream: &Stream, at_ms: u64, clean: &SourceFacts) -> Result<String, String> {
    let case = match case(fault, stream, at_ms, END_MS) {
        Ok(case) => case,
        Err(why) => return Ok(format!("- ({why})")),
    };
    let seen = run(stream, &case, &[]);
    let well_ms = seen.well_after(case.ends_ms).ok_or("not well at the end")?;
    if well_ms > RECOVERED_WITHIN_MS {
        return Err(format!("well only {well_ms} ms after the end"));
    }
    let text = if case.signs.is_empty() {
        match seen.states.iter().flat_map(|state| &state.troubles).next() {
            Some(named) => return Err(format!("{} is named without cause", named.name())),
            None => "nothing to name".to_owned(),
        }
    } else {
        let (sign, after_ms) = seen.first_sign(&case.signs, case.begins_ms).ok_or("is not named")?;
        if after_ms > DETECTED_WITHIN_MS.max(stream.period_ms) {
            return Err(format!("{sign:?} is named only after {after_ms} ms"));
        }
        if let Some((sign, _)) = run(stream, &case, &case.signs).first_sign(&case.signs, 0) {
            return Err(format!("{sign:?} is named although it is switched off"));
        }
        let name = match sign {
            Sign::Trouble(trouble) => trouble.name(),
            Sign::Silence => "stale",
        };
        format!("{name} {after_ms}/{well_ms}")
    };
    account(&case, stream, clean, &seen.facts)?;
    Ok(text)
}

/// Holds what was counted against what happened: nothing is lost without a count, nothing counted twice.
fn account(case: &Case, stream: &Stream, clean: &SourceFacts, facts: &SourceFacts) -> Result<(), String> {
    let lost = clean.imu.samples - facts.imu.samples;
    let (fewest, most) = case.lost;
    if !(fewest..=most).contains(&lost) {
        return Err(format!("{lost} samples are lost, expected {fewest} to {most}"));
    }
    let repeated = facts.decode.repeated + facts.imu.repeated + facts.imu.out_of_order;
    let clock_set = facts.imu.clock_resets > 0;
    if repeated != case.repeated && !clock_set {
        return Err(format!("{repeated} packets are counted as repeated, expected {}", case.repeated));
    }
    let missing = facts.decode.missing;
    let expected = match case.missing {
        _ if !stream.counts_packets || clock_set => return Ok(()),
        Missing::Unknown if missing <= 2 * lost => return Ok(()),
        Missing::Unknown => 0,
        Missing::AsLost => lost,
        Missing::AtLeast(gone) => gone + if stream.is_can() { 0 } else { lost - fewest },
    };
    // A sequence number of 8 bits does not show multiples of 256; the gap in time does.
    let shown = |count: u64| if stream.name == "otolith-serial" { count % 256 } else { count };
    if missing == shown(expected) {
        return Ok(());
    }
    Err(format!("{missing} packets are counted as missing, expected {expected}"))
}

#[test]
fn every_fault_is_named_in_time_over_in_time_and_counted_once() {
    let streams = streams::all();
    let mut table = String::new();
    let mut wrong = Vec::new();
    for stream in &streams {
        let no_fault = case("no fault", stream, 0, END_MS).expect("always possible");
        let clean = run(stream, &no_fault, &[]).facts;
        assert!(clean.imu.samples > 0, "{}: no sample without a fault", stream.name);
        let _ = writeln!(table, "\n## {}, a sample every {} ms\n", stream.name, stream.period_ms);
        let _ = writeln!(table, "| fault | {} | {} |\n|---|---|---|", PHASES[0].0, PHASES[1].0);
        for fault in FAULTS {
            let cells = PHASES.map(|(phase, at_ms)| {
                cell(fault, stream, at_ms, &clean).unwrap_or_else(|why| {
                    wrong.push(format!("{}, {fault}, {phase}: {why}", stream.name));
                    format!("**{why}**")
                })
            });
            let _ = writeln!(table, "| {fault} | {} | {} |", cells[0], cells[1]);
        }
    }
    println!("{table}");
    assert!(wrong.is_empty(), "{} cells are wrong:\n{}", wrong.len(), wrong.join("\n"));
    if streams.len() == STREAMS {
        assert_documented(&table);
    }
}

/// The table in docs/fault-matrix.md is this one; `OTOLITH_WRITE_DOCS=1` writes it.
fn assert_documented(table: &str) {
    const MARK: &str =
        "<!-- generated below: cargo test --test it fault_matrix, with OTOLITH_WRITE_DOCS=1 -->\n";
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/fault-matrix.md");
    let page = std::fs::read_to_string(path).expect("docs/fault-matrix.md");
    let (text, documented) = page.split_once(MARK).expect("the mark");
    if documented == table {
        return;
    }
    assert!(
        std::env::var_os("OTOLITH_WRITE_DOCS").is_some(),
        "docs/fault-matrix.md is out of date: run this test with OTOLITH_WRITE_DOCS=1"
    );
    std::fs::write(path, format!("{text}{MARK}{table}")).expect("written");
}
