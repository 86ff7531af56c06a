//! The tolerance with which a run has an error that is asked for.
//!
//! The error of an integration is nearly proportional to its tolerance: two runs with loose tolerances, which are cheap, tell the error of
//! the looser one, and so that of the tighter one and the tolerance for any other error. Each run tells whether this was right for the
//! one before it. Where two runs have other events, the error is not proportional, and it must be small enough without that assumption.

use super::run_error::{Outline, RATIO, steps};
use super::trajectory::{Event, Summary};
use crate::error::SimError;
use crate::plan::Plan;
use crate::scene::Scene;
use crate::state::{EXACT, GROWTH};

/// The tolerance of the first run, as a multiple of the accuracy, and the loosest that is tried.
const LOOSE: f64 = 1e3;
const LOOSEST: f64 = 1e-4;

/// A scene with the tolerance that meets its [`accuracy`](Scene::accuracy), and its run.
#[derive(Debug, Clone)]
pub struct ToAccuracy {
    /// The scene, with this tolerance in its text, too, and no accuracy.
    pub scene: Scene,
    /// Its plan.
    pub plan: Plan,
    /// The events of its run.
    pub events: Vec<Event>,
    /// The summary of its run.
    pub summary: Summary,
    /// The estimated error of the numbers of the final state and of the times of events: the largest, each in its own unit.
    pub error: f64,
    /// Evaluations of the equation of motion in all runs that have led to it.
    pub evaluations: usize,
}

impl Scene {
    /// The scene with a tolerance that meets its [`accuracy`](Scene::accuracy): every number of the final state, and the time of every event, has
    /// an estimated error of this size at most, in its own unit. `None` for a scene without such a wish.
    ///
    /// # Errors
    /// [`SimError::Accuracy`]: no tolerance meets the wish; as [`Simulation::run`](crate::Simulation::run).
    pub fn to_accuracy(&self) -> Result<Option<ToAccuracy>, SimError> {
        let Some(accuracy) = self.accuracy else { return Ok(None) };
        let mut scene = Self { accuracy: None, ..self.clone() };
        let (plan, run, error, evaluations) = scene.plan()?.meet(accuracy, self.duration)?;
        let Outline { events, summary, .. } = run;
        scene.set_accuracy(&plan.simulation)?;
        let plan = scene.plan()?.because(accuracy, error);
        Ok(Some(ToAccuracy { scene, plan, events, summary, error, evaluations }))
    }
}

impl Plan {
    /// The plan with another tolerance, its run, its error, and the evaluations of all runs.
    fn meet(mut self, accuracy: f64, duration: f64) -> Result<(Self, Outline, f64, usize), SimError> {
        let unmet = |why: String| Err(SimError::Accuracy { accuracy, why });
        let mut before = (LOOSE * accuracy).clamp(EXACT / RATIO, LOOSEST);
        let mut tolerance = RATIO * before;
        self.simulation.set_tolerance(before);
        let mut looser = self.outline(duration, None)?;
        let mut evaluations = looser.summary.statistics.evaluations;
        loop {
            self = self.tighter(tolerance, &looser.summary.statistics);
            let run = self.outline(duration, None)?;
            evaluations += run.summary.statistics.evaluations;
            if let Some(time) = steps(&looser.events).or(steps(&run.events)) {
                let why = "time steps begin, whose error does not follow from the tolerance: give tolerance";
                return unmet(format!("at {time} s {why}"));
            }
            let apart = self.apart((&looser.events, &looser.summary.last), &run)?;
            let error = apart.largest() * if apart.same { GROWTH * tolerance / before } else { 1.0 };
            if error <= accuracy {
                return Ok((self, run, error, evaluations));
            }
            if tolerance <= EXACT {
                let why = "and rounding prevents a tighter one: ask for less, or give tolerance";
                return unmet(format!("with the tolerance {tolerance:e} the estimated error is {error:.1e}, {why}"));
            }
            (before, looser) = (tolerance, run);
            tolerance = (tolerance * accuracy / error).min(RATIO * tolerance).max(EXACT);
        }
    }
}
