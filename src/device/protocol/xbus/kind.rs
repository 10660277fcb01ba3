//! The items of MTData2 this decoder reads: data identifiers without their lowest four bits, which tell axes and number
//! format.

/// u32 ns, u16 year, u8 month, day, hour, minute, second, flags.
pub(super) const UTC_TIME: u16 = 0x1010;
/// u16, counts every MTData2 packet.
pub(super) const PACKET_COUNTER: u16 = 0x1020;
/// u32, 100 µs.
pub(super) const SAMPLE_TIME_FINE: u16 = 0x1060;
/// Velocity increment over the sample.
pub(super) const DELTA_V: u16 = 0x4010;
/// Specific force, m/s².
pub(super) const ACCELERATION: u16 = 0x4020;
/// Acceleration without gravity, in axes of the earth.
pub(super) const FREE_ACCELERATION: u16 = 0x4030;
/// Specific force at a high rate, m/s².
pub(super) const ACCELERATION_HR: u16 = 0x4040;
/// Angular velocity, rad/s.
pub(super) const RATE_OF_TURN: u16 = 0x8020;
/// Orientation increment over the sample.
pub(super) const DELTA_Q: u16 = 0x8030;
/// Angular velocity at a high rate, rad/s.
pub(super) const RATE_OF_TURN_HR: u16 = 0x8040;
/// u32 of flags.
pub(super) const STATUS_WORD: u16 = 0xE020;

/// The kind of a data identifier.
pub(super) fn of(id: u16) -> u16 {
    id & 0xFFF0
}
