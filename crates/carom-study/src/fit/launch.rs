//! Estimates the state at the start of a free flight from all its sampled poses.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | z | 2nv | (step from a reference pose to q₀, qd₀) at the first sample | `z` |
//! | Σ | 2nv×2nv | covariance of z, (SᵀS)⁻¹SᵀW S(SᵀS)⁻¹ | `inverse`·W^½ is a square root |
//! | W | m×m | variances of the residuals, one for each coordinate, from their scatter about the fit | `sigmas` |
//!
//! Residuals are differences of poses in the metric of `least_squares.rs`, m. Velocities of the table are not used: a filtered
//! difference of poses has an edge error at the first samples.

use super::error::FitError;
use super::flights::Flight;
use super::least_squares::{MOST_STEPS, SETTLED, Samples, greatest_miss, lines, medoid, pose_metric, rms, unwrap};
use super::loss::Cost;
use carom_chain::Chain;
use carom_sim::free_motion_at;
use nalgebra::{DMatrix, DVector, Vector3};

/// The state at the first sample of a flight, fitted to all its samples by [`launch()`].
#[derive(Debug, Clone, PartialEq)]
pub struct Launched {
    /// Configuration, rad or m.
    pub q: Vec<f64>,
    /// Joint velocities, rad/s or m/s.
    pub qd: Vec<f64>,
    /// Root mean square of the residuals, m.
    pub rest: f64,
    /// Times of the samples that were left out because their poses contradict those of all others, s.
    pub outliers: Vec<f64>,
    /// (SᵀS)⁻¹Sᵀ of (step of q, qd).
    inverse: DMatrix<f64>,
    /// Standard deviation of the residuals of each coordinate, m.
    sigmas: Vec<f64>,
    /// The metric of the residuals.
    metric: DMatrix<f64>,
}

/// The poses of a flight at its samples from a start (q, qd); `None` if it cannot be computed.
pub(crate) type Flies<'a> = &'a dyn Fn(&[f64], &[f64]) -> Option<Vec<Vec<f64>>>;

/// Greatest number of steps of [`Launched::refined`], and the length of z at which it ends.
const RESTEPS: usize = 12;
const RESETTLED: f64 = 1e-5;

impl Launched {
    /// A state drawn from the normal distribution of the estimate, by a generator of standard normal numbers.
    ///
    /// # Errors
    /// [`FitError::Chain`] for a chain other than that of the fit.
    pub fn drawn(&self, chain: &Chain, normal: &mut dyn FnMut() -> f64) -> Result<(Vec<f64>, Vec<f64>), FitError> {
        let (columns, nv) = (self.inverse.ncols(), chain.nv());
        let step = &self.inverse * DVector::from_fn(columns, |k, _| self.sigmas[k % nv] * normal());
        let (move_by, faster) = step.as_slice().split_at(chain.nv());
        Ok((chain.integrate(&self.q, move_by, 1.0)?, self.qd.iter().zip(faster).map(|(a, b)| a + b).collect()))
    }

    /// The state for other equations of the flight, `flown`: poses at the samples from a start. It solves (SᵀS)⁻¹Sᵀ r = 0 with
    /// the S of this estimate, by steps with this S. `None` if they do not converge or the flight cannot be computed.
    pub(crate) fn refined(&self, chain: &Chain, flight: &Flight, flown: Flies<'_>) -> Option<Self> {
        let (mut q, mut qd, mut poses) = (self.q.clone(), self.qd.clone(), flight.poses.clone());
        unwrap(chain, &mut poses);
        for _ in 0..RESTEPS {
            let there = flown(&q, &qd)?;
            let mut rest = Vec::new();
            for ((time, seen), there) in flight.times.iter().zip(&poses).zip(&there) {
                if !self.outliers.contains(time) {
                    let miss = DVector::from_vec(chain.difference(seen, there).ok()?);
                    rest.extend((&self.metric * miss).iter());
                }
            }
            let step = &self.inverse * DVector::from_vec(rest);
            let (back, slower) = step.as_slice().split_at(chain.nv());
            q = chain.integrate(&q, back, -1.0).ok()?;
            qd.iter_mut().zip(slower).for_each(|(qd, x)| *qd -= x);
            if step.norm() < RESETTLED {
                return Some(Self { q, qd, ..self.clone() });
            }
        }
        None
    }
}

/// Fewest samples that remain without outliers: two determine pose and velocity.
const FEWEST: usize = 3;

/// Estimates the state at the first sample of a free flight under `gravity` (world axes, m/s²) from the poses of all its
/// samples, at least 3, by least squares: no motor torques, no damping. Mistracked samples are left out.
///
/// # Errors
/// [`FitError::Input`]: too few samples; [`FitError::Chain`]: poses that do not fit the chain; [`FitError::NotConverged`].
pub fn launch(chain: &Chain, gravity: Vector3<f64>, flight: &Flight) -> Result<Launched, FitError> {
    let (found, needed) = (flight.times.len().min(flight.poses.len()), FEWEST);
    if found < needed {
        let what = "samples of a flight (three or more)";
        return Err(FitError::Input(format!("{what}: {found}, but {needed} are needed")));
    }
    let mut poses = flight.poses.clone();
    unwrap(chain, &mut poses);
    let middle = medoid(chain, &poses)?;
    let (step, rate) = lines(chain, &middle, &flight.times, &poses, flight.times[0])?;
    let reference = chain.integrate(&middle, &step, 1.0)?;
    let metric = pose_metric(chain, &reference)?;
    let begin = flight.times[0];
    let mut flown =
        Flown { chain, gravity, begin, flight: Flight { times: flight.times.clone(), poses }, reference, metric };
    let still = vec![0.0; chain.nv()];
    let z = flown.robust(DVector::from_vec([still, rate].concat()))?;
    let outliers = flown.leave_out(&z)?;
    let (z, settled) = flown.solve(z, Cost::SQUARES, SETTLED)?;
    flown.launched(&z, settled, outliers)
}

struct Flown<'a> {
    chain: &'a Chain,
    gravity: Vector3<f64>,
    begin: f64,
    flight: Flight,
    reference: Vec<f64>,
    metric: DMatrix<f64>,
}

impl Flown<'_> {
    fn pose(&self, z: &DVector<f64>) -> Result<Vec<f64>, FitError> {
        Ok(self.chain.integrate(&self.reference, &z.as_slice()[..self.chain.nv()], 1.0)?)
    }

    /// The estimate at the solution `z`.
    fn launched(&self, z: &DVector<f64>, settled: bool, outliers: Vec<f64>) -> Result<Launched, FitError> {
        let rest = self.residual(z)?;
        if !settled {
            return Err(FitError::NotConverged(format!(
                "the fit of the flight did not converge in {MOST_STEPS} steps; its residual is {} m",
                rms(&rest)
            )));
        }
        let slopes = self.slopes(z, &rest)?;
        // Noise of its own in each coordinate, which two unknowns describe: (SᵀS)⁻¹Sᵀ = R⁻¹Qᵀ with S = Q R
        let (nv, samples) = (self.chain.nv(), self.flight.times.len());
        let sigma = |v: usize| {
            let squares: f64 = rest.iter().skip(v).step_by(nv).map(|x| x * x).sum();
            (squares / (samples - 2) as f64).sqrt()
        };
        let sigmas: Vec<f64> = (0..nv).map(sigma).collect();
        let qr = slopes.qr();
        let inverse = qr.r().try_inverse().unwrap_or_else(|| DMatrix::zeros(z.len(), z.len()));
        let inverse = inverse * qr.q().transpose();
        let qd = z.as_slice()[self.chain.nv()..].to_vec();
        Ok(Launched { q: self.pose(z)?, qd, rest: rms(&rest), outliers, inverse, sigmas, metric: self.metric.clone() })
    }

    /// Removes the outliers of a fit and returns their times; none if too few samples would remain.
    fn leave_out(&mut self, z: &DVector<f64>) -> Result<Vec<f64>, FitError> {
        let misses = self.misses(&self.residual(z)?);
        Ok(self.flight.leave_out(&misses, greatest_miss(&misses), FEWEST))
    }
}

impl Samples for Flown<'_> {
    fn residual(&self, z: &DVector<f64>) -> Result<DVector<f64>, FitError> {
        let times: Vec<f64> = self.flight.times.iter().map(|t| t - self.begin).collect();
        let qd = &z.as_slice()[self.chain.nv()..];
        let flown = free_motion_at(self.chain, &self.pose(z)?, qd, self.gravity, &times)?;
        let mut out = Vec::new();
        for (there, seen) in flown.iter().zip(&self.flight.poses) {
            let miss = DVector::from_vec(self.chain.difference(seen, &there.q)?);
            out.extend((&self.metric * miss).iter());
        }
        Ok(DVector::from_vec(out))
    }

    fn of_one(&self) -> usize {
        self.chain.nv()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use carom_chain::urdf::LoadOptions;

    /// A tumbling body with unequal moments of inertia: the start fitted with equal ones does not describe the flight; fitted
    /// again from it with the right ones, it is the start of a fit from the beginning.
    #[test]
    fn a_start_fitted_again_for_another_inertia_is_that_of_a_new_fit() {
        let body = |moments: [f64; 3]| {
            let [x, y, z] = moments.map(|m| m * 1e-4);
            let text = format!(
                "<robot name='b'><link name='b'><inertial><mass value='0.4'/><inertia ixx='{x}' iyy='{y}' izz='{z}' ixy='0' \
                 ixz='0' iyz='0'/></inertial></link></robot>"
            );
            Chain::from_urdf_str(&text, &LoadOptions { floating_base: true, ..LoadOptions::default() }).unwrap()
        };
        let (equal, unequal) = (body([6.0, 6.0, 6.0]), body([4.0, 6.0, 8.0]));
        let gravity = Vector3::new(0.0, 0.0, -9.81);
        let (q, qd) = ([0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0], [0.5, 0.1, 0.3, 4.0, 5.0, -3.0]);
        let times: Vec<f64> = (0..15).map(|k| 0.0068 * f64::from(k)).collect();
        let flown = free_motion_at(&unequal, &q, &qd, gravity, &times).unwrap();
        let flight = Flight { times, poses: flown.into_iter().map(|moment| moment.q).collect() };
        let wrong = launch(&equal, gravity, &flight).unwrap();
        let turning = |q: &[f64], qd: &[f64]| {
            let flown = free_motion_at(&unequal, q, qd, gravity, &flight.times).ok()?;
            Some(flown.into_iter().map(|moment| moment.q).collect())
        };
        let again = wrong.refined(&unequal, &flight, &turning).unwrap();
        assert!(wrong.rest > 1e-5 && wrong.qd.iter().zip(&qd).any(|(a, b)| (a - b).abs() > 1e-2), "{wrong:?}");
        // the iteration ends with a step of 1e-5
        assert!(again.qd.iter().zip(&qd).all(|(a, b)| (a - b).abs() < 1e-5), "{:?}", again.qd);
    }
}
