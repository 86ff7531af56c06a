//! One constraint alone, the others' impulses given: solved exactly. A contact that approaches gets its impulse from
//! [`Cone`], one that does not gets none.

use nalgebra::{DMatrix, Vector3};

use super::Constraint;
use crate::cone::Cone;

/// A share below which a number is rounding of zero beside its neighbours.
const NOTHING: f64 = 1024.0 * f64::EPSILON;

/// A constraint with what its rows of H say, prepared once.
pub(super) struct Block {
    pub constraint: Constraint,
    /// First row.
    pub row: usize,
    /// Mean diagonal entry of its rows (1/kg); 1 where nothing can move it, so that it can divide.
    pub scale: f64,
    /// Of a contact whose normal can move.
    cone: Option<Cone<f64>>,
    /// H_nn of a contact, H of any other constraint (1/kg).
    inverse_mass: f64,
}

impl Block {
    pub fn new(constraint: Constraint, row: usize, h: &DMatrix<f64>) -> Self {
        let rows = constraint.rows();
        let mean = (row..row + rows).map(|i| h[(i, i)]).sum::<f64>() / rows as f64;
        let last = row + rows - 1;
        // A diagonal entry that is rounding beside the whole matrix cannot carry an impulse.
        let nothing = h.diagonal().amax() * NOTHING * NOTHING;
        let inverse_mass = if h[(last, last)] > nothing { h[(last, last)] } else { 0.0 };
        let cone = (rows == 3 && inverse_mass > 0.0).then(|| {
            let tangents = h.fixed_view::<2, 2>(row, row).into_owned();
            Cone::new(tangents, h.fixed_view::<2, 1>(row, last).into_owned(), inverse_mass)
        });
        Self { constraint, row, scale: if mean > nothing { mean } else { 1.0 }, cone, inverse_mass }
    }

    /// The impulse along one row, with velocity c (m/s) at none.
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

    /// The impulse of a contact with friction μ, with velocity c (m/s) at none, where c is a sum of terms of the
    /// given size (m/s).
    pub fn solve_contact(&self, mu: f64, c: Vector3<f64>, size: f64) -> Vector3<f64> {
        let Some(cone) = self.cone.filter(|_| c.z < 0.0) else {
            return Vector3::zeros();
        };
        // Where nothing moves a tangent that restitution is to move, friction may wedge the contact: no impulse is
        // an answer, and the smooth one is at least of finite size.
        match cone.solve(mu, &c.xy(), c.z, size) {
            Some(touch) => Vector3::new(touch.tangent.x, touch.tangent.y, touch.normal),
            None => Vector3::new(0.0, 0.0, -c.z / self.inverse_mass),
        }
    }
}
