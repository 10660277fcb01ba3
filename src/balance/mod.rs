//! Perception to torques: momentum control in the believed frame (section 5 of the main paper).
//!
//! The controller knows where its body is relative to the ground; what it may be wrong about is which way is down.
//! Everything it believes stands in one struct, [`PerceivedBalance`], filled in one place.

use crate::character::JointVec;
use crate::dynamics::{Dynamics, GroundSurface};

mod cone;
mod fall;
mod kkt;
mod momentum;
mod perceive;
mod settings;
#[cfg(test)]
mod tests;

pub use cone::{ForceDistribution, SupportForces};
pub use fall::{FallDetector, FallSettings};
pub use momentum::{MomentumController, Reference};
pub use perceive::{PerceivedBalance, SupportPolygon, perceive};
pub use settings::{BalanceSettings, SettingsError};

/// Turns what is believed into joint torques.
pub trait BalanceController<D: Dynamics>: Send {
    /// Torques for the present state, N m.
    fn control(&mut self, body: &D, ground: &GroundSurface, perceived: &PerceivedBalance) -> Control;
    /// Forgets the past: warm starts and the height that is held.
    fn reset(&mut self, body: &D);
}

/// Result of one control computation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// Joint torques, limited, N m.
    pub torques: JointVec,
    /// How well the problem could be solved.
    pub report: ControlReport,
}

/// How well the control problem could be solved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControlReport {
    /// Length of the part of the root's wrench that no force inside the friction cones supplies (N and N m).
    pub constraint_residual: f64,
    /// Joints whose torque stood at its limit.
    pub saturated_joints: u8,
}
