//! Sensor calibration: constant bias, scale and misalignment, and what a sensor shows at rest.

use nalgebra::{Matrix3, Vector3};

use super::ImuSample;
use super::error::{ImuConfigError, check_range};
use super::settings::RestLimits;

/// Fewest samples from which rest may be concluded.
pub const MIN_REST_SAMPLES: u64 = 8;

/// Affine correction of both sensors, imu frame: `true = matrix * (raw - bias)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Gyroscope reading at zero rate, rad/s.
    pub gyro_bias: Vector3<f64>,
    /// Scale and misalignment of the gyroscope (3 x 3), near 1.
    pub gyro_matrix: Matrix3<f64>,
    /// Accelerometer offset, m/s².
    pub specific_force_bias: Vector3<f64>,
    /// Scale and misalignment of the accelerometer (3 x 3), near 1.
    pub specific_force_matrix: Matrix3<f64>,
}

impl Default for Calibration {
    fn default() -> Self {
        Self {
            gyro_bias: Vector3::zeros(),
            gyro_matrix: Matrix3::identity(),
            specific_force_bias: Vector3::zeros(),
            specific_force_matrix: Matrix3::identity(),
        }
    }
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationFile {
    gyro: Option<GyroTable>,
    specific_force: Option<SpecificForceTable>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct GyroTable {
    #[serde(default)]
    bias_rad_s: [f64; 3],
    matrix: Option<[[f64; 3]; 3]>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct SpecificForceTable {
    #[serde(default)]
    bias_m_s2: [f64; 3],
    matrix: Option<[[f64; 3]; 3]>,
}

impl Calibration {
    /// Reads a calibration from TOML text; `file` only names it in errors.
    ///
    /// Tables `[gyro]` (`bias_rad_s`, `matrix`) and `[specific_force]` (`bias_m_s2`, `matrix`), matrices row by row.
    /// Whatever is left out is the identity.
    ///
    /// # Errors
    /// [`ImuConfigError::Toml`] for broken text or unknown keys, [`ImuConfigError::OutOfRange`] for a bias beyond
    /// 1 rad/s or 5 m/s², a matrix entry beyond ±2 or a determinant outside 0.2 to 5.
    pub fn from_toml(file: &str, text: &str) -> Result<Self, ImuConfigError> {
        let tables: CalibrationFile = toml::from_str(text).map_err(|source| ImuConfigError::Toml {
            file: file.to_owned(),
            source: Box::new(source),
            hint: "[gyro] has bias_rad_s and matrix, [specific_force] has bias_m_s2 and matrix",
        })?;
        let mut calibration = Self::default();
        if let Some(gyro) = tables.gyro {
            calibration.gyro_bias = checked_bias(file, "gyro.bias_rad_s", gyro.bias_rad_s, 1.0, "rad/s")?;
            calibration.gyro_matrix = checked_matrix(file, "gyro.matrix", gyro.matrix)?;
        }
        if let Some(force) = tables.specific_force {
            calibration.specific_force_bias =
                checked_bias(file, "specific_force.bias_m_s2", force.bias_m_s2, 5.0, "m/s²")?;
            calibration.specific_force_matrix = checked_matrix(file, "specific_force.matrix", force.matrix)?;
        }
        Ok(calibration)
    }

    /// Angular velocity with bias, scale and misalignment removed, rad/s, imu frame.
    pub fn omega(&self, raw: Vector3<f64>) -> Vector3<f64> {
        self.gyro_matrix * (raw - self.gyro_bias)
    }

    /// Specific force with bias, scale and misalignment removed, m/s², imu frame.
    pub fn specific_force(&self, raw: Vector3<f64>) -> Vector3<f64> {
        self.specific_force_matrix * (raw - self.specific_force_bias)
    }
}

fn checked_bias(
    file: &str,
    key: &str,
    bias: [f64; 3],
    limit: f64,
    unit: &str,
) -> Result<Vector3<f64>, ImuConfigError> {
    for (axis, value) in ["x", "y", "z"].iter().zip(bias) {
        check_range(file, &format!("{key} ({axis})"), value, (-limit, limit), unit)?;
    }
    Ok(bias.into())
}

fn checked_matrix(
    file: &str,
    key: &str,
    rows: Option<[[f64; 3]; 3]>,
) -> Result<Matrix3<f64>, ImuConfigError> {
    let Some(rows) = rows else { return Ok(Matrix3::identity()) };
    for (row, entries) in rows.iter().enumerate() {
        for (column, &value) in entries.iter().enumerate() {
            check_range(file, &format!("{key}[{row}][{column}]"), value, (-2.0, 2.0), "")?;
        }
    }
    let matrix = matrix_from_rows(&rows);
    // A sensor's scale is near 1: a determinant far from it is a unit error, zero or less is no sensor at all.
    check_range(file, &format!("determinant of {key}"), matrix.determinant(), (0.2, 5.0), "")?;
    Ok(matrix)
}

/// A matrix from its rows as a file lists them.
pub(super) fn matrix_from_rows(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| rows[row][column])
}

/// Running mean and scatter of a vector (Welford), per axis.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    count: u64,
    mean: Vector3<f64>,
    /// Sum of squared deviations from the mean.
    squares: Vector3<f64>,
}

impl Moments {
    fn push(&mut self, value: Vector3<f64>) {
        self.count += 1;
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.squares += before.component_mul(&(value - self.mean));
    }

    /// Largest standard deviation of the three axes.
    fn std_max(&self) -> f64 {
        (self.squares.max() / self.count.max(1) as f64).sqrt()
    }
}

/// Statistics of a window of samples: does the sensor rest, and what does it read there?
///
/// Rest is a small scatter of both sensors and a small mean rate. A chair that turns steadily and slower than
/// [`RestLimits::gyro_mean_max_rad_s`] cannot be told from a gyro bias, by nobody: keep that limit below the slowest
/// rotation a stream may begin with.
#[derive(Clone, Copy, Debug, Default)]
pub struct RestDetector {
    omega: Moments,
    specific_force: Moments,
}

impl RestDetector {
    /// Takes a sample in; `has_specific_force` is false where the accelerometer's value is only a stand-in.
    pub fn push(&mut self, sample: &ImuSample, has_specific_force: bool) {
        self.omega.push(sample.omega_imu);
        if has_specific_force {
            self.specific_force.push(sample.specific_force_imu);
        }
    }

    /// Samples taken in.
    pub fn samples(&self) -> u64 {
        self.omega.count
    }

    /// True when at least [`MIN_REST_SAMPLES`] samples keep within `limits`. Without an accelerometer the gyroscope
    /// alone decides.
    pub fn is_at_rest(&self, limits: &RestLimits) -> bool {
        self.omega.count >= MIN_REST_SAMPLES
            && self.gyro_std() <= limits.gyro_std_max_rad_s
            && self.mean_omega().norm() <= limits.gyro_mean_max_rad_s
            && self.specific_force.std_max() <= limits.specific_force_std_max_m_s2
    }

    /// Mean angular velocity, rad/s, imu frame: the gyro bias if the sensor rests. Zero before the first sample.
    pub fn mean_omega(&self) -> Vector3<f64> {
        self.omega.mean
    }

    /// Standard deviation of the noisiest gyro axis, rad/s.
    pub fn gyro_std(&self) -> f64 {
        self.omega.std_max()
    }

    /// Mean specific force, m/s², imu frame; `None` before the first accelerometer value.
    pub fn mean_specific_force(&self) -> Option<Vector3<f64>> {
        (self.specific_force.count > 0).then_some(self.specific_force.mean)
    }

    /// Standard deviation of the noisiest accelerometer axis, m/s².
    pub fn specific_force_std(&self) -> f64 {
        self.specific_force.std_max()
    }
}

#[cfg(test)]
mod tests;
