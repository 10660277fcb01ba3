//! Cost of a tick of 1 ms and of its parts: physics step, controller, one whole character, green and blue together.

#![allow(missing_docs, clippy::unwrap_used)] // a benchmark may stop on bad input

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;
use otolith::balance::{BalanceController, BalanceSettings, MomentumController, perceive};
use otolith::character::{CharacterModel, CharacterState};
use otolith::dynamics::{
    ContactSettings, Dynamics, Engine, GroundSurface, MotorSet, PoseSettings, Simulator, StepInput,
    standing_pose,
};
use otolith::hil::ChairResidual;
use otolith::imu::LinkHealth;
use otolith::runtime::{Core, CoreSettings, Figure, Vestibular};
use otolith::tick::{PlatformMotion, TickInput};
use otolith::time::{TICK_S, Tick};
use otolith::units::RAD_S_PER_RPM;
use otolith::vestibular::{HeadMotion, NewmanObserver};

/// The default spin: 2 s of rest, 15 s at 30 rpm from ramp to ramp of 1 s.
fn chair(tick: Tick) -> HeadMotion {
    let t = tick.time_s();
    let share = (t - 2.0).clamp(0.0, 1.0) - (t - 17.0).clamp(0.0, 1.0);
    let omega_head = Vector3::new(0.0, 0.0, 30.0 * RAD_S_PER_RPM * share);
    HeadMotion { omega_head, gif_head: Vector3::new(0.0, 0.0, -9.81) }
}

/// First tick of the worst sway after the stop.
const SWAYING_FROM: u64 = 20_000;

fn standing() -> (Arc<CharacterModel>, CharacterState) {
    let model = Arc::new(CharacterModel::standing().unwrap());
    let state = standing_pose(&model, &PoseSettings::default()).unwrap();
    (model, state)
}

/// A body that the controller keeps standing, and the input of its next step.
fn controlled(ticks: usize) -> (Engine, MomentumController, StepInput) {
    let (model, state) = standing();
    let mut engine = Engine::new(model, ContactSettings::default(), state);
    let mut controller = MomentumController::new(BalanceSettings::default(), &engine);
    let ground = GroundSurface::level(1.0);
    let mut input = StepInput { motors: MotorSet::limp(1.0), wrench: None, ground, dt_s: TICK_S };
    for _ in 0..ticks {
        let perceived = perceive(&engine, &ground, &engine.model().gravity);
        let control = controller.control(&engine, &ground, &perceived);
        input.motors = MotorSet::torques(control.torques, 200.0);
        engine.step(&input);
    }
    (engine, controller, input)
}

fn parts(criterion: &mut Criterion) {
    let (mut engine, mut controller, input) = controlled(1000);
    let snapshot = engine.snapshot();
    // Held torques would let it fall: every step starts again from the same standing state (a copy of 0.7 kB).
    criterion.bench_function("physics step, 8 contacts", |bencher| {
        let mut steps = 0;
        bencher.iter(|| {
            steps += 1;
            if steps % 100 == 0 {
                engine.restore(&snapshot);
            }
            engine.step(black_box(&input)).load()
        });
    });
    engine.restore(&snapshot);
    let gravity = engine.model().gravity;
    criterion.bench_function("controller solve", |bencher| {
        bencher.iter(|| {
            let perceived = perceive(&engine, &input.ground, black_box(&gravity));
            controller.control(&engine, &input.ground, &perceived)
        });
    });
}

fn one_character(criterion: &mut Criterion) {
    let (model, state) = standing();
    let settings = Arc::new(CoreSettings::default());
    let observer = NewmanObserver::new(settings.observer).unwrap();
    let mut figure = Figure::new(Vestibular::Trusted, settings, model, state, observer);
    let (platform, residual) = (PlatformMotion::default(), ChairResidual::default());
    criterion.bench_function("whole tick, one character standing", |bencher| {
        bencher.iter(|| figure.step(black_box(&platform), black_box(&residual), None));
    });
}

/// A core that has run the default spin up to `tick`.
fn core_at(tick: u64) -> Core {
    let mut core = Core::new(CoreSettings::default(), CharacterModel::standing().unwrap()).unwrap();
    (0..tick).for_each(|k| {
        core.step(&input(k));
    });
    core
}

fn input(k: u64) -> TickInput {
    TickInput { tick: Tick(k), chair: Some(chair(Tick(k))), link: LinkHealth::Live, respawn: false }
}

fn both(criterion: &mut Criterion) {
    let mut core = core_at(1000);
    criterion.bench_function("green and blue standing", |bencher| {
        bencher.iter(|| core.step(black_box(&input(0))));
    });
    let swaying = core_at(SWAYING_FROM);
    let (mut core, mut k) = (swaying.clone(), SWAYING_FROM);
    criterion.bench_function("green and blue swaying", |bencher| {
        bencher.iter(|| {
            k += 1;
            if k == SWAYING_FROM + 10_000 {
                (core, k) = (swaying.clone(), SWAYING_FROM);
            }
            core.step(black_box(&input(k)))
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(50).measurement_time(std::time::Duration::from_secs(3));
    targets = parts, one_character, both
}
criterion_main!(benches);
