//! Derivatives of a whole run by its initial state and by parameters.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | S⁻, S⁺ | n×k | derivatives before and after an event | – |
//! | w | 1 | the guard that fired | – |
//! | τ′ | k | derivatives of the time of the event | `time_by` |
//! | E | – | what an event does: (t, x) before it to (t, x) after it | `crossing.rs` |
//! | Ξ | n⁺×n | saltation matrix: S⁺ = Ξ S⁻ + the columns of the parameters | [`LinearEvent`] |
//!
//! Between events S follows the variational equations (`variation.rs`). An event at w(t, x) = 0 has
//! τ′ = −(∂w S⁻ + ∂ₚw)/ẇ. For a change of the j-th quantity by δ the event takes place at t + τ′ⱼδ in the state
//! x + (S⁻ⱼ + f⁻τ′ⱼ)δ, from which it leads to E. So
//!
//! ```text
//! S⁺ⱼ = dE/dδ − f⁺ dt⁺/dδ
//! ```
//!
//! where t⁺ is the time after the event, which differs from t at the end of an accumulation of impacts. With S⁻ = 1 this is the
//! saltation matrix (Aizerman & Gantmacher 1958; Leine & Nijmeijer 2004, section 7) of every event, whatever it consists of: an impact,
//! the impact of several contacts, the beginning and the end of a contact, slip that stops. Of the impact of one touch that opens again
//! dE/dδ has a closed form; otherwise it is a central difference of fourth order of the program that computes the event, from states that
//! are on the constraints and on w = 0.
//!
//! The run is a product of these linear maps: [`LinearRun`] applies them to changes of the start and the parameters, or their transposes,
//! last one first, to the derivatives of a number by the outcome (the adjoint method). [`Sensitivity`] applies them to all changes at once.
//!
//! **Where there is no derivative** the events of neighbouring motions are others, and E has a kink or a jump: it is compared
//! with its own second differences, and the modes after the event must be the same.

use super::changed::{AT, Base, Changed, DIFFERENCE, Others, WEIGHTS, silent};
use super::crossing::{After, Before, Struck, WIDE, jump, normal, outcome, rate, value};
use super::guard::Ending;
use super::guard::Is;
use super::linear_run::{AllColumns, EventTime, LinearEvent, LinearRun, Maps, Piece, Pieces};
use super::run_state::Run;
use super::sampler::Step;
use super::trajectory::{EventKind, Sampling, Seen};
use super::variation::{LinearStep, left_inverse};
use crate::error::SimError;
use crate::model::{Parameter, Place, Simulation};
use crate::motion::{ActiveSet, Dry, Lasting};
use crate::plan::Plan;
use crate::state::{EXACT, Moment, Space};
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

/// Where the outcome of a run is not differentiable.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Broken {
    /// Time, s.
    pub time: f64,
    /// Why.
    pub reason: String,
}

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
    Ok(Sensitivity { names, last: end.last, last_by, events, broken: end.broken })
}

fn linear(
    simulation: &Simulation,
    flat: Option<&PlanarChain>,
    start: (&[f64], &[f64]),
    duration: f64,
    parameters: &[Parameter],
) -> Result<LinearRun, SimError> {
    let mut pieces = Pieces::new(AllColumns::new(2 * simulation.chain.nv(), parameters.len()));
    let end = differentiate(simulation, flat, (start, duration), parameters, &mut pieces)?;
    if let Some(Broken { time, reason }) = end.broken {
        return Err(SimError::NoDerivative { time, reason });
    }
    Ok(LinearRun::new(names(simulation, parameters), parameters.len(), end.last, pieces, end.tangent))
}

/// The end of a run that was differentiated.
struct End {
    last: Moment,
    /// From x to the final displacement and velocity, 2nv×n.
    tangent: DMatrix<f64>,
    broken: Option<Broken>,
}

fn differentiate(
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
struct Follow<'a, 'w, A: Space> {
    run: Run<'a, 'w, A>,
    /// The same simulation, for states beside that of the run.
    probe: Run<'a, 'w, A>,
    changed: Vec<Changed<'a, 'w, A>>,
    kinds: &'a RefCell<Vec<Noted>>,
}

/// The name of an event, and the touch of the impact of one touch.
struct Noted {
    kind: &'static str,
    touch: Option<usize>,
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

fn follow<A: Space>(
    base: Base<A>,
    model_of: fn(&Simulation) -> Option<A::Model>,
    duration: f64,
    parameters: &[Parameter],
    each: &mut dyn Maps,
) -> Result<End, SimError> {
    let (sim, model, start) = base;
    let others: Vec<Others<A>> = parameters.iter().map(|_| Others::<A>::new()).collect();
    let kinds = RefCell::new(Vec::new());
    let mut note = |seen: Seen| {
        if let Seen::Event(event) = seen {
            let touch = match event.kind {
                EventKind::Impact { touch, .. } | EventKind::Limit { touch, .. } => Some(touch),
                _ => None,
            };
            kinds.borrow_mut().push(Noted { kind: event.kind.name(), touch });
        }
    };
    let run = Run::<A>::at_start(sim, model, start, Sampling::default(), &mut note)?;
    let probe = Run::<A>::at_start(sim, model, start, Sampling::default(), silent())?;
    let changed =
        parameters.iter().zip(&others).map(|(parameter, others)| Changed::new(parameter, base, model_of, others));
    let changed = changed.collect::<Result<_, _>>()?;
    let mut follow = Follow { run, probe, changed, kinds: &kinds };
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
    Ok(End { last: Moment { time: follow.run.time, q, qd }, tangent, broken })
}

/// The names of the columns.
fn names(sim: &Simulation, parameters: &[Parameter]) -> Vec<String> {
    let mut names = sim.state_names();
    names.extend(parameters.iter().map(|parameter| parameter.name().to_owned()));
    names
}

impl<A: Space> Follow<'_, '_, A> {
    fn broken<T>(&self, time: f64, reason: &str) -> Result<T, Stop> {
        let kinds: Vec<&str> = self.kinds.borrow().iter().map(|noted| noted.kind).collect();
        let told = if kinds.is_empty() { String::new() } else { format!("{}: ", kinds.join(", ")) };
        Err(Stop::Broken(Broken { time, reason: told + reason }))
    }

    /// The whole run.
    fn whole(&mut self, end: f64, each: &mut dyn Maps) -> Result<(), Stop> {
        let time = self.run.time;
        (self.run.end, self.run.history.follows_slips) = (end, true);
        self.run.begin()?;
        if self.kinds.borrow().iter().any(|noted| IMPACTS.contains(&noted.kind)) {
            return self.broken(time, "it begins with an impact, and neighbouring starts begin before or after it");
        }
        self.kinds.borrow_mut().clear();
        let x = self.run.x();
        let active = self.run.motion.active.clone();
        let start = self.neighbours(time, &x, &active)?.columns(0, 2 * self.run.motion.sim.chain.nv()).into_owned();
        each.add(Piece::Start(start));
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
        let mut active = self.run.motion.active.clone();
        self.run.sampler.path = Some(Vec::new());
        let ending = self.run.leg()?;
        let path: Vec<Step> = self.run.sampler.path.take().unwrap_or_default();
        self.probe.motion.active = active.clone();
        for step in &path {
            let linear = LinearStep::of(step, &mut self.probe, &mut self.changed)?;
            let failed =
                || SimError::Integration { time: step.start, reason: "the variational equations are singular".into() };
            each.add(Piece::Step(linear)).ok_or_else(failed)?;
            active = self.probe.motion.active.clone(); // with the last direction of slip
        }
        match ending {
            Ending::Passed => Ok(self.run.act(ending)?),
            Ending::Stuck(_) => {
                let time = self.run.time;
                self.run.act(ending)?;
                self.broken(time, "the mode cannot be continued, and the motion jumps or is computed by time steps")
            }
            Ending::Kink | Ending::Fired(_) => {
                let event = self.event(ending, &active, each)?;
                each.add(Piece::Event(event));
                Ok(())
            }
        }
    }

    /// Ξ, τ′, and what the parameters add.
    fn event(&mut self, ending: Ending, active: &ActiveSet, each: &mut dyn Maps) -> Result<LinearEvent, Stop> {
        let (time, x) = (self.run.time, self.run.x());
        let f = self.probe.field(time, &x)?;
        let guard = if let Ending::Fired(guard) = ending { Some(guard) } else { None };
        let pace = self.pace(&x);
        let rate = match guard {
            Some(guard) => rate(&mut self.probe, guard, (time, &x), (&f, DIFFERENCE / pace))?,
            None => 1.0,
        };
        let (history, active) = (self.run.history.clone(), active.clone());
        let mut before =
            Before { time, x: DVector::from_vec(x), f, ending, guard, rate, normal: None, active, history };
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
        let closed = match self.struck_alone(&before, &after) {
            Some(touch) => jump(&mut self.probe, touch, &before)?.map(|by| (touch, by)),
            None => None,
        };
        let is_closed =
            |changed: &Changed<A>| closed.is_some() && !matches!(changed.parameter.place(), Place::Anywhere);
        let mut middle = None;
        if closed.is_none() || !self.changed.iter().all(is_closed) {
            self.probe.motion.active = before.active.clone();
            if let Some(guard) = guard.filter(|guard| guard.is() == Is::Gap) {
                before.normal = normal(&mut self.probe, guard, time, before.x.as_slice())?;
            }
            let at = (time, before.x.as_slice());
            middle = Some(outcome(&mut self.probe, &before, &after.active, at, self.run.end)?.0);
        }
        let middle = middle.unwrap_or_default();
        let tangent = self.probe.tangent(before.x.as_slice());
        let inverse = left_inverse(&tangent);
        // In closed form along all directions; otherwise along those in which changes of start and parameters lead, each as far as the
        // others: beside them the constraints and the modes of the motion need not hold.
        let (basis, coordinates) = match &closed {
            Some(_) => (tangent, inverse.clone()),
            None => directions(each.columns().unwrap_or(tangent)),
        };
        let mut map = DMatrix::zeros(after.x.len(), basis.ncols());
        let mut time_by = DVector::zeros(basis.ncols());
        for (j, own) in basis.column_iter().enumerate() {
            let own = own.into_owned();
            let column = match &closed {
                Some((_, by)) => {
                    time_by[j] = by.gap.get(j).map_or(0.0, |slope| -slope / rate);
                    struck((own, time_by[j]), by, &inverse, (&before, &after))
                }
                None => {
                    time_by[j] = self.time_by(&own, None, &before)?;
                    self.column_after((own, time_by[j]), None, &before, (&after, &middle))?
                }
            };
            map.set_column(j, &column);
        }
        let parameters = self.changed.len();
        let mut push = DMatrix::zeros(after.x.len(), parameters);
        let mut time_push = DVector::zeros(parameters);
        for p in 0..parameters {
            if let Some((touch, by)) = closed.as_ref().filter(|_| is_closed(&self.changed[p])) {
                let (sim, parameter) = (self.run.motion.sim, self.changed[p].parameter);
                if parameter.is_of(&sim.touches[*touch]) {
                    push.view_mut((sim.chain.nq(), p), (sim.chain.nv(), 1))
                        .copy_from(by.coefficient(parameter.place()));
                }
                continue;
            }
            let none = DVector::zeros(before.x.len());
            time_push[p] = self.time_by(&none, Some(p), &before)?;
            push.set_column(p, &self.column_after((none, time_push[p]), Some(p), &before, (&after, &middle))?);
        }
        Ok(LinearEvent {
            time,
            kinds: self.kinds.borrow_mut().drain(..).map(|noted| noted.kind).collect(),
            map: map * &coordinates,
            push,
            time_by: coordinates.tr_mul(&time_by),
            time_push,
            counts: is_force || rate.abs() > FAINT * pace,
        })
    }

    /// The touch of an event that is its impact and nothing else, whose derivative has a closed form.
    fn struck_alone(&self, before: &Before, after: &After) -> Option<usize> {
        let sim = self.run.motion.sim;
        let kinds = self.kinds.borrow();
        let [Noted { touch: Some(touch), .. }] = kinds.as_slice() else { return None };
        let gap = before.guard.is_some_and(|guard| guard.is() == Is::Gap);
        let free = !before.active.lasting.iter().any(Lasting::is_rigid)
            && !before.active.dry.iter().any(|joint| joint.state == Dry::Holds);
        let same = before.active.is_alike(&after.active) && before.x.len() == after.x.len();
        (gap && free && same && sim.loops.is_empty() && sim.neglect.is_none() && after.time == before.time)
            .then_some(*touch)
    }

    /// τ′ of a change of x, or of a parameter.
    fn time_by(&mut self, own: &DVector<f64>, parameter: Option<usize>, before: &Before) -> Result<f64, Stop> {
        let Some(guard) = before.guard else { return Ok(0.0) };
        // Guards are smooth, so a larger step has less rounding.
        let wide = WIDE / own.amax().max(1.0);
        let mut slope = 0.0;
        for (k, (times, weight)) in AT.iter().zip(WEIGHTS).enumerate() {
            let (run, beside, step) = match parameter {
                Some(p) => {
                    let by = self.changed[p].by;
                    (&mut self.changed[p].runs(&before.active)?[k], before.x.clone(), by)
                }
                None => (&mut self.probe, &before.x + own * (times * wide), wide),
            };
            run.motion.active.clone_from(&before.active);
            slope += weight / step * value(run, guard, before.time, beside.as_slice())?.value;
        }
        Ok(-slope / before.rate)
    }

    /// What a change of x, or of a parameter, becomes by the event. `middle`: the outcome without a change.
    fn column_after(
        &mut self,
        (own, time_by): (DVector<f64>, f64),
        parameter: Option<usize>,
        before: &Before,
        (after, middle): (&After, &DVector<f64>),
    ) -> Result<DVector<f64>, Stop> {
        let mut h = parameter.map_or_else(|| DIFFERENCE / own.amax().max(1.0), |p| self.changed[p].by);
        let along = own + &before.f * time_by;
        h *= self.share(before, &along, h)?;
        let end = self.run.end;
        let mut found = Vec::with_capacity(AT.len());
        for (k, times) in AT.iter().enumerate() {
            let run = match parameter {
                Some(p) => &mut self.changed[p].runs(&before.active)?[k],
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
}

/// The directions of the columns of S, of which none counts as longer than one, by their singular values, the largest of size one; and the
/// matrix of the coordinates of x along them.
fn directions(mut s: DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    s.column_iter_mut().for_each(|mut column| column /= column.amax().max(1.0));
    let svd = s.svd(true, false);
    let sizes = &svd.singular_values;
    let u = svd.u.unwrap_or_default();
    let most = sizes.max();
    let kept: Vec<usize> = (0..sizes.len()).filter(|&i| sizes[i] > EXACT * most).collect();
    let share = |i: usize| sizes[i] / most;
    let basis = DMatrix::from_fn(u.nrows(), kept.len(), |r, i| u[(r, kept[i])] * share(kept[i]));
    let coordinates = DMatrix::from_fn(kept.len(), u.nrows(), |i, r| u[(r, kept[i])] / share(kept[i]));
    (basis, coordinates)
}

/// What a change of x, with the time of the event that it has, becomes by an impact with these derivatives.
fn struck(
    (own, time_by): (DVector<f64>, f64),
    Struck { jumped: by, .. }: &Struck,
    inverse: &DMatrix<f64>,
    (before, after): (&Before, &After),
) -> DVector<f64> {
    let along = own + &before.f * time_by;
    let nv = by.qd.ncols();
    let moved = inverse * &along;
    let mut jumped = &by.q * moved.rows(0, nv) + &by.qd * moved.rows(nv, nv);
    if let Some(time) = &by.time {
        jumped += time * time_by;
    }
    let nq = along.len() - (moved.len() - nv);
    let mut out = along;
    out.rows_mut(nq, nv).copy_from(&jumped);
    out - &after.f * time_by
}

/// The kinds of events that are impacts.
const IMPACTS: [&str; 4] = ["impact", "several", "limit", "latch"];
