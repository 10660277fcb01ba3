//! Bias and factor of the accelerometer's axes from several directions at rest; the mounting, where they are named.
//!
//! At rest the accelerometer reads gravity, whichever way it lies: `|K (reading - bias)| = gravity` with `K` diagonal. Six
//! poses with each of its axes once up and once down determine bias and factor of every axis, however roughly they are
//! made. Where the sensor lies aslant between the poses, so that its axes never come near the vertical, one common factor
//! is sought instead. Where also this is left open, the axes that have not been up or down are named.
//!
//! The mounting needs the direction of the head in each pose: the rotation that takes the readings' directions to the
//! named ones best (Wahba 1965, solved by singular values as Markley 1988).

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Rotation3, SymmetricEigen, Vector3, Vector6};
use serde::Serialize;

use super::{MountEstimate, OFFSET_SIGMA_MAX_M_S2, Study, in_degrees};
use crate::survey::{Mean, Sample, Segments, Span, VectorEstimate, angle_between, coverage_factor};
use crate::units::{DEG_PER_RAD, RAD_PER_DEG};

/// Shortest rest that is a pose, s.
const LEAST_POSE_S: f64 = 1.5;
/// Rests in directions nearer than this are one pose, rad.
const SAME_POSE: f64 = 20.0 * RAD_PER_DEG;
/// A sensor axis has been up when it was within this of the vertical, rad.
const NEAR_UP: f64 = 40.0 * RAD_PER_DEG;
/// Least eigenvalue of the normal matrix over the number of poses; six poses along the axes have 1/3.
const LEAST_EIGENVALUE: f64 = 0.02;
/// Rounds of the least squares.
const ROUNDS: usize = 20;
/// Poses this far from where the others put them were named wrongly, rad.
const MISNAMED: f64 = 20.0 * RAD_PER_DEG;
/// Names of the six directions of the sensor.
const DIRECTIONS: [&str; 6] = ["x", "-x", "y", "-y", "z", "-z"];

const HINT: &str = "lay the sensor still for 3 s with each of its six sides up, one after the other";

/// Factors and offsets of the accelerometer's axes: `true = scale * (reading - bias)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AccelerometerEstimate {
    /// Reading where the true specific force is zero, m/s², imu axes.
    pub bias_m_s2: VectorEstimate,
    /// Factor on the reading less the bias, imu axes.
    pub scale: VectorEstimate,
    /// The poses determine one factor for all axes only.
    pub common_scale: bool,
    /// Poses it was taken from.
    pub poses: usize,
    /// Root mean square of the corrected norms less gravity, m/s²; `None` where no pose is left over to check with.
    pub residual_m_s2: Option<f64>,
}

/// A direction the sensor rested in.
#[derive(Clone, Debug)]
pub(super) struct Pose {
    spans: Vec<Span>,
    pub(super) force: Mean,
}

/// The poses in the order of time: rests of 1.5 s, those next to each other in the same direction put together.
pub(super) fn find_poses(samples: &[Sample], segments: &Segments) -> Vec<Pose> {
    let mut poses: Vec<Pose> = Vec::new();
    for rest in segments.rests.iter().filter(|rest| rest.duration_s(samples) >= LEAST_POSE_S) {
        let Some(force) = Mean::of(&rest.specific_forces(samples)) else { continue };
        match poses.last_mut() {
            Some(last) if angle_between(&last.force.mean, &force.mean) < SAME_POSE => {
                last.spans.push(*rest);
                let forces: Vec<_> =
                    last.spans.iter().flat_map(|span| span.specific_forces(samples)).collect();
                last.force = Mean::of(&forces).unwrap_or(force);
            }
            _ => poses.push(Pose { spans: vec![*rest], force }),
        }
    }
    poses
}

/// Directions of the sensor that have not been up in any of the poses, as `x, -y`; empty when all have.
pub(super) fn not_yet_up(poses: &[Pose]) -> String {
    let missing = DIRECTIONS.iter().enumerate().filter(|(index, _)| {
        let direction = Vector3::ith(index / 2, if index % 2 == 0 { 1.0 } else { -1.0 });
        !poses.iter().any(|pose| angle_between(&pose.force.mean, &direction) <= NEAR_UP)
    });
    missing.map(|(_, name)| *name).collect::<Vec<_>>().join(", ")
}

/// What the poses say about the accelerometer, with what corrects a reading.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accelerometer {
    bias: Vector3<f64>,
    scale: Vector3<f64>,
    pub(super) finding: AccelerometerEstimate,
}

impl Accelerometer {
    /// The specific force without bias and factor, m/s².
    pub(super) fn corrected(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        self.scale.component_mul(&(reading - self.bias))
    }
}

impl Study<'_> {
    /// Bias and factor of each axis, or of all together.
    pub(super) fn accelerometer(&mut self, poses: &[Pose]) -> Option<Accelerometer> {
        let gravity = self.settings.gravity;
        let per_axis = DMatrix::identity(6, 6);
        // Three offsets and one factor.
        let common =
            DMatrix::from_fn(
                6,
                4,
                |row, column| {
                    if row == column || (row >= 3 && column == 3) { 1.0 } else { 0.0 }
                },
            );
        let found = [(per_axis, false), (common, true)]
            .into_iter()
            .find_map(|(basis, is_common)| fit(poses, gravity, &basis, is_common));
        if found.is_none() {
            let blind = self.samples.iter().all(|sample| sample.specific_force_imu.is_none());
            let why = match (poses.len(), not_yet_up(poses)) {
                _ if blind => "there is no accelerometer".to_owned(),
                (0, _) => "there is no pose: nowhere does the sensor lie still for 2 s".to_owned(),
                (count, missing) if missing.is_empty() => {
                    format!("of the {count} poses found the readings do not fit together: were they still?")
                }
                (count, missing) => format!(
                    "the {count} poses found leave it open; within 40 deg of up these sensor axes are missing: {missing}"
                ),
            };
            self.refuse("accelerometer bias and scale", why, HINT, true);
        }
        if found.is_some_and(|found| found.finding.common_scale) {
            self.notes.push(format!(
                "the poses determine one factor for all accelerometer axes only: for one of each, lay these up as well: {}",
                not_yet_up(poses)
            ));
        }
        found
    }

    /// The mounting from poses whose upward head direction is named, in the same order.
    pub(super) fn posed_mount(
        &mut self,
        poses: &[Pose],
        named: &[Vector3<f64>],
        accelerometer: Option<&Accelerometer>,
    ) -> Option<(Rotation3<f64>, MountEstimate)> {
        const NAMES: &str = "--poses names the head's direction that is up in each pose, in the order of time, for example \
                             z,-z,x,-x,y,-y; lay the sensor down only in these";
        // The chair that is turned afterwards rests as well.
        let poses = match self.settings.counted {
            Some(_) if poses.len() > named.len() => &poses[..named.len()],
            _ => poses,
        };
        if poses.len() != named.len() {
            let why = format!("{} poses were named and {} were found", named.len(), poses.len());
            self.refuse("mount", why, NAMES, true);
            return None;
        }
        let directions: Vec<Vector3<f64>> = poses
            .iter()
            .map(|pose| accelerometer.map_or(pose.force.mean, |known| known.corrected(&pose.force.mean)))
            .map(|force| force.normalize())
            .collect();
        if named.iter().all(|direction| direction.cross(&named[0]).norm() < 1e-6) {
            let why = "all poses have the same axis up: turned about it, the sensor would have read the same";
            self.refuse("mount", why, NAMES, true);
            return None;
        }
        let rot_head_imu = best_rotation(named, &directions);
        // A rotation by `cross` would take the reading to where it should be.
        let errors: Vec<Vector3<f64>> =
            named.iter().zip(&directions).map(|(up, read)| (rot_head_imu * read).cross(up)).collect();
        let off = |index: &usize| angle_between(&(rot_head_imu * directions[*index]), &named[*index]);
        let worst =
            (0..named.len()).max_by(|a, b| off(a).total_cmp(&off(b))).filter(|index| off(index) > MISNAMED);
        if let Some(index) = worst {
            let why = format!(
                "pose {} is {:.0} deg from where the others put it: the order is another one, or an axis of the sensor has \
                 the wrong sign",
                index + 1,
                off(&index) * DEG_PER_RAD
            );
            self.refuse("mount", why, NAMES, true);
            return None;
        }
        let normal: Matrix3<f64> = named.iter().map(|up| Matrix3::identity() - up * up.transpose()).sum();
        let degrees = 2 * named.len() - 3;
        let squares: f64 = errors.iter().map(|error| error.norm_squared()).sum();
        let factor = coverage_factor(degrees);
        let covariance = normal.try_inverse()? * (squares / degrees as f64 * factor * factor);
        let estimate = MountEstimate {
            matrix: core::array::from_fn(|row| core::array::from_fn(|column| rot_head_imu[(row, column)])),
            sigma_deg: core::array::from_fn(|i| in_degrees(0.0, covariance[(i, i)]).sigma),
            lever_arm_m: None,
        };
        Some((rot_head_imu, estimate))
    }
}

/// The rotation that takes `from` to `to` best, least squares.
fn best_rotation(to: &[Vector3<f64>], from: &[Vector3<f64>]) -> Rotation3<f64> {
    let profile: Matrix3<f64> = to.iter().zip(from).map(|(to, from)| to * from.transpose()).sum();
    let svd = profile.svd(true, true);
    let (left, right) = (svd.u.unwrap_or_default(), svd.v_t.unwrap_or_default());
    let sense = (left * right).determinant().signum();
    // The smallest singular value stands last.
    let keep = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sense));
    Rotation3::from_matrix_unchecked(left * keep * right)
}

/// Least squares for bias and factors in the space that `basis` spans; `None` where they are not determined well.
///
/// Unknowns: bias (m/s²) and `gravity * (factor - 1)` (m/s²), so that all have one size.
fn fit(poses: &[Pose], gravity: f64, basis: &DMatrix<f64>, common_scale: bool) -> Option<Accelerometer> {
    let unknowns = basis.ncols();
    if poses.len() < unknowns {
        return None;
    }
    let mut state = Vector6::zeros();
    let mut covariance = DMatrix::zeros(unknowns, unknowns);
    let mut squares = (0.0, 0.0);
    for _ in 0..ROUNDS {
        let bias = Vector3::new(state[0], state[1], state[2]);
        let scale = Vector3::from_fn(|i, _| 1.0 + state[3 + i] / gravity);
        let (mut plain, mut normal) = (Matrix6::zeros(), Matrix6::zeros());
        let mut right = Vector6::zeros();
        squares = (0.0, 0.0);
        for pose in poses {
            let free = pose.force.mean - bias;
            let force = scale.component_mul(&free);
            let up = force.try_normalize(1e-9)?;
            let residual = gravity - force.norm();
            let (of_bias, of_scale) = (-scale.component_mul(&up), free.component_mul(&up) / gravity);
            let row = Vector6::new(of_bias.x, of_bias.y, of_bias.z, of_scale.x, of_scale.y, of_scale.z);
            let along = scale.component_mul(&up);
            let variance = (along.transpose() * pose.force.covariance * along)[(0, 0)].max(1e-12);
            plain += row * row.transpose() / poses.len() as f64;
            normal += row * row.transpose() / variance;
            right += row * (residual / variance);
            squares.0 += residual * residual;
            squares.1 += residual * residual / variance;
        }
        let within = |matrix: &Matrix6<f64>| {
            basis.transpose() * DMatrix::from_column_slice(6, 6, matrix.as_slice()) * basis
        };
        if SymmetricEigen::new(within(&plain)).eigenvalues.min() < LEAST_EIGENVALUE {
            return None;
        }
        covariance = within(&normal).try_inverse()?;
        let step = basis * (&covariance * (basis.transpose() * DVector::from_column_slice(right.as_slice())));
        state += Vector6::from_column_slice(step.as_slice());
        if step.norm() < 1e-9 {
            break;
        }
    }
    let left_over = poses.len() - unknowns;
    let excess = if left_over > 0 { (squares.1 / left_over as f64).max(1.0) } else { 1.0 };
    let full = basis * covariance * basis.transpose() * excess;
    let value = |first: usize| Vector3::new(state[first], state[first + 1], state[first + 2]);
    let spread = |first: usize| Matrix3::from_fn(|row, column| full[(first + row, first + column)]);
    let (bias, scale) = (value(0), value(3).map(|part| 1.0 + part / gravity));
    let finding = AccelerometerEstimate {
        bias_m_s2: VectorEstimate::new(&bias, &spread(0)),
        scale: VectorEstimate::new(&scale, &(spread(3) / (gravity * gravity))),
        common_scale,
        poses: poses.len(),
        residual_m_s2: (left_over > 0).then(|| (squares.0 / poses.len() as f64).sqrt()),
    };
    let known = (0..6).all(|i| full[(i, i)].max(0.0).sqrt() <= OFFSET_SIGMA_MAX_M_S2);
    // An offset or a factor beyond these is no calibration but a wrong unit or a moving sensor.
    let believed = bias.amax() <= 5.0 && scale.iter().all(|factor| (0.5..=2.0).contains(factor));
    (known && believed).then_some(Accelerometer { bias, scale, finding })
}
