//! Gyroscopes that are silenced at rest.

use nalgebra::Vector3;

/// Samples of exactly no rotation in a row that no noisy gyroscope gives.
const ZEROS: u32 = 50;
/// Changes of the accelerometer in these: the sensor itself is alive and noisy.
const CHANGES: u32 = 10;

/// Finds out whether a device writes exactly 0 for slow rotation: a gyroscope has noise, and one that reads 0 on all
/// axes sample after sample, while the accelerometer beside it does change, has a dead band.
#[derive(Clone, Debug, Default)]
pub(super) struct DeadBand {
    zeros: u32,
    changes: u32,
    last_force: Option<Vector3<f64>>,
    found: bool,
}

impl DeadBand {
    /// Takes a sample: angular velocity, rad/s, and specific force, m/s².
    pub(super) fn take(&mut self, omega: &Vector3<f64>, specific_force: &Vector3<f64>) {
        let changed = self.last_force.replace(*specific_force).is_some_and(|last| last != *specific_force);
        if *omega == Vector3::zeros() {
            self.zeros = self.zeros.saturating_add(1);
            self.changes = self.changes.saturating_add(u32::from(changed));
            self.found |= self.zeros >= ZEROS && self.changes >= CHANGES;
        } else {
            (self.zeros, self.changes) = (0, 0);
        }
    }

    /// Whether a dead band was seen so far.
    pub(super) fn is_found(&self) -> bool {
        self.found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(omega_z: impl Fn(u32) -> f64, force_z: impl Fn(u32) -> f64) -> bool {
        let mut dead_band = DeadBand::default();
        for k in 0..200 {
            dead_band.take(&Vector3::new(0.0, 0.0, omega_z(k)), &Vector3::new(0.0, 0.0, force_z(k)));
        }
        dead_band.is_found()
    }

    #[test]
    fn only_a_silent_gyroscope_beside_a_noisy_accelerometer_has_a_dead_band() {
        let noise = |k: u32| 9.8 + 0.01 * f64::from(k * 7 % 5);
        assert!(found(|_| 0.0, noise));
        assert!(found(|k| f64::from(u32::from(k > 60)), noise), "and later rotation does not undo it");
        assert!(!found(|k| 1e-3 * f64::from(k % 20), noise));
        assert!(!found(|_| 0.0, |_| 9.8), "two constants are a simulation");
    }
}
