//! The same device on classic CAN: eight messages of 8 bytes, identifiers from a base address.
//!
//! A sample is two frames, GYRO and ACCEL, paired by an equal tick. The tick is the low 16 bits of the device time
//! in units of 10 µs, and TIME carries the low 32, so the relation survives every wrap. [`CanReceiver`] puts it
//! together again; layout and factors for other tools are in `otolith.dbc`.

mod clock;
mod message;
mod receiver;

pub use message::{CanError, CanMessage, HalfSample, Health, Identity, Ranges, Time};
pub use receiver::{CanCounters, CanEvent, CanReceiver, CanSample};

/// Identifier of the first message of node 0.
pub const DEFAULT_BASE: u16 = 0x3A0;

/// Distance of the base identifiers of two nodes.
pub const NODE_STRIDE: u16 = 0x10;

/// The unit of tick and device time on CAN, µs.
pub const TICK_US: u64 = 10;

/// The messages as a DBC file (`otolith.dbc`), for tools and for generic decoders.
pub const DBC: &str = include_str!("../otolith.dbc");

/// Message = base identifier + offset.
pub mod offset {
    /// Angular rate of a sample.
    pub const GYRO: u16 = 0;
    /// Specific force of a sample.
    pub const ACCEL: u16 = 1;
    /// Device time and number of frames sent, 10 Hz.
    pub const TIME: u16 = 2;
    /// Temperature and error counts, 1 Hz.
    pub const HEALTH: u16 = 3;
    /// Ranges and identity, multiplexed, 1 Hz.
    pub const DESC: u16 = 4;
    /// A command to the device.
    pub const CMD: u16 = 5;
    /// The device's answer to a command.
    pub const ACK: u16 = 6;
}

/// The identifiers of one device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ids {
    base: u16,
}

impl Ids {
    /// Identifiers of a node at the default base; `None` if they do not fit 11 bits (nodes above 69).
    #[must_use]
    pub const fn of_node(node: u8) -> Option<Self> {
        Self::at_base(DEFAULT_BASE + NODE_STRIDE * node as u16)
    }

    /// Identifiers from any base; `None` if they do not fit 11 bits.
    #[must_use]
    pub const fn at_base(base: u16) -> Option<Self> {
        if base <= 0x7FF - offset::ACK { Some(Self { base }) } else { None }
    }

    /// The first identifier, that of GYRO.
    #[must_use]
    pub const fn base(self) -> u16 {
        self.base
    }

    /// The offset of an 11-bit identifier from the base; `None` if it belongs to another device.
    #[must_use]
    pub fn offset_of(self, id: u32) -> Option<u16> {
        let distance = id.checked_sub(u32::from(self.base))?;
        u16::try_from(distance).ok().filter(|&distance| distance <= offset::ACK)
    }

    /// Identifier and data of a message.
    #[must_use]
    pub fn frame(self, message: &CanMessage) -> (u16, [u8; 8]) {
        (self.base + message.offset(), message.encode())
    }
}

impl Default for Ids {
    /// Node 0 at the default base.
    fn default() -> Self {
        Self { base: DEFAULT_BASE }
    }
}
