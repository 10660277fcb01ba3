//! Our half of the comparison with other engines: times the whole tick of one character, sensors to body, through a
//! spin, then the parts of it on the same states, and writes its motion for the other engines.
//!
//! Usage: `peers DIR`. Prints lines `ours PHASE PART min median p99`, microseconds; writes `DIR/PHASE.f64`, one row of
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

mod parts;
use parts::Moment;

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
    let standing = standing_pose(&model, &PoseSettings::default()).unwrap();
    let settings = Arc::new(CoreSettings::default());
    let observer = NewmanObserver::new(settings.observer).unwrap();
    let mut figure = Figure::new(Vestibular::Trusted, settings, model.clone(), standing, observer);
    let mut turntable = Turntable::turning(TurntableSettings::default(), 0.0);

    let mut phases: Vec<Vec<Moment>> = PHASES.iter().map(|_| Vec::new()).collect();
    let mut times: Vec<Vec<f64>> = PHASES.iter().map(|_| Vec::new()).collect();
    for k in 0..PHASES[PHASES.len() - 1].2 {
        let phase = PHASES.iter().position(|(_, from, to)| (*from..*to).contains(&k));
        let chair = chair(k);
        let platform = turntable.follow(Some(chair.omega_head.z), TICK_S);
        let state = *figure.state();
        let started = Instant::now();
        let residual = ChairResidual::of(Some(&chair), &platform, &gravity);
        let output = std::hint::black_box(figure.step(&platform, &residual, None));
        let elapsed = parts::microseconds(started);
        if let Some(phase) = phase {
            times[phase].push(elapsed);
            phases[phase].push(Moment { state, platform, gravity_platform: output.gravity_platform });
        }
        turntable.advance(&platform, TICK_S);
    }
    for (((name, ..), moments), times) in PHASES.iter().zip(&phases).zip(times) {
        parts::print(name, "tick", times);
        parts::time(name, &model, standing, moments);
        write(&format!("{folder}/{name}.f64"), moments);
    }
}

fn write(path: &str, moments: &[Moment]) {
    let mut bytes = Vec::new();
    for Moment { state, platform, .. } in moments {
        let configuration = std::iter::once(platform.angle).chain(state.qpos());
        let velocity = std::iter::once(platform.rate).chain(state.velocity.iter().copied());
        bytes.extend(configuration.chain(velocity).flat_map(f64::to_le_bytes));
    }
    std::fs::File::create(path).unwrap().write_all(&bytes).unwrap();
}
