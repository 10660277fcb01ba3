use nalgebra::Vector3;
use proptest::prelude::*;
use serde_json::Value;

use super::*;
use crate::device::protocol::trials::{damage, damaged, decode, holds_in_order};
use crate::device::testing::from_hex;
use crate::units::STANDARD_GRAVITY;

fn golden(text: &str) -> Value {
    serde_json::from_str(text).expect("the golden file is JSON")
}

/// Frames of pymavlink; `tests/foreign/mavlink_frames.py` made them.
fn frames() -> Value {
    golden(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/devices/mavlink-frames.json")))
}

fn frame(name: &str) -> Vec<u8> {
    let frames = frames();
    let row = frames["frames"].as_array().expect("rows").iter().find(|row| row["name"] == name);
    from_hex(row.expect("there is one")["hex"].as_str().expect("digits"))
}

fn triple(value: &Value, scale: f64) -> Vector3<f64> {
    let axis = |i: usize| value[i].as_f64().expect("a number") * scale;
    Vector3::new(axis(0), axis(1), axis(2))
}

#[test]
fn every_frame_of_the_other_encoder_is_read() {
    for row in frames()["frames"].as_array().expect("rows") {
        let (name, expect) = (&row["name"], &row["expect"]);
        let mut bytes = from_hex(row["hex"].as_str().expect("digits"));
        let unknown = expect["unknown"] == true;
        if unknown {
            // It is believed only if a frame follows.
            bytes.extend(frame("heartbeat/px4"));
        }
        let (readings, counters, _) = decode(MavlinkDecoder::new(), [&bytes[..]]);
        let expected = DecodeCounters {
            packets: 1 + u64::from(unknown),
            unknown: u64::from(unknown),
            lone_halves: u64::from(expect["half"] == true),
            ..DecodeCounters::default()
        };
        assert_eq!(counters, expected, "{name}");
        if expect["time_us"].is_null() {
            assert!(readings.is_empty(), "{name}");
            continue;
        }
        let [reading] = readings[..] else { panic!("{name}: {readings:?}") };
        let (force, rate) = match expect.get("force") {
            Some(force) => (triple(force, 1.0), triple(&expect["rate"], 1.0)),
            None => {
                (triple(&expect["force_mg"], 1e-3 * STANDARD_GRAVITY), triple(&expect["rate_mrad_s"], 1e-3))
            }
        };
        assert_eq!(reading.device_time.map(|time| time.micros), expect["time_us"].as_u64(), "{name}");
        assert_eq!(reading.specific_force_imu, Some(force), "{name}");
        assert_eq!(reading.omega_imu, rate, "{name}");
        assert!(!reading.clipped);
    }
}

/// Two of a real log, one of each kind of message, one from an independent encoder.
#[test]
fn the_document_s_vectors() {
    let vectors =
        golden(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/devices/vectors.json")));
    let rows = vectors.as_array().expect("rows").iter().filter(|row| row["proto"] == "mavlink2");
    let mut seen = Vec::new();
    for row in rows {
        let (expect, bytes) = (&row["expect"], from_hex(row["hex"].as_str().expect("digits")));
        let (readings, counters, _) = decode(MavlinkDecoder::new(), [&bytes[..]]);
        assert_eq!(counters, DecodeCounters { packets: 1, ..DecodeCounters::default() }, "{row}");
        let message = expect["msg"].as_str().expect("a name");
        seen.push(message.to_owned());
        let force = |scale: f64| expect["zacc"].as_f64().expect("a number") * scale;
        let rate = |scale: f64| expect["zgyro"].as_f64().expect("a number") * scale;
        match (message, &readings[..]) {
            ("RAW_IMU", [reading]) => {
                assert_eq!(reading.device_time.map(|time| time.micros), expect["time_usec"].as_u64());
                let found = reading.specific_force_imu.expect("an accelerometer");
                assert!((found.z - force(9.80665e-3)).abs() < 1e-12 && found.z < -9.6);
                assert!((reading.omega_imu.z - rate(1e-3)).abs() < 1e-12);
            }
            ("HIGHRES_IMU", [reading]) => {
                let found = reading.specific_force_imu.expect("an accelerometer");
                assert!((found.z - force(1.0)).abs() < 1e-6);
                assert!((reading.omega_imu.z - rate(1.0)).abs() < 1e-6);
            }
            ("ATTITUDE", []) => {}
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(seen, ["RAW_IMU", "ATTITUDE", "RAW_IMU", "HIGHRES_IMU"]);
}

#[test]
fn notes_say_what_the_units_rest_on() {
    let raw = frame("raw_imu/cut");
    let note = |first: &[u8]| {
        let (_, _, notes) = decode(MavlinkDecoder::new(), [first, &raw]);
        notes.first().expect("a note").clone()
    };
    assert!(note(&frame("heartbeat/ardupilot")).contains("its heartbeat says ArduPilot"));
    assert!(note(&frame("heartbeat/px4")).contains("the autopilot is of kind 12"));
    assert!(note(&[]).contains("no heartbeat has told the autopilot"));
    let (_, _, notes) = decode(MavlinkDecoder::new(), [&frame("highres_imu/version 1")[..]]);
    assert!(notes[0].starts_with("samples are HIGHRES_IMU of system 1, component 1, sensor 0"), "{notes:?}");
    assert!(notes.iter().any(|note| note == "1 packets are MAVLink 1"), "{notes:?}");
}

#[test]
fn the_first_of_several_sensors_is_used_alone() {
    let stream =
        [frame("scaled_imu2"), frame("highres_imu"), frame("scaled_imu"), frame("scaled_imu2")].concat();
    let (readings, counters, notes) = decode(MavlinkDecoder::new(), [&stream[..]]);
    assert_eq!((readings.len(), counters.packets), (2, 4));
    assert!(
        notes[0].contains("SCALED_IMU2") && notes[1].starts_with("2 samples of other messages"),
        "{notes:?}"
    );
}

#[test]
fn a_sensor_that_is_not_there_is_not_used() {
    // SCALED_IMU2 with the magnetometer alone, from the real log: all the autopilot has is one IMU.
    let zeros = from_hex("fd1600000a010174000053840a00000000000000000000000000dffea200df00");
    let mut zeros = zeros;
    let crc = mcrf(&zeros[1..], 76);
    zeros.extend(crc);
    let stream = [zeros.clone(), frame("raw_imu/cut"), zeros].concat();
    let (readings, counters, notes) = decode(MavlinkDecoder::new(), [&stream[..]]);
    assert_eq!((readings.len(), counters.packets, counters.bad_checksum), (1, 3, 0));
    assert!(notes.iter().any(|note| note.starts_with("2 messages of a sensor held zeros only")), "{notes:?}");
}

/// Checksum of a frame made here.
fn mcrf(checked: &[u8], extra: u8) -> [u8; 2] {
    use crate::device::protocol::crc::{MCRF4XX_START, mcrf4xx};
    mcrf4xx(MCRF4XX_START, checked.iter().copied().chain([extra])).to_le_bytes()
}

/// A RAW_IMU that turns at `rate` mrad/s about z.
fn raw_imu(sequence: u8, rate: i16) -> Vec<u8> {
    let mut frame = frame("raw_imu/extensions");
    let end = frame.len() - 2;
    frame[4] = sequence;
    frame[10 + 18..10 + 20].copy_from_slice(&rate.to_le_bytes());
    let crc = mcrf(&frame[1..end], 144);
    frame[end..].copy_from_slice(&crc);
    frame
}

#[test]
fn losses_are_counted_in_the_sequence_of_one_component() {
    let other = frame("scaled_imu");
    let mut stream = Vec::new();
    for k in 0..300_u16 {
        // Three lost, one of them at the wrap; one comes twice.
        if ![10, 11, 256].contains(&k) {
            stream.extend(raw_imu(k as u8, 1));
            stream.extend(&other);
        }
        if k == 20 {
            stream.extend(raw_imu(k as u8, 1));
        }
    }
    let (readings, counters, _) = decode(MavlinkDecoder::new(), [&stream[..]]);
    assert_eq!((readings.len(), counters.missing), (298, 3));
    // Restarted: the sequence begins again.
    let stream = [raw_imu(200, 1), raw_imu(0, 1), raw_imu(1, 1)].concat();
    assert_eq!(decode(MavlinkDecoder::new(), [&stream[..]]).1.missing, 55);
    let stream = [raw_imu(100, 1), raw_imu(0, 1), raw_imu(1, 1)].concat();
    assert_eq!(decode(MavlinkDecoder::new(), [&stream[..]]).1.missing, 0);
}

#[test]
fn an_unknown_message_needs_a_frame_behind_it() {
    let foreign = frame("message of another dialect");
    let counted = |stream: &[u8]| {
        let (_, counters, _) = decode(MavlinkDecoder::new(), [stream]);
        (counters.packets, counters.unknown, counters.bad_checksum, counters.unfinished_bytes)
    };
    let next = frame("heartbeat/px4");
    assert_eq!(counted(&[&foreign[..], &next].concat()), (2, 1, 0, 0));
    assert_eq!(counted(&foreign), (0, 0, 0, foreign.len() as u64));
    assert_eq!(counted(&[&foreign[..], b"x", &next].concat()), (1, 0, 1, 0));
    // No crc_extra makes up for a flipped bit in the payload.
    let mut damaged = foreign.clone();
    damaged[12] ^= 1;
    assert_eq!(counted(&[&damaged[..], &next].concat()), (1, 0, 1, 0));
}

/// The camera of the real log: its frames were cut by the program that wrote the log.
#[test]
fn a_payload_cut_after_its_checksum_is_good_unless_it_is_a_sample() {
    let camera = from_hex("fd050000c701640401000200000001f8fa");
    let (_, counters, notes) = decode(MavlinkDecoder::new(), [&camera[..]]);
    assert_eq!((counters.packets, counters.bad_checksum), (1, 0));
    assert!(notes.iter().any(|note| note.starts_with("1 packets were cut shorter")), "{notes:?}");
    // The same done to a sample.
    let whole = frame("raw_imu/cut");
    let mut full = whole[..whole.len() - 2].to_vec();
    full[1] = 26;
    full.resize(10 + 26, 0);
    let crc = mcrf(&full[1..], 144);
    let cut = [&whole[..whole.len() - 2], &crc].concat();
    let (readings, counters, _) = decode(MavlinkDecoder::new(), [&cut[..]]);
    assert_eq!((readings.len(), counters.packets, counters.bad_checksum), (0, 0, 1));
}

#[test]
fn a_count_at_the_end_of_its_range_is_marked() {
    let (readings, _, _) = decode(MavlinkDecoder::new(), [&raw_imu(0, i16::MAX)[..], &raw_imu(1, 5)]);
    assert_eq!(readings.iter().map(|reading| reading.clipped).collect::<Vec<_>>(), [true, false]);
}

#[test]
fn a_rejoined_line_starts_anew() {
    let mut decoder = MavlinkDecoder::new();
    let mut readings = 0;
    for piece in [&raw_imu(0, 1)[..], &raw_imu(1, 1)[..9]] {
        decoder.push(Traffic::Bytes(piece), &mut |_| readings += 1);
    }
    decoder.rejoin();
    for piece in [&raw_imu(90, 1)[..], &frame("scaled_imu")] {
        decoder.push(Traffic::Bytes(piece), &mut |_| readings += 1);
    }
    assert_eq!((readings, decoder.counters().missing, decoder.counters().bytes_skipped), (2, 0, 9));
}

/// Samples with a rate of their own among other messages.
fn stream() -> Vec<Vec<u8>> {
    let others = ["heartbeat/ardupilot", "message of another dialect", "raw_imu/version 1"].map(frame);
    (0..20u8).flat_map(|k| [raw_imu(k, i16::from(k)), others[usize::from(k + 1) % 3].clone()]).collect()
}

/// A signature has no check of its own: a byte missing in it is taken from the next frame.
#[test]
fn damage_in_a_signature_costs_the_next_frame_at_most() {
    let mut signed = frame("raw_imu/signed");
    signed.pop();
    let stream = [raw_imu(0, 0), signed, raw_imu(1, 1), raw_imu(2, 2), raw_imu(3, 3)].concat();
    let rates: Vec<f64> =
        decode(MavlinkDecoder::new(), [&stream[..]]).0.iter().map(|reading| reading.omega_imu.z).collect();
    assert_eq!(rates, [0.0, 0.002, 0.003]);
}

proptest! {
    #[test]
    fn any_bytes_are_survived_and_accounted_for(
        bytes in proptest::collection::vec(
            prop_oneof![Just(0xFDu8), Just(0xFE), Just(0), Just(27), 0u8..40, any::<u8>()], 0..3000,
        ),
        cut in 1usize..50,
    ) {
        let (readings, counters, _) = decode(MavlinkDecoder::new(), bytes.chunks(cut));
        let whole = decode(MavlinkDecoder::new(), [&bytes[..]]);
        prop_assert_eq!((&readings, counters), (&whole.0, whole.1));
        prop_assert!(counters.bytes_skipped + counters.unfinished_bytes <= bytes.len() as u64);
    }

    #[test]
    fn cuts_do_not_matter(cut in 1usize..200) {
        let bytes = stream().concat();
        let (readings, counters, notes) = decode(MavlinkDecoder::new(), bytes.chunks(cut));
        prop_assert_eq!(readings.len(), 20);
        prop_assert_eq!((counters.packets, counters.bytes_skipped), (40, 0));
        prop_assert_eq!((counters, notes), {
            let whole = decode(MavlinkDecoder::new(), [&bytes[..]]);
            (whole.1, whole.2)
        });
    }

    #[test]
    fn damage_costs_what_it_hits(damages in proptest::collection::vec((0.0..1.0f64, damage()), 0..12)) {
        let frames = stream();
        let (bytes, hit) = damaged(&frames, &damages);
        let unhit = frames.iter().zip(hit).filter(|(_, hit)| !hit).map(|(frame, _)| frame);
        let samples = unhit.filter(|frame| frame[1] == 29);
        let expected: Vec<ImuReading> =
            samples.flat_map(|frame| decode(MavlinkDecoder::new(), [&frame[..]]).0).collect();
        // The first sample decides which sensor is used: a whole one stands in front.
        let first = raw_imu(255, 0);
        let (readings, _, _) = decode(MavlinkDecoder::new(), std::iter::once(&first[..]).chain(bytes.chunks(64)));
        prop_assert!(holds_in_order(&readings, &expected), "{:?}", damages);
    }
}
