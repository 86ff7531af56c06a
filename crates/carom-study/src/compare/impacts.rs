//! The protocol for single impacts.

use super::candidates::Candidate;
use super::data::{CompareError, DataSet, Impacts};
use super::statistics::{Spread, folds};
use super::{CompareOptions, Comparison, Judged, Progress, rows};
use crate::fit::{FitError, LawPair, MeasuredImpact};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Greatest number of steps of a search, and the relative spread of the costs at its end.
const STEPS: u64 = 120;
const SETTLED: f64 = 1e-7;

pub(super) fn compare(
    set: &DataSet,
    Impacts { what, numbers, impacts, left_out }: &Impacts,
    options: &CompareOptions,
    progress: Progress<'_>,
) -> Result<Comparison, CompareError> {
    let (found, needed) = (impacts.len(), 4 * options.folds);
    if found < needed {
        return Err(CompareError::TooFew { set: set.name.clone(), found, needed, folds: options.folds });
    }
    let fold_of = folds(found, options.folds, options.seed);
    let candidates = Candidate::all();
    let all = candidates.len() * options.folds;
    let done = AtomicUsize::new(0);
    let judge = |candidate: Candidate| {
        let one = |fold: usize| {
            let fitted = fit(&candidate, impacts, &fold_of, fold, options);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, all, &set.name);
            fitted
        };
        let coefficients: Vec<Vec<f64>> = (0..options.folds).into_par_iter().map(one).collect();
        let laws: Result<Vec<LawPair>, FitError> =
            coefficients.iter().map(|x| LawPair::new(candidate.law, candidate.coefficients(x))).collect();
        let laws = laws.map_err(|reason| CompareError::Impacts { set: set.name.clone(), reason })?;
        let errors = impacts.iter().zip(&fold_of).map(|(impact, &fold)| error(impact, &laws[fold])).collect();
        Ok(Judged { candidate, coefficients, errors })
    };
    let judged: Vec<Judged> = candidates.into_iter().map(judge).collect::<Result<_, CompareError>>()?;
    let bound: Vec<f64> = impacts.iter().map(|impact| impact.least_residual(f64::INFINITY) / impact.speed()).collect();
    Ok(Comparison {
        set: set.name.clone(),
        what: (*what).into(),
        measure: "|v − v⁺|/|v⁻| in the metric of the kinetic energy".into(),
        numbers: numbers.clone(),
        folds: fold_of,
        left_out: *left_out,
        rows: rows(judged, false, false),
        bound: Some(Spread::of(&bound)),
        floor: None,
    })
}

/// The normalised error of a law; infinite where it refuses the impact.
fn error(impact: &MeasuredImpact, laws: &LawPair) -> f64 {
    impact.residual(laws).map_or(f64::INFINITY, |residual| residual.norm() / impact.speed())
}

/// The coefficients with the least mean error over the impacts outside a fold.
fn fit(
    candidate: &Candidate,
    impacts: &[MeasuredImpact],
    fold_of: &[usize],
    fold: usize,
    options: &CompareOptions,
) -> Vec<f64> {
    let train: Vec<&MeasuredImpact> =
        impacts.iter().zip(fold_of).filter(|(_, of)| **of != fold).map(|(impact, _)| impact).collect();
    let cost = |x: &[f64]| match LawPair::new(candidate.law, candidate.coefficients(x)) {
        Ok(laws) => (train.iter().map(|impact| error(impact, &laws)).sum::<f64>() / train.len() as f64).min(f64::MAX),
        Err(_) => f64::MAX,
    };
    let region = candidate.region(options.max_friction);
    let best = region.points().into_iter().map(|x| (cost(&x), x)).min_by(|a, b| a.0.total_cmp(&b.0));
    let mut x = best.map_or_else(Vec::new, |(_, x)| x);
    // restarted once: a simplex may have collapsed onto a kink
    for share in [0.1, 0.02] {
        x = region.descend(&x, share, SETTLED, STEPS, &cost).0;
    }
    x
}
