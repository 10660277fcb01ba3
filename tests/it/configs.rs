//! Every file in `configs/` is one that its reader accepts.

use std::fs;
use std::path::{Path, PathBuf};

use otolith::character::CharacterModel;
use otolith::config::Config;
use otolith::device::Selector;
use otolith::device::doctor::UDEV_RULES;
use otolith::device::protocol::can_map::Dbc;
use otolith::device::protocol::text::TextMapping;
use otolith::imu::Mount;
use otolith::motion::MotionSettings;
use otolith::vestibular::ObserverParameters;

fn configs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs")
}

/// Name and text of each file in a folder, folders left out.
fn files(folder: &Path) -> Vec<(String, String)> {
    let mut files: Vec<(String, String)> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file())
        .map(|path| (path.display().to_string(), fs::read_to_string(&path).unwrap()))
        .collect();
    files.sort();
    assert!(!files.is_empty(), "{}: no files", folder.display());
    files
}

/// The tests run in the package's folder, which is where the paths in the examples start.
#[test]
fn the_examples_name_a_device_and_files_that_exist() {
    for (name, text) in files(&configs()) {
        let config = Config::from_toml(&text, &name).unwrap_or_else(|error| panic!("{error}"));
        let device = config.device.as_deref().unwrap_or_else(|| panic!("{name}: names a device"));
        device.parse::<Selector>().unwrap_or_else(|error| panic!("{name}: {error}"));
        config.sensor().unwrap_or_else(|error| panic!("{name}: {error}"));
        config.model().unwrap_or_else(|error| panic!("{name}: {error}"));
    }
}

#[test]
fn every_other_file_is_accepted_by_its_reader() {
    let mut folders: Vec<PathBuf> = fs::read_dir(configs())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    for folder in folders {
        for (name, text) in files(&folder) {
            let problem = match folder.file_name().unwrap().to_str().unwrap() {
                "can" if name.ends_with(".dbc") => {
                    Dbc::parse(&name, &text).err().map(|error| error.to_string())
                }
                "can" => can_map_problem(&name),
                "characters" => CharacterModel::from_mjcf(&text, &name).err().map(|error| error.to_string()),
                "logs" => TextMapping::from_toml(&name, &text).err().map(|error| error.to_string()),
                "motions" => MotionSettings::from_toml(&text).err().map(|error| error.to_string()),
                "mounts" => Mount::from_toml(&name, &text).err().map(|error| error.to_string()),
                "observers" => observer_problem(&text),
                "udev" => (text != UDEV_RULES).then(|| "not what `otolith doctor` prints".to_owned()),
                "scenarios" => Config::from_toml(&text, &name).err().map(|error| error.to_string()),
                other => panic!("{name}: nothing here reads the folder {other}"),
            };
            assert_eq!(problem, None, "{name}");
        }
    }
}

/// The mapping as a user names it: its DBC file is found beside it.
fn can_map_problem(path: &str) -> Option<String> {
    Config { can_map: Some(path.to_owned()), ..Config::default() }
        .sensor()
        .err()
        .map(|error| error.to_string())
}

fn observer_problem(text: &str) -> Option<String> {
    match toml::from_str::<ObserverParameters>(text) {
        Ok(parameters) => parameters.validate().err().map(|error| error.to_string()),
        Err(error) => Some(error.to_string()),
    }
}
