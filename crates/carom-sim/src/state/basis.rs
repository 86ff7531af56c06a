//! The independent rows among constraints.

use nalgebra::{DMatrix, DVector};

/// A pivot of R M⁻¹ Rᵀ below this share of its diagonal entry counts as zero: the row depends on others. The entries are sums
/// of some dozens of products, and rows that depend on others do so within the projection of the state, 1e-13 of its size.
const DEPENDENT: f64 = 1e-10;

/// Independent rows of a positive semidefinite matrix, by Cholesky factorisation with diagonal pivoting (Golub & Van Loan,
/// *Matrix Computations*, 4th ed., section 4.2.8).
pub(crate) struct Basis {
    pub rows: Vec<usize>,
    /// The least pivot as a share of its size; 1 without rows.
    pub least: f64,
    /// The largest share of the rows that are left; 0 if there are none.
    pub left: f64,
}

impl Basis {
    pub fn of(gram: &DMatrix<f64>) -> Self {
        let most = gram.diagonal().amax();
        Self::among(gram, &gram.diagonal().map(|own| own.max(most * DEPENDENT)))
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
            let dependent = share.is_nan() || share <= DEPENDENT;
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
        Self { rows, least, left: rest }
    }

    /// X with R = X R_B, for the matrix R M⁻¹ Rᵀ.
    pub fn spread(&self, gram: &DMatrix<f64>) -> DMatrix<f64> {
        let r = self.rows.len();
        let own = DMatrix::from_fn(r, r, |i, j| gram[(self.rows[i], self.rows[j])]);
        let across = DMatrix::from_fn(r, gram.nrows(), |i, j| gram[(self.rows[i], j)]);
        match own.cholesky() {
            Some(factor) => factor.solve(&across).transpose(),
            None => DMatrix::zeros(gram.nrows(), r),
        }
    }
}
