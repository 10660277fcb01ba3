//! Logs of real sensors through `otolith run`. The expected numbers are those of `imu-logs/PROVENANCE.md`.

use serde_json::Value;

use super::{Place, Run, near, number, shared_log, shipped};

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

#[test]
fn sensor_logger_with_acceleration_needs_its_platform_and_means_the_same_on_both() {
    let place = Place::new();
    // At rest on its back; face up the documents give +9.81 m/s2 on Android and -1 g on iOS.
    let log = |force: &str| {
        let row = |k: u32| format!("1,{:.3},0.002,0.001,0.003,1,{force}\n", f64::from(k) * 0.01 - 0.05);
        let rows: String = (0..300).map(row).collect();
        format!("time,seconds_elapsed,z,y,x,time_force,z_force,y_force,x_force\n{rows}")
    };
    place.write("android.csv", log("9.70665,0.1,-0.2"));
    place.write("ios.csv", log("-0.98980,-0.010197,0.020394"));
    let refused = place.run(&["calibrate", "android.csv", "--up", "gravity", "--forward", "x"]);
    refused.refused(2, &["depend on the platform", "sensor-logger-android.toml", "--log-map"]);
    for platform in ["android", "ios"] {
        let (file, map) =
            (format!("{platform}.csv"), shipped(&format!("configs/logs/sensor-logger-{platform}.toml")));
        let args = ["calibrate", &file, "--log-map", &map, "--up", "gravity", "--forward", "x", "--json"];
        let json = place.run(&args).done().json();
        for (axis, force, rate) in [(0, -0.2, 0.003), (1, 0.1, 0.001), (2, 9.70665, 0.002)] {
            near(&json, &format!("/gravity/specific_force_m_s2/value/{axis}"), force, 1e-3);
            near(&json, &format!("/gyro_bias_rad_s/value/{axis}"), rate, 1e-9);
        }
    }
}

#[test]
fn a_sensor_upside_down_without_a_mount_is_told_that_its_heading_is_open() {
    let place = Place::new();
    place.write(
        "down.toml",
        "[time]\ncolumn = 1\nunit = \"s\"\n[gyro]\ncolumns = [2, 3, 4]\nunit = \"rad/s\"\n\
                 [specific_force]\ncolumns = [5, 6, 7]\nunit = \"m/s^2\"\n",
    );
    // Rest, two turns to the left (about the sensor's -z), rest.
    let row = |k: u32| {
        let t = f64::from(k) * 0.01;
        let rate = 1.5 * ((t - 3.0).clamp(0.0, 1.0) - (t - 11.0).clamp(0.0, 1.0));
        format!("{t:.2},0.001,0.002,{:.6},0.01,-0.02,-9.80\n", 0.003 - rate)
    };
    place.write("down.csv", (0..1600).map(row).collect::<String>());
    let log = ["--log-map", "down.toml", "--json"];
    let run = [&["run", "--device", "replay:down.csv", "--pace", "max"], &log[..]].concat();
    let open = place.run(&run).done();
    assert_eq!(open.json()["alignment"]["heading_arbitrary"], true);
    near(&open.json(), "/chair/turned_deg", 12.0_f64.to_degrees(), 1.0);
    assert!(
        open.stderr.contains("180 deg from upright") && open.stderr.contains("--mount"),
        "{}",
        open.stderr
    );
    let mount = shipped("configs/mounts/upside-down.toml");
    let mounted = place.run(&[&run[..], &["--mount", &mount]].concat()).done();
    assert_eq!(mounted.json()["alignment"]["heading_arbitrary"], false);
    assert!(!mounted.stderr.contains("upright"), "{}", mounted.stderr);
    let chair = place.run(&[&["chair", "down.csv"], &log[..]].concat()).done().json();
    assert!(chair["notes"].to_string().contains("180 deg from upright"), "{}", chair["notes"]);
    let calibrated = place.run(&[&["calibrate", "down.csv"], &log[..]].concat());
    calibrated.complains(1, &["heading"]);
    let notes = calibrated.json()["notes"].to_string();
    assert!(notes.contains("180 deg from upright"), "{notes}");
    let given = place.run(&[&["calibrate", "down.csv", "--forward", "x"], &log[..]].concat()).done().json();
    assert!(!given["notes"].to_string().contains("upright"), "{}", given["notes"]);
}
