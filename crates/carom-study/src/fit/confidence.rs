//! Confidence intervals: profile likelihood with a leverage-corrected sandwich covariance.
//!
//! | symbol | size | meaning |
//! | --- | --- | --- |
//! | rᵢ, Jᵢ | m, m×p | residual of impact i and its derivative with respect to the coefficients |
//! | wᵢ, ρ | 1 | weight and loss, see `loss.rs` |
//! | gᵢ = wᵢ Jᵢᵀ rᵢ | p | contribution of impact i to the gradient of the loss (score) |
//! | Aᵢ = wᵢ JᵢᵀJᵢ + 2ρ'' Jᵢᵀrᵢ rᵢᵀJᵢ, A = Σ Aᵢ | p×p | Gauss–Newton Hessian of the loss (ρ'' with respect to r²) |
//! | Bᵢ = A^-½ Aᵢ A^-½, Σ Bᵢ = 1 | p×p | leverage of impact i: its share of the information |
//! | z, ν | p, 1 | A^-½ eₖ; degrees of freedom of the variance of coefficient k |
//!
//! The sandwich covariance is A⁻¹ (Σ gᵢ gᵢᵀ) A⁻¹ (P. J. Huber 1967; H. White, Econometrica 48 (1980) 817). It assumes that
//! the impacts are independent, and nothing about the size or direction of the noise within an impact. It is biased low for
//! impacts with high leverage, whose residuals the fit makes small. This matters for friction, which only slipping impacts
//! identify: with a quarter of thirty impacts slipping, its 95 % intervals contain the true value in 84 % of the cases.
//! Each score is therefore multiplied by (1 − Bᵢ)^-½, which makes the variance unbiased for homogeneous noise, and Student's
//! quantile is taken for ν = (Σᵢ Mᵢᵢ)²/Σᵢⱼ Mᵢⱼ² degrees of freedom, Mᵢⱼ = δᵢⱼ zᵀ(1 − Bᵢ)⁻¹Bᵢ z − yᵢᵀyⱼ,
//! yᵢ = Bᵢ(1 − Bᵢ)^-½ z (R. M. Bell & D. F. McCaffrey, Survey Methodology 28 (2002) 169; here with p×p matrices), which lies
//! between 1 and n − p.
//!
//! The half-width of this interval is converted into an increase of the loss. The ends of the profile interval are the values
//! at which the loss, minimised over the other coefficients, has increased by this amount. Both intervals are equal where the
//! loss is quadratic. The profile interval remains valid beyond a kink, where impacts stick and the loss is flat, and at the
//! bounds of the search.

use super::loss::Cost;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Size of the interval of a coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reach {
    /// Half-width of the interval for a quadratic loss.
    pub width: f64,
    /// Increase of the loss at the ends of the interval.
    pub rise: f64,
}

/// The size of each coefficient's interval; `None` for a coefficient that one impact alone identifies. `None` for all if the
/// Hessian is singular.
pub(crate) fn reaches(
    residuals: &[DVector<f64>],
    jacobians: &[DMatrix<f64>],
    cost: Cost,
    confidence: f64,
) -> Option<Vec<Option<Reach>>> {
    let p = jacobians.first()?.ncols();
    let one = |(r, j): (&DVector<f64>, &DMatrix<f64>)| {
        let norm = r.norm();
        let weight = cost.weight(norm);
        let along = j.transpose() * r;
        let mut curvature = j.transpose() * j * weight;
        if norm > cost.threshold {
            curvature -= &along * along.transpose() * (weight / (norm * norm));
        }
        (curvature, along * weight)
    };
    let each: Vec<(DMatrix<f64>, DVector<f64>)> = residuals.iter().zip(jacobians).map(one).collect();
    let total = each.iter().fold(DMatrix::zeros(p, p), |sum: DMatrix<f64>, (curvature, _)| sum + curvature);
    // The eigenvalue zero of a singular matrix is rounded to either side.
    let least = 4.0 * f64::EPSILON * total.trace();
    let root = function(&total, |x| if x > least { 1.0 / x.sqrt() } else { f64::NAN });
    if !root.iter().all(|x| x.is_finite()) {
        return None;
    }
    let mut variances = DVector::zeros(p);
    let (mut known, mut squares, mut crossed) = (vec![0.0; p], vec![0.0; p], vec![0.0; p]);
    let mut outer = vec![DMatrix::<f64>::zeros(p, p); p];
    for (curvature, pull) in &each {
        let leverage = &root * curvature * &root;
        // an impact with leverage 1 has no residual from which its noise could be estimated
        let freed = function(&leverage, |b| if 1.0 - b > ALL { 1.0 / (1.0 - b).sqrt() } else { 0.0 });
        let moved = &root * &freed * &root * pull;
        variances += moved.component_mul(&moved);
        let told = &leverage * &freed;
        for k in 0..p {
            let z = root.column(k);
            let y = &told * z;
            let own = (&freed * z).dot(&y);
            let length = y.norm_squared();
            known[k] += own - length;
            squares[k] += own * own;
            crossed[k] += own * length;
            outer[k] += &y * y.transpose();
        }
    }
    let of = |k: usize| {
        let inverse = root.column(k).norm_squared();
        if known[k] < (1.0 - 1e-6) * inverse {
            return None;
        }
        let degrees: f64 = known[k] * known[k] / (squares[k] - 2.0 * crossed[k] + outer[k].norm_squared());
        let width = quantile(degrees.max(1.0), confidence)? * variances[k].sqrt();
        Some(Reach { width, rise: width * width / inverse })
    };
    Some((0..p).map(of).collect())
}

/// A leverage within this of 1 counts as 1.
const ALL: f64 = 1e-9;

/// A function of a symmetric matrix, computed from its eigenvalues.
fn function(matrix: &DMatrix<f64>, of: impl Fn(f64) -> f64) -> DMatrix<f64> {
    let eigen = matrix.clone().symmetric_eigen();
    &eigen.eigenvectors * DMatrix::from_diagonal(&eigen.eigenvalues.map(of)) * eigen.eigenvectors.transpose()
}

/// Student's two-sided quantile.
pub(crate) fn quantile(degrees: f64, confidence: f64) -> Option<f64> {
    Some(StudentsT::new(0.0, 1.0, degrees).ok()?.inverse_cdf(0.5 + 0.5 * confidence))
}

/// How often each of `n` measurements is drawn when `n` are drawn with replacement.
pub(crate) fn resample(n: usize, rng: &mut fastrand::Rng) -> Vec<f64> {
    let mut counts = vec![0.0; n];
    (0..n).for_each(|_| counts[rng.usize(0..n)] += 1.0);
    counts
}

/// The central interval with a fraction `confidence` of the values.
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
