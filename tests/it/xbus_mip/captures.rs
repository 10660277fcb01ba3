//! Captures of real devices. The expected numbers are those of `imu-logs/PROVENANCE.md`, found there by independent
//! readers.

use nalgebra::Vector3;
use otolith::device::configure::xbus::{Output, OutputConfiguration};
use otolith::device::protocol::{DecodeCounters, ImuReading};
use otolith::units::{DEG_PER_RAD, STANDARD_GRAVITY};

use super::decode;
use crate::shared_capture;

/// What the decoder makes of a whole capture, however it is cut.
fn read(protocol: &str, capture: &[u8]) -> (Vec<ImuReading>, DecodeCounters) {
    let found = decode(protocol, capture, capture.len());
    assert_eq!(found, decode(protocol, capture, 61));
    found
}

#[track_caller]
fn assert_near(what: &str, found: Vector3<f64>, expected: [f64; 3], tolerance: f64) {
    let expected = Vector3::from(expected);
    assert!(
        (found - expected).amax() <= tolerance,
        "{what}: {found:?}, expected {expected:?} +- {tolerance}"
    );
}

fn mean(values: impl ExactSizeIterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let count = values.len() as f64;
    values.sum::<Vector3<f64>>() / count
}

fn mean_force(readings: &[ImuReading]) -> Vector3<f64> {
    mean(readings.iter().map(|reading| reading.specific_force_imu.expect("an accelerometer")))
}

/// The largest value of each axis, of either sign.
fn largest_omega(readings: &[ImuReading]) -> Vector3<f64> {
    readings.iter().fold(Vector3::zeros(), |largest, reading| largest.sup(&reading.omega_imu.abs()))
}

fn times_us(readings: &[ImuReading]) -> Vec<u64> {
    readings.iter().map(|reading| reading.device_time.expect("a time").micros).collect()
}

/// Every step from one sample to the next, µs; that all are forward is part of it.
fn steps_us(readings: &[ImuReading]) -> Vec<u64> {
    times_us(readings).windows(2).map(|pair| pair[1] - pair[0]).collect()
}

#[test]
fn xsens_moved_by_hand_with_gnss() {
    let Some(capture) = shared_capture("serial_raw/xsens_mtdata2_100hz_gnss.bin") else { return };
    assert_eq!(capture.len(), 368_140);
    let (readings, counters) = read("xbus", &capture);
    assert_eq!(counters, DecodeCounters { packets: 4936, bytes_skipped: 22, ..DecodeCounters::default() });
    assert_eq!(readings.len(), 4746);
    assert!(
        steps_us(&readings).iter().all(|step| *step == 10_000),
        "the time of GNSS packets is none of these"
    );
    assert_eq!(steps_us(&readings).iter().sum::<u64>(), 47_450_000);
    assert_near("first gyro", readings[0].omega_imu, [-0.005_478_38, 0.009_752_45, -0.001_082_65], 5e-9);
    assert_near("largest gyro", largest_omega(&readings), [5.522, 4.957, 2.661], 5e-4);
    assert_near("mean accelerometer", mean_force(&readings), [0.735, -1.009, 8.801], 5e-4);
}

#[test]
fn xsens_in_three_number_formats() {
    let force = [[0.0261, -9.6483, -1.6352], [0.0290, -9.6499, -1.6347], [0.0277, -9.6491, -1.6351]];
    for (name, bytes, mean_force_m_s2) in
        [("1", 14_337, force[0]), ("2", 14_445, force[1]), ("3", 17_937, force[2])]
    {
        let Some(capture) = shared_capture(&format!("serial_raw/xsens_einride_{name}.bin")) else { return };
        assert_eq!(capture.len(), bytes);
        let (readings, counters) = read("xbus", &capture);
        assert_eq!(counters, DecodeCounters { packets: 100, ..DecodeCounters::default() }, "{name}");
        assert_eq!((readings.len(), steps_us(&readings).len()), (96, 95));
        assert_near("mean accelerometer", mean_force(&readings), mean_force_m_s2, 5.01e-5);
        let mean_omega = mean(readings.iter().map(|reading| reading.omega_imu));
        match name {
            "1" => assert_near(
                "first gyro",
                readings[0].omega_imu,
                [-0.002_965_7, 0.002_203_52, 0.001_722_57],
                5.01e-8,
            ),
            "2" => assert_near("mean gyro", mean_omega, [-3.04e-5, -1.9003e-3, -1.6965e-3], 5.01e-8),
            _ => assert_near(
                "first gyro",
                readings[0].omega_imu,
                [0.001_092_6, 0.001_668_91, -0.003_750_26],
                5.01e-8,
            ),
        }
    }
}

#[test]
fn xsens_output_configuration() {
    let Some(data) = shared_capture("serial_raw/xsens_einride_1_outputconfig.bin") else { return };
    let read = OutputConfiguration::parse(&data).expect("whole entries");
    assert_eq!((data.len(), read.outputs.len()), (52, 13));
    assert_eq!(read.outputs[0], Output { data_id: 0x1020, rate_hz: 0xFFFF });
    assert_eq!(read.outputs[12], Output { data_id: 0x7010, rate_hz: 4 });
    assert_eq!(
        (read.rate_of(0x4020), read.rate_of(0x8020), read.rate_of(0x8040)),
        (Some(100), Some(100), None)
    );
    assert_eq!(read.data(), data, "written as it was read");
}

#[test]
fn microstrain_moved_by_hand() {
    let Some(capture) = shared_capture("serial_raw/microstrain_mip_125hz.bin") else { return };
    assert_eq!(capture.len(), 368_940);
    let (readings, counters) = read("mip", &capture);
    assert_eq!(counters, DecodeCounters { packets: 8384, ..DecodeCounters::default() });
    assert_eq!(readings.len(), 4473);
    let times = times_us(&readings);
    assert_eq!((times[0], times[4472]), (282_809_000, 318_585_000));
    assert!(steps_us(&readings).iter().all(|step| *step == 8_000));
    let force_g = mean_force(&readings) / STANDARD_GRAVITY;
    assert_near("mean accelerometer", force_g, [-0.0506, -0.0582, -0.9446], 5.01e-5);
    assert_near("largest gyro", largest_omega(&readings), [3.621, 3.055, 1.802], 5.01e-4);
    let turned = readings.iter().map(|reading| reading.omega_imu * 0.008 * DEG_PER_RAD).sum::<Vector3<f64>>();
    assert_near("turned", turned, [-7.18, -12.59, 16.59], 0.01);
}
