//! What the device says of itself: HELLO, STATUS, TEXT.

use super::{check_fits, check_length, utf8_prefix};
use crate::MAX_PAYLOAD;
use crate::message::{EncodeError, PayloadError, kind};
use crate::wire::{put, take};

/// HELLO: who sends, and what its counts mean. Its version byte is [`VERSION`](crate::VERSION) by construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hello<'a> {
    /// Reserved, 0; receivers ignore it.
    pub flags: u8,
    /// Serial number of the device.
    pub device_id: u32,
    /// Firmware version, major in the high byte.
    pub firmware: u16,
    /// Nominal sample rate, mHz.
    pub rate_millihertz: u32,
    /// Angular rate of one count, rad/s.
    pub gyro_scale: f32,
    /// Specific force of one count, m/s².
    pub accel_scale: f32,
    /// Full scale of the gyro, deg/s.
    pub gyro_range_dps: u16,
    /// Full scale of the accelerometer, g.
    pub accel_range_g: u16,
    /// Capability bits; none is defined in version 1, receivers ignore it.
    pub caps: u16,
    /// Name of the sensor, meant to be ASCII; at most [`Hello::NAME_MAX`] bytes.
    pub name: &'a [u8],
}

mod hello_at {
    pub(super) const VERSION: usize = 0;
    pub(super) const FLAGS: usize = 1;
    pub(super) const DEVICE_ID: usize = 2;
    pub(super) const FIRMWARE: usize = 6;
    pub(super) const RATE_MILLIHERTZ: usize = 8;
    pub(super) const GYRO_SCALE: usize = 12;
    pub(super) const ACCEL_SCALE: usize = 16;
    pub(super) const GYRO_RANGE_DPS: usize = 20;
    pub(super) const ACCEL_RANGE_G: usize = 22;
    pub(super) const CAPS: usize = 24;
    pub(super) const NAME_LENGTH: usize = 26;
    pub(super) const NAME: usize = 27;
}

impl<'a> Hello<'a> {
    /// Longest name that fits a frame, bytes.
    pub const NAME_MAX: usize = MAX_PAYLOAD - hello_at::NAME;

    /// The name up to its first byte that is not UTF-8.
    #[must_use]
    pub fn name_str(&self) -> &'a str {
        utf8_prefix(self.name)
    }

    pub(crate) fn decode(payload: &'a [u8]) -> Result<Self, PayloadError> {
        use hello_at::*;
        // The version comes first: another version may have another length.
        match payload.first() {
            Some(&crate::VERSION) | None => {}
            Some(&got) => return Err(PayloadError::Version { got }),
        }
        let name_length = payload.get(NAME_LENGTH).map_or(0, |&n| usize::from(n));
        check_length(kind::HELLO, payload, NAME + name_length)?;
        Ok(Self {
            flags: payload[FLAGS],
            device_id: u32::from_le_bytes(take(payload, DEVICE_ID)),
            firmware: u16::from_le_bytes(take(payload, FIRMWARE)),
            rate_millihertz: u32::from_le_bytes(take(payload, RATE_MILLIHERTZ)),
            gyro_scale: f32::from_le_bytes(take(payload, GYRO_SCALE)),
            accel_scale: f32::from_le_bytes(take(payload, ACCEL_SCALE)),
            gyro_range_dps: u16::from_le_bytes(take(payload, GYRO_RANGE_DPS)),
            accel_range_g: u16::from_le_bytes(take(payload, ACCEL_RANGE_G)),
            caps: u16::from_le_bytes(take(payload, CAPS)),
            name: &payload[NAME..],
        })
    }

    pub(crate) fn encode(&self, out: &mut [u8; MAX_PAYLOAD]) -> Result<usize, EncodeError> {
        use hello_at::*;
        check_fits(kind::HELLO, self.name.len(), Self::NAME_MAX)?;
        let end = NAME + self.name.len();
        out[VERSION] = crate::VERSION;
        out[FLAGS] = self.flags;
        put(out, DEVICE_ID, self.device_id.to_le_bytes());
        put(out, FIRMWARE, self.firmware.to_le_bytes());
        put(out, RATE_MILLIHERTZ, self.rate_millihertz.to_le_bytes());
        put(out, GYRO_SCALE, self.gyro_scale.to_le_bytes());
        put(out, ACCEL_SCALE, self.accel_scale.to_le_bytes());
        put(out, GYRO_RANGE_DPS, self.gyro_range_dps.to_le_bytes());
        put(out, ACCEL_RANGE_G, self.accel_range_g.to_le_bytes());
        put(out, CAPS, self.caps.to_le_bytes());
        out[NAME_LENGTH] = self.name.len() as u8;
        out[NAME..end].copy_from_slice(self.name);
        Ok(end)
    }
}

/// STATUS: health of the device. Counts are since power-up, modulo 65536.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// Device time, µs: the samples' clock, without their wrap.
    pub t_us: u64,
    /// Temperature of the sensor, 0.01 °C.
    pub temperature_centi_c: i16,
    /// Bits of [`status_flag`](crate::message::status_flag).
    pub flags: u32,
    /// Samples dropped before sending.
    pub dropped: u16,
    /// Frames that did not fit the transmit queue.
    pub tx_overrun: u16,
    /// Failed reads of the sensor.
    pub sensor_err: u16,
}

mod status_at {
    pub(super) const T_US: usize = 0;
    pub(super) const TEMPERATURE: usize = 8;
    pub(super) const FLAGS: usize = 10;
    pub(super) const DROPPED: usize = 14;
    pub(super) const TX_OVERRUN: usize = 16;
    pub(super) const SENSOR_ERR: usize = 18;
    pub(super) const END: usize = 20;
}

impl Status {
    pub(crate) fn decode(payload: &[u8]) -> Result<Self, PayloadError> {
        use status_at::*;
        check_length(kind::STATUS, payload, END)?;
        Ok(Self {
            t_us: u64::from_le_bytes(take(payload, T_US)),
            temperature_centi_c: i16::from_le_bytes(take(payload, TEMPERATURE)),
            flags: u32::from_le_bytes(take(payload, FLAGS)),
            dropped: u16::from_le_bytes(take(payload, DROPPED)),
            tx_overrun: u16::from_le_bytes(take(payload, TX_OVERRUN)),
            sensor_err: u16::from_le_bytes(take(payload, SENSOR_ERR)),
        })
    }

    pub(crate) fn encode(&self, out: &mut [u8; MAX_PAYLOAD]) -> usize {
        use status_at::*;
        put(out, T_US, self.t_us.to_le_bytes());
        put(out, TEMPERATURE, self.temperature_centi_c.to_le_bytes());
        put(out, FLAGS, self.flags.to_le_bytes());
        put(out, DROPPED, self.dropped.to_le_bytes());
        put(out, TX_OVERRUN, self.tx_overrun.to_le_bytes());
        put(out, SENSOR_ERR, self.sensor_err.to_le_bytes());
        END
    }
}

/// TEXT: one log line, meant to be UTF-8, without terminator; at most [`MAX_PAYLOAD`] bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Text<'a> {
    /// The line as it travels.
    pub bytes: &'a [u8],
}

impl<'a> Text<'a> {
    /// The line up to its first byte that is not UTF-8.
    #[must_use]
    pub fn as_str(&self) -> &'a str {
        utf8_prefix(self.bytes)
    }

    pub(crate) fn encode(&self, out: &mut [u8; MAX_PAYLOAD]) -> Result<usize, EncodeError> {
        check_fits(kind::TEXT, self.bytes.len(), MAX_PAYLOAD)?;
        out[..self.bytes.len()].copy_from_slice(self.bytes);
        Ok(self.bytes.len())
    }
}
