//! Loops of a mechanism, as pairs of points that stay together.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | L | m×nv | rows of the differences of the point velocities, along the axes of the algebra | `rows` |
//! | X | nv×r | M⁻¹Lᵀ of independent rows | `responses` |
//! | G | r×r | L X of these rows | `factor` |
//!
//! A chain with loops answers a generalised force f with P M⁻¹f, where P = 1 − X G⁻¹ L removes what the loops prevent: the
//! velocity change of least kinetic energy with L v = 0 (Gauss's principle). The loops are thus part of the response of the
//! chain at every contact, and no contact law has a row for them.
//!
//! Dependent rows, of loops that are closed more often than needed, are left out; their forces have no effect. At a pose at which
//! a mechanism could branch (a four-bar linkage that lies flat) further rows become dependent: see `run/branch.rs`.

use super::accuracy::EQUAL;
use super::basis::Basis;
use carom_chain::algebra::Algebra;
use carom_chain::{Point, Rows};
use nalgebra::{DMatrix, DVector, Vector3};
use std::sync::Arc;

/// Two points that stay together.
#[derive(Debug, Clone)]
pub(crate) struct Coupling<A: Algebra<Scalar = f64>> {
    /// Name of the loop.
    pub name: Arc<str>,
    pub first: Point<A>,
    /// `None`: a place of the world.
    pub second: Option<Point<A>>,
    /// The constant part of the difference of the points: places of the world, and what is perpendicular to the plane.
    pub apart: Vector3<f64>,
    /// Reach of the chain, m.
    pub reach: f64,
}

/// What the loops of a chain prevent, at one configuration.
pub(crate) struct Loops {
    /// L, all rows.
    pub rows: Rows,
    /// M⁻¹Lᵀ, all rows.
    responses: Rows,
    basis: Basis,
}

impl Loops {
    /// From L and M⁻¹Lᵀ, with this number of rows for each pair of points; `None` if no row has an effect.
    pub fn new(rows: Rows, responses: Rows, each: usize) -> Option<Self> {
        let gram = rows.times(&responses);
        // A single row may vanish at some pose; what a pair of points resists with, in all directions, does not.
        let sizes = gram.diagonal();
        let sizes = DVector::from_fn(rows.len(), |i, _| sizes.rows(i - i % each, each).sum().max(f64::MIN_POSITIVE));
        let basis = Basis::among(&gram, &sizes);
        (!basis.rows.is_empty()).then_some(Self { rows, responses, basis })
    }

    /// Changes x by X η, so that L x becomes `wanted` (zero without it) on the independent rows.
    pub fn bind(&self, x: &mut [f64], wanted: Option<&[f64]>) {
        for (row, force) in self.forces(x, wanted) {
            x.iter_mut().zip(self.responses.row(row)).for_each(|(x, response)| *x += force * response);
        }
    }

    /// η of [`Self::bind`]: the independent rows with their forces.
    pub fn forces(&self, x: &[f64], wanted: Option<&[f64]>) -> impl Iterator<Item = (usize, f64)> + use<'_> {
        let rows = &self.basis.rows;
        let missing = |row: usize| wanted.map_or(0.0, |wanted| wanted[row]) - self.rows.dot(row, x);
        let missing = DMatrix::from_fn(rows.len(), 1, |i, _| missing(rows[i]));
        let forces = self.basis.solve(&missing).unwrap_or_default();
        rows.iter().enumerate().filter_map(move |(i, row)| Some((*row, *forces.get(i)?)))
    }

    /// Turns M⁻¹fᵀ of a row f into P M⁻¹fᵀ; zero where the loops lock what f moves. What is left of a response of which most is taken
    /// away has the rounding of what was there; a second pass has that of what is left: "twice is enough" (Parlett, *The Symmetric
    /// Eigenvalue Problem*, 1980, section 6.9).
    pub fn bind_response(&self, row: &[f64], response: &mut [f64]) {
        let along = |response: &[f64]| row.iter().zip(response).map(|(r, x)| r * x).sum::<f64>();
        let open = along(response);
        self.bind(response, None);
        if 2.0 * along(response) < open {
            self.bind(response, None);
            if along(response) <= EQUAL * open {
                response.fill(0.0);
            }
        }
    }

    /// The size of the terms of L x along a row, of which its rounding is a share.
    pub fn terms(&self, row: usize, x: &[f64]) -> f64 {
        self.rows.row(row).iter().zip(x).map(|(l, x)| (l * x).abs()).sum()
    }

    /// The largest size of a number of the independent rows; not a number if one of them is not.
    pub fn most(&self, number: impl Fn(usize) -> f64) -> f64 {
        self.basis.rows.iter().fold(0.0, |most, row| if number(*row).abs() <= most { most } else { number(*row).abs() })
    }

    /// Number of independent rows.
    pub fn rank(&self) -> usize {
        self.basis.rows.len()
    }

    /// The sine of the angle, in the metric of M⁻¹, between the one of `rank` rows that depends most on the others and these:
    /// small near a pose at which the mechanism could branch.
    pub fn regularity(&self, rank: usize) -> f64 {
        let Basis { rows, least, left, .. } = &self.basis;
        if rows.len() < rank { left.sqrt() } else { least.sqrt() }
    }
}
