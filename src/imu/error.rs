//! What can be wrong with the settings of the IMU path.

/// A settings file of the IMU path that cannot be used. Device trouble is never an error: it is counted.
#[derive(Debug, thiserror::Error)]
pub enum ImuConfigError {
    /// Not TOML, an unknown key or a value of the wrong type.
    #[error("{file}: {source}\nhint: {hint}")]
    Toml {
        /// Name of the file as the user gave it.
        file: String,
        /// What the TOML reader said, with line and column.
        source: Box<toml::de::Error>,
        /// Which keys the file may have.
        hint: &'static str,
    },
    /// A value outside its range.
    #[error("{file}: {key} is {got}, allowed is {allowed}\n\nhint: {hint}")]
    OutOfRange {
        /// Name of the file as the user gave it.
        file: String,
        /// The key, dotted.
        key: String,
        /// The value as read.
        got: String,
        /// The range, with its unit.
        allowed: String,
        /// What to do.
        hint: &'static str,
    },
    /// A left-handed matrix where a rotation is needed.
    #[error(
        "{file}: {key} is mirrored: its determinant is {determinant:+.6}, a rotation has +1\n\n\
         hint: one axis points the wrong way or two are swapped; write the sensor's axes in head axes, column by column"
    )]
    Mirrored {
        /// Name of the file as the user gave it.
        file: String,
        /// The key, dotted.
        key: String,
        /// The determinant found.
        determinant: f64,
    },
    /// A matrix that is not orthonormal.
    #[error(
        "{file}: {key} is no rotation: its columns are off orthonormal by {deviation:.1e} (determinant \
         {determinant:+.6}), allowed is 1e-6\n\n\
         hint: give the entries with 7 digits or more, or use `quaternion` or `axes`"
    )]
    NotARotation {
        /// Name of the file as the user gave it.
        file: String,
        /// The key, dotted.
        key: String,
        /// Largest entry of `R^T R - 1`.
        deviation: f64,
        /// The determinant found.
        determinant: f64,
    },
    /// Not exactly one of several keys that say the same thing.
    #[error("{file}: exactly one of {keys} is needed, {got} given\n\nhint: {hint}")]
    ExactlyOne {
        /// Name of the file as the user gave it.
        file: String,
        /// The keys to choose from.
        keys: &'static str,
        /// How many there were.
        got: usize,
        /// What to do.
        hint: &'static str,
    },
    /// Two named axes that do not span a frame.
    #[error(
        "{file}: axes.forward = \"{forward}\" and axes.up = \"{up}\" lie on one line\n\n\
         hint: name the sensor axis that points forward and another one that points up"
    )]
    ParallelAxes {
        /// Name of the file as the user gave it.
        file: String,
        /// Sensor axis said to point forward.
        forward: &'static str,
        /// Sensor axis said to point up.
        up: &'static str,
    },
}

/// Checks that `value` is finite and within `low..=high`.
pub(super) fn check_range(
    file: &str,
    key: &str,
    value: f64,
    (low, high): (f64, f64),
    unit: &str,
) -> Result<(), ImuConfigError> {
    if value.is_finite() && (low..=high).contains(&value) {
        return Ok(());
    }
    Err(ImuConfigError::OutOfRange {
        file: file.to_owned(),
        key: key.to_owned(),
        got: format!("{value}"),
        allowed: format!("{low} to {high} {unit}").trim_end().to_owned(),
        hint: "the unit is part of the key's name; see the example files in configs/",
    })
}
