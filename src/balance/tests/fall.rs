//! When standing counts as over.

use super::super::{FallDetector, FallSettings};
use crate::units::RAD_PER_DEG;

const DT: f64 = 1e-3;

/// Ticks until the detector says so, of at most 1000; `sway_deg`, `height` and `residual` by tick.
fn ticks(observe: impl Fn(u32) -> (f64, f64, f64)) -> Option<u32> {
    let (settings, mut detector) = (FallSettings::default(), FallDetector::default());
    (0..1000).find(|k| {
        let (sway_deg, height, residual) = observe(*k);
        detector.fallen(&settings, sway_deg * RAD_PER_DEG, height, residual, DT)
    })
}

#[test]
fn a_sway_past_the_limit_counts_only_while_it_grows() {
    assert_eq!(ticks(|k| (9.0 + 1e-5 * f64::from(k), 0.9, 0.0)), None);
    assert_eq!(ticks(|_| (15.0, 0.9, 0.0)), None, "held, not growing");
    assert_eq!(ticks(|k| (20.0 - 0.01 * f64::from(k), 0.9, 0.0)), None, "recovering");
    // 50 ms of growth.
    assert!(ticks(|k| (10.0 + 0.01 * f64::from(k), 0.9, 0.0)).is_some_and(|k| (49..=51).contains(&k)));
}

#[test]
fn a_lost_support_counts_after_a_quarter_second() {
    assert!(ticks(|_| (0.0, 0.9, 21.0)).is_some_and(|k| (249..=251).contains(&k)));
    assert_eq!(ticks(|k| (0.0, 0.9, if k % 200 == 0 { 0.0 } else { 100.0 })), None, "interrupted");
}

#[test]
fn low_or_not_a_number_counts_at_once() {
    assert_eq!(ticks(|_| (0.0, 0.59, 0.0)), Some(0));
    for bad in [f64::NAN, f64::INFINITY] {
        assert_eq!(ticks(|_| (bad, 0.9, 0.0)), Some(0));
        assert_eq!(ticks(|_| (0.0, bad, 0.0)), Some(0));
        assert_eq!(ticks(|_| (0.0, 0.9, bad)), Some(0));
    }
}
