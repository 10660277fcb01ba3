//! The acceleration problem of Eq. 18 with static contact, solved without a 53 x 53 system.
//!
//! ```text
//! min  b_l |l̇ - l̇_des|² + b_k |k̇ - k̇_des|² + b_q |q̈_j - q̈_des|²     subject to  J q̈ = a_sup - J̇ q̇
//! ```
//!
//! With the momentum rates in place of the root accelerations as unknowns, `z = (l̇, k̇, q̈_j)`, the weights are diagonal
//! and the answer is the weighted minimum-norm correction `z = z0 + W⁻¹ Bᵀ (B W⁻¹ Bᵀ + ε)⁻¹ (r - B z0)`: one inverse of
//! the 3 x 3 inertia about the centre of mass and one 12 x 12 Cholesky factorisation. Equal to the dense KKT system to
//! rounding (a test compares them).

use nalgebra::{Matrix3, Vector3};

use super::BalanceSettings;
use crate::character::{DOF, Foot, GenVec, JointVec};
use crate::dynamics::{Dynamics, add_scaled, cholesky_solve, dot};

/// Rows of the static-contact constraint: angular and linear acceleration of two feet.
pub(super) const ROWS: usize = 12;
/// Regularisation of the constraint rows.
const REGULARISATION: f64 = 1e-10;

/// What the accelerations should be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Targets {
    /// Rate of linear momentum, N.
    pub(super) linear_rate: Vector3<f64>,
    /// Rate of angular momentum about the centre of mass, N m.
    pub(super) angular_rate: Vector3<f64>,
    /// Hinge accelerations, rad/s².
    pub(super) joints: JointVec,
    /// Acceleration of each foot's origin: angular, linear.
    pub(super) feet: [(Vector3<f64>, Vector3<f64>); 2],
}

/// Accelerations that follow `targets` as well as the static contacts allow.
#[inline(never)] // a stage of its own in a profile
pub(super) fn solve<D: Dynamics>(body: &D, targets: &Targets, settings: &BalanceSettings) -> GenVec {
    let system = System::build(body, targets);
    let inverse_weights = inverse_weights(settings);
    let mut wanted = system.wanted(targets);
    let mut correction = system.residual(&wanted);
    let mut matrix = system.weighted_square(&inverse_weights);
    cholesky_solve(&mut matrix, &mut correction);
    for ((z, weight), column) in wanted.iter_mut().zip(&inverse_weights).zip(&system.columns) {
        *z += weight * dot(column, &correction);
    }
    system.accelerations(body, &wanted)
}

/// W⁻¹: one number for each entry of z.
fn inverse_weights(settings: &BalanceSettings) -> [f64; DOF] {
    let mut inverse = [1.0 / settings.posture_weight; DOF];
    inverse[..3].fill(1.0 / settings.linear_weight);
    inverse[3..6].fill(1.0 / settings.angular_weight);
    inverse
}

/// The constraint matrix B and what is needed to come back to accelerations.
struct System {
    /// B column by column: linear and angular momentum rate, then the hinges.
    columns: [[f64; ROWS]; DOF],
    /// Right-hand side r minus the velocity-product part of the root.
    right: [f64; ROWS],
    inverse_inertia: Matrix3<f64>,
    com_offset: Vector3<f64>,
    mass: f64,
    /// Momentum rates at zero acceleration.
    bias: (Vector3<f64>, Vector3<f64>),
}

impl System {
    fn build<D: Dynamics>(body: &D, targets: &Targets) -> Self {
        let (model, kinematics, inertias) = (body.model(), body.kinematics(), body.inertias());
        let com_offset = inertias.com_offset();
        let mass = inertias.composite[0].mass;
        let inverse_inertia = inertias.about_com().try_inverse().unwrap_or_else(Matrix3::zeros);
        let rate = &body.velocity_forces().momentum_rate;
        let bias = (rate.force, rate.moment - com_offset.cross(&rate.force));
        let feet = model.feet.map(|foot| kinematics.position[foot]);
        let arms = feet.map(|foot| foot - com_offset);

        // A unit momentum rate (l, k) moves the root as a rigid body: angular I⁻¹ k, linear at the centre l / m.
        let column =
            |l: &Vector3<f64>, k: &Vector3<f64>| rigid_column(&(inverse_inertia * k), &(l / mass), &arms);
        // A hinge moves its own limb; with the momentum held, the whole body recoils as a rigid one.
        let mut columns: [[f64; ROWS]; DOF] = std::array::from_fn(|i| match i {
            0..3 => column(&Vector3::ith(i, 1.0), &Vector3::zeros()),
            3..6 => column(&Vector3::zeros(), &Vector3::ith(i - 3, 1.0)),
            _ => {
                let (l, k) = inertias.centroidal_column(i, &com_offset);
                column(&-l, &-k)
            }
        });
        for foot in Foot::BOTH {
            let index = foot as usize;
            for &dof in model.body_chain(model.feet[index]).iter().filter(|dof| **dof >= 6) {
                let axis = &kinematics.axis[dof];
                let at_foot = axis.at(&feet[index]);
                for r in 0..3 {
                    columns[dof][6 * index + r] += axis.angular[r];
                    columns[dof][6 * index + 3 + r] += at_foot[r];
                }
            }
        }
        let mut right = [0.0; ROWS];
        for foot in 0..2 {
            let (angular, linear) = body.jdot_qdot(model.feet[foot], &feet[foot]);
            let (a, l) = (targets.feet[foot].0 - angular, targets.feet[foot].1 - linear);
            right[6 * foot..6 * foot + 3].copy_from_slice(a.as_slice());
            right[6 * foot + 3..6 * foot + 6].copy_from_slice(l.as_slice());
        }
        Self { columns, right, inverse_inertia, com_offset, mass, bias }
    }

    /// z0: the targets, momentum rates without what velocities alone contribute.
    fn wanted(&self, targets: &Targets) -> [f64; DOF] {
        let mut wanted = [0.0; DOF];
        wanted[..3].copy_from_slice((targets.linear_rate - self.bias.0).as_slice());
        wanted[3..6].copy_from_slice((targets.angular_rate - self.bias.1).as_slice());
        wanted[6..].copy_from_slice(targets.joints.as_slice());
        wanted
    }

    /// `r - B z0`.
    fn residual(&self, wanted: &[f64; DOF]) -> [f64; ROWS] {
        let mut residual = self.right;
        for (column, value) in self.columns.iter().zip(wanted) {
            add_scaled(&mut residual, -value, column);
        }
        residual
    }

    /// `B W⁻¹ Bᵀ + ε`, upper triangle and the rest of the diagonal blocks.
    fn weighted_square(&self, inverse_weights: &[f64; DOF]) -> [[f64; ROWS]; ROWS] {
        // Row by row, so that a sum stays in registers through all columns; the right foot's rows leave out the block
        // that mirrors the left foot's.
        let mut square: [[f64; ROWS]; ROWS] = std::array::from_fn(|i| {
            let mut row = [0.0; ROWS];
            for (column, weight) in self.columns.iter().zip(inverse_weights) {
                let scaled = weight * column[i];
                if i < ROWS / 2 {
                    add_scaled(&mut row, scaled, column);
                } else {
                    add_scaled(&mut row[ROWS / 2..], scaled, &column[ROWS / 2..]);
                }
            }
            row
        });
        for (i, row) in square.iter_mut().enumerate() {
            row[i] += REGULARISATION;
        }
        square
    }

    /// Generalised accelerations of z.
    fn accelerations<D: Dynamics>(&self, body: &D, z: &[f64; DOF]) -> GenVec {
        let (mut l, mut k) = (Vector3::new(z[0], z[1], z[2]), Vector3::new(z[3], z[4], z[5]));
        let mut qdd = GenVec::from_column_slice(z);
        for (dof, value) in z.iter().enumerate().skip(6) {
            let (lj, kj) = body.inertias().centroidal_column(dof, &self.com_offset);
            l -= *value * lj;
            k -= *value * kj;
        }
        let omega_rate = self.inverse_inertia * k;
        let linear = l / self.mass - omega_rate.cross(&self.com_offset);
        let angular = body.kinematics().rot_world_body[0].transpose() * omega_rate;
        qdd.fixed_rows_mut::<3>(0).copy_from(&linear);
        qdd.fixed_rows_mut::<3>(3).copy_from(&angular);
        qdd
    }
}

/// Accelerations of both feet when everything turns rigidly with `angular` about a centre that accelerates with `linear`.
fn rigid_column(angular: &Vector3<f64>, linear: &Vector3<f64>, arms: &[Vector3<f64>; 2]) -> [f64; ROWS] {
    let mut column = [0.0; ROWS];
    for (foot, arm) in arms.iter().enumerate() {
        let at_foot = linear + angular.cross(arm);
        column[6 * foot..6 * foot + 3].copy_from_slice(angular.as_slice());
        column[6 * foot + 3..6 * foot + 6].copy_from_slice(at_foot.as_slice());
    }
    column
}
