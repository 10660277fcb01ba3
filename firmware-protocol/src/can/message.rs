//! The eight messages on CAN as values: 8 data bytes to fields and back.

use core::fmt;

use super::offset;
use crate::VERSION;
use crate::message::{Ack, Cmd};
use crate::wire::{put, put_i16x3, take, take_i16x3};

/// GYRO or ACCEL: half a sample, in counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HalfSample {
    /// x, y, z in the sensor frame, counts of full scale / 32768.
    pub xyz: [i16; 3],
    /// Device time modulo 655.36 ms, 10 µs.
    pub tick: u16,
}

/// TIME: device time and end-to-end count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Time {
    /// Device time, 10 µs, wraps after 2³² units (11.9 h).
    pub time_10us: u32,
    /// GYRO and ACCEL frames sent before this one, modulo 65536.
    pub frames_sent: u16,
    /// Low bits of [`status_flag`](crate::message::status_flag).
    pub status: u16,
}

/// HEALTH: temperature and error counts since power-up, modulo 65536. Its version is [`VERSION`] by construction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Health {
    /// Temperature of the sensor, 0.01 °C.
    pub temperature_centi_c: i16,
    /// Samples dropped before sending.
    pub dropped: u16,
    /// Frames that did not fit the transmit queue.
    pub tx_overrun: u16,
    /// Result of the self-test, as the firmware defines it.
    pub self_test: u8,
}

/// DESC, page 0: what the counts mean. Its version is [`VERSION`] by construction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ranges {
    /// Full scale of the gyro, deg/s.
    pub gyro_range_dps: u16,
    /// Full scale of the accelerometer, g.
    pub accel_range_g: u16,
    /// Nominal sample rate, Hz.
    pub rate_hz: u16,
}

impl Ranges {
    /// Angular rate of one count, rad/s: full scale / 32768.
    #[must_use]
    pub fn gyro_scale(&self) -> f64 {
        f64::from(self.gyro_range_dps).to_radians() / 32768.0
    }

    /// Specific force of one count, m/s²: full scale / 32768, with 1 g = 9.80665 m/s².
    #[must_use]
    pub fn accel_scale(&self) -> f64 {
        f64::from(self.accel_range_g) * 9.80665 / 32768.0
    }
}

/// DESC, page 1: who sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Serial number of the device.
    pub device_id: u32,
    /// Firmware version, major in the high byte.
    pub firmware: u16,
}

/// One message on CAN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanMessage {
    /// Angular rate of a sample.
    Gyro(HalfSample),
    /// Specific force of a sample.
    Accel(HalfSample),
    /// Device time and end-to-end count.
    Time(Time),
    /// Temperature and error counts.
    Health(Health),
    /// What the counts mean.
    Ranges(Ranges),
    /// Who sends.
    Identity(Identity),
    /// A command to the device, as on the serial line.
    Cmd(Cmd),
    /// The device's answer, as on the serial line.
    Ack(Ack),
}

mod half_at {
    pub(super) const XYZ: usize = 0;
    pub(super) const TICK: usize = 6;
}

mod time_at {
    pub(super) const TIME: usize = 0;
    pub(super) const FRAMES_SENT: usize = 4;
    pub(super) const STATUS: usize = 6;
}

mod health_at {
    pub(super) const TEMPERATURE: usize = 0;
    pub(super) const DROPPED: usize = 2;
    pub(super) const TX_OVERRUN: usize = 4;
    pub(super) const VERSION: usize = 6;
    pub(super) const SELF_TEST: usize = 7;
}

mod desc_at {
    pub(super) const PAGE: usize = 0;
    pub(super) const PAGE_RANGES: u8 = 0;
    pub(super) const GYRO_RANGE_DPS: usize = 1;
    pub(super) const ACCEL_RANGE_G: usize = 3;
    pub(super) const RATE_HZ: usize = 5;
    pub(super) const VERSION: usize = 7;
    pub(super) const PAGE_IDENTITY: u8 = 1;
    pub(super) const DEVICE_ID: usize = 1;
    pub(super) const FIRMWARE: usize = 5;
}

impl CanMessage {
    /// Distance of the identifier from the base, one of [`offset`].
    #[must_use]
    pub const fn offset(&self) -> u16 {
        match self {
            Self::Gyro(_) => offset::GYRO,
            Self::Accel(_) => offset::ACCEL,
            Self::Time(_) => offset::TIME,
            Self::Health(_) => offset::HEALTH,
            Self::Ranges(_) | Self::Identity(_) => offset::DESC,
            Self::Cmd(_) => offset::CMD,
            Self::Ack(_) => offset::ACK,
        }
    }

    /// The 8 data bytes; unused ones are 0.
    #[must_use]
    pub fn encode(&self) -> [u8; 8] {
        let mut data = [0; 8];
        match self {
            Self::Gyro(half) | Self::Accel(half) => {
                put_i16x3(&mut data, half_at::XYZ, half.xyz);
                put(&mut data, half_at::TICK, half.tick.to_le_bytes());
            }
            Self::Time(time) => {
                put(&mut data, time_at::TIME, time.time_10us.to_le_bytes());
                put(&mut data, time_at::FRAMES_SENT, time.frames_sent.to_le_bytes());
                put(&mut data, time_at::STATUS, time.status.to_le_bytes());
            }
            Self::Health(health) => {
                put(&mut data, health_at::TEMPERATURE, health.temperature_centi_c.to_le_bytes());
                put(&mut data, health_at::DROPPED, health.dropped.to_le_bytes());
                put(&mut data, health_at::TX_OVERRUN, health.tx_overrun.to_le_bytes());
                data[health_at::VERSION] = VERSION;
                data[health_at::SELF_TEST] = health.self_test;
            }
            Self::Ranges(ranges) => {
                data[desc_at::PAGE] = desc_at::PAGE_RANGES;
                put(&mut data, desc_at::GYRO_RANGE_DPS, ranges.gyro_range_dps.to_le_bytes());
                put(&mut data, desc_at::ACCEL_RANGE_G, ranges.accel_range_g.to_le_bytes());
                put(&mut data, desc_at::RATE_HZ, ranges.rate_hz.to_le_bytes());
                data[desc_at::VERSION] = VERSION;
            }
            Self::Identity(identity) => {
                data[desc_at::PAGE] = desc_at::PAGE_IDENTITY;
                put(&mut data, desc_at::DEVICE_ID, identity.device_id.to_le_bytes());
                put(&mut data, desc_at::FIRMWARE, identity.firmware.to_le_bytes());
            }
            Self::Cmd(cmd) => cmd.write(&mut data),
            Self::Ack(ack) => ack.write(&mut data),
        }
        data
    }

    /// Reads the data of the frame at `offset` from the base; any bytes are legal input, unused ones are ignored.
    ///
    /// # Errors
    /// [`CanError`]: unknown offset or page, a length other than 8, or another version of the format.
    pub fn decode(offset: u16, data: &[u8]) -> Result<Self, CanError> {
        let data: &[u8; 8] = data.try_into().map_err(|_| CanError::Length { got: data.len() })?;
        match offset {
            offset::GYRO => Ok(Self::Gyro(HalfSample::read(data))),
            offset::ACCEL => Ok(Self::Accel(HalfSample::read(data))),
            offset::TIME => Ok(Self::Time(Time {
                time_10us: u32::from_le_bytes(take(data, time_at::TIME)),
                frames_sent: u16::from_le_bytes(take(data, time_at::FRAMES_SENT)),
                status: u16::from_le_bytes(take(data, time_at::STATUS)),
            })),
            offset::HEALTH => Health::read(data).map(Self::Health),
            offset::DESC => match data[desc_at::PAGE] {
                desc_at::PAGE_RANGES => Ranges::read(data).map(Self::Ranges),
                desc_at::PAGE_IDENTITY => Ok(Self::Identity(Identity {
                    device_id: u32::from_le_bytes(take(data, desc_at::DEVICE_ID)),
                    firmware: u16::from_le_bytes(take(data, desc_at::FIRMWARE)),
                })),
                page => Err(CanError::UnknownPage { page }),
            },
            offset::CMD => Ok(Self::Cmd(Cmd::read(data))),
            offset::ACK => Ok(Self::Ack(Ack::read(data))),
            _ => Err(CanError::UnknownOffset { offset }),
        }
    }
}

impl HalfSample {
    fn read(data: &[u8; 8]) -> Self {
        Self { xyz: take_i16x3(data, half_at::XYZ), tick: u16::from_le_bytes(take(data, half_at::TICK)) }
    }
}

impl Health {
    fn read(data: &[u8; 8]) -> Result<Self, CanError> {
        check_version(data[health_at::VERSION])?;
        Ok(Self {
            temperature_centi_c: i16::from_le_bytes(take(data, health_at::TEMPERATURE)),
            dropped: u16::from_le_bytes(take(data, health_at::DROPPED)),
            tx_overrun: u16::from_le_bytes(take(data, health_at::TX_OVERRUN)),
            self_test: data[health_at::SELF_TEST],
        })
    }
}

impl Ranges {
    fn read(data: &[u8; 8]) -> Result<Self, CanError> {
        check_version(data[desc_at::VERSION])?;
        Ok(Self {
            gyro_range_dps: u16::from_le_bytes(take(data, desc_at::GYRO_RANGE_DPS)),
            accel_range_g: u16::from_le_bytes(take(data, desc_at::ACCEL_RANGE_G)),
            rate_hz: u16::from_le_bytes(take(data, desc_at::RATE_HZ)),
        })
    }
}

fn check_version(got: u8) -> Result<(), CanError> {
    if got == VERSION { Ok(()) } else { Err(CanError::Version { got }) }
}

/// Why the data of a frame could not be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanError {
    /// No message has this offset from the base.
    UnknownOffset {
        /// The offset.
        offset: u16,
    },
    /// DESC has no such page.
    UnknownPage {
        /// The page number, its first byte.
        page: u8,
    },
    /// Every message has 8 data bytes.
    Length {
        /// How many there were.
        got: usize,
    },
    /// A DESC or HEALTH of another version of the format.
    Version {
        /// The version it states.
        got: u8,
    },
}

impl fmt::Display for CanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownOffset { offset } => write!(f, "no message at base + {offset:#x}"),
            Self::UnknownPage { page } => write!(f, "unknown page {page} of DESC"),
            Self::Length { got } => write!(f, "{got} data bytes, expected 8"),
            Self::Version { got } => write!(f, "the device speaks format version {got}, expected {VERSION}"),
        }
    }
}

impl core::error::Error for CanError {}
