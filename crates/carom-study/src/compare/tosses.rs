//! The protocol for tosses: coefficients are fitted to roll-outs from fitted starts, and judged on both parts of the tosses
//! from both starts.

use super::candidates::Candidate;
use super::cases::{TossCase, TossCases, TossStart};
use super::data::{CompareError, DataSet};
use super::statistics::{Spread, folds, shuffled};
use super::{CompareOptions, Comparison, Judged, Progress, rows};
use crate::fit::Region;
use crate::tosses::{GRAVITY, Horizon, Launch, PoseError, RollOut, RollOutOptions, Start, Toss, Tosses};
use carom_sim::{ContactLaw, ContactRule, Moment, SimError};
use rayon::prelude::*;

/// The search for coefficients ends when its step is below this share of the range.
const FINEST: f64 = 0.01;

/// The tosses that are compared, with both starts.
struct Work<'a> {
    tosses: &'a Tosses,
    options: &'a CompareOptions,
    kept: Vec<Kept<'a>>,
    fold_of: Vec<usize>,
    /// Indices of the tosses to which coefficients are fitted.
    fitted: Vec<usize>,
}

struct Kept<'a> {
    toss: &'a Toss,
    given: Launch,
    launch: Launch,
}

/// A set of coefficients and the errors of the tosses to which coefficients are fitted.
struct Trial {
    x: Vec<f64>,
    errors: Vec<f64>,
}

/// The tosses of a set as [`compare`] uses them.
pub(super) fn export(set: &DataSet, tosses: &Tosses, options: &CompareOptions) -> Result<TossCases, CompareError> {
    let work = Work::new(set, tosses, options)?;
    let case = |(k, kept): (usize, &Kept<'_>)| {
        let Kept { toss, given, launch } = kept;
        let samples = &toss.samples[launch.sample..];
        let start = |launch: &Launch| TossStart { q: launch.q.clone(), qd: launch.qd.clone() };
        TossCase {
            number: toss.number,
            fold: work.fold_of[k],
            fitted: work.fitted.contains(&k),
            fitted_start: start(launch),
            given_start: start(given),
            times: samples.iter().map(|sample| sample.time - samples[0].time).collect(),
            poses: samples.iter().map(|sample| sample.q.clone()).collect(),
            early: launch.end(toss, Horizon::Early).map_or(0, |end| end - launch.sample),
        }
    };
    Ok(TossCases {
        set: set.name.clone(),
        urdf: tosses.urdf.clone(),
        gravity: GRAVITY.into(),
        folds: options.folds,
        seed: options.seed,
        trials: options.trials,
        horizon: options.horizon.name(),
        length: options.length,
        max_friction: options.max_friction,
        cases: work.kept.iter().enumerate().map(case).collect(),
    })
}

pub(super) fn compare(
    set: &DataSet,
    tosses: &Tosses,
    options: &CompareOptions,
    progress: Progress<'_>,
) -> Result<Vec<Comparison>, CompareError> {
    let work = Work::new(set, tosses, options)?;
    let found = work.kept.len();
    let candidates = Candidate::all_for_tosses();
    let all = candidates.len() + 1;
    let mut judged: Vec<[Judged; 4]> = Vec::new();
    for (k, candidate) in candidates.into_iter().enumerate() {
        progress(k, all, &format!("{}: {} ({})", set.name, candidate.law, candidate.several.name()));
        judged.push(work.judge(candidate));
    }
    progress(all - 1, all, &format!("{}: floor", set.name));
    let best = judged.iter().min_by(|a, b| mean(&a[0].errors).total_cmp(&mean(&b[0].errors)));
    let floors = best.map(|best| work.floors(&best[0]));
    let mut parts: [Vec<Judged>; 4] = Default::default();
    for four in judged {
        for (part, one) in parts.iter_mut().zip(four) {
            part.push(one);
        }
    }
    progress(all, all, &set.name);
    let what = ["to 0.1 s after the first impact", "whole toss"];
    let start = ["start fitted to the flight", "start given by the table"];
    let comparison = |(k, judged): (usize, Vec<Judged>)| Comparison {
        set: set.name.clone(),
        what: format!("{}, {}", what[k % 2], start[k / 2]),
        measure: format!("mean |Δp|²/L + mean Δθ² over the samples, L = {} m", options.length),
        numbers: work.kept.iter().map(|kept| kept.toss.number).collect(),
        folds: work.fold_of.clone(),
        left_out: tosses.tosses.len() - found,
        rows: rows(judged, true, k % 2 == 1),
        bound: None,
        floor: floors.as_ref().map(|floors| Spread::of(&floors[k])),
    };
    Ok(parts.into_iter().enumerate().map(comparison).collect())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

impl<'a> Work<'a> {
    /// Deals the tosses that both starts and an impact are known of out to the folds, and chooses those that are fitted.
    fn new(set: &DataSet, tosses: &'a Tosses, options: &'a CompareOptions) -> Result<Self, CompareError> {
        let launches = tosses.launches(Start::Fitted).into_iter().zip(tosses.launches(Start::Given));
        let mut kept = Vec::new();
        for (toss, both) in tosses.tosses.iter().zip(launches) {
            let (Ok(launch), Ok(given)) = both else { continue };
            if launch.end(toss, Horizon::Early).is_some() {
                kept.push(Kept { toss, given, launch });
            }
        }
        let (found, needed) = (kept.len(), 2 * options.folds);
        if found < needed {
            return Err(CompareError::TooFew { set: set.name.clone(), found, needed, folds: options.folds });
        }
        let fold_of = folds(found, options.folds, options.seed);
        // at least two of each fold, so that every fold leaves some to fit
        let fitted: Vec<usize> = shuffled(found, options.seed).into_iter().take(options.tosses.max(needed)).collect();
        Ok(Self { tosses, options, kept, fold_of, fitted })
    }
}

impl Work<'_> {
    fn roll(&self, candidate: &Candidate) -> RollOutOptions {
        let CompareOptions { tolerance, contact_step, length, horizon, .. } = *self.options;
        let (start, several) = (Start::Fitted, candidate.several);
        RollOutOptions { tolerance, contact_step, length, start, horizon, several }
    }

    fn rule(candidate: &Candidate, x: &[f64]) -> ContactRule {
        let law = ContactLaw::named(candidate.law, candidate.coefficients(x));
        ContactRule::new(law.unwrap_or_else(|| unreachable!("the candidates have the names of laws")))
    }

    /// The errors of the tosses that are fitted, at the coefficients `x`; infinite where a roll-out is refused.
    fn tried(&self, candidate: &Candidate, x: &[f64]) -> Vec<f64> {
        let (rule, roll) = (Self::rule(candidate, x), self.roll(candidate));
        let one = |&k: &usize| {
            let Kept { toss, launch, .. } = &self.kept[k];
            let rolled = launch.roll_out(&self.tosses.chain, toss, &rule, &roll, roll.horizon);
            rolled.ok().and_then(|rolled| rolled.error(roll.horizon, roll.length)).unwrap_or(f64::INFINITY)
        };
        self.fitted.par_iter().map(one).collect()
    }

    /// Coefficients for each fold, fitted without it: a grid, then steps along each coefficient from the best point, halved
    /// where none is better. The folds share their trials.
    fn fit(&self, candidate: &Candidate) -> Vec<Vec<f64>> {
        let region = candidate.region(self.options.max_friction);
        let budget = self.options.trials;
        let mut trials: Vec<Trial> = Vec::new();
        let add = |trials: &mut Vec<Trial>, x: Vec<f64>| {
            if trials.len() < budget && trials.iter().all(|trial| trial.x != x) {
                trials.push(Trial { errors: self.tried(candidate, &x), x });
            }
        };
        for x in region.points() {
            add(&mut trials, x);
        }
        let best = |trials: &[Trial], fold: usize| {
            let cost = |trial: &Trial| {
                let outside = self.fitted.iter().zip(&trial.errors).filter(|(k, _)| self.fold_of[**k] != fold);
                outside.map(|(_, error)| error).sum::<f64>()
            };
            let costs = trials.iter().map(|trial| (cost(trial), &trial.x));
            costs.min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(Vec::new, |(_, x)| x.clone())
        };
        let mut at: Vec<(Vec<f64>, f64)> =
            (0..self.options.folds).map(|fold| (best(&trials, fold), FIRST_STEP)).collect();
        while trials.len() < budget && at.iter().any(|(_, step)| *step >= FINEST) {
            for (fold, (x, step)) in at.iter_mut().enumerate().filter(|(_, (_, step))| *step >= FINEST) {
                for around in around(&region, x, *step) {
                    add(&mut trials, around);
                }
                let next = best(&trials, fold);
                if next == *x {
                    *step *= 0.5;
                }
                *x = next;
            }
        }
        (0..self.options.folds).map(|fold| best(&trials, fold)).collect()
    }

    /// The errors of all tosses by the coefficients that were fitted without their fold: early and whole from the fitted start,
    /// early and whole from the given one.
    fn judge(&self, candidate: Candidate) -> [Judged; 4] {
        let coefficients = self.fit(&candidate);
        let rules: Vec<ContactRule> = coefficients.iter().map(|x| Self::rule(&candidate, x)).collect();
        let roll = self.roll(&candidate);
        let one = |k: usize| {
            let Kept { toss, given, launch } = &self.kept[k];
            let rule = &rules[self.fold_of[k]];
            let errors = |launch: &Launch| {
                let rolled = launch.roll_out(&self.tosses.chain, toss, rule, &roll, Horizon::Whole);
                let of = |rolled: &RollOut, horizon| rolled.error(horizon, roll.length).unwrap_or(f64::INFINITY);
                rolled.map_or([f64::INFINITY; 2], |one| [of(&one, Horizon::Early), of(&one, Horizon::Whole)])
            };
            [errors(launch), errors(given)].concat()
        };
        let all: Vec<Vec<f64>> = (0..self.kept.len()).into_par_iter().map(one).collect();
        [0, 1, 2, 3].map(|part| Judged {
            candidate: candidate.clone(),
            coefficients: coefficients.clone(),
            errors: all.iter().map(|errors| errors[part]).collect(),
        })
    }

    /// The error of a law against itself: from a start drawn from the estimate instead of the estimate, and from the given
    /// start instead of the fitted one; early and whole. Only tosses whose start was fitted.
    fn floors(&self, best: &Judged) -> [Vec<f64>; 4] {
        let roll = self.roll(&best.candidate);
        let one = |k: usize| -> Option<Vec<f64>> {
            let Kept { toss, given, launch } = &self.kept[k];
            let rule = Self::rule(&best.candidate, &best.coefficients[self.fold_of[k]]);
            let state = &launch.fitted.as_ref()?.state;
            let mut rng = fastrand::Rng::with_seed(self.options.seed.wrapping_add(k as u64));
            let (q, qd) = state.drawn(&self.tosses.chain, &mut || normal(&mut rng)).ok()?;
            let drawn = Launch { q, qd, ..launch.clone() };
            let last = toss.samples.len() - 1;
            let simulated = |launch: &Launch| -> Result<Vec<Moment>, SimError> {
                Ok(launch.simulate(&self.tosses.chain, toss, last, &rule, &roll)?.0)
            };
            let truth = simulated(launch).ok()?;
            let early = launch.end(toss, Horizon::Early)? - launch.sample;
            let mut errors = Vec::new();
            for other in [&drawn, given] {
                let other = simulated(other).ok()?;
                let apart: Vec<PoseError> = other.iter().zip(&truth).map(|(a, b)| PoseError::between(a, b)).collect();
                for end in [early, apart.len() - 1] {
                    errors.push(PoseError::mean(&apart[..=end], |x| x * x).measure(roll.length));
                }
            }
            Some(errors)
        };
        let all: Vec<Vec<f64>> = (0..self.kept.len()).into_par_iter().filter_map(one).collect();
        [0, 1, 2, 3].map(|part| all.iter().map(|errors| errors[part]).collect())
    }
}

/// The first step of the search, as a share of the range.
const FIRST_STEP: f64 = 0.08;

/// The points one step along each coefficient from `x`, within the box.
fn around(region: &Region, x: &[f64], step: f64) -> Vec<Vec<f64>> {
    let mut points = Vec::new();
    for (k, &(low, high)) in region.bounds.iter().enumerate() {
        for sign in [1.0, -1.0] {
            let mut point = x.to_vec();
            point[k] += sign * step * (high - low);
            points.push(region.clamp(&point));
        }
    }
    points
}

/// A standard normal number (G. E. P. Box, M. E. Muller 1958).
fn normal(rng: &mut fastrand::Rng) -> f64 {
    let (a, b) = (1.0 - rng.f64(), rng.f64());
    (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}
