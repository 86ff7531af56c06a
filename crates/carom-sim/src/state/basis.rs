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
        let mut left: Vec<f64> = gram.diagonal().iter().copied().collect();
        let mut factor: Vec<DVector<f64>> = Vec::new();
        let (mut rows, mut least, mut rest) = (Vec::new(), 1.0_f64, 0.0);
        while rows.len() < m {
            let share = |i: &usize| left[*i] / sizes[*i];
            let Some(next) = (0..m).filter(|i| !rows.contains(i)).max_by(|a, b| share(a).total_cmp(&share(b))) else {
                break;
            };
            let dependent = share(&next).is_nan() || share(&next) <= DEPENDENT;
            if dependent {
                rest = share(&next).max(0.0);
                break;
            }
            least = least.min(share(&next));
            let pivot = left[next].sqrt();
            let mut column = gram.column(next).into_owned();
            for before in &factor {
                column.axpy(-before[next], before, 1.0);
            }
            column /= pivot;
            left.iter_mut().zip(column.iter()).for_each(|(left, x)| *left -= x * x);
            factor.push(column);
            rows.push(next);
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
