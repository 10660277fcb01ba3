//! CEVA BNO080, BNO085 and BNO086 in UART-RVC mode. Source: BNO08X datasheet 1000-3927, section 1.2.5.2.
//!
//! Frames of 19 bytes, 100 a second, numbers little-endian:
//!
//! | bytes | content |
//! |---|---|
//! | 0, 1 | 0xAA 0xAA |
//! | 2 | index, u8, one more each frame |
//! | 3..9 | yaw, pitch, roll, i16, 0.01 deg; turned about z, then y, then x |
//! | 9..15 | accelerometer x y z, i16, mg |
//! | 15..18 | motion intent, motion request, reserved: not used |
//! | 18 | low byte of the sum of bytes 2..18 |
//!
//! There is **no gyroscope** in it. Differences of angles of 0.01 deg over 10 ms are rates in steps of 1 deg/s, and
//! what the sensor's own filter makes of a quick turn is in them: no readings come out of this protocol unless they
//! are asked for as degraded.

use nalgebra::{UnitQuaternion, Vector3};

use super::frames::{FrameScanner, Look};
use super::{DecodeCounters, DeviceTime, ImuReading, PacketDecoder, detect};
use crate::device::Traffic;
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};

const SYNC: u8 = 0xAA;
const FRAME_BYTES: usize = 19;
/// Time from one frame to the next, µs.
const PERIOD_US: u64 = 10_000;
/// Frames the index counts.
const INDEX_TURN: u64 = 256;

/// Decodes UART-RVC.
#[derive(Clone, Debug, Default)]
pub struct Bno08xRvcDecoder {
    scanner: FrameScanner<FRAME_BYTES>,
    content: Content,
}

#[derive(Clone, Debug, Default)]
struct Content {
    allow_degraded: bool,
    /// Index and orientation of the frame before.
    last: Option<(u8, UnitQuaternion<f64>)>,
    missing: u64,
}

impl Bno08xRvcDecoder {
    /// A decoder that gives no readings, or with `allow_degraded` those that differences of angles make.
    pub fn new(allow_degraded: bool) -> Self {
        Self { content: Content { allow_degraded, ..Content::default() }, ..Self::default() }
    }
}

fn look(bytes: &[u8]) -> Look {
    match bytes {
        [SYNC] => Look::Incomplete,
        [SYNC, SYNC, ..] => match bytes.get(..FRAME_BYTES) {
            None => Look::Incomplete,
            Some([_, _, content @ .., sum])
                if content.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte)) == *sum =>
            {
                Look::Frame(FRAME_BYTES)
            }
            Some(_) => Look::Damaged,
        },
        _ => Look::NoFrame,
    }
}

impl Content {
    fn take(&mut self, frame: &[u8], on_reading: &mut dyn FnMut(ImuReading)) {
        let &[_, _, index, ref numbers @ .., _, _, _, _] = frame else { return };
        let Some(&[yaw, pitch, roll, x, y, z]) = numbers.as_chunks().0.first_chunk() else { return };
        let [yaw, pitch, roll] =
            [yaw, pitch, roll].map(|raw| f64::from(i16::from_le_bytes(raw)) * 0.01 * RAD_PER_DEG);
        let orientation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let Some((last_index, last)) = self.last.replace((index, orientation)) else { return };
        let steps = u64::from(index.wrapping_sub(last_index));
        if steps == 0 {
            return;
        }
        self.missing += steps - 1;
        if !self.allow_degraded {
            return;
        }
        let milli_g = [x, y, z].map(|raw| f64::from(i16::from_le_bytes(raw)));
        on_reading(ImuReading {
            device_time: Some(DeviceTime {
                micros: u64::from(index) * PERIOD_US,
                wraps_after_us: Some(INDEX_TURN * PERIOD_US),
            }),
            // The turn from the frame before, in the sensor's own axes.
            omega_imu: (last.inverse() * orientation).scaled_axis() * (1e6 / (steps * PERIOD_US) as f64),
            specific_force_imu: Some(Vector3::from(milli_g) * (1e-3 * STANDARD_GRAVITY)),
            clipped: false,
        });
    }
}

impl PacketDecoder for Bno08xRvcDecoder {
    fn protocol(&self) -> &'static str {
        detect::BNO08X_RVC
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        let Self { scanner, content } = self;
        scanner.take(traffic, look, |frame| content.take(frame, on_reading));
    }

    fn counters(&self) -> DecodeCounters {
        DecodeCounters { missing: self.content.missing, ..self.scanner.counters().into() }
    }

    fn rejoin(&mut self) {
        self.scanner.rejoin();
        self.content.last = None;
    }

    fn finish(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        let Self { scanner, content, .. } = self;
        scanner.finish(look, |frame| content.take(frame, on_reading));
    }

    fn allow_degraded(&mut self) {
        self.content.allow_degraded = true;
    }

    fn notes(&self) -> Vec<String> {
        if self.scanner.counters().frames == 0 {
            return Vec::new();
        }
        vec![if self.content.allow_degraded {
            "degraded: there is no gyroscope in UART-RVC; the angular velocity is made from angles of 0.01 deg at 100 Hz, \
             in steps of 1 deg/s, and dated by the frame index"
                .to_owned()
        } else {
            "there is no gyroscope in UART-RVC, only angles of 0.01 deg at 100 Hz (1 deg/s when differentiated): refused; \
             use the sensor's SPI or I2C interface, or accept that with --allow-degraded"
                .to_owned()
        }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame of angles in 0.01 deg.
    fn frame(index: u8, yaw: i16, pitch: i16, roll: i16) -> Vec<u8> {
        let mut frame = vec![SYNC, SYNC, index];
        for number in [yaw, pitch, roll, 0, 0, 1000] {
            frame.extend(number.to_le_bytes());
        }
        frame.extend([0, 0, 0]);
        frame.push(frame[2..].iter().fold(0, |sum, byte| sum.wrapping_add(*byte)));
        frame
    }

    fn decode(decoder: &mut Bno08xRvcDecoder, frames: &[Vec<u8>]) -> Vec<ImuReading> {
        let mut readings = Vec::new();
        decoder.push(Traffic::Bytes(&frames.concat()), &mut |reading| readings.push(reading));
        readings
    }

    #[test]
    fn without_consent_there_are_no_readings_and_a_note_says_why() {
        let mut decoder = Bno08xRvcDecoder::new(false);
        assert!(decoder.notes().is_empty());
        assert!(
            decode(&mut decoder, &[frame(254, 0, 0, 0), frame(255, 9, 0, 0), frame(2, 9, 0, 0)]).is_empty()
        );
        let expected = DecodeCounters { packets: 3, missing: 2, ..DecodeCounters::default() };
        assert_eq!(decoder.counters(), expected);
        assert!(
            decoder.notes()[0].contains("no gyroscope") && decoder.notes()[0].contains("--allow-degraded")
        );
    }

    #[test]
    fn with_consent_the_turn_from_frame_to_frame_is_the_rate() {
        let mut decoder = Bno08xRvcDecoder::new(true);
        // 100 deg/s about z, over the jump from 180 to -180 deg and over the wrap of the index; one frame is lost.
        let yaw = |k: i16| if k == 0 { 17_950 } else { -18_050 + 100 * k };
        let frames: Vec<_> = [0, 1, 2, 4].map(|k| frame(253_u8.wrapping_add(k as u8), yaw(k), 0, 0)).to_vec();
        let readings = decode(&mut decoder, &frames);
        assert_eq!((readings.len(), decoder.counters().missing), (3, 1));
        for reading in &readings {
            assert!((reading.omega_imu.z / RAD_PER_DEG - 100.0).abs() < 1e-6, "{reading:?}");
            assert!((reading.specific_force_imu.expect("has one").z - STANDARD_GRAVITY).abs() < 1e-9);
        }
        let times: Vec<u64> =
            readings.iter().map(|reading| reading.device_time.expect("dated").micros).collect();
        assert_eq!(times, [2_540_000, 2_550_000, 10_000]);
        assert!(decoder.notes()[0].starts_with("degraded: "));
        // Nose up by 90 deg, a turn in yaw is one about the sensor's own x.
        decoder.rejoin();
        let tilted = decode(&mut decoder, &[frame(0, 0, -9000, 0), frame(1, 100, -9000, 0)]);
        assert!(
            (tilted[0].omega_imu / RAD_PER_DEG - Vector3::new(100.0, 0.0, 0.0)).norm() < 1e-6,
            "{tilted:?}"
        );
    }
}
