//! Estimates the states before and after an impact from poses recorded in the flights before and after it.
//!
//! An impact is shorter than a sampling interval, so the difference quotient across it is the velocity of neither flight. Both
//! flights are therefore fitted together, as free motions that share the pose q* at the time t*, by least squares over all
//! samples. The unknowns are q*, qd⁻, qd⁺ and t*. The larger the velocity jump, the better t* is determined.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | z | 3nv+1 | (step from a reference pose to q*, qd⁻, qd⁺, t*) | `z` |
//! | L, m | nv×nv, 1 | M = L Lᵀ at the reference pose, total mass | `metric` = Lᵀ/√m |
//!
//! Residuals are differences of poses in that metric, m; `least_squares.rs` has the method, and the treatment of mistracked
//! samples.

use super::error::FitError;
use super::least_squares::{MOST_STEPS, SETTLED, Samples, greatest_miss, lines, medoid, pose_metric, rms, unwrap};
use super::loss::Cost;
use crate::tosses::{TossError, Tosses};
use carom_chain::{Chain, FramePoint};
use carom_contact::{Obstacle, gap, link_shapes};
use carom_sim::{Moment, SimError, free_motion_at};
use nalgebra::{DMatrix, DVector, Vector3};

/// Sampled poses of one free flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    /// Times of the samples, ascending, s.
    pub times: Vec<f64>,
    /// Configuration q at each time, rad or m.
    pub poses: Vec<Vec<f64>>,
}

impl Flight {
    /// The poses of samples.
    pub(crate) fn of(samples: &[Moment]) -> Self {
        let (times, poses) = samples.iter().map(|sample| (sample.time, sample.q.clone())).unzip();
        Self { times, poses }
    }

    /// Removes the samples whose residual is above `greatest` and returns their times; none if fewer than `fewest` would remain.
    pub(super) fn leave_out(&mut self, misses: &[f64], greatest: f64, fewest: usize) -> Vec<f64> {
        if misses.iter().filter(|miss| **miss <= greatest).count() < fewest {
            return Vec::new();
        }
        let mut outliers = Vec::new();
        let (times, poses) = (std::mem::take(&mut self.times), std::mem::take(&mut self.poses));
        for ((time, pose), miss) in times.into_iter().zip(poses).zip(misses) {
            if *miss <= greatest {
                self.times.push(time);
                self.poses.push(pose);
            } else {
                outliers.push(time);
            }
        }
        outliers
    }
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

/// Fewest samples of a flight that remain without outliers.
const FEWEST: usize = 2;

/// Estimates time, pose and velocities of the impact between two free flights: no motor torques, no damping, under `gravity`
/// (world frame, m/s²). Each flight has at least two samples; mistracked samples are left out ([`Joined::outliers`]). Positions of continuous joints may wrap at ±π.
///
/// # Errors
/// [`FitError::Input`]: too few, non-finite or unordered samples; [`FitError::Chain`]: poses that do not fit the chain;
/// [`FitError::NotConverged`].
pub fn join_flights(chain: &Chain, gravity: Vector3<f64>, before: &Flight, after: &Flight) -> Result<Joined, FitError> {
    let mut pair = Pair::new(chain, gravity, before, after)?;
    let z = pair.robust(pair.start()?)?;
    let outliers = pair.leave_out(&z)?;
    let (z, settled) = pair.solve(z, Cost::SQUARES, SETTLED)?;
    let rest = pair.residual(&z)?;
    if !settled {
        return Err(FitError::NotConverged(format!(
            "no impact joins the two flights: the fit of pose, velocities and time did not converge in {MOST_STEPS} steps; its \
             residual is {} m",
            rms(&rest)
        )));
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

impl<'a> Pair<'a> {
    fn new(chain: &'a Chain, gravity: Vector3<f64>, before: &Flight, after: &Flight) -> Result<Self, FitError> {
        let still = vec![0.0; chain.nv()];
        for (which, flight) in [("before", before), ("after", after)] {
            let (found, needed) = (flight.poses.len(), flight.times.len());
            if found != needed {
                let what = "poses of a flight, one for each time";
                return Err(FitError::Input(format!("{what}: {found}, but {needed} are needed")));
            }
            if found < 2 {
                let what = "samples of a flight (two or more)";
                return Err(FitError::Input(format!("{what}: {found}, but 2 are needed")));
            }
            if let Some(&value) = flight.times.iter().find(|t| !t.is_finite()) {
                return Err(FitError::not_finite("the list of a flight's times", value));
            }
            for pair in flight.times.windows(2) {
                if pair[1] <= pair[0] {
                    return Err(FitError::Input(format!(
                        "the times of the flight {which} the impact must ascend: {} s follows {} s",
                        pair[1], pair[0]
                    )));
                }
            }
            for pose in &flight.poses {
                chain.check_state(pose, &still)?;
            }
        }
        let (end, start) = (before.times[before.times.len() - 1], after.times[0]);
        if start <= end {
            return Err(FitError::Input(format!(
                "the flight before the impact ends at {end} s and the flight after it begins at {start} s: it must begin later"
            )));
        }
        let mut poses: Vec<Vec<f64>> = before.poses.iter().chain(&after.poses).cloned().collect();
        unwrap(chain, &mut poses);
        let later = poses.split_off(before.poses.len());
        let reference = medoid(chain, &later)?;
        let metric = pose_metric(chain, &reference)?;
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
            let (at, rate) = lines(self.chain, &self.reference, &flight.times, &flight.poses, time)?;
            for v in 0..nv {
                z[nv * (k + 1) + v] = rate[v];
                z[v] += 0.5 * at[v];
            }
        }
        z[3 * nv] = time;
        Ok(z)
    }

    /// Removes the outliers of a fit and returns their times, in ascending order; none from a flight of which too few samples
    /// would remain.
    fn leave_out(&mut self, z: &DVector<f64>) -> Result<Vec<f64>, FitError> {
        let misses = self.misses(&self.residual(z)?);
        let greatest = greatest_miss(&misses);
        let (before, after) = misses.split_at(self.before.times.len());
        let mut gone = self.before.leave_out(before, greatest, FEWEST);
        gone.extend(self.after.leave_out(after, greatest, FEWEST));
        gone.sort_by(f64::total_cmp);
        Ok(gone)
    }

    fn pose(&self, z: &DVector<f64>) -> Result<Vec<f64>, FitError> {
        Ok(self.chain.integrate(&self.reference, &z.as_slice()[..self.chain.nv()], 1.0)?)
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

impl Samples for Pair<'_> {
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

    fn of_one(&self) -> usize {
        self.chain.nv()
    }

    /// t* stays between the flights.
    fn at_end(&self, z: &DVector<f64>, k: usize, step: f64) -> bool {
        k == z.len() - 1 && z[k] + step > self.after.times[0]
    }

    fn inside(&self, mut z: DVector<f64>) -> DVector<f64> {
        let last = z.len() - 1;
        z[last] = z[last].clamp(self.before.times[0], self.after.times[0]);
        z
    }
}

/// The lowest point of the robot's collision shapes along `normal` (world frame) at configuration `q`.
///
/// # Errors
/// [`FitError::Input`] for a robot without shapes; [`FitError::Simulation`] for an invalid shape or normal;
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
    let (frame, gap, pose) = lowest.ok_or_else(|| {
        let rule = "the robot has no collision shape to compute the contact point from: give the contact point";
        FitError::Input(rule.into())
    })?;
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
        let (before, after) = (first.min(most), next.saturating_sub(first + 1).min(most));
        if before >= fewest && after >= fewest {
            let flight = |from: usize, to: usize| Flight::of(&toss.samples[from..to]);
            all.push((toss.number, flight(first - before, first), flight(first + 1, first + 1 + after)));
        }
    }
    Ok(all)
}
