//! OpenIMU: packets of real captures, and the captures.

use nalgebra::Vector3;
use otolith::device::Traffic;
use otolith::device::protocol::detect::{AutoDecoder, Bus};
use otolith::device::protocol::openimu::OpenImuDecoder;
use otolith::device::protocol::{DecodeCounters, ImuReading, PacketDecoder};
use otolith::units::{RAD_PER_DEG, STANDARD_GRAVITY};

use super::{bytes_of, decode, one, three, vector};

#[test]
fn a_z1_packet() {
    let vector = vector("openimu-z1/capture");
    let mut decoder = OpenImuDecoder::new();
    let readings = decode(&mut decoder, &bytes_of(&vector));
    let [reading] = readings[..] else { panic!("one sample, not {readings:?}") };
    assert!((reading.omega_imu - three(&vector, "gyro_dps") * RAD_PER_DEG).norm() < 1e-12);
    assert!((reading.specific_force_imu.unwrap() - three(&vector, "accel_mps2")).norm() < 1e-12);
    assert_eq!(reading.device_time, None, "one packet does not tell the unit of its time");
    assert_eq!(decoder.counters(), DecodeCounters { packets: 1, ..DecodeCounters::default() });
}

#[test]
fn an_s1_packet() {
    let vector = vector("aceinna-S1/capture");
    let mut decoder = OpenImuDecoder::new();
    let readings = decode(&mut decoder, &bytes_of(&vector));
    let [reading] = readings[..] else { panic!("one sample, not {readings:?}") };
    let omega = three(&vector, "raw_gyr") * (1260.0 / 65536.0 * RAD_PER_DEG);
    let force = three(&vector, "raw_acc") * (20.0 / 65536.0 * STANDARD_GRAVITY);
    assert!((reading.omega_imu - omega).norm() < 1e-12);
    assert!((reading.specific_force_imu.unwrap() - force).norm() < 1e-12);
    assert!((force.z / STANDARD_GRAVITY - one(&vector, "az_g")).abs() < 1e-9);
}

#[test]
fn a_type_in_the_other_case_or_with_a_wrong_checksum_is_no_sample() {
    let good = bytes_of(&vector("openimu-z1/capture"));
    let mut damaged = good.clone();
    damaged[20] ^= 4;
    let mut decoder = OpenImuDecoder::new();
    assert_eq!(decode(&mut decoder, &[damaged, good.clone()].concat()).len(), 1);
    let counters = decoder.counters();
    assert_eq!((counters.packets, counters.bad_checksum, counters.bytes_skipped), (1, 1, 47));

    // The same packet called Z1 (0x5A31), with a checksum made for it.
    let mut decoder = OpenImuDecoder::new();
    assert!(decode(&mut decoder, &packet(b"Z1", &good[5..45])).is_empty());
    assert_eq!(decoder.counters(), DecodeCounters { packets: 1, unknown: 1, ..DecodeCounters::default() });
}

/// A packet with its checksum.
fn packet(kind: &[u8; 2], payload: &[u8]) -> Vec<u8> {
    let checked = [&kind[..], &[payload.len() as u8], payload].concat();
    let crc = checked.iter().fold(0x1D0F_u16, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| crc << 1 ^ if crc >= 0x8000 { 0x1021 } else { 0 })
    });
    [&[0x55, 0x55][..], &checked, &crc.to_be_bytes()].concat()
}

const ACCELERATION: [f32; 3] = [0.5, -0.25, 9.75];
const RATE: [f32; 3] = [5.0, -10.0, 30.0];

/// Every type with samples at `k` hundredths of a second, its fields in the order of the vendor's `openimu.json` and
/// `dmu.json` (python-openimu). `unit` is that of an acceleration whose unit differs between versions, m/s².
fn packets_of_all_types(k: u32, unit: f32) -> [(&'static [u8; 2], Vec<u8>); 9] {
    let floats =
        |groups: &[[f32; 3]]| groups.concat().into_iter().flat_map(f32::to_le_bytes).collect::<Vec<_>>();
    let time = [&(10 * k).to_le_bytes()[..], &(f64::from(k) * 0.01).to_le_bytes()].concat();
    let other = [7.0; 3];
    let (force, maybe_g) = (ACCELERATION, ACCELERATION.map(|value| value / unit));
    let states = vec![1; 3];
    let tilt = [7.0_f32; 2].map(f32::to_le_bytes).concat();
    let position = [7.0_f64; 3].map(f64::to_le_bytes).concat();
    // Rates of 1260/65536 deg/s and accelerations of 20 g / 65536.
    let whole = |values: [f32; 3], lsb: f64| {
        values.map(|value| ((f64::from(value) / lsb).round() as i16).to_be_bytes()).concat()
    };
    let accelerometer = whole(force, 20.0 * STANDARD_GRAVITY / 65536.0);
    let gyroscope = whole(RATE, 1260.0 / 65536.0);
    let angles = [7; 6];
    let ms = (10 * k).to_be_bytes();
    let ticks = ((655 * k) as u16).to_be_bytes();
    [
        (b"s1", [time.clone(), floats(&[maybe_g, RATE, other]), 25f32.to_le_bytes().to_vec()].concat()),
        (b"a1", [time.clone(), tilt, floats(&[RATE, force]), states.clone()].concat()),
        (b"a2", [time.clone(), floats(&[other, RATE, force])].concat()),
        (b"e1", [time.clone(), floats(&[other, maybe_g, RATE, other, other]), states.clone()].concat()),
        (
            b"e2",
            [time, floats(&[other, maybe_g, other, RATE, other, other, other]), position, states].concat(),
        ),
        (b"S0", [&accelerometer[..], &gyroscope, &[7; 14], &ticks, &[0; 2]].concat()),
        (b"S1", [&accelerometer[..], &gyroscope, &[7; 8], &ticks, &[0; 2]].concat()),
        (b"A1", [&angles[..], &gyroscope, &accelerometer, &[7; 8], &ms, &[0; 2]].concat()),
        (b"A2", [&angles[..], &gyroscope, &accelerometer, &[7; 6], &ms, &[0; 2]].concat()),
    ]
}

#[test]
fn every_type_with_samples_gives_the_same_sample() {
    for unit in [1.0, STANDARD_GRAVITY as f32] {
        for index in 0..9 {
            let of = |k| {
                let (kind, payload) = &packets_of_all_types(k, unit)[index];
                (packet(kind, payload), kind.escape_ascii().to_string())
            };
            let mut decoder = OpenImuDecoder::new();
            let readings = decode(&mut decoder, &(0..30).flat_map(|k| of(k).0).collect::<Vec<_>>());
            let name = of(0).1;
            let expected = DecodeCounters { packets: 30, ..DecodeCounters::default() };
            assert_eq!((readings.len(), decoder.counters()), (30, expected), "{name}");
            let (omega, force) = (Vector3::from(RATE).cast(), Vector3::from(ACCELERATION).cast::<f64>());
            let times: Vec<u64> =
                readings.iter().map(|reading| reading.device_time.unwrap().micros).collect();
            assert!(
                times.windows(2).all(|pair| pair[1].abs_diff(pair[0] + 10_000) < 10),
                "{name}: {times:?}"
            );
            for reading in readings {
                assert!((reading.omega_imu / RAD_PER_DEG - omega).amax() < 0.01, "{name}: {reading:?}");
                assert!((reading.specific_force_imu.unwrap() - force).amax() < 0.002, "{name}: {reading:?}");
            }
            let says_unit = decoder.notes().iter().any(|note| note.contains("documented in g"));
            assert_eq!(says_unit, ["s1", "e1", "e2"].contains(&name.as_str()), "{name}");
        }
    }
}

#[test]
fn of_two_types_one_is_used_and_other_lengths_and_refusals_are_no_samples() {
    let types = packets_of_all_types(3, 1.0);
    let refusal = packet(&[0x15, 0x15], b"uP");
    let changed = packet(b"a2", &types[2].1[..40]);
    let stream =
        [packet(types[2].0, &types[2].1), packet(types[5].0, &types[5].1), refusal, changed].concat();
    let mut decoder = OpenImuDecoder::new();
    assert_eq!(decode(&mut decoder, &stream).len(), 1);
    let expected = DecodeCounters { packets: 4, unknown: 1, device_errors: 1, ..DecodeCounters::default() };
    assert_eq!(decoder.counters(), expected);
    let notes = decoder.notes().join("\n");
    assert!(
        notes.contains("1 packets of other types") && notes.contains("refused the command uP"),
        "{notes}"
    );
}

/// A capture through the decoder that is found for it, in pieces of 64 bytes.
fn capture(name: &str) -> Option<(Vec<ImuReading>, AutoDecoder)> {
    let path = format!("{}/../shared/imu-logs/serial_raw/{name}", env!("CARGO_MANIFEST_DIR"));
    let bytes = match std::fs::read(&path) {
        Ok(bytes) => bytes,
        Err(error) if std::env::var_os("CI").is_some() => panic!("{path}: {error}"),
        Err(_) => {
            crate::say_skipped("../shared is not here");
            return None;
        }
    };
    let mut decoder = AutoDecoder::on(&[Bus::Serial, Bus::Can]);
    let mut readings = Vec::new();
    for piece in bytes.chunks(64) {
        decoder.push(Traffic::Bytes(piece), &mut |reading| readings.push(reading));
    }
    decoder.finish(&mut |reading| readings.push(reading));
    assert_eq!(decoder.protocol(), "openimu");
    Some((readings, decoder))
}

fn mean(values: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let (count, sum) = values.fold((0.0, Vector3::zeros()), |(count, sum), value| (count + 1.0, sum + value));
    sum / count
}

#[test]
fn a_capture_of_z1_matches_its_provenance() {
    let Some((readings, decoder)) = capture("openimu_z1.raw") else { return };
    let expected = DecodeCounters { packets: 2127, unfinished_bytes: 31, ..DecodeCounters::default() };
    assert_eq!((readings.len(), decoder.counters()), (2127, expected));
    let times: Vec<u64> = readings.iter().map(|reading| reading.device_time.unwrap().micros).collect();
    assert_eq!((times[0], times[2126]), (23_584_908, 44_826_451));
    assert!(times.windows(2).all(|pair| (9_956..=10_034).contains(&(pair[1] - pair[0]))));
    assert!(decoder.notes()[0].contains("documented in ms"), "{:?}", decoder.notes());
    let fastest =
        readings.iter().fold(Vector3::zeros(), |most: Vector3<f64>, r| most.sup(&r.omega_imu.abs()));
    assert!((fastest / RAD_PER_DEG - Vector3::new(121.3, 398.6, 107.9)).amax() < 0.05, "{fastest}");
    let norm = readings.iter().map(|r| r.specific_force_imu.unwrap().norm()).sum::<f64>() / 2127.0;
    assert!((norm - 9.83).abs() < 0.01, "{norm}");
}

#[test]
fn a_capture_of_s1_matches_its_provenance() {
    let Some((readings, decoder)) = capture("openimu_Scale1.raw") else { return };
    let expected = DecodeCounters { packets: 1002, ..DecodeCounters::default() };
    assert_eq!((readings.len(), decoder.counters()), (1002, expected));
    let force = mean(readings.iter().map(|reading| reading.specific_force_imu.unwrap()));
    let counts = force / STANDARD_GRAVITY * (65536.0 / 20.0);
    assert!((counts - Vector3::new(-30.4, 21.8, 3272.1)).amax() < 0.05, "{counts}");
    let counts = mean(readings.iter().map(|reading| reading.omega_imu)) / RAD_PER_DEG * (65536.0 / 1260.0);
    assert!((counts - Vector3::new(-1.4, -4.9, -1.4)).amax() < 0.05, "{counts}");
    // 3276.8 units of 1/65536 s are 50 ms; rounding down makes it a microsecond less now and then.
    let times: Vec<_> = readings.iter().map(|reading| reading.device_time.unwrap()).collect();
    assert!(times.iter().all(|time| time.wraps_after_us == Some(1_000_000)));
    let steps: Vec<u64> =
        times.windows(2).map(|pair| (1_000_000 + pair[1].micros - pair[0].micros) % 1_000_000).collect();
    assert!(steps.iter().all(|step| (49_980..=50_010).contains(step)), "{steps:?}");
    assert_eq!(times.windows(2).filter(|pair| pair[1].micros < pair[0].micros).count(), 50, "wraps");
}
