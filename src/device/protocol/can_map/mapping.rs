//! Mapping files: which signal of a DBC file is what, in which unit, and which frames make a sample.

use super::error::CanMapError;
use crate::device::protocol::quantity::{ForceUnit, RateUnit, TimeUnit};

/// Rates that make sense for a sensor on a classic CAN bus, Hz.
const RATES: std::ops::RangeInclusive<f64> = 0.1..=20_000.0;
/// A counter of 53 bits is the largest that an f64 still counts by one.
const LARGEST_WRAP: u64 = 1 << 53;

/// A signal by the names of its message and itself: `MESSAGE.SIGNAL`.
#[derive(Clone, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(try_from = "String")]
pub(super) struct SignalName {
    pub(super) message: String,
    pub(super) signal: String,
}

impl TryFrom<String> for SignalName {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match text.split_once('.') {
            Some((message, signal)) if !message.is_empty() && !signal.is_empty() => {
                Ok(Self { message: message.to_owned(), signal: signal.to_owned() })
            }
            _ => Err(format!("`{text}` is no signal, expected MESSAGE.SIGNAL")),
        }
    }
}

impl std::fmt::Display for SignalName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.message, self.signal)
    }
}

/// One component of what an IMU measures, sensor axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
pub(super) enum Axis {
    #[serde(rename = "gyro.x")]
    GyroX,
    #[serde(rename = "gyro.y")]
    GyroY,
    #[serde(rename = "gyro.z")]
    GyroZ,
    #[serde(rename = "specific_force.x")]
    ForceX,
    #[serde(rename = "specific_force.y")]
    ForceY,
    #[serde(rename = "specific_force.z")]
    ForceZ,
}

impl Axis {
    pub(super) const GYRO: [Self; 3] = [Self::GyroX, Self::GyroY, Self::GyroZ];
    pub(super) const FORCE: [Self; 3] = [Self::ForceX, Self::ForceY, Self::ForceZ];

    /// The key of the mapping.
    pub(super) fn key(self) -> &'static str {
        match self {
            Self::GyroX => "gyro.x",
            Self::GyroY => "gyro.y",
            Self::GyroZ => "gyro.z",
            Self::ForceX => "specific_force.x",
            Self::ForceY => "specific_force.y",
            Self::ForceZ => "specific_force.z",
        }
    }
}

/// A check beyond the bus's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Checksum {
    /// The last byte is the low byte of the sum of both bytes of the identifier, the length and all bytes before.
    Toyota,
}

#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct AxesTable<U> {
    x: Option<SignalName>,
    y: Option<SignalName>,
    z: Option<SignalName>,
    unit: U,
    #[serde(default = "all_positive")]
    signs: [i8; 3],
    full_scale: Option<f64>,
}

fn all_positive() -> [i8; 3] {
    [1; 3]
}

#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct TimeTable {
    signal: SignalName,
    unit: TimeUnit,
    wraps_after: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct CounterTable {
    signal: SignalName,
    wraps_after: u64,
}

/// How frames become samples, where a sample is more than one.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PairingTable {
    /// Names of the messages of a sample in the order in which they are sent.
    pub(super) order: Option<Vec<String>>,
    /// One signal of each message; frames in which they are equal belong together.
    pub(super) counters: Option<Vec<SignalName>>,
}

/// How to read the frames of a CAN bus: the parsed and checked mapping file. Signals are those of a DBC file.
///
/// ```toml
/// dbc = "sensor.dbc"          # beside this file; --dbc names another
/// notes = ["..."]             # shown with every result: what is not certain about this device
/// rate_hz = 100.0             # samples per second, where the device sends no time; default unknown
/// absent = ["gyro.x", "gyro.y", "specific_force.z"]  # axes not measured: 0 is assumed; every axis is mapped or absent
/// assume_upright = true       # with an absent specific_force.z: +9.80665 m/s^2 is assumed on it; default false
/// checksum = "toyota"         # last byte = low byte of (identifier bytes + length + other bytes); default none
/// max_raw = 0xFAFF            # larger raw values of gyro and specific_force are none (J1939: error, not available)
/// id_mask = 0x03FFFF00        # identifier bits that must fit (J1939: the parameter group); default all
/// source_address = 0x80       # lowest byte, where id_mask leaves it out; default: that of the first frame
/// [gyro]
/// x = "MESSAGE.SIGNAL"        # sensor axes, each from any message; M/mN multiplexed signals too
/// y = "MESSAGE.SIGNAL"
/// z = "MESSAGE.SIGNAL"
/// unit = "deg/s"              # of the DBC file's scaled values: deg/s, rad/s
/// signs = [1, 1, -1]          # default 1, 1, 1
/// full_scale = 163.0          # same unit; readings at or beyond it count as clipped; default none
/// [specific_force]            # may be missing, with its axes absent; +1 g on the upward axis at rest
/// x = "MESSAGE.SIGNAL"
/// y = "MESSAGE.SIGNAL"
/// unit = "m/s^2"              # m/s^2, g, mg
/// [time]                      # the device's clock, in a message of every sample; default none
/// signal = "MESSAGE.SIGNAL"
/// unit = "us"                 # of the scaled value: s, ms, 100us, us, ns
/// wraps_after = 4294967296    # returns to zero after so many units; default never
/// [counter]                   # counts up by one per frame of its message: gaps are missing frames; default none
/// signal = "MESSAGE.SIGNAL"
/// wraps_after = 65536         # returns to zero after so many
/// [pairing]                   # needed where a sample is more than one message: one of the two
/// order = ["GYRO", "ACCEL"]   # the messages of a sample (with that of [time], if it has its own) as they are sent
/// counters = ["GYRO.TICK", "ACCEL.TICK"]  # equal values belong together
/// ```
///
/// A multiplexed message has one name for each switch value in `order`: `MESSAGE/m0`, `MESSAGE/m1`.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CanMapping {
    dbc: Option<String>,
    #[serde(default)]
    pub(super) notes: Vec<String>,
    pub(super) rate_hz: Option<f64>,
    #[serde(default)]
    absent: Vec<Axis>,
    #[serde(default)]
    pub(super) assume_upright: bool,
    pub(super) checksum: Option<Checksum>,
    pub(super) max_raw: Option<u64>,
    pub(super) id_mask: Option<u32>,
    pub(super) source_address: Option<u8>,
    gyro: AxesTable<RateUnit>,
    specific_force: Option<AxesTable<ForceUnit>>,
    time: Option<TimeTable>,
    counter: Option<CounterTable>,
    pub(super) pairing: Option<PairingTable>,
}

/// One mapped axis.
#[derive(Clone, Debug)]
pub(super) struct AxisSource<'a> {
    pub(super) axis: Axis,
    pub(super) name: &'a SignalName,
    /// Factor to SI, with the sign.
    pub(super) to_si: f64,
    /// Absolute value in the mapping's unit from which on the sensor is clipped.
    pub(super) full_scale: f64,
}

impl CanMapping {
    /// Reads a mapping from TOML text; `file` only names it in errors.
    ///
    /// # Errors
    /// [`CanMapError::Toml`] for broken text, unknown keys and units, [`CanMapError::Value`] for values that cannot
    /// be: signs other than 1 and -1, an axis that is neither mapped nor absent, a wrap of nothing.
    pub fn from_toml(file: &str, text: &str) -> Result<Self, CanMapError> {
        let mapping: Self = toml::from_str(text)
            .map_err(|source| CanMapError::Toml { file: file.to_owned(), source: Box::new(source) })?;
        mapping.check(file)?;
        Ok(mapping)
    }

    /// Name of the DBC file beside the mapping, where it gives one.
    pub fn dbc(&self) -> Option<&str> {
        self.dbc.as_deref()
    }

    fn check(&self, file: &str) -> Result<(), CanMapError> {
        let value = |key: &str, got: String, allowed: &str| {
            let (file, key, allowed) = (file.to_owned(), key.to_owned(), allowed.to_owned());
            Err(CanMapError::Value { file, key, got, allowed })
        };
        match self.rate_hz {
            Some(rate) if !RATES.contains(&rate) => {
                return value("rate_hz", rate.to_string(), "0.1 to 20000 Hz");
            }
            _ => {}
        }
        for axis in Axis::GYRO.into_iter().chain(Axis::FORCE) {
            let is_mapped = self.sources().any(|source| source.axis == axis);
            let allowed = "a signal MESSAGE.SIGNAL, or a place in the list `absent`; not both";
            if is_mapped == self.absent.contains(&axis) {
                let got = if is_mapped { "mapped and absent" } else { "missing" };
                return value(axis.key(), got.to_owned(), allowed);
            }
        }
        let is_absent = |axis| self.absent.contains(&axis);
        if Axis::GYRO.into_iter().all(is_absent) {
            return value(
                "gyro",
                "absent on all axes".to_owned(),
                "at least one axis: nothing turns without it",
            );
        }
        let forces_absent = Axis::FORCE.into_iter().filter(|axis| is_absent(*axis)).count();
        let upright_needed = is_absent(Axis::ForceZ) && forces_absent < 3;
        if upright_needed != self.assume_upright {
            let allowed = "true exactly where specific_force.z is absent and another of its axes is not: gravity is \
                           then assumed on z";
            return value("assume_upright", self.assume_upright.to_string(), allowed);
        }
        for source in self.sources() {
            if source.full_scale.is_nan() || source.full_scale <= 0.0 {
                let key = format!("full_scale of {}", source.axis.key());
                return value(&key, source.full_scale.to_string(), "a number above 0");
            }
        }
        let signs = self.gyro.signs.iter().chain(self.specific_force.iter().flat_map(|force| &force.signs));
        if let Some(sign) = signs.into_iter().find(|sign| !matches!(sign, 1 | -1)) {
            return value("signs", sign.to_string(), "1 or -1 for each axis");
        }
        if let Some(wrap) = self.time.as_ref().and_then(|time| time.wraps_after)
            && !(wrap.is_finite() && wrap > 0.0)
        {
            return value("time.wraps_after", wrap.to_string(), "a number of time units above 0");
        }
        match &self.counter {
            Some(counter) if !(2..=LARGEST_WRAP).contains(&counter.wraps_after) => {
                value("counter.wraps_after", counter.wraps_after.to_string(), "2 to 9007199254740992")
            }
            _ => Ok(()),
        }
    }

    /// The mapped axes.
    pub(super) fn sources(&self) -> impl Iterator<Item = AxisSource<'_>> {
        let gyro = axis_sources(&self.gyro, Axis::GYRO, self.gyro.unit.radians_per_second());
        let force = self
            .specific_force
            .iter()
            .flat_map(|force| axis_sources(force, Axis::FORCE, force.unit.metres_per_second_squared()));
        gyro.chain(force)
    }

    /// The axes that are not measured.
    pub(super) fn absent(&self) -> &[Axis] {
        &self.absent
    }

    /// Whether anything of the specific force is measured.
    pub(super) fn has_specific_force(&self) -> bool {
        self.sources().any(|source| Axis::FORCE.contains(&source.axis))
    }

    /// Full scale of gyro, rad/s, and accelerometer, m/s², where given.
    pub(super) fn full_scales(&self) -> (Option<f64>, Option<f64>) {
        let force = self.specific_force.as_ref();
        (
            self.gyro.full_scale.map(|scale| scale * self.gyro.unit.radians_per_second()),
            force.and_then(|force| Some(force.full_scale? * force.unit.metres_per_second_squared())),
        )
    }

    /// The signal of the device's clock and the length of its unit, s.
    pub(super) fn time(&self) -> Option<(&SignalName, f64)> {
        self.time.as_ref().map(|time| (&time.signal, time.unit.seconds()))
    }

    /// Period of the device's clock, µs, where it wraps.
    pub(super) fn wraps_after_us(&self) -> Option<u64> {
        let time = self.time.as_ref()?;
        time.wraps_after.map(|wrap| (wrap * time.unit.seconds() * 1e6).round().max(1.0) as u64)
    }

    /// The counter's signal and after how many it returns to zero.
    pub(super) fn counter(&self) -> Option<(&SignalName, u64)> {
        self.counter.as_ref().map(|counter| (&counter.signal, counter.wraps_after))
    }
}

fn axis_sources<U>(table: &AxesTable<U>, axes: [Axis; 3], unit: f64) -> impl Iterator<Item = AxisSource<'_>> {
    let full_scale = table.full_scale.unwrap_or(f64::INFINITY);
    let names = [&table.x, &table.y, &table.z];
    axes.into_iter().zip(names).zip(table.signs).filter_map(move |((axis, name), sign)| {
        let name = name.as_ref()?;
        Some(AxisSource { axis, name, to_si: unit * f64::from(sign), full_scale })
    })
}
