//! A chain with loops at one configuration: the rows of its loops, what they leave of its responses, and their closing.

use super::accuracy::{EQUAL, EXACT, ROUNDING, STEPS};
use super::coupling::{Coupling, Loops};
use super::space::{Space, View};
use crate::error::SimError;
use carom_chain::{Chain, FrameId, Point, Rows, Workspace};
use nalgebra::Vector3;
use std::sync::Arc;

impl<A: Space> Coupling<A> {
    /// The coupling of a point of a frame (at `offset`, in its axes) and a point of another one, or a place of the world.
    pub fn new(
        name: &Arc<str>,
        model: &A::Model,
        (frame, offset): (FrameId, Vector3<f64>),
        (other, place): (Option<FrameId>, Vector3<f64>),
        reach: f64,
    ) -> Self {
        let (first, beside) = A::material_point(model, frame, offset);
        let (second, other_beside) = match other {
            Some(other) => {
                let (second, beside) = A::material_point(model, other, place);
                (Some(second), beside)
            }
            None => (None, place),
        };
        Self { name: name.clone(), first, second, apart: beside - other_beside, reach }
    }

    /// From the second point to the first, m, world axes.
    fn gap(&self, view: &View<A>) -> Vector3<f64> {
        let at = |point: Point<A>| A::lift(view.model, view.kin.position(point));
        at(self.first) - self.second.map_or_else(Vector3::zeros, at) + self.apart
    }
}

impl<A: Space> View<'_, A> {
    /// L; no rows without loops.
    pub fn loop_rows(&self) -> Result<Rows, SimError> {
        let mut rows = Rows::new(self.kin.chain().nv());
        for coupling in self.couplings {
            for axis in self.axes() {
                let row = rows.add();
                self.add_row(coupling.first, axis, row)?;
                if let Some(second) = coupling.second {
                    self.add_row(second, -axis, row)?;
                }
            }
        }
        Ok(rows)
    }

    /// The axes of the algebra, world.
    fn axes(&self) -> impl Iterator<Item = Vector3<f64>> + use<'_, A> {
        (0..A::LINEAR).map(|k| A::lift(self.model, A::vector(|i| if i == k { 1.0 } else { 0.0 })))
    }

    /// The components of these vectors, one for each coupling, along the rows.
    fn along(&self, vectors: &[Vector3<f64>]) -> Vec<f64> {
        vectors.iter().flat_map(|vector| self.axes().map(|axis| axis.dot(vector))).collect()
    }

    /// What the loops prevent here; `None` without loops.
    pub fn closed(&mut self) -> Result<Option<Loops>, SimError> {
        if self.couplings.is_empty() {
            return Ok(None);
        }
        let (rows, mut responses) = (self.loop_rows()?, Rows::default());
        self.kin.respond(&rows, &mut responses)?;
        Ok(Loops::new(rows, responses, A::LINEAR))
    }

    /// M⁻¹fᵀ for every row f, as far as the loops allow, with q̈ under joint forces and gravity alone if it is asked for: by one
    /// factorisation of M, of which the rows of the loops are the first.
    #[expect(clippy::type_complexity, reason = "the inputs and the output of the forward dynamics, private")]
    pub(super) fn respond_in_loops(
        &mut self,
        dynamics: Option<(&[f64], &[f64], Vector3<f64>, &mut [f64])>,
        rows: &Rows,
        responses: &mut Rows,
    ) -> Result<(), SimError> {
        let mut all = self.loop_rows()?;
        let own = all.len();
        rows.iter().for_each(|row| all.add().copy_from_slice(row));
        let mut answers = Rows::default();
        let accelerated = match dynamics {
            Some((qd, tau, gravity, qdd)) => {
                let gravity = A::project(self.model, gravity);
                self.kin.accelerate_and_respond((qd, tau, gravity), &[], qdd, &all, &mut answers)?;
                Some((qd, qdd))
            }
            None => {
                self.kin.respond(&all, &mut answers)?;
                None
            }
        };
        *responses = answers.split_off(own);
        all.split_off(own);
        let Some(closed) = Loops::new(all, answers, A::LINEAR) else { return Ok(()) };
        if let Some((qd, qdd)) = accelerated {
            // Twice: joints that the loops lock are then at rest to the rounding of their own acceleration. What is left below the rounding of
            // the acceleration without loops is none.
            let wanted = self.loop_acceleration(qd)?;
            let open = qdd.iter().fold(0.0, |most: f64, a| most.max(a.abs()));
            closed.bind(qdd, Some(&wanted));
            closed.bind(qdd, Some(&wanted));
            qdd.iter_mut().filter(|a| a.abs() <= ROUNDING * open).for_each(|a| *a = 0.0);
        }
        rows.iter().zip(responses.iter_mut()).for_each(|(row, response)| closed.bind_response(row, response));
        Ok(())
    }

    /// −d(L q̇)/dt at q̈ = 0: what L q̈ must be.
    pub fn loop_acceleration(&mut self, qd: &[f64]) -> Result<Vec<f64>, SimError> {
        let couplings = self.couplings;
        let drifts = self.drifts(couplings.iter().map(|it| [Some(it.first), it.second]), qd)?;
        let wanted: Vec<_> = drifts.iter().map(|[first, second]| second - first).collect();
        Ok(self.along(&wanted))
    }

    /// The differences of the points that should be together.
    fn gaps(&self) -> Vec<Vector3<f64>> {
        self.couplings.iter().map(|coupling| coupling.gap(self)).collect()
    }
}

/// Closes the loops by the smallest changes of q and q̇ in the metric of M: Newton's method, then a projection of q̇. Returns
/// whether anything changed.
///
/// # Errors
/// [`SimError::Loop`] if they do not close.
pub(crate) fn close_loops<A: Space>(
    (chain, model): (&Chain, &A::Model),
    workspace: &mut Workspace<A>,
    couplings: &[Coupling<A>],
    q: &mut [f64],
    qd: &mut [f64],
) -> Result<bool, SimError> {
    if couplings.is_empty() {
        return Ok(false);
    }
    let mut changed = false;
    let reach = couplings.iter().fold(0.0_f64, |most, coupling| most.max(coupling.reach));
    for step in 0.. {
        let mut view = View::closed_by(model, workspace, q, couplings)?;
        let gaps = view.gaps();
        let closed = view.closed()?;
        let along = view.along(&gaps);
        let open = closed.as_ref().map_or(0.0, |closed| closed.most(|row| along[row]));
        // A joint that has turned many times is rounded to its own digits.
        let rounding = 4.0 * f64::EPSILON * reach * q.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let within = (EXACT * reach).max(rounding);
        if open <= if step == 0 { 0.1 * ROUNDING * reach } else { within } || step == STEPS {
            let excess = |k: &usize| gaps[*k].norm() / couplings[*k].reach;
            let worst = (0..gaps.len()).max_by(|a, b| excess(a).total_cmp(&excess(b))).unwrap_or(0);
            // Along rows that depend on others, for `Basis` up to the square root of its share, no joint closes what is open: axes that a file
            // gives with five digits are parallel to some 1e-6.
            if !(open <= within && excess(&worst) <= EQUAL.sqrt()) {
                return Err(SimError::Loop { name: couplings[worst].name.to_string(), gap: gaps[worst].into() });
            }
            // The velocities along the rows, as shares of their terms.
            let opens = |closed: &Loops| {
                closed.most(|row| closed.rows.dot(row, qd)) > 0.1 * ROUNDING * closed.most(|row| closed.terms(row, qd))
            };
            if let Some(closed) = closed.filter(opens) {
                closed.bind(qd, None);
                changed = true;
            }
            break;
        }
        let mut back = vec![0.0; qd.len()];
        if let Some(closed) = closed {
            closed.bind(&mut back, Some(&along));
        }
        q.copy_from_slice(&chain.integrate(q, &back, -1.0)?);
        changed = true;
    }
    Ok(changed)
}
