//! Text logs of known programs, by the names in their header.
//!
//! A name without its unit is never guessed: such a log needs a mapping that says the unit.

use super::error::TextError;
use super::mapping::{Delimiter, TextMapping};
use super::row::{BYTE_ORDER_MARK, RowReader, split};

/// A log format with a built-in mapping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KnownLog {
    /// The mapping's file in the repository.
    pub file: &'static str,
    /// Its text.
    pub text: &'static str,
    /// What the name of the log must contain, in small letters, where the header does not say enough.
    name_part: &'static str,
}

/// The formats with a built-in mapping.
pub const KNOWN_LOGS: [KnownLog; 4] = [
    KnownLog {
        file: "configs/logs/phyphox.toml",
        text: include_str!("../../../../configs/logs/phyphox.toml"),
        name_part: "",
    },
    KnownLog {
        file: "configs/logs/xio.toml",
        text: include_str!("../../../../configs/logs/xio.toml"),
        name_part: "",
    },
    KnownLog {
        file: "configs/logs/vn310.toml",
        text: include_str!("../../../../configs/logs/vn310.toml"),
        name_part: "",
    },
    KnownLog {
        file: "configs/logs/sensor-logger-gyroscope.toml",
        text: include_str!("../../../../configs/logs/sensor-logger-gyroscope.toml"),
        name_part: "gyroscope",
    },
];

/// A log that is recognised and cannot be used as it is.
struct Unusable {
    /// Names in its header, all of which must be there.
    titles: &'static [&'static str],
    what: &'static str,
    hint: &'static str,
}

const UNUSABLE: [Unusable; 4] = [
    Unusable {
        titles: &["IMU::AngularRate::X", "IMU::Accel::X [m/s^2]", "Time::TimeStartup [ns]"],
        what: "the column IMU::AngularRate::X does not say its unit",
        hint: "if it is rad/s like its neighbours, say so: --log-map configs/logs/vn310-without-unit.toml",
    },
    Unusable {
        titles: &["time", "seconds_elapsed", "x", "y", "z"],
        what: "a file of Sensor Logger whose name does not say that it is the gyroscope's; all its files have the same \
               header, and sign and unit of the acceleration depend on the platform",
        hint: "play Gyroscope.csv alone, or join it with the acceleration as configs/logs/sensor-logger-android.toml shows \
               and name the platform with --log-map: that file, or sensor-logger-ios.toml beside it",
    },
    Unusable {
        titles: &["Time (s)", "Acceleration x (m/s^2)"],
        what: "acceleration of phyphox without a gyroscope",
        hint: "play the CSV file of the gyroscope from the same export",
    },
    Unusable {
        titles: &["Time (s)", "Linear Acceleration x (m/s^2)"],
        what: "acceleration of phyphox without gravity and without a gyroscope",
        hint: "play the CSV file of the gyroscope from the same export",
    },
];

impl KnownLog {
    /// The built-in mapping.
    ///
    /// # Errors
    /// None with the mappings that are built in; see [`TextMapping::from_toml`].
    pub fn mapping(&self) -> Result<TextMapping, TextError> {
        TextMapping::from_toml(self.file, self.text)
    }

    fn fits(&self, log_name: &str, header: &[u8]) -> Result<bool, TextError> {
        let mapping = self.mapping()?;
        let named = log_name.to_ascii_lowercase().contains(self.name_part);
        Ok(named && RowReader::new(&mapping).find_columns(header).is_some())
    }
}

/// The format of a log, by its first line and where that is not enough by the name of its file; `None` for a log that
/// nobody here knows.
///
/// # Errors
/// [`TextError::Unusable`] for a log that is recognised and cannot be used as it is.
pub fn known_log(log_name: &str, first_line: &[u8]) -> Result<Option<KnownLog>, TextError> {
    let header = first_line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(first_line);
    for known in KNOWN_LOGS {
        if known.fits(log_name, header)? {
            return Ok(Some(known));
        }
    }
    let has = |title: &&str| split(header, Delimiter::Byte(b',')).any(|found| found == title.as_bytes());
    match UNUSABLE.iter().find(|unusable| unusable.titles.iter().all(has)) {
        Some(Unusable { what, hint, .. }) => {
            Err(TextError::Unusable { log: log_name.to_owned(), what, hint })
        }
        None => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file_of(log_name: &str, header: &str) -> Option<&'static str> {
        known_log(log_name, header.as_bytes()).unwrap().map(|known| known.file)
    }

    #[test]
    fn known_headers_choose_their_mapping_and_others_none() {
        let phone = "\u{feff}\"Time (s)\",\"Gyroscope x (rad/s)\",\"Gyroscope y (rad/s)\",\"Gyroscope z (rad/s)\"\r\n";
        assert_eq!(file_of("a.csv", phone), Some("configs/logs/phyphox.toml"));
        let in_degrees = phone.replace("rad/s", "deg/s");
        assert_eq!(file_of("a.csv", &in_degrees), None, "another unit is another format");
        assert_eq!(
            file_of("sub/Gyroscope.csv", "time,seconds_elapsed,z,y,x"),
            Some("configs/logs/sensor-logger-gyroscope.toml")
        );
        assert_eq!(file_of("a.csv", "0.0,1,2,3,4,5,6"), None);
        assert_eq!(file_of("a.csv", ""), None);
    }

    #[test]
    fn what_cannot_be_used_is_refused_with_a_way_out() {
        for (log_name, header, parts) in [
            (
                "Accelerometer.csv",
                "time,seconds_elapsed,z,y,x",
                ["depend on the platform", "sensor-logger-ios.toml"],
            ),
            (
                "joined.csv",
                "time,seconds_elapsed,z,y,x,time_force,z_force,y_force,x_force",
                ["depend on the platform", "sensor-logger-android.toml"],
            ),
            ("raw.csv", "\"Time (s)\",\"Acceleration x (m/s^2)\"", ["without a gyroscope", "same export"]),
        ] {
            let text = known_log(log_name, header.as_bytes()).unwrap_err().to_string();
            assert!(text.starts_with(log_name) && text.contains("\n\nhint: "), "{text}");
            for part in parts {
                assert!(text.contains(part), "{part} is missing in: {text}");
            }
        }
    }
}
