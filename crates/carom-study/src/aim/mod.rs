//! Aims: numbers of a scene that are chosen such that its motion meets conditions, at least cost.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | u | unknowns: numbers of the scene, torques at knots | `unknown.rs`, `torque.rs` |
//! | c(u) | values of the conditions, each of a state, an impact or u | `function.rs` |
//! | f(u) | cost | [`Found::cost`] |
//! | ∂c, ∂f | derivatives of the whole run through its impacts, in reverse | `evaluate.rs` |
//!
//! The conditions are aᵢ ≤ cᵢ(u) ≤ bᵢ (aᵢ = bᵢ for an equation), the unknowns have bounds. Sequential quadratic programming with a trust region
//! finds u: `search.rs`.

mod curvature;
mod evaluate;
mod function;
mod model;
mod problem;
mod search;
mod segments;
mod torque;
mod unknown;
mod written;

pub use problem::Problem;
pub(crate) use torque::names_of_motors;

use crate::orbit::Happened;
use carom_sim::SimError;
use serde::Serialize;
use std::collections::BTreeMap;

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Found {
    /// The unknowns.
    pub unknowns: Vec<Unknown>,
    /// The conditions.
    pub conditions: Vec<Met>,
    /// The cost; 0 without one.
    pub cost: f64,
    /// The events of the motion.
    pub events: Vec<Happened>,
    /// The steps of the search.
    pub steps: Vec<Step>,
    /// Number of runs.
    pub runs: usize,
    /// Number of runs with derivatives.
    pub differentiated: usize,
    /// Why the search ended.
    pub end: End,
}

impl Found {
    /// The values of the unknowns.
    pub fn values(&self) -> Vec<f64> {
        self.unknowns.iter().map(|own| own.found).collect()
    }
}

/// An unknown.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unknown {
    /// Its name: the path of its key, its own name, or `torque JOINT K` of the K-th knot.
    pub name: String,
    /// Its value at the start of the search.
    pub first: f64,
    /// Its value.
    pub found: f64,
    /// Whether it is at one of its bounds.
    pub at_bound: bool,
}

/// A condition at the end of the search.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Met {
    /// What is asked: its formula with where it holds and what it is to be.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// How far it is from what is asked.
    pub miss: f64,
}

/// A step of the search.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// Largest miss of a condition after it.
    pub miss: f64,
    /// Cost after it.
    pub cost: f64,
    /// Largest change of an unknown, as a share of its range or size.
    pub change: f64,
    /// Events that the motion has now and had not before the step, `+`, and the reverse, `-`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<String>,
}

/// Why a search that meets all conditions ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// Without a cost: all conditions are met.
    Met,
    /// The cost does not decrease to first order.
    Least,
    /// As least, at the start: there it may as well be the greatest, or level.
    Flat,
    /// At a kink or jump of the motion, as where an event appears, no shorter step decreases the cost.
    Kink,
    /// After the greatest number of steps.
    Steps,
    /// By the segments of the motion, but not by the motion in one piece, whose errors grow.
    Segments,
}

impl End {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Self::Met => "all conditions are met",
            Self::Least => "all conditions are met, at a least cost nearby",
            Self::Flat => {
                "all conditions are met; at the start no unknown changes the cost to first order, which is a least, a greatest or a \
                 level place: try other values of first, or many starts"
            }
            Self::Kink => {
                "all conditions are met; at a kink or jump of the motion, where no shorter step lowers the cost"
            }
            Self::Steps => "all conditions are met; the greatest number of steps is reached, and the cost still falls",
            Self::Segments => {
                "all conditions are met in segments, but not in one piece, whose errors grow: add feedback"
            }
        }
    }
}

/// Why an aim is not reached.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum AimError {
    /// The problem file breaks a rule.
    #[error("{file}: {rule}")]
    File {
        /// The file.
        file: String,
        /// Key, value, the rule that is broken, and what to do.
        rule: String,
    },
    /// The scene, or a run of it, fails.
    #[error(transparent)]
    Run(#[from] SimError),
    /// The motion has no such impact.
    #[error(
        "{condition}: the motion has {found} impacts of {contact}: its events are {seen}; choose a start that has one"
    )]
    NoImpact {
        /// The condition or cost.
        condition: String,
        /// The contact.
        contact: String,
        /// Number of impacts of this contact.
        found: usize,
        /// The events that were seen.
        seen: String,
    },
    /// The search does not meet the conditions.
    #[error("not reached after {steps} steps: {missed}; {}", why.text())]
    NotMet {
        /// Number of steps.
        steps: usize,
        /// The conditions that are missed, each with its value.
        missed: String,
        /// Why the search ended.
        why: Stuck,
    },
    /// None of many searches meets the conditions.
    #[error("none of {} starts reaches the aim ({}); the first one: {first}", starts.count, starts.told())]
    NoneReached {
        /// The starts.
        starts: Starts,
        /// The first error.
        first: Box<AimError>,
    },
}

/// What came of searches from many starts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Starts {
    /// Number of starts.
    pub count: u64,
    /// Number of those whose search meets all conditions.
    pub reached: u64,
    /// Number of the others, by the reason.
    pub failed: BTreeMap<&'static str, u64>,
}

/// Why a search ends without meeting its conditions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stuck {
    /// After the greatest number of steps.
    Steps,
    /// At a kink or a jump of the motion.
    Kink,
    /// No unknown brings the conditions nearer to first order.
    Flat,
    /// The quadratic program of a step has sizes that differ by too much for its solver.
    Unsolved,
}

impl Stuck {
    fn text(self) -> &'static str {
        match self {
            Self::Steps => "the search has used its steps: give more, [search] steps",
            Self::Kink => {
                "the motion has a kink or a jump there, as where an impact appears: choose another start of the search"
            }
            Self::Unsolved => {
                "the equations of a step differ too much in size: hardly an unknown changes a condition that is missed; give other unknowns, or \
                 another start of the search"
            }
            Self::Flat => {
                "no unknown brings them nearer to first order: give more unknowns, wider bounds, or another start of the search"
            }
        }
    }
}

impl Starts {
    fn told(&self) -> String {
        let told = self.failed.iter().map(|(why, count)| format!("{count}: {why}"));
        told.collect::<Vec<_>>().join("; ")
    }
}

impl AimError {
    /// The kind, in words: of searches from many starts those of one kind are counted.
    fn kind(&self) -> &'static str {
        match self {
            Self::File { .. } => "the problem is refused",
            Self::Run(SimError::Overlap { .. }) => "bodies overlap at the start",
            Self::Run(SimError::NoDerivative { .. }) => "the first motion has no derivative",
            Self::Run(SimError::Jam { .. }) => "a motion jams",
            Self::Run(_) => "the first motion fails",
            Self::NoneReached { .. } => "no start reaches the aim",
            Self::NoImpact { .. } => "the first motion lacks an impact of a condition",
            Self::NotMet { why: Stuck::Steps, .. } => "the steps are used",
            Self::NotMet { why: Stuck::Kink, .. } => "a kink or a jump of the motion",
            Self::NotMet { why: Stuck::Unsolved, .. } => "the equations of a step differ too much in size",
            Self::NotMet { why: Stuck::Flat, .. } => "the conditions do not come nearer to first order",
        }
    }
}
