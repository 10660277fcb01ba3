//! Means of vectors and how far they may be off.

use nalgebra::{Matrix3, Rotation3, Vector3};

/// Most batches a stretch is cut into for the error of its mean.
const BATCHES: usize = 10;
/// Fewest samples in a batch.
const LEAST_BATCH: usize = 8;
/// Fewest batches from which a scatter is concluded.
const LEAST_BATCHES: usize = 4;

/// A number with its standard uncertainty.
///
/// `sigma` is one standard deviation, widened where it rests on few repetitions ([`coverage_factor`]), so that
/// value ± 2 sigma holds the truth in about 95 of 100 repetitions.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard uncertainty, same unit.
    pub sigma: f64,
}

impl Estimate {
    /// The same in another unit.
    pub fn scaled(self, factor: f64) -> Self {
        Self { value: self.value * factor, sigma: self.sigma * factor.abs() }
    }
}

/// A vector with the standard uncertainty of each component, as in [`Estimate`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct VectorEstimate {
    /// The vector.
    pub value: [f64; 3],
    /// Standard uncertainty of each component, same unit.
    pub sigma: [f64; 3],
}

impl VectorEstimate {
    /// Components of `value` with the square roots of the diagonal of `covariance`.
    pub fn new(value: &Vector3<f64>, covariance: &Matrix3<f64>) -> Self {
        Self { value: (*value).into(), sigma: covariance.diagonal().map(|v| v.max(0.0).sqrt()).into() }
    }

    /// The same in another unit.
    pub fn scaled(self, factor: f64) -> Self {
        Self { value: self.value.map(|v| v * factor), sigma: self.sigma.map(|v| v * factor.abs()) }
    }
}

/// Mean of a vector over a stretch of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mean {
    /// The mean.
    pub mean: Vector3<f64>,
    /// Covariance of the mean (3 x 3), not of the samples.
    pub covariance: Matrix3<f64>,
    /// Standard deviation of the samples, per axis.
    pub std: Vector3<f64>,
    /// Samples.
    pub count: usize,
}

impl Mean {
    /// Mean of `values`; `None` for fewer than two.
    ///
    /// Of vibration and of filtered noise neighbouring samples are alike, and scatter / √count is too small. The
    /// stretch is therefore also cut into up to 10 batches, and each axis takes the larger error of the two: that of
    /// independent samples or that of the batch means (Law & Kelton, *Simulation Modeling and Analysis*, section 9.5.3).
    pub fn of(values: &[Vector3<f64>]) -> Option<Self> {
        let count = values.len();
        let samples = covariance(values)?;
        let mean = centre(values);
        let independent = samples / count as f64;
        let widening = match batches(values) {
            Some(batch_means) => {
                let scatter = covariance(&batch_means)? / batch_means.len() as f64;
                let factor = coverage_factor(batch_means.len() - 1);
                Vector3::from_fn(|i, _| {
                    let ratio = scatter[(i, i)].max(0.0).sqrt() * factor / independent[(i, i)].sqrt();
                    if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
                })
            }
            None => Vector3::repeat(coverage_factor(count - 1)),
        };
        let widen = Matrix3::from_diagonal(&widening);
        let std = samples.diagonal().map(|variance| variance.max(0.0).sqrt());
        Some(Self { mean, covariance: widen * independent * widen, std, count })
    }

    /// The same of vectors that all have nearly one direction, such as the rates of a spin: errors are judged along and
    /// across it, so that a length that varies does not widen the error of the direction.
    pub fn of_one_direction(values: &[Vector3<f64>]) -> Option<Self> {
        let along = centre(values).try_normalize(0.0)?;
        let frame = Rotation3::face_towards(&along, &Vector3::ith(along.iamin(), 1.0)).into_inner();
        let turned: Vec<Vector3<f64>> = values.iter().map(|value| frame.transpose() * value).collect();
        let mean = Self::of(&turned)?;
        let std = covariance(values)?.diagonal().map(|variance| variance.max(0.0).sqrt());
        let covariance = frame * mean.covariance * frame.transpose();
        Some(Self { mean: frame * mean.mean, covariance, std, ..mean })
    }

    /// The mean with its errors.
    pub fn estimate(&self) -> VectorEstimate {
        VectorEstimate::new(&self.mean, &self.covariance)
    }
}

fn centre(values: &[Vector3<f64>]) -> Vector3<f64> {
    values.iter().sum::<Vector3<f64>>() / values.len().max(1) as f64
}

/// Covariance of the samples; `None` for fewer than two.
fn covariance(values: &[Vector3<f64>]) -> Option<Matrix3<f64>> {
    if values.len() < 2 {
        return None;
    }
    let mean = centre(values);
    let squares: Matrix3<f64> = values.iter().map(|value| (value - mean) * (value - mean).transpose()).sum();
    Some(squares / (values.len() - 1) as f64)
}

/// Means of equally long batches; `None` where there are too few samples for four.
fn batches(values: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
    let count = (values.len() / LEAST_BATCH).min(BATCHES);
    (count >= LEAST_BATCHES).then(|| {
        let length = values.len() / count;
        values.chunks_exact(length).take(count).map(centre).collect()
    })
}

/// How much wider a 95 % interval is when its standard deviation comes from a scatter with `degrees` of freedom:
/// Student's t over the normal quantile. Infinite for none.
pub fn coverage_factor(degrees: usize) -> f64 {
    /// Two-sided 95 % quantile of the normal distribution.
    const NORMAL: f64 = 1.959_964;
    /// The same of Student's t for 1 to 10 degrees of freedom.
    const STUDENT: [f64; 10] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228];
    match degrees {
        0 => f64::INFINITY,
        1..=10 => STUDENT[degrees - 1] / NORMAL,
        // First terms of the expansion in 1/degrees (Abramowitz & Stegun 26.7.5).
        _ => 1.0 + (1.2104 + 1.441 / degrees as f64) / degrees as f64,
    }
}
