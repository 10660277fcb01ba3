//! Composite rigid bodies: mass matrix and momentum map.

use nalgebra::{Matrix3, Vector3};

use super::kinematics::Kinematics;
use super::spatial::{SpatialInertia, Wrench};
use crate::character::{BODIES, CharacterModel, DOF, GenVec, MAX_CHAIN};

/// A symmetric matrix with the sparsity of the kinematic tree, lower triangle.
///
/// Row `i` holds one number for each degree of freedom on the chain from the root to `i`, root first, `i` itself
/// last. The chain of an ancestor is a prefix of the chain of `i`, so rows combine as contiguous slices.
#[derive(Clone, Debug)]
pub struct TreeMatrix {
    /// `(DOF x MAX_CHAIN)`; entries past the chain's length are unused.
    pub rows: [[f64; MAX_CHAIN]; DOF],
}

impl Default for TreeMatrix {
    fn default() -> Self {
        Self { rows: [[0.0; MAX_CHAIN]; DOF] }
    }
}

impl TreeMatrix {
    /// The product with a vector.
    pub fn times(&self, model: &CharacterModel, x: &GenVec) -> GenVec {
        let mut out = GenVec::zeros();
        for i in 0..DOF {
            let len = model.chain_len[i];
            let (row, chain) = (&self.rows[i][..len], &model.chain[i][..len]);
            let (xi, mut sum) = (x[i], row[len - 1] * x[i]);
            for (entry, &j) in row[..len - 1].iter().zip(chain) {
                sum += entry * x[j];
                out[j] += entry * xi;
            }
            out[i] += sum;
        }
        out
    }

    /// Entry of the full matrix; zero where the tree says so.
    pub fn entry(&self, model: &CharacterModel, i: usize, j: usize) -> f64 {
        let (i, j) = (i.max(j), i.min(j));
        let chain = &model.chain[i][..model.chain_len[i]];
        chain.iter().position(|dof| *dof == j).map_or(0.0, |p| self.rows[i][p])
    }
}

/// Inertias of bodies and of subtrees, and what follows from them.
#[derive(Clone, Debug)]
pub struct Inertias {
    /// Inertia of each body about the reference point.
    pub body: [SpatialInertia; BODIES],
    /// Inertia of each body with everything that hangs on it.
    pub composite: [SpatialInertia; BODIES],
    /// Momentum of the subtree of each degree of freedom at unit rate, about the reference point.
    pub momentum: [Wrench; DOF],
    /// Joint-space inertia M with armature on the diagonal.
    pub mass_matrix: TreeMatrix,
}

impl Default for Inertias {
    fn default() -> Self {
        Self {
            body: [SpatialInertia::default(); BODIES],
            composite: [SpatialInertia::default(); BODIES],
            momentum: [Wrench::default(); DOF],
            mass_matrix: TreeMatrix::default(),
        }
    }
}

impl Inertias {
    /// Recomputes everything (composite rigid body algorithm) for the present kinematics.
    pub fn update(&mut self, model: &CharacterModel, kinematics: &Kinematics) {
        for (i, body) in model.bodies.iter().enumerate() {
            let rot = &kinematics.rot_world_body[i];
            let inertia = rot * body.inertia * rot.transpose();
            self.body[i] = SpatialInertia::of_body(body.mass, &kinematics.com_offset[i], &inertia);
        }
        self.composite = self.body;
        for i in (1..BODIES).rev() {
            let inertia = self.composite[i];
            self.composite[model.bodies[i].parent] += inertia;
        }
        let to_root = kinematics.rot_world_body[0].transpose();
        for dof in 0..DOF {
            let momentum = self.composite[model.dof_body[dof]].apply(&kinematics.axis[dof]);
            self.momentum[dof] = momentum;
            let row = &mut self.mass_matrix.rows[dof];
            // The root's axes at its own origin are those of the world (linear) and of the body (angular).
            row[..3].copy_from_slice(momentum.force.as_slice());
            row[3..6].copy_from_slice((to_root * momentum.moment).as_slice());
            if dof >= 6 {
                let len = model.chain_len[dof];
                for (entry, &ancestor) in row[6..len].iter_mut().zip(&model.chain[dof][6..len]) {
                    *entry = kinematics.axis[ancestor].dot(&momentum);
                }
                row[len - 1] += model.joints[dof - 6].armature;
            }
        }
    }

    /// Centre of mass relative to the reference point, m.
    pub fn com_offset(&self) -> Vector3<f64> {
        self.composite[0].first_moment / self.composite[0].mass
    }

    /// Column `dof` of the centroidal momentum map: linear momentum, angular momentum about the centre of mass.
    #[inline]
    pub fn centroidal_column(&self, dof: usize, com_offset: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let momentum = &self.momentum[dof];
        (momentum.force, momentum.moment - com_offset.cross(&momentum.force))
    }

    /// Rotational inertia of the whole character about its centre of mass, world axes, kg m².
    pub fn about_com(&self) -> Matrix3<f64> {
        let whole = &self.composite[0];
        let c = self.com_offset();
        let mc = whole.first_moment;
        whole.rotational - (Matrix3::from_diagonal_element(mc.dot(&c)) - mc * c.transpose())
    }
}
