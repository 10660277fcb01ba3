//! The intervals the metrics are taken over.

use crate::report::spins::Spin;

/// Start of a run without spin or push that no metric counts, s: the CoM starts 10 mm behind the centroid.
const SETTLE_S: f64 = 2.0;

/// A closed interval of tick time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// First moment, s.
    pub start_s: f64,
    /// Last moment, s.
    pub end_s: f64,
}

impl Window {
    /// The interval, or `None` when it would end before it starts.
    fn new(start_s: f64, end_s: f64) -> Option<Self> {
        (start_s <= end_s).then_some(Self { start_s, end_s })
    }

    /// Whether `time_s` lies in the interval.
    pub fn contains(&self, time_s: f64) -> bool {
        // Half a nanosecond absorbs the rounding of tick times.
        self.start_s - 5e-10 <= time_s && time_s <= self.end_s + 5e-10
    }
}

/// The intervals the metrics are taken over.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Windows {
    /// From the end of the last ramp down, or of the push if that is later, to the end of the run; with neither spin
    /// nor push the run after its first 2 s. `None` while the last spin still turns.
    pub after_stop: Option<Window>,
    /// Each spin from the start of its ramp up to the end of its ramp down, or to the end of the run.
    pub in_spin: Vec<Window>,
    /// End of the last ramp down, s.
    pub stop_s: Option<f64>,
    /// End of the push, s.
    pub push_end_s: Option<f64>,
}

impl Windows {
    /// The windows of a run over `span_s` (first and last tick time, s; `None` for a run without ticks).
    pub fn new(spins: &[Spin], push_end_s: Option<f64>, span_s: Option<(f64, f64)>) -> Self {
        let Some((first_s, last_s)) = span_s else {
            return Self::default();
        };
        let in_spin = spins
            .iter()
            .filter_map(|spin| Window::new(spin.start_s, spin.stop_s.unwrap_or(last_s).min(last_s)))
            .collect();
        let stop_s = spins.last().and_then(|spin| spin.stop_s);
        let still_turning = !spins.is_empty() && stop_s.is_none();
        let start_s = match (stop_s, push_end_s) {
            (Some(stop_s), Some(push_end_s)) => stop_s.max(push_end_s),
            (Some(only_s), None) | (None, Some(only_s)) => only_s,
            (None, None) => first_s + SETTLE_S,
        };
        let after_stop = if still_turning { None } else { Window::new(start_s, last_s) };
        Self { after_stop, in_spin, stop_s, push_end_s }
    }
}
