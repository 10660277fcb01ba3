//! The observer against closed forms and symmetries.

use nalgebra::{Rotation3, Unit, Vector3, vector};
use otolith::units::{DEG_PER_RAD, STANDARD_GRAVITY};
use otolith::vestibular::{
    HeadMotion, NewmanObserver, ObserverParameters, OrientationObserver, PRESET_NAMES, angle_between,
};
use proptest::prelude::*;

use super::observer_cases::named;

const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -STANDARD_GRAVITY);

fn observer(parameters: ObserverParameters) -> NewmanObserver {
    NewmanObserver::new(parameters).unwrap()
}

/// Believed yaw rate after a jump to 1 rad/s, every `dt_s`, from time 0.
fn yaw_step_response(canal_gain: f64, dt_s: f64, steps: usize) -> Vec<f64> {
    let mut observer = observer(ObserverParameters { canal_gain, ..ObserverParameters::default() });
    observer.reset(DOWN, &HeadMotion { omega_head: Vector3::zeros(), gif_head: DOWN });
    let spin = HeadMotion { omega_head: Vector3::z(), gif_head: DOWN };
    let first = observer.step(&spin, 0.0).omega_head.z;
    std::iter::once(first).chain((0..steps).map(|_| observer.step(&spin, dt_s).omega_head.z)).collect()
}

#[test]
fn a_jump_of_yaw_decays_as_the_closed_form_says() {
    for canal_gain in [8.0, 3.0, 2.28] {
        let (p, q) = (1.0 / 80.0, 1.0 / ((canal_gain + 1.0) * 5.7));
        for (i, y) in yaw_step_response(canal_gain, 0.01, 30_000).into_iter().enumerate() {
            let t = i as f64 * 0.01;
            let expected = (q * libm::exp(-q * t) - p * libm::exp(-p * t)) / (q - p);
            assert!((y - expected).abs() < 1e-10, "k_ω {canal_gain}, {t} s: {y} {expected}");
        }
    }
}

#[test]
fn yaw_storage_crosses_zero_and_undershoots_when_the_table_says() {
    // (k_ω, 1/e s, zero s, minimum, its time s, y(15 s)), to the digits printed in the specification.
    for (canal_gain, e_fold, zero, minimum, minimum_at, at_15_s) in [
        (8.0, 27.21, 63.54, -0.1310, 127.1, 0.5989),
        (3.0, 15.97, 40.03, -0.1048, 80.1, 0.3939),
        (2.28, 13.78, 35.47, -0.0963, 70.9, 0.3322),
    ] {
        let y = yaw_step_response(canal_gain, 0.001, 150_000);
        let first_below = |level: f64| y.iter().position(|&value| value < level).unwrap() as f64 * 0.001;
        let (lowest_at, lowest) = y.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!((first_below(libm::exp(-1.0)) - e_fold).abs() < 0.0065, "{}", first_below(libm::exp(-1.0)));
        assert!((first_below(0.0) - zero).abs() < 0.0065, "{}", first_below(0.0));
        assert!((lowest - minimum).abs() < 0.000_06, "{lowest}");
        assert!((lowest_at as f64 * 0.001 - minimum_at).abs() < 0.06, "{lowest_at}");
        assert!((y[15_000] - at_15_s).abs() < 0.000_06, "{}", y[15_000]);
    }
}

/// Evaluated with last-sample values, the loops of Eqs. 2-7 leave the finite numbers within a second of motion. In
/// closed form the percept of a jump is right at once, and bounded ever after, at every sample time.
#[test]
fn the_loops_are_solved_not_iterated() {
    for preset in ["seed", "merfeld-zupan-2002", "irmak-2023", "allred-tuned"] {
        for dt_s in [0.001, 0.005, 0.01, 0.02, 0.05] {
            let mut observer = observer(ObserverParameters::preset(preset).unwrap());
            let spin = HeadMotion { omega_head: vector![0.0, 0.0, 3.0], gif_head: DOWN };
            let percept = observer.step(&spin, 0.0);
            assert!((percept.omega_head.z - 3.0).abs() < 1e-14, "{preset}: {percept:?}");
            for _ in 0..1000 {
                let percept = observer.step(&spin, dt_s);
                assert!(percept.omega_head.norm() <= 3.0 + 1e-12, "{preset} at {dt_s} s: {percept:?}");
            }
        }
    }
}

/// Tilt error of believed gravity at the golden rows during and after a fast roll, fed at 100 Hz.
fn fast_roll_error_deg(hold: bool) -> f64 {
    let case = named("e_roll90");
    let mut observer = observer(ObserverParameters::default());
    observer.reset(DOWN, &case.truth(0.0).motion());
    let mut worst = 0.0_f64;
    for sample in 1..=6200_u32 {
        if hold {
            // The sample before holds for the whole interval; the new one arrives as a jump at its end.
            observer.step(&case.truth(f64::from(sample - 1) * 0.01).motion(), 0.01);
        }
        let to = case.truth(f64::from(sample) * 0.01).motion();
        let percept = observer.step(&to, if hold { 0.0 } else { 0.01 });
        if sample % 50 == 0 {
            let golden = &case.rows[(sample / 50) as usize].gravity_hat;
            worst = worst.max(angle_between(&percept.gravity_head, golden) * DEG_PER_RAD);
        }
    }
    worst
}

#[test]
fn a_sample_and_hold_feed_is_measurably_wrong() {
    let (linear, held) = (fast_roll_error_deg(false), fast_roll_error_deg(true));
    println!(
        "error of believed gravity in a fast roll at 100 Hz: linear {linear:.1e} deg, held {held:.2} deg"
    );
    assert!(linear < 0.01 && held > 0.5, "linear {linear} deg, held {held} deg");
}

/// A motion that turns and pulls in every direction, with frequencies that do not repeat.
fn stirred(t: f64) -> HeadMotion {
    let wave = |f: f64, phase: f64| libm::sin(f * t + phase);
    HeadMotion {
        omega_head: vector![2.0 * wave(1.3, 0.1), 1.5 * wave(2.1, 1.0), 3.0 * wave(0.7, 2.0)],
        gif_head: DOWN + vector![3.0 * wave(1.7, 0.3), 4.0 * wave(1.1, 0.7), 2.0 * wave(2.9, 1.9)],
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// All gains are scalars: a head whose axes are called otherwise perceives the same.
    #[test]
    fn turned_axes_perceive_the_same(
        axis in prop::array::uniform3(-1.0..1.0f64), angle in -3.1..3.1f64, preset in 0..PRESET_NAMES.len(),
    ) {
        prop_assume!(Vector3::from(axis).norm() > 0.1);
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::from(axis)), angle);
        let seen = |motion: HeadMotion| HeadMotion {
            omega_head: turn * motion.omega_head,
            gif_head: turn * motion.gif_head,
        };
        let parameters = ObserverParameters::preset(PRESET_NAMES[preset]).unwrap();
        let (mut plain, mut turned) = (observer(parameters), observer(parameters));
        plain.reset(DOWN, &stirred(0.0));
        turned.reset(turn * DOWN, &seen(stirred(0.0)));
        for step in 1..=500 {
            let motion = stirred(f64::from(step) * 0.01);
            let (plain, turned) = (plain.step(&motion, 0.01), turned.step(&seen(motion), 0.01));
            prop_assert!((turn * plain.omega_head - turned.omega_head).norm() < 1e-12);
            prop_assert!((turn * plain.gravity_head - turned.gravity_head).norm() < 1e-12);
            prop_assert!((turn * plain.accel_head - turned.accel_head).norm() < 1e-12);
        }
    }

    /// Whatever is fed, belief stays finite and its gravity keeps its size.
    #[test]
    fn rough_input_leaves_a_finite_percept(
        inputs in prop::collection::vec(
            (prop::array::uniform3(-40.0..40.0f64), prop::array::uniform3(-80.0..80.0f64), 0.0..0.2f64),
            1..60,
        ),
        preset in 0..PRESET_NAMES.len(),
    ) {
        let mut observer = observer(ObserverParameters::preset(PRESET_NAMES[preset]).unwrap());
        for (omega, gif, dt_s) in inputs {
            let motion = HeadMotion { omega_head: omega.into(), gif_head: gif.into() };
            let percept = observer.step(&motion, dt_s);
            prop_assert!(percept.omega_head.norm().is_finite() && percept.accel_head.norm().is_finite());
            prop_assert!((percept.gravity_head.norm() - STANDARD_GRAVITY).abs() < 1e-12);
        }
    }
}
