//! Little-endian fields at fixed offsets of a byte slice whose length the caller has checked.

/// The `N` bytes at `at`.
pub(crate) fn take<const N: usize>(from: &[u8], at: usize) -> [u8; N] {
    let mut field = [0; N];
    field.copy_from_slice(&from[at..at + N]);
    field
}

/// Writes a field at `at`.
pub(crate) fn put<const N: usize>(into: &mut [u8], at: usize, field: [u8; N]) {
    into[at..at + N].copy_from_slice(&field);
}

/// Three `i16` at `at`.
pub(crate) fn take_i16x3(from: &[u8], at: usize) -> [i16; 3] {
    core::array::from_fn(|axis| i16::from_le_bytes(take(from, at + 2 * axis)))
}

/// Writes three `i16` at `at`.
pub(crate) fn put_i16x3(into: &mut [u8], at: usize, xyz: [i16; 3]) {
    for (axis, value) in xyz.into_iter().enumerate() {
        put(into, at + 2 * axis, value.to_le_bytes());
    }
}

/// Three `f32` at `at`.
pub(crate) fn take_f32x3(from: &[u8], at: usize) -> [f32; 3] {
    core::array::from_fn(|axis| f32::from_le_bytes(take(from, at + 4 * axis)))
}

/// Writes three `f32` at `at`.
pub(crate) fn put_f32x3(into: &mut [u8], at: usize, xyz: [f32; 3]) {
    for (axis, value) in xyz.into_iter().enumerate() {
        put(into, at + 4 * axis, value.to_le_bytes());
    }
}
