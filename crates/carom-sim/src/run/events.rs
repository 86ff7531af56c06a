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
//! computed by time steps (`steps.rs`), until a mode is consistent again.

use super::guard::Ending;
use super::guard::Guard;
use super::guarded::Guarded;
use super::leg::{Accuracy, LegEnd, leg};
use super::run_state::Run;
use super::trajectory::{Event, EventKind, EventLoads, Sampling, Seen, StepReason, Summary};
use crate::contact::Touch;
use crate::error::SimError;
use crate::model::{Integrator, Simulation};
use crate::motion::{Hold, Lasting, Motion, Near, NonUnique, Scale, is_reached};
use crate::state::{CLEAR, ContactImpulse, EQUAL, GROWTH, MAX_STEPS, ROUNDING, STEPS, Space};
use carom_chain::urdf::JointType;

impl<'a, 'w, A: Space> Run<'a, 'w, A> {
    pub fn go(
        sim: &'a Simulation,
        model: &'a A::Model,
        (q, qd): (&[f64], &[f64]),
        (duration, later): (f64, bool),
        sampling: Sampling,
        watch: &'w mut dyn FnMut(Seen),
    ) -> Result<Summary, SimError> {
        let mut run = Self::at_start(sim, model, (q, qd), sampling, watch)?;
        (run.end, run.history.ends_later) = (sim.start_time + duration, later);
        let start = run.motion.energy(&run.y)?;
        run.begin()?;
        let stop = run.until_end(false)?;
        run.summary(start, stop)
    }

    /// What follows the end of a leg.
    pub fn act(&mut self, ending: Ending) -> Result<(), SimError> {
        match self.follow_on(ending) {
            // A mode that is consistent, but whose forces are without bound.
            Err(SimError::Jam { .. }) => self.step_on(StepReason::NoMode),
            done => done,
        }
    }

    /// Integrates the present mode to its end, by the first of these attempts that gets there:
    ///
    /// | what happens | next attempt |
    /// |---|---|
    /// | – | with the length of the last step as its first; implicit if the mode was stiff and is rigid |
    /// | the first step reaches states that are none | with a first step that the integrator chooses |
    /// | a step that is tried reaches beyond a jam, which the motion only approaches | to an earlier end: half the way to the jam at most |
    /// | a stiff compliant contact; a slow slip, whose direction turns the faster the slower it is; a kink of a force | explicit and implicit in turn, each with growing patience; if it is rigid for a short time, and after an implicit start that moved, by the next leg |
    /// | an implicit step without rigid contacts whose equations are not solved | with shorter steps |
    /// | none of them ends the leg | time steps if it is rigid, else an error |
    pub fn leg(&mut self) -> Result<Ending, SimError> {
        let sim = self.motion.sim;
        let Simulation { tolerance, max_step, integrator, .. } = *sim;
        let rigid = self.motion.active.lasting.iter().any(Lasting::is_rigid);
        let presses = self.motion.active.lasting.iter().any(|own| !own.is_rigid());
        let patience = (rigid || presses).then_some(1);
        let implicit = std::mem::take(&mut self.history.implicit).filter(|_| rigid && !presses);
        let integrator = if implicit.is_some() { Integrator::Radau } else { integrator };
        let (first_step, short) = (self.history.step, self.history.short);
        let mut accuracy = Accuracy { tolerance, max_step, integrator, patience, first_step, short };
        let kink = sim.next_kink(&self.motion.moving, self.time);
        let mut until = kink.min(self.end).min(self.time + implicit.unwrap_or(f64::INFINITY));
        let pace = self.motion.scale.pace;
        if is_reached(until, self.time, pace) {
            self.time = until;
            return Ok(Ending::Passed);
        }
        self.measure();
        self.motion.end_long_starts(self.time, &self.y)?;
        let (start, lasting) = (self.time, self.motion.active.lasting.clone());
        let mut flow = match Guarded::new(&mut self.motion, (self.time, kink), &self.y) {
            Err(SimError::Jam { .. }) => return Ok(Ending::Stuck(StepReason::NoMode)),
            flow => flow?,
        };
        if std::mem::take(&mut self.history.slip_goes_on) || self.history.follows_slips {
            flow.guards.retain(|guard| *guard != Guard::SlipEnds);
        }
        // With rigid contacts alone time steps go on where more patience did not help.
        let most = if presses { MAX_STEPS / STEPS } else { GROWTH as usize };
        let patient = |patience: Option<usize>| patience.is_some_and(|times| times <= most);
        let (mut next, mut turn) = (implicit.map(|span| GROWTH * span), 0);
        let LegEnd { time, y, fired, stalled, step, short } = loop {
            match leg(&mut flow, self.time, &self.y, until, accuracy, &mut self.history.statistics, &mut self.sampler) {
                Err(SimError::Chain(_)) if accuracy.first_step.is_some() => {
                    accuracy.first_step = None;
                    flow.restart(&lasting, (self.time, &self.y))?;
                }
                Err(SimError::Jam { time: jam, .. }) => {
                    let earlier = self.time + (0.125 * (until - self.time)).min(0.5 * (jam - self.time));
                    if until - self.time <= EQUAL / pace || is_reached(earlier, self.time, pace) {
                        return Ok(Ending::Stuck(StepReason::NoMode));
                    }
                    until = earlier;
                    flow.restart(&lasting, (self.time, &self.y))?;
                }
                Ok(LegEnd { time, y, stalled: Some(_), .. }) if patient(accuracy.patience) => {
                    let moved = time > self.time;
                    (self.time, self.y) = (time, y);
                    if implicit.is_some() && moved {
                        return Ok(Ending::Passed);
                    }
                    accuracy.integrator = match accuracy.integrator {
                        Integrator::Radau => Integrator::DormandPrince,
                        Integrator::DormandPrince => Integrator::Radau,
                    };
                    turn += 1;
                    accuracy.patience = Some((GROWTH as usize).pow(turn / 2));
                    until = if presses { until } else { until.min(self.time + max_step / GROWTH) };
                    next = (accuracy.integrator == Integrator::Radau).then_some(max_step);
                }
                Ok(LegEnd { time, y, stalled: Some(_), .. })
                    if !rigid && accuracy.integrator == Integrator::Radau && accuracy.max_step * pace > CLEAR =>
                {
                    (self.time, self.y) = (time, y);
                    accuracy.max_step /= GROWTH;
                }
                done => break done?,
            }
        };
        self.history.step = step.filter(|_| rigid && accuracy.integrator == Integrator::DormandPrince);
        if matches!(self.history.open, Some((NonUnique::Distribution, _))) {
            self.history.statistics.non_unique_time += time - start;
        }
        (self.time, self.history.short) = (time, short);
        self.history.implicit = next.filter(|_| fired.is_none() && stalled.is_none() && !presses);
        let ending = match (fired, stalled) {
            (_, Some(_)) if rigid => Ending::Stuck(StepReason::Stiff),
            (_, Some(reason)) => return Err(SimError::Integration { time, reason }),
            (Some(guard), _) => Ending::Fired(flow.guards[guard]),
            (None, _) if time == kink && !self.motion.moves_freely() => Ending::Kink,
            (None, _) => Ending::Passed,
        };
        self.y = y;
        Ok(ending)
    }

    fn follow_on(&mut self, ending: Ending) -> Result<(), SimError> {
        match ending {
            Ending::Passed => Ok(()),
            Ending::Fired(guard) => self.guard_fired(guard),
            Ending::Kink => {
                // The forces may jump here, and with them the modes.
                let before = self.y.clone();
                self.resettle(None, &[], &before)
            }
            Ending::Stuck(reason) => {
                // Slips that end together, or where friction jams, turn before the first of them is zero: those below the error have ended.
                let (before, events) = (self.y.clone(), self.history.events);
                let old = self.motion.active.lasting.clone();
                self.resettle(None, &[], &before)?;
                let goes_on = self.history.events != events
                    || self.note_turned((&old, true), &before)
                    || (reason == StepReason::NoMode && self.open_jammed()?);
                if goes_on { Ok(()) } else { self.no_mode(reason) }
            }
        }
    }

    /// The scale of the next decisions.
    pub fn measure(&mut self) {
        self.motion.measure(self.time, &self.y);
    }

    pub fn q_qd(&self) -> (Vec<f64>, Vec<f64>) {
        let (q, qd) = self.motion.split(&self.y);
        (q.to_vec(), qd.to_vec())
    }

    /// Gap and gap rate of a touch now.
    pub fn gap(&mut self, touch: usize) -> Result<(f64, f64), SimError> {
        self.motion.gap(touch, self.time, &self.y)
    }

    /// Gaps and gap rates of all touches now that are near: see [`Gaps::all`](crate::motion::Gaps::all).
    pub fn gaps(&mut self) -> Result<Vec<Near>, SimError> {
        self.motion.all_gaps(self.time, &self.y, |_, _| false)
    }

    /// The contacts and the mode at the start.
    pub fn begin(&mut self) -> Result<(), SimError> {
        let sim = self.motion.sim;
        self.measure();
        let (mut hits, mut rests, mut sunk) = (Vec::new(), Vec::new(), Vec::new());
        // The projection onto contacts leaves velocities of this size.
        let Scale { length, pace, .. } = self.motion.scale;
        let least = ROUNDING * self.motion.active.speed.max(length * pace);
        for (touch, (gap, rate)) in self.motion.all_gaps(self.time, &self.y, Motion::rests)? {
            let gives_way = sim.touches[touch].is_compliant();
            // A compliant contact may start with a penetration, but not with more than its body has.
            let gives_way = gives_way && gap > -2.0 * sim.touches[touch].size();
            if gives_way && gap <= 0.0 && (gap < 0.0 || rate <= 0.0) {
                sunk.push((touch, (gap, rate)));
            } else if gap < -self.motion.scale.touching(touch) {
                let touch = &sim.touches[touch];
                return Err(SimError::Overlap { touch: touch.name.clone(), depth: -gap, unit: unit(sim, touch) });
            } else if gap <= self.motion.scale.touching(touch) {
                if rate < -least * self.motion.scale.per_touch[touch] {
                    hits.push(touch);
                } else if rate <= self.motion.rest_of(touch) {
                    rests.push(touch);
                }
            }
        }
        // Compliant contacts may start with a penetration.
        for (touch, (gap, rate)) in sunk {
            let unloads = rate > 0.0 && sim.touches[touch].contact.compliance.is_some_and(|it| it.turns());
            self.press(touch, 0.0);
            if let Some(Lasting { hold: Hold::Presses { deepest, .. }, .. }) = self.motion.active.lasting.last_mut()
                && unloads
            {
                *deepest = -gap;
            }
        }
        self.remember()?;
        if sim.stepping {
            return self.step_on(StepReason::Asked);
        }
        let before = self.y.clone();
        if hits.is_empty() { self.resettle(None, &rests, &before) } else { self.collide(&hits, &rests) }
    }

    /// # Errors
    /// [`SimError::ClosesInside`] if a touch that may close from now on overlaps.
    pub fn refuse_overlap(&mut self, touch: usize) -> Result<(), SimError> {
        let (gap, _) = self.gap(touch)?;
        if gap >= -self.motion.scale.touching(touch) {
            return Ok(());
        }
        let (touch, sim) = (&self.motion.sim.touches[touch], self.motion.sim);
        let (time, name) = (self.time, touch.name.clone());
        Err(SimError::ClosesInside { time, touch: name, depth: -gap, unit: unit(sim, touch) })
    }

    /// Outputs an event that led from `before` to the present state.
    pub fn note(&mut self, kind: EventKind, before: &[f64]) {
        self.note_impact(kind, before, Vec::new(), None);
    }

    /// [`Self::note`] for an impact.
    pub fn note_impact(
        &mut self,
        kind: EventKind,
        before: &[f64],
        impulses: Vec<ContactImpulse>,
        loads: Option<Box<EventLoads>>,
    ) {
        let (q, qd_plus) = self.q_qd();
        let qd_minus = self.motion.split(before).1.to_vec();
        (self.sampler.watch)(Seen::Event(&Event { time: self.time, kind, q, qd_minus, qd_plus, impulses, loads }));
        self.history.events += 1;
    }
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

#[cfg(test)]
mod tests {
    use super::super::changed::silent;
    use super::*;
    use crate::contact::{ContactRule, Surface};
    use carom_chain::algebra::Spatial;
    use carom_contact::Obstacle;
    use carom_impact::Newton;
    use carom_testing::build::{Part, X, Y, Z, ball, chain};
    use nalgebra::Vector3;

    /// A ball on three sliders touches a floor that is tilted about y.
    fn on_tilted_floor() -> Simulation {
        let point = Part::slider("c", "b", Z).weighing(1.0, [1.0; 3]).shaped(&ball(0.1));
        let chain = chain(&[Part::slider("a", "base", X).massless(), Part::slider("b", "a", Y).massless(), point]);
        let obstacle = Obstacle::half_space(Vector3::new(0.0, 0.0, -0.1), Vector3::z()).unwrap();
        let contact = ContactRule::new(Newton { restitution: 0.0, friction: 0.3 });
        let floor = Surface { name: "floor".into(), obstacle, contact, motion: None };
        let touches = Touch::all(&chain, &[floor], 0.0).unwrap().touches;
        Simulation { gravity: Vector3::new(5.0, 0.0, -9.81), ..Simulation::new(chain, touches) }
    }

    /// Its run, in which it slides along y.
    fn sliding(sim: &Simulation) -> Run<'_, '_, Spatial<f64>> {
        let start = (&[0.0; 3][..], &[0.0, 1.0, 0.0][..]);
        let mut run = Run::at_start(sim, &sim.chain, start, Sampling::default(), silent()).unwrap();
        run.end = 0.1;
        run.begin().unwrap();
        run
    }

    /// The choice of a mode can leave slip that is too fast for one that begins in the direction of its acceleration. Friction acts against it,
    /// as where it is known to slide.
    #[test]
    fn friction_acts_against_slip_that_is_too_fast_to_begin() {
        let sim = on_tilted_floor();
        let end = |starts: bool| {
            let mut run = sliding(&sim);
            if starts {
                run.motion.active.lasting[0].hold = Hold::Starts { toward: Vector3::x() };
            }
            run.until_end(false).unwrap();
            run.y.clone()
        };
        let [known, found] = [end(false), end(true)];
        assert!(known[4] < 0.8, "it is braked: {known:?}");
        // Velocities of 1 m/s, at a tolerance of 1e-9.
        assert!(known.iter().zip(&found).all(|(a, b)| (a - b).abs() < 1e-9), "{known:?} {found:?}");
    }

    /// A slip that has ended and begins in another direction, or turns back, is an event; one that goes on, or begins as it did, is none.
    #[test]
    fn slip_that_begins_anew_is_an_event() {
        let sim = on_tilted_floor();
        let (slides, starts) = (|toward| Hold::Slides { toward }, |toward| Hold::Starts { toward });
        let (x, y) = (Vector3::x(), Vector3::y());
        for (old, now, events) in [
            (slides(x), starts(y), 1),
            (slides(x), slides(-x), 1),
            (slides(x), slides(y), 0),
            (starts(x), starts(y), 0),
            (Hold::Sticks, starts(x), 0),
        ] {
            let mut run = sliding(&sim);
            let (before, noted) = (run.y.clone(), run.history.events);
            run.motion.active.lasting = vec![Lasting { touch: 0, hold: now }];
            let turned = run.note_turned((&[Lasting { touch: 0, hold: old }], true), &before);
            assert_eq!((run.history.events - noted, turned), (events, events > 0), "{old:?} {now:?}");
        }
    }
}
