//! `otolith replay`: whole and damaged recordings.

use std::sync::LazyLock;

use serde_json::Value;

use super::{Place, Run, SHORT, number};

/// A good recording of a short run of the mock chair, and the JSON of that run.
static GOOD: LazyLock<(Vec<u8>, Value)> = LazyLock::new(|| {
    let place = Place::new();
    let run = place.run(&[&["demo", "--out", "x", "--json"], &SHORT[..]].concat()).done();
    (std::fs::read(place.path("x/recording.mcap")).expect("written"), run.json())
});
/// Ticks in it: 1.5 s, both ends included.
const TICKS: f64 = 1501.0;

/// A folder with a recording that holds `bytes`.
fn place_with(bytes: &[u8]) -> Place {
    let place = Place::new();
    place.write("r.mcap", bytes);
    place
}

#[test]
fn a_whole_recording_is_bit_identical() {
    let place = place_with(&GOOD.0);
    let run = place.run(&["replay", "r.mcap", "--verify"]).done();
    assert!(run.stdout.contains("bit-identical: 1501 of 1501 ticks"), "{}", run.stdout);
    let json = place.run(&["replay", "r.mcap", "--verify", "--json"]).done().json();
    assert_eq!(json["verify"]["bit_identical"], true);
    assert_eq!(number(&json, "/verify/ticks_compared"), TICKS);
    assert_eq!(json["damage"]["findings"], Value::Array(vec![]));
}

#[test]
fn a_recording_holds_the_whole_motion_and_repeats_it() {
    let place = Place::new();
    let own = "[[pose]]\ntime_s = 0\n[[pose]]\ntime_s = 0.8\nangles = { neck_y = -0.3 }";
    place.write("nod.toml", own);
    place.write("c.toml", "[core]\nmotion_start_s = 0.4");
    let spin = ["--rest-s", "0.5", "--spin-s", "2", "--ramp-s", "0.2", "--after-s", "0.5", "--json"];
    let demo = |args: &[&str]| place.run(&[&["demo"], args, &spin].concat()).done().json();
    let standing = demo(&["--out", "standing"]);
    let moving = demo(&["--config", "c.toml", "--motion", "nod.toml", "--out", "moving"]);
    assert_ne!(moving["green"], standing["green"], "the nod is seen");
    std::fs::remove_file(place.path("nod.toml")).expect("removed");
    let json = place.run(&["replay", "moving/recording.mcap", "--verify", "--json"]).done().json();
    assert_eq!(json["verify"]["bit_identical"], true);
    assert_eq!(json["green"], moving["green"]);
}

#[test]
fn a_replay_says_what_the_run_said() {
    let place = place_with(&GOOD.0);
    let json = place.run(&["replay", "r.mcap", "--json", "--out", "again"]).done().json();
    for key in ["samples", "duration_s", "link", "chair", "green", "blue", "verdict", "events"] {
        assert_eq!(json[key], GOOD.1[key], "{key}");
    }
    assert_eq!(json["verify"], Value::Null);
    assert!(place.path("again/figure.svg").exists() && place.path("again/summary.json").exists());
    place.run(&["replay", "r.mcap", "--out", "again"]).refused(2, &["again/figure.svg", "--force"]);
    place.run(&["replay", "r.mcap", "--out", "again", "--force"]).done();
}

/// What is good of a damaged recording is shown by every command that reads it, and all of them end with 3.
#[track_caller]
fn damaged(bytes: &[u8], ticks: std::ops::RangeInclusive<f64>) -> Run {
    let place = place_with(bytes);
    let run = place.run(&["replay", "r.mcap", "--verify", "--json"]);
    run.complains(3, &["r.mcap: the recording is damaged:", "ticks read, at least ", "lost", "bytes "]);
    let json = run.json();
    assert_eq!(json["damage"]["complete"], false);
    let [verified, all] = ["/verify/ticks_compared", "/damage/ticks_read"].map(|key| number(&json, key));
    assert!(ticks.contains(&verified) && verified <= all, "{verified} of {all} ticks: {json:#}");
    assert_eq!(json["verify"]["differing_ticks"], 0);
    assert_eq!(number(&json, "/timing/ticks"), verified);
    run
}

#[test]
fn one_flipped_bit_anywhere_is_found() {
    let bytes = &GOOD.0;
    let length = bytes.len();
    for (byte, least_ticks) in [
        (0, TICKS),           // opening magic
        (9, TICKS),           // length of the first record
        (3000, TICKS),        // the configuration, whose copy is good
        (length / 3, 1.0),    // data
        (length / 2, 1.0),    // data
        (length - 60, TICKS), // index at the end
        (length - 1, TICKS),  // closing magic
    ] {
        let mut bytes = bytes.clone();
        bytes[byte] ^= 0x10;
        let run = damaged(&bytes, least_ticks..=TICKS);
        let json = run.json();
        let finding = &json["damage"]["findings"][0];
        let (from, to) = (number(finding, "/offset"), number(finding, "/end"));
        assert!((from..=to).contains(&(byte as f64)), "byte {byte}: {finding}");
    }
}

#[test]
fn a_recording_cut_anywhere_is_used_up_to_the_cut() {
    let bytes = &GOOD.0;
    let length = bytes.len();
    for (cut, ticks) in [(5000, 0.0..=0.0), (length / 2, 100.0..=TICKS - 100.0), (length - 1, TICKS..=TICKS)]
    {
        damaged(&bytes[..cut], ticks);
    }
}

#[test]
fn a_recording_cut_before_its_data_is_damage_too() {
    for (cut, parts) in [
        (0, &["r.mcap: the file is empty", "0 bytes"][..]),
        (3, &["r.mcap: the recording is damaged", "cut at byte 3"]),
        (8, &["r.mcap: nothing usable in 8 bytes"]),
        (100, &["r.mcap: nothing usable in 100 bytes"]),
    ] {
        let place = place_with(&GOOD.0[..cut]);
        for args in [&["replay", "r.mcap"][..], &["replay", "r.mcap", "--verify"], &["inspect", "r.mcap"]] {
            place.run(args).refused(3, parts);
        }
    }
}

#[test]
fn replay_and_inspect_show_what_is_good_in_text() {
    let mut bytes = GOOD.0.clone();
    let half = bytes.len() / 2;
    bytes[half] ^= 1;
    let place = place_with(&bytes);
    for (args, shown) in [
        (&["replay", "r.mcap"][..], "peak CoM sway"),
        (&["replay", "r.mcap", "--verify"], "bit-identical as far as the recording is whole"),
        (&["inspect", "r.mcap"], "protocol otolith-serial"),
    ] {
        let run = place.run(args);
        run.complains(3, &["the recording is damaged", "bytes "]);
        assert!(run.stdout.contains(shown), "{}", run.stdout);
    }
}

#[test]
fn other_files_are_no_recordings() {
    let place = Place::new();
    place.write("log.txt", "1,2,3\n");
    place.run(&["replay", "log.txt"]).refused(2, &["log.txt: not a recording", "--log-map"]);
    place.run(&["replay", "nope.mcap"]).refused(2, &["nope.mcap: cannot read it"]);
    place.run(&["replay", "."]).refused(2, &[".: cannot read it"]);
    let place = place_with(&GOOD.0);
    place.run(&["run", "--device", "replay:r.mcap"]).refused(2, &["r.mcap", "`otolith replay FILE`"]);
}
