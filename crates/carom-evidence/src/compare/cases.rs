//! Tosses as [`compare()`](super::compare()) uses them, for other simulators: start, fold, measured poses.

use super::comparison::CompareOptions;
use super::data::{Data, DataSet};
use super::tosses;
use crate::EvidenceError;
use serde::Serialize;
use std::path::PathBuf;

/// The tosses of a data set with the options of their comparison. The floor is z = 0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TossCases {
    /// Name of the data set.
    pub(crate) set: String,
    /// File of the robot, whose base floats.
    pub(crate) urdf: PathBuf,
    /// Gravity, m/s².
    pub(crate) gravity: [f64; 3],
    /// Number of folds.
    pub(crate) folds: usize,
    /// Seed of the folds and of the tosses that are fitted.
    pub(crate) seed: u64,
    /// Greatest number of sets of coefficients that a law tries.
    pub(crate) trials: usize,
    /// The part of the tosses whose error is fitted, `early` or `whole`.
    pub(crate) horizon: &'static str,
    /// Length of the pose error, m.
    pub(crate) length: f64,
    /// Upper bound of the coefficient of friction.
    pub(crate) max_friction: f64,
    /// The tosses that are compared, in the order of [`Row::errors`](super::Row::errors).
    pub(crate) cases: Vec<TossCase>,
}

/// A toss that is compared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct TossCase {
    /// Number in the table.
    pub number: i64,
    /// Fold that the toss is judged in.
    pub fold: usize,
    /// Whether coefficients are fitted to this toss; all tosses are judged.
    pub fitted: bool,
    /// The state at the first sample, fitted to the flight.
    pub fitted_start: TossStart,
    /// The state at the first sample, as the table gives it.
    pub given_start: TossStart,
    /// Times of the samples from the first one without contact, s; the first is 0. Roll-outs are sampled at equal intervals.
    pub times: Vec<f64>,
    /// The measured configurations at these samples: position (m) and quaternion x y z w of the base, joint angles (rad).
    pub poses: Vec<Vec<f64>>,
    /// Index of the last sample to 0.1 s after the first impact.
    pub early: usize,
}

/// The state at the start of a roll-out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct TossStart {
    /// Configuration, rad or m.
    pub q: Vec<f64>,
    /// Joint velocities, rad/s or m/s; those of the base are in its own axes, the linear ones first.
    pub qd: Vec<f64>,
}

/// The tosses of a data set as [`compare()`](super::compare()) uses them; `None` for other sets.
///
/// # Errors
/// As those of [`compare()`](super::compare()).
pub fn toss_cases(set: &DataSet, options: &CompareOptions) -> Result<Option<TossCases>, EvidenceError> {
    options.check()?;
    match &set.data {
        Data::Impacts(_) | Data::Landings(_) => Ok(None),
        Data::Tosses(all, robot) => tosses::export(set, all, robot, options).map(Some),
    }
}
