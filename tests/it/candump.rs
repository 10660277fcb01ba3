//! A candump log of our CAN frames, through the real program to the character.

use std::process::Command;

use otolith_firmware_protocol::can::{Ids, offset};
use serde_json::Value;

use crate::chair_can::{Chair, Frame, candump_log};

const RATE_HZ: u32 = 500;
const CHAIR: Chair = Chair { rate_hz: RATE_HZ, spin_s: 15.0, after_s: 9.0 };

/// The log of a run; every `lose`-th accelerometer frame is left out.
fn log(lose: Option<usize>) -> String {
    let is_accel = |frame: &Frame| frame.id == Ids::default().base() + offset::ACCEL;
    let mut accels = 0;
    let keep = |frame: &Frame| {
        accels += usize::from(is_accel(frame));
        !is_accel(frame) || lose.is_none_or(|every| accels % every != 2)
    };
    let mut frames = CHAIR.frames();
    frames.retain(keep);
    candump_log(&frames)
}

fn run(log: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chair.log");
    std::fs::write(&path, log).unwrap();
    let device = format!("replay:{}", path.display());
    let output = Command::new(env!("CARGO_BIN_EXE_otolith"))
        .args(["run", "--device", &device, "--pace", "max", "--json"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_chair_on_the_can_bus_makes_green_sway_and_leaves_blue_alone() {
    let summary = run(&log(None));
    assert_eq!(summary["samples"], 26 * u64::from(RATE_HZ));
    assert_eq!(summary["link"]["missing"], 0, "{}", summary["link"]);
    let turned = summary["chair"]["turned_deg"].as_f64().unwrap();
    assert!((turned - 2700.0).abs() < 3.0, "{turned}");
    let peak = summary["green"]["peak_gravity_tilt_deg"].as_f64().unwrap();
    assert!((peak - 4.31).abs() < 0.15 * 4.31, "{peak}");
    assert!(summary["blue"]["peak_com_sway_deg"].as_f64().unwrap() < 0.3);
}

#[test]
fn lost_frames_are_counted_and_the_run_goes_on() {
    let summary = run(&log(Some(50)));
    let lost = u64::from(26 * RATE_HZ / 50);
    assert_eq!(summary["samples"], 26 * u64::from(RATE_HZ) - lost);
    let missing = summary["link"]["missing"].as_u64().unwrap();
    assert!(
        missing.abs_diff(lost) <= 5,
        "{missing} of {lost}: the frames after the last TIME cannot be known"
    );
    let turned = summary["chair"]["turned_deg"].as_f64().unwrap();
    assert!((turned - 2700.0).abs() < 3.0, "{turned}");
}
