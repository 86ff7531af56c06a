//! Loops of a mechanism, as pairs of points that stay together.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | L | m×nv | rows of the differences of the point velocities, along the axes of the algebra | `rows` |
//! | X | nv×r | M⁻¹Lᵀ of independent rows | `responses` |
//! | G | r×r | L X of these rows | `factor` |
//!
//! A chain with loops answers a generalised force f with P M⁻¹f, where P = 1 − X G⁻¹ L removes what the loops prevent: the
//! velocity change of least kinetic energy with L v = 0 (Gauss's principle). The loops are thus part of what every contact
//! feels of the chain, and no contact law has a row for them.
//!
//! Dependent rows, of loops that are closed more often than needed, are left out; their forces have no effect. At a pose at which
//! a mechanism could branch (a four-bar linkage that lies flat) further rows become dependent: see `run/branch.rs`.

use super::basis::Basis;
use super::space::{Space, View};
use crate::error::SimError;
use carom_chain::{Chain, FrameId, Point, Rows, Workspace};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};
use std::sync::Arc;

/// Two points that stay together.
#[derive(Debug, Clone)]
pub(crate) struct Coupling<A: Space> {
    /// Name of the loop.
    pub name: Arc<str>,
    first: Point<A>,
    /// `None`: a place of the world.
    second: Option<Point<A>>,
    /// The constant part of the difference of the points: places of the world, and what is perpendicular to the plane.
    apart: Vector3<f64>,
    /// What may stay open along dependent rows, m.
    slack: f64,
}

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
        Self { name: name.clone(), first, second, apart: beside - other_beside, slack: SLACK * reach }
    }

    /// From the second point to the first, m, world axes.
    fn gap(&self, view: &View<A>) -> Vector3<f64> {
        let at = |point: Point<A>| A::lift(view.model, view.kin.position(point));
        at(self.first) - self.second.map_or_else(Vector3::zeros, at) + self.apart
    }
}

/// What the loops of a chain prevent, at one configuration.
pub(crate) struct Loops {
    /// L, all rows.
    rows: Rows,
    /// M⁻¹Lᵀ, all rows.
    responses: Rows,
    basis: Basis,
    factor: Cholesky<f64, Dyn>,
}

impl Loops {
    /// From L and M⁻¹Lᵀ, with this number of rows for each pair of points; `None` if no row has an effect.
    pub fn new(rows: Rows, responses: Rows, each: usize) -> Option<Self> {
        let gram = rows.times(&responses);
        // A single row may vanish at some pose; what a pair of points resists with, in all directions, does not.
        let sizes = gram.diagonal();
        let sizes = DVector::from_fn(rows.len(), |i, _| sizes.rows(i - i % each, each).sum().max(f64::MIN_POSITIVE));
        let basis = Basis::among(&gram, &sizes);
        let r = basis.rows.len();
        let factor = DMatrix::from_fn(r, r, |i, j| gram[(basis.rows[i], basis.rows[j])]).cholesky()?;
        (r > 0).then_some(Self { rows, responses, basis, factor })
    }

    /// Changes x by X η, so that L x becomes `wanted` (zero without it) on the independent rows.
    pub fn bind(&self, x: &mut [f64], wanted: Option<&[f64]>) {
        let rows = &self.basis.rows;
        let missing = |row: usize| wanted.map_or(0.0, |wanted| wanted[row]) - self.rows.dot(row, x);
        let missing = DVector::from_fn(rows.len(), |i, _| missing(rows[i]));
        for (row, force) in rows.iter().zip(self.factor.solve(&missing).iter()) {
            x.iter_mut().zip(self.responses.row(*row)).for_each(|(x, response)| *x += force * response);
        }
    }

    /// The largest size of a number of the independent rows; not a number if one of them is not.
    fn most(&self, number: impl Fn(usize) -> f64) -> f64 {
        self.basis.rows.iter().fold(0.0, |most, row| if number(*row).abs() <= most { most } else { number(*row).abs() })
    }

    /// Number of independent rows.
    pub fn rank(&self) -> usize {
        self.basis.rows.len()
    }

    /// The sine of the angle, in the metric of M⁻¹, between the one of `rank` rows that depends most on the others and these:
    /// small near a pose at which the mechanism could branch.
    pub fn regularity(&self, rank: usize) -> f64 {
        let Basis { rows, least, left } = &self.basis;
        if rows.len() < rank { left.sqrt() } else { least.sqrt() }
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
                self.kin.accelerate_and_respond((qd, tau, gravity), qdd, &all, &mut answers)?;
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
            closed.bind(qdd, Some(&self.loop_acceleration(qd)?));
        }
        responses.iter_mut().for_each(|response| closed.bind(response, None));
        Ok(())
    }

    /// −d(L q̇)/dt at q̈ = 0: what L q̈ must be.
    pub fn loop_acceleration(&mut self, qd: &[f64]) -> Result<Vec<f64>, SimError> {
        let mut wanted = Vec::with_capacity(self.couplings.len());
        for coupling in self.couplings {
            let second = coupling.second.map_or(Ok(Vector3::zeros()), |second| self.drift(second, qd))?;
            wanted.push(second - self.drift(coupling.first, qd)?);
        }
        Ok(self.along(&wanted))
    }

    /// The differences of the points that should be together.
    fn gaps(&self) -> Vec<Vector3<f64>> {
        self.couplings.iter().map(|coupling| coupling.gap(self)).collect()
    }
}

/// Distances up to this are rounding, m; velocities, m/s.
const ROUNDING: f64 = 1e-15;
/// A loop whose points are within this distance is closed, m: far above rounding, far below any tolerance of integration.
const CLOSED: f64 = 1e-12;
/// Newton's steps from any start.
const STEPS: usize = 50;
/// Share of the chain's reach that may stay open along rows that depend on others: no joint closes it. Axes that a file gives
/// with five digits are parallel to some 1e-6; `Basis` takes such rows for dependent up to 1e-5.
const SLACK: f64 = 1e-5;

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
    for step in 0.. {
        let mut view = View::closed_by(model, workspace, q, couplings)?;
        let gaps = view.gaps();
        let closed = view.closed()?;
        let along = view.along(&gaps);
        let open = closed.as_ref().map_or(0.0, |closed| closed.most(|row| along[row]));
        if open <= if step == 0 { ROUNDING } else { CLOSED } || step == STEPS {
            let excess = |k: &usize| gaps[*k].norm() / couplings[*k].slack;
            let worst = (0..gaps.len()).max_by(|a, b| excess(a).total_cmp(&excess(b))).unwrap_or(0);
            if !(open <= CLOSED && excess(&worst) <= 1.0) {
                return Err(SimError::Loop { name: couplings[worst].name.to_string(), gap: gaps[worst].into() });
            }
            if let Some(closed) = closed.filter(|closed| closed.most(|row| closed.rows.dot(row, qd)) > ROUNDING) {
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
