//! The Delassus matrix as the iteration multiplies by it: whole, or as the product of two thin factors.
//!
//! | Symbol | Size | Meaning |
//! |---|---|---|
//! | H | n × n | Delassus matrix (1/kg) |
//! | U, V | n × r | factors, H = U Vᵀ |
//! | w | r | reduced impulse, `Vᵀ p`; the velocities are `u_free + U w` |
//!
//! The rank r of H is at most the number of degrees of freedom, so with many contacts on few freedoms H = G Gᵀ with a
//! thin G = U = V, from Cholesky's decomposition with pivoting. A product with H then takes 2 n r operations instead of
//! n², and a Newton step an r × r system instead of one with the rows of all active constraints. Where that is no gain, or H is not symmetric, U = H
//! and V = 1.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector};

use crate::rounding::COUPLING;

/// H in factors.
pub(super) struct Response<'a> {
    /// Uᵀ (r × n), in which the entries of one row of H are contiguous; V is the same, or 1.
    rows: Cow<'a, DMatrix<f64>>,
    thin: bool,
    /// Whether U is symmetric.
    symmetric: bool,
}

impl<'a> Response<'a> {
    /// U = H, V = 1.
    pub fn whole(h: &'a DMatrix<f64>, symmetric: bool) -> Self {
        Self { rows: if symmetric { Cow::Borrowed(h) } else { Cow::Owned(h.transpose()) }, thin: false, symmetric }
    }

    /// The thin factors of a symmetric, positive semidefinite H, if they have at most half as many columns.
    pub fn thin(h: &DMatrix<f64>) -> Option<Self> {
        thin_factor(h, h.nrows() / 2).map(|rows| Self { rows: Cow::Owned(rows), thin: true, symmetric: false })
    }

    pub fn is_thin(&self) -> bool {
        self.thin
    }

    /// Size of the reduced impulse, r.
    pub fn rank(&self) -> usize {
        self.rows.nrows()
    }

    /// Uᵀ.
    pub fn rows(&self) -> &DMatrix<f64> {
        &self.rows
    }

    /// `w = Vᵀ p`.
    pub fn reduce(&self, p: &DVector<f64>, w: &mut DVector<f64>) {
        if self.thin {
            w.gemv(1.0, &self.rows, p, 0.0);
        } else {
            w.copy_from(p);
        }
    }

    /// `w += Vᵀ e_i p`: the part of row i.
    pub fn add(&self, i: usize, p: f64, w: &mut DVector<f64>) {
        if self.thin {
            w.axpy(p, &self.rows.column(i), 1.0);
        } else {
            w[i] += p;
        }
    }

    /// Row i of `U w`.
    pub fn velocity(&self, i: usize, w: &DVector<f64>) -> f64 {
        self.rows.column(i).dot(w)
    }

    /// `u = U w`.
    pub fn velocities(&self, w: &DVector<f64>, u: &mut DVector<f64>) {
        if self.thin {
            let along = u.as_mut_slice().iter_mut().zip(self.rows.as_slice().chunks_exact(self.rank()));
            along.for_each(|(u, row)| *u = row.iter().zip(w.as_slice()).map(|(a, w)| a * w).sum());
        } else if self.symmetric {
            u.fill(0.0);
            for (column, w) in self.rows.column_iter().zip(w.iter()).filter(|(_, w)| **w != 0.0) {
                u.axpy(*w, &column, 1.0);
            }
        } else {
            u.gemv_tr(1.0, &self.rows, w, 0.0);
        }
    }

    /// A bound of the terms of `H p` in row i, which are summed in any order: |Hᵢⱼ| is at most |Uᵢ| |Vⱼ|.
    pub fn size(&self, i: usize, p: &DVector<f64>) -> f64 {
        let own = self.rows.column(i);
        if self.thin {
            own.norm() * self.rows.column_iter().zip(p).map(|(g, p)| g.norm() * p.abs()).sum::<f64>()
        } else {
            own.iter().zip(p).map(|(h, p)| (h * p).abs()).sum()
        }
    }
}

/// Gᵀ (r × n) with H = G Gᵀ within rounding, if r is at most `most`: Cholesky's decomposition, whose next pivot is the
/// one that is largest relative to its own diagonal entry, so that the unit of a row does not matter.
pub(super) fn thin_factor(h: &DMatrix<f64>, most: usize) -> Option<DMatrix<f64>> {
    let n = h.nrows();
    // The rows of Gᵀ one after another.
    let mut factor: Vec<f64> = Vec::with_capacity(most * n);
    let own: Vec<f64> = (0..n).map(|i| h[(i, i)]).collect();
    // Diagonal entries of what is not yet factored.
    let mut left = own.clone();
    for k in 0..=most {
        let (mut next, mut largest) = (0, 0.0);
        for (i, (left, own)) in left.iter().zip(&own).enumerate() {
            if *left > largest * own {
                (next, largest) = (i, left / own);
            }
        }
        if largest <= COUPLING * f64::EPSILON {
            return (k > 0).then(|| DMatrix::from_row_slice(k, n, &factor));
        }
        if k == most {
            return None;
        }
        factor.extend_from_slice(h.column(next).as_slice());
        let (known, row) = factor.split_at_mut(k * n);
        for known in known.chunks_exact(n) {
            let share = known[next];
            row.iter_mut().zip(known).for_each(|(entry, known)| *entry -= share * known);
        }
        let pivot = left[next].sqrt();
        for (left, entry) in left.iter_mut().zip(row) {
            *entry /= pivot;
            *left -= *entry * *entry;
        }
        left[next] = 0.0;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wide(rng: &mut fastrand::Rng) -> f64 {
        2.0 * rng.f64() - 1.0
    }

    /// H of n rows on `freedoms` freedoms; the unit of the first row is 1e10 times smaller than that of the others.
    fn gram(rng: &mut fastrand::Rng, n: usize, freedoms: usize) -> DMatrix<f64> {
        let unit = |i: usize| if i == 0 { 1e5 } else { 1e-5 };
        let j = DMatrix::from_fn(n, freedoms, |i, _| unit(i) * wide(rng));
        &j * j.transpose()
    }

    #[test]
    fn thin_factors_are_those_of_h_in_any_units() {
        let mut rng = fastrand::Rng::with_seed(1);
        for n in [2, 3, 9, 30, 150] {
            for freedoms in 1..=6.min(n / 2) {
                let h = gram(&mut rng, n, freedoms);
                let response = Response::thin(&h).unwrap();
                assert_eq!(response.rank(), freedoms);
                let product = response.rows().tr_mul(response.rows());
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    // A sum of at most six products, and the pivots left out.
                    let size = (h[(i, i)] * h[(j, j)]).sqrt();
                    assert!((product[(i, j)] - h[(i, j)]).abs() <= 1e-13 * size, "{n} {freedoms} {i} {j}");
                }
            }
        }
    }

    #[test]
    fn matrix_of_more_than_half_rank_is_not_factored() {
        let mut rng = fastrand::Rng::with_seed(2);
        for (n, freedoms) in [(1, 1), (3, 2), (6, 4), (12, 7), (12, 20)] {
            assert!(Response::thin(&gram(&mut rng, n, freedoms)).is_none(), "{n} {freedoms}");
        }
        assert!(Response::thin(&DMatrix::zeros(4, 4)).is_none());
    }

    /// Velocities and their bounds, row by row, thin, whole and for a matrix that is not symmetric.
    #[test]
    fn rows_of_the_factors_multiply_as_h_does() {
        let mut rng = fastrand::Rng::with_seed(3);
        let h = gram(&mut rng, 9, 3);
        let turned = DMatrix::from_fn(9, 9, |_, _| wide(&mut rng));
        let p = DVector::from_fn(9, |_, _| wide(&mut rng));
        for (h, response) in [
            (&h, Response::thin(&h).unwrap()),
            (&h, Response::whole(&h, true)),
            (&turned, Response::whole(&turned, false)),
        ] {
            let (u, most) = (h * &p, h.abs() * p.abs());
            let mut at_once = DVector::zeros(response.rank());
            response.reduce(&p, &mut at_once);
            let mut w = DVector::zeros(response.rank());
            for i in 0..9 {
                response.add(i, p[i], &mut w);
            }
            for i in 0..9 {
                let within = 1e-12 * h.row(i).amax();
                assert!((response.velocity(i, &w) - u[i]).abs() <= within);
                assert!((response.velocity(i, &at_once) - u[i]).abs() <= within);
                assert!(response.size(i, &p) >= most[i] - within, "a bound of the terms of row {i}");
            }
        }
    }
}
