//! The fields of set 80 this decoder reads.

/// Specific force, 3 × f32, g.
pub(super) const ACCELERATION: u8 = 0x04;
/// Angular velocity, 3 × f32, rad/s.
pub(super) const ANGULAR_RATE: u8 = 0x05;
/// Angle increment over the sample.
pub(super) const DELTA_THETA: u8 = 0x07;
/// Velocity increment over the sample.
pub(super) const DELTA_VELOCITY: u8 = 0x08;
/// GPS time of devices before the shared fields: f64 s of the week, u16 week, u16 flags.
pub(super) const GPS_TIMESTAMP: u8 = 0x12;
/// u16 of flags.
pub(super) const OVER_RANGE: u8 = 0x18;
/// GPS time: f64 s of the week, u16 week, u16 flags.
pub(super) const GPS_TIME: u8 = 0xD3;
/// u64 ns since the device was switched on.
pub(super) const REFERENCE_TIME: u8 = 0xD5;
