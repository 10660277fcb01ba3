//! Cost of one observer step of 1 ms.

#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::vector;
use otolith::vestibular::{
    HeadMotion, IdealObserver, NewmanObserver, ObserverParameters, OrientationObserver, PRESET_NAMES,
};

/// Head motion that changes every step, so that no branch is always the same.
fn motions() -> Vec<HeadMotion> {
    let wave = |i: i32, f: f64| libm::sin(f64::from(i) * f);
    (0..1000)
        .map(|i| HeadMotion {
            omega_head: vector![wave(i, 0.01), wave(i, 0.013), 3.0],
            gif_head: vector![wave(i, 0.02), 2.0 * wave(i, 0.017), -9.8 + wave(i, 0.03)],
        })
        .collect()
}

fn step_by_step<O: OrientationObserver>(criterion: &mut Criterion, name: &str, mut observer: O) {
    let motions = motions();
    let mut next = motions.iter().cycle();
    criterion.bench_function(name, |bencher| {
        bencher.iter(|| next.next().map(|motion| observer.step(black_box(motion), 1e-3)));
    });
}

fn observer_step(criterion: &mut Criterion) {
    for name in PRESET_NAMES.iter().take(2) {
        let parameters = ObserverParameters::preset(name).unwrap_or_default();
        let Ok(observer) = NewmanObserver::new(parameters) else { continue };
        step_by_step(criterion, &format!("observer/{name}"), observer);
    }
    let ideal = IdealObserver::new(vector![0.0, 0.0, -9.80665], &motions()[0]);
    step_by_step(criterion, "observer/ideal", ideal);
}

criterion_group!(benches, observer_step);
criterion_main!(benches);
