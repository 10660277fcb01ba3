//! Commands that set a device up, for `--configure`. Nothing here is ever sent without it.
//!
//! One file per protocol turns a [`Request`] into a [`Plan`] of bytes to write and answers to wait for; it is pure.

mod apply;
pub mod mip;
mod native;
mod request;
pub mod vectornav;
pub mod witmotion;
pub mod xbus;

pub use apply::apply;

use super::DeviceError;
use super::bandwidth::check_serial;
use super::protocol::detect;

/// What the user asked for, written `rate=200,baud=115200,save`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Request {
    /// Samples per second.
    pub rate_hz: Option<f64>,
    /// Baud rate the device shall change to, bit/s.
    pub baud: Option<u32>,
    /// Keep the settings when the power goes off.
    pub save: bool,
}

/// What the bytes received since a command was sent say about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Nothing yet.
    NotYet,
    /// The device has done it.
    Done,
    /// The device refused, and why.
    Refused(String),
}

/// One command.
#[derive(Clone, Debug)]
pub struct Step {
    /// What it does, for people.
    pub what: String,
    /// The bytes.
    pub bytes: Vec<u8>,
    /// Judges everything received since the bytes were sent, which may begin or end within a packet and have measured
    /// data in between; `None` where the protocol knows no answer.
    pub answer: Option<fn(&[u8]) -> Answer>,
    /// From this command on the line runs at this baud rate, bit/s.
    pub baud_after: Option<u32>,
}

/// The commands for one request, in order.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The commands.
    pub steps: Vec<Step>,
    /// Samples per second when it is done.
    pub rate_hz: f64,
    /// Bytes a sample takes on the line when it is done.
    pub bytes_per_sample: f64,
}

impl Plan {
    /// The plan of a protocol for a line at `baud` bit/s.
    ///
    /// # Errors
    /// [`DeviceError::Configure`] when otolith has no commands for the protocol or the device does not offer what is
    /// asked for, [`DeviceError::SerialTooSlow`] when the line could not carry the result.
    pub fn new(protocol: &str, request: &Request, baud: u32) -> Result<Self, DeviceError> {
        let found = PLANNERS.iter().find(|(name, _)| *name == protocol);
        let (_, planner) = found.ok_or_else(|| ConfigureError::NoCommands {
            protocol: protocol.to_owned(),
            known: PLANNERS.map(|(name, _)| name).join(", "),
        })?;
        let plan = planner(request)?;
        check_serial(request.baud.unwrap_or(baud), plan.rate_hz, plan.bytes_per_sample)?;
        Ok(plan)
    }
}

type Planner = fn(&Request) -> Result<Plan, ConfigureError>;

/// The protocols with commands.
const PLANNERS: [(&str, Planner); 5] = [
    (detect::OTOLITH_SERIAL, native::plan),
    (detect::VECTORNAV, vectornav::plan),
    (detect::MIP, mip::plan),
    (detect::XBUS, xbus::plan),
    (detect::WITMOTION, witmotion::plan),
];

/// Whether otolith has commands for a protocol.
pub fn is_configurable(protocol: &str) -> bool {
    PLANNERS.iter().any(|(name, _)| *name == protocol)
}

/// Why a request cannot be met.
#[derive(Debug, thiserror::Error)]
pub enum ConfigureError {
    /// A value the device does not offer.
    #[error("--configure {key}={got}: {protocol} does not offer this, expected {expected}\n\nhint: {hint}")]
    NotOffered {
        /// Name of the protocol.
        protocol: &'static str,
        /// The key of `--configure`.
        key: &'static str,
        /// The value given.
        got: String,
        /// The values there are.
        expected: String,
        /// What to do.
        hint: String,
    },
    /// A text that is no request.
    #[error("--configure {text}: {problem}\n\nhint: write for example rate=200 or rate=200,baud=115200,save")]
    Request {
        /// The text as given.
        text: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A protocol otolith has no commands for.
    #[error(
        "--configure: otolith has no commands for the protocol `{protocol}`\n\nhint: it has some for {known}; name the \
         protocol with --protocol, `otolith devices` says which one a port speaks"
    )]
    NoCommands {
        /// The protocol.
        protocol: String,
        /// Those with commands.
        known: String,
    },
    /// The device refused a command.
    #[error("{port}: the device refused to {what}: {why}\n\nhint: {}", unchanged(*.done))]
    Refused {
        /// The port.
        port: String,
        /// The command.
        what: String,
        /// What it answered.
        why: String,
        /// Commands it had taken before.
        done: usize,
    },
    /// The device did not answer.
    #[error(
        "{port}: no answer to \"{what}\" within {} s\n\nhint: is this the right protocol and baud rate? `otolith devices` \
         says what the port speaks. {}", apply::ANSWER_WITHIN.as_secs(), unchanged(*.done)
    )]
    NoAnswer {
        /// The port.
        port: String,
        /// The command.
        what: String,
        /// Commands it had taken before.
        done: usize,
    },
}

/// What state a device is left in.
fn unchanged(done: usize) -> String {
    match done {
        0 => "nothing was changed".to_owned(),
        done => format!(
            "the first {done} commands had been taken: switch the device off and on to undo what is not saved"
        ),
    }
}
