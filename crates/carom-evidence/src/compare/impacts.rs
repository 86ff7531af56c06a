//! The protocol for single impacts.

use super::candidates::Candidate;
use super::comparison::{CompareOptions, Comparison, Judged, Progress, best, centre, rows};
use super::data::{DataSet, Impacts, too_few};
use super::identify::weakest;
use super::impact::Impact;
use super::selection::chosen;
use super::statistics::{Spread, folds};
use crate::EvidenceError;
use nalgebra::DVector;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Greatest number of steps of a search, and the relative spread of the costs at its end.
const STEPS: u64 = 120;
const SETTLED: f64 = 1e-7;

pub(super) fn compare(
    set: &DataSet,
    Impacts { what, measure, numbers, impacts, effects, left_out }: &Impacts,
    options: &CompareOptions,
    progress: Progress<'_>,
) -> Result<Comparison, EvidenceError> {
    let (found, needed) = (impacts.len(), 4 * options.folds);
    if found < needed {
        return Err(too_few(&set.name, found, needed, options.folds));
    }
    let fold_of = folds(found, options.folds, options.seed);
    let mut candidates = Candidate::all();
    for k in 0..effects.len() {
        let longest: Vec<Candidate> = candidates.iter().filter(|one| one.effects.len() == k).cloned().collect();
        candidates.extend(longest.iter().map(|one| one.with(effects[k])));
    }
    let all = candidates.len() * options.folds;
    let done = AtomicUsize::new(0);
    let judge = |candidate: Candidate| {
        let one = |fold: usize| {
            let fitted = fit(&candidate, impacts, &fold_of, fold, options);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, all);
            fitted
        };
        let coefficients: Vec<Vec<f64>> = (0..options.folds).into_par_iter().map(one).collect();
        let errors = impacts.iter().zip(&fold_of).map(|(impact, &fold)| impact.error(&candidate, &coefficients[fold]));
        let errors = errors.collect();
        let training = |(fold, x): (usize, &Vec<f64>)| {
            let outside = impacts.iter().zip(&fold_of).filter(|(_, of)| **of != fold);
            outside.map(|(impact, _)| impact.error(&candidate, x)).collect()
        };
        let training = coefficients.iter().enumerate().map(training).collect();
        Judged { candidate, coefficients, training, errors }
    };
    let judged: Vec<Judged> = candidates.into_iter().map(judge).collect();
    let bound = |best: &Judged| -> Vec<f64> {
        let of = |(impact, &fold): (&Impact, &usize)| impact.bound(&best.candidate, &best.coefficients[fold]);
        impacts.iter().zip(&fold_of).map(of).collect()
    };
    let direction = |best: &Judged| {
        let model = &best.candidate;
        let residuals = |x: &[f64]| -> Vec<Option<DVector<f64>>> {
            impacts.iter().map(|impact| impact.residual(model, x)).collect()
        };
        weakest(model, &model.region(options.max_friction), &centre(&best.coefficients), &residuals)
    };
    Ok(Comparison {
        set: set.name.clone(),
        what: (*what).into(),
        measure: (*measure).into(),
        numbers: numbers.clone(),
        left_out: *left_out,
        bound: best(&judged).map(|best| Spread::of(&bound(best))),
        floor: None,
        weakest: best(&judged).and_then(direction),
        selected: chosen(&judged, &fold_of),
        rows: rows(judged, false, false),
        folds: fold_of,
    })
}

/// The parameters with the least mean error over the impacts outside a fold.
fn fit(
    candidate: &Candidate,
    impacts: &[Impact],
    fold_of: &[usize],
    fold: usize,
    options: &CompareOptions,
) -> Vec<f64> {
    let train: Vec<&Impact> =
        impacts.iter().zip(fold_of).filter(|(_, of)| **of != fold).map(|(impact, _)| impact).collect();
    let cost = |x: &[f64]| {
        let sum: f64 = train.iter().map(|impact| impact.error(candidate, x)).sum();
        (sum / train.len() as f64).min(f64::MAX)
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
