//! Captures of real Xsens and MicroStrain devices through the program, the protocol found by itself.

use serde_json::Value;

use super::{Place, number, shared_log};

/// File, protocol, packets, junk bytes, samples, time by the device.
const CAPTURES: [(&str, &str, f64, f64, f64, f64); 5] = [
    ("xsens_mtdata2_100hz_gnss.bin", "xbus", 4936.0, 22.0, 4746.0, 47.45),
    ("xsens_einride_1.bin", "xbus", 100.0, 0.0, 96.0, f64::NAN),
    ("xsens_einride_2.bin", "xbus", 100.0, 0.0, 96.0, f64::NAN),
    ("xsens_einride_3.bin", "xbus", 100.0, 0.0, 96.0, f64::NAN),
    ("microstrain_mip_125hz.bin", "mip", 8384.0, 0.0, 4473.0, 35.776),
];

/// The largest absolute value of each axis of a range.
fn largest(json: &Value, range: &str) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        let end = |end: &str| number(json, &format!("/{range}/{end}/{axis}")).abs();
        end("min").max(end("max"))
    })
}

#[test]
fn inspect_finds_the_protocol_and_every_sample() {
    let place = Place::new();
    for (file, protocol, packets, junk, samples, duration_s) in CAPTURES {
        let Some(path) = shared_log(&format!("serial_raw/{file}")) else { return };
        let json = place.run(&["inspect", &path, "--json"]).done().json();
        assert_eq!((&json["kind"], &json["protocol"]), (&"raw".into(), &protocol.into()), "{file}");
        let link = |counter: &str| number(&json, &format!("/link/{counter}"));
        assert_eq!(
            [link("packets"), link("bytes_skipped"), number(&json, "/samples")],
            [packets, junk, samples]
        );
        assert_eq!([link("bad_checksum"), link("missing"), link("dropped")], [0.0; 3], "{file}");
        assert_eq!(json["notes"], serde_json::json!([]), "{file}");
        if duration_s.is_finite() {
            assert!((number(&json, "/duration_s") - duration_s).abs() < 1e-9, "{json:#}");
        }
        let expected = match file {
            "xsens_mtdata2_100hz_gnss.bin" => [5.522, 4.957, 2.661],
            "microstrain_mip_125hz.bin" => [3.621, 3.055, 1.802],
            _ => continue,
        };
        for (found, expected) in largest(&json, "omega_rad_s").iter().zip(expected) {
            assert!((found - expected).abs() < 5.01e-4, "{found} is not {expected}");
        }
    }
}

#[test]
fn a_capture_moves_the_characters_in_the_devices_own_time_without_a_loss() {
    let place = Place::new();
    for (file, protocol, packets, junk, samples, duration_s) in [CAPTURES[0], CAPTURES[4]] {
        let Some(path) = shared_log(&format!("serial_raw/{file}")) else { return };
        let device = format!("replay:{path}");
        let json = place.run(&["run", "--device", &device, "--pace", "max", "--json"]).done().json();
        let link = |counter: &str| number(&json, &format!("/link/{counter}"));
        assert_eq!(
            [number(&json, "/samples"), link("packets"), link("bytes_skipped")],
            [samples, packets, junk]
        );
        assert_eq!(
            [link("bad_checksum"), link("missing"), link("gaps"), link("dropped")],
            [0.0; 4],
            "{file}"
        );
        let device = |counter: &str| number(&json, &format!("/device/{counter}"));
        for counter in ["clock_resets", "lost_episodes", "stale_episodes", "late_ticks", "clipped"] {
            assert_eq!(device(counter), 0.0, "{file}: {counter}");
        }
        assert_eq!(
            (&json["device"]["protocol"], &json["device"]["clock"]),
            (&protocol.into(), &"device".into())
        );
        assert!(device("clock_drift_ppm").abs() < 1.0, "{json:#}");
        // The capture begins a few bytes before its first sample.
        assert!((number(&json, "/duration_s") - duration_s).abs() < 0.02, "{json:#}");
        assert_eq!(json["alignment"]["at_rest"], true);
        assert!(number(&json, "/chair/peak_rate_rpm") > 5.0, "the motion did not reach the chair: {json:#}");
    }
}
