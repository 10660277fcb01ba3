//! Gravity as a turning head sees it, and the angle between directions.

use nalgebra::{Rotation3, Vector3};

/// Longest interval carried in one exponential map, s; longer ones are cut into equal parts.
const LONGEST_PART_S: f64 = 0.02;

/// Gravity in head axes after the head has turned for `dt_s` with an angular velocity linear from `omega_from` to
/// `omega_to` (rad/s, head frame).
///
/// ```text
/// g' = -ω × g   =>   g(h) = exp(-[r]×) g(0),   r = h (ω0 + ω1)/2 + h²/12 (ω0 × ω1) + O(h⁵)
/// ```
/// The fourth-order Magnus expansion: exact when ω keeps its direction, and it keeps |g|. The second term is the
/// coning correction of strapdown navigation.
pub fn carry_gravity(
    gravity_head: &Vector3<f64>,
    omega_from: &Vector3<f64>,
    omega_to: &Vector3<f64>,
    dt_s: f64,
) -> Vector3<f64> {
    let parts = (dt_s / LONGEST_PART_S).ceil().max(1.0);
    let part_s = dt_s / parts;
    let mut gravity = *gravity_head;
    let mut from = *omega_from;
    for part in 1..=parts as u64 {
        let to = omega_from.lerp(omega_to, part as f64 / parts);
        let turn = (from + to) * (0.5 * part_s) + from.cross(&to) * (part_s * part_s / 12.0);
        gravity = Rotation3::new(-turn) * gravity;
        from = to;
    }
    gravity
}

/// Angle between two directions, rad, in \[0, π\]: the tilt of believed against true gravity.
///
/// atan2 of cross and dot product: right to the last digit at every angle. Zero when either vector is zero.
pub fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::atan2(a.cross(b).norm(), a.dot(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::STANDARD_GRAVITY;
    use nalgebra::vector;

    #[test]
    fn a_turn_about_a_fixed_axis_is_exact_over_any_interval() {
        let down = vector![0.0, 0.0, -STANDARD_GRAVITY];
        // 0 to 2 rad/s in 3 s: 3 rad.
        let carried = carry_gravity(&down, &Vector3::zeros(), &vector![2.0, 0.0, 0.0], 3.0);
        let expected = Rotation3::new(vector![-3.0, 0.0, 0.0]) * down;
        assert!((carried - expected).norm() < 1e-13, "{carried}");
    }

    #[test]
    fn a_turning_axis_is_followed_to_fourth_order() {
        let down = vector![0.0, 0.0, -STANDARD_GRAVITY];
        let (from, to) = (vector![3.0, 0.0, 1.0], vector![0.0, 4.0, -1.0]);
        let reference = (0..10_000).fold(down, |gravity, i| {
            let at = |j: i32| from.lerp(&to, f64::from(j) / 10_000.0);
            carry_gravity(&gravity, &at(i), &at(i + 1), 0.02 / 10_000.0)
        });
        let error = |parts: i32| {
            let carried = (0..parts).fold(down, |gravity, i| {
                let at = |j: i32| from.lerp(&to, f64::from(j) / f64::from(parts));
                carry_gravity(&gravity, &at(i), &at(i + 1), 0.02 / f64::from(parts))
            });
            (carried - reference).norm()
        };
        assert!(error(1) < 3e-5, "{:e}", error(1));
        assert!((error(1) / error(2) - 16.0).abs() < 2.0, "{:e} {:e}", error(1), error(2));
    }

    #[test]
    fn carrying_keeps_the_size() {
        let down = vector![0.0, 0.0, -STANDARD_GRAVITY];
        let (from, to) = (vector![3.0, -2.0, 1.0], vector![0.0, 4.0, -1.0]);
        let carried = (0..1000).fold(down, |gravity, _| carry_gravity(&gravity, &from, &to, 0.01));
        assert!((carried.norm() - STANDARD_GRAVITY).abs() < 1e-12);
    }

    #[test]
    fn angles_from_zero_to_a_half_turn() {
        let down = vector![0.0, 0.0, -STANDARD_GRAVITY];
        for angle in [0.0, 1e-10, 0.5, 3.0, core::f64::consts::PI] {
            let turned = Rotation3::new(vector![0.0, angle, 0.0]) * down;
            assert!((angle_between(&down, &turned) - angle).abs() < 1e-15, "{angle}");
        }
        assert_eq!(angle_between(&down, &Vector3::zeros()), 0.0);
    }
}
