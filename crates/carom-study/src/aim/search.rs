//! Sequential quadratic programming with a trust region (Fletcher 1982: Sℓ₁QP).
//!
//! The step of the model (`model.rs`, with the symbols) is taken if φ of the run decreases by a share of what this model promises; otherwise Δ is a
//! quarter. The conditions are met exactly once ν exceeds their multipliers. Squares have the Gauss–Newton approximation, other costs and the
//! conditions with them Powell's damped BFGS update (`curvature.rs`). Without a cost B is small: of the steps that meet the linearised conditions
//! the shortest is taken.
//!
//! The merit is that of runs, whatever events they have: a step may add or lose an impact.

use super::curvature::Curvature;
use super::evaluate::Values;
use super::model::Place;
use super::problem::Problem;
use super::unknown::size;
use super::{AimError, End, Found, Met, Starts, Step, Stuck, Unknown};
use carom_sim::SimError;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Of more unknowns the second derivatives of squares are those of the Gauss-Newton method alone: others are a full matrix.
const MANY: usize = 100;
/// A smaller trust radius is that of a kink or a jump.
const SMALLEST: f64 = 1e-10;
/// A model that promises less than this share of the cost, or of the miss, has reached its least value.
const LEAST: f64 = 1e-10;
/// Random values that are run for each start of a search from many.
const DRAWS: usize = 20;
/// Largest weight of the conditions, as a multiple of the first one, if this is above 1.
const HEAVIEST: f64 = 1e8;

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
        // Squares fall to the square of what rounding leaves of them.
        let first_cost = self.cost(&here.values).abs();
        let bends = self.costs.iter().any(|cost| !cost.squared);
        let mut weight = 1.0;
        if has_cost {
            let [most, least] = [self.cost_slope(&here).amax(), here.slopes.conditions.amax()];
            weight = if least > 0.0 { (10.0 * most / least).max(1e-6) } else { 1.0 };
        }
        let heaviest = HEAVIEST * weight.max(1.0);
        let first_bend = || DMatrix::identity(sizes.len(), sizes.len()) * self.cost_slope(&here).amax().max(1e-6);
        let mut curvature = Curvature::new(bends.then(first_bend));
        let is_bent = has_cost && sizes.len() <= MANY;
        let (mut radius, mut steps) = (1.0_f64, Vec::new());
        let mut unsolved = false;
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
            let Some(mut solved) =
                self.model((&here, own), (&sizes, &bounds), curvature.matrix.as_ref(), (weight, radius))
            else {
                radius *= 0.25;
                if radius < SMALLEST {
                    unsolved = true;
                    break met.then_some(End::Kink);
                }
                continue;
            };
            if has_cost && solved.missed > 0.1 * self.tolerance.max(1e-3 * miss) {
                // The lightest conditions that are missed nearly as little as heavier ones (Byrd, Nocedal & Waltz 2008).
                let now: f64 = self.misses(&here.values).iter().sum();
                let (mut least, mut heavier) = (solved.missed, weight);
                while heavier < heaviest && least > 1e-3 * now {
                    heavier *= 10.0;
                    let tried =
                        self.model((&here, own), (&sizes, &bounds), curvature.matrix.as_ref(), (heavier, radius));
                    let Some(tried) = tried else { break };
                    least = least.min(tried.missed);
                    let nearer = now - tried.missed > (now - solved.missed) / 0.9 + LEAST * now;
                    if nearer && solved.missed > least + 0.1 * (now - least) {
                        (weight, solved) = (heavier, tried);
                    }
                }
            }
            let cost = self.cost(&here.values);
            let scale = if met { cost.abs().max(LEAST * first_cost) } else { weight * miss };
            if solved.promised <= LEAST * scale && solved.d.amax() < 0.5 * radius {
                if curvature.renew(steps.len()) {
                    continue;
                }
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
            // The conditions bend: once more with what they are at the end of the step.
            let again = there.as_ref().filter(|_| share < 0.75 && !self.conditions.is_empty()).and_then(|values| {
                let bent = &here.slopes.conditions * &solved.d;
                let conditions: Vec<f64> = values.conditions.iter().zip(bent.iter()).map(|(c, jd)| c - jd).collect();
                self.model((&here, &conditions), (&sizes, &bounds), curvature.matrix.as_ref(), (weight, radius))
            });
            if let Some(again) = again {
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
                    if is_bent || curvature.matrix.is_some() {
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
                        curvature.learn(&d, &y);
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
            None => Err(self.not_met(&here, steps.len(), (radius, unsolved))),
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

    fn not_met(&self, here: &Place, steps: usize, (radius, unsolved): (f64, bool)) -> AimError {
        let misses = self.misses(&here.values);
        let own = self.conditions.iter().zip(&misses).zip(&here.values.conditions);
        let missed = own.filter(|((_, miss), _)| **miss > self.tolerance);
        let missed: Vec<String> =
            missed.map(|((own, miss), value)| format!("{} is {value:.6e}, off by {miss:.1e}", own.name)).collect();
        let why = match radius < SMALLEST {
            _ if unsolved => Stuck::Unsolved,
            _ if steps >= self.steps => Stuck::Steps,
            true => Stuck::Kink,
            false => Stuck::Flat,
        };
        AimError::NotMet { steps, missed: missed.join("; "), why }
    }
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
