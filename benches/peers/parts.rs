//! Times the parts of a tick on the states of one phase.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Vector3;
use otolith::balance::{BalanceController, BalanceSettings, MomentumController, perceive};
use otolith::character::{CharacterModel, CharacterState, GenVec};
use otolith::dynamics::{
    ContactSettings, Dynamics, Engine, GroundSurface, Inertias, Kinematics, MotorSet, Simulator, Snapshot,
    StepInput,
};
use otolith::tick::PlatformMotion;
use otolith::time::TICK_S;

/// One tick of the run.
pub(crate) struct Moment {
    /// Body before the step.
    pub(crate) state: CharacterState,
    /// Platform during the step.
    pub(crate) platform: PlatformMotion,
    /// Believed gravity, platform axes, m/s².
    pub(crate) gravity_platform: Vector3<f64>,
}

/// Evaluations timed together where one is too short for the clock, and how many ticks lie between two such blocks.
const REPEATS: u32 = 16;
const STRIDE: usize = 8;

/// `ours PHASE PART min median p99`, microseconds.
pub(crate) fn print(phase: &str, part: &str, mut times: Vec<f64>) {
    times.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
    println!("ours {phase} {part} {:.3} {:.3} {:.3}", at(0.0), at(0.5), at(0.99));
}

/// Times every part on `moments`; the controller holds the posture of `standing`.
pub(crate) fn time(phase: &str, model: &Arc<CharacterModel>, standing: CharacterState, moments: &[Moment]) {
    let (solve, step) = controller_and_step(model, standing, moments);
    print(phase, "solve", solve);
    print(phase, "step", step);

    let mut engine = Engine::new(model.clone(), ContactSettings::default(), standing);
    let (mut kinematics, mut inertias) = (Kinematics::default(), Inertias::default());
    let acceleration = GenVec::from_element(0.1);
    let feet = |engine: &Engine, kinematics: &Kinematics| {
        for foot in engine.model().feet {
            let offset = kinematics.position[foot];
            black_box(engine.jacobian(foot, &offset));
            black_box(engine.jdot_qdot(foot, &offset));
        }
    };
    let mut block = |part: &str, work: &mut dyn FnMut(&mut Engine, &CharacterState)| {
        let mut times = Vec::new();
        for moment in moments.iter().step_by(STRIDE) {
            engine.set_state(moment.state);
            let started = Instant::now();
            for _ in 0..REPEATS {
                work(&mut engine, black_box(&moment.state));
            }
            times.push(microseconds(started) / f64::from(REPEATS));
        }
        print(phase, part, times);
    };
    block("kinematics", &mut |_, state| {
        kinematics.update(model, state);
        black_box(&kinematics);
    });
    block("mass_matrix", &mut |_, state| {
        kinematics.update(model, state);
        inertias.update(model, &kinematics);
        black_box(&inertias);
    });
    block("inverse_dynamics", &mut |engine, state| {
        kinematics.update(model, state);
        inertias.update(model, &kinematics);
        black_box(engine.inverse_dynamics(black_box(&acceleration), &model.gravity));
    });
    block("bias", &mut |engine, state| {
        engine.set_state(*state);
        black_box(engine.velocity_forces().generalised + engine.gravity_forces(&model.gravity));
    });
    block("feet", &mut |engine, state| {
        kinematics.update(model, state);
        feet(engine, &kinematics);
    });
    block("all_terms", &mut |engine, state| {
        engine.set_state(*state);
        black_box(engine.velocity_forces().generalised + engine.gravity_forces(&model.gravity));
        feet(engine, engine.kinematics());
    });
}

/// Controller with what it perceives, and bare physics step, each on its own, microseconds.
fn controller_and_step(
    model: &Arc<CharacterModel>,
    standing: CharacterState,
    moments: &[Moment],
) -> (Vec<f64>, Vec<f64>) {
    let settings = BalanceSettings::default();
    let mut engine = Engine::new(model.clone(), ContactSettings::default(), standing);
    let mut controller = MomentumController::new(settings, &engine);
    let (mut solve, mut step) = (Vec::new(), Vec::new());
    for moment in moments {
        // The state is the whole tick's; warm start and anchors are those of the step before.
        let contacts = engine.snapshot().contacts;
        engine.restore(&Snapshot { state: moment.state, contacts });
        let motion = &moment.platform;
        let ground = GroundSurface::turntable(motion.angle, motion.rate, motion.acceleration, model.friction);
        let gravity = ground.rot_world_surface * moment.gravity_platform;

        let started = Instant::now();
        let perceived = perceive(&engine, &ground, black_box(&gravity));
        let control = black_box(controller.control(&engine, &ground, &perceived));
        solve.push(microseconds(started));

        let motors = MotorSet::torques(control.torques, settings.torque_limit);
        let input = StepInput { motors, wrench: None, ground, dt_s: TICK_S };
        let started = Instant::now();
        black_box(engine.step(black_box(&input)));
        step.push(microseconds(started));
    }
    (solve, step)
}

pub(crate) fn microseconds(since: Instant) -> f64 {
    since.elapsed().as_nanos() as f64 * 1e-3
}
