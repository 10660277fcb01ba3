//! Laws that hold at any state: algebra of the mass matrix, derivatives, conservation.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix3, UnitQuaternion, Vector3};

use super::{Random, engine_at, model};
use crate::character::{CharacterState, DOF, GenVec};
use crate::dynamics::{
    BodyWrench, ContactSettings, Dynamics, Engine, GroundSurface, MotorSet, Simulator, StepInput, TreeFactor,
};

/// States of each property.
const STATES: u64 = 120;

fn random_engines() -> impl Iterator<Item = (Random, Engine)> {
    (1..=STATES).map(|seed| {
        let mut random = Random::new(seed);
        let state = random.state();
        (random, engine_at(state))
    })
}

/// Largest difference relative to max(1, largest value).
fn relative<'a>(got: impl IntoIterator<Item = &'a f64>, want: impl IntoIterator<Item = &'a f64>) -> f64 {
    let (mut worst, mut scale) = (0.0f64, 1.0f64);
    for (g, w) in got.into_iter().zip(want) {
        worst = worst.max((g - w).abs());
        scale = scale.max(w.abs());
    }
    worst / scale
}

fn dense_mass_matrix(engine: &Engine) -> DMatrix<f64> {
    DMatrix::from_fn(DOF, DOF, |i, j| engine.inertias().mass_matrix.entry(engine.model(), i, j))
}

fn unit(dof: usize) -> GenVec {
    GenVec::from_fn(|i, _| f64::from(u8::from(i == dof)))
}

/// The state after moving with `velocity` for `time`, exactly (every coordinate turns or slides at a constant rate).
fn moved(state: &CharacterState, time: f64) -> CharacterState {
    let mut next = *state;
    let v = &state.velocity;
    next.root_position += time * v.fixed_rows::<3>(0);
    next.root_attitude *= UnitQuaternion::from_scaled_axis(time * v.fixed_rows::<3>(3));
    next.joint_angles += time * v.fixed_rows::<{ DOF - 6 }>(6);
    next
}

/// Engines a little before and after the present state, at the same generalised velocity.
fn neighbours(engine: &Engine, time: f64) -> [Engine; 2] {
    [-time, time].map(|t| engine_at(moved(engine.state(), t)))
}

/// Rotation vector per unit time from `before` to `after`, `2 time` apart; for small angles.
fn turning(before: &Matrix3<f64>, after: &Matrix3<f64>, time: f64) -> Vector3<f64> {
    let r = after * before.transpose();
    Vector3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12) / (4.0 * time)
}

#[test]
fn inverse_dynamics_is_the_mass_matrix_times_acceleration_plus_bias() {
    for (mut random, engine) in random_engines() {
        let qdd = random.generalised(20.0);
        let gravity = 10.0 * random.vector();
        let bias = engine.velocity_forces().generalised + engine.gravity_forces(&gravity);
        let sparse = engine.inertias().mass_matrix.times(engine.model(), &qdd) + bias;
        let tau = engine.inverse_dynamics(&qdd, &gravity);
        assert!(relative(&sparse, &tau) < 1e-10);
        let dense = dense_mass_matrix(&engine) * DVector::from_column_slice(qdd.as_slice());
        assert!(relative(&dense, &(tau - bias)) < 1e-10);
    }
}

#[test]
fn the_mass_matrix_column_by_column_from_newton_and_euler_is_symmetric() {
    for (_, engine) in random_engines().take(20) {
        let still = engine.velocity_forces().generalised;
        let columns: Vec<GenVec> =
            (0..DOF).map(|dof| engine.inverse_dynamics(&unit(dof), &Vector3::zeros()) - still).collect();
        let newton_euler = DMatrix::from_fn(DOF, DOF, |i, j| columns[j][i]);
        assert!(relative(&newton_euler, &dense_mass_matrix(&engine)) < 1e-10);
        assert!(relative(&newton_euler, &newton_euler.transpose()) < 1e-10);
    }
}

#[test]
fn the_factorisation_is_positive_and_solves_as_a_dense_one_does() {
    for (mut random, engine) in random_engines() {
        let addition = GenVec::from_fn(|_, _| random.unit().abs());
        for addition in [None, Some(addition)] {
            let mut factor = TreeFactor::default();
            factor.factor(engine.model(), &engine.inertias().mass_matrix, addition.as_ref());
            assert!(factor.diagonal.iter().all(|d| *d > 0.0));
            let mut matrix = dense_mass_matrix(&engine);
            for i in 0..DOF {
                matrix[(i, i)] += addition.map_or(0.0, |a| a[i]);
            }
            let right = random.generalised(100.0);
            let dense = matrix.cholesky().unwrap().solve(&DVector::from_column_slice(right.as_slice()));
            let mut x = right;
            factor.solve(engine.model(), &mut x);
            assert!(relative(&x, &dense) < 1e-10);
        }
    }
}

#[test]
fn the_root_rows_of_the_mass_matrix_are_the_momentum_map() {
    for (_, engine) in random_engines() {
        let matrix = dense_mass_matrix(&engine);
        let com = engine.inertias().com_offset();
        let rot = engine.kinematics().rot_world_body[0];
        for dof in 0..DOF {
            let linear = Vector3::from_fn(|i, _| matrix[(i, dof)]);
            let root_moment = rot * Vector3::from_fn(|i, _| matrix[(3 + i, dof)]);
            let angular = root_moment - com.cross(&linear);
            let (l, k) = engine.inertias().centroidal_column(dof, &com);
            // A rotor turns relative to its parent: its armature is no momentum of the whole, and no root row holds it.
            assert!(relative(&linear, &l) < 1e-12 && relative(&angular, &k) < 1e-12, "{dof}");
        }
        let momentum = engine.momentum();
        let com_velocity = momentum.0 / engine.model().mass();
        let [before, after] = neighbours(&engine, 1e-6);
        assert!(((after.com() - before.com()) / 2e-6 - com_velocity).norm() < 1e-6);
    }
}

#[test]
fn jacobians_are_the_derivatives_of_positions() {
    let time = 1e-6;
    for (mut random, engine) in random_engines() {
        let [before, after] = neighbours(&engine, time);
        for body in [0, engine.model().head, engine.model().feet[0], engine.model().feet[1]] {
            let local = 0.3 * random.vector();
            let place = |e: &Engine| {
                let k = e.kinematics();
                k.position[body] + k.rot_world_body[body] * local
            };
            let world = |e: &Engine| e.kinematics().origin + place(e);
            let speed = engine.jacobian(body, &place(&engine)) * engine.state().velocity;
            let linear = (world(&after) - world(&before)) / (2.0 * time);
            let attitude = |e: &Engine| e.kinematics().rot_world_body[body];
            let angular = turning(&attitude(&before), &attitude(&after), time);
            assert!((speed.fixed_rows::<3>(0) - angular).norm() < 1e-6);
            assert!((speed.fixed_rows::<3>(3) - linear).norm() < 1e-6);
        }
    }
}

#[test]
fn velocity_products_are_the_derivatives_at_constant_rates() {
    let time = 1e-5;
    for (_, engine) in random_engines() {
        let [before, after] = neighbours(&engine, time);
        for body in [0, engine.model().head, engine.model().feet[0]] {
            let speed = |e: &Engine| e.jacobian(body, &e.kinematics().position[body]) * e.state().velocity;
            let rate = (speed(&after) - speed(&before)) / (2.0 * time);
            let (angular, linear) = engine.jdot_qdot(body, &engine.kinematics().position[body]);
            assert!((rate.fixed_rows::<3>(0) - angular).norm() < 1e-6 * angular.norm().max(1.0));
            assert!((rate.fixed_rows::<3>(3) - linear).norm() < 1e-6 * linear.norm().max(1.0));
        }
        let (before, after) = (before.momentum(), after.momentum());
        let rate = &engine.velocity_forces().momentum_rate;
        let angular = rate.moment - engine.inertias().com_offset().cross(&rate.force);
        let measured = (after.0 - before.0) / (2.0 * time);
        assert!((measured - rate.force).norm() < 1e-6 * rate.force.norm().max(1.0));
        let measured = (after.1 - before.1) / (2.0 * time);
        assert!((measured - angular).norm() < 1e-6 * angular.norm().max(1.0));
    }
}

/// Far above the ground, so that nothing touches it.
fn flying(mut state: CharacterState, gravity: Vector3<f64>) -> Engine {
    state.root_position.z += 1000.0;
    let mut model = (*model()).clone();
    model.gravity = gravity;
    Engine::new(Arc::new(model), ContactSettings::default(), state)
}

fn free(dt_s: f64) -> StepInput {
    let motors = MotorSet::torques(crate::character::JointVec::zeros(), 1.0);
    StepInput { motors, wrench: None, ground: GroundSurface::level(1.0), dt_s }
}

#[test]
fn the_rate_of_momentum_is_the_external_force_whatever_the_motors_do() {
    for (mut random, engine) in random_engines() {
        let mut engine = flying(*engine.state(), engine.model().gravity);
        let push = BodyWrench {
            body: (random.unit().abs() * 18.9) as usize,
            force: 100.0 * random.vector(),
            moment: 20.0 * random.vector(),
        };
        let mut motors =
            MotorSet::torques(20.0 * crate::character::JointVec::from_fn(|_, _| random.unit()), 50.0);
        motors.damping.iter_mut().for_each(|d| *d = 30.0 * random.unit().max(0.0));
        motors.target_rate.iter_mut().for_each(|w| *w = 3.0 * random.unit());
        let arm = engine.kinematics().com_offset[push.body] - engine.inertias().com_offset();
        let com = engine.inertias().com_offset();
        let (map, rate) = (engine.inertias().clone(), engine.velocity_forces().momentum_rate);
        let weight = engine.model().mass() * engine.model().gravity;
        let qdd = engine.step(&StepInput { motors, wrench: Some(push), ..free(1e-3) }).qdd;
        let (mut linear, mut angular) = (rate.force, rate.moment - com.cross(&rate.force));
        for dof in 0..DOF {
            let (l, k) = map.centroidal_column(dof, &com);
            linear += qdd[dof] * l;
            angular += qdd[dof] * k;
        }
        assert!((linear - weight - push.force).norm() < 1e-9 * weight.norm());
        assert!((angular - push.moment - arm.cross(&push.force)).norm() < 1e-8);
    }
}

/// Largest drift of energy and of momentum (linear, angular) over 0.5 s of free flight without gravity.
fn drift(seed: u64, dt_s: f64) -> [f64; 3] {
    let mut engine = flying(Random::new(seed).state(), Vector3::zeros());
    let (energy, momentum) = (engine.energy().0, engine.momentum());
    let mut worst = [0.0f64; 3];
    for _ in 0..(0.5 / dt_s).round() as usize {
        engine.step(&free(dt_s));
        let now = engine.momentum();
        worst[0] = worst[0].max((engine.energy().0 - energy).abs() / energy);
        worst[1] = worst[1].max((now.0 - momentum.0).norm() / momentum.0.norm());
        worst[2] = worst[2].max((now.1 - momentum.1).norm() / momentum.1.norm());
    }
    worst
}

#[test]
fn energy_and_momentum_drift_in_free_flight_halves_with_the_step() {
    for seed in 1..=5 {
        let (coarse, fine) = (drift(seed, 5e-4), drift(seed, 2.5e-4));
        println!("seed {seed}: {coarse:?} {fine:?}");
        for (what, (coarse, fine)) in ["energy", "linear", "angular"].iter().zip(coarse.iter().zip(fine)) {
            let ratio = coarse / fine;
            assert!(fine < 0.02 && (1.7..2.4).contains(&ratio), "seed {seed} {what}: {coarse} {fine}");
        }
    }
}

#[test]
fn a_rigid_body_in_free_fall_gains_exactly_its_weight_times_time() {
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let mut state = *super::standing().state();
    state.set_rigid_rotation(0.0);
    state.velocity[0] = 1.5;
    let mut engine = flying(state, gravity);
    let start = engine.momentum();
    for _ in 0..1000 {
        engine.step(&free(1e-3));
    }
    let (linear, angular) = engine.momentum();
    let want = start.0 + engine.model().mass() * gravity;
    assert!((linear - want).norm() < 1e-9 * want.norm());
    assert!(angular.norm() < 1e-9);
}
