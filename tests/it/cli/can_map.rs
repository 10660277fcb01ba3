//! CAN sensors that a DBC file and a mapping describe, as a user meets them.

use std::fmt::Write as _;

use serde_json::Value;

use super::{Place, number, shared_log, shipped};

const TOYOTA: &str = "can/toyota_scion_xb_drive.candump.log";

#[track_caller]
fn assert_near(json: &Value, pointer: &str, expected: f64, tolerance: f64) {
    let found = number(json, pointer);
    assert!((found - expected).abs() <= tolerance, "{pointer}: {found}, expected {expected}");
}

/// The numbers of `imu-logs/PROVENANCE.md`.
#[test]
fn a_real_drive_of_a_toyota() {
    let Some(log) = shared_log(TOYOTA) else { return };
    let place = Place::new();
    let json = place.run(&["inspect", &log, "--map", "toyota-yaw", "--json"]).done().json();
    assert_eq!((&json["kind"], &json["protocol"]), (&"candump".into(), &"can-map".into()));
    assert_eq!((number(&json, "/samples"), number(&json, "/link/packets")), (766.0, 766.0));
    assert_eq!((number(&json, "/link/bad_checksum"), number(&json, "/link/bytes_skipped")), (0.0, 0.0));
    assert_near(&json, "/duration_s", 9.207, 0.0005); // of the sensor's frames; the log has 9.229 s
    for (pointer, dps) in
        [("/omega_rad_s/min/2", -1.708), ("/omega_rad_s/mean/2", 0.233), ("/omega_rad_s/max/2", 1.220)]
    {
        assert_near(
            &json,
            pointer,
            dps * std::f64::consts::PI / 180.0,
            0.0005 * std::f64::consts::PI / 180.0,
        );
    }
    for (pointer, force) in
        [("min/0", -1.471), ("max/0", 3.984), ("min/1", -4.091), ("max/1", 1.365), ("mean/2", 9.80665)]
    {
        assert_near(&json, &format!("/specific_force_m_s2/{pointer}"), force, 0.00051);
    }
    assert_eq!((number(&json, "/omega_rad_s/max/0"), number(&json, "/omega_rad_s/min/1")), (0.0, 0.0));

    assert_eq!(number(&json, "/can/frames"), 8762.0);
    let identifiers = json["can"]["identifiers"].as_array().expect("a list");
    assert_eq!(identifiers.len(), 48);
    let sensor = identifiers.iter().find(|found| found["id"] == "024").expect("is there");
    assert_eq!(number(sensor, "/frames"), 766.0);
    assert_near(sensor, "/median_interval_ms", 11.81, 0.005);
    let notes = json["notes"].to_string();
    assert!(
        notes.contains("taken as 0: gyro.x, gyro.y") && notes.contains("assumed to stand upright"),
        "{notes}"
    );
    assert!(notes.contains("samples are dated by arrival"), "{notes}");
}

#[test]
fn a_bus_without_a_mapping_is_described_with_what_would_fit() {
    let Some(log) = shared_log(TOYOTA) else { return };
    let place = Place::new();
    let json = place.run(&["inspect", &log, "--json"]).done().json();
    assert_eq!((&json["protocol"], number(&json, "/samples")), (&"unknown".into(), 0.0));
    assert_eq!(json["can"]["fitting_maps"], serde_json::json!(["toyota-yaw"]));
    let text = place.run(&["inspect", &log]).done().stdout;
    assert!(
        text.contains("8762 frames of 48 identifiers, none of the CAN protocols otolith-can, "),
        "{text}"
    );
    assert!(text.contains("id 024       766 frames, 83.1 Hz, 8 bytes\n"), "{text}");
    assert_eq!(number(&json, "/link/bytes_skipped"), 0.0, "a frame of another device is not junk");
    let command = format!("otolith inspect {log} --map toyota-yaw");
    assert!(text.contains(&command), "{text}");
    // The command as it stands there.
    let args: Vec<&str> = command.split(' ').skip(1).collect();
    place.run(&args).done();
}

#[test]
fn a_drive_can_be_run() {
    let Some(log) = shared_log(TOYOTA) else { return };
    let device = format!("replay:{log}");
    let args = ["run", "--device", &device, "--map", "toyota-yaw", "--pace", "max", "--json"];
    let json = Place::new().run(&args).done().json();
    assert_eq!(number(&json, "/samples"), 766.0);
    assert_eq!(json["device"]["protocol"], "can-map");
}

/// An SBG sensor: 4 s at 100 Hz, 2 s of rest, then 60 deg/s to the left.
fn sbg_log() -> String {
    let mut log = String::new();
    for k in 0..=400_u32 {
        let rate = if k < 200 { 0 } else { 1047_i16 }; // mrad/s
        let at = format!("({}.{:06})", 1_700_000_000 + k / 100, k % 100 * 10_000);
        let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02X}")).collect::<String>();
        let time = hex(&(k * 10_000).to_le_bytes());
        let (rate, up) = (hex(&rate.to_le_bytes()), hex(&981_i16.to_le_bytes()));
        writeln!(log, "{at} can0 120#{time}00000000").expect("written");
        writeln!(log, "{at} can0 121#00000000{up}").expect("written");
        writeln!(log, "{at} can0 122#00000000{rate}").expect("written");
    }
    log
}

#[test]
fn a_recording_brings_mapping_and_dbc_file_along() {
    let place = Place::new();
    place.write("can.log", sbg_log());
    for (from, to) in [("configs/can/sbg.toml", "my.toml"), ("configs/can/sbg.dbc", "other.dbc")] {
        std::fs::copy(shipped(from), place.path(to)).expect("copied");
    }
    let args =
        ["run", "--device", "replay:can.log", "--map", "my.toml", "--dbc", "other.dbc", "--pace", "max"];
    let run = place.run(&[&args[..], &["--record", "r.mcap", "--json"]].concat()).done().json();
    assert_eq!(number(&run, "/samples"), 401.0);
    assert_eq!(run["device"]["clock"], "device");
    // One interval ramps up: 60 deg/s (1047 mrad/s) for 2 s less half of 10 ms.
    assert_near(&run, "/chair/turned_deg", 1.047_f64.to_degrees() * 2.005, 0.2);
    for name in ["can.log", "my.toml", "other.dbc"] {
        std::fs::remove_file(place.path(name)).expect("removed");
    }
    let json = place.run(&["inspect", "r.mcap", "--json"]).done().json();
    assert_eq!((&json["protocol"], number(&json, "/samples")), (&"can-map".into(), 401.0));
    assert_near(&json, "/rate_hz", 100.0, 1e-6);
    place.run(&["replay", "r.mcap", "--verify"]).done();
    // The flags stand above what was recorded.
    let json = place.run(&["inspect", "r.mcap", "--map", "sbg-no-time", "--json"]).done().json();
    assert!(json["notes"].to_string().contains("dated by arrival"), "{json:#}");
}

#[test]
fn a_ready_mapping_is_proposed_for_a_log() {
    let place = Place::new();
    place.write("can.log", sbg_log());
    let json = place.run(&["inspect", "can.log", "--json"]).done().json();
    assert_eq!(json["can"]["fitting_maps"], serde_json::json!(["sbg", "sbg-no-time"]));
    let text = place.run(&["inspect", "can.log", "--map", "sbg"]).done().stdout;
    assert!(text.contains("samples 401 in 4.000 s: 100.00 Hz"), "{text}");
}

#[test]
fn the_configuration_holds_mapping_and_dbc_file() {
    let place = Place::new();
    let text = place
        .run(&["run", "--device", "can:can0", "--map", "sbg", "--dbc", "my.dbc", "--print-config"])
        .done()
        .stdout;
    assert!(text.contains("can_map = \"sbg\"") && text.contains("dbc = \"my.dbc\""), "{text}");
    place.write("run.toml", text.replace("my.dbc", "nope.dbc"));
    place.run(&["run", "--config", "run.toml"]).refused(2, &["nope.dbc: cannot read it"]);
}

#[test]
fn what_cannot_be_used_is_refused_with_a_hint() {
    let place = Place::new();
    place.write("can.log", "(1700000000.000000) can0 024#020001FF61F78006\n");
    place.write("log.txt", "0 0 0 1 0 0 10\n1000 0 0 1 0 0 10\n");
    place.write("bad.dbc", "BO_ 36 KINEMATICS 8 X\n");
    place.write("empty.dbc", "");
    place.write("bad.toml", "gyro = 1\n");
    for (args, parts) in [
        (&["--map", "nope"][..], &["`nope`", "toyota-yaw", "configs/can"][..]),
        (&["--map", "bad.toml"], &["bad.toml", "line 1", "configs/can"]),
        (&["--dbc", "bad.dbc"], &["bad.dbc", "--map"]),
        (&["--map", "sbg", "--dbc", "bad.dbc"], &["bad.dbc: this does not read as a DBC file"]),
        (
            &["--map", "sbg", "--dbc", "empty.dbc"],
            &["sbg: gyro.x names SBG_ECAN_MSG_IMU_GYRO.GYRO_X, empty.dbc has the messages none"],
        ),
        (&["--map", "sbg", "--dbc", "nope.dbc"], &["nope.dbc: cannot read it"]),
        (&["--protocol", "can-map"], &["`can-map` needs a mapping of signals", "toyota-yaw"]),
    ] {
        place.run(&[&["inspect", "can.log"], args].concat()).refused(2, parts);
        let run = place.run(&[&["run", "--device", "replay:can.log", "--pace", "max"], args].concat());
        run.refused(2, parts);
    }
    let text = place.run(&["inspect", "can.log", "--map", "sbg-no-time"]).done().stdout;
    for part in ["SBG_ECAN_MSG_IMU_GYRO (0x122)", "id 024       1 frames, 8 bytes"] {
        assert!(text.contains(part), "{part} is missing in: {text}");
    }
    place.run(&["inspect", "log.txt", "--map", "sbg"]).refused(2, &["log.txt: ", "--log-map"]);
    let run = place.run(&["run", "--device", "replay:can.log", "--pace", "max", "--map", "sbg"]);
    run.complains(1, &["not one sample arrived (protocol can-map", "--map the signals of a CAN log"]);
}
