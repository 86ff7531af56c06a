//! Coefficients from recorded impacts: restitution, friction and, if asked, the scale of rotational inertia.
//!
//! Impacts are recorded in one of three ways, and they give different coefficients, so a [`Fit`] says which it is of:
//!
//! | recorded | fitted | what is missed is |
//! | --- | --- | --- |
//! | velocities before and after, as numbers or of a chain's joints | [`fit_velocities`] of [`MeasuredImpact`]s | a velocity, m/s |
//! | poses of the flights before and after | the same, after [`join_flights`] has estimated velocities, pose and time | a velocity, m/s |
//! | whole tosses | [`fit_trajectories`] | the pose over the whole roll-out, [`RollOut::pose_error`](crate::RollOut::pose_error) |
//!
//! The first two speak of one impact at a time and can be held against [`MeasuredImpact::least_residual`], the bound below
//! which no point contact can go, whatever its law. The third adds up everything that happens in a toss.
//!
//! **Method.** The least of a robust loss ([`Loss`]) over a box, by a grid and Nelder & Mead's search (`search.rs`);
//! intervals from the loss itself, which may rise by what a covariance allows that assumes nothing of the noise
//! (`confidence.rs`); for roll-outs, from a seeded bootstrap over the tosses. Noise in the velocities *before* an impact is
//! not modelled: it is taken for noise of the jump. That is no matter while it is some hundredths of them, and then biases
//! restitution low and, where many impacts are near sticking, friction high. The same numbers in give the same numbers out.

mod bound;
mod confidence;
mod error;
mod flights;
mod jumps;
mod loss;
mod search;
mod trajectories;
mod velocities;

pub use error::FitError;
pub use flights::{Flight, Joined, join_flights, lowest_point, toss_flights};
pub use jumps::{ChainJump, LawPair, MeasuredImpact};
pub use loss::Loss;
pub use trajectories::{RollOutOptions, fit_trajectories};
pub use velocities::fit_velocities;

use carom_impact::LAW_NAMES;
use loss::median;

/// How to fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitOptions<'a> {
    /// The law, one of [`LAW_NAMES`] with friction.
    pub law: &'a str,
    /// What a residual costs.
    pub loss: Loss,
    /// Fit the scale of rotational inertia too: all bodies' inertias about their centres of mass times one number, while
    /// masses stay. Searched from 1/2 to 2.
    pub inertia: bool,
    /// Upper end of the search for friction.
    pub max_friction: f64,
    /// Share of the measurements that are fitted on; the rest is for the test. 1: all, and no test.
    pub train: f64,
    /// Seed of the split and of the bootstrap.
    pub seed: u64,
    /// Of the intervals.
    pub confidence: f64,
}

impl Default for FitOptions<'_> {
    /// Stronge's law, Huber's loss, friction up to 1, half for training, 95 %.
    fn default() -> Self {
        Self {
            law: "energetic",
            loss: Loss::Huber,
            inertia: false,
            max_friction: 1.0,
            train: 0.5,
            seed: 0,
            confidence: 0.95,
        }
    }
}

/// What was fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FittedTo {
    /// Velocity jumps.
    Velocities,
    /// Poses of whole roll-outs.
    Trajectories,
}

impl FittedTo {
    /// `velocities` or `trajectories`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Velocities => "velocities",
            Self::Trajectories => "trajectories",
        }
    }
}

/// The outcome of a fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// What was fitted.
    pub to: FittedTo,
    /// The law's name.
    pub law: String,
    /// The loss.
    pub loss: Loss,
    /// Beyond this error the loss grows in proportion; `None` for squares.
    pub threshold: Option<f64>,
    /// Restitution, friction and, if asked, the inertia's scale.
    pub coefficients: Vec<Coefficient>,
    /// On what was fitted.
    pub train: Score,
    /// On what was not; `None` if everything was fitted.
    pub test: Option<Score>,
    /// Each measurement, in its order.
    pub each: Vec<Misfit>,
    /// What a reader has to know, in sentences.
    pub notes: Vec<String>,
    /// How many sets of coefficients were tried.
    pub trials: usize,
}

/// A fitted coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficient {
    /// `restitution`, `friction` or `inertia scale`.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end of its interval.
    pub high: f64,
    /// Where the interval comes from.
    pub interval: Interval,
}

/// Where an interval comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interval {
    /// The values at which the loss, with the other coefficients fitted anew, has risen by no more than the scatter of
    /// what each measurement pulls by allows.
    Profile,
    /// Fits to measurements drawn anew.
    Bootstrap,
    /// One measurement or none tells of it, which leaves no scatter: the values that fit as well, if noise is alike in all.
    Alike,
}

impl Interval {
    /// `jacobian`, `bootstrap` or `flat`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Profile => "profile",
            Self::Bootstrap => "bootstrap",
            Self::Alike => "alike",
        }
    }
}

/// How well one measurement is met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// Its place, counted from 0, or the toss's number.
    pub number: i64,
    /// It was fitted, not tested on.
    pub trained: bool,
    /// Velocities: norm of the residual, m/s. Trajectories: the pose error.
    pub error: f64,
    /// The least residual of any impulse that does not pull, m/s (velocities).
    pub least: Option<f64>,
    /// The least residual within the cone of the fitted friction, m/s (velocities).
    pub least_in_cone: Option<f64>,
}

/// How well several are met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// How many.
    pub count: usize,
    /// Mean of the errors.
    pub mean: f64,
    /// Their median.
    pub median: f64,
    /// Share of errors below 0.5 (trajectories).
    pub below_half: Option<f64>,
    /// Mean of the least residuals of any impulse that does not pull (velocities).
    pub least: Option<f64>,
    /// Mean of those within the cone of the fitted friction (velocities).
    pub least_in_cone: Option<f64>,
}

impl Score {
    fn of<'a>(all: impl Iterator<Item = &'a Misfit>, to: FittedTo) -> Option<Self> {
        let all: Vec<&Misfit> = all.collect();
        let count = all.len();
        let mean = |values: Vec<f64>| values.iter().sum::<f64>() / count as f64;
        let mean_of = |part: fn(&Misfit) -> Option<f64>| {
            let values: Option<Vec<f64>> = all.iter().map(|one| part(one)).collect();
            values.map(mean)
        };
        let errors: Vec<f64> = all.iter().map(|one| one.error).collect();
        let below = errors.iter().filter(|&&error| error < 0.5).count() as f64 / count as f64;
        (count > 0).then(|| Self {
            count,
            mean: mean(errors.clone()),
            median: median(errors),
            below_half: (to == FittedTo::Trajectories).then_some(below),
            least: mean_of(|one| one.least),
            least_in_cone: mean_of(|one| one.least_in_cone),
        })
    }
}

const NAMES: [&str; 3] = ["restitution", "friction", "inertia scale"];

impl FitOptions<'_> {
    fn check(&self) -> Result<(), FitError> {
        if !LAW_NAMES.contains(&self.law) {
            return Err(FitError::UnknownLaw { name: self.law.into(), known: LAW_NAMES.join(", ") });
        }
        if self.law == "frictionless" {
            let known: Vec<&str> = LAW_NAMES.into_iter().filter(|&name| name != self.law).collect();
            return Err(FitError::NoFriction { name: self.law.into(), known: known.join(", ") });
        }
        let refuse = |what, value, rule| Err(FitError::Setting { what, value, rule });
        if !(self.max_friction > 0.0 && self.max_friction <= 100.0) {
            return refuse("largest friction", self.max_friction, "the search ends above 0 and at 100 at most");
        }
        if !(self.train > 0.0 && self.train <= 1.0) {
            return refuse("training share", self.train, "it lies above 0, and 1 is all");
        }
        if !(self.confidence >= 0.5 && self.confidence < 1.0) {
            return refuse(
                "confidence",
                self.confidence,
                "give at least 0.5 and less than 1, as only the whole range is sure to hold the truth",
            );
        }
        Ok(())
    }

    fn parameters(&self) -> usize {
        if self.inertia { 3 } else { 2 }
    }

    /// Which of `all` measurements are fitted (ascending), by a seeded shuffle.
    fn split(&self, all: usize, of: &'static str) -> Result<Vec<usize>, FitError> {
        let parameters = self.parameters();
        let found = ((all as f64 * self.train).round() as usize).min(all);
        let needed = parameters + 1;
        if found < needed {
            return Err(FitError::TooFew { found, all, of, parameters, needed });
        }
        let mut order: Vec<usize> = (0..all).collect();
        fastrand::Rng::with_seed(self.seed).shuffle(&mut order);
        order.truncate(found);
        order.sort_unstable();
        Ok(order)
    }

    /// Sides of the box that is searched.
    fn bounds(&self) -> Vec<(f64, f64)> {
        let mut bounds = vec![(0.0, 1.0), (0.0, self.max_friction)];
        if self.inertia {
            bounds.push(INERTIA);
        }
        bounds
    }
}

/// The scales of inertia that are searched.
const INERTIA: (f64, f64) = (0.5, 2.0);
