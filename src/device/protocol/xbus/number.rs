//! The four number formats of MTData2, told by the lowest two bits of a data identifier.
//!
//! | bits | format | bytes | value |
//! |---|---|---|---|
//! | 0 | float32 | 4 | IEEE 754, big-endian |
//! | 1 | fp12.20 | 4 | i32 big-endian / 2²⁰ |
//! | 2 | fp16.32 | 6 | fraction u32 big-endian, then whole part i16 big-endian: i48 / 2³² |
//! | 3 | float64 | 8 | IEEE 754, big-endian |

use nalgebra::Vector3;

/// Bytes of one number.
pub(super) fn size(id: u16) -> usize {
    match id & 3 {
        0 | 1 => 4,
        2 => 6,
        _ => 8,
    }
}

/// Three numbers in the format that `id` tells; `None` if `data` is not three.
pub(super) fn vector(id: u16, data: &[u8]) -> Option<Vector3<f64>> {
    match id & 3 {
        0 => three(data, |bytes| f64::from(f32::from_be_bytes(bytes))),
        1 => three(data, |bytes| f64::from(i32::from_be_bytes(bytes)) / f64::from(1 << 20)),
        2 => three(data, fp16_32),
        _ => three(data, f64::from_be_bytes),
    }
}

fn fp16_32([f3, f2, f1, f0, w1, w0]: [u8; 6]) -> f64 {
    let fraction = u32::from_be_bytes([f3, f2, f1, f0]);
    f64::from(i16::from_be_bytes([w1, w0])) + f64::from(fraction) / 4_294_967_296.0
}

fn three<const N: usize>(data: &[u8], number: fn([u8; N]) -> f64) -> Option<Vector3<f64>> {
    match data.as_chunks() {
        (&[x, y, z], []) => Some(Vector3::new(number(x), number(y), number(z))),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_part_of_fp16_32_comes_last_and_carries_the_sign() {
        let read = |bytes| fp16_32(bytes);
        assert_eq!(read([0, 0, 0, 0, 0, 1]), 1.0);
        assert_eq!(read([0x80, 0, 0, 0, 0, 2]), 2.5);
        assert_eq!(read([0xC0, 0, 0, 0, 0xFF, 0xFF]), -0.25);
        assert_eq!(read([0, 0, 0, 1, 0, 0]), 1.0 / 4_294_967_296.0);
    }

    #[test]
    fn every_format_takes_three_numbers_and_nothing_else() {
        for (format, bytes) in [(0, 12), (1, 12), (2, 18), (3, 24)] {
            let id = 0x4020 | format;
            assert_eq!(3 * size(id), bytes);
            assert_eq!(vector(id, &vec![0; bytes]), Some(Vector3::zeros()));
            assert_eq!((vector(id, &vec![0; bytes - 1]), vector(id, &vec![0; bytes + 1])), (None, None));
        }
    }

    #[test]
    fn fixed_point_with_20_binary_places() {
        let data = [0x00, 0x10, 0, 0, 0xFF, 0xF8, 0, 0, 0x80, 0, 0, 0];
        assert_eq!(vector(0x8021, &data), Some(Vector3::new(1.0, -0.5, -2048.0)));
    }
}
