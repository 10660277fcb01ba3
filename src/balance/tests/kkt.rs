//! The structured solve of Eq. 18 against the dense 53 x 53 system it replaces.

use nalgebra::{DMatrix, DVector, Vector3};

use super::super::BalanceSettings;
use super::super::kkt::{self, Targets};
use super::{Random, standing};
use crate::character::{DOF, GenVec, JointVec};
use crate::dynamics::{Dynamics, Engine};

const ROWS: usize = 12;

/// `[H Jᵀ; J -ε] [q̈; λ] = [f; r]`, solved by LU.
fn dense(body: &Engine, targets: &Targets, settings: &BalanceSettings) -> GenVec {
    let com = body.inertias().com_offset();
    let rate = &body.velocity_forces().momentum_rate;
    let linear_error = targets.linear_rate - rate.force;
    let angular_error = targets.angular_rate - (rate.moment - com.cross(&rate.force));
    let mut system = DMatrix::zeros(DOF + ROWS, DOF + ROWS);
    let mut right = DVector::zeros(DOF + ROWS);
    let columns: Vec<_> = (0..DOF).map(|dof| body.inertias().centroidal_column(dof, &com)).collect();
    for (i, (li, ki)) in columns.iter().enumerate() {
        for (j, (lj, kj)) in columns.iter().enumerate() {
            system[(i, j)] = settings.linear_weight * li.dot(lj) + settings.angular_weight * ki.dot(kj);
        }
        right[i] =
            settings.linear_weight * li.dot(&linear_error) + settings.angular_weight * ki.dot(&angular_error);
        if i >= 6 {
            system[(i, i)] += settings.posture_weight;
            right[i] += settings.posture_weight * targets.joints[i - 6];
        }
    }
    for foot in 0..2 {
        let index = body.model().feet[foot];
        let offset = body.kinematics().position[index];
        let jacobian = body.jacobian(index, &offset);
        let (angular, linear) = body.jdot_qdot(index, &offset);
        for row in 0..6 {
            let place = DOF + 6 * foot + row;
            for dof in 0..DOF {
                system[(place, dof)] = jacobian[(row, dof)];
                system[(dof, place)] = jacobian[(row, dof)];
            }
            system[(place, place)] = -1e-10;
            right[place] = if row < 3 {
                targets.feet[foot].0[row] - angular[row]
            } else {
                targets.feet[foot].1[row - 3] - linear[row - 3]
            };
        }
    }
    let solution = system.full_piv_lu().solve(&right).unwrap();
    GenVec::from_fn(|i, _| solution[i])
}

fn compare(body: &Engine, targets: &Targets, settings: &BalanceSettings) -> f64 {
    let (fast, slow) = (kkt::solve(body, targets, settings), dense(body, targets, settings));
    (fast - slow).amax() / slow.amax().max(1.0)
}

fn random_targets(random: &mut Random) -> Targets {
    Targets {
        linear_rate: 200.0 * random.vector(),
        angular_rate: 50.0 * random.vector(),
        joints: JointVec::from_fn(|_, _| 10.0 * random.unit()),
        feet: [0, 1].map(|_| (random.vector(), random.vector())),
    }
}

#[test]
fn equals_the_dense_system_at_random_states() {
    let mut random = Random(1);
    let mut worst: f64 = 0.0;
    for _ in 0..100 {
        let body = random.swaying(0.3);
        let targets = random_targets(&mut random);
        worst = worst.max(compare(&body, &targets, &BalanceSettings::default()));
    }
    println!("largest relative difference {worst:e}");
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn equals_the_dense_system_for_other_weights() {
    let mut random = Random(2);
    let body = random.swaying(0.2);
    for (linear_weight, angular_weight, posture_weight) in
        [(1.0, 1.0, 1.0), (10.0, 0.01, 100.0), (0.1, 3.0, 5.0)]
    {
        let weights =
            BalanceSettings { linear_weight, angular_weight, posture_weight, ..BalanceSettings::default() };
        let difference = compare(&body, &random_targets(&mut random), &weights);
        assert!(difference < 1e-8, "{difference:e}");
    }
}

#[test]
fn the_feet_accelerate_as_asked_and_nothing_to_do_means_nothing_done() {
    let mut random = Random(3);
    let body = random.swaying(0.3);
    let targets = random_targets(&mut random);
    let qdd = kkt::solve(&body, &targets, &BalanceSettings::default());
    for foot in 0..2 {
        let index = body.model().feet[foot];
        let offset = body.kinematics().position[index];
        let (angular, linear) = body.jdot_qdot(index, &offset);
        let acceleration = body.jacobian(index, &offset) * qdd;
        let (want_angular, want_linear) = (targets.feet[foot].0 - angular, targets.feet[foot].1 - linear);
        assert!((acceleration.fixed_rows::<3>(0) - want_angular).norm() < 1e-6);
        assert!((acceleration.fixed_rows::<3>(3) - want_linear).norm() < 1e-6);
    }
    let rest = Targets {
        linear_rate: Vector3::zeros(),
        angular_rate: Vector3::zeros(),
        joints: JointVec::zeros(),
        feet: [(Vector3::zeros(), Vector3::zeros()); 2],
    };
    assert!(kkt::solve(&standing(), &rest, &BalanceSettings::default()).amax() < 1e-12);
}
