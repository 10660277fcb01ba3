//! What a simulated device does, and how a selector says so.

use std::fmt;

use super::{GYRO_NOISE, SPECIFIC_FORCE_NOISE};
use crate::device::DeviceError;
use crate::units::RAD_S_PER_RPM;

/// Which simulated device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MockKind {
    /// Rests, rotates at a constant rate, stops, and goes on resting.
    Chair,
    /// Stands still for `rest_s`.
    Rest,
}

/// What a simulated chair does. Angular rate about the chair's vertical:
///
/// ```text
/// rate  ____________/‾‾‾‾‾‾‾‾‾‾‾‾‾‾\____________
///        rest_s     |ramp_s        |ramp_s  after_s
///                   |<-- spin_s -->|
/// ```
///
/// The ramps are linear, so the chair turns by exactly rate × `spin_s`.
#[derive(Clone, Debug, PartialEq)]
pub struct MockParams {
    /// Which device.
    pub kind: MockKind,
    /// Rate of rotation, rpm; positive is to the left. -80 to 80 (the gyro's range is 500 deg/s).
    pub rate_rpm: f64,
    /// From the start of the ramp up to the start of the ramp down, s. At least `ramp_s`.
    pub spin_s: f64,
    /// Length of each ramp, s.
    pub ramp_s: f64,
    /// Rest before, s.
    pub rest_s: f64,
    /// Rest after the ramp down, s.
    pub after_s: f64,
    /// Samples per second, Hz. 10 to 2000.
    pub sample_rate_hz: f64,
    /// Tilt of the sensor on the chair about its x axis, deg. -45 to 45.
    pub tilt_deg: f64,
    /// White noise of the gyroscope per sample, rad/s rms and axis. 0 to 1.
    pub gyro_noise: f64,
    /// White noise of the accelerometer per sample, m/s² rms and axis. 0 to 10.
    pub specific_force_noise: f64,
    /// How late every frame arrives beside its time on the wire, s. 0 to 1.
    pub latency_s: f64,
    /// Sensor noise on or off.
    pub noise: bool,
    /// Seed of the noise; 0 is a seed like any other.
    pub seed: u64,
}

impl Default for MockParams {
    fn default() -> Self {
        Self::chair()
    }
}

impl MockParams {
    /// Keys of [`MockParams::set`], in the order of the fields.
    pub const KEYS: [&'static str; 12] = [
        "rate_rpm",
        "spin_s",
        "ramp_s",
        "rest_s",
        "after_s",
        "sample_rate_hz",
        "tilt_deg",
        "gyro_noise",
        "specific_force_noise",
        "latency_s",
        "noise",
        "seed",
    ];

    /// 30 rpm for 15 s between 2 s and 25 s of rest.
    pub fn chair() -> Self {
        Self {
            kind: MockKind::Chair,
            rate_rpm: 30.0,
            spin_s: 15.0,
            ramp_s: 1.0,
            rest_s: 2.0,
            after_s: 25.0,
            sample_rate_hz: 1000.0,
            tilt_deg: 0.0,
            gyro_noise: GYRO_NOISE,
            specific_force_noise: SPECIFIC_FORCE_NOISE,
            latency_s: 0.0,
            noise: true,
            seed: 0,
        }
    }

    /// No rotation for 30 s.
    pub fn rest() -> Self {
        let (spin_s, ramp_s, after_s) = (0.0, 0.0, 0.0);
        Self { kind: MockKind::Rest, rate_rpm: 0.0, spin_s, ramp_s, rest_s: 30.0, after_s, ..Self::chair() }
    }

    /// The defaults of the mock called `name`.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "chair" => Some(Self::chair()),
            "rest" => Some(Self::rest()),
            _ => None,
        }
    }

    /// Sets one parameter from text. Ranges are left to [`MockParams::validate`].
    ///
    /// # Errors
    /// What was expected instead, when `value` cannot be read or there is no such key.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), &'static str> {
        let number = match key {
            "rate_rpm" => &mut self.rate_rpm,
            "spin_s" => &mut self.spin_s,
            "ramp_s" => &mut self.ramp_s,
            "rest_s" => &mut self.rest_s,
            "after_s" => &mut self.after_s,
            "sample_rate_hz" => &mut self.sample_rate_hz,
            "tilt_deg" => &mut self.tilt_deg,
            "gyro_noise" => &mut self.gyro_noise,
            "specific_force_noise" => &mut self.specific_force_noise,
            "latency_s" => &mut self.latency_s,
            "noise" => {
                self.noise = match value {
                    "0" => false,
                    "1" => true,
                    _ => return Err("0 or 1"),
                };
                return Ok(());
            }
            "seed" => {
                self.seed = value.parse().map_err(|_| "a whole number from 0 to 18446744073709551615")?;
                return Ok(());
            }
            _ => return Err("a key of a mock device"),
        };
        *number = value.parse().map_err(|_| "a number")?;
        Ok(())
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`DeviceError::Range`] naming the first parameter out of its range.
    pub fn validate(&self) -> Result<(), DeviceError> {
        const LONGEST_S: f64 = 86_400.0;
        let rate_range = if self.kind == MockKind::Rest { 0.0..=0.0 } else { -80.0..=80.0 };
        DeviceError::check_range("rate_rpm", self.rate_rpm, rate_range)?;
        DeviceError::check_range("ramp_s", self.ramp_s, 0.0..=60.0)?;
        DeviceError::check_range("spin_s", self.spin_s, 0.0..=LONGEST_S)?;
        if self.spin_s < self.ramp_s {
            return Err(DeviceError::Range {
                what: "spin_s".to_owned(),
                got: format!("{:?}", self.spin_s),
                expected: format!("at least ramp_s, which is {:?}", self.ramp_s),
            });
        }
        DeviceError::check_range("rest_s", self.rest_s, 0.0..=LONGEST_S)?;
        DeviceError::check_range("after_s", self.after_s, 0.0..=LONGEST_S)?;
        DeviceError::check_range("sample_rate_hz", self.sample_rate_hz, 10.0..=2000.0)?;
        DeviceError::check_range("tilt_deg", self.tilt_deg, -45.0..=45.0)?;
        DeviceError::check_range("gyro_noise", self.gyro_noise, 0.0..=1.0)?;
        DeviceError::check_range("specific_force_noise", self.specific_force_noise, 0.0..=10.0)?;
        DeviceError::check_range("latency_s", self.latency_s, 0.0..=1.0)?;
        Ok(())
    }

    /// Length of the whole run, s.
    pub fn duration_s(&self) -> f64 {
        self.rest_s + self.spin_s + self.ramp_s + self.after_s
    }

    /// Angular rate of the chair about its vertical at time `t_s` from the start, rad/s.
    pub fn omega(&self, t_s: f64) -> f64 {
        let rate = self.rate_rpm * RAD_S_PER_RPM;
        let (start, brake) = (self.rest_s, self.rest_s + self.spin_s);
        if t_s < start {
            0.0
        } else if t_s < start + self.ramp_s {
            rate * (t_s - start) / self.ramp_s
        } else if t_s < brake {
            rate
        } else if t_s < brake + self.ramp_s {
            rate * (1.0 - (t_s - brake) / self.ramp_s)
        } else {
            0.0
        }
    }
}

impl fmt::Display for MockParams {
    /// Writes `chair` or `rest` and the parameters that differ from its defaults, as a selector takes them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, defaults) = match self.kind {
            MockKind::Chair => ("chair", Self::chair()),
            MockKind::Rest => ("rest", Self::rest()),
        };
        f.write_str(name)?;
        let numbers = |params: &Self| {
            let Self { rate_rpm, spin_s, ramp_s, rest_s, after_s, sample_rate_hz, tilt_deg, .. } = *params;
            let Self { gyro_noise, specific_force_noise, latency_s, .. } = *params;
            [
                rate_rpm,
                spin_s,
                ramp_s,
                rest_s,
                after_s,
                sample_rate_hz,
                tilt_deg,
                gyro_noise,
                specific_force_noise,
                latency_s,
            ]
        };
        let mut separator = '?';
        for ((key, value), default) in Self::KEYS.into_iter().zip(numbers(self)).zip(numbers(&defaults)) {
            if value != default {
                write!(f, "{separator}{key}={value}")?;
                separator = '&';
            }
        }
        if self.noise != defaults.noise {
            write!(f, "{separator}noise={}", u8::from(self.noise))?;
            separator = '&';
        }
        if self.seed != defaults.seed {
            write!(f, "{separator}seed={}", self.seed)?;
        }
        Ok(())
    }
}
