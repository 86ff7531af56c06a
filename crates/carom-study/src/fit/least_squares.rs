//! Least squares over measured samples: the Levenberg–Marquardt method with the weights of a robust loss.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | z | p | unknowns | `z` |
//! | S | m×p | d(residual)/dz, differences | `slopes` |
//!
//! A mistracked sample must not move a fit. A fit therefore starts from straight lines with median slopes (H. Theil, 1950;
//! P. K. Sen, 1968). Huber's loss with the median residual as its threshold gives the first fit, and samples whose residual
//! exceeds ten medians are left out of the final fit, which is by least squares. Ten medians are 6.7 standard deviations of
//! normal noise in one direction, and more in several.
//!
//! The solver is implemented here because the crate for it depends on another version of nalgebra.

use super::error::FitError;
use super::loss::{Cost, median};
use carom_chain::urdf::JointType;
use carom_chain::{Chain, Coordinates};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Greatest number of steps; 4 to 12 are usual.
pub(crate) const MOST_STEPS: usize = 60;
/// The iteration ends with a relative step below this: the next one is smaller by the relative error of the numerical
/// derivative, at most 1e-5.
pub(crate) const SETTLED: f64 = 1e-9;
/// The same for the fit that finds outliers.
pub(crate) const ROUGH: f64 = 1e-4;
/// Residuals below this are rounding errors and the error of the integration, m.
const ROUNDING: f64 = 1e-8;
/// Residuals beyond this number of medians are outliers.
const OUTLYING: f64 = 10.0;
/// Step of the numerical derivative: m, rad, m/s, rad/s, s.
const STEP: f64 = 1e-6;

/// Residuals of samples as a function of unknowns.
pub(crate) trait Samples {
    /// The residuals of all samples, one after another.
    fn residual(&self, z: &DVector<f64>) -> Result<DVector<f64>, FitError>;

    /// Number of residuals of a sample.
    fn of_one(&self) -> usize;

    /// Whether the unknown `k` must not be increased by `step` at `z`.
    fn at_end(&self, _z: &DVector<f64>, _k: usize, _step: f64) -> bool {
        false
    }

    /// The nearest admissible unknowns.
    fn inside(&self, z: DVector<f64>) -> DVector<f64> {
        z
    }

    /// The norm of each sample's residual.
    fn misses(&self, residual: &DVector<f64>) -> Vec<f64> {
        residual.as_slice().chunks(self.of_one()).map(|miss| miss.iter().map(|x| x * x).sum::<f64>().sqrt()).collect()
    }

    /// S by forward differences.
    fn slopes(&self, z: &DVector<f64>, rest: &DVector<f64>) -> Result<DMatrix<f64>, FitError> {
        let mut slopes = DMatrix::zeros(rest.len(), z.len());
        for k in 0..z.len() {
            let mut moved = z.clone();
            let step = if self.at_end(z, k, STEP) { -STEP } else { STEP };
            moved[k] += step;
            slopes.set_column(k, &((self.residual(&moved)? - rest) / step));
        }
        Ok(slopes)
    }

    /// The fit by Huber's loss from `z`. It is repeated with the scale of its own residuals, and need not converge.
    fn robust(&self, mut z: DVector<f64>) -> Result<DVector<f64>, FitError> {
        for _ in 0..2 {
            let threshold = median(self.misses(&self.residual(&z)?)).max(ROUNDING);
            z = self.solve(z, Cost { threshold }, ROUGH)?.0;
        }
        Ok(z)
    }

    /// The minimum from `z` with a loss; also whether the iteration has converged.
    fn solve(&self, mut z: DVector<f64>, cost: Cost, settled: f64) -> Result<(DVector<f64>, bool), FitError> {
        let mut rest = self.residual(&z)?;
        let (one, mut damping) = (self.of_one(), 1e-3);
        for _ in 0..MOST_STEPS {
            let (mut slopes, mut weighted) = (self.slopes(&z, &rest)?, rest.clone());
            for (k, miss) in self.misses(&rest).into_iter().enumerate() {
                slopes.rows_mut(k * one, one).scale_mut(cost.weight(miss).sqrt());
                weighted.rows_mut(k * one, one).scale_mut(cost.weight(miss).sqrt());
            }
            let (gram, pull) = (slopes.transpose() * &slopes, slopes.transpose() * &weighted);
            let now = cost.sum(&self.misses(&rest));
            let mut moved = None;
            while damping < 1e6 && moved.is_none() {
                let mut damped = gram.clone();
                for k in 0..damped.nrows() {
                    damped[(k, k)] += damping * gram[(k, k)].max(1e-12);
                }
                let Some(factor) = damped.cholesky() else {
                    damping *= 10.0;
                    continue;
                };
                let next = self.inside(&z - factor.solve(&pull));
                // the integration can fail at trial velocities that are far too large
                match self.residual(&next).ok().filter(|r| cost.sum(&self.misses(r)) < now) {
                    Some(tried) => {
                        moved = Some((&next - &z).norm() / (1.0 + z.norm()));
                        (z, rest) = (next, tried);
                        damping = (damping * 0.1).max(1e-15);
                    }
                    None => damping *= 10.0,
                }
            }
            if moved.is_none_or(|moved| moved < settled) {
                return Ok((z, true));
            }
        }
        Ok((z, false))
    }
}

/// The greatest norm of the residual of a sample that is no outlier.
pub(crate) fn greatest_miss(misses: &[f64]) -> f64 {
    (OUTLYING * median(misses.iter().copied())).max(ROUNDING)
}

/// Root mean square of residuals.
pub(crate) fn rms(residual: &DVector<f64>) -> f64 {
    residual.norm() / (residual.len() as f64).sqrt()
}

/// Lᵀ/√m with the mass matrix M = L Lᵀ at `q` and the total mass m: differences of poses in this metric are in metres.
pub(crate) fn pose_metric(chain: &Chain, q: &[f64]) -> Result<DMatrix<f64>, FitError> {
    let mass_matrix = chain.workspace().update(chain, q)?.mass_matrix();
    let Some(factor) = mass_matrix.cholesky() else {
        let joint = chain.joints().first().map_or_else(String::new, |joint| joint.name.clone());
        return Err(carom_chain::ChainError::NoInertia { joint }.into());
    };
    Ok(factor.l().transpose() / chain.total_mass().sqrt())
}

/// The pose with the least sum of distances from the others: not an outlier.
pub(crate) fn medoid(chain: &Chain, poses: &[Vec<f64>]) -> Result<Vec<f64>, FitError> {
    let mut best: Option<(f64, &Vec<f64>)> = None;
    for pose in poses {
        let mut sum = 0.0;
        for other in poses {
            sum += chain.difference(pose, other)?.iter().map(|x| x * x).sum::<f64>().sqrt();
        }
        if best.is_none_or(|(least, _)| sum < least) {
            best = Some((sum, pose));
        }
    }
    Ok(best.map_or_else(Vec::new, |(_, pose)| pose.clone()))
}

/// Removes the wraps at ±π from the positions of continuous joints.
pub(crate) fn unwrap(chain: &Chain, poses: &mut [Vec<f64>]) {
    for joint in chain.joints() {
        let (JointType::Continuous, Coordinates::Own { q, .. }) = (joint.kind, &joint.coordinates) else { continue };
        for k in 1..poses.len() {
            let turns = ((poses[k][q.start] - poses[k - 1][q.start]) / TAU).round();
            poses[k][q.start] -= turns * TAU;
        }
    }
}

/// A straight line through the samples of each coordinate by medians: the steps from `reference` at `time`, and their rates.
pub(crate) fn lines(
    chain: &Chain,
    reference: &[f64],
    times: &[f64],
    poses: &[Vec<f64>],
    time: f64,
) -> Result<(Vec<f64>, Vec<f64>), FitError> {
    let steps: Result<Vec<_>, _> = poses.iter().map(|pose| chain.difference(reference, pose)).collect();
    let steps = steps?;
    let of = |v: usize| {
        let pairs = (0..times.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let rate = median(pairs.map(|(i, j)| (steps[i][v] - steps[j][v]) / (times[i] - times[j])));
        (median(steps.iter().zip(times).map(|(step, t)| step[v] - rate * (t - time))), rate)
    };
    Ok((0..chain.nv()).map(of).unzip())
}
