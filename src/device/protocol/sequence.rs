//! Sequence numbers held against sample times, so that a frame that comes twice or late is no loss.

/// Samples that come with a time up to this far back are late, not a new start of the device's clock, µs.
const LATEST_US: i32 = 1_000_000;

/// What a frame's sequence number turned out to say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sequel {
    /// The next frame, or the first after a loss.
    New,
    /// The frame before, once more.
    Repeated,
    /// A frame that a later one has overtaken.
    Late,
}

/// Counts what is missing by an 8-bit sequence number.
///
/// By the number alone a frame that comes again is a loss of 255 others. The time it carries tells the difference: a
/// frame not newer than the newest is repeated or late. Frames without a time are repeated if they carry the last
/// number and the last type.
#[derive(Clone, Debug, Default)]
pub(super) struct SequenceWatch {
    last: Option<(u8, u8)>,
    newest_us: Option<u32>,
    missing: u64,
    repeated: u64,
    late: u64,
}

impl SequenceWatch {
    /// Judges a frame of type `kind`. `time_us` is that of its first sample, modulo 2³², where it has one.
    pub(super) fn judge(&mut self, seq: u8, kind: u8, time_us: Option<u32>) -> Sequel {
        let lag_us = time_us.zip(self.newest_us).map(|(now, newest)| newest.wrapping_sub(now).cast_signed());
        match lag_us {
            Some(0) if self.last.is_some_and(|(last, _)| last == seq) => return self.repeat(),
            None if self.last == Some((seq, kind)) => return self.repeat(),
            Some(1..LATEST_US) if self.last.is_some_and(|(last, _)| last.wrapping_sub(seq) < 128) => {
                self.late += 1;
                // The gap it left has been counted.
                self.missing = self.missing.saturating_sub(1);
                return Sequel::Late;
            }
            _ => {}
        }
        if let Some((last, _)) = self.last {
            self.missing += u64::from(seq.wrapping_sub(last).wrapping_sub(1));
        }
        self.last = Some((seq, kind));
        self.newest_us = time_us.or(self.newest_us);
        Sequel::New
    }

    fn repeat(&mut self) -> Sequel {
        self.repeated += 1;
        Sequel::Repeated
    }

    /// The port was reopened: what was lost meanwhile cannot be told from the numbers.
    pub(super) fn rejoin(&mut self) {
        self.last = None;
        self.newest_us = None;
    }

    /// Frames missing so far. Falls again by one for each that comes late.
    pub(super) fn missing(&self) -> u64 {
        self.missing
    }

    /// Frames that came twice, and frames that came late.
    pub(super) fn disorder(&self) -> (u64, u64) {
        (self.repeated, self.late)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of one type, one a millisecond, in the order given.
    fn judge(numbers: &[u32]) -> (Vec<Sequel>, u64, (u64, u64)) {
        let mut watch = SequenceWatch::default();
        let sequels =
            numbers.iter().map(|&k| watch.judge(k as u8, 0x10, Some(k.wrapping_mul(1000)))).collect();
        (sequels, watch.missing(), watch.disorder())
    }

    #[test]
    fn losses_repeats_and_disorder_are_told_apart() {
        use Sequel::{Late, New, Repeated};
        assert_eq!(judge(&[0, 1, 2, 5]), (vec![New; 4], 2, (0, 0)));
        assert_eq!(judge(&[0, 1, 1, 2]), (vec![New, New, Repeated, New], 0, (1, 0)));
        assert_eq!(judge(&[0, 2, 1, 3]), (vec![New, New, Late, New], 0, (0, 1)));
        // A burst whose length looks like a late frame by the number alone.
        assert_eq!(judge(&[0, 1, 1 + 250, 252]), (vec![New; 4], 249, (0, 0)));
        assert_eq!(judge(&[0, 1, 256, 257]), (vec![New; 4], 254, (0, 0)));
    }

    #[test]
    fn frames_without_a_time_count_by_number_and_type() {
        let mut watch = SequenceWatch::default();
        assert_eq!(watch.judge(7, 0x30, None), Sequel::New);
        assert_eq!(watch.judge(7, 0x30, None), Sequel::Repeated);
        assert_eq!(watch.judge(9, 0x20, None), Sequel::New);
        watch.rejoin();
        assert_eq!(watch.judge(100, 0x20, None), Sequel::New);
        assert_eq!((watch.missing(), watch.disorder()), (1, (1, 0)));
    }

    #[test]
    fn a_restarted_device_is_not_late() {
        let mut watch = SequenceWatch::default();
        watch.judge(200, 0x10, Some(90_000_000));
        assert_eq!(watch.judge(0, 0x10, Some(1000)), Sequel::New);
    }
}
