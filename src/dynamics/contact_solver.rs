//! Solves the contact problem: a direct all-stick solution first, block Gauss-Seidel with true friction cones else.
//!
//! Standing on both feet nearly every step is all-stick, so one Cholesky factorisation gives the exact answer. When a
//! point pulls it is dropped (at most [`MAX_DROPS`] rounds); when one would leave its cone the iterative solver runs a
//! fixed number of sweeps from the last step's impulses.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::character::CONTACTS;

/// Rows of one contact point: two tangents, then the normal.
pub(super) const POINT_ROWS: usize = 3;
/// All rows.
const ROWS: usize = POINT_ROWS * CONTACTS;
/// Rounds of dropping pulling points before the iterative solver takes over.
const MAX_DROPS: usize = 4;
/// A dropped point may approach the ground at most this fast, m/s, for the direct solution to stand.
const APPROACH_TOLERANCE: f64 = 1e-9;

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

/// `A λ + b` with `λ_n >= 0`, `|λ_t| <= μ λ_n`. Rows of point `i` are `3 i ..= 3 i + 2`.
#[derive(Clone, Debug)]
pub(super) struct ContactProblem {
    /// Points that take part.
    pub(super) active: [bool; CONTACTS],
    /// Symmetric `(24 x 24)`, both triangles filled for active points.
    matrix: [[f64; ROWS]; ROWS],
    /// Velocity b of each point without impulses, contact axes, m/s, position correction included.
    pub(super) offset_velocity: [Vector3<f64>; CONTACTS],
    /// Solution and warm start, contact axes, N s.
    pub(super) impulse: [Vector3<f64>; CONTACTS],
    /// Coulomb friction coefficient.
    pub(super) friction: f64,
    /// Compact scratch of the direct solver, upper triangle row by row.
    scratch: [[f64; ROWS]; ROWS],
}

impl Default for ContactProblem {
    fn default() -> Self {
        Self {
            active: [false; CONTACTS],
            matrix: [[0.0; ROWS]; ROWS],
            offset_velocity: [Vector3::zeros(); CONTACTS],
            impulse: [Vector3::zeros(); CONTACTS],
            friction: 1.0,
            scratch: [[0.0; ROWS]; ROWS],
        }
    }
}

impl ContactProblem {
    /// Sets the block of points `i`, `j` and its mirror image.
    pub(super) fn set_block(&mut self, i: usize, j: usize, block: &Matrix3<f64>) {
        for r in 0..POINT_ROWS {
            for c in 0..POINT_ROWS {
                self.matrix[POINT_ROWS * i + r][POINT_ROWS * j + c] = block[(r, c)];
                self.matrix[POINT_ROWS * j + c][POINT_ROWS * i + r] = block[(r, c)];
            }
        }
    }

    /// Adds `relative` times itself to each diagonal entry: 24 rows stand on 12 degrees of freedom.
    pub(super) fn soften(&mut self, relative: f64) {
        for i in (0..CONTACTS).filter(|i| self.active[*i]) {
            for r in POINT_ROWS * i..POINT_ROWS * (i + 1) {
                self.matrix[r][r] *= 1.0 + relative;
            }
        }
    }

    fn block(&self, i: usize, j: usize) -> Matrix3<f64> {
        Matrix3::from_fn(|r, c| self.matrix[POINT_ROWS * i + r][POINT_ROWS * j + c])
    }

    /// Velocity of point `i` for the present impulses.
    pub(super) fn velocity(&self, i: usize) -> Vector3<f64> {
        let mut velocity = self.offset_velocity[i];
        for j in (0..CONTACTS).filter(|j| self.active[*j]) {
            let impulse = &self.impulse[j];
            for r in 0..POINT_ROWS {
                let row = &self.matrix[POINT_ROWS * i + r][POINT_ROWS * j..POINT_ROWS * (j + 1)];
                velocity[r] += row[0] * impulse.x + row[1] * impulse.y + row[2] * impulse.z;
            }
        }
        velocity
    }

    /// Solves in place; `impulse` holds the warm start on entry and the solution on return.
    pub(super) fn solve(&mut self, sweeps: usize) -> ContactMethod {
        if !self.active.contains(&true) {
            return ContactMethod::None;
        }
        let warm = self.impulse;
        if self.direct() {
            return ContactMethod::Direct;
        }
        self.impulse = warm;
        self.iterate(sweeps);
        ContactMethod::Iterative
    }

    /// All-stick solution over the loaded points; false when it is none.
    fn direct(&mut self) -> bool {
        let mut loaded = self.active;
        for _ in 0..MAX_DROPS {
            self.stick(&loaded);
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

    /// Cholesky solution of `A λ = -b` over the loaded points; the others get zero.
    fn stick(&mut self, loaded: &[bool; CONTACTS]) {
        let mut rows = [0usize; ROWS];
        let mut count = 0;
        for i in (0..CONTACTS).filter(|i| loaded[*i]) {
            for r in 0..POINT_ROWS {
                rows[count] = POINT_ROWS * i + r;
                count += 1;
            }
        }
        let mut x = [0.0; ROWS];
        for p in 0..count {
            let source = &self.matrix[rows[p]];
            for q in p..count {
                self.scratch[p][q] = source[rows[q]];
            }
            x[p] = -self.offset_velocity[rows[p] / POINT_ROWS][rows[p] % POINT_ROWS];
        }
        cholesky_solve(&mut self.scratch, &mut x, count);
        self.impulse = [Vector3::zeros(); CONTACTS];
        for p in 0..count {
            self.impulse[rows[p] / POINT_ROWS][rows[p] % POINT_ROWS] = x[p];
        }
    }

    pub(super) fn iterate(&mut self, sweeps: usize) {
        let mut inverse = [Matrix3::zeros(); CONTACTS];
        for i in (0..CONTACTS).filter(|i| self.active[*i]) {
            inverse[i] = self.block(i, i).try_inverse().unwrap_or_else(Matrix3::zeros);
        }
        for i in (0..CONTACTS).filter(|i| !self.active[*i]) {
            self.impulse[i] = Vector3::zeros();
        }
        for _ in 0..sweeps {
            for i in (0..CONTACTS).filter(|i| self.active[*i]) {
                let velocity = self.velocity(i);
                let sticking = self.impulse[i] - inverse[i] * velocity;
                self.impulse[i] =
                    if inside_cone(&sticking, self.friction) { sticking } else { self.slide(i, &velocity) };
            }
        }
    }

    /// One point that cannot stick: normal row first, then the tangents projected onto the disk of that load.
    fn slide(&self, i: usize, velocity: &Vector3<f64>) -> Vector3<f64> {
        let a = self.block(i, i);
        let old = self.impulse[i];
        let normal = (old.z - velocity.z / a[(2, 2)]).max(0.0);
        let change = normal - old.z;
        let slip = Vector2::new(velocity.x + a[(0, 2)] * change, velocity.y + a[(1, 2)] * change);
        // Gradient step with the larger eigenvalue of the tangential block: a contraction for any anisotropy.
        let (mean, half) = ((a[(0, 0)] + a[(1, 1)]) / 2.0, (a[(0, 0)] - a[(1, 1)]) / 2.0);
        let stiffest = mean + (half * half + a[(0, 1)] * a[(0, 1)]).sqrt();
        let mut tangential = Vector2::new(old.x, old.y) - slip / stiffest;
        let (length, limit) = (tangential.norm(), self.friction * normal);
        if length > limit {
            tangential *= if length > 0.0 { limit / length } else { 0.0 };
        }
        Vector3::new(tangential.x, tangential.y, normal)
    }
}

fn inside_cone(impulse: &Vector3<f64>, friction: f64) -> bool {
    let limit = friction * impulse.z;
    impulse.z >= 0.0 && impulse.x * impulse.x + impulse.y * impulse.y <= limit * limit
}

/// `x <- A⁻¹ x` for the leading `count` rows of a symmetric positive definite `a` (upper triangle), in place.
///
/// Right-looking `A = Uᵀ U`: the inner loops update contiguous rows, without a sum to wait for.
pub(crate) fn cholesky_solve<const N: usize>(a: &mut [[f64; N]; N], x: &mut [f64; N], count: usize) {
    let mut inverse = [0.0; N];
    for k in 0..count {
        let (above, below) = a.split_at_mut(k + 1);
        let pivot = &mut above[k][..count];
        inverse[k] = 1.0 / pivot[k].sqrt();
        for entry in &mut pivot[k + 1..] {
            *entry *= inverse[k];
        }
        for (row, i) in below.iter_mut().zip(k + 1..count) {
            subtract_scaled(&mut row[i..count], pivot[i], &pivot[i..]);
        }
        x[k] *= inverse[k];
        let value = x[k];
        subtract_scaled(&mut x[k + 1..count], value, &pivot[k + 1..]);
    }
    for k in (0..count).rev() {
        let known: f64 = a[k][k + 1..count].iter().zip(&x[k + 1..count]).map(|(u, x)| u * x).sum();
        x[k] = (x[k] - known) * inverse[k];
    }
}

/// `x -= scale y`
#[inline]
fn subtract_scaled(x: &mut [f64], scale: f64, y: &[f64]) {
    for (x, y) in x.iter_mut().zip(y) {
        *x -= scale * y;
    }
}
