//! Solves the contact problem: a direct all-stick solution first, block Gauss-Seidel with true friction cones else.
//!
//! Eight points have 24 rows, but two rigid feet have only 12 velocities, and everything here works on those. With V the
//! feet's velocities relative to the ground before the impulses, `B = J M⁻¹ Jᵀ` their mobility, R the rows of the
//! points, b their position correction and C their compliance, the impulses λ give
//!
//! ```text
//! feet after the step:   v = V + B Rᵀ λ             points after the step:   R v + C λ + b
//! ```
//!
//! Standing on both feet nearly every step is all-stick: every point ends with zero. Without λ that is
//!
//! ```text
//! (B⁻¹ + Rᵀ C⁻¹ R) v = B⁻¹ V - Rᵀ C⁻¹ b             λ = -C⁻¹ (R v + b)
//! ```
//!
//! the inertia the feet feel and the stiffness of the points that hold them: exact, and 12 x 12 instead of 24 x 24.
//! When a point pulls it is dropped (at most [`MAX_DROPS`] rounds) and takes its stiffness with it; when one would
//! leave its cone the iterative solver sweeps from the last step's impulses until they settle, at most a given number of
//! times.

use nalgebra::{Matrix3, Vector2, Vector3};

use super::dense::{add_scaled, cholesky_solve, dot, invert};
use crate::character::{CONTACTS, Foot};

/// Rows of one contact point: two tangents, then the normal.
pub(super) const POINT_ROWS: usize = 3;
/// Numbers in the spatial velocity of one foot: angular, linear.
pub(super) const FOOT_ROWS: usize = 6;
/// Numbers in the spatial velocities of both feet.
pub(super) const FEET_ROWS: usize = 2 * FOOT_ROWS;
/// Rounds of dropping pulling points before the iterative solver takes over.
const MAX_DROPS: usize = 4;
/// A dropped point may approach the ground at most this fast, m/s, for the direct solution to stand.
const APPROACH_TOLERANCE: f64 = 1e-9;

/// Velocity of a contact point, contact axes, from the spatial velocity of its foot.
pub(super) type PointRows = [[f64; FOOT_ROWS]; POINT_ROWS];
/// A matrix between spatial velocities and wrenches of both feet, left foot first.
pub(super) type FeetMatrix = [[f64; FEET_ROWS]; FEET_ROWS];

/// How a contact problem was solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ContactMethod {
    /// No point near the ground.
    #[default]
    None,
    /// All loaded points stick: exact.
    Direct,
    /// Block Gauss-Seidel with friction cones.
    Iterative,
}

/// `R (V + B Rᵀ λ) + C λ + b` against `λ_n >= 0`, `|λ_t| <= μ λ_n`.
#[derive(Clone, Debug)]
pub(super) struct ContactProblem {
    /// Points that take part.
    pub(super) active: [bool; CONTACTS],
    /// R of each point.
    pub(super) rows: [PointRows; CONTACTS],
    /// B, both triangles filled.
    pub(super) mobility: FeetMatrix,
    /// C of each point: softening of its rows, 1/kg.
    pub(super) compliance: [Vector3<f64>; CONTACTS],
    /// b of each point: velocity that corrects its position, contact axes, m/s.
    pub(super) correction: [Vector3<f64>; CONTACTS],
    /// V: the feet's velocities relative to the ground after the step without impulses.
    pub(super) feet_before: [f64; FEET_ROWS],
    /// Solution and warm start, contact axes, N s.
    pub(super) impulse: [Vector3<f64>; CONTACTS],
    /// Coulomb friction coefficient.
    pub(super) friction: f64,
    /// v: the same with the impulses.
    feet_after: [f64; FEET_ROWS],
}

impl Default for ContactProblem {
    fn default() -> Self {
        Self {
            active: [false; CONTACTS],
            rows: [[[0.0; FOOT_ROWS]; POINT_ROWS]; CONTACTS],
            mobility: [[0.0; FEET_ROWS]; FEET_ROWS],
            compliance: [Vector3::zeros(); CONTACTS],
            correction: [Vector3::zeros(); CONTACTS],
            feet_before: [0.0; FEET_ROWS],
            impulse: [Vector3::zeros(); CONTACTS],
            friction: 1.0,
            feet_after: [0.0; FEET_ROWS],
        }
    }
}

/// First of the six rows of the foot that point `i` belongs to.
fn first_row(i: usize) -> usize {
    FOOT_ROWS * Foot::of_contact(i) as usize
}

impl ContactProblem {
    /// Gives each row of point `i` a compliance of `relative` times its own diagonal entry of `R B Rᵀ`: 24 rows stand
    /// on 12 degrees of freedom.
    pub(super) fn soften(&mut self, i: usize, relative: f64) {
        let first = first_row(i);
        for (r, row) in self.rows[i].iter().enumerate() {
            let mut moved = [0.0; FOOT_ROWS];
            for (entry, mobility) in row.iter().zip(&self.mobility[first..first + FOOT_ROWS]) {
                add_scaled(&mut moved, *entry, &mobility[first..first + FOOT_ROWS]);
            }
            self.compliance[i][r] = relative * dot(row, &moved);
        }
    }

    /// Velocity of point `i` for the present impulses.
    pub(super) fn velocity(&self, i: usize) -> Vector3<f64> {
        let foot = &self.feet_after[first_row(i)..][..FOOT_ROWS];
        let moved = Vector3::from_fn(|r, _| dot(&self.rows[i][r], foot));
        moved + self.compliance[i].component_mul(&self.impulse[i]) + self.correction[i]
    }

    /// Solves in place; `impulse` holds the warm start on entry and the solution on return.
    #[inline(never)] // a stage of its own in a profile
    pub(super) fn solve(&mut self, sweeps: usize, settled: f64) -> ContactMethod {
        if !self.active.contains(&true) {
            return ContactMethod::None;
        }
        let warm = self.impulse;
        if self.direct() {
            return ContactMethod::Direct;
        }
        self.impulse = warm;
        self.iterate(sweeps, settled);
        ContactMethod::Iterative
    }

    /// All-stick solution over the loaded points; false when it is none.
    fn direct(&mut self) -> bool {
        let mut inertia = self.mobility;
        if !invert(&mut inertia) {
            return false;
        }
        let momentum = inertia.map(|row| dot(&row, &self.feet_before));
        let mut loaded = self.active;
        for _ in 0..MAX_DROPS {
            self.stick(&inertia, &momentum, &loaded);
            let pulling = |i: usize| loaded[i] && self.impulse[i].z < 0.0;
            if !(0..CONTACTS).any(pulling) {
                return self.is_solution(&loaded);
            }
            loaded = std::array::from_fn(|i| loaded[i] && !pulling(i));
        }
        false
    }

    fn is_solution(&self, loaded: &[bool; CONTACTS]) -> bool {
        (0..CONTACTS).filter(|i| self.active[*i]).all(|i| {
            if loaded[i] {
                let impulse = &self.impulse[i];
                let limit = self.friction * impulse.z;
                impulse.x * impulse.x + impulse.y * impulse.y <= limit * limit
            } else {
                self.velocity(i).z >= -APPROACH_TOLERANCE
            }
        })
    }

    /// All-stick solution with the loaded points; the others get zero. `inertia` is B⁻¹, `momentum` B⁻¹ V.
    fn stick(&mut self, inertia: &FeetMatrix, momentum: &[f64; FEET_ROWS], loaded: &[bool; CONTACTS]) {
        let (mut held, mut feet) = (*inertia, *momentum);
        for i in (0..CONTACTS).filter(|i| loaded[*i]) {
            let first = first_row(i);
            for (r, row) in self.rows[i].iter().enumerate() {
                let stiffness = 1.0 / self.compliance[i][r];
                for (p, entry) in row.iter().enumerate() {
                    let scaled = stiffness * entry;
                    feet[first + p] -= scaled * self.correction[i][r];
                    add_scaled(&mut held[first + p][first..first + FOOT_ROWS], scaled, row);
                }
            }
        }
        cholesky_solve(&mut held, &mut feet);
        self.feet_after = feet;
        self.impulse = [Vector3::zeros(); CONTACTS];
        for i in (0..CONTACTS).filter(|i| loaded[*i]) {
            self.impulse[i] = -self.velocity(i).component_div(&self.compliance[i]);
        }
    }

    #[inline(never)] // a stage of its own in a profile
    pub(super) fn iterate(&mut self, sweeps: usize, settled: f64) {
        let mut reaction = [[[0.0; FEET_ROWS]; POINT_ROWS]; CONTACTS];
        let mut block = [Matrix3::zeros(); CONTACTS];
        let mut inverse = [Matrix3::zeros(); CONTACTS];
        self.feet_after = self.feet_before;
        for i in 0..CONTACTS {
            if !self.active[i] {
                self.impulse[i] = Vector3::zeros();
                continue;
            }
            reaction[i] = self.reaction(i);
            let own = |row: usize, column: usize| {
                dot(&self.rows[i][row], &reaction[i][column][first_row(i)..][..FOOT_ROWS])
            };
            block[i] = Matrix3::from_fn(own) + Matrix3::from_diagonal(&self.compliance[i]);
            inverse[i] = block[i].try_inverse().unwrap_or_else(Matrix3::zeros);
            react(&mut self.feet_after, &reaction[i], &self.impulse[i]);
        }
        for _ in 0..sweeps {
            let mut largest_change: f64 = 0.0;
            for i in (0..CONTACTS).filter(|i| self.active[*i]) {
                let velocity = self.velocity(i);
                let old = self.impulse[i];
                let sticking = old - inverse[i] * velocity;
                let next = if inside_cone(&sticking, self.friction) {
                    sticking
                } else {
                    slide(&block[i], &old, &velocity, self.friction)
                };
                self.impulse[i] = next;
                react(&mut self.feet_after, &reaction[i], &(next - old));
                largest_change = largest_change.max((next - old).amax());
            }
            let load: f64 = self.impulse.iter().map(|impulse| impulse.z).sum();
            if largest_change < settled * load {
                break;
            }
        }
    }

    /// Change of both feet's velocities for a unit impulse in each row of point `i`: `Rᵢ B`.
    fn reaction(&self, i: usize) -> [[f64; FEET_ROWS]; POINT_ROWS] {
        self.rows[i].map(|row| {
            let mut sum = [0.0; FEET_ROWS];
            for (entry, mobility) in row.iter().zip(&self.mobility[first_row(i)..]) {
                add_scaled(&mut sum, *entry, mobility);
            }
            sum
        })
    }
}

/// Adds the effect of `impulse` on a point with this `reaction` to the feet's velocities.
fn react(feet: &mut [f64; FEET_ROWS], reaction: &[[f64; FEET_ROWS]; POINT_ROWS], impulse: &Vector3<f64>) {
    for (row, value) in reaction.iter().zip(impulse.iter()) {
        add_scaled(feet, *value, row);
    }
}

/// One point that cannot stick: normal row first, then the tangents projected onto the disk of that load. `block` is
/// the point's own block of `R B Rᵀ + C`.
fn slide(block: &Matrix3<f64>, old: &Vector3<f64>, velocity: &Vector3<f64>, friction: f64) -> Vector3<f64> {
    let a = block;
    let normal = (old.z - velocity.z / a[(2, 2)]).max(0.0);
    let change = normal - old.z;
    let slip = Vector2::new(velocity.x + a[(0, 2)] * change, velocity.y + a[(1, 2)] * change);
    // Gradient step with the larger eigenvalue of the tangential block: a contraction for any anisotropy.
    let (mean, half) = ((a[(0, 0)] + a[(1, 1)]) / 2.0, (a[(0, 0)] - a[(1, 1)]) / 2.0);
    let stiffest = mean + (half * half + a[(0, 1)] * a[(0, 1)]).sqrt();
    let mut tangential = Vector2::new(old.x, old.y) - slip / stiffest;
    let (length, limit) = (tangential.norm(), friction * normal);
    if length > limit {
        tangential *= if length > 0.0 { limit / length } else { 0.0 };
    }
    Vector3::new(tangential.x, tangential.y, normal)
}

fn inside_cone(impulse: &Vector3<f64>, friction: f64) -> bool {
    let limit = friction * impulse.z;
    impulse.z >= 0.0 && impulse.x * impulse.x + impulse.y * impulse.y <= limit * limit
}
