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
use crate::character::{Foot, GenVec, JOINTS, JointVec};
use crate::dynamics::{Dynamics, cholesky_solve};

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
pub(super) fn solve<D: Dynamics>(body: &D, targets: &Targets, settings: &BalanceSettings) -> GenVec {
    let system = System::build(body, targets);
    let inverse_weights =
        [1.0 / settings.linear_weight, 1.0 / settings.angular_weight, 1.0 / settings.posture_weight];
    let mut correction = system.residual(targets);
    let mut matrix = system.weighted_square(&inverse_weights);
    cholesky_solve(&mut matrix, &mut correction, ROWS);
    system.accelerations(body, targets, &inverse_weights, &correction)
}

/// The constraint matrix B, column by column, and what is needed to come back to accelerations.
struct System {
    /// Columns of the linear momentum rate.
    linear: [[f64; ROWS]; 3],
    /// Columns of the angular momentum rate.
    angular: [[f64; ROWS]; 3],
    /// Columns of the hinges.
    joints: [[f64; ROWS]; JOINTS],
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
        let linear = std::array::from_fn(|i| column(&Vector3::ith(i, 1.0), &Vector3::zeros()));
        let angular = std::array::from_fn(|i| column(&Vector3::zeros(), &Vector3::ith(i, 1.0)));

        // A hinge moves its own limb; with the momentum held, the whole body recoils as a rigid one.
        let mut joints: [[f64; ROWS]; JOINTS] = std::array::from_fn(|j| {
            let (l, k) = inertias.centroidal_column(6 + j, &com_offset);
            column(&-l, &-k)
        });
        for foot in Foot::BOTH {
            let index = foot as usize;
            for &dof in model.body_chain(model.feet[index]).iter().filter(|dof| **dof >= 6) {
                let axis = &kinematics.axis[dof];
                let at_foot = axis.at(&feet[index]);
                for r in 0..3 {
                    joints[dof - 6][6 * index + r] += axis.angular[r];
                    joints[dof - 6][6 * index + 3 + r] += at_foot[r];
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
        Self { linear, angular, joints, right, inverse_inertia, com_offset, mass, bias }
    }

    /// `r - B z0`.
    fn residual(&self, targets: &Targets) -> [f64; ROWS] {
        let l = targets.linear_rate - self.bias.0;
        let k = targets.angular_rate - self.bias.1;
        let mut residual = self.right;
        let parts = self.linear.iter().zip(l.iter()).chain(self.angular.iter().zip(k.iter()));
        for (column, value) in parts.chain(self.joints.iter().zip(targets.joints.iter())) {
            for (r, entry) in residual.iter_mut().zip(column) {
                *r -= entry * value;
            }
        }
        residual
    }

    /// `B W⁻¹ Bᵀ + ε`, upper triangle.
    fn weighted_square(&self, inverse_weights: &[f64; 3]) -> [[f64; ROWS]; ROWS] {
        let mut square = [[0.0; ROWS]; ROWS];
        for (columns, weight) in
            [&self.linear[..], &self.angular[..], &self.joints[..]].into_iter().zip(inverse_weights)
        {
            for column in columns {
                for (i, row) in square.iter_mut().enumerate() {
                    let scaled = weight * column[i];
                    for (entry, other) in row[i..].iter_mut().zip(&column[i..]) {
                        *entry += scaled * other;
                    }
                }
            }
        }
        for (i, row) in square.iter_mut().enumerate() {
            row[i] += REGULARISATION;
        }
        square
    }

    fn accelerations<D: Dynamics>(
        &self,
        body: &D,
        targets: &Targets,
        inverse_weights: &[f64; 3],
        correction: &[f64; ROWS],
    ) -> GenVec {
        let dot = |column: &[f64; ROWS]| column.iter().zip(correction).map(|(a, b)| a * b).sum::<f64>();
        let mut l = targets.linear_rate - self.bias.0;
        let mut k = targets.angular_rate - self.bias.1;
        for i in 0..3 {
            l[i] += inverse_weights[0] * dot(&self.linear[i]);
            k[i] += inverse_weights[1] * dot(&self.angular[i]);
        }
        let mut qdd = GenVec::zeros();
        for j in 0..JOINTS {
            let value = targets.joints[j] + inverse_weights[2] * dot(&self.joints[j]);
            qdd[6 + j] = value;
            let (lj, kj) = body.inertias().centroidal_column(6 + j, &self.com_offset);
            l -= value * lj;
            k -= value * kj;
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
