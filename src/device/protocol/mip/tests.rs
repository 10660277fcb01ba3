//! What recordings at hand do not show. Frames of the vendor's document and captures: `tests/it`.

use super::*;

/// A packet of several fields, its checksum made right.
fn packet(set: u8, fields: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let one = |(descriptor, data): &(u8, Vec<u8>)| {
        let frame = frame::packet(set, *descriptor, data);
        frame[4..frame.len() - 2].to_vec()
    };
    let payload: Vec<u8> = fields.iter().flat_map(one).collect();
    let mut bytes = vec![0x75, 0x65, set, payload.len() as u8];
    bytes.extend_from_slice(&payload);
    let (mut sum, mut sum_of_sums) = (0u8, 0u8);
    for byte in &bytes {
        sum = sum.wrapping_add(*byte);
        sum_of_sums = sum_of_sums.wrapping_add(sum);
    }
    bytes.extend_from_slice(&[sum, sum_of_sums]);
    bytes
}

fn floats(descriptor: u8, values: [f32; 3]) -> (u8, Vec<u8>) {
    (descriptor, values.map(f32::to_be_bytes).concat())
}

fn motion() -> [(u8, Vec<u8>); 2] {
    [floats(0x04, [0.0, 0.0, -1.0]), floats(0x05, [0.0, 0.5, 0.0])]
}

fn sample_at(micros: u64) -> Vec<u8> {
    let time = (0xD5, (1000 * micros).to_be_bytes().to_vec());
    packet(0x80, &[&[time][..], &motion()].concat())
}

fn decode(packets: &[Vec<u8>]) -> (Vec<ImuReading>, MipDecoder) {
    let (mut decoder, mut readings) = (MipDecoder::new(), Vec::new());
    decoder.push(Traffic::Bytes(&packets.concat()), &mut |reading| readings.push(reading));
    decoder.finish(&mut |reading| readings.push(reading));
    (readings, decoder)
}

#[test]
fn loss_is_seen_in_the_reference_time() {
    let packets: Vec<_> = (0..30).chain(34..60).map(|k| sample_at(8_000 * k)).collect();
    let (readings, decoder) = decode(&packets);
    assert_eq!((readings.len(), decoder.counters().missing), (56, 4));
    assert_eq!(readings[1].device_time, Some(DeviceTime { micros: 8_000, wraps_after_us: None }));
    assert_eq!(readings[0].specific_force_imu, Some(Vector3::new(0.0, 0.0, -9.80665)));
}

#[test]
fn gps_time_serves_where_there_is_no_reference_time() {
    let time = |descriptor: u8, of_week_s: f64, flags: u16| {
        let data = [&of_week_s.to_be_bytes()[..], &2300u16.to_be_bytes(), &flags.to_be_bytes()].concat();
        let (readings, _) = decode(&[packet(0x80, &[&[(descriptor, data)][..], &motion()].concat())]);
        readings[0].device_time.map(|time| time.micros)
    };
    let expected = 2300 * 604_800_000_000 + 12_500_000;
    assert_eq!(time(0xD3, 12.5, 3), Some(expected));
    assert_eq!(time(0xD3, 12.5, 2), None, "flagged as not valid");
    assert_eq!(time(0x12, 12.5, 0), Some(expected));
    assert_eq!((time(0x12, f64::NAN, 0), time(0x12, 1e9, 0)), (None, None));
}

#[test]
fn only_axes_of_accelerometer_and_gyroscope_count_as_clipped() {
    for (flags, clipped) in [(0u16, false), (1, true), (0x40, true), (0x100, false), (0x1000, false)] {
        let flags = (0x18, flags.to_be_bytes().to_vec());
        let (readings, _) = decode(&[packet(0x80, &[&motion()[..], std::slice::from_ref(&flags)].concat())]);
        assert_eq!(readings[0].clipped, clipped, "{flags:?}");
    }
}

#[test]
fn refusals_and_sets_that_are_not_documented_are_counted_and_said() {
    let (readings, decoder) = decode(&[
        packet(0x0C, &[(0xF1, vec![0x0F, 0x03])]),
        packet(0x0C, &[(0xF1, vec![0x0F, 0x00])]),
        packet(0x82, &[(0x05, vec![0; 14])]),
        packet(0x55, &[(0x01, vec![1, 2])]),
        packet(0x80, &[floats(0x07, [0.0; 3])]),
    ]);
    let counters = decoder.counters();
    assert_eq!((readings.len(), counters.packets, counters.unknown, counters.device_errors), (0, 5, 1, 1));
    let notes = decoder.notes().join("\n");
    for part in ["refused command 0C/0F: 0x03, parameter not valid", "increments (07, 08) only"] {
        assert!(notes.contains(part), "{part} is missing in: {notes}");
    }
    let (_, decoder) = decode(&[packet(0x82, &[(0x05, vec![0; 14])])]);
    assert!(decoder.notes()[0].contains("estimates of the filter (set 82) only"), "{:?}", decoder.notes());
}

#[test]
fn a_damaged_length_does_not_hold_up_what_follows() {
    let mut decoder = MipDecoder::new();
    let mut readings = 0;
    let mut hurt = sample_at(0);
    hurt[3] = 0xF0;
    for bytes in [hurt, sample_at(8_000), sample_at(16_000)] {
        decoder.push(Traffic::Bytes(&bytes), &mut |_| readings += 1);
    }
    assert_eq!((readings, decoder.counters().bad_checksum), (2, 1));
}
