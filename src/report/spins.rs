//! Finding the spins of the chair in its measured yaw rate.
//!
//! A spin is found by a threshold on the low-passed rate and then lengthened at both ends by what the ramp needs to
//! reach the threshold, so that its ends are those of the ramps and not of the threshold.

use serde::Serialize;

use super::summary::rounded;
use crate::units::{DEG_PER_RAD, RAD_S_PER_RPM};

/// Length of the centred moving average, s: no lag, and nothing passes at multiples of 20 Hz.
const SMOOTHING_S: f64 = 0.05;
/// A rate below this is never a spin, rad/s (1.7 deg/s, or 0.29 rpm).
const MIN_THRESHOLD: f64 = 0.03;
/// A rate below this part of the run's peak is not a spin.
const THRESHOLD_OF_PEAK: f64 = 0.03;
/// The spin goes on until the rate is below this part of the threshold.
const RELEASE: f64 = 0.8;
/// A shorter pause between two spins to the same side does not part them, s.
const MIN_PAUSE_S: f64 = 0.5;
/// Anything shorter is a knock, s.
const MIN_DURATION_S: f64 = 0.5;
/// Anything that turns the chair by less is fidgeting, deg.
const MIN_TURN_DEG: f64 = 10.0;
/// Parts of the plateau rate between which a ramp is taken as straight.
const RAMP_FIT: (f64, f64) = (0.1, 0.6);

/// One spin of the chair.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spin {
    /// Start of the ramp up, tick time, s. The first measurement when the stream begins while the chair turns.
    pub start_s: f64,
    /// End of the ramp down, tick time, s; `None` when the stream ends while the chair turns.
    pub stop_s: Option<f64>,
    /// Median rate of the plateau, rpm, left positive.
    pub rate_rpm: f64,
}

/// A stretch of samples on one side of the threshold: indices of its first and last sample.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    first: usize,
    last: usize,
    sign: f64,
}

/// A yaw rate over time with vibration averaged out.
#[derive(Clone, Debug)]
pub struct YawRate {
    time_s: Vec<f64>,
    rate: Vec<f64>,
}

impl YawRate {
    /// Smooths samples of (time in s, yaw rate in rad/s) with a centred moving average of 50 ms.
    ///
    /// Times increase; they need not be even. Gaps are taken as a straight line. No samples: no spin, peak 0.
    pub fn new(samples: impl Iterator<Item = (f64, f64)>) -> Self {
        let (time_s, raw): (Vec<f64>, Vec<f64>) = samples.unzip();
        let mut rate = Vec::with_capacity(raw.len());
        let (mut from, mut to, mut sum) = (0, 0, 0.0);
        for &centre_s in &time_s {
            // Half a tick of slack keeps the window symmetric against the rounding of the times.
            let reach_s = 0.5 * SMOOTHING_S + 5e-4;
            while to < raw.len() && time_s[to] <= centre_s + reach_s {
                sum += raw[to];
                to += 1;
            }
            while time_s[from] < centre_s - reach_s {
                sum -= raw[from];
                from += 1;
            }
            rate.push(sum / (to - from) as f64);
        }
        Self { time_s, rate }
    }

    /// Largest magnitude of the smoothed rate, rad/s.
    pub fn peak(&self) -> f64 {
        self.rate.iter().fold(0.0, |peak, rate| rate.abs().max(peak))
    }

    /// The spins, in order of time.
    ///
    /// Neither end lies outside the samples. Spins to opposite sides are two spins, even without a pause; a pause under 0.5 s does not part a spin; what is
    /// shorter than 0.5 s or turns by less than 10 deg is none.
    pub fn spins(&self) -> Vec<Spin> {
        let threshold = MIN_THRESHOLD.max(THRESHOLD_OF_PEAK * self.peak());
        let mut stretches = self.stretches(threshold);
        // Knocks go first, so that one cannot bridge two spins.
        stretches.retain(|stretch| self.turn_deg(stretch) > 0.1 * MIN_TURN_DEG);
        let mut merged: Vec<Stretch> = Vec::new();
        for stretch in stretches {
            match merged.last_mut() {
                Some(before)
                    if before.sign == stretch.sign
                        && self.time_s[stretch.first] - self.time_s[before.last] < MIN_PAUSE_S =>
                {
                    before.last = stretch.last;
                }
                _ => merged.push(stretch),
            }
        }
        merged.retain(|stretch| {
            self.time_s[stretch.last] - self.time_s[stretch.first] >= MIN_DURATION_S
                && self.turn_deg(stretch) >= MIN_TURN_DEG
        });
        merged.iter().map(|stretch| self.spin(stretch)).collect()
    }

    /// Stretches that rise above `threshold` and last until the rate is below its release or changes sign.
    fn stretches(&self, threshold: f64) -> Vec<Stretch> {
        let mut found: Vec<Stretch> = Vec::new();
        let mut open: Option<Stretch> = None;
        for (index, &rate) in self.rate.iter().enumerate() {
            open = match open {
                Some(stretch) if rate * stretch.sign >= RELEASE * threshold => {
                    Some(Stretch { last: index, ..stretch })
                }
                ended => {
                    found.extend(ended);
                    let sign = rate.signum();
                    (rate.abs() >= threshold).then_some(Stretch { first: index, last: index, sign })
                }
            };
        }
        found.extend(open);
        found
    }

    /// Angle turned within a stretch, deg, positive.
    fn turn_deg(&self, stretch: &Stretch) -> f64 {
        let mut turn = 0.0;
        for index in stretch.first..stretch.last {
            let step_s = self.time_s[index + 1] - self.time_s[index];
            turn += 0.5 * (self.rate[index] + self.rate[index + 1]) * step_s;
        }
        turn.abs() * DEG_PER_RAD
    }

    fn spin(&self, stretch: &Stretch) -> Spin {
        let plateau = self.plateau(stretch);
        let (first, last) = (stretch.first, stretch.last);
        let begins_turning = first == 0;
        let ends_turning = last + 1 == self.time_s.len();
        let lead_s = if begins_turning { 0.0 } else { self.ramp_lead_s(first..=last, first, plateau) };
        let tail_s = self.ramp_lead_s((first..=last).rev(), last, plateau);
        let start_s = (self.time_s[first] - lead_s).max(self.time_s[0]);
        let end_s = self.time_s[self.time_s.len() - 1];
        let stop_s = (!ends_turning).then(|| rounded((self.time_s[last] + tail_s).min(end_s)));
        Spin { start_s: rounded(start_s), stop_s, rate_rpm: rounded(stretch.sign * plateau / RAD_S_PER_RPM) }
    }

    /// Median magnitude of the rate on the plateau, rad/s.
    ///
    /// First the median of everything above half the peak, then of what is within a fifth of that, then within 8 % of
    /// that: a short overshoot does not pull it, nor do ramps twice as long as the plateau.
    fn plateau(&self, stretch: &Stretch) -> f64 {
        let rates: Vec<f64> =
            self.rate[stretch.first..=stretch.last].iter().map(|rate| rate * stretch.sign).collect();
        let peak = rates.iter().fold(0.0_f64, |peak, &rate| peak.max(rate));
        let rough = median(rates.iter().copied().filter(|&rate| rate >= 0.5 * peak));
        [0.2, 0.08].into_iter().fold(rough, |plateau, share| {
            median(rates.iter().copied().filter(|rate| (rate - plateau).abs() <= share * plateau))
        })
    }

    /// Time the ramp took to reach the sample `end`, s: that sample's rate over the ramp's slope.
    ///
    /// `inwards` are the samples from `end` towards the plateau; the slope is a least-squares fit. Zero when there is
    /// no ramp to fit.
    fn ramp_lead_s(&self, inwards: impl Iterator<Item = usize>, end: usize, plateau: f64) -> f64 {
        let magnitude = |index: usize| self.rate[index].abs();
        let ramp: Vec<(f64, f64)> = inwards
            .take_while(|&index| magnitude(index) < RAMP_FIT.1 * plateau)
            .filter(|&index| magnitude(index) >= RAMP_FIT.0 * plateau)
            .map(|index| ((self.time_s[index] - self.time_s[end]).abs(), magnitude(index)))
            .collect();
        match slope(&ramp) {
            Some(slope) if slope > 0.0 => magnitude(end) / slope,
            _ => 0.0,
        }
    }
}

/// Slope of the least-squares line through `points`; `None` for fewer than two or when all lie above each other.
fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let count = points.len() as f64;
    let mean_x = points.iter().map(|point| point.0).sum::<f64>() / count;
    let mean_y = points.iter().map(|point| point.1).sum::<f64>() / count;
    let spread: f64 = points.iter().map(|(x, _)| (x - mean_x) * (x - mean_x)).sum();
    let common: f64 = points.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    (spread > 0.0).then(|| common / spread)
}

/// The middle value (the upper one of two); 0 for none.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
