//! How well a coefficient is known.
//!
//! | symbol | size | meaning |
//! | --- | --- | --- |
//! | rᵢ, Jᵢ | m, m×p | residual of impact i and its derivative by the coefficients |
//! | wᵢ, ρ | 1 | weight and loss, see `loss.rs` |
//! | gᵢ = wᵢ Jᵢᵀ rᵢ | p | what impact i pulls the coefficients by |
//! | A = Σ (wᵢ JᵢᵀJᵢ + 2ρ'' Jᵢᵀrᵢ rᵢᵀJᵢ) | p×p | curvature of the loss (Gauss & Newton's part; ρ'' by r²) |
//!
//! Covariance A⁻¹ (Σ gᵢ gᵢᵀ) A⁻¹ · n/(n − p) (P. J. Huber 1967; H. White, Econometrica 48 (1980) 817), with Student's
//! quantile of n − p degrees: the impacts are taken for independent of one another, and nothing is assumed of the
//! noise's size or direction within one.

use super::loss::Cost;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Half the width of each coefficient's interval; `None` where the curvature is singular.
pub(crate) fn half_widths(
    residuals: &[DVector<f64>],
    jacobians: &[DMatrix<f64>],
    cost: Cost,
    confidence: f64,
) -> Option<Vec<f64>> {
    let (n, p) = (residuals.len(), jacobians.first()?.ncols());
    if n <= p {
        return None;
    }
    let (mut curvature, mut pulls) = (DMatrix::zeros(p, p), DMatrix::zeros(p, p));
    for (r, j) in residuals.iter().zip(jacobians) {
        let norm = r.norm();
        let weight = cost.weight(norm);
        let along = j.transpose() * r;
        curvature += j.transpose() * j * weight;
        if norm > cost.threshold {
            curvature -= &along * along.transpose() * (weight / (norm * norm));
        }
        let pull = along * weight;
        pulls += &pull * pull.transpose();
    }
    let inverse = curvature.cholesky()?.inverse();
    let covariance = &inverse * pulls * &inverse * (n as f64 / (n - p) as f64);
    let quantile = quantile(n - p, confidence)?;
    Some(covariance.diagonal().iter().map(|variance| quantile * variance.max(0.0).sqrt()).collect())
}

/// Student's two-sided quantile.
pub(crate) fn quantile(degrees: usize, confidence: f64) -> Option<f64> {
    Some(StudentsT::new(0.0, 1.0, degrees as f64).ok()?.inverse_cdf(0.5 + 0.5 * confidence))
}

/// How often each of `n` measurements is drawn when `n` are drawn with replacement.
pub(crate) fn resample(n: usize, rng: &mut fastrand::Rng) -> Vec<f64> {
    let mut counts = vec![0.0; n];
    (0..n).for_each(|_| counts[rng.usize(0..n)] += 1.0);
    counts
}

/// The interval that holds the middle `confidence` of the drawn values.
pub(crate) fn percentiles(mut values: Vec<f64>, confidence: f64) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    let last = (values.len() - 1) as f64;
    let at = |share: f64| {
        let place = share * last;
        let (low, part) = (place.floor(), place.fract());
        let above = values[(low as usize + 1).min(values.len() - 1)];
        values[low as usize] * (1.0 - part) + above * part
    };
    (at(0.5 - 0.5 * confidence), at(0.5 + 0.5 * confidence))
}
