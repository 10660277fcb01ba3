//! Recorded logs of real sensors through `otolith inspect`. The expected numbers are those of
//! `imu-logs/PROVENANCE.md`, found there by independent readers.

use otolith::device::Traffic;
use otolith::device::protocol::text::{TextDecoder, TextMapping, known_log};
use otolith::device::protocol::{ImuReading, PacketDecoder};
use otolith::units::{DEG_PER_RAD, STANDARD_GRAVITY};
use serde_json::Value;

use super::{Place, number, shared_log, shipped};

/// What `inspect` finds in a log, with the mapping of that name or none; `None` where the recordings are not at hand.
fn inspected(log: &str, mapping: Option<&str>) -> Option<Value> {
    let log = shared_log(log)?;
    let mapping = mapping.map(|name| shipped(&format!("configs/logs/{name}")));
    let mut args = vec!["inspect", log.as_str(), "--json"];
    args.extend(mapping.iter().flat_map(|path| ["--log-map", path.as_str()]));
    Some(Place::new().run(&args).done().json())
}

/// The readings of a log, with the mapping of that name or the one found for it.
fn readings(log: &str, mapping: Option<&str>) -> Option<Vec<ImuReading>> {
    let path = shared_log(log)?;
    let bytes = std::fs::read(&path).expect("readable");
    let mapping = match mapping {
        Some(name) => {
            let text = std::fs::read_to_string(shipped(&format!("configs/logs/{name}"))).expect("shipped");
            TextMapping::from_toml(name, &text).expect("a mapping")
        }
        None => {
            let header = bytes.split(|byte| *byte == b'\n').next().expect("a line");
            known_log(&path, header).expect("usable").expect("known").mapping().expect("a mapping")
        }
    };
    Some(read(&mapping, &bytes))
}

fn read(mapping: &TextMapping, bytes: &[u8]) -> Vec<ImuReading> {
    let mut decoder = TextDecoder::new(mapping);
    let mut readings = Vec::new();
    decoder.push(Traffic::Bytes(bytes), &mut |reading| readings.push(reading));
    decoder.finish(&mut |reading| readings.push(reading));
    readings
}

#[track_caller]
fn assert_near(what: &str, found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found}, expected {expected} +- {tolerance}");
}

#[track_caller]
fn assert_all_near(json: &Value, pointer: &str, unit: f64, expected: [f64; 3], tolerance: f64) {
    for (axis, expected) in expected.into_iter().enumerate() {
        assert_near(pointer, number(json, &format!("{pointer}/{axis}")) * unit, expected, tolerance);
    }
}

#[track_caller]
fn assert_without_loss(json: &Value) {
    for loss in ["bad_checksum", "bytes_skipped", "missing", "dropped"] {
        assert_eq!(json["link"][loss], 0, "{loss}");
    }
}

fn seconds(reading: &ImuReading) -> f64 {
    reading.device_time.expect("dated").micros as f64 * 1e-6
}

/// Trapezoidal integral of the angular velocity, degrees.
fn turned_deg(readings: &[ImuReading]) -> [f64; 3] {
    let mut turned = nalgebra::Vector3::zeros();
    for pair in readings.windows(2) {
        let dt = seconds(&pair[1]) - seconds(&pair[0]);
        turned += (pair[0].omega_imu + pair[1].omega_imu) * (0.5 * dt * DEG_PER_RAD);
    }
    turned.into()
}

fn fastest_rad_s(readings: &[ImuReading]) -> f64 {
    readings.iter().map(|reading| reading.omega_imu.norm()).fold(0.0, f64::max)
}

#[test]
fn phones() {
    for (log, rows, duration_s, turned_z_deg, fastest) in [
        ("phone/phyphox_z_circle_then_stop.csv", 2239.0, 22.467, 3914.9, 6.371),
        ("phone/phyphox_z_spinup.csv", 982.0, 9.848, 3645.9, 20.4),
    ] {
        let Some(json) = inspected(log, None) else { return };
        assert_eq!((&json["kind"], &json["protocol"]), (&"text".into(), &"text".into()));
        assert_without_loss(&json);
        assert_eq!((number(&json, "/samples"), number(&json, "/link/gaps")), (rows, 0.0));
        assert_near("duration", number(&json, "/duration_s"), duration_s, 6e-4);
        assert_near("rate", number(&json, "/rate_hz"), 99.6, 0.05);
        assert_eq!(json["specific_force_m_s2"], Value::Null);
        let notes = json["notes"].to_string();
        assert!(notes.contains("no accelerometer") && notes.contains("configs/logs/phyphox.toml"), "{notes}");
        let readings = readings(log, None).expect("was there");
        assert_near("turned", turned_deg(&readings)[2], turned_z_deg, 0.05);
        assert_near("fastest", fastest_rad_s(&readings), fastest, 0.05);
    }
    let Some(json) = inspected("phone/phyphox_z_spinup.csv", None) else { return };
    assert_near("largest", number(&json, "/omega_rad_s/max/2"), 20.355, 6e-4);
}

#[test]
fn means_of_a_phone_over_spans() {
    let Some(readings) = readings("phone/phyphox_z_circle_then_stop.csv", None) else { return };
    for (from_s, to_s, expected) in [(0.0, 5.0, 4.16), (5.0, 16.0, 4.12), (19.0, 20.0, -0.06)] {
        let span = readings.iter().filter(|reading| (from_s..to_s).contains(&seconds(reading)));
        let (count, sum) = span.fold((0.0, 0.0), |(count, sum), r| (count + 1.0, sum + r.omega_imu.z));
        assert_near("mean", sum / count, expected, 0.006);
    }
}

#[test]
fn an_x_imu3() {
    let log = "csv/xio_fusion_sensor_data.csv";
    let Some(json) = inspected(log, None) else { return };
    assert_without_loss(&json);
    assert_eq!(number(&json, "/samples"), 13514.0);
    assert_near("duration", number(&json, "/duration_s"), 135.327, 6e-4);
    let readings = readings(log, None).expect("was there");
    assert_near("fastest", fastest_rad_s(&readings) * DEG_PER_RAD, 368.0, 0.05);
    for (found, expected) in turned_deg(&readings).into_iter().zip([-16.3, -33.3, 1081.5]) {
        assert_near("turned", found, expected, 0.06);
    }
    let norm = readings.iter().map(|r| r.specific_force_imu.expect("has one").norm()).sum::<f64>() / 13514.0;
    assert_near("norm", norm / STANDARD_GRAVITY, 1.0054, 6e-5);
    let mut steps: Vec<f64> = readings.windows(2).map(|pair| seconds(&pair[1]) - seconds(&pair[0])).collect();
    steps.sort_by(f64::total_cmp);
    assert_near("median step", steps[steps.len() / 2], 10.08e-3, 6e-6);
    assert_near("shortest step", steps[0], 7.56e-3, 6e-6);
    assert_near("longest step", steps[steps.len() - 1], 30.24e-3, 6e-6);
    assert_eq!(steps.iter().filter(|step| **step > 15e-3).count(), 10);
    // Each of the ten is three usual intervals long but for parts of a microsecond: two samples are not there.
    let in_usual = steps.iter().map(|step| step / steps[steps.len() / 2]).filter(|ratio| *ratio > 1.5);
    assert!(in_usual.into_iter().all(|ratio| (ratio - 3.0).abs() < 1e-3));
    // Those over 15 ms, of 10 ms usually.
    assert_eq!(number(&json, "/link/gaps"), 10.0);
}

#[test]
fn a_vn310_without_a_unit_needs_to_be_told_it() {
    let log = "csv/vn310_static_imu.csv";
    let Some(path) = shared_log(log) else { return };
    let place = Place::new();
    for args in [vec!["inspect", &path], vec!["run", "--pace", "max", "--device", &format!("replay:{path}")]]
    {
        place
            .run(&args)
            .refused(2, &["IMU::AngularRate::X does not say its unit", "vn310-without-unit.toml"]);
    }
    let Some(json) = inspected(log, Some("vn310-without-unit.toml")) else { return };
    assert_without_loss(&json);
    assert_eq!((number(&json, "/samples"), number(&json, "/link/gaps")), (690.0, 0.0));
    assert_near("duration", number(&json, "/duration_s"), 34.45, 6e-3);
    assert_near("rate", number(&json, "/rate_hz"), 20.0, 0.01);
    assert_all_near(&json, "/specific_force_m_s2/mean", 1.0, [-0.9026, -0.0733, -9.7626], 6e-5);
    // The uncompensated gyroscope, whose names carry their unit.
    let mapping = std::fs::read_to_string(shipped("configs/logs/vn310.toml")).expect("shipped");
    let mapping =
        TextMapping::from_toml("raw", &mapping.replace("AngularRate", "UncompGyro")).expect("a mapping");
    let readings = read(&mapping, &std::fs::read(path).expect("readable"));
    let sum = readings.iter().map(|reading| reading.omega_imu).sum::<nalgebra::Vector3<f64>>();
    for (found, expected) in (sum / 690.0).iter().zip([5.6e-4, 1.14e-3, 2.7e-4]) {
        assert_near("gyroscope", *found, expected, 6e-6);
    }
}

#[test]
fn a_vn310_whose_last_row_is_cut() {
    let Some(json) = inspected("csv/vn310_fixed_imu.csv", None) else { return };
    assert_eq!((number(&json, "/samples"), number(&json, "/link/bad_checksum")), (18.0, 1.0));
    assert_near("rate", number(&json, "/rate_hz"), 100.0, 0.1);
    assert_all_near(&json, "/specific_force_m_s2/mean", 1.0, [9.791, 0.180, -0.498], 6e-4);
    // It is short, and nothing to run with; but the cut row is not what keeps it from being run.
    let log = shared_log("csv/vn310_fixed_imu.csv").expect("was there");
    let device = format!("replay:{log}");
    let run = Place::new().run(&["run", "--device", &device, "--pace", "max", "--json"]).done().json();
    assert_eq!((number(&run, "/samples"), number(&run, "/link/bad_checksum")), (18.0, 1.0));
}

#[test]
fn a_log_without_a_time_column() {
    let log = "csv/imucal_ferraris_session.csv";
    let Some(json) = inspected(log, Some("imucal-ferraris.toml")) else { return };
    assert_without_loss(&json);
    assert_eq!((number(&json, "/samples"), number(&json, "/link/gaps")), (10376.0, 0.0));
    assert_near("rate", number(&json, "/rate_hz"), 204.8, 1e-3);
    let largest = |pointer: &str, unit: f64| {
        let at = |end: &str, axis: usize| number(&json, &format!("/{pointer}/{end}/{axis}")).abs() * unit;
        [0, 1, 2].map(|axis| at("min", axis).max(at("max", axis)))
    };
    for (found, expected) in largest("omega_rad_s", DEG_PER_RAD).into_iter().zip([895.0, 452.0, 779.0]) {
        assert_near("gyroscope", found, expected, 0.5);
    }
    assert_near(
        "accelerometer",
        largest("specific_force_m_s2", 1.0).into_iter().fold(0.0, f64::max),
        20.9,
        0.05,
    );
    let readings = readings(log, Some("imucal-ferraris.toml")).expect("was there");
    let first = readings[..200].iter().map(|r| r.specific_force_imu.expect("has one"));
    assert_near("norm", (first.sum::<nalgebra::Vector3<f64>>() / 200.0).norm(), 10.340, 6e-4);
}

#[test]
fn turntables() {
    for (log, rows, duration_s, turned_z_deg) in [
        ("turntable/roomba_circular_start_rotate_stop.txt", 1216.0, 18.987, -322.2),
        ("turntable/roomba_spin_23dps.txt", 1728.0, 26.987, -583.1),
    ] {
        let Some(json) = inspected(log, Some("turntable-lsm9ds1.toml")) else { return };
        assert_without_loss(&json);
        assert_eq!((number(&json, "/samples"), number(&json, "/link/gaps")), (rows, 0.0));
        assert_near("duration", number(&json, "/duration_s"), duration_s, 6e-4);
        let readings = readings(log, Some("turntable-lsm9ds1.toml")).expect("was there");
        assert_near("turned", turned_deg(&readings)[2], turned_z_deg, 0.06);
    }
}

#[test]
fn captures_of_an_openimu() {
    let Some(json) = inspected("serial_raw/openimu_z1.raw", None) else { return };
    assert_eq!((&json["kind"], &json["protocol"]), (&"raw".into(), &"openimu".into()));
    assert_without_loss(&json);
    assert_eq!((number(&json, "/samples"), number(&json, "/link/packets")), (2127.0, 2127.0));
    assert_near("duration", number(&json, "/duration_s"), 21.241_543, 1e-6);
    assert_near("rate", number(&json, "/rate_hz"), 100.0, 0.1);
    let notes = json["notes"].to_string();
    assert!(
        notes.contains("31 bytes of an unfinished packet") && notes.contains("documented in ms"),
        "{notes}"
    );

    let Some(json) = inspected("serial_raw/openimu_Scale1.raw", None) else { return };
    assert_without_loss(&json);
    assert_eq!((number(&json, "/samples"), number(&json, "/link/gaps")), (1002.0, 0.0));
    assert_near("duration", number(&json, "/duration_s"), 1001.0 / 20.0, 1e-4);
    assert_near("rate", number(&json, "/rate_hz"), 20.0, 1e-4);
}

#[test]
fn known_headers_need_no_mapping_and_a_recording_keeps_it() {
    let place = Place::new();
    let row = |k: i32| {
        format!(
            "{},{:.2},{},0,0\n",
            1_700_000_000_000_000_000_i64 + i64::from(k) * 10_000_000,
            0.01 * f64::from(k - 5),
            if k < 150 { 0.0 } else { 1.0 }
        )
    };
    let log: String =
        std::iter::once("time,seconds_elapsed,z,y,x\n".to_owned()).chain((0..300).map(row)).collect();
    place.write("Gyroscope.csv", &log);
    place.write("Accelerometer.csv", &log);
    place.run(&["inspect", "Accelerometer.csv"]).refused(2, &["Sensor Logger", "depend on the platform"]);
    let json = place.run(&["inspect", "Gyroscope.csv", "--json"]).done().json();
    assert_eq!(number(&json, "/samples"), 300.0);
    assert_near("duration", number(&json, "/duration_s"), 2.99, 1e-6);
    assert_all_near(&json, "/omega_rad_s/max", 1.0, [0.0, 0.0, 1.0], 1e-12);

    let run = ["run", "--device", "replay:Gyroscope.csv", "--pace", "max", "--record", "r.mcap", "--json"];
    assert_eq!(number(&place.run(&run).done().json(), "/samples"), 300.0);
    let json = place.run(&["inspect", "r.mcap", "--json"]).done().json();
    assert_eq!((number(&json, "/samples"), &json["protocol"]), (300.0, &"text".into()));
}

#[test]
fn empty_values_are_counted_and_gaps_too() {
    let place = Place::new();
    let mut log = "Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),\
                   Accelerometer Y (g),Accelerometer Z (g)\n"
        .to_owned();
    for k in 0..300 {
        let at = 0.01 * f64::from(k) + if k < 200 { 0.0 } else { 0.05 };
        log += &if k < 3 { ",,,,0,0,1\n".to_owned() } else { format!("{at:.2},0,0,10,0,0,1\n") };
    }
    log += "3.05,0,0";
    place.write("log.csv", &log);
    for args in [
        &["inspect", "log.csv", "--json"][..],
        &["run", "--device", "replay:log.csv", "--pace", "max", "--json"],
    ] {
        let json = place.run(args).done().json();
        let link = &json["link"];
        assert_eq!(
            (&json["samples"], &link["bad_checksum"], &link["gaps"]),
            (&297.into(), &4.into(), &1.into())
        );
    }
}

#[test]
fn a_device_without_a_gyroscope_is_refused_unless_that_is_accepted() {
    let place = Place::new();
    let frame = |index: u8, yaw: i16| {
        let mut frame = vec![0xAA, 0xAA, index];
        for value in [yaw, 0, 0, 0, 0, 1000] {
            frame.extend(value.to_le_bytes());
        }
        frame.extend([0, 0, 0]);
        frame.push(frame[2..].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte)));
        frame
    };
    let capture: Vec<u8> = (0..400_i16).flat_map(|k| frame(k as u8, (k - 200).max(0) * 50)).collect();
    place.write("rvc.bin", capture);
    let json = place.run(&["inspect", "rvc.bin", "--json"]).done().json();
    assert_eq!((&json["protocol"], number(&json, "/samples")), (&"bno08x-rvc".into(), 0.0));
    assert!(json["notes"].to_string().contains("there is no gyroscope"), "{json:#}");
    let run = ["run", "--device", "replay:rvc.bin", "--pace", "max", "--json"];
    place
        .run(&run)
        .complains(1, &["not one sample", "bno08x-rvc", "there is no gyroscope", "--allow-degraded"]);

    let json = place.run(&["inspect", "rvc.bin", "--json", "--allow-degraded"]).done().json();
    assert_eq!(number(&json, "/samples"), 399.0);
    assert_near("rate", number(&json, "/omega_rad_s/max/2") * DEG_PER_RAD, 50.0, 1e-6);
    assert!(json["notes"].to_string().contains("degraded"), "{json:#}");
    let recorded = place.run(&[&run[..], &["--allow-degraded", "--record", "r.mcap"]].concat()).done().json();
    assert_eq!(number(&recorded, "/samples"), 399.0);
    assert!(recorded["device"]["notes"].to_string().contains("degraded"), "{recorded:#}");
    let json = place.run(&["inspect", "r.mcap", "--json"]).done().json();
    assert_eq!(number(&json, "/samples"), 399.0, "the recording keeps what was accepted");
    assert!(json["events"].to_string().contains("degraded"), "{json:#}");
}
