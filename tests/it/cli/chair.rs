//! `otolith chair` on real logs and on the mock. The expected numbers are those of `imu-logs/PROVENANCE.md`.

use serde_json::Value;

use super::{Place, near, number, shared_log, shipped};

/// The report on a shared log; `None` where the shared recordings are not at hand.
fn report(log: &str, mapping: &str) -> Option<Value> {
    let log = shared_log(log)?;
    let mapping = shipped(&format!("configs/logs/{mapping}"));
    Some(Place::new().run(&["chair", &log, "--log-map", &mapping, "--json"]).done().json())
}

#[test]
fn the_turntable_that_stops() {
    let Some(json) = report("turntable/roomba_circular_start_rotate_stop.txt", "turntable-lsm9ds1.toml")
    else {
        return;
    };
    near(&json, "/integral_imu_deg/2", -322.2, 0.1);
    near(&json, "/spin/plateau/omega_imu_deg_s/2", -21.40, 0.1);
    near(&json, "/spin/plateau/rate_deg_s/value", -21.43, 0.1);
    near(&json, "/spin/axis/tilt_from_sensor_z_deg", 3.48, 0.1);
    near(&json, "/spin/axis/gravity_tilt_from_sensor_z_deg", 4.35, 0.1);
    near(&json, "/spin/start_s", 2.07, 0.1);
    near(&json, "/spin/stop_s", 17.03, 0.1);
    near(&json, "/spin/gyro_bias_before_deg_s/value/2", -0.017, 0.01);
    assert_eq!(json["spin"]["ramp_up"]["unresolved"], true);
    assert!(
        number(&json, "/spin/plateau/ripple_rms_deg_s")
            > 10.0 * number(&json, "/spin/noise_at_rest_rms_deg_s")
    );
    assert_eq!(json["spin"]["sense_known"], true);
}

#[test]
fn the_turntable_whose_log_ends_in_the_spin() {
    let Some(json) = report("turntable/roomba_spin_23dps.txt", "turntable-lsm9ds1.toml") else { return };
    near(&json, "/integral_imu_deg/2", -583.1, 0.1);
    near(&json, "/spin/plateau/omega_imu_deg_s/2", -23.31, 0.1);
    near(&json, "/spin/axis/tilt_from_sensor_z_deg", 5.20, 0.1);
    assert_eq!((&json["spin"]["stop_s"], &json["spin"]["ramp_down"]), (&Value::Null, &Value::Null));
    let told = json["cannot_tell"].to_string();
    assert!(told.contains("ramp down") && told.contains("drifted"), "{told}");
}

#[test]
fn a_phone_without_an_accelerometer_says_what_it_cannot_tell() {
    let Some(json) = report("phone/phyphox_z_circle_then_stop.csv", "phyphox.toml") else { return };
    near(&json, "/integral_imu_deg/2", 3914.9, 0.5);
    // A hand that wobbles: 4.12 to 4.16 rad/s about z.
    near(&json, "/spin/plateau/omega_imu_deg_s/2", 4.14_f64.to_degrees(), 3.0);
    assert!(number(&json, "/spin/axis/wobble_rms_deg") > 10.0);
    assert_eq!(json["spin"]["sense_known"], false);
    assert_eq!(json["spin"]["vibration"]["specific_force_m_s2"], Value::Null);
    let told = json["cannot_tell"].to_string();
    for part in ["no accelerometer", "rests neither before nor after", "ramp up"] {
        assert!(told.contains(part), "{part} is missing in {told}");
    }
}

#[test]
fn a_mock_chair_against_what_it_was_told() {
    let place = Place::new();
    let device = "mock:chair?rate_rpm=-20&rest_s=3&ramp_s=2&spin_s=15&after_s=3";
    let flags = ["--commanded-rpm", "-20", "--commanded-ramp-s", "2", "--out", "x"];
    let run = place.run(&[&["chair", "--device", device], &flags[..], &["--json"]].concat()).done();
    let json = run.json();
    near(&json, "/spin/plateau/rate_deg_s/value", -120.0, 0.05);
    near(&json, "/spin/plateau/commanded/error", 0.0, 0.05);
    near(&json, "/spin/turned_deg", -1800.0, 1.0);
    near(&json, "/spin/ramp_up/duration_s", 2.0, 0.02);
    near(&json, "/spin/ramp_down/commanded/error", 0.0, 0.02);
    assert!(number(&json, "/spin/overshoot/overshoot_percent") < 0.5);
    let figure = std::fs::read_to_string(place.path("x/chair.svg")).expect("written");
    assert!(figure.contains("rate of the chair") && place.path("x/chair.json").exists());
    let again = place.run(&[&["chair", "--device", device], &flags[..]].concat());
    again.refused(2, &["chair.svg", "--force"]);
    let text = place.run(&["chair", "--device", device]).done().stdout;
    assert!(text.contains("to the right") && text.contains("rpm") && text.contains("wobble (deg)"), "{text}");
}

#[test]
fn a_chair_that_rests_has_no_spin() {
    let place = Place::new();
    let run = place.run(&["chair", "--device", "mock:rest?rest_s=3", "--json"]);
    run.complains(1, &["no spin"]);
    assert_eq!(run.json()["spin"], Value::Null);
    place.run(&["chair", "--device", "mock:rest", "--commanded-rpm", "0"]).refused(2, &["--commanded-rpm"]);
}

#[test]
fn a_damaged_recording_is_surveyed_as_far_as_it_is_good() {
    let place = Place::new();
    let device = "mock:chair?rest_s=3&spin_s=6&after_s=3";
    place.run(&["run", "--device", device, "--pace", "max", "--record", "r.mcap"]).done();
    let whole = std::fs::read(place.path("r.mcap")).expect("written");
    place.write("cut.mcap", &whole[..whole.len() * 3 / 4]);
    for command in
        [&["chair", "cut.mcap", "--json"][..], &["calibrate", "cut.mcap", "--forward", "x", "--json"]]
    {
        let run = place.run(command);
        run.complains(3, &["cut.mcap", "damaged"]);
        assert!(number(&run.json(), "/sampling/samples") > 5000.0);
    }
}

#[test]
fn several_spins_are_all_reported_and_held_against_a_profile() {
    let place = Place::new();
    place.write(
        "map.toml",
        "[time]\ncolumn = 1\nunit = \"s\"\n[gyro]\ncolumns = [2, 3, 4]\nunit = \"deg/s\"\n\
                 [specific_force]\ncolumns = [5, 6, 7]\nunit = \"m/s^2\"\n",
    );
    // 60 deg/s to the left for 10 s, then 40 to the right for 20 s, both 2 % slow.
    let told = |t: f64| {
        let ramp = |from: f64, to: f64| (t - from).clamp(0.0, 1.0) - (t - to).clamp(0.0, 1.0);
        60.0 * ramp(3.0, 13.0) - 40.0 * ramp(18.0, 38.0)
    };
    let row = |k: u32| {
        let t = f64::from(k) * 0.01;
        format!("{t:.2},0.1,0.2,{:.4},0.0,0.0,9.81\n", 0.98 * told(t - 0.2) + 0.3 + 0.01 * f64::from(k % 3))
    };
    place.write("log.csv", (0..4400).map(row).collect::<String>());
    place.write(
        "told.csv",
        "time_s,rate_rpm\n3,0\n4,10\n13,10\n14,0\n18,0\n19,-6.666667\n38,-6.666667\n39,0\n",
    );
    let base = ["chair", "log.csv", "--log-map", "map.toml", "--commanded", "told.csv"];
    let json = place.run(&[&base[..], &["--commanded-start-s", "0", "--json"]].concat()).done().json();
    assert_eq!(json["spins"].as_array().map(Vec::len), Some(2));
    near(&json, "/spins/0/turned_deg", 588.0, 0.5);
    near(&json, "/spins/1/turned_deg", -784.0, 0.5);
    near(&json, "/spin/turned_deg", -784.0, 0.5);
    near(&json, "/spins/0/rate_deg_s/value", 58.8, 0.05);
    assert_eq!(json["profile"]["start_given"], true);
    for (index, rate, percent) in [(0, 58.8, -2.0), (1, -39.2, 2.0)] {
        let at = |key: &str| format!("/profile/plateaus/{index}/{key}");
        near(&json, &at("executed_deg_s/value"), rate, 0.02);
        near(&json, &at("error/error_percent"), percent, 0.05);
        near(&json, &at("delay_s"), 0.21, 0.02);
    }
    let text = place.run(&base).done().stdout;
    for part in ["2 spins", "commanded profile", "where it fits best", "-39.2"] {
        assert!(text.contains(part), "{part} is missing in\n{text}");
    }
}

#[test]
fn a_profile_that_cannot_be_read_is_refused_with_its_line() {
    let place = Place::new();
    for (text, part) in [
        ("t,rate\n0,1\n", "expected columns time_s and rate_deg_s, got t, rate"),
        ("time_s,rate_deg_s\n0,60\n5,fast\n", "line 3: rate_deg_s is \"fast\""),
        ("time_s,rate_deg_s\n0,60\n5,60\n4,0\n", "line 4: the time goes back"),
        ("time_s,rate_deg_s\n0,60\n5,NaN\n", "line 3: time and rate must be finite"),
        ("time_s,rate_deg_s\n0,0\n5,60\n6,0\n", "no plateau"),
        ("time_s,rate_deg_s\n0,60,1\n", "told.csv"),
        ("", "told.csv"),
    ] {
        place.write("told.csv", text);
        place
            .run(&["chair", "--device", "mock:chair", "--commanded", "told.csv"])
            .refused(2, &["told.csv", part]);
    }
    place.run(&["chair", "--device", "mock:chair", "--commanded", "none.csv"]).refused(2, &["none.csv"]);
    let both = ["chair", "--device", "mock:chair", "--commanded", "told.csv", "--commanded-rpm", "3"];
    assert_eq!(place.run(&both).code, 2);
}
