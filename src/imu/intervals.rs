//! The usual time between samples, and what is longer.

/// Intervals whose median is the usual one.
const INTERVALS: usize = 15;
/// So many usual intervals are the longest that is no gap: one sample may be late or missing, two are not there. Halfway
/// between, so that the last digit of a time does not decide.
const LONGEST_IN_USUAL: f64 = 2.5;

/// Longest interval that counts as usual, s: below 5 Hz nothing is held longer than for 5 Hz.
pub(super) const LONGEST_USUAL_S: f64 = 0.2;

/// Keeps the median of the last 15 intervals, and counts as gaps those longer than two and a half of it.
#[derive(Clone, Debug, Default)]
pub struct Intervals {
    recent_s: [f64; INTERVALS],
    seen: usize,
    usual_s: Option<f64>,
    gaps: u64,
}

impl Intervals {
    /// Takes the time from one sample to the next, s. The first one is the usual one, whatever it is.
    pub fn take(&mut self, interval_s: f64) {
        let is_gap = self.usual_s.is_some_and(|usual_s| interval_s > LONGEST_IN_USUAL * usual_s);
        self.gaps += u64::from(is_gap);
        self.recent_s[self.seen % INTERVALS] = interval_s;
        self.seen += 1;
        let mut sorted = self.recent_s;
        let known = &mut sorted[..self.seen.min(INTERVALS)];
        let (_, &mut median, _) = known.select_nth_unstable_by((known.len() - 1) / 2, f64::total_cmp);
        self.usual_s = Some(median);
    }

    /// The usual interval, s, after the first one.
    pub fn usual_s(&self) -> Option<f64> {
        self.usual_s
    }

    /// Gaps so far.
    pub fn gaps(&self) -> u64 {
        self.gaps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_and_a_half_usual_intervals_are_a_gap_and_a_new_rate_is_learnt() {
        let mut intervals = Intervals::default();
        intervals.take(0.3);
        assert_eq!((intervals.gaps(), intervals.usual_s()), (0, Some(0.3)));
        (0..20).for_each(|_| intervals.take(0.01));
        assert_eq!(intervals.usual_s(), Some(0.01));
        for interval_s in [0.025, 0.026, 0.01, 1.0] {
            intervals.take(interval_s);
        }
        assert_eq!(intervals.gaps(), 2);
        (0..20).for_each(|_| intervals.take(0.1));
        // Each counts until the median is one of them.
        assert_eq!((intervals.gaps(), intervals.usual_s()), (2 + 7, Some(0.1)));
    }
}
