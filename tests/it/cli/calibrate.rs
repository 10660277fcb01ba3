//! `otolith calibrate` on real turntable logs and on the mock. The expected numbers are those of
//! `imu-logs/PROVENANCE.md`.

use serde_json::Value;

use super::{Place, Run, near, number, shared_log, shipped};

/// Calibrates from a turntable log with further arguments; `None` where the shared recordings are not at hand.
fn turntable(place: &Place, log: &str, more: &[&str]) -> Option<Run> {
    let log = shared_log(&format!("turntable/{log}.txt"))?;
    let mapping = shipped("configs/logs/turntable-lsm9ds1.toml");
    Some(place.run(&[&["calibrate", &log, "--log-map", &mapping], more].concat()))
}

#[test]
fn the_turntable_logs_give_their_axes_and_no_heading() {
    for (log, axis_deg, gravity_deg, norm) in
        [("roomba_circular_start_rotate_stop", 3.48, 4.35, 9.487), ("roomba_spin_23dps", 5.20, 6.86, 9.652)]
    {
        let place = Place::new();
        let Some(run) = turntable(&place, log, &["--json", "--out", "x"]) else { return };
        run.complains(1, &["heading", "parallel", "mount.toml was not written", "forward first"]);
        let json = run.json();
        near(&json, "/spin_axis/tilt_from_sensor_z_deg/value", axis_deg, 0.5);
        near(&json, "/gravity/tilt_from_sensor_z_deg/value", gravity_deg, 0.1);
        near(&json, "/gravity/norm_m_s2/value", norm, 0.02);
        assert!(number(&json, "/spin_axis/tilt_from_sensor_z_deg/sigma") < 0.3);
        // The axis points up in the sensor, and the chair turns to the right.
        near(&json, "/spin_axis/axis_imu/2", 0.998, 0.003);
        assert!(number(&json, "/spin_axis/rate_deg_s") < -21.0);
        let kinds: Vec<&str> =
            json["motions"].as_array().expect("a list").iter().filter_map(|m| m["kind"].as_str()).collect();
        assert!(kinds.starts_with(&["rest", "spin"]), "{kinds:?}");
        assert_eq!(json["mount"], Value::Null);
        // What is determined is written all the same.
        let written = std::fs::read_to_string(place.path("x/calibration.toml")).expect("written");
        assert!(written.contains("bias_rad_s") && !place.path("x/mount.toml").exists(), "{written}");
    }
}

#[test]
fn a_counted_turn_gives_the_scale_of_the_gyro() {
    let place = Place::new();
    let Some(run) = turntable(&place, "roomba_spin_23dps", &["--turned-deg", "584.8", "--json"]) else {
        return;
    };
    let json = run.json();
    near(&json, "/gyro_scale/scale/value", 584.8 / 583.3, 0.005);
    // About the axis, which is 5.2 deg from the sensor's z, it is larger by 1/cos than about z: 583.4 / 0.9959.
    near(&json, "/gyro_scale/measured_deg/value", 585.8, 0.6);
    near(&json, "/gyro_scale/scale/sigma", 0.0018, 0.0003);
    let Some(run) = turntable(&place, "roomba_spin_23dps", &["--turned-deg", "360"]) else { return };
    run.complains(1, &["gyro scale: 360.0 deg were counted and 585.", "heading"]);
}

#[test]
fn a_given_heading_completes_the_mount_and_a_run_takes_both_files() {
    let place = Place::new();
    let arguments = ["--forward", "-x", "--out", "x", "--turned-deg", "584.8"];
    let Some(run) = turntable(&place, "roomba_spin_23dps", &arguments) else { return };
    let text = run.done().stdout;
    for part in ["gyro bias, sensor x (deg/s)", "1 sigma", "gyro scale", "as given", "lever arm"] {
        assert!(text.contains(part), "{part} is missing in\n{text}");
    }
    assert_eq!(place.names(), ["x"]);
    let log = shared_log("turntable/roomba_spin_23dps.txt").expect("there a moment ago");
    let (device, mapping) = (format!("replay:{log}"), shipped("configs/logs/turntable-lsm9ds1.toml"));
    let files = ["--mount", "x/mount.toml", "--calibration", "x/calibration.toml"];
    let run = ["run", "--device", &device, "--log-map", &mapping, "--pace", "max", "--json"];
    let json = place.run(&[&run[..], &files].concat()).done().json();
    near(&json, "/chair/turned_deg", -584.8, 3.0);
    near(&json, "/alignment/scale", 9.81 / 9.80665, 0.002);
    assert_eq!(json["alignment"]["scale_refused"], false);
    // Nothing is overwritten unasked.
    let Some(again) = turntable(&place, "roomba_spin_23dps", &arguments) else { return };
    again.refused(2, &["exists already", "--force"]);
    let Some(again) = turntable(&place, "roomba_spin_23dps", &[&arguments[..], &["--force"]].concat()) else {
        return;
    };
    again.done();
}

#[test]
fn a_mock_chair_and_its_recording_say_the_same() {
    let place = Place::new();
    let device = "mock:chair?tilt_deg=10&rest_s=3&spin_s=6&after_s=3";
    place.run(&["run", "--device", device, "--pace", "max", "--record", "r.mcap"]).done();
    let flags = ["--turned-deg", "1080", "--turned-sigma-deg", "0", "--forward", "x", "--json"];
    let live = place.run(&[&["calibrate", "--device", device], &flags[..]].concat()).done().json();
    let recorded = place.run(&[&["calibrate", "r.mcap"], &flags[..]].concat()).done().json();
    for json in [&live, &recorded] {
        near(json, "/spin_axis/tilt_from_sensor_z_deg/value", 10.0, 0.1);
        near(json, "/spin_axis/tilt_from_gravity_deg/value", 0.0, 0.1);
        near(json, "/gyro_scale/scale/value", 1.0, 0.002);
        near(json, "/lever_arm/radius_m/value", 0.0, 0.01);
        assert_eq!(json["protocol"], "otolith-serial");
    }
    let part = place.run(&["calibrate", "--device", device, "--duration-s", "2", "--json"]);
    part.complains(1, &["spin axis", "no spin"]);
    near(&part.json(), "/sampling/duration_s", 2.0, 0.01);
}

#[test]
fn a_gyro_alone_has_a_bias_and_no_mount() {
    let place = Place::new();
    let Some(log) = shared_log("phone/phyphox_z_circle_then_stop.csv") else { return };
    let run = place.run(&["calibrate", &log, "--log-map", &shipped("configs/logs/phyphox.toml")]);
    run.complains(1, &["no accelerometer", "no rest"]);
}

#[test]
fn wrong_flags_are_refused_before_anything_is_read() {
    let place = Place::new();
    for (flags, part) in [
        (&["--turned-deg", "10"][..], "--turned-deg"),
        (&["--gravity", "1"], "--gravity"),
        (&["--rest-rate-max-deg-s", "0"], "--rest-rate-max-deg-s"),
        (&["--duration-s", "0"], "--duration-s"),
    ] {
        place.run(&[&["calibrate", "--device", "mock:rest?rest_s=1"], flags].concat()).refused(2, &[part]);
    }
    place.run(&["calibrate", "nowhere.txt"]).refused(2, &["nowhere.txt"]);
    assert_eq!(place.run(&["calibrate"]).code, 2);
    assert_eq!(place.run(&["calibrate", "f", "--device", "mock:rest"]).code, 2);
}
