//! The mappings that come with the program.

/// A ready mapping: the texts of two files in `configs/can`.
#[derive(Clone, Copy, Debug)]
pub struct ShippedCanMap {
    /// Name, as `--map` takes it.
    pub name: &'static str,
    /// The mapping.
    pub map: &'static str,
    /// Name of its DBC file.
    pub dbc_name: &'static str,
    /// Its DBC file.
    pub dbc: &'static str,
}

macro_rules! shipped {
    ($name:literal, $dbc:literal) => {
        ShippedCanMap {
            name: $name,
            map: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/configs/can/", $name, ".toml")),
            dbc_name: concat!($dbc, ".dbc"),
            dbc: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/configs/can/", $dbc, ".dbc")),
        }
    };
}

/// All of them; where several fit one bus, the likeliest first.
pub const CAN_MAPS: &[ShippedCanMap] = &[
    ShippedCanMap {
        name: "otolith-can",
        map: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/configs/can/otolith-can.toml")),
        dbc_name: "otolith.dbc",
        dbc: otolith_firmware_protocol::can::DBC,
    },
    shipped!("toyota-yaw", "toyota-yaw"),
    shipped!("racelogic-imu04", "racelogic-imu04"),
    shipped!("bosch-mm7", "bosch-mm7"),
    shipped!("bosch-mm5", "bosch-mm5"),
    shipped!("bosch-abs-kit", "bosch-abs-kit"),
    shipped!("sbg", "sbg"),
    shipped!("sbg-no-time", "sbg"),
    shipped!("j1939-imu", "j1939-imu"),
    shipped!("j1939-imu-xyz", "j1939-imu"),
    shipped!("xsens-mti-can", "xsens-mti-can"),
    shipped!("xsens-mti-can-100us", "xsens-mti-can"),
    shipped!("xsens-mti-can-no-time", "xsens-mti-can"),
];

/// The ready mapping called `name`.
pub fn shipped_can_map(name: &str) -> Option<&'static ShippedCanMap> {
    CAN_MAPS.iter().find(|shipped| shipped.name == name)
}

/// The names of all ready mappings, for people.
pub fn can_map_names() -> String {
    CAN_MAPS.iter().map(|shipped| shipped.name).collect::<Vec<_>>().join(", ")
}
