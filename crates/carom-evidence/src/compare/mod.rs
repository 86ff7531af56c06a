//! Comparison of all impact laws on measured data: which law predicts impacts that it was not fitted to?
//!
//! Every law has the same protocol. The measurements are dealt out to K folds by a seeded shuffle. For each fold the
//! coefficients of a law are fitted to the mean error of the measurements outside the fold and judged by those in it. Every
//! measurement is thus judged once, by coefficients that were fitted without it. Two laws are compared by the paired
//! differences of their errors.
//!
//! | file | content |
//! | --- | --- |
//! | `comparison.rs` | options and results, and the rows of a table |
//! | `data.rs` | recognises and reads data sets |
//! | `candidates.rs` | the models: laws, effects, and the parameters that are fitted |
//! | `statistics.rs` | folds, means, paired differences |
//! | `identify.rs` | the combination of parameters that the measurements determine least |
//! | `selection.rs` | the choice among models by the measurements outside a fold |
//! | `impacts.rs`, `planar.rs` | the protocol for single impacts, and what a model predicts for one |
//! | `tosses.rs`, `search.rs` | the protocol for tosses, the search for parameters, the floor from the noise of the start |
//! | `scenes.rs` | the scene and the contact rule of a model on tosses |
//! | `landings` | the protocol for landings of a biped, and its model |
//! | `cases.rs` | the tosses and their folds, for other simulators |
//! | `page.rs`, `picture.rs` | a table in Markdown and a picture of each set |
//!
//! A minimum of a law's mean error over its coefficients is sought by a grid and by the Nelder–Mead method for single
//! impacts, and by a grid and the Levenberg–Marquardt method for tosses and landings.

mod candidates;
mod cases;
mod comparison;
mod data;
mod identify;
mod impact;
mod impacts;
mod landings;
mod page;
mod picture;
mod planar;
mod scenes;
mod search;
mod selection;
mod statistics;
mod tosses;

pub use cases::{TossCases, toss_cases};
#[cfg(test)]
pub(crate) use comparison::Row;
pub use comparison::{CompareOptions, Comparison, Progress};
pub use data::{DataSet, data_sets};
pub use page::{markdown, summary};
pub use picture::svg;

use crate::EvidenceError;

/// Compares all laws on a data set: one comparison for single impacts, up to four for tosses (the parts of the tosses that are
/// judged, from both starts), two for landings (7 and 5 ms after them).
///
/// # Errors
/// [`EvidenceError`]: options out of their range, fewer measurements than folds, a toss that cannot be simulated at all.
pub fn compare(
    set: &DataSet,
    options: &CompareOptions,
    progress: Progress<'_>,
) -> Result<Vec<Comparison>, EvidenceError> {
    options.check()?;
    match &set.data {
        data::Data::Impacts(impacts) => Ok(vec![impacts::compare(set, impacts, options, progress)?]),
        data::Data::Tosses(tosses, robot) => tosses::compare(set, tosses, robot, options, progress),
        data::Data::Landings(landings) => landings::compare(set, landings, options, progress),
    }
}

impl CompareOptions {
    fn check(&self) -> Result<(), EvidenceError> {
        let refuse = |what: &str, value: f64, rule: &str| Err(EvidenceError::new(format!("{what} is {value}: {rule}")));
        if self.folds < 2 {
            return refuse("number of folds", self.folds as f64, "it must be at least 2");
        }
        if !(self.max_friction > 0.0 && self.max_friction <= 100.0) {
            return refuse("largest friction", self.max_friction, "it must be above 0 and at most 100");
        }
        if self.trials == 0 {
            return refuse("number of trials", 0.0, "it must be at least 1");
        }
        if self.tosses == 0 {
            return refuse("number of tosses", 0.0, "it must be at least 1");
        }
        for (what, value) in [
            ("tolerance", self.tolerance),
            ("contact step", self.contact_step),
            ("length of the pose error", self.length),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(what, value, "it must be positive and finite");
            }
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "../../tests/compare.rs"]
mod tests;
