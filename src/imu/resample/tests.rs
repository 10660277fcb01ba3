use nalgebra::Vector3;
use proptest::prelude::*;

use super::*;

fn sample(ms: f64, rate: f64) -> HeadSample {
    HeadSample {
        at: HostTime::from_secs_f64(ms * 1e-3),
        motion: HeadMotion {
            omega_head: Vector3::new(0.0, 0.0, rate),
            gif_head: Vector3::new(0.0, 0.0, -9.81),
        },
    }
}

fn rate_at(resampler: &mut Resampler, ms: f64) -> (Option<f64>, LinkHealth) {
    let (motion, health) = resampler.at(HostTime::from_secs_f64(ms * 1e-3));
    (motion.map(|motion| motion.omega_head.z), health)
}

proptest! {
    /// A signal linear in time is reproduced whatever the sample times.
    #[test]
    fn a_ramp_stays_a_ramp(steps in prop::collection::vec(0.1..40.0_f64, 2..200)) {
        let mut resampler = Resampler::new(0.05);
        let mut ms = 0.0;
        resampler.push(sample(ms, 0.0));
        for step in steps {
            ms += step;
            resampler.push(sample(ms, 0.1 * ms));
        }
        for tick in 0..ms as u64 {
            let (rate, health) = rate_at(&mut resampler, tick as f64);
            // Sample times are rounded to 1 ns.
            prop_assert!((rate.unwrap() - 0.1 * tick as f64).abs() < 1e-6);
            prop_assert_eq!(health, LinkHealth::Live);
        }
    }
}

#[test]
fn the_newest_sample_is_held_then_stale_then_lost_then_live_again() {
    let mut resampler = Resampler::new(0.05);
    assert_eq!(rate_at(&mut resampler, 0.0), (None, LinkHealth::Waiting));
    resampler.push(sample(10.0, 1.0));
    assert_eq!(rate_at(&mut resampler, 9.0), (None, LinkHealth::Waiting));
    resampler.push(sample(20.0, 2.0));
    assert_eq!(rate_at(&mut resampler, 10.0), (Some(1.0), LinkHealth::Live));
    assert_eq!(rate_at(&mut resampler, 20.0), (Some(2.0), LinkHealth::Live));
    assert_eq!(rate_at(&mut resampler, 45.0), (Some(2.0), LinkHealth::Live));
    assert_eq!(rate_at(&mut resampler, 46.0), (Some(2.0), LinkHealth::Stale));
    assert_eq!(rate_at(&mut resampler, 70.0), (Some(2.0), LinkHealth::Stale));
    assert_eq!(rate_at(&mut resampler, 71.0), (None, LinkHealth::Lost));
    resampler.push(sample(200.0, 3.0));
    assert_eq!(rate_at(&mut resampler, 199.0), (None, LinkHealth::Lost));
    assert_eq!(rate_at(&mut resampler, 200.0), (Some(3.0), LinkHealth::Live));
    let counters = resampler.counters();
    assert_eq!((counters.stale_episodes, counters.lost_episodes, counters.gaps), (1, 1, 1));
}

#[test]
fn a_gap_known_in_advance_is_treated_like_one_lived_through() {
    let (mut live, mut replayed) = (Resampler::new(0.05), Resampler::new(0.05));
    let times = (0..20).map(|k| 5.0 * f64::from(k)).chain((0..20).map(|k| 261.3 + 5.0 * f64::from(k)));
    let samples: Vec<_> = times.map(|ms| sample(ms, ms)).collect();
    samples.iter().for_each(|&sample| replayed.push(sample));
    let mut pending = samples.iter();
    let mut next = pending.next();
    for tick in 95..262 {
        while let Some(arrived) = next.filter(|sample| sample.at <= HostTime(tick * 1_000_000)) {
            live.push(*arrived);
            next = pending.next();
        }
        assert_eq!(rate_at(&mut live, tick as f64), rate_at(&mut replayed, tick as f64), "tick {tick}");
    }
    assert_eq!(replayed.counters().gaps, 1);
    assert_eq!(live.counters().lost_episodes, 1);
}

#[test]
fn a_slow_sensor_is_not_lost_between_its_samples() {
    let mut resampler = Resampler::new(0.05);
    (0..10).for_each(|k| resampler.push(sample(100.0 * f64::from(k), f64::from(k))));
    assert_eq!(rate_at(&mut resampler, 850.0), (Some(8.5), LinkHealth::Live));
    assert_eq!(rate_at(&mut resampler, 1040.0), (Some(9.0), LinkHealth::Live));
    assert_eq!(rate_at(&mut resampler, 1150.0), (Some(9.0), LinkHealth::Stale));
    assert_eq!(rate_at(&mut resampler, 1201.0), (None, LinkHealth::Lost));
    assert_eq!(resampler.counters().gaps, 0);
}

#[test]
fn disorder_and_overflow_are_counted() {
    let mut resampler = Resampler::new(0.05);
    resampler.push(sample(10.0, 1.0));
    resampler.push(sample(10.0, 9.0));
    resampler.push(sample(5.0, 9.0));
    assert_eq!(resampler.counters().out_of_order, 2);
    for k in 0..RESAMPLE_CAPACITY as u32 + 5 {
        resampler.push(sample(11.0 + f64::from(k), f64::from(k)));
    }
    assert_eq!(resampler.counters().dropped, 6);
    assert_eq!(resampler.samples.len(), RESAMPLE_CAPACITY);
    assert_eq!(rate_at(&mut resampler, 12.0), (Some(5.0), LinkHealth::Live), "the oldest there is");
}
