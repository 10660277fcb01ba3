//! What the pure core learns and says each tick: the plain data that is recorded and verified.

use nalgebra::{Vector2, Vector3};

use crate::imu::LinkHealth;
use crate::time::Tick;
use crate::vestibular::{HeadMotion, Perception};

/// Everything the core learns in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickInput {
    /// Number of this tick. Ticks may be skipped (an overrun), never repeated.
    pub tick: Tick,
    /// Motion measured by the chair's IMU in mount (level chair) axes; `None` when there is none to trust.
    pub chair: Option<HeadMotion>,
    /// State of the device link.
    pub link: LinkHealth,
    /// True to stand both characters up again before this tick.
    pub respawn: bool,
}

/// The virtual turntable under both characters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlatformMotion {
    /// Angle about the vertical, rad.
    pub angle: f64,
    /// Angular rate about the vertical at the start of the tick, rad/s.
    pub rate: f64,
    /// Angular acceleration during the tick, rad/s².
    pub acceleration: f64,
}

/// Whether a character stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Posture {
    /// The balance controller is in charge.
    #[default]
    Standing,
    /// Fallen: joints damped and limp until it is stood up again.
    Fallen,
}

/// What one character believed, where it was and what its controller did in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CharacterOutput {
    /// What its observer believes, head frame.
    pub perception: Perception,
    /// Believed gravity in turntable axes (z up, turning with the platform), m/s².
    pub gravity_platform: Vector3<f64>,
    /// Angle between believed and true gravity, rad.
    pub gravity_tilt: f64,
    /// Centre of mass minus support centroid, turntable axes, m (z: height above the ground).
    pub com_platform: Vector3<f64>,
    /// Angle of the line from the support centroid to the centre of mass against the vertical, rad.
    pub com_sway: f64,
    /// Centre of pressure minus support centroid, turntable axes, m; `None` below 20 N of load.
    pub cop_platform: Option<Vector2<f64>>,
    /// Largest angle of a sole against the ground, rad: of the z axis of either foot's body against the ground's
    /// normal. The contact points of a foot lie in one plane across that axis.
    pub foot_tilt: f64,
    /// Length of the unbalanced root rows of the inverse dynamics, N and N m.
    pub constraint_residual: f64,
    /// Joints whose torque stood at its limit.
    pub saturated_joints: u8,
    /// Standing or fallen.
    pub posture: Posture,
    /// FNV-1a hash over the bits of configuration, velocity and torques after the tick.
    pub state_hash: u64,
}

/// Everything the core says in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickOutput {
    /// Number of this tick.
    pub tick: Tick,
    /// The turntable both characters stand on.
    pub platform: PlatformMotion,
    /// The character that trusts its vestibular model.
    pub green: CharacterOutput,
    /// The character that perceives perfectly; its observer runs but nobody listens to it.
    pub blue: CharacterOutput,
}
