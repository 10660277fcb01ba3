//! Spins of known shape, with noise, and those of a real turntable.

use proptest::prelude::*;

use super::{input, noise, numbers, output, shared, upright};
use crate::report::spins::{Spin, YawRate};
use crate::report::{Analysis, Trace};
use crate::units::{RAD_PER_DEG, RAD_S_PER_RPM};

/// The mock chair's trapezoid: `ramp_s` up from `start_s`, steady, `ramp_s` down to `stop_s`.
fn trapezoid(time_s: f64, start_s: f64, stop_s: f64, ramp_s: f64, rate_rpm: f64) -> f64 {
    let up = (time_s - start_s) / ramp_s;
    let down = (stop_s - time_s) / ramp_s;
    up.min(down).clamp(0.0, 1.0) * rate_rpm * RAD_S_PER_RPM
}

/// The spins in `rate` sampled at 1 kHz for `length_s` with 0.002 rad/s of noise.
fn noisy_spins(length_s: f64, rate: impl Fn(f64) -> f64) -> Vec<Spin> {
    let mut seed = 7;
    let count = (length_s * 1e3) as u32;
    let samples = (0..count).map(|n| f64::from(n) * 1e-3);
    YawRate::new(samples.map(|t| (t, rate(t) + 0.002 * noise(&mut seed)))).spins()
}

fn assert_near(spin: &Spin, start_s: f64, stop_s: f64, rate_rpm: f64) {
    let stop = spin.stop_s.expect("the spin ends");
    assert!((spin.start_s - start_s).abs() < 0.03, "start {} instead of {start_s}", spin.start_s);
    assert!((stop - stop_s).abs() < 0.03, "stop {stop} instead of {stop_s}");
    assert!(
        (spin.rate_rpm - rate_rpm).abs() < 0.005 * rate_rpm.abs(),
        "{} rpm instead of {rate_rpm}",
        spin.rate_rpm
    );
}

#[test]
fn the_mock_chair_is_found_within_30_ms_at_every_speed() {
    for rate_rpm in [1.0, 3.6, 10.0, 20.0, -30.0, 60.0] {
        let spins = noisy_spins(30.0, |t| trapezoid(t, 2.0, 18.0, 1.0, rate_rpm));
        assert_eq!(spins.len(), 1, "{rate_rpm} rpm: {spins:?}");
        assert_near(&spins[0], 2.0, 18.0, rate_rpm);
    }
}

#[test]
fn a_reversal_is_two_spins_and_a_short_pause_none() {
    let reversed =
        noisy_spins(20.0, |t| trapezoid(t, 2.0, 8.0, 1.0, 30.0) + trapezoid(t, 8.0, 14.0, 1.0, -20.0));
    assert_eq!(reversed.len(), 2, "{reversed:?}");
    assert_near(&reversed[0], 2.0, 8.0, 30.0);
    assert_near(&reversed[1], 8.0, 14.0, -20.0);
    let paused = |pause_s: f64| {
        noisy_spins(20.0, |t| {
            trapezoid(t, 2.0, 6.0, 0.2, 30.0) + trapezoid(t, 6.0 + pause_s, 12.0, 0.2, 30.0)
        })
    };
    assert_eq!(paused(0.3).len(), 1);
    assert_eq!(paused(1.0).len(), 2);
}

#[test]
fn knocks_and_fidgeting_are_no_spins() {
    assert!(noisy_spins(10.0, |_| 0.0).is_empty());
    assert!(noisy_spins(10.0, |t| trapezoid(t, 4.0, 4.3, 0.05, 30.0)).is_empty(), "a knock of 0.3 s");
    assert!(noisy_spins(10.0, |t| trapezoid(t, 4.0, 7.0, 0.5, 0.5)).is_empty(), "7.5 deg in 3 s");
    assert!(YawRate::new(std::iter::empty()).spins().is_empty());
    assert!(YawRate::new(std::iter::once((0.0, 3.0))).spins().is_empty());
}

#[test]
fn a_stream_may_begin_and_end_while_the_chair_turns() {
    let spins = noisy_spins(10.0, |t| trapezoid(t, -5.0, 25.0, 1.0, 30.0));
    assert_eq!(spins.len(), 1);
    assert_eq!((spins[0].start_s, spins[0].stop_s), (0.0, None));
    assert!((spins[0].rate_rpm - 30.0).abs() < 0.01);
}

/// A turntable log of (t in s, gz in deg/s) columns 0 and 6, as ticks interpolated to 1 kHz.
fn turntable(file: &str) -> Option<Trace> {
    let rows = numbers(&shared(&format!("imu-logs/turntable/{file}"))?, 0);
    let mut trace = Trace::new();
    let mut next = 1;
    let last_tick = (rows[rows.len() - 1][0] * 1e3).floor() as u64;
    for tick in 0..=last_tick {
        let time_s = tick as f64 * 1e-3;
        while rows[next][0] < time_s {
            next += 1;
        }
        let (before, after) = (&rows[next - 1], &rows[next]);
        let share = (time_s - before[0]) / (after[0] - before[0]);
        let rate = (before[6] + share * (after[6] - before[6])) * RAD_PER_DEG;
        trace.push(&input(tick, Some(rate)), &output(tick, upright(), upright()));
    }
    Some(trace)
}

/// Facts from the log's provenance: moving from 2.07 to 17.03 s, plateau -21.40 deg/s, integral -322.2 deg.
#[test]
fn the_real_turntable_is_found_through_its_vibration() {
    let Some(trace) = turntable("roomba_circular_start_rotate_stop.txt") else { return };
    let chair = Analysis::new(&trace, None).chair;
    assert_eq!(chair.spins.len(), 1, "{chair:?}");
    assert!((chair.spins[0].start_s - 2.07).abs() < 0.05, "{chair:?}");
    assert!((chair.spins[0].stop_s.unwrap() - 17.03).abs() < 0.06, "{chair:?}");
    assert!((chair.spins[0].rate_rpm + 21.40 / 6.0).abs() < 0.05, "{chair:?}");
    assert!((chair.turned_deg + 322.2).abs() < 0.3, "{chair:?}");
    assert!((3.6..6.0).contains(&chair.peak_rate_rpm), "{chair:?}");
}

/// Facts from the log's provenance: moving from 2.07 s to the end, plateau -23.31 deg/s, integral -583.1 deg.
#[test]
fn the_real_log_that_ends_while_spinning_has_no_stop() {
    let Some(trace) = turntable("roomba_spin_23dps.txt") else { return };
    let analysis = Analysis::new(&trace, None);
    let chair = &analysis.chair;
    assert_eq!(chair.spins.len(), 1, "{chair:?}");
    assert!((chair.spins[0].start_s - 2.07).abs() < 0.05, "{chair:?}");
    assert_eq!(chair.spins[0].stop_s, None);
    assert!((chair.spins[0].rate_rpm + 23.31 / 6.0).abs() < 0.05, "{chair:?}");
    assert!((chair.turned_deg + 583.1).abs() < 0.5, "{chair:?}");
    assert_eq!(analysis.green.peak_com_sway_deg, None, "there is no time after the stop");
    assert!(analysis.green.peak_gravity_tilt_in_spin_deg.is_some());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_linear_ramp_is_extrapolated(
        rate_rpm in 5.0..60.0_f64, ramp_s in 0.2..4.0_f64, start_s in 0.5..3.0_f64, plateau_s in 2.0..6.0_f64,
    ) {
        let stop_s = start_s + 2.0 * ramp_s + plateau_s;
        let spins = noisy_spins(stop_s + 2.0, |t| trapezoid(t, start_s, stop_s, ramp_s, rate_rpm));
        prop_assert_eq!(spins.len(), 1);
        assert_near(&spins[0], start_s, stop_s, rate_rpm);
    }

    #[test]
    fn any_signal_gives_ordered_spins(rates in prop::collection::vec(-5.0..5.0_f64, 0..60)) {
        let at = |n: usize| (n as f64 * 0.1, rates[n]);
        let spins = YawRate::new((0..rates.len()).map(at)).spins();
        for spin in &spins {
            prop_assert!(spin.start_s >= 0.0 && spin.rate_rpm.is_finite());
            prop_assert!(spin.stop_s.is_none_or(|stop_s| stop_s > spin.start_s));
        }
        prop_assert!(spins.iter().rev().skip(1).all(|spin| spin.stop_s.is_some()));
    }
}
