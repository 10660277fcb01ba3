//! Hardware in the loop: the measured chair drives a simulated turntable, and what the turntable cannot show is added
//! to the simulated head's sensors (`spec/balance.md`, mode A).
//!
//! Feeding the chair's IMU straight into the observer cannot work: yaw of a level chair leaves the believed rotation
//! parallel to gravity, and no illusion of tilt arises. The illusion is closed through the character's own head sway.

mod residual;
mod turntable;

pub use residual::{ChairResidual, compose};
pub use turntable::{Turntable, TurntableSettings};
