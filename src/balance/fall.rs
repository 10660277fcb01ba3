//! When standing is over. After that the momentum controller must not act: its static-contact assumption is broken
//! and torques blow up.

use crate::units::RAD_PER_DEG;

/// Limits past which a character has fallen.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FallSettings {
    /// Sway past which the character falls if the sway still grows, deg.
    pub sway_limit_deg: f64,
    /// How long the sway must have grown past the limit, s.
    pub growing_for_s: f64,
    /// Centre-of-mass height below which it has fallen, m.
    pub least_com_height: f64,
    /// Unsupplied root wrench that counts as lost contact, N and N m.
    pub residual_limit: f64,
    /// How long the residual must stay above its limit, s.
    pub residual_for_s: f64,
    /// Damping of the limp joints after the fall, N m s/rad.
    pub limp_damping: f64,
}

impl Default for FallSettings {
    fn default() -> Self {
        Self {
            sway_limit_deg: 9.5,
            growing_for_s: 0.05,
            least_com_height: 0.6,
            residual_limit: 20.0,
            residual_for_s: 0.25,
            limp_damping: 8.0,
        }
    }
}

/// Watches one character.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FallDetector {
    last_sway: f64,
    growing_s: f64,
    residual_s: f64,
}

impl FallDetector {
    /// True when the character has fallen by this tick. Non-finite numbers are a fall.
    pub fn fallen(
        &mut self,
        settings: &FallSettings,
        sway: f64,
        com_height: f64,
        residual: f64,
        dt_s: f64,
    ) -> bool {
        let growing = sway > settings.sway_limit_deg * RAD_PER_DEG && sway > self.last_sway;
        self.growing_s = if growing { self.growing_s + dt_s } else { 0.0 };
        self.residual_s = if residual > settings.residual_limit { self.residual_s + dt_s } else { 0.0 };
        self.last_sway = sway;
        let finite = sway.is_finite() && com_height.is_finite() && residual.is_finite();
        !finite
            || com_height < settings.least_com_height
            || self.growing_s > settings.growing_for_s
            || self.residual_s > settings.residual_for_s
    }
}
