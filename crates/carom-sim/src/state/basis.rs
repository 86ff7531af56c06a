//! The independent rows among constraints.

use super::accuracy::EQUAL;
use nalgebra::{DMatrix, DVector, Dyn, LU};
use std::ops::Range;

/// Independent rows of a positive semidefinite matrix: the others have a pivot that is at most a share [`EQUAL`] of their diagonal entry. By Cholesky factorisation with diagonal pivoting (Golub & Van Loan,
/// *Matrix Computations*, 4th ed., section 4.2.8).
pub(crate) struct Basis {
    pub rows: Vec<usize>,
    /// The least pivot as a share of its size; 1 without rows.
    pub least: f64,
    /// The largest share of the rows that are left; 0 if there are none.
    pub left: f64,
    /// All rows of the factor L, one column for each of `rows`.
    factor: DMatrix<f64>,
}

/// The equations K λ = b with λ = X η, R = X R_B, factored. X is the identity for the rows B.
pub(crate) struct Spread {
    basis: Vec<usize>,
    others: Vec<usize>,
    /// The rows of X that are not in the basis and not left out.
    spread: DMatrix<f64>,
    /// The rows B of K X.
    folded: LU<f64, Dyn, Dyn>,
}

impl Basis {
    pub fn of(gram: &DMatrix<f64>) -> Self {
        Self::without(gram, &[])
    }

    /// [`Self::of`] without these rows.
    pub fn without(gram: &DMatrix<f64>, left_out: &[Range<usize>]) -> Self {
        let least = Self::least(gram);
        let mut sizes = gram.diagonal().map(|own| own.max(least));
        left_out.iter().cloned().flatten().for_each(|row| sizes[row] = f64::INFINITY);
        Self::among(gram, &sizes)
    }

    /// The size of rows that are rounding: those of a planar robot across its plane.
    pub fn least(gram: &DMatrix<f64>) -> f64 {
        gram.diagonal().amax() * EQUAL
    }

    /// The rows whose pivots are not small compared with these sizes.
    pub fn among(gram: &DMatrix<f64>, sizes: &DVector<f64>) -> Self {
        let m = gram.nrows();
        let mut left = gram.diagonal();
        // What is left of each row as a share of its size; −∞ for those that are taken.
        let mut shares = left.component_div(sizes);
        let mut factor = DMatrix::zeros(m, m);
        let (mut rows, mut least, mut rest) = (Vec::with_capacity(m), 1.0_f64, 0.0);
        while rows.len() < m {
            let Some((next, &share)) = shares.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)) else { break };
            let dependent = share.is_nan() || share <= EQUAL;
            if dependent {
                rest = share.max(0.0);
                break;
            }
            least = least.min(share);
            let (before, mut others) = factor.columns_range_pair_mut(..rows.len(), rows.len()..);
            let mut column = others.column_mut(0);
            column.copy_from(&gram.column(next));
            for before in before.column_iter() {
                column.axpy(-before[next], &before, 1.0);
            }
            column /= left[next].sqrt();
            rows.push(next);
            shares[next] = f64::NEG_INFINITY;
            for (i, x) in column.iter().enumerate() {
                if shares[i] != f64::NEG_INFINITY {
                    left[i] -= x * x;
                    shares[i] = left[i] / sizes[i];
                }
            }
        }
        factor.resize_horizontally_mut(rows.len(), 0.0);
        Self { rows, least, left: rest, factor }
    }

    /// The solution x of R_B M⁻¹ R_Bᵀ x = `wanted` on the rows B, for one or more columns.
    pub fn solve(&self, wanted: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let lower = self.factor.select_rows(&self.rows);
        lower.tr_solve_lower_triangular(&lower.solve_lower_triangular(wanted)?)
    }

    /// What is left of x, a line for every row, when the rows B are zero: x − G_B G_BB⁻¹ x_B for the matrix G.
    pub fn rest(&self, x: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let lower = self.factor.select_rows(&self.rows);
        Some(x - &self.factor * lower.solve_lower_triangular(&x.select_rows(&self.rows))?)
    }

    /// The equations of the matrix K with these rows; those that are left out have no force.
    pub fn spread(self, k: &DMatrix<f64>, left_out: &[Range<usize>]) -> Option<Spread> {
        let Self { rows: basis, factor, .. } = self;
        let is_other = |i: &usize| !basis.contains(i) && !left_out.iter().any(|rows| rows.contains(i));
        let others: Vec<usize> = (0..k.nrows()).filter(is_other).collect();
        // The rows of L that are left are X L_B.
        let left = factor.select_rows(&others).transpose();
        let spread = factor.select_rows(&basis).tr_solve_lower_triangular(&left)?.transpose();
        let own = k.select_rows(&basis);
        let folded = (own.select_columns(&basis) + own.select_columns(&others) * &spread).lu();
        Some(Spread { basis, others, spread, folded })
    }
}

impl Spread {
    /// Number of independent rows.
    pub fn rank(&self) -> usize {
        self.basis.len()
    }

    /// λ, for one or more columns b; `None` where they have no solution.
    pub fn solve(&self, wanted: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        if self.basis.is_empty() {
            return Some(DMatrix::zeros(wanted.nrows(), wanted.ncols())); // no row moves anything
        }
        let eta = self.folded.solve(&wanted.select_rows(&self.basis))?;
        let rest = &self.spread * &eta;
        let mut found = DMatrix::zeros(wanted.nrows(), wanted.ncols());
        self.basis.iter().enumerate().for_each(|(i, row)| found.row_mut(*row).copy_from(&eta.row(i)));
        self.others.iter().enumerate().for_each(|(i, row)| found.row_mut(*row).copy_from(&rest.row(i)));
        Some(found)
    }
}
