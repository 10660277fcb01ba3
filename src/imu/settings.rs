//! Settings of the IMU path, as the `[imu]` table of a configuration.

use super::error::{ImuConfigError, check_range};

/// How readings become head motion. Every key has a default; unknown keys are errors.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImuSettings {
    /// Length of the window at the start in which rest is looked for, s.
    pub align_window_s: f64,
    /// Turn the mount so that the specific force at rest points up.
    pub level: bool,
    /// Subtract the mean rate at rest from the gyroscope.
    pub find_gyro_bias: bool,
    /// Scale the accelerometer so that its norm at rest is the model's gravity.
    pub scale_rest_norm: bool,
    /// A newest sample older than this is no longer held, s.
    pub hold_limit_s: f64,
    /// Sample rate to assume where the device sends no time, Hz.
    pub nominal_rate_hz: Option<f64>,
    /// What counts as rest.
    pub rest: RestLimits,
}

/// What counts as rest. The defaults are wide for a MEMS sensor on a still chair and narrow for a hand.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RestLimits {
    /// Largest standard deviation of a gyro axis, rad/s.
    pub gyro_std_max_rad_s: f64,
    /// Largest mean rate, rad/s: a bias below it, a rotation above it.
    pub gyro_mean_max_rad_s: f64,
    /// Largest standard deviation of an accelerometer axis, m/s².
    pub specific_force_std_max_m_s2: f64,
}

impl Default for ImuSettings {
    fn default() -> Self {
        Self {
            align_window_s: 1.0,
            level: true,
            find_gyro_bias: true,
            scale_rest_norm: true,
            hold_limit_s: 0.2,
            nominal_rate_hz: None,
            rest: RestLimits::default(),
        }
    }
}

impl Default for RestLimits {
    fn default() -> Self {
        Self { gyro_std_max_rad_s: 0.02, gyro_mean_max_rad_s: 0.06, specific_force_std_max_m_s2: 0.3 }
    }
}

impl ImuSettings {
    /// Checks every value; `file` only names the configuration in errors.
    ///
    /// # Errors
    /// [`ImuConfigError::OutOfRange`] with the key and its range.
    pub fn validate(&self, file: &str) -> Result<(), ImuConfigError> {
        let checks = [
            ("imu.align_window_s", self.align_window_s, (0.1, 10.0), "s"),
            ("imu.hold_limit_s", self.hold_limit_s, (0.005, 1.0), "s"),
            ("imu.nominal_rate_hz", self.nominal_rate_hz.unwrap_or(100.0), (1.0, 8000.0), "Hz"),
            ("imu.rest.gyro_std_max_rad_s", self.rest.gyro_std_max_rad_s, (1e-5, 1.0), "rad/s"),
            ("imu.rest.gyro_mean_max_rad_s", self.rest.gyro_mean_max_rad_s, (1e-5, 1.0), "rad/s"),
            (
                "imu.rest.specific_force_std_max_m_s2",
                self.rest.specific_force_std_max_m_s2,
                (1e-4, 10.0),
                "m/s²",
            ),
        ];
        checks
            .into_iter()
            .try_for_each(|(key, value, range, unit)| check_range(file, key, value, range, unit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_survive_toml() {
        let settings = ImuSettings::default();
        settings.validate("defaults").unwrap();
        let text = toml::to_string(&settings).unwrap();
        assert_eq!(toml::from_str::<ImuSettings>(&text).unwrap(), settings);
        assert_eq!(toml::from_str::<ImuSettings>("").unwrap(), settings);
    }

    #[test]
    fn unknown_keys_and_bad_values_are_named() {
        let unknown = toml::from_str::<ImuSettings>("hold_limit_ms = 50").unwrap_err().to_string();
        assert!(unknown.contains("hold_limit_ms") && unknown.contains("hold_limit_s"), "{unknown}");
        for (text, key) in [
            ("align_window_s = -1.0", "imu.align_window_s is -1, allowed is 0.1 to 10 s"),
            ("hold_limit_s = nan", "imu.hold_limit_s is NaN, allowed is 0.005 to 1 s"),
            ("nominal_rate_hz = 0.0", "imu.nominal_rate_hz is 0, allowed is 1 to 8000 Hz"),
        ] {
            let error = toml::from_str::<ImuSettings>(text).unwrap().validate("run.toml").unwrap_err();
            assert!(error.to_string().starts_with(&format!("run.toml: {key}\n\nhint: ")), "{error}");
        }
    }
}
