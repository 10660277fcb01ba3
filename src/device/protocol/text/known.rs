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
    /// Its text, for columns with commas between.
    pub text: &'static str,
    /// What stands between the columns of this log.
    delimiter: char,
    /// What the name of the log must contain, in small letters, where the header does not say enough.
    name_part: &'static str,
}

/// What programs that let the user choose put between columns (phyphox: comma, semicolon or tabulator).
const DELIMITERS: [char; 3] = [',', ';', '\t'];

/// The formats with a built-in mapping; of two that fit, the one with more columns first.
pub const KNOWN_LOGS: [KnownLog; 6] = [
    KnownLog {
        file: "configs/logs/phyphox-both.toml",
        text: include_str!("../../../../configs/logs/phyphox-both.toml"),
        delimiter: ',',
        name_part: "",
    },
    KnownLog {
        file: "configs/logs/phyphox.toml",
        text: include_str!("../../../../configs/logs/phyphox.toml"),
        delimiter: ',',
        name_part: "",
    },
    KnownLog {
        file: "configs/logs/phyphox-short.toml",
        text: include_str!("../../../../configs/logs/phyphox-short.toml"),
        delimiter: ',',
        name_part: "",
    },
    KnownLog {
        file: "configs/logs/xio.toml",
        text: include_str!("../../../../configs/logs/xio.toml"),
        delimiter: ',',
        name_part: "",
    },
    KnownLog {
        file: "configs/logs/vn310.toml",
        text: include_str!("../../../../configs/logs/vn310.toml"),
        delimiter: ',',
        name_part: "",
    },
    KnownLog {
        file: "configs/logs/sensor-logger-gyroscope.toml",
        text: include_str!("../../../../configs/logs/sensor-logger-gyroscope.toml"),
        delimiter: ',',
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
        TextMapping::from_toml(self.file, &self.mapping_text())
    }

    /// The text of the built-in mapping for the delimiter of this log.
    pub fn mapping_text(&self) -> String {
        self.text.replacen("delimiter = \",\"", &format!("delimiter = {:?}", self.delimiter.to_string()), 1)
    }

    fn fits(&self, log_name: &str, start: &[u8]) -> Result<bool, TextError> {
        let rows = RowReader::new(&self.mapping()?);
        let named = log_name.to_ascii_lowercase().contains(self.name_part);
        Ok(named && lines(start).any(|line| rows.find_columns(line).is_some()))
    }
}

fn lines(start: &[u8]) -> impl Iterator<Item = &[u8]> {
    start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start).split(|byte| *byte == b'\n')
}

/// The format of a log, by the header among its first lines and where that is not enough by the name of its file;
/// `None` for a log that nobody here knows. `start` is the beginning of the log, a few kilobytes.
///
/// # Errors
/// [`TextError::Unusable`] for a log that is recognised and cannot be used as it is.
pub fn known_log(log_name: &str, start: &[u8]) -> Result<Option<KnownLog>, TextError> {
    for delimiter in DELIMITERS {
        for known in KNOWN_LOGS.map(|known| KnownLog { delimiter, ..known }) {
            if known.fits(log_name, start)? {
                return Ok(Some(known));
            }
        }
    }
    let has_all = |line: &[u8], titles: &[&str], delimiter: char| {
        let has = |title: &&str| {
            split(line, Delimiter::Byte(delimiter as u8)).any(|found| found == title.as_bytes())
        };
        titles.iter().all(has)
    };
    let is_it = |unusable: &&Unusable| {
        lines(start).any(|line| DELIMITERS.iter().any(|between| has_all(line, unusable.titles, *between)))
    };
    match UNUSABLE.iter().find(is_it) {
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
        let short = "Time (s),X (rad/s),Y (rad/s),Z (rad/s)";
        assert_eq!(file_of("a.csv", short), Some("configs/logs/phyphox-short.toml"));
        let both = phone.replace(
            "\r\n",
            ",\"Acceleration x (m/s^2)\",\"Acceleration y (m/s^2)\",\"Acceleration z (m/s^2)\"\r\n",
        );
        assert_eq!(file_of("a.csv", &both), Some("configs/logs/phyphox-both.toml"));
        for delimiter in [";", "\t"] {
            let found = known_log("a.csv", phone.replace(',', delimiter).as_bytes()).unwrap().unwrap();
            assert_eq!(found.file, "configs/logs/phyphox.toml");
            assert!(found.mapping_text().contains(&format!("delimiter = {delimiter:?}\n")));
        }
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
