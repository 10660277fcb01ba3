//! The rate over time: ramps, overshoot, settling.

use serde::Serialize;

use super::Against;

/// Length of the window over which the rate is smoothed, s.
const SMOOTHING_S: f64 = 0.2;
/// Shares of the plateau's rate between which a ramp is measured.
const RAMP_SHARES: (f64, f64) = (0.1, 0.9);
/// The settled rate stays within this share of the plateau's, or within three standard deviations of the smoothed ripple
/// where that is more.
const SETTLED_SHARE: f64 = 0.02;
const SETTLED_SIGMAS: f64 = 3.0;

/// One ramp of the rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ramp {
    /// When the line through 10 and 90 % begins, s.
    pub start_s: f64,
    /// How long that line takes from rest to the plateau or back, s.
    pub duration_s: f64,
    /// Its slope, deg/s².
    pub acceleration_deg_s2: f64,
    /// Duration against the commanded one, s.
    pub commanded: Option<Against>,
    /// The ramp takes no longer than a few samples: duration and slope are bounds, not measurements.
    pub unresolved: bool,
}

/// What happens between ramp and plateau.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Overshoot {
    /// Peak of the smoothed rate (0.2 s) over the plateau's, deg/s; zero when it never exceeds it.
    pub overshoot_deg_s: f64,
    /// The same, percent of the plateau's rate.
    pub overshoot_percent: f64,
    /// Standard deviation of the equally smoothed rate in the plateau, percent: an overshoot of up to three times this is
    /// ripple.
    pub smoothed_ripple_percent: f64,
    /// From the start of the ramp until the smoothed rate stays within `settled_band_percent`, s.
    pub settling_s: f64,
    /// Half width of that band, percent of the plateau's rate.
    pub settled_band_percent: f64,
}

/// The rate of one spin about its axis, positive in the sense of the spin.
pub(super) struct Profile {
    pub(super) times_s: Vec<f64>,
    /// Rad/s.
    pub(super) rates: Vec<f64>,
    smoothed: Vec<f64>,
}

impl Profile {
    pub(super) fn new(times_s: Vec<f64>, rates: Vec<f64>) -> Self {
        let smoothed = smoothed(&times_s, &rates);
        Self { times_s, rates, smoothed }
    }

    /// The ramp that ends in the plateau's first sample `plateau`, at `level` rad/s.
    pub(super) fn ramp_up(&self, plateau: usize, level: f64, commanded_s: Option<f64>) -> Option<Ramp> {
        // Backwards from the plateau: the last time it was slower.
        let high = self.crossing((1..=plateau).rev(), RAMP_SHARES.1 * level)?;
        let low = self.crossing((1..=high.1).rev(), RAMP_SHARES.0 * level)?;
        Some(self.ramp((low.0, high.0), level, 1.0, commanded_s))
    }

    /// The ramp that begins behind the plateau's last sample.
    pub(super) fn ramp_down(&self, plateau: usize, level: f64, commanded_s: Option<f64>) -> Option<Ramp> {
        let high = self.crossing(plateau + 1..self.rates.len(), RAMP_SHARES.1 * level)?;
        let low = self.crossing(high.1..self.rates.len(), RAMP_SHARES.0 * level)?;
        Some(self.ramp((high.0, low.0), level, -1.0, commanded_s))
    }

    fn ramp(&self, (from_s, to_s): (f64, f64), level: f64, sense: f64, commanded_s: Option<f64>) -> Ramp {
        let share = RAMP_SHARES.1 - RAMP_SHARES.0;
        let step_s =
            (self.times_s[self.times_s.len() - 1] - self.times_s[0]) / (self.times_s.len() - 1) as f64;
        let duration_s = (to_s - from_s).max(share * step_s) / share;
        Ramp {
            start_s: from_s - RAMP_SHARES.0 * duration_s,
            duration_s,
            acceleration_deg_s2: (sense * level / duration_s).to_degrees(),
            commanded: commanded_s.map(|commanded| Against::of(duration_s, commanded)),
            unresolved: duration_s < 4.0 * step_s,
        }
    }

    /// Time at which the rate crosses `rate` between a sample and the one before, and the index; indices as given.
    fn crossing(&self, mut indices: impl Iterator<Item = usize>, rate: f64) -> Option<(f64, usize)> {
        let index = indices.find(|&i| (self.rates[i - 1] - rate) * (self.rates[i] - rate) <= 0.0)?;
        let (before, after) = (self.rates[index - 1], self.rates[index]);
        let share = if after == before { 0.0 } else { (rate - before) / (after - before) };
        let (from_s, to_s) = (self.times_s[index - 1], self.times_s[index]);
        Some((from_s + share * (to_s - from_s), index))
    }

    /// Overshoot and settling after a ramp that begins at `start_s`; `plateau` are the plateau's first and last index.
    pub(super) fn overshoot(&self, start_s: f64, plateau: (usize, usize), level: f64) -> Overshoot {
        let settled = &self.smoothed[plateau.0..=plateau.1];
        let ripple = (settled.iter().map(|rate| (rate - level) * (rate - level)).sum::<f64>()
            / settled.len() as f64)
            .sqrt();
        let first = self.times_s.iter().position(|&time_s| time_s >= start_s).unwrap_or(0);
        // Into the plateau too: a small overshoot is part of it.
        let until_s = self.times_s[plateau.0] + (self.times_s[plateau.1] - self.times_s[plateau.0]).min(2.0);
        let early =
            self.times_s.iter().zip(&self.smoothed).skip(first).take_while(|(time_s, _)| **time_s <= until_s);
        let peak = early.map(|(_, rate)| *rate).fold(level, f64::max);
        let band = (SETTLED_SHARE * level).max(SETTLED_SIGMAS * ripple);
        let last_out = (first..=plateau.1.min(self.last_before(until_s)))
            .rev()
            .find(|&i| (self.smoothed[i] - level).abs() > band);
        Overshoot {
            overshoot_deg_s: (peak - level).to_degrees(),
            overshoot_percent: 100.0 * (peak / level - 1.0),
            smoothed_ripple_percent: 100.0 * ripple / level,
            settling_s: last_out.map_or(0.0, |i| self.times_s[(i + 1).min(plateau.1)] - start_s),
            settled_band_percent: 100.0 * band / level,
        }
    }

    fn last_before(&self, time_s: f64) -> usize {
        self.times_s.partition_point(|&at_s| at_s <= time_s).saturating_sub(1)
    }
}

/// Moving mean over [`SMOOTHING_S`], centred.
pub(super) fn smoothed(times_s: &[f64], rates: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0];
    sums.extend(rates.iter().scan(0.0, |sum, rate| {
        *sum += rate;
        Some(*sum)
    }));
    let (mut first, mut end) = (0, 0);
    let mean = |&time_s: &f64| {
        while times_s[first] < time_s - 0.5 * SMOOTHING_S {
            first += 1;
        }
        while end < times_s.len() && times_s[end] <= time_s + 0.5 * SMOOTHING_S {
            end += 1;
        }
        (sums[end] - sums[first]) / (end - first) as f64
    };
    times_s.iter().map(mean).collect()
}
