//! The stretch of a spin in which the rate is steady.

use nalgebra::Vector3;

use super::segments::windows;
use super::{Mean, Movement, Sample, Span, median};

/// Window whose mean rate is judged, s.
const WINDOW_S: f64 = 0.25;
/// Fewest samples in it.
const LEAST_WINDOW: usize = 4;
/// Width of the band in which the most windows are looked for, of the rate.
const MODE_BAND: f64 = 0.1;
/// Windows this near the level say how far windows scatter, of the rate.
const SCATTER_BAND: f64 = 0.25;
/// Windows within this many standard deviations of the level belong to the plateau, ...
const TOLERANCE_SIGMAS: f64 = 4.0;
/// ... but at least within this much and at most within that much of the level.
const TOLERANCE_LIMITS: (f64, f64) = (0.02, 0.35);
/// Windows outside the band for no longer than this do not end a plateau, s.
const BRIDGE_S: f64 = 0.8;
/// A stretch whose first and last third differ by more than this, of the level, is a ramp.
const CREEP_LIMIT: f64 = 0.2;
/// Shortest plateau, s.
const LEAST_S: f64 = 1.0;

/// The steady part of a spin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plateau {
    /// Its samples.
    pub span: Span,
    /// Mean bias-corrected angular velocity, imu frame.
    pub omega: Mean,
    /// How far window means may be from the level to belong to it, rad/s.
    pub tolerance: f64,
}

impl Plateau {
    /// Finds the longest stretch of `spin` in which the means of 0.25 s keep near the commonest rate, short dips
    /// bridged; `None` where none lasts 1 s, or where it is one long ramp.
    pub fn find(samples: &[Sample], spin: &Movement) -> Option<Self> {
        let axis = spin.turning.angle.try_normalize(0.0)?;
        let offset = spin.span.first;
        let spans: Vec<Span> = windows(spin.span.of(samples), WINDOW_S, LEAST_WINDOW)
            .into_iter()
            .map(|span| Span { first: span.first + offset, end: span.end + offset })
            .collect();
        let rate = |sample: &Sample| (sample.omega_imu - spin.bias.at(sample.time_s)).dot(&axis);
        let means: Vec<f64> = spans
            .iter()
            .map(|span| span.of(samples).iter().map(rate).sum::<f64>() / span.count() as f64)
            .collect();
        let level = commonest(&means)?;
        let mut deviations: Vec<f64> = means
            .iter()
            .map(|mean| (mean - level).abs())
            .filter(|deviation| *deviation <= SCATTER_BAND * level)
            .collect();
        // 1.4826 times the median deviation is the standard deviation of a normal scatter.
        let scatter = 1.4826 * median(&mut deviations);
        let tolerance =
            (TOLERANCE_SIGMAS * scatter).clamp(TOLERANCE_LIMITS.0 * level, TOLERANCE_LIMITS.1 * level);
        let steady: Vec<Span> = spans
            .iter()
            .zip(&means)
            .filter(|(_, mean)| (*mean - level).abs() <= tolerance)
            .map(|(span, _)| *span)
            .collect();
        let span = longest_run(samples, &steady)?;
        let third = span.count() / 3;
        let mean_rate = |part: &[Sample]| part.iter().map(rate).sum::<f64>() / part.len().max(1) as f64;
        let [start, end] =
            [&span.of(samples)[..third], &span.of(samples)[span.count() - third..]].map(mean_rate);
        if (end - start).abs() > CREEP_LIMIT * level {
            return None;
        }
        let rates: Vec<Vector3<f64>> =
            span.of(samples).iter().map(|sample| sample.omega_imu - spin.bias.at(sample.time_s)).collect();
        Some(Self { span, omega: Mean::of_one_direction(&rates)?, tolerance })
    }
}

/// Mean of the most `means` that fit into a band of a tenth of their size; `None` when none is positive.
fn commonest(means: &[f64]) -> Option<f64> {
    let mut sorted: Vec<f64> = means.iter().copied().filter(|mean| *mean > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    let mut best: &[f64] = &[];
    let mut first = 0;
    for end in 1..=sorted.len() {
        while sorted[first] < (1.0 - MODE_BAND) * sorted[end - 1] {
            first += 1;
        }
        // At equal counts the faster one: a plateau is the end of a ramp.
        if end - first >= best.len() {
            best = &sorted[first..end];
        }
    }
    (!best.is_empty()).then(|| best.iter().sum::<f64>() / best.len() as f64)
}

/// The longest run of windows, pauses of up to [`BRIDGE_S`] bridged, if it lasts [`LEAST_S`].
fn longest_run(samples: &[Sample], steady: &[Span]) -> Option<Span> {
    let mut runs: Vec<Span> = Vec::new();
    for window in steady {
        match runs.last_mut() {
            Some(run) if samples[window.first].time_s - samples[run.end - 1].time_s <= BRIDGE_S => {
                run.end = window.end;
            }
            _ => runs.push(*window),
        }
    }
    let longest = runs.into_iter().max_by(|a, b| a.duration_s(samples).total_cmp(&b.duration_s(samples)))?;
    (longest.duration_s(samples) >= LEAST_S).then_some(longest)
}
