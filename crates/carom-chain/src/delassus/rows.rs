//! What many rows feel of the chain: M⁻¹Fᵀ for any number of rows F, and the acceleration without constraint forces, from
//! one factorisation of M.
//!
//! A row r is a linear function r·q̇ of the joint velocities: the velocity of a point along a direction, the difference of two
//! such velocities, the velocity of one coordinate. Its transpose is the joint forces of a unit force along it. With the rows R
//! of the constraints and the rows F of their forces (equal unless a contact slides), R M⁻¹Fᵀ is the Delassus matrix of all
//! of them.
//!
//! M is factored by the articulated-body recursion, and every row costs one sweep in time O(nv); for chains with mimic joints
//! by Cholesky's method.

use crate::algebra::Algebra;
use crate::error::ChainError;
use crate::kinematics::Kinematics;
use nalgebra::{DMatrix, DVector};

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
        DMatrix::from_fn(self.len(), others.len(), |i, j| self.dot(i, others.row(j)))
    }
}

impl<A: Algebra<Scalar = f64>> Kinematics<'_, A> {
    /// M⁻¹rᵀ for every row r, as the rows of `responses`: joint velocities after a unit impulse along the row.
    ///
    /// # Errors
    /// [`ChainError::NoInertia`] where M is singular; [`ChainError::WrongLength`] for rows of another chain.
    pub fn respond(&mut self, rows: &Rows, responses: &mut Rows) -> Result<(), ChainError> {
        self.answer(None, rows, responses)
    }

    /// As [`Kinematics::respond`], with the forward dynamics of [`Kinematics::forward_dynamics_into`] by the same factorisation.
    ///
    /// # Errors
    /// As both.
    pub fn accelerate_and_respond(
        &mut self,
        (qd, tau, gravity): (&[f64], &[f64], A::Vector),
        qdd: &mut [f64],
        rows: &Rows,
        responses: &mut Rows,
    ) -> Result<(), ChainError> {
        self.answer(Some((qd, tau, gravity, qdd)), rows, responses)
    }

    #[expect(clippy::type_complexity, reason = "the inputs and the output of the forward dynamics, private")]
    fn answer(
        &mut self,
        dynamics: Option<(&[f64], &[f64], A::Vector, &mut [f64])>,
        rows: &Rows,
        responses: &mut Rows,
    ) -> Result<(), ChainError> {
        let nv = self.chain().nv();
        self.chain().check_nv("row", if rows.is_empty() { nv } else { rows.nv })?;
        (responses.nv, responses.numbers) = (nv, std::mem::take(&mut responses.numbers));
        responses.clear();
        if self.chain().is_coupled() {
            if let Some((qd, tau, gravity, qdd)) = dynamics {
                self.forward_dynamics_into(qd, tau, gravity, qdd)?;
            }
            let cholesky = self.cholesky()?;
            for row in rows.iter() {
                let solved = cholesky.solve(&DVector::from_column_slice(row));
                responses.add().copy_from_slice(solved.as_slice());
            }
            return Ok(());
        }
        let mut articulation = self.articulate_checked(&[])?;
        if let Some((qd, tau, gravity, qdd)) = dynamics {
            articulation.forward_dynamics_into(qd, tau, gravity, qdd)?;
        }
        for row in rows.iter() {
            articulation.solve_into(row, responses.add())?;
        }
        Ok(())
    }
}
