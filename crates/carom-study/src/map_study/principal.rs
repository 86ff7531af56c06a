//! Eigenvectors of H from its factor.
//!
//! H = E Eᵀ, where column k of E is yₖ/√Dₖ ([`carom_chain::PointResponse`]). Rotations that make the rows of E orthogonal (one-sided
//! Jacobi) give the eigenvectors of H. An eigenvalue is a sum of squares, accurate down to ε² of the largest; that of H itself
//! would be accurate to ε.

use nalgebra::{SMatrix, SVector};

/// An eigenvalue whose root is below this fraction of √(tr H) counts as zero, as in [`carom_chain::PointResponse::moves`].
pub(super) const fn singular() -> f64 {
    64.0 * f64::EPSILON
}

/// Greatest number of sweeps; three rows need about four.
const SWEEPS: usize = 30;

/// Eigenvectors of E Eᵀ as columns, and its eigenvalues. Overwrites the columns of E.
pub(super) fn eigenvectors<const D: usize>(columns: &mut [SVector<f64, D>]) -> (SMatrix<f64, D, D>, SVector<f64, D>) {
    let product = |columns: &[SVector<f64, D>], i: usize, j: usize| columns.iter().map(|e| e[i] * e[j]).sum::<f64>();
    let mut vectors = SMatrix::<f64, D, D>::identity();
    for _ in 0..SWEEPS {
        let mut turned = false;
        for (i, j) in (0..D).flat_map(|i| (i + 1..D).map(move |j| (i, j))) {
            let (a, b, c) = (product(columns, i, i), product(columns, j, j), product(columns, i, j));
            if c == 0.0 || c.abs() <= f64::EPSILON * a.sqrt() * b.sqrt() {
                continue;
            }
            turned = true;
            let cot = (b - a) / (2.0 * c); // of twice the angle
            let tan = 1.0_f64.copysign(cot) / (cot.abs() + cot.hypot(1.0));
            let cos = 1.0 / tan.hypot(1.0);
            let sin = tan * cos;
            for e in columns.iter_mut() {
                (e[i], e[j]) = (cos * e[i] - sin * e[j], sin * e[i] + cos * e[j]);
            }
            for k in 0..D {
                let (x, y) = (vectors[(k, i)], vectors[(k, j)]);
                (vectors[(k, i)], vectors[(k, j)]) = (cos * x - sin * y, sin * x + cos * y);
            }
        }
        if !turned {
            break;
        }
    }
    (vectors, SVector::from_fn(|i, _| product(columns, i, i)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Vector3};

    #[test]
    fn eigenvalues_are_exact_down_to_the_square_of_rounding() {
        let turn = Rotation3::from_euler_angles(0.3, -0.8, 1.1);
        let sigma = [2.0, 0.5, 1e-9];
        let mut columns: Vec<Vector3<f64>> = (0..3).map(|k| turn.matrix().column(k) * sigma[k]).collect();
        let (vectors, values) = eigenvectors(&mut columns);
        for (k, s) in sigma.iter().enumerate() {
            let own = (0..3).max_by(|a, b| {
                let along = |i: &usize| vectors.column(*i).dot(&turn.matrix().column(k)).abs();
                along(a).total_cmp(&along(b))
            });
            let own = own.unwrap();
            assert!((values[own] / (s * s) - 1.0).abs() < 1e-6, "{} for {}", values[own], s * s);
            assert!(vectors.column(own).dot(&turn.matrix().column(k)).abs() > 1.0 - 1e-14);
        }
    }
}
