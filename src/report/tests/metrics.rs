//! Metrics against the golden balance series, and their windows and gaps on made-up runs.

use nalgebra::{Vector2, Vector3};

use super::{golden, input, output, upright};
use crate::report::spins::Spin;
use crate::report::{Analysis, Trace, Window, Windows};
use crate::tick::{CharacterOutput, Posture};
use crate::time::Tick;

fn near(value: Option<f64>, expected: f64, tolerance: f64) {
    let value = value.expect("the metric has a value");
    assert!((value - expected).abs() <= tolerance, "{value} instead of {expected}");
}

/// Peaks from the table in `golden/balance/README.md`, ranges from section 4 of `spec/balance.md`.
#[test]
fn golden_30_rpm_15_s() {
    let Some(trace) = golden("A_g30_15", "A_blue30_15") else { return };
    let Analysis { chair, green, blue, verdict, .. } = Analysis::new(&trace, None);
    assert_eq!(chair.spins.len(), 1);
    near(Some(chair.spins[0].start_s), 2.0, 0.03);
    near(chair.spins[0].stop_s, 18.0, 0.03);
    near(Some(chair.peak_rate_rpm), 30.0, 1e-3);
    near(Some(chair.turned_deg), 15.0 * 180.0, 1.0);
    near(green.peak_gravity_tilt_deg, 4.31, 0.005);
    near(green.peak_com_sway_deg, 6.03, 0.005);
    near(green.peak_gravity_tilt_in_spin_deg, 1.67, 0.005);
    near(green.com_range_after_stop_m.map(|range| range[0]), 0.0625, 1e-4);
    near(green.com_range_after_stop_m.map(|range| range[1]), 0.0838, 1e-4);
    near(green.cop_within_5mm_after_stop, 0.0, 0.0);
    near(green.omega_hat_at_stop_rad_s, -1.2426, 1e-4);
    near(blue.peak_gravity_tilt_deg, 0.763, 0.005);
    near(blue.peak_com_sway_deg, 0.090, 0.005);
    near(blue.cop_within_5mm_after_stop, 1.0, 0.0);
    assert_eq!((green.fell_at_s, blue.fell_at_s), (None, None));
    assert_eq!(verdict, "green swayed up to 6.0 deg and steadied; blue stayed balanced");
}

#[test]
fn golden_order_of_speeds_durations_and_time_constants() {
    let peaks = [
        ("A_g10_15", 0.14, 0.28),
        ("A_g20_15", 0.81, 1.36),
        ("A_g30_10", 2.38, 3.51),
        ("A_td5.7", 5.20, 7.14),
        ("A_td11.4", 3.15, 4.47),
    ];
    for (run, tilt_deg, sway_deg) in peaks {
        let Some(trace) = golden(run, run) else { return };
        let green = Analysis::new(&trace, None).green;
        near(green.peak_gravity_tilt_deg, tilt_deg, 0.006);
        near(green.peak_com_sway_deg, sway_deg, 0.006);
    }
}

#[test]
fn golden_pushes_count_from_the_end_of_the_push() {
    let peaks =
        [("A_bluepush", None, 0.33), ("A_greenpush", Some(0.45), 0.51), ("A_greenpushy", Some(0.33), 0.48)];
    for (run, tilt_deg, sway_deg) in peaks {
        let Some(trace) = golden(run, run) else { return };
        let analysis = Analysis::new(&trace, Some(2.1));
        assert_eq!(analysis.windows.after_stop.map(|window| window.start_s), Some(2.1));
        near(analysis.green.peak_com_sway_deg, sway_deg, 0.006);
        if let Some(tilt_deg) = tilt_deg {
            near(analysis.green.peak_gravity_tilt_deg, tilt_deg, 0.006);
        }
        assert_eq!(analysis.green.peak_gravity_tilt_in_spin_deg, None);
        assert_eq!(analysis.green.omega_hat_at_stop_rad_s, None);
    }
}

#[test]
fn windows_follow_the_last_stop_and_the_push() {
    let spin = |start_s, stop_s| Spin { start_s, stop_s, rate_rpm: 30.0 };
    let after = |spins: &[Spin], push| Windows::new(spins, push, Some((0.0, 40.0))).after_stop;
    let to_the_end = |start_s| Some(Window { start_s, end_s: 40.0 });
    let (first, second) = (spin(2.0, Some(8.0)), spin(10.0, Some(18.0)));
    assert_eq!(after(&[first, second], None), to_the_end(18.0));
    assert_eq!(after(&[first, second], Some(20.0)), to_the_end(20.0));
    assert_eq!(after(&[first, second], Some(1.0)), to_the_end(18.0));
    assert_eq!(after(&[], Some(2.1)), to_the_end(2.1));
    assert_eq!(after(&[], None), to_the_end(2.0));
    assert_eq!(after(&[first, spin(10.0, None)], None), None, "the last spin still turns");
    assert_eq!(after(&[], Some(41.0)), None, "the run ended before the push did");
    let windows = Windows::new(&[first, spin(10.0, None)], None, Some((0.0, 40.0)));
    let in_spin = [Window { start_s: 2.0, end_s: 8.0 }, Window { start_s: 10.0, end_s: 40.0 }];
    assert_eq!(windows.in_spin, in_spin);
    assert_eq!(Windows::new(&[], None, None), Windows::default());
}

/// A run at rest in which `character` says what green does; blue stands.
fn at_rest(seconds: u64, character: impl Fn(u64) -> CharacterOutput) -> Trace {
    let mut trace = Trace::new();
    for tick in 0..=seconds * 1000 {
        trace.push(&input(tick, Some(0.0)), &output(tick, character(tick), upright()));
    }
    trace
}

fn swaying(sway_deg: f64) -> CharacterOutput {
    CharacterOutput { com_sway: sway_deg.to_radians(), ..upright() }
}

#[test]
fn without_spin_or_push_the_first_two_seconds_do_not_count() {
    let trace = at_rest(5, |tick| swaying(if tick < 2000 { 0.6 } else { 0.05 }));
    let green = Analysis::new(&trace, None).green;
    near(green.peak_com_sway_deg, 0.05, 1e-6);
    near(green.cop_within_5mm_after_stop, 1.0, 0.0);
    assert_eq!(green.peak_gravity_tilt_in_spin_deg, None);
    let short = Analysis::new(&at_rest(1, |_| upright()), None);
    assert_eq!(short.green.peak_com_sway_deg, None);
    assert_eq!(short.green.com_range_after_stop_m, None);
    assert_eq!(short.verdict, "green and blue stood");
}

#[test]
fn ticks_without_a_centre_of_pressure_are_outside() {
    let trace = at_rest(6, |tick| {
        let cop_platform = match tick {
            0..3000 => Some(Vector2::zeros()),
            3000..4000 => Some(Vector2::new(0.003, 0.0039)),
            4000..5000 => Some(Vector2::new(0.003, 0.0041)),
            _ => None,
        };
        CharacterOutput { cop_platform, ..upright() }
    });
    near(Analysis::new(&trace, None).green.cop_within_5mm_after_stop, 2000.0 / 4001.0, 1e-6);
}

#[test]
fn peaks_go_up_to_the_fall_and_the_fall_is_told() {
    let trace = at_rest(10, |tick| match tick {
        0..6500 => swaying(1.0),
        6500 => CharacterOutput { posture: Posture::Fallen, ..swaying(12.0) },
        _ => CharacterOutput {
            posture: Posture::Fallen,
            com_platform: Vector3::new(0.7, 0.0, 0.1),
            ..swaying(80.0)
        },
    });
    let analysis = Analysis::new(&trace, None);
    assert_eq!(analysis.green.fell_at_s, Some(6.5));
    near(analysis.green.peak_com_sway_deg, 12.0, 1e-5);
    assert_eq!(analysis.green.com_range_after_stop_m, Some([0.0, 0.0]));
    near(analysis.green.cop_within_5mm_after_stop, 4501.0 / 8001.0, 1e-6);
    assert_eq!(analysis.verdict, "green fell at 6.5 s; blue stayed balanced");
    let pushed = Analysis::new(&trace, Some(2.1));
    assert_eq!(pushed.verdict, "green fell 4.4 s after the push; blue stayed balanced");
}

#[test]
fn a_character_stood_up_again_counts_after_it_settled() {
    let mut trace = Trace::new();
    for tick in 0..=9000 {
        let (posture, sway_deg) = match tick {
            0..3000 => (Posture::Standing, 0.1),
            3000..4000 => (Posture::Fallen, 70.0),
            4000..5000 => (Posture::Standing, 0.6),
            _ => (Posture::Standing, 0.2),
        };
        // It stands up by itself: nothing in the input says so.
        let input = input(tick, Some(0.0));
        let green = CharacterOutput { posture, ..swaying(if tick == 3000 { 0.4 } else { sway_deg }) };
        trace.push(&input, &output(tick, green, upright()));
    }
    let green = Analysis::new(&trace, None).green;
    assert_eq!(green.fell_at_s, Some(3.0));
    near(green.peak_com_sway_deg, 0.4, 1e-6);
}

#[test]
fn a_long_run_keeps_every_second_tick_and_all_of_the_turn() {
    let mut trace = Trace::with_max_rows(1000);
    for tick in 0..10_000 {
        let mut green = swaying(1.0);
        green.posture = if tick == 7777 { Posture::Fallen } else { Posture::Standing };
        trace.push(&input(tick, Some(1.0)), &output(tick, green, upright()));
    }
    assert!(trace.rows().len() <= 1000);
    assert!(trace.rows().windows(2).all(|pair| pair[1].tick.0 - pair[0].tick.0 == 16), "an even grid");
    assert!((trace.turned() - 9.999).abs() < 1e-9);
    assert_eq!(trace.fell_at(crate::report::Character::Green), Some(Tick(7777)));
    assert_eq!(trace.span_s(), Some((0.0, 9.999)));
}

#[test]
fn a_lost_measurement_turns_nothing() {
    let mut trace = Trace::new();
    for tick in 0..3000 {
        let rate = (!(1000..2000).contains(&tick)).then_some(1.0);
        trace.push(&input(tick, rate), &output(tick, upright(), upright()));
    }
    assert!((trace.turned() - (0.999 + 0.999)).abs() < 1e-9);
}

#[test]
fn an_empty_trace_has_no_metrics() {
    let analysis = Analysis::new(&Trace::new(), None);
    assert_eq!(analysis.green.peak_com_sway_deg, None);
    assert_eq!(analysis.chair.spins, []);
    assert_eq!(analysis.chair.turned_deg, 0.0);
}
