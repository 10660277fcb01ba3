//! What is wrong with a port, and the command that mends it: a pure function of what is known about it.

use serde::Serialize;

use super::DeviceError;
use super::can::CanDetails;
use super::discover::Access;
use super::probe::Heard;

mod line;
mod stream;
pub mod survey;

/// Rules for udev that give access to USB serial ports and take the delay out of FTDI bridges.
pub const UDEV_RULES: &str = include_str!("../../configs/udev/70-otolith.rules");

/// Everything known about one port.
#[derive(Clone, Debug, Serialize)]
pub struct PortFacts {
    /// The selector that names it.
    pub selector: String,
    /// What the system says about it.
    #[serde(flatten)]
    pub link: LinkFacts,
    /// Why it could not be opened.
    pub refusal: Option<Refusal>,
    /// What was heard; `None` when it was not listened to.
    pub heard: Option<Heard>,
    /// Rate of rotation the sensor is to measure, rpm.
    pub intended_rate_rpm: Option<f64>,
}

/// What the system says about a port.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LinkFacts {
    /// A serial port.
    Serial(SerialFacts),
    /// A CAN interface.
    Can(CanFacts),
}

/// A program that holds a port open.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Holder {
    /// Number of the process.
    pub pid: u32,
    /// Name of the program.
    pub program: String,
}

/// What the system says about a serial port.
#[derive(Clone, Debug, Serialize)]
pub struct SerialFacts {
    /// Path of the node, links resolved.
    pub node: String,
    /// Whether this process may open it.
    pub access: Access,
    /// Group that owns the node.
    pub group: Option<String>,
    /// Programs that hold it open, as far as this user may see.
    pub holders: Vec<Holder>,
    /// Longest time an FTDI bridge holds bytes back, ms; `None` where the driver has no such setting.
    pub latency_timer_ms: Option<u32>,
    /// ModemManager runs and may write to a port it does not know.
    pub modem_manager: bool,
    /// [`UDEV_RULES`] are installed.
    pub rules_installed: bool,
    /// It is a port of a USB device, which somebody has plugged in; a built-in one may have nothing connected.
    pub usb: bool,
    /// It is a pseudo-terminal, which has no speed.
    pub pseudo_terminal: bool,
    /// Baud rate the user means to use, bit/s; `None` when nobody has named the port.
    pub asked_baud: Option<u32>,
}

/// What the system says about a CAN interface.
#[derive(Clone, Debug, Serialize)]
pub struct CanFacts {
    /// There is such an interface.
    pub exists: bool,
    /// It is up.
    pub up: bool,
    /// How it is set up, where the system tells.
    pub details: Option<CanDetails>,
}

/// Why a port could not be opened.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Refusal {
    /// There is no such port; what there is instead.
    Missing(String),
    /// No permission.
    Denied,
    /// Another program holds it.
    Busy,
    /// It went away while it was listened to; what the system said.
    Lost(String),
    /// Anything else, in words.
    Other(String),
}

impl From<&DeviceError> for Refusal {
    fn from(error: &DeviceError) -> Self {
        match error {
            DeviceError::NoSuchPort { hint, .. } => Self::Missing(hint.clone()),
            DeviceError::NoPermission { .. } => Self::Denied,
            DeviceError::Busy { .. } => Self::Busy,
            DeviceError::Lost { source, .. } => Self::Lost(source.to_string()),
            other => Self::Other(other.to_string().replace("\n\nhint: ", "; ")),
        }
    }
}

/// Whether something must be done about a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// It must be mended before measurements can be trusted.
    Mend,
    /// Worth knowing; it may be as intended.
    Note,
}

/// One thing that is not as it should be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Whether it must be mended.
    pub level: Level,
    /// Name of the check.
    pub check: &'static str,
    /// What is the case.
    pub what: String,
    /// Why it matters.
    pub why: &'static str,
    /// What mends it: a command where there is one.
    pub mend: String,
}

impl Finding {
    fn mend(check: &'static str, what: String, why: &'static str, mend: String) -> Self {
        Self { level: Level::Mend, check, what, why, mend }
    }

    fn note(check: &'static str, what: String, why: &'static str, mend: String) -> Self {
        Self { level: Level::Note, check, what, why, mend }
    }
}

/// What is wrong with a port, the cause before its consequences.
pub fn judge(facts: &PortFacts) -> Vec<Finding> {
    let mut findings = match &facts.link {
        LinkFacts::Serial(serial) => line::serial_findings(serial, facts.refusal.as_ref()),
        LinkFacts::Can(can) => line::can_findings(&facts.selector, can, facts.refusal.as_ref()),
    };
    if let Some(heard) = &facts.heard {
        findings.extend(stream::findings(facts, heard));
    }
    findings
}

#[cfg(test)]
mod tests;
