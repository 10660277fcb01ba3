//! Our half of the comparison with other engines: times the whole tick of one character, sensors to body, through a
//! spin, and writes its motion for the other engine to follow.
//!
//! Usage: `peers DIR`. Prints one line per phase: `phase min_us median_us p99_us`; writes `DIR/PHASE.f64`, one row of
//! little-endian doubles per tick: platform angle, 42 configuration numbers, platform rate, 41 velocities.

#![allow(missing_docs, clippy::unwrap_used)] // a benchmark may stop on bad input
#![allow(clippy::disallowed_methods)] // it times single ticks, below the resolution of the run's clock

use std::io::Write;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Vector3;
use otolith::character::CharacterModel;
use otolith::dynamics::{PoseSettings, standing_pose};
use otolith::hil::{ChairResidual, Turntable, TurntableSettings};
use otolith::runtime::{CoreSettings, Figure, Vestibular};
use otolith::time::TICK_S;
use otolith::units::RAD_S_PER_RPM;
use otolith::vestibular::{HeadMotion, NewmanObserver};

/// Name, first and last tick of each phase of the default spin.
const PHASES: [(&str, u64, u64); 3] =
    [("standing", 0, 2_000), ("spinning", 10_000, 12_000), ("swaying", 20_000, 22_000)];

/// 30 rpm from 2 s to 17 s with ramps of 1 s.
fn chair(k: u64) -> HeadMotion {
    let t = k as f64 * TICK_S;
    let share = (t - 2.0).clamp(0.0, 1.0) - (t - 17.0).clamp(0.0, 1.0);
    let omega_head = Vector3::new(0.0, 0.0, 30.0 * RAD_S_PER_RPM * share);
    HeadMotion { omega_head, gif_head: Vector3::new(0.0, 0.0, -9.81) }
}

fn main() {
    // `cargo bench` adds `--bench`; without a folder there is nothing to do.
    let Some(folder) = std::env::args().skip(1).find(|argument| !argument.starts_with('-')) else { return };
    let model = Arc::new(CharacterModel::standing().unwrap());
    let gravity = model.gravity;
    let state = standing_pose(&model, &PoseSettings::default()).unwrap();
    let settings = Arc::new(CoreSettings::default());
    let observer = NewmanObserver::new(settings.observer).unwrap();
    let mut figure = Figure::new(Vestibular::Trusted, settings, model, state, observer);
    let mut turntable = Turntable::turning(TurntableSettings::default(), 0.0);

    let mut times = Vec::new();
    let mut rows = Vec::new();
    for k in 0..PHASES[PHASES.len() - 1].2 {
        let phase = PHASES.iter().find(|(_, from, to)| (*from..*to).contains(&k));
        let chair = chair(k);
        let platform = turntable.follow(Some(chair.omega_head.z), TICK_S);
        if phase.is_some() {
            let state = figure.state();
            rows.push(platform.angle);
            rows.extend(state.qpos());
            rows.push(platform.rate);
            rows.extend(state.velocity.iter());
        }
        let started = Instant::now();
        let residual = ChairResidual::of(Some(&chair), &platform, &gravity);
        std::hint::black_box(figure.step(&platform, &residual, None));
        if phase.is_some() {
            times.push(started.elapsed().as_nanos() as f64 * 1e-3);
        }
        turntable.advance(&platform, TICK_S);
        if let Some((name, ..)) = phase.filter(|(_, _, to)| k + 1 == *to) {
            times.sort_unstable_by(f64::total_cmp);
            let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
            println!("{name} {:.2} {:.2} {:.2}", at(0.0), at(0.5), at(0.99));
            times.clear();
            let bytes: Vec<u8> = rows.drain(..).flat_map(f64::to_le_bytes).collect();
            std::fs::File::create(format!("{folder}/{name}.f64")).unwrap().write_all(&bytes).unwrap();
        }
    }
}
