//! Lower bound of the residual of a point contact: the minimum over all admissible impulses, independent of the law.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | b | m | measured jump | `jump` |
//! | A | m×D | jump per unit impulse | `reach` |
//! | p | D | impulse, contact axes, tangents first | – |
//! | μ | 1 | coefficient of friction | `friction` |
//!
//! min ‖b − A p‖ over pₙ ≥ 0 and |p_t| ≤ μ pₙ. The problem is convex. If the unconstrained least-squares solution is
//! inadmissible, the minimum is on the cone, p = λ (μ cos θ, μ sin θ, 1), where λ ≥ 0 has a closed form and θ is searched:
//! values every 5°, then Brent's method around the best.

use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::brent::BrentOpt;
use carom_impact::least_norm;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Relative tolerance of the rank: smaller pivots belong to directions that no joint moves.
const RANK: f64 = 1e-12;

/// The least residual norm of all impulses in the friction cone; with infinite friction, of all with pₙ ≥ 0.
pub(crate) fn least_residual(reach: &DMatrix<f64>, jump: &DVector<f64>, friction: f64) -> f64 {
    let n = reach.ncols() - 1;
    let free = least_norm(reach, jump, RANK);
    let pushes = free[n] >= 0.0;
    let within = pushes && (friction.is_infinite() || free.rows(0, n).norm() <= friction * free[n]);
    if within {
        return (jump - reach * free).norm();
    }
    if friction.is_infinite() {
        // on the boundary of the half-space p_n = 0
        let flat = reach.columns(0, n).into_owned();
        return (jump - &flat * least_norm(&flat, jump, RANK)).norm();
    }
    let on_ray = |tangent: &[f64]| {
        let direction = reach * DVector::from_iterator(n + 1, tangent.iter().map(|t| t * friction).chain([1.0]));
        let length = direction.norm_squared();
        let along = if length > 0.0 { (direction.dot(jump) / length).max(0.0) } else { 0.0 };
        (jump - direction * along).norm()
    };
    if n == 1 {
        return on_ray(&[1.0]).min(on_ray(&[-1.0]));
    }
    let at = |angle: f64| on_ray(&[angle.cos(), angle.sin()]);
    const RAYS: usize = 72;
    let step = TAU / RAYS as f64;
    let rays = (0..RAYS).map(|k| k as f64 * step);
    let best = rays.map(|angle| (at(angle), angle)).min_by(|a, b| a.0.total_cmp(&b.0));
    let (coarse, angle) = best.unwrap_or((f64::INFINITY, 0.0));
    let brent = BrentOpt::new(angle - step, angle + step).set_tolerance(1e-12, 1e-12);
    let ran = Executor::new(Ray(&at), brent).configure(|state| state.max_iters(100)).run();
    let fine = ran.map_or(coarse, |done| done.state.best_cost);
    coarse.min(fine)
}

struct Ray<'a>(&'a dyn Fn(f64) -> f64);

impl CostFunction for Ray<'_> {
    type Param = f64;
    type Output = f64;

    fn cost(&self, angle: &f64) -> Result<f64, Error> {
        Ok((self.0)(*angle))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference solution: projected gradient descent with the exact projection onto the cone.
    fn by_descent(a: &DMatrix<f64>, b: &DVector<f64>, mu: f64) -> f64 {
        let n = a.ncols() - 1;
        let gram = a.transpose() * a;
        let step = 1.0 / gram.symmetric_eigenvalues().max();
        let mut p = DVector::zeros(n + 1);
        for _ in 0..20_000 {
            p -= (&gram * &p - a.transpose() * b) * step;
            let t = p.rows(0, n).norm();
            if t > mu * p[n] {
                let along = ((mu * t + p[n]) / (1.0 + mu * mu)).max(0.0);
                let scale = if t > 0.0 { mu * along / t } else { 0.0 };
                p.rows_mut(0, n).scale_mut(scale);
                p[n] = along;
            }
        }
        (b - a * p).norm()
    }

    #[test]
    fn least_residual_equals_that_of_projected_gradient_descent() {
        let mut rng = fastrand::Rng::with_seed(1);
        let mut outside = 0;
        for k in 0..60 {
            let (rows, columns) = (3 + k % 4, 2 + k % 2);
            let a = DMatrix::from_fn(rows, columns, |_, _| rng.f64() - 0.5);
            let b = DVector::from_fn(rows, |_, _| rng.f64() - 0.5);
            let mu = 0.1 + rng.f64();
            let (ours, theirs) = (least_residual(&a, &b, mu), by_descent(&a, &b, mu));
            // the error of the descent is O(1/steps)
            assert!((ours - theirs).abs() < 1e-5 * b.norm(), "{k}: {ours} against {theirs}");
            assert!(ours <= theirs + 1e-12 * b.norm(), "{k}: {ours} above {theirs}");
            let any = least_residual(&a, &b, f64::INFINITY);
            assert!(any <= ours + 1e-12, "{k}: more friction must not increase the residual");
            outside += usize::from(ours > any + 1e-6);
        }
        assert!(outside > 20, "too few cases in which the cone is active: {outside}");
    }
}
