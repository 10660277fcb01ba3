//! The axis of a movement back and forth, stroke by stroke.

use nalgebra::{Matrix3, Vector3};

use crate::survey::{Movement, Sample, coverage_factor};

/// A stroke begins and ends where the rate about the axis falls below this share of its peak.
const TURNING_POINT_SHARE: f64 = 0.1;
/// Strokes shorter than this share of the longest are no strokes.
const LEAST_STROKE_SHARE: f64 = 0.3;

/// One way of a movement back and forth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stroke {
    /// Integral of the rate, rad, imu frame.
    pub(super) angle: Vector3<f64>,
    /// How long it took, s.
    duration_s: f64,
    /// Index of its first sample.
    first: usize,
    /// Index of its last sample.
    last: usize,
}

/// The strokes of one movement, in the order of time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Rocking {
    pub(super) strokes: Vec<Stroke>,
}

/// Axis of several strokes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RockingAxis {
    /// Unit, imu frame, in the sense of the first stroke.
    pub(super) axis: Vector3<f64>,
    /// Covariance of its direction.
    pub(super) covariance: Matrix3<f64>,
    /// Strokes it was taken from.
    pub(super) strokes: usize,
}

impl Rocking {
    /// Cuts `movement` into strokes; `None` when there is none.
    pub(super) fn of(samples: &[Sample], movement: &Movement) -> Option<Self> {
        let inside = movement.span.of(samples);
        let rates: Vec<Vector3<f64>> =
            inside.iter().map(|sample| sample.omega_imu - movement.bias.at(sample.time_s)).collect();
        let along: Vec<f64> = rates.iter().map(|rate| rate.dot(&movement.main_axis)).collect();
        let peak = along.iter().map(|rate| rate.abs()).fold(0.0, f64::max);
        let mut strokes: Vec<Stroke> = Vec::new();
        let mut sense = 0.0;
        for (index, &rate) in along.iter().enumerate() {
            if rate.abs() >= TURNING_POINT_SHARE * peak && rate.signum() != sense {
                sense = rate.signum();
                let first = movement.span.first + index;
                strokes.push(Stroke { angle: Vector3::zeros(), duration_s: 0.0, first, last: first });
            }
            if let (Some(stroke), true) = (strokes.last_mut(), index > 0 && rate * sense > 0.0) {
                let step_s = inside[index].time_s - inside[index - 1].time_s;
                stroke.angle += 0.5 * (rates[index - 1] + rates[index]) * step_s;
                stroke.duration_s += step_s;
                stroke.last = movement.span.first + index;
            }
        }
        let longest = strokes.iter().map(|stroke| stroke.angle.norm()).fold(0.0, f64::max);
        strokes.retain(|stroke| stroke.angle.norm() >= LEAST_STROKE_SHARE * longest);
        (!strokes.is_empty() && longest > 0.0).then_some(Self { strokes })
    }

    /// Whether the specific force turned the other way than the gyro says in the first stroke; `None` where it hardly
    /// turned or is not known.
    ///
    /// Gravity stands still: turned by `angle`, the sensor sees it turn back by as much.
    pub(super) fn senses_agree(&self, samples: &[Sample]) -> Option<bool> {
        let stroke = self.strokes.first()?;
        let before = samples[stroke.first].specific_force_imu?;
        let after = samples[stroke.last].specific_force_imu?;
        let turned = after.cross(&before).dot(&stroke.angle) / (before.norm() * after.norm());
        (turned.abs() >= 0.25 * stroke.angle.norm_squared()).then_some(turned > 0.0)
    }
}

/// The common axis of several rockings, each in the sense of its first stroke.
///
/// Its error is that of the gyro (`walk`, the variance of the integral of its noise, rad²/s, and `bias_covariance`) and the
/// scatter of the nods, widened for their number: a person's nods differ by more than the noise.
pub(super) fn common_axis(
    rockings: &[Rocking],
    walk: &Matrix3<f64>,
    bias_covariance: &Matrix3<f64>,
) -> Option<RockingAxis> {
    let mut aligned: Vec<(Vector3<f64>, f64, &Stroke)> = Vec::new();
    for rocking in rockings {
        let first = rocking.strokes.first()?.angle;
        aligned.extend(rocking.strokes.iter().map(|stroke| {
            let sense = if stroke.angle.dot(&first) < 0.0 { -1.0 } else { 1.0 };
            (stroke.angle * sense, sense, stroke)
        }));
    }
    let total: Vector3<f64> = aligned.iter().map(|(angle, ..)| angle).sum();
    let length = total.norm();
    let axis = total.try_normalize(1e-9)?;
    let across = Matrix3::identity() - axis * axis.transpose();
    // There and back make the same mistake: only from one nod to the next are mistakes independent. Of a single nod the
    // two strokes must do.
    let pairs: Vec<Vector3<f64>> = rockings
        .iter()
        .scan(0, |first, rocking| {
            let own = &aligned[*first..*first + rocking.strokes.len()];
            *first += own.len();
            Some(own)
        })
        .flat_map(|own| own.chunks(2).map(|pair| pair.iter().map(|(angle, ..)| angle).sum()))
        .collect();
    let strokes: Vec<Vector3<f64>> = aligned.iter().map(|(angle, ..)| *angle).collect();
    let scatter = scatter(&across, if pairs.len() > 1 { &pairs } else { &strokes });
    let signed_s: f64 = aligned.iter().map(|(_, sense, stroke)| sense * stroke.duration_s).sum();
    let all_s: f64 = aligned.iter().map(|(.., stroke)| stroke.duration_s).sum();
    let noise = walk * all_s + bias_covariance * (signed_s * signed_s);
    let covariance = across * (scatter + noise) * across / (length * length);
    Some(RockingAxis { axis, covariance, strokes: strokes.len() })
}

/// Covariance of the sum of `parts`, from their scatter across the axis; zero for a single one.
fn scatter(across: &Matrix3<f64>, parts: &[Vector3<f64>]) -> Matrix3<f64> {
    let count = parts.len();
    if count < 2 {
        return Matrix3::zeros();
    }
    let factor = coverage_factor(count - 1);
    let squares: Matrix3<f64> = parts
        .iter()
        .map(|part| {
            let off = across * part;
            off * off.transpose()
        })
        .sum();
    squares * (factor * factor * count as f64 / (count - 1) as f64)
}
