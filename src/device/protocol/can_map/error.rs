//! What can be wrong with a mapping of CAN signals, its DBC file, or between the two.

/// A mapping or a DBC file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CanMapError {
    /// The mapping is not TOML, or has an unknown key, unit or a wrong type.
    #[error(
        "{file}: {}\n\nhint: a mapping has dbc, notes, rate_hz, absent, assume_upright, checksum, max_raw, id_mask, \
         source_address and the tables [gyro], [specific_force], [time], [counter] and [pairing]; see configs/can/",
        source.to_string().trim_end()
    )]
    Toml {
        /// Name of the mapping file as the user gave it.
        file: String,
        /// What the TOML reader said, with line and column.
        source: Box<toml::de::Error>,
    },
    /// A value of the mapping that cannot be.
    #[error("{file}: {key} is {got}, allowed is {allowed}\n\nhint: see the ready mappings in configs/can/")]
    Value {
        /// Name of the mapping file as the user gave it.
        file: String,
        /// The key, dotted.
        key: String,
        /// The value as read.
        got: String,
        /// What may stand there.
        allowed: String,
    },
    /// A name that is neither a ready mapping nor a file.
    #[error(
        "there is no mapping `{got}`, neither ready nor as a file\n\nhint: ready mappings are {known}; anything else is \
         the path of a TOML file like those in configs/can/"
    )]
    Unknown {
        /// The name as given.
        got: String,
        /// Names of the ready mappings.
        known: String,
    },
    /// Text that is not a DBC file.
    #[error(
        "{file}: this does not read as a DBC file: {what}\n\nhint: a DBC file is text with lines like `BO_ 36 NAME: 8 \
         NODE` and ` SG_ NAME : 1|10@0+ (0.244,-124.196) [0|0] \"deg/s\" NODE`; export it again or mend that line"
    )]
    Dbc {
        /// Name of the DBC file.
        file: String,
        /// What the reader said, with line and column.
        what: String,
    },
    /// A message or signal of the mapping that the DBC file does not have.
    #[error(
        "{file}: {key} names {got}, {found}\n\nhint: correct {key}, or name the DBC file that has it with --dbc"
    )]
    NotInDbc {
        /// Name of the mapping file.
        file: String,
        /// The key that names it.
        key: String,
        /// The message or signal asked for.
        got: String,
        /// The DBC file and what it has instead.
        found: String,
    },
    /// A signal that is there but cannot be read.
    #[error("{file}: {key} names {got}, which in {problem}\n\nhint: {hint}")]
    Unreadable {
        /// Name of the mapping file.
        file: String,
        /// The key that names it.
        key: String,
        /// The signal.
        got: String,
        /// The DBC file and why it cannot be read.
        problem: String,
        /// What to do.
        hint: &'static str,
    },
    /// Frames that are not joined to samples by any rule, or by one that does not fit.
    #[error("{file}: {problem}\n\nhint: {hint}")]
    Pairing {
        /// Name of the mapping file.
        file: String,
        /// What is missing or too much.
        problem: String,
        /// What to write.
        hint: String,
    },
}
