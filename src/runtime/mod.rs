//! Running the pure core: live, from a recording, or as fast as the machine goes.

mod core;
mod figure;

pub use core::{Core, CoreSettings, CoreSettingsError, MAX_CHAIR_FORCE, MAX_CHAIR_RATE, Push};
pub use figure::{Figure, Vestibular};
