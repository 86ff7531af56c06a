//! The impact of several contacts as one problem.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | R | m×nv | rows of all constraints in contact axes, tangents first, normal last | `rows` |
//! | G | m×m | R M⁻¹ Rᵀ | `delassus` |
//! | p | m | impulses | `impulse` |
//!
//! The law of several contacts is applied in [`Run::solve`] only.

use super::history::Class;
use super::impacts::Struck;
use super::run_state::Run;
use super::trajectory::EventKind;
use crate::contact::SeveralLaw;
use crate::error::SimError;
use crate::motion::{ACCURACY, Constraints, Lasting, Level, push};
use crate::state::{CLEAR, EQUAL, EXACT, Space};
use carom_chain::Rows;
use carom_impact::{Accuracy, Constraint, SeveralOutcome, SeveralProblem};
use nalgebra::DVector;

impl<A: Space> Run<'_, '_, A> {
    /// Impulses by the law of several contacts, with these laws of the rows.
    pub fn solve(
        &self,
        (table, responses, laws): (&Constraints, &Rows, Vec<Constraint>),
        velocities: [&DVector<f64>; 2],
        (law, accuracy): (SeveralLaw, &Accuracy),
        start: Option<&DVector<f64>>,
    ) -> Result<SeveralOutcome, SimError> {
        let problem = table.problem(responses, laws, velocities)?;
        Ok(law.solve(&problem, &table.stiffnesses(self.motion.sim), accuracy, start)?)
    }

    /// The impact of touches that close at the same time, together with a contact that lasts. `ends`: without restitution, as
    /// the end of an accumulation.
    pub fn several_impacts(&mut self, together: &[usize], ends: bool) -> Result<(), SimError> {
        let before = self.y.clone();
        let (sim, (_, qd)) = (self.motion.sim, self.q_qd());
        let (table, responses, approach) = self.closed_rows(together)?;
        let u = table.excess(&qd);
        let solve = |law: SeveralLaw, elastic: bool| {
            let laws = table.laws(sim, &[], 1.0, elastic.then_some(&u));
            self.solve((&table, &responses, laws), [&u, &u], (law, &ACCURACY), None)
        };
        let mut outcome = solve(sim.several, !ends)?;
        let residual = outcome.residual;
        if residual > EQUAL && !ends {
            // No impulses satisfy the law: friction wedges a contact. Without restitution there are some.
            outcome = solve(sim.several, false)?;
        }
        if outcome.residual > EQUAL && sim.several != SeveralLaw::Moreau {
            // A sequence that does not end leaves contacts approaching: all at once they do not.
            outcome = solve(SeveralLaw::Moreau, false)?;
        }
        self.strike(together, (&table, &responses), (&outcome, residual))?;
        self.refuse_squeeze((&table, &responses), outcome.residual, &self.q_qd().1)?;
        let scale = approach.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let struck: Vec<Struck> =
            together.iter().zip(&approach).map(|(&touch, &approach)| Struck { touch, approach }).collect();
        // Separation velocities of the size of the solver's error count as zero.
        self.after(&struck, EQUAL * scale, &before)
    }

    /// # Errors
    /// [`SimError::Squeezed`] where no velocity keeps surfaces that move from going on into the robot. Where there is one, the problem
    /// without friction, of normal impulses alone, has a solution.
    pub fn refuse_squeeze(
        &self,
        (table, responses): (&Constraints, &Rows),
        residual: f64,
        v: &[f64],
    ) -> Result<(), SimError> {
        let normals: Vec<usize> = table.contacts.iter().map(|contact| contact.rows.end - 1).collect();
        let moves = normals.iter().fold(0.0, |most: f64, &i| most.max(table.surface[i].abs()));
        if residual <= EQUAL || moves == 0.0 {
            return Ok(());
        }
        let u = table.excess(v).select_rows(&normals);
        let k = table.gram(responses).select_rows(&normals).select_columns(&normals);
        let smooth = vec![Constraint::Stop { restitution: 0.0 }; normals.len()];
        let apart = SeveralProblem::from_gram(k, u, smooth)?.simultaneous(&ACCURACY, None)?;
        let fastest = -apart.u_plus.min();
        if apart.residual <= EQUAL || fastest <= CLEAR * moves {
            return Ok(());
        }
        let names = table.contacts.iter().map(|contact| self.motion.sim.touches[contact.own.touch].name.clone());
        Err(SimError::Squeezed { time: self.time, touches: names.collect::<Vec<_>>().join(", "), speed: fastest })
    }

    /// An impact without collision of several closed touches (Painlevé): the limit of the law's outcome for vanishing approach velocities,
    /// from approach velocities that are a tie. `false` if no contact jams: then all jump by some multiple of them, and not clearly.
    pub fn several_without_collision(&mut self, closed: &[usize]) -> Result<bool, SimError> {
        let before = self.y.clone();
        let (sim, rest, (_, qd)) = (self.motion.sim, self.motion.rest(), self.q_qd());
        let (table, responses, _) = self.closed_rows(closed)?;
        let mut u = table.excess(&qd);
        let speed = u.amax();
        if speed <= rest || self.history.count(Class::Jam, self.time) == Some(0.0) {
            return Ok(false);
        }
        table.contacts.iter().for_each(|contact| u[contact.rows.end - 1] = -EQUAL * speed);
        let laws = table.laws(sim, &[], 1.0, Some(&u));
        let solved = self.solve((&table, &responses, laws), [&u, &u], (sim.several, &ACCURACY), None);
        let Ok(outcome) = solved else { return Ok(false) };
        let mut jump = vec![0.0; qd.len()];
        push(&mut jump, &responses, outcome.impulse.as_slice());
        let finite = (0..table.rows.len()).any(|i| table.rows.dot(i, &jump).abs() > CLEAR * speed);
        if !finite || outcome.residual > EXACT {
            return Ok(false);
        }
        let residual = outcome.residual;
        self.strike(closed, (&table, &responses), (&outcome, residual))?;
        let struck: Vec<Struck> = closed.iter().map(|&touch| Struck { touch, approach: 0.0 }).collect();
        self.after(&struck, rest, &before)?;
        Ok(true)
    }

    /// The rows of these touches now, of those that some joint moves, the responses to them, and the rates of all gaps.
    pub fn closed_rows(&mut self, together: &[usize]) -> Result<(Constraints, Rows, Vec<f64>), SimError> {
        let (q, qd) = self.q_qd();
        let (sim, time) = (self.motion.sim, self.time);
        let (mut table, mut responses) = (Constraints::new(sim.chain.nv()), Rows::default());
        let mut view = self.motion.view(&q)?;
        let mut approach = Vec::new();
        for &touch in together {
            let one = &sim.touches[touch];
            let at = one.at(&view, &q, time);
            approach.push(one.rate(&at, &view, &qd, time)?);
            if one.moves(&at, &mut view)? {
                table.add((&Lasting::of(touch, one, None), one), (&at, Some(&view)), time, Level::Velocities)?;
            }
        }
        view.respond(&table.rows, &mut responses)?;
        Ok((table, responses, approach))
    }

    /// The jump by the impulses of these touches, with its event and its loss of energy.
    fn strike(
        &mut self,
        together: &[usize],
        (table, responses): (&Constraints, &Rows),
        (outcome, residual): (&SeveralOutcome, f64),
    ) -> Result<(), SimError> {
        let before = self.y.clone();
        self.history.statistics.worst_residual = self.history.statistics.worst_residual.max(residual);
        push(&mut self.y[self.motion.sim.chain.nq()..], responses, outcome.impulse.as_slice());
        let kind = EventKind::Several { touches: together.to_vec(), residual, flags: outcome.flags };
        self.book(kind, together, table.impulses(outcome.impulse.as_slice()), &before)
    }
}
