//! One scenario, run through the whole program from the mock device's bytes to both characters.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use super::stills::Stills;
use crate::config::{Config, ConfigError};
use crate::device::mock::{MockChair, MockParams};
use crate::device::protocol::native_serial::NativeSerialDecoder;
use crate::device::{DeviceError, Selector};
use crate::imu::ImuPipeline;
use crate::report::{Analysis, Character, CharacterMetrics, Trace};
use crate::runtime::{Core, CoreSettingsError, Journal, Source, run_offline};
use crate::tick::TickOutput;

/// Why an experiment could not be run.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// A configuration that cannot be used.
    #[error(transparent)]
    Config(Box<ConfigError>),
    /// A device that cannot be used.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// Settings the core cannot run with.
    #[error(transparent)]
    Core(#[from] CoreSettingsError),
    /// Not a mock chair.
    #[error(
        "an experiment needs a mock chair, not {device}\n\nhint: name one, for example mock:chair?rate_rpm=30"
    )]
    NotAMock {
        /// The device that was named.
        device: String,
    },
}

impl From<ConfigError> for ExperimentError {
    fn from(error: ConfigError) -> Self {
        Self::Config(Box::new(error))
    }
}

/// What came out of a scenario.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// The course of both characters.
    pub trace: Trace,
    /// What was measured in it.
    pub analysis: Analysis,
    /// Simulated time, s.
    pub simulated_s: f64,
    /// The core at the end of the run.
    pub core: Core,
    /// Where both bodies were, if the run was watched for it.
    pub stills: Stills,
}

/// The mock chair of a configuration.
///
/// # Errors
/// It names none.
pub fn chair_of(config: &Config) -> Result<MockParams, ExperimentError> {
    let device = config.device.as_deref().ok_or(ConfigError::NoDevice)?;
    match device.parse()? {
        Selector::Mock(chair) => Ok(chair),
        _ => Err(ExperimentError::NotAMock { device: device.to_owned() }),
    }
}

/// Runs a configuration with a mock chair to its end, or until `stop` is set. `watch` sees the core after each tick.
///
/// # Errors
/// The configuration does not name a mock chair, or something in it cannot be used.
pub fn experiment(
    config: &Config,
    stop: &AtomicBool,
    watch: impl FnMut(&Core, &TickOutput),
) -> Result<Experiment, ExperimentError> {
    let chair = chair_of(config)?;
    let model = config.model()?;
    let sensor = config.sensor()?;
    let pipeline = ImuPipeline::new(&config.imu, sensor.calibration, sensor.mount, model.gravity.norm());
    let link = Box::new(MockChair::new(chair)?);
    let mut source = Source::new(link, Box::new(NativeSerialDecoder::new()), pipeline, None);
    let mut core = Core::new(config.core.clone(), model)?;
    let mut journal = Journal::default();
    let hold_limit_s = config.imu.hold_limit_s;
    let outcome = run_offline(&mut source, &mut core, &mut journal, hold_limit_s, None, stop, watch)?;
    let trace = journal.trace;
    let push_end_s = config.core.push.map(|push| push.start_s + push.duration_s);
    let analysis = Analysis::new(&trace, push_end_s);
    Ok(Experiment {
        trace,
        analysis,
        simulated_s: outcome.last_tick.time_s(),
        core,
        stills: Stills::default(),
    })
}

/// The experiments of a reproduction, by the name of their scenario.
#[derive(Clone, Debug, Default)]
pub struct Runs(pub BTreeMap<&'static str, Experiment>);

impl Runs {
    /// The run of `scenario`, if it is there.
    pub fn of(&self, scenario: &str) -> Option<&Experiment> {
        self.0.get(scenario)
    }

    /// How `character` fared in `scenario`; without a number where the run is missing.
    pub(super) fn metrics(&self, scenario: &str, character: Character) -> CharacterMetrics {
        let Some(run) = self.of(scenario) else { return CharacterMetrics::default() };
        match character {
            Character::Green => run.analysis.green,
            Character::Blue => run.analysis.blue,
        }
    }

    /// How the character fared that trusts its vestibular model.
    pub(super) fn green(&self, scenario: &str) -> CharacterMetrics {
        self.metrics(scenario, Character::Green)
    }

    /// How the character fared that perceives perfectly.
    pub(super) fn blue(&self, scenario: &str) -> CharacterMetrics {
        self.metrics(scenario, Character::Blue)
    }
}
