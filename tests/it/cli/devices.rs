//! `otolith devices` at pseudo-terminals on which captures of real devices play at their speed.

use std::time::Duration;

use otolith::time::{Clock, SystemClock};
use serde_json::Value;

use super::{Place, Run, number};
use crate::probe::{our_bytes, raw_captures};
use crate::pty::Device;

/// Time between two writes of a device.
const STEP: Duration = Duration::from_millis(5);

/// Runs the program with `args` while `device` sends `bytes` over and over, at 8N1 and `baud` bit/s.
pub(super) fn run_beside(place: &Place, args: &[&str], device: &Device, bytes: &[u8], baud: u32) -> Run {
    let mut child = place.spawn(args);
    let clock = SystemClock::start_now();
    let mut stream = bytes.iter().copied().cycle();
    let mut sent = 0;
    while child.try_wait().expect("a child").is_none() {
        let due = (clock.now().as_secs_f64() * f64::from(baud) / 10.0) as usize;
        let piece: Vec<u8> = stream.by_ref().take(due - sent).collect();
        sent = due;
        device.write(&piece);
        clock.sleep_until(clock.now() + STEP);
    }
    let output = child.wait_with_output().expect("ends");
    Run {
        code: output.status.code().expect("not killed"),
        stdout: String::from_utf8(output.stdout).expect("UTF-8"),
        stderr: String::from_utf8(output.stderr).expect("UTF-8"),
    }
}

/// What `otolith devices` says about a device that sends these bytes.
fn heard(bytes: &[u8], baud: u32, more: &[&str]) -> Value {
    let place = Place::new();
    let device = Device::plug_in(&place.path(""));
    let selector = format!("serial:{}", device.port());
    let args = [&["devices", "--json", &selector], more].concat();
    let json = run_beside(&place, &args, &device, bytes, baud).done().json();
    assert_eq!(device.read_all(), "", "nothing is ever written to a device");
    assert_eq!(json["devices"][0]["selector"], selector);
    json["devices"][0]["heard"].clone()
}

/// Captures of real devices: file, protocol, samples and samples per second by the device's clock, as PROVENANCE.md has
/// them (the rate of `openimu_Scale1.raw` by its timer, that of the einride ones by their output configuration).
const CAPTURES: [(&str, &str, f64, f64); 7] = [
    ("microstrain_mip_125hz.bin", "mip", 4473.0, 125.0),
    ("openimu_Scale1.raw", "openimu", 1002.0, 20.0),
    ("openimu_z1.raw", "openimu", 2127.0, 100.0),
    ("xsens_einride_1.bin", "xbus", 96.0, 100.0),
    ("xsens_einride_2.bin", "xbus", 96.0, 100.0),
    ("xsens_einride_3.bin", "xbus", 96.0, 100.0),
    ("xsens_mtdata2_100hz_gnss.bin", "xbus", 4746.0, 100.0),
];

/// Each at the speed at which its device sent it, which is what the time to name it depends on.
#[test]
fn captures_of_real_devices_are_named() {
    let captures = raw_captures();
    for (file, protocol, samples, rate_hz) in CAPTURES {
        let Some((_, bytes)) = captures.iter().find(|(name, _)| name == file) else {
            assert!(captures.is_empty(), "{file} is missing");
            return;
        };
        let bytes_per_s = bytes.len() as f64 * rate_hz / samples;
        let heard = heard(bytes, (10.0 * bytes_per_s) as u32, &[]);
        assert_eq!((&heard["verdict"], &heard["protocol"]), (&"protocol".into(), &protocol.into()), "{file}");
        assert!(number(&heard, "/sample/samples") >= 10.0, "{file}: {heard:#}");
        println!("{file}: {protocol} after {} s, {} Hz", heard["listened_s"], heard["rate_hz"]);
    }
}

#[test]
fn our_own_protocol_is_named_with_rate_and_sample() {
    // 200 samples of 34 bytes, a HELLO and ten STATUS in a second.
    let heard = heard(&our_bytes(5.0, 200.0), 72_000, &[]);
    assert_eq!((&heard["verdict"], &heard["protocol"]), (&"protocol".into(), &"otolith-serial".into()));
    assert_eq!((&heard["baud"], &heard["announced_rate_hz"]), (&115_200.into(), &200.0.into()));
    assert!((number(&heard, "/sample/specific_force_m_s2/2") - 9.807).abs() < 0.05, "{heard:#}");
    assert!(number(&heard, "/sample/gyro_deg_s/2").abs() < 0.5);
    // The piece before the first delimiter: the line was joined in the middle of a frame.
    assert!(number(&heard, "/counters/bad_checksum") <= 1.0, "{heard:#}");
    assert!(heard["notes"].to_string().contains("pseudo-terminal"), "{heard:#}");
}

#[test]
fn what_is_not_understood_stays_unknown() {
    let noise: Vec<u8> = (0..4000u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let unknown = heard(&noise, 115_200, &["--listen-s", "1"]);
    assert_eq!((&unknown["verdict"], &unknown["protocol"]), (&"unknown".into(), &Value::Null));
    assert!(number(&unknown, "/bytes") > 0.0);
    assert_eq!(unknown["looks"].as_array().map(Vec::len), Some(6));

    let silent = heard(&[0], 0, &["--listen-s", "0.5"]);
    assert_eq!((&silent["verdict"], &silent["bytes"]), (&"silence".into(), &0.into()));

    let lines = b"0.01,-0.02,9.81,0.1,0.2,0.3\r\n";
    let text = heard(lines, 28_000, &["--listen-s", "2"]);
    assert_eq!((&text["verdict"], &text["text_columns"]), (&"text".into(), &6.into()));
}

#[test]
fn the_text_says_the_same_in_words() {
    let place = Place::new();
    let device = Device::plug_in(&place.path(""));
    let selector = format!("serial:{}?baud=57600", device.port());
    let bytes = our_bytes(5.0, 200.0);
    let run = run_beside(&place, &["devices", &selector], &device, &bytes, 72_000).done();
    for part in ["speaks otolith-serial at 57600 baud, ", " deg/s, specific force (", "pseudo-terminal"] {
        assert!(run.stdout.contains(part), "{part} is missing in: {}", run.stdout);
    }
    assert_eq!(run.stderr, "");
}

#[test]
fn a_named_port_that_cannot_be_opened_is_an_error_and_others_are_still_heard() {
    let place = Place::new();
    let device = Device::plug_in(&place.path(""));
    let selector = format!("serial:{}", device.port());
    let run = place.run(&["devices", "--json", "--listen-s", "0.2", "serial:/dev/no-such-port", &selector]);
    run.complains(2, &["/dev/no-such-port: there is no such port"]);
    let devices = &run.json()["devices"];
    let text = place.run(&["devices", "--listen-s", "0.2", "can:nope"]).stdout;
    assert!(text.starts_with("can:nope\n    ") && !text.contains("you may open it"), "{text}");
    assert!(devices[0]["error"].as_str().expect("why").contains("no such port"));
    assert_eq!(devices[1]["heard"]["verdict"], "silence");
}

#[test]
fn wrong_requests_are_refused() {
    let place = Place::new();
    place.run(&["devices", "--listen-s", "0"]).refused(2, &["--listen-s is 0, expected 0.1 to 3600 s"]);
    place.run(&["devices", "usb:1"]).refused(2, &["unknown scheme `usb`"]);
    place.run(&["devices", "mock:chair"]).complains(2, &["mock:chair", "no port to listen to"]);
}
