//! Configurations with a name, built into the program: the experiments of the standing paper.
//!
//! A scenario is a configuration like any other (`configs/scenarios/NAME.toml`), so what `otolith reproduce` measures
//! can be run, changed and recorded by `otolith run --scenario NAME`.

use super::{Config, ConfigError};

macro_rules! scenarios {
    ($($name:literal),+ $(,)?) => {
        /// Every scenario: name and text of its file.
        const SCENARIOS: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../configs/scenarios/", $name, ".toml")))),+];
        /// Names of the scenarios, in the order of the paper's figures.
        pub const SCENARIO_NAMES: &[&str] = &[$($name),+];
    };
}

scenarios![
    "constant-yaw",
    "spin-30rpm-15s",
    "push-4ns",
    "spin-10rpm-15s",
    "spin-20rpm-15s",
    "spin-30rpm-10s",
    "spin-30rpm-20s",
    "spin-30rpm-17s-tau-2-85",
    "spin-30rpm-17s",
    "spin-30rpm-17s-tau-11-4",
    "motion-reach",
    "motion-drink",
    "motion-stand-up",
    "spin-30rpm-14s",
    "recovery-10rpm-15s",
    "recovery-20rpm-15s",
    "recovery-30rpm-10s",
    "recovery-30rpm-15s",
];

impl Config {
    /// The scenario called `name`, one of [`SCENARIO_NAMES`].
    ///
    /// # Errors
    /// [`ConfigError::Scenario`] lists the names there are.
    pub fn scenario(name: &str) -> Result<Self, ConfigError> {
        let (_, text) = SCENARIOS.iter().find(|(known, _)| *known == name).ok_or_else(|| {
            ConfigError::Scenario { got: name.to_owned(), known: SCENARIO_NAMES.join(", ") }
        })?;
        Self::from_toml(text, &format!("configs/scenarios/{name}.toml"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Selector;

    #[test]
    fn every_scenario_is_a_valid_configuration_of_a_mock_chair_without_noise() {
        for name in SCENARIO_NAMES {
            let config = Config::scenario(name).unwrap();
            let selector: Selector = config.device.unwrap().parse().unwrap();
            assert!(matches!(&selector, Selector::Mock(params) if !params.noise), "{name}: {selector}");
        }
    }

    #[test]
    fn every_file_in_the_folder_is_a_scenario() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/scenarios");
        let mut files: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned())
            .collect();
        files.sort();
        let mut names = SCENARIO_NAMES.to_vec();
        names.sort_unstable();
        assert_eq!(files, names);
    }

    #[test]
    fn an_unknown_scenario_is_refused_with_the_names_there_are() {
        let error = Config::scenario("spin").unwrap_err().to_string();
        assert!(error.contains("`spin`") && error.contains("spin-30rpm-15s"), "{error}");
    }

    #[test]
    fn all_scenarios_share_one_parameter_set_and_change_only_what_their_figure_varies() {
        for name in SCENARIO_NAMES {
            let mut core = Config::scenario(name).unwrap().core;
            (core.push, core.motion) = (None, None);
            if name.contains("-tau-") {
                core.observer = Default::default();
            }
            assert_eq!(core, crate::runtime::CoreSettings::default(), "{name}");
        }
    }

    #[test]
    fn a_scenario_keeps_what_it_does_not_name() {
        let short = Config::scenario("spin-30rpm-17s-tau-2-85").unwrap().core;
        let mut usual = Config::scenario("spin-30rpm-17s").unwrap().core;
        assert_eq!(usual, crate::runtime::CoreSettings::default());
        usual.observer.dominant_time_constant_s = 2.85;
        usual.observer.internal_dominant_time_constant_s = 2.85;
        assert_eq!(short, usual);
    }
}
