//! The choice among models inside the folds: a model is chosen for each fold by the measurements outside it.

use super::candidates::title;
use super::comparison::{Judged, finite};
use super::statistics::{Estimate, Spread};
use serde::Serialize;

/// The models selected in each fold by the measurements outside it, and their errors on the fold.
///
/// Of each law, an effect is accepted if it lowers the mean error of the measurements to which the parameters are fitted by
/// more than two standard errors of the paired differences; of the accepted models, that with the least mean error is selected.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Selected {
    /// The model of each fold.
    pub models: Vec<String>,
    /// Statistics of the errors of all held-out measurements.
    #[serde(flatten)]
    pub error: Spread,
    /// Mean of the paired differences to the law with constant coefficients that is selected in the same way.
    pub to_constant: Estimate,
    /// Error of each measurement.
    pub errors: Vec<f64>,
}

/// Number of standard errors by which an effect must lower the training error.
const ACCEPTED: f64 = 2.0;

/// The selection among the models that were judged; `None` if none has an effect.
pub(super) fn chosen(judged: &[Judged], fold_of: &[usize]) -> Option<Selected> {
    judged.iter().find(|one| !one.candidate.effects.is_empty())?;
    let folds = judged.first()?.training.len();
    let of: Vec<usize> = (0..folds).map(|fold| in_fold(judged, fold, true)).collect::<Option<_>>()?;
    let constant: Vec<usize> = (0..folds).map(|fold| in_fold(judged, fold, false)).collect::<Option<_>>()?;
    let errors = |of: &[usize]| {
        let all: Vec<f64> = fold_of.iter().enumerate().map(|(k, &fold)| judged[of[fold]].errors[k]).collect();
        finite(&all)
    };
    let (errors, constant) = (errors(&of), errors(&constant));
    Some(Selected {
        models: of.iter().map(|&k| title(&judged[k].candidate)).collect(),
        error: Spread::of(&errors),
        to_constant: Estimate::of_pairs(&errors, &constant),
        errors,
    })
}

/// The model selected by the errors outside a fold, with or without effects.
fn in_fold(judged: &[Judged], fold: usize, effects: bool) -> Option<usize> {
    let training = |k: usize| finite(&judged[k].training[fold]);
    let mean = |k: usize| Estimate::of(&training(k)).mean;
    let accepted = |law: usize| {
        let mut at = law;
        loop {
            let further = |k: &usize| {
                let (own, other) = (&judged[*k].candidate, &judged[at].candidate);
                effects && own.effects.len() > other.effects.len() && own.extends(other) && {
                    let gain = Estimate::of_pairs(&training(at), &training(*k));
                    gain.mean > ACCEPTED * gain.standard_error
                }
            };
            let Some(next) = (0..judged.len()).filter(further).min_by_key(|k| judged[*k].candidate.effects.len())
            else {
                break;
            };
            at = next;
        }
        at
    };
    let laws = (0..judged.len()).filter(|k| judged[*k].candidate.effects.is_empty());
    laws.map(accepted).min_by(|a, b| mean(*a).total_cmp(&mean(*b)))
}
