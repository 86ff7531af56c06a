//! Periodic orbits of scenes, their stability, and how they change with a parameter.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | x | state (q, q̇) just after the section | [`State`] |
//! | P | return map: the motion from x to the next passage of the section, then the relabelling | `return_map.rs` |
//! | r | P(x) − x, as a displacement and a change of velocity | – |
//! | DP | ∂P/∂x, from the derivative of the run and that of the time of the section | [`Orbit::map`] |
//! | μ | multipliers: eigenvalues of DP | [`Orbit::multipliers`] |
//! | p | the parameter of a branch | [`Point::parameter`] |
//!
//! An orbit is a fixed point of P (or of its k-th power), which Newton's method finds: `newton.rs`. A perturbation of it is multiplied by
//! DP in each period, so that the orbit is stable if all |μ| < 1 and unstable if one |μ| > 1 (Guckenheimer & Holmes 1983, section 1.5; with
//! impacts: Leine & Nijmeijer 2004, chapter 7). [`Problem::branch`] follows an orbit over a parameter: `branch.rs`.

mod basin;
mod branch;
mod cycles;
mod newton;
mod pictures;
mod problem;
mod read;
mod return_map;
mod table;

pub use basin::{Attractor, Basin};
pub use branch::{Branch, Point, Special};
pub use cycles::Cycles;
pub use pictures::SAMPLES;
pub use problem::Problem;
pub use return_map::Cycle;

use carom_sim::SimError;
use nalgebra::{Complex, DMatrix};
use serde::Serialize;

/// A state on the section.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct State {
    /// Configuration, length nq; m, rad.
    pub q: Vec<f64>,
    /// Velocities, length nv; m/s, rad/s.
    pub qd: Vec<f64>,
}

/// An event of an orbit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Happened {
    /// Time since the start of the orbit, s.
    pub time: f64,
    /// Kind ([`EventKind::name`](carom_sim::EventKind::name)) and contacts, of an impact with friction also its mode: `impact foot on floor
    /// (stick)`.
    pub what: String,
}

/// A periodic orbit.
#[derive(Debug, Clone, Serialize)]
pub struct Orbit {
    /// The state at its start, on the section.
    pub start: State,
    /// The time of its start, s: `start_time` of the scene, or later where a branch has moved a section by a period.
    pub start_time: f64,
    /// Its period, s.
    pub period: f64,
    /// Its events.
    pub events: Vec<Happened>,
    /// The multipliers, by decreasing absolute value; real and imaginary part. Directions that constraints, the section or the impact of the
    /// section forbid have multipliers of zero; `modulo` coordinates have none.
    #[serde(serialize_with = "as_pairs")]
    pub multipliers: Vec<Complex<f64>>,
    /// Whether small perturbations of the orbit decay or grow.
    pub stability: Stability,
    /// The largest component of P(x) − x, velocities times the period, as a share of the largest of x.
    pub residual: f64,
    /// Number of runs with derivatives that were needed.
    pub iterations: usize,
    /// ∂P/∂x: rows and columns are a displacement of q and a change of qd, as in [`Sensitivity`](carom_sim::Sensitivity).
    #[serde(skip)]
    pub map: DMatrix<f64>,
}

impl Orbit {
    /// The multipliers that are not zero up to 1e-7, the error of derivatives.
    pub fn lasting(&self) -> &[Complex<f64>] {
        &self.multipliers[..self.multipliers.iter().take_while(|x| x.norm() > 1e-7).count()]
    }
}

/// A multiplier whose size differs from 1 by less counts as one of size 1; multipliers are accurate to about 1e-8.
const NEUTRAL: f64 = 1e-6;

/// Stability of an orbit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stability {
    /// All |μ| < 1.
    Stable,
    /// The largest |μ| is 1 up to 1e-6: the first derivative does not decide.
    Neutral,
    /// One |μ| > 1.
    Unstable,
}

crate::words! { Stability { Stable "stable", Neutral "neutral", Unstable "unstable" } }

impl Stability {
    fn of(multipliers: &[Complex<f64>]) -> Self {
        match multipliers.first().map_or(0.0, |largest| largest.norm()) {
            most if most > 1.0 + NEUTRAL => Self::Unstable,
            most if most < 1.0 - NEUTRAL => Self::Stable,
            _ => Self::Neutral,
        }
    }
}

fn as_pairs<S: serde::Serializer>(numbers: &[Complex<f64>], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(numbers.iter().map(|x| [x.re, x.im]))
}

/// Why an orbit is not found.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum OrbitError {
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
    /// The motion does not return to the section.
    #[error("the motion does not reach the section ({section}) within {longest} s, the duration of the scene: {seen}")]
    NoReturn {
        /// The section.
        section: String,
        /// Duration of the scene, s.
        longest: f64,
        /// The events that were seen.
        seen: String,
    },
    /// The function of the section jumps from below zero to above it.
    #[error(
        "at {time} s the function of the section ({section}) jumps over zero in an impact: choose one of positions, or contact"
    )]
    Jumps {
        /// The section.
        section: String,
        /// Time since the start, s.
        time: f64,
    },
    /// A compliant contact is closed at the section. Its force depends on earlier states, which [`State`] does not contain.
    #[error(
        "at the section ({section}) {touch} is a compliant contact that is closed, and its force depends on earlier states: choose a section at which it is open"
    )]
    Presses {
        /// The section.
        section: String,
        /// Name of the contact.
        touch: String,
    },
    /// The return map has no derivative.
    #[error("the return map has no derivative: at {time} s: {reason}")]
    NoDerivative {
        /// Time since the start, s.
        time: f64,
        /// Why.
        reason: String,
    },
    /// Newton's method did not converge.
    #[error(
        "no orbit near the start: after {iterations} steps of Newton's method P(x) − x is still {residual:.1e}; choose a start \
         nearer to the orbit, or more passages before the first step"
    )]
    NotConverged {
        /// Number of steps.
        iterations: usize,
        /// The least that was reached.
        residual: f64,
    },
    /// The states to which Newton's method leads are inside of bodies or beyond limits.
    #[error(
        "no orbit near the start: in step {iterations} of Newton's method P(x) − x is {residual:.1e}, and from the state that it leads to the motion \
         cannot begin ({why}); choose a start nearer to the orbit, or more passages before the first step"
    )]
    LeadsInside {
        /// Number of the step.
        iterations: usize,
        /// The least that was reached.
        residual: f64,
        /// What is wrong with the state.
        why: Box<OrbitError>,
    },
    /// Newton's method converged to an orbit that is not on the branch.
    #[error(
        "the nearest orbit is {distance:.1e} (m, rad, their rates, shares of the range) beside the line along which the branch leads: it is \
         not on the branch"
    )]
    Apart {
        /// Distance, of displacements, velocities and the share of the range.
        distance: f64,
    },
}

/// How runs to the section fail, as words of tables; the book explains them: `book/src/task-orbits.md`.
const FAILURES: [&str; 8] = ["no-return", "overlap", "jam", "squeezed", "jumps", "pressing", "no-derivative", "fails"];

impl OrbitError {
    /// Its name: `no-return`, `overlap`, `jam`, `squeezed`, `jumps`, `pressing`, `no-derivative`, `fails`, as in tables, or `not-converged`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::NoReturn { .. } => "no-return",
            Self::Run(SimError::Overlap { .. } | SimError::ClosesInside { .. }) => "overlap",
            Self::Run(SimError::Jam { .. }) => "jam",
            Self::Run(SimError::Squeezed { .. }) => "squeezed",
            Self::Jumps { .. } => "jumps",
            Self::Presses { .. } => "pressing",
            Self::NoDerivative { .. } => "no-derivative",
            Self::NotConverged { .. } | Self::Apart { .. } | Self::LeadsInside { .. } => "not-converged",
            Self::File { .. } | Self::Run(_) => "fails",
        }
    }

    /// The number of its word in a column of a first word and [`FAILURES`].
    fn outcome(&self) -> f64 {
        let last = FAILURES.len() - 1;
        (1 + FAILURES.iter().position(|name| *name == self.name()).unwrap_or(last)) as f64
    }
}
