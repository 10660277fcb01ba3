//! The parameters that are varied, one at a time.

use std::sync::atomic::AtomicBool;

use super::{Row, threshold};
use crate::config::Config;
use crate::device::Selector;
use crate::device::mock::MockParams;
use crate::reproduce::{ExperimentError, chair_of, experiment};
use crate::runtime::CoreSettings;
use crate::vestibular::{ObserverParameters, PRESET_NAMES};

/// The scenario that everything is a variation of.
const BASE: &str = "spin-30rpm-15s";

/// Stiffness of a foot point at a relative compliance of 1, N/m: error reduction over (A h²) with the default error
/// reduction of 0.2, ticks of 1 ms and A = 3.7 1/kg, the mean of the points' diagonal `J M⁻¹ Jᵀ` along the normal.
const UNIT_STIFFNESS: f64 = 5.4e4;

type Change = Box<dyn Fn(&mut CoreSettings, &mut MockParams) + Send + Sync>;

/// One parameter changed.
pub(super) struct Variation {
    parameter: &'static str,
    value: String,
    change: Change,
}

impl Variation {
    pub(super) fn new(
        parameter: &'static str,
        value: String,
        change: impl Fn(&mut CoreSettings, &mut MockParams) + Send + Sync + 'static,
    ) -> Self {
        Self { parameter, value, change: Box::new(change) }
    }

    /// Nothing changed.
    pub(super) fn none() -> Self {
        Self::new("none", "-".to_owned(), |_, _| ())
    }

    /// The base scenario with this change.
    pub(super) fn config(&self) -> Result<Config, ExperimentError> {
        self.applied_to(BASE)
    }

    /// Another scenario of a mock chair with this change.
    pub(super) fn applied_to(&self, scenario: &str) -> Result<Config, ExperimentError> {
        let mut config = Config::scenario(scenario)?;
        let mut chair = chair_of(&config)?;
        (self.change)(&mut config.core, &mut chair);
        config.device = Some(Selector::Mock(chair).to_string());
        Ok(config)
    }

    /// What comes out of the base scenario with this change, and how long a spin it takes to fall.
    pub(super) fn row(&self, stop: &AtomicBool) -> Result<Row, ExperimentError> {
        let green = experiment(&self.config()?, stop, |_, _| ())?.analysis.green;
        let standing = green.fell_at_s.is_none();
        Ok(Row {
            parameter: self.parameter,
            value: self.value.clone(),
            peak_gravity_tilt_deg: green.peak_gravity_tilt_deg.filter(|_| standing),
            peak_com_sway_deg: green.peak_com_sway_deg.filter(|_| standing),
            peak_foot_tilt_deg: green.peak_foot_tilt_deg.filter(|_| standing),
            fall_threshold: threshold::fall_threshold(self, stop)?,
        })
    }
}

/// Every row of the table.
pub(super) fn all() -> Vec<Variation> {
    let mut all = Vec::new();
    all.extend([8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0].map(|stiffness: f64| {
        Variation::new("kp_l (1/s2), critically damped", format!("{stiffness}"), move |core, _| {
            core.balance.com_stiffness = stiffness;
            core.balance.com_damping = 2.0 * stiffness.sqrt();
        })
    }));
    all.extend([-18.0, -10.0, 0.0, 5.0, 10.0].map(|shift_mm| {
        let ahead_mm = 18.0 + shift_mm;
        Variation::new("vestibule ahead of the spin axis (mm)", format!("{ahead_mm}"), move |core, _| {
            core.vestibule_shift[0] = 1e-3 * shift_mm;
        })
    }));
    all.extend([1e-4, 1e-2, 0.1, 0.2, 0.5].map(|compliance| {
        let stiffness = UNIT_STIFFNESS / compliance;
        Variation::new("contact stiffness of a point (N/m)", format!("{stiffness:.1e}"), move |core, _| {
            core.contact.relative_compliance = compliance;
        })
    }));
    all.extend([0.2, 2.0, 5.0].map(|force| {
        Variation::new("least force of a foot point (N)", format!("{force}"), move |core, _| {
            core.balance.least_point_force = force;
        })
    }));
    all.extend(PRESET_NAMES.map(|name| {
        Variation::new("observer preset", name.to_owned(), move |core, _| {
            core.observer = ObserverParameters::preset(name).unwrap_or_default();
        })
    }));
    all.extend([0.2, 1.0, 3.0].map(|ramp_s| {
        Variation::new("ramps of the chair (s)", format!("{ramp_s}"), move |_, chair| chair.ramp_s = ramp_s)
    }));
    all
}

/// A realistic IMU: 200 Hz, 0.005 rad/s and 0.03 m/s² rms, 10 ms late.
pub(super) fn noisy_imu(seed: u64) -> Variation {
    Variation::new("noise seed", seed.to_string(), move |_, chair| {
        chair.noise = true;
        chair.seed = seed;
        chair.sample_rate_hz = 200.0;
        chair.gyro_noise = 0.005;
        chair.specific_force_noise = 0.03;
        chair.latency_s = 0.01;
    })
}
