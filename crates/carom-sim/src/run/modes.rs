//! The modes of the contacts in a run: their choice, the events of their changes, slips that end as soon as their mode is chosen
//! (`motion/ending.rs`), rest, and motions that are not unique.

use super::run_state::Run;
use super::trajectory::{EventKind, StepReason};
use crate::error::SimError;
use crate::motion::{Dry, DryJoint, Hold, Lasting};
use crate::state::{EQUAL, Space};

impl<A: Space> Run<'_, '_, A> {
    /// The contact point of a touch has left its faces and edges: others may strike in this instant, such as the far side of
    /// a rim whose cap comes to lie on a face.
    pub fn leave(&mut self, touch: usize, before: &[f64]) -> Result<(), SimError> {
        self.measure();
        let gaps = self.gaps()?;
        let [hits, beside] = self.others_closed(touch, &gaps)?;
        if hits.is_empty() { self.resettle(Some(touch), &[], before) } else { self.collide(&hits, &beside) }
    }

    pub fn note_joint(&mut self, k: usize, before: &[f64]) {
        let DryJoint { v, state, .. } = self.motion.active.dry[k];
        let joint = self.motion.sim.chain.joint_of_velocity(v).map_or_else(String::new, |joint| joint.name.clone());
        self.note(EventKind::Joint { joint, holds: state == Dry::Holds }, before);
    }

    /// The modes of the contacts that last, without the touch that is `gone`, and of those in `more`, and the events of their changes.
    pub fn resettle(&mut self, gone: Option<usize>, more: &[usize], before: &[f64]) -> Result<(), SimError> {
        let old = self.motion.active.lasting.clone();
        let dry = self.motion.active.dry.clone();
        let mut touches: Vec<usize> = old.iter().filter(|own| own.is_rigid()).map(|own| own.touch).collect();
        touches.extend(more);
        touches.retain(|touch| Some(*touch) != gone);
        for (touch, (gap, rate)) in self.gaps()? {
            let compliant = self.motion.sim.touches[touch].contact.compliance.is_some();
            let open = compliant || Some(touch) == gone || touches.contains(&touch);
            if !open && gap.abs() <= self.motion.closed(touch) && rate.abs() <= self.motion.rest_of(touch) {
                touches.push(touch);
            }
        }
        touches.sort_unstable();
        if let Some(reason) = self.choose(&touches)? {
            return self.no_mode(reason);
        }
        self.note_modes((&old, &dry), before);
        self.rest()
    }

    /// Drops a contact that jams, where the others leave it open; `false`: none.
    pub fn open_jammed(&mut self) -> Result<bool, SimError> {
        let (old, dry) = (self.motion.active.lasting.clone(), self.motion.active.dry.clone());
        if !self.motion.let_open(self.time, &self.y)? {
            return Ok(false);
        }
        self.note_modes((&old, &dry), &self.y.clone());
        self.rest()?;
        Ok(true)
    }

    /// The events of the contacts and joints whose mode has changed.
    fn note_modes(&mut self, (old, dry): (&[Lasting], &[DryJoint]), before: &[f64]) {
        self.note_changes(old, before);
        let sim_start = self.motion.sim.start_time;
        for (k, old) in dry.iter().enumerate() {
            let holds = |joint: &DryJoint| joint.state == Dry::Holds;
            if holds(old) != holds(&self.motion.active.dry[k]) && self.time > sim_start {
                self.note_joint(k, before);
            }
        }
    }

    /// Sets the modes of these rigid touches, beside the compliant contacts, and projects the state onto them; or the reason why
    /// their motion needs time steps.
    pub fn choose(&mut self, touches: &[usize]) -> Result<Option<StepReason>, SimError> {
        let active = self.motion.active.lasting.iter().filter(|own| !own.is_rigid());
        let mut candidates: Vec<Lasting> = active.copied().collect();
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
        let faces = self.motion.active.lasting.iter().any(|own| !self.motion.sim.touches[own.touch].is_point());
        Ok(faces.then_some(StepReason::Face))
    }

    /// The events of the contacts whose mode has changed.
    pub fn note_changes(&mut self, old: &[Lasting], before: &[f64]) {
        let new = self.motion.active.lasting.clone();
        for own in old.iter().filter(|own| !new.iter().any(|now| now.touch == own.touch)) {
            self.note(EventKind::LiftOff { touch: own.touch }, before);
        }
        for now in &new {
            if !old.iter().any(|own| own.is_alike(now)) {
                self.note(EventKind::Mode { mode: now.mode() }, before);
            }
        }
    }

    /// Notes whether the motion is unique, and ends the run if the chain is at rest and stays so.
    pub fn rest(&mut self) -> Result<(), SimError> {
        self.note_open()?;
        let rested = std::mem::replace(&mut self.history.resting, false);
        let rest = self.motion.rest();
        let still = self.motion.scale.fastest(self.motion.split(&self.y).1) <= rest;
        let lasting = &self.motion.active.lasting;
        let held = !lasting.is_empty() && lasting.iter().all(Lasting::is_rigid);
        if !still || !held || !self.is_steady() || self.time >= self.end {
            return Ok(());
        }
        let qdd = match self.motion.accelerations(self.time, &self.y) {
            Err(SimError::Jam { .. }) => return Ok(()),
            held => held?.qdd,
        };
        let scale = &self.motion.scale;
        if scale.fastest(qdd.iter()) > EQUAL * self.motion.sim.gravity.norm().max(rest * scale.pace) {
            return Ok(());
        }
        let before = self.y.clone();
        let (nq, nv) = (self.motion.sim.chain.nq(), self.motion.sim.chain.nv());
        self.y[nq..nq + nv].fill(0.0);
        self.history.resting = true;
        if !rested {
            self.note(EventKind::Rest, &before);
        }
        self.stay()
    }

    /// The event that the motion in the present mode is not unique, if it was not noted before.
    pub fn note_open(&mut self) -> Result<(), SimError> {
        let open = self.motion.open(self.time, &self.y)?;
        if let Some((reason, touches)) = &open
            && open != self.history.open
        {
            let (y, touches) = (self.y.clone(), touches.clone());
            self.note(EventKind::NonUnique { reason: *reason, touches }, &y);
        }
        self.history.open = open;
        Ok(())
    }

    /// The events of contacts whose slip has turned back, or with `anew` has ended and begins in any direction, since their modes were `old`;
    /// whether there are any.
    pub fn note_turned(&mut self, (old, anew): (&[Lasting], bool), before: &[f64]) -> bool {
        let turned = |old: &Lasting, now: &Lasting| match (old.hold, now.hold) {
            (Hold::Slides { toward }, Hold::Slides { toward: now }) => toward.dot(&now) < 0.0,
            (Hold::Slides { .. }, Hold::Starts { .. }) => anew,
            _ => false,
        };
        let pairs = old.iter().zip(&self.motion.active.lasting);
        let turned: Vec<_> = pairs.filter(|(old, now)| turned(old, now)).map(|(_, now)| now.mode()).collect();
        for mode in &turned {
            self.note(EventKind::Mode { mode: *mode }, before);
        }
        !turned.is_empty()
    }

    /// Ends the slips of contacts and joints that would end soon and then rest; the energy that they lose is booked.
    pub fn end_slips(&mut self, candidates: &[Lasting]) -> Result<(), SimError> {
        if self.history.follows_slips {
            return Ok(());
        }
        let mut ending = self.motion.ending(self.time, &self.y)?;
        if ending.is_empty() {
            return Ok(());
        }
        let (active, y, other) = (self.motion.active.clone(), self.y.clone(), self.motion.other_mode.take());
        let energy = self.motion.energy(&y)?;
        while !ending.is_empty() {
            let ends = |touch| ending.touches.contains(&touch);
            let sim = self.motion.sim;
            let rest = |own: &Lasting| match own.hold {
                Hold::Slides { .. } if ends(own.touch) => Lasting::of(own.touch, &sim.touches[own.touch], None),
                _ => *own,
            };
            let candidates: Vec<Lasting> = candidates.iter().map(rest).collect();
            ending.joints.iter().for_each(|&k| self.motion.active.dry[k].state = Dry::Holds);
            self.motion.shut(&candidates, self.time, &mut self.y)?;
            let found = self.motion.select(&candidates, self.time, &mut self.y)?;
            if found && !self.motion.is_moving(&mut ending) {
                self.history.lost += energy - self.motion.energy(&self.y)?;
                return Ok(());
            }
            self.motion.active = active.clone();
            self.y.copy_from_slice(&y);
            if !found {
                break;
            }
        }
        self.motion.other_mode = other;
        Ok(())
    }
}
