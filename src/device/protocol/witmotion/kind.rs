//! What a packet's first two bytes say.

/// First byte of every packet.
pub(super) const SYNC: u8 = 0x55;
/// Lowest type there is.
pub(super) const FIRST: u8 = 0x50;
pub(super) const TIME: u8 = 0x50;
pub(super) const ACCELEROMETER: u8 = 0x51;
pub(super) const GYROSCOPE: u8 = 0x52;
/// Up to here: angles, magnetic field, ports, pressure, position, ground speed, quaternion, accuracy.
pub(super) const LAST_KNOWN: u8 = 0x5A;
/// The answer to a request for a register; may stand anywhere.
pub(super) const REGISTER: u8 = 0x5F;
/// Highest type there is.
pub(super) const LAST: u8 = 0x5F;
