//! Tree-sparse factorisation `M = Lᵀ D L` (Featherstone 2005) and the solves that go with it.
//!
//! No fill-in: L has the sparsity of the tree. Rows are stored along chains (see [`TreeMatrix`]), so the inner loops
//! run over contiguous slices.

use super::inertia::TreeMatrix;
use crate::character::{CharacterModel, DOF, GenVec, MAX_CHAIN};

/// Factors of a tree-sparse symmetric positive definite matrix.
#[derive(Clone, Debug)]
pub struct TreeFactor {
    /// Unit lower factor L, same layout as the matrix; the diagonal entry is unused.
    lower: TreeMatrix,
    /// Diagonal D.
    pub diagonal: [f64; DOF],
    /// `1 / D`.
    pub inverse_diagonal: [f64; DOF],
}

impl Default for TreeFactor {
    fn default() -> Self {
        Self { lower: TreeMatrix::default(), diagonal: [1.0; DOF], inverse_diagonal: [1.0; DOF] }
    }
}

impl TreeFactor {
    /// Factors `matrix + diag(addition)`; `addition` carries implicit joint damping and motors (`h D`).
    ///
    /// The result is positive definite when every entry of `diagonal` is above zero.
    pub fn factor(&mut self, model: &CharacterModel, matrix: &TreeMatrix, addition: Option<&GenVec>) {
        self.lower = matrix.clone();
        if let Some(addition) = addition {
            for i in 0..DOF {
                self.lower.rows[i][model.chain_len[i] - 1] += addition[i];
            }
        }
        for k in (0..DOF).rev() {
            let own = model.chain_len[k] - 1;
            let (above, below) = self.lower.rows.split_at_mut(k);
            let row = &mut below[0];
            let pivot = row[own];
            let inverse = 1.0 / pivot;
            self.diagonal[k] = pivot;
            self.inverse_diagonal[k] = inverse;
            for p in (0..own).rev() {
                let scaled = row[p] * inverse;
                let ancestor = &mut above[model.chain[k][p]];
                subtract_leading(ancestor, scaled, row, p + 1);
            }
            for entry in &mut row[..own] {
                *entry *= inverse;
            }
        }
    }

    /// Row `dof` of L along its chain, without the diagonal.
    #[inline]
    pub fn lower_row(&self, model: &CharacterModel, dof: usize) -> &[f64] {
        &self.lower.rows[dof][..model.chain_len[dof] - 1]
    }

    /// `x <- L⁻ᵀ x`: the first half of a solve, from the leaves to the root.
    pub fn half_solve(&self, model: &CharacterModel, x: &mut GenVec) {
        let x = x.as_mut_slice();
        for k in (0..DOF).rev() {
            let xk = x[k];
            let row = self.lower_row(model, k);
            for (entry, &j) in row.iter().zip(&model.chain[k]) {
                x[j] -= entry * xk;
            }
        }
    }

    /// `x <- L⁻¹ x`: the last part of a solve, from the root to the leaves.
    pub fn forward_solve(&self, model: &CharacterModel, x: &mut GenVec) {
        let x = x.as_mut_slice();
        for k in 0..DOF {
            let row = self.lower_row(model, k);
            let mut sum = x[k];
            for (entry, &j) in row.iter().zip(&model.chain[k]) {
                sum -= entry * x[j];
            }
            x[k] = sum;
        }
    }

    /// `x <- (Lᵀ D L)⁻¹ x`.
    pub fn solve(&self, model: &CharacterModel, x: &mut GenVec) {
        self.half_solve(model, x);
        for k in 0..DOF {
            x[k] *= self.inverse_diagonal[k];
        }
        self.forward_solve(model, x);
    }

    /// `L⁻ᵀ` applied to a block of 6 columns that is supported on one chain, in place.
    ///
    /// `block[p]` belongs to degree of freedom `chain[p]`; this is what makes contact rows cheap: 12 instead of 41.
    pub fn half_solve_chain(&self, model: &CharacterModel, chain: &[usize], block: &mut [[f64; 6]]) {
        debug_assert!(chain.len() <= MAX_CHAIN && block.len() == chain.len());
        for k in (0..chain.len()).rev() {
            let row = self.lower_row(model, chain[k]);
            let (above, below) = block.split_at_mut(k);
            let source = &below[0];
            for (target, entry) in above.iter_mut().zip(row) {
                for c in 0..6 {
                    target[c] -= entry * source[c];
                }
            }
        }
    }
}

/// `x -= scale y` for at least the first `count` entries.
///
/// It goes on to a multiple of [`STRIDE`]: strides of fixed length unroll, and past its diagonal a row holds nothing.
#[inline]
fn subtract_leading(x: &mut [f64; MAX_CHAIN], scale: f64, y: &[f64; MAX_CHAIN], count: usize) {
    let (x, y) = (x.as_chunks_mut::<STRIDE>().0, y.as_chunks::<STRIDE>().0);
    for (x, y) in x.iter_mut().zip(y).take(count.div_ceil(STRIDE)) {
        for (x, y) in x.iter_mut().zip(y) {
            *x -= scale * y;
        }
    }
}

/// Entries of a row that are combined at a time.
const STRIDE: usize = 4;
const _: () = assert!(MAX_CHAIN.is_multiple_of(STRIDE));
