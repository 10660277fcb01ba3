//! Where the numbers of each packet type stand. From the vendor's `openimu.json` (applications IMU, VG_AHRS and INS) and
//! `dmu.json`.
//!
//! Floating-point types, little-endian; all begin with a time, u32:
//!
//! | type | payload | accelerometer 3 × f32 | gyroscope 3 × f32, deg/s | other, not used |
//! |---|---|---|---|---|
//! | `z1` | 40 | 4, m/s² | 16 | magnetometer |
//! | `s1` | 52 | 12, see below | 24 | time f64 s at 4, magnetometer, temperature |
//! | `a1` | 47 | 32, m/s² | 20 | time f64 s at 4, roll, pitch, states |
//! | `a2` | 48 | 36, m/s² | 24 | time f64 s at 4, roll, pitch, heading |
//! | `e1` | 75 | 24, see below | 36 | time f64 s at 4, angles, gyroscope bias, magnetometer, states |
//! | `e2` | 123 | 24, see below | 48 | time f64 s at 4, angles, biases, velocity, magnetometer, position, states |
//!
//! The accelerometer of `s1`, `e1` and `e2` is documented in g and, for other versions of the firmware, in m/s².
//!
//! Whole-number types, big-endian, 20 g and 1260 deg/s for 65536 counts:
//!
//! | type | payload | accelerometer 3 × i16 | gyroscope 3 × i16 | time |
//! |---|---|---|---|---|
//! | `S0` | 30 | 0 | 6 | u16 at 26 |
//! | `S1` | 24 | 0 | 6 | u16 at 20 |
//! | `A1` | 32 | 12 | 6 | u32 at 26, ms |
//! | `A2` | 30 | 12 | 6 | u32 at 24, ms |

use super::clock::{CountClock, Unit};

/// How the numbers of a packet are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Numbers {
    /// f32, little-endian, m/s² and deg/s.
    Floats,
    /// The same, with an accelerometer that may be in g.
    FloatsMaybeG,
    /// i16, big-endian.
    Counts,
}

/// One packet type.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub(super) kind: [u8; 2],
    /// Bytes of the payload.
    pub(super) bytes: usize,
    pub(super) numbers: Numbers,
    /// Places in the payload.
    pub(super) force_at: usize,
    pub(super) omega_at: usize,
    pub(super) time_at: usize,
    /// Whether the time has 16 bits, not 32.
    pub(super) short_time: bool,
}

const fn floats(kind: &[u8; 2], bytes: usize, numbers: Numbers, force_at: usize, omega_at: usize) -> Layout {
    Layout { kind: *kind, bytes, numbers, force_at, omega_at, time_at: 0, short_time: false }
}

const fn counts(kind: &[u8; 2], bytes: usize, force_at: usize, time_at: usize, short_time: bool) -> Layout {
    Layout { kind: *kind, bytes, numbers: Numbers::Counts, force_at, omega_at: 6, time_at, short_time }
}

/// Number of packet types with samples.
pub(super) const TYPES: usize = 10;

pub(super) const LAYOUTS: [Layout; TYPES] = [
    floats(b"z1", 40, Numbers::Floats, 4, 16),
    floats(b"s1", 52, Numbers::FloatsMaybeG, 12, 24),
    floats(b"a1", 47, Numbers::Floats, 32, 20),
    floats(b"a2", 48, Numbers::Floats, 36, 24),
    floats(b"e1", 75, Numbers::FloatsMaybeG, 24, 36),
    floats(b"e2", 123, Numbers::FloatsMaybeG, 24, 48),
    counts(b"S0", 30, 0, 26, true),
    counts(b"S1", 24, 0, 20, true),
    counts(b"A1", 32, 12, 26, false),
    counts(b"A2", 30, 12, 24, false),
];

impl Layout {
    /// A clock for the time of this packet type.
    pub(super) fn clock(&self) -> CountClock {
        if self.short_time {
            CountClock::of_16_bits(Unit::Packet, Unit::Second65536th, 100)
        } else {
            CountClock::of_32_bits(Unit::Millisecond, Unit::Microsecond, 1000)
        }
    }

    /// What the time field of a packet says.
    pub(super) fn time(&self, payload: &[u8]) -> Option<u32> {
        let field = payload.get(self.time_at..)?;
        Some(match (self.short_time, self.numbers) {
            (true, _) => u32::from(u16::from_be_bytes(*field.first_chunk()?)),
            (false, Numbers::Counts) => u32::from_be_bytes(*field.first_chunk()?),
            (false, _) => u32::from_le_bytes(*field.first_chunk()?),
        })
    }

    /// Its name, for people.
    pub(super) fn name(&self) -> String {
        self.kind.iter().map(|letter| char::from(*letter)).collect()
    }
}
