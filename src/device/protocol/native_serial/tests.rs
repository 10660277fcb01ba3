use otolith_firmware_protocol::message::{Batch16, Status, Sync};
use proptest::prelude::*;
use serde_json::Value;

use super::*;
use crate::device::bandwidth::check_serial;
use crate::device::testing::{from_hex, golden_frames};

const SCALE: CountScale = CountScale { gyro: 0.000_266_316_109_007_923_84, accel: 0.001_197_100_830_078_125 };

fn golden(name: &str) -> Value {
    let golden = golden_frames();
    let found = golden["serial"].as_array().and_then(|all| all.iter().find(|vector| vector["name"] == name));
    found.unwrap_or_else(|| panic!("no golden frame {name}")).clone()
}

fn frame(name: &str) -> Vec<u8> {
    from_hex(golden(name)["hex"].as_str().expect("a string"))
}

fn readings(decoder: &mut NativeSerialDecoder, bytes: &[u8]) -> Vec<ImuReading> {
    let mut readings = Vec::new();
    decoder.push(Traffic::Bytes(bytes), &mut |reading| readings.push(reading));
    readings
}

fn vector(value: &Value, scale: f64) -> Vector3<f64> {
    let numbers: Vec<f64> =
        value.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect();
    Vector3::from_row_slice(&numbers) * scale
}

#[test]
fn every_golden_frame_gives_the_stated_counts() {
    for vector in golden_frames()["serial"].as_array().expect("a list") {
        let mut decoder = NativeSerialDecoder::new();
        readings(&mut decoder, &from_hex(vector["hex"].as_str().expect("a string")));
        let (counted, expected) = (decoder.counters(), &vector["expect"]["counts"]);
        let name = &vector["name"];
        assert_eq!(counted.packets, expected["frames"].as_u64().expect("a count"), "{name}");
        let errors = expected["framing_errors"].as_u64().zip(expected["crc_errors"].as_u64());
        assert_eq!(Some(counted.bad_checksum), errors.map(|(framing, crc)| framing + crc), "{name}");
        assert_eq!(counted.missing, expected["lost"].as_u64().expect("a count"), "{name}");
        assert_eq!(counted.unknown, 0, "{name}");
    }
}

#[test]
fn golden_samples_come_out_in_si_units() {
    for name in
        ["sample16_rest", "sample16_60dps_yaw", "sample16_extremes", "sample16_seq_wrap_t_wrap", "sample_f32"]
    {
        let mut decoder = NativeSerialDecoder::new();
        assert!(readings(&mut decoder, &frame("hello")).is_empty());
        let [reading] = readings(&mut decoder, &frame(name))[..] else { panic!("{name}: one sample") };
        let expect = &golden(name)["expect"];
        let (omega, force) = match expect.get("gyro") {
            Some(gyro) => (vector(gyro, SCALE.gyro), vector(&expect["accel"], SCALE.accel)),
            None => (vector(&expect["gyro_radps"], 1.0), vector(&expect["accel_mps2"], 1.0)),
        };
        // The scales travel as f32.
        assert!((reading.omega_imu - omega).norm() < 1e-6, "{name}: {reading:?}");
        assert!((reading.specific_force_imu.expect("has one") - force).norm() < 1e-5, "{name}: {reading:?}");
        let time = reading.device_time.expect("has a clock");
        assert_eq!((Some(time.micros), time.wraps_after_us), (expect["t_us"].as_u64(), Some(1 << 32)));
        assert_eq!(reading.clipped, name == "sample16_extremes", "{name}");
    }
}

#[test]
fn a_batch_is_its_samples_at_their_times() {
    let mut decoder = NativeSerialDecoder::with_scale(SCALE);
    let batch = readings(&mut decoder, &frame("batch16x5"));
    let times: Vec<u64> =
        batch.iter().map(|reading| reading.device_time.expect("has a clock").micros).collect();
    assert_eq!(times, [5000, 6000, 7000, 8000, 9000]);
    for (i, reading) in batch.iter().enumerate() {
        let expected = Vector3::new(i as f64, 0.0, 3932.0) * SCALE.gyro;
        assert!((reading.omega_imu - expected).norm() < 1e-12);
    }
}

#[test]
fn a_batch_across_the_wrap_of_the_clock_wraps() {
    let rows = [Batch16::row([0; 3], [0; 3]); 2];
    let message = Message::Batch16(Batch16 { t_us: u32::MAX, dt_us: 1000, rows: &rows });
    let mut decoder = NativeSerialDecoder::with_scale(SCALE);
    let batch = readings(&mut decoder, encode(&message, &mut [0; MAX_FRAME]));
    let times: Vec<_> = batch.iter().map(|reading| reading.device_time.map(|time| time.micros)).collect();
    assert_eq!(times, [Some(u64::from(u32::MAX)), Some(999)]);
}

fn encode<'b>(message: &Message<'_>, buffer: &'b mut [u8; MAX_FRAME]) -> &'b [u8] {
    StreamEncoder::new().encode(message, buffer).expect("fits")
}

#[test]
fn no_sample_before_a_hello_and_nothing_is_sent() {
    let mut decoder = NativeSerialDecoder::new();
    assert!(readings(&mut decoder, &frame("sample16_rest")).is_empty());
    assert!(readings(&mut decoder, &frame("sample_f32")).is_empty());
    assert_eq!((decoder.withheld(), decoder.counters().packets), (2, 2));
    assert_eq!(decoder.poll_transmit(9_000_000, &mut [0; 64]), None);
    assert_eq!(
        (decoder.device(), decoder.announced_rate_hz(), decoder.wire_bytes_per_sample()),
        (None, None, None)
    );
}

#[test]
fn a_hello_is_kept_for_those_who_ask() {
    let mut decoder = NativeSerialDecoder::new();
    readings(&mut decoder, &frame("hello"));
    let device = decoder.device().expect("has said hello");
    assert_eq!((device.device_id, device.firmware), (Some(0x00C0_FFEE), Some(0x0102)));
    assert_eq!(device.name.as_deref(), Some("ICM42688"));
    assert!((device.gyro_range.expect("announced") - 500.0 * RAD_PER_DEG).abs() < 1e-12);
    assert_eq!(decoder.announced_rate_hz(), Some(1000.0));
}

#[test]
fn a_line_too_slow_for_the_announced_rate_is_known_from_the_hello_on() {
    let mut decoder = NativeSerialDecoder::new();
    readings(&mut decoder, &frame("hello"));
    let check = |decoder: &NativeSerialDecoder, baud| {
        let rate_hz = decoder.announced_rate_hz().expect("announced");
        check_serial(baud, rate_hz, decoder.wire_bytes_per_sample().expect("known"))
    };
    assert!(check(&decoder, 115_200).is_err(), "too slow even for full batches");
    assert!(check(&decoder, 230_400).is_ok(), "full batches would fit");
    readings(&mut decoder, &frame("sample16_rest"));
    assert_eq!(decoder.wire_bytes_per_sample(), Some(22.0));
    assert!(check(&decoder, 230_400).is_err(), "single samples do not");
    readings(&mut decoder, &frame("batch16x5"));
    assert_eq!(decoder.wire_bytes_per_sample(), Some(14.6));
    readings(&mut decoder, &frame("sample_f32"));
    assert_eq!(decoder.wire_bytes_per_sample(), Some(34.0));
}

#[test]
fn floats_at_full_scale_are_clipped() {
    let mut decoder = NativeSerialDecoder::new();
    readings(&mut decoder, &frame("hello"));
    let full = (500.0 * RAD_PER_DEG) as f32;
    for (t_us, gyro_z, clipped) in [(1, full, true), (2, 0.99 * full, false), (3, f32::INFINITY, true)] {
        let message = Message::SampleF32(SampleF32 { t_us, gyro: [0.0, 0.0, gyro_z], accel: [0.0; 3] });
        let got = readings(&mut decoder, encode(&message, &mut [0; MAX_FRAME]));
        assert_eq!(got.first().map(|reading| reading.clipped), Some(clipped), "{gyro_z}");
    }
}

#[test]
fn a_frame_that_comes_twice_is_one_and_no_loss() {
    let mut decoder = NativeSerialDecoder::new();
    readings(&mut decoder, &frame("hello"));
    decoder.rejoin();
    let (mut encoder, mut buffer) = (StreamEncoder::new(), [0; MAX_FRAME]);
    let mut frames = Vec::new();
    for t_us in [1000, 2000, 3000, 4000] {
        let sample = Message::SampleF32(SampleF32 { t_us, gyro: [0.0; 3], accel: [0.0; 3] });
        frames.push(encoder.encode(&sample, &mut buffer).expect("fits").to_vec());
    }
    let got: usize = [0, 1, 1, 3, 2].map(|k| readings(&mut decoder, &frames[k]).len()).iter().sum();
    assert_eq!(got, 3, "the repeated and the late one are not used");
    let counters = decoder.counters();
    assert_eq!((counters.missing, counters.repeated, counters.packets), (0, 2, 6));
}

#[test]
fn drops_on_the_device_are_counted_from_the_first_status_on() {
    let mut decoder = NativeSerialDecoder::new();
    readings(&mut decoder, &frame("status"));
    assert_eq!(decoder.counters().device_dropped, 0);
    let later = Status {
        t_us: 123_456_889_012,
        temperature_centi_c: 0,
        flags: 0,
        dropped: 20,
        tx_overrun: 0,
        sensor_err: 0,
    };
    readings(&mut decoder, encode(&Message::Status(later), &mut [0; MAX_FRAME]));
    assert_eq!(decoder.counters().device_dropped, 3);
}

#[test]
fn clocks_are_compared_once_a_second_after_a_hello() {
    let mut decoder = NativeSerialDecoder::new();
    readings(&mut decoder, &frame("hello"));
    let mut out = [0; 64];
    let length = decoder.poll_transmit(1_000_000, &mut out).expect("a request");
    let mut requests = Vec::new();
    StreamDecoder::new().push(&out[..length], |event| {
        if let Event::Message { message: Message::Sync(sync), .. } = event {
            requests.push(sync);
        }
    });
    assert_eq!(requests, [Sync { t1_us: 1_000_000, t2_us: 0, t3_us: 0 }]);
    assert_eq!(decoder.poll_transmit(1_500_000, &mut out), None);

    let answer = Sync { t1_us: 1_000_000, t2_us: 8_000_300, t3_us: 8_000_320 };
    readings(&mut decoder, encode(&Message::Sync(answer), &mut [0; MAX_FRAME]));
    assert_eq!(decoder.poll_transmit(1_000_620, &mut out), None);
    let best = decoder.sync_estimate().expect("answered");
    assert_eq!((best.offset_us, best.round_trip_us), (7_000_000, 600));
    assert!(decoder.poll_transmit(2_000_000, &mut out).is_some());
}

#[test]
fn a_reopened_port_costs_no_false_losses() {
    let mut decoder = NativeSerialDecoder::with_scale(SCALE);
    readings(&mut decoder, &frame("sample16_rest"));
    readings(&mut decoder, &frame("sample16_60dps_yaw")[..9]);
    decoder.rejoin();
    assert_eq!(readings(&mut decoder, &frame("sample16_extremes")).len(), 1);
    let counters = decoder.counters();
    assert_eq!((counters.packets, counters.bad_checksum, counters.missing), (2, 0, 0));
}

#[test]
fn frames_of_a_bus_are_skipped_and_counted() {
    let mut decoder = NativeSerialDecoder::new();
    decoder.push(Traffic::CanFrame { id: 1, extended: false, data: &[0; 8] }, &mut |_| panic!("no sample"));
    assert_eq!(decoder.counters().bytes_skipped, 8);
}

proptest! {
    #[test]
    fn cuts_change_nothing(cuts in proptest::collection::vec(1usize..40, 0..40)) {
        let stream: Vec<u8> =
            ["hello", "sample16_rest", "batch16x5", "stream_resync", "sample_f32", "bad_cobs", "status"]
                .into_iter().flat_map(frame).collect();
        let mut whole = NativeSerialDecoder::new();
        let expected = readings(&mut whole, &stream);
        let mut cut = NativeSerialDecoder::new();
        let (mut got, mut rest) = (Vec::new(), &stream[..]);
        for length in cuts {
            let (piece, behind) = rest.split_at(length.min(rest.len()));
            got.extend(readings(&mut cut, piece));
            rest = behind;
        }
        got.extend(readings(&mut cut, rest));
        prop_assert_eq!(got, expected);
        prop_assert_eq!(cut.counters(), whole.counters());
    }

    #[test]
    fn any_bytes_are_legal_and_the_next_frame_is_read(noise in proptest::collection::vec(any::<u8>(), 0..600)) {
        let mut decoder = NativeSerialDecoder::with_scale(SCALE);
        readings(&mut decoder, &noise);
        readings(&mut decoder, &[0]);
        prop_assert_eq!(readings(&mut decoder, &frame("sample16_rest")).len(), 1);
    }
}
