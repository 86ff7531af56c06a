//! Beginning, pausing and continuing a run.

use super::leap::Leap;
use super::memory::Memory;
use super::run_state::Run;
use super::sampler::Sampler;
use super::trajectory::{EnergyBooks, Sampling, Seen, Statistics, StopReason, Summary};
use crate::error::SimError;
use crate::model::Simulation;
use crate::motion::{ContactState, Kept, Motion, bristles};
use crate::state::{Moment, Space};

/// Where a run stands: all that its further motion depends on, beside the simulation.
#[derive(Debug, Clone)]
pub(crate) struct Stand {
    pub time: f64,
    pub y: Vec<f64>,
    pub kept: Kept,
    statistics: Statistics,
    lost: f64,
    stepped: Vec<ContactState>,
    memory: Memory,
    leap: Option<Leap>,
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
        let deflections = vec![0.0; 3 * bristles(sim).len()];
        let mut y = [q, qd, &[0.0, 0.0], &deflections].concat();
        motion.close_loops(&mut y)?;
        let stand = Stand {
            time: sim.start_time,
            y,
            kept: motion.kept(),
            statistics: Statistics::default(),
            lost: 0.0,
            stepped: Vec::new(),
            memory: Memory::default(),
            leap: None,
        };
        let mut run = Self::resume(motion, stand, sampling, watch);
        run.refuse_branching_start()?;
        Ok(run)
    }

    /// A run that goes on from where another one stood.
    pub fn resume(mut motion: Motion<'a, A>, stand: Stand, sampling: Sampling, watch: &'w mut dyn FnMut(Seen)) -> Self {
        let sizes = (motion.sim.chain.nq(), motion.sim.chain.nv());
        let Stand { time, y, kept, statistics, lost, stepped, memory, leap } = stand;
        motion.keep(kept);
        let count = sampling.every.map_or(0, |every| next_moment(time, every, time == motion.sim.start_time));
        let sampler = Sampler { sampling, sizes, count, until: time, watch, path: None };
        Self { motion, time, y, end: time, sampler, statistics, lost, stepped, memory, leap }
    }

    /// Where the run stands.
    pub fn stand(self) -> Stand {
        let Self { motion, time, y, statistics, lost, stepped, memory, leap, .. } = self;
        Stand { time, y, kept: motion.kept(), statistics, lost, stepped, memory, leap }
    }

    /// Runs to the end, or with `to_event` to the next event.
    pub fn until_end(&mut self, to_event: bool) -> Result<StopReason, SimError> {
        let first = self.memory.events;
        while self.time < self.end && !(to_event && self.memory.events > first) {
            if self.memory.events >= self.motion.sim.max_events {
                return Ok(StopReason::Events);
            }
            if let Some(leap) = self.leap.take() {
                self.follow(leap)?;
            } else if self.motion.stepping {
                self.several_contacts()?;
            } else {
                self.one_leg()?;
            }
        }
        Ok(StopReason::Duration)
    }

    /// Stays at rest to the end.
    pub fn stay(&mut self) -> Result<(), SimError> {
        let (start, y) = (std::mem::replace(&mut self.time, self.end), self.y.clone());
        let told = self.motion.contact_states(start, &y)?;
        self.sampler.stretch((start, self.end, 2), |_| y.clone(), |_, _| told.clone());
        Ok(())
    }

    /// The modes after a pause, in which the drive may have `changed`.
    pub fn wake(&mut self, changed: bool) -> Result<(), SimError> {
        if self.leap.is_some() {
            return Ok(());
        }
        if changed && !self.motion.stepping && !self.motion.moves_freely() {
            let before = self.y.clone();
            self.measure();
            return self.resettle(None, &[], &before);
        }
        if changed {
            self.memory.resting = false;
        } else if self.memory.resting && self.is_steady() {
            return self.stay();
        }
        Ok(())
    }

    /// The lasting contacts now.
    pub fn contacts(&mut self) -> Result<Vec<ContactState>, SimError> {
        if self.motion.stepping { Ok(self.stepped.clone()) } else { self.motion.contact_states(self.time, &self.y) }
    }

    /// The results so far, with the energy balance from a start with this energy.
    pub fn summary(&mut self, start: f64, stop: StopReason) -> Result<Summary, SimError> {
        let (contacts, energy, (q, qd)) = (self.contacts()?, self.books(start)?, self.q_qd());
        Ok(Summary {
            last: Moment { time: self.time, q, qd },
            mode: self.motion.mode(),
            contacts,
            stop,
            events: self.memory.events,
            statistics: self.statistics,
            energy,
        })
    }

    /// The energy balance from a start with this energy.
    pub fn books(&mut self, start: f64) -> Result<EnergyBooks, SimError> {
        let end = self.motion.energy(&self.y)?;
        let work = self.motion.sim.chain.nq() + self.motion.sim.chain.nv();
        Ok(EnergyBooks { start, end, drive: self.y[work], resistance: self.y[work + 1], impacts: self.lost })
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
