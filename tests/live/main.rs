//! Live runs of the real program against a simulated device on a pseudo-terminal, in real time.
//!
//! Its own binary, one run at a time: each needs a core for itself. Times are printed, never asserted.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used)]
// A device lives by the clock.
#![allow(clippy::disallowed_methods)]

mod calibrate;
#[path = "../common/chair_can.rs"]
mod chair_can;
mod foreign;
mod port;
mod slcan;

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::message::{Hello, Message, Sample16};
use otolith_firmware_protocol::stream::StreamEncoder;
use port::Port;
use serde_json::Value;

static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

const GYRO_RANGE_DPS: u16 = 500;
const ACCEL_RANGE_G: u16 = 4;
const STANDARD_GRAVITY: f64 = 9.80665;

/// One sample as the sensor has it, SI.
#[derive(Clone, Copy)]
struct Sample {
    t_s: f64,
    omega: [f64; 3],
    force: [f64; 3],
}

/// Firmware that speaks SAMPLE16.
struct Firmware {
    encoder: StreamEncoder,
    rate_hz: f64,
    next_hello_s: f64,
}

impl Firmware {
    fn new(rate_hz: f64) -> Self {
        Self { encoder: StreamEncoder::new(), rate_hz, next_hello_s: f64::NEG_INFINITY }
    }

    fn frames(&mut self, sample: &Sample) -> Vec<u8> {
        let gyro_scale = f64::from(GYRO_RANGE_DPS).to_radians() / 32768.0;
        let accel_scale = f64::from(ACCEL_RANGE_G) * STANDARD_GRAVITY / 32768.0;
        let mut bytes = Vec::new();
        let mut frame = [0; MAX_FRAME];
        if sample.t_s >= self.next_hello_s {
            self.next_hello_s = sample.t_s + 1.0;
            let hello = Message::Hello(Hello {
                flags: 0,
                device_id: 7,
                firmware: 0x0100,
                rate_millihertz: (self.rate_hz * 1000.0) as u32,
                gyro_scale: gyro_scale as f32,
                accel_scale: accel_scale as f32,
                gyro_range_dps: GYRO_RANGE_DPS,
                accel_range_g: ACCEL_RANGE_G,
                caps: 0,
                name: b"test",
            });
            bytes.extend_from_slice(self.encoder.encode(&hello, &mut frame).unwrap());
        }
        let counts = |values: [f64; 3], scale: f64| values.map(|v| (v / scale).round() as i16);
        let sample = Message::Sample16(Sample16 {
            t_us: (sample.t_s * 1e6).round() as u32,
            gyro: counts(sample.omega, gyro_scale),
            accel: counts(sample.force, accel_scale),
        });
        bytes.extend_from_slice(self.encoder.encode(&sample, &mut frame).unwrap());
        bytes
    }
}

/// When the device misbehaves.
#[derive(Clone, Copy, Default)]
struct Mischief {
    /// Sends nothing for 100 ms each time this many seconds have passed, then everything at once.
    stall_every_s: Option<f64>,
    /// Is unplugged from the first to the second time, s.
    unplugged_s: Option<(f64, f64)>,
}

/// Plays `samples` through `port` in real time.
fn play(link: &Path, mut port: Option<Port>, samples: &[Sample], rate_hz: f64, mischief: Mischief) {
    let mut firmware = Firmware::new(rate_hz);
    let start = Instant::now();
    let mut next_stall_s = mischief.stall_every_s.unwrap_or(f64::INFINITY);
    for sample in samples {
        let due = Duration::from_secs_f64(sample.t_s);
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        if sample.t_s >= next_stall_s {
            next_stall_s += mischief.stall_every_s.unwrap();
            std::thread::sleep(Duration::from_millis(100));
        }
        if let Some((out_s, in_s)) = mischief.unplugged_s {
            if sample.t_s >= out_s && sample.t_s < in_s {
                port = None;
                continue;
            }
            if sample.t_s >= in_s && port.is_none() {
                port = Some(Port::plug_in(link));
            }
        }
        if let Some(port) = &port {
            port.write(&firmware.frames(sample));
        }
    }
    // Bytes not yet read would be lost with the terminal.
    std::thread::sleep(Duration::from_millis(500));
}

fn otolith(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_otolith")).args(arguments).output().unwrap()
}

fn summary(output: &Output) -> Value {
    let stderr = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}; stderr: {stderr}"))
}

/// Runs the program on a device that plays `samples`, and gives its exit status and summary.
fn live(
    folder: &Path,
    samples: &[Sample],
    rate_hz: f64,
    mischief: Mischief,
) -> (Option<i32>, Value, PathBuf) {
    let link = folder.join("ttyIMU");
    let port = Port::plug_in(&link);
    let recording = folder.join("run.mcap");
    let length = samples.last().unwrap().t_s + 1.0;
    let output = std::thread::scope(|scope| {
        let program = scope.spawn(|| {
            otolith(&[
                "run",
                "--device",
                &format!("serial:{}", link.display()),
                "--duration-s",
                &length.to_string(),
                "--record",
                recording.to_str().unwrap(),
                "--json",
            ])
        });
        std::thread::sleep(Duration::from_millis(300));
        play(&link, Some(port), samples, rate_hz, mischief);
        program.join().unwrap()
    });
    let summary = summary(&output);
    println!("timing {} device {} events {}", summary["timing"], summary["device"], summary["events"]);
    (output.status.code(), summary, recording)
}

fn number(value: &Value, path: &str) -> f64 {
    value.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} in {value}"))
}

/// The same peaks within 2 % or 0.02 deg.
fn same_peaks(live: &Value, expected: &Value) {
    for character in ["green", "blue"] {
        for key in ["peak_gravity_tilt_deg", "peak_com_sway_deg"] {
            let path = format!("/{character}/{key}");
            let (got, want) = (number(live, &path), number(expected, &path));
            assert!((got - want).abs() <= (0.02 * want).max(0.02), "{path}: live {got}, expected {want}");
        }
    }
}

fn nothing_lost(summary: &Value) {
    for key in ["bad_checksum", "missing", "dropped"] {
        assert_eq!(number(summary, &format!("/link/{key}")), 0.0, "{key}: {}", summary["link"]);
    }
}

fn verified(recording: &Path) {
    let output = otolith(&["replay", recording.to_str().unwrap(), "--verify", "--json"]);
    let report = summary(&output);
    assert_eq!(output.status.code(), Some(0), "{}", report["verify"]);
    assert_eq!(report["verify"]["bit_identical"], Value::Bool(true), "{}", report["verify"]);
}

/// A file of the shared data; `None` when it is not here and need not be.
fn shared(path: &Path) -> Option<PathBuf> {
    if path.exists() {
        return Some(path.to_owned());
    }
    assert!(std::env::var_os("CI").is_none(), "{} is missing", path.display());
    // Past the harness, which shows the output of failed tests only.
    let _ = writeln!(std::io::stderr(), "skipped: ../shared is not here");
    None
}

#[test]
fn a_real_recording_through_a_serial_port_gives_the_peaks_of_its_replay() {
    let _alone = ONE_AT_A_TIME.lock();
    let name = "../shared/imu-logs/turntable/roomba_circular_start_rotate_stop.txt";
    let Some(log) = shared(&Path::new(env!("CARGO_MANIFEST_DIR")).join(name)) else { return };
    let folder = tempfile::tempdir().unwrap();
    let samples: Vec<Sample> = std::fs::read_to_string(&log)
        .unwrap()
        .lines()
        .map(|line| {
            let v: Vec<f64> = line.split(',').map(|field| field.trim().parse().unwrap()).collect();
            Sample { t_s: v[0], force: [v[1], v[2], v[3]], omega: [v[4], v[5], v[6]].map(f64::to_radians) }
        })
        .collect();
    let map = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/logs/turntable-lsm9ds1.toml");
    let replay = otolith(&[
        "run",
        "--device",
        &format!("replay:{}", log.display()),
        "--log-map",
        map.to_str().unwrap(),
        "--pace",
        "max",
        "--json",
    ]);
    let (code, run, recording) = live(folder.path(), &samples, 64.0, Mischief::default());
    assert_eq!(code, Some(0));
    nothing_lost(&run);
    assert_eq!(number(&run, "/samples"), samples.len() as f64);
    same_peaks(&run, &summary(&replay));
    verified(&recording);
}

/// An ideal chair at 30 rpm: 2 s rest, 1 s ramps, `spin_s`, `after_s`.
fn chair(spin_s: f64, after_s: f64) -> Vec<Sample> {
    let plateau = 30.0 * std::f64::consts::TAU / 60.0;
    let length = 2.0 + spin_s + 1.0 + after_s;
    (0..(length * 1000.0) as u32)
        .map(|k| {
            let t_s = f64::from(k) * 1e-3;
            let rate = plateau * ((t_s - 2.0).clamp(0.0, 1.0) - (t_s - 2.0 - spin_s).clamp(0.0, 1.0));
            Sample { t_s, omega: [0.0, 0.0, rate], force: [0.0, 0.0, STANDARD_GRAVITY] }
        })
        .collect()
}

#[test]
fn a_spin_at_1_khz_with_stalls_of_100_ms_gives_the_peaks_of_the_mock() {
    let _alone = ONE_AT_A_TIME.lock();
    let folder = tempfile::tempdir().unwrap();
    let mischief = Mischief { stall_every_s: Some(2.5), ..Mischief::default() };
    let (code, run, recording) = live(folder.path(), &chair(15.0, 8.0), 1000.0, mischief);
    assert_eq!(code, Some(0));
    nothing_lost(&run);
    let mock = otolith(&["run", "--device", "mock:chair?noise=0&after_s=8", "--pace", "max", "--json"]);
    same_peaks(&run, &summary(&mock));
    verified(&recording);
}

#[test]
fn unplugging_is_a_named_state_and_the_run_goes_on_when_the_device_returns() {
    let _alone = ONE_AT_A_TIME.lock();
    let folder = tempfile::tempdir().unwrap();
    let mischief = Mischief { unplugged_s: Some((5.0, 7.0)), ..Mischief::default() };
    let (code, run, recording) = live(folder.path(), &chair(8.0, 2.0), 1000.0, mischief);
    assert_eq!(code, Some(0));
    let events = run["events"].to_string();
    for event in ["connection lost", "link lost", "connection is back"] {
        assert!(events.contains(event), "{event}: {events}");
    }
    let back = events.find("connection is back").unwrap();
    assert!(events[back..].contains("link live"), "{events}");
    assert_eq!(number(&run, "/device/reconnects"), 1.0);
    assert_eq!(run["blue"]["fell_at_s"], Value::Null);
    verified(&recording);
}
