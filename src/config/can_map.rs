//! The texts of a CAN mapping and of its DBC file, wherever they are.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::{Config, ConfigError, read};
use crate::device::protocol::can_map::{CanMap, CanMapError, CanMapping, can_map_names, shipped_can_map};

/// A CAN mapping and its DBC file as texts, with the names for errors: what a recording keeps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanMapTexts {
    /// Name of the mapping.
    pub map_name: String,
    /// The mapping.
    pub map: String,
    /// Name of the DBC file.
    pub dbc_name: String,
    /// The DBC file.
    pub dbc: String,
}

impl CanMapTexts {
    /// Reads both.
    ///
    /// # Errors
    /// [`CanMapError`] with file, key and what is allowed.
    pub fn compile(&self) -> Result<CanMap, CanMapError> {
        CanMap::new(&self.map_name, &self.map, &self.dbc_name, &self.dbc)
    }
}

impl Config {
    /// The CAN mapping and its DBC file; `None` if no mapping is asked for.
    ///
    /// # Errors
    /// A name that is neither ready nor a file, a file that cannot be read, no DBC file, a DBC file alone.
    pub fn can_map_texts(&self) -> Result<Option<CanMapTexts>, ConfigError> {
        let Some(name) = &self.can_map else {
            return match &self.dbc {
                Some(dbc) => Err(ConfigError::DbcWithoutMap { dbc: dbc.clone(), ready: can_map_names() }),
                None => Ok(None),
            };
        };
        let shipped = shipped_can_map(name);
        let map = shipped.map_or_else(|| read_map(name), |shipped| Ok(shipped.map.to_owned()))?;
        let (dbc_name, dbc) = match (&self.dbc, shipped) {
            (Some(path), _) => (path.display().to_string(), read_dbc(path)?),
            (None, Some(shipped)) => (shipped.dbc_name.to_owned(), shipped.dbc.to_owned()),
            (None, None) => {
                let path = dbc_beside(name, &map)?;
                (path.display().to_string(), read_dbc(&path)?)
            }
        };
        Ok(Some(CanMapTexts { map_name: name.clone(), map, dbc_name, dbc }))
    }
}

fn read_map(name: &str) -> Result<String, ConfigError> {
    read(Path::new(name)).map_err(|error| match error {
        ConfigError::File { source, .. } if source.kind() == ErrorKind::NotFound => {
            CanMapError::Unknown { got: name.to_owned(), known: can_map_names() }.into()
        }
        error => error,
    })
}

/// The DBC file that a mapping names; relative names start where the mapping is.
fn dbc_beside(name: &str, map: &str) -> Result<PathBuf, ConfigError> {
    let mapping = CanMapping::from_toml(name, map)?;
    let dbc = mapping.dbc().ok_or_else(|| CanMapError::Value {
        file: name.to_owned(),
        key: "dbc".to_owned(),
        got: "missing".to_owned(),
        allowed: "the DBC file beside the mapping; or name one with --dbc".to_owned(),
    })?;
    Ok(Path::new(name).parent().unwrap_or(Path::new("")).join(dbc))
}

/// Tools for DBC files write them in the code page of their system. Only units and comments have letters beyond
/// ASCII, so whatever is not UTF-8 is taken as Latin-1.
fn read_dbc(path: &Path) -> Result<String, ConfigError> {
    let bytes = std::fs::read(path).map_err(|source| ConfigError::File { path: path.to_owned(), source })?;
    Ok(String::from_utf8(bytes)
        .unwrap_or_else(|error| error.as_bytes().iter().map(|&byte| char::from(byte)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(can_map: Option<&str>, dbc: Option<&str>) -> Result<Option<CanMapTexts>, String> {
        let config =
            Config { can_map: can_map.map(str::to_owned), dbc: dbc.map(PathBuf::from), ..Config::default() };
        config.can_map_texts().map_err(|error| error.to_string())
    }

    #[test]
    fn a_mapping_is_ready_or_a_file_with_its_dbc_beside_it() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/can");
        let ready = texts(Some("sbg"), None).unwrap().unwrap();
        let from_file = texts(Some(&format!("{folder}/sbg.toml")), None).unwrap().unwrap();
        assert_eq!((&ready.map, &ready.dbc), (&from_file.map, &from_file.dbc));
        assert!(from_file.compile().is_ok());
        let other = texts(Some("sbg"), Some(&format!("{folder}/toyota-yaw.dbc"))).unwrap().unwrap();
        let error = other.compile().unwrap_err().to_string();
        assert!(error.contains("toyota-yaw.dbc has the messages KINEMATICS"), "{error}");
        assert_eq!(texts(None, None), Ok(None));
    }

    #[test]
    fn what_is_missing_is_named() {
        for (can_map, dbc, parts) in [
            (Some("nope"), None, &["`nope`", "toyota-yaw", "\n\nhint: "][..]),
            (Some("/"), None, &["/: cannot read it", "\n\nhint: "]),
            (Some("sbg"), Some("/nope.dbc"), &["/nope.dbc: cannot read it"]),
            (None, Some("my.dbc"), &["my.dbc", "--map", "sbg"]),
        ] {
            let error = texts(can_map, dbc).unwrap_err();
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.toml");
        let map = crate::device::protocol::can_map::CAN_MAPS[1].map.replace("dbc = ", "# dbc = ");
        std::fs::write(&path, map).unwrap();
        let error = texts(path.to_str(), None).unwrap_err();
        assert!(error.contains("map.toml: dbc is missing, allowed is"), "{error}");
    }

    #[test]
    fn a_dbc_file_in_another_code_page_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("old.dbc");
        let shipped = shipped_can_map("toyota-yaw").unwrap();
        let mut bytes = shipped.dbc.replace("deg/s", "#/s").into_bytes();
        bytes.iter_mut().filter(|byte| **byte == b'#').for_each(|byte| *byte = 0xB0);
        std::fs::write(&path, &bytes).unwrap();
        let texts = texts(Some("toyota-yaw"), path.to_str()).unwrap().unwrap();
        assert!(texts.dbc.contains("\"\u{b0}/s\""));
        assert!(texts.compile().is_ok());
    }
}
