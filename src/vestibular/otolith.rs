//! The otolith organs and the loop around them. Their afference is the gravito-inertial force itself (Eq. 3).

use nalgebra::Vector3;

/// Below this a gravito-inertial force has no direction, m/s²: free fall, or a packet of zeros.
const NO_FORCE: f64 = 1e-9;
/// Below this sine two directions count as one line.
const NO_ANGLE: f64 = 1e-14;

/// Rotation that carries the sensed gravito-inertial force onto the expected one, as a rotation vector.
///
/// ```text
/// e_f = (α_f × α̂_f) / |α_f × α̂_f| · arccos( α_f/|α_f| · α̂_f/|α̂_f| )          (Eq. 2)
/// ```
///
/// | symbol | here                | unit | frame | meaning                              |
/// |--------|---------------------|------|-------|--------------------------------------|
/// | α_f    | `gif_sensed_head`   | m/s² | head  | otolith afference                    |
/// | α̂_f    | `gif_expected_head` | m/s² | head  | afference the internal model expects |
/// | e_f    | return value        | rad  | head  | axis times angle, angle in \[0, π\]  |
///
/// # Degenerate inputs
/// Either zero (free fall): zero. Parallel: zero. Opposite (axis undefined): zero, as in the published model.
///
/// # Departure from the paper
/// The angle is atan2(|a × b|, a · b): equal to the arccos form, which loses its digits near 0 and π and is NaN
/// whenever rounding takes the dot product past 1.
#[inline]
pub fn gif_rotation_error(gif_sensed_head: &Vector3<f64>, gif_expected_head: &Vector3<f64>) -> Vector3<f64> {
    let sizes_squared = gif_sensed_head.norm_squared() * gif_expected_head.norm_squared();
    if gif_sensed_head.norm_squared() < NO_FORCE * NO_FORCE
        || gif_expected_head.norm_squared() < NO_FORCE * NO_FORCE
    {
        return Vector3::zeros();
    }
    let cross = gif_sensed_head.cross(gif_expected_head);
    let cross_squared = cross.norm_squared();
    if cross_squared < NO_ANGLE * NO_ANGLE * sizes_squared {
        return Vector3::zeros();
    }
    let sine = cross_squared.sqrt();
    cross * (libm::atan2(sine, gif_sensed_head.dot(gif_expected_head)) / sine)
}

/// Expected gravito-inertial force f̂, m/s², head frame: the otolith loop solved for its own output.
///
/// ```text
/// f̂ = ĝ - â   (Eq. 5)      â = k_a (f - f̂)   (Eq. 6)      =>   f̂ = (ĝ - k_a f) / (1 - k_a)
/// ```
///
/// | symbol | here           | unit | frame | meaning                                    |
/// |--------|----------------|------|-------|--------------------------------------------|
/// | f      | `gif_head`     | m/s² | head  | gravito-inertial force g - a, Eq. 4        |
/// | ĝ      | `gravity_head` | m/s² | head  | believed gravity, down                     |
/// | k_a    | `accel_gain`   | 1    | -     | acceleration gain, negative (never 1)      |
///
/// # Departure from the paper
/// With the last sample's f̂ the two equations are an iteration with multiplier k_a = -4, which diverges.
#[inline]
pub fn gif_expected(gravity_head: &Vector3<f64>, gif_head: &Vector3<f64>, accel_gain: f64) -> Vector3<f64> {
    (gravity_head - gif_head * accel_gain) / (1.0 - accel_gain)
}

/// Believed acceleration â = k_a (α_f - α̂_f), m/s², head frame (Eq. 6); both afferences in m/s².
#[inline]
pub fn accel_believed(
    gif_sensed: &Vector3<f64>,
    gif_expected: &Vector3<f64>,
    accel_gain: f64,
) -> Vector3<f64> {
    (gif_sensed - gif_expected) * accel_gain
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::RAD_PER_DEG;
    use nalgebra::{Rotation3, vector};
    use proptest::prelude::*;

    const GRAVITY: f64 = crate::units::STANDARD_GRAVITY;

    #[test]
    fn no_direction_no_error() {
        let down = vector![0.0, 0.0, -GRAVITY];
        for (sensed, expected) in [
            (Vector3::zeros(), down),
            (down, Vector3::zeros()),
            (Vector3::zeros(), Vector3::zeros()),
            (down, down * 0.3),
            (down, -down),
        ] {
            assert_eq!(gif_rotation_error(&sensed, &expected), Vector3::zeros());
        }
    }

    #[test]
    fn tiny_angles_keep_all_their_digits() {
        let down = vector![0.0, 0.0, -GRAVITY];
        for angle in [1e-12, 1e-8, 1e-3, 1.0, 3.0] {
            let turned = Rotation3::new(vector![angle, 0.0, 0.0]) * down;
            let error = gif_rotation_error(&down, &turned);
            assert!((error.x / angle - 1.0).abs() < 1e-15, "{angle}: {error}");
            assert_eq!((error.y, error.z), (0.0, 0.0));
        }
    }

    #[test]
    fn at_one_g_the_error_stays_below_asin_of_a_quarter() {
        let gif = vector![0.0, 0.0, -GRAVITY];
        let peak = (0..=1800)
            .map(|tenth_deg| {
                Rotation3::new(vector![f64::from(tenth_deg) * 0.1 * RAD_PER_DEG, 0.0, 0.0]) * gif
            })
            .map(|gravity| gif_rotation_error(&gif, &gif_expected(&gravity, &gif, -4.0)).norm())
            .fold(0.0, f64::max);
        assert!(peak <= libm::asin(0.25) && peak > libm::asin(0.25) - 1e-6, "{peak}");
    }

    proptest! {
        #[test]
        fn the_error_turns_one_direction_onto_the_other(
            a in prop::array::uniform3(-20.0..20.0f64), b in prop::array::uniform3(-20.0..20.0f64),
        ) {
            let (a, b) = (Vector3::from(a), Vector3::from(b));
            prop_assume!(a.norm() > 0.1 && b.norm() > 0.1 && a.cross(&b).norm() > 1e-3);
            let turned = Rotation3::new(gif_rotation_error(&a, &b)) * a.normalize();
            prop_assert!((turned - b.normalize()).norm() < 1e-12);
        }

        #[test]
        fn the_closed_loop_satisfies_equations_5_and_6(
            gravity in prop::array::uniform3(-10.0..10.0f64), gif in prop::array::uniform3(-20.0..20.0f64),
            accel_gain in -8.0..0.0f64,
        ) {
            let (gravity, gif) = (Vector3::from(gravity), Vector3::from(gif));
            let expected = gif_expected(&gravity, &gif, accel_gain);
            let accel = accel_believed(&gif, &expected, accel_gain);
            prop_assert!((gravity - accel - expected).norm() < 1e-13);
        }
    }
}
