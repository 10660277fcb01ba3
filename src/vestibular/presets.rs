//! Published parameter sets, by name. `configs/observers/` holds the same numbers for copying and changing.

use super::ObserverParameters;

/// Names of the presets, the default first.
pub const PRESET_NAMES: [&str; 5] =
    ["seed", "newman-lpf", "merfeld-zupan-2002", "irmak-2023", "allred-tuned"];

/// Name of the preset used when none is named: the paper's. It stores rotation for longer than people do.
pub const DEFAULT_PRESET: &str = PRESET_NAMES[0];

/// The paper's Fig. 5, after Newman 2009: yaw falls to 1/e in 27.2 s, people's in 14.5-20 s.
pub(super) const SEED: ObserverParameters = ObserverParameters {
    canal_gain: 8.0,
    gif_to_gravity_gain_per_s: 4.0,
    gif_to_omega_gain_per_s: 8.0,
    accel_gain: -4.0,
    omega_to_gravity_gain: 1.0,
    dominant_time_constant_s: 5.7,
    adaptation_time_constant_s: 80.0,
    internal_dominant_time_constant_s: 5.7,
    canal_low_pass_hz: None,
    otolith_low_pass_hz: None,
};

/// The published Simulink *Observer*: the same gains behind 2 Hz low-passes. The MISC model was trained on it.
const NEWMAN_LPF: ObserverParameters =
    ObserverParameters { canal_low_pass_hz: Some(2.0), otolith_low_pass_hz: Some(2.0), ..SEED };

/// Merfeld & Zupan's gains as given by Rader, Oman & Merfeld 2009, Table 4.
const MERFELD_ZUPAN_2002: ObserverParameters = ObserverParameters {
    canal_gain: 3.0,
    gif_to_gravity_gain_per_s: 2.0,
    gif_to_omega_gain_per_s: 2.0,
    accel_gain: -2.0,
    ..SEED
};

/// Irmak 2023, from the published Simulink *Observer*.
const IRMAK_2023: ObserverParameters = ObserverParameters {
    canal_gain: 2.28,
    gif_to_gravity_gain_per_s: 15.4,
    gif_to_omega_gain_per_s: 0.0,
    accel_gain: -3.2,
    ..SEED
};

/// Allred's tuned gains, from the published Simulink *Observer*.
const ALLRED_TUNED: ObserverParameters = ObserverParameters { canal_gain: 2.28, accel_gain: -3.2, ..SEED };

impl ObserverParameters {
    /// The preset called `name`, one of [`PRESET_NAMES`].
    pub fn preset(name: &str) -> Option<Self> {
        match name {
            "seed" => Some(SEED),
            "newman-lpf" => Some(NEWMAN_LPF),
            "merfeld-zupan-2002" => Some(MERFELD_ZUPAN_2002),
            "irmak-2023" => Some(IRMAK_2023),
            "allred-tuned" => Some(ALLRED_TUNED),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOT: &str = env!("CARGO_MANIFEST_DIR");

    #[test]
    fn every_name_is_a_valid_preset_and_nothing_else_is() {
        for name in PRESET_NAMES {
            ObserverParameters::preset(name).unwrap().validate().unwrap();
        }
        assert_eq!(ObserverParameters::preset("human"), None);
        assert_eq!(ObserverParameters::preset(DEFAULT_PRESET), Some(ObserverParameters::default()));
    }

    #[test]
    fn the_files_hold_the_same_numbers() {
        let folder = format!("{ROOT}/configs/observers");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), PRESET_NAMES.len());
        for name in PRESET_NAMES {
            let text = std::fs::read_to_string(format!("{folder}/{name}.toml")).unwrap();
            assert_eq!(
                toml::from_str::<ObserverParameters>(&text).ok(),
                ObserverParameters::preset(name),
                "{name}"
            );
        }
    }

    #[test]
    fn the_numbers_are_the_reference_ones() {
        let text = std::fs::read_to_string(format!("{ROOT}/tests/golden/observer/presets.json")).unwrap();
        let golden: serde_json::Value = serde_json::from_str(&text).unwrap();
        for name in PRESET_NAMES {
            let ours = ObserverParameters::preset(name).unwrap();
            for (key, value) in [
                ("kw", Some(ours.canal_gain)),
                ("kf", Some(ours.gif_to_gravity_gain_per_s)),
                ("kfw", Some(ours.gif_to_omega_gain_per_s)),
                ("ka", Some(ours.accel_gain)),
                ("kwf", Some(ours.omega_to_gravity_gain)),
                ("tau_d", Some(ours.dominant_time_constant_s)),
                ("tau_a", Some(ours.adaptation_time_constant_s)),
                ("tau_d_hat", Some(ours.internal_dominant_time_constant_s)),
                ("canal_lp_hz", ours.canal_low_pass_hz),
                ("oto_lp_hz", ours.otolith_low_pass_hz),
            ] {
                assert!(golden[name].get(key).is_some(), "{name} {key}");
                assert_eq!(golden[name][key].as_f64(), value, "{name} {key}");
            }
        }
    }
}
