//! The event loop: smooth legs of motion, and exact events between them.
//!
//! Between events every closed contact has a mode: it slides, sticks, is held by a latch, or presses (a compliant contact).
//! All rigid ones are constraints, solved together (`motion/held.rs`). A leg ends when a gap closes, when a normal force becomes
//! negative, when slip stops or a sticking contact leaves its friction cone, when a joint with dry friction stops or breaks
//! loose.
//!
//! **A mode ends** (`resettle`): the touches that are closed and have no normal velocity are candidates; the complementarity
//! problem of their accelerations (`motion/select.rs`) decides which of them carry load, stick or slide.
//!
//! **A gap closes**: an impact (`impacts.rs`), then the same choice among the contacts that it leaves closed.
//!
//! **No consistent mode**: a contact that slides has an impact without collision (Painlevé); what has no solution at all is
//! computed by time steps (`several.rs`), until a mode is consistent again.

use super::leap::Leap;
use super::leg::{Accuracy, LegEnd, PATIENCE, leg};
use super::memory::{Class, Memory};
use super::sampler::Sampler;
use super::trajectory::{Event, EventKind, Sampling, Seen, Statistics, StepReason, Summary};
use super::watch::{Watch, Watched};
use crate::contact::Touch;
use crate::error::SimError;
use crate::model::{Integrator, Simulation};
use crate::motion::{Candidate, ContactState, Dry, DryJoint, Hold, Lasting, Motion, Near, NonUnique};
use crate::state::{ContactImpulse, Space};
use carom_chain::urdf::JointType;

/// The state of a run.
pub(crate) struct Run<'a, 'w, A: Space> {
    pub motion: Motion<'a, A>,
    pub time: f64,
    pub y: Vec<f64>,
    pub end: f64,
    pub sampler: Sampler<'w>,
    pub statistics: Statistics,
    pub lost: f64,
    /// The contacts of the last time step.
    pub stepped: Vec<ContactState>,
    pub memory: Memory,
    /// A leap over a pose at which the mechanism could branch, if the run stands within it.
    pub leap: Option<Leap>,
}

/// How a leg ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Ending {
    /// At the end of the run, or at a jump of forces that changes no mode.
    Passed,
    /// A witness function fired.
    Fired(Watch),
    /// At a jump or a kink of forces or surfaces, with contacts.
    Kink,
    /// The mode cannot be continued.
    Stuck(StepReason),
}

impl<'a, 'w, A: Space> Run<'a, 'w, A> {
    pub fn go(
        sim: &'a Simulation,
        model: &'a A::Model,
        (q, qd): (&[f64], &[f64]),
        duration: f64,
        sampling: Sampling,
        watch: &'w mut dyn FnMut(Seen),
    ) -> Result<Summary, SimError> {
        let mut run = Self::at_start(sim, model, (q, qd), sampling, watch)?;
        run.end = sim.start_time + duration;
        let start = run.motion.energy(&run.y)?;
        run.begin()?;
        let stop = run.until_end(false)?;
        run.summary(start, stop)
    }

    pub fn one_leg(&mut self) -> Result<(), SimError> {
        let ending = self.leg()?;
        self.act(ending)
    }

    /// What follows the end of a leg.
    pub fn act(&mut self, ending: Ending) -> Result<(), SimError> {
        match self.follow_on(ending) {
            // A mode that is consistent, but whose forces are without bound.
            Err(SimError::Jam { .. }) => self.step_on(StepReason::NoMode),
            done => done,
        }
    }

    /// Integrates the present mode to its end.
    pub fn leg(&mut self) -> Result<Ending, SimError> {
        let sim = self.motion.sim;
        let Simulation { tolerance, max_step, integrator, .. } = *sim;
        let gives_up = self.motion.lasting.iter().any(Lasting::is_rigid);
        let presses = self.motion.lasting.iter().any(|own| !own.is_rigid());
        let patience = (gives_up || presses).then_some(PATIENCE);
        // A mode that has turned out to be stiff goes on implicitly, each time for longer.
        let implicit = std::mem::take(&mut self.memory.implicit).filter(|_| gives_up && !presses);
        let integrator = if implicit.is_some() { Integrator::Radau } else { integrator };
        let (first_step, short) = (self.memory.step, self.memory.short);
        let works = self.motion.works();
        let accuracy = Accuracy { tolerance, max_step, integrator, patience, first_step, short, works };
        let kink = sim.next_kink(&self.motion.moving, self.time);
        let mut until = kink.min(self.end).min(self.time + implicit.unwrap_or(f64::INFINITY));
        if is_reached(until, self.time) {
            self.time = until;
            return Ok(Ending::Passed);
        }
        self.measure();
        let start = self.time;
        let mut flow = match Watched::new(&mut self.motion, (self.time, kink), &self.y) {
            Err(SimError::Jam { .. }) => return Ok(Ending::Stuck(StepReason::NoMode)),
            flow => flow?,
        };
        if std::mem::take(&mut self.memory.slip_goes_on) || self.memory.follows_slips {
            flow.watches.retain(|watch| *watch != Watch::SlipEnds);
        }
        let (statistics, sampler) = (&mut self.statistics, &mut self.sampler);
        let mut ended = leg(&mut flow, self.time, &self.y, until, accuracy, statistics, sampler);
        // Far too long a step may reach states that are none.
        if matches!(ended, Err(SimError::Chain(_))) && first_step.is_some() {
            let accuracy = Accuracy { first_step: None, ..accuracy };
            ended = leg(&mut flow, self.time, &self.y, until, accuracy, statistics, sampler);
        }
        // A step that is tried may reach beyond a jam that the motion only approaches.
        while let Err(SimError::Jam { time: jam, .. }) = &ended
            && until - self.time > NEAREST
        {
            until = self.time + (0.125 * (until - self.time)).min(0.5 * (jam - self.time));
            if is_reached(until, self.time) {
                break;
            }
            ended = leg(&mut flow, self.time, &self.y, until, accuracy, statistics, sampler);
        }
        // A stiff compliant contact; or a slow slip, whose direction turns the faster the slower it is: the implicit
        // integrator, for a while. It may fail at a kink of a force, or of the motion: both take turns, each with growing patience.
        let mut next = implicit.map(|span| LONGER * span);
        let mut turn = 0;
        let turns = if presses { TURNS } else { FEW_TURNS };
        let mut integrator = integrator;
        while let (true, Ok(LegEnd { time, y, stalled: Some(_), .. })) = (patience.is_some() && turn < turns, &ended) {
            let moved = *time > self.time;
            (self.time, self.y) = (*time, y.clone());
            if implicit.is_some() && moved {
                return Ok(Ending::Passed); // the explicit integrator is tried again
            }
            integrator = match integrator {
                Integrator::Radau => Integrator::DormandPrince,
                Integrator::DormandPrince => Integrator::Radau,
            };
            turn += 1;
            let patience = patience.map(|steps| steps * 4_usize.pow(turn / 2));
            let accuracy = Accuracy { integrator, patience, ..accuracy };
            let until = if presses { until } else { until.min(self.time + TURNING * max_step) };
            next = (integrator == Integrator::Radau).then_some(LONGER * TURNING * max_step);
            ended = leg(&mut flow, self.time, &self.y, until, accuracy, statistics, sampler);
        }
        let watches = flow.watches;
        match ended {
            Ok(LegEnd { time, y, fired, stalled, step, short }) => {
                self.memory.step = step.filter(|_| gives_up && integrator == Integrator::DormandPrince);
                if matches!(self.memory.open, Some((NonUnique::Distribution, _))) {
                    self.statistics.non_unique_time += time - start;
                }
                (self.time, self.y, self.memory.short) = (time, y, short);
                self.memory.implicit = next.filter(|_| fired.is_none() && stalled.is_none() && !presses);
                match (fired, stalled) {
                    (_, Some(_)) if gives_up => Ok(Ending::Stuck(StepReason::Stiff)),
                    (_, Some(reason)) => Err(SimError::Integration { time, reason }),
                    (Some(witness), _) => Ok(Ending::Fired(watches[witness])),
                    (None, _) if time == kink && !self.motion.moves_freely() => Ok(Ending::Kink),
                    (None, _) => Ok(Ending::Passed),
                }
            }
            Err(SimError::Jam { .. }) => Ok(Ending::Stuck(StepReason::NoMode)),
            Err(error) => Err(error),
        }
    }

    fn follow_on(&mut self, ending: Ending) -> Result<(), SimError> {
        match ending {
            Ending::Passed => Ok(()),
            Ending::Fired(watch) => self.event(watch),
            Ending::Kink => {
                // The forces may jump here, and with them the modes.
                let before = self.y.clone();
                self.resettle(&[], &before)
            }
            Ending::Stuck(reason) => {
                // Several slips that end together turn before the first of them is zero: those below the error have ended.
                let (before, events) = (self.y.clone(), self.memory.events);
                if reason == StepReason::Stiff {
                    self.resettle(&[], &before)?;
                }
                if self.memory.events == events { self.no_mode(reason) } else { Ok(()) }
            }
        }
    }

    /// The velocity scale of the next decisions.
    pub fn measure(&mut self) {
        let surfaces = self.motion.moving.iter().map(|motion| motion.speed(self.time)).fold(0.0, f64::max);
        self.motion.speed = self.motion.split(&self.y).1.iter().fold(surfaces, |m: f64, v| m.max(v.abs()));
    }

    pub fn q_qd(&self) -> (Vec<f64>, Vec<f64>) {
        let (q, qd) = self.motion.split(&self.y);
        (q.to_vec(), qd.to_vec())
    }

    /// Gap and gap rate of a touch now.
    pub fn gap(&mut self, touch: usize) -> Result<(f64, f64), SimError> {
        let (q, qd) = self.q_qd();
        self.motion.gap(touch, &q, &qd, self.time)
    }

    /// Gaps and gap rates of all touches now that are near: see [`Gaps::all`](crate::motion::Gaps::all).
    pub fn gaps(&mut self) -> Result<Vec<Near>, SimError> {
        let (q, qd) = self.q_qd();
        self.motion.all_gaps(&q, &qd, self.time)
    }

    /// The contacts and the mode at the start.
    pub fn begin(&mut self) -> Result<(), SimError> {
        let sim = self.motion.sim;
        self.measure();
        let (mut hits, mut rests, mut sunk) = (Vec::new(), Vec::new(), Vec::new());
        for (touch, (gap, rate)) in self.gaps()? {
            let gives_way = sim.touches[touch].is_compliant();
            // A compliant contact may start with a penetration, but not with more than its body has.
            let gives_way = gives_way && gap > -2.0 * sim.touches[touch].size();
            if gives_way && gap <= 0.0 && (gap < 0.0 || rate <= 0.0) {
                sunk.push((touch, -rate));
            } else if gap < -TOUCHING {
                let touch = &sim.touches[touch];
                return Err(SimError::Overlap { touch: touch.name.clone(), depth: -gap, unit: unit(sim, touch) });
            } else if gap <= TOUCHING {
                if rate < -ROUNDING * self.motion.speed {
                    hits.push(touch);
                } else if rate <= self.motion.rest() {
                    rests.push(touch);
                }
            }
        }
        // Compliant contacts may start with a penetration.
        for (touch, approach) in sunk {
            let damping = self.damping(touch, approach)?;
            self.press(touch, damping);
        }
        if sim.stepping {
            return self.step_on(StepReason::Asked);
        }
        let before = self.y.clone();
        if hits.is_empty() { self.resettle(&rests, &before) } else { self.collide(&hits, &rests) }
    }

    fn event(&mut self, watch: Watch) -> Result<(), SimError> {
        if self.memory.is_crowded(self.time, watch, self.motion.sim) {
            return self.step_on(StepReason::Crowd);
        }
        let before = self.y.clone();
        match watch {
            Watch::Gap(touch) => return self.touch(touch),
            Watch::Branches => return self.pass_branch(),
            Watch::Pair(group) | Watch::Rest(group) => {
                let gaps = self.gaps()?;
                let own = |k: usize| self.motion.gaps.is_of(group, k) && !self.motion.lasts(k);
                let least = gaps.iter().filter(|(k, _)| own(*k)).min_by(|a, b| a.1.0.total_cmp(&b.1.0));
                return least.map_or(Ok(()), |&(touch, _)| self.touch(touch));
            }
            Watch::Leaves(i) => {
                let touch = self.motion.lasting.remove(i).touch;
                self.note(EventKind::LiftOff { touch }, &before, Vec::new());
                return self.leave(touch, &before);
            }
            Watch::Depth(i) => {
                let own = self.motion.lasting.remove(i);
                self.note(EventKind::LiftOff { touch: own.touch }, &before, Vec::new());
            }
            Watch::Turns(i) => {
                let (gap, _) = self.gap(self.motion.lasting[i].touch)?;
                if let Hold::Presses { deepest, .. } = &mut self.motion.lasting[i].hold {
                    *deepest = -gap;
                }
                return Ok(());
            }
            Watch::Deepens(i) => {
                if let Hold::Presses { deepest, .. } = &mut self.motion.lasting[i].hold {
                    *deepest = f64::NEG_INFINITY;
                }
                return Ok(());
            }
            Watch::SlipGrows(_) => return self.motion.started(self.time, &before),
            Watch::SlipStops(i) => {
                self.motion.follow_slip(self.time, &before)?;
                let touch = self.motion.lasting[i].touch;
                if let Some(toward) = self.motion.candidate(touch, self.time, &before)?.slip {
                    self.motion.lasting[i].hold = Hold::Slides { toward }; // its direction has turned by 90°
                    return Ok(());
                }
            }
            Watch::JointStops(k) if self.motion.couplings.is_empty() => {
                self.y[self.motion.sim.chain.nq() + self.motion.dry[k].v] = 0.0;
            }
            Watch::NormalForce(_)
            | Watch::Cone(_)
            | Watch::JointBreaksLoose(_)
            | Watch::JointStops(_)
            | Watch::Admissible
            | Watch::SlipEnds => {}
        }
        let events = self.memory.events;
        let (old, joints) = (self.motion.lasting.clone(), self.motion.dry.clone());
        self.resettle(&[], &before)?;
        // A contact that slides on in another direction, a joint that turns back: the mode has the same name as before.
        if self.memory.events == events {
            match watch {
                // A contact whose normal force is zero again within this time has none.
                Watch::NormalForce(i) => {
                    let since = self.memory.count(Class::NormalForce, self.time);
                    if since.is_some_and(|since| since <= self.motion.sim.zeno_time) {
                        self.resettle_without(Some(old[i].touch), &[], &before)?;
                    }
                }
                Watch::SlipStops(i) | Watch::Cone(i) => {
                    if let Some(mode) = self.motion.lasting.get(i).map(Lasting::mode) {
                        self.note(EventKind::Mode { mode }, &before, Vec::new());
                    }
                }
                Watch::JointStops(k) | Watch::JointBreaksLoose(k) if self.motion.dry[k].state != joints[k].state => {
                    self.note_joint(k, &before);
                }
                Watch::SlipEnds => self.slips_on(&old, &before),
                _ => {}
            }
        }
        Ok(())
    }

    /// The contact point of a touch has left its faces and edges: others may strike in this instant, such as the far side of
    /// a rim whose cap comes to lie on a face.
    fn leave(&mut self, touch: usize, before: &[f64]) -> Result<(), SimError> {
        self.measure();
        let gaps = self.gaps()?;
        let [hits, beside] = self.others_closed(touch, &gaps)?;
        if hits.is_empty() { self.resettle_without(Some(touch), &[], before) } else { self.collide(&hits, &beside) }
    }

    fn note_joint(&mut self, k: usize, before: &[f64]) {
        let DryJoint { v, state, .. } = self.motion.dry[k];
        let joint = self.motion.sim.chain.joint_of_velocity(v).map_or_else(String::new, |joint| joint.name.clone());
        self.note(EventKind::Joint { joint, holds: state == Dry::Holds }, before, Vec::new());
    }

    /// The modes of the contacts that last and of those in `more`, and the events of their changes.
    pub fn resettle(&mut self, more: &[usize], before: &[f64]) -> Result<(), SimError> {
        self.resettle_without(None, more, before)
    }

    /// The same without a touch whose contact point has left its faces and edges.
    fn resettle_without(&mut self, gone: Option<usize>, more: &[usize], before: &[f64]) -> Result<(), SimError> {
        let old = self.motion.lasting.clone();
        let dry = self.motion.dry.clone();
        let mut touches: Vec<usize> = old.iter().filter(|own| own.is_rigid()).map(|own| own.touch).collect();
        touches.extend(more);
        let rest = self.motion.rest();
        let closed = self.motion.closed();
        touches.retain(|touch| Some(*touch) != gone);
        for (touch, (gap, rate)) in self.gaps()? {
            let compliant = self.motion.sim.touches[touch].contact.compliance.is_some();
            let open = compliant || Some(touch) == gone || touches.contains(&touch);
            if !open && gap.abs() <= closed && rate.abs() <= rest {
                touches.push(touch);
            }
        }
        touches.sort_unstable();
        if let Some(reason) = self.choose(&touches)? {
            return self.no_mode(reason);
        }
        self.note_changes(&old, before);
        let sim_start = self.motion.sim.start_time;
        for (k, old) in dry.iter().enumerate() {
            let holds = |joint: &DryJoint| joint.state == Dry::Holds;
            if holds(old) != holds(&self.motion.dry[k]) && self.time > sim_start {
                self.note_joint(k, before);
            }
        }
        self.rest()
    }

    /// Sets the modes of these rigid touches, beside the compliant contacts, and projects the state onto them; or the reason why
    /// their motion needs time steps.
    pub fn choose(&mut self, touches: &[usize]) -> Result<Option<StepReason>, SimError> {
        let kept = self.motion.lasting.iter().filter(|own| !own.is_rigid());
        let mut candidates: Vec<Candidate> =
            kept.map(|own| Candidate { touch: own.touch, slip: None, kept: Some(*own) }).collect();
        for &touch in touches {
            // Parts that no longer face each other have opened; what no joint moves has no force.
            if self.gap(touch)?.0.is_finite() && self.motion.moves(touch, self.time, &self.y)? {
                candidates.push(self.motion.candidate(touch, self.time, &self.y)?);
            }
        }
        if !self.motion.select(&candidates, self.time, &mut self.y)? {
            return Ok(Some(StepReason::NoMode));
        }
        self.end_slips(&candidates)?;
        let faces = self.motion.lasting.iter().any(|own| !self.motion.sim.touches[own.touch].is_point());
        Ok(faces.then_some(StepReason::Face))
    }

    /// The events of the contacts whose mode has changed.
    pub fn note_changes(&mut self, old: &[Lasting], before: &[f64]) {
        let new = self.motion.lasting.clone();
        for own in old.iter().filter(|own| !new.iter().any(|now| now.touch == own.touch)) {
            self.note(EventKind::LiftOff { touch: own.touch }, before, Vec::new());
        }
        for now in &new {
            let same = |own: &Lasting| std::mem::discriminant(&own.mode()) == std::mem::discriminant(&now.mode());
            if !old.iter().any(|own| own.touch == now.touch && same(own)) {
                self.note(EventKind::Mode { mode: now.mode() }, before, Vec::new());
            }
        }
    }

    /// Notes whether the motion is unique, and ends the run if the chain is at rest and stays so.
    pub fn rest(&mut self) -> Result<(), SimError> {
        self.note_open()?;
        let rested = std::mem::replace(&mut self.memory.resting, false);
        let rest = self.motion.rest();
        let still = self.motion.split(&self.y).1.iter().all(|v| v.abs() <= rest);
        let held =
            self.motion.lasting.iter().any(Lasting::is_rigid) && self.motion.lasting.iter().all(Lasting::is_rigid);
        if !still || !held || !self.is_steady() || self.time >= self.end {
            return Ok(());
        }
        let qdd = match self.motion.accelerations(self.time, &self.y) {
            Err(SimError::Jam { .. }) => return Ok(()),
            held => held?.qdd,
        };
        let gravity = self.motion.sim.gravity.norm().max(rest);
        if qdd.amax() > 1e-9 * gravity {
            return Ok(());
        }
        let before = self.y.clone();
        let (nq, nv) = (self.motion.sim.chain.nq(), self.motion.sim.chain.nv());
        self.y[nq..nq + nv].fill(0.0);
        self.memory.resting = true;
        if !rested {
            self.note(EventKind::Rest, &before, Vec::new());
        }
        self.stay()
    }

    /// Outputs an event that led from `before` to the present state.
    pub fn note(&mut self, kind: EventKind, before: &[f64], impulses: Vec<ContactImpulse>) {
        let (q, qd_plus) = self.q_qd();
        let qd_minus = self.motion.split(before).1.to_vec();
        (self.sampler.watch)(Seen::Event(&Event { time: self.time, kind, q, qd_minus, qd_plus, impulses }));
        self.memory.events += 1;
    }
}

/// At the start approach velocities up to this share of the joint velocities are rounding.
const ROUNDING: f64 = 1e-14;
/// Gaps up to this size count as closed when another contact closes, m.
pub(crate) const TOUCHING: f64 = 1e-9;
/// A jam within this time counts as reached, s.
const NEAREST: f64 = 1e-9;
/// The explicit and the implicit integrator take turns at most so often in one leg with compliant contacts.
const TURNS: u32 = 20;
/// The same for legs without compliant contacts, which time steps can go on with.
const FEW_TURNS: u32 = 4;
/// Share of the longest step for which a stiff mode is integrated implicitly first.
const TURNING: f64 = 0.1;
/// The factor by which the time is longer in which it is integrated implicitly next.
const LONGER: f64 = 8.0;

/// Whether what is left to this time is shorter than any step.
pub(crate) fn is_reached(until: f64, time: f64) -> bool {
    until - time <= 1e-13 * (1.0 + until)
}

/// The unit of a touch's gap.
fn unit(sim: &Simulation, touch: &Touch) -> &'static str {
    let slides = |joint: &str| {
        let of_name = sim.chain.joints().iter().find(|it| it.name == joint);
        of_name.is_some_and(|joint| joint.kind == JointType::Prismatic)
    };
    match touch.limit_of() {
        Some(joint) if !slides(joint) => "rad",
        _ => "m",
    }
}
