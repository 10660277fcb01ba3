//! Every sample of the float captures against the decoder of the crate `xsens-mti`.

use nalgebra::Vector3;
use xsens_mti::prelude::{
    Acceleration, DataType, Decoder, MTData2, MessageDecode, RateOfTurn, SampleTimeFine,
};

use super::decode;
use crate::shared_capture;

/// Time in ticks, angular velocity and specific force of every packet that has all three.
fn samples_of_peer(capture: &[u8]) -> Vec<(u32, Vector3<f64>, Vector3<f64>)> {
    let mut decoder = Decoder::new([0; 2100]).expect("large enough");
    let mut samples = Vec::new();
    for byte in capture {
        let Some(frame) = decoder.decode(*byte).expect("the buffer is large enough") else { continue };
        let Ok(packets) = MTData2::decode(&frame) else { continue };
        let (mut ticks, mut omega, mut force) = (None, None, None);
        for packet in packets.into_iter().flatten() {
            let data = packet.payload();
            match packet.data_id().data_type() {
                DataType::SampleTimeFine => {
                    ticks = SampleTimeFine::from_be_slice(data).ok().map(|time| time.0)
                }
                DataType::RateOfTurn => omega = RateOfTurn::<f32>::from_be_slice(data).ok(),
                DataType::Acceleration => force = Acceleration::<f32>::from_be_slice(data).ok(),
                _ => {}
            }
        }
        if let (Some(ticks), Some(omega), Some(force)) = (ticks, omega, force) {
            let omega = Vector3::new(omega.x, omega.y, omega.z).map(f64::from);
            samples.push((ticks, omega, Vector3::new(force.x, force.y, force.z).map(f64::from)));
        }
    }
    samples
}

#[test]
fn every_sample_is_the_same_to_the_bit() {
    for (file, count) in [("xsens_mtdata2_100hz_gnss.bin", 4746), ("xsens_einride_1.bin", 96)] {
        let Some(capture) = shared_capture(&format!("serial_raw/{file}")) else { return };
        let (readings, _) = decode("xbus", &capture, 64);
        let ours: Vec<_> = readings
            .iter()
            .map(|reading| {
                let ticks = reading.device_time.expect("a time").micros / 100;
                (ticks as u32, reading.omega_imu, reading.specific_force_imu.expect("an accelerometer"))
            })
            .collect();
        assert_eq!(ours.len(), count, "{file}");
        assert_eq!(ours, samples_of_peer(&capture), "{file}");
    }
}
