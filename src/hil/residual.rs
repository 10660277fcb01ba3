//! What the real chair does beyond an ideal turntable: tilt, wobble, vibration.

use nalgebra::{Matrix3, Vector3};

use crate::dynamics::HeadSignals;
use crate::tick::PlatformMotion;
use crate::vestibular::HeadMotion;

/// Difference between the measured chair motion and an ideal level turntable turning with the platform's rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChairResidual {
    /// Angular velocity that the platform does not have, rad/s, chair axes.
    pub omega_chair: Vector3<f64>,
    /// Specific force that an ideal turntable would not show on its axis, m/s², chair axes.
    pub specific_force_chair: Vector3<f64>,
}

impl ChairResidual {
    /// Residual of a measurement taken on the axis (the mount's lever arm has moved it there); zero without one.
    pub fn of(chair: Option<&HeadMotion>, platform: &PlatformMotion, gravity: &Vector3<f64>) -> Self {
        chair.map_or_else(Self::default, |chair| Self {
            omega_chair: chair.omega_head - Vector3::new(0.0, 0.0, platform.rate),
            // On the axis an ideal turntable shows -g and nothing else.
            specific_force_chair: gravity - chair.gif_head,
        })
    }
}

/// What the observer is given: the simulated head's own sensors plus the chair's residual carried to the head.
///
/// ```text
/// ω_obs = ω_head + R_hᵀ (ω_chair - (0, 0, ω_p))        s_obs = s_head + R_hᵀ (s_chair - s_expected)
/// ```
///
/// `rot_world_head` and `rot_world_chair` take head and chair coordinates to the world's.
pub fn compose(
    head: &HeadSignals,
    residual: &ChairResidual,
    rot_world_head: &Matrix3<f64>,
    rot_world_chair: &Matrix3<f64>,
) -> HeadMotion {
    let rot_head_chair = rot_world_head.transpose() * rot_world_chair;
    HeadMotion {
        omega_head: head.omega_head + rot_head_chair * residual.omega_chair,
        gif_head: -(head.specific_force_head + rot_head_chair * residual.specific_force_chair),
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)] // reference values only
mod tests {
    use super::*;

    const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

    #[test]
    fn a_perfect_chair_leaves_no_residual() {
        let platform = PlatformMotion { angle: 0.3, rate: 1.5, acceleration: 0.0 };
        let chair = HeadMotion { omega_head: Vector3::new(0.0, 0.0, 1.5), gif_head: GRAVITY };
        let residual = ChairResidual::of(Some(&chair), &platform, &GRAVITY);
        assert_eq!(residual, ChairResidual::default());
        assert_eq!(ChairResidual::of(None, &platform, &GRAVITY), ChairResidual::default());
    }

    #[test]
    fn a_chair_tilted_left_ear_down_reaches_a_turned_head_along_the_right_axis() {
        // Chair rolled by 0.1 rad about its x axis: gravity then has a part along chair y.
        let (s, c) = (0.1f64.sin(), 0.1f64.cos());
        let gif = Vector3::new(0.0, -9.81 * s, -9.81 * c);
        let platform = PlatformMotion::default();
        let chair = HeadMotion { omega_head: Vector3::zeros(), gif_head: gif };
        let residual = ChairResidual::of(Some(&chair), &platform, &GRAVITY);
        let upright = HeadSignals { omega_head: Vector3::zeros(), specific_force_head: -GRAVITY };
        // The chair has turned a quarter to the left together with the head: nothing changes for the head.
        let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        let felt = compose(&upright, &residual, &quarter, &quarter);
        assert!((felt.gif_head - gif).norm() < 1e-12, "{felt:?}");
        // A head that looks a quarter to the left of the chair feels it along its own x axis, reversed.
        let felt = compose(&upright, &residual, &quarter, &Matrix3::identity());
        assert!((felt.gif_head - Vector3::new(gif.y, 0.0, gif.z)).norm() < 1e-12, "{felt:?}");
    }
}
