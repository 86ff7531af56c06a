//! Estimates the states before and after an impact from poses recorded in the flights before and after it.
//!
//! An impact is shorter than a sampling interval, so the difference quotient across it is the velocity of neither flight. Both
//! flights are therefore fitted together, as free motions that share the pose q* at the time t*, by least squares over all
//! samples. The unknowns are q*, qd⁻, qd⁺ and t*. The larger the velocity jump, the better t* is determined.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | z | 3nv+1 | (step from a reference pose to q*, qd⁻, qd⁺, t*) | `z` |
//! | S | m×(3nv+1) | d(residual)/dz, forward differences | `slopes` |
//! | L, m | nv×nv, 1 | M = L Lᵀ at the reference pose, total mass | `metric` = Lᵀ/√m |
//!
//! A mistracked sample must not move the fit. Straight lines with median slopes (H. Theil, 1950; P. K. Sen, 1968) give the
//! start, Huber's loss with the median residual as its threshold the first fit, and samples whose residual exceeds ten medians are
//! left out of the final fit, which is by least squares. Ten medians are 6.7 standard deviations of normal noise in one direction,
//! and more in several.
//!
//! Residuals are differences of poses in that metric, m. The solver is Levenberg–Marquardt, implemented here because the crate
//! for it depends on another version of nalgebra.

use super::error::FitError;
use super::loss::{Cost, median};
use crate::tosses::{TossError, Tosses};
use carom_chain::urdf::JointType;
use carom_chain::{Chain, Coordinates, FramePoint};
use carom_contact::{Obstacle, gap, link_shapes};
use carom_sim::{SimError, free_motion_at};
use nalgebra::{DMatrix, DVector, Vector3};
use std::f64::consts::TAU;

/// Sampled poses of one free flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    /// Times of the samples, ascending, s.
    pub times: Vec<f64>,
    /// Configuration q at each time, rad or m.
    pub poses: Vec<Vec<f64>>,
}

/// The impact between two flights, estimated by [`join_flights`].
#[derive(Debug, Clone, PartialEq)]
pub struct Joined {
    /// Time of the impact, s.
    pub time: f64,
    /// Configuration at the impact, rad or m.
    pub q: Vec<f64>,
    /// Joint velocities before the impact, rad/s or m/s.
    pub qd_minus: Vec<f64>,
    /// Joint velocities after the impact, rad/s or m/s.
    pub qd_plus: Vec<f64>,
    /// Root mean square of the residuals of all samples, m.
    pub rest: f64,
    /// Standard deviation of the estimated jump qd⁺ − qd⁻, m/s, in the metric of [`MeasuredImpact`](super::MeasuredImpact).
    pub deviation: f64,
    /// Times of the samples that were left out because their poses contradict those of all others, s.
    pub outliers: Vec<f64>,
}

/// Greatest number of steps; 4 to 12 are usual.
const MOST_STEPS: usize = 60;
/// The iteration ends with a relative step below this: the next one is smaller by the relative error of the numerical
/// derivative, at most 1e-5.
const SETTLED: f64 = 1e-9;
/// The same for the fit that finds outliers.
const ROUGH: f64 = 1e-4;
/// Residuals below this are rounding errors and the error of the integration, m.
const ROUNDING: f64 = 1e-8;
/// Residuals beyond this number of medians are outliers.
const OUTLYING: f64 = 10.0;
/// Fewest samples of a flight that remain without outliers.
const FEWEST: usize = 2;
/// Step of the numerical derivative: m, rad, m/s, rad/s, s.
const STEP: f64 = 1e-6;

/// Estimates time, pose and velocities of the impact between two free flights: no motor torques, no damping, under `gravity`
/// (world frame, m/s²). Each flight has at least two samples; mistracked samples are left out ([`Joined::outliers`]). Positions of continuous joints may wrap at ±π.
///
/// # Errors
/// [`FitError::Sizes`], [`FitError::NotFinite`], [`FitError::Times`], [`FitError::Overlap`]: too few, non-finite or unordered
/// samples; [`FitError::Chain`]: poses that do not fit the chain; [`FitError::NotJoined`]: no convergence.
pub fn join_flights(chain: &Chain, gravity: Vector3<f64>, before: &Flight, after: &Flight) -> Result<Joined, FitError> {
    let mut pair = Pair::new(chain, gravity, before, after)?;
    let mut z = pair.start()?;
    // The fit that finds outliers is repeated with the scale of its own residuals, and need not converge.
    for _ in 0..2 {
        let threshold = median(pair.misses(&pair.residual(&z)?)).max(ROUNDING);
        z = pair.solve(z, Cost { threshold }, ROUGH)?.0;
    }
    let outliers = pair.leave_out(&z)?;
    let (z, settled) = pair.solve(z, Cost::SQUARES, SETTLED)?;
    let rest = pair.residual(&z)?;
    if !settled {
        return Err(FitError::NotJoined { steps: MOST_STEPS, rest: rms(&rest) });
    }
    pair.joined(&z, &rest, outliers)
}

struct Pair<'a> {
    chain: &'a Chain,
    gravity: Vector3<f64>,
    /// In reverse order, from the impact backwards.
    before: Flight,
    after: Flight,
    reference: Vec<f64>,
    metric: DMatrix<f64>,
}

fn rms(residual: &DVector<f64>) -> f64 {
    residual.norm() / (residual.len() as f64).sqrt()
}

impl<'a> Pair<'a> {
    fn new(chain: &'a Chain, gravity: Vector3<f64>, before: &Flight, after: &Flight) -> Result<Self, FitError> {
        let still = vec![0.0; chain.nv()];
        for (which, flight) in [("before", before), ("after", after)] {
            let (found, needed) = (flight.poses.len(), flight.times.len());
            if found != needed {
                return Err(FitError::Sizes { what: "poses of a flight, one for each time", found, needed });
            }
            if found < 2 {
                return Err(FitError::Sizes { what: "samples of a flight (two or more)", found, needed: 2 });
            }
            if let Some(&value) = flight.times.iter().find(|t| !t.is_finite()) {
                return Err(FitError::NotFinite { what: "the list of a flight's times", value });
            }
            for pair in flight.times.windows(2) {
                if pair[1] <= pair[0] {
                    return Err(FitError::Times { which, time: pair[1], before: pair[0] });
                }
            }
            for pose in &flight.poses {
                chain.check_state(pose, &still)?;
            }
        }
        let (end, start) = (before.times[before.times.len() - 1], after.times[0]);
        if start <= end {
            return Err(FitError::Overlap { end, start });
        }
        let mut poses: Vec<Vec<f64>> = before.poses.iter().chain(&after.poses).cloned().collect();
        unwrap(chain, &mut poses);
        let later = poses.split_off(before.poses.len());
        let reference = medoid(chain, &later)?;
        let mass_matrix = chain.workspace().update(chain, &reference)?.mass_matrix();
        let Some(factor) = mass_matrix.cholesky() else {
            let joint = chain.joints().first().map_or_else(String::new, |joint| joint.name.clone());
            return Err(carom_chain::ChainError::NoInertia { joint }.into());
        };
        let metric = factor.l().transpose() / chain.total_mass().sqrt();
        poses.reverse();
        let before = Flight { times: before.times.iter().rev().copied().collect(), poses };
        let after = Flight { times: after.times.clone(), poses: later };
        Ok(Self { chain, gravity, before, after, reference, metric })
    }

    /// Initial values: a straight line through the samples of each flight, by medians of each coordinate, and t* midway between
    /// the flights.
    fn start(&self) -> Result<DVector<f64>, FitError> {
        let time = 0.5 * (self.before.times[0] + self.after.times[0]);
        let nv = self.chain.nv();
        let mut z = DVector::zeros(3 * nv + 1);
        for (k, flight) in [&self.before, &self.after].into_iter().enumerate() {
            let steps: Result<Vec<_>, _> =
                flight.poses.iter().map(|pose| self.chain.difference(&self.reference, pose)).collect();
            let (steps, times) = (steps?, &flight.times);
            for v in 0..nv {
                let pairs = (0..times.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
                let rate = median(pairs.map(|(i, j)| (steps[i][v] - steps[j][v]) / (times[i] - times[j])));
                z[nv * (k + 1) + v] = rate;
                z[v] += 0.5 * median(steps.iter().zip(times).map(|(step, t)| step[v] - rate * (t - time)));
            }
        }
        z[3 * nv] = time;
        Ok(z)
    }

    /// Levenberg–Marquardt with the weights of a loss; also returns whether it has converged.
    fn solve(&self, mut z: DVector<f64>, cost: Cost, settled: f64) -> Result<(DVector<f64>, bool), FitError> {
        let mut rest = self.residual(&z)?;
        let mut damping = 1e-3;
        for _ in 0..MOST_STEPS {
            let (mut slopes, mut weighted) = (self.slopes(&z, &rest)?, rest.clone());
            for (k, miss) in self.misses(&rest).into_iter().enumerate() {
                let (first, nv) = (k * self.chain.nv(), self.chain.nv());
                slopes.rows_mut(first, nv).scale_mut(cost.weight(miss).sqrt());
                weighted.rows_mut(first, nv).scale_mut(cost.weight(miss).sqrt());
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

    /// The norm of each sample's residual.
    fn misses(&self, residual: &DVector<f64>) -> Vec<f64> {
        residual.as_slice().chunks(self.chain.nv()).map(|miss| miss.iter().map(|x| x * x).sum::<f64>().sqrt()).collect()
    }

    /// Removes the outliers of a fit and returns their times, in ascending order; none from a flight of which too few samples
    /// would remain.
    fn leave_out(&mut self, z: &DVector<f64>) -> Result<Vec<f64>, FitError> {
        let misses = self.misses(&self.residual(z)?);
        let greatest = (OUTLYING * median(misses.iter().copied())).max(ROUNDING);
        let (mut gone, mut misses) = (Vec::new(), misses.into_iter());
        for flight in [&mut self.before, &mut self.after] {
            let fits: Vec<bool> = misses.by_ref().take(flight.times.len()).map(|miss| miss <= greatest).collect();
            if fits.iter().filter(|fits| **fits).count() < FEWEST {
                continue;
            }
            gone.extend(flight.times.iter().zip(&fits).filter(|(_, fits)| !**fits).map(|(time, _)| *time));
            let mut kept = fits.iter();
            flight.times.retain(|_| *kept.next().unwrap_or(&true));
            let mut kept = fits.iter();
            flight.poses.retain(|_| *kept.next().unwrap_or(&true));
        }
        gone.sort_by(f64::total_cmp);
        Ok(gone)
    }

    /// Clamps t* to the interval between the flights.
    fn inside(&self, mut z: DVector<f64>) -> DVector<f64> {
        let last = z.len() - 1;
        z[last] = z[last].clamp(self.before.times[0], self.after.times[0]);
        z
    }

    fn pose(&self, z: &DVector<f64>) -> Result<Vec<f64>, FitError> {
        Ok(self.chain.integrate(&self.reference, &z.as_slice()[..self.chain.nv()], 1.0)?)
    }

    fn residual(&self, z: &DVector<f64>) -> Result<DVector<f64>, FitError> {
        let nv = self.chain.nv();
        let (q, time) = (self.pose(z)?, z[3 * nv]);
        let mut out = Vec::new();
        for (k, flight) in [&self.before, &self.after].into_iter().enumerate() {
            let qd = &z.as_slice()[nv * (k + 1)..nv * (k + 2)];
            let times: Vec<f64> = flight.times.iter().map(|t| t - time).collect();
            let flown = free_motion_at(self.chain, &q, qd, self.gravity, &times)?;
            for (there, seen) in flown.iter().zip(&flight.poses) {
                let miss = DVector::from_vec(self.chain.difference(seen, &there.q)?);
                out.extend((&self.metric * miss).iter());
            }
        }
        Ok(DVector::from_vec(out))
    }

    fn slopes(&self, z: &DVector<f64>, rest: &DVector<f64>) -> Result<DMatrix<f64>, FitError> {
        let mut slopes = DMatrix::zeros(rest.len(), z.len());
        for k in 0..z.len() {
            let mut moved = z.clone();
            // t* stays between the flights
            let back = k == z.len() - 1 && z[k] + STEP > self.after.times[0];
            let step = if back { -STEP } else { STEP };
            moved[k] += step;
            slopes.set_column(k, &((self.residual(&moved)? - rest) / step));
        }
        Ok(slopes)
    }

    fn joined(&self, z: &DVector<f64>, rest: &DVector<f64>, outliers: Vec<f64>) -> Result<Joined, FitError> {
        let nv = self.chain.nv();
        let slopes = self.slopes(z, rest)?;
        let degrees = rest.len().saturating_sub(z.len()).max(1);
        let variance = rest.norm_squared() / degrees as f64;
        // the jump in the metric as a linear function of z
        let mut jump = DMatrix::zeros(nv, z.len());
        jump.columns_mut(2 * nv, nv).copy_from(&self.metric);
        jump.columns_mut(nv, nv).copy_from(&-&self.metric);
        let spread = (slopes.transpose() * &slopes).pseudo_inverse(1e-18).unwrap_or_else(|_| DMatrix::zeros(0, 0));
        let deviation = if spread.nrows() == z.len() {
            ((&jump * spread * jump.transpose()).trace() * variance).max(0.0).sqrt()
        } else {
            0.0
        };
        Ok(Joined {
            time: z[3 * nv],
            q: self.pose(z)?,
            qd_minus: z.as_slice()[nv..2 * nv].to_vec(),
            qd_plus: z.as_slice()[2 * nv..3 * nv].to_vec(),
            rest: rms(rest),
            deviation,
            outliers,
        })
    }
}

/// The pose with the least sum of distances from the others: not an outlier.
fn medoid(chain: &Chain, poses: &[Vec<f64>]) -> Result<Vec<f64>, FitError> {
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
fn unwrap(chain: &Chain, poses: &mut [Vec<f64>]) {
    for joint in chain.joints() {
        let (JointType::Continuous, Coordinates::Own { q, .. }) = (joint.kind, &joint.coordinates) else { continue };
        for k in 1..poses.len() {
            let turns = ((poses[k][q.start] - poses[k - 1][q.start]) / TAU).round();
            poses[k][q.start] -= turns * TAU;
        }
    }
}

/// The lowest point of the robot's collision shapes along `normal` (world frame) at configuration `q`.
///
/// # Errors
/// [`FitError::NoShape`] for a robot without shapes; [`FitError::Simulation`] for an invalid shape or normal;
/// [`FitError::Chain`] for a configuration that does not fit the chain.
pub fn lowest_point(chain: &Chain, q: &[f64], normal: impl Into<Vector3<f64>>) -> Result<FramePoint, FitError> {
    let plane = Obstacle::half_space(Vector3::zeros(), normal.into()).map_err(SimError::from)?;
    let mut workspace = chain.workspace();
    let kin = workspace.update(chain, q)?;
    let shapes = link_shapes(chain).map_err(SimError::from)?;
    let lowest = shapes.iter().map(|shape| {
        let pose = kin.pose(shape.frame());
        (shape.frame(), gap(shape, &pose, &plane), pose)
    });
    let lowest = lowest.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance));
    let (frame, gap, pose) = lowest.ok_or(FitError::NoShape)?;
    Ok(FramePoint::new(frame, pose.inverse().point(gap.on_robot)))
}

/// Greatest gap to the floor at the sample of an impact, m.
const NEAR: f64 = 0.005;
/// Least and greatest number of samples of a flight, those nearest to the impact.
const SAMPLES: (usize, usize) = (4, 12);

/// The flights before and after the first impact of each toss, with the number of the toss.
///
/// The impact is at the first local minimum of the gap between the lowest point of the robot and the floor that is below
/// 5 mm; that sample belongs to neither flight. The flight after it ends before the next such minimum. A flight has the at
/// most 12 samples nearest to the impact. Tosses with fewer than 4 samples before or after the impact are left out.
///
/// # Errors
/// [`TossError::Simulation`] for a pose that does not fit the robot.
pub fn toss_flights(tosses: &Tosses) -> Result<Vec<(i64, Flight, Flight)>, TossError> {
    let mut all = Vec::new();
    for toss in &tosses.tosses {
        let gaps = tosses.gaps(toss)?;
        let low = |k: &usize| gaps[*k] < gaps[k - 1] && gaps[*k] <= gaps[k + 1] && gaps[*k] < NEAR;
        let mut lows = (1..gaps.len().saturating_sub(1)).filter(low);
        let Some(first) = lows.next() else { continue };
        let next = lows.next().unwrap_or(gaps.len());
        let (fewest, most) = SAMPLES;
        let flight = |from: usize, to: usize| Flight {
            times: toss.samples[from..to].iter().map(|sample| sample.time).collect(),
            poses: toss.samples[from..to].iter().map(|sample| sample.q.clone()).collect(),
        };
        let (before, after) = (first.min(most), next.saturating_sub(first + 1).min(most));
        if before >= fewest && after >= fewest {
            all.push((toss.number, flight(first - before, first), flight(first + 1, first + 1 + after)));
        }
    }
    Ok(all)
}
