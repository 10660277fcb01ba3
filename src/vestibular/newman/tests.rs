//! The derivative itself against closed forms: what integration cannot hide.

use nalgebra::{Complex, SMatrix, SVector, Vector3, vector};

use super::*;
use crate::units::{DEG_PER_RAD, STANDARD_GRAVITY};

type State12 = SVector<f64, 12>;
type Input2 = [f64; 2];

const UPRIGHT: Vector3<f64> = Vector3::new(0.0, 0.0, -STANDARD_GRAVITY);

fn packed(state: &State) -> State12 {
    let parts = [state.canal.omega_forgotten, state.canal.omega_adapted, state.internal_canal, state.gravity];
    State12::from_iterator(parts.iter().flat_map(|part| part.iter().copied()))
}

fn unpacked(values: &State12) -> State {
    let part = |first: usize| Vector3::new(values[first], values[first + 1], values[first + 2]);
    State {
        canal: CanalState { omega_forgotten: part(0), omega_adapted: part(3) },
        internal_canal: part(6),
        gravity: part(9),
        canal_sensed: Vector3::zeros(),
        canal_expected: Vector3::zeros(),
        otolith_sensed: Vector3::zeros(),
        otolith_expected: Vector3::zeros(),
    }
}

/// Derivative, and (ĝ_y, â_y), for the roll rate and lateral gravito-inertial force in `input`, about upright.
fn model(state: &State12, input: Input2) -> (State12, [f64; 2]) {
    let parameters = ObserverParameters::default();
    let motion = HeadMotion {
        omega_head: vector![input[0], 0.0, 0.0],
        gif_head: UPRIGHT + vector![0.0, input[1], 0.0],
    };
    let state = unpacked(state);
    let signals = signals(&parameters, &state, &motion);
    (packed(&rate(&parameters, &state, &motion, &signals)), [state.gravity.y, signals.accel.y])
}

/// The linear system (A, B, C, D) about upright rest by central differences.
struct Linear {
    a: SMatrix<f64, 12, 12>,
    b: SMatrix<f64, 12, 2>,
    c: SMatrix<f64, 2, 12>,
    d: SMatrix<f64, 2, 2>,
}

fn linearised() -> Linear {
    const STEP: f64 = 1e-4;
    let upright = packed(&initial_state(
        &ObserverParameters::default(),
        UPRIGHT,
        &HeadMotion { omega_head: Vector3::zeros(), gif_head: UPRIGHT },
    ));
    let mut linear =
        Linear { a: SMatrix::zeros(), b: SMatrix::zeros(), c: SMatrix::zeros(), d: SMatrix::zeros() };
    let slopes = |plus: (State12, [f64; 2]), minus: (State12, [f64; 2])| {
        let output = SVector::<f64, 2>::from(plus.1) - SVector::<f64, 2>::from(minus.1);
        ((plus.0 - minus.0) / (2.0 * STEP), output / (2.0 * STEP))
    };
    for column in 0..12 {
        let mut offset = State12::zeros();
        offset[column] = STEP;
        let (a, c) = slopes(model(&(upright + offset), [0.0; 2]), model(&(upright - offset), [0.0; 2]));
        linear.a.set_column(column, &a);
        linear.c.set_column(column, &c);
    }
    for column in 0..2 {
        let mut input = [0.0; 2];
        input[column] = STEP;
        let (b, d) = slopes(model(&upright, input), model(&upright, input.map(|value| -value)));
        linear.b.set_column(column, &b);
        linear.d.set_column(column, &d);
    }
    linear
}

/// Complex amplitudes of (ĝ_y, â_y) for the complex input amplitudes at `f_hz`.
fn response(linear: &Linear, f_hz: f64, input: SVector<Complex<f64>, 2>) -> SVector<Complex<f64>, 2> {
    let complex = |value: f64| Complex::new(value, 0.0);
    let s = Complex::new(0.0, 2.0 * core::f64::consts::PI * f_hz);
    let system = SMatrix::<Complex<f64>, 12, 12>::identity() * s - linear.a.map(complex);
    let state = system.lu().solve(&(linear.b.map(complex) * input)).unwrap();
    linear.c.map(complex) * state + linear.d.map(complex) * input
}

fn degrees(value: Complex<f64>) -> f64 {
    libm::atan2(value.im, value.re) * DEG_PER_RAD
}

#[test]
fn small_roll_and_lateral_motion_match_the_exact_frequency_response() {
    let linear = linearised();
    let golden = include_str!("../../../tests/golden/observer/g_frequency_response_seed.csv");
    let mut rows = 0;
    for line in golden.lines().skip(1) {
        let row: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let s = Complex::new(0.0, 2.0 * core::f64::consts::PI * row[0]);
        // Roll by φ = 1: ω = s φ, and gravity moves towards the right ear, f_y = -|g| φ.
        let tilt = response(&linear, row[0], SVector::from([s, Complex::new(-STANDARD_GRAVITY, 0.0)]));
        // Acceleration a = 1 to the left: f_y = -1.
        let translation = response(&linear, row[0], SVector::from([Complex::ZERO, Complex::new(-1.0, 0.0)]));
        let believed_roll = -tilt[0] / STANDARD_GRAVITY;
        // ĝ_y = -|g| φ̂ and the tilt of the gravito-inertial force is a/|g|.
        let false_tilt = -translation[0];
        let ours = [
            libm::hypot(believed_roll.re, believed_roll.im),
            degrees(believed_roll),
            libm::hypot(tilt[1].re, tilt[1].im),
            libm::hypot(translation[1].re, translation[1].im),
            degrees(translation[1]),
            libm::hypot(false_tilt.re, false_tilt.im),
            degrees(false_tilt),
        ];
        for (ours, golden) in ours.iter().zip(&row[1..]) {
            assert!((ours - golden).abs() < 1e-6 * golden.abs().max(1.0), "{} Hz: {ours} {golden}", row[0]);
        }
        rows += 1;
    }
    assert_eq!(rows, 53);
}

#[test]
fn belief_opposite_to_gravity_is_an_equilibrium_and_free_fall_is_finite() {
    let mut observer = NewmanObserver::new(ObserverParameters::default()).unwrap();
    let rest = HeadMotion { omega_head: Vector3::zeros(), gif_head: UPRIGHT };
    observer.reset(-UPRIGHT, &rest);
    let percept = observer.step(&rest, 1.0);
    assert_eq!(percept.gravity_head, -UPRIGHT);
    assert_eq!(percept.omega_head, Vector3::zeros());

    let falling = HeadMotion { omega_head: vector![1.0, 0.0, 0.0], gif_head: Vector3::zeros() };
    observer.reset(UPRIGHT, &rest);
    for _ in 0..2000 {
        let percept = observer.step(&falling, 1e-3);
        assert_eq!(observer.gif_error(), Vector3::zeros());
        assert!((percept.gravity_head.norm() - STANDARD_GRAVITY).abs() < 1e-12);
        // With no force felt, all of believed gravity is taken for a fall: â = -k_a/(1 - k_a) ĝ.
        assert!((percept.accel_head - percept.gravity_head * 0.8).norm() < 1e-12);
    }
}

#[test]
fn adapted_canals_start_silent_while_the_chair_turns() {
    for name in super::super::PRESET_NAMES {
        let mut observer = NewmanObserver::new(ObserverParameters::preset(name).unwrap()).unwrap();
        let spinning = HeadMotion { omega_head: vector![0.0, 0.0, 3.0], gif_head: UPRIGHT };
        observer.reset(UPRIGHT, &spinning);
        for _ in 0..1000 {
            let percept = observer.step(&spinning, 0.01);
            assert!(percept.omega_head.norm() < 1e-12, "{name}");
            assert!((percept.gravity_head - UPRIGHT).norm() < 1e-12, "{name}");
        }
    }
}

#[test]
fn a_long_gap_equals_its_parts() {
    let jump = HeadMotion { omega_head: vector![0.4, -0.3, 1.0], gif_head: vector![1.0, 2.0, -9.0] };
    for name in super::super::PRESET_NAMES {
        let mut whole = NewmanObserver::new(ObserverParameters::preset(name).unwrap()).unwrap();
        let from = whole.motion;
        let mut parts = whole;
        whole.step(&jump, 0.5);
        for part in 1..=100 {
            parts.step(&from.interpolated(&jump, f64::from(part) / 100.0), 0.005);
        }
        let (whole, parts) = (whole.perception(), parts.perception());
        assert!((whole.gravity_head - parts.gravity_head).norm() < 1e-6, "{name}");
        assert!((whole.omega_head - parts.omega_head).norm() < 1e-6, "{name}");
    }
}

#[test]
#[should_panic(expected = "time only goes forward")]
fn time_does_not_run_backwards() {
    let mut observer = NewmanObserver::new(ObserverParameters::default()).unwrap();
    let motion = observer.motion;
    observer.step(&motion, -1e-3);
}
