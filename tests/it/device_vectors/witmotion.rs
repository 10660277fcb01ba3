//! WitMotion: constructed samples, and the vendor's commands.

use nalgebra::Vector3;
use otolith::device::Traffic;
use otolith::device::configure::{Request, witmotion};
use otolith::device::protocol::detect::{AutoDecoder, Bus};
use otolith::device::protocol::witmotion::can::WitMotionCanDecoder;
use otolith::device::protocol::witmotion::serial::WitMotionDecoder;
use otolith::device::protocol::{DecodeCounters, ImuReading, PacketDecoder};
use otolith::units::{RAD_PER_DEG, STANDARD_GRAVITY};
use serde_json::Value;

use super::{bytes_of, decode, from_hex, one, vector};

/// Whether a reading has the values of a vector, and nothing on the other axes.
fn assert_is(reading: &ImuReading, vector: &Value) {
    let omega = Vector3::new(0.0, 0.0, one(vector, "gz_dps") * RAD_PER_DEG);
    let force = Vector3::new(0.0, 0.0, one(vector, "az_g") * STANDARD_GRAVITY);
    assert!((reading.omega_imu - omega).norm() < 1e-12, "{reading:?}");
    assert!((reading.specific_force_imu.unwrap() - force).norm() < 1e-12, "{reading:?}");
    assert!(reading.device_time.is_none() && !reading.clipped);
}

#[test]
fn a_serial_sample() {
    let vector = vector("witmotion-serial/constructed");
    let mut decoder = WitMotionDecoder::new();
    let readings = decode(&mut decoder, &bytes_of(&vector));
    assert_eq!(readings.len(), 1);
    assert_is(&readings[0], &vector);
    assert_eq!(decoder.counters(), DecodeCounters { packets: 2, ..DecodeCounters::default() });
    assert!(decoder.notes()[0].contains("no time packets"), "{:?}", decoder.notes());
    let range = decoder.device().unwrap().gyro_range.unwrap();
    assert!((range - 2000.0 * RAD_PER_DEG).abs() < 1e-9);
}

/// Frames of a CAN vector.
fn frames(vector: &Value) -> Vec<(u32, Vec<u8>)> {
    let frames = vector["can"].as_array().unwrap().iter();
    frames.map(|f| (f["id"].as_u64().unwrap() as u32, from_hex(f["data"].as_str().unwrap()))).collect()
}

#[test]
fn a_can_sample() {
    let vector = vector("witmotion-can/constructed");
    let mut decoder = WitMotionCanDecoder::new(None);
    let mut readings = Vec::new();
    for (id, data) in frames(&vector) {
        let frame = Traffic::CanFrame { id, extended: false, data: &data };
        decoder.push(frame, &mut |reading| readings.push(reading));
    }
    assert_eq!(readings.len(), 1);
    assert_is(&readings[0], &vector);
    assert_eq!(decoder.counters(), DecodeCounters { packets: 3, ..DecodeCounters::default() });
}

#[test]
fn both_links_are_found_without_losing_a_sample() {
    let serial = bytes_of(&vector("witmotion-serial/constructed")).repeat(30);
    let mut found = AutoDecoder::on(&[Bus::Serial, Bus::Can]);
    let mut readings = 0;
    for piece in serial.chunks(7) {
        found.push(Traffic::Bytes(piece), &mut |_| readings += 1);
    }
    assert_eq!((found.protocol(), readings), ("witmotion", 30));

    let can = vec![frames(&vector("witmotion-can/constructed")); 30].concat();
    let mut found = AutoDecoder::on(&[Bus::Serial, Bus::Can]);
    let mut readings = 0;
    for (id, data) in can {
        found.push(Traffic::CanFrame { id, extended: false, data: &data }, &mut |_| readings += 1);
    }
    assert_eq!((found.protocol(), readings), ("witmotion-can", 30));
}

/// The bytes a request comes to, as hexadecimal digits.
fn commands(request: &Request) -> Vec<String> {
    let steps = witmotion::plan(request).unwrap().steps;
    steps.iter().map(|step| step.bytes.iter().map(|byte| format!("{byte:02x}")).collect()).collect()
}

#[test]
fn the_commands_are_the_vendors() {
    let of = |name: &str| vector(&format!("witmotion-cmd/{name}"))["hex"].as_str().unwrap().to_owned();
    for (rate_hz, rate, baud, baud_name) in
        [(200.0, "rate_200hz", 921_600, "baud_921600"), (100.0, "rate_100hz", 115_200, "baud_115200")]
    {
        let request = Request { rate_hz: Some(rate_hz), baud: Some(baud), save: true };
        let expected = [of("unlock"), of("rsw_time_acc_gyro"), of(rate), of(baud_name), of("save")];
        assert_eq!(commands(&request), expected);
        let steps = witmotion::plan(&request).unwrap().steps;
        let bauds: Vec<_> = steps.iter().map(|step| step.baud_after).collect();
        assert_eq!(bauds, [None, None, None, Some(baud), None]);
        assert_eq!(commands(&Request { save: false, ..request }), expected[..4]);
    }
}
