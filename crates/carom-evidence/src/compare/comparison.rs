//! Options and results of a comparison, and the rows of its table.

use super::candidates::Candidate;
use super::identify::Weakest;
use super::selection::Selected;
use super::statistics::{Estimate, Spread};
use carom_study::tosses::Horizon;
use serde::Serialize;

/// Options of a comparison.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompareOptions {
    /// Number of folds, at least 2.
    pub folds: usize,
    /// Seed of the folds, of the tosses that are fitted, and of the perturbed starts.
    pub seed: u64,
    /// Upper bound of the coefficients of friction.
    pub max_friction: f64,
    /// Greatest number of sets of parameters that a model tries on tosses and landings for each fold.
    pub trials: usize,
    /// Greatest number of tosses to which coefficients are fitted; all tosses are judged.
    pub tosses: usize,
    /// The part of the tosses whose error is fitted.
    pub horizon: Horizon,
    /// The part of the tosses that is judged; the whole contains the early part, which is judged too.
    pub judged: Horizon,
    /// Relative tolerance of the simulation of tosses and landings.
    pub tolerance: f64,
    /// Time step of the simulation of tosses, s.
    pub contact_step: f64,
    /// Length of the pose error of tosses, m.
    pub length: f64,
}

impl Default for CompareOptions {
    /// Five folds, seed 0, friction up to 1, 60 trials on 60 tosses, the part to 0.1 s after the first impact, tolerance 1e-5,
    /// time step 1 ms, length 0.0524 m.
    fn default() -> Self {
        Self {
            folds: 5,
            seed: 0,
            max_friction: 1.0,
            trials: 60,
            tosses: 60,
            horizon: Horizon::Early,
            judged: Horizon::Whole,
            tolerance: 1e-5,
            contact_step: 1e-3,
            length: 0.0524,
        }
    }
}

/// All laws on one part of a data set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Name of the data set.
    pub(crate) set: String,
    /// What was compared.
    pub(crate) what: String,
    /// The measure of the error, with its unit.
    pub(crate) measure: String,
    /// Numbers of the measurements in their table, of landings their lines, in the order of [`Row::errors`].
    pub(crate) numbers: Vec<i64>,
    /// Fold of each measurement.
    pub(crate) folds: Vec<usize>,
    /// Number of measurements of the table that were left out.
    pub(crate) left_out: usize,
    /// The laws, best mean first.
    pub(crate) rows: Vec<Row>,
    /// Least error of any impulse at the contact point that does not pull: no law of one contact can be below it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) bound: Option<Spread>,
    /// Error of the best law against itself from a start that is perturbed by the noise of the measurement: no model can be
    /// expected below it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) floor: Option<Spread>,
    /// The models that the measurements outside each fold select.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) selected: Option<Selected>,
    /// The combination of the best model's parameters that the measurements determine least.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) weakest: Option<Weakest>,
}

/// A law on one part of a data set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Row {
    /// Name of the law.
    pub law: String,
    /// The law of impacts of several contacts, for tosses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub several: Option<&'static str>,
    /// What the model has beyond the law with constant coefficients.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<&'static str>,
    /// The fitted parameters of each fold.
    pub coefficients: Vec<FittedCoefficient>,
    /// Statistics of the errors of all held-out measurements.
    #[serde(flatten)]
    pub error: Spread,
    /// Share of the errors below the published threshold.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub below_threshold: Option<f64>,
    /// Mean of the paired differences to the best law of the table, which has zeros.
    pub to_best: Estimate,
    /// Mean of the paired differences to the same model without its last effect; negative where the effect helps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to_simpler: Option<Estimate>,
    /// Number of measurements whose prediction was refused; each counts with the greatest error of the others.
    pub refused: usize,
    /// Error of each measurement, predicted by the coefficients that were fitted without its fold.
    pub errors: Vec<f64>,
}

/// A coefficient fitted for each fold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct FittedCoefficient {
    /// Name of the coefficient.
    pub name: &'static str,
    #[serde(skip)]
    pub(super) symbol: &'static str,
    /// Its value for each fold.
    pub values: Vec<f64>,
}

/// The number of the comparison's steps that are done, and the number of all.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) + Sync);

/// Error below which the published measure counts a toss as predicted.
const THRESHOLD: f64 = 0.5;

/// A candidate's coefficients by fold and the errors of the held-out measurements; infinite where the prediction was refused.
pub(super) struct Judged {
    pub candidate: Candidate,
    pub coefficients: Vec<Vec<f64>>,
    /// For each fold the errors of the measurements outside it to which the parameters were fitted.
    pub training: Vec<Vec<f64>>,
    pub errors: Vec<f64>,
}

/// The candidate with the least mean error.
pub(super) fn best(judged: &[Judged]) -> Option<&Judged> {
    let mean = |one: &Judged| one.errors.iter().sum::<f64>();
    judged.iter().min_by(|a, b| mean(a).total_cmp(&mean(b)))
}

/// The mean of the parameters over the folds.
pub(super) fn centre(coefficients: &[Vec<f64>]) -> Vec<f64> {
    let folds = coefficients.len() as f64;
    let count = coefficients.first().map_or(0, Vec::len);
    (0..count).map(|k| coefficients.iter().map(|x| x[k]).sum::<f64>() / folds).collect()
}

/// The errors, with the greatest one in place of those that are infinite.
pub(super) fn finite(errors: &[f64]) -> Vec<f64> {
    let greatest = errors.iter().copied().filter(|error| error.is_finite()).fold(0.0, f64::max);
    errors.iter().map(|error| if error.is_finite() { *error } else { greatest }).collect()
}

/// Rows in the order of their means, with paired differences to the first.
pub(super) fn rows(judged: Vec<Judged>, several: bool, threshold: bool) -> Vec<Row> {
    let simpler = |k: usize| -> Option<Estimate> {
        let candidate = &judged[k].candidate;
        let effects = candidate.effects.split_last()?.1;
        let without =
            judged.iter().find(|one| candidate.extends(&one.candidate) && one.candidate.effects == effects)?;
        Some(Estimate::of_pairs(&finite(&judged[k].errors), &finite(&without.errors)))
    };
    let simpler: Vec<Option<Estimate>> = (0..judged.len()).map(simpler).collect();
    let one = |(Judged { candidate, coefficients, errors, .. }, to_simpler): (Judged, Option<Estimate>)| {
        let refused = errors.iter().filter(|error| !error.is_finite()).count();
        let errors = finite(&errors);
        let below = errors.iter().filter(|error| **error < THRESHOLD).count() as f64 / errors.len() as f64;
        let of = |k: usize| coefficients.iter().map(|x| x[k]).collect();
        let names = candidate.parameters.iter().enumerate();
        Row {
            law: candidate.law.into(),
            several: several.then(|| candidate.several.name()),
            effects: candidate.effects.iter().map(|effect| effect.name()).collect(),
            coefficients: names
                .map(|(k, parameter)| FittedCoefficient {
                    name: parameter.name(),
                    symbol: parameter.symbol(),
                    values: of(k),
                })
                .collect(),
            error: Spread::of(&errors),
            below_threshold: threshold.then_some(below),
            to_best: Estimate { mean: 0.0, standard_error: 0.0 },
            to_simpler,
            refused,
            errors,
        }
    };
    let mut rows: Vec<Row> = judged.into_iter().zip(simpler).map(one).collect();
    rows.sort_by(|a, b| a.error.estimate.mean.total_cmp(&b.error.estimate.mean));
    let best = rows.first().map_or_else(Vec::new, |row| row.errors.clone());
    for row in &mut rows {
        row.to_best = Estimate::of_pairs(&row.errors, &best);
    }
    rows
}
