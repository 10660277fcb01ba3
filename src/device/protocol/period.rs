//! Loss seen in a device's own clock, for protocols without a sequence number.

/// Steps the usual one is the mean of.
const STEPS: usize = 9;
/// So many usual steps are a gap.
const LONG_STEP: f64 = 1.75;
/// A silence longer than this is no count of samples: the device paused or its clock was set, µs.
const LONGEST_GAP_US: u64 = 2_000_000;

/// Counts samples that are missing between two others by the time between them.
///
/// The usual step is the mean of the last nine usual ones, so that a clock that counts whole milliseconds does not
/// matter. A step of at least 1.75 of it is a gap, once the step after it is usual again: two long steps in a row are
/// a slower rate, not losses, and the usual step is learnt anew.
#[derive(Clone, Debug, Default)]
pub(super) struct PeriodWatch {
    steps_us: [u64; STEPS],
    count: usize,
    /// Samples missing if the present long step is a gap.
    suspected: u64,
    missing: u64,
}

impl PeriodWatch {
    /// Takes the time from one sample to the next by the device's clock, µs; zero and more than 2 s start anew.
    pub(super) fn step(&mut self, step_us: u64) {
        if !(1..=LONGEST_GAP_US).contains(&step_us) {
            self.restart();
            return;
        }
        let Some(usual_us) = self.usual_us() else {
            self.learn(step_us);
            return;
        };
        let steps = step_us as f64 / usual_us;
        if steps < LONG_STEP {
            self.missing += std::mem::take(&mut self.suspected);
            self.learn(step_us);
        } else if self.suspected > 0 {
            self.restart();
            self.learn(step_us);
        } else {
            self.suspected = (steps.round() as u64).saturating_sub(1);
        }
    }

    /// The clock was set or the rate changed: forgets the usual step, keeps the count.
    pub(super) fn restart(&mut self) {
        self.count = 0;
        self.suspected = 0;
    }

    /// Samples missing so far.
    pub(super) fn missing(&self) -> u64 {
        self.missing
    }

    fn learn(&mut self, step_us: u64) {
        self.steps_us[self.count % STEPS] = step_us;
        self.count += 1;
    }

    fn usual_us(&self) -> Option<f64> {
        (self.count >= STEPS).then(|| self.steps_us.iter().sum::<u64>() as f64 / STEPS as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn missing(steps_us: impl IntoIterator<Item = u64>) -> u64 {
        let mut watch = PeriodWatch::default();
        steps_us.into_iter().for_each(|step_us| watch.step(step_us));
        watch.missing()
    }

    #[test]
    fn gaps_among_usual_steps_are_counted_in_samples() {
        let steps = [vec![5_000; 20], vec![10_000], vec![4_900; 3], vec![20_100], vec![5_100]].concat();
        assert_eq!(missing(steps), 1 + 3);
    }

    #[test]
    fn a_slower_rate_a_pause_and_jitter_are_no_losses() {
        assert_eq!(missing([vec![5_000; 20], vec![10_000; 50]].concat()), 0);
        assert_eq!(missing([vec![5_000; 20], vec![3_000_000], vec![5_000; 20]].concat()), 0);
        assert_eq!(missing((0..200).map(|k| if k % 2 == 0 { 4_000 } else { 7_000 })), 0);
        // 800 Hz in whole milliseconds.
        assert_eq!(missing((0..200).map(|k| if k % 4 == 0 { 2_000 } else { 1_000 })), 0);
        assert_eq!(missing([vec![5_000; 20], vec![0], vec![5_000; 20]].concat()), 0);
    }

    #[test]
    fn a_faster_rate_is_learnt() {
        let steps = [vec![10_000; 20], vec![5_000; 20], vec![15_000], vec![5_000]].concat();
        assert_eq!(missing(steps), 2);
    }
}
