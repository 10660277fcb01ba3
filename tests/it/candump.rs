//! A candump log of our CAN frames, through the real program to the character.

use std::fmt::Write as _;
use std::process::Command;

use otolith_firmware_protocol::can::{CanMessage, HalfSample, Identity, Ids, Ranges, Time};
use serde_json::Value;

const RATE_HZ: u32 = 500;

/// 2 s rest, 30 rpm for 15 s with ramps of 1 s, 8 s rest, as `candump -l` writes it; every `lose`-th accelerometer frame
/// is left out.
fn log(lose: Option<u32>) -> String {
    let ranges = Ranges { gyro_range_dps: 500, accel_range_g: 4, rate_hz: RATE_HZ as u16 };
    let identity = Identity { device_id: 7, firmware: 0x0100 };
    let mut log = String::new();
    let mut frames_sent = 0u16;
    let mut frame = |t_us: u32, message: CanMessage| {
        let (id, data) = Ids::default().frame(&message);
        let hex: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
        writeln!(log, "({}.{:06}) can0 {id:03X}#{hex}", 1_700_000_000 + t_us / 1_000_000, t_us % 1_000_000)
            .unwrap();
    };
    for k in 0..26 * RATE_HZ {
        let t_us = k * (1_000_000 / RATE_HZ);
        let t_s = f64::from(t_us) * 1e-6;
        if k % RATE_HZ == 0 {
            frame(t_us, CanMessage::Ranges(ranges));
            frame(t_us, CanMessage::Identity(identity));
        }
        if k % (RATE_HZ / 10) == 0 {
            frame(t_us, CanMessage::Time(Time { time_10us: t_us / 10, frames_sent, status: 0 }));
        }
        let rate = 180.0 * ((t_s - 2.0).clamp(0.0, 1.0) - (t_s - 17.0).clamp(0.0, 1.0));
        let tick = (t_us / 10) as u16;
        let counts = (rate.to_radians() / ranges.gyro_scale()).round() as i16;
        let up = (9.80665 / ranges.accel_scale()).round() as i16;
        frames_sent = frames_sent.wrapping_add(2);
        frame(t_us + 100, CanMessage::Gyro(HalfSample { xyz: [0, 0, counts], tick }));
        if lose.is_none_or(|every| k % every != 1) {
            frame(t_us + 200, CanMessage::Accel(HalfSample { xyz: [0, 0, up], tick }));
        }
    }
    log
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
