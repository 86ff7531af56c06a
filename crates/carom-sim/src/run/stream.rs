//! The two ways to run a simulation: all results at once, or passed on as they arise.

use super::run_state::Run;
use super::trajectory::{Sampling, Seen, Summary, Trajectory};
use crate::error::SimError;
use crate::model::Simulation;
use crate::plan::Plan;
use carom_chain::PlanarChain;

impl Simulation {
    /// Runs from `(q, qd)` for `duration` seconds and returns all events and the whole motion.
    ///
    /// # Errors
    /// [`SimError`]: an invalid state or setting, an overlap at the start, errors of the impact laws and of the integrator.
    pub fn run(&self, q: &[f64], qd: &[f64], duration: f64) -> Result<Trajectory, SimError> {
        store(|sampling, watch| self.stream(q, qd, duration, sampling, watch))
    }

    /// Runs from `(q, qd)` for `duration` seconds and calls `watch` with every event, sample and segment. Memory does not
    /// grow with the simulated time.
    ///
    /// # Errors
    /// As [`Simulation::run`].
    pub fn stream(
        &self,
        q: &[f64],
        qd: &[f64],
        duration: f64,
        sampling: Sampling,
        watch: &mut dyn FnMut(Seen),
    ) -> Result<Summary, SimError> {
        go(self, self.in_plane().as_ref(), (q, qd), (duration, false), sampling, watch)
    }
}

impl Plan {
    /// Runs the plan from its start: as [`Simulation::run`], in the plane that the plan has decided on.
    ///
    /// # Errors
    /// As [`Simulation::run`].
    pub fn run(&self, duration: f64) -> Result<Trajectory, SimError> {
        store(|sampling, watch| self.stream(duration, sampling, watch))
    }

    /// Runs the plan from its start: as [`Simulation::stream`], in the plane that the plan has decided on.
    ///
    /// # Errors
    /// As [`Simulation::run`].
    pub fn stream(&self, duration: f64, sampling: Sampling, watch: &mut dyn FnMut(Seen)) -> Result<Summary, SimError> {
        self.stream_from((&self.q, &self.qd), duration, sampling, watch)
    }

    /// Runs the plan from another start, of all its joints: as [`Plan::stream`], with what was decided at its own.
    ///
    /// # Errors
    /// As [`Simulation::run`].
    pub fn stream_from(
        &self,
        start: (&[f64], &[f64]),
        duration: f64,
        sampling: Sampling,
        watch: &mut dyn FnMut(Seen),
    ) -> Result<Summary, SimError> {
        go(&self.simulation, self.in_plane(), start, (duration, false), sampling, watch)
    }
}

/// Runs in the plane, if one is given, or in space; with one impact more before each end of an accumulation if `later`.
pub(super) fn go(
    simulation: &Simulation,
    flat: Option<&PlanarChain>,
    start: (&[f64], &[f64]),
    (duration, later): (f64, bool),
    sampling: Sampling,
    watch: &mut dyn FnMut(Seen),
) -> Result<Summary, SimError> {
    simulation.check(start.0, start.1, duration, sampling.every)?;
    in_its_space!(simulation, flat, |A, model| {
        Run::<A>::go(simulation, model, start, (duration, later), sampling, watch)
    })
}

/// Stores all events and the whole motion of a run.
fn store(
    run: impl FnOnce(Sampling, &mut dyn FnMut(Seen)) -> Result<Summary, SimError>,
) -> Result<Trajectory, SimError> {
    let (mut events, mut segments) = (Vec::new(), Vec::new());
    let summary = run(Sampling { dense: true, ..Sampling::default() }, &mut |seen| match seen {
        Seen::Event(event) => events.push(event.clone()),
        Seen::Segment(segment) => segments.push(segment.clone()),
        Seen::Moment(_) | Seen::Contacts(..) | Seen::Motors(..) => {}
    })?;
    Ok(Trajectory { events, segments, summary })
}
