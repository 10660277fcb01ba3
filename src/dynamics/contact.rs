//! Contact of the eight foot points with the ground, at velocity level: setting up the problem and applying its result.
//!
//! Each active point gets three rows (two tangents, normal): the velocity relative to the ground after the step. All
//! points of a foot move with one spatial velocity, so the body comes in only through the mobility `J M⁻¹ Jᵀ` of the
//! two feet.

use nalgebra::{Matrix3, Vector3};

use super::contact_solver::{ContactProblem, FOOT_ROWS, PointRows};
use super::dense::{add_scaled, dot};
use super::factor::TreeFactor;
use super::ground::GroundSurface;
use super::kinematics::Kinematics;
use super::spatial::Motion;
use crate::character::{CONTACTS, CharacterModel, FOOT_CHAIN, Foot, GenVec};

/// Settings of the contact model. Defaults: the proven set of `spec/contact-closed-loop.md`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ContactSettings {
    /// A point closer than this to the ground takes part, m; grows with the step size.
    pub margin: f64,
    /// Share of a penetration that is pushed out in one step.
    pub error_reduction: f64,
    /// Fastest push-out, m/s.
    pub push_out_limit: f64,
    /// Softening of the rows relative to their diagonal.
    pub relative_compliance: f64,
    /// Share of the tangential drift against the anchor that is removed in one step.
    pub anchor_gain: f64,
    /// Most sweeps of the fall-back solver.
    pub sweeps: usize,
    /// Largest change of an impulse in a sweep, relative to the load, that ends the sweeps; 0 for never.
    pub settled: f64,
}

impl Default for ContactSettings {
    fn default() -> Self {
        Self {
            margin: 2e-3,
            error_reduction: 0.2,
            push_out_limit: 0.1,
            relative_compliance: 1e-4,
            anchor_gain: 0.05,
            sweeps: 20,
            // 6 mN of a body's 640 N. What goes on changing is how the points of one rigid foot share a force that no
            // motion tells apart.
            settled: 1e-5,
        }
    }
}

/// What one contact point did in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointContact {
    /// Force on the foot, world axes, N.
    pub force: Vector3<f64>,
    /// Where it acts: the lowest point of the sphere, world axes, m.
    pub position: Vector3<f64>,
    /// True when the point took part.
    pub active: bool,
}

/// Memory of the contacts from step to step: warm start and anchors. Part of the state to save.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactMemory {
    /// Impulses of the last step in contact axes, N s.
    pub impulse: [Vector3<f64>; CONTACTS],
    /// Where each sticking point took hold, in axes that turn with the surface, m.
    pub anchor: [Option<Vector3<f64>>; CONTACTS],
}

impl Default for ContactMemory {
    fn default() -> Self {
        Self { impulse: [Vector3::zeros(); CONTACTS], anchor: [None; CONTACTS] }
    }
}

/// Scratch of the contact stage.
#[derive(Clone, Debug)]
pub(super) struct ContactStage {
    /// `L⁻ᵀ Jᵀ` of each foot's spatial velocity: `(FOOT_CHAIN x 6)`.
    half: [[[f64; FOOT_ROWS]; FOOT_CHAIN]; 2],
    /// World to contact axes.
    axes: Matrix3<f64>,
    /// Lowest point of each sphere relative to the reference point, m.
    offset: [Vector3<f64>; CONTACTS],
    /// The problem handed to the solver.
    pub(super) problem: ContactProblem,
}

impl Default for ContactStage {
    fn default() -> Self {
        Self {
            half: [[[0.0; FOOT_ROWS]; FOOT_CHAIN]; 2],
            axes: Matrix3::identity(),
            offset: [Vector3::zeros(); CONTACTS],
            problem: ContactProblem::default(),
        }
    }
}

impl ContactStage {
    /// Builds the contact problem.
    ///
    /// `half_increment` is `D⁻¹ L⁻ᵀ` of the contact-free momentum change, so that `v⁺ = v + L⁻¹ half_increment`
    /// without contacts; `velocity` is v.
    #[inline(never)] // a stage of its own in a profile
    #[allow(clippy::too_many_arguments)] // one call site; a struct would only rename the arguments
    pub(super) fn assemble(
        &mut self,
        model: &CharacterModel,
        kinematics: &Kinematics,
        factor: &TreeFactor,
        ground: &GroundSurface,
        settings: &ContactSettings,
        memory: &ContactMemory,
        half_increment: &GenVec,
        dt_s: f64,
    ) {
        self.feet_mobility(model, kinematics, factor);
        let axes = ground.contact_axes();
        self.axes = axes;
        let surface = Motion {
            angular: ground.angular_velocity + dt_s * ground.angular_acceleration,
            linear: ground.velocity_after(&kinematics.origin, dt_s),
        };
        for foot in Foot::BOTH {
            let free = self.free_velocity(model, kinematics, foot, half_increment);
            let relative = free.plus_scaled(-1.0, &surface);
            let of_foot = &mut self.problem.feet_before[FOOT_ROWS * foot as usize..][..FOOT_ROWS];
            of_foot[..3].copy_from_slice(relative.angular.as_slice());
            of_foot[3..].copy_from_slice(relative.linear.as_slice());
        }
        // A point may close the gap by the fastest approach expected in one step: 1 m/s.
        let margin = settings.margin.max(dt_s);
        let problem = &mut self.problem;
        problem.active = [false; CONTACTS];
        for i in 0..CONTACTS {
            let offset = kinematics.contact_offset(model, i) - model.contacts[i].radius * ground.normal;
            let world = kinematics.origin + offset;
            self.offset[i] = offset;
            let gap = ground.height(&world);
            if gap > margin {
                continue;
            }
            problem.active[i] = true;
            problem.rows[i] = point_rows(&axes, &offset);
            problem.soften(i, settings.relative_compliance);
            let mut b = Vector3::zeros();
            b.z = if gap >= 0.0 {
                gap / dt_s
            } else {
                -(-gap * settings.error_reduction / dt_s).min(settings.push_out_limit)
            };
            if let Some(anchor) = memory.anchor[i] {
                let drift = axes * (world - ground.rot_world_surface * anchor);
                b.x = settings.anchor_gain * drift.x / dt_s;
                b.y = settings.anchor_gain * drift.y / dt_s;
            }
            problem.correction[i] = b;
        }
        problem.friction = ground.friction;
    }

    fn feet_mobility(&mut self, model: &CharacterModel, kinematics: &Kinematics, factor: &TreeFactor) {
        for foot in Foot::BOTH {
            let chain = model.body_chain(model.feet[foot as usize]);
            let half = &mut self.half[foot as usize];
            for (row, &dof) in half.iter_mut().zip(chain) {
                let axis = &kinematics.axis[dof];
                *row = [
                    axis.angular.x,
                    axis.angular.y,
                    axis.angular.z,
                    axis.linear.x,
                    axis.linear.y,
                    axis.linear.z,
                ];
            }
            factor.half_solve_chain(model, chain, half);
        }
        let chains = model.feet.map(|foot| model.body_chain(foot));
        let mobility = &mut self.problem.mobility;
        for (a, b) in [(0, 0), (0, 1), (1, 1)] {
            let mut block = [[0.0; FOOT_ROWS]; FOOT_ROWS];
            // Two legs share the root's degrees of freedom only.
            let common = chains[a].iter().zip(chains[b]).take_while(|(p, q)| p == q);
            for ((dof, _), (ya, yb)) in common.zip(self.half[a].iter().zip(&self.half[b])) {
                let weight = factor.inverse_diagonal[*dof];
                for (row, entry) in block.iter_mut().zip(ya) {
                    add_scaled(row, weight * entry, yb);
                }
            }
            for (r, row) in block.iter().enumerate() {
                for (c, entry) in row.iter().enumerate() {
                    mobility[FOOT_ROWS * a + r][FOOT_ROWS * b + c] = *entry;
                    mobility[FOOT_ROWS * b + c][FOOT_ROWS * a + r] = *entry;
                }
            }
        }
    }

    /// Spatial velocity of a foot after the step without contact impulses.
    fn free_velocity(
        &self,
        model: &CharacterModel,
        kinematics: &Kinematics,
        foot: Foot,
        half_increment: &GenVec,
    ) -> Motion {
        let body = model.feet[foot as usize];
        let mut sum = [0.0; 6];
        for (row, &dof) in self.half[foot as usize].iter().zip(model.body_chain(body)) {
            add_scaled(&mut sum, half_increment[dof], row);
        }
        let increment = Motion {
            angular: Vector3::new(sum[0], sum[1], sum[2]),
            linear: Vector3::new(sum[3], sum[4], sum[5]),
        };
        kinematics.velocity[body].plus_scaled(1.0, &increment)
    }

    /// Adds `D⁻¹ L⁻ᵀ Jᵀ λ` of the solved impulses to `half_increment`.
    pub(super) fn apply(&self, model: &CharacterModel, factor: &TreeFactor, half_increment: &mut GenVec) {
        for foot in Foot::BOTH {
            let mut wrench = [0.0; FOOT_ROWS];
            for i in (0..CONTACTS).filter(|i| self.problem.active[*i] && Foot::of_contact(*i) == foot) {
                for (row, impulse) in self.problem.rows[i].iter().zip(self.problem.impulse[i].iter()) {
                    add_scaled(&mut wrench, *impulse, row);
                }
            }
            let chain = model.body_chain(model.feet[foot as usize]);
            for (row, &dof) in self.half[foot as usize].iter().zip(chain) {
                half_increment[dof] += factor.inverse_diagonal[dof] * dot(row, &wrench);
            }
        }
    }

    /// Forces in world axes, and the memory for the next step.
    pub(super) fn finish(
        &self,
        kinematics: &Kinematics,
        ground: &GroundSurface,
        memory: &mut ContactMemory,
        dt_s: f64,
    ) -> [PointContact; CONTACTS] {
        let to_world = self.axes.transpose();
        let mut points = [PointContact::default(); CONTACTS];
        for (i, point) in points.iter_mut().enumerate() {
            let position = kinematics.origin + self.offset[i];
            let active = self.problem.active[i];
            let impulse = if active { self.problem.impulse[i] } else { Vector3::zeros() };
            memory.impulse[i] = impulse;
            *point = PointContact { force: to_world * impulse / dt_s, position, active };
            let tangential = impulse.xy().norm();
            // Anchors turn with the surface, but nothing carries them along with a belt.
            let sticking = ground.velocity == Vector3::zeros()
                && active
                && impulse.z > 0.0
                && tangential < ground.friction * impulse.z * (1.0 - 1e-6);
            memory.anchor[i] = if sticking {
                memory.anchor[i].or_else(|| Some(ground.rot_world_surface.transpose() * position))
            } else {
                None
            };
        }
        points
    }
}

/// Rows that give the contact-axes velocity of the point at `offset` from a foot's spatial velocity.
fn point_rows(axes: &Matrix3<f64>, offset: &Vector3<f64>) -> PointRows {
    std::array::from_fn(|r| {
        let axis = axes.row(r).transpose();
        // axis · (linear + angular x offset) = axis · linear + (offset x axis) · angular
        let arm = offset.cross(&axis);
        [arm.x, arm.y, arm.z, axis.x, axis.y, axis.z]
    })
}
