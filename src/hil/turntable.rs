//! The virtual turntable under the characters, driven by the chair's yaw rate.

use crate::tick::PlatformMotion;

/// How the turntable follows the chair.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TurntableSettings {
    /// Time constant of the low-pass on the measured yaw rate, s. Its derivative is the turntable's acceleration, so
    /// gyroscope noise must be kept out of it.
    pub filter_s: f64,
    /// Largest acceleration while the device is lost and until the turntable has caught up again, rad/s².
    pub recovery_acceleration: f64,
}

impl Default for TurntableSettings {
    fn default() -> Self {
        Self { filter_s: 0.02, recovery_acceleration: 2.0 }
    }
}

/// Difference to the chair's rate at which a recovering turntable counts as caught up, rad/s.
const CAUGHT_UP: f64 = 0.02;

/// The turntable's state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turntable {
    settings: TurntableSettings,
    angle: f64,
    rate: f64,
    recovering: bool,
}

impl Turntable {
    /// A turntable at angle zero that already turns with `rate` rad/s.
    pub fn turning(settings: TurntableSettings, rate: f64) -> Self {
        Self { settings, angle: 0.0, rate, recovering: false }
    }

    /// Motion during the coming tick for the measured yaw rate; `None` when the measurement is gone: the turntable then
    /// brakes gently, since a jump to zero would throw the characters down.
    pub fn follow(&mut self, measured_rate: Option<f64>, dt_s: f64) -> PlatformMotion {
        let target = measured_rate.unwrap_or(0.0);
        let mut change = dt_s / (self.settings.filter_s + dt_s) * (target - self.rate);
        self.recovering |= measured_rate.is_none();
        if self.recovering {
            let limit = self.settings.recovery_acceleration * dt_s;
            self.recovering = measured_rate.is_none() || (target - self.rate).abs() > CAUGHT_UP;
            change = change.clamp(-limit, limit);
        }
        PlatformMotion { angle: self.angle, rate: self.rate, acceleration: change / dt_s }
    }

    /// Moves on to the end of the tick: the angle advances with the end rate, which is what the contacts see.
    pub fn advance(&mut self, motion: &PlatformMotion, dt_s: f64) {
        self.rate = motion.rate + dt_s * motion.acceleration;
        self.angle += dt_s * self.rate;
    }

    /// The turntable's angle, rad.
    pub fn angle(&self) -> f64 {
        self.angle
    }

    /// The turntable's rate, rad/s.
    pub fn rate(&self) -> f64 {
        self.rate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn follows_a_constant_rate_and_integrates_its_angle() {
        let mut table = Turntable::turning(TurntableSettings::default(), 0.0);
        for _ in 0..1000 {
            let motion = table.follow(Some(2.0), 1e-3);
            table.advance(&motion, 1e-3);
        }
        assert!((table.rate() - 2.0).abs() < 1e-9);
        // A first-order lag of 20 ms costs 2.0 rad/s x 20 ms of angle.
        assert!((table.angle() - 2.0 * (1.0 - 0.02)).abs() < 1e-3, "{}", table.angle());
    }

    #[test]
    fn brakes_gently_when_the_device_is_lost_and_catches_up_gently() {
        let settings = TurntableSettings::default();
        let mut table = Turntable::turning(settings, 3.0);
        let mut largest: f64 = 0.0;
        for tick in 0..4000 {
            let measured = (tick > 2500).then_some(3.0);
            let motion = table.follow(measured, 1e-3);
            largest = largest.max(motion.acceleration.abs());
            table.advance(&motion, 1e-3);
            if tick == 2500 {
                assert!(table.rate().abs() < 0.01, "stopped: {}", table.rate());
            }
        }
        assert!(largest <= settings.recovery_acceleration * (1.0 + 1e-12));
        assert!((table.rate() - 3.0).abs() < 0.05, "caught up: {}", table.rate());
    }
}
