//! Logs of real sensors through `otolith run`. The expected numbers are those of `imu-logs/PROVENANCE.md`.

use serde_json::Value;

use super::{Place, Run, number, shared_log, shipped};

/// Runs a recorded log with the mapping of that name; `None` where the shared recordings are not at hand.
fn played(log: &str, mapping: &str) -> Option<Run> {
    let device = format!("replay:{}", shared_log(log)?);
    let mapping = shipped(&format!("configs/logs/{mapping}"));
    let args = ["run", "--device", &device, "--log-map", &mapping, "--pace", "max", "--json"];
    Some(Place::new().run(&args).done())
}

#[test]
fn a_turntable_log_is_used_to_the_last_sample() {
    let Some(run) = played("turntable/roomba_circular_start_rotate_stop.txt", "turntable-lsm9ds1.toml")
    else {
        return;
    };
    let json = run.json();
    assert_eq!((number(&json, "/samples"), number(&json, "/link/packets")), (1216.0, 1216.0));
    for loss in ["bad_checksum", "bytes_skipped", "missing", "gaps", "dropped"] {
        assert_eq!(json["link"][loss], 0, "{loss}");
    }
    assert!((number(&json, "/chair/turned_deg") / -322.2 - 1.0).abs() < 0.01, "{json:#}");
    assert!((number(&json, "/alignment/mount_tilt_deg") - 4.35).abs() < 0.1, "{json:#}");
    assert_eq!(json["alignment"]["levelled"], true);
    let spin = &json["chair"]["spins"][0];
    assert!((number(spin, "/start_s") - 2.07).abs() < 0.1 && (number(spin, "/stop_s") - 17.03).abs() < 0.1);
    assert!((number(spin, "/rate_rpm") - -21.43 / 6.0).abs() < 0.05, "{spin}");
    assert!(number(&json, "/green/peak_com_sway_deg") > 5.0 * number(&json, "/blue/peak_com_sway_deg"));
    assert!(number(&json, "/blue/cop_within_5mm_after_stop") >= 0.99);
}

#[test]
fn a_log_that_ends_while_the_chair_turns_has_no_stop() {
    let Some(run) = played("turntable/roomba_spin_23dps.txt", "turntable-lsm9ds1.toml") else { return };
    let json = run.json();
    assert_eq!(number(&json, "/samples"), 1728.0);
    assert!((number(&json, "/chair/turned_deg") / -583.3 - 1.0).abs() < 0.01, "{json:#}");
    let spin = &json["chair"]["spins"][0];
    assert!((number(spin, "/start_s") - 2.07).abs() < 0.1);
    assert_eq!(spin["stop_s"], Value::Null);
    assert_eq!(json["green"]["peak_com_sway_deg"], Value::Null);
    assert!(number(&json, "/green/peak_gravity_tilt_in_spin_deg") > 0.5);
}

#[test]
fn phone_logs_are_used_without_an_accelerometer() {
    for (log, samples, turned_deg) in [
        ("phone/phyphox_z_circle_then_stop.csv", 2239.0, 3914.9),
        ("phone/phyphox_z_spinup.csv", 982.0, 3645.9),
    ] {
        let Some(run) = played(log, "phyphox.toml") else { return };
        let json = run.json();
        assert_eq!(number(&json, "/samples"), samples);
        assert!((number(&json, "/chair/turned_deg") / turned_deg - 1.0).abs() < 0.01, "{json:#}");
        assert_eq!(json["alignment"]["accelerometer_missing"], true);
    }
}

#[test]
fn a_recorded_log_is_verified_and_inspected() {
    let Some(log) = shared_log("turntable/roomba_spin_23dps.txt") else { return };
    let place = Place::new();
    let (device, mapping) = (format!("replay:{log}"), shipped("configs/logs/turntable-lsm9ds1.toml"));
    let run = ["run", "--device", &device, "--log-map", &mapping, "--pace", "max", "--record", "r.mcap"];
    place.run(&run).done();
    let verified = place.run(&["replay", "r.mcap", "--verify", "--json"]).done().json();
    assert_eq!(verified["verify"]["bit_identical"], true);
    assert_eq!(verified["samples"], 1728);
    let inspected = place.run(&["inspect", "r.mcap", "--json"]).done().json();
    assert_eq!((&inspected["protocol"], &inspected["samples"]), (&"text".into(), &1728.into()));
}
