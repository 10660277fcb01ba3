//! Means and segments on data whose truth is known.

use nalgebra::Vector3;

use super::{
    Bias, Mean, MovementKind, Plateau, Sample, Sampling, Segments, angle_between, coverage_factor, median,
};
use crate::device::Noise;
use crate::imu::RestLimits;

/// Samples at 100 Hz whose rate about z is `rate` of the time.
fn turning(duration_s: f64, rate: impl Fn(f64) -> f64) -> Vec<Sample> {
    let mut noise = Noise::new(11);
    let count = (duration_s * 100.0) as usize;
    let sample = |index: usize| {
        let time_s = index as f64 * 0.01;
        Sample {
            time_s,
            omega_imu: Vector3::z() * rate(time_s) + Vector3::from_fn(|_, _| 1e-3 * noise.normal()),
            specific_force_imu: Some(Vector3::new(0.0, 0.0, 9.8)),
            clipped: false,
        }
    };
    (0..count).map(sample).collect()
}

#[test]
fn the_error_of_a_mean_knows_that_neighbours_are_alike() {
    // A first-order filter with a correlation of 0.9 from sample to sample: the mean is √19 times as uncertain as that
    // of independent samples.
    let (mut covered, mut ratio, runs) = (0, 0.0, 200);
    for seed in 0..runs {
        let mut noise = Noise::new(seed);
        let mut state = Vector3::zeros();
        let values: Vec<Vector3<f64>> = (0..4000)
            .map(|_| {
                state = 0.9 * state + Vector3::from_fn(|_, _| noise.normal());
                state
            })
            .collect();
        let mean = Mean::of(&values).unwrap();
        covered += usize::from(mean.mean.x.abs() <= 2.0 * mean.covariance[(0, 0)].sqrt());
        ratio += mean.covariance[(0, 0)].sqrt() / (mean.std.x / (4000.0_f64).sqrt()) / runs as f64;
    }
    assert!(covered >= 180, "{covered} of {runs}");
    assert!((ratio / 19.0_f64.sqrt() - 1.0).abs() < 0.2, "{ratio}");
}

#[test]
fn of_few_values_the_error_is_wide_and_of_one_there_is_none() {
    assert!(Mean::of(&[Vector3::x()]).is_none());
    let two = Mean::of(&[Vector3::zeros(), Vector3::x()]).unwrap();
    assert!((two.covariance[(0, 0)].sqrt() - 0.5 * coverage_factor(1)).abs() < 1e-12);
    assert!((coverage_factor(1) * 1.96 - 12.7).abs() < 0.01 && coverage_factor(0).is_infinite());
    // Student's t for 15 and 60 degrees of freedom: 2.131 and 2.000.
    assert!((coverage_factor(15) * 1.959_964 - 2.131).abs() < 2e-3);
    assert!((coverage_factor(60) * 1.959_964 - 2.000).abs() < 1e-3);
}

#[test]
fn medians_and_angles_have_their_edges() {
    assert_eq!(median(&mut []), 0.0);
    assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
    assert_eq!(angle_between(&Vector3::x(), &Vector3::zeros()), 0.0);
    assert!((angle_between(&Vector3::x(), &-Vector3::x()) - core::f64::consts::PI).abs() < 1e-15);
    assert_eq!(Sampling::of(&[]).rate_hz, 0.0);
}

#[test]
fn rests_and_movements_are_told_apart_and_a_soft_start_is_no_rest() {
    // Within the limits of rest for more than a second, and yet on its way.
    let soft = |t: f64| {
        if (3.0..13.0).contains(&t) {
            0.5 * (1.0 - libm::cos(0.2 * core::f64::consts::PI * (t - 3.0)))
        } else {
            0.0
        }
    };
    let samples = turning(16.0, soft);
    let segments = Segments::find(&samples, &RestLimits::default());
    assert_eq!((segments.rests.len(), segments.movements.len()), (2, 1));
    assert!(segments.rests[0].times_s(&samples).1 < 3.4 && segments.rests[1].times_s(&samples).0 > 12.6);
    let spin = segments.longest_spin().unwrap();
    assert_eq!(spin.kind, MovementKind::Spin);
    assert!((spin.turning.angle.z - 5.0).abs() < 0.01, "{}", spin.turning.angle);
    assert!(Segments::find(&[], &RestLimits::default()).movements.is_empty());
}

#[test]
fn back_and_forth_is_rocking_and_a_quarter_turn_is_no_spin() {
    let rocking = turning(8.0, |t| {
        if (2.0..6.0).contains(&t) { libm::sin(core::f64::consts::TAU * (t - 2.0) / 2.0) } else { 0.0 }
    });
    let segments = Segments::find(&rocking, &RestLimits::default());
    assert_eq!(segments.movements[0].kind, MovementKind::Rocking);
    assert!(segments.movements[0].main_axis.z.abs() > 0.999 && segments.longest_spin().is_none());
    let quarter = turning(5.0, |t| if (2.0..3.0).contains(&t) { 1.5 } else { 0.0 });
    let segments = Segments::find(&quarter, &RestLimits::default());
    assert_eq!(segments.movements[0].kind, MovementKind::Other);
}

#[test]
fn the_plateau_is_the_longest_steady_stretch() {
    // 4 s at half the rate, then 8 s at the whole, with a dip of 0.3 s that does not end it.
    let steps = |t: f64| match t {
        t if !(2.0..14.0).contains(&t) => 0.0,
        t if t < 6.0 => 1.0,
        t if (9.0..9.3).contains(&t) => 1.6,
        _ => 2.0,
    };
    let samples = turning(16.0, steps);
    let segments = Segments::find(&samples, &RestLimits::default());
    let plateau = Plateau::find(&samples, segments.longest_spin().unwrap()).unwrap();
    let (start_s, end_s) = plateau.span.times_s(&samples);
    assert!((start_s - 6.0).abs() < 0.3 && (end_s - 14.0).abs() < 0.3, "{start_s} to {end_s}");
    // A rate that never keeps steady has none.
    let ramp = turning(8.0, |t| if (2.0..6.0).contains(&t) { 2.0 * (t - 2.0) } else { 0.0 });
    let segments = Segments::find(&ramp, &RestLimits::default());
    assert_eq!(Plateau::find(&ramp, segments.longest_spin().unwrap()), None);
}

#[test]
fn a_bias_goes_on_a_line_from_rest_to_rest() {
    let bias = Bias { before: Some((1.0, Vector3::x())), after: Some((3.0, Vector3::x() * 2.0)) };
    assert_eq!(bias.at(2.0), Vector3::x() * 1.5);
    assert_eq!((bias.at(0.0), bias.at(9.0)), (Vector3::x(), Vector3::x() * 2.0));
    assert_eq!(Bias::default().at(1.0), Vector3::zeros());
    assert!(bias.is_known() && !Bias::default().is_known());
}

#[test]
fn a_pause_of_the_data_ends_a_rest_and_spoils_a_nod() {
    let rocking = |t: f64| {
        if (2.0..6.0).contains(&t) { libm::sin(core::f64::consts::TAU * (t - 2.0) / 2.0) } else { 0.0 }
    };
    let whole = turning(10.0, rocking);
    let without = |from_s: f64, to_s: f64| -> Segments {
        let kept: Vec<Sample> =
            whole.iter().copied().filter(|s| !(from_s..to_s).contains(&s.time_s)).collect();
        Segments::find(&kept, &RestLimits::default())
    };
    // From the first rest right into the second: nobody knows what happened.
    let segments = without(1.5, 7.0);
    assert_eq!((segments.rests.len(), segments.movements.len()), (2, 1));
    assert_eq!(segments.movements[0].kind, MovementKind::Other);
    assert_eq!(without(3.5, 4.8).movements[0].kind, MovementKind::Other);
    // The rate before the pause did not go on in it: half a nod is no spin of 114 deg.
    assert_eq!(without(2.5, 6.5).movements[0].kind, MovementKind::Other);
    // Some lost samples are no pause.
    assert_eq!(without(3.5, 3.8).movements[0].kind, MovementKind::Rocking);
    assert_eq!(without(8.0, 8.5).rests.len(), 2);
}
