//! The observer that is never wrong.

use nalgebra::Vector3;

use super::{HeadMotion, OrientationObserver, Perception, carry_gravity};

/// An observer that believes what is true: the paper's ideal observer, blue's.
///
/// Truth is more than a [`HeadMotion`]: gravity and acceleration only come as their difference. There are two ways:
///
/// - [`IdealObserver::perceive`] is told the true gravity, which a simulation knows. No error at any time: this is
///   how blue is fed, tick by tick.
/// - [`OrientationObserver::step`] carries the gravity it was last told along by the angular velocity. Exact up to the
///   interpolation of the input, so with measured input gyroscope bias adds up (1°/s: 30° in 30 s).
#[derive(Clone, Copy, Debug)]
pub struct IdealObserver {
    gravity_head: Vector3<f64>,
    motion: HeadMotion,
}

impl IdealObserver {
    /// An observer whose head moves by `motion` under the true gravity `gravity_head`, m/s², down.
    pub fn new(gravity_head: Vector3<f64>, motion: &HeadMotion) -> Self {
        Self { gravity_head, motion: *motion }
    }

    /// Takes the true gravity `gravity_head` (m/s², head frame, down) and motion of this moment, and believes them.
    pub fn perceive(&mut self, gravity_head: Vector3<f64>, motion: &HeadMotion) -> Perception {
        *self = Self::new(gravity_head, motion);
        self.perception()
    }
}

impl OrientationObserver for IdealObserver {
    fn reset(&mut self, gravity_head: Vector3<f64>, motion: &HeadMotion) {
        *self = Self::new(gravity_head, motion);
    }

    fn step(&mut self, motion: &HeadMotion, dt_s: f64) -> Perception {
        let gravity = carry_gravity(&self.gravity_head, &self.motion.omega_head, &motion.omega_head, dt_s);
        self.perceive(gravity, motion)
    }

    /// True gravity, true angular velocity, and the acceleration a = g - f that Eq. 4 leaves.
    fn perception(&self) -> Perception {
        Perception {
            gravity_head: self.gravity_head,
            omega_head: self.motion.omega_head,
            accel_head: self.gravity_head - self.motion.gif_head,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::STANDARD_GRAVITY;
    use nalgebra::vector;

    #[test]
    fn told_gravity_is_believed_to_the_bit_and_the_rest_is_acceleration() {
        let gravity = vector![0.3, -0.1, -9.8];
        let accel = vector![0.5, 0.25, -0.125];
        let motion = HeadMotion { omega_head: vector![0.1, 0.2, 0.3], gif_head: gravity - accel };
        let mut observer = IdealObserver::new(Vector3::zeros(), &motion);
        let percept = observer.perceive(gravity, &motion);
        assert_eq!(percept.gravity_head, gravity);
        assert_eq!(percept.omega_head, motion.omega_head);
        assert!((percept.accel_head - accel).norm() < 1e-15);
    }

    #[test]
    fn gravity_is_carried_along_between_tellings() {
        let down = vector![0.0, 0.0, -STANDARD_GRAVITY];
        let motion = HeadMotion { omega_head: vector![1.0, 0.0, 0.0], gif_head: down };
        let mut observer = IdealObserver::new(down, &motion);
        let mut percept = observer.perception();
        for _ in 0..500 {
            percept = observer.step(&motion, 1e-3);
        }
        // Rolling to the right by 0.5 rad lets gravity pull towards the right ear, -y.
        let expected = vector![0.0, -libm::sin(0.5), -libm::cos(0.5)] * STANDARD_GRAVITY;
        assert!((percept.gravity_head - expected).norm() < 1e-12);
    }
}
