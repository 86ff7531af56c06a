//! The equations K λ = b of the forces of several constraints, factored once for any number of right-hand sides.
//!
//! Symbols as in `held.rs`. Most rows are clearly independent, and this shows in the symmetric part S = ½ (K + Kᵀ): where it is positive
//! definite, xᵀK x = xᵀS x > 0 for every x ≠ 0. So K is regular, and with x = K⁻¹eᵢ a unit force along row i, the others held, moves
//! this row with it: (K⁻¹)ᵢᵢ > 0, which makes sliding consistent. Otherwise R M⁻¹ Rᵀ tells which rows are independent.

use super::assembled::Assembled;
use super::lasting::{Hold, Lasting};
use crate::state::{Basis, Spread};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, LU};

/// Pivots of S above this share of the terms of their row belong to independent rows: far above the share of [`Basis`] that decides.
const INDEPENDENT: f64 = 1e-6;
/// A force moves its row, the others held, by more than this share of what a force along R moves it alone.
const YIELDS: f64 = 1e-12;

/// Factored equations.
pub(crate) enum Equations {
    /// F = R.
    Symmetric(Cholesky<f64, Dyn>),
    Regular(LU<f64, Dyn, Dyn>),
    /// Rows depend on others.
    Redundant(Spread),
}

impl Equations {
    /// Of these lasting contacts; `None` if it depends on the responses of the rows R, and they are missing.
    ///
    /// # Errors
    /// The row of a contact that jams: no force along it opens the gap.
    pub fn of(found: &Assembled, lasting: &[Lasting]) -> Result<Option<Self>, usize> {
        let (k, constraints) = (found.delassus(), &found.constraints);
        let (m, skew) = (k.nrows(), !constraints.skewed.is_empty());
        if m == 1 {
            // A unit force must open the gap; NaN does not.
            let opens = k[(0, 0)] > 0.0 && (!skew || k[(0, 0)] > YIELDS * found.terms(0));
            let jams = !opens && !constraints.contacts.is_empty();
            return if jams { Err(0) } else { Ok(Some(Self::Regular(k.lu()))) };
        }
        let symmetric = if skew { (&k + k.transpose()) * 0.5 } else { k.clone() };
        if let Some(factor) = symmetric.cholesky() {
            let l = factor.l_dirty();
            if (0..m).all(|i| l[(i, i)] * l[(i, i)] > INDEPENDENT * found.terms(i)) {
                return Ok(Some(if skew { Self::Regular(k.lu()) } else { Self::Symmetric(factor) }));
            }
        }
        if skew && found.own_responses.is_empty() {
            return Ok(None);
        }
        let gram = found.gram();
        let basis = Basis::of(&gram);
        if basis.rows.len() < m {
            return basis.spread(&k).map(|spread| Some(Self::Redundant(spread))).ok_or(0);
        }
        let factor = k.lu();
        let rigid = lasting.iter().filter(|own| own.is_rigid());
        for (contact, own) in constraints.contacts.iter().zip(rigid) {
            let slides = matches!(own.hold, Hold::Slides { .. } | Hold::Starts { .. }) && skew;
            if !slides || contact.rows.is_empty() {
                continue; // without rows: the joint is locked
            }
            let row = contact.rows.start;
            let mut force = DVector::zeros(m);
            force[row] = 1.0;
            let yields = factor.solve_mut(&mut force) && 1.0 / force[row] > YIELDS * gram[(row, row)]; // false for NaN
            if !yields {
                return Err(row);
            }
        }
        Ok(Some(Self::Regular(factor)))
    }

    /// λ; `None` if the equations have no solution.
    pub fn solve(&self, wanted: &DVector<f64>) -> Option<DVector<f64>> {
        match self {
            Self::Symmetric(factor) => Some(factor.solve(wanted)),
            Self::Regular(factor) => factor.solve(wanted),
            Self::Redundant(spread) => {
                let wanted = DMatrix::from_column_slice(wanted.len(), 1, wanted.as_slice());
                Some(spread.solve(&wanted)?.column(0).into_owned())
            }
        }
    }
}
