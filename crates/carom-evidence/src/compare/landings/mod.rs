//! The protocol for landings of a biped: parameters are fitted to the jumps of the joint velocities of the leg that lands, for
//! folds of whole logs, because both legs of a jump land in one log.
//!
//! `log.rs` reads the table, `leg.rs` has the robot and the run of a landing.

mod leg;
mod log;
#[cfg(test)]
#[path = "../../../tests/landings.rs"]
mod tests;

use super::candidates::{Candidate, Effect};
use super::comparison::{CompareOptions, Comparison, Judged, Progress, best, centre, rows};
use super::data::{DataSet, too_few};
use super::identify::weakest;
use super::search::{Residuals, descend};
use super::selection::chosen;
use super::statistics::folds;
use crate::EvidenceError;
use carom_chain::Chain;
use carom_chain::urdf::Robot;
use leg::{Landing, WINDOWS, rms, with_rods};
pub(super) use log::is_log;
use log::{MEASURED, SAMPLE, SIDES};
use nalgebra::DVector;
use rayon::prelude::*;
use std::cell::RefCell;
use std::path::Path;

/// The landings of a table, and the robot.
#[derive(Debug, Clone)]
pub(super) struct Landings {
    chain: Chain,
    landings: Vec<Landing>,
    /// Legs of the logs without a landing that can be compared.
    left_out: usize,
}

/// The effects that are tried, each in addition to those before it.
const EFFECTS: [Effect; 4] = [Effect::Rotors, Effect::Rods, Effect::Springs, Effect::Toe];

impl Landings {
    /// The landings of a table, with the robot of the file `urdf`.
    pub fn read(table: &Path, urdf: &Path, robot: &Robot) -> Result<Self, EvidenceError> {
        let of_robot = |reason: String| EvidenceError::of_file(urdf, reason);
        log::check_joints(robot).map_err(of_robot)?;
        let chain = with_rods(robot).map_err(of_robot)?;
        let logs = log::read(table).map_err(|reason| EvidenceError::of_file(table, reason))?;
        let legs = logs.iter().enumerate().flat_map(|log| (0..SIDES.len()).map(move |side| (log, side)));
        let all = legs.map(|(log, side)| Landing::of(&chain, log, side).map_err(|e| of_robot(e.to_string())));
        let all: Vec<Option<Landing>> = all.collect::<Result<_, _>>()?;
        let legs = all.len();
        let landings: Vec<Landing> = all.into_iter().flatten().collect();
        Ok(Self { chain, left_out: legs - landings.len(), landings })
    }

    /// The errors of all landings for the parameters `x`.
    fn errors(&self, model: &Candidate, x: &[f64], tolerance: f64) -> Errors {
        self.landings.par_iter().map(|landing| landing.errors(&self.chain, model, x, tolerance)).collect()
    }
}

/// The errors of the jumps of each landing in each window.
type Errors = Vec<Option<[[f64; MEASURED]; WINDOWS.len()]>>;

/// The residual of a landing in the window that is fitted, of which the squares sum up to the mean square error.
fn residual(errors: &Option<[[f64; MEASURED]; WINDOWS.len()]>) -> Option<DVector<f64>> {
    let [fitted, ..] = errors.as_ref()?;
    Some(DVector::from_row_slice(fitted) / (MEASURED as f64).sqrt())
}

pub(super) fn compare(
    set: &DataSet,
    landings: &Landings,
    options: &CompareOptions,
    progress: Progress<'_>,
) -> Result<Vec<Comparison>, EvidenceError> {
    let mut logs: Vec<usize> = landings.landings.iter().map(|landing| landing.log).collect();
    logs.dedup();
    let (found, needed) = (logs.len(), options.folds);
    if found < needed {
        return Err(too_few(&set.name, found, needed, options.folds));
    }
    let of_log = folds(found, options.folds, options.seed);
    let place = |landing: &Landing| logs.iter().position(|log| *log == landing.log).unwrap_or_default();
    let fold_of: Vec<usize> = landings.landings.iter().map(|landing| of_log[place(landing)]).collect();
    let laws = Candidate::all();
    let all = laws.len() * (EFFECTS.len() + 1);
    let mut judged: [Vec<Judged>; WINDOWS.len()] = Default::default();
    for law in laws {
        let mut model = law;
        for k in 0..=EFFECTS.len() {
            progress(judged[0].len(), all);
            let simpler = judged[0].last().filter(|_| k > 0);
            let both = judge(landings, &model, simpler, &fold_of, options);
            judged.iter_mut().zip(both).for_each(|(part, one)| part.push(one));
            if let Some(effect) = EFFECTS.get(k) {
                model = model.with(*effect);
            }
        }
    }
    progress(all, all);
    let residuals = |model: &Candidate, x: &[f64]| -> Residuals {
        landings.errors(model, x, options.tolerance).iter().map(residual).collect()
    };
    let weakest = best(&judged[0]).and_then(|best| {
        let model = &best.candidate;
        let region = model.region(options.max_friction);
        weakest(model, &region, &centre(&best.coefficients), &|x| residuals(model, x))
    });
    let comparison = |(window, judged): (usize, Vec<Judged>)| {
        let jumps = landings.landings.iter().map(|landing| landing.jump(window)).sum::<f64>();
        Comparison {
            set: set.name.clone(),
            what: format!(
                "jumps of joint velocities {} ms after landing, {:.2} rad/s in the mean",
                1e3 * SAMPLE * WINDOWS[window] as f64,
                jumps / landings.landings.len() as f64
            ),
            measure: "root mean square of the errors of seven joint velocities, rad/s".into(),
            numbers: landings.landings.iter().map(|landing| landing.line as i64).collect(),
            folds: fold_of.clone(),
            left_out: landings.left_out,
            bound: None,
            floor: None,
            weakest: weakest.clone().filter(|_| window == 0),
            selected: chosen(&judged, &fold_of),
            rows: rows(judged, false, false),
        }
    };
    Ok(judged.into_iter().enumerate().map(comparison).collect())
}

/// A model with its parameters for each fold, fitted to the landings outside it, and the errors of all landings in each window. A model
/// with effects starts from the model without the last one.
fn judge(
    landings: &Landings,
    model: &Candidate,
    simpler: Option<&Judged>,
    fold_of: &[usize],
    options: &CompareOptions,
) -> [Judged; WINDOWS.len()] {
    let region = model.region(options.max_friction);
    // Folds share the runs at the same point.
    let seen: RefCell<Vec<(Vec<f64>, Errors)>> = RefCell::default();
    let errors = |x: &[f64]| -> Errors {
        if let Some((_, errors)) = seen.borrow().iter().find(|(other, _)| other == x) {
            return errors.clone();
        }
        let errors = landings.errors(model, x, options.tolerance);
        seen.borrow_mut().push((x.to_vec(), errors.clone()));
        errors
    };
    let in_fold = |fold: usize| {
        let outside = |x: &[f64]| -> Residuals {
            errors(x).iter().zip(fold_of).filter(|(_, of)| **of != fold).map(|(errors, _)| residual(errors)).collect()
        };
        let begin = match simpler {
            Some(simpler) => model.starts(model.nominal(&simpler.candidate, &simpler.coefficients[fold])),
            None => region.points(),
        };
        let budget = (options.trials + 1).saturating_sub(begin.len());
        descend(&region, begin, budget, &outside)
    };
    let trials = (0..options.folds).filter_map(in_fold);
    let (coefficients, training): (Vec<Vec<f64>>, Vec<Vec<f64>>) =
        trials.map(|trial| (trial.x, trial.errors.iter().map(|square| square.sqrt()).collect())).unzip();
    let by_fold: Vec<Errors> = coefficients.iter().map(|x| errors(x)).collect();
    std::array::from_fn(|window| {
        let of = |(k, &fold): (usize, &usize)| {
            by_fold[fold][k].as_ref().map_or(f64::INFINITY, |errors| rms(&errors[window]))
        };
        Judged {
            candidate: model.clone(),
            coefficients: coefficients.clone(),
            training: training.clone(),
            errors: fold_of.iter().enumerate().map(of).collect(),
        }
    })
}
