//! Fits the coefficients of an impact law to recorded impacts: restitution, friction and, optionally, the scale of rotational
//! inertia.
//!
//! There are three kinds of recordings. They give different coefficients, so a [`Fit`] states which kind it is for:
//!
//! | recording | function | residual |
//! | --- | --- | --- |
//! | velocities before and after, at the contact or of a chain's joints | [`fit_velocities`] of [`MeasuredImpact`]s | velocity, m/s |
//! | poses of the flights before and after | [`join_flights`] estimates velocities, pose and time, then [`fit_velocities`] | velocity, m/s |
//! | tosses | [`fit_trajectories`] | pose error over the roll-out to its end or to 0.1 s after the first impact, [`RollOut::pose_error`](crate::RollOut::pose_error) |
//!
//! The residual of a single impact has the lower bound [`MeasuredImpact::least_residual`], which no law with a point contact
//! can go below. The error of a roll-out accumulates over all impacts and contacts of a toss.
//!
//! **Method.** A robust loss ([`Loss`]) is minimised over a box by a grid and the Nelder–Mead method (`search.rs`). Intervals
//! for velocities are profile-likelihood intervals with a leverage-corrected sandwich covariance (`confidence.rs`); intervals
//! for roll-outs come from a seeded bootstrap over the tosses. Noise in the velocities *before* an impact is not modelled but
//! treated as noise of the jump. Its effect is negligible up to a few per cent of these velocities; larger noise biases
//! restitution low and, where many impacts are close to sticking, friction high. Results are deterministic.

mod bound;
mod confidence;
mod error;
mod flights;
mod jumps;
mod launch;
mod least_squares;
mod loss;
mod search;
mod trajectories;
mod velocities;

pub use error::FitError;
pub use flights::{Flight, Joined, join_flights, lowest_point, toss_flights};
pub use jumps::{ChainJump, MeasuredImpact};
#[doc(hidden)] // for carom-evidence, and under test
pub use launch::{Launched, launch};
pub use loss::Loss;
pub use trajectories::fit_trajectories;
pub use velocities::fit_velocities;

use carom_impact::{Coefficients, LawInfo};
use serde::Serialize;

#[doc(hidden)] // for carom-evidence
pub use jumps::LawPair;
#[doc(hidden)] // for carom-evidence
pub use loss::median;
#[doc(hidden)] // for carom-evidence
pub use search::Region;

/// Options of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitOptions<'a> {
    /// The law: one of [`LAW_NAMES`](carom_impact::LAW_NAMES), or an alias of it.
    pub law: &'a str,
    /// The loss.
    pub loss: Loss,
    /// Whether to fit the scale of rotational inertia too: one factor for the inertias of all bodies about their centres of
    /// mass, with the masses unchanged; searched from 1/2 to 2.
    pub inertia: bool,
    /// Upper bound of the coefficient of friction, above 0 and at most 100. The lower bound is 0.
    pub max_friction: f64,
    /// Share of the measurements used for training, above 0 and at most 1; the others form the test set.
    pub train: f64,
    /// Seed of the split into training and test set, and of the bootstrap.
    pub seed: u64,
    /// Confidence level of the intervals, at least 0.5 and below 1.
    pub confidence: f64,
}

impl Default for FitOptions<'_> {
    /// Stronge's law, Huber's loss, no scale of inertia, friction up to 1, all measurements for training, seed 0, 95 %.
    fn default() -> Self {
        Self {
            law: "energetic",
            loss: Loss::Huber,
            inertia: false,
            max_friction: 1.0,
            train: 1.0,
            seed: 0,
            confidence: 0.95,
        }
    }
}

/// The kind of recording that was fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FittedTo {
    /// Velocity jumps.
    Velocities,
    /// Poses of whole roll-outs.
    Trajectories,
}

crate::words! { FittedTo { Velocities "velocities", Trajectories "trajectories" } }

/// Result of a fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The kind of recording that was fitted.
    pub to: FittedTo,
    /// Name of the law.
    pub law: String,
    /// The loss.
    pub loss: Loss,
    /// Error beyond which the loss grows linearly, in the unit of [`Misfit::error`]; `None` for least squares.
    pub threshold: Option<f64>,
    /// Restitution, friction unless the law has none, and, if requested, the scale of inertia.
    pub coefficients: Vec<Coefficient>,
    /// Errors of the training set.
    pub train: Score,
    /// Errors of the test set; `None` if it is empty.
    pub test: Option<Score>,
    /// Error of each measurement, in the order of the input.
    pub each: Vec<Misfit>,
    /// Notes for the reader, one sentence each: identifiability, active bounds, origin of the intervals.
    pub notes: Vec<String>,
    /// Number of sets of coefficients that were evaluated.
    pub trials: usize,
}

/// A fitted coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Coefficient {
    /// `restitution`, `friction` or `inertia scale`.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Lower end of its confidence interval.
    pub low: f64,
    /// Upper end of its confidence interval.
    pub high: f64,
    /// Method of the interval.
    pub interval: Interval,
}

/// Method of a confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interval {
    /// Profile likelihood with a leverage-corrected sandwich covariance: the values at which the loss, minimised over the
    /// other coefficients, exceeds its minimum by no more than this covariance allows.
    Profile,
    /// Bootstrap over the tosses.
    Bootstrap,
    /// Profile likelihood with homogeneous noise: at most one measurement identifies the coefficient, so the covariance
    /// cannot be estimated.
    Alike,
}

crate::words! { Interval { Profile "profile", Bootstrap "bootstrap", Alike "alike" } }

/// Error of one measurement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Misfit {
    /// Velocities: index of the impact, from 0. Trajectories: number of the toss.
    pub number: i64,
    /// Whether the measurement belongs to the training set.
    pub trained: bool,
    /// Velocities: norm of the residual, m/s. Trajectories: `whole` or `early`, whichever was fitted.
    pub error: f64,
    /// Trajectories: [`RollOut::pose_error`](crate::RollOut::pose_error).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub whole: Option<f64>,
    /// Trajectories: [`RollOut::early_error`](crate::RollOut::early_error), if the toss has an impact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub early: Option<f64>,
    /// Velocities: lower bound of the residual over all impulses in the cone of the fitted friction, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least_in_cone: Option<f64>,
    /// Velocities: lower bound of the residual over all impulses with p_n ≥ 0, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least: Option<f64>,
}

/// Statistics of the errors of several measurements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Score {
    /// Number of measurements.
    pub count: usize,
    /// Mean of [`Misfit::error`].
    pub mean: f64,
    /// Median of [`Misfit::error`].
    pub median: f64,
    /// Trajectories: share of [`Misfit::whole`] below 0.5.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub below_half: Option<f64>,
    /// Trajectories: mean of [`Misfit::whole`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub whole_mean: Option<f64>,
    /// Trajectories: median of [`Misfit::whole`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub whole_median: Option<f64>,
    /// Trajectories: mean of [`Misfit::early`] over the tosses that have it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub early_mean: Option<f64>,
    /// Trajectories: median of [`Misfit::early`] over the tosses that have it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub early_median: Option<f64>,
    /// Velocities: mean of [`Misfit::least_in_cone`], m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least_in_cone: Option<f64>,
    /// Velocities: mean of [`Misfit::least`], m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least: Option<f64>,
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
        let both = |part: fn(&Misfit) -> Option<f64>| {
            let values: Vec<f64> = all.iter().filter_map(|one| part(one)).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            (!values.is_empty()).then(|| (mean, median(values))).unzip()
        };
        let ((whole_mean, whole_median), (early_mean, early_median)) = (both(|one| one.whole), both(|one| one.early));
        let below = all.iter().filter(|one| one.whole.is_some_and(|error| error < 0.5)).count() as f64 / count as f64;
        (count > 0).then(|| Self {
            count,
            mean: mean(errors.clone()),
            median: median(errors),
            below_half: (to == FittedTo::Trajectories).then_some(below),
            whole_mean,
            whole_median,
            early_mean,
            early_median,
            least: mean_of(|one| one.least),
            least_in_cone: mean_of(|one| one.least_in_cone),
        })
    }
}

impl FitOptions<'_> {
    /// What is fitted, after a check of all options.
    fn model(&self) -> Result<Model, FitError> {
        let law = LawInfo::named(self.law).ok_or_else(|| FitError::unknown_law(self.law))?;
        let refuse = |what, value, rule| Err(FitError::setting(what, value, rule));
        if !(self.max_friction > 0.0 && self.max_friction <= 100.0) {
            return refuse("largest friction", self.max_friction, "it must be above 0 and at most 100");
        }
        if !(self.train > 0.0 && self.train <= 1.0) {
            return refuse("training share", self.train, "it must be above 0 and at most 1");
        }
        if !(self.confidence >= 0.5 && self.confidence < 1.0) {
            return refuse("confidence", self.confidence, "it must be at least 0.5 and below 1");
        }
        let all = [
            ("restitution", true, (0.0, 1.0)),
            (FRICTION, law.has(FRICTION), (0.0, self.max_friction)),
            (INERTIA, self.inertia, (0.5, 2.0)),
        ];
        let of = all.into_iter().filter(|(_, fitted, _)| *fitted).map(|(name, _, bounds)| (name, bounds)).collect();
        Ok(Model { law: law.name, coefficients: of })
    }

    /// Indices of the training set among `all` measurements, ascending, by a seeded shuffle.
    fn split(&self, model: &Model, all: usize, of: &'static str) -> Result<Vec<usize>, FitError> {
        let parameters = model.coefficients.len();
        let found = ((all as f64 * self.train).round() as usize).min(all);
        let needed = parameters + 1;
        if found < needed {
            return Err(FitError::Input(format!(
                "{found} of {all} {of} are selected to fit {parameters} coefficients, but at least {needed} are needed: record \
                 more, or train on a larger share of them"
            )));
        }
        let mut order = shuffled(all, self.seed);
        order.truncate(found);
        order.sort_unstable();
        Ok(order)
    }
}

/// The numbers below `count` in a seeded random order.
#[doc(hidden)] // for carom-evidence
pub fn shuffled(count: usize, seed: u64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    fastrand::Rng::with_seed(seed).shuffle(&mut order);
    order
}

/// Names of the coefficients that not every fit has.
const FRICTION: &str = "friction";
const INERTIA: &str = "inertia scale";

/// What is fitted: a law and the coefficients of its fit.
struct Model {
    /// One of [`LAW_NAMES`](carom_impact::LAW_NAMES).
    law: &'static str,
    /// Names with the ends of the search.
    coefficients: Vec<(&'static str, (f64, f64))>,
}

impl Model {
    /// The coefficient called `name` of `x`; `None` if it is not fitted.
    fn get(&self, x: &[f64], name: &str) -> Option<f64> {
        self.coefficients.iter().position(|(own, _)| *own == name).map(|k| x[k])
    }

    /// Notes on the coefficient `one`, whose search has ended at `end` of its range or at neither end; `together`: the residuals determine
    /// fewer numbers than there are coefficients.
    fn notes(&self, k: usize, one: &Coefficient, end: Option<f64>, together: bool) -> Vec<String> {
        let (name, (low, high)) = self.coefficients[k];
        let at_bound = end.map(|end| {
            let more = if name == FRICTION && end > 0.0 { ": raise the largest friction" } else { "" };
            format!("{name} is at its bound {end}{more}")
        });
        let alike = (one.interval == Interval::Alike).then(|| {
            let why = if together {
                format!("{name} may compensate another coefficient")
            } else {
                format!("only one impact identifies {name}")
            };
            format!("{why}: its interval assumes the same noise in all impacts")
        });
        let wide = (one.high - one.low > 0.9 * (high - low)).then(|| {
            format!("the interval of {name} covers more than 90 % of the range searched: it is poorly identified")
        });
        at_bound.into_iter().chain(alike).chain(wide).collect()
    }

    /// The result of a fit whose loss has this threshold.
    fn fit(
        &self,
        to: FittedTo,
        options: &FitOptions,
        threshold: f64,
        coefficients: Vec<Coefficient>,
        (each, notes, trials): (Vec<Misfit>, Vec<String>, usize),
    ) -> Fit {
        let of = |trained: bool| Score::of(each.iter().filter(|one| one.trained == trained), to);
        let Some(train) = of(true) else { unreachable!("the split has measurements to fit") };
        let (law, loss, test) = (self.law.into(), options.loss, of(false));
        let threshold = threshold.is_finite().then_some(threshold);
        Fit { to, law, loss, threshold, coefficients, train, test, notes, trials, each }
    }

    /// The coefficients of the law.
    fn law(&self, x: &[f64]) -> Coefficients {
        Coefficients { restitution: x[0], friction: self.get(x, FRICTION).unwrap_or(0.0), ..Coefficients::default() }
    }

    /// The box of the search, with a grid of restitutions, of shares of the largest friction, and of scales of inertia.
    fn region(&self, restitution: &[f64], friction: &[f64], inertia: &[f64]) -> Region {
        let grid = |&(name, (_, high)): &(&str, (f64, f64))| match name {
            FRICTION => friction.iter().map(|share| share * high).collect(),
            INERTIA => inertia.to_vec(),
            _ => restitution.to_vec(),
        };
        Region {
            bounds: self.coefficients.iter().map(|(_, bounds)| *bounds).collect(),
            grid: self.coefficients.iter().map(grid).collect(),
        }
    }
}
