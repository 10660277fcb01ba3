//! What recordings at hand do not show. Frames of the vendor's document and captures: `tests/it`.

use super::*;
use crate::device::protocol::xbus::frame::message;

/// An item of MTData2.
fn item(id: u16, data: &[u8]) -> Vec<u8> {
    [&id.to_be_bytes()[..], &[data.len() as u8], data].concat()
}

fn floats(id: u16, values: [f32; 3]) -> Vec<u8> {
    item(id, &values.map(f32::to_be_bytes).concat())
}

/// Packet counter and time, then other items.
fn packet(counter: u16, ticks: u32, items: &[Vec<u8>]) -> Vec<u8> {
    let head = [item(0x1020, &counter.to_be_bytes()), item(0x1060, &ticks.to_be_bytes())];
    message(frame::MT_DATA2, &[head.concat(), items.concat()].concat())
}

fn sample(counter: u16, ticks: u32) -> Vec<u8> {
    packet(counter, ticks, &[floats(0x4020, [0.0, 0.0, 9.8]), floats(0x8020, [0.0, 0.0, 1.0])])
}

fn decode(messages: &[Vec<u8>]) -> (Vec<ImuReading>, XbusDecoder) {
    let (mut decoder, mut readings) = (XbusDecoder::new(), Vec::new());
    decoder.push(Traffic::Bytes(&messages.concat()), &mut |reading| readings.push(reading));
    decoder.finish(&mut |reading| readings.push(reading));
    (readings, decoder)
}

#[test]
fn loss_is_counted_over_all_packets_and_not_where_the_device_starts_anew() {
    let gnss = |counter, ticks| packet(counter, ticks, &[item(0x7010, &[0; 94])]);
    let (readings, decoder) = decode(&[
        sample(65_533, 100_000),
        gnss(65_534, 75_000),
        sample(1, 100_200), // 65535 and 0 are missing
        sample(1, 100_300), // sent twice
        sample(2, 100_400),
        sample(9_000, 500), // switched off and on
        sample(9_001, 600),
        message(frame::WAKE_UP, &[]),
        sample(20_000, 700),
    ]);
    assert_eq!((readings.len(), decoder.counters().missing), (7, 2));
    let times: Vec<_> = readings.iter().filter_map(|reading| reading.device_time).collect();
    assert_eq!((times[1].micros - times[0].micros, times.len()), (20_000, 7));
}

#[test]
fn without_a_packet_counter_loss_is_seen_in_the_time() {
    let at = |ticks: u32| {
        let items = [item(0x1060, &ticks.to_be_bytes()), floats(0x4020, [0.0; 3]), floats(0x8020, [0.0; 3])];
        message(frame::MT_DATA2, &items.concat())
    };
    let times = (0..40).chain(43..60).map(|k| at(100 * k));
    let (readings, decoder) = decode(&times.collect::<Vec<_>>());
    assert_eq!((readings.len(), decoder.counters().missing), (57, 3));
}

#[test]
fn every_number_format_and_the_high_rate_items_give_the_same_sample() {
    let fixed = |value: f64| ((value * f64::from(1 << 20)) as i32).to_be_bytes().to_vec();
    let long = |value: f64| {
        let whole = (value * 4_294_967_296.0) as i64;
        [&(whole as u32).to_be_bytes()[..], &((whole >> 32) as i16).to_be_bytes()].concat()
    };
    let double = |value: f64| value.to_be_bytes().to_vec();
    let expected = ([0.5, -2.25, 1.0], [-0.125, 9.75, 3.0]);
    let write = |id: u16, values: [f64; 3]| {
        let number = |value: f64| match id & 3 {
            0 => (value as f32).to_be_bytes().to_vec(),
            1 => fixed(value),
            2 => long(value),
            _ => double(value),
        };
        item(id, &values.map(number).concat())
    };
    // The upper two of the lowest four bits are the axes of orientations.
    for (gyro, accelerometer) in [
        (0x8020, 0x4020),
        (0x8021, 0x4021),
        (0x8022, 0x4022),
        (0x8023, 0x4023),
        (0x8040, 0x4040),
        (0x802F, 0x4026),
    ] {
        let items = [write(accelerometer, expected.1), write(gyro, expected.0)];
        let (readings, _) = decode(&[packet(0, 0, &items)]);
        assert_eq!(readings.len(), 1, "{gyro:04x}");
        assert_eq!(readings[0].omega_imu, Vector3::from(expected.0), "{gyro:04x}");
        assert_eq!(readings[0].specific_force_imu, Some(Vector3::from(expected.1)), "{gyro:04x}");
    }
}

#[test]
fn only_axes_of_accelerometer_and_gyroscope_count_as_clipped() {
    for (word, clipped) in
        [(0u32, false), (1 << 8, true), (1 << 13, true), (1 << 14, false), (1 << 19, false)]
    {
        let items = [floats(0x4020, [0.0; 3]), floats(0x8020, [0.0; 3]), item(0xE020, &word.to_be_bytes())];
        assert_eq!(decode(&[packet(0, 0, &items)]).0[0].clipped, clipped, "{word:08x}");
    }
}

#[test]
fn a_length_of_two_bytes_is_read() {
    let items = [sample(0, 0)[4..sample(0, 0).len() - 1].to_vec(), item(0x7020, &[7; 250])].concat();
    let mut bytes = vec![0xFA, 0xFF, frame::MT_DATA2, 0xFF];
    bytes.extend_from_slice(&(items.len() as u16).to_be_bytes());
    bytes.extend_from_slice(&items);
    let sum = bytes[1..].iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    bytes.push(0u8.wrapping_sub(sum));
    let (readings, decoder) = decode(&[bytes, sample(1, 100)]);
    assert_eq!((readings.len(), decoder.counters().bytes_skipped), (2, 0));
}

#[test]
fn what_is_no_sample_is_said_in_words() {
    let without = |items: &[Vec<u8>]| decode(&[packet(0, 0, items)]);
    let omega = floats(0x8020, [0.0, 0.0, 1.0]);
    let (readings, decoder) = without(&[omega.clone(), floats(0x4030, [0.0; 3])]);
    assert_eq!(readings[0].specific_force_imu, None);
    assert!(decoder.notes()[0].contains("gravity is removed"), "{:?}", decoder.notes());
    let (_, decoder) = without(&[omega, floats(0x4010, [0.0; 3])]);
    assert!(decoder.notes()[0].contains("velocity increments (4010) only"), "{:?}", decoder.notes());
    let (readings, decoder) = without(&[item(0x8030, &[0; 16]), floats(0x4020, [0.0; 3])]);
    assert_eq!((readings.len(), decoder.counters().lone_halves), (0, 1));
    assert!(decoder.notes()[0].contains("orientation increments (8030) only"), "{:?}", decoder.notes());

    let (_, decoder) = decode(&[message(frame::ERROR, &[0x1E]), message(frame::MT_DATA, &[0; 50])]);
    assert_eq!((decoder.counters().device_errors, decoder.counters().unknown), (1, 1));
    assert!(decoder.notes()[0].contains("error 0x1e: timer overflow"), "{:?}", decoder.notes());
    assert!(decoder.notes()[1].contains("MTData2"), "{:?}", decoder.notes());
}

#[test]
fn values_that_are_no_numbers_are_given_out_as_they_are() {
    let items = [floats(0x4020, [0.0; 3]), floats(0x8020, [f32::NAN, 0.0, 0.0])];
    let (readings, decoder) = decode(&[packet(0, 0, &items)]);
    assert_eq!((readings.len(), decoder.counters().unknown, decoder.counters().packets), (1, 0, 1));
}

#[test]
fn packets_that_are_overtaken_are_no_loss() {
    let packets: Vec<_> = [0, 1, 3, 2, 4, 7].map(|k| sample(k, 100 * u32::from(k))).to_vec();
    let (_, decoder) = decode(&packets);
    assert_eq!(decoder.counters().missing, 2, "5 and 6 alone");
}

#[test]
fn a_damaged_length_does_not_hold_up_what_follows() {
    let mut decoder = XbusDecoder::new();
    let mut readings = 0;
    let mut hurt = sample(0, 0);
    hurt[3] = 0xF0;
    // Two good packets are less than the damaged length, and both come out.
    for bytes in [hurt, sample(1, 100), sample(2, 200)] {
        decoder.push(Traffic::Bytes(&bytes), &mut |_| readings += 1);
    }
    assert_eq!((readings, decoder.counters().bad_checksum), (2, 1));
}

/// Lengths from the vendor's document: filter profiles are 22 bytes each (type, version, 20 letters), settings of a
/// synchronisation line 12.
#[test]
fn long_answers_to_commands_are_messages() {
    let answers = [
        message(0x0D, &[0; 118]),
        message(0xC1, &[0x10, 0x20, 0xFF, 0xFF].repeat(32)),
        message(0x63, &[7; 22].repeat(5)),
        message(0x2D, &[7; 12].repeat(10)),
    ];
    let stream = [&answers[..], &[sample(0, 0)]].concat();
    let (readings, decoder) = decode(&stream);
    let counters = decoder.counters();
    assert_eq!((readings.len(), counters.packets, counters.bytes_skipped), (1, 5, 0));
}

/// UtcTime as the vendor's document lays it out: nanoseconds, year, month, day, hour, minute, second, flags.
#[test]
fn utc_dates_samples_that_have_no_other_time() {
    let utc = |ms: u32, second: u8| {
        let time =
            [&(ms * 1_000_000).to_be_bytes()[..], &2026_u16.to_be_bytes(), &[11, 22, 23, 59, second, 7]];
        item(0x1010, &time.concat())
    };
    let motion = [floats(0x4020, [0.0; 3]), floats(0x8020, [0.0; 3])].concat();
    let packet = |time: Vec<u8>| message(frame::MT_DATA2, &[time, motion.clone()].concat());
    let (readings, _) = decode(&[packet(utc(990, 58)), packet(utc(0, 59)), packet(utc(10, 59))]);
    let times: Vec<_> = readings.iter().filter_map(|reading| reading.device_time).collect();
    // 2026-11-22 is day 9822 from 2000-01-01 on.
    let day_us = 86_400_000_000;
    assert_eq!(times[0], DeviceTime { micros: 9823 * day_us - 1_010_000, wraps_after_us: None });
    assert_eq!([1, 2].map(|k| times[k].micros_since(times[k - 1])), [10_000, 10_000]);
    let both = [utc(990, 58), item(0x1060, &[0, 0, 0, 7])].concat();
    assert_eq!(decode(&[packet(both)]).0[0].device_time.map(|time| time.micros), Some(700));
}
