//! `otolith calibrate` on real turntable logs and on the mock. The expected numbers are those of
//! `imu-logs/PROVENANCE.md`.

use otolith::units::STANDARD_GRAVITY;
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

/// Writes a log of a sensor (x forward, y left, z up) that lies 3 s in each of these directions, which are up one after
/// the other; z reads 2 % too much and has an offset of 0.3 m/s².
fn poses_log(place: &Place, up: &[[f64; 3]]) {
    let mut log = String::new();
    for (pose, up) in up.iter().enumerate() {
        for k in 0..400_u32 {
            let t = pose as f64 * 4.0 + f64::from(k) * 0.01;
            let flicker = 0.005 * (f64::from(k * k % 7) - 3.0);
            // A quick turn between the poses.
            let rate = if k >= 350 { 1.5 } else { 0.0 };
            let [x, y, z] = up.map(|part| STANDARD_GRAVITY * part + flicker);
            log += &format!("{t:.2},{rate},0.01,0.0,{x:.5},{y:.5},{:.5}\n", 1.02 * z + 0.3);
        }
    }
    place.write("poses.csv", log);
    let map = "[time]\ncolumn = 1\nunit = \"s\"\n[gyro]\ncolumns = [2, 3, 4]\nunit = \"rad/s\"\n\
               [specific_force]\ncolumns = [5, 6, 7]\nunit = \"m/s^2\"\n";
    place.write("map.toml", map);
}

#[test]
fn six_poses_give_bias_scale_and_mount_and_a_run_takes_both() {
    let place = Place::new();
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let all = [z, z.map(|v: f64| -v), x, x.map(|v: f64| -v), y, y.map(|v: f64| -v)];
    poses_log(&place, &all);
    let base = ["calibrate", "poses.csv", "--log-map", "map.toml"];
    let json = place
        .run(&[&base[..], &["--poses", "z,-z,x,-x,y,-y", "--out", "x", "--json"]].concat())
        .done()
        .json();
    near(&json, "/accelerometer/bias_m_s2/value/2", 0.3, 0.01);
    near(&json, "/accelerometer/scale/value/2", 1.0 / 1.02, 1e-3);
    near(&json, "/accelerometer/scale/value/0", 1.0, 1e-3);
    near(&json, "/mount/matrix/0/0", 1.0, 1e-3);
    for file in ["x/mount.toml", "x/calibration.toml"] {
        assert!(place.path(file).exists(), "{file}");
    }
    let files = ["--mount", "x/mount.toml", "--calibration", "x/calibration.toml", "--json"];
    let run = ["run", "--device", "mock:rest?rest_s=2", "--pace", "max"];
    place.run(&[&run[..], &files].concat()).done();
    let text = place.run(&[&base[..], &["--poses", "any"]].concat()).done().stdout;
    assert!(text.contains("accelerometer bias, sensor z (m/s2)") && !text.contains("mount:"), "{text}");

    poses_log(&place, &all[..3]);
    let few = place.run(&[&base[..], &["--poses", "any"]].concat());
    few.complains(1, &["3 poses found leave it open", "missing: -x, y, -y", "each of its six sides up"]);
    for wrong in ["z", "up,down", "z,-z,w"] {
        let run = place.run(&[&base[..], &["--poses", wrong]].concat());
        assert_eq!(
            (run.code, run.stderr.contains("any, or two or more of x, -x")),
            (2, true),
            "{}",
            run.stderr
        );
    }
    assert_eq!(place.run(&[&base[..], &["--poses", "any", "--forward", "x"]].concat()).code, 2);
}

#[test]
fn six_poses_of_a_real_sensor_bring_its_norm_to_gravity() {
    let Some(log) = shared_log("csv/imucal_ferraris_session.csv") else { return };
    let mapping = shipped("configs/logs/imucal-ferraris.toml");
    let args = ["calibrate", &log, "--log-map", &mapping, "--poses", "any", "--json"];
    let json = Place::new().run(&args).done().json();
    assert!(number(&json, "/accelerometer/poses") >= 6.0);
    assert_eq!(json["accelerometer"]["common_scale"], false);
    // Half the sum, and twice gravity over the difference, of the means with each axis up and down: the rests from 2.2 to
    // 29.5 s, averaged by another program. Its six sides were laid down to a few degrees, hence the tolerance.
    for (axis, bias, scale) in [(0, 0.5370, 1.00306), (1, -0.6164, 0.99728), (2, 0.3989, 0.97690)] {
        near(&json, &format!("/accelerometer/bias_m_s2/value/{axis}"), bias, 0.005);
        near(&json, &format!("/accelerometer/scale/value/{axis}"), scale, 5e-4);
    }
    assert!(number(&json, "/accelerometer/residual_m_s2") < 0.005, "{}", json["accelerometer"]);
}

#[test]
fn logs_that_hold_next_to_nothing_are_refused_and_never_a_panic() {
    let place = Place::new();
    poses_log(&place, &[]);
    let line = |t: f64, rate: f64| format!("{t:.2},0,0,{rate},0,0,9.8\n");
    for (name, log) in [
        ("one sample", line(0.0, 0.0)),
        ("two samples", line(0.0, 0.0) + &line(0.01, 1.0)),
        ("constant", (0..600).map(|k| line(f64::from(k) * 0.01, 0.0)).collect()),
        ("turning from end to end", (0..600).map(|k| line(f64::from(k) * 0.01, 2.0)).collect()),
        ("all zero", (0..600).map(|k| format!("{:.2},0,0,0,0,0,0\n", f64::from(k) * 0.01)).collect()),
        ("one time", (0..600).map(|_| line(1.0, 1.0)).collect()),
    ] {
        place.write("poses.csv", &log);
        for command in ["calibrate", "chair"] {
            for more in [&[][..], &["--json"]] {
                let run = place.run(&[&[command, "poses.csv", "--log-map", "map.toml"], more].concat());
                let spins = name.starts_with("turning") && command == "chair";
                assert_eq!(run.code, i32::from(!spins), "{name} {command}: {}", run.stderr);
                assert!(
                    !run.stderr.contains("panicked") && !run.stdout.contains("NaN"),
                    "{name}: {}",
                    run.stdout
                );
            }
        }
        let poses = place.run(&["calibrate", "poses.csv", "--log-map", "map.toml", "--poses", "any"]);
        poses.complains(1, &["accelerometer bias and scale"]);
    }
}

#[test]
fn samples_that_come_twice_are_left_out_and_counted() {
    let place = Place::new();
    poses_log(&place, &[[0.0, 0.0, 1.0]]);
    let log = std::fs::read_to_string(place.path("poses.csv")).expect("written");
    let twice: String = log.lines().flat_map(|line| [line, "\n", line, "\n"]).collect();
    place.write("poses.csv", twice);
    let json = place.run(&["calibrate", "poses.csv", "--log-map", "map.toml", "--json"]).json();
    assert_eq!(number(&json, "/sampling/samples"), 400.0);
    assert!(json["notes"].to_string().contains("400 samples came twice"), "{}", json["notes"]);
}
