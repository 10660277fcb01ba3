//! Executed against commanded rate, where the command is a profile over time.
//!
//! The clocks of command and log need not be the same. Without the log's time of the profile's zero, the time is taken at
//! which the whole profile fits the measured rate best, and a delay is what a plateau has beyond that.

use nalgebra::Vector3;
use serde::Serialize;

use super::Against;
use super::profile::smoothed;
use crate::survey::{Estimate, Mean, Sample, Segments};

/// Shortest commanded plateau that is judged, s.
const LEAST_PLATEAU_S: f64 = 1.0;
/// Share of the rate within which neighbouring points are one plateau.
const SAME_RATE: f64 = 1e-3;
/// Longest profile, s: looking for the place where it fits takes the square of this.
const LONGEST_S: f64 = 7200.0;
/// Steps in which the start of the profile is looked for, s: first through the whole log, then around the best.
const STEPS_S: (f64, f64) = (0.1, 0.01);
/// An executed ramp is looked for from this long before the commanded one, s.
const EARLY_S: f64 = 2.0;
/// A root mean square error of this share of the commanded rates is doubted.
const DOUBTFUL_SHARE: f64 = 0.5;
/// An overshoot comes within this time from the start of a plateau, s.
const OVERSHOOT_S: f64 = 2.0;

/// The rate a chair was told to have: straight lines between points, zero before and after.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandedProfile {
    /// Time (s) and rate (deg/s, positive to the left). Two points of the same time are a step.
    points: Vec<(f64, f64)>,
    /// Time of the log at the profile's zero, s, where it is known.
    start_s: Option<f64>,
}

/// Why a list of points is no profile.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// It says nothing about a plateau.
    #[error("there is no plateau: nowhere is a rate other than 0 kept for 1 s")]
    NoPlateau,
    /// From its first point to its last it is longer than two hours.
    #[error("it covers {0} s, expected at most {LONGEST_S} s")]
    TooLong(f64),
    /// The point of this index is earlier than the one before.
    #[error("the time goes back")]
    GoesBack(usize),
    /// The point of this index is not a number.
    #[error("time and rate must be finite")]
    NotFinite(usize),
}

/// A stretch of constant commanded rate.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Level {
    start_s: f64,
    end_s: f64,
    rate: f64,
    /// Rate before the ramp to it.
    before: f64,
    /// When the ramp is half way, s.
    half_way_s: f64,
}

/// Measured against the commanded profile.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProfileReport {
    /// Time of the log at the profile's zero, s.
    pub start_s: f64,
    /// It was given; else it is where the whole profile fits best, to 0.01 s, and delays are against that.
    pub start_given: bool,
    /// Root mean square of measured minus commanded rate over the time of the profile, deg/s.
    pub rms_error_deg_s: f64,
    /// The plateaus of the profile that are in the log, in the order of time.
    pub plateaus: Vec<CommandedPlateau>,
}

/// One commanded plateau. Its second half is taken for steady.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CommandedPlateau {
    /// Commanded beginning in the log's time, s.
    pub start_s: f64,
    /// Commanded length, s.
    pub duration_s: f64,
    /// Commanded rate, deg/s; positive is to the left.
    pub commanded_deg_s: f64,
    /// Mean rate of the second half, deg/s.
    pub executed_deg_s: Estimate,
    /// The one against the other, deg/s.
    pub error: Against,
    /// Executed minus commanded time at which the ramp is half way, s; `None` where the log has no such moment.
    pub delay_s: Option<f64>,
    /// Peak of the smoothed rate (0.2 s) in the first 2 s past that of the second half, deg/s; zero without one.
    pub overshoot_deg_s: f64,
    /// The same, percent of the step from the rate before.
    pub overshoot_percent: f64,
    /// Standard deviation of the rate in the second half, deg/s.
    pub ripple_rms_deg_s: f64,
}

impl ProfileReport {
    /// What speaks against this being the profile of these data.
    pub(super) fn doubt(&self) -> Option<String> {
        let told = self.plateaus.iter().map(|plateau| plateau.commanded_deg_s);
        let squares: f64 = told.map(|rate| rate * rate).sum();
        let commanded = (squares / self.plateaus.len() as f64).sqrt();
        (self.rms_error_deg_s > DOUBTFUL_SHARE * commanded).then(|| {
            format!(
                "the rate differs from the commanded profile by {:.1} deg/s rms, where {commanded:.1} deg/s were \
                 commanded: is it the profile of these data?",
                self.rms_error_deg_s
            )
        })
    }
}

impl CommandedProfile {
    /// A profile through `points` of time (s) and rate (deg/s); `start_s` is the log's time of its zero, if known.
    ///
    /// # Errors
    /// [`ProfileError`]: values that are not finite, times that go back or cover more than two hours, no plateau
    /// of 1 s.
    pub fn new(points: Vec<(f64, f64)>, start_s: Option<f64>) -> Result<Self, ProfileError> {
        if let Some(bad) = points.iter().position(|(time_s, rate)| !(time_s.is_finite() && rate.is_finite()))
        {
            return Err(ProfileError::NotFinite(bad));
        }
        if let Some(before) = points.windows(2).position(|pair| pair[1].0 < pair[0].0) {
            return Err(ProfileError::GoesBack(before + 1));
        }
        if let [first, .., last] = points.as_slice()
            && last.0 - first.0 > LONGEST_S
        {
            return Err(ProfileError::TooLong(last.0 - first.0));
        }
        let profile = Self { points, start_s };
        if profile.levels().is_empty() { Err(ProfileError::NoPlateau) } else { Ok(profile) }
    }

    /// Commanded rate, deg/s.
    fn rate(&self, time_s: f64) -> f64 {
        let next = self.points.partition_point(|(at_s, _)| *at_s <= time_s);
        match (next.checked_sub(1).map(|last| self.points[last]), self.points.get(next)) {
            (Some((from_s, from)), Some((to_s, to))) => {
                from + (to - from) * ((time_s - from_s) / (to_s - from_s))
            }
            _ => 0.0,
        }
    }

    fn levels(&self) -> Vec<Level> {
        let same = |a: f64, b: f64| (a - b).abs() <= SAME_RATE * a.abs().max(b.abs());
        let mut levels = Vec::new();
        let mut first = 0;
        while first < self.points.len() {
            let (start_s, rate) = self.points[first];
            let count = self.points[first..].iter().take_while(|(_, other)| same(rate, *other)).count();
            let end_s = self.points[first + count - 1].0;
            if rate != 0.0 && end_s - start_s >= LEAST_PLATEAU_S {
                let (before, half_way_s) = self.ramp_to(first);
                levels.push(Level { start_s, end_s, rate, before, half_way_s });
            }
            first += count;
        }
        levels
    }

    /// Rate before the ramp that ends in point `top`, and when it is half way, s.
    fn ramp_to(&self, top: usize) -> (f64, f64) {
        let (top_s, rate) = self.points[top];
        let Some(mut foot) = top.checked_sub(1) else { return (0.0, top_s) };
        let rises = rate > self.points[foot].1;
        while foot > 0
            && self.points[foot - 1].1 != self.points[foot].1
            && (self.points[foot].1 > self.points[foot - 1].1) == rises
        {
            foot -= 1;
        }
        let before = self.points[foot].1;
        let half = 0.5 * (before + rate);
        let crossing = self.points[foot..=top].windows(2).find_map(|pair| crossing(&pair[0], &pair[1], half));
        (before, crossing.unwrap_or(top_s))
    }
}

/// Time at which the line between two points has this value.
fn crossing(from: &(f64, f64), to: &(f64, f64), value: f64) -> Option<f64> {
    let (before, after) = (from.1 - value, to.1 - value);
    (before * after <= 0.0 && before != after).then(|| from.0 + (to.0 - from.0) * before / (before - after))
}

/// Holds the rate about `axis` (unit, imu frame, up) against `profile`. `None` when no plateau of it is in the log.
pub(super) fn against_profile(
    samples: &[Sample],
    segments: &Segments,
    axis: &Vector3<f64>,
    profile: &CommandedProfile,
) -> Option<ProfileReport> {
    let rates = rates(samples, segments, axis);
    let times_s: Vec<f64> = samples.iter().map(|sample| sample.time_s).collect();
    let executed = Executed { smoothed: smoothed(&times_s, &rates), times_s, rates };
    let start_s = profile.start_s.unwrap_or_else(|| executed.best_start_s(profile));
    let plateaus: Vec<CommandedPlateau> =
        profile.levels().iter().filter_map(|level| executed.plateau(level, start_s)).collect();
    let (from_s, to_s) = (profile.points.first()?.0 + start_s, profile.points.last()?.0 + start_s);
    let inside = executed.indices(from_s, to_s);
    let squares: f64 = inside
        .clone()
        .map(|i| executed.rates[i] - profile.rate(executed.times_s[i] - start_s))
        .map(|error| error * error)
        .sum();
    (!plateaus.is_empty()).then(|| ProfileReport {
        start_s,
        start_given: profile.start_s.is_some(),
        rms_error_deg_s: (squares / inside.len().max(1) as f64).sqrt(),
        plateaus,
    })
}

/// Rate about `axis`, bias removed as each stretch has it, deg/s.
fn rates(samples: &[Sample], segments: &Segments, axis: &Vector3<f64>) -> Vec<f64> {
    let mut rates: Vec<f64> = samples.iter().map(|sample| sample.omega_imu.dot(axis)).collect();
    for rest in &segments.rests {
        let mean = rates[rest.first..rest.end].iter().sum::<f64>() / rest.count() as f64;
        rates[rest.first..rest.end].iter_mut().for_each(|rate| *rate -= mean);
    }
    for movement in &segments.movements {
        for index in movement.span.first..movement.span.end {
            rates[index] -= movement.bias.at(samples[index].time_s).dot(axis);
        }
    }
    rates.iter_mut().for_each(|rate| *rate = rate.to_degrees());
    rates
}

/// What the chair did.
struct Executed {
    times_s: Vec<f64>,
    /// Deg/s.
    rates: Vec<f64>,
    smoothed: Vec<f64>,
}

impl Executed {
    /// Indices of the samples from one time to another.
    fn indices(&self, from_s: f64, to_s: f64) -> std::ops::Range<usize> {
        let index = |time_s: f64| self.times_s.partition_point(|at_s| *at_s < time_s);
        index(from_s)..index(to_s).max(index(from_s))
    }

    /// Smoothed rates at evenly spaced times from the first sample on.
    fn even(&self, step_s: f64) -> Vec<(f64, f64)> {
        let (Some(first_s), Some(last_s)) = (self.times_s.first(), self.times_s.last()) else {
            return Vec::new();
        };
        let count = ((last_s - first_s) / step_s) as usize + 1;
        let mut next = 0;
        (0..count)
            .map(|index| {
                let time_s = first_s + index as f64 * step_s;
                while next + 1 < self.times_s.len() && self.times_s[next] < time_s {
                    next += 1;
                }
                (time_s, self.smoothed[next])
            })
            .collect()
    }

    /// Where the profile fits best, least squares.
    fn best_start_s(&self, profile: &CommandedProfile) -> f64 {
        let (Some(first), Some(last)) = (profile.points.first(), profile.points.last()) else { return 0.0 };
        let coarse = self.even(STEPS_S.0);
        let count = ((last.0 - first.0) / STEPS_S.0) as usize + 1;
        let told: Vec<f64> =
            (0..count).map(|index| profile.rate(first.0 + index as f64 * STEPS_S.0)).collect();
        // Outside the profile nothing depends on where it is.
        let misfit = |shift: usize| {
            let pairs = told
                .iter()
                .enumerate()
                .filter_map(|(index, told)| Some((told, coarse.get((shift + index).checked_sub(count)?)?.1)));
            pairs.map(|(told, done)| told * told - 2.0 * told * done).sum::<f64>()
        };
        let judged = (0..count + coarse.len()).map(|shift| (misfit(shift), shift));
        let best = judged.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(count, |(_, shift)| shift);
        let near_s =
            self.times_s.first().copied().unwrap_or(0.0) - first.0 + (best as f64 - count as f64) * STEPS_S.0;
        let fine = self.even(STEPS_S.1);
        let misfit = |start_s: f64| {
            let errors = fine.iter().map(|(time_s, done)| done - profile.rate(time_s - start_s));
            errors.map(|error| error * error).sum::<f64>()
        };
        let steps = (STEPS_S.0 / STEPS_S.1) as i32;
        let starts = (-steps..=steps).map(|step| near_s + f64::from(step) * STEPS_S.1);
        let judged = starts.map(|start_s| (misfit(start_s), start_s));
        judged.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(near_s, |(_, start_s)| start_s)
    }

    /// One plateau; `None` when it is not wholly in the log.
    fn plateau(&self, level: &Level, start_s: f64) -> Option<CommandedPlateau> {
        let (from_s, to_s) = (level.start_s + start_s, level.end_s + start_s);
        let covered = *self.times_s.first()? <= from_s && to_s <= *self.times_s.last()?;
        let steady = self.indices(0.5 * (from_s + to_s), to_s);
        let values: Vec<Vector3<f64>> = steady.map(|i| Vector3::x() * self.rates[i]).collect();
        let mean = Mean::of(&values).filter(|_| covered)?;
        let executed = Estimate { value: mean.mean.x, sigma: mean.covariance[(0, 0)].max(0.0).sqrt() };
        let step = level.rate - level.before;
        let early = self.indices(from_s, to_s.min(from_s + OVERSHOOT_S));
        let past = early.map(|i| (self.smoothed[i] - executed.value) * step.signum()).fold(0.0, f64::max);
        Some(CommandedPlateau {
            start_s: from_s,
            duration_s: to_s - from_s,
            commanded_deg_s: level.rate,
            executed_deg_s: executed,
            error: Against::of(executed.value, level.rate),
            delay_s: self.delay_s(level, start_s),
            overshoot_deg_s: past,
            overshoot_percent: 100.0 * past / step.abs(),
            ripple_rms_deg_s: mean.std.x,
        })
    }

    fn delay_s(&self, level: &Level, start_s: f64) -> Option<f64> {
        let half_way_s = level.half_way_s + start_s;
        let half = 0.5 * (level.before + level.rate);
        let inside = self.indices(half_way_s - EARLY_S, level.end_s + start_s);
        let point = |i: usize| (self.times_s[i], self.smoothed[i]);
        let crossings = inside.skip(1).filter_map(|i| crossing(&point(i - 1), &point(i), half));
        let delays = crossings.map(|at_s| at_s - half_way_s);
        delays.min_by(|a, b| a.abs().total_cmp(&b.abs()))
    }
}

#[cfg(test)]
mod tests;
