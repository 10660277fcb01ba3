//! The cyclic redundancy check of 16 bits that several devices share.

/// CRC-16 with polynomial 0x1021, most significant bit first, no final inversion, from `start` on.
pub(super) fn crc16_1021(start: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(start, |crc, byte| {
        (0..8).fold(
            crc ^ u16::from(*byte) << 8,
            |crc, _| if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x1021 },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check values of the catalogue of CRC algorithms: CRC-16/XMODEM, /IBM-3740, /SPI-FUJITSU.
    #[test]
    fn the_published_check_values_come_out() {
        for (start, check) in [(0x0000, 0x31C3), (0xFFFF, 0x29B1), (0x1D0F, 0xE5CC)] {
            assert_eq!(crc16_1021(start, b"123456789"), check);
        }
    }
}
