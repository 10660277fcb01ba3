//! Joint motors: stability at any stiffness, exact targets, exact limits.

use std::sync::Arc;

use nalgebra::Vector3;

use super::{Random, model, standing};
use crate::character::{CharacterModel, CharacterState, DOF, JOINTS, JointVec};
use crate::dynamics::{ContactSettings, Dynamics, Engine, GroundSurface, MotorSet, Simulator, StepInput};

/// Weightless, far above the ground, at rest in the standing pose.
fn floating(model: CharacterModel) -> Engine {
    let mut state: CharacterState = *standing().state();
    state.root_position.z += 100.0;
    let model = CharacterModel { gravity: Vector3::zeros(), ..model };
    Engine::new(Arc::new(model), ContactSettings::default(), state)
}

fn with(motors: MotorSet, dt_s: f64) -> StepInput {
    StepInput { motors, wrench: None, ground: GroundSurface::level(1.0), dt_s }
}

fn only(joint: usize, value: f64) -> JointVec {
    JointVec::from_fn(|j, _| if j == joint { value } else { 0.0 })
}

#[test]
fn a_stiff_implicit_spring_holds_the_light_hand_at_any_step() {
    let model = (*model()).clone();
    let hand = model.joint("hand_l_y").unwrap();
    assert!(model.bodies[model.joints[hand].body].mass < 0.4);
    for dt_s in [1e-3, 5e-3, 20e-3] {
        let mut engine = floating(model.clone());
        let rest = engine.state().joint_angles;
        let target = rest + only(hand, 0.5);
        // kp 800, kd 80 on a hand of 0.001 kg m2: explicit integration would need steps below 0.03 ms.
        let (kp, kd) = (JointVec::repeat(800.0), JointVec::repeat(80.0));
        let mut error = 0.5;
        for _ in 0..(2.0 / dt_s) as usize {
            let motors = MotorSet::implicit_pd(engine.state(), &target, &kp, &kd, 1e6, dt_s);
            engine.step(&with(motors, dt_s));
            let next = target[hand] - engine.state().joint_angles[hand];
            assert!(next > -1e-6 && next < error + 1e-12, "h {dt_s}: {error} -> {next}");
            error = next;
        }
        assert!(error < 1e-6, "h {dt_s}: {error}");
    }
}

#[test]
fn a_velocity_motor_reaches_its_target_in_one_step_if_its_torque_allows() {
    let mut engine = floating((*model()).clone());
    let mut random = Random::new(3);
    let target_rate = JointVec::from_fn(|_, _| 2.0 * random.unit());
    let motors = MotorSet { damping: JointVec::repeat(1e9), target_rate, ..MotorSet::limp(0.0) };
    let report = *engine.step(&with(motors, 1e-3));
    assert!(report.motors_settled && report.motor_rounds == 0);
    let reached = engine.state().velocity.fixed_rows::<JOINTS>(6).into_owned();
    assert!((reached - target_rate).amax() < 1e-5, "{}", (reached - target_rate).amax());
}

#[test]
fn a_saturated_velocity_motor_is_a_constant_torque_at_its_limit() {
    let limit = 1.5;
    let mut random = Random::new(5);
    for _ in 0..20 {
        let knee = (random.unit().abs() * 34.9) as usize;
        let sign = random.unit().signum();
        let mut by_motor = floating((*model()).clone());
        let mut by_torque = by_motor.clone();
        let mut motors = MotorSet::limp(0.0);
        motors.damping = only(knee, 1e6);
        motors.target_rate = only(knee, sign * 1e5);
        motors.torque_limit = JointVec::repeat(limit);
        let report = *by_motor.step(&with(motors, 1e-3));
        assert!(report.motors_settled && report.motor_rounds >= 1);
        assert_eq!(report.joint_torques, only(knee, sign * limit));
        by_torque.step(&with(MotorSet::torques(only(knee, sign * limit), limit), 1e-3));
        let difference = (by_motor.state().velocity - by_torque.state().velocity).amax();
        assert!(difference < 1e-12, "{difference}");
    }
}

#[test]
fn a_torque_motor_keeps_to_its_limit_beside_velocity_motors() {
    let mut engine = floating((*model()).clone());
    let mut motors = MotorSet::limp(0.0);
    motors.damping = only(0, 10.0);
    motors.torque = only(20, 500.0);
    motors.torque_limit = JointVec::repeat(3.0);
    let report = engine.step(&with(motors, 1e-3));
    assert_eq!(report.joint_torques[20], 3.0);
}

#[test]
fn the_realised_torque_accounts_for_the_motion() {
    let mut random = Random::new(9);
    for _ in 0..20 {
        let mut engine = floating((*model()).clone());
        let mut state = *engine.state();
        state.velocity = random.generalised(1.0);
        engine.set_state(state);
        let motors = MotorSet {
            damping: JointVec::from_fn(|_, _| 50.0 * random.unit().max(0.0)),
            target_rate: JointVec::from_fn(|_, _| 5.0 * random.unit()),
            torque: JointVec::from_fn(|_, _| random.unit()),
            torque_limit: JointVec::repeat(20.0),
        };
        let before = engine.clone();
        let report = *engine.step(&with(motors, 1e-3));
        assert!(report.motors_settled);
        let tau = before.inverse_dynamics(&report.qdd, &Vector3::zeros());
        for j in 0..JOINTS {
            assert!((tau[6 + j] - report.joint_torques[j]).abs() < 1e-8, "joint {j}");
            assert!(report.joint_torques[j].abs() <= 20.0 * (1.0 + 1e-12));
        }
        assert!(tau.fixed_rows::<6>(0).amax() < 1e-8, "nothing pushes the root");
    }
}

#[test]
fn a_held_pose_stands_at_every_step_size() {
    for dt_s in [1e-3, 5e-3, 10e-3, 20e-3] {
        let mut engine = standing();
        let pose = engine.state().joint_angles;
        let start = engine.com();
        let mut fastest: f64 = 0.0;
        for k in 0..(20.0 / dt_s) as usize {
            let target_rate = 25.0 * (pose - engine.state().joint_angles);
            let motors = MotorSet { damping: JointVec::repeat(1e4), target_rate, ..MotorSet::limp(0.0) };
            let report = engine.step(&with(motors, dt_s));
            assert!(report.motors_settled);
            if k as f64 * dt_s > 1.0 {
                fastest = fastest.max(engine.state().velocity.amax());
            }
        }
        let drift = (engine.com() - start).norm();
        println!("h {dt_s}: drift {drift:e} m, fastest {fastest:e}");
        assert!(drift < 2e-3 && fastest < 1e-3, "h {dt_s}: drift {drift}, fastest {fastest}");
    }
}

#[test]
fn a_hinge_outside_its_range_comes_back_and_stays() {
    let mut limited = (*model()).clone();
    let knee = limited.joint("shank_l_y").unwrap();
    limited.joints[knee].range = Some((0.3, 2.0));
    for dt_s in [1e-3, 5e-3, 20e-3] {
        let mut engine = floating(limited.clone());
        assert!(engine.state().joint_angles[knee] < 0.3);
        for _ in 0..(3.0 / dt_s) as usize {
            engine.step(&with(MotorSet::limp(0.5), dt_s));
            assert!(engine.state().velocity.amax() < 50.0, "h {dt_s}");
        }
        let angle = engine.state().joint_angles[knee];
        assert!(angle > 0.3 - 1e-3, "h {dt_s}: {angle}");
        // Torques push against the limit: the spring holds with a small deflection.
        for _ in 0..(3.0 / dt_s) as usize {
            let mut motors = MotorSet::limp(0.5);
            motors.torque = only(knee, -20.0);
            engine.step(&with(motors, dt_s));
        }
        let angle = engine.state().joint_angles[knee];
        assert!((angle - (0.3 - 20.0 / 2000.0)).abs() < 2e-3, "h {dt_s}: {angle}");
    }
}

const _: () = assert!(DOF == 6 + JOINTS);
