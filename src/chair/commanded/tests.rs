//! Chairs that do, and do not do, what they were told.

use nalgebra::Vector3;

use super::{CommandedProfile, ProfileError, ProfileReport};
use crate::chair::{ChairReport, ChairSettings, Commanded, survey_chair};
use crate::device::Noise;
use crate::imu::RestLimits;
use crate::survey::Sample;
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};

/// A staircase to the left and back, a rest, and a spin to the right.
const POINTS: [(f64, f64); 10] = [
    (1.0, 0.0),
    (2.0, 60.0),
    (10.0, 60.0),
    (10.5, 90.0),
    (20.0, 90.0),
    (21.0, 0.0),
    (25.0, 0.0),
    (26.0, -45.0),
    (36.0, -45.0),
    (37.0, 0.0),
];
/// Time of the log at the profile's zero, s.
const START_S: f64 = 4.0;
const DELAY_S: f64 = 0.15;
const GAIN: f64 = 0.98;

/// A chair that turns with `GAIN`, late by `DELAY_S`, past each step by 10 % for a while, and with a ripple of 1 deg/s.
fn samples(profile: &CommandedProfile) -> Vec<Sample> {
    let mut noise = Noise::new(3);
    let sample = |index: usize| {
        let time_s = 0.005 * index as f64;
        let told_s = time_s - START_S - DELAY_S;
        let told = profile.rate(told_s);
        let past: f64 = profile
            .levels()
            .iter()
            .map(|level| (told_s - level.start_s, level))
            .filter(|(late_s, _)| *late_s > 0.0)
            .map(|(late_s, level)| {
                let x = late_s / 0.25;
                0.1 * (level.rate - level.before) * x * libm::exp(1.0 - x)
            })
            .sum();
        let ripple = if told == 0.0 { 0.0 } else { libm::sin(core::f64::consts::TAU * 5.0 * time_s) };
        let rate = (GAIN * told + past + ripple) * RAD_PER_DEG;
        Sample {
            time_s,
            omega_imu: Vector3::new(0.01, 0.02, rate - 0.01) + Vector3::from_fn(|_, _| 1e-3 * noise.normal()),
            specific_force_imu: Some(Vector3::new(0.0, 0.0, STANDARD_GRAVITY)),
            clipped: false,
        }
    };
    (0..9200).map(sample).collect()
}

fn report(samples: &[Sample], profile: &CommandedProfile) -> ChairReport {
    let settings = ChairSettings {
        gravity: STANDARD_GRAVITY,
        commanded: Commanded::default(),
        profile: Some(profile.clone()),
        rest: RestLimits::default(),
    };
    survey_chair(samples, &settings)
}

fn profile(start_s: Option<f64>) -> CommandedProfile {
    CommandedProfile::new(POINTS.to_vec(), start_s).unwrap()
}

#[track_caller]
fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found}, expected {expected} +- {tolerance}");
}

fn check(found: &ProfileReport, delay_s: f64) {
    let told: Vec<f64> = found.plateaus.iter().map(|plateau| plateau.commanded_deg_s).collect();
    assert_eq!(told, [60.0, 90.0, -45.0]);
    for (plateau, step) in found.plateaus.iter().zip([60.0_f64, 30.0, -45.0]) {
        near(plateau.executed_deg_s.value, GAIN * plateau.commanded_deg_s, 0.1);
        near(plateau.error.error, (GAIN - 1.0) * plateau.commanded_deg_s, 0.1);
        near(plateau.error.error_percent * plateau.commanded_deg_s.signum(), -2.0, 0.2);
        // Of the executed ramp, a little less high, the half commanded height is reached a little later.
        near(plateau.delay_s.unwrap(), delay_s, 0.05);
        near(plateau.overshoot_percent, 10.0, 2.0);
        near(plateau.overshoot_deg_s, 0.1 * step.abs(), 0.02 * step.abs());
        near(plateau.ripple_rms_deg_s, 0.5_f64.sqrt(), 0.05);
    }
}

#[test]
fn plateaus_are_held_against_the_profile_with_their_delay() {
    let given = profile(Some(START_S));
    let report = report(&samples(&given), &given);
    let found = report.profile.as_ref().unwrap();
    assert!(found.start_given);
    check(found, DELAY_S);
    assert_eq!(report.notes, [""; 0]);
    let text = report.to_string();
    for part in ["commanded profile", "4.00, as given", "-45.000", "2 spins"] {
        assert!(text.contains(part), "{part} is missing in\n{text}");
    }
}

#[test]
fn without_a_start_the_best_fit_takes_the_common_delay() {
    let found = report(&samples(&profile(None)), &profile(None)).profile.unwrap();
    assert!(!found.start_given);
    near(found.start_s, START_S + DELAY_S, 0.05);
    check(&found, 0.0);
    // Wherever the profile's own clock began.
    let later: Vec<(f64, f64)> = POINTS.iter().map(|(time_s, rate)| (time_s + 1e4, *rate)).collect();
    let later = CommandedProfile::new(later, None).unwrap();
    near(report(&samples(&profile(None)), &later).profile.unwrap().start_s, found.start_s - 1e4, 0.011);
}

#[test]
fn without_an_accelerometer_the_sense_that_fits_is_taken() {
    let down: Vec<Sample> = samples(&profile(None))
        .iter()
        .map(|s| Sample { specific_force_imu: None, omega_imu: -s.omega_imu, ..*s })
        .collect();
    check(&report(&down, &profile(None)).profile.unwrap(), 0.0);
}

#[test]
fn another_profile_and_one_that_is_not_in_the_log_are_said() {
    let run = samples(&profile(None));
    let other = CommandedProfile::new(vec![(0.0, -120.0), (15.0, -120.0)], Some(START_S)).unwrap();
    let found = report(&run, &other);
    assert!(
        found.profile.is_some() && found.notes[0].contains("is it the profile of these data"),
        "{:?}",
        found.notes
    );
    let elsewhere = report(&run, &profile(Some(500.0)));
    assert!(elsewhere.profile.is_none());
    assert!(
        elsewhere.cannot_tell.iter().any(|what| what.contains("as commanded")),
        "{:?}",
        elsewhere.cannot_tell
    );
}

#[test]
fn steps_and_sampled_ramps_are_profiles_and_other_lists_are_none() {
    let step =
        CommandedProfile::new(vec![(0.0, 0.0), (2.0, 0.0), (2.0, 30.0), (5.0, 30.0), (5.0, 0.0)], None)
            .unwrap();
    assert_eq!((step.rate(1.9), step.rate(2.0), step.rate(4.9), step.rate(5.0)), (0.0, 30.0, 30.0, 0.0));
    let levels = step.levels();
    assert_eq!((levels.len(), levels[0].half_way_s, levels[0].before), (1, 2.0, 0.0));
    // The same as a controller's log of every 10 ms.
    let fine: Vec<(f64, f64)> =
        (0..4000).map(|k| 0.01 * f64::from(k)).map(|t| (t, profile(None).rate(t))).collect();
    let fine = CommandedProfile::new(fine, None).unwrap();
    for (fine, coarse) in fine.levels().iter().zip(profile(None).levels()) {
        near(fine.half_way_s, coarse.half_way_s, 0.011);
        near(fine.before, coarse.before, 1.0);
        near(fine.end_s - fine.start_s, coarse.end_s - coarse.start_s, 0.03);
    }
    assert_eq!(fine.levels().len(), 3);
    let error = |points: &[(f64, f64)]| CommandedProfile::new(points.to_vec(), None).unwrap_err();
    assert_eq!(error(&[]), ProfileError::NoPlateau);
    assert_eq!(error(&[(0.0, 0.0), (9.0, 60.0)]), ProfileError::NoPlateau);
    assert_eq!(error(&[(0.0, 1.0), (-1.0, 1.0)]), ProfileError::GoesBack(1));
    // A minute written down in milliseconds.
    assert_eq!(error(&[(0.0, 1.0), (60_000.0, 1.0)]), ProfileError::TooLong(60_000.0));
    assert_eq!(error(&[(0.0, 1.0), (f64::NAN, 1.0)]), ProfileError::NotFinite(1));
}
