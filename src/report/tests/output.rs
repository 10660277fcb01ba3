//! JSON, table, figure and tick times.

use std::time::Duration;

use super::{golden, input, leaning, output, upright};
use crate::report::summary::{LinkCounters, RunFacts, TimingSummary};
use crate::report::svg::{self, Caption};
use crate::report::{Analysis, Summary, TickTimes, Trace, table};
use crate::tick::CharacterOutput;

/// Green leans more and more from the stop at 8 s on and falls at 11 s.
fn falling() -> Trace {
    leaning(8.0, 4.0, Some(11_000))
}

fn summary() -> Summary {
    let mut times = TickTimes::new();
    for us in 1..=100 {
        times.record(Duration::from_micros(us));
    }
    let facts = RunFacts {
        source: "mock:chair".into(),
        duration_s: 14.0,
        samples: 2801,
        link: LinkCounters { packets: 2801, gaps: 1, missing: 3, ..LinkCounters::default() },
        timing: TimingSummary::new(&times, 14.0, 0.7, 0),
    };
    let mut summary = Summary::new(facts, &Analysis::new(&falling(), None));
    summary.events.push("link stale from 3.10 s to 3.12 s".into());
    summary.recording = Some("run.mcap".into());
    summary
}

#[test]
fn the_json_object_has_the_promised_keys() {
    let json = serde_json::to_value(summary()).unwrap();
    let keys = |value: &serde_json::Value| {
        value.as_object().unwrap().keys().map(String::as_str).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(
        keys(&json),
        "blue chair duration_s events green link recording samples source timing verdict"
    );
    assert_eq!(keys(&json["link"]), "bad_checksum bytes_skipped dropped gaps missing packets");
    assert_eq!(keys(&json["chair"]), "peak_rate_rpm spins turned_deg");
    assert_eq!(keys(&json["chair"]["spins"][0]), "rate_rpm start_s stop_s");
    let character = "com_path_m com_range_after_stop_m cop_ellipse_95_m2 cop_path_m \
                     cop_within_5mm_after_stop fell_at_s omega_hat_at_stop_rad_s peak_com_sway_deg \
                     peak_foot_tilt_deg peak_gravity_tilt_deg peak_gravity_tilt_in_spin_deg recovery_s \
                     rms_com_sway_deg";
    assert_eq!(keys(&json["green"]), character);
    assert_eq!(keys(&json["blue"]), character);
    assert_eq!(keys(&json["timing"]), "overruns realtime_factor tick_us ticks");
    assert_eq!(keys(&json["timing"]["tick_us"]), "max p50 p99");
    assert_eq!(json["green"]["fell_at_s"], 11.0);
    assert!(json["blue"]["fell_at_s"].is_null());
    assert_eq!(json["timing"]["realtime_factor"], 20.0);
}

#[test]
fn the_table_reads_like_this() {
    let expected = "\
mock:chair  14.0 s, 2801 samples
chair   peak 30.0 rpm, turned 900.0 deg
spin    30.0 rpm from 2.00 s to 8.00 s
link    2801 packets, 3 missing, 1 gaps
ticks   100, 20.0 x real time, 50 us median, 100 us max, 0 overruns

                                           green          blue
fell at (s)                                11.00             -
peak gravity tilt in spin (deg)             0.00          0.00
peak gravity tilt (deg)                     9.60          0.00
peak CoM sway (deg)                        12.00          0.00
peak foot tilt (deg)                        1.20          0.00
recovery, tilt < 0.5 deg (s)                   -           0.0
CoM range, forward x left (mm)       199.0 x 0.0     0.0 x 0.0
CoP path (mm)                                0.0           0.0
CoP 95 % ellipse (mm2)                       0.0           0.0
CoP within 5 mm (% of ticks)                50.1         100.0
believed rate at stop (rpm)                -11.5           0.0

green fell 3.0 s after the stop; blue stayed balanced.
- link stale from 3.10 s to 3.12 s
recording run.mcap
";
    assert_eq!(table::render(&summary(), false), expected);
}

#[test]
fn the_age_of_the_newest_sample_is_told_where_it_is_known() {
    let mut summary = summary();
    summary.timing.max_sample_age_ms = Some(23.4);
    let text = table::render(&summary, false);
    assert!(text.contains("0 overruns\nage     newest sample 23 ms at most\n"), "{text}");
}

#[test]
fn colour_adds_nothing_but_colour() {
    let coloured = table::render(&summary(), true);
    assert!(coloured.contains("\x1b[32m") && coloured.contains("\x1b[34m"));
    let mut plain = coloured;
    for code in ["\x1b[32m", "\x1b[34m", "\x1b[1m", "\x1b[0m"] {
        plain = plain.replace(code, "");
    }
    assert_eq!(plain, table::render(&summary(), false));
}

fn caption(title: &str) -> Caption {
    let (x, y) = (0.129, 0.13);
    Caption {
        title: title.into(),
        subtitle: "chair 30 rpm for 15 s; observer seed, dominant time constant 5.7 s; gain set A".into(),
        support_polygon: vec![[x, y], [-x, y], [-x, -y], [x, -y]],
    }
}

/// All text of the figure, one piece per line.
fn texts(figure: &str) -> String {
    let document = roxmltree::Document::parse(figure).expect("well-formed XML");
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    texts.filter_map(|node| node.text()).collect::<Vec<_>>().join("\n")
}

#[test]
fn the_figure_is_well_formed_whatever_it_is_called() {
    let trace = falling();
    let analysis = Analysis::new(&trace, None);
    let title = "replay:<a & b>\u{1b} \"c\".txt";
    let figure = svg::render(&trace, &analysis, &caption(title));
    let texts = texts(&figure);
    assert!(texts.contains("replay:<a & b>  \"c\".txt"), "{texts}");
    assert!(texts.contains("green fell at 11.0 s"), "{texts}");
    assert!(!texts.contains("blue fell"), "{texts}");
    assert_eq!(figure, svg::render(&trace, &analysis, &caption(title)), "the same run, the same bytes");
}

#[test]
fn empty_and_tiny_runs_still_give_a_figure() {
    let mut trace = Trace::new();
    for tick in 0..3 {
        let figure = svg::render(&trace, &Analysis::new(&trace, None), &Caption::default());
        assert!(texts(&figure).contains("time (s)"));
        assert!(!figure.contains("NaN") && !figure.contains("inf"));
        let lost = CharacterOutput { cop_platform: None, ..upright() };
        trace.push(&input(tick, None), &output(tick, lost, lost));
    }
}

#[test]
fn a_golden_run_fits_its_figure() {
    let Some(trace) = golden("A_g30_15", "A_blue30_15") else { return };
    let figure = svg::render(&trace, &Analysis::new(&trace, None), &caption("mock:chair"));
    let document = roxmltree::Document::parse(&figure).unwrap();
    let curves: Vec<_> = document.descendants().filter(|node| node.has_tag_name("polyline")).collect();
    assert_eq!(curves.len(), 6 + 4, "two curves in each panel and map");
    for curve in curves {
        let points = curve.attribute("points").unwrap().split(' ');
        let places: Vec<(f64, f64)> = points
            .map(|point| point.split_once(',').unwrap())
            .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
            .collect();
        assert!(places.len() <= 4002);
        assert!(places.iter().all(|(x, y)| (60.0..745.0).contains(x) && (95.0..800.0).contains(y)));
    }
}

#[test]
fn tick_times_are_exact_to_a_64th() {
    let mut times = TickTimes::new();
    assert_eq!(times.quantile_ns(0.5), 0);
    for ns in 1..=10_000 {
        times.record(Duration::from_nanos(ns));
    }
    for (share, exact) in [(0.001, 10.0), (0.5, 5000.0), (0.99, 9900.0), (1.0, 10_000.0)] {
        let found = times.quantile_ns(share) as f64;
        assert!(found >= exact && found <= exact * (1.0 + 1.0 / 64.0), "{share}: {found}");
    }
    times.record(Duration::from_secs(3600));
    assert_eq!(times.count(), 10_001);
    assert_eq!(times.percentiles().max, 3.6e9);
    assert_eq!(times.quantile_ns(1.0), 3_600_000_000_000);
}
