//! `otolith run`: both characters driven by a device, a log or a mock.

use std::path::PathBuf;
use std::process::ExitCode;

use super::assemble::Pace;
use super::decoder_flags::DecoderFlags;
use super::failure::Failure;
use super::session::Session;
use super::show;
use crate::config::{Config, ConfigError, SCENARIO_NAMES};
use crate::device::Selector;
use crate::vestibular::PRESET_NAMES;

/// Drive both characters from a device, a log or a mock.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    otolith run --device serial:/dev/ttyUSB0?baud=921600 --out my-run\n  \
    otolith run --device can:can0 --duration-s 60 --record my-run.mcap\n  \
    otolith run --device slcan:/dev/ttyACM0?bitrate=500000 --duration-s 60\n  \
    otolith run --device replay:log.txt --log-map configs/logs/turntable-lsm9ds1.toml --pace max --json\n  \
    otolith run --device can:can0 --map racelogic-imu04 --duration-s 60\n  \
    otolith run --device mock:chair --rate-rpm 20 --pace max\n  \
    otolith run --scenario spin-30rpm-20s --pace max --out fall\n  \
    otolith run --device mock:chair --motion reach --print-config > my-run.toml\n\n\
    A motion begins a quarter of a second after the turntable has come to rest from at least one whole turn, and again \
    only after the characters were stood up; core.motion_start_s begins it at a fixed time instead. \
    configs/motions holds the key poses of the built-in ones.\n\n\
    While it runs: r + Enter stands the characters up again, Ctrl-C ends the run and prints the summary.")]
pub(super) struct RunArgs {
    /// Device: serial:PORT?baud=N, can:IFACE, slcan:PORT, replay:FILE, mock:chair.
    #[arg(long, value_name = "SELECTOR")]
    device: Option<String>,
    /// An experiment of the standing paper, by the name of its file in configs/scenarios.
    #[arg(long, value_name = "NAME", conflicts_with = "config",
          value_parser = clap::builder::PossibleValuesParser::new(SCENARIO_NAMES))]
    scenario: Option<String>,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    options: Options,
    /// End after this much time.
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    duration_s: Option<f64>,
    /// Write figure.svg and summary.json into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Real time, or as fast as the machine goes (recordings and mocks only) [default: real].
    #[arg(long, value_enum, default_value_t = Pace::Real, hide_default_value = true)]
    pace: Pace,
    /// Print the effective configuration as TOML and stop.
    #[arg(long)]
    print_config: bool,
    // Last, because its heading would hold for every option behind it.
    #[command(flatten)]
    chair: ChairArgs,
}

/// What is known about the sensor beforehand.
#[derive(Debug, clap::Args)]
struct SensorArgs {
    #[command(flatten)]
    flags: DecoderFlags,
    /// Set the device up first: rate=HZ, baud=N, save. Needs --protocol; without this flag nothing is changed on a device.
    #[arg(long, value_name = "KEY=VALUE,...")]
    configure: Option<String>,
    /// How the sensor is mounted on the chair.
    #[arg(long, value_name = "FILE.toml")]
    mount: Option<PathBuf>,
    /// Calibration of the sensor.
    #[arg(long, value_name = "FILE.toml")]
    calibration: Option<PathBuf>,
}

impl SensorArgs {
    /// Puts the flags into the configuration, above what its file says.
    fn apply(&self, config: &mut Config) {
        self.flags.apply(config);
        config.configure = self.configure.clone().or(config.configure.take());
        config.mount = self.mount.clone().or(config.mount.take());
        config.calibration = self.calibration.clone().or(config.calibration.take());
    }
}

/// Options that every run has.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// Configuration file; the flags stand above it.
    #[arg(long, value_name = "FILE.toml")]
    config: Option<PathBuf>,
    /// Model of the character (MJCF subset).
    #[arg(long, value_name = "FILE.xml")]
    character: Option<PathBuf>,
    /// Preset of the vestibular model.
    #[arg(long, value_name = "NAME", value_parser = clap::builder::PossibleValuesParser::new(PRESET_NAMES))]
    preset: Option<String>,
    /// Motion both characters make once the turntable rests after a spin: reach, drink, stand-up, or a file of key poses.
    #[arg(long, value_name = "NAME|FILE.toml")]
    motion: Option<String>,
    /// Stand a fallen character up again after this time.
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    respawn: Option<f64>,
    /// Write the recording to this file.
    #[arg(long, value_name = "FILE.mcap")]
    pub(super) record: Option<PathBuf>,
    /// Overwrite files.
    #[arg(long)]
    pub(super) force: bool,
}

impl Options {
    /// The configuration: file or scenario first, flags on top.
    pub(super) fn config(&self, scenario: Option<&str>) -> Result<Config, Failure> {
        let mut config = match (&self.config, scenario) {
            (Some(path), _) => Config::load(path)?,
            (None, Some(name)) => Config::scenario(name)?,
            (None, None) => Config::default(),
        };
        config.character = self.character.clone().or(config.character);
        config.observer_preset = self.preset.clone();
        config.motion = self.motion.clone();
        config.core.respawn_after_s = positive("--respawn", self.respawn)?.or(config.core.respawn_after_s);
        Ok(config.resolved("command line")?)
    }
}

/// Parameters of the mock chair; each replaces the selector's.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Mock chair")]
pub(super) struct ChairArgs {
    /// Rate of rotation, rpm; positive is to the left [default: 30].
    #[arg(long, value_name = "RPM", allow_hyphen_values = true)]
    rate_rpm: Option<f64>,
    /// From the start of the ramp up to the start of the ramp down [default: 15].
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    spin_s: Option<f64>,
    /// Length of each ramp [default: 1].
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    ramp_s: Option<f64>,
    /// Rest before the spin [default: 2].
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    rest_s: Option<f64>,
    /// Rest after the spin [default: 25].
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    after_s: Option<f64>,
    /// Seed of the sensor noise [default: 0].
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

impl ChairArgs {
    /// Puts the parameters into the selector.
    pub(super) fn apply(&self, selector: &mut Selector) -> Result<(), Failure> {
        let given = [self.rate_rpm, self.spin_s, self.ramp_s, self.rest_s, self.after_s];
        let Selector::Mock(params) = selector else {
            if self.seed.is_none() && given.iter().all(Option::is_none) {
                return Ok(());
            }
            return Err(Failure::usage(format!(
                "--rate-rpm, --spin-s, --ramp-s, --rest-s, --after-s and --seed belong to mock:chair, not to {selector}\n\n\
                 hint: leave them out, or use --device mock:chair"
            )));
        };
        let slots = [
            &mut params.rate_rpm,
            &mut params.spin_s,
            &mut params.ramp_s,
            &mut params.rest_s,
            &mut params.after_s,
        ];
        for (slot, value) in slots.into_iter().zip(given) {
            *slot = value.unwrap_or(*slot);
        }
        params.seed = self.seed.unwrap_or(params.seed);
        Ok(params.validate()?)
    }
}

/// Length of the source, where it is known before the run.
pub(super) fn expected_s(selector: &Selector) -> Option<f64> {
    match selector {
        Selector::Mock(params) => Some(params.duration_s()),
        _ => None,
    }
}

pub(super) fn run(args: &RunArgs, json: bool) -> Result<ExitCode, Failure> {
    let mut config = args.options.config(args.scenario.as_deref())?;
    config.device = args.device.clone().or(config.device);
    args.sensor.apply(&mut config);
    let duration_s = positive("--duration-s", args.duration_s)?;
    if let Some(device) = &mut config.device {
        let mut selector: Selector = device.parse()?;
        args.chair.apply(&mut selector)?;
        *device = selector.to_string();
    }
    if args.print_config {
        if json {
            show::json(&config)?
        } else {
            show::text(&config.to_toml())?
        }
        return Ok(ExitCode::SUCCESS);
    }
    let selector: Selector = config.device.as_deref().ok_or(ConfigError::NoDevice)?.parse()?;
    Session {
        expected_s: expected_s(&selector),
        config,
        selector,
        pace: args.pace,
        duration_s,
        record: args.options.record.clone(),
        out: args.out.clone(),
        force: args.options.force,
        json,
    }
    .run()
}

/// A time given by a flag, s: finite and above zero.
fn positive(flag: &str, value: Option<f64>) -> Result<Option<f64>, Failure> {
    match value {
        Some(got) if !(got.is_finite() && got > 0.0) => Err(Failure::usage(format!(
            "{flag} is {got}, expected more than 0 s\n\nhint: give a number of seconds, or leave {flag} out"
        ))),
        value => Ok(value),
    }
}
