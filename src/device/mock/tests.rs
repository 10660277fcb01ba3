use nalgebra::Vector3;

use super::*;
use crate::device::protocol::native_serial::NativeSerialDecoder;
use crate::device::protocol::{ImuReading, PacketDecoder};
use crate::device::testing::drain;
use crate::units::RAD_S_PER_RPM;

/// Every reading of a run with its arrival time, and the decoder that read it.
fn run(params: MockParams) -> (Vec<(HostTime, ImuReading)>, NativeSerialDecoder) {
    let mut decoder = NativeSerialDecoder::new();
    let mut readings = Vec::new();
    for (at, bytes) in drain(&mut MockChair::new(params).expect("in range")) {
        decoder.push(Traffic::Bytes(&bytes), &mut |reading| readings.push((at, reading)));
    }
    (readings, decoder)
}

fn quiet(params: MockParams) -> MockParams {
    MockParams { noise: false, ..params }
}

#[test]
fn the_chair_turns_by_rate_times_spin() {
    let (readings, decoder) = run(quiet(MockParams::chair()));
    assert_eq!(readings.len(), 43_001);
    let counters = decoder.counters();
    // 44 HELLO (0 to 43 s), one sample per ms, 431 STATUS.
    assert_eq!(counters.packets, 44 + 43_001 + 431);
    assert_eq!((counters.bad_checksum, counters.missing, counters.bytes_skipped), (0, 0, 0));
    assert_eq!(decoder.announced_rate_hz(), Some(1000.0));

    // The trapezoidal rule is exact for the ramps, whose ends lie on samples.
    let turned: f64 =
        readings.windows(2).map(|pair| 0.5e-3 * (pair[0].1.omega_imu.z + pair[1].1.omega_imu.z)).sum();
    let expected = 30.0 * RAD_S_PER_RPM * 15.0;
    assert!((turned - expected).abs() < 1e-5 * expected, "turned {turned} rad, expected {expected}");
}

#[test]
fn the_rate_follows_the_ramps() {
    let params = MockParams::chair();
    let rate = 30.0 * RAD_S_PER_RPM;
    for (t_s, expected) in [
        (0.0, 0.0),
        (2.0, 0.0),
        (2.5, 0.5 * rate),
        (3.0, rate),
        (16.999, rate),
        (17.25, 0.75 * rate),
        (18.0, 0.0),
        (43.0, 0.0),
    ] {
        assert!((params.omega(t_s) - expected).abs() < 1e-12, "{t_s} s");
    }
    let step = MockParams { ramp_s: 0.0, ..params };
    assert_eq!(
        (step.omega(1.999), step.omega(2.0), step.omega(16.999), step.omega(17.0)),
        (0.0, rate, rate, 0.0)
    );
}

#[test]
fn stamps_are_sample_time_plus_time_on_the_wire() {
    let (readings, _) =
        run(quiet(MockParams { after_s: 0.0, spin_s: 1.0, rest_s: 0.0, ..MockParams::chair() }));
    for (at, reading) in readings {
        let taken_us = reading.device_time.expect("has a clock").micros;
        let delay_us = (at.0 as f64) * 1e-3 - taken_us as f64;
        // A frame of 34 bytes alone takes 369 µs; after a HELLO of 43 bytes or a STATUS of 26 it waits its turn.
        assert!((368.0..840.0).contains(&delay_us), "{delay_us} µs after {taken_us} µs");
    }
}

#[test]
fn a_tilted_sensor_sees_gravity_and_rotation_along_the_same_axis() {
    let (readings, _) = run(quiet(MockParams { tilt_deg: 30.0, ..MockParams::chair() }));
    let up = Vector3::new(0.0, 0.5, 0.75f64.sqrt());
    let (_, spinning) = readings[10_000];
    let force = spinning.specific_force_imu.expect("has an accelerometer");
    assert!((force - up * STANDARD_GRAVITY).norm() < 1e-5);
    assert!((spinning.omega_imu - up * 30.0 * RAD_S_PER_RPM).norm() < 1e-5);
}

#[test]
fn noise_has_the_stated_size_and_comes_from_the_seed() {
    let params = MockParams { rest_s: 20.0, ..MockParams::rest() };
    let (readings, _) = run(params.clone());
    let count = readings.len() as f64;
    let rms = |value: &dyn Fn(&ImuReading) -> f64| {
        (readings.iter().map(|(_, reading)| value(reading) * value(reading)).sum::<f64>() / count).sqrt()
    };
    assert!((rms(&|reading| reading.omega_imu.x) / GYRO_NOISE - 1.0).abs() < 0.03);
    let force_z =
        rms(&|reading| reading.specific_force_imu.map_or(f64::NAN, |force| force.z - STANDARD_GRAVITY));
    assert!((force_z / SPECIFIC_FORCE_NOISE - 1.0).abs() < 0.03);

    assert_eq!(readings, run(params.clone()).0);
    assert_ne!(readings, run(MockParams { seed: 1, ..params }).0);
}

#[test]
fn parameters_out_of_range_are_refused() {
    for (params, what) in [
        (MockParams { rate_rpm: 100.0, ..MockParams::chair() }, "rate_rpm = 100"),
        (MockParams { rate_rpm: 1.0, ..MockParams::rest() }, "rate_rpm = 1"),
        (MockParams { rest_s: -1.0, ..MockParams::chair() }, "rest_s = -1"),
        (MockParams { spin_s: 0.5, ..MockParams::chair() }, "spin_s = 0.5"),
        (MockParams { after_s: f64::NAN, ..MockParams::chair() }, "after_s = NaN"),
        (MockParams { sample_rate_hz: 5000.0, ..MockParams::chair() }, "sample_rate_hz = 5000"),
    ] {
        let text = MockChair::new(params).expect_err(what).to_string();
        assert!(
            text.starts_with(what) && text.contains(", expected ") && text.contains("\n\nhint: "),
            "{text}"
        );
    }
}
