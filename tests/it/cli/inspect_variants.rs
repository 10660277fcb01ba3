//! `otolith inspect` on files like those at hand, but written by other versions, settings and languages.

use serde_json::Value;

use super::{Place, number, shipped};

/// A sentence with its checksum, the XOR of all bytes between `$` and `*` (UM001).
fn sentence(body: &str) -> String {
    format!("${body}*{:02X}\r\n", body.bytes().fold(0, |sum, byte| sum ^ byte))
}

#[test]
fn sentences_of_a_device_are_a_capture_and_no_log() {
    let place = Place::new();
    // The example of VNYMR in the VN-100 manual (UM001), after what a terminal program may have put before it.
    let example = "VNYMR,-129.829,+006.715,+041.227,+01.1025,-00.0452,+01.3475,+00.118,-00.240,-09.797,-00.001185,\
                   +00.000613,-00.000521";
    let log = format!("connected\r\n{}", sentence(example).repeat(20));
    place.write("vn.txt", &log);
    let json = place.run(&["inspect", "vn.txt", "--json"]).done().json();
    assert_eq!((&json["kind"], &json["protocol"]), (&"raw".into(), &"vectornav".into()));
    assert_eq!((number(&json, "/samples"), number(&json, "/link/bytes_skipped")), (20.0, 11.0));
    assert!((number(&json, "/specific_force_m_s2/mean/2") + 9.797).abs() < 1e-9);
    // How fast the line was is not how often the device measured.
    assert_eq!((&json["rate_hz"], &json["duration_s"]), (&Value::Null, &Value::Null));
    assert!(json["notes"].to_string().contains("no time at all"), "{}", json["notes"]);
    // What turns rates into angles wants times.
    let lacks = ["vn.txt: ", "carry no time", "`otolith run --record`"];
    place.run(&["chair", "vn.txt"]).refused(2, &lacks);
    place.run(&["run", "--device", "replay:vn.txt", "--pace", "max"]).refused(2, &lacks);
    // Sentences of a satellite receiver are nothing that is known here.
    place.write("gps.txt", sentence("GPVTG,054.7,T,034.4,M,005.5,N,010.2,K").repeat(20));
    place.run(&["inspect", "gps.txt"]).refused(2, &["gps.txt: ", "needs a mapping"]);
}

/// The five formats that phyphox offers for its export.
#[test]
fn a_phone_log_in_every_format_of_its_program() {
    let place = Place::new();
    let titles = ["Time (s)", "Gyroscope x (rad/s)", "Gyroscope y (rad/s)", "Gyroscope z (rad/s)"];
    for (delimiter, point) in [(",", "."), ("\t", "."), (";", "."), ("\t", ","), (";", ",")] {
        let header = titles.map(|title| format!("\"{title}\"")).join(delimiter);
        let rows = (0..100).map(|k| {
            let row = [format!("{}E-2", k), "1.25E-1".to_owned(), "-2.5E-1".to_owned(), "5.0E-1".to_owned()];
            row.map(|value| value.replace('.', point)).join(delimiter) + "\n"
        });
        place.write("Raw Data.csv", format!("{header}\n{}", rows.collect::<String>()));
        let json = place.run(&["inspect", "Raw Data.csv", "--json"]).done().json();
        assert_eq!((number(&json, "/samples"), number(&json, "/link/bad_checksum")), (100.0, 0.0));
        assert!((number(&json, "/rate_hz") - 100.0).abs() < 1e-6, "{delimiter:?} {point}");
        let mean = [0, 1, 2].map(|axis| number(&json, &format!("/omega_rad_s/mean/{axis}")));
        assert_eq!(mean, [0.125, -0.25, 0.5], "{delimiter:?} {point}");
    }
}

#[test]
fn a_title_above_the_header_is_counted_and_the_rest_is_read() {
    let place = Place::new();
    let rows: String = (0..50).map(|k| format!("{}e-2,0.125,-0.25,0.5\n", k)).collect();
    let header = "\"Time (s)\",\"Gyroscope x (rad/s)\",\"Gyroscope y (rad/s)\",\"Gyroscope z (rad/s)\"";
    place.write("log.csv", format!("chair, second run\n\n{header}\n{rows}"));
    let json = place.run(&["inspect", "log.csv", "--json"]).done().json();
    assert_eq!((number(&json, "/samples"), number(&json, "/link/bad_checksum")), (50.0, 1.0));
    assert!((number(&json, "/omega_rad_s/mean/2") - 0.5).abs() < 1e-12);
}

#[test]
fn a_sketch_whose_first_bytes_are_noise_is_read_by_its_mapping() {
    let place = Place::new();
    let rows: String = (0..50).map(|k| format!("{} 0 0 1 0 0 10\r\n", 10_000 * k)).collect();
    place.write("capture.bin", [&b"\x00\xF8\x80ets\x1C\n"[..], rows.as_bytes()].concat());
    let mapping = shipped("configs/logs/arduino-mpu6050.toml");
    let json = place.run(&["inspect", "capture.bin", "--log-map", &mapping, "--json"]).done().json();
    assert_eq!((&json["kind"], &json["protocol"]), (&"raw".into(), &"text".into()));
    assert_eq!((number(&json, "/samples"), number(&json, "/link/bad_checksum")), (50.0, 1.0));
    assert!((number(&json, "/rate_hz") - 100.0).abs() < 1e-9);
}

/// The times of its lines count, not the speed of the line.
#[test]
fn a_chair_turns_as_far_in_a_sketch_with_noise_as_in_one_without() {
    let place = Place::new();
    // 3 s of rest, 20 s at 45 deg/s, 3 s of rest; 100 Hz.
    let row = |k: u32| {
        let rate = if (300..2300).contains(&k) { 45 } else { 0 };
        format!("{} 0 0 1 0 0 {rate}\r\n", 10_000 * k)
    };
    let rows: String = (0..2600).map(row).collect();
    place.write("clean.txt", &rows);
    place.write("noisy.bin", [&b"\x00\xF8\x80ets\x1C\n"[..], rows.as_bytes()].concat());
    let mapping = shipped("configs/logs/arduino-mpu6050.toml");
    for file in ["clean.txt", "noisy.bin"] {
        let json = place.run(&["chair", file, "--log-map", &mapping, "--json"]).done().json();
        let turned = number(&json, "/integral_imu_deg/2");
        assert!((turned - 900.0).abs() < 2.0, "{file}: {turned} deg");
    }
}

#[test]
fn a_mapping_whose_columns_are_not_in_the_header_is_refused() {
    let place = Place::new();
    place.write("log.csv", "t,gx,gy,gz\n0,1,2,3\n");
    let mapping = shipped("configs/logs/xio.toml");
    place
        .run(&["inspect", "log.csv", "--log-map", &mapping])
        .refused(2, &["log.csv: ", "no column \"Gyroscope X (deg/s)\"", "\"gx\"", "xio.toml"]);
}

/// `candump` without options writes no times.
#[test]
fn frames_without_times_are_read_and_the_lack_is_said() {
    let place = Place::new();
    // Halves of a sample of a WitMotion sensor, from `vectors.json` (witmotion-can/constructed).
    let sample = "  can0  050   [8]  55 51 00 00 00 00 00 08\n  can0  050   [8]  55 52 00 00 00 00 D7 03\n";
    let others =
        "  can0  123   [0]  remote request\n  can0  20000040   [8]  00 00 00 00 00 00 00 00   ERRORFRAME\n";
    place.write("screen.txt", sample.repeat(40) + others);
    place.run(&["chair", "screen.txt"]).refused(2, &["screen.txt: ", "without times", "`candump -l`"]);
    let json = place.run(&["inspect", "screen.txt", "--json"]).done().json();
    assert_eq!((&json["kind"], &json["protocol"]), (&"candump".into(), &"witmotion-can".into()));
    assert_eq!((number(&json, "/samples"), number(&json, "/link/bytes_skipped")), (40.0, 34.0));
    assert!((number(&json, "/specific_force_m_s2/mean/2") - 9.80665).abs() < 1e-9);
    let notes = json["notes"].to_string();
    for part in ["no time at all", "34 bytes of lines", "1 error frames: ", "bus off 1 times"] {
        assert!(notes.contains(part), "{part}: {notes}");
    }
}
