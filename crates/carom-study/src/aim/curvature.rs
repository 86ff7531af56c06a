//! The approximation B of the second derivatives of the Lagrangian.
//!
//! Damped updates keep B positive, and make it grow without bound along directions in which the Lagrangian bends down: steps become short, and
//! promise nothing. So B is begun anew once it is far above what was seen, and before the search may end by it.

use nalgebra::{DMatrix, DVector};

/// B so many times the largest second derivative that was seen is begun anew.
const GROWN: f64 = 10.0;

pub(super) struct Curvature {
    /// B; `None`: the model has all second derivatives in closed form.
    pub matrix: Option<DMatrix<f64>>,
    /// The largest second derivative that was seen along a step, and that along the last one, at least 0.
    seen: f64,
    last: f64,
    /// The number of steps after which it was begun anew, to see whether the search ends.
    renewed: Option<usize>,
}

impl Curvature {
    pub fn new(matrix: Option<DMatrix<f64>>) -> Self {
        Self { matrix, seen: 0.0, last: 0.0, renewed: None }
    }

    /// Takes account of a step d along which the derivatives changed by y.
    pub fn learn(&mut self, d: &DVector<f64>, y: &DVector<f64>) {
        self.last = (d.dot(y) / d.norm_squared()).max(0.0);
        self.seen = self.seen.max(y.norm() / d.norm());
        let fresh = DMatrix::identity(d.len(), d.len()) * self.last;
        let own = self.matrix.get_or_insert_with(|| fresh.clone());
        if own.amax() == 0.0 {
            own.copy_from(&fresh);
        }
        update(own, d, y);
        if own.amax() > GROWN * self.seen {
            *own = fresh;
        }
    }

    /// Begins anew where the search would end after so many steps; `false` if it has done so there, or has learnt nothing.
    pub fn renew(&mut self, steps: usize) -> bool {
        let Some(own) = self.matrix.as_mut().filter(|_| steps > 0 && self.renewed != Some(steps)) else { return false };
        self.renewed = Some(steps);
        own.fill(0.0);
        own.fill_diagonal(self.last);
        true
    }
}

/// Powell's damped BFGS update of B, for a step d along which the derivatives changed by y (Nocedal & Wright 2006, procedure 18.2).
fn update(b: &mut DMatrix<f64>, d: &DVector<f64>, y: &DVector<f64>) {
    let bd = &*b * d;
    let (curved, found) = (d.dot(&bd), d.dot(y));
    if curved <= 0.0 {
        return;
    }
    let theta = if found >= 0.2 * curved { 1.0 } else { 0.8 * curved / (curved - found) };
    let y = y * theta + &bd * (1.0 - theta);
    let along = d.dot(&y);
    *b += &y * y.transpose() / along - &bd * bd.transpose() / curved;
}
