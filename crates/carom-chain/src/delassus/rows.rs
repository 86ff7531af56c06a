//! The response of the chain to many rows: M⁻¹Fᵀ for any number of rows F, and the acceleration without constraint forces, from
//! one factorisation of M.
//!
//! A row r is a linear function r·q̇ of the joint velocities: the velocity of a point along a direction, the difference of two
//! such velocities, the velocity of one coordinate. Its transpose is the joint forces of a unit force along it. With the rows R
//! of the constraints and the rows F of their forces (equal unless a contact slides), R M⁻¹Fᵀ is the Delassus matrix of all
//! of them.
//!
//! M is factored by the articulated-body recursion, and a row costs one sweep in time O(nv). For many rows on chains of some
//! dozens of bodies the entries of L in M = Lᵀ D L are written out first: ℓₖₐ = sₐ·Uₖ/Dₖ for every ancestor a of body k. A row
//! then costs two products for each of them, and its inward half only those on the way from its contact to the world. For
//! chains with mimic joints M is factored as a whole.

use super::LONG;
use super::topology::{Topology, Tree};
use crate::algebra::Algebra;
use crate::chain::Chain;
use crate::error::ChainError;
use crate::kinematics::{Kinematics, Workspace};
use crate::rounding::ROUNDING;
use nalgebra::DMatrix;

/// From this number of rows on the factor is written out: it costs as much as some three sweeps.
const MANY: usize = 4;
/// Number of rows that are solved together.
const TOGETHER: usize = 4;

/// Rows of length nv in memory that is allocated once and reused.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Rows {
    nv: usize,
    numbers: Vec<f64>,
}

impl Rows {
    /// No rows, for a chain with `nv` velocity coordinates.
    pub fn new(nv: usize) -> Self {
        Self { nv, numbers: Vec::new() }
    }

    /// Removes all rows and keeps the memory.
    pub fn clear(&mut self) {
        self.numbers.clear();
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.numbers.len().checked_div(self.nv).unwrap_or(0)
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.numbers.is_empty()
    }

    /// Adds a row of zeros and returns it.
    pub fn add(&mut self) -> &mut [f64] {
        let start = self.numbers.len();
        self.numbers.resize(start + self.nv, 0.0);
        &mut self.numbers[start..]
    }

    /// Row `i`, length nv.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.numbers[i * self.nv..(i + 1) * self.nv]
    }

    /// All rows in their order.
    pub fn iter(&self) -> impl Iterator<Item = &[f64]> {
        self.numbers.chunks_exact(self.nv.max(1))
    }

    /// All rows in their order, to change.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut [f64]> {
        self.numbers.chunks_exact_mut(self.nv.max(1))
    }

    /// Takes the rows from row `i` on away and returns them.
    ///
    /// # Panics
    /// If there are fewer than `i` rows.
    pub fn split_off(&mut self, i: usize) -> Self {
        Self { nv: self.nv, numbers: self.numbers.split_off(i * self.nv) }
    }

    /// The product of row `i` with a vector of length nv.
    pub fn dot(&self, i: usize, v: &[f64]) -> f64 {
        self.row(i).iter().zip(v).map(|(r, v)| r * v).sum()
    }

    /// The products of all rows (first index) with all rows of `others`: for the responses of rows F, R M⁻¹Fᵀ.
    pub fn times(&self, others: &Rows) -> DMatrix<f64> {
        // One coordinate of all `others` side by side. A row of a contact has entries for the joints between the contact and the world
        // only.
        let columns = DMatrix::from_fn(others.len(), self.nv, |j, v| others.row(j)[v]);
        let mut product = DMatrix::zeros(others.len(), self.len());
        for (row, mut products) in self.iter().zip(product.column_iter_mut()) {
            for (r, column) in row.iter().zip(columns.column_iter()).filter(|(r, _)| **r != 0.0) {
                products.axpy(*r, &column, 1.0);
            }
        }
        product.transpose()
    }
}

#[doc(hidden)]
impl<A: Algebra<Scalar = f64>> Kinematics<'_, A> {
    /// Sets those entries of a row to zero that are rounding: a joint whose axis meets the line of a contact normal does not move the
    /// contact along it, but its entry is a difference of lengths. The row is the velocity, along a direction of length `size`, of a
    /// point (or of one relative to another) at a distance of `from_origin`, m, from the origin of the world. An entry is zero if it is
    /// within 64 ε of what the geometry could give: reach plus that distance for a hinge, 1 for a joint that slides.
    pub fn clear_rounding(&self, from_origin: f64, size: f64, row: &mut [f64]) {
        let structure = &self.chain().structure;
        let (lever, noise) = (structure.reach + from_origin, ROUNDING * size);
        for (entry, [turns, slides]) in row.iter_mut().zip(&structure.turns_and_slides) {
            if entry.abs() <= noise * (turns * lever + slides) {
                *entry = 0.0;
            }
        }
    }

    /// M⁻¹rᵀ for every row r, as the rows of `responses`: joint velocities after a unit impulse along the row.
    ///
    /// # Errors
    /// [`ChainError::NoInertia`] where M is singular; [`ChainError::WrongLength`] for rows of another chain.
    pub fn respond(&mut self, rows: &Rows, responses: &mut Rows) -> Result<(), ChainError> {
        self.answer(None, &[], rows, responses)
    }

    /// As [`Kinematics::respond`], with the forward dynamics of [`Kinematics::forward_dynamics_into`] by the same factorisation, and
    /// with inertia added to each coordinate: `added` is empty or has length nv, and infinite inertia locks a joint.
    ///
    /// # Errors
    /// As both.
    pub fn accelerate_and_respond(
        &mut self,
        (qd, tau, gravity): (&[f64], &[f64], A::Vector),
        added: &[f64],
        qdd: &mut [f64],
        rows: &Rows,
        responses: &mut Rows,
    ) -> Result<(), ChainError> {
        self.answer(Some((qd, tau, gravity, qdd)), added, rows, responses)
    }

    #[expect(clippy::type_complexity, reason = "the inputs and the output of the forward dynamics, private")]
    fn answer(
        &mut self,
        dynamics: Option<(&[f64], &[f64], A::Vector, &mut [f64])>,
        added: &[f64],
        rows: &Rows,
        responses: &mut Rows,
    ) -> Result<(), ChainError> {
        let nv = self.chain().nv();
        self.chain().check_nv("row", if rows.is_empty() { nv } else { rows.nv })?;
        (responses.nv, responses.numbers) = (nv, std::mem::take(&mut responses.numbers));
        responses.clear();
        if self.chain().is_coupled() {
            let mut dense = self.dense(added)?;
            if let Some((qd, tau, gravity, qdd)) = dynamics {
                self.dense_dynamics(&mut dense, (qd, tau, gravity), qdd)?;
            }
            for row in rows.iter() {
                let response = responses.add();
                response.copy_from_slice(row);
                dense.solve(response);
            }
            return Ok(());
        }
        let n = self.chain().bodies.len();
        let mut articulation = self.articulate_checked(added)?;
        if let Some((qd, tau, gravity, qdd)) = dynamics {
            articulation.forward_dynamics_into(qd, tau, gravity, qdd)?;
        }
        if rows.len() < MANY || n > LONG {
            return rows.iter().try_for_each(|row| articulation.solve_into(row, responses.add()));
        }
        responses.numbers.resize(rows.numbers.len(), 0.0);
        let Self { chain, ws } = self;
        ws.write_factor(chain);
        ws.solve_rows(chain, rows, responses);
        Ok(())
    }
}

impl<A: Algebra<Scalar = f64>> Workspace<A> {
    /// Writes L from the articulated inertias: row k has the entries of the ancestors of body k by their depth.
    fn write_factor(&mut self, chain: &Chain<A>) {
        let n = chain.bodies.len();
        let tree = Tree::new(&chain.structure.paths, 0);
        self.factor.resize(n * n, 0.0);
        for k in 0..n {
            let mut force = self.free[k].transmitted * self.free[k].inverse_d;
            let mut shift = self.links[k].offset;
            let mut entries = self.factor[k * n..][..tree.depth(k)].iter_mut().rev();
            for run in tree.runs(k) {
                for (link, entry) in self.links[run].iter().rev().zip(&mut entries) {
                    force = force.shifted(shift);
                    *entry = link.axis.dot(force);
                    shift = link.offset;
                }
            }
        }
    }

    /// x = L⁻¹ D⁻¹ L⁻ᵀ r for all rows r, with the factor in place.
    fn solve_rows(&mut self, chain: &Chain<A>, rows: &Rows, responses: &mut Rows) {
        let (n, nv) = (chain.bodies.len(), chain.nv());
        let tree = Tree::new(&chain.structure.paths, 0);
        let Self { factor, free, solved, .. } = self;
        solved.resize(n, [0.0; TOGETHER]);
        let blocks = rows.numbers.chunks(TOGETHER * nv).zip(responses.numbers.chunks_mut(TOGETHER * nv));
        for (rows, responses) in blocks {
            solved.fill([0.0; TOGETHER]);
            for (l, row) in rows.chunks_exact(nv).enumerate() {
                (0..n).for_each(|k| solved[k][l] = row[tree.coordinate(k)]);
            }
            // Inward: off the way from the contact to the world all entries are zero.
            for k in (0..n).rev() {
                let (before, rest) = solved.split_at_mut(k);
                let own = &mut rest[0];
                if *own == [0.0; TOGETHER] {
                    continue;
                }
                let mut depth = tree.depth(k);
                for run in tree.runs(k) {
                    let entries = &factor[k * n + depth - run.len()..k * n + depth];
                    depth -= run.len();
                    for (there, entry) in before[run].iter_mut().zip(entries) {
                        (0..TOGETHER).for_each(|l| there[l] -= entry * own[l]);
                    }
                }
                own.iter_mut().for_each(|u| *u *= free[k].inverse_d);
            }
            for k in 0..n {
                let (before, rest) = solved.split_at_mut(k);
                let own = &mut rest[0];
                let mut depth = tree.depth(k);
                for run in tree.runs(k) {
                    let entries = &factor[k * n + depth - run.len()..k * n + depth];
                    depth -= run.len();
                    for (there, entry) in before[run].iter().zip(entries) {
                        (0..TOGETHER).for_each(|l| own[l] -= entry * there[l]);
                    }
                }
            }
            for (l, response) in responses.chunks_exact_mut(nv).enumerate() {
                (0..n).for_each(|k| response[tree.coordinate(k)] = solved[k][l]);
            }
        }
    }
}
