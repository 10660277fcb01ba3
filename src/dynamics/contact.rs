//! Contact of the eight foot points with the ground, at velocity level: setting up the problem and applying its result.
//!
//! Each active point gets three rows (two tangents, normal) of `A λ + b`: the velocity relative to the ground after
//! the step for the impulses λ. `A = J M⁻¹ Jᵀ` is built from one 6 x 6 block per pair of feet, since all points of a
//! foot move with one spatial velocity.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::contact_solver::{ContactProblem, POINT_ROWS};
use super::factor::TreeFactor;
use super::ground::GroundSurface;
use super::kinematics::Kinematics;
use super::spatial::Motion;
use crate::character::{CONTACTS, CharacterModel, FOOT_CHAIN, Foot, GenVec};

type Matrix6 = SMatrix<f64, 6, 6>;
type Matrix3x6 = SMatrix<f64, 3, 6>;

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
    /// Sweeps of the fall-back solver.
    pub sweeps: usize,
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
    half: [[[f64; 6]; FOOT_CHAIN]; 2],
    /// `J M⁻¹ Jᵀ` of the feet's spatial velocities: blocks left-left, left-right, right-right.
    blocks: [Matrix6; 3],
    /// Rows of each point: contact-axes velocity from the foot's spatial velocity (angular, linear).
    rows: [Matrix3x6; CONTACTS],
    /// Lowest point of each sphere relative to the reference point, m.
    offset: [Vector3<f64>; CONTACTS],
    /// The problem handed to the solver.
    pub(super) problem: ContactProblem,
}

impl Default for ContactStage {
    fn default() -> Self {
        Self {
            half: [[[0.0; 6]; FOOT_CHAIN]; 2],
            blocks: [Matrix6::zeros(); 3],
            rows: [Matrix3x6::zeros(); CONTACTS],
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
        self.foot_blocks(model, kinematics, factor);
        let axes = ground.contact_axes();
        let mut feet_velocity = [Motion::default(); 2];
        for foot in Foot::BOTH {
            feet_velocity[foot as usize] = self.free_velocity(model, kinematics, foot, half_increment);
        }
        // A point may close the gap by the fastest approach expected in one step: 1 m/s.
        let margin = settings.margin.max(dt_s);
        let problem = &mut self.problem;
        problem.active = [false; CONTACTS];
        for i in 0..CONTACTS {
            let foot = Foot::of_contact(i);
            let offset = kinematics.contact_offset(model, i) - model.contacts[i].radius * ground.normal;
            let world = kinematics.origin + offset;
            self.offset[i] = offset;
            let gap = ground.height(&world);
            if gap > margin {
                continue;
            }
            problem.active[i] = true;
            self.rows[i] = point_rows(&axes, &offset);
            let free = feet_velocity[foot as usize].at(&offset) - ground.velocity_after(&world, dt_s);
            let mut b = axes * free;
            b.z += if gap >= 0.0 {
                gap / dt_s
            } else {
                -(-gap * settings.error_reduction / dt_s).min(settings.push_out_limit)
            };
            if let Some(anchor) = memory.anchor[i] {
                let drift = axes * (world - ground.rot_world_surface * anchor);
                b.x += settings.anchor_gain * drift.x / dt_s;
                b.y += settings.anchor_gain * drift.y / dt_s;
            }
            problem.offset_velocity[i] = b;
        }
        problem.friction = ground.friction;
        self.fill_matrix(settings.relative_compliance);
    }

    fn foot_blocks(&mut self, model: &CharacterModel, kinematics: &Kinematics, factor: &TreeFactor) {
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
        for (block, (a, b)) in self.blocks.iter_mut().zip([(0, 0), (0, 1), (1, 1)]) {
            block.fill(0.0);
            // Two legs share the root's degrees of freedom only.
            let common = chains[a].iter().zip(chains[b]).take_while(|(p, q)| p == q);
            for ((dof, _), (ya, yb)) in common.zip(self.half[a].iter().zip(&self.half[b])) {
                let weight = factor.inverse_diagonal[*dof];
                for (column, other) in yb.iter().enumerate() {
                    let scaled = weight * other;
                    for (row, entry) in ya.iter().enumerate() {
                        block[(row, column)] += entry * scaled;
                    }
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
            for (total, entry) in sum.iter_mut().zip(row) {
                *total += entry * half_increment[dof];
            }
        }
        let increment = Motion {
            angular: Vector3::new(sum[0], sum[1], sum[2]),
            linear: Vector3::new(sum[3], sum[4], sum[5]),
        };
        kinematics.velocity[body].plus_scaled(1.0, &increment)
    }

    fn fill_matrix(&mut self, relative_compliance: f64) {
        let problem = &mut self.problem;
        let active = problem.active;
        for i in (0..CONTACTS).filter(|i| active[*i]) {
            let foot_i = Foot::of_contact(i) as usize;
            // j <= i, so the feet come in the order (0,0), (1,0) or (1,1); block 1 is left-right.
            let with_left = if foot_i == 0 {
                self.rows[i] * self.blocks[0]
            } else {
                self.rows[i] * self.blocks[1].transpose()
            };
            let with_right = self.rows[i] * self.blocks[2];
            for j in (0..=i).filter(|j| active[*j]) {
                let product = if Foot::of_contact(j) == Foot::Left { &with_left } else { &with_right };
                problem.set_block(i, j, &(product * self.rows[j].transpose()));
            }
        }
        problem.soften(relative_compliance);
    }

    /// Adds `D⁻¹ L⁻ᵀ Jᵀ λ` of the solved impulses to `half_increment`.
    pub(super) fn apply(&self, model: &CharacterModel, factor: &TreeFactor, half_increment: &mut GenVec) {
        for foot in Foot::BOTH {
            let mut wrench = SMatrix::<f64, 6, 1>::zeros();
            for i in (0..CONTACTS).filter(|i| self.problem.active[*i] && Foot::of_contact(*i) == foot) {
                wrench += self.rows[i].transpose() * self.problem.impulse[i];
            }
            let chain = model.body_chain(model.feet[foot as usize]);
            for (row, &dof) in self.half[foot as usize].iter().zip(chain) {
                let sum: f64 = row.iter().zip(wrench.iter()).map(|(y, w)| y * w).sum();
                half_increment[dof] += factor.inverse_diagonal[dof] * sum;
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
        let axes = ground.contact_axes();
        let mut points = [PointContact::default(); CONTACTS];
        for (i, point) in points.iter_mut().enumerate() {
            let position = kinematics.origin + self.offset[i];
            let active = self.problem.active[i];
            let impulse = if active { self.problem.impulse[i] } else { Vector3::zeros() };
            memory.impulse[i] = impulse;
            *point = PointContact { force: axes.transpose() * impulse / dt_s, position, active };
            let tangential = libm::hypot(impulse.x, impulse.y);
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
fn point_rows(axes: &Matrix3<f64>, offset: &Vector3<f64>) -> Matrix3x6 {
    let mut rows = Matrix3x6::zeros();
    // v = linear + angular x offset = linear - [offset]x angular
    rows.fixed_view_mut::<3, 3>(0, 0).copy_from(&(-(axes * offset.cross_matrix())));
    rows.fixed_view_mut::<3, 3>(0, 3).copy_from(axes);
    rows
}

const _: () = assert!(POINT_ROWS == 3);
