//! What the sequence numbers of one component say: how many frames are missing, and which only came late.

/// A frame this far behind the newest may have been overtaken; further back the component was restarted.
const LATEST: u8 = 63;
/// So many frames in a row behind the newest, and it is the component that began anew.
const RESTART_AFTER: u8 = 3;

/// Counts missing frames by their 8-bit number. A frame that comes late takes its loss back, which
/// [`SequenceWatch`](crate::device::protocol::sequence::SequenceWatch) does not: radios and companions of vehicles forward
/// frames in another order than they were numbered.
#[derive(Debug, Default)]
pub(super) struct Sequence {
    newest: Option<u8>,
    /// Bit n: the frame n before the newest has come, or was sent before the first.
    came: u64,
    late_in_row: u8,
    missing: u64,
}

impl Sequence {
    /// Takes the number of the next frame.
    pub(super) fn take(&mut self, number: u8) {
        let Some(newest) = self.newest else { return self.begin(number) };
        let (ahead, behind) = (number.wrapping_sub(newest), newest.wrapping_sub(number));
        match behind {
            0 => {}
            1..=LATEST if self.late_in_row + 1 < RESTART_AFTER => {
                self.late_in_row += 1;
                let bit = 1 << behind;
                self.missing -= u64::from(self.came & bit == 0);
                self.came |= bit;
            }
            1..=127 => self.begin(number),
            _ => {
                self.missing += u64::from(ahead - 1);
                self.came = self.came.checked_shl(u32::from(ahead)).unwrap_or(0) | 1;
                (self.newest, self.late_in_row) = (Some(number), 0);
            }
        }
    }

    /// The numbers begin with this one; the count stays.
    pub(super) fn begin(&mut self, number: u8) {
        (self.newest, self.came, self.late_in_row) = (Some(number), u64::MAX, 0);
    }

    /// What comes next begins the numbers.
    pub(super) fn forget(&mut self) {
        self.newest = None;
    }

    /// Frames missing so far. Falls again by one for each that comes late.
    pub(super) fn missing(&self) -> u64 {
        self.missing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn missing(numbers: &[u8]) -> u64 {
        let mut sequence = Sequence::default();
        numbers.iter().for_each(|number| sequence.take(*number));
        sequence.missing()
    }

    #[test]
    fn a_late_frame_takes_its_loss_back_and_a_repeated_one_changes_nothing() {
        assert_eq!(missing(&[250, 251, 254, 0]), 2 + 1);
        assert_eq!(missing(&[0, 2, 1, 3, 4]), 0);
        assert_eq!(missing(&[254, 1, 255, 0, 2]), 0, "across the wrap");
        assert_eq!(missing(&[0, 3, 1, 1, 4]), 1, "late, and once more");
        assert_eq!(missing(&[5, 6, 6, 5, 7]), 0);
        assert_eq!(missing(&[5, 4, 6]), 0, "before the first");
    }

    #[test]
    fn a_restart_is_no_disorder() {
        assert_eq!(missing(&[100, 0, 1, 2]), 0);
        assert_eq!(missing(&[20, 21, 0, 1, 2, 3, 5]), 1);
        assert_eq!(missing(&[200, 0, 1]), 55, "ahead is a loss");
    }
}
