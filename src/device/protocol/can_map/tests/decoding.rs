//! From frames to readings: the golden vectors, pairing, losses and damage.

use otolith_firmware_protocol::can::{CanMessage, HalfSample, Ids, Ranges};
use proptest::prelude::*;
use serde_json::Value;

use super::*;
use crate::device::protocol::native_can::NativeCanDecoder;
use crate::device::replay::parse_candump_line;
use crate::device::testing::from_hex;
use crate::units::DEG_PER_RAD;

/// The test vectors of CAN sensors, cut from `../shared/golden/devices/vectors.json`.
fn vectors() -> Value {
    let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/can/vectors/can.json"));
    serde_json::from_str(text).unwrap()
}

fn vector(name: &str) -> (Vec<(u32, bool, Vec<u8>)>, Value) {
    let vectors = vectors();
    let vector = vectors.as_array().unwrap().iter().find(|vector| vector["name"] == name).unwrap();
    let frames = match vector["candump"].as_str() {
        Some(line) => {
            let frame = parse_candump_line(line.as_bytes()).unwrap();
            vec![(frame.id, frame.extended, frame.data().to_vec())]
        }
        None => vector["can"].as_array().unwrap().iter().map(frame_of).collect(),
    };
    (frames, vector["expect"].clone())
}

fn frame_of(frame: &Value) -> (u32, bool, Vec<u8>) {
    let id = u32::try_from(frame["id"].as_u64().unwrap()).unwrap();
    (id, frame["extended"].as_bool().unwrap(), from_hex(frame["data"].as_str().unwrap()))
}

/// One reading of a ready mapping in deg/s and m/s².
fn one_reading(map: &str, frames: &[(u32, bool, Vec<u8>)]) -> ([f64; 3], [f64; 3], ImuReading) {
    let mut decoder = CanMapDecoder::new(&ready(map));
    let readings = push(&mut decoder, frames);
    let [reading] = readings[..] else {
        panic!("{map}: {} readings, {:?}", readings.len(), decoder.counters())
    };
    let counted = DecodeCounters { packets: frames.len() as u64, ..DecodeCounters::default() };
    assert_eq!(decoder.counters(), counted, "{map}");
    let omega_dps = reading.omega_imu * DEG_PER_RAD;
    (omega_dps.into(), reading.specific_force_imu.unwrap().into(), reading)
}

#[track_caller]
fn assert_near(found: [f64; 3], expected: [f64; 3], tolerance: f64) {
    let near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() <= tolerance);
    assert!(near, "{found:?}, expected {expected:?} +- {tolerance}");
}

fn number(expect: &Value, key: &str) -> f64 {
    expect[key].as_f64().unwrap_or_else(|| panic!("{key} in {expect}"))
}

const G: f64 = STANDARD_GRAVITY;

#[test]
fn a_real_frame_of_a_toyota() {
    let (frames, expect) = vector("toyota-0x24/capture");
    let (omega_dps, force, reading) = one_reading("toyota-yaw", &frames);
    assert_near(omega_dps, [0.0, 0.0, number(&expect, "yaw_rate_dps")], 1e-9);
    assert_near(force, [number(&expect, "accel_x_mps2"), number(&expect, "accel_y_mps2"), G], 1e-5);
    assert!(!reading.clipped && reading.device_time.is_none());
    let mut decoder = CanMapDecoder::new(&ready("toyota-yaw"));
    let silent = "not one frame came of KINEMATICS (0x024): no sample is complete without";
    assert_eq!(decoder.notes().last().map(String::as_str), Some(silent));
    push(&mut decoder, &frames);
    let notes = decoder.notes();
    assert_eq!(notes[0], "not measured and taken as 0: gyro.x, gyro.y");
    assert!(notes[1].contains("upright, +9.80665 m/s2 on z") && notes.len() == 3, "{notes:?}");

    let mut damaged = frames.clone();
    damaged[0].2[3] ^= 1;
    let mut decoder = CanMapDecoder::new(&ready("toyota-yaw"));
    assert!(push(&mut decoder, &damaged).is_empty());
    assert_eq!(decoder.counters(), DecodeCounters { bad_checksum: 1, ..DecodeCounters::default() });
}

#[test]
fn the_vector_of_the_racelogic_imu04() {
    let (frames, expect) = vector("racelogic-imu04/constructed");
    let (omega_dps, force, _) = one_reading("racelogic-imu04", &frames);
    let rates = ["roll_dps", "pitch_dps", "yaw_dps"].map(|key| number(&expect, key));
    // Clockwise yaw and nose-up pitch are negative about up and left.
    assert_near(omega_dps, [rates[0], -rates[1], -rates[2]], 1e-6);
    assert_near(force, ["ax_g", "ay_g", "az_g"].map(|key| G * number(&expect, key)), 1e-6);
}

#[test]
fn the_vector_of_the_bosch_mm7_and_its_smaller_brothers() {
    let (frames, expect) = vector("bosch-mm710/constructed");
    let rates = ["roll_dps", "pitch_dps", "yaw_dps"].map(|key| number(&expect, key));
    let forces = ["ax_g", "ay_g", "az_g"].map(|key| G * number(&expect, key));
    let (omega_dps, force, _) = one_reading("bosch-mm7", &frames);
    assert_near(omega_dps, rates, 0.005);
    assert_near(force, forces, 0.00013 * G);
    let without_pitch = [rates[0], 0.0, rates[2]];
    let (omega_dps, force, _) = one_reading("bosch-mm5", &frames);
    assert_near(omega_dps, without_pitch, 0.005);
    assert_near(force, forces, 0.00013 * G);
    let of_kit: Vec<_> =
        frames.iter().zip([0x70, 0x80, 0x576]).map(|(frame, id)| (id, false, frame.2.clone())).collect();
    let (omega_dps, force, _) = one_reading("bosch-abs-kit", &of_kit);
    assert_near(omega_dps, without_pitch, 0.005);
    assert_near(force, forces, 0.00013 * G);
}

#[test]
fn a_bosch_at_the_end_of_its_range_is_clipped() {
    for (raw, clipped) in [(0xFFFF_u16, true), (0, true), (0xFF00, false)] {
        let yaw = [&raw.to_le_bytes()[..], &[0, 0, 0, 128, 0, 0]].concat();
        let level = vec![0, 128, 0, 0, 0, 128, 0, 0];
        let frames = [(0x174, false, yaw), (0x178, false, level.clone()), (0x17C, false, level)];
        assert_eq!(one_reading("bosch-mm7", &frames).2.clipped, clipped, "{raw:#x}");
    }
    let device = CanMapDecoder::new(&ready("bosch-mm7")).device().cloned().unwrap();
    assert!((device.gyro_range.unwrap() * DEG_PER_RAD - 163.0).abs() < 1e-9, "{device:?}");
}

#[test]
fn the_vector_of_j1939_in_both_axis_orders_from_any_source() {
    let (frames, expect) = vector("j1939-imu/constructed");
    let [roll, pitch, yaw] = ["roll_dps", "pitch_dps", "yaw_dps"].map(|key| number(&expect, key));
    let [ax, ay, az] = ["ax", "ay", "az"].map(|key| number(&expect, key));
    let (omega_dps, force, _) = one_reading("j1939-imu", &frames);
    assert_near(omega_dps, [roll, pitch, yaw], 1e-9);
    assert_near(force, [ax, ay, az], 1e-9);
    let (omega_dps, force, _) = one_reading("j1939-imu-xyz", &frames);
    assert_near(omega_dps, [pitch, roll, yaw], 1e-9);
    assert_near(force, [ay, ax, az], 1e-9);
    // Another priority and another source: the same parameter groups.
    let moved: Vec<_> =
        frames.iter().map(|(id, _, data)| (id & 0x03FF_FF00 | 0x1800_0033, true, data.clone())).collect();
    assert_near(one_reading("j1939-imu", &moved).1, [ax, ay, az], 1e-9);

    // Two sensors on one bus: the first that sends is followed.
    let mut decoder = CanMapDecoder::new(&ready("j1939-imu"));
    let mixed = [&frames[..1], &moved[..], &frames[1..]].concat();
    assert_eq!(push(&mut decoder, &mixed).len(), 1);
    assert_eq!((decoder.counters().lone_halves, decoder.counters().packets), (0, 2));
    assert!(decoder.notes().iter().any(|note| note.starts_with("2 frames of other source addresses")));

    // 0xFFFF is "not available", 0xFExx an error.
    let mut decoder = CanMapDecoder::new(&ready("j1939-imu"));
    let mut unavailable = frames.clone();
    unavailable[0].2[4..6].copy_from_slice(&[0xFF, 0xFF]);
    assert!(push(&mut decoder, &unavailable).is_empty());
    assert_eq!((decoder.counters().device_errors, decoder.counters().lone_halves), (1, 1));
}

#[test]
fn the_vector_of_the_xsens_mti_and_its_counter() {
    let (frames, expect) = vector("xsens-can/constructed");
    let (omega_dps, force, reading) = one_reading("xsens-mti-can", &frames);
    assert_near(omega_dps, [0.0, 0.0, number(&expect, "gz_radps") * DEG_PER_RAD], 1e-9);
    // The vector states 9.8046875, which is 0x09CE / 256; its frame holds 0x09CF.
    assert_near(force, [0.0, 0.0, number(&expect, "az")], 1.0 / 256.0);
    assert_near(force, [0.0, 0.0, f64::from(0x09CF) / 256.0], 0.0);
    let wraps_after_us = Some(1 << 32);
    assert_eq!(reading.device_time, Some(DeviceTime { micros: 123_456, wraps_after_us }));
    let (_, _, reading) = one_reading("xsens-mti-can-100us", &frames);
    let wraps_after_us = Some(100 << 32);
    assert_eq!(reading.device_time, Some(DeviceTime { micros: 12_345_600, wraps_after_us }));
    assert_eq!(one_reading("xsens-mti-can-no-time", &frames[1..]).2.device_time, None);

    // The counter wraps, repeats, loses two, and starts again.
    let mut decoder = CanMapDecoder::new(&ready("xsens-mti-can"));
    for count in [65_534_u16, 65_535, 0, 0, 3, 4, 4 + 40_000] {
        push(&mut decoder, &[(6, false, count.to_be_bytes().to_vec())]);
    }
    assert_eq!((decoder.counters().missing, decoder.counters().packets), (2, 7));
}

#[test]
fn a_message_that_never_comes_is_named_once_others_have_come() {
    let mut decoder = CanMapDecoder::new(&ready("xsens-mti-can"));
    let silent =
        "not one frame came of RateOfTurn (0x032), SampleTime (0x005): no sample is complete without";
    for k in 0..20 {
        assert!(k == 0 || !decoder.notes().iter().any(|note| note.starts_with("not one")), "{k}");
        assert!(push(&mut decoder, &[(52, false, vec![0; 6])]).is_empty());
    }
    assert!(decoder.notes().iter().any(|note| note == silent), "{:?}", decoder.notes());
    assert_eq!(decoder.counters().lone_halves, 20);
}

/// SBG frames with the time of sample `k`, 10 ms each; the counter of the device wraps at 2^32 µs.
fn sbg_sample(k: u32) -> Vec<(u32, bool, Vec<u8>)> {
    let time = u32::MAX.wrapping_sub(50_000).wrapping_add(k * 10_000);
    let info = [&time.to_le_bytes()[..], &[0; 4]].concat();
    let vector = |z: i16| [&[0; 4][..], &z.to_le_bytes()].concat();
    vec![(0x120, false, info), (0x121, false, vector(981)), (0x122, false, vector(1000 + k as i16))]
}

#[test]
fn device_time_wraps_and_shows_losses_where_nothing_counts() {
    let mut decoder = CanMapDecoder::new(&ready("sbg"));
    let kept = (0..40).filter(|k| !matches!(k, 20 | 21));
    let readings: Vec<_> = kept.flat_map(|k| push(&mut decoder, &sbg_sample(k))).collect();
    assert_eq!((readings.len(), decoder.counters().missing, decoder.counters().lone_halves), (38, 2, 0));
    assert!((readings[0].omega_imu.z - 1.0).abs() < 1e-12);
    let micros: Vec<u64> = readings.iter().map(|reading| reading.device_time.unwrap().micros).collect();
    assert!(micros[0] > micros[10], "it wraps");
    assert_eq!(readings[0].device_time.unwrap().wraps_after_us, Some(1 << 32));
}

#[test]
fn frames_without_the_others_of_their_sample_are_lone() {
    let mut decoder = CanMapDecoder::new(&ready("sbg"));
    let mut frames: Vec<_> = (0..3).flat_map(sbg_sample).collect();
    frames.remove(4); // of the second sample, the specific force
    assert_eq!(push(&mut decoder, &frames).len(), 2);
    assert_eq!(decoder.counters().lone_halves, 2);
    push(&mut decoder, &sbg_sample(3)[..2]);
    decoder.rejoin();
    assert_eq!(
        push(&mut decoder, &sbg_sample(4)[2..]).len(),
        0,
        "the halves of two connections are not joined"
    );
    push(&mut decoder, &sbg_sample(5)[..1]);
    decoder.finish(&mut |_| panic!("nothing is whole"));
    assert_eq!(decoder.counters().lone_halves, 2 + 3 + 1);
}

#[test]
fn short_frames_and_foreign_traffic_are_counted_and_passed_over() {
    let mut decoder = CanMapDecoder::new(&ready("sbg"));
    let mut frames = sbg_sample(0);
    frames[1].2.truncate(5);
    frames.extend(sbg_sample(1));
    frames.insert(0, (0x121, true, vec![0; 6])); // a 29-bit identifier is another one
    frames.insert(0, (0x7FF, false, vec![0; 8]));
    assert_eq!(push(&mut decoder, &frames).len(), 1);
    let counters = decoder.counters();
    assert_eq!((counters.unknown, counters.packets, counters.lone_halves), (1, 5, 2));
    assert!(decoder.notes().iter().any(|note| note.starts_with("1 frames were too short")));
    decoder.push(Traffic::Bytes(b"text"), &mut |_| panic!("no frame"));
    assert_eq!(decoder.counters().bytes_skipped, 4);
}

#[test]
fn a_float_that_is_no_number_is_not_given_out() {
    let (mut frames, _) = vector("racelogic-imu04/constructed");
    frames[2].2[..4].copy_from_slice(&f32::NAN.to_be_bytes());
    let mut decoder = CanMapDecoder::new(&ready("racelogic-imu04"));
    assert!(push(&mut decoder, &frames).is_empty());
    assert_eq!((decoder.counters().device_errors, decoder.counters().lone_halves), (1, 3));
}

/// Our own frames: the generic decoder, by the DBC file, gives what the native one gives.
#[test]
fn our_own_frames_read_as_the_native_decoder_reads_them() {
    let ids = Ids::of_node(0).unwrap();
    let frame = |message: CanMessage| {
        let (id, data) = ids.frame(&message);
        (u32::from(id), false, data.to_vec())
    };
    let ranges = Ranges { gyro_range_dps: 500, accel_range_g: 4, rate_hz: 1000 };
    let mut frames = vec![frame(CanMessage::Ranges(ranges))];
    for k in 0..2000_u32 {
        let tick = (k * 100) as u16;
        let xyz = [k as i16, (k * 31) as i16, (k * 977) as i16];
        if k % 97 != 5 {
            frames.push(frame(CanMessage::Gyro(HalfSample { xyz, tick })));
        }
        if k % 89 != 7 {
            frames.push(frame(CanMessage::Accel(HalfSample { xyz: [xyz[2], xyz[0], xyz[1]], tick })));
        }
    }
    let mut generic = CanMapDecoder::new(&ready("otolith-can"));
    let found = push(&mut generic, &frames);
    let mut native = NativeCanDecoder::new(Some(0));
    let mut expected = Vec::new();
    for (id, extended, data) in &frames {
        let traffic = Traffic::CanFrame { id: *id, extended: *extended, data };
        native.push(traffic, &mut |reading| expected.push(reading));
    }
    assert!(expected.len() > 1900);
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(&expected) {
        // The factors in the DBC file are rounded; that of the specific force is 1.0e-6 of itself too small.
        assert!((found.omega_imu - expected.omega_imu).norm() < 1e-7);
        let [found_force, force] = [found, expected].map(|reading| reading.specific_force_imu.unwrap());
        assert!((found_force - force).norm() < 1.1e-6 * force.norm().max(1.0));
        let [found_us, expected_us] = [found, expected].map(|reading| reading.device_time.unwrap().micros);
        assert_eq!(found_us, expected_us % 655_360);
        assert_eq!(found.clipped, expected.clipped);
    }
    assert_eq!(generic.counters().lone_halves, frames.len() as u64 - 1 - 2 * expected.len() as u64);
}

proptest! {
    /// No frames do harm to any ready mapping, and every frame of a mapped message is accounted for.
    #[test]
    fn no_frames_do_harm(
        frames in prop::collection::vec((0..32_usize, any::<u32>(), prop::collection::vec(any::<u8>(), 0..=8), 0..3_u8), 0..200),
        map in 0..CAN_MAPS.len(),
    ) {
        let map = ready(CAN_MAPS[map].name);
        let messages: Vec<_> = map.messages().collect();
        let mut decoder = CanMapDecoder::new(&map);
        let mut readings = 0;
        for (which, id, data, kind) in &frames {
            let message = messages[which % messages.len()];
            let data = if *kind == 0 { [&data[..], &[0; 8]].concat()[..message.size].to_vec() } else { data.clone() };
            let (id, extended) = if *kind == 2 { (*id, id % 2 == 0) } else { (message.id, message.extended) };
            decoder.push(Traffic::CanFrame { id, extended, data: &data }, &mut |reading| {
                assert!(reading.omega_imu.iter().all(|value| value.is_finite()));
                readings += 1;
            });
        }
        decoder.finish(&mut |_| readings += 1);
        let counters = decoder.counters();
        prop_assert!(counters.packets + counters.bad_checksum + counters.unknown <= frames.len() as u64);
        let parts = messages.iter().filter(|message| message.required).count() as u64;
        prop_assert!(readings * parts + counters.lone_halves + counters.device_errors <= counters.packets);
    }
}
