//! Gaps between samples, and changes of the sample rate.

/// Steps that make a rate.
const STEPS: usize = 9;
/// Steps that differ from the usual one by less than this share are the same rate.
const SAME_RATE: f64 = 0.1;
/// Steps that differ from it by more than this share are another one.
const OTHER_RATE: f64 = 0.3;
/// So many usual steps are a gap: at least one sample is not there.
pub(super) const GAP_STEPS: f64 = 1.75;

/// Notices gaps at once, and by the second interval of the same length that it was no gap but a new sample rate.
///
/// Judges only devices whose last nine intervals were equal within 10 %: of an irregular stream nothing can be said.
#[derive(Clone, Debug, Default)]
pub(super) struct RateWatch {
    steps_s: [f64; STEPS],
    count: usize,
    /// The step before, if it was of another rate.
    other_s: Option<f64>,
    gaps: u64,
    changes: u64,
}

impl RateWatch {
    /// Takes the time from one sample to the next, s.
    pub(super) fn step(&mut self, step_s: f64) {
        let Some(usual_s) = self.usual_s() else {
            self.learn(step_s);
            return;
        };
        let differs = |from: f64, share: f64| (step_s - from).abs() > share * from;
        if !differs(usual_s, OTHER_RATE) {
            self.other_s = None;
            self.learn(step_s);
        } else if self.other_s.is_some_and(|other_s| !differs(other_s, SAME_RATE)) {
            self.changes += 1;
            self.gaps -= u64::from(is_gap(usual_s, self.other_s));
            self.restart();
            self.learn(step_s);
        } else {
            self.gaps += u64::from(is_gap(usual_s, Some(step_s)));
            self.other_s = Some(step_s);
        }
    }

    /// The stream began anew: forgets the rate, keeps the count.
    pub(super) fn restart(&mut self) {
        self.count = 0;
        self.other_s = None;
    }

    /// Gaps noticed so far. Falls again by one when the gap was the first interval of a slower rate.
    pub(super) fn gaps(&self) -> u64 {
        self.gaps
    }

    /// Changes noticed so far.
    pub(super) fn changes(&self) -> u64 {
        self.changes
    }

    fn learn(&mut self, step_s: f64) {
        self.steps_s[self.count % STEPS] = step_s;
        self.count += 1;
    }

    /// Mean of the last steps; `None` while there are too few, or when they differ.
    fn usual_s(&self) -> Option<f64> {
        let mean_s = self.steps_s.iter().sum::<f64>() / STEPS as f64;
        let equal = self.steps_s.iter().all(|step_s| (step_s - mean_s).abs() <= SAME_RATE * mean_s);
        (self.count >= STEPS && equal).then_some(mean_s)
    }
}

fn is_gap(usual_s: f64, step_s: Option<f64>) -> bool {
    step_s.is_some_and(|step_s| step_s >= GAP_STEPS * usual_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Changes and gaps.
    fn judge(steps_ms: &[f64]) -> (u64, u64) {
        let mut watch = RateWatch::default();
        steps_ms.iter().for_each(|step_ms| watch.step(step_ms * 1e-3));
        (watch.changes(), watch.gaps())
    }

    #[test]
    fn a_change_shows_at_the_second_interval_and_counts_once() {
        let steady = vec![5.0; 20];
        assert_eq!(judge(&[steady.clone(), vec![10.0]].concat()), (0, 1));
        assert_eq!(judge(&[steady.clone(), vec![10.0, 10.0]].concat()), (1, 0));
        assert_eq!(judge(&[steady.clone(), vec![2.5; 40]].concat()), (1, 0));
        assert_eq!(judge(&[steady.clone(), vec![10.0; 20], steady].concat()), (2, 0));
    }

    #[test]
    fn gaps_jitter_and_irregular_streams_are_no_change() {
        let gaps = [vec![5.0; 20], vec![20.0], vec![5.2; 20], vec![40.0, 5.0, 15.0, 5.0, 8.0]].concat();
        assert_eq!(judge(&gaps), (0, 3));
        let irregular: Vec<f64> = (0..200_u32).map(|k| 2.0 + f64::from(k * 7919 % 100)).collect();
        assert_eq!(judge(&irregular), (0, 0));
    }
}
