//! Derivatives of a whole run by its initial state and by parameters.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | S⁻, S⁺ | n×k | derivatives before and after an event | `s` |
//! | w | 1 | the guard that fired | – |
//! | τ′ | k | derivatives of the time of the event | `time_by` |
//! | E | – | what an event does: (t, x) before it to (t, x) after it | `crossing.rs` |
//!
//! Between events S follows the variational equations (`variation.rs`). An event at w(t, x) = 0 has
//! τ′ = −(∂w S⁻ + ∂ₚw)/ẇ. For a change of the j-th quantity by δ the event takes place at t + τ′ⱼδ in the state
//! x + (S⁻ⱼ + f⁻τ′ⱼ)δ, from which it leads to E. So
//!
//! ```text
//! S⁺ⱼ = dE/dδ − f⁺ dt⁺/dδ
//! ```
//!
//! where t⁺ is the time after the event, which differs from t at the end of an accumulation of impacts. This is the saltation
//! matrix (Aizerman & Gantmacher 1958; Leine & Nijmeijer 2004, section 7) of every event, whatever it consists of: an impact, the
//! impact of several contacts, the beginning and the end of a contact, slip that stops. dE/dδ is a central difference of fourth
//! order of the program that computes the event, from states that are on the constraints and on w = 0.
//!
//! **Where there is no derivative** the events of neighbouring motions are others, and E has a kink or a jump: it is compared
//! with its own second differences, and the modes after the event must be the same.

use super::crossing::{After, Before, WIDE, normal, outcome, rate, value};
use super::guard::Ending;
use super::guard::Is;
use super::run_state::Run;
use super::sampler::Step;
use super::trajectory::{Sampling, Seen};
use super::variation::{Gauss, left_inverse, over_step};
use crate::error::SimError;
use crate::model::{Parameter, Simulation};
use crate::motion::ActiveSet;
use crate::plan::Plan;
use crate::state::{Moment, Space};
use carom_chain::{Coordinates, Planar, PlanarChain, Spatial};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::cell::RefCell;

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
    /// The times of the events that have derivatives.
    pub events: Vec<EventTime>,
    /// Where and why the derivatives end, if they do.
    pub broken: Option<Broken>,
}

/// The time of an event, and its derivatives. Serde leaves out derivatives whose digits do not count.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventTime {
    /// Time, s.
    pub time: f64,
    /// Names of what happens ([`EventKind::name`](crate::EventKind::name)).
    pub kinds: Vec<&'static str>,
    /// Derivatives by the columns of [`Sensitivity`]; not numbers for impacts so slow that their digits do not count: the last ones before
    /// an accumulation. Their effect on the motion is part of the other derivatives all the same.
    #[serde(skip_serializing_if = "uncounted")]
    pub time_by: Vec<f64>,
}

fn uncounted(numbers: &[f64]) -> bool {
    !numbers.iter().all(|x| x.is_finite())
}

/// Where the outcome of a run is not differentiable.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Broken {
    /// Time, s.
    pub time: f64,
    /// Why.
    pub reason: String,
}

/// Step of the central differences of events, for a column of size one.
const DIFFERENCE: f64 = 1e-5;
/// An event whose guard changes by less than this in the time in which the state changes by its own size is a grazing
/// one.
const GRAZING: f64 = 1e-7;
/// An event whose guard changes by less than this in that time has no derivative of its time that is told: the error of S,
/// about 1e-8, is divided by this rate.
const FAINT: f64 = 1e-3;
/// The share of its approach speed by which an impact may be slower beside the motion.
const SLOWER: f64 = 1e-2;
/// A second difference above this share of the first may be a kink.
const KINK: f64 = 0.05;

impl Simulation {
    /// Runs from `(q, qd)` for `duration` seconds, and differentiates the final state and the times of the events by the initial
    /// state and by these parameters.
    ///
    /// The derivatives are those of the motion that is computed, to about 1e-8 of their size. Those of a start in which contacts
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
        differentiate(self, self.in_plane().as_ref(), (q, qd), duration, parameters)
    }
}

impl Plan {
    /// [`Simulation::sensitivity`] of the plan from its start, in the plane that the plan has decided on.
    ///
    /// # Errors
    /// As [`Simulation::sensitivity`].
    pub fn sensitivity(&self, duration: f64, parameters: &[Parameter]) -> Result<Sensitivity, SimError> {
        differentiate(&self.simulation, self.in_plane(), (&self.q, &self.qd), duration, parameters)
    }
}

fn differentiate(
    simulation: &Simulation,
    flat: Option<&PlanarChain>,
    start: (&[f64], &[f64]),
    duration: f64,
    parameters: &[Parameter],
) -> Result<Sensitivity, SimError> {
    simulation.check(start.0, start.1, duration, None)?;
    match flat {
        Some(model) => follow::<Planar<f64>>(simulation, model, start, duration, parameters),
        None => follow::<Spatial<f64>>(simulation, &simulation.chain, start, duration, parameters),
    }
}

/// The multiples of the difference step at which an event is evaluated, and the weights of the derivative.
const AT: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
const WEIGHTS: [f64; 4] = [1.0 / 12.0, -8.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0];

/// A run with its derivatives.
struct Follow<'a, 'w, A: Space> {
    run: Run<'a, 'w, A>,
    /// The same simulation, for states beside that of the run.
    probe: Run<'a, 'w, A>,
    /// For each parameter the simulations with the parameter changed by the multiples [`AT`] of a number, and that number.
    changed: Vec<([Run<'a, 'w, A>; 4], f64)>,
    s: DMatrix<f64>,
    gauss: Gauss,
    kinds: &'a RefCell<Vec<&'static str>>,
}

/// Why a step could not be differentiated.
enum Stop {
    Broken(Broken),
    Error(SimError),
}

impl From<SimError> for Stop {
    fn from(error: SimError) -> Self {
        Self::Error(error)
    }
}

/// A callback that does nothing; it has no size, so nothing is allocated.
fn silent<'w>() -> &'w mut dyn FnMut(Seen) {
    Box::leak(Box::new(|_: Seen| {}))
}

fn follow<A: Space>(
    sim: &Simulation,
    model: &A::Model,
    start: (&[f64], &[f64]),
    duration: f64,
    parameters: &[Parameter],
) -> Result<Sensitivity, SimError> {
    let mut sims = Vec::new();
    for parameter in parameters {
        let by = 0.1 * DIFFERENCE * parameter.scale();
        let changed = AT.map(|times| parameter.apply(sim, times * by));
        if changed.iter().any(|other| other.chain != sim.chain || other.touches.len() != sim.touches.len()) {
            let rule =
                "it changes the chain or the number of possible contacts: a parameter must leave both as they are";
            return Err(SimError::Setting { what: "parameter of a sensitivity", value: by, rule });
        }
        sims.push((changed, by));
    }
    let kinds = RefCell::new(Vec::new());
    let mut note = |seen: Seen| {
        if let Seen::Event(event) = seen {
            kinds.borrow_mut().push(event.kind.name());
        }
    };
    let run = Run::<A>::at_start(sim, model, start, Sampling::default(), &mut note)?;
    let beside = |sim| Run::<A>::at_start(sim, model, start, Sampling::default(), silent());
    let probe = beside(sim)?;
    let mut changed = Vec::new();
    for (sims, by) in &sims {
        let [a, b, c, d] = sims;
        changed.push(([beside(a)?, beside(b)?, beside(c)?, beside(d)?], *by));
    }
    let s = DMatrix::zeros(0, 0);
    let mut follow = Follow { run, probe, changed, s, gauss: Gauss::new(), kinds: &kinds };
    let mut events = Vec::new();
    let end = sim.start_time + duration;
    let broken = match follow.whole(end, &mut events) {
        Ok(()) => None,
        Err(Stop::Broken(broken)) => Some(broken),
        Err(Stop::Error(SimError::Jam { time, touch, .. })) => {
            Some(Broken { time, reason: format!("{touch} comes to a jam, after which the motion jumps") })
        }
        Err(Stop::Error(error)) => return Err(error),
    };
    let last_by = if broken.is_none() { Some(follow.last_by()) } else { None };
    follow.run.until_end(false)?;
    let (q, qd) = follow.run.q_qd();
    let last = Moment { time: follow.run.time, q, qd };
    Ok(Sensitivity { names: names(sim, parameters), last, last_by, events, broken })
}

/// The names of the columns.
fn names(sim: &Simulation, parameters: &[Parameter]) -> Vec<String> {
    let nv = sim.chain.nv();
    let mut names = Vec::new();
    for what in ["q", "qd"] {
        for v in 0..nv {
            let Some(joint) = sim.chain.joint_of_velocity(v) else { continue };
            let number = match &joint.coordinates {
                Coordinates::Own { v: own, .. } if own.len() > 1 => format!(" {}", v - own.start + 1),
                _ => String::new(),
            };
            names.push(format!("{what} {}{number}", joint.name));
        }
    }
    names.extend(parameters.iter().map(|parameter| parameter.name().to_owned()));
    names
}

impl<A: Space> Follow<'_, '_, A> {
    fn broken<T>(&self, time: f64, reason: &str) -> Result<T, Stop> {
        let kinds = self.kinds.borrow();
        let told = if kinds.is_empty() { String::new() } else { format!("{}: ", kinds.join(", ")) };
        Err(Stop::Broken(Broken { time, reason: told + reason }))
    }

    /// The whole run.
    fn whole(&mut self, end: f64, events: &mut Vec<EventTime>) -> Result<(), Stop> {
        let time = self.run.time;
        (self.run.end, self.run.history.follows_slips) = (end, true);
        self.run.begin()?;
        if self.kinds.borrow().iter().any(|kind| IMPACTS.contains(kind)) {
            return self.broken(time, "it begins with an impact, and neighbouring starts begin before or after it");
        }
        self.kinds.borrow_mut().clear();
        self.at_start()?;
        while self.run.time < end {
            if self.run.motion.active.stepping {
                return self.broken(self.run.time, "time steps have no derivative");
            }
            if self.run.history.events >= self.run.motion.sim.max_events {
                return Ok(());
            }
            self.leg(events)?;
        }
        Ok(())
    }

    /// The derivatives of the start: of the states nearest to its neighbours in which the contacts that last are closed.
    fn at_start(&mut self) -> Result<(), SimError> {
        let x = self.run.x();
        let active = self.run.motion.active.clone();
        let tangent = self.run.tangent(&x);
        let moving = 2 * self.run.motion.sim.chain.nv();
        self.s = DMatrix::zeros(x.len(), moving + self.changed.len());
        let time = self.run.time;
        for j in 0..moving {
            let mut slope = DVector::zeros(x.len());
            for (times, weight) in AT.iter().zip(WEIGHTS) {
                let moved = DVector::from_column_slice(&x) + tangent.column(j) * (times * DIFFERENCE);
                let probe = &mut self.probe;
                probe.motion.active = active.clone();
                let mut y = probe.y_of(moved.as_slice());
                probe.motion.sim.normalise(&mut y);
                probe.motion.settle(time, &mut y)?;
                slope += DVector::from_vec(probe.x_of(&y, &moved.as_slice()[y.len() - 2..])) * (weight / DIFFERENCE);
            }
            self.s.set_column(j, &slope);
        }
        Ok(())
    }

    /// One leg, and the event at its end.
    fn leg(&mut self, events: &mut Vec<EventTime>) -> Result<(), Stop> {
        let mut active = self.run.motion.active.clone();
        self.run.sampler.path = Some(Vec::new());
        let ending = self.run.leg()?;
        let path: Vec<Step> = self.run.sampler.path.take().unwrap_or_default();
        self.probe.motion.active = active.clone();
        for (runs, _) in &mut self.changed {
            runs.iter_mut().for_each(|run| run.motion.active = active.clone());
        }
        for step in &path {
            self.s = over_step(&self.gauss, step, &mut self.probe, &mut self.changed, &self.s)?;
            active = self.probe.motion.active.clone(); // with the last direction of slip
        }
        match ending {
            Ending::Passed => Ok(self.run.act(ending)?),
            Ending::Stuck(_) => {
                let time = self.run.time;
                self.run.act(ending)?;
                self.broken(time, "the mode cannot be continued, and the motion jumps or is computed by time steps")
            }
            Ending::Kink | Ending::Fired(_) => self.event(ending, &active, events),
        }
    }

    /// S⁺ and τ′.
    fn event(&mut self, ending: Ending, active: &ActiveSet, events: &mut Vec<EventTime>) -> Result<(), Stop> {
        let (time, x) = (self.run.time, self.run.x());
        let f = self.probe.field(time, &x)?;
        let guard = if let Ending::Fired(guard) = ending { Some(guard) } else { None };
        let pace = self.pace(&x);
        let rate = match guard {
            Some(guard) => rate(&mut self.probe, guard, (time, &x), (&f, DIFFERENCE / pace))?,
            None => 1.0,
        };
        let normal = match guard {
            Some(guard) if guard.is() == Is::Gap => normal(&mut self.probe, guard, time, &x)?,
            _ => None,
        };
        let (history, active) = (self.run.history.clone(), active.clone());
        let before = Before { time, x: DVector::from_vec(x), f, ending, guard, rate, normal, active, history };
        self.run.act(ending)?;
        if self.run.motion.active.stepping {
            return self.broken(time, "time steps begin, which have no derivative");
        }
        let is_force = guard.is_some_and(|guard| guard.is() == Is::Force);
        if rate == 0.0 || !is_force && rate.abs() <= GRAZING * pace {
            return self.broken(time, "it grazes: a neighbouring motion may miss this event");
        }
        let (x, time_after) = (DVector::from_vec(self.run.x()), self.run.time);
        let rests = time_after >= self.run.end;
        let f = if rests { DVector::zeros(x.len()) } else { self.run.field(time_after, x.as_slice())? };
        let after = After { time: time_after, x, f, active: self.run.motion.active.clone() };
        let (middle, _) = outcome(&mut self.probe, &before, &after.active, (time, before.x.as_slice()), self.run.end)?;
        let mut s = DMatrix::zeros(after.x.len(), self.s.ncols());
        let mut time_by = Vec::with_capacity(s.ncols());
        for j in 0..s.ncols() {
            time_by.push(self.time_by(j, &before)?);
            s.set_column(j, &self.column_after(j, time_by[j], &before, (&after, &middle))?);
        }
        self.s = s;
        if !is_force && rate.abs() <= FAINT * pace {
            time_by.fill(f64::NAN);
        }
        let kinds = std::mem::take(&mut *self.kinds.borrow_mut());
        if !kinds.is_empty() {
            events.push(EventTime { time, kinds, time_by });
        }
        Ok(())
    }

    /// The number of the parameter of a column of S, if it is that of one.
    fn parameter(&self, j: usize) -> Option<usize> {
        j.checked_sub(self.s.ncols() - self.changed.len())
    }

    /// τ′ⱼ.
    fn time_by(&mut self, j: usize, before: &Before) -> Result<f64, Stop> {
        let Some(guard) = before.guard else { return Ok(0.0) };
        let own = self.s.column(j).into_owned();
        // GuardValue functions are smooth, so a larger step has less rounding.
        let wide = WIDE / own.amax().max(1.0);
        let parameter = self.parameter(j);
        let mut slope = 0.0;
        for (k, (times, weight)) in AT.iter().zip(WEIGHTS).enumerate() {
            self.probe.motion.active = before.active.clone();
            let beside = &before.x + &own * (times * wide);
            slope += weight / wide * value(&mut self.probe, guard, before.time, beside.as_slice())?.value;
            if let Some(p) = parameter {
                let (runs, by) = &mut self.changed[p];
                runs[k].motion.active = before.active.clone();
                slope += weight / *by * value(&mut runs[k], guard, before.time, before.x.as_slice())?.value;
            }
        }
        Ok(-slope / before.rate)
    }

    /// S⁺ⱼ. `middle`: the outcome without a change.
    fn column_after(
        &mut self,
        j: usize,
        time_by: f64,
        before: &Before,
        (after, middle): (&After, &DVector<f64>),
    ) -> Result<DVector<f64>, Stop> {
        let own = self.s.column(j).into_owned();
        let parameter = self.parameter(j);
        let mut h = parameter.map_or_else(|| DIFFERENCE / own.amax().max(1.0), |p| self.changed[p].1);
        let along = own + &before.f * time_by;
        h *= self.share(before, &along, h)?;
        let end = self.run.end;
        let mut found = Vec::with_capacity(AT.len());
        for (k, times) in AT.iter().enumerate() {
            let run = match parameter {
                Some(p) => &mut self.changed[p].0[k],
                None => &mut self.probe,
            };
            let beside = &before.x + &along * (times * h);
            let at = (before.time + times * h * time_by, beside.as_slice());
            match outcome(run, before, &after.active, at, end) {
                Ok(outcome) if run.motion.active.is_alike(&after.active) => found.push(outcome),
                Ok(_) | Err(SimError::Overlap { .. }) => {
                    return self
                        .broken(before.time, "a neighbouring motion goes on in another mode or order of events");
                }
                Err(error) => return Err(error.into()),
            }
        }
        let mut moved = DVector::zeros(after.x.len());
        let mut later = 0.0;
        for ((there, time), weight) in found.iter().zip(WEIGHTS) {
            moved += there * (weight / h);
            later += (time - after.time) * (weight / h);
        }
        // Of a smooth outcome the second differences at one and two steps are as 1 : 4, at a kink as 1 : 2, at a jump as 1 : 1.
        let bends = [1, 0].map(|k| (&found[k].0 + &found[3 - k].0 - middle * 2.0).amax() / h);
        if bends[0] > KINK * moved.amax().max(1.0) && bends[1] < 3.0 * bends[0] {
            return self
                .broken(before.time, "neighbouring motions have other events at the same time, in another order");
        }
        Ok(moved - &after.f * later)
    }

    /// By what the step `h` is too long: the approach speed of a slow impact changes by as much as itself within a small change of
    /// the state, and the outcome is not smooth beyond that.
    fn share(&mut self, before: &Before, along: &DVector<f64>, h: f64) -> Result<f64, Stop> {
        let Before { guard: Some(guard), normal: Some(_), time, .. } = *before else { return Ok(1.0) };
        self.probe.motion.active = before.active.clone();
        let beside = &before.x + along * h;
        let there = rate(&mut self.probe, guard, (time, beside.as_slice()), (&before.f, DIFFERENCE))?;
        Ok((SLOWER * before.rate.abs() / (there - before.rate).abs()).min(1.0))
    }

    /// The largest velocity, 1/s: the reciprocal of the time in which the state changes by its own size.
    fn pace(&self, x: &[f64]) -> f64 {
        let (nq, nv) = (self.run.motion.sim.chain.nq(), self.run.motion.sim.chain.nv());
        x[nq..nq + nv].iter().fold(1.0, |most: f64, v| most.max(v.abs()))
    }

    fn last_by(&mut self) -> DMatrix<f64> {
        let x = self.run.x();
        let moving = 2 * self.run.motion.sim.chain.nv();
        let tangent = self.run.tangent(&x);
        let own = if tangent.is_square() { self.s.clone() } else { left_inverse(&tangent) * &self.s };
        own.rows(0, moving).into_owned()
    }
}

/// The kinds of events that are impacts.
const IMPACTS: [&str; 4] = ["impact", "several", "limit", "latch"];
