//! Several contacts at the same time: their impact as one problem, and Moreau–Jean time stepping while they last.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | h | 1 | step | `step` |
//! | R | m×nv | rows of all constraints in contact axes, tangents first, normal last | `rows` |
//! | G | m×m | R M⁻¹ Rᵀ | `delassus` |
//! | p | m | impulses | `impulse` |
//!
//! One time step (J. J. Moreau 1988, M. Jean 1999, θ = ½): half a step of positions, qₘ = q + ½ h q̇; the contacts that are
//! closed at qₘ; q̇⁺ = q̇ + h M⁻¹f + M⁻¹Rᵀp, with p by the law of several contacts ([`SeveralLaw`]); the second half step with
//! q̇⁺. The contact law is imposed on velocities, so a step may contain any number of impacts, and positions overlap by
//! O(h v). Overlaps are corrected along M⁻¹Rᵀ down to the overlap of one step of free fall: after a correction to a gap of
//! zero the contact would open and close in alternate steps and never come to rest.
//!
//! The law of several contacts is applied in [`Run::solve`] only.

use super::events::{Run, TOUCHING};
use super::impacts::Struck;
use super::trajectory::EventKind;
use crate::contact::{At, ContactMode, SeveralLaw, Solved, Touch};
use crate::error::SimError;
use crate::motion::{ContactState, Dry, Hold, Lasting, Motion};
use crate::state::{Blow, Loops, Space, View};
use carom_chain::algebra::z_onto;
use carom_chain::{ChainError, Rows};
use carom_impact::{Accuracy, Constraint, Flags, SeveralProblem};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Vector3};

/// Accuracy of the impulses of an impact.
const ACCURACY: Accuracy = Accuracy { tolerance: 1e-12, max_iterations: 5000 };
/// Accuracy of the impulses of a time step: far below the error of time stepping.
const STEP_ACCURACY: Accuracy = Accuracy { tolerance: 1e-10, ..ACCURACY };
/// An impact with a larger residual has no solution by its law.
const UNSOLVED: f64 = 1e-9;
/// After this number of steps without contact the motion continues event-driven.
const OPEN_STEPS: usize = 10;
/// After this number of steps a consistent mode is looked for.
const RESUME: usize = 20;
/// After this number of steps without motion the chain is at rest.
const STILL_STEPS: usize = 20;
/// Joint velocities below this count as zero, rad/s or m/s.
const STILL: f64 = 1e-10;

/// The constraints of one instant.
struct Closures {
    rows: Rows,
    constraints: Vec<Constraint>,
    /// Stiffness of each constraint relative to the others.
    stiffnesses: Vec<f64>,
    /// Velocity of the surface along each row.
    surface: Vec<f64>,
    contacts: Vec<Closed>,
}

/// A closed touch among the rows.
struct Closed {
    touch: usize,
    /// Contact axes and point; `None` for a limit.
    place: Option<(Matrix3<f64>, Vector3<f64>)>,
    rows: std::ops::Range<usize>,
    gap: f64,
}

impl Closed {
    /// The impulse on the robot, world axes.
    fn push(&self, axes: &Matrix3<f64>, impulse: &DVector<f64>) -> Vector3<f64> {
        // A single row is that of the normal.
        let skip = 3 - self.rows.len();
        self.rows.clone().map(|row| axes.column(row - self.rows.start + skip) * impulse[row]).sum()
    }
}

impl Closures {
    fn new(nv: usize) -> Self {
        let (constraints, stiffnesses) = (Vec::new(), Vec::new());
        Self { rows: Rows::new(nv), constraints, stiffnesses, surface: Vec::new(), contacts: Vec::new() }
    }

    /// The rows of one closed touch.
    fn add<A: Space>(
        &mut self,
        k: usize,
        touch: &Touch,
        at: &At<A>,
        view: &View<A>,
        time: f64,
    ) -> Result<(), SimError> {
        let first = self.rows.len();
        let rule = &touch.contact;
        let (restitution, friction) = (rule.law.restitution(), rule.law.friction());
        let Some(place) = at.surface else {
            touch.row_into(at, view, self.rows.add())?;
            self.surface.push(0.0);
            self.constraints.push(if rule.latch { Constraint::Held } else { Constraint::Stop { restitution } });
            self.stiffnesses.push(rule.relative_stiffness);
            self.contacts.push(Closed { touch: k, place: None, rows: first..first + 1, gap: at.gap });
            return Ok(());
        };
        let velocity = touch.surface_velocity(&place, time);
        let axes = z_onto(place.normal);
        let directions = if rule.latch || friction > 0.0 { 0..3 } else { 2..3 };
        for axis in directions {
            let direction = axes.column(axis).into_owned();
            place.row_into(view, direction, self.rows.add())?;
            self.surface.push(direction.dot(&velocity));
        }
        if rule.latch {
            self.constraints.extend([Constraint::Held, Constraint::Held, Constraint::Held]);
        } else if friction > 0.0 {
            self.constraints.push(Constraint::Contact { restitution, friction });
        } else {
            self.constraints.push(Constraint::Stop { restitution });
        }
        self.stiffnesses.resize(self.constraints.len(), rule.relative_stiffness);
        let rows = first..self.rows.len();
        self.contacts.push(Closed { touch: k, place: Some((axes, place.position)), rows, gap: at.gap });
        Ok(())
    }

    fn without_restitution(&mut self) {
        for constraint in &mut self.constraints {
            match constraint {
                Constraint::Stop { restitution } | Constraint::Contact { restitution, .. } => *restitution = 0.0,
                _ => {}
            }
        }
    }

    /// R v − velocity of the surfaces.
    fn velocities(&self, v: &[f64]) -> DVector<f64> {
        DVector::from_fn(self.rows.len(), |i, _| self.rows.dot(i, v) - self.surface[i])
    }

    /// The contacts of a time step of this length with these impulses and flags.
    fn told(&self, impulse: &DVector<f64>, step: f64, flags: Flags) -> Vec<ContactState> {
        let state = |closed: &Closed| {
            let normal_force = impulse[closed.rows.end - 1] / step;
            let (touch, mode, gap) = (closed.touch, ContactMode::Stepping, closed.gap);
            let zero = Vector3::zeros();
            let (point, normal, force) = closed.place.as_ref().map_or((zero, zero, zero), |(axes, point)| {
                (*point, axes.column(2).into(), closed.push(axes, impulse) / step)
            });
            ContactState { touch, mode, point, normal, gap, force, normal_force, flags }
        };
        self.contacts.iter().map(state).collect()
    }

    /// Impulses of a time step of this length by the forces of the step before, where a contact had one.
    fn guess(&self, before: &[ContactState], step: f64) -> DVector<f64> {
        let mut guess = DVector::zeros(self.rows.len());
        for closed in &self.contacts {
            let Some(state) = before.iter().find(|state| state.touch == closed.touch) else { continue };
            guess[closed.rows.end - 1] = state.normal_force * step;
            if let (Some((axes, _)), 3) = (&closed.place, closed.rows.len()) {
                guess.rows_mut(closed.rows.start, 3).copy_from(&(axes.tr_mul(&state.force) * step));
            }
        }
        guess
    }

    /// The contact impulses in world axes.
    fn blows(&self, impulse: &DVector<f64>) -> Vec<Blow> {
        let blow = |closed: &Closed| {
            let (axes, point) = closed.place.as_ref()?;
            Some(Blow { touch: closed.touch, point: *point, impulse: closed.push(axes, impulse) })
        };
        self.contacts.iter().filter_map(blow).collect()
    }
}

impl<A: Space> Run<'_, '_, A> {
    /// Impulses by the law of several contacts.
    fn solve(
        &self,
        rows: &Closures,
        responses: &Rows,
        u_minus: DVector<f64>,
        u_free: DVector<f64>,
        (law, accuracy): (SeveralLaw, &Accuracy),
        start: Option<&DVector<f64>>,
    ) -> Result<Solved, SimError> {
        let m = rows.rows.len();
        let delassus = DMatrix::from_fn(m, m, |i, j| {
            // Both triangles from one product: exactly symmetric.
            let (i, j) = (i.min(j), i.max(j));
            rows.rows.dot(i, responses.row(j))
        });
        let problem = SeveralProblem::new(delassus, u_minus, rows.constraints.clone())?.with_free_velocity(u_free)?;
        Ok(law.solve(&problem, &rows.stiffnesses, accuracy, start)?)
    }

    /// The impact of touches that close at the same time, together with a contact that lasts. `ends`: without restitution, as
    /// the end of an accumulation.
    pub fn several_impacts(&mut self, together: &[usize], ends: bool) -> Result<(), SimError> {
        let before = self.y.clone();
        let (q, qd) = self.q_qd();
        let (sim, time, nq) = (self.motion.sim, self.time, self.motion.sim.chain.nq());
        let energy = self.motion.energy(&before)?;
        let mut rows = Closures::new(sim.chain.nv());
        let mut view = self.motion.view(&q)?;
        let mut approach = Vec::new();
        for &touch in together {
            let one = &sim.touches[touch];
            let at = one.at(&view, &q, time);
            approach.push(one.rate(&at, &view, &qd, time)?);
            rows.add(touch, one, &at, &view, time)?;
        }
        if ends {
            rows.without_restitution();
        }
        let mut responses = Rows::default();
        view.respond(&rows.rows, &mut responses)?;
        let u_minus = rows.velocities(&qd);
        let mut outcome =
            self.solve(&rows, &responses, u_minus.clone(), u_minus.clone(), (sim.several, &ACCURACY), None)?;
        let residual = outcome.residual;
        self.statistics.worst_residual = self.statistics.worst_residual.max(residual);
        if residual > UNSOLVED && !ends {
            // No impulses satisfy the law: friction wedges a contact. Without restitution there are some.
            rows.without_restitution();
            outcome = self.solve(&rows, &responses, u_minus.clone(), u_minus, (sim.several, &ACCURACY), None)?;
        }
        push(&mut self.y[nq..], &responses, &outcome.impulse);
        together.iter().for_each(|&touch| self.motion.count_impact(touch));
        let kind = EventKind::Several { touches: together.to_vec(), residual, flags: outcome.flags };
        self.note(kind, &before, rows.blows(&outcome.impulse));
        self.lost += energy - self.motion.energy(&self.y)?;
        let scale = approach.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let struck: Vec<Struck> =
            together.iter().zip(&approach).map(|(&touch, &approach)| Struck { touch, approach }).collect();
        // Separation velocities of the size of the solver's error count as zero.
        self.after(&struck, scale * 1e-9, &before)
    }

    /// Time steps until all contacts are open, the chain is at rest, or the run ends.
    pub fn several_contacts(&mut self) -> Result<(), SimError> {
        let (mut still_steps, mut open_steps, mut steps) = (0, 0, 0_usize);
        while self.time < self.end {
            let (open, still) = self.contact_step()?;
            open_steps = if open { open_steps + 1 } else { 0 };
            let flies = open_steps >= OPEN_STEPS && !self.motion.sim.stepping;
            if flies && self.gaps()?.into_iter().all(|(_, (gap, _))| gap > 0.0) {
                return self.fly();
            }
            steps += 1;
            if steps % RESUME == 0 && !self.motion.sim.stepping && self.resumes()? {
                return Ok(());
            }
            still_steps = if still { still_steps + 1 } else { 0 };
            if still_steps == STILL_STEPS && self.is_steady() {
                let energy = self.motion.energy(&self.y)?;
                self.put_back(0.0)?;
                self.lost += energy - self.motion.energy(&self.y)?;
                let y = self.y.clone();
                if !std::mem::replace(&mut self.memory.resting, true) {
                    self.note(EventKind::Rest, &y, Vec::new());
                }
                let start = std::mem::replace(&mut self.time, self.end);
                let told = self.stepped.clone();
                self.sampler.stretch((start, self.end, 2), |_| y.clone(), |_, _| told.clone());
            }
        }
        Ok(())
    }

    /// Continues event-driven without contacts.
    fn fly(&mut self) -> Result<(), SimError> {
        self.motion.stepping = false;
        let before = self.y.clone();
        self.note(EventKind::Mode { mode: ContactMode::Free }, &before, Vec::new());
        self.measure();
        self.resettle(&[], &before)
    }

    /// Continues event-driven if the closed contacts have a consistent mode; `false` leaves the state as it was.
    fn resumes(&mut self) -> Result<bool, SimError> {
        let sim = self.motion.sim;
        let gravity = sim.gravity.norm().max(1.0);
        // Within one step of fall, in position and velocity.
        let (depth, speed) = (4.0 * gravity * sim.contact_step.powi(2), 4.0 * gravity * sim.contact_step);
        let mut closed = Vec::new();
        for (touch, (gap, rate)) in self.gaps()? {
            if gap <= depth && rate.abs() <= speed {
                closed.push(touch);
            } else if gap <= depth && rate < 0.0 {
                return Ok(false);
            }
        }
        if closed.is_empty() || closed.iter().any(|&touch| !sim.touches[touch].is_point()) {
            return Ok(false);
        }
        let before = self.y.clone();
        self.measure();
        let energy = self.motion.energy(&before)?;
        let hold = Hold::Slides { toward: Vector3::zeros() };
        let normals: Vec<Lasting> = closed.iter().map(|&touch| Lasting { touch, hold }).collect();
        self.motion.project(&normals, self.time, &mut self.y)?;
        let clear = self.gaps()?.into_iter().all(|(_, (gap, _))| gap >= -TOUCHING);
        if !clear || self.choose(&closed)?.is_some() || self.motion.in_mode(self.time, &self.y).is_err() {
            self.y = before;
            self.motion.lasting.retain(|own| !own.is_rigid());
            return Ok(false);
        }
        self.motion.stepping = false;
        self.lost += energy - self.motion.energy(&self.y)?;
        self.note_changes(&[], &before);
        self.rest()?;
        Ok(true)
    }

    /// Whether a chain at rest stays at rest: no drive or surface depends on time.
    pub fn is_steady(&self) -> bool {
        self.motion.moving.is_empty() && self.motion.sim.is_steady(self.time)
    }

    /// One time step; returns whether all contacts were open, and whether all velocities are zero.
    fn contact_step(&mut self) -> Result<(bool, bool), SimError> {
        let sim = self.motion.sim;
        let (nq, nv) = (sim.chain.nq(), sim.chain.nv());
        let step =
            sim.contact_step.min(self.end - self.time).min(sim.next_kink(&self.motion.moving, self.time) - self.time);
        let (q, qd) = self.q_qd();
        let (start_time, middle_time) = (self.time, self.time + step / 2.0);
        let energy = self.motion.energy(&self.y)?;

        let middle = sim.chain.integrate(&q, &qd, step / 2.0)?;
        // All dry friction is part of the contact problem, so none of it is applied as a force.
        self.motion.dry.iter_mut().for_each(|joint| joint.state = Dry::Holds);
        let (tau, power) = self.motion.applied(middle_time, &middle, &qd)?;
        let dry = self.motion.dry.clone();
        let (stiffness, damping) = self.motion.regulation();
        let Motion { model, workspace, couplings, gaps: near, .. } = &mut self.motion;
        let mut view = View::closed_by(*model, workspace, &middle, couplings)?;
        let v = DVector::from_column_slice(&qd);
        // Damping and controllers are implicit (velocity at the end of the step), so that stiff ones stay stable:
        // (M + h D + ½h² K)(q̇⁺ − q̇) = h f − ½h² K q̇ + Rᵀp.
        let mut inertia = view.kin.mass_matrix();
        for i in 0..nv {
            inertia[(i, i)] += step * damping[i] + step * step / 2.0 * stiffness[i];
        }
        let inertia = inertia.cholesky().ok_or(ChainError::NoInertia { joint: sim.chain.name().to_owned() });
        let inertia = inertia.map_err(SimError::from)?;
        let force = DVector::from_vec(tau) - view.bias(&qd, sim.gravity)?;
        let carried = DVector::from_fn(nv, |i, _| v[i] * (step * step / 2.0 * stiffness[i]));
        let mut free = &v + inertia.solve(&(force * step - carried));
        let loops = view.loop_rows()?;
        let closed = Loops::new(loops.clone(), solved(&inertia, &loops), A::LINEAR);
        if let Some(closed) = &closed {
            closed.bind(free.as_mut_slice(), None);
        }

        let mut rows = Closures::new(sim.chain.nv());
        for k in near.near(&view, (&middle, &qd), middle_time, TOUCHING)? {
            let touch = &sim.touches[k];
            for at in touch.points(&view, &middle, middle_time, TOUCHING) {
                rows.add(k, touch, &at, &view, middle_time)?;
            }
        }
        let open = rows.rows.is_empty();
        for joint in &dry {
            rows.rows.add()[joint.v] = 1.0;
            rows.surface.push(0.0);
            rows.constraints.push(Constraint::Dry { bound: joint.friction * step });
            rows.stiffnesses.push(1.0);
        }
        let mut told = Vec::new();
        let mut next = free.clone();
        let mut fall = 0.0_f64;
        if !rows.rows.is_empty() {
            let mut responses = solved(&inertia, &rows.rows);
            if let Some(closed) = &closed {
                responses.iter_mut().for_each(|response| closed.bind(response, None));
            }
            let (u_minus, u_free) = (rows.velocities(&qd), rows.velocities(free.as_slice()));
            fall = (&u_minus - &u_free).amax() * step;
            let start = rows.guess(&self.stepped, step);
            let outcome =
                self.solve(&rows, &responses, u_minus, u_free, (sim.several, &STEP_ACCURACY), Some(&start))?;
            self.statistics.worst_residual = self.statistics.worst_residual.max(outcome.residual);
            push(next.as_mut_slice(), &responses, &outcome.impulse);
            let open = outcome.flags.contains(Flags::NON_UNIQUE);
            self.statistics.non_unique_time += if open { step } else { 0.0 };
            told = rows.told(&outcome.impulse, step, if open { Flags::NON_UNIQUE } else { Flags::NONE });
        }
        let moved = sim.chain.integrate(&middle, next.as_slice(), step / 2.0)?;
        self.y[..nq].copy_from_slice(&moved);
        self.y[nq..nq + nv].copy_from_slice(next.as_slice());
        sim.normalise(&mut self.y);
        self.time = start_time + step;
        if !open {
            self.put_back(2.0 * fall)?;
        }
        self.motion.close_loops(&mut self.y)?;

        self.statistics.contact_steps += 1;
        self.y[nq + nv] += power[0] * step;
        self.y[nq + nv + 1] += power[1] * step;
        self.lost += energy - self.motion.energy(&self.y)? + (power[0] + power[1]) * step;
        let (y, still) = (self.y.clone(), next.amax() < STILL);
        let chain = &sim.chain;
        let at = |time: f64| {
            // Positions are linear in time in each half of the step, with the velocity before and after it.
            let half = step / 2.0;
            let (from, rate, span) = if time <= start_time + half {
                (&q, qd.as_slice(), time - start_time)
            } else {
                (&middle, next.as_slice(), time - start_time - half)
            };
            let mut state = y.clone();
            if let Ok(there) = chain.integrate(from, rate, span) {
                state[..nq].copy_from_slice(&there);
            }
            state[nq..nq + nv].copy_from_slice(rate);
            state
        };
        self.sampler.stretch((start_time, self.time, 2), at, |_, _| told.clone());
        self.stepped = told;
        Ok((open, still))
    }

    /// Corrects overlaps above `allowed` (m) by the smallest displacement in the kinetic metric: with the gaps g + allowed,
    /// 0 ≤ g + R δ ⟂ π ≥ 0, δ = M⁻¹Rᵀπ.
    fn put_back(&mut self, allowed: f64) -> Result<(), SimError> {
        let sim = self.motion.sim;
        let (q, qd) = self.q_qd();
        let time = self.time;
        let mut rows = Closures::new(sim.chain.nv());
        let Motion { model, workspace, couplings, gaps: near, .. } = &mut self.motion;
        let mut view = View::closed_by(*model, workspace, &q, couplings)?;
        let mut gaps = Vec::new();
        for touch in near.near(&view, (&q, &qd), time, 0.0)?.into_iter().map(|k| &sim.touches[k]) {
            for at in touch.points(&view, &q, time, 0.0) {
                touch.row_into(&at, &view, rows.rows.add())?;
                rows.constraints.push(Constraint::Stop { restitution: 0.0 });
                gaps.push(at.gap + allowed);
            }
        }
        if gaps.iter().all(|gap| *gap > -OVERLAP) {
            return Ok(());
        }
        let mut responses = Rows::default();
        view.respond(&rows.rows, &mut responses)?;
        let gaps = DVector::from_vec(gaps);
        let outcome = self.solve(&rows, &responses, gaps.clone(), gaps, (SeveralLaw::Moreau, &STEP_ACCURACY), None)?;
        let mut back = vec![0.0; sim.chain.nv()];
        push(&mut back, &responses, &outcome.impulse);
        let moved = sim.chain.integrate(&q, &back, 1.0)?;
        self.y[..q.len()].copy_from_slice(&moved);
        Ok(())
    }
}

/// The solutions for these rows, as rows.
fn solved(inertia: &Cholesky<f64, Dyn>, rows: &Rows) -> Rows {
    let mut responses = Rows::new(inertia.l_dirty().nrows());
    for row in rows.iter() {
        responses.add().copy_from_slice(inertia.solve(&DVector::from_column_slice(row)).as_slice());
    }
    responses
}

/// Adds the velocities M⁻¹Rᵀp.
fn push(v: &mut [f64], responses: &Rows, impulse: &DVector<f64>) {
    for (response, p) in responses.iter().zip(impulse.iter()) {
        v.iter_mut().zip(response).for_each(|(v, x)| *v += x * p);
    }
}

/// Overlaps up to this are not corrected, m.
const OVERLAP: f64 = 1e-12;
