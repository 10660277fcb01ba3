//! What a UART makes of a line that runs at another speed than it listens at.

use serde::{Deserialize, Serialize};

use crate::device::DeviceError;

/// Bits of one byte in 8N1: start bit (low), eight data bits, least significant first, stop bit (high).
const BITS_PER_BYTE: u64 = 10;

/// A device that sends at one baud rate and a host that reads at another, both 8N1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WrongBaud {
    /// Baud rate of the device, bit/s.
    pub sent_baud: u32,
    /// Baud rate of the host, bit/s.
    pub read_baud: u32,
    /// Whether a byte whose stop bit is low is delivered all the same, as USB bridges do, or dropped, as the PC's own
    /// UARTs are told to.
    #[serde(default)]
    pub keep_framing_errors: bool,
}

impl WrongBaud {
    pub(super) fn validate(&self) -> Result<(), DeviceError> {
        const RANGE: std::ops::RangeInclusive<f64> = 300.0..=12_000_000.0;
        DeviceError::check_range("wrong_baud.sent_baud", f64::from(self.sent_baud), RANGE)?;
        DeviceError::check_range("wrong_baud.read_baud", f64::from(self.read_baud), RANGE)?;
        Ok(())
    }

    /// Appends to `read` what the host reads when the device sends `sent` without a pause, on a line that is idle
    /// (high) before and long after.
    ///
    /// A falling edge starts a byte; a start bit that is high again in its middle was none. The data bits are sampled
    /// in their middle. After a byte without a stop bit the line must be high before the next byte can start.
    pub fn misread(&self, sent: &[u8], read: &mut Vec<u8>) {
        // In units of 1 / (sent_baud * read_baud) s both bit lengths are whole numbers.
        let (sent_bit, read_bit) = (u64::from(self.read_baud).max(1), u64::from(self.sent_baud).max(1));
        let line = Line { sent, sent_bit };
        let mut from = 0;
        while let Some(edge) = line.falling_edge(from) {
            let middle = |bit: u64| edge + read_bit / 2 + bit * read_bit;
            if line.is_high(middle(0)) {
                from = middle(0);
                continue;
            }
            let byte = (0..8).fold(0, |byte, bit| byte | u8::from(line.is_high(middle(1 + bit))) << bit);
            from = middle(BITS_PER_BYTE - 1);
            if line.is_high(from) || self.keep_framing_errors {
                read.push(byte);
            }
        }
    }
}

/// The voltage of a line over time.
struct Line<'a> {
    sent: &'a [u8],
    /// Length of one bit.
    sent_bit: u64,
}

impl Line<'_> {
    fn bits(&self) -> u64 {
        self.sent.len() as u64 * BITS_PER_BYTE
    }

    /// Level of the bit with this number.
    fn bit_is_high(&self, bit: u64) -> bool {
        let Some(byte) = self.sent.get((bit / BITS_PER_BYTE) as usize) else { return true };
        match bit % BITS_PER_BYTE {
            0 => false,
            9 => true,
            data => byte >> (data - 1) & 1 == 1,
        }
    }

    fn is_high(&self, time: u64) -> bool {
        self.bit_is_high(time / self.sent_bit)
    }

    /// The next time from `time` on at which the line goes low after having been high.
    fn falling_edge(&self, time: u64) -> Option<u64> {
        let mut bit = time / self.sent_bit;
        if time > 0 {
            while !self.bit_is_high(bit) {
                bit += 1;
            }
        }
        let low = (bit..self.bits()).find(|bit| !self.bit_is_high(*bit))?;
        Some(low * self.sent_bit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn misread(sent_baud: u32, read_baud: u32, keep_framing_errors: bool, sent: &[u8]) -> Vec<u8> {
        let mut read = Vec::new();
        WrongBaud { sent_baud, read_baud, keep_framing_errors }.misread(sent, &mut read);
        read
    }

    /// Worked out on paper from the levels on the line.
    #[test]
    fn single_bytes_at_twice_and_half_the_speed() {
        // Twice too fast: a start bit takes two bits, so it is a start bit and a zero.
        assert_eq!(misread(9600, 19_200, false, &[0xFF]), [0xFE]);
        // Nine low bits take eighteen: the stop bit is missing.
        assert_eq!(misread(9600, 19_200, false, &[0x00]), [0u8; 0]);
        assert_eq!(misread(9600, 19_200, true, &[0x00]), [0x00]);
        // 0 0000 1111 1: five low bits are a start bit, eight zeros and a missing stop bit.
        assert_eq!(misread(9600, 19_200, true, &[0xF0]), [0x00]);
        // Half as fast: the start bit alone is too short to be one, two low bits are one.
        assert_eq!(misread(19_200, 9600, false, &[0xFF]), [0u8; 0]);
        assert_eq!(misread(19_200, 9600, false, &[0xFE]), [0xFF]);
    }

    #[test]
    fn speeds_outside_the_range_are_refused() {
        for (sent_baud, read_baud, what) in [(0, 9600, "sent_baud = 0"), (9600, 50_000_000, "read_baud")] {
            let wrong = WrongBaud { sent_baud, read_baud, keep_framing_errors: false };
            let text = wrong.validate().expect_err(what).to_string();
            assert!(text.contains(what), "{text}");
        }
    }

    proptest! {
        #[test]
        fn the_right_speed_changes_nothing(
            sent in proptest::collection::vec(any::<u8>(), 0..200), baud in 300u32..4_000_000, keep: bool,
        ) {
            prop_assert_eq!(misread(baud, baud, keep, &sent), sent.clone());
            // Two per cent off: the sampling stays within each bit.
            prop_assert_eq!(misread(100_000, 102_000, keep, &sent), sent.clone());
            prop_assert_eq!(misread(100_000, 98_000, keep, &sent), sent);
        }

        #[test]
        fn no_more_is_read_than_there_was_time_for(
            sent in proptest::collection::vec(any::<u8>(), 0..200), sent_baud in 300u32..4_000_000,
            read_baud in 300u32..4_000_000, keep: bool,
        ) {
            let read = misread(sent_baud, read_baud, keep, &sent);
            // A byte takes nine and a half bits; the last one may end in the idle time after.
            let half_bits_sent = 20 * sent.len() as u64 * u64::from(read_baud) / u64::from(sent_baud);
            prop_assert!(19 * read.len() as u64 <= half_bits_sent + 20, "{} bytes", read.len());
        }
    }
}
