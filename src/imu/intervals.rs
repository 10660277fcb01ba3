//! The usual time between samples, and what is longer.

/// Intervals whose median is the usual one.
const INTERVALS: usize = 15;
/// So many usual intervals are the longest that is no gap.
const LONGEST_IN_USUAL: f64 = 3.0;

/// Longest interval that counts as usual, s: below 5 Hz nothing is held longer than for 5 Hz.
pub(super) const LONGEST_USUAL_S: f64 = 0.2;

/// Keeps the median of the last 15 intervals, and counts as gaps those longer than three of it.
#[derive(Clone, Debug)]
pub struct Intervals {
    recent_s: [f64; INTERVALS],
    seen: usize,
    usual_s: Option<f64>,
    first_limit_s: f64,
    gaps: u64,
}

/// With the least limit for the first interval that a [`super::Resampler`] has.
impl Default for Intervals {
    fn default() -> Self {
        Self::new(LONGEST_USUAL_S)
    }
}

impl Intervals {
    /// Nothing seen yet; the first interval counts as a gap above `first_limit_s`.
    pub fn new(first_limit_s: f64) -> Self {
        Self { recent_s: [0.0; INTERVALS], seen: 0, usual_s: None, first_limit_s, gaps: 0 }
    }

    /// Takes the time from one sample to the next, s.
    pub fn take(&mut self, interval_s: f64) {
        let gap_from_s = self.usual_s.map_or(self.first_limit_s, |usual_s| LONGEST_IN_USUAL * usual_s);
        self.gaps += u64::from(interval_s > gap_from_s);
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
    fn more_than_three_usual_intervals_are_a_gap_and_a_new_rate_is_learnt() {
        let mut intervals = Intervals::new(0.2);
        intervals.take(0.3);
        assert_eq!((intervals.gaps(), intervals.usual_s()), (1, Some(0.3)));
        (0..20).for_each(|_| intervals.take(0.01));
        assert_eq!(intervals.usual_s(), Some(0.01));
        for interval_s in [0.03, 0.031, 0.01, 1.0] {
            intervals.take(interval_s);
        }
        assert_eq!(intervals.gaps(), 3);
        (0..20).for_each(|_| intervals.take(0.1));
        // Each counts until the median is one of them.
        assert_eq!((intervals.gaps(), intervals.usual_s()), (3 + 7, Some(0.1)));
    }
}
