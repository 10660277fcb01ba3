//! Contact: the friction cone's edge, rest, moving ground, and the two solvers against each other.

use std::sync::Arc;

use nalgebra::{SMatrix, UnitQuaternion, Vector3};

use super::{Random, engine_at, model, standing};
use crate::character::{CONTACTS, CharacterModel, CharacterState, JointVec};
use crate::dynamics::contact_solver::{ContactMethod, ContactProblem, FEET_ROWS};
use crate::dynamics::{ContactSettings, Dynamics, Engine, GroundSurface, MotorSet, Simulator, StepInput};
use crate::units::RAD_PER_DEG;

const G: f64 = 9.81;

/// Every hinge held by a motor so stiff that the character is one rigid block.
fn locked() -> MotorSet {
    MotorSet { damping: JointVec::repeat(1e7), ..MotorSet::limp(0.0) }
}

fn on(ground: GroundSurface) -> StepInput {
    StepInput { motors: locked(), wrench: None, ground, dt_s: 1e-3 }
}

/// A slope of `angle` rad that rises toward `heading` rad, and the character standing upright on it.
fn slope(angle: f64, heading: f64, friction: f64) -> (Engine, GroundSurface) {
    let axis = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading) * -Vector3::y();
    let turn = UnitQuaternion::from_scaled_axis(angle * axis);
    let mut state: CharacterState = *standing().state();
    state.root_position = turn * state.root_position;
    state.root_attitude = turn * state.root_attitude;
    (engine_at(state), GroundSurface::plane(turn * Vector3::z(), friction))
}

/// Distance the block has slid down the slope after each millisecond of `steps`.
fn slide(angle_deg: f64, heading_deg: f64, friction: f64, steps: usize) -> Vec<f64> {
    let (mut engine, ground) = slope(angle_deg * RAD_PER_DEG, heading_deg * RAD_PER_DEG, friction);
    let start = engine.com();
    let step = |_| {
        engine.step(&on(ground));
        (engine.com() - start).norm()
    };
    (0..steps).map(step).collect()
}

#[test]
fn a_block_sticks_below_the_angle_of_friction_and_slides_above_in_every_direction() {
    let friction = 0.1;
    for heading in [0.0, 45.0, 90.0, 160.0, 270.0] {
        // tan 5.6 deg = 0.0981, tan 5.8 deg = 0.1016: the threshold lies within 0.01 of 0.1.
        let stuck = slide(5.6, heading, friction, 1000);
        let crept = stuck[999] - stuck[99];
        assert!(stuck[999] < 1e-4 && crept < 2e-5, "heading {heading}: crept {crept} m in 0.9 s");
        for angle in [5.8, 6.0, 7.0] {
            let a = angle * RAD_PER_DEG;
            let acceleration = G * (libm::sin(a) - friction * libm::cos(a));
            let path = slide(angle, heading, friction, 1000);
            println!(
                "heading {heading} slope {angle}: {} mm in 1 s of {}",
                path[999] * 1e3,
                acceleration * 500.0
            );
            // Second difference of the path: what the first steps did to the velocity drops out.
            let measured = (path[999] - 2.0 * path[549] + path[99]) / (0.45 * 0.45);
            assert!((measured - acceleration).abs() < 0.01 * acceleration, "{measured} {acceleration}");
            // The contact closes from nothing, with too little friction for some milliseconds.
            assert!((path[999] - 0.5 * acceleration).abs() < 1.5e-3, "{}", path[999]);
        }
    }
}

#[test]
fn a_dropped_block_does_not_bounce_and_its_impulse_is_its_momentum() {
    let mut state = *standing().state();
    state.root_position.z += 0.02;
    let mut engine = engine_at(state);
    let (mass, mut impulse, mut highest_after) = (engine.model().mass(), 0.0, f64::NEG_INFINITY);
    let mut landed: Option<f64> = None;
    for _ in 0..300 {
        let load = engine.step(&on(GroundSurface::level(1.0))).load();
        impulse += 1e-3 * load;
        let rising = engine.momentum().0.z / mass;
        if landed.is_some() {
            highest_after = highest_after.max(rising);
        } else if load > 0.0 && engine.report().contacts.iter().all(|c| c.active) && rising > -1e-3 {
            landed = Some(rising);
        }
    }
    assert!(landed.is_some());
    // Push-out of what is left of the penetration is the only upward motion.
    assert!(highest_after < 5e-3, "{highest_after}");
    let gained = engine.momentum().0.z + mass * G * 0.3;
    assert!((impulse - gained).abs() < 1e-6 * gained, "{impulse} {gained}");
    assert!(engine.momentum().0.norm() < 1e-4 * mass);
}

#[test]
fn standing_for_a_minute_carries_the_weight_and_does_not_creep() {
    let mut engine = standing();
    let weight = engine.model().mass() * G;
    for _ in 0..200 {
        engine.step(&on(GroundSurface::level(1.0)));
    }
    let feet = |engine: &Engine| -> [Vector3<f64>; CONTACTS] {
        std::array::from_fn(|i| engine.kinematics().contact_position(engine.model(), i))
    };
    let start = feet(&engine);
    for _ in 0..60_000 {
        let load = engine.step(&on(GroundSurface::level(1.0))).load();
        assert!((load - weight).abs() < 1e-3 * weight, "{load}");
    }
    let creep = start.iter().zip(feet(&engine)).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    println!("creep of the feet in 60 s: {:.6} mm", creep * 1e3);
    assert!(creep < 1e-4, "{creep}");
}

#[test]
fn on_a_turntable_the_feet_follow_the_surface() {
    let mut engine = standing();
    let (mut angle, mut rate, dt_s): (f64, f64, f64) = (0.0, 0.0, 1e-3);
    let full = 30.0 * crate::units::RAD_S_PER_RPM;
    let place = |engine: &Engine, angle: f64, i: usize| {
        let (s, c) = libm::sincos(angle);
        let p = engine.kinematics().contact_position(engine.model(), i);
        Vector3::new(c * p.x + s * p.y, c * p.y - s * p.x, p.z)
    };
    let start: [_; CONTACTS] = std::array::from_fn(|i| place(&engine, 0.0, i));
    let mut worst: f64 = 0.0;
    for k in 0..20_000 {
        let acceleration = if k < 1000 { full } else { 0.0 };
        engine.step(&on(GroundSurface::turntable(angle, rate, acceleration, 1.0)));
        rate += dt_s * acceleration;
        angle += dt_s * rate;
        for (i, from) in start.iter().enumerate() {
            worst = worst.max((place(&engine, angle, i) - from).norm());
        }
    }
    println!("feet against the turntable over 20 s: {:.4} mm", worst * 1e3);
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn a_treadmill_drags_the_block_at_mu_g_until_it_moves_with_the_belt() {
    let (friction, belt) = (0.1, 0.3);
    let ground = GroundSurface { velocity: Vector3::new(0.0, belt, 0.0), ..GroundSurface::level(friction) };
    let mut engine = standing();
    let mass = engine.model().mass();
    let slip_s = belt / (friction * G);
    for k in 1..=1000 {
        engine.step(&on(ground));
        let (t, speed) = (f64::from(k) * 1e-3, engine.momentum().0.y / mass);
        if k == 200 {
            assert!((speed - friction * G * t).abs() < 0.01 * friction * G * t, "{speed}");
        }
        if t > 1.01 * slip_s + 2e-3 {
            assert!((speed - belt).abs() < 0.01 * belt, "{t} {speed}");
        }
    }
}

#[test]
fn upside_down_and_far_away_nothing_touches() {
    let mut state = *standing().state();
    state.root_position.z += 1.0;
    let mut engine = engine_at(state);
    let report = engine.step(&on(GroundSurface::level(1.0)));
    assert_eq!(report.contact_method, ContactMethod::None);
    assert_eq!(report.cop(), None);
    assert!(report.contacts.iter().all(|c| !c.active && c.force == Vector3::zeros()));
}

#[test]
fn a_step_continues_bit_for_bit_from_a_snapshot() {
    let mut engine = standing();
    for _ in 0..50 {
        engine.step(&on(GroundSurface::level(0.05)));
    }
    let snapshot = engine.snapshot();
    let mut run = || {
        engine.restore(&snapshot);
        for _ in 0..50 {
            engine.step(&on(GroundSurface::level(0.05)));
        }
        engine.snapshot()
    };
    assert_eq!(run(), run());
}

#[test]
fn gravity_along_a_tilted_model_equals_a_tilted_ground() {
    let angle = 7.0 * RAD_PER_DEG;
    let mut tilted: CharacterModel = (*model()).clone();
    tilted.gravity = G * Vector3::new(-libm::sin(angle), 0.0, -libm::cos(angle));
    let mut engine = Engine::new(Arc::new(tilted), ContactSettings::default(), *standing().state());
    let start = engine.com();
    for _ in 0..500 {
        engine.step(&on(GroundSurface::level(0.1)));
    }
    let by_gravity = (engine.com() - start).norm();
    let by_ground = slide(7.0, 0.0, 0.1, 500)[499];
    assert!((by_gravity - by_ground).abs() < 1e-6, "{by_gravity} {by_ground}");
}

/// A well-conditioned random problem, all points active.
fn random_problem(random: &mut Random, pressing: f64) -> ContactProblem {
    type Feet<const COLUMNS: usize> = SMatrix<f64, FEET_ROWS, COLUMNS>;
    let half = Feet::<FEET_ROWS>::from_fn(|_, _| random.unit());
    let mobility = half * half.transpose() + Feet::<FEET_ROWS>::identity();
    let mut problem = ContactProblem::default();
    problem.active = [true; CONTACTS];
    problem.friction = 0.8;
    problem.mobility = mobility.transpose().data.0;
    problem.rows = std::array::from_fn(|_| std::array::from_fn(|_| std::array::from_fn(|_| random.unit())));
    problem.compliance = [Vector3::repeat(4.0); CONTACTS];
    problem.feet_before = std::array::from_fn(|_| random.unit());
    // Corrections of a known solution inside the cones (or not, when `pressing` is small).
    let solution: [Vector3<f64>; CONTACTS] = std::array::from_fn(|_| {
        Vector3::new(0.4 * random.unit(), 0.4 * random.unit(), pressing + random.unit())
    });
    let rows = problem.rows.map(|rows| SMatrix::<f64, 6, 3>::from(rows).transpose());
    let mut wrench = Feet::<1>::zeros();
    for i in 0..CONTACTS {
        let mut foot = wrench.fixed_rows_mut::<6>(6 * (i / 4));
        foot += rows[i].transpose() * solution[i];
    }
    let feet = Feet::<1>::from(problem.feet_before) + mobility * wrench;
    for i in 0..CONTACTS {
        problem.correction[i] = -(rows[i] * feet.fixed_rows::<6>(6 * (i / 4)) + 4.0 * solution[i]);
    }
    problem
}

#[test]
fn the_direct_and_the_iterative_solver_agree_where_everything_sticks() {
    let mut random = Random::new(7);
    for _ in 0..100 {
        let mut direct = random_problem(&mut random, 2.0);
        let mut iterative = direct.clone();
        assert_eq!(direct.solve(0, 0.0), ContactMethod::Direct);
        iterative.iterate(3000, 0.0);
        for (d, i) in direct.impulse.iter().zip(&iterative.impulse) {
            assert!((d - i).norm() < 1e-8, "{d} {i}");
        }
    }
}

#[test]
fn no_impulse_leaves_its_cone_and_sliding_opposes_the_slip() {
    let mut random = Random::new(11);
    let mut iterated = 0;
    for _ in 0..200 {
        let mut problem = random_problem(&mut random, 0.2);
        iterated += u32::from(problem.solve(2000, 0.0) == ContactMethod::Iterative);
        for (i, impulse) in problem.impulse.iter().enumerate() {
            let (tangential, limit) = (libm::hypot(impulse.x, impulse.y), problem.friction * impulse.z);
            assert!(impulse.z >= 0.0 && tangential <= limit * (1.0 + 1e-12), "{impulse}");
            let velocity = problem.velocity(i);
            assert!(velocity.z > -1e-6, "approaches: {velocity}");
            assert!(velocity.z * impulse.z < 1e-6, "pulls or hovers: {velocity} {impulse}");
            let slip = libm::hypot(velocity.x, velocity.y);
            if slip > 1e-4 && impulse.z > 1e-6 {
                let along = (velocity.x * impulse.x + velocity.y * impulse.y) / (slip * tangential);
                assert!(along < -1.0 + 1e-4, "friction does not oppose the slip: {along}");
            }
        }
    }
    assert!(iterated > 100, "only {iterated} problems reached the iterative solver");
}
