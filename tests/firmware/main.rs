//! The example firmware, simulated down to its registers, through the real serial backend.
//!
//! Its own binary, one device at a time: it lives by the clock. Times are printed, never asserted.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod conversation;
mod device;

use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::time::Duration;

use otolith::device::{Link as _, Traffic};
use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::message::{Ack, Cmd, Message, Sync, ack_result, command, status_flag};
use serde_json::Value;

use conversation::{Conversation, Heard};
use device::{Device, bench};

static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Ends hangs; never decides a test.
const MOST_POLLS: u32 = 60_000;
const POLL: Duration = Duration::from_millis(10);

const GYRO_COUNTS_PER_DPS: f64 = 32768.0 / 500.0;
const ACCEL_COUNTS_PER_G: f64 = 32768.0 / 4.0;

fn number(value: &Value, path: &str) -> f64 {
    value.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} in {value}"))
}

fn near(got: f64, expected: f64, by: f64) -> bool {
    (got - expected).abs() <= by
}

/// The program on a device, and its summary. It must end well, having lost nothing. (Gaps count pauses: time, not loss.)
fn run(device: &Device, baud: u32, duration_s: u32) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_otolith"))
        .args(["run", "--device", &format!("serial:{}?baud={baud}", device.port.display())])
        .args(["--duration-s", &duration_s.to_string(), "--json"])
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    println!("{} {} {} {}", summary["samples"], summary["link"], summary["device"], summary["timing"]);
    assert_eq!(summary["device"]["protocol"], "otolith-serial");
    for path in [
        "/link/bad_checksum",
        "/link/missing",
        "/link/dropped",
        "/device/dropped_by_device",
        "/device/unknown_packets",
        "/device/clipped",
        "/device/losses",
    ] {
        assert_eq!(number(&summary, path), 0.0, "{path}: {summary}");
    }
    summary
}

#[test]
fn the_synthetic_chair_drives_a_run_of_20_seconds_without_a_loss() {
    let _alone = ONE_AT_A_TIME.lock();
    let Some(bench) = bench() else { return };
    let folder = tempfile::tempdir().unwrap();
    let device = Device::plug_in(bench, folder.path(), &bench.synthetic, &[]);
    let summary = run(&device, 115_200, 22);
    // 200 a second; the run's first moments pass before the device has introduced itself.
    let samples = number(&summary, "/samples");
    assert!(samples >= 4000.0, "{samples} samples");
    // It spun, and green believes that it turns the other way when the chair has stopped.
    assert_eq!(summary["alignment"]["at_rest"], true);
    assert!(near(number(&summary, "/chair/peak_rate_rpm"), 30.0, 1.0), "{}", summary["chair"]);
    assert!(number(&summary, "/chair/turned_deg") > 180.0, "{}", summary["chair"]);
    assert!(number(&summary, "/green/omega_hat_at_stop_rad_s") < -0.1, "{}", summary["green"]);
    // Where the computer stalls, the turntable brakes meanwhile. Where it does not: 30 rpm for 10 s between two ramps of
    // 1 s, which make green sway and not blue.
    if number(&summary, "/device/stale_episodes") == 0.0 {
        assert!(near(number(&summary, "/chair/turned_deg"), 11.0 * 180.0, 40.0), "{}", summary["chair"]);
        let sway = |who: &str| number(&summary, &format!("/{who}/peak_com_sway_deg"));
        assert!(sway("green") > 1.0 && sway("blue") < 0.5, "green {} blue {}", sway("green"), sway("blue"));
    }
    // The host asks for the clock once a second.
    assert!(!summary["device"]["sync_round_trip_us"].is_null());
    assert!(device.unplug().contains(" 0 dropped,"), "the terminal must have taken everything");
}

#[test]
fn commands_are_obeyed_and_answered() {
    let _alone = ONE_AT_A_TIME.lock();
    let Some(bench) = bench() else { return };
    let folder = tempfile::tempdir().unwrap();
    let device = Device::plug_in(bench, folder.path(), &bench.synthetic, &[]);
    let mut host = Conversation::open(&device);

    // It introduces itself unasked, and at once on request.
    let is_hello = |heard: &Heard| matches!(heard, Heard::Hello { .. });
    let expected = Heard::Hello {
        name: "synthetic chair".into(),
        rate_millihertz: 200_000,
        gyro_scale: (500f64.to_radians() / 32768.0) as f32,
        accel_scale: (4.0 * 9.80665 / 32768.0) as f32,
    };
    assert_eq!(*host.listen(is_hello), expected);
    host.samples_come_every(5000);
    let accepted = |code, value, token| Ack { code, result: ack_result::OK, value, token };
    assert_eq!(host.ask(command::SEND_HELLO, 0, 1), accepted(command::SEND_HELLO, 0, 1));
    assert_eq!(host.right_after_the_answer(), expected);

    // Rates: the one in force is the whole number of timer ticks next to the one asked for, and HELLO says it.
    let set_rate = command::SET_RATE;
    for (asked_mhz, in_force_mhz, period_us) in [
        (100_000, 100_000, 10_000),
        (31_000, 31_000, 32_258),
        (459_000, 459_031, 2178),
        (300_000, 299_985, 3333),
    ] {
        assert_eq!(host.ask(set_rate, asked_mhz, 2), accepted(set_rate, in_force_mhz, 2));
        let hello = host.right_after_the_answer();
        let Heard::Hello { rate_millihertz, .. } = hello else { panic!("{hello:?}") };
        assert_eq!(rate_millihertz, in_force_mhz);
        host.samples_come_every(period_us);
    }
    // More does not fit 115200 Bd, and the timer has no 30 Hz.
    for refused_mhz in [459_001, 1_000_000, 30_000, 0, u32::MAX] {
        let refused = Ack { code: set_rate, result: ack_result::OUT_OF_RANGE, value: 299_985, token: 3 };
        assert_eq!(host.ask(set_rate, refused_mhz, 3), refused);
    }
    host.samples_come_every(3333);
    for code in [0, command::SET_GYRO_RANGE, command::SELF_TEST, command::SAVE, 9, 255] {
        let unknown = Ack { code, result: ack_result::UNKNOWN_CODE, value: 0, token: 4 };
        assert_eq!(host.ask(code, 2000, 4), unknown);
    }

    // Stop ends the samples and nothing else.
    assert_eq!(host.ask(command::STOP, 0, 5), accepted(command::STOP, 0, 5));
    let from = host.heard.len();
    host.listen_for(1.5);
    assert_eq!(host.samples_from(from), []);
    assert!(host.heard[from..].iter().any(is_hello));
    assert_eq!(host.ask(command::START, 0, 6), accepted(command::START, 0, 6));
    host.samples_come_every(3333);

    host.ends_without_a_loss();
    device.unplug();
}

#[test]
fn clocks_are_compared_and_damaged_requests_ignored() {
    let _alone = ONE_AT_A_TIME.lock();
    let Some(bench) = bench() else { return };
    let folder = tempfile::tempdir().unwrap();
    let device = Device::plug_in(bench, folder.path(), &bench.synthetic, &[]);
    let mut host = Conversation::open(&device);

    let is_sync = |heard: &Heard| matches!(heard, Heard::Sync(_));
    for t1_us in [1, 1_700_000_000_000_001, u64::MAX] {
        let before = host.next_status();
        let from = host.heard.len();
        host.say(&Message::Sync(Sync { t1_us, t2_us: 0, t3_us: 0 }));
        let at = host.listen_from(from, is_sync);
        let Heard::Sync(answer) = host.heard[at] else { unreachable!() };
        let after = host.next_status();
        // On the clock of STATUS, in order; a full transmit queue takes 22 ms to leave, in which a STATUS may be queued.
        assert_eq!(answer.t1_us, t1_us);
        assert!([before.t_us, answer.t2_us, after.t_us].is_sorted(), "{before:?} {answer:?} {after:?}");
        let inside_us = answer.t3_us.checked_sub(answer.t2_us).unwrap();
        assert!((1..25_000).contains(&inside_us), "{answer:?}");
    }

    // Noise, a flipped bit, an overlong piece and a delimiter too many, then a command: one answer.
    let mut frame = [0; MAX_FRAME];
    let damaged =
        host.encoder.encode(&Message::Cmd(Cmd { code: command::STOP, arg: 0, token: 7 }), &mut frame);
    let mut damaged = damaged.unwrap().to_vec();
    damaged[2] ^= 0x10;
    for noise in [&[0x55; 100][..], &[0], &damaged, &[0, 0]] {
        host.link.send(Traffic::Bytes(noise)).unwrap();
    }
    let from = host.heard.len();
    assert_eq!(host.ask(command::SEND_HELLO, 0, 8).token, 8);
    host.samples_come_every(5000);
    let answers = host.heard[from..].iter().filter(|heard| matches!(heard, Heard::Ack(_))).count();
    assert_eq!(answers, 1);
    let status = host.next_status();
    assert_eq!((status.dropped, status.tx_overrun, status.sensor_err, status.flags), (0, 0, 0, 0));
    host.ends_without_a_loss();
    device.unplug();
}

/// Writes the motion of the simulated sensor: rest for 3 s, then these values, reached within a second and held.
fn motion_file(folder: &Path, omega_dps: [f64; 3], specific_force_g: [f64; 3]) -> String {
    let path = folder.join("motion.txt");
    let ([wx, wy, wz], [fx, fy, fz]) = (omega_dps, specific_force_g);
    let text = format!("0 0 0 0 0 0 1\n3 0 0 0 0 0 1  # rest\n4 {wx} {wy} {wz} {fx} {fy} {fz}\n");
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

fn counts(values: [f64; 3], per_unit: f64) -> [i16; 3] {
    values.map(|value| (value * per_unit).round() as i16)
}

#[test]
fn the_sensor_is_read_over_i2c_in_its_ranges_and_survives_being_unplugged() {
    let _alone = ONE_AT_A_TIME.lock();
    let Some(bench) = bench() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (omega_dps, force_g) = ([10.0, -20.0, 180.0], [0.1, -0.2, 0.97]);
    let motion = motion_file(folder.path(), omega_dps, force_g);
    let options = ["--mpu6050", &motion, "--unplug", "5,6"];
    let device = Device::plug_in(bench, folder.path(), &bench.mpu6050, &options);
    let mut host = Conversation::open(&device);

    let Heard::Hello { name, .. } = host.listen(|heard| matches!(heard, Heard::Hello { .. })) else {
        unreachable!()
    };
    assert_eq!(name, "MPU-6050");
    host.samples_come_every(5000);
    // Every sample before the motion begins is the rest, every one after it the motion.
    let complained = host.listen_from(0, |heard| matches!(heard, Heard::Text(_)));
    let rest = ([0; 3], counts([0.0, 0.0, 1.0], ACCEL_COUNTS_PER_G));
    let held = (counts(omega_dps, GYRO_COUNTS_PER_DPS), counts(force_g, ACCEL_COUNTS_PER_G));
    let (mut resting, mut moving) = (0, 0);
    for sample in host.samples_from(0) {
        let got = (sample.gyro, sample.accel);
        // A reading belongs to its tick or at most 1 ms later.
        match sample.t_us {
            ..2_990_000 => assert!(got == rest, "{sample:?}"),
            4_000_000.. => assert!(got == held, "{sample:?}"),
            _ => continue,
        }
        if got == rest { resting += 1 } else { moving += 1 }
    }
    assert!(resting > 400 && moving > 150, "{resting} {moving}");

    let Heard::Text(text) = &host.heard[complained] else { unreachable!() };
    assert!(text.starts_with("no answer from an MPU-6050"), "{text}");
    // It comes back with its ranges forgotten, and is set up again.
    let back = host.listen_from(complained, |heard| matches!(heard, Heard::Sample(_)));
    let Heard::Sample(sample) = host.heard[back] else { unreachable!() };
    assert!(sample.t_us > 6_000_000 && (sample.gyro, sample.accel) == held, "{sample:?}");
    let status = host.next_status();
    // One failed read for each tick of that second; 25.00 deg C through two roundings.
    assert!((195..=205).contains(&status.sensor_err), "{status:?}");
    assert!(status.temperature_centi_c.abs_diff(2500) <= 2, "{status:?}");
    let texts = host.heard.iter().filter(|heard| matches!(heard, Heard::Text(_))).count();
    assert_eq!(texts, 1, "one complaint is enough");
    host.ends_without_a_loss();
    device.unplug();
}

/// No read fails, but what is read is a sleeping sensor.
#[test]
fn a_sensor_that_lost_its_power_between_two_readings_is_woken_again() {
    let _alone = ONE_AT_A_TIME.lock();
    let Some(bench) = bench() else { return };
    let folder = tempfile::tempdir().unwrap();
    let motion = motion_file(folder.path(), [0.0; 3], [0.0, 0.0, 1.0]);
    let options = ["--mpu6050", &motion, "--unplug", "1.002,1.003"];
    let device = Device::plug_in(bench, folder.path(), &bench.mpu6050, &options);
    let mut host = Conversation::open(&device);
    let complained = host.listen_from(0, |heard| matches!(heard, Heard::Text(_)));
    let Heard::Text(text) = &host.heard[complained] else { unreachable!() };
    assert!(text.contains("lost its power"), "{text}");
    host.listen_from(complained, |heard| matches!(heard, Heard::Sample(_)));
    let rest = ([0; 3], counts([0.0, 0.0, 1.0], ACCEL_COUNTS_PER_G));
    for sample in host.samples_from(0) {
        assert_eq!((sample.gyro, sample.accel), rest, "{sample:?}");
    }
    assert_eq!(host.next_status().sensor_err, 1);
    host.ends_without_a_loss();
    device.unplug();
}

#[test]
fn the_program_feels_what_the_sensor_feels_a_thousand_times_a_second() {
    let _alone = ONE_AT_A_TIME.lock();
    let Some(bench) = bench() else { return };
    let folder = tempfile::tempdir().unwrap();
    let motion = motion_file(folder.path(), [0.0, 0.0, 120.0], [0.0, 0.0, 1.0]);
    let device = Device::plug_in(bench, folder.path(), &bench.fast_mpu6050, &["--mpu6050", &motion]);
    let summary = run(&device, 1_000_000, 6);
    assert!(number(&summary, "/samples") >= 5000.0, "{summary}");
    assert!(near(number(&summary, "/chair/peak_rate_rpm"), 20.0, 0.5), "{}", summary["chair"]);
    assert!(near(number(&summary, "/alignment/rest_norm_m_s2"), 9.80665, 0.001), "{}", summary["alignment"]);
    device.unplug();
}

#[test]
fn clipping_and_a_missing_sensor_are_told() {
    let _alone = ONE_AT_A_TIME.lock();
    let Some(bench) = bench() else { return };
    let folder = tempfile::tempdir().unwrap();
    let motion = motion_file(folder.path(), [0.0, 0.0, 600.0], [0.0, 0.0, 5.0]);
    let device = Device::plug_in(bench, folder.path(), &bench.mpu6050, &["--mpu6050", &motion]);
    let mut host = Conversation::open(&device);
    assert_eq!(host.next_status().flags, 0);
    let clip = status_flag::GYRO_CLIP | status_flag::ACCEL_CLIP;
    host.listen(|heard| matches!(heard, Heard::Status(status) if status.flags == clip));
    host.ends_without_a_loss();
    device.unplug();

    let device = Device::plug_in(bench, folder.path(), &bench.mpu6050, &[]);
    let mut host = Conversation::open(&device);
    let from = host.listen_from(0, |heard| matches!(heard, Heard::Text(_)));
    host.listen_for(0.5);
    assert_eq!(host.samples_from(0), [], "nothing is made up where there is no sensor");
    assert!(host.next_status().sensor_err > 90);
    assert!(host.heard[from..].iter().any(|heard| matches!(heard, Heard::Status(_))));
    host.ends_without_a_loss();
    device.unplug();
}

#[test]
fn the_simulator_refuses_what_it_cannot_run() {
    let _alone = ONE_AT_A_TIME.lock();
    let Some(bench) = bench() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "0 0 0 0 0 0 1\n0 0 0 0 0 0 1\n").unwrap();
    let (file, link) = (file.to_str().unwrap(), folder.path().join("link"));
    let (link, firmware) = (link.to_str().unwrap(), bench.synthetic.to_str().unwrap());
    let cases: [(&[&str], i32, &str); 7] = [
        (&[], 2, "usage: simhost"),
        (&["--duration-s", "soon", firmware, link], 2, "--duration-s: expected a number"),
        (&["--unplug", "5,4", firmware, link], 2, "--unplug: expected FROM,TO"),
        (&[file, link], 1, "is no AVR program in ELF"),
        (&[env!("CARGO_BIN_EXE_otolith"), link], 1, "is no AVR program in ELF"),
        (&[firmware, file], 1, "cannot make the link"),
        (&["--mpu6050", file, firmware, link], 1, "file:2: the time does not rise"),
    ];
    for (arguments, code, complaint) in cases {
        let output = Command::new(&bench.simhost).args(arguments).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
        assert!(stderr.contains(complaint), "{arguments:?}: {stderr}");
    }
}
