//! One signal of a frame: where its bits are and what they mean.

/// Data bytes of a classic CAN frame at most.
pub(super) const MAX_BYTES: usize = 8;
const MAX_BITS: u64 = 8 * MAX_BYTES as u64;

/// How the bits of a signal become a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalKind {
    /// Whole number from 0.
    Unsigned,
    /// Two's complement.
    Signed,
    /// IEEE 754, 32 bit (`SIG_VALTYPE_` 1).
    Float32,
    /// IEEE 754, 64 bit (`SIG_VALTYPE_` 2).
    Float64,
}

/// Place, kind and scale of a signal, ready to be read from a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalLayout {
    big_endian: bool,
    /// Distance of the signal's last bit from the end of the word that the frame's bytes make in this byte order.
    shift: u32,
    length: u32,
    kind: SignalKind,
    factor: f64,
    offset: f64,
    /// Bytes a frame needs to hold all of it.
    bytes: usize,
}

impl SignalLayout {
    /// A signal as a DBC file places it: `start|length@order`, where the start of a big-endian signal (`@0`) is its
    /// most significant bit and that of a little-endian one (`@1`) its least, with bit 0 the lowest of byte 0 and
    /// bit 8 the lowest of byte 1.
    ///
    /// `None` for no bits, more than 64, bits beyond the eighth byte, and floats of a wrong length.
    pub fn new(
        start: u64,
        length: u64,
        big_endian: bool,
        kind: SignalKind,
        factor: f64,
        offset: f64,
    ) -> Option<Self> {
        let length_fits = match kind {
            SignalKind::Unsigned | SignalKind::Signed => (1..=MAX_BITS).contains(&length),
            SignalKind::Float32 => length == 32,
            SignalKind::Float64 => length == 64,
        };
        if !length_fits || start >= MAX_BITS {
            return None;
        }
        // In the order in which the bits are sent: byte 0 first, the highest bit of a byte first.
        let first = if big_endian { start / 8 * 8 + 7 - start % 8 } else { start };
        let end = first + length;
        if end > MAX_BITS {
            return None;
        }
        let shift = if big_endian { MAX_BITS - end } else { start };
        let (shift, length) = (u32::try_from(shift).ok()?, u32::try_from(length).ok()?);
        let bytes = usize::try_from(end.div_ceil(8)).ok()?;
        Some(Self { big_endian, shift, length, kind, factor, offset, bytes })
    }

    /// Bytes a frame needs to hold this signal.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// The bits of the signal; `None` if the frame is too short to hold them.
    pub fn raw(&self, data: &[u8]) -> Option<u64> {
        if data.len() < self.bytes {
            return None;
        }
        let mut bytes = [0; MAX_BYTES];
        for (byte, &given) in bytes.iter_mut().zip(data) {
            *byte = given;
        }
        let word = if self.big_endian { u64::from_be_bytes(bytes) } else { u64::from_le_bytes(bytes) };
        Some((word >> self.shift) & (u64::MAX >> (64 - self.length)))
    }

    /// The number these bits stand for, in the unit of the DBC file. A float may be NaN or infinite.
    pub fn physical(&self, raw: u64) -> f64 {
        let unused = 64 - self.length;
        let number = match self.kind {
            SignalKind::Unsigned => raw as f64,
            SignalKind::Signed => (((raw << unused) as i64) >> unused) as f64,
            SignalKind::Float32 => f64::from(f32::from_bits(raw as u32)),
            SignalKind::Float64 => f64::from_bits(raw),
        };
        number * self.factor + self.offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of the DBC format's own pictures: both orders across a byte boundary.
    #[test]
    fn bits_are_counted_as_dbc_files_count_them() {
        let data = [0x12, 0x34, 0x56, 0x78];
        for (start, length, big_endian, raw) in [
            (0, 8, false, 0x12),
            (0, 16, false, 0x3412),
            (4, 8, false, 0x41),
            (7, 8, true, 0x12),
            (7, 16, true, 0x1234),
            (3, 8, true, 0x23),
            (1, 10, true, 0x234 & 0x3FF),
            (31, 8, true, 0x78),
        ] {
            let layout = SignalLayout::new(start, length, big_endian, SignalKind::Unsigned, 1.0, 0.0);
            assert_eq!(
                layout.expect("fits").raw(&data),
                Some(raw),
                "{start}|{length}, big endian {big_endian}"
            );
        }
    }

    #[test]
    fn a_signal_needs_its_bytes_and_no_more() {
        for (start, length, big_endian, bytes) in [
            (0, 8, false, 1),
            (4, 8, false, 2),
            (7, 8, true, 1),
            (3, 8, true, 2),
            (24, 1, false, 4),
            (0, 64, false, 8),
        ] {
            let layout =
                SignalLayout::new(start, length, big_endian, SignalKind::Signed, 1.0, 0.0).expect("fits");
            assert_eq!(layout.bytes(), bytes);
            assert_eq!(layout.raw(&[0xFF; 8][..bytes - 1]), None);
            assert_eq!(layout.raw(&[0xFF; 8][..bytes]).map(|raw| layout.physical(raw)), Some(-1.0));
        }
    }

    #[test]
    fn impossible_places_are_refused() {
        use SignalKind::{Float32, Float64, Unsigned};
        for (start, length, big_endian, kind) in [
            (0, 0, false, Unsigned),
            (0, 65, false, Unsigned),
            (64, 1, false, Unsigned),
            (63, 2, false, Unsigned),
            (56, 2, true, Unsigned),
            (u64::MAX, u64::MAX, true, Unsigned),
            (0, 31, false, Float32),
            (0, 32, false, Float64),
        ] {
            assert_eq!(SignalLayout::new(start, length, big_endian, kind, 1.0, 0.0), None);
        }
    }
}
