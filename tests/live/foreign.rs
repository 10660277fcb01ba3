//! Devices of others: 22 s each in real time, with bytes from documents and real captures.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::{ONE_AT_A_TIME, number, otolith, summary};
use crate::port::Port;

/// Length of a run, s.
const DURATION_S: u64 = 22;

/// What a device sends, and when, s.
type Packets = Vec<(f64, Vec<u8>)>;

/// Runs the program on a device that sends these packets. It must end well, with nothing lost.
fn run(packets: &Packets, options: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("ttyIMU");
    let port = Port::plug_in(&link);
    let device = format!("serial:{}?baud=115200", link.display());
    let output = std::thread::scope(|scope| {
        let program = scope.spawn(|| {
            let duration = DURATION_S.to_string();
            otolith(&[&["run", "--device", &device, "--duration-s", &duration, "--json"], options].concat())
        });
        std::thread::sleep(Duration::from_millis(300));
        let start = Instant::now();
        for (due_s, bytes) in packets {
            std::thread::sleep(Duration::from_secs_f64(*due_s).saturating_sub(start.elapsed()));
            port.write(bytes);
        }
        program.join().unwrap()
    });
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let run = summary(&output);
    println!("{} {} {} {}", run["samples"], run["link"], run["device"], run["timing"]);
    for path in
        ["/link/bad_checksum", "/link/missing", "/link/dropped", "/device/lone_halves", "/device/losses"]
    {
        assert_eq!(number(&run, path), 0.0, "{path}: {run}");
    }
    run
}

/// The pair of packets of the document's sample, 100 times a second: 60 deg/s about an upright axis.
fn witmotion() -> Packets {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/devices/vectors.json");
    let vectors: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let vectors = vectors.as_array().unwrap();
    let vector = vectors.iter().find(|vector| vector["name"] == "witmotion-serial/constructed").unwrap();
    let digits = vector["hex"].as_str().unwrap().as_bytes();
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
    let bytes: Vec<u8> = digits.chunks(2).map(byte).collect();
    (0..100 * (DURATION_S + 2)).map(|k| (k as f64 * 0.01, bytes.clone())).collect()
}

/// The messages of the capture, those with motion at the 100 a second they were taken at.
fn xbus(capture: &[u8]) -> Packets {
    let mut packets = Packets::new();
    let mut moving = 0_u32;
    let mut at = capture.windows(3).position(|start| start == [0xFA, 0xFF, 0x36]).unwrap();
    while let Some(length) = capture.get(at + 3).filter(|_| moving < 100 * (DURATION_S as u32 + 2)) {
        let end = at + usize::from(*length) + 5;
        let message = &capture[at..end];
        packets.push((f64::from(moving) * 0.01, message.to_vec()));
        moving += u32::from(message.windows(3).any(|item| item == [0x80, 0x20, 0x0C]));
        at = end;
    }
    packets
}

#[test]
fn witmotion_and_xbus_drive_the_characters_for_20_seconds_each() {
    let _alone = ONE_AT_A_TIME.lock();
    let capture = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/imu-logs/serial_raw/xsens_mtdata2_100hz_gnss.bin");
    let capture = super::shared(&capture).map(|path| std::fs::read(path).unwrap());
    // Together, to save time: neither needs a whole core.
    std::thread::scope(|scope| {
        let witmotion = scope.spawn(|| run(&witmotion(), &[]));
        if let Some(capture) = capture {
            let run = run(&xbus(&capture), &[]);
            assert_eq!(run["device"]["protocol"], "xbus");
            assert_eq!(run["device"]["clock"], "device");
            assert!(number(&run, "/samples") >= 2000.0, "{run}");
        }
        let run = witmotion.join().unwrap();
        assert_eq!(run["device"]["protocol"], "witmotion");
        assert!(number(&run, "/samples") >= 2000.0, "{run}");
        // 59.9976 deg/s, the whole time.
        assert!((number(&run, "/chair/peak_rate_rpm") - 10.0).abs() < 0.1, "{}", run["chair"]);
    });
}
