//! Linear equations with many solutions or none.

use nalgebra::{DMatrix, DVector};

/// Of all x that minimise |A x − b| the shortest, by a complete orthogonal decomposition: QR with column pivoting, then
/// QR of the transposed upper factor (Golub & Van Loan, Matrix Computations, 4th ed., sections 5.4.7 and 5.5). Pivots
/// below `rank` times the largest count as zero. NaN if A contains one.
///
/// nalgebra's SVD is not used: in version 0.35 its result is wrong by up to a third for some matrices with a double
/// singular value, such as the Delassus matrix at a cube's corner, and by all of it for some of dependent rows or columns
/// (<https://github.com/dimforge/nalgebra/issues/1172>).
pub fn least_norm(a: &DMatrix<f64>, b: &DVector<f64>, rank: f64) -> DVector<f64> {
    let factors = a.clone().col_piv_qr();
    let upper = factors.r();
    let pivots: Vec<f64> = (0..upper.nrows().min(upper.ncols())).map(|k| upper[(k, k)]).collect();
    if pivots.iter().any(|pivot| !pivot.is_finite()) {
        return DVector::from_element(a.ncols(), f64::NAN);
    }
    let least = rank * pivots.iter().fold(0.0, |most: f64, pivot| most.max(pivot.abs()));
    let rank = pivots.iter().take_while(|pivot| pivot.abs() > least).count();
    let mut x = DVector::zeros(a.ncols());
    if rank > 0 {
        let mut turned = b.clone();
        factors.q_tr_mul(&mut turned);
        let across = upper.rows(0, rank).transpose().qr();
        // `across` has full rank: none of its pivots is zero.
        if let Some(along) = across.r().tr_solve_upper_triangular(&turned.rows(0, rank)) {
            x = across.q() * along;
        }
        factors.p().inv_permute_rows(&mut x);
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, UnitQuaternion, Vector3};

    /// H of a cube's corner has a double eigenvalue: r at the corner, H = 1/m + (r² − r rᵀ)/I, whose inverse is
    /// m (r rᵀ/r²) + (1 − r rᵀ/r²)/(1/m + r²/I).
    #[test]
    fn cube_corner_is_solved_in_every_pose() {
        let (mass, inertia) = (0.37, 8e-4);
        let mut worst = 0.0_f64;
        for k in 0..20_000 {
            let angle = |rate: f64| f64::from(k) * rate % 6.0;
            let turn = UnitQuaternion::from_euler_angles(angle(0.7), angle(0.43), angle(0.311));
            let r = turn * Vector3::new(0.05, 0.05, -0.05);
            let (square, outer) = (r.norm_squared(), r * r.transpose());
            let one = Matrix3::identity();
            let h = one / mass + (one * square - outer) / inertia;
            let along = outer / square;
            let b = Vector3::new(angle(0.013) - 3.0, angle(0.017) - 3.0, 9.0);
            let expected = along * b * mass + (one - along) * b / (1.0 / mass + square / inertia);
            let (h, b) = (DMatrix::from_column_slice(3, 3, h.as_slice()), DVector::from_column_slice(b.as_slice()));
            let found = least_norm(&h, &b, 1e-12);
            worst = worst.max((Vector3::from_column_slice(found.as_slice()) - expected).norm() / expected.norm());
        }
        // The condition number is 2.2.
        assert!(worst < 1e-14, "{worst}");
    }

    /// A = T W of rank 2: the shortest least-squares solution is Wᵀ(W Wᵀ)⁻¹(Tᵀ T)⁻¹Tᵀ b.
    #[test]
    fn redundant_equations_get_the_shortest_least_squares_solution() {
        let t = DMatrix::from_row_slice(4, 2, &[1.0, 0.3, -0.4, 1.0, 0.2, 0.1, 0.5, -0.7]);
        let w = DMatrix::from_row_slice(2, 3, &[0.6, -1.0, 0.2, 0.3, 0.4, 1.1]);
        let b = DVector::from_vec(vec![1.0, -2.0, 0.5, 0.3]);
        let inverse = |m: DMatrix<f64>| m.try_inverse().unwrap();
        let expected = w.transpose() * inverse(&w * w.transpose()) * inverse(t.transpose() * &t) * t.transpose() * &b;
        let found = least_norm(&(&t * &w), &b, 1e-12);
        // Conditions below 10.
        assert!((&found - &expected).norm() < 1e-14 * expected.norm() * 10.0, "{found} instead of {expected}");
        // More unknowns than equations: Wᵀ(W Wᵀ)⁻¹ b.
        let b = DVector::from_vec(vec![0.4, -1.2]);
        let expected = w.transpose() * inverse(&w * w.transpose()) * &b;
        assert!((least_norm(&w, &b, 1e-12) - &expected).norm() < 1e-13 * expected.norm());
        assert_eq!(least_norm(&DMatrix::zeros(2, 3), &DVector::from_element(2, 1.0), 1e-12), DVector::zeros(3));
        let hole = least_norm(&DMatrix::from_element(2, 2, f64::NAN), &DVector::zeros(2), 1e-12);
        assert!(hole.iter().all(|x| x.is_nan()), "{hole}");
    }
}
