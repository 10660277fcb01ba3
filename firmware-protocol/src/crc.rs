//! The frame's checksum: CRC-16/IBM-3740, also called CCITT-FALSE.
//!
//! Polynomial 0x1021, start 0xFFFF, not reflected, no final xor. It finds every single-bit error of a frame body,
//! every burst of up to 16 bits, and all but one in 65536 of everything else.

/// The generator polynomial, without its leading term.
const POLYNOMIAL: u16 = 0x1021;

/// Remainders of all single bytes: 512 bytes of flash for one step per byte instead of eight.
static TABLE: [u16; 256] = table();

const fn table() -> [u16; 256] {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut remainder = (byte as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            let carry = remainder & 0x8000 != 0;
            remainder <<= 1;
            if carry {
                remainder ^= POLYNOMIAL;
            }
            bit += 1;
        }
        table[byte] = remainder;
        byte += 1;
    }
    table
}

/// Checksum of `bytes`; 0xFFFF for none.
///
/// ```
/// assert_eq!(otolith_firmware_protocol::crc::crc16(b"123456789"), 0x29B1);
/// ```
#[must_use]
pub fn crc16(bytes: &[u8]) -> u16 {
    crc16_from(0xFFFF, bytes)
}

/// The remainder from `start` on: other checksums of the same polynomial differ in nothing else, and a long input can
/// be taken in pieces.
///
/// ```
/// use otolith_firmware_protocol::crc::{crc16, crc16_from};
/// assert_eq!(crc16_from(crc16(b"1234"), b"56789"), crc16(b"123456789"));
/// assert_eq!(crc16_from(0, b"123456789"), 0x31C3); // CRC-16/XMODEM
/// ```
#[must_use]
pub fn crc16_from(start: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(start, |crc, &byte| (crc << 8) ^ TABLE[usize::from((crc >> 8) as u8 ^ byte)])
}
