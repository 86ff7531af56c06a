//! A run of a simulation: its state, beginning, pausing and continuing it.

use super::history::History;
use super::sampler::Sampler;
use super::trajectory::{EnergyBooks, Sampling, Seen, StopReason, Summary};
use crate::error::SimError;
use crate::model::Simulation;
use crate::motion::{ActiveSet, ContactState, Lasting, Motion};
use crate::state::{Moment, STEPS, Space};

/// A run. Its state is that of a [`Checkpoint`]: the time, the numbers of the state, the active set of the
/// motion, and the history. All else follows from the simulation or is scratch memory.
pub(crate) struct Run<'a, 'w, A: Space> {
    pub motion: Motion<'a, A>,
    pub time: f64,
    pub y: Vec<f64>,
    pub history: History,
    /// The time at which it ends.
    pub end: f64,
    pub sampler: Sampler<'w>,
}

/// All that the further motion of a run depends on, beside the simulation.
#[derive(Debug, Clone)]
pub(crate) struct Checkpoint {
    pub time: f64,
    pub y: Vec<f64>,
    pub active: ActiveSet,
    pub history: History,
}

impl<'a, 'w, A: Space> Run<'a, 'w, A> {
    /// A run at its start, before the first contacts are looked for.
    pub fn at_start(
        sim: &'a Simulation,
        model: &'a A::Model,
        (q, qd): (&[f64], &[f64]),
        sampling: Sampling,
        watch: &'w mut dyn FnMut(Seen),
    ) -> Result<Self, SimError> {
        let mut motion = Motion::new(sim, model);
        let deflections = vec![0.0; 3 * motion.bristles.len()];
        let mut y = [q, qd, &[0.0, 0.0], &deflections].concat();
        motion.close_loops(&mut y)?;
        let mut run = Self::of(motion, (sim.start_time, y), History::default(), sampling, watch);
        run.refuse_branching_start()?;
        Ok(run)
    }

    /// A run that goes on from a checkpoint.
    pub fn resume(
        mut motion: Motion<'a, A>,
        from: Checkpoint,
        sampling: Sampling,
        watch: &'w mut dyn FnMut(Seen),
    ) -> Self {
        motion.active = from.active;
        Self::of(motion, (from.time, from.y), from.history, sampling, watch)
    }

    fn of(
        motion: Motion<'a, A>,
        (time, y): (f64, Vec<f64>),
        history: History,
        sampling: Sampling,
        watch: &'w mut dyn FnMut(Seen),
    ) -> Self {
        let sizes = (motion.sim.chain.nq(), motion.sim.chain.nv());
        let count = sampling.every.map_or(0, |every| next_moment(time, every, time == motion.sim.start_time));
        let sampler = Sampler { sampling, sizes, count, until: time, watch, path: None };
        Self { motion, time, y, history, end: time, sampler }
    }

    /// Where the run stands.
    pub fn checkpoint(self) -> Checkpoint {
        let Self { motion, time, y, history, .. } = self;
        Checkpoint { time, y, active: motion.active, history }
    }

    /// Runs to the end, or with `to_event` to the next event.
    pub fn until_end(&mut self, to_event: bool) -> Result<StopReason, SimError> {
        let first = self.history.events;
        while self.time < self.end && !(to_event && self.history.events > first) {
            self.motion.sim.go_on(self.time)?;
            if self.history.events >= self.motion.sim.max_events {
                return Ok(StopReason::Events);
            }
            if let Some(leap) = self.history.leap.take() {
                self.follow(leap)?;
            } else if self.motion.active.stepping {
                self.several_contacts()?;
            } else {
                let ending = self.leg()?;
                self.act(ending)?;
            }
        }
        Ok(StopReason::Duration)
    }

    /// See [`Session::nearest`](super::Session::nearest).
    pub fn nearest(&mut self, q: &[f64], qd: &[f64]) -> Result<(Vec<f64>, Vec<f64>), SimError> {
        self.measure();
        let lasting = self.motion.active.lasting.clone();
        let mut closed = lasting.clone();
        for (touch, (gap, _)) in self.gaps()? {
            if gap.abs() <= self.motion.scale.touching(touch) && !self.motion.lasts(touch) {
                closed.push(Lasting::of(touch, &self.motion.sim.touches[touch], None));
            }
        }
        let mut y = self.y.clone();
        y[..q.len()].copy_from_slice(q);
        y[q.len()..q.len() + qd.len()].copy_from_slice(qd);
        // One projection is a step of Newton's method: the gaps are not linear in q.
        for _ in 0..STEPS {
            if !self.motion.project((&closed, &lasting), self.time, &mut y)? {
                break;
            }
        }
        let (q, qd) = self.motion.split(&y);
        Ok((q.to_vec(), qd.to_vec()))
    }

    /// Stays at rest to the end.
    pub fn stay(&mut self) -> Result<(), SimError> {
        let contacts = self.contacts()?;
        let (start, y) = (std::mem::replace(&mut self.time, self.end), self.y.clone());
        let told = self.told(contacts, &y)?;
        self.sampler.stretch((start, self.end, 2), |_| y.clone(), |_, _| told.clone());
        Ok(())
    }

    /// The modes after a pause, in which the drive may have `changed`.
    pub fn wake(&mut self, changed: bool) -> Result<(), SimError> {
        if self.history.leap.is_some() {
            return Ok(());
        }
        if changed && !self.motion.active.stepping && !self.motion.moves_freely() {
            let before = self.y.clone();
            self.measure();
            return self.resettle(None, &[], &before);
        }
        if changed {
            self.history.resting = false;
        } else if self.history.resting && self.is_steady() {
            return self.stay();
        }
        Ok(())
    }

    /// The lasting contacts now.
    pub fn contacts(&mut self) -> Result<Vec<ContactState>, SimError> {
        if self.motion.active.stepping {
            Ok(self.history.stepped.clone())
        } else {
            self.motion.contact_states(self.time, &self.y)
        }
    }

    /// The results so far, with the energy balance from a start with this energy.
    pub fn summary(&mut self, start: f64, stop: StopReason) -> Result<Summary, SimError> {
        let (contacts, energy, (q, qd)) = (self.contacts()?, self.books(start)?, self.q_qd());
        Ok(Summary {
            last: Moment { time: self.time, q, qd },
            mode: self.motion.active.mode(),
            contacts,
            stop,
            events: self.history.events,
            statistics: self.history.statistics,
            energy,
        })
    }

    /// The energy balance from a start with this energy.
    pub fn books(&mut self, start: f64) -> Result<EnergyBooks, SimError> {
        let end = self.motion.energy(&self.y)?;
        let work = self.motion.sim.chain.nq() + self.motion.sim.chain.nv();
        Ok(EnergyBooks { start, end, drive: self.y[work], resistance: self.y[work + 1], impacts: self.history.lost })
    }
}

/// Number of the next moment after `time`, at multiples of `every`; of the one at `time` itself if it is `included`.
fn next_moment(time: f64, every: f64, included: bool) -> usize {
    let mut count = (time / every).floor().max(0.0) as usize;
    let passed = |count: usize| if included { (count as f64) * every < time } else { count as f64 * every <= time };
    while passed(count) {
        count += 1;
    }
    count
}
