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

    /// λ = X η of the matrix K, where R = X R_B, with the rows B of K λ = `wanted` (one or more columns); `None` where they have no
    /// solution. X is the identity for the rows B.
    pub fn solve(&self, gram: &DMatrix<f64>, k: &DMatrix<f64>, wanted: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let (m, basis) = (gram.nrows(), &self.rows);
        let others: Vec<usize> = (0..m).filter(|i| !basis.contains(i)).collect();
        let part = |of: &DMatrix<f64>, columns: &[usize]| {
            DMatrix::from_fn(basis.len(), columns.len(), |i, j| of[(basis[i], columns[j])])
        };
        let own = part(gram, basis).cholesky()?;
        let spread = own.solve(&part(gram, &others)).transpose();
        let folded = part(k, basis) + part(k, &others) * &spread;
        let eta = folded.lu().solve(&DMatrix::from_fn(basis.len(), wanted.ncols(), |i, j| wanted[(basis[i], j)]))?;
        let mut found = DMatrix::zeros(m, wanted.ncols());
        let rest = spread * &eta;
        basis.iter().enumerate().for_each(|(i, row)| found.row_mut(*row).copy_from(&eta.row(i)));
        others.iter().enumerate().for_each(|(i, row)| found.row_mut(*row).copy_from(&rest.row(i)));
        Some(found)
    }
}
