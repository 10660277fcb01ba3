//! `otolith doctor` at pseudo-terminals that are well, ill and taken.

use std::sync::Arc;

use otolith::device::serial::SerialLink;
use otolith::time::SystemClock;
use serde_json::Value;

use super::devices::run_beside;
use super::{Place, shipped};
use crate::probe::our_bytes;
use crate::pty::Device;

/// Samples per second of the device.
const RATE_HZ: f64 = 200.0;
/// Length of what it sends, s.
const LENGTH_S: f64 = 5.0;

/// Runs the doctor beside a device at rest that speaks our protocol at its rate; gives exit code and result.
fn examined(more: &[&str]) -> (i32, Value) {
    let place = Place::new();
    let device = Device::plug_in(&place.path(""));
    let selector = format!("serial:{}", device.port());
    let bytes = our_bytes(LENGTH_S, RATE_HZ);
    let baud = (bytes.len() as f64 * 10.0 / LENGTH_S) as u32;
    let args = [&["doctor", "--json", &selector], more].concat();
    let run = run_beside(&place, &args, &device, &bytes, baud);
    assert_eq!(device.read_all(), "", "nothing is ever written to a device");
    (run.code, run.json()["ports"][0].clone())
}

/// The names of the checks that complain.
fn checks(port: &Value) -> Vec<&str> {
    let findings = port["findings"].as_array().expect("a list");
    findings.iter().map(|finding| finding["check"].as_str().expect("a name")).collect()
}

#[test]
fn a_device_in_order_is_fine() {
    let (code, port) = examined(&["--rate-rpm", "30"]);
    assert_eq!((code, checks(&port)), (0, vec![]), "{port:#}");
    assert_eq!(port["heard"]["protocol"], "otolith-serial");
    assert_eq!(port["serial"]["pseudo_terminal"], true);
}

#[test]
fn a_spin_beyond_the_range_has_to_be_mended() {
    // The mock announces 500 deg/s.
    let (code, port) = examined(&["--rate-rpm", "-100"]);
    assert_eq!((code, checks(&port)), (1, vec!["range"]), "{port:#}");
    let finding = &port["findings"][0];
    assert_eq!(finding["level"], "mend");
    assert!(finding["what"].as_str().is_some_and(|what| what.contains("500 deg/s")), "{finding}");
}

#[test]
fn silence_and_absence_are_findings_not_errors() {
    let place = Place::new();
    let device = Device::plug_in(&place.path(""));
    let selector = format!("serial:{}", device.port());
    let run = place.run(&["doctor", "--listen-s", "0.2", &selector, "serial:/dev/no-such-port", "can:nope"]);
    assert_eq!((run.code, run.stderr.as_str()), (1, ""), "{}", run.stdout);
    let lines: Vec<&str> = run.stdout.lines().collect();
    assert_eq!(lines.len(), 3, "{}", run.stdout);
    for (line, parts) in lines.iter().zip([
        ["not one byte in 0.2 s", "otolith devices", "ttyIMU"],
        ["serial:/dev/no-such-port: there is no such port", "nothing can be read", "plug the device in"],
        ["can:nope: ", "nothing can be read", " -> "],
    ]) {
        for part in parts {
            assert!(line.starts_with("mend  ") && line.contains(part), "`{part}` is missing in: {line}");
        }
    }
    // Which of the two is the kernel's to say.
    let reasons = ["there is no CAN interface nope", "this kernel has no CAN support", "only Linux has"];
    assert!(reasons.iter().any(|reason| lines[2].contains(reason)), "{}", lines[2]);
}

#[cfg(target_os = "linux")]
#[test]
fn who_holds_a_port_is_named_and_left_alone() {
    let place = Place::new();
    let device = Device::plug_in(&place.path(""));
    let _held = SerialLink::open(device.port(), 115_200, Arc::new(SystemClock::start_now())).expect("opens");
    let run = place.run(&["doctor", "--json", &format!("serial:{}", device.port())]);
    let port = &run.json()["ports"][0];
    assert_eq!((run.code, checks(port)), (1, vec!["busy"]), "{port:#}");
    assert!(port["findings"][0]["mend"].to_string().contains(&format!("kill {}", std::process::id())));
    assert_eq!(port["heard"], Value::Null, "two readers would get half of the bytes each");
}

#[test]
fn the_rules_are_printed_as_shipped() {
    let rules = std::fs::read_to_string(shipped("configs/udev/70-otolith.rules")).expect("shipped");
    assert_eq!(Place::new().run(&["doctor", "--print-udev-rules"]).done().stdout, rules);
}

#[test]
fn wrong_requests_are_refused() {
    let place = Place::new();
    place.run(&["doctor", "mock:chair"]).refused(2, &["no port to examine"]);
    place.run(&["doctor", "--rate-rpm", "NaN"]).refused(2, &["--rate-rpm is no number"]);
    place.run(&["doctor", "--listen-s", "-1", "can:nope"]).refused(2, &["--listen-s is -1"]);
}
