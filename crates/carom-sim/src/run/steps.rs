//! Moreau–Jean time steps, where no mode of several contacts is consistent or the integrators fail.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | h | 1 | step | `step` |
//! | R | m×nv | rows of all constraints in contact axes, tangents first, normal last | `rows` |
//! | p | m | impulses | `impulse` |
//!
//! One time step (J. J. Moreau 1988, M. Jean 1999, θ = ½): half a step of positions, qₘ = q + ½ h q̇; the contacts that are
//! closed at qₘ; q̇⁺ = q̇ + h M⁻¹f + M⁻¹Rᵀp, with p by the law of several contacts ([`SeveralLaw`]); the second half step with
//! q̇⁺. The contact law is imposed on velocities, so a step may contain any number of impacts, and positions overlap by
//! O(h v). Overlaps are corrected along M⁻¹Rᵀ down to the overlap of one step of free fall: after a correction to a gap of
//! zero the contact would open and close in alternate steps and never come to rest.
//!
//! Compliant contacts press at their state in the middle of the step, as the drives do.
//!
//! **Error and step.** The difference of the positions after one step and after two of half its length estimates the error of the
//! step; the motion goes on from the two. The step is accepted where the estimate is at most 0.01 √(tolerance) (rad, or the length of the
//! scene, `motion/zero.rs`), and the next
//! one follows from it, because the error of a step is of second order in its length. An impact within a step has an error of first
//! order: the shortest step is 1/256 of `contact_step`, the longest is `contact_step`. Where time steps are asked for, all have the
//! length `contact_step`.
//!
//! **Their end.** Where no mode is consistent (Painlevé) there is an impact without collision, and a mode after it: the first step is the
//! shortest, and a mode is looked for after it, of the contacts that carried load in the step and of those that are closed. If there is
//! none, or if the events that follow end soon at the next inconsistency, the next stretch of steps is twice as long. So the number of
//! stretches in a time is bounded, and most of it is covered by events where that is possible.

use super::history::History;
use super::run_state::Run;
use super::sampler::Told;
use super::trajectory::{EventKind, StepReason};
use crate::contact::{ContactMode, SeveralLaw, Touch};
use crate::error::SimError;
use crate::motion::{
    ACCURACY, Constraints, Contact, ContactState, Dry, Hold, Lasting, Level, Loads, Motion, Near, is_reached, push,
};
use crate::state::{CLEAR, EQUAL, EXACT, GROWTH, Loops, Space, View};
use carom_chain::{ChainError, Rows};
use carom_impact::{Accuracy, Constraint, Flags, SeveralProblem};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};

/// Accuracy of the impulses of a time step: far below the error of time stepping.
const STEP_ACCURACY: Accuracy = Accuracy { tolerance: 1e-10, ..ACCURACY };
/// After at most this number of steps of full length a consistent mode is looked for; after this number without motion the chain is at rest.
const WAIT: f64 = 20.0;
/// The error of a step that is accepted, as a multiple of the square root of the tolerance.
const SHARE: f64 = 0.01;
/// The full length over the shortest. Stretches of time steps become longer where the events between them last less than so many of them.
const SHORTEST: f64 = 256.0;
/// The share of the length that the estimated error allows.
const SAFE: f64 = 0.9;
/// Iterations of the implicit midpoint rule for the Coriolis forces; each is exact to one more power of the turn in a step.
const MIDPOINT: usize = 3;

/// A time step that was made.
struct TimeStep {
    start: f64,
    end: f64,
    /// q and qd at its start.
    before: (Vec<f64>, Vec<f64>),
    /// q at its middle.
    middle: Vec<f64>,
    /// The state at its end.
    after: Vec<f64>,
    told: Told,
    /// Whether all velocities are zero.
    still: bool,
}

/// A time step before its impulses.
struct Posed {
    /// q at its middle, and the state there with q̇ of its start.
    middle: Vec<f64>,
    there: Vec<f64>,
    /// The compliant contacts.
    contacts: Vec<ContactState>,
    /// Rates of the deflections of compliant contacts.
    bends: Vec<f64>,
    mass: DMatrix<f64>,
    /// q̇ at its start, and at its end without impulses.
    v: DVector<f64>,
    free: DVector<f64>,
    /// The rows of the impulses, and the responses to them.
    table: Constraints,
    responses: Rows,
    /// The velocities along the rows, relative to the surfaces: at its start, and at its end without impulses.
    u: [DVector<f64>; 2],
}

impl<A: Space> Run<'_, '_, A> {
    /// Time steps until the motion with the contacts that are closed then has a consistent mode, the chain is at rest, or the run
    /// ends.
    pub fn several_contacts(&mut self) -> Result<(), SimError> {
        let sim = self.motion.sim;
        let (mut still, mut since) = (0.0, 0.0);
        let mut length = sim.contact_step.min(self.history.wait);
        while self.time < self.end {
            sim.go_on(self.time)?;
            let start = self.time;
            let until = self.end.min(sim.next_kink(&self.motion.moving, start));
            if is_reached(until, self.time, self.motion.scale.pace) {
                self.time = until;
                continue;
            }
            let longest = until - start;
            let inactive = self.inactive()?;
            let done = if sim.stepping {
                self.time_step(sim.contact_step.min(longest), &inactive)?
            } else {
                let longest = longest.min((self.history.wait - since).max(self.shortest()));
                self.controlled_step(&mut length, longest, &inactive)?
            };
            for &(touch, (gap, _)) in &inactive {
                if gap < -self.motion.scale.touching(touch) && self.motion.may_close(touch, &self.y) {
                    self.refuse_overlap(touch)?;
                }
            }
            let is_still = done.still;
            self.tell(done);
            let step = self.time - start;
            since += step;
            if since > self.history.wait - 0.5 * self.shortest() && !sim.stepping {
                if self.resumes(step)? {
                    self.history.resumed = Some(self.time);
                    return Ok(());
                }
                since = 0.0;
                self.history.wait = (2.0 * self.history.wait).min(WAIT * sim.contact_step);
            }
            still = if is_still { still + step } else { 0.0 };
            // Half a step less, because times are rounded.
            if still >= (WAIT - 0.5) * sim.contact_step && self.is_steady() {
                self.put_back(0.0, &inactive)?;
                let y = self.y.clone();
                if !std::mem::replace(&mut self.history.resting, true) {
                    self.note(EventKind::Rest, &y);
                }
                self.stay()?;
            }
        }
        Ok(())
    }

    fn shortest(&self) -> f64 {
        self.motion.sim.contact_step / SHORTEST
    }

    /// Continues by time steps.
    pub fn step_on(&mut self, reason: StepReason) -> Result<(), SimError> {
        let sim = self.motion.sim;
        let first = match reason {
            // After an impact without collision there is a mode.
            StepReason::NoMode => self.shortest(),
            StepReason::Crowd | StepReason::Stiff | StepReason::Asked => sim.contact_step,
            // Contacts that are not divided into points have no mode.
            StepReason::Face => 0.5 * WAIT * sim.contact_step,
        };
        let History { wait, resumed, .. } = &mut self.history;
        *wait = match resumed {
            Some(resumed) if self.time - *resumed < SHORTEST * *wait => first.max(2.0 * *wait),
            _ => first.max(0.5 * *wait),
        };
        *wait = wait.min(WAIT * sim.contact_step);
        let before = self.y.clone();
        self.motion.active.let_go();
        self.note(EventKind::Steps { reason }, &before);
        Ok(())
    }

    /// Two time steps of half a length, which is shortened until the error is accepted or the step is the shortest. `length`: that
    /// of this and of the next step, s; `longest`: its limit now.
    fn controlled_step(&mut self, length: &mut f64, longest: f64, inactive: &[Near]) -> Result<TimeStep, SimError> {
        let sim = self.motion.sim;
        let nq = sim.chain.nq();
        let accepted = SHARE * sim.tolerance.sqrt();
        let shortest = self.shortest();
        let begin = (self.time, self.y.clone(), self.history.lost, self.history.statistics, self.motion.active.clone());
        let rewind = |run: &mut Self| {
            (run.time, run.y, run.history.lost, run.history.statistics, run.motion.active) = begin.clone();
        };
        loop {
            let step = length.min(longest);
            self.time_step(step, inactive)?;
            let whole = self.y.clone();
            rewind(self);
            let first = self.time_step(step / 2.0, inactive)?;
            let second = self.time_step(step / 2.0, inactive)?;
            let error = whole[..nq].iter().zip(&self.y).map(|(one, two)| (one - two).abs()).fold(0.0, f64::max);
            let share = self.motion.scale.apart(&whole[..nq], &self.y[..nq]);
            let ends = share <= accepted || step <= shortest;
            // A step that the end or a kink of the forces shortens says nothing about longer ones.
            if !(ends && step < *length) {
                let factor = (SAFE * (accepted / share).sqrt()).clamp(1.0 / GROWTH, GROWTH);
                *length = (step * factor).clamp(shortest, sim.contact_step);
            }
            if ends {
                self.history.statistics.step_error += error;
                let still = first.still && second.still;
                self.tell(first);
                return Ok(TimeStep { still, ..second });
            }
            rewind(self);
        }
    }

    /// Continues event-driven after a time step of this length, s, if the contacts that carried load in it and those that are
    /// closed have a consistent mode; `false` leaves the state as it was.
    fn resumes(&mut self, step: f64) -> Result<bool, SimError> {
        let sim = self.motion.sim;
        let (before, lost) = (self.y.clone(), self.history.lost);
        let inactive = self.inactive()?;
        self.put_back(0.0, &inactive)?;
        self.measure();
        let gravity = sim.gravity.norm().max(self.motion.scale.acceleration());
        // Within one step of fall, in position and velocity.
        let (depth, speed) = (4.0 * gravity * step.powi(2), 4.0 * gravity * step);
        let loaded: Vec<bool> = (0..sim.touches.len()).map(|touch| self.history.carried(touch)).collect();
        let (mut hits, mut closed) = (Vec::new(), Vec::new());
        let gaps = self.motion.all_gaps(self.time, &self.y, |motion, near| loaded[near.0] || motion.rests(near))?;
        for (touch, (gap, rate)) in gaps {
            let (rest, touching) = (self.motion.rest_of(touch), self.motion.scale.touching(touch));
            let lasts = loaded[touch] && gap <= depth && rate.abs() <= speed;
            if self.motion.lasts(touch) || !lasts && (gap > touching || rate > rest) {
                continue;
            }
            if lasts || rate >= -rest { closed.push(touch) } else { hits.push(touch) }
        }
        let points = hits.iter().chain(&closed).all(|&touch| sim.touches[touch].is_point());
        let hold = Hold::Slides { toward: Vector3::zeros() };
        let normals: Vec<Lasting> = closed.iter().map(|&touch| Lasting { touch, hold }).collect();
        // Within a time step dry friction holds every joint.
        self.motion.brake(&self.y);
        self.motion.project((&normals, &normals), self.time, &mut self.y)?;
        let (gaps, scale) = (self.gaps()?, &self.motion.scale);
        let fine = |&(k, (gap, _)): &Near| gap >= -scale.touching(k) || sim.touches[k].is_compliant();
        let clear = points && gaps.iter().all(fine);
        if !clear || hits.is_empty() && !self.has_mode(&closed)? {
            (self.y, self.history.lost) = (before, lost);
            self.motion.active.let_go();
            return Ok(false);
        }
        self.motion.active.stepping = false;
        if !hits.is_empty() {
            match self.collide(&hits, &closed) {
                // After the impact friction jams: the steps go on.
                Err(SimError::Jam { .. }) => {
                    self.motion.active.let_go();
                    return Ok(false);
                }
                done => done?,
            }
        } else if closed.is_empty() {
            self.note(EventKind::Mode { mode: ContactMode::Free }, &before);
        } else {
            self.note_changes(&[], &before);
            self.rest()?;
        }
        Ok(true)
    }

    /// Chooses the modes of these contacts; whether they are consistent.
    fn has_mode(&mut self, closed: &[usize]) -> Result<bool, SimError> {
        if self.choose(closed)?.is_some() {
            return Ok(false);
        }
        match self.motion.accelerations(self.time, &self.y) {
            Err(SimError::Jam { .. }) => Ok(false),
            held => held.map(|_| true),
        }
    }

    /// Whether a chain at rest stays at rest: no drive or surface depends on time.
    pub fn is_steady(&self) -> bool {
        self.motion.moving.is_empty() && self.motion.sim.is_steady(self.time)
    }

    /// Begins and ends compliant contacts at the middle of a step; returns those that press. What they remember of their largest penetration
    /// follows their rate.
    fn press_in_step(&mut self, time: f64, y: &[f64]) -> Result<Vec<ContactState>, SimError> {
        let sim = self.motion.sim;
        if !sim.touches.iter().any(Touch::is_compliant) {
            return Ok(Vec::new());
        }
        let gaps = self.motion.all_gaps(time, y, |_, _| false)?;
        let closed = |touch: usize| gaps.iter().find(|(k, (gap, _))| *k == touch && *gap <= 0.0).map(|(_, gap)| *gap);
        self.motion.active.lasting.retain(|own| closed(own.touch).is_some());
        for own in &mut self.motion.active.lasting {
            let (gap, rate) = closed(own.touch).unwrap_or_default();
            if let Hold::Presses { deepest, .. } = &mut own.hold {
                match *deepest {
                    f64::NEG_INFINITY if rate > 0.0 => *deepest = -gap,
                    most if -gap > most => *deepest = f64::NEG_INFINITY,
                    _ => {}
                }
            }
        }
        let begins = |k: &usize| sim.touches[*k].is_compliant() && !self.motion.lasts(*k);
        let begin: Vec<(usize, f64)> =
            gaps.iter().filter(|(k, (gap, _))| *gap <= 0.0 && begins(k)).map(|(k, (_, rate))| (*k, -rate)).collect();
        for (touch, approach) in begin {
            let damping = self.damping(touch, approach)?;
            self.motion.active.count_impact(touch, self.motion.sim);
            self.press(touch, damping);
        }
        if self.motion.active.lasting.is_empty() { Ok(Vec::new()) } else { self.motion.contact_states(time, y) }
    }

    /// The touches whose condition does not hold and that do not last: they carried no load in the last step, and are not closed at rest.
    fn inactive(&mut self) -> Result<Vec<Near>, SimError> {
        let (sim, mut found) = (self.motion.sim, Vec::new());
        for k in (0..sim.touches.len()).filter(|&k| sim.touches[k].closes_while.is_some()) {
            if !self.motion.may_close(k, &self.y) && !self.history.carried(k) {
                let near = (k, self.gap(k)?);
                found.extend((!self.motion.rests(&near)).then_some(near));
            }
        }
        Ok(found)
    }

    /// The contact problem of a time step of this length, s, as [`Self::time_step`] poses it.
    pub fn contact_problem(&mut self, step: f64) -> Result<SeveralProblem, SimError> {
        let inactive = self.inactive()?;
        let Posed { table, responses, u, .. } = self.posed(step, &inactive)?;
        let laws = table.laws(self.motion.sim, &self.motion.active.dry, step, Some(&u[0]));
        table.problem(&responses, laws, u.each_ref())
    }

    /// What the impulses of a time step of this length, s, are found from.
    fn posed(&mut self, step: f64, inactive: &[Near]) -> Result<Posed, SimError> {
        let sim = self.motion.sim;
        let nv = sim.chain.nv();
        let (q, qd) = self.q_qd();
        let (start, middle_time) = (self.time, self.time + step / 2.0);
        let middle = sim.chain.integrate(&q, &qd, step / 2.0)?;
        // All dry friction is part of the contact problem, so none of it is applied as a force.
        self.motion.active.dry.iter_mut().for_each(|joint| joint.state = Dry::Holds);
        let mut there = self.y.clone();
        there[..q.len()].copy_from_slice(&middle);
        let contacts = self.press_in_step(middle_time, &there)?;
        let Loads { tau, bends, .. } = self.motion.loads(middle_time, &there)?;
        let dry = self.motion.active.dry.clone();
        let (stiffness, damping) = self.motion.regulation(&[]);
        let Motion { model, workspace, couplings, gaps: near, scale, .. } = &mut self.motion;
        let mut view = View::closed_by(*model, workspace, &middle, couplings)?;
        let v = DVector::from_column_slice(&qd);
        // Damping and controllers are implicit (velocity at the end of the step), so that stiff ones stay stable:
        // (M + h D + ½h² K)(q̇⁺ − q̇) = h f − ½h² K q̇ + Rᵀp.
        let mass = view.kin.mass_matrix();
        let mut inertia = mass.clone();
        for i in 0..nv {
            inertia[(i, i)] += step * damping[i] + step * step / 2.0 * stiffness[i];
        }
        if inertia.iter().any(|x| !x.is_finite()) {
            return Err(SimError::Diverged { time: start });
        }
        let inertia = inertia.cholesky().ok_or(ChainError::NoInertia { joint: sim.chain.name().to_owned() });
        let inertia = inertia.map_err(SimError::from)?;
        let tau = DVector::from_vec(tau);
        let carried = DVector::from_fn(nv, |i, _| v[i] * (step * step / 2.0 * stiffness[i]));
        let loops = view.loop_rows()?;
        let closed = Loops::new(loops.clone(), solved(&inertia, &loops), A::LINEAR);
        // Coriolis forces at the mean of both velocities: with those at q̇ a spinning body gains energy in every step.
        let (mut free, mut mean) = (v.clone(), v.clone());
        for _ in 0..MIDPOINT {
            let force = &tau - view.bias(mean.as_slice(), sim.gravity)?;
            free = &v + inertia.solve(&(force * step - &carried));
            if free.iter().any(|x| !x.is_finite()) {
                return Err(SimError::Diverged { time: start });
            }
            if let Some(closed) = &closed {
                closed.bind(free.as_mut_slice(), None);
            }
            mean = (&v + &free) * 0.5;
        }

        let mut table = Constraints::new(nv);
        for k in near.near(&view, (&middle, &qd), middle_time, EQUAL * scale.length)? {
            let touch = &sim.touches[k];
            if touch.is_compliant() || inactive.iter().any(|own| own.0 == k) {
                continue;
            }
            for at in touch.points(&view, &middle, middle_time, scale.touching(k)) {
                if touch.moves(&at, &mut view)? {
                    table.add(
                        (&Lasting::of(k, touch, None), touch),
                        (&at, Some(&view)),
                        middle_time,
                        Level::Velocities,
                    )?;
                }
            }
        }
        table.hold(&dry);
        let mut responses = solved(&inertia, &table.rows);
        if let Some(closed) = &closed {
            let rows = table.rows.iter().zip(responses.iter_mut());
            rows.for_each(|(row, response)| closed.bind_response(row, response));
        }
        let u = [&v, &free].map(|v| table.excess(v.as_slice()));
        Ok(Posed { middle, there, contacts, bends, mass, v, free, table, responses, u })
    }

    /// One time step of this length, s, in which the touches that are `inactive` do not close.
    fn time_step(&mut self, step: f64, inactive: &[Near]) -> Result<TimeStep, SimError> {
        let sim = self.motion.sim;
        let (nq, nv) = (sim.chain.nq(), sim.chain.nv());
        let start = self.time;
        let Posed { middle, mut there, mut contacts, bends, mass, v, free, table, responses, u } =
            self.posed(step, inactive)?;
        let (q, qd) = self.q_qd();
        let (middle_time, open) = (start + step / 2.0, table.contacts.is_empty());
        let mut next = free.clone();
        let mut fall = 0.0_f64;
        if !table.rows.is_empty() {
            fall = (&u[0] - &u[1]).amax() * step;
            let guess = guess(&table, &self.history.stepped, step);
            let laws = table.laws(sim, &self.motion.active.dry, step, Some(&u[0]));
            let outcome =
                self.solve((&table, &responses, laws), u.each_ref(), (sim.several, &STEP_ACCURACY), Some(&guess))?;
            self.history.statistics.worst_residual = self.history.statistics.worst_residual.max(outcome.residual);
            push(next.as_mut_slice(), &responses, outcome.impulse.as_slice());
            self.refuse_squeeze((&table, &responses), outcome.residual, next.as_slice())?;
            let open = outcome.flags.contains(Flags::NON_UNIQUE);
            self.history.statistics.non_unique_time += if open { step } else { 0.0 };
            // ½ (u⁻ + u⁺)·p, the work of the impulses on the robot: exact for the jump of q̇ at the mass matrix of the middle.
            // Impacts are of contacts that approach and carried nothing in the step before.
            for contact in &table.contacts {
                let (touch, n) = (contact.own.touch, contact.rows.end - 1);
                if outcome.impulse[n] > 0.0 && u[0][n] < -self.motion.rest_of(touch) && !self.history.carried(touch) {
                    self.motion.active.count_impact(touch, sim);
                }
            }
            let mean = (&v + &next) * 0.5;
            let work: f64 =
                outcome.impulse.iter().enumerate().map(|(i, p)| p * table.rows.dot(i, mean.as_slice())).sum();
            self.history.lost -= work;
            let still = table.surface.iter().all(|speed| *speed == 0.0);
            let mut flags = if open { Flags::NON_UNIQUE } else { Flags::NONE };
            let twice = |v: &DVector<f64>| v.dot(&(&mass * v));
            // Impulses of support work as well, while a body still moves up.
            if still && work > 0.0 && twice(&next) > (1.0 + CLEAR) * twice(&v).max(twice(&free)) {
                flags |= Flags::ENERGY_GAIN;
                self.history.statistics.energy_gained += work;
            }
            contacts.extend(contact_states(&table, outcome.impulse.as_slice(), step, flags));
        }
        // Drive and resistance work at the mean velocity, as the impulses do.
        let mean = qd.iter().zip(&next).map(|(before, after)| 0.5 * (before + after));
        there[nq..nq + nv].iter_mut().zip(mean).for_each(|(v, mean)| *v = mean);
        let power = self.motion.loads(middle_time, &there)?.power;
        let motors = self.motor_forces(middle_time, &there)?;
        let moved = sim.chain.integrate(&middle, next.as_slice(), step / 2.0)?;
        self.y[..nq].copy_from_slice(&moved);
        self.y[nq..nq + nv].copy_from_slice(next.as_slice());
        sim.normalise(&mut self.y);
        self.time = start + step;
        if !open {
            self.put_back(2.0 * fall, inactive)?;
        }
        self.motion.close_loops(&mut self.y)?;

        self.history.statistics.contact_steps += 1;
        self.y[nq + nv] += power[0] * step;
        self.y[nq + nv + 1] += power[1] * step;
        self.y[nq + nv + 2..].iter_mut().zip(&bends).for_each(|(deflection, rate)| *deflection += rate * step);
        if !self.motion.energy(&self.y)?.is_finite() {
            return Err(SimError::Diverged { time: start });
        }
        let scale = &self.motion.scale;
        let still = scale.fastest(next.iter()) < 0.1 * EQUAL * scale.length * scale.pace;
        let told = Told { contacts, motors };
        Ok(TimeStep { start, end: self.time, before: (q, qd), middle, after: self.y.clone(), told, still })
    }

    /// The samples of a step: positions are linear in time in each half of it, with the velocity before and after it.
    fn tell(&mut self, done: TimeStep) {
        let TimeStep { start, end, before: (q, qd), middle, after, told, .. } = done;
        let chain = &self.motion.sim.chain;
        let (nq, nv, half) = (chain.nq(), chain.nv(), (end - start) / 2.0);
        let at = |time: f64| {
            let (from, rate, span) = if time <= start + half {
                (&q, qd.as_slice(), time - start)
            } else {
                (&middle, &after[nq..nq + nv], time - start - half)
            };
            let mut state = after.clone();
            if let Ok(there) = chain.integrate(from, rate, span) {
                state[..nq].copy_from_slice(&there);
            }
            state[nq..nq + nv].copy_from_slice(rate);
            state
        };
        self.sampler.stretch((start, end, 2), at, |_, _| told.clone());
        self.history.stepped = told.contacts;
    }

    /// Corrects overlaps above `allowed` (m) by the smallest displacement in the kinetic metric: with the gaps g + allowed,
    /// 0 ≤ g + R δ ⟂ π ≥ 0, δ = M⁻¹Rᵀπ. Those of the touches that are `inactive` remain.
    fn put_back(&mut self, allowed: f64, inactive: &[Near]) -> Result<(), SimError> {
        let sim = self.motion.sim;
        let (q, qd) = self.q_qd();
        let time = self.time;
        let (mut table, mut responses) = (Constraints::new(qd.len()), Rows::default());
        let Motion { model, workspace, couplings, gaps: near, scale, .. } = &mut self.motion;
        let mut view = View::closed_by(*model, workspace, &q, couplings)?;
        for k in near.near(&view, (&q, &qd), time, 0.0)? {
            let touch = &sim.touches[k];
            if touch.is_compliant() || inactive.iter().any(|own| own.0 == k) {
                continue;
            }
            for at in touch.points(&view, &q, time, 0.0) {
                table.add((&Lasting::of(k, touch, None), touch), (&at, Some(&view)), time, Level::Positions)?;
            }
        }
        let overlap = |k: usize| EXACT * scale.length * scale.per_touch[k];
        if table.contacts.iter().all(|contact| contact.gap + allowed > -overlap(contact.own.touch)) {
            return Ok(());
        }
        view.respond(&table.rows, &mut responses)?;
        let gaps = DVector::from_fn(table.contacts.len(), |i, _| table.contacts[i].gap + allowed);
        let laws = vec![Constraint::Stop { restitution: 0.0 }; gaps.len()];
        let outcome =
            self.solve((&table, &responses, laws), [&gaps, &gaps], (SeveralLaw::Moreau, &STEP_ACCURACY), None)?;
        let mut back = vec![0.0; qd.len()];
        push(&mut back, &responses, outcome.impulse.as_slice());
        let moved = sim.chain.integrate(&q, &back, 1.0)?;
        self.y[..q.len()].copy_from_slice(&moved);
        Ok(())
    }
}

/// The contacts of a time step of this length with these impulses and flags.
fn contact_states(table: &Constraints, impulse: &[f64], step: f64, flags: Flags) -> Vec<ContactState> {
    let state = |contact: &Contact| ContactState {
        touch: contact.own.touch,
        mode: ContactMode::Stepping,
        point: contact.position,
        normal: contact.normal,
        gap: contact.gap,
        force: contact.force(impulse) / step,
        normal_force: impulse[contact.rows.end - 1] / step,
        flags,
    };
    table.contacts.iter().map(state).collect()
}

/// Impulses of a time step of this length by the forces of the step before, where a contact had one.
fn guess(table: &Constraints, before: &[ContactState], step: f64) -> DVector<f64> {
    let mut guess = DVector::zeros(table.rows.len());
    for contact in &table.contacts {
        let Some(state) = before.iter().find(|state| state.touch == contact.own.touch) else { continue };
        guess[contact.rows.end - 1] = state.normal_force * step;
        if let (Some(axes), 3) = (&contact.directions, contact.rows.len()) {
            guess.rows_mut(contact.rows.start, 3).copy_from(&(axes.tr_mul(&state.force) * step));
        }
    }
    guess
}

/// The solutions for these rows, as rows.
fn solved(inertia: &Cholesky<f64, Dyn>, rows: &Rows) -> Rows {
    let mut responses = Rows::new(inertia.l_dirty().nrows());
    for row in rows.iter() {
        responses.add().copy_from_slice(inertia.solve(&DVector::from_column_slice(row)).as_slice());
    }
    responses
}
