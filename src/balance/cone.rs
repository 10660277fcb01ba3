//! Shares the wrench the ground must supply among the contact points, every force inside its friction cone.
//!
//! Solved exactly:
//!
//! ```text
//! min ½ Σ |F_i|² + |Σ A_i F_i - w|² / (2 δ)      F_i in the cone { |t| <= μ n }
//! ```
//!
//! by Newton's method on the dual, six unknowns y: `F_i = P_K(A_iᵀ y)`, `Σ A_i F_i + δ y = w`. The dual is convex and
//! piecewise smooth; from the last tick's y two rounds suffice on average. Source: `spec/contact-closed-loop.md`,
//! fix 1 (plain least squares without cones falls at 30 rpm / 15 s; a pyramid solved by coordinate descent costs
//! thirty times as much and jumps between solutions).

use nalgebra::{Cholesky, Matrix3, SMatrix, SVector, Vector3};

use crate::character::CONTACTS;

type Vector6 = SVector<f64, 6>;
type Matrix6 = SMatrix<f64, 6, 6>;

/// Softness δ of the wrench: small against (N/point)².
const SOFTNESS: f64 = 1e-4;
/// Rounds of Newton's method: about 2 while standing, 15 from nothing to a wrench beyond the soles. More than this is
/// only asked by wrenches that pull, after which the forces are inside their cones but not quite the nearest.
const MAX_ROUNDS: usize = 40;
/// Bisections of the line search.
const BISECTIONS: usize = 16;
/// Rise at the end of a step, relative to the fall at its start, up to which the whole step is taken.
const FLAT: f64 = 0.1;
/// Residual of the dual equation that counts as solved, relative to the wrench.
const TOLERANCE: f64 = 1e-11;

/// Forces at the contact points and what they leave unsupplied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupportForces {
    /// Force of the ground on the foot at each point, world axes, N.
    pub force: [Vector3<f64>; CONTACTS],
    /// Wrench that the forces do not supply: force, then moment.
    pub unsupplied: Vector6,
}

/// The distribution with its warm start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceDistribution {
    dual: Vector6,
}

impl Default for ForceDistribution {
    fn default() -> Self {
        Self { dual: Vector6::zeros() }
    }
}

impl ForceDistribution {
    /// Forces at `points` (relative to the point the moment of `wrench` is taken about) for `wrench` = force, moment.
    ///
    /// Each point carries at least `least_force` along `normal`; the rest lies in a cone of `friction` about it.
    pub fn share(
        &mut self,
        points: &[Vector3<f64>; CONTACTS],
        normal: &Vector3<f64>,
        wrench: &Vector6,
        friction: f64,
        least_force: f64,
    ) -> SupportForces {
        let least = least_force * normal;
        let mut target = *wrench;
        for point in points {
            target -= wrench_of(point, &least);
        }
        let cone = Cone { normal: *normal, friction };
        let state = self.newton(points, &cone, &target);
        let mut unsupplied = *wrench;
        let force = std::array::from_fn(|i| state.force[i] + least);
        for (point, f) in points.iter().zip(&force) {
            unsupplied -= wrench_of(point, f);
        }
        SupportForces { force, unsupplied }
    }

    /// Minimises the dual from the last solution by Newton's method with an exact line search.
    fn newton(&mut self, points: &[Vector3<f64>; CONTACTS], cone: &Cone, target: &Vector6) -> Evaluation {
        let mut state = Evaluation::at(&self.dual, points, cone, target);
        if !state.gradient.iter().all(|g| g.is_finite()) {
            self.dual = Vector6::zeros();
            state = Evaluation::at(&self.dual, points, cone, target);
        }
        let small = TOLERANCE * (1.0 + target.norm());
        for _ in 0..MAX_ROUNDS {
            if state.gradient.norm() < small {
                break;
            }
            let Some(factor) = Cholesky::new(hessian(&self.dual, points, cone)) else { break };
            let step = factor.solve(&state.gradient);
            let at = |share: f64| {
                let dual = self.dual - share * step;
                (dual, Evaluation::at(&dual, points, cone, target))
            };
            // Nothing but rounding is left when the dual does not fall along its own Newton step.
            let Some(next) = line_search(at, &step, step.dot(&state.gradient)) else { break };
            (self.dual, state) = next;
        }
        state
    }
}

/// The whole step if the dual falls to its end, else the place where it stops falling (by bisection; the dual is convex).
/// `slope` is how fast it falls at the start.
fn line_search(
    at: impl Fn(f64) -> (Vector6, Evaluation),
    step: &Vector6,
    slope: f64,
) -> Option<(Vector6, Evaluation)> {
    let whole = at(1.0);
    let over = -whole.1.gradient.dot(step);
    if over <= FLAT * slope {
        return Some(whole);
    }
    let (mut low, mut high, mut best) = (0.0, 1.0, None);
    for _ in 0..BISECTIONS {
        let share = 0.5 * (low + high);
        let next = at(share);
        if next.1.gradient.dot(step) > 0.0 {
            low = share;
            best = Some(next);
        } else {
            high = share;
        }
    }
    best
}

/// Force and moment of `force` acting at `point`.
fn wrench_of(point: &Vector3<f64>, force: &Vector3<f64>) -> Vector6 {
    let moment = point.cross(force);
    Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}

/// `A_iᵀ y`: what the dual asks of a point.
fn asked(point: &Vector3<f64>, dual: &Vector6) -> Vector3<f64> {
    dual.fixed_rows::<3>(0) + dual.fixed_rows::<3>(3).cross(point)
}

/// Gradient of the dual objective and the forces at one y.
struct Evaluation {
    gradient: Vector6,
    force: [Vector3<f64>; CONTACTS],
}

impl Evaluation {
    fn at(dual: &Vector6, points: &[Vector3<f64>; CONTACTS], cone: &Cone, target: &Vector6) -> Self {
        let mut gradient = SOFTNESS * dual - target;
        let force = std::array::from_fn(|i| {
            let force = cone.project(&asked(&points[i], dual));
            gradient += wrench_of(&points[i], &force);
            force
        });
        Self { gradient, force }
    }
}

fn hessian(dual: &Vector6, points: &[Vector3<f64>; CONTACTS], cone: &Cone) -> Matrix6 {
    let mut ff = Matrix3::from_diagonal_element(SOFTNESS);
    let (mut mf, mut mm) = (Matrix3::zeros(), ff);
    for point in points {
        let slope = cone.projection_slope(&asked(point, dual));
        let arm = point.cross_matrix();
        let lever = arm * slope;
        ff += slope;
        mf += lever;
        mm += lever * arm.transpose();
    }
    let mut h = Matrix6::zeros();
    h.fixed_view_mut::<3, 3>(0, 0).copy_from(&ff);
    h.fixed_view_mut::<3, 3>(3, 0).copy_from(&mf);
    h.fixed_view_mut::<3, 3>(0, 3).copy_from(&mf.transpose());
    h.fixed_view_mut::<3, 3>(3, 3).copy_from(&mm);
    h
}

/// A circular friction cone about `normal`.
struct Cone {
    normal: Vector3<f64>,
    friction: f64,
}

impl Cone {
    /// Normal part, tangential vector and its length.
    fn split(&self, v: &Vector3<f64>) -> (f64, Vector3<f64>, f64) {
        let n = v.dot(&self.normal);
        let t = v - n * self.normal;
        (n, t, t.norm())
    }

    /// Nearest point of the cone.
    fn project(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let (n, t, length) = self.split(v);
        let mu = self.friction;
        if length <= mu * n {
            *v
        } else if mu * length <= -n {
            Vector3::zeros()
        } else {
            let s = (n + mu * length) / (1.0 + mu * mu);
            s * self.normal + (mu * s / length) * t
        }
    }

    /// Derivative of the projection (one of them where it has a kink).
    fn projection_slope(&self, v: &Vector3<f64>) -> Matrix3<f64> {
        let (n, t, length) = self.split(v);
        let mu = self.friction;
        if length <= mu * n {
            Matrix3::identity()
        } else if mu * length <= -n {
            Matrix3::zeros()
        } else {
            let along = t / length;
            let ray = (self.normal + mu * along) / (1.0 + mu * mu).sqrt();
            let across =
                Matrix3::identity() - self.normal * self.normal.transpose() - along * along.transpose();
            let s = (n + mu * length) / (1.0 + mu * mu);
            ray * ray.transpose() + (mu * s / length) * across
        }
    }
}
