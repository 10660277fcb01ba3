//! Gains and time constants of the observer, and what makes a set of them usable.

use serde::{Deserialize, Serialize};

/// Gains and time constants of Newman's observer. `Default` is the preset `seed`, the paper's.
///
/// | symbol | field                                 | unit | in                                 |
/// |--------|---------------------------------------|------|------------------------------------|
/// | k_ω    | `canal_gain`                          | 1    | ω' = k_ω e_ω + k_fω e_f (Eq. 7)    |
/// | k_fω   | `gif_to_omega_gain_per_s`             | 1/s  | ω' = k_ω e_ω + k_fω e_f (Eq. 7)    |
/// | k_f    | `gif_to_gravity_gain_per_s`           | 1/s  | ĝ = Q(k_f e_f + k_ωf ω̂) (Eq. 1)    |
/// | k_ωf   | `omega_to_gravity_gain`               | 1    | ĝ = Q(k_f e_f + k_ωf ω̂) (Eq. 1)    |
/// | k_a    | `accel_gain`                          | 1    | â = k_a e_a (Eq. 6)                |
/// | τ_d    | `dominant_time_constant_s`            | s    | scc(s) (Eq. 8)                     |
/// | τ_a    | `adaptation_time_constant_s`          | s    | scc(s) (Eq. 8)                     |
/// | τ̂_d    | `internal_dominant_time_constant_s`   | s    | internal scc(s) (Eq. 9)            |
///
/// k1 of ω̂ = k1 ω' is no parameter: (k_ω + 1)/k_ω makes the percept of a jump of ω right at once.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObserverParameters {
    /// k_ω: weight of the canal conflict, positive. Sets velocity storage: (k_ω + 1) τ̂_d.
    pub canal_gain: f64,
    /// k_f: how fast believed gravity turns towards the gravito-inertial force, 1/s.
    pub gif_to_gravity_gain_per_s: f64,
    /// k_fω: how much rotation the gravito-inertial rotation error feels like, 1/s.
    pub gif_to_omega_gain_per_s: f64,
    /// k_a: how much acceleration the gravito-inertial conflict feels like, zero or negative.
    pub accel_gain: f64,
    /// k_ωf: how much of the believed rotation turns believed gravity.
    pub omega_to_gravity_gain: f64,
    /// τ_d: time constant of the canals, s.
    pub dominant_time_constant_s: f64,
    /// τ_a: time constant of their nerve's adaptation, s.
    pub adaptation_time_constant_s: f64,
    /// τ̂_d: time constant of the brain's model of the canals, s.
    pub internal_dominant_time_constant_s: f64,
    /// Corner of a low-pass on sensed and expected canal afference, Hz; none in the paper.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub canal_low_pass_hz: Option<f64>,
    /// Corner of a low-pass on sensed and expected otolith afference, Hz; none in the paper ("oto(s) = 1", Eq. 3).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub otolith_low_pass_hz: Option<f64>,
}

/// A value no observer can run with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// A value outside its range.
    #[error(
        "observer parameter `{key}` is {got}, expected {expected}\n\nhint: the preset `seed` is a complete set that works"
    )]
    OutOfRange {
        /// Name of the field.
        key: &'static str,
        /// The value found.
        got: f64,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// Gains and corners that together react faster than the integration step can follow.
    #[error(
        "the observer's {what} reacts at {rate_per_s:.1} 1/s, expected at most {limit_per_s:.1} 1/s for its \
         integration step\n\nhint: lower the gain or the low-pass corner"
    )]
    TooFast {
        /// Which loop.
        what: &'static str,
        /// Its fastest rate, 1/s.
        rate_per_s: f64,
        /// The fastest the integrator follows, 1/s.
        limit_per_s: f64,
    },
}

/// Longest integration step, s.
const LONGEST_STEP_S: f64 = 0.02;
/// Longest integration step with a low-pass: 2 Hz ones put poles at 113 and 63 1/s.
const LONGEST_STEP_LOW_PASS_S: f64 = 0.005;
/// Rate times step up to which RK4 is safely stable (its limit on the real axis is 2.785).
const STABLE_RATE_STEP: f64 = 2.0;

impl Default for ObserverParameters {
    fn default() -> Self {
        super::presets::SEED
    }
}

impl ObserverParameters {
    /// k1 = (k_ω + 1)/k_ω, from ω' to ω̂.
    #[inline]
    pub fn omega_scale(&self) -> f64 {
        (self.canal_gain + 1.0) / self.canal_gain
    }

    /// Longest step the integrator may take, s; it cuts longer ones into equal parts.
    #[inline]
    pub fn longest_step_s(&self) -> f64 {
        match (self.canal_low_pass_hz, self.otolith_low_pass_hz) {
            (None, None) => LONGEST_STEP_S,
            _ => LONGEST_STEP_LOW_PASS_S,
        }
    }

    /// Checks every value, and that no loop is faster than the integrator.
    ///
    /// # Errors
    /// [`ParameterError::OutOfRange`] names the first bad field (not finite, a time constant, corner or `canal_gain`
    /// not positive, `accel_gain` positive: at 1 its loop has no solution); [`ParameterError::TooFast`] the loop.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = |ok: bool, key, got, expected| {
            if ok { Ok(()) } else { Err(ParameterError::OutOfRange { key, got, expected }) }
        };
        for (key, value) in [
            ("gif_to_gravity_gain_per_s", self.gif_to_gravity_gain_per_s),
            ("gif_to_omega_gain_per_s", self.gif_to_omega_gain_per_s),
            ("omega_to_gravity_gain", self.omega_to_gravity_gain),
        ] {
            check(value.is_finite(), key, value, "a finite number")?;
        }
        for (key, value) in [
            ("canal_gain", Some(self.canal_gain)),
            ("dominant_time_constant_s", Some(self.dominant_time_constant_s)),
            ("adaptation_time_constant_s", Some(self.adaptation_time_constant_s)),
            ("internal_dominant_time_constant_s", Some(self.internal_dominant_time_constant_s)),
            ("canal_low_pass_hz", self.canal_low_pass_hz),
            ("otolith_low_pass_hz", self.otolith_low_pass_hz),
        ] {
            let value = value.unwrap_or(1.0);
            check(value.is_finite() && value > 0.0, key, value, "a finite number greater than 0")?;
        }
        let accel_gain = self.accel_gain;
        check(
            accel_gain.is_finite() && accel_gain <= 0.0,
            "accel_gain",
            accel_gain,
            "0 or a negative number",
        )?;
        self.check_rates()
    }

    /// Small-angle rates of the loops against the integration step.
    fn check_rates(&self) -> Result<(), ParameterError> {
        let corner = |hz: Option<f64>| 2.0 * core::f64::consts::PI * hz.unwrap_or(0.0);
        // With the low-pass the canal no longer damps the path e_f -> ω̂ -> ĝ at once: take it undamped there.
        let damping = if self.canal_low_pass_hz.is_some() { 1.0 } else { 1.0 + self.canal_gain };
        let gif_to_omega =
            self.omega_to_gravity_gain * self.omega_scale() * self.gif_to_omega_gain_per_s / damping;
        let limit_per_s = STABLE_RATE_STEP / self.longest_step_s();
        for (what, rate_per_s) in [
            ("canal", 1.0 / self.dominant_time_constant_s),
            ("canal adaptation", 1.0 / self.adaptation_time_constant_s),
            ("internal canal", 1.0 / self.internal_dominant_time_constant_s),
            ("canal loop", corner(self.canal_low_pass_hz) * (1.0 + self.canal_gain)),
            ("otolith loop", corner(self.otolith_low_pass_hz) * (1.0 - self.accel_gain)),
            (
                "believed gravity",
                (self.gif_to_gravity_gain_per_s + gif_to_omega).abs() / (1.0 - self.accel_gain),
            ),
        ] {
            if rate_per_s > limit_per_s {
                return Err(ParameterError::TooFast { what, rate_per_s, limit_per_s });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_values_are_named() {
        let seed = ObserverParameters::default();
        for (key, bad) in [
            ("canal_gain", ObserverParameters { canal_gain: 0.0, ..seed }),
            ("accel_gain", ObserverParameters { accel_gain: 1.0, ..seed }),
            ("gif_to_omega_gain_per_s", ObserverParameters { gif_to_omega_gain_per_s: f64::NAN, ..seed }),
            ("dominant_time_constant_s", ObserverParameters { dominant_time_constant_s: -5.7, ..seed }),
            ("canal_low_pass_hz", ObserverParameters { canal_low_pass_hz: Some(0.0), ..seed }),
        ] {
            let text = bad.validate().unwrap_err().to_string();
            assert!(text.contains(key) && text.contains("\n\nhint: "), "{text}");
        }
    }

    #[test]
    fn loops_faster_than_the_integrator_are_refused() {
        let seed = ObserverParameters::default();
        for (what, bad) in [
            ("canal loop", ObserverParameters { canal_low_pass_hz: Some(20.0), ..seed }),
            ("otolith loop", ObserverParameters { otolith_low_pass_hz: Some(50.0), ..seed }),
            ("believed gravity", ObserverParameters { gif_to_gravity_gain_per_s: 5000.0, ..seed }),
        ] {
            let text = bad.validate().unwrap_err().to_string();
            assert!(text.contains(what), "{text}");
        }
    }

    #[test]
    fn unknown_keys_are_refused_and_missing_ones_are_those_of_the_seed() {
        let text = toml::to_string(&ObserverParameters::default()).unwrap();
        assert_eq!(toml::from_str::<ObserverParameters>(&text).unwrap(), ObserverParameters::default());
        let unknown = format!("{text}canal_gian = 8\n");
        let error = toml::from_str::<ObserverParameters>(&unknown).unwrap_err().to_string();
        assert!(error.contains("canal_gian"), "{error}");
        let one = toml::from_str::<ObserverParameters>("accel_gain = -3.2").unwrap();
        assert_eq!(one, ObserverParameters { accel_gain: -3.2, ..ObserverParameters::default() });
    }
}
