//! 16-bit checksums of foreign protocols. All have the polynomial 0x1021; they differ in direction and start.

/// Remainders of single bytes, highest bit first.
static FORWARD: [u16; 256] = forward();
/// Remainders of single bytes, lowest bit first.
static REFLECTED: [u16; 256] = reflected();

const fn forward() -> [u16; 256] {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut remainder = (byte as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            let carry = remainder & 0x8000 != 0;
            remainder = (remainder << 1) ^ if carry { 0x1021 } else { 0 };
            bit += 1;
        }
        table[byte] = remainder;
        byte += 1;
    }
    table
}

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
    highest_bit_first(0, bytes)
}

/// What CRC-16/SPI-FUJITSU starts with.
pub(super) const SPI_FUJITSU_START: u16 = 0x1D0F;

/// The checksum from `start` on, highest bit first, without a final inversion.
pub(super) fn highest_bit_first(start: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(start, |crc, &byte| (crc << 8) ^ FORWARD[usize::from((crc >> 8) as u8 ^ byte)])
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
        assert_eq!(highest_bit_first(SPI_FUJITSU_START, b"123456789"), 0xE5CC);
        assert_eq!(mcrf4xx(MCRF4XX_START, *b"123456789"), 0x6F91);
        let halves = mcrf4xx(mcrf4xx(MCRF4XX_START, *b"1234"), *b"56789");
        assert_eq!(halves, 0x6F91);
        assert_eq!(xmodem(b"123456789\x31\xC3"), 0);
    }
}
