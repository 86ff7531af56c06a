//! The tolerance with which a run has an error that is asked for.
//!
//! The error of an integration is nearly proportional to its tolerance: two runs with loose tolerances, which are cheap, tell the error of
//! the looser one, and so that of the tighter one and the tolerance for any other error. Each run tells whether this was right for the
//! one before it: how the error has fallen so far is how it is taken to fall. Where two runs have other events, the error is not proportional, and it must be small enough without that assumption; so must
//! that of the ends of accumulations, which a run with one impact more before each tells.

use super::run_error::{Outline, RATIO, steps};
use super::trajectory::{Event, EventKind, Summary};
use crate::error::SimError;
use crate::model::Simulation;
use crate::plan::Plan;
use crate::scene::Scene;
use crate::state::{EXACT, GROWTH};
use serde::Serialize;

/// The tolerance of the first run, as a multiple of the accuracy, and the loosest that is tried.
const LOOSE: f64 = 1e3;
const LOOSEST: f64 = 1e-4;

/// A scene whose tolerance is chosen, and its plan: the scene as it was if it asks for no accuracy.
#[derive(Debug, Clone)]
pub struct ToAccuracy {
    /// The scene, with this tolerance in its text, too, and no accuracy.
    pub scene: Scene,
    /// Its plan.
    pub plan: Plan,
    /// How the accuracy is met; `None` for a scene that asks for none.
    pub met: Option<Met>,
}

/// How a tolerance meets an accuracy.
#[derive(Debug, Clone, Serialize)]
pub struct Met {
    /// The [`accuracy`](Scene::accuracy).
    pub asked: f64,
    /// The tolerance.
    pub tolerance: f64,
    /// The longest step that belongs to it, s: a scene with these three numbers has the same run.
    pub max_step: f64,
    /// The Zeno time that belongs to it, s.
    pub zeno_time: f64,
    /// The estimated error of the numbers of the final state and of the times of events: the largest, each in its own unit.
    pub error: f64,
    /// Evaluations of the equation of motion in all runs that have led to it.
    pub evaluations: usize,
    /// The events of the run with this tolerance.
    #[serde(skip)]
    pub events: Vec<Event>,
    /// Its summary.
    #[serde(skip)]
    pub summary: Summary,
}

impl Scene {
    /// The plan of the scene, with a tolerance that meets its [`accuracy`](Scene::accuracy) if it asks for one: every number of the final state, and
    /// the time of every event, has an estimated error of this size at most, in its own unit.
    ///
    /// # Errors
    /// [`SimError::Accuracy`]: no tolerance meets it; as [`Scene::plan`] and [`Simulation::run`](crate::Simulation::run).
    pub fn to_accuracy(mut self) -> Result<ToAccuracy, SimError> {
        let Some(accuracy) = self.accuracy.take() else {
            return Ok(ToAccuracy { plan: self.plan()?, scene: self, met: None });
        };
        let (plan, met) = self.plan()?.meet(accuracy, self.duration)?;
        self.set_accuracy(&plan.simulation)?;
        let plan = self.plan()?.because(accuracy, met.error);
        Ok(ToAccuracy { plan, scene: self, met: Some(met) })
    }
}

impl Plan {
    /// The plan with the tolerance that meets an accuracy.
    fn meet(mut self, accuracy: f64, duration: f64) -> Result<(Self, Met), SimError> {
        let mut before = (LOOSE * accuracy).clamp(EXACT / RATIO, LOOSEST);
        let mut tolerance = RATIO * before;
        self.simulation.set_tolerance(before);
        let (mut evaluations, mut before_that) = (0, None::<(f64, f64)>);
        let mut attempt = |plan: &Self, later: bool| match plan.outline(duration, None, later) {
            Err(stopped @ SimError::Stopped { .. }) => Err(stopped),
            Err(why) => Ok(Err(why)),
            Ok(run) => {
                evaluations += run.summary.statistics.evaluations;
                Ok(match steps(&run.events) {
                    Some(time) => Err(unmet(
                        accuracy,
                        format!(
                            "at {time} s time steps begin, whose error does not follow from the tolerance: give tolerance"
                        ),
                    )),
                    None => Ok(run),
                })
            }
        };
        let mut looser = attempt(&self, false)?;
        loop {
            match &looser {
                Ok(run) => self = self.tighter(tolerance, &run.summary.statistics),
                Err(_) => self.simulation.set_tolerance(tolerance),
            }
            let run = attempt(&self, false)?;
            let share = tolerance / before;
            let (mut error, mut expected) = (None, None);
            if let (Ok(looser), Ok(run)) = (&looser, &run) {
                let apart = self.apart((&looser.events, &looser.summary.last), run)?;
                let most = apart.largest();
                // The power of the tolerance with which the error falls, as the runs before show it.
                let power = before_that.map_or(0.0, |(earlier, share)| (most / earlier).ln() / share.ln());
                let falls = |power: f64| if apart.same { (GROWTH * share.powf(power)).min(1.0) } else { 1.0 };
                error = Some(most * falls(power.clamp(0.0, 1.0)));
                expected = Some(most * falls(1.0));
                before_that = Some((most, share)).filter(|_| apart.same && most > 0.0);
            } else {
                before_that = None;
            }
            // Both may end an accumulation after the same impact: its error then is not seen, and does not follow from the tolerance.
            if let (Ok(run), Some(own)) = (&run, &mut error)
                && *own <= accuracy
                && run.events.iter().any(|event| matches!(event.kind, EventKind::Zeno { .. }))
            {
                *own = match attempt(&self, true)? {
                    Ok(later) => own.max(self.apart((&run.events, &run.summary.last), &later)?.largest()),
                    Err(_) => f64::INFINITY,
                };
            }
            if let Some(error) = error.filter(|error| *error <= accuracy) {
                let Outline { events, summary, .. } = run?;
                return Ok(self.with(accuracy, error, (evaluations, events, summary)));
            }
            // A loose run that fails, or needs time steps, says nothing of tighter ones, unless the scene asks for them; the tightest tells why.
            if tolerance <= EXACT || self.simulation.stepping {
                let Outline { events, summary, .. } = run?;
                // A looser run that is hardly looser, or has other events, says little: tighter ones than those that may be chosen tell more.
                let found = self.error_of((duration, None), (&events, &[], &summary))?;
                let error = found.largest().or(error).unwrap_or(f64::INFINITY);
                if error <= accuracy {
                    return Ok(self.with(accuracy, error, (evaluations, events, summary)));
                }
                let why = format!(
                    "with the tolerance {tolerance:e} the estimated error is {error:.1e}, and rounding prevents a tighter one: ask for less, or give tolerance"
                );
                return Err(unmet(accuracy, why));
            }
            let asked = expected.map_or(f64::INFINITY, |error| tolerance * accuracy / error);
            (before, looser) = (tolerance, run);
            tolerance = asked.min(RATIO * tolerance).max(EXACT);
        }
    }
}

impl Plan {
    /// The plan, and how it meets an accuracy.
    fn with(self, asked: f64, error: f64, (evaluations, events, summary): (usize, Vec<Event>, Summary)) -> (Self, Met) {
        let Simulation { tolerance, max_step, zeno_time, .. } = self.simulation;
        (self, Met { asked, tolerance, max_step, zeno_time, error, evaluations, events, summary })
    }
}

fn unmet(accuracy: f64, why: String) -> SimError {
    SimError::Accuracy { accuracy, why }
}
