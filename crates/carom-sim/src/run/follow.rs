//! A run with its derivatives: from event to event, one linear map for each step of the motion and each event.
//!
//! Between events S follows the variational equations (`variation.rs`); an event is linearised in `event_derivative.rs`.

use super::changed::{AT, Base, Changed, DIFFERENCE, Others, WEIGHTS, silent};
use super::guard::Ending;
use super::linear_run::{LinearEvent, Maps, MovedKink, Piece};
use super::run_state::Run;
use super::trajectory::{Event, Sampling, Seen, Step};
use super::variation::{LinearStep, left_inverse};
use crate::error::SimError;
use crate::model::{Parameter, Place, Simulation};
use crate::motion::{ActiveSet, Dry, Lasting};
use crate::state::{Moment, ROUNDING, Space};
use carom_chain::{Planar, PlanarChain, Spatial};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::cell::RefCell;

/// Where the outcome of a run is not differentiable.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Broken {
    /// Time, s.
    pub time: f64,
    /// Why.
    pub reason: String,
}

/// The end of a run that was differentiated.
pub(super) struct End {
    pub(super) last: Moment,
    /// From x to the final displacement and velocity, 2nv×n.
    pub(super) tangent: DMatrix<f64>,
    /// The rate of the final displacement and velocity.
    pub(super) rate: Vec<f64>,
    pub(super) broken: Option<Broken>,
}

pub(super) fn differentiate(
    simulation: &Simulation,
    flat: Option<&PlanarChain>,
    (start, duration): ((&[f64], &[f64]), f64),
    parameters: &[Parameter],
    each: &mut dyn Maps,
) -> Result<End, SimError> {
    simulation.check(start.0, start.1, duration, None)?;
    match flat {
        Some(model) => {
            follow::<Planar<f64>>((simulation, model, start), Simulation::in_plane, duration, parameters, each)
        }
        None => {
            let chain = |other: &Simulation| Some(other.chain.clone());
            follow::<Spatial<f64>>((simulation, &simulation.chain, start), chain, duration, parameters, each)
        }
    }
}

/// A run with its derivatives.
pub(super) struct Follow<'a, 'w, A: Space> {
    pub(super) run: Run<'a, 'w, A>,
    /// The same simulation, for states beside that of the run.
    pub(super) probe: Run<'a, 'w, A>,
    pub(super) changed: Vec<Changed<'a, 'w, A>>,
    /// What happened since the last linear map of an event.
    pub(super) happened: &'a RefCell<Vec<Event>>,
}

/// Why a step could not be differentiated.
pub(super) enum Stop {
    Broken(Broken),
    Error(SimError),
}

impl From<SimError> for Stop {
    fn from(error: SimError) -> Self {
        Self::Error(error)
    }
}

fn follow<A: Space>(
    base: Base<A>,
    model_of: fn(&Simulation) -> Option<A::Model>,
    duration: f64,
    parameters: &[Parameter],
    each: &mut dyn Maps,
) -> Result<End, SimError> {
    let (sim, model, start) = base;
    let others: Vec<Others<A>> = parameters.iter().map(|_| Others::<A>::default()).collect();
    let happened = RefCell::new(Vec::new());
    let mut note = |seen: Seen| {
        if let Seen::Event(event) = seen {
            happened.borrow_mut().push(event.clone());
        }
    };
    let run = Run::<A>::at_start(sim, model, start, Sampling::default(), &mut note)?;
    let probe = Run::<A>::at_start(sim, model, start, Sampling::default(), silent())?;
    let changed =
        parameters.iter().zip(&others).map(|(parameter, others)| Changed::new(parameter, base, model_of, others));
    let changed = changed.collect::<Result<_, _>>()?;
    let mut follow = Follow { run, probe, changed, happened: &happened };
    let end = sim.start_time + duration;
    let broken = match follow.whole(end, each) {
        Ok(()) => None,
        Err(Stop::Broken(broken)) => Some(broken),
        Err(Stop::Error(SimError::Jam { time, touch, .. })) => {
            Some(Broken { time, reason: format!("{touch} comes to a jam, after which the motion jumps") })
        }
        Err(Stop::Error(error)) => return Err(error),
    };
    let x = follow.run.x();
    let moving = 2 * sim.chain.nv();
    let tangent = left_inverse(&follow.run.tangent(&x)).rows(0, moving).into_owned();
    follow.run.until_end(false)?;
    let (q, qd) = follow.run.q_qd();
    let mut rate = vec![0.0; moving];
    if !follow.run.motion.active.stepping && !follow.run.history.resting {
        let x = follow.run.x();
        let f = follow.run.field(follow.run.time, &x)?;
        rate.copy_from_slice((left_inverse(&follow.run.tangent(&x)).rows(0, moving) * f).as_slice());
    }
    Ok(End { last: Moment { time: follow.run.time, q, qd }, tangent, rate, broken })
}

impl<A: Space> Follow<'_, '_, A> {
    pub(super) fn broken<T>(&self, time: f64, reason: &str) -> Result<T, Stop> {
        let kinds: Vec<&str> = self.happened.borrow().iter().map(|event| event.kind.name()).collect();
        let told = if kinds.is_empty() { String::new() } else { format!("{}: ", kinds.join(", ")) };
        Err(Stop::Broken(Broken { time, reason: told + reason }))
    }

    /// The whole run.
    fn whole(&mut self, end: f64, each: &mut dyn Maps) -> Result<(), Stop> {
        let time = self.run.time;
        (self.run.end, self.run.history.follows_slips) = (end, true);
        self.run.begin()?;
        if self.happened.borrow().iter().any(|event| event.kind.is_impact()) {
            return self.broken(time, "it begins with an impact, and neighbouring starts begin before or after it");
        }
        self.happened.borrow_mut().clear();
        let x = self.run.x();
        let active = self.run.motion.active.clone();
        let start = self.neighbours(time, &x, &active)?.columns(0, 2 * self.run.motion.sim.chain.nv()).into_owned();
        each.add(Piece::Start(start));
        if !self.run.remembered().is_empty() {
            each.add(Piece::Event(self.remembering((time, &x), &active, |run| run.remember())?));
        }
        while self.run.time < end {
            if self.run.motion.active.stepping {
                return self.broken(self.run.time, "time steps have no derivative");
            }
            if self.run.history.events >= self.run.motion.sim.max_events {
                return Ok(());
            }
            self.leg(each)?;
        }
        Ok(())
    }

    /// The start, or an event that changes only what compliant contacts remember: `set` does so at x in the mode `active`.
    pub(super) fn remembering(
        &mut self,
        (time, x): (f64, &[f64]),
        active: &ActiveSet,
        set: impl Fn(&mut Run<A>) -> Result<(), SimError>,
    ) -> Result<LinearEvent, SimError> {
        let of = |run: &mut Run<A>, x: &[f64]| {
            run.motion.active.clone_from(active);
            (run.time, run.y) = (time, run.y_of(x));
            set(run)?;
            Ok(DVector::from_vec(run.remembered()))
        };
        self.probe.motion.active.clone_from(active);
        let moving = x.len() - self.probe.remembered().len();
        let count = of(&mut self.probe, x)?.len();
        let tangent = self.probe.tangent(x);
        let mut by = DMatrix::zeros(count, tangent.ncols());
        for (j, direction) in tangent.column_iter().enumerate() {
            by.set_column(j, &self.probe.difference(x, direction, f64::INFINITY, of)?);
        }
        let mut event = LinearEvent::nothing(time, x.len(), self.changed.len());
        event.map = DMatrix::identity(moving + count, x.len());
        event.map.rows_mut(moving, count).copy_from(&(by * left_inverse(&tangent)));
        event.push = DMatrix::zeros(moving + count, self.changed.len());
        for (p, changed) in self.changed.iter_mut().enumerate() {
            if !matches!(changed.parameter.place(), Place::Motor { .. }) {
                let (stencil, step, runs) = changed.runs_at(0)?;
                for (run, weight) in runs.iter_mut().zip(stencil.weights) {
                    let mut rows = event.push.view_mut((moving, p), (count, 1));
                    rows += of(run, x)? * (weight / step);
                }
            }
        }
        Ok(event)
    }

    /// The directions in which x can change: those of the nearest states in which the contacts of the mode are closed, its held joints
    /// rest and the loops are closed.
    fn neighbours(&mut self, time: f64, x: &[f64], active: &ActiveSet) -> Result<DMatrix<f64>, SimError> {
        let mut tangent = self.probe.tangent(x);
        let bound = active.lasting.iter().any(Lasting::is_rigid)
            || active.dry.iter().any(|joint| joint.state == Dry::Holds)
            || !self.probe.motion.couplings.is_empty();
        if !bound {
            return Ok(tangent);
        }
        for mut column in tangent.column_iter_mut().take(2 * self.run.motion.sim.chain.nv()) {
            let mut slope = DVector::zeros(x.len());
            for (times, weight) in AT.iter().zip(WEIGHTS) {
                let moved = DVector::from_column_slice(x) + &column * (times * DIFFERENCE);
                let probe = &mut self.probe;
                probe.motion.active = active.clone();
                let mut y = probe.y_of(moved.as_slice());
                probe.motion.sim.normalise(&mut y);
                probe.motion.settle(time, &mut y)?;
                slope += DVector::from_vec(probe.x_of(&y, &moved.as_slice()[y.len() - 2..])) * (weight / DIFFERENCE);
            }
            column.copy_from(&slope);
        }
        Ok(tangent)
    }

    /// One leg, and the event at its end.
    fn leg(&mut self, each: &mut dyn Maps) -> Result<(), Stop> {
        let (start, mut active) = (self.run.time, self.run.motion.active.clone());
        self.run.sampler.path = Some(Vec::new());
        let ending = self.run.leg()?;
        let path: Vec<Step> = self.run.sampler.path.take().unwrap_or_default();
        self.probe.motion.active = active.clone();
        for step in &path {
            let linear = LinearStep::of(step, &mut self.probe, &mut self.changed)?;
            let failed =
                || SimError::Integration { time: step.start, reason: "the variational equations are singular".into() };
            let after = self.probe.motion.active.clone(); // with the last direction of slip
            each.step(step, active.impacts.iter().sum(), &mut || {
                let points = Step::POINTS.map(|c| step.start + (step.end - step.start) * c);
                let states = std::iter::once(&step.before).chain(&step.states);
                let at = |(time, y): (f64, &Vec<f64>)| {
                    let memory = self.probe.remembered();
                    self.neighbours(time, &self.probe.x_of(y, &memory), &active)
                };
                std::iter::once(step.start).chain(points).zip(states).map(at).collect()
            })?;
            each.add(Piece::Step(linear)).ok_or_else(failed)?;
            self.probe.motion.active = after.clone();
            active = after;
        }
        let moved = self.moved_kink(start, ending)?;
        let mut event = match ending {
            Ending::Passed => {
                self.run.act(ending)?;
                None
            }
            Ending::Stuck(_) => {
                let time = self.run.time;
                self.run.act(ending)?;
                return self
                    .broken(time, "the mode cannot be continued, and the motion jumps or is computed by time steps");
            }
            Ending::Kink | Ending::Fired(_) => self.event(ending, &active, each)?,
        };
        if let Some(moved) = moved {
            let (time, x) = (self.run.time, self.run.x());
            let after = self.run.field(time, &x)?;
            let nothing = || LinearEvent::nothing(time, moved.before.len(), self.changed.len());
            event.get_or_insert_with(nothing).later(&moved, after);
        }
        if let Some(event) = event {
            each.add(Piece::Event(event));
        }
        Ok(())
    }

    /// By how much each parameter moves the jump of forces or surfaces at which a leg ended that began at this time; `None` if none does, or
    /// at no jump.
    fn moved_kink(&mut self, start: f64, ending: Ending) -> Result<Option<MovedKink>, SimError> {
        let time = self.run.time;
        let next = |run: &Run<A>, from: f64| run.motion.sim.next_kink(&run.motion.moving, from);
        if !matches!(ending, Ending::Passed | Ending::Kink) || next(&self.run, start) != time {
            return Ok(None);
        }
        // The jump before may be moved, too.
        let middle = 0.5 * (start + time);
        let mut by = DVector::zeros(self.changed.len());
        for (p, changed) in self.changed.iter_mut().enumerate() {
            if matches!(changed.parameter.place(), Place::Anywhere) {
                let (stencil, step, runs) = changed.runs_at(0)?;
                let moved = runs.iter().zip(stencil.weights).map(|(run, weight)| weight * (next(run, middle) - time));
                let moved: f64 = moved.sum();
                if moved.abs() > ROUNDING * time.abs() {
                    by[p] = moved / step;
                }
            }
        }
        if by.amax() == 0.0 {
            return Ok(None);
        }
        let x = self.run.x();
        Ok(Some(MovedKink { by, before: self.run.field(time.next_down(), &x)? }))
    }
}
