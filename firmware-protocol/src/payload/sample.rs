//! What the sensor measured: SAMPLE16, BATCH16, SAMPLE_F32.

use super::{check_fits, check_length};
use crate::MAX_PAYLOAD;
use crate::message::{EncodeError, PayloadError, kind};
use crate::wire::{put, put_f32x3, put_i16x3, take, take_f32x3, take_i16x3};

/// SAMPLE16: one sample in counts; HELLO's scales turn them into rad/s and m/s². Sensor frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample16 {
    /// Device time, µs, wraps after 2³² µs (71.6 min).
    pub t_us: u32,
    /// Angular rate about x, y, z, counts.
    pub gyro: [i16; 3],
    /// Specific force along x, y, z, counts.
    pub accel: [i16; 3],
}

mod sample16_at {
    pub(super) const T_US: usize = 0;
    pub(super) const GYRO: usize = 4;
    pub(super) const ACCEL: usize = 10;
    pub(super) const END: usize = 16;
}

impl Sample16 {
    pub(crate) fn decode(payload: &[u8]) -> Result<Self, PayloadError> {
        use sample16_at::*;
        check_length(kind::SAMPLE16, payload, END)?;
        Ok(Self {
            t_us: u32::from_le_bytes(take(payload, T_US)),
            gyro: take_i16x3(payload, GYRO),
            accel: take_i16x3(payload, ACCEL),
        })
    }

    pub(crate) fn encode(&self, out: &mut [u8; MAX_PAYLOAD]) -> usize {
        use sample16_at::*;
        put(out, T_US, self.t_us.to_le_bytes());
        put_i16x3(out, GYRO, self.gyro);
        put_i16x3(out, ACCEL, self.accel);
        END
    }
}

/// Most rows of a BATCH16.
pub const BATCH_MAX_ROWS: usize = (MAX_PAYLOAD - batch16_at::ROWS) / batch16_at::ROW;

/// BATCH16: samples at equal distance in time, in counts. An empty batch is legal and carries nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Batch16<'a> {
    /// Device time of the first row, µs, wraps after 2³² µs.
    pub t_us: u32,
    /// Time from row to row, µs.
    pub dt_us: u16,
    /// Rows as they travel, at most [`BATCH_MAX_ROWS`]; made by [`Batch16::row`], read by [`Batch16::samples`].
    pub rows: &'a [[u8; 12]],
}

mod batch16_at {
    pub(super) const T_US: usize = 0;
    pub(super) const DT_US: usize = 4;
    pub(super) const COUNT: usize = 6;
    pub(super) const ROWS: usize = 7;
    /// Length of a row, and its two fields.
    pub(super) const ROW: usize = 12;
    pub(super) const ROW_GYRO: usize = 0;
    pub(super) const ROW_ACCEL: usize = 6;
}

impl<'a> Batch16<'a> {
    /// One row from counts, for firmware that fills a batch sample by sample.
    #[must_use]
    pub fn row(gyro: [i16; 3], accel: [i16; 3]) -> [u8; 12] {
        let mut row = [0; batch16_at::ROW];
        put_i16x3(&mut row, batch16_at::ROW_GYRO, gyro);
        put_i16x3(&mut row, batch16_at::ROW_ACCEL, accel);
        row
    }

    /// The samples with their own times, oldest first.
    pub fn samples(&self) -> impl Iterator<Item = Sample16> + use<'a> {
        let Self { t_us, dt_us, rows } = *self;
        rows.iter().zip(0u32..).map(move |(row, index)| Sample16 {
            t_us: t_us.wrapping_add(index.wrapping_mul(u32::from(dt_us))),
            gyro: take_i16x3(row, batch16_at::ROW_GYRO),
            accel: take_i16x3(row, batch16_at::ROW_ACCEL),
        })
    }

    pub(crate) fn decode(payload: &'a [u8]) -> Result<Self, PayloadError> {
        use batch16_at::*;
        let count = payload.get(COUNT).map_or(0, |&n| usize::from(n));
        check_length(kind::BATCH16, payload, ROWS + ROW * count)?;
        let (rows, _) = payload[ROWS..].as_chunks();
        Ok(Self {
            t_us: u32::from_le_bytes(take(payload, T_US)),
            dt_us: u16::from_le_bytes(take(payload, DT_US)),
            rows,
        })
    }

    pub(crate) fn encode(&self, out: &mut [u8; MAX_PAYLOAD]) -> Result<usize, EncodeError> {
        use batch16_at::*;
        check_fits(kind::BATCH16, self.rows.len(), BATCH_MAX_ROWS)?;
        let end = ROWS + ROW * self.rows.len();
        put(out, T_US, self.t_us.to_le_bytes());
        put(out, DT_US, self.dt_us.to_le_bytes());
        out[COUNT] = self.rows.len() as u8;
        out[ROWS..end].copy_from_slice(self.rows.as_flattened());
        Ok(end)
    }
}

/// SAMPLE_F32: one sample in SI units, sensor frame. Values are passed on as sent, NaN included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleF32 {
    /// Device time, µs, wraps after 2³² µs.
    pub t_us: u32,
    /// Angular rate about x, y, z, rad/s.
    pub gyro: [f32; 3],
    /// Specific force along x, y, z, m/s².
    pub accel: [f32; 3],
}

mod sample_f32_at {
    pub(super) const T_US: usize = 0;
    pub(super) const GYRO: usize = 4;
    pub(super) const ACCEL: usize = 16;
    pub(super) const END: usize = 28;
}

impl SampleF32 {
    pub(crate) fn decode(payload: &[u8]) -> Result<Self, PayloadError> {
        use sample_f32_at::*;
        check_length(kind::SAMPLE_F32, payload, END)?;
        Ok(Self {
            t_us: u32::from_le_bytes(take(payload, T_US)),
            gyro: take_f32x3(payload, GYRO),
            accel: take_f32x3(payload, ACCEL),
        })
    }

    pub(crate) fn encode(&self, out: &mut [u8; MAX_PAYLOAD]) -> usize {
        use sample_f32_at::*;
        put(out, T_US, self.t_us.to_le_bytes());
        put_f32x3(out, GYRO, self.gyro);
        put_f32x3(out, ACCEL, self.accel);
        END
    }
}
