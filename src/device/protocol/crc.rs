//! 16-bit checksums of foreign protocols. All have the polynomial 0x1021; they differ in direction and start.

use otolith_firmware_protocol::crc::crc16_from;

/// Remainders of single bytes, lowest bit first.
static REFLECTED: [u16; 256] = reflected();

const fn reflected() -> [u16; 256] {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut remainder = byte as u16;
        let mut bit = 0;
        while bit < 8 {
            let carry = remainder & 1 != 0;
            remainder = (remainder >> 1) ^ if carry { 0x8408 } else { 0 };
            bit += 1;
        }
        table[byte] = remainder;
        byte += 1;
    }
    table
}

/// CRC-16/XMODEM: start 0, highest bit first. Over a message and its checksum, big-endian, it gives 0.
pub(super) fn xmodem(bytes: &[u8]) -> u16 {
    crc16_from(0, bytes)
}

/// CRC-16/SPI-FUJITSU: start 0x1D0F, highest bit first. Over a message and its checksum, big-endian, it gives 0.
pub(super) fn spi_fujitsu(bytes: &[u8]) -> u16 {
    crc16_from(0x1D0F, bytes)
}

/// What CRC-16/MCRF4XX starts with.
pub(super) const MCRF4XX_START: u16 = 0xFFFF;

/// CRC-16/MCRF4XX, lowest bit first, going on from `crc`: [`MCRF4XX_START`], or the checksum of what stands before.
pub(super) fn mcrf4xx(crc: u16, bytes: impl IntoIterator<Item = u8>) -> u16 {
    bytes.into_iter().fold(crc, |crc, byte| (crc >> 8) ^ REFLECTED[usize::from(crc as u8 ^ byte)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check values of the catalogue of parametrised CRC algorithms.
    #[test]
    fn check_values() {
        assert_eq!(xmodem(b"123456789"), 0x31C3);
        assert_eq!(spi_fujitsu(b"123456789"), 0xE5CC);
        assert_eq!(mcrf4xx(MCRF4XX_START, *b"123456789"), 0x6F91);
        let halves = mcrf4xx(mcrf4xx(MCRF4XX_START, *b"1234"), *b"56789");
        assert_eq!(halves, 0x6F91);
        assert_eq!(xmodem(b"123456789\x31\xC3"), 0);
    }
}
