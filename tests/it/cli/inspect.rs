//! `otolith inspect` on every kind of file it may meet.

use std::fmt::Write as _;

use otolith::device::{Selector, Traffic};
use otolith::time::{Clock, SystemClock};
use otolith_firmware_protocol::can::{CanMessage, HalfSample, Ids, Ranges};
use serde_json::Value;

use super::{Place, SHORT, number, shared_log, shipped};

/// What a mock chair sends in 1.5 s: a raw capture of our serial protocol.
pub(super) fn raw_capture() -> Vec<u8> {
    let selector: Selector =
        "mock:chair?rest_s=1&spin_s=0.2&ramp_s=0.1&after_s=0.2".parse().expect("a selector");
    let clock: std::sync::Arc<dyn Clock> = std::sync::Arc::new(SystemClock::start_now());
    let mut link = otolith::device::open(&selector, &clock, None).expect("a mock");
    let mut bytes = Vec::new();
    while let Ok(piece) = link.receive(std::time::Duration::ZERO) {
        if let Some((_, Traffic::Bytes(piece))) = piece {
            bytes.extend_from_slice(piece);
        }
    }
    bytes
}

#[test]
fn a_recording() {
    let place = Place::new();
    place.run(&[&["demo", "--out", "x"], &SHORT[..]].concat()).done();
    let json = place.run(&["inspect", "x/recording.mcap", "--json"]).done().json();
    assert_eq!((&json["kind"], &json["protocol"]), (&"recording".into(), &"otolith-serial".into()));
    assert_eq!((number(&json, "/samples"), number(&json, "/ticks")), (1501.0, 1501.0));
    assert!((number(&json, "/rate_hz") - 1000.0).abs() < 0.1);
    assert!((number(&json, "/duration_s") - 1.5).abs() < 1e-3);
    assert_eq!(json["damage"]["complete"], true);
    let text = place.run(&["inspect", "x/recording.mcap"]).done().stdout;
    assert!(text.contains("samples 1501 in 1.500 s: 1000.00 Hz") && text.contains("link live"), "{text}");
}

#[test]
fn a_raw_capture_and_its_damage() {
    let place = Place::new();
    let mut bytes = raw_capture();
    place.write("good.bin", &bytes);
    let json = place.run(&["inspect", "good.bin", "--json"]).done().json();
    assert_eq!((&json["kind"], &json["protocol"]), (&"raw".into(), &"otolith-serial".into()));
    assert_eq!((number(&json, "/samples"), number(&json, "/link/bytes_skipped")), (1501.0, 0.0));
    assert!((number(&json, "/specific_force_m_s2/mean/2") - 9.80665).abs() < 0.01);
    // 30 rpm are 180 deg/s.
    assert!((number(&json, "/omega_rad_s/max/2").to_degrees() - 180.0).abs() < 1.0);

    let half = bytes.len() / 2;
    bytes[half] ^= 1;
    place.write("hurt.bin", &bytes);
    let forced = ["inspect", "hurt.bin", "--protocol", "otolith-serial", "--json"];
    let json = place.run(&forced).done().json();
    assert_eq!((number(&json, "/samples"), number(&json, "/link/missing")), (1500.0, 1.0));

    let run = place.run(&["run", "--device", "replay:good.bin", "--pace", "max", "--json"]).done().json();
    assert_eq!(number(&run, "/samples"), 1501.0);
}

/// The numbers of `imu-logs/PROVENANCE.md`.
#[test]
fn a_telemetry_log() {
    let Some(log) = shared_log("mavlink/ardusub_small.tlog") else { return };
    let place = Place::new();
    let json = place.run(&["inspect", &log, "--json"]).done().json();
    assert_eq!((&json["kind"], &json["protocol"]), (&"tlog".into(), &"mavlink".into()));
    assert_eq!((number(&json, "/samples"), number(&json, "/link/packets")), (528.0, 35_916.0));
    for count in ["bad_checksum", "bytes_skipped", "missing"] {
        assert_eq!(number(&json, &format!("/link/{count}")), 0.0, "{count}");
    }
    assert!((number(&json, "/duration_s") - 263.5).abs() < 0.05);
    for (what, mg, tolerance) in [("min", -1053.0, 1e-6), ("max", -956.0, 1e-6), ("mean", -999.0, 0.05)] {
        let found = number(&json, &format!("/specific_force_m_s2/{what}/2")) / 9.80665e-3;
        assert!((found - mg).abs() < tolerance, "{what}: {found} mg");
    }
    let notes = json["notes"].to_string();
    for part in
        ["RAW_IMU of system 1", "says ArduPilot", "528 messages of a sensor held zeros", "4 packets were cut"]
    {
        assert!(notes.contains(part), "{part} is missing in {notes}");
    }
    // Two samples a second by the log's own stamps: enough to stay linked, and no second of it is skipped.
    let run =
        place.run(&["run", "--device", &format!("replay:{log}"), "--pace", "max", "--json"]).done().json();
    assert_eq!(number(&run, "/samples"), 528.0);
    assert!((number(&run, "/duration_s") - 263.2).abs() < 0.1, "{run:#}");
}

#[test]
fn a_candump_log_of_our_frames() {
    let place = Place::new();
    let ids = Ids::of_node(0).expect("fits");
    let ranges = Ranges { gyro_range_dps: 500, accel_range_g: 4, rate_hz: 1000 };
    let mut log = String::new();
    let mut say = |ms: u32, message: CanMessage| {
        let (id, data) = ids.frame(&message);
        let data: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
        writeln!(log, "(1700000000.{ms:03}000) can0 {id:03X}#{data}").expect("written");
    };
    say(0, CanMessage::Ranges(ranges));
    for ms in 0..1000 {
        let tick = (ms * 100 % 0x1_0000) as u16; // of 10 us
        say(ms, CanMessage::Gyro(HalfSample { xyz: [0, 0, 3276], tick }));
        say(ms, CanMessage::Accel(HalfSample { xyz: [0, 0, 8192], tick }));
    }
    place.write("can.log", &log);
    let json = place.run(&["inspect", "can.log", "--json"]).done().json();
    assert_eq!((&json["kind"], &json["protocol"]), (&"candump".into(), &"otolith-can".into()));
    assert_eq!((number(&json, "/samples"), number(&json, "/link/missing")), (1000.0, 0.0));
    assert!((number(&json, "/omega_rad_s/mean/2").to_degrees() - 500.0 * 3276.0 / 32768.0).abs() < 1e-3);
    assert!((number(&json, "/specific_force_m_s2/mean/2") - 9.80665).abs() < 1e-6);
}

#[test]
fn a_text_log_needs_its_mapping() {
    let place = Place::new();
    place.write("log.txt", "0 0 0 1 0 0 10\n1000 0 0 1 0 0 10\n2000 0 0 1 0 0 -10\n");
    place.run(&["inspect", "log.txt"]).refused(2, &["log.txt: ", "mapping", "--log-map"]);
    let mapping = shipped("configs/logs/arduino-mpu6050.toml");
    let json = place.run(&["inspect", "log.txt", "--log-map", &mapping, "--json"]).done().json();
    assert_eq!((number(&json, "/samples"), &json["protocol"]), (3.0, &"text".into()));
    assert!((number(&json, "/omega_rad_s/min/2").to_degrees() + 10.0).abs() < 1e-9);
}

/// 3 s at 100 Hz: 1 s of rest, then 60 deg/s to the left.
fn text_log() -> String {
    let row = |i: u32| format!("{} 0 0 1 0 0 {}\n", i * 10_000, if i < 100 { 0 } else { 60 });
    (0..=300).map(row).collect()
}

#[test]
fn a_recorded_text_log_brings_its_mapping_along() {
    let place = Place::new();
    place.write("log.txt", text_log());
    std::fs::copy(shipped("configs/logs/arduino-mpu6050.toml"), place.path("map.toml")).expect("copied");
    let args = ["run", "--device", "replay:log.txt", "--log-map", "map.toml", "--pace", "max", "--json"];
    let run = place.run(&[&args[..], &["--record", "r.mcap"]].concat()).done().json();
    assert_eq!(number(&run, "/samples"), 301.0);
    // One interval ramps up: 60 deg/s for 2 s less half of 10 ms.
    assert!((number(&run, "/chair/turned_deg") - 60.0 * 2.005).abs() < 0.1, "{run:#}");
    // The recording needs nothing else: it holds the mapping.
    std::fs::remove_file(place.path("map.toml")).expect("removed");
    std::fs::remove_file(place.path("log.txt")).expect("removed");
    let json = place.run(&["inspect", "r.mcap", "--json"]).done().json();
    assert_eq!((number(&json, "/samples"), number(&json, "/ticks")), (301.0, number(&run, "/timing/ticks")));
    place.run(&["replay", "r.mcap", "--verify"]).done();
}

/// A pipe can be read once only, and finding out what a file holds is the first time.
#[cfg(unix)]
#[test]
fn a_pipe_is_refused_instead_of_losing_its_beginning() {
    let place = Place::new();
    for args in [&["inspect", "/dev/null"][..], &["run", "--device", "replay:/dev/null"]] {
        place.run(args).refused(2, &["/dev/null: this is a pipe or a device", "save it to a file first"]);
    }
}

#[test]
fn foreign_and_random_bytes_hold_no_sample_and_say_so() {
    let place = Place::new();
    let noise: Vec<u8> = (0..5000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    place.write("noise.bin", &noise);
    let mut files = vec![(place.path("noise.bin").display().to_string(), true)];
    // Frames of others on a bus are no junk.
    files.extend(shared_log("can/toyota_scion_xb_drive.candump.log").map(|log| (log, false)));
    for (file, is_junk) in files {
        let json = place.run(&["inspect", &file, "--json"]).done().json();
        assert_eq!((&json["protocol"], number(&json, "/samples")), (&"unknown".into(), 0.0));
        assert_eq!(number(&json, "/link/bytes_skipped") > 0.0, is_junk, "{json:#}");
        assert_eq!((&json["rate_hz"], &json["omega_rad_s"]), (&Value::Null, &Value::Null));
        assert!(json["notes"][0].as_str().expect("a note").contains("no sample was found"), "{json:#}");
        let run = place.run(&["run", "--device", &format!("replay:{file}"), "--pace", "max"]);
        let told =
            if is_junk { "bytes skipped, 0 packets of other kinds)" } else { "8762 packets of other kinds)" };
        run.complains(1, &["not one sample arrived", told, "`otolith inspect FILE`"]);
    }
}
