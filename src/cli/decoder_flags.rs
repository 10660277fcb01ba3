//! The flags that say how a device speaks, the same for every command that reads one.

use std::path::PathBuf;

use crate::config::Config;

/// How a device speaks, where it is not to be found out.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct DecoderFlags {
    /// Protocol of the device instead of finding it out, for example otolith-serial, witmotion, xbus, text, can-map.
    #[arg(long, value_name = "NAME")]
    pub(super) protocol: Option<String>,
    /// Columns of a text log.
    #[arg(long, value_name = "FILE.toml")]
    pub(super) log_map: Option<PathBuf>,
    /// What the signals on a CAN bus mean: a ready mapping (toyota-yaw, racelogic-imu04, bosch-mm5, bosch-mm7,
    /// bosch-abs-kit, sbg, j1939-imu, xsens-mti-can, ...; `otolith inspect LOG` says which fit) or a file.
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub(super) map: Option<String>,
    /// DBC file of that mapping, above its own.
    #[arg(long, value_name = "FILE.dbc")]
    pub(super) dbc: Option<PathBuf>,
    /// Take what a device without a gyroscope gives (BNO08x UART-RVC: rates in steps of 1 deg/s).
    #[arg(long)]
    pub(super) allow_degraded: bool,
}

impl DecoderFlags {
    /// Puts the flags into a configuration, above what it says.
    pub(super) fn apply(&self, config: &mut Config) {
        config.protocol = self.protocol.clone().or(config.protocol.take());
        config.log_map = self.log_map.clone().or(config.log_map.take());
        config.can_map = self.map.clone().or(config.can_map.take());
        config.dbc = self.dbc.clone().or(config.dbc.take());
        config.allow_degraded |= self.allow_degraded;
    }

    /// A configuration of nothing but these flags.
    pub(super) fn config(&self) -> Config {
        let mut config = Config::default();
        self.apply(&mut config);
        config
    }
}
