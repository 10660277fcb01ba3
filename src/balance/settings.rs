//! Gains of the momentum controller.

/// Gains and limits. Default: gain set A of the standing study, unchanged.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BalanceSettings {
    /// Centre-of-mass stiffness kp_l (Eq. 19), 1/s².
    pub com_stiffness: f64,
    /// Centre-of-mass damping kd_l (Eq. 19), 1/s.
    pub com_damping: f64,
    /// Stiffness of the height PD, 1/s² (not in the paper; it replaces the vertical row of Eq. 19).
    pub height_stiffness: f64,
    /// Damping of the height PD, 1/s.
    pub height_damping: f64,
    /// Posture stiffness kp_t (Eq. 16), 1/s².
    pub posture_stiffness: f64,
    /// Posture damping kd_t (Eq. 16), 1/s.
    pub posture_damping: f64,
    /// Weight b_l of the linear momentum rate (Eq. 18), 1/N².
    pub linear_weight: f64,
    /// Weight b_k of the angular momentum rate (Eq. 18), 1/(N m)².
    pub angular_weight: f64,
    /// Weight b_q of the posture (Eq. 18), 1/(rad/s²)².
    pub posture_weight: f64,
    /// Damping of the feet's velocity against the ground in the static-contact rows, 1/s.
    pub support_damping: f64,
    /// Friction coefficient the controller counts on (the ground's is higher).
    pub friction: f64,
    /// Least normal force each contact point is asked to carry, N. At 0.2 a foot tilts in wide sways, as in the paper; from
    /// 1 on the soles stay down.
    pub least_point_force: f64,
    /// Largest joint torque, N m.
    pub torque_limit: f64,
}

impl Default for BalanceSettings {
    fn default() -> Self {
        Self {
            com_stiffness: 11.0,
            com_damping: 6.63,
            height_stiffness: 60.0,
            height_damping: 15.0,
            posture_stiffness: 100.0,
            posture_damping: 20.0,
            linear_weight: 1.0,
            angular_weight: 0.1,
            posture_weight: 30.0,
            support_damping: 20.0,
            friction: 0.707,
            least_point_force: 0.2,
            torque_limit: 200.0,
        }
    }
}

/// A gain outside its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("key `balance.{key}` is {got}, allowed is {allowed}")]
pub struct SettingsError {
    /// Name of the key.
    pub key: &'static str,
    /// What was given.
    pub got: f64,
    /// Allowed range.
    pub allowed: &'static str,
}

impl BalanceSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// The first key outside its range.
    pub fn check(&self) -> Result<(), SettingsError> {
        let not_negative = [
            ("com_stiffness", self.com_stiffness),
            ("com_damping", self.com_damping),
            ("height_stiffness", self.height_stiffness),
            ("height_damping", self.height_damping),
            ("posture_stiffness", self.posture_stiffness),
            ("posture_damping", self.posture_damping),
            ("support_damping", self.support_damping),
        ];
        for (key, got) in not_negative {
            require(key, got, (0.0..=1e4).contains(&got), "0 to 10000")?;
        }
        let weights = [
            ("linear_weight", self.linear_weight),
            ("angular_weight", self.angular_weight),
            ("posture_weight", self.posture_weight),
        ];
        for (key, got) in weights {
            // The elimination of the root accelerations divides by the weights.
            require(key, got, got > 0.0 && got <= 1e6, "more than 0, at most 1e6")?;
        }
        require(
            "friction",
            self.friction,
            self.friction > 0.0 && self.friction <= 10.0,
            "more than 0, at most 10",
        )?;
        let least = self.least_point_force;
        require("least_point_force", least, (0.0..=40.0).contains(&least), "0 to 40 N")?;
        let limit = self.torque_limit;
        require("torque_limit", limit, limit > 0.0 && limit <= 1e4, "more than 0, at most 10000 N m")
    }
}

fn require(key: &'static str, got: f64, holds: bool, allowed: &'static str) -> Result<(), SettingsError> {
    if holds { Ok(()) } else { Err(SettingsError { key, got, allowed }) }
}
