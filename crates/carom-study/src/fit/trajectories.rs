//! Fits to whole roll-outs.
//!
//! The error of a roll-out is discontinuous where a toss tips onto another face, so no derivatives are used. The search is
//! a grid, a finer grid around its best point, and a few Nelder–Mead steps. The error of each toss is stored for each trial.
//! The bootstrap resamples the tosses and selects the best of the stored trials, so the resolution of an interval is the
//! spacing of the trials.

use super::confidence::{percentiles, resample};
use super::error::FitError;
use super::loss::{Cost, Loss, median};
use super::search::Region;
use super::{Coefficient, Fit, FitOptions, FittedTo, INERTIA, Interval, Misfit, Model};
use crate::tosses::{Horizon, Launch, RollOut, RollOutOptions, Scene, Start, TossError, Tosses};
use carom_sim::{ContactLaw, ContactRule};
use rayon::prelude::*;
use std::cell::RefCell;

/// Number of Nelder–Mead steps.
const STEPS: u64 = 20;
/// Number of bootstrap samples, which need no roll-outs.
const DRAWN: usize = 2000;

/// Fits the coefficients of a law to whole tosses. `progress` is called with the number of finished trials and the estimated
/// number of all trials.
///
/// # Errors
/// [`FitError`]: options out of their range, too few tosses, or an error of a roll-out.
pub fn fit_trajectories(
    tosses: &Tosses,
    options: &FitOptions,
    roll: &RollOutOptions,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Fit, FitError> {
    let model = options.model()?;
    let positive = |what, value: f64| {
        let rule = "it must be positive and finite";
        if value > 0.0 && value.is_finite() { Ok(()) } else { Err(FitError::setting(what, value, rule)) }
    };
    positive("length of the error measure", roll.length)?;
    positive("tolerance", roll.tolerance)?;
    positive("contact step", roll.contact_step)?;
    let refuse = |e: TossError| FitError::Refused(e.to_string());
    let launches: Vec<Launch> = tosses.launches(roll.start).into_iter().collect::<Result<_, _>>().map_err(refuse)?;
    let known = |k: &usize| launches[*k].end(&tosses.tosses[*k], roll.horizon).is_some();
    let scored: Vec<usize> = (0..launches.len()).filter(known).collect();
    let train = options.split(&model, scored.len(), "tosses")?.into_iter().map(|k| scored[k]).collect();
    Work { tosses, launches, scored, model, roll, train, trials: RefCell::default() }.fit(options, progress)
}

struct Trial {
    x: Vec<f64>,
    /// Square root of the error of each training toss.
    norms: Vec<f64>,
}

struct Work<'a> {
    tosses: &'a Tosses,
    launches: Vec<Launch>,
    /// Indices of the tosses that have the part that is fitted.
    scored: Vec<usize>,
    model: Model,
    roll: &'a RollOutOptions,
    train: Vec<usize>,
    trials: RefCell<Vec<Trial>>,
}

impl Work<'_> {
    /// Roll-outs of the tosses `which` at the coefficients `x`.
    fn roll_out(&self, x: &[f64], which: &[usize], horizon: Horizon) -> Result<Vec<RollOut>, FitError> {
        let scale = self.model.get(x, INERTIA).unwrap_or(1.0);
        let scene = Scene { chain: self.tosses.chain.with_inertia_scaled(scale)?, ..self.tosses.scene() };
        let law = ContactLaw::named(self.model.law, self.model.law(x));
        let rule = ContactRule::new(law.unwrap_or_else(|| unreachable!("the name was checked before the search")));
        let (tosses, launches, roll) = (&self.tosses.tosses, &self.launches, self.roll);
        let one = |&k: &usize| {
            let rolled = launches[k].roll_out(&scene, &tosses[k], &rule, roll, horizon);
            rolled.map_err(|e| FitError::Refused(e.to_string()))
        };
        which.par_iter().map(one).collect()
    }

    /// The error that is fitted; the tosses are those that have it.
    fn error(&self, rolled: &RollOut) -> f64 {
        rolled.error(self.roll.horizon, self.roll.length).unwrap_or(f64::INFINITY)
    }

    /// Square roots of the training errors at `x`; computed and stored if the trial is new.
    fn norms(&self, x: &[f64], progress: &dyn Fn(usize)) -> Result<Vec<f64>, FitError> {
        if let Some(seen) = self.trials.borrow().iter().find(|trial| trial.x == x) {
            return Ok(seen.norms.clone());
        }
        let rolled = self.roll_out(x, &self.train, self.roll.horizon)?;
        let norms: Vec<f64> = rolled.iter().map(|rolled| self.error(rolled).sqrt()).collect();
        self.trials.borrow_mut().push(Trial { x: x.to_vec(), norms: norms.clone() });
        progress(self.trials.borrow().len());
        Ok(norms)
    }

    /// The best trial so far.
    fn best(&self, cost: &dyn Fn(&[f64]) -> f64) -> Vec<f64> {
        let trials = self.trials.borrow();
        let best = trials.iter().map(|trial| (cost(&trial.norms), &trial.x)).min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or_else(Vec::new, |(_, x)| x.clone())
    }

    fn fit(self, options: &FitOptions, progress: &(dyn Fn(usize, usize) + Sync)) -> Result<Fit, FitError> {
        let (restitution, friction) = ([0.0, 0.1, 0.2, 0.35, 0.5, 0.75], [0.04, 0.1, 0.2, 0.35, 0.6, 1.0]);
        let region = self.model.region(&restitution, &friction, &[0.75, 1.0, 1.4]);
        let points = region.points();
        // coarse grid, finer grid of five values per coefficient (some of them known), and the final search
        let total = points.len() + 4 * 5_usize.pow(region.bounds.len() as u32) / 5 + STEPS as usize;
        let tell = |done: usize| progress(done.min(total - 1), total);
        for x in &points {
            self.norms(x, &tell)?;
        }
        let cost = match options.loss {
            Loss::Squares => Cost::SQUARES,
            Loss::Huber => {
                let robust = self.best(&|norms| Cost::NORMS.sum(norms));
                Cost { threshold: 2.0 * median(self.norms(&robust, &tell)?) }
            }
        };
        let by_cost = |norms: &[f64]| cost.sum(norms);
        let coarse = self.best(&by_cost);
        let around = |k: usize| {
            let values = &region.grid[k];
            let at = values.iter().position(|&v| v == coarse[k]).unwrap_or(0);
            let (left, right) = (values[at.saturating_sub(1)], values[(at + 1).min(values.len() - 1)]);
            let mut fine: Vec<f64> = [1.0 / 3.0, 2.0 / 3.0]
                .into_iter()
                .flat_map(|s| [left + (coarse[k] - left) * s, coarse[k] + (right - coarse[k]) * s])
                .chain([coarse[k]])
                .collect();
            fine.sort_by(f64::total_cmp);
            fine.dedup();
            fine
        };
        let finer = Region { bounds: region.bounds.clone(), grid: (0..coarse.len()).map(around).collect() };
        for x in finer.points() {
            self.norms(&x, &tell)?;
        }
        let start = self.best(&by_cost);
        // a trial with an error in a roll-out has infinite cost
        region.descend(&start, 0.02, 1e-6, STEPS, &|x| self.norms(x, &tell).map_or(f64::MAX, |norms| by_cost(&norms)));
        let x = self.best(&by_cost);

        let rolled = self.roll_out(&x, &self.scored, Horizon::Whole)?;
        let each: Vec<Misfit> = self
            .scored
            .iter()
            .zip(&rolled)
            .map(|(&k, rolled)| Misfit {
                number: self.tosses.tosses[k].number,
                trained: self.train.binary_search(&k).is_ok(),
                error: self.error(rolled),
                whole: Some(rolled.pose_error(self.roll.length)),
                early: rolled.early_error(self.roll.length),
                least: None,
                least_in_cone: None,
            })
            .collect();
        let trials = self.trials.borrow();
        let mut notes = vec![
            "fitted to trajectories of whole tosses: a fit to velocities of single impacts gives different coefficients"
                .to_owned(),
        ];
        let without = self.launches.len() - self.scored.len();
        if without > 0 {
            notes.push(format!("{without} tosses have no impact before their last sample and are left out"));
        }
        let tables = self.launches.iter().filter(|launch| launch.fitted.is_none()).count();
        if self.roll.start == Start::Fitted && tables > 0 {
            notes.push(format!("{tables} tosses start from the table, because no start can be fitted to their flight"));
        }
        let coefficients = intervals(&trials, &x, cost, &self.model, options, &mut notes);
        progress(total, total);
        let (threshold, found) = (cost.threshold.powi(2), (each, notes, trials.len()));
        Ok(self.model.fit(FittedTo::Trajectories, options, threshold, coefficients, found))
    }
}

fn intervals(
    trials: &[Trial],
    x: &[f64],
    cost: Cost,
    model: &Model,
    options: &FitOptions,
    notes: &mut Vec<String>,
) -> Vec<Coefficient> {
    let losses: Vec<Vec<f64>> =
        trials.iter().map(|trial| trial.norms.iter().map(|&norm| cost.of(norm)).collect()).collect();
    let mut rng = fastrand::Rng::with_seed(options.seed);
    let mut drawn: Vec<&[f64]> = Vec::new();
    for _ in 0..DRAWN {
        let counts = resample(losses[0].len(), &mut rng);
        let total = |k: usize| losses[k].iter().zip(&counts).map(|(loss, count)| loss * count).sum::<f64>();
        let best = (0..trials.len()).map(|k| (total(k), k)).min_by(|a, b| a.0.total_cmp(&b.0));
        drawn.extend(best.map(|(_, k)| trials[k].x.as_slice()));
    }
    let mut all = Vec::new();
    for (k, &value) in x.iter().enumerate() {
        let (low, high) = percentiles(drawn.iter().map(|x| x[k]).collect(), options.confidence);
        let (low, high) = (low.min(value), high.max(value));
        let (name, (lower, upper)) = model.coefficients[k];
        let one = Coefficient { name, value, low, high, interval: Interval::Bootstrap };
        let end = [lower, upper].into_iter().find(|end| (value - end).abs() < 1e-6 * (upper - lower));
        notes.extend(model.notes(k, &one, end, false));
        all.push(one);
    }
    notes.push(format!(
        "the intervals are from {DRAWN} bootstrap samples of the tosses over the {} sets of coefficients that were tried; \
         their resolution is the spacing of these sets",
        trials.len()
    ));
    all
}
