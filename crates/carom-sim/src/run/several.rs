//! The impact of several contacts as one problem, and the rows of all constraints for it and for time steps.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | R | m×nv | rows of all constraints in contact axes, tangents first, normal last | `rows` |
//! | G | m×m | R M⁻¹ Rᵀ | `delassus` |
//! | p | m | impulses | `impulse` |
//!
//! The law of several contacts is applied in [`Run::solve`] only.

use super::events::Run;
use super::impacts::Struck;
use super::memory::Class;
use super::trajectory::EventKind;
use crate::contact::{At, ContactMode, SeveralLaw, Solved, Touch, UNSOLVED};
use crate::error::SimError;
use crate::motion::{ContactState, along};
use crate::state::{ContactImpulse, Space, View};
use carom_chain::Rows;
use carom_chain::algebra::z_onto;
use carom_impact::{Accuracy, Constraint, Flags, SeveralProblem};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Vector3};

/// Accuracy of the impulses of an impact.
const ACCURACY: Accuracy = Accuracy { tolerance: 1e-12, max_iterations: 5000 };
/// Contacts that still approach, by more than this share of the velocity of the surfaces, squeeze the robot.
const SQUEEZE: f64 = 1e-6;
/// The approach velocity of an impact without collision, as a share of the largest velocity of the contacts.
const VANISHING: f64 = 1e-8;
/// Such an impact jumps by more than this share; contacts that do not jam, by some multiple of the approach velocity.
const FINITE: f64 = 1e-4;
/// It is solved to this share of the approach velocity.
const SETTLED: f64 = 1e-2;
/// The constraints of one instant.
pub(super) struct Closures {
    pub rows: Rows,
    pub constraints: Vec<Constraint>,
    /// Stiffness of each constraint relative to the others.
    pub stiffnesses: Vec<f64>,
    /// Velocity of the surface along each row.
    pub surface: Vec<f64>,
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

impl Closures {
    pub fn new(nv: usize) -> Self {
        let (constraints, stiffnesses) = (Vec::new(), Vec::new());
        Self { rows: Rows::new(nv), constraints, stiffnesses, surface: Vec::new(), contacts: Vec::new() }
    }

    /// The rows of one closed contact or limit; none if no joint moves it along its normal, as a limit in a loop that is locked.
    pub fn add<A: Space>(
        &mut self,
        k: usize,
        touch: &Touch,
        at: &At<A>,
        view: &mut View<A>,
        time: f64,
    ) -> Result<(), SimError> {
        if !touch.moves(at, view)? {
            return Ok(());
        }
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

    /// G, from the responses of the rows.
    fn delassus(&self, responses: &Rows) -> DMatrix<f64> {
        let m = self.rows.len();
        DMatrix::from_fn(m, m, |i, j| {
            // Both triangles from one product: exactly symmetric.
            let (i, j) = (i.min(j), i.max(j));
            self.rows.dot(i, responses.row(j))
        })
    }

    /// R v − velocity of the surfaces.
    pub fn velocities(&self, v: &[f64]) -> DVector<f64> {
        DVector::from_fn(self.rows.len(), |i, _| self.rows.dot(i, v) - self.surface[i])
    }

    /// The contacts of a time step of this length with these impulses and flags.
    pub fn contact_states(&self, impulse: &DVector<f64>, step: f64, flags: Flags) -> Vec<ContactState> {
        let state = |closed: &Closed| {
            let normal_force = impulse[closed.rows.end - 1] / step;
            let (touch, mode, gap) = (closed.touch, ContactMode::Stepping, closed.gap);
            let zero = Vector3::zeros();
            let (point, normal, force) = closed.place.as_ref().map_or((zero, zero, zero), |(axes, point)| {
                (*point, axes.column(2).into(), along(axes, &impulse.as_slice()[closed.rows.clone()]) / step)
            });
            ContactState { touch, mode, point, normal, gap, force, normal_force, flags }
        };
        self.contacts.iter().map(state).collect()
    }

    /// Impulses of a time step of this length by the forces of the step before, where a contact had one.
    pub fn guess(&self, before: &[ContactState], step: f64) -> DVector<f64> {
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
    fn impulses(&self, impulse: &DVector<f64>) -> Vec<ContactImpulse> {
        let one = |closed: &Closed| {
            let (axes, point) = closed.place.as_ref()?;
            let impulse = along(axes, &impulse.as_slice()[closed.rows.clone()]);
            Some(ContactImpulse { touch: closed.touch, point: *point, impulse })
        };
        self.contacts.iter().filter_map(one).collect()
    }
}

impl<A: Space> Run<'_, '_, A> {
    /// Impulses by the law of several contacts.
    pub fn solve(
        &self,
        rows: &Closures,
        responses: &Rows,
        u_minus: DVector<f64>,
        u_free: DVector<f64>,
        (law, accuracy): (SeveralLaw, &Accuracy),
        start: Option<&DVector<f64>>,
    ) -> Result<Solved, SimError> {
        let problem = SeveralProblem::from_gram(rows.delassus(responses), u_minus, rows.constraints.clone())?
            .with_free_velocity(u_free)?;
        Ok(law.solve(&problem, &rows.stiffnesses, accuracy, start)?)
    }

    /// The impact of touches that close at the same time, together with a contact that lasts. `ends`: without restitution, as
    /// the end of an accumulation.
    pub fn several_impacts(&mut self, together: &[usize], ends: bool) -> Result<(), SimError> {
        let before = self.y.clone();
        let (law, (_, qd)) = (self.motion.sim.several, self.q_qd());
        let (mut rows, responses, approach) = self.closures(together)?;
        if ends {
            rows.without_restitution();
        }
        let u_minus = rows.velocities(&qd);
        let mut outcome = self.solve(&rows, &responses, u_minus.clone(), u_minus.clone(), (law, &ACCURACY), None)?;
        let residual = outcome.residual;
        if residual > UNSOLVED && !ends {
            // No impulses satisfy the law: friction wedges a contact. Without restitution there are some.
            rows.without_restitution();
            outcome = self.solve(&rows, &responses, u_minus.clone(), u_minus.clone(), (law, &ACCURACY), None)?;
        }
        if outcome.residual > UNSOLVED && law != SeveralLaw::Moreau {
            // A sequence that does not end leaves contacts approaching: all at once they do not.
            rows.without_restitution();
            outcome = self.solve(&rows, &responses, u_minus.clone(), u_minus, (SeveralLaw::Moreau, &ACCURACY), None)?;
        }
        self.strike(together, (&rows, &responses), (&outcome, residual))?;
        self.refuse_squeeze((&rows, &responses), outcome.residual, &self.q_qd().1)?;
        let scale = approach.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let struck: Vec<Struck> =
            together.iter().zip(&approach).map(|(&touch, &approach)| Struck { touch, approach }).collect();
        // Separation velocities of the size of the solver's error count as zero.
        self.after(&struck, scale * 1e-9, &before)
    }

    /// # Errors
    /// [`SimError::Squeezed`] where no velocity keeps surfaces that move from going on into the robot. Where there is one, the problem
    /// without friction, of normal impulses alone, has a solution.
    pub fn refuse_squeeze(
        &self,
        (rows, responses): (&Closures, &Rows),
        residual: f64,
        v: &[f64],
    ) -> Result<(), SimError> {
        let normals: Vec<usize> = rows.contacts.iter().map(|closed| closed.rows.end - 1).collect();
        let moves = normals.iter().fold(0.0, |most: f64, &i| most.max(rows.surface[i].abs()));
        if residual <= UNSOLVED || moves == 0.0 {
            return Ok(());
        }
        let u = rows.velocities(v).select_rows(&normals);
        let k = rows.delassus(responses).select_rows(&normals).select_columns(&normals);
        let smooth = vec![Constraint::Stop { restitution: 0.0 }; normals.len()];
        let apart = SeveralProblem::from_gram(k, u, smooth)?.simultaneous(&ACCURACY, None)?;
        let fastest = -apart.u_plus.min();
        if apart.residual <= UNSOLVED || fastest <= SQUEEZE * moves {
            return Ok(());
        }
        let names = rows.contacts.iter().map(|closed| self.motion.sim.touches[closed.touch].name.clone());
        Err(SimError::Squeezed { time: self.time, touches: names.collect::<Vec<_>>().join(", "), speed: fastest })
    }

    /// An impact without collision of several closed touches (Painlevé): the limit of the law's outcome for vanishing approach velocities.
    /// `false` if it has no finite impulses: no contact jams.
    pub fn several_without_collision(&mut self, closed: &[usize]) -> Result<bool, SimError> {
        let before = self.y.clone();
        let (law, rest, (_, qd)) = (self.motion.sim.several, self.motion.rest(), self.q_qd());
        let (rows, responses, _) = self.closures(closed)?;
        let mut u = rows.velocities(&qd);
        let speed = u.amax();
        if speed <= rest || self.memory.count(Class::Jam, self.time) == Some(0.0) {
            return Ok(false);
        }
        rows.contacts.iter().for_each(|closed| u[closed.rows.end - 1] = -VANISHING * speed);
        let Ok(outcome) = self.solve(&rows, &responses, u.clone(), u, (law, &ACCURACY), None) else { return Ok(false) };
        let mut jump = vec![0.0; qd.len()];
        push(&mut jump, &responses, outcome.impulse.as_slice());
        let finite = (0..rows.rows.len()).any(|i| rows.rows.dot(i, &jump).abs() > FINITE * speed);
        if !finite || outcome.residual > SETTLED * VANISHING {
            return Ok(false);
        }
        let residual = outcome.residual;
        self.strike(closed, (&rows, &responses), (&outcome, residual))?;
        let struck: Vec<Struck> = closed.iter().map(|&touch| Struck { touch, approach: 0.0 }).collect();
        self.after(&struck, rest, &before)?;
        Ok(true)
    }

    /// Adds the velocities M⁻¹Rᵀp of these impulses on the rows of R.
    pub fn push(&mut self, responses: &Rows, impulse: &[f64]) {
        push(&mut self.y[self.motion.sim.chain.nq()..], responses, impulse);
    }

    /// The rows of these touches now, the responses to them, and the rates of the gaps.
    fn closures(&mut self, together: &[usize]) -> Result<(Closures, Rows, Vec<f64>), SimError> {
        let (q, qd) = self.q_qd();
        let (sim, time) = (self.motion.sim, self.time);
        let mut rows = Closures::new(sim.chain.nv());
        let mut view = self.motion.view(&q)?;
        let mut approach = Vec::new();
        for &touch in together {
            let one = &sim.touches[touch];
            let at = one.at(&view, &q, time);
            approach.push(one.rate(&at, &view, &qd, time)?);
            rows.add(touch, one, &at, &mut view, time)?;
        }
        let mut responses = Rows::default();
        view.respond(&rows.rows, &mut responses)?;
        Ok((rows, responses, approach))
    }

    /// The jump by the impulses of these touches, with its event and its loss of energy.
    fn strike(
        &mut self,
        together: &[usize],
        (rows, responses): (&Closures, &Rows),
        (outcome, residual): (&Solved, f64),
    ) -> Result<(), SimError> {
        let before = self.y.clone();
        self.statistics.worst_residual = self.statistics.worst_residual.max(residual);
        self.push(responses, outcome.impulse.as_slice());
        let kind = EventKind::Several { touches: together.to_vec(), residual, flags: outcome.flags };
        self.book(kind, together, rows.impulses(&outcome.impulse), &before)
    }
}

/// The solutions for these rows, as rows.
pub(super) fn solved(inertia: &Cholesky<f64, Dyn>, rows: &Rows) -> Rows {
    let mut responses = Rows::new(inertia.l_dirty().nrows());
    for row in rows.iter() {
        responses.add().copy_from_slice(inertia.solve(&DVector::from_column_slice(row)).as_slice());
    }
    responses
}

/// Adds the velocities M⁻¹Rᵀp.
pub(super) fn push(v: &mut [f64], responses: &Rows, impulse: &[f64]) {
    for (response, p) in responses.iter().zip(impulse) {
        v.iter_mut().zip(response).for_each(|(v, x)| *v += x * p);
    }
}
