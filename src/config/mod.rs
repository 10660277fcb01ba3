//! One configuration for every command: a TOML file, then the command line on top of it.
//!
//! The effective configuration is written into each recording, so a recording needs nothing else. There are no
//! environment variables.

mod can_map;
mod scenarios;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

pub use can_map::CanMapTexts;
pub use scenarios::SCENARIO_NAMES;

use crate::character::{CharacterModel, ModelError, STANDING_MJCF};
use crate::device::DeviceError;
use crate::device::fault::FaultPlan;
use crate::device::protocol::can_map::{CanMap, CanMapError};
use crate::device::protocol::text::{TextError, TextMapping};
use crate::imu::{Calibration, ImuConfigError, ImuSettings, Mount};
use crate::motion::{MOTION_NAMES, MotionError, MotionSettings, shipped_motion};
use crate::runtime::{CoreSettings, CoreSettingsError, LiveSettings, LiveSettingsError};
use crate::vestibular::{ObserverParameters, PRESET_NAMES};

/// Name of the mount's file in a recording.
pub const SENSOR_MOUNT: &str = "sensor/mount.toml";
/// Name of the calibration's file in a recording.
pub const SENSOR_CALIBRATION: &str = "sensor/calibration.toml";
/// Name of the text mapping's file in a recording.
pub const SENSOR_LOG_MAP: &str = "sensor/log_map.toml";
/// Name of the CAN mapping's file in a recording.
pub const SENSOR_CAN_MAP: &str = "sensor/can_map.toml";
/// Name of its DBC file in a recording, in UTF-8.
pub const SENSOR_CAN_DBC: &str = "sensor/can.dbc";

/// Everything a run can be told.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Device selector, for example `serial:/dev/ttyUSB0?baud=921600`.
    pub device: Option<String>,
    /// Protocol of the device; found by itself when absent.
    pub protocol: Option<String>,
    /// Commands to the device before it is listened to, such as `rate=200`; none are sent when absent.
    pub configure: Option<String>,
    /// Take readings that are worse than this program promises, from a device that has no better ones.
    pub allow_degraded: bool,
    /// Mapping of the columns of a text log.
    pub log_map: Option<PathBuf>,
    /// Mapping of the signals on a CAN bus: a ready one by its name, or a file.
    pub can_map: Option<String>,
    /// DBC file of the CAN mapping, above the one that it names itself.
    pub dbc: Option<PathBuf>,
    /// Calibration of the sensor.
    pub calibration: Option<PathBuf>,
    /// Mounting of the sensor on the chair.
    pub mount: Option<PathBuf>,
    /// Model of the character; the built-in one when absent.
    pub character: Option<PathBuf>,
    /// Preset of the vestibular model; it replaces `core.observer`.
    pub observer_preset: Option<String>,
    /// Motion of both characters, a built-in name or a file; it replaces `core.motion`.
    pub motion: Option<String>,
    /// Faults to inject into the traffic, for trials: none when absent.
    pub faults: Option<FaultPlan>,
    /// From readings to head motion.
    pub imu: ImuSettings,
    /// Threads and deadlines of a live run.
    pub live: LiveSettings,
    /// The two characters.
    pub core: CoreSettings,
}

/// Why a configuration cannot be used. Every one of these is the user's to mend.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// A file that cannot be read.
    #[error("{}: cannot read it: {source}\n\nhint: {}", path.display(), hint_for(source))]
    File {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// Not TOML, or a key or value that does not belong there.
    #[error("{file}: {}\n\nhint: {PRINT_CONFIG}", source.to_string().trim_end())]
    Toml {
        /// The file.
        file: String,
        /// What is wrong, with line and column.
        source: toml::de::Error,
    },
    /// A preset that does not exist.
    #[error("{file}: key `observer_preset` is `{got}`, allowed are {known}\n\nhint: `seed` is the default")]
    Preset {
        /// The file.
        file: String,
        /// The name given.
        got: String,
        /// The names there are.
        known: String,
    },
    /// A scenario that does not exist.
    #[error("there is no scenario `{got}`\n\nhint: scenarios are {known}")]
    Scenario {
        /// The name given.
        got: String,
        /// The names there are.
        known: String,
    },
    /// A motion that is neither built in nor a file that can be read.
    #[error(
        "{file}: motion `{got}` is neither built in nor a file\n\nhint: built in are {known}; anything else is the \
         path of a TOML file of key poses"
    )]
    MotionName {
        /// The file that names it.
        file: String,
        /// The name given.
        got: String,
        /// The names there are.
        known: String,
    },
    /// A bad motion file.
    #[error("{file}: {}", with_own_hint(source, SHOW_MOTION))]
    Motion {
        /// The file.
        file: String,
        /// What is wrong.
        source: MotionError,
    },
    /// A value of the core out of range.
    #[error("{file}: table [core]: {}", with_own_hint(source, PRINT_CONFIG))]
    Core {
        /// The file.
        file: String,
        /// Key, value and range.
        source: CoreSettingsError,
    },
    /// A value of the live run out of range.
    #[error("{file}: {}", with_own_hint(source, PRINT_CONFIG))]
    Live {
        /// The file.
        file: String,
        /// Key, value and range.
        source: LiveSettingsError,
    },
    /// A value of the IMU path out of range, or a bad calibration or mount.
    #[error(transparent)]
    Imu(#[from] ImuConfigError),
    /// A bad mapping of a text log.
    #[error(transparent)]
    Text(#[from] TextError),
    /// A bad mapping of CAN signals, or its DBC file.
    #[error(transparent)]
    CanMap(#[from] CanMapError),
    /// A DBC file without the mapping that says what its signals are.
    #[error(
        "{}: a DBC file alone does not say which signals are gyro and accelerometer\n\nhint: name a mapping with --map: a \
         ready one ({ready}), or a file like those in configs/can", dbc.display()
    )]
    DbcWithoutMap {
        /// The DBC file.
        dbc: PathBuf,
        /// Names of the ready mappings.
        ready: String,
    },
    /// A bad model file.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A bad device selector or protocol.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// No device was named.
    #[error(
        "no device to read from\n\nhint: name one with --device, for example serial:/dev/ttyUSB0?baud=921600, can:can0, \
         slcan:/dev/ttyACM0, replay:FILE or mock:chair; `otolith devices` lists what is connected"
    )]
    NoDevice,
}

const PRINT_CONFIG: &str = "`otolith run --print-config` prints every key with its default";
const SHOW_MOTION: &str = "`otolith run --motion reach --print-config` shows a motion, below [core]";

/// An error's text; one that brings no hint of its own gets the general one of its kind.
fn with_own_hint(error: &dyn std::error::Error, general: &str) -> String {
    let text = error.to_string();
    if text.contains("\n\nhint: ") { text } else { format!("{text}\n\nhint: {general}") }
}

fn hint_for(error: &std::io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::InvalidData => "a text file in UTF-8 is expected here; is this the right file?",
        ErrorKind::IsADirectory => "this is a folder: name a file in it",
        _ => "check the path, and that you may read the file",
    }
}

impl Config {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`ConfigError`] names the file and the key.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        Self::from_toml(&read(path)?, &path.display().to_string())
    }

    /// Parses and checks a text; `file` only names it in errors.
    ///
    /// # Errors
    /// [`ConfigError`] names the file and the key.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, ConfigError> {
        let config: Self =
            toml::from_str(text).map_err(|source| ConfigError::Toml { file: file.to_owned(), source })?;
        config.resolved(file)
    }

    /// The same with preset and motion put in place, checked.
    ///
    /// # Errors
    /// [`ConfigError`] names the file and the key.
    pub fn resolved(mut self, file: &str) -> Result<Self, ConfigError> {
        if let Some(name) = self.observer_preset.take() {
            self.core.observer = ObserverParameters::preset(&name).ok_or_else(|| ConfigError::Preset {
                file: file.to_owned(),
                got: name,
                known: PRESET_NAMES.join(", "),
            })?;
        }
        if let Some(name) = self.motion.take() {
            self.core.motion = Some(read_motion(&name, file)?);
        }
        self.imu.validate(file)?;
        self.faults.as_ref().map_or(Ok(()), FaultPlan::validate)?;
        self.core.check().map_err(|source| ConfigError::Core { file: file.to_owned(), source })?;
        self.live.check().map_err(|source| ConfigError::Live { file: file.to_owned(), source })?;
        Ok(self)
    }

    /// The whole configuration as TOML.
    pub fn to_toml(&self) -> String {
        // Serialising plain numbers, strings and tables to a string has no way to fail; an empty text would be caught
        // by the first reader.
        toml::to_string(self).unwrap_or_default()
    }

    /// Text of the model file and its name.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn model_text(&self) -> Result<(String, String), ConfigError> {
        match &self.character {
            None => Ok(("standing.xml".to_owned(), STANDING_MJCF.to_owned())),
            Some(path) => Ok((path.display().to_string(), read(path)?)),
        }
    }

    /// The character's model.
    ///
    /// # Errors
    /// The file cannot be read or is outside the supported subset.
    pub fn model(&self) -> Result<CharacterModel, ConfigError> {
        let (name, text) = self.model_text()?;
        Ok(CharacterModel::from_mjcf(&text, &name)?)
    }

    /// Texts of the files about the sensor, by the name under which a recording keeps them.
    ///
    /// # Errors
    /// A file cannot be read.
    pub fn sensor_texts(&self) -> Result<Vec<(String, String)>, ConfigError> {
        let files = [
            (SENSOR_MOUNT, &self.mount),
            (SENSOR_CALIBRATION, &self.calibration),
            (SENSOR_LOG_MAP, &self.log_map),
        ];
        let named = files.into_iter().filter_map(|(name, path)| path.as_ref().map(|path| (name, path)));
        let mut texts: Vec<_> = named
            .map(|(name, path)| Ok((name.to_owned(), read(path)?)))
            .collect::<Result<_, ConfigError>>()?;
        if let Some(can) = self.can_map_texts()? {
            texts.extend([(SENSOR_CAN_MAP.to_owned(), can.map), (SENSOR_CAN_DBC.to_owned(), can.dbc)]);
        }
        Ok(texts)
    }

    /// Calibration, mount and mappings from their files.
    ///
    /// # Errors
    /// A file cannot be read or holds something impossible, for example a mirrored mount.
    pub fn sensor(&self) -> Result<Sensor, ConfigError> {
        let calibration = match &self.calibration {
            Some(path) => Calibration::from_toml(&path.display().to_string(), &read(path)?)?,
            None => Calibration::default(),
        };
        let mount = match &self.mount {
            Some(path) => Mount::from_toml(&path.display().to_string(), &read(path)?)?,
            None => Mount::default(),
        };
        let mapping = match &self.log_map {
            Some(path) => Some(TextMapping::from_toml(&path.display().to_string(), &read(path)?)?),
            None => None,
        };
        let can_map = self.can_map_texts()?.map(|texts| texts.compile()).transpose()?;
        Ok(Sensor { calibration, mount, mapping, can_map })
    }
}

/// What is known about the sensor before it speaks.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Counts and axes to SI.
    pub calibration: Calibration,
    /// Sensor axes to chair axes.
    pub mount: Mount,
    /// Columns of a text log.
    pub mapping: Option<TextMapping>,
    /// Signals of a CAN bus.
    pub can_map: Option<CanMap>,
}

fn read(path: &Path) -> Result<String, ConfigError> {
    std::fs::read_to_string(path).map_err(|source| ConfigError::File { path: path.to_owned(), source })
}

/// The motion called `name`: a built-in one, or that of a file; `named_in` is where the name stands.
fn read_motion(name: &str, named_in: &str) -> Result<MotionSettings, ConfigError> {
    let text = match shipped_motion(name) {
        Some(text) => text.to_owned(),
        None => std::fs::read_to_string(name).map_err(|source| match source.kind() {
            ErrorKind::NotFound => ConfigError::MotionName {
                file: named_in.to_owned(),
                got: name.to_owned(),
                known: MOTION_NAMES.join(", "),
            },
            _ => ConfigError::File { path: PathBuf::from(name), source },
        })?,
    };
    MotionSettings::from_toml(&text).map_err(|source| ConfigError::Motion { file: name.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_effective_configuration_survives_being_written_and_read() {
        let mut config = Config { device: Some("mock:chair".to_owned()), ..Config::default() };
        config.core.balance.least_point_force = 0.1 + 0.2; // no short decimal
        config.core.respawn_after_s = Some(3.0);
        assert_eq!(Config::from_toml(&config.to_toml(), "test").unwrap(), config);
    }

    #[test]
    fn a_preset_replaces_the_observer_and_an_unknown_one_names_the_others() {
        let config = Config::from_toml("observer_preset = \"merfeld-zupan-2002\"", "test").unwrap();
        assert_eq!(Some(config.core.observer), ObserverParameters::preset("merfeld-zupan-2002"));
        let error = Config::from_toml("observer_preset = \"mz\"", "run.toml").unwrap_err().to_string();
        assert!(
            error.contains("run.toml") && error.contains("`mz`") && error.contains("merfeld-zupan-2002"),
            "{error}"
        );
    }

    #[test]
    fn a_named_motion_is_held_whole_by_the_effective_configuration() {
        let config = Config::from_toml("motion = \"drink\"", "test").unwrap();
        let motion = MotionSettings::from_toml(shipped_motion("drink").unwrap()).unwrap();
        assert_eq!(config.core.motion, Some(motion));
        assert!(config.motion.is_none());
        assert_eq!(Config::from_toml(&config.to_toml(), "test").unwrap(), config);
    }

    #[test]
    fn a_pose_that_cannot_be_stood_in_is_refused_and_one_key_of_it_is_enough() {
        let pose = |text: &str| {
            let config = Config::from_toml(&format!("[core.pose]\n{text}"), "run.toml").unwrap();
            crate::runtime::Core::new(config.core, CharacterModel::standing().unwrap()).map(|_| ())
        };
        assert!(pose("com_ahead_of_centroid = -0.005").is_ok());
        for text in
            ["com_ahead_of_centroid = nan", "initial_overlap = 1e300", "joint_angles = { neck_x = nan }"]
        {
            let error = pose(text).unwrap_err().to_string();
            assert!(error.contains("hint:"), "{error}");
        }
    }

    #[test]
    fn errors_name_file_key_and_range() {
        let error = Config::from_toml("[core.balance]\nfrictoin = 1.0", "run.toml").unwrap_err().to_string();
        assert!(
            error.contains("run.toml") && error.contains("frictoin") && error.contains("hint:"),
            "{error}"
        );
        let error = Config::from_toml("[core.balance]\nfriction = -1.0", "run.toml").unwrap_err().to_string();
        assert!(error.contains("run.toml") && error.contains("friction") && error.contains("-1"), "{error}");
        let error = Config::from_toml("[imu]\nhold_limit_s = -0.1", "run.toml").unwrap_err().to_string();
        assert!(error.contains("run.toml") && error.contains("hold_limit_s"), "{error}");
    }
}
