//! Where a sensor rests, and what it does between the rests.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::turning::PAUSE_S;
use super::{Bias, Mean, Sample, Turning, median};
use crate::imu::{ImuSample, MIN_REST_SAMPLES, RestDetector, RestLimits};
use crate::time::HostTime;
use crate::units::RAD_PER_DEG;

/// Shortest window that is judged as a whole, s.
const WINDOW_S: f64 = 0.25;
/// Shortest rest, s.
const LEAST_REST_S: f64 = 0.75;
/// Cut off each end of a rest that a movement borders, s: it may have begun within a window.
const TRIM_S: f64 = 0.2;
/// Windows at the ends of a rest whose mean rate is further from the others' than this many standard deviations of
/// theirs belong to a movement.
const ONSET_SIGMAS: f64 = 4.0;
/// A spin turns at least this far, rad, ...
const LEAST_SPIN: f64 = 90.0 * RAD_PER_DEG;
/// ... and so much of its path in one direction.
const SPIN_SHARE: f64 = 0.6;
/// A rocking moves at least this far back and forth, rad, ...
const LEAST_ROCKING: f64 = 20.0 * RAD_PER_DEG;
/// ... of which at most this share is left in the end, ...
const ROCKING_SHARE: f64 = 0.3;
/// ... and its rate lies at least so much (of its energy) along one axis.
const ROCKING_PURITY: f64 = 0.8;

/// Samples `first..end` of a slice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Index of the first sample.
    pub first: usize,
    /// Index behind the last one.
    pub end: usize,
}

impl Span {
    /// The samples.
    pub fn of(self, samples: &[Sample]) -> &[Sample] {
        &samples[self.first..self.end]
    }

    /// Number of samples.
    pub fn count(self) -> usize {
        self.end - self.first
    }

    /// Times of the first and the last sample, s; zero for an empty span.
    pub fn times_s(self, samples: &[Sample]) -> (f64, f64) {
        match self.of(samples) {
            [first, .., last] => (first.time_s, last.time_s),
            [only] => (only.time_s, only.time_s),
            [] => (0.0, 0.0),
        }
    }

    /// From the first sample to the last, s.
    pub fn duration_s(self, samples: &[Sample]) -> f64 {
        let (start_s, end_s) = self.times_s(samples);
        end_s - start_s
    }

    /// The rates as read, rad/s.
    pub fn omegas(self, samples: &[Sample]) -> Vec<Vector3<f64>> {
        self.of(samples).iter().map(|sample| sample.omega_imu).collect()
    }

    /// The specific forces as read, m/s², without the samples that have none.
    pub fn specific_forces(self, samples: &[Sample]) -> Vec<Vector3<f64>> {
        self.of(samples).iter().filter_map(|sample| sample.specific_force_imu).collect()
    }

    /// Longest interval between two of its samples, s.
    pub fn longest_gap_s(self, samples: &[Sample]) -> f64 {
        let pairs = self.of(samples).windows(2);
        pairs.map(|pair| pair[1].time_s - pair[0].time_s).fold(0.0, f64::max)
    }
}

/// What a movement is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MovementKind {
    /// At least a quarter turn in one direction.
    Spin,
    /// Back and forth about one axis: a nod or a shake.
    Rocking,
    /// Anything else.
    Other,
}

/// What happens between two rests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Movement {
    /// From the end of the rest before to the start of the rest after.
    pub span: Span,
    /// What it is.
    pub kind: MovementKind,
    /// What it turned.
    pub turning: Turning,
    /// The bias that was taken off.
    pub bias: Bias,
    /// Axis along which its rate has the most energy, unit, imu frame; the sign means nothing.
    pub main_axis: Vector3<f64>,
    /// Index in [`Segments::rests`] of the rest before.
    pub rest_before: Option<usize>,
    /// Index of the rest after.
    pub rest_after: Option<usize>,
}

/// All rests of a stretch of samples and the movements between them, in the order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Segments {
    /// Rests, without the parts next to a movement.
    pub rests: Vec<Span>,
    /// Movements.
    pub movements: Vec<Movement>,
}

impl Segments {
    /// Finds rests of at least 0.75 s by `limits`, and takes everything between them for movements.
    ///
    /// A gyroscope cannot tell a steady rotation slower than [`RestLimits::gyro_mean_max_rad_s`] from its own bias: it
    /// is taken for rest. No sample gives no segment.
    pub fn find(samples: &[Sample], limits: &RestLimits) -> Self {
        let rests = rests(samples, limits);
        let mut movements = Vec::new();
        for index in 0..=rests.len() {
            let first = if index == 0 { 0 } else { rests[index - 1].end };
            let end = rests.get(index).map_or(samples.len(), |span| span.first);
            if first < end {
                let (before, after) = (index.checked_sub(1), (index < rests.len()).then_some(index));
                movements.push(movement(samples, &rests, Span { first, end }, before, after));
            }
        }
        Self { rests, movements }
    }

    /// The spins, in the order of time.
    pub fn spins(&self) -> impl Iterator<Item = &Movement> {
        self.movements.iter().filter(|movement| movement.kind == MovementKind::Spin)
    }

    /// The spin that turns furthest.
    pub fn longest_spin(&self) -> Option<&Movement> {
        self.spins().max_by(|a, b| a.turning.angle.norm().total_cmp(&b.turning.angle.norm()))
    }

    /// The rests next to `movement`, in the order of time.
    pub fn rests_around(&self, movement: &Movement) -> impl Iterator<Item = Span> + use<'_> {
        [movement.rest_before, movement.rest_after].into_iter().flatten().map(|rest| self.rests[rest])
    }

    /// Covariance of the gyro bias that was taken off `movement`, (rad/s)²: of the mean of both rests, or of the only
    /// one. Zero without a rest.
    pub fn bias_covariance(&self, samples: &[Sample], movement: &Movement) -> Matrix3<f64> {
        let means: Vec<Matrix3<f64>> = self
            .rests_around(movement)
            .filter_map(|rest| Some(Mean::of(&rest.omegas(samples))?.covariance))
            .collect();
        means.iter().sum::<Matrix3<f64>>() / (means.len() * means.len()).max(1) as f64
    }
}

/// Whether `samples` are at rest by `limits`.
pub(super) fn is_quiet(samples: &[Sample], limits: &RestLimits) -> bool {
    let mut rest = RestDetector::default();
    for sample in samples {
        let as_imu = ImuSample {
            at: HostTime::default(),
            omega_imu: sample.omega_imu,
            specific_force_imu: sample.specific_force_imu.unwrap_or_default(),
        };
        rest.push(&as_imu, sample.specific_force_imu.is_some());
    }
    rest.is_at_rest(limits)
}

/// Runs of quiet windows that are long enough to be a rest, without the parts next to a movement.
fn rests(samples: &[Sample], limits: &RestLimits) -> Vec<Span> {
    let mut runs: Vec<Vec<Span>> = Vec::new();
    for window in windows(samples, WINDOW_S, MIN_REST_SAMPLES as usize) {
        if !is_quiet(window.of(samples), limits) || window.longest_gap_s(samples) > PAUSE_S {
            continue;
        }
        let goes_on = |last: &Span| {
            last.end == window.first && samples[window.first].time_s - samples[last.end - 1].time_s <= PAUSE_S
        };
        match runs.last_mut() {
            Some(run) if run.last().is_some_and(goes_on) => run.push(window),
            _ => runs.push(vec![window]),
        }
    }
    let settled = runs.iter().filter_map(|run| without_onsets(samples, run));
    settled
        .filter(|span| span.duration_s(samples) >= LEAST_REST_S)
        .map(|span| trimmed(samples, span))
        .collect()
}

/// A run of quiet windows without those at its ends whose mean rate is none of the rest's: a slow start of a movement
/// stays within the limits for a while, and would pass for bias.
fn without_onsets(samples: &[Sample], run: &[Span]) -> Option<Span> {
    let means: Vec<Vector3<f64>> = run
        .iter()
        .map(|window| window.omegas(samples).iter().sum::<Vector3<f64>>() / window.count() as f64)
        .collect();
    let middle = Vector3::from_fn(|i, _| median(&mut means.iter().map(|mean| mean[i]).collect::<Vec<_>>()));
    // 1.4826 times the median deviation is the standard deviation of a normal scatter. Of few windows it may come out
    // small by chance: the samples' own scatter is the least that their means can have.
    let by_median = Vector3::from_fn(|i, _| {
        1.4826 * median(&mut means.iter().map(|mean| (mean[i] - middle[i]).abs()).collect::<Vec<_>>())
    });
    let inner = run.iter().zip(&means).map(|(window, mean)| {
        let squares = window.of(samples).iter().map(|sample| (sample.omega_imu - mean).map(|d| d * d));
        squares.sum::<Vector3<f64>>() / (window.count() * window.count()) as f64
    });
    let scatter = by_median.sup(&(inner.sum::<Vector3<f64>>() / run.len() as f64).map(f64::sqrt));
    let belongs =
        |mean: &Vector3<f64>| (0..3).all(|i| (mean[i] - middle[i]).abs() <= ONSET_SIGMAS * scatter[i]);
    let first = means.iter().position(belongs)?;
    let last = means.iter().rposition(belongs)?;
    Some(Span { first: run[first].first, end: run[last].end })
}

/// Cuts `samples` into windows of at least `window_s` and `least` samples; what is left over joins the last.
pub(super) fn windows(samples: &[Sample], window_s: f64, least: usize) -> Vec<Span> {
    let mut windows: Vec<Span> = Vec::new();
    let mut first = 0;
    for index in 0..samples.len() {
        let enough = samples[index].time_s - samples[first].time_s >= window_s && index - first >= least;
        if enough {
            windows.push(Span { first, end: index });
            first = index;
        }
    }
    match windows.last_mut() {
        Some(last) => last.end = samples.len(),
        None if samples.len() >= least => windows.push(Span { first: 0, end: samples.len() }),
        None => {}
    }
    windows
}

fn trimmed(samples: &[Sample], span: Span) -> Span {
    let (start_s, end_s) = span.times_s(samples);
    let inside = |index: &usize| {
        let time_s = samples[*index].time_s;
        (span.first == 0 || time_s >= start_s + TRIM_S)
            && (span.end == samples.len() || time_s <= end_s - TRIM_S)
    };
    let first = (span.first..span.end).find(inside).unwrap_or(span.first);
    let end = (first..span.end).rev().find(inside).map_or(span.end, |last| last + 1);
    Span { first, end }
}

fn movement(
    samples: &[Sample],
    rests: &[Span],
    span: Span,
    rest_before: Option<usize>,
    rest_after: Option<usize>,
) -> Movement {
    let bias_of = |rest: usize| {
        let (start_s, end_s) = rests[rest].times_s(samples);
        let sum: Vector3<f64> = rests[rest].omegas(samples).iter().sum();
        (0.5 * (start_s + end_s), sum / rests[rest].count().max(1) as f64)
    };
    let bias = Bias { before: rest_before.map(bias_of), after: rest_after.map(bias_of) };
    let turning = Turning::over(samples, span, &bias);
    let (main_axis, purity) = main_axis(samples, span, &bias);
    let net = turning.angle.norm();
    let kind = if net >= LEAST_SPIN && net >= SPIN_SHARE * turning.path {
        MovementKind::Spin
    } else if turning.path >= LEAST_ROCKING
        && net <= ROCKING_SHARE * turning.path
        && purity >= ROCKING_PURITY
        && span.longest_gap_s(samples) <= PAUSE_S
    {
        MovementKind::Rocking
    } else {
        MovementKind::Other
    };
    Movement { span, kind, turning, bias, main_axis, rest_before, rest_after }
}

/// The axis along which the rate has the most energy, and that energy's share.
fn main_axis(samples: &[Sample], span: Span, bias: &Bias) -> (Vector3<f64>, f64) {
    let energy: Matrix3<f64> = span
        .of(samples)
        .iter()
        .map(|sample| {
            let rate = sample.omega_imu - bias.at(sample.time_s);
            rate * rate.transpose()
        })
        .sum();
    if !(energy.trace() > 0.0 && energy.trace().is_finite()) {
        return (Vector3::z(), 0.0);
    }
    let eigen = SymmetricEigen::new(energy);
    let largest = eigen.eigenvalues.imax();
    (eigen.eigenvectors.column(largest).into_owned(), eigen.eigenvalues[largest] / energy.trace())
}
