//! Derivatives of a whole run by its initial state and by parameters: the public functions and their results.
//!
//! A run is a product of linear maps, of its motions and of its events (`follow.rs`): [`LinearRun`] applies them to changes of
//! the start and the parameters, or their transposes, last one first, to the derivatives of a number by the outcome (the adjoint method).
//! [`Sensitivity`] applies them to all changes at once.

use super::follow::{Broken, differentiate};
use super::linear_run::{AllColumns, EventTime, LinearRun, Pieces};
use crate::error::SimError;
use crate::model::{Parameter, Simulation};
use crate::plan::Plan;
use crate::state::Moment;
use carom_chain::{Coordinates, PlanarChain};
use nalgebra::DMatrix;

/// Derivatives of the final state of a run, and of the times of its events.
///
/// The columns are the initial state and then the parameters: the nv numbers of a small displacement of q (rad, m; of a floating
/// joint along and about the axes of the body), the nv numbers of qd, and one for each parameter.
#[derive(Debug, Clone)]
pub struct Sensitivity {
    /// The names of the columns: `q shoulder`, `qd shoulder`, `restitution` …; of joints with several coordinates with a number:
    /// `q base 3`.
    pub names: Vec<String>,
    /// The state at the end.
    pub last: Moment,
    /// Derivatives of the final displacement (nv rows, as in the columns) and velocity (nv rows); `None` if the final state has
    /// no derivative: see `broken`.
    pub last_by: Option<DMatrix<f64>>,
    /// The rate of the final displacement and velocity, (qd, q̈): 2 nv numbers. Of a run that ends with an event, that after it.
    pub rate: Vec<f64>,
    /// The times of the events that have derivatives.
    pub events: Vec<EventTime>,
    /// Where and why the derivatives end, if they do.
    pub broken: Option<Broken>,
}

impl Simulation {
    /// Runs from `(q, qd)` for `duration` seconds, and differentiates the final state and the times of the events by the initial
    /// state and by these parameters.
    ///
    /// The derivatives are those of the motion that is computed. Those of a start in which contacts
    /// last, or dry friction holds joints, compare it with the nearest starts in which they do. Where a contact or a joint at rest
    /// begins to move at the start, the motion has a kink there in its velocity, and the derivatives are those of the side on which it
    /// has the direction in which it begins to move.
    ///
    /// # Errors
    /// As [`Simulation::run`]; [`SimError::Setting`] for a parameter that changes the chain or the number of possible contacts.
    pub fn sensitivity(
        &self,
        q: &[f64],
        qd: &[f64],
        duration: f64,
        parameters: &[Parameter],
    ) -> Result<Sensitivity, SimError> {
        all_columns(self, self.in_plane().as_ref(), (q, qd), duration, parameters)
    }

    /// Runs from `(q, qd)` for `duration` seconds, and keeps the run as a linear map, from changes of the initial state and of these
    /// parameters to those of the final state and of the times of the events: see [`LinearRun`]. It needs memory for each step.
    ///
    /// # Errors
    /// As [`Simulation::sensitivity`]; [`SimError::NoDerivative`] where the run has none.
    pub fn linear_run(
        &self,
        q: &[f64],
        qd: &[f64],
        duration: f64,
        parameters: &[Parameter],
    ) -> Result<LinearRun, SimError> {
        linear(self, self.in_plane().as_ref(), (q, qd), duration, parameters)
    }
}

impl Plan {
    /// [`Simulation::sensitivity`] of the plan from its start, in the plane that the plan has decided on.
    ///
    /// # Errors
    /// As [`Simulation::sensitivity`].
    pub fn sensitivity(&self, duration: f64, parameters: &[Parameter]) -> Result<Sensitivity, SimError> {
        all_columns(&self.simulation, self.in_plane(), (&self.q, &self.qd), duration, parameters)
    }

    /// [`Simulation::linear_run`] of the plan from its start, in the plane that the plan has decided on.
    ///
    /// # Errors
    /// As [`Simulation::linear_run`].
    pub fn linear_run(&self, duration: f64, parameters: &[Parameter]) -> Result<LinearRun, SimError> {
        linear(&self.simulation, self.in_plane(), (&self.q, &self.qd), duration, parameters)
    }
}

impl Simulation {
    /// The names of the numbers of a small change of the state, 2 nv: `q shoulder`, `qd shoulder`; of joints with several coordinates
    /// with a number, `q base 3`. The first columns of a [`Sensitivity`] have these names, and so have the rows of its `last_by`.
    pub fn state_names(&self) -> Vec<String> {
        let mut names = Vec::new();
        for what in ["q", "qd"] {
            for v in 0..self.chain.nv() {
                let Some(joint) = self.chain.joint_of_velocity(v) else { continue };
                let number = match &joint.coordinates {
                    Coordinates::Own { v: own, .. } if own.len() > 1 => format!(" {}", v - own.start + 1),
                    _ => String::new(),
                };
                names.push(format!("{what} {}{number}", joint.name));
            }
        }
        names
    }
}

fn all_columns(
    simulation: &Simulation,
    flat: Option<&PlanarChain>,
    start: (&[f64], &[f64]),
    duration: f64,
    parameters: &[Parameter],
) -> Result<Sensitivity, SimError> {
    let mut all = AllColumns::new(2 * simulation.chain.nv(), parameters.len());
    let end = differentiate(simulation, flat, (start, duration), parameters, &mut all)?;
    let last_by = end.broken.is_none().then(|| end.tangent * &all.s);
    let (names, events) = (names(simulation, parameters), all.events);
    Ok(Sensitivity { names, last: end.last, last_by, rate: end.rate, events, broken: end.broken })
}

fn linear(
    simulation: &Simulation,
    flat: Option<&PlanarChain>,
    start: (&[f64], &[f64]),
    duration: f64,
    parameters: &[Parameter],
) -> Result<LinearRun, SimError> {
    let mut pieces = Pieces::new(2 * simulation.chain.nv(), parameters.len());
    let end = differentiate(simulation, flat, (start, duration), parameters, &mut pieces)?;
    if let Some(Broken { time, reason }) = &end.broken {
        return Err(SimError::NoDerivative { time: *time, reason: reason.clone() });
    }
    let names = (names(simulation, parameters), parameters.len());
    Ok(LinearRun::new(names, (end.last, end.rate, end.tangent), pieces))
}

/// The names of the columns.
fn names(sim: &Simulation, parameters: &[Parameter]) -> Vec<String> {
    let mut names = sim.state_names();
    names.extend(parameters.iter().map(|parameter| parameter.name().to_owned()));
    names
}
