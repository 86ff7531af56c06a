//! Exact solution of one constraint with the impulses of the others given. An approaching contact gets its impulse from
//! [`Cone`], a separating one gets none.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::Constraint;
use crate::cone::Cone;
use crate::rounding::NULL_PIVOT;

/// A constraint with the entries of H that belong to it.
#[derive(Clone)]
pub(super) struct Block {
    pub constraint: Constraint,
    /// First row.
    pub row: usize,
    /// Mean diagonal entry of its rows (1/kg); 1 if all are zero, so that it can divide.
    pub scale: f64,
    /// What regularisation has added to its diagonal entries (1/kg).
    pub added: f64,
    /// Its own entries (1/kg), the only one first.
    pub own: Matrix3<f64>,
    /// For a contact whose normal direction is regular.
    cone: Option<Cone<f64>>,
    /// H_nn of a contact, the diagonal entry of any other constraint (1/kg); 0 if it is zero within rounding.
    inverse_mass: f64,
}

/// A diagonal entry of H up to this is rounding relative to the whole matrix, and counts as zero (1/kg).
pub(super) fn nothing(h: &DMatrix<f64>) -> f64 {
    let null = NULL_PIVOT * f64::EPSILON;
    (0..h.nrows()).fold(0.0, |most: f64, i| most.max(h[(i, i)].abs())) * null * null
}

impl Block {
    pub fn new(constraint: Constraint, row: usize, h: &DMatrix<f64>, nothing: f64) -> Self {
        let rows = constraint.rows();
        let own = Matrix3::from_fn(|i, j| if i < rows && j < rows { h[(row + i, row + j)] } else { 0.0 });
        Self::of(constraint, row, own, nothing)
    }

    fn of(constraint: Constraint, row: usize, own: Matrix3<f64>, nothing: f64) -> Self {
        let rows = constraint.rows();
        let mean = own.trace() / rows as f64;
        let normal = own[(rows - 1, rows - 1)];
        let inverse_mass = if normal > nothing { normal } else { 0.0 };
        let cone = (rows == 3 && inverse_mass > 0.0).then(|| {
            let tangents = own.fixed_view::<2, 2>(0, 0).into_owned();
            Cone::new(tangents, own.fixed_view::<2, 1>(0, 2).into_owned(), inverse_mass)
        });
        Self { constraint, row, scale: if mean > nothing { mean } else { 1.0 }, added: 0.0, own, cone, inverse_mass }
    }

    /// The same with `share` of its scale added to its diagonal entries.
    pub fn regularised(&self, share: f64, nothing: f64) -> Self {
        let added = share * self.scale;
        let mut own = self.own;
        for i in 0..self.constraint.rows() {
            own[(i, i)] += added;
        }
        Self { added, ..Self::of(self.constraint, self.row, own, nothing) }
    }

    /// The impulse along one row whose velocity without impulse is c (m/s).
    pub fn solve_one(&self, c: f64) -> f64 {
        if self.inverse_mass == 0.0 {
            return 0.0;
        }
        let rest = -c / self.inverse_mass;
        match self.constraint {
            Constraint::Stop { .. } => rest.max(0.0),
            Constraint::Dry { bound } => rest.clamp(-bound, bound),
            Constraint::Held | Constraint::Contact { .. } => rest,
        }
    }

    /// The impulse of a contact with friction μ whose velocity without impulse is c (m/s), a sum of terms of the given
    /// size (m/s).
    pub fn solve_contact(&self, mu: f64, c: Vector3<f64>, size: impl FnOnce() -> f64) -> Vector3<f64> {
        let Some(cone) = self.cone.filter(|_| c.z < 0.0) else {
            return Vector3::zeros();
        };
        // For singular H friction may wedge the contact, and no impulse is a solution: the frictionless one is finite.
        match cone.solve(mu, &c.xy(), c.z, size) {
            Some(touch) => Vector3::new(touch.tangent.x, touch.tangent.y, touch.normal),
            None => Vector3::new(0.0, 0.0, -c.z / self.inverse_mass),
        }
    }
}
