//! Fits to velocity jumps.

use super::confidence::{Reach, quantile, reaches};
use super::error::FitError;
use super::jumps::{LawPair, MeasuredImpact};
use super::loss::{Cost, Loss, median};
use super::search::Region;
use super::{Coefficient, FRICTION, Fit, FitOptions, FittedTo, INERTIA, Interval, Misfit, Model};
use carom_chain::Chain;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Fits the coefficients of a law to measured velocity jumps. `chain` is the robot of the impacts made by
/// [`MeasuredImpact::of_chain`]; it is needed for the scale of inertia only. `progress` is called with the number of finished
/// steps and the number of all steps.
///
/// # Errors
/// [`FitError`]: options out of their range, too few impacts, no robot for the scale of inertia, or an error of the law at the
/// fitted coefficients.
pub fn fit_velocities(
    impacts: &[MeasuredImpact],
    chain: Option<&Chain>,
    options: &FitOptions,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Fit, FitError> {
    let model = options.model()?;
    if options.inertia && (chain.is_none() || !impacts.iter().all(MeasuredImpact::has_robot)) {
        return Err(FitError::NoInertia);
    }
    let train = options.split(&model, impacts.len(), "impacts")?;
    let size = median(train.iter().map(|&k| impacts[k].size()));
    let chain = chain.filter(|_| options.inertia);
    let work = Work { impacts, chain, model, train, size, trials: AtomicUsize::new(0) };
    work.fit(options, progress)
}

struct Work<'a> {
    impacts: &'a [MeasuredImpact],
    chain: Option<&'a Chain>,
    model: Model,
    train: Vec<usize>,
    /// Median size of the jumps, m/s.
    size: f64,
    trials: AtomicUsize,
}

/// Relative spread of the costs of a simplex at which a search ends: of the first searches, and of the last ones.
const ROUGH: f64 = 1e-5;
const FINE: f64 = 1e-13;
/// Greatest number of steps of one search; 20 to 100 are usual.
const MOST_STEPS: u64 = 300;
/// With more impacts than this the residuals are computed in parallel.
const MANY: usize = 200;
/// A coefficient is unidentified if the residuals change by less than this share of the jumps over its whole range.
const FLAT: f64 = 1e-7;
/// A coefficient within this share of its range of a bound is set to the bound.
const ON_BOUND: f64 = 1e-7;
/// Step of the numerical derivative, relative to the range.
const STEP: f64 = 1e-6;

impl Work<'_> {
    /// Residuals of the impacts `which` at the coefficients `x`.
    fn residuals(&self, x: &[f64], which: &[usize]) -> Result<Vec<DVector<f64>>, FitError> {
        self.trials.fetch_add(1, Ordering::Relaxed);
        let law = LawPair::new(self.model.law, self.model.law(x))?;
        let scaled = self.scaled(x)?;
        let one = |&k: &usize| match &scaled {
            Some(chain) => Ok(self.impacts[k].on(chain)?.residual(&law)?),
            None => Ok(self.impacts[k].residual(&law)?),
        };
        if which.len() > MANY { which.par_iter().map(one).collect() } else { which.iter().map(one).collect() }
    }

    /// The robot with the inertia of `x`; `None` if it is not fitted.
    fn scaled(&self, x: &[f64]) -> Result<Option<Chain>, FitError> {
        let (Some(chain), Some(scale)) = (self.chain, self.model.get(x, INERTIA)) else { return Ok(None) };
        Ok(Some(chain.with_inertia_scaled(scale)?))
    }

    /// Norms of the training residuals. An error of the law counts as a residual larger than any other.
    fn norms(&self, x: &[f64]) -> Vec<f64> {
        match self.residuals(x, &self.train) {
            Ok(residuals) => residuals.iter().map(|r| r.norm()).collect(),
            Err(_) => vec![self.size * 1e6; self.train.len()],
        }
    }

    fn fit(&self, options: &FitOptions, progress: &(dyn Fn(usize, usize) + Sync)) -> Result<Fit, FitError> {
        let (restitution, friction) = ([0.0, 0.2, 0.4, 0.6, 0.8, 1.0], [0.0, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0]);
        let region = self.model.region(&restitution, &friction, &[0.6, 1.0, 1.6]);
        let points = region.points();
        let total = points.len() + 3;
        let mut seen: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
        for (k, x) in points.into_iter().enumerate() {
            progress(k, total);
            let norms = self.norms(&x);
            seen.push((x, norms));
        }
        // the best point of the grid
        let start = |cost: Cost| -> Vec<f64> {
            let ranked = seen.iter().map(|(x, norms)| (cost.sum(norms), x));
            ranked.min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(Vec::new, |(_, x)| x.clone())
        };
        let descend = |start: &[f64], share: f64, spread: f64, cost: Cost| {
            region.descend(start, share, spread, MOST_STEPS, &|x| cost.sum(&self.norms(x)))
        };
        let (cost, mut from) = match options.loss {
            Loss::Squares => (Cost::SQUARES, Vec::new()),
            Loss::Huber => {
                let robust = descend(&start(Cost::NORMS), 0.1, ROUGH, Cost::NORMS).0;
                // the residuals of exact data are rounding errors, which give no scale
                let threshold = (2.0 * median(self.norms(&robust))).max(1e-9 * self.size);
                (Cost { threshold }, vec![robust])
            }
        };
        from.push(start(cost));
        progress(total - 2, total);
        let rough = from.iter().map(|start| descend(start, 0.1, ROUGH, cost)).min_by(|a, b| a.1.total_cmp(&b.1));
        let mut x = rough.map_or_else(Vec::new, |(x, _)| x);
        // restart twice: a simplex may have collapsed onto a kink
        for share in [0.03, 0.003] {
            x = descend(&x, share, FINE, cost).0;
        }
        for (x, &(low, high)) in x.iter_mut().zip(&region.bounds) {
            let near = |end: f64| (*x - end).abs() <= ON_BOUND * (high - low);
            *x = if near(low) {
                low
            } else if near(high) {
                high
            } else {
                *x
            };
        }
        let value = cost.sum(&self.norms(&x));
        let residuals = self.residuals(&x, &self.train).map_err(|e| FitError::Refused(e.to_string()))?;

        let mut notes = vec![
            "fitted to velocities of single impacts: a fit to whole trajectories gives different coefficients"
                .to_owned(),
        ];
        let coefficients = self.coefficients(&region, &x, value, cost, &residuals, options, &mut notes)?;
        progress(total - 1, total);
        let each = self.each(&x)?;
        progress(total, total);
        let found = (each, notes, self.trials.load(Ordering::Relaxed));
        Ok(self.model.fit(FittedTo::Velocities, options, cost.threshold, coefficients, found))
    }

    /// Errors of all impacts at the fitted coefficients.
    fn each(&self, x: &[f64]) -> Result<Vec<Misfit>, FitError> {
        let all: Vec<usize> = (0..self.impacts.len()).collect();
        let scaled = self.scaled(x)?;
        let residuals = self.residuals(x, &all)?;
        let one = |k: usize| {
            let impact = match &scaled {
                Some(chain) => &self.impacts[k].on(chain)?,
                None => &self.impacts[k],
            };
            Ok(Misfit {
                number: k as i64,
                trained: self.train.binary_search(&k).is_ok(),
                error: residuals[k].norm(),
                whole: None,
                early: None,
                least: Some(impact.least_residual(f64::INFINITY)),
                least_in_cone: Some(impact.least_residual(self.model.law(x).friction)),
            })
        };
        all.par_iter().map(|&k| one(k)).collect()
    }

    /// d(residual)/dx of each training impact: central differences, one-sided at a bound.
    fn jacobians(&self, region: &Region, x: &[f64]) -> Result<Vec<DMatrix<f64>>, FitError> {
        let mut columns = Vec::new();
        for (k, &(low, high)) in region.bounds.iter().enumerate() {
            let step = STEP * (high - low);
            let (mut below, mut above) = (x.to_vec(), x.to_vec());
            below[k] = (x[k] - step).max(low);
            above[k] = (x[k] + step).min(high);
            let width = above[k] - below[k];
            let pairs = self.residuals(&above, &self.train)?.into_iter().zip(self.residuals(&below, &self.train)?);
            columns.push(pairs.map(|(a, b)| (a - b) / width).collect::<Vec<_>>());
        }
        let one = |i: usize| DMatrix::from_columns(&columns.iter().map(|c| c[i].clone()).collect::<Vec<_>>());
        Ok((0..self.train.len()).map(one).collect())
    }

    #[allow(clippy::too_many_arguments)]
    fn coefficients(
        &self,
        region: &Region,
        x: &[f64],
        value: f64,
        cost: Cost,
        residuals: &[DVector<f64>],
        options: &FitOptions,
        notes: &mut Vec<String>,
    ) -> Result<Vec<Coefficient>, FitError> {
        let jacobians = self.jacobians(region, x)?;
        let n = residuals.len();
        let side = |k: usize| region.bounds[k].1 - region.bounds[k].0;
        let tells = |k: &usize| {
            let most = jacobians.iter().map(|j| j.column(*k).norm()).fold(0.0, f64::max);
            most * side(*k) > FLAT * self.size
        };
        let known: Vec<usize> = (0..x.len()).filter(tells).collect();
        let bound = |k: usize| {
            let (low, high) = region.bounds[k];
            [low, high].into_iter().find(|end| (x[k] - end).abs() <= ON_BOUND * side(k))
        };
        let columns: Vec<DMatrix<f64>> = jacobians.iter().map(|j| j.select_columns(&known)).collect();
        let told = reaches(residuals, &columns, cost, options.confidence);
        let together = told.is_none();
        let told = told.unwrap_or_else(|| vec![None; known.len()]);
        // loss of the rounding errors of exact data
        let rounding = n as f64 * cost.of(1e-9 * self.size);
        let degrees = (n - x.len()) as f64;
        let alike = value * (quantile(degrees, options.confidence).unwrap_or(2.0).powi(2) / degrees);
        let mut all = Vec::new();
        for (k, &fitted) in x.iter().enumerate() {
            let reach = known.iter().position(|&other| other == k).and_then(|place| told[place]);
            let interval = if reach.is_some() { Interval::Profile } else { Interval::Alike };
            let Reach { width, rise } = reach.unwrap_or(Reach { width: 0.05 * side(k), rise: alike });
            // exact data give a width of 0
            let reach = Reach { width: width.max(ON_BOUND * side(k)), rise: rise + rounding };
            let (low, high) = region.bounds[k];
            let [low, high] = [low, high].map(|end| self.edge(region, (x, k), end, reach, (cost, value)));
            all.push(Coefficient { name: self.model.coefficients[k].0, value: fitted, low, high, interval });
        }
        for (k, one) in all.iter().enumerate() {
            let name = one.name;
            if !known.contains(&k) {
                let more = if name == FRICTION { " (sticking impacts are independent of friction)" } else { "" };
                notes.push(format!(
                    "{name} is not identified: the residuals do not depend on it{more}; all values from {} to {} fit equally \
                     well",
                    one.low, one.high
                ));
                continue;
            }
            notes.extend(self.model.notes(k, one, bound(k), together));
        }
        Ok(all)
    }

    /// End of the profile interval of coefficient `k` towards the bound `end`: where the loss, minimised over the other
    /// coefficients, exceeds its minimum `value` at `x` by `rise`.
    fn edge(
        &self,
        region: &Region,
        (x, k): (&[f64], usize),
        end: f64,
        Reach { width, rise }: Reach,
        (cost, value): (Cost, f64),
    ) -> f64 {
        let others = region.without(k);
        let mut rest = [&x[..k], &x[k + 1..]].concat();
        let spread = (1e-4 * rise / value.max(rise)).max(FINE);
        // positive outside the interval; linear in the distance for a quadratic loss
        let mut over = |at: f64| {
            let with = |rest: &[f64]| [&rest[..k], &[at], &rest[k..]].concat();
            let (best, least) = others.descend(&rest, 0.01, spread, 40, &|rest| cost.sum(&self.norms(&with(rest))));
            rest = best;
            (least - value).max(0.0).sqrt() - rise.sqrt()
        };
        let (mut inside, mut f_inside) = (x[k], -rise.sqrt());
        let mut step = width;
        let (mut outside, mut f_outside) = loop {
            let at = if (end - inside).abs() <= step { end } else { inside + step.copysign(end - inside) };
            let f = over(at);
            if f > 0.0 {
                break (at, f);
            }
            if at == end {
                return end;
            }
            (inside, f_inside) = (at, f);
            step *= 1.5;
        };
        // false position (Illinois method)
        let mut stayed = None;
        for _ in 0..60 {
            let middle = inside + (outside - inside) * (f_inside / (f_inside - f_outside));
            let f = over(middle);
            let beyond = f > 0.0;
            if beyond {
                (outside, f_outside) = (middle, f)
            } else {
                (inside, f_inside) = (middle, f)
            }
            if f.abs() <= 1e-4 * rise.sqrt() || (outside - inside).abs() <= 1e-6 * width {
                return middle;
            }
            if stayed == Some(beyond) {
                if beyond { f_inside *= 0.5 } else { f_outside *= 0.5 }
            }
            stayed = Some(beyond);
        }
        outside
    }
}
