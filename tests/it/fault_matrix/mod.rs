//! Every fault on every kind of stream, in its first second and later: named in time, over in time, counted once, and
//! not named when the one that should name it is switched off. In simulated time; the table is docs/fault-matrix.md.

#[path = "../../common/fault_bench.rs"]
mod fault_bench;

mod device;
mod faults;
mod streams;

use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Duration;

use otolith::device::find::PortFinder;
use otolith::device::reconnect::Reconnecting;
use otolith::runtime::SourceFacts;
use otolith::time::Clock;

use device::{Device, NODE, Outage};
use fault_bench::{Bench, END_MS, PHASES, Seen, Sign, StreamClock};
use faults::{Case, FAULTS, Missing, case};
use streams::{Carrier, Counting, Parts, Stream};

/// Streams there are when the recordings are at hand.
const STREAMS: usize = 14;

/// Runs a stream through the program's own reconnecting, source and resampler, blind to the signs given.
fn run(stream: &Stream, case: &Case, blind_to: &[Sign]) -> Seen {
    let clock = Arc::new(StreamClock::default());
    let device = Arc::new(Device {
        packets: case.packets.clone(),
        outage: case.outage,
        status: Arc::clone(&case.status),
        clock: Arc::clone(&clock),
    });
    let listed = Arc::clone(&device);
    // A CAN interface is opened by its name alone.
    let has_nodes = stream.carrier != Carrier::Can;
    let ports = move || if has_nodes { listed.ports() } else { Vec::new() };
    let mut finder = PortFinder::new(NODE, ports);
    let open_line = stream.open_line;
    let opener = move || finder.open(|node| open_line(device.open(node)?));
    let reconnect_clock = Arc::clone(&clock) as Arc<dyn Clock>;
    let link = Reconnecting::open(opener, reconnect_clock).expect("plugged in at first");
    let mut bench = Bench::new(&clock, Box::new(link), (stream.decoder)(), blind_to);
    for ms in 0..END_MS {
        clock.set_ms(ms);
        while bench.take_in(Duration::ZERO) {}
        bench.look();
    }
    bench.end()
}

/// One cell: its text, or what is wrong with it.
fn cell(fault: &str, stream: &Stream, at_ms: u64, clean: &SourceFacts) -> Result<String, String> {
    let case = match case(fault, stream, at_ms, END_MS) {
        Ok(case) => case,
        Err(why) => return Ok(format!("- ({why})")),
    };
    let (text, seen) = case.expected.cell(stream.period_ms, |blind_to| run(stream, &case, blind_to))?;
    account(&case, stream, clean, &seen.facts)?;
    if let Some(outage) = case.outage.filter(|outage| outage.node != NODE) {
        let found = format!("found again as {}", outage.node);
        if !seen.events.iter().any(|event| event.ends_with(&found)) {
            return Err(format!("not {found}"));
        }
        let unknown = Outage { has_serial_number: false, ..outage };
        let case = Case { outage: Some(unknown), ..case };
        if run(stream, &case, &[]).well_after(case.expected.ends_ms).is_some() {
            return Err("is found again without its serial number".to_owned());
        }
    }
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
    if clock_set {
        return Ok(());
    }
    let more = lost - fewest;
    let expected = match case.missing {
        _ if stream.counting == Counting::Nothing => 0..=0,
        Missing::Unknown => 0..=2 * lost,
        Missing::AsLost if stream.parts == Parts::ByTick => lost..=2 * lost,
        Missing::AsLost => lost..=lost,
        // Half a sample more is one packet more.
        Missing::AtLeast(gone) if stream.parts == Parts::ByTick => gone..=gone + 2 * more,
        Missing::AtLeast(gone) => gone + more..=gone + more,
    };
    // A sequence number of 8 bits does not show multiples of 256; the gap in time does.
    let shown = |count: u64| if stream.counting == Counting::Sequence8 { count % 256 } else { count };
    let missing = facts.decode.missing;
    if (shown(*expected.start())..=shown(*expected.end())).contains(&missing) {
        return Ok(());
    }
    Err(format!("{missing} packets are counted as missing, expected {expected:?}"))
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
        let _ = writeln!(table, "{}.\n", stream.origin);
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
