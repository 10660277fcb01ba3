//! Units that a mapping file may name.

use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};

/// Unit of a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum TimeUnit {
    #[serde(rename = "s")]
    Seconds,
    #[serde(rename = "ms")]
    Milliseconds,
    #[serde(rename = "100us")]
    HundredMicroseconds,
    #[serde(rename = "us")]
    Microseconds,
    #[serde(rename = "ns")]
    Nanoseconds,
}

impl TimeUnit {
    /// Length of one unit, s.
    pub(super) fn seconds(self) -> f64 {
        match self {
            Self::Seconds => 1.0,
            Self::Milliseconds => 1e-3,
            Self::HundredMicroseconds => 1e-4,
            Self::Microseconds => 1e-6,
            Self::Nanoseconds => 1e-9,
        }
    }
}

/// Unit of an angular velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum RateUnit {
    #[serde(rename = "rad/s")]
    RadPerSecond,
    #[serde(rename = "deg/s")]
    DegPerSecond,
}

impl RateUnit {
    /// One unit, rad/s.
    pub(super) fn radians_per_second(self) -> f64 {
        match self {
            Self::RadPerSecond => 1.0,
            Self::DegPerSecond => RAD_PER_DEG,
        }
    }
}

/// Unit of a specific force.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum ForceUnit {
    #[serde(rename = "m/s^2")]
    MetrePerSecondSquared,
    #[serde(rename = "g")]
    G,
    #[serde(rename = "mg")]
    MilliG,
}

impl ForceUnit {
    /// One unit, m/s².
    pub(super) fn metres_per_second_squared(self) -> f64 {
        match self {
            Self::MetrePerSecondSquared => 1.0,
            Self::G => STANDARD_GRAVITY,
            Self::MilliG => 1e-3 * STANDARD_GRAVITY,
        }
    }
}
