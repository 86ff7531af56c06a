//! Which combination of parameters do the measurements determine least?
//!
//! | symbol | size | meaning |
//! | --- | --- | --- |
//! | rᵢ, Jᵢ | m, m×p | residual of measurement i, and its derivative with respect to the parameters as shares of their ranges |
//! | G = Σ JᵢᵀJᵢ | p×p | Gauss–Newton matrix of the squared error |
//! | λ, w | 1, p | its least eigenvalue and the eigenvector, of length 1 |
//! | σ | 1 | √(Σ (wᵀJᵢᵀrᵢ)²)/λ: standard deviation of the estimate along w, measurements independent of one another |
//!
//! A measurement whose derivative exceeds ten medians is left out: its motion jumps within the step of the differences.

use super::candidates::{Candidate, title};
use super::search::Residuals;
use carom_study::fit::{Region, median};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// The combination of a model's parameters that the measurements determine least.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Weakest {
    /// The model.
    pub model: String,
    /// The direction, of length 1, with each parameter measured as a share of the range of its search: names and components.
    pub direction: Vec<(&'static str, f64)>,
    /// Standard deviation of the estimate along this direction, as a share of the ranges.
    pub deviation: f64,
    /// The same along the direction that is determined best.
    pub least_deviation: f64,
}

/// Half of the step of the differences, as a share of the range.
const STEP: f64 = 0.01;
/// Derivatives beyond this number of medians are those of jumps.
pub(super) const JUMP: f64 = 10.0;

/// The weakest combination at the parameters `x`; `residuals` gives the residual of each measurement, of a fixed length, or
/// `None` where the model refuses it. `None` with fewer than two parameters.
pub(super) fn weakest(
    model: &Candidate,
    region: &Region,
    x: &[f64],
    residuals: &dyn Fn(&[f64]) -> Residuals,
) -> Option<Weakest> {
    let p = x.len();
    if p < 2 {
        return None;
    }
    let at = residuals(x);
    let mut slopes: Vec<Option<DMatrix<f64>>> =
        at.iter().map(|r| r.as_ref().map(|r| DMatrix::zeros(r.len(), p))).collect();
    for (k, &(low, high)) in region.bounds.iter().enumerate() {
        let moved = |sign: f64| {
            let mut x = x.to_vec();
            x[k] = (x[k] + sign * STEP * (high - low)).clamp(low, high);
            (x[k], residuals(&x))
        };
        let ((above, up), (below, down)) = (moved(1.0), moved(-1.0));
        let share = (above - below) / (high - low);
        for ((slope, up), down) in slopes.iter_mut().zip(&up).zip(&down) {
            match (slope.as_mut(), up, down) {
                (Some(slope), Some(up), Some(down)) if up.len() == slope.nrows() && down.len() == slope.nrows() => {
                    slope.set_column(k, &((up - down) / share));
                }
                _ => *slope = None,
            }
        }
    }
    let usual = JUMP * median(slopes.iter().flatten().map(|slope| slope.norm()));
    let kept: Vec<(&DVector<f64>, &DMatrix<f64>)> = at
        .iter()
        .zip(&slopes)
        .filter_map(|(r, slope)| Some((r.as_ref()?, slope.as_ref()?)))
        .filter(|(_, slope)| slope.norm() <= usual)
        .collect();
    let mut gram = DMatrix::<f64>::zeros(p, p);
    kept.iter().for_each(|(_, slope)| gram += slope.transpose() * *slope);
    let eigen = gram.symmetric_eigen();
    let deviation = |k: usize| {
        let direction = eigen.eigenvectors.column(k);
        let pulls = kept.iter().map(|(r, slope)| (*slope * direction).dot(r).powi(2)).sum::<f64>();
        pulls.sqrt() / eigen.eigenvalues[k].max(f64::MIN_POSITIVE)
    };
    let (least, most) = (eigen.eigenvalues.imin(), eigen.eigenvalues.imax());
    let direction = eigen.eigenvectors.column(least);
    let sign = if direction[direction.iamax()] < 0.0 { -1.0 } else { 1.0 };
    let names = model.parameters.iter().map(|parameter| parameter.name());
    Some(Weakest {
        model: title(model),
        direction: names.zip(direction.iter().map(|w| sign * w)).collect(),
        deviation: deviation(least).min(f64::MAX),
        least_deviation: deviation(most),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Residuals that depend on the sum of two parameters alone: the weakest direction is their difference. One measurement that
    /// jumps does not count.
    #[test]
    fn the_weakest_direction_is_that_which_no_residual_sees() {
        let model = &Candidate::all()[1];
        let region = Region { bounds: vec![(0.0, 1.0), (0.0, 1.0)], grid: vec![vec![0.5]; 2] };
        let residuals = |x: &[f64]| -> Residuals {
            let one = |k: usize| {
                let noise = 0.01 * (k as f64 * 1.7).sin();
                let jump = if k == 3 && x[0] > 0.5 { 100.0 } else { 0.0 };
                Some(DVector::from_vec(vec![x[0] + x[1] - 1.0 + noise, noise + jump]))
            };
            (0..20).map(one).collect()
        };
        let found = weakest(model, &region, &[0.5, 0.5], &residuals).unwrap();
        let [a, b] = [found.direction[0].1, found.direction[1].1];
        assert!((a + b).abs() < 1e-9 && (a.abs() - 0.5_f64.sqrt()).abs() < 1e-9, "{found:?}");
        // along the sum, with derivatives √2: noise of 0.007 over √(2 · 19)
        assert!((1e-4..3e-3).contains(&found.least_deviation), "{found:?}");
    }
}
