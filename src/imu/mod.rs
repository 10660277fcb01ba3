//! IMU readings to measured head motion: clock, calibration, mounting, one sample per tick.
//!
//! `ImuReading -> ClockSync -> Calibration -> (alignment at rest) -> Mount -> HeadSample -> Resampler -> HeadMotion`.
//! [`ImuPipeline`] goes up to the head samples, [`Resampler`] from there to the ticks.

use nalgebra::Vector3;

mod calibration;
mod clock_sync;
mod envelope;
mod error;
mod health;
mod intervals;
mod mount;
mod order;
mod pipeline;
mod rate;
mod resample;
mod settings;

pub use calibration::{Calibration, MIN_REST_SAMPLES, RestDetector};
pub use clock_sync::{ClockMode, ClockSync};
pub use error::ImuConfigError;
pub use health::{AgeLimits, ImuCounters, LinkMonitor, ResampleCounters};
pub use intervals::Intervals;
pub use mount::{HeadSample, Mount, OmegaDerivative, points_down};
pub use order::{OrderWatch, Place};
pub use pipeline::{AlignmentReport, ImuPipeline, SCALE_LIMITS};
pub use resample::{RESAMPLE_CAPACITY, Resampler};
pub use settings::{ImuSettings, RestLimits};

use crate::time::HostTime;

/// One IMU sample on the host's time, calibrated, still in the sensor frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// When the sample was taken, host time.
    pub at: HostTime,
    /// Angular velocity, rad/s, imu frame.
    pub omega_imu: Vector3<f64>,
    /// Specific force a - g, m/s², imu frame.
    pub specific_force_imu: Vector3<f64>,
}

/// State of the connection to the device, by the age of its newest sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LinkHealth {
    /// Nothing usable has arrived yet.
    #[default]
    Waiting,
    /// Samples arrive.
    Live,
    /// The newest sample is old but within the hold limit: it is held.
    Stale,
    /// Older than the hold limit: the measurement is gone until samples return.
    Lost,
}
