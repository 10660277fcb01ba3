use std::path::Path;
use std::time::Duration;

use nalgebra::Vector3;
use otolith_firmware_protocol::can::{HalfSample, Health, Time};

use super::*;
use crate::device::replay;
use crate::device::testing::{from_hex, golden_frames};

const RANGES: CanMessage =
    CanMessage::Ranges(Ranges { gyro_range_dps: 500, accel_range_g: 4, rate_hz: 1000 });

fn push(decoder: &mut NativeCanDecoder, id: u32, data: &[u8]) -> Vec<ImuReading> {
    let mut readings = Vec::new();
    decoder.push(Traffic::CanFrame { id, extended: false, data }, &mut |reading| readings.push(reading));
    readings
}

fn say(decoder: &mut NativeCanDecoder, node: u8, message: CanMessage) -> Vec<ImuReading> {
    let (id, data) = Ids::of_node(node).expect("fits").frame(&message);
    push(decoder, id.into(), &data)
}

fn half(z: i16, tick: u16) -> HalfSample {
    HalfSample { xyz: [0, 0, z], tick }
}

#[test]
fn the_golden_frames_give_the_stated_values() {
    let golden = golden_frames();
    let frames: Vec<(u32, Vec<u8>)> = golden["can"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|frame| {
            let id = u32::try_from(frame["id"].as_u64().expect("an id")).expect("11 bits");
            (id, from_hex(frame["data"].as_str().expect("a string")))
        })
        .collect();
    let mut decoder = NativeCanDecoder::new(Some(0));
    // The samples stand before the DESC that scales them: the second round gives them.
    for (id, data) in &frames {
        assert!(push(&mut decoder, *id, data).is_empty());
    }
    assert_eq!((decoder.withheld(), decoder.counters().packets), (1, frames.len() as u64));
    assert_eq!(decoder.announced_rate_hz(), Some(1000.0));
    let device = decoder.device().expect("has described itself");
    assert_eq!((device.device_id, device.firmware), (Some(0x00C0_FFEE), Some(0x0102)));
    assert!((device.gyro_range.expect("announced") - 500.0 * RAD_PER_DEG).abs() < 1e-12);

    // The frames of now again would only be repetitions.
    assert!(push(&mut decoder, frames[0].0, &frames[0].1).is_empty());
    assert!(push(&mut decoder, frames[1].0, &frames[1].1).is_empty());
    assert_eq!(decoder.counters().repeated, 2);
    let [mut gyro, mut accel] = [frames[0].1.clone(), frames[1].1.clone()];
    for half in [&mut gyro, &mut accel] {
        half[6] ^= 1; // another tick
    }
    assert!(push(&mut decoder, frames[0].0, &gyro).is_empty());
    let [reading] = push(&mut decoder, frames[1].0, &accel)[..] else { panic!("one sample") };
    assert!((reading.omega_imu.z / RAD_PER_DEG - 59.998).abs() < 1e-3);
    let force = reading.specific_force_imu.expect("has an accelerometer");
    assert!((force - Vector3::z() * STANDARD_GRAVITY).norm() < 1e-12);
    assert!(!reading.clipped);
}

#[test]
fn the_first_node_that_describes_itself_is_followed() {
    let mut decoder = NativeCanDecoder::new(None);
    assert!(say(&mut decoder, 3, CanMessage::Gyro(half(1, 5))).is_empty());
    assert_eq!(decoder.counters().packets, 0, "nobody has described itself yet");
    say(&mut decoder, 2, RANGES);
    say(&mut decoder, 3, RANGES);
    for (node, expected) in [(3, 0), (2, 1)] {
        say(&mut decoder, node, CanMessage::Gyro(half(100, 7)));
        assert_eq!(say(&mut decoder, node, CanMessage::Accel(half(8192, 7))).len(), expected, "node {node}");
    }
}

#[test]
fn times_run_on_through_wraps_of_the_tick_and_losses_show() {
    let mut decoder = NativeCanDecoder::new(Some(0));
    say(&mut decoder, 0, RANGES);
    let mut times = Vec::new();
    // 2 s at 1 kHz, the tick wraps three times; TIME every 100 ms; every 50th ACCEL is lost.
    let (mut sent, mut lost) = (0u16, 0u64);
    for ms in 0..2000u32 {
        let tick = (ms * 100) as u16;
        say(&mut decoder, 0, CanMessage::Gyro(half(1, tick)));
        sent += 2;
        if ms % 50 == 49 {
            lost += 1;
        } else {
            times.extend(say(&mut decoder, 0, CanMessage::Accel(half(1, tick))));
        }
        if ms % 100 == 99 {
            let time = Time { time_10us: ms * 100, frames_sent: sent, status: 0 };
            say(&mut decoder, 0, CanMessage::Time(time));
        }
    }
    let micros: Vec<u64> = times.iter().filter_map(|r| r.device_time.map(|time| time.micros)).collect();
    assert_eq!(micros.len(), 2000 - 40);
    assert!(micros.windows(2).all(|pair| matches!(pair[1] - pair[0], 1000 | 2000)));
    assert_eq!(micros[micros.len() - 1] - micros[0], 1_998_000);
    // Those before the first TIME cannot be judged.
    assert_eq!(decoder.counters().missing, lost - 2);
}

#[test]
fn full_scale_is_clipped_and_drops_are_counted() {
    let mut decoder = NativeCanDecoder::new(Some(0));
    say(&mut decoder, 0, RANGES);
    for (tick, count, clipped) in [(7, i16::MAX, true), (8, i16::MIN, true), (9, i16::MAX - 1, false)] {
        say(&mut decoder, 0, CanMessage::Gyro(half(count, tick)));
        assert_eq!(say(&mut decoder, 0, CanMessage::Accel(half(0, tick)))[0].clipped, clipped);
    }
    for dropped in [65_535, 2] {
        let health = Health { temperature_centi_c: 0, dropped, tx_overrun: 0, self_test: 0 };
        say(&mut decoder, 0, CanMessage::Health(health));
    }
    assert_eq!(decoder.counters().device_dropped, 3);
}

#[test]
fn other_traffic_is_skipped() {
    let mut decoder = NativeCanDecoder::new(Some(0));
    decoder.push(Traffic::Bytes(b"text"), &mut |_| panic!("no sample"));
    decoder
        .push(Traffic::CanFrame { id: 0x3A0, extended: true, data: &[0; 8] }, &mut |_| panic!("no sample"));
    push(&mut decoder, 0x3A0, &[0; 3]);
    let counters = decoder.counters();
    assert_eq!((counters.packets, counters.bytes_skipped, counters.unknown), (0, 4, 1));
}

/// Two minutes of a car's bus, on which none of our devices is.
#[test]
fn a_real_bus_without_our_device_gives_no_sample() {
    let log =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/imu-logs/can/toyota_scion_xb_drive.candump.log");
    if !Path::new(log).exists() {
        assert!(std::env::var_os("CI").is_none(), "../shared is not here");
        println!("skipped: ../shared is not here");
        return;
    }
    let mut link = replay::open(Path::new(log), None, 0, None).expect("opens");
    let mut decoder = NativeCanDecoder::new(None);
    let mut frames = 0;
    while let Ok(Some((_, traffic))) = link.receive(Duration::ZERO) {
        frames += 1;
        decoder.push(traffic, &mut |_| panic!("no sample of ours"));
    }
    assert_eq!(link.status().bytes_skipped, 0);
    assert_eq!(decoder.counters(), DecodeCounters::default());
    let lines = std::fs::read_to_string(log).expect("readable").lines().count();
    assert_eq!(frames, lines);
}
