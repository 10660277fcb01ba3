//! How the sensor sits on the chair. The only place where sensor axes become head axes.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::ImuSample;
use super::calibration::matrix_from_rows;
use super::error::{ImuConfigError, check_range};
use crate::time::HostTime;
use crate::vestibular::HeadMotion;

/// Largest deviation from orthonormal that a given matrix may have.
const ORTHONORMAL_TOLERANCE: f64 = 1e-6;
/// Lever arms shorter than this get no angular-acceleration term, m: its noise would outweigh it.
const EULER_TERM_FROM_M: f64 = 0.05;
/// Cut-off frequency of the angular acceleration, Hz.
const DERIVATIVE_CUTOFF_HZ: f64 = 15.0;
/// After a pause longer than this the derivative starts again from zero, s.
const DERIVATIVE_RESTART_S: f64 = 0.2;

/// Motion of the head at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadSample {
    /// When, host time.
    pub at: HostTime,
    /// How the head moved then, head frame.
    pub motion: HeadMotion,
}

/// Position and orientation of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mount {
    /// Takes imu coordinates to head coordinates.
    pub rot_head_imu: Rotation3<f64>,
    /// Head point minus sensor, m, head axes.
    pub lever_arm_head: Vector3<f64>,
}

impl Default for Mount {
    /// Sensor axes are head axes, the sensor sits in the head.
    fn default() -> Self {
        Self { rot_head_imu: Rotation3::identity(), lever_arm_head: Vector3::zeros() }
    }
}

/// One axis of the sensor, with its direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
enum SensorAxis {
    #[serde(rename = "x", alias = "+x")]
    X,
    #[serde(rename = "y", alias = "+y")]
    Y,
    #[serde(rename = "z", alias = "+z")]
    Z,
    #[serde(rename = "-x")]
    MinusX,
    #[serde(rename = "-y")]
    MinusY,
    #[serde(rename = "-z")]
    MinusZ,
}

impl SensorAxis {
    fn vector(self) -> Vector3<f64> {
        match self {
            Self::X => Vector3::x(),
            Self::Y => Vector3::y(),
            Self::Z => Vector3::z(),
            Self::MinusX => -Vector3::x(),
            Self::MinusY => -Vector3::y(),
            Self::MinusZ => -Vector3::z(),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
            Self::MinusX => "-x",
            Self::MinusY => "-y",
            Self::MinusZ => "-z",
        }
    }
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct NamedAxes {
    forward: SensorAxis,
    up: SensorAxis,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct MountFile {
    matrix: Option<[[f64; 3]; 3]>,
    quaternion: Option<[f64; 4]>,
    axes: Option<NamedAxes>,
    #[serde(default)]
    lever_arm_m: [f64; 3],
}

impl Mount {
    /// Reads a mount from TOML text; `file` only names it in errors.
    ///
    /// Exactly one of `matrix` (rows; takes imu to head coordinates), `quaternion` (w, x, y, z, same sense) and
    /// `axes = { forward = "x", up = "-z" }` (which sensor axis points forward, which up); and `lever_arm_m` (head
    /// point minus sensor in head axes, default zero, at most 2 m each way).
    ///
    /// # Errors
    /// Broken text or unknown keys, none or several of the three, a matrix that is mirrored or off orthonormal by
    /// more than 1e-6, a quaternion off unit norm by more than 1e-3, parallel axes, a lever arm out of range.
    pub fn from_toml(file: &str, text: &str) -> Result<Self, ImuConfigError> {
        let mount: MountFile = toml::from_str(text).map_err(|source| ImuConfigError::Toml {
            file: file.to_owned(),
            source: Box::new(source),
            hint: "the keys of a mount are matrix, quaternion or axes (one of them), and lever_arm_m",
        })?;
        for (axis, value) in ["x", "y", "z"].iter().zip(mount.lever_arm_m) {
            check_range(file, &format!("lever_arm_m ({axis})"), value, (-2.0, 2.0), "m")?;
        }
        let rot_head_imu = match (mount.matrix, mount.quaternion, mount.axes) {
            (Some(rows), None, None) => checked_rotation(file, "matrix", &matrix_from_rows(&rows))?,
            (None, Some(wxyz), None) => rotation_from_quaternion(file, wxyz)?,
            (None, None, Some(axes)) => rotation_from_axes(file, &axes)?,
            (matrix, quaternion, axes) => {
                return Err(ImuConfigError::ExactlyOne {
                    file: file.to_owned(),
                    keys: "matrix, quaternion and axes",
                    got: [matrix.is_some(), quaternion.is_some(), axes.is_some()]
                        .into_iter()
                        .filter(|&given| given)
                        .count(),
                    hint: "a sensor lying flat with x forward is axes = { forward = \"x\", up = \"z\" }",
                });
            }
        };
        Ok(Self { rot_head_imu, lever_arm_head: mount.lever_arm_m.into() })
    }

    /// This mount turned so that `rest_specific_force_imu` points to head +z, and the angle of that turn, rad.
    ///
    /// The turn is the smallest one that does it; gravity says nothing about heading. For a sensor exactly upside
    /// down there is no smallest turn: it is made about the forward axis. A force of zero changes nothing.
    pub fn levelled(&self, rest_specific_force_imu: &Vector3<f64>) -> (Self, f64) {
        let Some(up) = (self.rot_head_imu * rest_specific_force_imu).try_normalize(1e-9) else {
            return (*self, 0.0);
        };
        let axis = up.cross(&Vector3::z());
        let (sine, cosine) = (axis.norm(), up.z);
        let tilt = libm::atan2(sine, cosine);
        let turn = if cosine > -1.0 + 1e-9 {
            // Rodrigues' formula with (1 - cos)/sin² = 1/(1 + cos), which needs no angle.
            let cross = axis.cross_matrix();
            Rotation3::from_matrix_unchecked(Matrix3::identity() + cross + cross * cross / (1.0 + cosine))
        } else {
            Rotation3::from_matrix_unchecked(Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)))
        };
        (Self { rot_head_imu: turn * self.rot_head_imu, ..*self }, tilt)
    }

    /// Head motion of one sample: axes turned, specific force moved from the sensor to the head point.
    ///
    /// `s_H = s_I + omega_dot x r + omega x (omega x r)` with `r` = [`Self::lever_arm_head`]. The first term is left
    /// out for `|r|` below 5 cm, where the noise of a differentiated gyro outweighs it.
    pub fn to_head(&self, sample: &ImuSample, derivative: &mut OmegaDerivative) -> HeadSample {
        let omega_head = self.rot_head_imu * sample.omega_imu;
        let omega_dot_head = derivative.push(sample.at, omega_head);
        let arm = &self.lever_arm_head;
        let mut specific_force_head =
            self.rot_head_imu * sample.specific_force_imu + omega_head.cross(&omega_head.cross(arm));
        if arm.norm() >= EULER_TERM_FROM_M {
            specific_force_head += omega_dot_head.cross(arm);
        }
        HeadSample { at: sample.at, motion: HeadMotion { omega_head, gif_head: -specific_force_head } }
    }
}

/// Angular acceleration from samples at irregular times: the derivative of a first-order low-pass at 15 Hz.
///
/// It lags by 1/(2 pi 15 Hz) = 10.6 ms. The first sample, and the first after a pause of 0.2 s, give zero.
#[derive(Clone, Copy, Debug, Default)]
pub struct OmegaDerivative {
    last: Option<(HostTime, Vector3<f64>)>,
    omega_dot: Vector3<f64>,
}

impl OmegaDerivative {
    /// Takes in the angular velocity at `at` and returns the angular acceleration, rad/s², same axes.
    ///
    /// A sample that is not later than the one before changes nothing.
    pub fn push(&mut self, at: HostTime, omega: Vector3<f64>) -> Vector3<f64> {
        const TIME_CONSTANT_S: f64 = 1.0 / (2.0 * core::f64::consts::PI * DERIVATIVE_CUTOFF_HZ);
        match self.last {
            Some((before, filtered)) if at > before => {
                let dt = at.saturating_since(before).as_secs_f64();
                if dt > DERIVATIVE_RESTART_S {
                    self.omega_dot = Vector3::zeros();
                    self.last = Some((at, omega));
                } else {
                    // Backward Euler of filtered' = (omega - filtered) / T: stable for every dt.
                    self.omega_dot = (omega - filtered) / (TIME_CONSTANT_S + dt);
                    self.last = Some((at, filtered + self.omega_dot * dt));
                }
            }
            Some(_) => {}
            None => self.last = Some((at, omega)),
        }
        self.omega_dot
    }
}

/// What levelling does to a sensor that is `tilt_deg` (more than 90) from upright, in words for whoever mounted it.
pub fn points_down(tilt_deg: f64) -> String {
    format!(
        "the sensor is {tilt_deg:.0} deg from upright: levelling turns it about an axis that nobody chose; up and the sense of \
         a spin come out right, forward and left do not: say how it sits with --mount (lying upside down, x forward: \
         configs/mounts/upside-down.toml)"
    )
}

fn checked_rotation(file: &str, key: &str, matrix: &Matrix3<f64>) -> Result<Rotation3<f64>, ImuConfigError> {
    for value in matrix.iter() {
        check_range(file, key, *value, (-1.0 - ORTHONORMAL_TOLERANCE, 1.0 + ORTHONORMAL_TOLERANCE), "")?;
    }
    let determinant = matrix.determinant();
    let gram = matrix.transpose() * matrix;
    let deviation = (gram - Matrix3::identity()).amax();
    if determinant < 0.0 {
        return Err(ImuConfigError::Mirrored { file: file.to_owned(), key: key.to_owned(), determinant });
    }
    if deviation > ORTHONORMAL_TOLERANCE {
        return Err(ImuConfigError::NotARotation {
            file: file.to_owned(),
            key: key.to_owned(),
            deviation,
            determinant,
        });
    }
    // One Newton step to the nearest rotation takes away the rounding of the file's digits.
    Ok(Rotation3::from_matrix_unchecked(matrix * (Matrix3::identity() * 3.0 - gram) * 0.5))
}

fn rotation_from_quaternion(file: &str, [w, x, y, z]: [f64; 4]) -> Result<Rotation3<f64>, ImuConfigError> {
    let quaternion = Quaternion::new(w, x, y, z);
    check_range(file, "norm of quaternion", quaternion.norm(), (0.999, 1.001), "")?;
    Ok(UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix())
}

fn rotation_from_axes(file: &str, axes: &NamedAxes) -> Result<Rotation3<f64>, ImuConfigError> {
    let (forward, up) = (axes.forward.vector(), axes.up.vector());
    if forward.dot(&up) != 0.0 {
        return Err(ImuConfigError::ParallelAxes {
            file: file.to_owned(),
            forward: axes.forward.name(),
            up: axes.up.name(),
        });
    }
    // Rows are the head axes in imu coordinates; left = up x forward makes the determinant +1.
    let left = up.cross(&forward);
    Ok(Rotation3::from_matrix_unchecked(Matrix3::from_rows(&[
        forward.transpose(),
        left.transpose(),
        up.transpose(),
    ])))
}

#[cfg(test)]
mod tests;
