//! The messages of an inertial sensor.

use nalgebra::Vector3;

use super::frame::Frame;
use crate::device::protocol::native_serial::{at_end_of_range, scaled};
use crate::device::protocol::{DeviceTime, ImuReading};
use crate::units::STANDARD_GRAVITY;

pub(super) const SCALED_IMU: u32 = 26;
pub(super) const RAW_IMU: u32 = 27;
pub(super) const HIGHRES_IMU: u32 = 105;
pub(super) const SCALED_IMU2: u32 = 116;
pub(super) const SCALED_IMU3: u32 = 129;

/// Specific force of one count of RAW_IMU and SCALED_IMU, m/s²: a thousandth of standard gravity.
const FORCE_PER_COUNT: f64 = 1e-3 * STANDARD_GRAVITY;
/// Angular rate of one count of RAW_IMU and SCALED_IMU, rad/s.
const RATE_PER_COUNT: f64 = 1e-3;
/// The 32-bit millisecond counter of SCALED_IMU starts again after this.
const WRAPS_AFTER_US: u64 = (1 << 32) * 1000;
/// `fields_updated` of HIGHRES_IMU: acceleration, then angular rate, each three axes.
const FORCE_UPDATED: u16 = 0x0007;
const RATE_UPDATED: u16 = 0x0038;

/// What a message of an inertial sensor says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ImuMessage {
    /// A sample, and which of several sensors it is of.
    Sample { sensor: u8, reading: ImuReading },
    /// The gyroscope or the accelerometer alone has news.
    Half,
    /// Neither has: the magnetometer or the barometer.
    Neither,
    /// All six values are exactly zero, which no accelerometer reads: the sensor is not there.
    Absent,
}

/// Name of a message that [`read`] reads.
pub(super) fn name(message: u32) -> Option<&'static str> {
    Some(match message {
        SCALED_IMU => "SCALED_IMU",
        RAW_IMU => "RAW_IMU",
        HIGHRES_IMU => "HIGHRES_IMU",
        SCALED_IMU2 => "SCALED_IMU2",
        SCALED_IMU3 => "SCALED_IMU3",
        _ => return None,
    })
}

/// Reads a message of an inertial sensor; `None` for any other.
pub(super) fn read(frame: &Frame<'_>) -> Option<ImuMessage> {
    name(frame.message)?;
    // What was cut off is zero.
    let mut payload = [0; 64];
    payload.iter_mut().zip(frame.payload).for_each(|(to, from)| *to = *from);
    Some(match frame.message {
        HIGHRES_IMU => highres(&payload),
        RAW_IMU => {
            let time = DeviceTime { micros: u64::from_le_bytes(bytes(&payload, 0)), wraps_after_us: None };
            counts(&payload, 8, payload[26], time)
        }
        _ => {
            let millis = u64::from(u32::from_le_bytes(bytes(&payload, 0)));
            counts(&payload, 4, 0, DeviceTime { micros: millis * 1000, wraps_after_us: Some(WRAPS_AFTER_US) })
        }
    })
}

/// `N` bytes from `at` on; all of them lie in the payload of the messages read here.
fn bytes<const N: usize>(payload: &[u8; 64], at: usize) -> [u8; N] {
    payload[at..].first_chunk().copied().unwrap_or([0; N])
}

/// Three accelerometer and three gyroscope counts from `at` on.
fn counts(payload: &[u8; 64], at: usize, sensor: u8, time: DeviceTime) -> ImuMessage {
    let triple = |at: usize| [0, 2, 4].map(|axis| i16::from_le_bytes(bytes(payload, at + axis)));
    let (force, rate) = (triple(at), triple(at + 6));
    if force == [0; 3] && rate == [0; 3] {
        return ImuMessage::Absent;
    }
    let reading = ImuReading {
        device_time: Some(time),
        omega_imu: scaled(rate, RATE_PER_COUNT),
        specific_force_imu: Some(scaled(force, FORCE_PER_COUNT)),
        clipped: at_end_of_range(force) || at_end_of_range(rate),
    };
    ImuMessage::Sample { sensor, reading }
}

fn highres(payload: &[u8; 64]) -> ImuMessage {
    let updated = u16::from_le_bytes(bytes(payload, 60));
    match (updated & FORCE_UPDATED == FORCE_UPDATED, updated & RATE_UPDATED == RATE_UPDATED) {
        (true, true) => {}
        (false, false) => return ImuMessage::Neither,
        _ => return ImuMessage::Half,
    }
    let triple = |at: usize| {
        Vector3::from([0, 4, 8].map(|axis| f64::from(f32::from_le_bytes(bytes(payload, at + axis)))))
    };
    let (force, rate) = (triple(8), triple(20));
    if force == Vector3::zeros() && rate == Vector3::zeros() {
        return ImuMessage::Absent;
    }
    let micros = u64::from_le_bytes(bytes(payload, 0));
    let reading = ImuReading {
        device_time: Some(DeviceTime { micros, wraps_after_us: None }),
        omega_imu: rate,
        specific_force_imu: Some(force),
        clipped: false,
    };
    ImuMessage::Sample { sensor: payload[62], reading }
}
