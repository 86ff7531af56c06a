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

use super::events::{Run, Stays, TOUCHING};
use super::trajectory::{Blow, EventKind};
use crate::contact::{At, ContactMode, Touch};
use crate::error::SimError;
use crate::model::SeveralLaw;
use crate::motion::Dry;
use crate::state::{Space, View};
use carom_chain::ChainError;
use carom_chain::algebra::z_onto;
use carom_impact::{Accuracy, Constraint, Order, SeveralProblem};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Accuracy of the solution of problems with several contacts: far below the error of time stepping.
const ACCURACY: Accuracy = Accuracy { tolerance: 1e-12, max_iterations: 2000 };
/// After this number of steps without contact the motion continues event-driven.
const OPEN_STEPS: usize = 10;
/// After this number of steps without motion the chain is at rest.
const STILL_STEPS: usize = 20;
/// Joint velocities below this count as zero, rad/s or m/s.
const STILL: f64 = 1e-10;

/// Impulses of all constraints, and the residual of the law.
struct Solved {
    impulse: DVector<f64>,
    residual: f64,
}

/// The constraints of one instant.
struct Rows {
    rows: Vec<DVector<f64>>,
    constraints: Vec<Constraint>,
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
}

impl Rows {
    fn new() -> Self {
        Self { rows: Vec::new(), constraints: Vec::new(), surface: Vec::new(), contacts: Vec::new() }
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
            self.rows.push(touch.row(at, view)?);
            self.surface.push(0.0);
            self.constraints.push(if rule.latch { Constraint::Held } else { Constraint::Stop { restitution } });
            self.contacts.push(Closed { touch: k, place: None, rows: first..first + 1 });
            return Ok(());
        };
        let velocity = touch.shift(time)[1];
        let axes = z_onto(place.normal);
        let directions = if rule.latch || friction > 0.0 { 0..3 } else { 2..3 };
        for axis in directions {
            let direction = axes.column(axis).into_owned();
            self.rows.push(place.row(view, direction)?);
            self.surface.push(direction.dot(&velocity));
        }
        if rule.latch {
            self.constraints.extend([Constraint::Held, Constraint::Held, Constraint::Held]);
        } else if friction > 0.0 {
            self.constraints.push(Constraint::Contact { restitution, friction });
        } else {
            self.constraints.push(Constraint::Stop { restitution });
        }
        let rows = first..self.rows.len();
        self.contacts.push(Closed { touch: k, place: Some((axes, place.position)), rows });
        Ok(())
    }

    fn responses<A: Space>(&self, view: &mut View<A>) -> Result<Vec<DVector<f64>>, SimError> {
        self.rows.iter().map(|row| Ok(view.kin.solve(row.as_slice())?)).collect()
    }

    /// R v − velocity of the surfaces.
    fn velocities(&self, v: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(self.rows.len(), |i, _| self.rows[i].dot(v) - self.surface[i])
    }

    /// The contact impulses in world axes.
    fn blows(&self, impulse: &DVector<f64>) -> Vec<Blow> {
        let blow = |closed: &Closed| {
            let (axes, point) = closed.place.as_ref()?;
            // A single row is that of the normal.
            let skip = 3 - closed.rows.len();
            let parts = closed.rows.clone().map(|row| axes.column(row - closed.rows.start + skip) * impulse[row]);
            Some(Blow {
                touch: closed.touch,
                point: *point,
                impulse: parts.fold(Vector3::zeros(), |sum, part| sum + part),
            })
        };
        self.contacts.iter().filter_map(blow).collect()
    }
}

impl<A: Space> Run<'_, '_, A> {
    /// Impulses by the law of several contacts.
    fn solve(
        &self,
        rows: &Rows,
        responses: &[DVector<f64>],
        u_minus: DVector<f64>,
        u_free: DVector<f64>,
        law: SeveralLaw,
    ) -> Result<Solved, SimError> {
        let m = rows.rows.len();
        let delassus = DMatrix::from_fn(m, m, |i, j| {
            // Both triangles from one product: exactly symmetric.
            let (i, j) = (i.min(j), i.max(j));
            rows.rows[i].dot(&responses[j])
        });
        let problem = SeveralProblem::new(delassus, u_minus, rows.constraints.clone())?.with_free_velocity(u_free)?;
        Ok(match law {
            SeveralLaw::Moreau => {
                let found = problem.simultaneous(&ACCURACY, None)?;
                Solved { impulse: found.impulse, residual: found.residual }
            }
            SeveralLaw::Poisson => {
                let found = problem.poisson(&ACCURACY).total;
                Solved { impulse: found.impulse, residual: found.residual }
            }
            SeveralLaw::Sequential => {
                let found = problem.sequential(&Order::MostApproaching, &ACCURACY);
                let found = found.unwrap_or_else(|_| unreachable!("this order has no indices that could be invalid"));
                Solved { impulse: found.impulse, residual: found.residual }
            }
        })
    }

    /// The impact of touches that close at the same time, together with a contact that lasts.
    pub fn several_impacts(&mut self, together: &[usize]) -> Result<(), SimError> {
        let before = self.y.clone();
        let (q, qd) = self.q_qd();
        let (sim, time, nq) = (self.motion.sim, self.time, self.motion.sim.chain.nq());
        let energy = self.motion.energy(&before)?;
        let mut rows = Rows::new();
        let mut view = self.motion.view(&q)?;
        let mut approach = Vec::new();
        for &touch in together {
            let one = &sim.touches[touch];
            let at = one.at(&view, &q, time);
            approach.push(one.rate(&at, &view, &qd, time)?);
            rows.add(touch, one, &at, &view, time)?;
        }
        let responses = rows.responses(&mut view)?;
        let v = DVector::from_column_slice(&qd);
        let u_minus = rows.velocities(&v);
        let outcome = self.solve(&rows, &responses, u_minus.clone(), u_minus, sim.several)?;
        self.statistics.worst_residual = self.statistics.worst_residual.max(outcome.residual);
        let qd_plus = responses.iter().zip(outcome.impulse.iter()).fold(v, |v, (response, p)| v + response * *p);
        self.y[nq..nq + qd.len()].copy_from_slice(qd_plus.as_slice());
        together.iter().for_each(|&touch| self.motion.count_impact(touch));
        let kind = EventKind::Several { touches: together.to_vec(), residual: outcome.residual };
        self.note(kind, &before, rows.blows(&outcome.impulse));
        self.lost += energy - self.motion.energy(&self.y)?;
        self.sort_out(together, &approach)
    }

    /// After an impact of several touches: decides which contacts open and which last.
    fn sort_out(&mut self, together: &[usize], approach: &[f64]) -> Result<(), SimError> {
        self.motion.mode = ContactMode::Free;
        self.motion.settle_joints(self.time, &mut self.y)?;
        let scale = approach.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let mut still = Vec::new();
        let mut leaving = Vec::new();
        for (&touch, &approach) in together.iter().zip(approach) {
            let (_, rebound) = self.gap(touch)?;
            // Rebound velocities of the size of the solver's error count as zero.
            if rebound <= scale * 1e-9 { still.push(touch) } else { leaving.push((touch, approach, rebound)) }
        }
        let points = still.iter().all(|&touch| self.motion.sim.touches[touch].is_point());
        match (still.as_slice(), points) {
            ([], _) => {}
            (&[touch], true) if matches!(self.stays(touch, 0.0, 0.0)?, Stays::Rests) => {
                let before = self.y.clone();
                self.motion.stop_normal(touch, self.time, &mut self.y)?;
                self.last(touch, &before)?;
            }
            (&[_], true) => {}
            _ => return self.enter(ContactMode::Several),
        }
        if self.motion.mode == ContactMode::Several {
            return Ok(());
        }
        for (touch, approach, rebound) in leaving {
            match self.stays(touch, approach, rebound)? {
                Stays::No => {}
                // An accumulation of impacts beside another lasting contact is left to time stepping.
                Stays::Rests | Stays::Zeno(_) => return self.enter(ContactMode::Several),
            }
        }
        Ok(())
    }

    /// Time steps until all contacts are open, the chain is at rest, or the run ends.
    pub fn several_contacts(&mut self) -> Result<(), SimError> {
        let (mut still_steps, mut open_steps) = (0, 0);
        while self.time < self.end {
            let (open, still) = self.contact_step()?;
            open_steps = if open { open_steps + 1 } else { 0 };
            let flies = open_steps >= OPEN_STEPS && !self.motion.sim.stepping;
            if flies && self.gaps()?.into_iter().all(|(gap, _)| gap > 0.0) {
                return self.enter(ContactMode::Free);
            }
            still_steps = if still { still_steps + 1 } else { 0 };
            if still_steps == STILL_STEPS && self.is_steady() {
                let energy = self.motion.energy(&self.y)?;
                self.put_back(0.0)?;
                self.lost += energy - self.motion.energy(&self.y)?;
                let y = self.y.clone();
                self.note(EventKind::Rest, &y, Vec::new());
                let start = std::mem::replace(&mut self.time, self.end);
                self.sampler.stretch(start, self.end, 2, |_| y.clone());
            }
        }
        Ok(())
    }

    /// Whether a chain at rest stays at rest: no drive or surface depends on time.
    fn is_steady(&self) -> bool {
        let sim = self.motion.sim;
        let drive = sim.after_impact.as_ref().unwrap_or(&sim.drive);
        drive.is_steady() && sim.drive.is_steady() && sim.touches.iter().all(|touch| touch.motion.is_none())
    }

    /// One time step; returns whether all contacts were open, and whether all velocities are zero.
    fn contact_step(&mut self) -> Result<(bool, bool), SimError> {
        let sim = self.motion.sim;
        let (nq, nv) = (sim.chain.nq(), sim.chain.nv());
        let step = sim.contact_step.min(self.end - self.time);
        let (q, qd) = self.q_qd();
        let (start, middle_time) = (self.time, self.time + step / 2.0);
        let energy = self.motion.energy(&self.y)?;

        let middle = sim.chain.integrate(&q, &qd, step / 2.0)?;
        // All dry friction is part of the contact problem, so none of it is applied as a force.
        self.motion.dry.iter_mut().for_each(|joint| joint.state = Dry::Holds);
        let (tau, power) = self.motion.applied(middle_time, &middle, &qd)?;
        let dry = self.motion.dry.clone();
        let (stiffness, damping) = self.motion.regulation();
        let mut view = self.motion.view(&middle)?;
        let v = DVector::from_column_slice(&qd);
        // Damping and controllers are implicit (velocity at the end of the step), so that stiff ones stay stable:
        // (M + h D + ½h² K)(q̇⁺ − q̇) = h f − ½h² K q̇ + Rᵀp.
        let mut inertia = view.kin.mass_matrix();
        for i in 0..nv {
            inertia[(i, i)] += step * damping[i] + step * step / 2.0 * stiffness;
        }
        let inertia = inertia.cholesky().ok_or(ChainError::NoInertia { joint: sim.chain.name().to_owned() });
        let inertia = inertia.map_err(SimError::from)?;
        let force = DVector::from_vec(tau) - view.bias(&qd, sim.gravity)?;
        let free = &v + inertia.solve(&(force * step - &v * (step * step / 2.0 * stiffness)));

        let mut rows = Rows::new();
        for (k, touch) in sim.touches.iter().enumerate() {
            for at in touch.points(&view, &middle, middle_time, TOUCHING) {
                rows.add(k, touch, &at, &view, middle_time)?;
            }
        }
        let open = rows.rows.is_empty();
        for joint in &dry {
            let mut row = DVector::zeros(nv);
            row[joint.v] = 1.0;
            rows.rows.push(row);
            rows.surface.push(0.0);
            rows.constraints.push(Constraint::Dry { bound: joint.friction * step });
        }
        let mut next = free.clone();
        let mut fall = 0.0_f64;
        if !rows.rows.is_empty() {
            let responses: Vec<DVector<f64>> = rows.rows.iter().map(|row| inertia.solve(row)).collect();
            let (u_minus, u_free) = (rows.velocities(&v), rows.velocities(&free));
            fall = (&u_minus - &u_free).amax() * step;
            let outcome = self.solve(&rows, &responses, u_minus, u_free, sim.several)?;
            self.statistics.worst_residual = self.statistics.worst_residual.max(outcome.residual);
            next = responses.iter().zip(outcome.impulse.iter()).fold(next, |v, (response, p)| v + response * *p);
        }
        let moved = sim.chain.integrate(&middle, next.as_slice(), step / 2.0)?;
        self.y[..nq].copy_from_slice(&moved);
        self.y[nq..nq + nv].copy_from_slice(next.as_slice());
        sim.normalise(&mut self.y);
        self.time = start + step;
        if !open {
            self.put_back(2.0 * fall)?;
        }

        self.statistics.contact_steps += 1;
        self.y[nq + nv] += power[0] * step;
        self.y[nq + nv + 1] += power[1] * step;
        self.lost += energy - self.motion.energy(&self.y)? + (power[0] + power[1]) * step;
        let (y, still) = (self.y.clone(), next.amax() < STILL);
        let chain = &sim.chain;
        self.sampler.stretch(start, self.time, 2, |time| {
            // Positions are linear in time in each half of the step.
            let half = step / 2.0;
            let (from, rate, span) = if time <= start + half {
                (&q, qd.as_slice(), time - start)
            } else {
                (&middle, next.as_slice(), time - start - half)
            };
            let mut state = y.clone();
            if let Ok(there) = chain.integrate(from, rate, span) {
                state[..nq].copy_from_slice(&there);
            }
            state
        });
        Ok((open, still))
    }

    /// Corrects overlaps above `allowed` (m) by the smallest displacement in the kinetic metric: with the gaps g + allowed,
    /// 0 ≤ g + R δ ⟂ π ≥ 0, δ = M⁻¹Rᵀπ.
    fn put_back(&mut self, allowed: f64) -> Result<(), SimError> {
        let sim = self.motion.sim;
        let (q, _) = self.q_qd();
        let time = self.time;
        let mut rows = Rows::new();
        let mut view = self.motion.view(&q)?;
        let mut gaps = Vec::new();
        for touch in &sim.touches {
            for at in touch.points(&view, &q, time, 0.0) {
                rows.rows.push(touch.row(&at, &view)?);
                rows.constraints.push(Constraint::Stop { restitution: 0.0 });
                gaps.push(at.gap + allowed);
            }
        }
        if gaps.iter().all(|gap| *gap > -OVERLAP) {
            return Ok(());
        }
        let responses = rows.responses(&mut view)?;
        let gaps = DVector::from_vec(gaps);
        let outcome = self.solve(&rows, &responses, gaps.clone(), gaps, SeveralLaw::Moreau)?;
        let back = DVector::zeros(sim.chain.nv());
        let back = responses.iter().zip(outcome.impulse.iter()).fold(back, |sum, (response, p)| sum + response * *p);
        let moved = sim.chain.integrate(&q, back.as_slice(), 1.0)?;
        self.y[..q.len()].copy_from_slice(&moved);
        Ok(())
    }
}

/// Overlaps up to this are not corrected, m.
const OVERLAP: f64 = 1e-12;
