//! What the friction of an impact changes at most.

use nalgebra::{Matrix3, Vector3};

/// A bound on the change of the velocity after an impact by friction, m/s.
///
/// With C = nᵀHn and b = |H_tn|, dvₙ/dpₙ is between C − μb and C + μb (also for a sticking contact, which needs μ ≥ b/H_tt). So
/// pₙ is between (1+e)|uₙ|/(C + μb) and (1+e)|uₙ|/(C − μb) for every law; without friction it is (1+e)|uₙ|/C. Hence
/// `|Δu| ≤ |Hn| Δpₙ + max‖Ht‖ μ pₙ` with the largest such pₙ. Infinite for μb ≥ C.
pub(crate) fn friction_bound(delassus: &Matrix3<f64>, n: &Vector3<f64>, approach: f64, e: f64, mu: f64) -> f64 {
    let column = delassus * n;
    let c = n.dot(&column);
    let across = Matrix3::identity() - n * n.transpose();
    let b = (across * column).norm();
    if mu * b >= c {
        return f64::INFINITY;
    }
    let (plain, most) = ((1.0 + e) * approach / c, (1.0 + e) * approach / (c - mu * b));
    column.norm() * (most - plain) + (delassus * across).norm() * mu * most
}
