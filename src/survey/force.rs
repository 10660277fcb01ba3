//! What an accelerometer that turns with a chair reads, taken apart: its own offset, gravity, and the arm.
//!
//! Across the axis `u` (unit, up), in axes that turn with the sensor, the specific force is
//!
//! ```text
//! f = offset + R(u, -theta) lean - omega² arm
//! ```
//!
//! with `theta` the angle turned and `omega` the rate. `offset` stands still in the sensor: the accelerometer's bias and
//! cross-axis error. `lean` is the gravity across an axis that is not vertical: it goes round once per turn. `arm` is
//! the horizontal way from the axis to the sensor; at rest it cannot be felt. Rest alone gives `offset + lean`, a steady
//! spin alone `offset - omega² arm`; both together and a good part of a turn give all three by least squares.

use nalgebra::{Matrix2x3, Matrix3, Matrix6, SMatrix, Vector2, Vector3, Vector6};

use super::segments::windows;
use super::{Estimate, Movement, Plateau, Sample, Span, coverage_factor};

/// Length of a block whose mean is one observation, s.
const BLOCK_S: f64 = 0.25;
/// Fewest samples in a block.
const LEAST_BLOCK: usize = 4;
/// Times the weights of rest and spin are found from the residuals.
const REWEIGHTINGS: usize = 3;
/// Unknowns: three vectors in a plane.
const UNKNOWNS: usize = 6;

type Row = SMatrix<f64, 2, UNKNOWNS>;

/// The parts of the specific force across the axis, imu frame, each with the covariance of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurningForce {
    /// Part that stands still in the sensor, m/s².
    pub offset: Vector3<f64>,
    /// Its covariance.
    pub offset_covariance: Matrix3<f64>,
    /// Gravity across the axis at the heading where the movement begins, m/s².
    pub lean: Vector3<f64>,
    /// Its covariance.
    pub lean_covariance: Matrix3<f64>,
    /// From the axis to the sensor, horizontally, m.
    pub arm: Vector3<f64>,
    /// Its covariance.
    pub arm_covariance: Matrix3<f64>,
}

/// Factors on the raw readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// On the bias-corrected rate, with its uncertainty: an unknown factor is 1 with a wide one.
    pub gyro: Estimate,
    /// On the specific force. The offset along gravity hides in it, hence its uncertainty.
    pub specific_force: Estimate,
}

/// One block of samples.
struct Block {
    at_rest: bool,
    row: Row,
    force: Vector2<f64>,
}

impl TurningForce {
    /// Takes the force of `spin` and the rests around it apart; `up` is the axis.
    ///
    /// `up_covariance` is that of its direction. `None` without a rest next to the spin, without an accelerometer, or where
    /// the equations have no solution. Where they hardly have one, for a slow spin or less than half a turn, the covariances
    /// say so.
    pub fn fit(
        samples: &[Sample],
        rests: &[Span],
        (spin, plateau): (&Movement, &Plateau),
        (up, up_covariance): (&Vector3<f64>, &Matrix3<f64>),
        scales: &Scales,
    ) -> Option<Self> {
        let plane = across(up);
        let along = mean_along(plateau.span.of(samples), up)?;
        let solve = |gyro_scale: f64| {
            let blocks = blocks(
                samples,
                rests,
                (spin, plateau),
                (up, &plane),
                (gyro_scale, scales.specific_force.value),
            );
            solution(&blocks)
        };
        let (unknowns, mut covariance) = solve(scales.gyro.value)?;
        if scales.gyro.sigma > 0.0 {
            let moved = solve(scales.gyro.value + scales.gyro.sigma)?.0 - unknowns;
            covariance += moved * moved.transpose();
        }
        let relative = scales.specific_force.sigma / scales.specific_force.value;
        covariance += unknowns * unknowns.transpose() * (relative * relative);
        let vector = |first: usize| plane.transpose() * unknowns.fixed_rows::<2>(first);
        let spread = |first: usize| plane.transpose() * covariance.fixed_view::<2, 2>(first, first) * plane;
        // Seen across an axis that is off by an angle, gravity has a part that stands still in the sensor.
        let gravity = along * scales.specific_force.value;
        Some(Self {
            offset: vector(0),
            offset_covariance: spread(0) + up_covariance * (gravity * gravity),
            lean: vector(2),
            lean_covariance: spread(2),
            arm: vector(4),
            arm_covariance: spread(4),
        })
    }
}

/// Two unit vectors across `up`, the second a quarter turn left of the first, as rows.
fn across(up: &Vector3<f64>) -> Matrix2x3<f64> {
    let far = Vector3::ith(up.iamin(), 1.0);
    let first = (far - up * far.dot(up)).normalize();
    Matrix2x3::from_rows(&[first.transpose(), up.cross(&first).transpose()])
}

/// Mean specific force along `up`, m/s²; `None` without an accelerometer.
fn mean_along(samples: &[Sample], up: &Vector3<f64>) -> Option<f64> {
    let forces = samples.iter().filter_map(|sample| sample.specific_force_imu);
    let (count, sum) = forces.fold((0.0, 0.0), |(count, sum), force| (count + 1.0, sum + force.dot(up)));
    (count > 0.0).then(|| sum / count)
}

fn blocks(
    samples: &[Sample],
    rests: &[Span],
    (spin, plateau): (&Movement, &Plateau),
    (up, plane): (&Vector3<f64>, &Matrix2x3<f64>),
    (gyro_scale, force_scale): (f64, f64),
) -> Vec<Block> {
    let rate = |sample: &Sample| gyro_scale * (sample.omega_imu - spin.bias.at(sample.time_s)).dot(up);
    // Angle turned at each sample of the movement.
    let mut angle = 0.0;
    let from = spin.span.first.saturating_sub(1);
    let mut angles = Vec::with_capacity(spin.span.end - from);
    angles.push(angle);
    for pair in samples[from..spin.span.end].windows(2) {
        angle += 0.5 * (rate(&pair[0]) + rate(&pair[1])) * (pair[1].time_s - pair[0].time_s);
        angles.push(angle);
    }
    let end_angle = angle;
    let mut all = Vec::new();
    let mut add = |span: Span, at_rest: bool, turned: &dyn Fn(usize) -> (f64, f64)| {
        for window in windows(span.of(samples), BLOCK_S, LEAST_BLOCK) {
            let indices = span.first + window.first..span.first + window.end;
            all.extend(block(samples, indices, at_rest, plane, force_scale, turned));
        }
    };
    for (rest, turned) in [(spin.rest_before, 0.0), (spin.rest_after, end_angle)] {
        if let Some(rest) = rest {
            add(rests[rest], true, &|_| (turned, 0.0));
        }
    }
    add(plateau.span, false, &|index| (angles[index - from], rate(&samples[index])));
    all
}

/// Mean force and mean coefficients of a block; `None` where a sample has no force. `turned` gives angle and rate.
fn block(
    samples: &[Sample],
    indices: std::ops::Range<usize>,
    at_rest: bool,
    plane: &Matrix2x3<f64>,
    force_scale: f64,
    turned: &dyn Fn(usize) -> (f64, f64),
) -> Option<Block> {
    let share = 1.0 / indices.len() as f64;
    let (mut row, mut force) = (Row::zeros(), Vector2::zeros());
    for index in indices {
        let (angle, rate) = turned(index);
        let (sin, cos) = libm::sincos(angle);
        force += plane * samples[index].specific_force_imu? * (force_scale * share);
        row += Row::new(
            1.0,
            0.0,
            cos,
            sin,
            -rate * rate,
            0.0, //
            0.0,
            1.0,
            -sin,
            cos,
            0.0,
            -rate * rate,
        ) * share;
    }
    Some(Block { at_rest, row, force })
}

/// Weighted least squares: the scatter of rest and spin is taken from the residuals. Unknowns and their covariance.
fn solution(blocks: &[Block]) -> Option<(Vector6<f64>, Matrix6<f64>)> {
    let of_kind = |at_rest: bool| blocks.iter().filter(move |block| block.at_rest == at_rest);
    let counts = [false, true].map(|at_rest| of_kind(at_rest).count());
    if counts.iter().any(|count| *count < 2) || 2 * blocks.len() <= UNKNOWNS {
        return None;
    }
    let mut variances = [1.0, 1.0];
    let mut unknowns = Vector6::zeros();
    let mut covariance = Matrix6::identity();
    for _ in 0..=REWEIGHTINGS {
        let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for block in blocks {
            let weight = 1.0 / variances[usize::from(block.at_rest)];
            normal += block.row.transpose() * block.row * weight;
            right += block.row.transpose() * block.force * weight;
        }
        covariance = normal.try_inverse()?;
        unknowns = covariance * right;
        for at_rest in [false, true] {
            let squares: f64 = of_kind(at_rest).map(|b| (b.force - b.row * unknowns).norm_squared()).sum();
            // Of 2 n numbers the fit has eaten some; the rests feel only offset and lean, of which they fix two.
            let count = 2 * counts[usize::from(at_rest)];
            let eaten = if at_rest { 2 } else { 4 };
            variances[usize::from(at_rest)] =
                (squares / count.saturating_sub(eaten).max(1) as f64).max(1e-18);
        }
    }
    let factor = coverage_factor((2 * blocks.len() - UNKNOWNS).min(2 * counts[0].min(counts[1])));
    Some((unknowns, covariance * (factor * factor * persistence(blocks, &unknowns))))
}

/// How much the likeness of neighbouring residuals of the spin widens the covariance, at least 1: (1 + r)/(1 - r) for
/// a correlation r from block to block.
fn persistence(blocks: &[Block], unknowns: &Vector6<f64>) -> f64 {
    let residuals: Vec<Vector2<f64>> = blocks
        .iter()
        .filter(|block| !block.at_rest)
        .map(|block| block.force - block.row * unknowns)
        .collect();
    let squares: f64 = residuals.iter().map(|residual| residual.norm_squared()).sum();
    let products: f64 = residuals.windows(2).map(|pair| pair[0].dot(&pair[1])).sum();
    let correlation = if squares > 0.0 { (products / squares).clamp(0.0, 0.9) } else { 0.0 };
    (1.0 + correlation) / (1.0 - correlation)
}
