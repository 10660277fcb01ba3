//! What host and device ask of each other: SYNC, CMD, ACK.

use super::check_length;
use crate::MAX_PAYLOAD;
use crate::message::{PayloadError, kind};
use crate::wire::{put, take};

/// SYNC: three of the four stamps of a clock exchange as in NTP, µs. The host's receive time is the fourth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sync {
    /// When the host sent its request, host time; echoed.
    pub t1_us: u64,
    /// When the device received it, device time; 0 in a request.
    pub t2_us: u64,
    /// When the device sent its answer, device time; 0 in a request.
    pub t3_us: u64,
}

mod sync_at {
    pub(super) const T1_US: usize = 0;
    pub(super) const T2_US: usize = 8;
    pub(super) const T3_US: usize = 16;
    pub(super) const END: usize = 24;
}

impl Sync {
    /// Device time minus host time, µs: `((t2 - t1) + (t3 - t4)) / 2` with `t4_us` the host's receive time.
    ///
    /// Exact to half the difference between the two ways; nonsense stamps give a number without meaning.
    #[must_use]
    pub const fn offset_us(&self, t4_us: u64) -> i64 {
        let out = self.t2_us.wrapping_sub(self.t1_us) as i64;
        let back = self.t3_us.wrapping_sub(t4_us) as i64;
        out.wrapping_add(back) / 2
    }

    /// Time on the wire both ways, µs: `(t4 - t1) - (t3 - t2)`. Keep the answers with the shortest.
    #[must_use]
    pub const fn round_trip_us(&self, t4_us: u64) -> i64 {
        let total = t4_us.wrapping_sub(self.t1_us) as i64;
        total.wrapping_sub(self.t3_us.wrapping_sub(self.t2_us) as i64)
    }

    pub(crate) fn decode(payload: &[u8]) -> Result<Self, PayloadError> {
        use sync_at::*;
        check_length(kind::SYNC, payload, END)?;
        Ok(Self {
            t1_us: u64::from_le_bytes(take(payload, T1_US)),
            t2_us: u64::from_le_bytes(take(payload, T2_US)),
            t3_us: u64::from_le_bytes(take(payload, T3_US)),
        })
    }

    pub(crate) fn encode(&self, out: &mut [u8; MAX_PAYLOAD]) -> usize {
        use sync_at::*;
        put(out, T1_US, self.t1_us.to_le_bytes());
        put(out, T2_US, self.t2_us.to_le_bytes());
        put(out, T3_US, self.t3_us.to_le_bytes());
        END
    }
}

/// CMD: what the host asks of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cmd {
    /// One of [`command`](crate::message::command); the device answers others with "unknown code".
    pub code: u8,
    /// Argument in the unit of the code; 0 where it takes none.
    pub arg: u32,
    /// Chosen by the host, echoed in the answer.
    pub token: u8,
}

mod cmd_at {
    pub(super) const CODE: usize = 0;
    pub(super) const ARG: usize = 1;
    pub(super) const TOKEN: usize = 5;
    pub(super) const END: usize = 6;
}

impl Cmd {
    pub(crate) fn decode(payload: &[u8]) -> Result<Self, PayloadError> {
        check_length(kind::CMD, payload, cmd_at::END)?;
        Ok(Self::read(payload))
    }

    pub(crate) fn encode(&self, out: &mut [u8; MAX_PAYLOAD]) -> usize {
        self.write(out);
        cmd_at::END
    }

    /// The fields at the front of `bytes`: the layout is the same on CAN.
    pub(crate) fn read(bytes: &[u8]) -> Self {
        use cmd_at::*;
        Self { code: bytes[CODE], arg: u32::from_le_bytes(take(bytes, ARG)), token: bytes[TOKEN] }
    }

    /// Writes the fields to the front of `out`.
    pub(crate) fn write(&self, out: &mut [u8]) {
        use cmd_at::*;
        out[CODE] = self.code;
        put(out, ARG, self.arg.to_le_bytes());
        out[TOKEN] = self.token;
    }
}

/// ACK: the device's answer to a [`Cmd`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ack {
    /// The code it answers.
    pub code: u8,
    /// One of [`ack_result`](crate::message::ack_result).
    pub result: u8,
    /// The value now in force, in the unit of the code's argument.
    pub value: u32,
    /// The command's token.
    pub token: u8,
}

mod ack_at {
    pub(super) const CODE: usize = 0;
    pub(super) const RESULT: usize = 1;
    pub(super) const VALUE: usize = 2;
    pub(super) const TOKEN: usize = 6;
    pub(super) const END: usize = 7;
}

impl Ack {
    pub(crate) fn decode(payload: &[u8]) -> Result<Self, PayloadError> {
        check_length(kind::ACK, payload, ack_at::END)?;
        Ok(Self::read(payload))
    }

    pub(crate) fn encode(&self, out: &mut [u8; MAX_PAYLOAD]) -> usize {
        self.write(out);
        ack_at::END
    }

    /// The fields at the front of `bytes`: the layout is the same on CAN.
    pub(crate) fn read(bytes: &[u8]) -> Self {
        use ack_at::*;
        Self {
            code: bytes[CODE],
            result: bytes[RESULT],
            value: u32::from_le_bytes(take(bytes, VALUE)),
            token: bytes[TOKEN],
        }
    }

    /// Writes the fields to the front of `out`.
    pub(crate) fn write(&self, out: &mut [u8]) {
        use ack_at::*;
        out[CODE] = self.code;
        out[RESULT] = self.result;
        put(out, VALUE, self.value.to_le_bytes());
        out[TOKEN] = self.token;
    }
}
