//! Sequential quadratic programming with a trust region (Fletcher 1982: Sℓ₁QP).
//!
//! | symbol | meaning |
//! | --- | --- |
//! | u, d | unknowns as shares of their sizes, and the step |
//! | c, J | conditions a ≤ c ≤ b, and their derivatives |
//! | r, R | functions whose squares are costs, and their derivatives |
//! | g, B | derivatives of the other costs, and an approximation of the second derivatives of the Lagrangian |
//! | t | what the linearised conditions miss |
//! | Δ | trust radius |
//! | ν | weight of the conditions in the merit function φ = f + ν Σ miss |
//!
//! The step minimises
//!
//! ```text
//! ½ dᵀBd + gᵀd + Σ w (r + R d)² + ν Σ t   with   a − t ≤ c + J d ≤ b + t,  t ≥ 0,  |dᵢ| ≤ Δ,  bounds of u
//! ```
//!
//! and is taken if φ of the run decreases by a share of what this model promises; otherwise Δ is a quarter. The conditions are met exactly
//! once ν exceeds their multipliers. Squares have the Gauss–Newton approximation, other costs and the conditions with them Powell's damped
//! BFGS update. Without a cost B is small: of the steps that meet the linearised conditions the shortest is taken.
//!
//! The merit is that of runs, whatever events they have: a step may add or lose an impact.

use super::evaluate::{Slopes, Values};
use super::problem::Problem;
use super::unknown::size;
use super::{AimError, End, Found, Met, Starts, Step, Stuck, Unknown};
use carom_sim::SimError;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, ZeroConeT};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Second derivative along directions in which nothing else bends, as a share of ν without a cost, and of the cost's derivatives: of steps
/// that are equally good the shorter is taken.
const SHORTER: f64 = 1e-8;
/// Of more unknowns the second derivatives of squares are those of the Gauss-Newton method alone: others are a full matrix.
const MANY: usize = 100;
/// A smaller trust radius is that of a kink or a jump.
const SMALLEST: f64 = 1e-10;
/// A model that promises less than this share of the cost, or of the miss, has reached its least value.
const LEAST: f64 = 1e-10;
/// The distance from a bound, as a share of the size of an unknown, at which the answer of the solver is at the bound.
const INSIDE: f64 = 1e-9;
/// Random values that are run for each start of a search from many.
const DRAWS: usize = 20;
/// Largest weight of the conditions, as a multiple of the first one, if this is above 1.
const HEAVIEST: f64 = 1e8;

/// A place of the search.
struct Place {
    u: Vec<f64>,
    values: Values,
    slopes: Slopes,
}

/// The quadratic program's answer.
struct Solved {
    d: DVector<f64>,
    /// The multipliers of the conditions.
    multipliers: DVector<f64>,
    /// The linearised misses.
    missed: f64,
    /// The decrease of the merit that the model promises.
    promised: f64,
}

impl Problem {
    /// Looks for unknowns near those of the problem.
    ///
    /// # Errors
    /// [`AimError`]: the first motion fails, has no derivative or lacks an impact; the search does not meet the conditions.
    pub fn solve(&self) -> Result<Found, AimError> {
        self.solve_from(self.given.first())
    }

    /// [`Problem::solve`] from so many random values of the unknowns, even between their bounds, each the nearest to the aim of twenty draws; of
    /// those that meet the conditions that of the least cost, without a cost the first. `each` is called after each of them.
    ///
    /// # Errors
    /// [`AimError::NoneReached`]; [`AimError::File`] for an unknown without bounds.
    pub fn solve_from_many(
        &self,
        count: u64,
        seed: u64,
        each: &(dyn Fn() + Sync),
    ) -> Result<(Found, Starts), AimError> {
        let (bounds, names) = (self.given.bounds(), self.given.names());
        if let Some(k) = bounds.iter().position(|[from, to]| !(to - from).is_finite()) {
            let rule = "has no bounds, between which random starts are: give from and to".into();
            return Err(AimError::File { file: names[k].clone(), rule });
        }
        let all: Vec<Result<Found, AimError>> = (0..count)
            .into_par_iter()
            .map(|k| {
                // Each start is a function of its number.
                let rng = &mut fastrand::Rng::with_seed(seed.wrapping_add(k.wrapping_mul(0x9E37_79B9_7F4A_7C15)));
                // Of these draws the one that is nearest: most motions lack the impact that matters, and no derivative leads to it.
                let mut nearest: Option<(f64, f64, Vec<f64>)> = None;
                for _ in 0..DRAWS {
                    let u: Vec<f64> = bounds.iter().map(|[from, to]| from + (to - from) * rng.f64()).collect();
                    let seen = self.attempt(&u)?;
                    let far = |values: &Values| (self.misses(values).iter().sum(), self.cost(values));
                    let (miss, cost) = seen.as_ref().map_or((f64::INFINITY, f64::INFINITY), far);
                    if nearest.as_ref().is_none_or(|(least, cheap, _)| (miss, cost) < (*least, *cheap)) {
                        nearest = Some((miss, cost, u));
                    }
                }
                let found = self.solve_from(nearest.map_or_else(|| self.given.first(), |(.., u)| u));
                each();
                found
            })
            .collect();
        let mut starts = Starts { count, reached: 0, failed: BTreeMap::new() };
        let (mut best, mut first): (Option<Found>, _) = (None, None);
        for found in all {
            match found {
                Ok(found) => {
                    starts.reached += 1;
                    if best.as_ref().is_none_or(|best| found.cost < best.cost) {
                        best = Some(found);
                    }
                }
                Err(stopped @ AimError::Run(SimError::Stopped { .. })) => return Err(stopped),
                Err(error) => {
                    *starts.failed.entry(error.kind()).or_default() += 1;
                    first.get_or_insert(Box::new(error));
                }
            }
        }
        match (best, first) {
            (Some(best), _) => Ok((best, starts)),
            (None, Some(first)) => Err(AimError::NoneReached { starts, first }),
            (None, None) => Err(AimError::File { file: "starts = 0".into(), rule: "give 1 or more".into() }),
        }
    }

    fn solve_from(&self, first: Vec<f64>) -> Result<Found, AimError> {
        if self.segments > 1 { self.solve_in_segments(first) } else { self.search(first) }
    }

    pub(super) fn search(&self, first: Vec<f64>) -> Result<Found, AimError> {
        let bounds = self.given.bounds();
        let sizes: Vec<f64> = bounds.iter().zip(self.given.first()).map(|(own, first)| size(*own, first)).collect();
        let mut counts = (1, 1);
        let values = self.values(&first)?;
        let slopes = self.slopes(&first, &values)?.scaled(&sizes);
        let mut here = Place { u: first.clone(), values, slopes };
        let has_cost = self.has_cost();
        let bends = self.costs.iter().any(|cost| !cost.squared);
        let mut weight = 1.0;
        if has_cost {
            let [most, least] = [self.cost_slope(&here).amax(), here.slopes.conditions.amax()];
            weight = if least > 0.0 { (10.0 * most / least).max(1e-6) } else { 1.0 };
        }
        let heaviest = HEAVIEST * weight.max(1.0);
        let mut hessian =
            bends.then(|| DMatrix::identity(sizes.len(), sizes.len()) * self.cost_slope(&here).amax().max(1e-6));
        let is_bent = has_cost && sizes.len() <= MANY;
        let (mut radius, mut steps) = (1.0_f64, Vec::new());
        let end = loop {
            let miss = self.miss(&here.values);
            let met = miss <= self.tolerance;
            if met && !has_cost {
                break Some(End::Met);
            }
            if steps.len() >= self.steps {
                break met.then_some(End::Steps);
            }
            let own = &here.values.conditions;
            let mut solved = self.model((&here, own), (&sizes, &bounds), hessian.as_ref(), (weight, radius))?;
            if has_cost && solved.missed > 0.1 * self.tolerance.max(1e-3 * miss) {
                // The lightest conditions that are missed nearly as little as heavier ones (Byrd, Nocedal & Waltz 2008).
                let now: f64 = self.misses(&here.values).iter().sum();
                let (mut least, mut heavier) = (solved.missed, weight);
                while heavier < heaviest && least > 1e-3 * now {
                    heavier *= 10.0;
                    let tried = self.model((&here, own), (&sizes, &bounds), hessian.as_ref(), (heavier, radius))?;
                    least = least.min(tried.missed);
                    if tried.missed < 0.9 * solved.missed && solved.missed > least + 0.1 * (now - least) {
                        (weight, solved) = (heavier, tried);
                    }
                }
            }
            let cost = self.cost(&here.values);
            let scale = if met { cost.abs() } else { weight * miss };
            if solved.promised <= LEAST * scale && solved.d.amax() < 0.5 * radius {
                let level = steps.is_empty() && self.cost_slope(&here).amax() <= LEAST * cost.abs();
                let flat = level && (bends || cost > 0.0);
                break met.then_some(if flat { End::Flat } else { End::Least });
            }
            let merit = |values: &Values| self.cost(values) + weight * self.misses(values).iter().sum::<f64>();
            let at = |d: &DVector<f64>| -> Vec<f64> {
                let moved = here.u.iter().zip(&sizes).zip(d.iter()).map(|((u, size), d)| u + size * d);
                moved.zip(&bounds).map(|(u, [from, to])| u.clamp(*from, *to)).collect()
            };
            let share_of = |values: &Values| (merit(&here.values) - merit(values)) / solved.promised;
            let mut tried = at(&solved.d);
            counts.0 += 1;
            let mut there = self.attempt(&tried)?;
            let mut share = there.as_ref().map_or(-1.0, &share_of);
            if let Some(values) = there.as_ref().filter(|_| share < 0.75 && !self.conditions.is_empty()) {
                // The conditions bend: once more with what they are at the end of the step.
                let bent = &here.slopes.conditions * &solved.d;
                let conditions: Vec<f64> = values.conditions.iter().zip(bent.iter()).map(|(c, jd)| c - jd).collect();
                let again = self.model((&here, &conditions), (&sizes, &bounds), hessian.as_ref(), (weight, radius))?;
                let corrected = at(&again.d);
                counts.0 += 1;
                let values = self.attempt(&corrected)?;
                let better = values.as_ref().map_or(-1.0, &share_of);
                if better > share {
                    (tried, there, share) = (corrected, values, better);
                    solved.d = again.d;
                }
            }
            let taken = there.filter(|_| share > 1e-3).and_then(|values| {
                counts.1 += 1;
                let slopes = self.slopes(&tried, &values).ok()?.scaled(&sizes);
                Some(Place { u: tried, values, slopes })
            });
            let length = solved.d.amax();
            match taken {
                Some(there) => {
                    if has_cost && solved.missed < LEAST {
                        weight = weight.min((10.0 * solved.multipliers.amax()).max(1e-6));
                    }
                    if is_bent || hessian.is_some() {
                        let lagrangian = |place: &Place| {
                            let mut slope =
                                self.bent_slope(place) + place.slopes.conditions.tr_mul(&solved.multipliers);
                            for (k, cost) in self.costs.iter().enumerate().filter(|(_, cost)| cost.squared) {
                                let r = there.values.costs[k];
                                slope += place.slopes.costs.row(k).transpose() * (2.0 * cost.weight * r);
                            }
                            slope
                        };
                        let y = lagrangian(&there) - lagrangian(&here);
                        let d = DVector::from_fn(sizes.len(), |k, _| (there.u[k] - here.u[k]) / sizes[k]);
                        let first = (d.dot(&y) / d.norm_squared()).max(0.0);
                        let hessian = hessian.get_or_insert_with(|| DMatrix::identity(d.len(), d.len()) * first);
                        update(hessian, &d, &y);
                    }
                    steps.push(Step {
                        miss: self.miss(&there.values),
                        cost: self.cost(&there.values),
                        change: length,
                        events: changed(&here.values, &there.values),
                    });
                    here = there;
                    radius = match share {
                        share if share < 0.25 => 0.25 * length,
                        share if share > 0.75 => radius.max(4.0 * length),
                        _ => radius,
                    };
                }
                None => radius = 0.25 * radius.min(length),
            }
            if radius < SMALLEST {
                break met.then_some(End::Kink);
            }
        };
        match end {
            Some(end) => Ok(self.found(&here.u, here.values, &first, (steps, end), counts)),
            None => Err(self.not_met(&here, steps.len(), radius)),
        }
    }

    /// The values of a run; `None` if it fails.
    fn attempt(&self, u: &[f64]) -> Result<Option<Values>, AimError> {
        match self.values(u) {
            Err(stopped @ AimError::Run(SimError::Stopped { .. })) => Err(stopped),
            other => Ok(other.ok()),
        }
    }

    pub(super) fn found(
        &self,
        u: &[f64],
        values: Values,
        first: &[f64],
        (steps, end): (Vec<Step>, End),
        (runs, differentiated): (usize, usize),
    ) -> Found {
        let own = self.given.names().into_iter().zip(self.given.bounds()).enumerate();
        let unknowns = own.map(|(k, (name, bounds))| Unknown {
            name,
            first: first[k],
            found: u[k],
            at_bound: bounds.contains(&u[k]),
        });
        let own = self.conditions.iter().zip(&values.conditions).filter(|(own, _)| own.asked.is_some());
        let conditions = own.map(|(own, value)| Met { name: own.name.clone(), value: *value, miss: own.miss(*value) });
        Found {
            unknowns: unknowns.collect(),
            conditions: conditions.collect(),
            cost: self.cost(&values),
            events: values.events,
            steps,
            runs,
            differentiated,
            end,
        }
    }

    fn not_met(&self, here: &Place, steps: usize, radius: f64) -> AimError {
        let misses = self.misses(&here.values);
        let own = self.conditions.iter().zip(&misses).zip(&here.values.conditions);
        let missed = own.filter(|((_, miss), _)| **miss > self.tolerance);
        let missed: Vec<String> =
            missed.map(|((own, miss), value)| format!("{} is {value:.6e}, off by {miss:.1e}", own.name)).collect();
        let why = match radius < SMALLEST {
            _ if steps >= self.steps => Stuck::Steps,
            true => Stuck::Kink,
            false => Stuck::Flat,
        };
        AimError::NotMet { steps, missed: missed.join("; "), why }
    }

    fn has_cost(&self) -> bool {
        !self.costs.is_empty() || self.effort > 0.0
    }

    /// f.
    fn cost(&self, values: &Values) -> f64 {
        let own = self.costs.iter().zip(&values.costs);
        let sum: f64 = own.map(|(cost, x)| cost.weight * if cost.squared { x * x } else { *x }).sum();
        sum + self.effort * values.effort
    }

    /// ∂f.
    fn cost_slope(&self, place: &Place) -> DVector<f64> {
        let mut slope = self.bent_slope(place) + &place.slopes.effort * self.effort;
        for (k, cost) in self.costs.iter().enumerate().filter(|(_, cost)| cost.squared) {
            slope += place.slopes.costs.row(k).transpose() * (2.0 * cost.weight * place.values.costs[k]);
        }
        slope
    }

    /// Of the costs that are no squares.
    fn bent_slope(&self, place: &Place) -> DVector<f64> {
        let mut slope = DVector::zeros(place.u.len());
        for (k, cost) in self.costs.iter().enumerate().filter(|(_, cost)| !cost.squared) {
            slope += place.slopes.costs.row(k).transpose() * cost.weight;
        }
        slope
    }

    fn misses(&self, values: &Values) -> Vec<f64> {
        self.conditions.iter().zip(&values.conditions).map(|(own, x)| own.miss(*x)).collect()
    }

    fn miss(&self, values: &Values) -> f64 {
        self.misses(values).into_iter().fold(0.0, f64::max)
    }

    /// The step of the model, whose conditions have these values at the place.
    fn model(
        &self,
        (here, conditions): (&Place, &[f64]),
        (sizes, bounds): (&[f64], &[[f64; 2]]),
        hessian: Option<&DMatrix<f64>>,
        (weight, radius): (f64, f64),
    ) -> Result<Solved, AimError> {
        let n = sizes.len();
        let Place { u, values, slopes } = here;
        let squares: Vec<usize> = (0..self.costs.len()).filter(|k| self.costs[*k].squared).collect();
        let (first_r, first_t) = (n, n + squares.len());
        let count = first_t + 2 * self.conditions.len();
        let (mut p, mut q) = (Entries::new(count, count), vec![0.0; count]);
        let of = if self.has_cost() { self.cost_slope(here).amax().max(f64::MIN_POSITIVE) } else { weight };
        let shorter = SHORTER * of;
        (0..n).for_each(|i| p.add(i, i, shorter));
        if let Some(hessian) = hessian {
            (0..n).for_each(|j| (0..=j).for_each(|i| p.add(i, j, hessian[(i, j)])));
        }
        if let Some(torque) = self.given.torque.as_ref().filter(|_| self.effort > 0.0) {
            let first = self.given.unknowns.len();
            for (i, j, x) in torque.effort_twice(values.duration) {
                p.add(first + i, first + j, self.effort * x * sizes[first + i] * sizes[first + j]);
            }
        }
        let linear = self.bent_slope(here) + &slopes.effort * self.effort;
        q[..n].copy_from_slice(linear.as_slice());
        let (mut equal, mut below) = (Rows::new(count), Rows::new(count));
        for (i, k) in squares.iter().enumerate() {
            let (w, r) = (self.costs[*k].weight, values.costs[*k]);
            p.add(first_r + i, first_r + i, 2.0 * w);
            q[first_r + i] = 2.0 * w * r;
            let row = (0..n).map(|j| (j, slopes.costs[(*k, j)])).chain([(first_r + i, -1.0)]);
            equal.push(row, 0.0);
        }
        // Of each condition: where it is an equation its row, else those of its bounds.
        let mut rows_of = Vec::new();
        for (k, condition) in self.conditions.iter().enumerate() {
            let [a, b] = condition.bounds.map(|bound| bound - conditions[k]);
            let t = first_t + 2 * k;
            let row = |sign: f64| (0..n).map(move |j| (j, sign * slopes.conditions[(k, j)]));
            q[t..t + 2].fill(weight);
            if a == b {
                rows_of.push((Some(equal.len()), [None; 2]));
                equal.push(row(1.0).chain([(t, 1.0), (t + 1, -1.0)]), a);
            } else {
                let mut own = [None; 2];
                if b.is_finite() {
                    own[1] = Some(below.len());
                    below.push(row(1.0).chain([(t + 1, -1.0)]), b);
                }
                if a.is_finite() {
                    own[0] = Some(below.len());
                    below.push(row(-1.0).chain([(t, -1.0)]), -a);
                }
                rows_of.push((None, own));
            }
            below.push([(t, -1.0)], 0.0);
            below.push([(t + 1, -1.0)], 0.0);
        }
        for j in 0..n {
            let [from, to] = bounds[j].map(|bound| (bound - u[j]) / sizes[j]);
            below.push([(j, 1.0)], to.min(radius));
            below.push([(j, -1.0)], -from.max(-radius));
        }
        let cones = [ZeroConeT(equal.len()), NonnegativeConeT(below.len())];
        let first_below = equal.len();
        let (matrix, right) = equal.with(below);
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .tol_gap_abs(1e-13)
            .tol_gap_rel(1e-13)
            .tol_feas(1e-13)
            .build()
            .unwrap_or_default();
        let solver = DefaultSolver::new(&p.matrix(), &q, &matrix, &right, &cones, settings);
        let failed = |why: String| {
            AimError::Run(SimError::Integration {
                time: 0.0,
                reason: format!("the quadratic program of a step: {why}"),
            })
        };
        let mut solver = solver.map_err(|e| failed(e.to_string()))?;
        solver.solve();
        let solution = &solver.solution;
        // Near a solution its last digits are beyond the solver, which says so; the merit of the run decides.
        let usable = [
            SolverStatus::Solved,
            SolverStatus::AlmostSolved,
            SolverStatus::InsufficientProgress,
            SolverStatus::MaxIterations,
            SolverStatus::NumericalError,
        ];
        if !usable.contains(&solution.status) || solution.x.iter().any(|x| !x.is_finite()) {
            return Err(failed(format!("{:?}", solution.status)));
        }
        let mut d = DVector::from_column_slice(&solution.x[..n]);
        for j in 0..n {
            let [from, to] = bounds[j].map(|bound| (bound - u[j]) / sizes[j]);
            d[j] = d[j].clamp(from.max(-radius), to.min(radius));
            // The solver stays inside the bounds by its tolerance.
            if let Some(bound) =
                [from, to].into_iter().find(|bound| (d[j] - bound).abs() < INSIDE && bound.abs() <= radius)
            {
                d[j] = bound;
            }
        }
        let multipliers = rows_of.iter().map(|(row, bounds)| {
            let of_bound = |side: usize| bounds[side].map_or(0.0, |row| solution.z[first_below + row]);
            row.map_or_else(|| of_bound(1) - of_bound(0), |row| solution.z[row])
        });
        let multipliers = DVector::from_iterator(self.conditions.len(), multipliers);
        let linearised = &slopes.conditions * &d;
        let missed = self.conditions.iter().zip(conditions).zip(linearised.iter());
        let missed: f64 = missed.map(|((own, c), moved)| own.miss(c + moved)).sum();
        let mut promised = weight * (self.misses(values).iter().sum::<f64>() - missed) - linear.dot(&d);
        if let Some(hessian) = hessian {
            promised -= 0.5 * d.dot(&(hessian * &d));
        }
        for k in squares {
            let moved = slopes.costs.row(k).transpose().dot(&d);
            promised -= self.costs[k].weight * moved * (2.0 * values.costs[k] + moved);
        }
        if let Some(torque) = self.given.torque.as_ref().filter(|_| self.effort > 0.0) {
            let first = self.given.unknowns.len();
            let own: Vec<f64> = (first..n).map(|j| d[j] * sizes[j]).collect();
            promised -= self.effort * torque.effort(&own, values.duration).0;
        }
        Ok(Solved { d, multipliers, missed, promised })
    }
}

impl Slopes {
    /// By the unknowns as shares of their sizes.
    fn scaled(mut self, sizes: &[f64]) -> Self {
        for (j, size) in sizes.iter().enumerate() {
            self.conditions.column_mut(j).scale_mut(*size);
            self.costs.column_mut(j).scale_mut(*size);
            self.effort[j] *= size;
        }
        self
    }
}

/// Powell's damped BFGS update of B, for a step d along which the derivatives changed by y (Nocedal & Wright 2006, procedure 18.2).
fn update(b: &mut DMatrix<f64>, d: &DVector<f64>, y: &DVector<f64>) {
    let bd = &*b * d;
    let (curved, found) = (d.dot(&bd), d.dot(y));
    if curved <= 0.0 {
        return;
    }
    let theta = if found >= 0.2 * curved { 1.0 } else { 0.8 * curved / (curved - found) };
    let y = y * theta + &bd * (1.0 - theta);
    let along = d.dot(&y);
    *b += &y * y.transpose() / along - &bd * bd.transpose() / curved;
}

/// The events that a motion has and another has not.
fn changed(before: &Values, after: &Values) -> Vec<String> {
    let count = |values: &Values| {
        let mut counts: BTreeMap<String, i64> = BTreeMap::new();
        values.events.iter().for_each(|event| *counts.entry(event.what.clone()).or_default() += 1);
        counts
    };
    let (old, mut new) = (count(before), count(after));
    old.into_iter().for_each(|(what, count)| *new.entry(what).or_default() -= count);
    let told = new.into_iter().filter(|(_, count)| *count != 0);
    told.map(|(what, count)| {
        let (sign, times) = (if count > 0 { '+' } else { '-' }, count.abs());
        if times == 1 { format!("{sign} {what}") } else { format!("{sign} {times} x {what}") }
    })
    .collect()
}

/// The entries of a sparse matrix.
struct Entries {
    size: (usize, usize),
    all: Vec<(usize, usize, f64)>,
}

impl Entries {
    fn new(rows: usize, columns: usize) -> Self {
        Self { size: (rows, columns), all: Vec::new() }
    }

    fn add(&mut self, i: usize, j: usize, x: f64) {
        if x != 0.0 {
            self.all.push((i, j, x));
        }
    }

    fn matrix(self) -> CscMatrix<f64> {
        let (mut i, mut j, mut x) = (Vec::new(), Vec::new(), Vec::new());
        for (row, column, entry) in self.all {
            i.push(row);
            j.push(column);
            x.push(entry);
        }
        CscMatrix::new_from_triplets(self.size.0, self.size.1, i, j, x)
    }
}

/// Rows of a matrix with right sides.
struct Rows {
    entries: Entries,
    right: Vec<f64>,
}

impl Rows {
    fn new(columns: usize) -> Self {
        Self { entries: Entries::new(0, columns), right: Vec::new() }
    }

    fn len(&self) -> usize {
        self.right.len()
    }

    fn push(&mut self, row: impl IntoIterator<Item = (usize, f64)>, right: f64) {
        let i = self.len();
        row.into_iter().for_each(|(j, x)| self.entries.add(i, j, x));
        self.right.push(right);
    }

    /// Both, one below the other.
    fn with(mut self, below: Self) -> (CscMatrix<f64>, Vec<f64>) {
        let first = self.len();
        below.entries.all.iter().for_each(|(i, j, x)| self.entries.add(first + i, *j, *x));
        self.right.extend(&below.right);
        self.entries.size.0 = self.right.len();
        (self.entries.matrix(), self.right)
    }
}
