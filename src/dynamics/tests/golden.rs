//! `tests/golden/dynamics`: MuJoCo 4.0.0 in double precision, to 1e-10 relative to max(1, |value|).

use nalgebra::Vector3;
use serde_json::Value;

use super::{engine_at, standing};
use crate::character::{BODIES, CharacterState, DOF, GenVec};
use crate::dynamics::{Dynamics, Engine};

const TOLERANCE: f64 = 1e-10;

fn load(index: usize) -> Value {
    let path = format!("{}/tests/golden/dynamics/state_{index}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn engine(golden: &Value) -> Engine {
    let qpos: [f64; DOF + 1] = numbers(&golden["qpos"]).try_into().unwrap();
    let mut state = CharacterState::from_qpos(&qpos);
    state.velocity = GenVec::from_column_slice(&numbers(&golden["qvel"]));
    engine_at(state)
}

fn close(what: &str, got: f64, want: f64) {
    let error = (got - want).abs() / want.abs().max(1.0);
    assert!(error <= TOLERANCE, "{what}: got {got}, want {want}, relative error {error:e}");
}

fn all_close(what: &str, got: impl IntoIterator<Item = f64>, want: &[f64]) {
    let got: Vec<f64> = got.into_iter().collect();
    assert_eq!(got.len(), want.len(), "{what}");
    for (i, (g, w)) in got.iter().zip(want).enumerate() {
        close(&format!("{what}[{i}]"), *g, *w);
    }
}

fn each_state(check: impl Fn(&Value, &Engine)) {
    for index in 0..6 {
        let golden = load(index);
        check(&golden, &engine(&golden));
    }
}

#[test]
fn the_character_weighs_65_kg_and_stands_as_in_the_golden_pose() {
    let engine = standing();
    close("mass", engine.model().mass(), 65.0);
    let golden = numbers(&load(0)["qpos"]);
    // The pose is our own computation: compared to the accuracy of its fixed number of rounds.
    for (i, (got, want)) in engine.state().qpos().iter().zip(&golden).enumerate() {
        assert!((got - want).abs() < 1e-8, "qpos[{i}]: got {got}, want {want}");
    }
}

#[test]
fn poses_and_centres_of_mass() {
    each_state(|golden, engine| {
        let k = engine.kinematics();
        for i in 0..BODIES {
            let name = &engine.model().bodies[i].name;
            let body = &golden["bodies"][name.as_str()];
            all_close(name, (k.origin + k.position[i]).iter().copied(), &numbers(&body["pos"]));
            all_close(name, (k.origin + k.com_offset[i]).iter().copied(), &numbers(&body["com"]));
        }
        all_close("com", engine.com().iter().copied(), &numbers(&golden["com"]));
    });
}

#[test]
fn mass_matrix() {
    each_state(|golden, engine| {
        for i in 0..DOF {
            let row = numbers(&golden["M"][i]);
            for (j, want) in row.iter().enumerate() {
                let got = engine.inertias().mass_matrix.entry(engine.model(), i, j);
                close(&format!("M[{i}][{j}]"), got, *want);
            }
        }
    });
}

#[test]
fn bias_and_coriolis_forces() {
    each_state(|golden, engine| {
        let gravity = engine.model().gravity;
        let coriolis = engine.velocity_forces().generalised;
        all_close("coriolis", coriolis.iter().copied(), &numbers(&golden["coriolis"]));
        let bias = coriolis + engine.gravity_forces(&gravity);
        all_close("bias", bias.iter().copied(), &numbers(&golden["bias"]));
    });
}

#[test]
fn inverse_dynamics_and_vestibular_signals() {
    each_state(|golden, engine| {
        let qdd = GenVec::from_column_slice(&numbers(&golden["qdd"]));
        let tau = engine.inverse_dynamics(&qdd, &engine.model().gravity);
        all_close("tau", tau.iter().copied(), &numbers(&golden["inverse_dynamics"]));
        let head = engine.head_signals(&qdd);
        let vestibule = &golden["vestibule"];
        all_close("gyro", head.omega_head.iter().copied(), &numbers(&vestibule["gyro"]));
        all_close(
            "accelerometer",
            head.specific_force_head.iter().copied(),
            &numbers(&vestibule["accelerometer"]),
        );
        let position = engine.kinematics().origin + engine.kinematics().vestibule_offset(engine.model());
        all_close("vestibule", position.iter().copied(), &numbers(&vestibule["pos"]));
    });
}

#[test]
fn momentum_map_and_energy() {
    each_state(|golden, engine| {
        let com = engine.inertias().com_offset();
        for dof in 0..DOF {
            let (linear, angular) = engine.inertias().centroidal_column(dof, &com);
            for row in 0..3 {
                close("cmm linear", linear[row], golden["cmm"][row][dof].as_f64().unwrap());
                close("cmm angular", angular[row], golden["cmm"][3 + row][dof].as_f64().unwrap());
            }
        }
        let (kinetic, potential) = engine.energy();
        close("kinetic", kinetic, golden["energy"]["kinetic"].as_f64().unwrap());
        close("potential", potential, golden["energy"]["potential"].as_f64().unwrap());
    });
}

#[test]
fn jacobians_and_their_rates() {
    each_state(|golden, engine| {
        for name in ["pelvis", "head", "thorax", "hand_l", "foot_l", "foot_r"] {
            let body = engine.model().body(name).unwrap();
            let offset: Vector3<f64> = engine.kinematics().position[body];
            let jacobian = engine.jacobian(body, &offset);
            for row in 0..6 {
                let want = numbers(&golden["jac"][name][row]);
                all_close(name, jacobian.row(row).iter().copied(), &want);
            }
            let (angular, linear) = engine.jdot_qdot(body, &offset);
            let want = numbers(&golden["jdot_qdot"][name]);
            all_close(name, angular.iter().chain(linear.iter()).copied(), &want);
        }
    });
}
