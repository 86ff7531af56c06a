//! The two ways to run a simulation: all results at once, or passed on as they arise.

use super::events::Run;
use super::trajectory::{Sampling, Seen, Summary, Trajectory};
use crate::error::SimError;
use crate::model::Simulation;
use carom_chain::{Planar, Spatial};

impl Simulation {
    /// Runs from `(q, qd)` for `duration` seconds and returns all events and the whole motion.
    ///
    /// # Errors
    /// [`SimError`]: an invalid state or setting, an overlap at the start, errors of the impact laws and of the integrator.
    pub fn run(&self, q: &[f64], qd: &[f64], duration: f64) -> Result<Trajectory, SimError> {
        let (mut events, mut segments) = (Vec::new(), Vec::new());
        let summary = self.stream(q, qd, duration, Sampling { every: None, dense: true }, &mut |seen| match seen {
            Seen::Event(event) => events.push(event.clone()),
            Seen::Segment(segment) => segments.push(segment.clone()),
            Seen::Moment(_) => {}
        })?;
        Ok(Trajectory { events, segments, summary })
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
        self.check(q, qd, duration, sampling.every)?;
        match self.in_plane() {
            Some(model) => Run::<Planar<f64>>::go(self, &model, (q, qd), duration, sampling, watch),
            None => Run::<Spatial<f64>>::go(self, &self.chain, (q, qd), duration, sampling, watch),
        }
    }
}
