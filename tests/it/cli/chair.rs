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
