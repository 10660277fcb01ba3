//! Path, ellipse, root mean square and recovery against closed forms, on made-up runs whose first 2 s do not count.

use std::f64::consts::{LN_2, PI, TAU};

use nalgebra::{Vector2, Vector3};

use super::{input, output, upright};
use crate::report::{Analysis, CharacterMetrics, Trace};
use crate::tick::{CharacterOutput, Posture};

/// A run at rest up to tick `last` in which green is what `character` says, `time_s` after the first 2 s.
fn green(last: u64, character: impl Fn(f64) -> CharacterOutput) -> CharacterMetrics {
    let mut trace = Trace::new();
    for tick in 0..=last {
        let time_s = (tick as f64 - 2000.0) * 1e-3;
        trace.push(&input(tick, Some(0.0)), &output(tick, character(time_s), upright()));
    }
    Analysis::new(&trace, None).green
}

#[track_caller]
fn near(value: Option<f64>, expected: f64, tolerance: f64) {
    let value = value.expect("the metric has a value");
    assert!((value - expected).abs() <= tolerance, "{value} instead of {expected}");
}

/// A point on a circle of `radius` around (0.02, -0.01), one round in 2 s.
fn on_circle(radius: f64, time_s: f64) -> Vector2<f64> {
    let (sin, cos) = libm::sincos(PI * time_s);
    Vector2::new(0.02 + radius * cos, -0.01 + radius * sin)
}

#[test]
fn circles_have_the_length_and_the_ellipse_of_circles() {
    let metrics = green(12_000, |time_s| {
        let com = on_circle(0.03, time_s);
        let com_platform = Vector3::new(com.x, com.y, 0.95);
        CharacterOutput { com_platform, cop_platform: Some(on_circle(0.01, time_s)), ..upright() }
    });
    // Five rounds in chords of 1/200 of a round.
    let chords = |radius: f64| 1000.0 * 2.0 * radius * libm::sin(PI / 200.0);
    assert!((chords(0.01) - 5.0 * TAU * 0.01).abs() < 1e-4);
    near(metrics.com_path_m, chords(0.03), 2e-6);
    near(metrics.cop_path_m, chords(0.01), 2e-6);
    // Covariance r²/2 in every direction; the first point comes once too often.
    let area = PI * 5.991_465 * 0.01 * 0.01 / 2.0;
    near(metrics.cop_ellipse_95_m2, area, 2e-3 * area);
}

#[test]
fn an_ellipse_is_as_large_as_its_axes_however_it_lies() {
    let along = |angle: f64| {
        green(12_000, |time_s| {
            let (sin, cos) = libm::sincos(PI * time_s);
            let (s, c) = libm::sincos(angle);
            let (long, short) = (0.02 * cos, 0.005 * sin);
            let cop = Vector2::new(c * long - s * short, s * long + c * short);
            CharacterOutput { cop_platform: Some(cop), ..upright() }
        })
    };
    let area = PI * 5.991_465 * 0.02 * 0.005 / 2.0;
    for angle in [0.0, 0.5, 1.3] {
        near(along(angle).cop_ellipse_95_m2, area, 2e-3 * area);
    }
    let to_and_fro = green(12_000, |time_s| {
        let cop = libm::sin(PI * time_s) * Vector2::new(0.01, 0.02);
        CharacterOutput { cop_platform: Some(cop), ..upright() }
    });
    near(to_and_fro.cop_ellipse_95_m2, 0.0, 1e-9);
}

#[test]
fn trembling_between_the_places_of_the_grid_is_no_path() {
    let metrics = green(4000, |time_s| {
        let tick = (time_s * 1e3).round() as i64;
        let x = if tick % 10 == 0 { 1e-3 * time_s } else { 0.01 };
        CharacterOutput { cop_platform: Some(Vector2::new(x, 0.0)), ..upright() }
    });
    near(metrics.cop_path_m, 2e-3, 2e-6);
    near(metrics.com_path_m, 0.0, 0.0);
}

#[test]
fn lost_ticks_and_thinned_rows_keep_the_path() {
    let straight =
        |time_s: f64| CharacterOutput { cop_platform: Some(Vector2::new(1e-3 * time_s, 0.0)), ..upright() };
    // Every tenth tick is lost; 4000 ticks in 1000 rows.
    let (mut lossy, mut thinned) = (Trace::new(), Trace::with_max_rows(1000));
    for tick in 0..=4000 {
        let output = output(tick, straight(tick as f64 * 1e-3), upright());
        if tick % 10 != 0 {
            lossy.push(&input(tick, Some(0.0)), &output);
        }
        thinned.push(&input(tick, Some(0.0)), &output);
    }
    for trace in [lossy, thinned] {
        near(Analysis::new(&trace, None).green.cop_path_m, 2e-3, 2e-5);
    }
}

#[test]
fn the_path_is_broken_where_there_is_no_centre_of_pressure() {
    let cop = |time_s: f64| match time_s {
        ..0.9995 => Some(Vector2::new(0.01 * time_s, 0.0)),
        ..1.9995 => None,
        _ => Some(Vector2::new(0.5, 0.01 * time_s)),
    };
    let metrics = green(5000, |time_s| CharacterOutput { cop_platform: cop(time_s), ..upright() });
    // 0 to 0.99 s and 2 to 3 s; not the jump.
    near(metrics.cop_path_m, 0.0099 + 0.01, 2e-6);
    let never = green(5000, |_| CharacterOutput { cop_platform: None, ..upright() });
    assert_eq!((never.cop_path_m, never.cop_ellipse_95_m2), (None, None));
    near(never.com_path_m, 0.0, 0.0);
}

#[test]
fn two_places_have_a_path_and_no_ellipse() {
    let metrics = green(2010, |_| upright());
    assert_eq!((metrics.cop_path_m, metrics.cop_ellipse_95_m2), (Some(0.0), None));
    let one = green(2009, |_| upright());
    assert_eq!((one.cop_path_m, one.com_path_m), (None, None));
}

#[test]
fn sway_has_the_root_mean_square_of_its_shape() {
    let swaying = |sway_deg: f64| CharacterOutput { com_sway: sway_deg.to_radians(), ..upright() };
    near(green(4000, |_| swaying(1.5)).rms_com_sway_deg, 1.5, 2e-6);
    let rectified = green(4000, |time_s| swaying(2.0 * libm::fabs(libm::sin(TAU * time_s))));
    near(rectified.rms_com_sway_deg, libm::sqrt(2.0), 1e-3);
}

#[test]
fn foot_tilt_is_told_in_degrees() {
    let metrics = green(4000, |time_s| {
        let foot_tilt = if time_s == 1.0 { 0.1 } else { 0.01 };
        CharacterOutput { foot_tilt, ..upright() }
    });
    near(metrics.peak_foot_tilt_deg, 5.729_578, 2e-6);
}

fn tilted(tilt_deg: f64) -> CharacterOutput {
    CharacterOutput { gravity_tilt: tilt_deg.to_radians(), ..upright() }
}

#[test]
fn recovery_is_when_the_tilt_falls_below_half_a_degree_for_good() {
    // Halves in every second: 4 deg are 0.5 deg after 3 s.
    let decaying = |time_s: f64| tilted(4.0 * libm::exp(-LN_2 * time_s));
    near(green(9000, decaying).recovery_s, 3.0, 1.1e-3);
    assert_eq!(green(4999, decaying).recovery_s, None, "above at the end");
    near(green(5002, decaying).recovery_s, 3.0, 1.1e-3);
    assert_eq!(green(9000, |_| tilted(0.49)).recovery_s, Some(0.0));
    let back = green(9000, |time_s| if time_s == 5.0 { tilted(0.6) } else { decaying(time_s) });
    assert_eq!(back.recovery_s, Some(5.001));
}

#[test]
fn who_fell_has_not_recovered() {
    let fallen = |com_x| {
        let com_platform = Vector3::new(com_x, 0.0, 0.1);
        CharacterOutput { posture: Posture::Fallen, com_platform, ..tilted(9.0) }
    };
    let fall = |stood_up_s: f64| {
        green(9000, |time_s| match time_s {
            ..1.0 => tilted(1.0),
            1.0 => fallen(0.0),
            time_s if time_s < stood_up_s => fallen(0.7),
            _ => tilted(0.1),
        })
    };
    assert_eq!(fall(99.0).recovery_s, None);
    assert_eq!(fall(3.0).recovery_s, None, "stood up again");
    near(fall(3.0).com_path_m, 0.0, 1e-9);
}
