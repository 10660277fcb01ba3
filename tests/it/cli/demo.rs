//! `otolith demo`: what both characters do, and what is printed and written.

use std::sync::LazyLock;

use serde_json::Value;

use super::{Place, SHORT, number};

/// Runs the demo as fast as possible.
fn demo(args: &[&str]) -> Value {
    let place = Place::new();
    let run = place.run(&[&["demo", "--pace", "max", "--json", "--out", "out"], args].concat()).done();
    run.json()
}

/// The demo as it is without arguments.
static DEFAULT: LazyLock<Value> = LazyLock::new(|| demo(&[]));

#[test]
fn green_sways_after_the_stop_and_recovers_and_blue_stands() {
    let json = &*DEFAULT;
    let green = |key: &str| number(&json["green"], key);
    assert_eq!(json["green"]["fell_at_s"], Value::Null);
    assert!((3.0..=6.5).contains(&green("/peak_gravity_tilt_deg")), "{json:#}");
    assert!(green("/peak_com_sway_deg") > green("/peak_gravity_tilt_deg"), "{json:#}");
    assert!(green("/peak_gravity_tilt_in_spin_deg") <= 2.5, "{json:#}");
    assert!((0.0..=0.05).contains(&green("/cop_within_5mm_after_stop")), "{json:#}");
    assert!(json["verdict"].as_str().expect("a sentence").contains("and steadied"), "{json:#}");
    // The after-effect: the chair has stopped, and green believes that it turns to the other side.
    assert!(green("/omega_hat_at_stop_rad_s") < -1.0, "{json:#}");

    assert_eq!(json["blue"]["fell_at_s"], Value::Null);
    assert!(number(json, "/blue/peak_com_sway_deg") < 0.3, "{json:#}");
    assert!(number(json, "/blue/cop_within_5mm_after_stop") >= 0.99, "{json:#}");
}

#[test]
fn the_json_has_every_key_with_its_type() {
    let json = &*DEFAULT;
    assert_eq!(json["source"], "mock:chair");
    let keys = |value: &Value| -> Vec<String> {
        let mut keys: Vec<String> = value.as_object().expect("an object").keys().cloned().collect();
        keys.sort();
        keys
    };
    assert_eq!(
        keys(&json["link"]),
        ["bad_checksum", "bytes_skipped", "dropped", "gaps", "missing", "packets"]
    );
    assert_eq!(keys(&json["chair"]), ["peak_rate_rpm", "spins", "turned_deg"]);
    assert_eq!(keys(&json["timing"]), ["overruns", "realtime_factor", "tick_us", "ticks"]);
    assert_eq!(keys(&json["timing"]["tick_us"]), ["max", "p50", "p99"]);
    let of_a_character = [
        "com_path_m",
        "com_range_after_stop_m",
        "cop_ellipse_95_m2",
        "cop_path_m",
        "cop_within_5mm_after_stop",
        "fell_at_s",
        "omega_hat_at_stop_rad_s",
        "peak_com_sway_deg",
        "peak_foot_tilt_deg",
        "peak_gravity_tilt_deg",
        "peak_gravity_tilt_in_spin_deg",
        "recovery_s",
        "rms_com_sway_deg",
    ];
    for name in ["green", "blue"] {
        assert_eq!(keys(&json[name]), of_a_character);
        for axis in ["/com_range_after_stop_m/0", "/com_range_after_stop_m/1"] {
            assert!((0.0..0.3).contains(&number(&json[name], axis)), "{json:#}");
        }
    }
    for group in ["link", "timing"] {
        for (key, value) in json[group].as_object().expect("an object") {
            assert!(value.is_number() || key == "tick_us", "{group}.{key}");
        }
    }
    // 2 + 15 + 1 + 25 s of samples at 1 kHz, both ends included; HELLO and STATUS frames are packets too.
    assert_eq!((number(json, "/samples"), number(json, "/timing/ticks")), (43001.0, 43001.0));
    assert_eq!(number(json, "/duration_s"), 43.001);
    assert!(number(json, "/link/packets") > 43001.0);
    assert!((number(json, "/chair/turned_deg") / (30.0 * 6.0 * 15.0) - 1.0).abs() < 1e-3, "{json:#}");
    let [spin] = json["chair"]["spins"].as_array().expect("a list").as_slice() else { panic!("one spin") };
    for (key, expected) in [("/start_s", 2.0), ("/stop_s", 18.0), ("/rate_rpm", 30.0)] {
        assert!((number(spin, key) - expected).abs() < 0.02, "{key}: {spin}");
    }
}

#[test]
fn a_longer_spin_makes_green_fall_and_slower_ones_sway_less() {
    let fell = demo(&["--rate-rpm", "30", "--spin-s", "20"]);
    assert!(number(&fell, "/green/fell_at_s") > 23.0, "{fell:#}");
    assert_eq!(fell["blue"]["fell_at_s"], Value::Null);
    let sway = |json: &Value| number(json, "/green/peak_com_sway_deg");
    let (slow, middle) = (sway(&demo(&["--rate-rpm", "10"])), sway(&demo(&["--rate-rpm", "20"])));
    let fast = sway(&DEFAULT);
    assert!(slow < middle && middle < fast, "{slow} {middle} {fast}");
}

#[test]
fn values_that_have_no_window_are_null() {
    let json = demo(&["--rest-s", "1", "--spin-s", "0", "--ramp-s", "0", "--after-s", "0"]);
    assert_eq!(json["chair"]["spins"], Value::Array(vec![]));
    for key in ["peak_gravity_tilt_deg", "peak_com_sway_deg", "com_range_after_stop_m", "fell_at_s"] {
        assert_eq!(json["green"][key], Value::Null, "{key}");
    }
}

#[test]
fn seeds_repeat_and_differ() {
    let sway = |seed: &str| {
        let json = demo(&[&SHORT[..], &["--seed", seed]].concat());
        (json["green"].clone(), json["chair"].clone())
    };
    assert_eq!(sway("7"), sway("7"));
    assert_ne!(sway("7"), sway("8"));
}

#[test]
fn the_files_are_in_a_new_folder_named_by_date_and_time() {
    let place = Place::new();
    let command = [&["demo"], &SHORT[..]].concat();
    place.run(&command).done();
    place.run(&command).done();
    let names = place.names();
    assert_eq!(names.len(), 2, "{names:?}");
    for name in &names {
        let stamp = name.strip_prefix("otolith-").expect("the program's name in front");
        let shape: String = stamp[..15].chars().map(|c| if c.is_ascii_digit() { 'd' } else { c }).collect();
        assert_eq!(shape, "dddddddd-dddddd", "{name}");
        for file in ["figure.svg", "summary.json", "recording.mcap"] {
            assert!(place.path(name).join(file).exists(), "{name}/{file}");
        }
    }
}

#[test]
fn the_summary_file_is_what_was_printed_and_the_figure_is_svg() {
    let place = Place::new();
    let run =
        place.run(&[&["demo", "--out", "x", "--record", "y.mcap", "--json"], &SHORT[..]].concat()).done();
    let json = run.json();
    assert_eq!((&json["figure"], &json["recording"]), (&"x/figure.svg".into(), &"y.mcap".into()));
    let summary = std::fs::read_to_string(place.path("x/summary.json")).expect("written");
    assert_eq!(serde_json::from_str::<Value>(&summary).expect("JSON"), json);
    let figure = std::fs::read_to_string(place.path("x/figure.svg")).expect("written");
    let svg = roxmltree::Document::parse(&figure).expect("well-formed");
    assert_eq!(svg.root_element().tag_name().name(), "svg");
    assert_eq!(place.names(), ["x", "y.mcap"]);
}

#[test]
fn nothing_is_overwritten_without_force() {
    let place = Place::new();
    let short = |args: &[&str]| place.run(&[&["demo"], args, &SHORT].concat());
    short(&["--out", "x"]).done();
    let before = std::fs::read(place.path("x/recording.mcap")).expect("written");
    short(&["--out", "x"]).refused(2, &["x/figure.svg: the file exists already", "--force"]);
    short(&["--record", "x/recording.mcap"]).refused(2, &["x/recording.mcap: the file exists already"]);
    assert_eq!(place.names(), ["x"], "a refused run leaves no folder");
    assert_eq!(std::fs::read(place.path("x/recording.mcap")).expect("still there"), before);
    short(&["--out", "x", "--force", "--seed", "1"]).done();
    assert_ne!(std::fs::read(place.path("x/recording.mcap")).expect("written again"), before);
}
