//! Impacts: of one touch, of one beside lasting contacts, of several at once; and what lasts after them.
//!
//! An impact beside lasting contacts is that of the touch alone, with the inertia that the others leave:
//! H_cc − H_cl H_ll⁺ H_lc, under the contact's own law, if the impulses of the others are admissible (they push, within their
//! cones) and the scene's law of several contacts is Moreau's, which keeps them closed as well. Otherwise, and where several
//! touches close at once, it is one problem under the scene's law of several contacts.
//!
//! **After the impact** each touch with a separation velocity u⁺, r = u⁺/|u⁻| and the acceleration a towards the surface:
//!
//! - u⁺ > 0 and no accumulation: it opens.
//! - a > 0, r < 1 and remaining time 2u⁺/(a(1−r)) below [`Simulation::zeno_time`](crate::Simulation::zeno_time): the infinitely
//!   many impacts within that time are replaced by their limit (`zeno`), after which the contact lasts. So are bounces whose
//!   height is below the tolerance. For a pendulum that hits a wall at its lowest point a = 0: its impacts never accumulate, and all are computed.
//! - u⁺ = 0: it lasts if the accelerations press it.

use super::history::{Class, TAIL};
use super::run_state::Run;
use super::trajectory::{EventKind, StepReason};
use crate::contact::{SeveralLaw, friction_bound};
use crate::error::SimError;
use crate::impact::ChainImpact;
use crate::motion::{Hold, Lasting, Motion, Near, Scale, direction_of_slip, push};
use crate::state::{CLEAR, ContactImpulse, EQUAL, EXACT, ROUNDING, Space};
use carom_chain::algebra::z_onto;
use carom_contact::Met;
use carom_impact::{Energetic, Flags, Frictionless, ImpactOutcome, ImpactProblem, Law};
use nalgebra::Vector3;

/// A touch after an impact.
pub(crate) struct Struck {
    pub touch: usize,
    /// ġ before, m/s; 0 for a contact that lasted.
    pub approach: f64,
}

/// A damping; none where it is infinite because no joint moves the contact along its normal: the force does not change there.
fn finite(damping: f64) -> f64 {
    if damping.is_finite() { damping } else { 0.0 }
}

impl<A: Space> Run<'_, '_, A> {
    /// A touch has closed, alone or together with others.
    pub fn touch(&mut self, touch: usize) -> Result<(), SimError> {
        self.measure();
        let rest = self.motion.rest();
        let gaps = self.gaps()?;
        let approach = gaps.iter().find(|(k, _)| *k == touch).map_or(0.0, |(_, (_, rate))| *rate);
        if approach >= -self.motion.still() && self.motion.gaps.is_beside(touch, &self.motion.active.lasting) {
            // A crossing of edges that begins as a corner leaves its face: no impact, and no contact if it opens.
            let before = self.y.clone();
            let more = [touch];
            return self.resettle(None, if approach <= rest { &more } else { &[] }, &before);
        }
        if self.grazes(touch, approach)? {
            return Ok(());
        }
        let [mut together, beside] = self.others_closed(touch, &gaps)?;
        together.insert(0, touch);
        self.collide(&together, &beside)
    }

    /// Whether a gap that closes opens again by the motion without a contact, after a depth that is rounding: a path that is tangent to a
    /// surface. There the row of the normal is next to zero, and an impact would stop what moves along the surface.
    fn grazes(&mut self, touch: usize, approach: f64) -> Result<bool, SimError> {
        // No path of this curvature reaches deeper.
        let (scale, speed) = (&self.motion.scale, self.motion.active.speed);
        let hysteresis = scale.hysteresis(touch);
        if approach * approach > 2.0 * hysteresis * speed * speed * scale.per_touch[touch] / scale.length {
            return Ok(false);
        }
        let away = self.motion.gap_acceleration(touch, self.time, &self.y)?;
        Ok(approach * approach < 2.0 * away * hysteresis)
    }

    /// The other touches that are closed and do not last: those that approach, and those that do not move apart but could.
    pub fn others_closed(&mut self, touch: usize, gaps: &[Near]) -> Result<[Vec<usize>; 2], SimError> {
        let (mut hits, mut beside) = (Vec::new(), Vec::new());
        for &(other, (gap, rate)) in gaps {
            let (rest, open) = (self.motion.rest_of(other), gap > self.motion.scale.touching(other));
            if other == touch || self.motion.lasts(other) || open || rate > rest || self.moves_off(other)? {
                continue;
            }
            if rate < -rest {
                hits.push(other);
            } else if self.motion.moves(other, self.time, &self.y)? {
                beside.push(other);
            }
        }
        Ok([hits, beside])
    }

    /// Whether the contact point of a touch is on the border of its face, or at the end of its edge, and moves off it. The bodies open
    /// there, although the point may pass the plane of the face: a corner that slides off the edge of a table falls beside it. The
    /// velocity of the point along the face is that since a short time before, when it had not passed.
    fn moves_off(&mut self, touch: usize) -> Result<bool, SimError> {
        let sim = self.motion.sim;
        let one = &sim.touches[touch];
        let (q, qd) = self.q_qd();
        let here = one.at(&self.motion.view(&q)?, &q, self.time).margin;
        if here > 2.0 * Met::OUTSIDE || self.motion.active.speed == 0.0 {
            return Ok(false);
        }
        let back = CLEAR * self.motion.scale.length / self.motion.active.speed;
        let earlier = sim.chain.integrate(&q, &qd, -back)?;
        Ok(one.at(&self.motion.view(&earlier)?, &earlier, self.time - back).margin > here)
    }

    /// The impact of the touches `hits`, which approach, while those in `beside` are closed.
    pub fn collide(&mut self, hits: &[usize], beside: &[usize]) -> Result<(), SimError> {
        let mut rigid = Vec::new();
        for &touch in hits {
            if !self.gives_way(touch)? {
                rigid.push(touch);
            }
        }
        let before = self.y.clone();
        if rigid.is_empty() {
            return self.resettle(None, beside, &before);
        }
        if let Some(swarm) = self.swarm(&rigid)? {
            return self.several_impacts(&swarm, true);
        }
        if self.lies_flat(&rigid)? {
            return self.step_on(StepReason::Face);
        }
        let lasting: Vec<usize> =
            self.motion.active.lasting.iter().filter(|own| own.is_rigid()).map(|own| own.touch).collect();
        match *rigid.as_slice() {
            [touch] if lasting.is_empty() && beside.is_empty() => self.impact(touch),
            [touch] if beside.is_empty() && self.impact_beside(touch)? => Ok(()),
            _ => {
                rigid.extend(lasting);
                rigid.extend(beside);
                self.several_impacts(&rigid, false)
            }
        }
    }

    /// The closed touches whose impacts accumulate, if these are among them: impacts of several touches in turn, which the rule for a
    /// single one does not end. Their common impact without restitution then replaces the rest of them. Slow ones accumulate where many
    /// are within the Zeno time: their end changes velocities by less than a fall of some [`zeno_time`](crate::Simulation::zeno_time).
    /// Fast ones, of a light body between heavy ones, do where many are within a way of the size of a closed gap.
    fn swarm(&mut self, hits: &[usize]) -> Result<Option<Vec<usize>>, SimError> {
        let sim = self.motion.sim;
        let since = self.history.count(Class::Impact, self.time);
        let Some(since) = since.filter(|since| *since <= sim.zeno_time) else {
            return Ok(None);
        };
        let (way, scale) = (self.motion.active.speed * since, self.motion.scale.clone());
        let fast = way <= (Class::Impact.many() - 1) as f64 * EQUAL * scale.length;
        let slow = TAIL * sim.gravity.norm().max(scale.acceleration()) * sim.zeno_time;
        let mut swarm = Vec::new();
        for (touch, (gap, rate)) in self.gaps()? {
            let rigid = sim.touches[touch].contact.compliance.is_none();
            if rigid && gap <= scale.touching(touch) && (fast || rate.abs() <= slow * scale.per_touch[touch]) {
                swarm.push(touch);
            }
        }

        Ok((swarm.len() > 1 && hits.iter().all(|hit| swarm.contains(hit))).then_some(swarm))
    }

    /// Whether one of these touches is closed at several points.
    fn lies_flat(&mut self, touches: &[usize]) -> Result<bool, SimError> {
        let (q, _) = self.q_qd();
        let (sim, time) = (self.motion.sim, self.time);
        let within = EQUAL * self.motion.scale.length;
        let view = self.motion.view(&q)?;
        let flat = |touch: &usize| {
            let one = &sim.touches[*touch];
            !one.is_point() && one.points(&view, &q, time, within).len() > 2
        };
        Ok(touches.iter().any(flat))
    }

    /// Whether a compliant contact begins, instead of an impact.
    fn gives_way(&mut self, touch: usize) -> Result<bool, SimError> {
        let sim = self.motion.sim;
        let one = &sim.touches[touch];
        let (Some(compliance), Some(_)) = (one.contact.compliance, one.link()) else { return Ok(false) };
        let (_, approach) = self.gap(touch)?;
        let (q, _) = self.q_qd();
        let speed = (-approach).max(self.motion.scale.slowest());
        let law = compliance.normal(one.contact.law.restitution())?;
        let mass = self.motion.effective_mass(touch, &q, self.time)?;
        let depth = law.greatest_penetration(speed, mass);
        if sim.neglect.is_some_and(|share| depth <= share * self.motion.scale.length) {
            self.history.statistics.neglected_depth = self.history.statistics.neglected_depth.max(depth);
            return Ok(false);
        }
        self.motion.active.count_impact(touch, self.motion.sim);
        let before = self.y.clone();
        let old = self.motion.active.lasting.clone();
        self.press(touch, finite(law.damping(speed, mass)));
        self.note_changes(&old, &before);
        Ok(true)
    }

    /// The damping of a compliant contact that begins with this approach velocity, m/s; 0 for rigid ones.
    pub fn damping(&mut self, touch: usize, approach: f64) -> Result<f64, SimError> {
        let rule = &self.motion.sim.touches[touch].contact;
        let Some(compliance) = rule.compliance else { return Ok(0.0) };
        let (q, _) = self.q_qd();
        let mass = self.motion.effective_mass(touch, &q, self.time)?;
        let law = compliance.normal(rule.law.restitution())?;
        Ok(finite(law.damping(approach.max(self.motion.scale.slowest()), mass)))
    }

    /// Sets what the compliant contacts of a start remember: the damping by their approach, and the depth from which they unload, if they do.
    pub fn remember(&mut self) -> Result<(), SimError> {
        for k in 0..self.motion.active.lasting.len() {
            let own = self.motion.active.lasting[k];
            let Hold::Presses { deepest, .. } = own.hold else { continue };
            let (gap, rate) = self.gap(own.touch)?;
            let damping = self.damping(own.touch, -rate)?;
            let deepest = if deepest.is_finite() { -gap } else { deepest };
            self.motion.active.lasting[k].hold = Hold::Presses { damping, deepest };
        }
        Ok(())
    }

    /// The beginning of a compliant contact.
    pub fn press(&mut self, touch: usize, damping: f64) {
        let tail = self.motion.sim.chain.nq() + self.motion.sim.chain.nv() + 2;
        if let Some(slot) = self.motion.bristles.iter().position(|&k| k == touch) {
            self.y[tail + 3 * slot..tail + 3 * slot + 3].fill(0.0); // no deflection of the bristle
        }
        self.motion.active.lasting.push(Lasting { touch, hold: Hold::Presses { damping, deepest: f64::NEG_INFINITY } });
    }

    /// The impact of a single touch.
    fn impact(&mut self, touch: usize) -> Result<(), SimError> {
        let before = self.y.clone();
        let (q, qd) = self.q_qd();
        let (sim, time) = (self.motion.sim, self.time);
        let one = &sim.touches[touch];
        if one.contact.latch {
            return self.latch(touch);
        }
        let (_, approach, u) = self.motion.closing(touch, &q, &qd, time)?;
        let mut view = self.motion.view(&q)?;
        let at = one.at(&view, &q, time);
        match (at.surface, one.limit_of()) {
            (Some(place), _) => {
                let given = &one.contact.law;
                let (restitution, friction) = (given.restitution_at(-approach), given.friction());
                let Some((delassus, response)) = place.inertia(&mut view)? else {
                    let link = one.link().unwrap_or_default().to_owned();
                    return Err(SimError::SingularNormal { link, normal: place.normal });
                };
                let axes = z_onto(place.normal);
                let problem = ImpactProblem::from_gram(axes.transpose() * delassus * axes, axes.transpose() * u)?;
                let bound = friction_bound(&delassus, &place.normal, -approach, restitution, friction) / u.norm();
                let plain = Frictionless { restitution };
                let mut law: &dyn Law<f64, 3> = &**given;
                // The bound holds for the laws of `carom-impact`.
                if friction > 0.0 && !given.is_users() && sim.neglect.is_some_and(|share| bound <= share) {
                    law = &plain;
                    self.history.statistics.neglected_frictions += 1;
                    self.history.statistics.neglected_bound = self.history.statistics.neglected_bound.max(bound);
                }
                let hit = ChainImpact::of_outcome(problem.resolve(law)?, &axes, &response, &qd);
                self.book_single((touch, place.position), hit, Vec::new())?;
            }
            (None, joint) => {
                let (table, response, _) = self.closed_rows(&[touch])?;
                if table.rows.is_empty() {
                    return self.resettle(None, &[], &before); // loops lock the joint
                }
                let impulse =
                    -(1.0 + one.contact.law.restitution_at(-approach)) * approach / table.rows.dot(0, response.row(0));
                push(&mut self.y[q.len()..], &response, &[impulse]);
                let kind = EventKind::Limit { touch, joint: joint.unwrap_or_default().to_owned(), impulse };
                self.book(kind, &[touch], Vec::new(), &before)?;
            }
        }
        // The laws are exact: a separation velocity below the rounding of the approach velocity is zero.
        self.after(&[Struck { touch, approach }], ROUNDING * approach.abs(), &before)
    }

    /// The impact at a latch: the velocity of the contact point relative to the surface becomes zero.
    fn latch(&mut self, touch: usize) -> Result<(), SimError> {
        let before = self.y.clone();
        let old = self.motion.active.lasting.clone();
        self.motion.active.lasting.push(Lasting { touch, hold: Hold::Latched });
        self.motion.settle(self.time, &mut self.y)?;
        let change: Vec<f64> = self.q_qd().1.iter().zip(self.motion.split(&before).1).map(|(v, old)| v - old).collect();
        let impulses = self.motion.impulses_of(&change, self.time, &self.y)?;
        self.book(EventKind::Latch { touch }, &[touch], impulses, &before)?;
        self.motion.active.lasting = old;
        self.resettle(None, &[touch], &before)
    }

    /// The impact of a touch while others last, under its own law; `false` if the impulses of the others are not admissible.
    fn impact_beside(&mut self, touch: usize) -> Result<bool, SimError> {
        let (sim, time) = (self.motion.sim, self.time);
        let one = &sim.touches[touch];
        // The other laws of several contacts pass impulses on through lasting contacts: a cradle.
        if one.contact.latch || one.link().is_none() || sim.several != SeveralLaw::Moreau {
            return Ok(false);
        }
        let before = self.y.clone();
        let (q, qd) = self.q_qd();
        let (_, approach, u) = self.motion.closing(touch, &q, &qd, time)?;
        let Some(beside) = self.motion.beside(touch, time, &before)? else { return Ok(false) };
        let axes = z_onto(beside.normal);
        let problem = ImpactProblem::new(beside.delassus, axes.transpose() * u);
        let Ok(outcome) = problem.and_then(|problem| problem.resolve(&*one.contact.law)) else { return Ok(false) };
        let Some(impulses) = self.motion.carried(&beside, &outcome.impulse) else { return Ok(false) };
        let hit = ChainImpact::of_outcome(outcome, &axes, &beside.response, &qd);
        self.book_single((touch, beside.position), hit, impulses)?;
        let lasted = self.motion.active.lasting.iter().filter(|own| own.is_rigid());
        let mut struck: Vec<Struck> = lasted.map(|own| Struck { touch: own.touch, approach: 0.0 }).collect();
        struck.push(Struck { touch, approach });
        self.after(&struck, EXACT * approach.abs(), &before)?;
        Ok(true)
    }

    /// The velocities after the impact of one touch at this point, its event and its loss of energy; `others`: the impulses that lasting
    /// contacts carry.
    fn book_single(
        &mut self,
        (touch, point): (usize, Vector3<f64>),
        mut hit: Box<ChainImpact>,
        others: Vec<ContactImpulse>,
    ) -> Result<(), SimError> {
        let (before, nq) = (self.y.clone(), self.motion.sim.chain.nq());
        let (q, qd) = self.q_qd();
        let mut view = self.motion.view(&q)?;
        hit.energy_before = view.kin.kinetic_energy(&qd)?;
        hit.energy_after = view.kin.kinetic_energy(&hit.qd_plus)?;
        self.y[nq..nq + qd.len()].copy_from_slice(&hit.qd_plus);
        let own = ContactImpulse { touch, point, impulse: hit.impulse };
        let impulses = std::iter::once(own).chain(others).collect();
        self.book(EventKind::Impact { touch, hit }, &[touch], impulses, &before)
    }

    /// Tells an impact that has changed the state, counts it at the touches `hits`, and books its loss of energy: the only way by which
    /// impulses of impacts enter a run.
    pub fn book(
        &mut self,
        kind: EventKind,
        hits: &[usize],
        impulses: Vec<ContactImpulse>,
        before: &[f64],
    ) -> Result<(), SimError> {
        let motors = self.motor_forces(self.time, before)?;
        hits.iter().for_each(|&touch| self.motion.active.count_impact(touch, self.motion.sim));
        let loads = self.loads(before, &impulses, motors)?;
        self.note_impact(kind, before, impulses, loads);
        self.history.lost += self.motion.energy(before)? - self.motion.energy(&self.y)?;
        Ok(())
    }

    /// What opens, lasts or accumulates after an impact. Separation velocities up to `slack` (m/s) count as zero.
    pub fn after(&mut self, struck: &[Struck], slack: f64, before: &[f64]) -> Result<(), SimError> {
        self.motion.end_starts(self.time, (before, &self.y))?;
        let old = self.motion.active.lasting.clone();
        let (mut still, mut leaving) = (Vec::new(), Vec::new());
        for one in struck {
            let (_, rebound) = self.gap(one.touch)?;
            if rebound <= slack { still.push(one.touch) } else { leaving.push(one) }
        }
        if let Some(reason) = self.choose(&still)? {
            return self.no_mode(reason);
        }
        let start = self.y.clone();
        let ended = self.end_accumulations(&mut still, &mut leaving)?;
        if self.y != start {
            self.history.lost += self.motion.energy(&start)? - self.motion.energy(&self.y)?;
        }
        let (left, ending) = match ended {
            Ok(ended) => ended,
            Err(reason) => return self.no_mode(reason),
        };
        if !ending.is_empty() {
            let (from, y) = (self.time, self.y.clone());
            self.time += left;
            let told = match self.motion.contact_states(self.time, &y) {
                // Slip has ended within the jump: the mode that is chosen below has the forces.
                Err(SimError::Jam { .. }) => Vec::new(),
                told => told?,
            };
            let told = self.told(told, &y)?;
            self.sampler.stretch((from, self.time, 2), |_| y.clone(), |_, _| told.clone());
            for &touch in &ending {
                self.note(EventKind::Zeno { touch, impacts: self.motion.active.impacts[touch] }, &start);
            }
            if let Some(reason) = self.choose(&still)? {
                return self.no_mode(reason);
            }
        }
        self.note_changes(&old, before);
        self.rest()
    }

    /// Ends the accumulations of those touches of `leaving` whose impacts accumulate, which it moves to `still`: their normal velocities
    /// become zero, and the state moves on by the longest time that they take. Returns this time and the touches, or why no mode follows.
    fn end_accumulations(
        &mut self,
        still: &mut Vec<usize>,
        leaving: &mut Vec<&Struck>,
    ) -> Result<Result<(f64, Vec<usize>), StepReason>, SimError> {
        let (mut left, mut ending) = (0.0_f64, Vec::new());
        // Another contact that closes may push one back that was opening.
        while let Some((remaining, touches)) = self.accumulating(leaving)? {
            left = left.max(remaining);
            still.extend(&touches);
            ending.extend(touches);
            self.close(still)?;
            if let Some(reason) = self.choose(still)? {
                return Ok(Err(reason));
            }
        }
        if ending.is_empty() {
            return Ok(Ok((0.0, ending)));
        }
        Ok(self.pass(still, left)?.map(|left| (left, ending)).ok_or(StepReason::NoMode))
    }

    /// Takes those of the touches that are `leaving` away whose impacts accumulate soon in the present mode, and returns them with the
    /// longest time that this takes; `None`: there are none.
    fn accumulating(&mut self, leaving: &mut Vec<&Struck>) -> Result<Option<(f64, Vec<usize>)>, SimError> {
        let (mut left, mut ending) = (0.0_f64, Vec::new());
        for k in (0..leaving.len()).rev() {
            let one = leaving[k];
            let (_, rebound) = self.gap(one.touch)?;
            let toward = -self.motion.gap_acceleration(one.touch, self.time, &self.y)?;
            // A contact that lasted has an approach velocity of the size of rounding, of either sign.
            let share = if one.approach < -self.motion.rest_of(one.touch) { rebound / -one.approach } else { 0.0 };
            let remaining = 2.0 * rebound / (toward * (1.0 - share));
            // Bounces that are not higher than the tolerance, or cannot be told from rounding. The error of the step over them is of third
            // order.
            let Motion { sim, scale, .. } = &self.motion;
            // The impact before this one met the conditions.
            let before = if self.history.ends_later && share < 1.0 { share } else { 1.0 };
            let lowest = (20.0 * scale.rounding()).max(sim.tolerance * scale.reach * before * before);
            let flat = rebound * rebound < 2.0 * toward * lowest * scale.per_touch[one.touch];
            let longest = sim.zeno_time * before;
            // Without loss flat bounces do not accumulate, but they are as many.
            if toward > 0.0 && (share < 1.0 && (remaining < longest || flat) || share < 1.0 + EQUAL && flat) {
                left = left.max(remaining.min(longest.max(EXACT.cbrt() / scale.pace)));
                ending.push(leaving.swap_remove(k).touch);
            }
        }
        Ok((!ending.is_empty()).then_some((left, ending)))
    }

    /// Moves the state on by the time `left` that the accumulation of these touches takes, or by none where the run ends, another gap
    /// closes or a slip ends within it: the next leg finds it. Returns the time by which it is moved; `None`: sliding jams.
    fn pass(&mut self, touches: &[usize], left: f64) -> Result<Option<f64>, SimError> {
        if self.time + left > self.end {
            return Ok(Some(0.0));
        }
        let closed = self.y.clone();
        match self.motion.pass(left, self.time, &mut self.y) {
            Err(SimError::Jam { .. }) => return Ok(None),
            done => done?,
        }
        if self.is_crossed(touches)? || self.motion.moves_back(self.time + left, &self.y)? {
            self.y = closed;
            return Ok(Some(0.0));
        }
        Ok(Some(left))
    }

    /// Whether the gap of a touch that neither lasts nor is one of these has closed: it did within the jump to this state.
    fn is_crossed(&mut self, still: &[usize]) -> Result<bool, SimError> {
        let gaps = self.gaps()?;
        let crossed =
            |&(k, (gap, rate)): &Near| gap < 0.0 && rate < 0.0 && !still.contains(&k) && !self.motion.lasts(k);
        Ok(gaps.iter().any(crossed))
    }

    /// Sets the normal velocities of these touches to zero: the end of their impacts.
    fn close(&mut self, touches: &[usize]) -> Result<(), SimError> {
        let candidates: Result<Vec<Lasting>, SimError> =
            touches.iter().map(|&touch| self.motion.candidate(touch, self.time, &self.y)).collect();
        self.motion.shut(&candidates?, self.time, &mut self.y)
    }

    /// The motion has no consistent mode: an impact without collision, or time steps.
    pub fn no_mode(&mut self, reason: StepReason) -> Result<(), SimError> {
        let gaps = self.gaps()?;
        let motion = &self.motion;
        let rigid = |k: &usize| motion.sim.touches[*k].contact.compliance.is_none();
        let closed: Vec<usize> = (gaps.into_iter())
            .filter(|(k, (gap, rate))| *gap <= motion.scale.touching(*k) && rate.abs() <= motion.rest_of(*k))
            .map(|(k, _)| k)
            .filter(rigid)
            .collect();
        let jumped = match *closed.as_slice() {
            [] => false,
            [touch] => self.without_collision(touch)?,
            _ => reason != StepReason::Face && self.several_without_collision(&closed)?,
        };
        if jumped { Ok(()) } else { self.step_on(reason) }
    }

    /// An impact without collision (Painlevé): the limit of the law's outcome for a vanishing approach velocity, for a single
    /// closed contact that slides and jams, or whose slip turns into a jam. Of a law without one, such as that without friction, that of
    /// Coulomb's friction along the impulse (Routh; Stronge's law without restitution). `false` if there is none.
    fn without_collision(&mut self, touch: usize) -> Result<bool, SimError> {
        let rest = self.motion.rest();
        let (sim, time) = (self.motion.sim, self.time);
        let one = &sim.touches[touch];
        if !one.is_point() {
            return Ok(false);
        }
        let before = self.y.clone();
        let (q, qd) = self.q_qd();
        let (_, _, u) = self.motion.closing(touch, &q, &qd, time)?;
        let mut view = self.motion.view(&q)?;
        let Some(place) = one.at(&view, &q, time).surface else { return Ok(false) };
        let ended = direction_of_slip(u, place.normal, rest).is_none();
        if ended || self.history.count(Class::Jam, time) == Some(0.0) {
            return Ok(false);
        }
        let Some((delassus, response)) = place.inertia(&mut view)? else { return Ok(false) };
        let axes = z_onto(place.normal);
        let mut along = axes.transpose() * u;
        along.z = 0.0;
        let gram = axes.transpose() * delassus * axes;
        // A slip that turns into a jam reaches it by a finite impulse in no time: it is as near as an approach that is a tie, to which the
        // impulse has to be large.
        let Scale { length, pace, .. } = self.motion.scale;
        let tie = EQUAL * along.norm().max(length * pace);
        let is_finite = |hit: &ImpactOutcome<f64, 3>| {
            let approach = -hit.u_minus.z;
            (approach > 0.0 || hit.flags.contains(Flags::JAM))
                && EQUAL * hit.impulse.z * gram[(2, 2)] > CLEAR * approach
        };
        let routh = Energetic { restitution: 0.0, friction: one.contact.law.friction() };
        let laws: [&dyn Law<f64, 3>; 2] = [&*one.contact.law, &routh];
        let mut found = None;
        for (law, approach) in laws.into_iter().flat_map(|law| [(law, 0.0), (law, tie)]) {
            along.z = -approach;
            let problem = ImpactProblem::from_gram(gram, along);
            let hits = problem.and_then(|problem| law.branches(&problem)).unwrap_or_default();
            found = hits.into_iter().find(is_finite);
            if found.is_some() {
                break;
            }
        }
        let Some(outcome) = found else { return Ok(false) };
        let hit = ChainImpact::of_outcome(outcome, &axes, &response, &qd);
        self.book_single((touch, place.position), hit, Vec::new())?;
        self.after(&[Struck { touch, approach: 0.0 }], rest, &before)?;
        Ok(true)
    }
}
