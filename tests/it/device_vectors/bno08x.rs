//! BNO08x in UART-RVC mode: the datasheet's example.

use otolith::device::Traffic;
use otolith::device::protocol::bno08x_rvc::Bno08xRvcDecoder;
use otolith::device::protocol::detect::{AutoDecoder, Bus};
use otolith::device::protocol::{DecodeCounters, PacketDecoder};
use otolith::units::RAD_PER_DEG;

use super::{bytes_of, decode, one, vector};

/// The same frame with other numbers: a yaw in 0.01 deg, and an index.
fn changed(frame: &[u8], index: u8, yaw: i16) -> Vec<u8> {
    let mut frame = frame.to_vec();
    frame[2] = index;
    frame[3..5].copy_from_slice(&yaw.to_le_bytes());
    frame[18] = frame[2..18].iter().fold(0, |sum, byte| sum.wrapping_add(*byte));
    frame
}

#[test]
fn the_example_of_the_datasheet() {
    let vector = vector("bno08x-uart-rvc/doc");
    let example = bytes_of(&vector);
    assert_eq!(f64::from(example[2]), one(&vector, "index"));
    let mut decoder = Bno08xRvcDecoder::new(false);
    assert!(decode(&mut decoder, &example).is_empty(), "no gyroscope, no sample");
    assert_eq!(decoder.counters(), DecodeCounters { packets: 1, ..DecodeCounters::default() });

    // The angles only show in differences: 1 deg less yaw in the frame before is 100 deg/s about the vertical.
    let yaw = (one(&vector, "yaw_deg") * 100.0).round() as i16;
    let before = changed(&example, example[2] - 1, yaw - 100);
    let mut decoder = Bno08xRvcDecoder::new(true);
    let readings = decode(&mut decoder, &[before, example].concat());
    let [reading] = readings[..] else { panic!("one sample, not {readings:?}") };
    let force = reading.specific_force_imu.unwrap();
    for (found, key) in force.iter().zip(["ax_mg", "ay_mg", "az_mg"]) {
        assert!((found / 9.80665e-3 - one(&vector, key)).abs() < 1e-9, "{key}: {found}");
    }
    assert!((force.z - one(&vector, "az_mps2")).abs() < 1e-3);
    let (pitch, roll) = (one(&vector, "pitch_deg") * RAD_PER_DEG, one(&vector, "roll_deg") * RAD_PER_DEG);
    let vertical = nalgebra::Vector3::new(
        -libm::sin(pitch),
        libm::cos(pitch) * libm::sin(roll),
        libm::cos(pitch) * libm::cos(roll),
    );
    assert!((reading.omega_imu / RAD_PER_DEG - vertical * 100.0).norm() < 1e-9, "{reading:?}");
}

#[test]
fn it_is_recognised_and_refused() {
    let example = bytes_of(&vector("bno08x-uart-rvc/doc"));
    let mut found = AutoDecoder::on(&[Bus::Serial]);
    for index in 0..30 {
        found.push(Traffic::Bytes(&changed(&example, index, 0)), &mut |_| panic!("no gyroscope, no sample"));
    }
    assert_eq!(found.protocol(), "bno08x-rvc");
    assert!(found.notes()[0].contains("no gyroscope"), "{:?}", found.notes());
}
