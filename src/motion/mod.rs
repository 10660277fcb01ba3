//! Motions: key poses to a reference posture that the balance controller follows (Eq. 16 of the main paper).

mod plan;
mod player;
mod polynomial;
mod trajectory;

pub use plan::{KeyPose, MOTION_NAMES, MotionError, MotionSettings, shipped_motion};
pub use player::Player;
pub use trajectory::Trajectory;
