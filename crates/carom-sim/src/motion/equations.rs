//! The equations K λ = b of the forces of several constraints, factored once for any number of right-hand sides.
//!
//! Symbols as in `held.rs`. Most rows are clearly independent, and this shows in the symmetric part S = ½ (K + Kᵀ): where it is positive
//! definite, with pivots above 1e-6 of the terms of their row, xᵀK x = xᵀS x > 0 for every x ≠ 0. So K is regular, and with x = K⁻¹eᵢ a unit force along row i, the others held, moves
//! this row with it: (K⁻¹)ᵢᵢ > 0, which makes sliding consistent. Otherwise R M⁻¹ Rᵀ tells which rows are independent.
//!
//! Where the motion depends on how forces are distributed (F ≠ R), contacts that would pull by the convention have no force, one after
//! another, as long as the rows of the others determine the motion.

use super::active_set::Hold;
use super::assembled::Assembled;
use super::rows::Contact;
use crate::state::{Basis, CLEAR, EQUAL, EXACT, Spread};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, LU};
use std::ops::Range;

/// Factored equations.
pub(crate) enum Equations {
    /// F = R.
    Symmetric(Cholesky<f64, Dyn>),
    Regular(LU<f64, Dyn, Dyn>),
    /// Rows depend on others.
    Redundant(Box<Redundant>),
}

/// Equations of rows that depend on others.
pub(crate) struct Redundant {
    spread: Spread,
    /// K and R M⁻¹ Rᵀ.
    matrices: [DMatrix<f64>; 2],
    /// The rows of contacts that push and do not pull, where F ≠ R.
    pushing: Vec<Range<usize>>,
}

impl Redundant {
    /// The equations without forces along these rows, and λ; `None` if the other rows do not determine the motion.
    fn without(&self, left_out: &[Range<usize>], wanted: &DMatrix<f64>) -> Option<(Spread, DMatrix<f64>)> {
        let [k, gram] = &self.matrices;
        let basis = Basis::without(gram, left_out);
        let spread = (basis.rows.len() == self.spread.rank()).then(|| basis.spread(k, left_out))??;
        let found = spread.solve(wanted)?;
        Some((spread, found))
    }

    /// λ where no contact pulls, by leaving out those that pull most, one after another; the equations are those of the others from
    /// then on. Where this leads to no solution λ is that of the convention.
    fn push(&mut self, wanted: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let convention = self.spread.solve(wanted)?;
        let (mut found, mut left_out, mut changed) = (convention.clone(), Vec::new(), None);
        loop {
            let normal = |rows: &&Range<usize>| found[(rows.end - 1, 0)];
            let pulls = self.pushing.iter().filter(|rows| normal(rows) < -EXACT * found.amax());
            let Some(worst) = pulls.min_by(|a, b| normal(a).total_cmp(&normal(b))) else { break };
            left_out.push(worst.clone());
            let Some((spread, forces)) = self.without(&left_out, wanted) else { return Some(convention) };
            (found, changed) = (forces, Some(spread));
        }
        if let Some(spread) = changed {
            self.spread = spread;
        }
        Some(found)
    }
}

impl Equations {
    /// Of the contacts that were assembled; `None` if it depends on the responses of the rows R, and they are missing.
    ///
    /// # Errors
    /// The row of a contact that jams: no force along it opens the gap.
    pub fn of(found: &Assembled) -> Result<Option<Self>, usize> {
        let (mut k, constraints) = (found.delassus(), &found.constraints);
        let (m, skew) = (k.nrows(), !constraints.skewed.is_empty());
        if m == 1 {
            // A unit force must open the gap; NaN does not.
            let opens = k[(0, 0)] > 0.0 && (!skew || k[(0, 0)] > EXACT * found.terms(0));
            match (opens, constraints.contacts.is_empty()) {
                (true, _) => return Ok(Some(Self::Regular(k.lu()))),
                (false, false) => return Err(0),
                (false, true) => {} // a joint that loops lock, held by its dry friction
            }
        }
        // Rows that nothing moves, as those across the plane of a planar robot, have no force: ∞ λ = b.
        let least = Basis::least(&k);
        for i in 0..m {
            if constraints.skewed.contains(&i) || k[(i, i)] > EQUAL * least {
                continue;
            }
            k.row_mut(i).fill(0.0);
            k.column_mut(i).fill(0.0);
            k[(i, i)] = f64::INFINITY;
        }
        let symmetric = if skew { (&k + k.transpose()) * 0.5 } else { k.clone() };
        if let Some(factor) = symmetric.cholesky() {
            let l = factor.l_dirty();
            if (0..m).all(|i| l[(i, i)] * l[(i, i)] > CLEAR * found.terms(i).max(least)) {
                return Ok(Some(if skew { Self::Regular(k.lu()) } else { Self::Symmetric(factor) }));
            }
        }
        if skew && found.own_responses.is_empty() {
            return Ok(None);
        }
        let gram = found.gram();
        let basis = Basis::of(&gram);
        if basis.rows.len() < m {
            let spread = basis.spread(&k, &[]).ok_or(0_usize)?;
            let unilateral = |contact: &Contact| {
                (skew && contact.own.hold != Hold::Latched && !contact.rows.is_empty()).then(|| contact.rows.clone())
            };
            let pushing = constraints.contacts.iter().filter_map(unilateral).collect();
            return Ok(Some(Self::Redundant(Box::new(Redundant { spread, matrices: [k, gram], pushing }))));
        }
        let factor = k.lu();
        for contact in &constraints.contacts {
            let slides = matches!(contact.own.hold, Hold::Slides { .. } | Hold::Starts { .. }) && skew;
            if !slides || contact.rows.is_empty() {
                continue; // without rows: the joint is locked
            }
            let row = contact.rows.start;
            let mut force = DVector::zeros(m);
            force[row] = 1.0;
            let yields = factor.solve_mut(&mut force) && 1.0 / force[row] > EXACT * gram[(row, row)]; // false for NaN
            if !yields {
                return Err(row);
            }
        }
        Ok(Some(Self::Regular(factor)))
    }

    /// λ of the motion: as [`Self::solve`], but of redundant contacts with F ≠ R, whose motion depends on the distribution, none pulls if
    /// this is possible. Further solutions are of the same contacts.
    pub fn forces(&mut self, wanted: &DVector<f64>) -> Option<DVector<f64>> {
        let Self::Redundant(redundant) = self else { return self.solve(wanted) };
        Some(redundant.push(&column(wanted))?.column(0).into_owned())
    }

    /// λ; `None` if the equations have no solution.
    pub fn solve(&self, wanted: &DVector<f64>) -> Option<DVector<f64>> {
        match self {
            Self::Symmetric(factor) => Some(factor.solve(wanted)),
            Self::Regular(factor) => factor.solve(wanted),
            Self::Redundant(redundant) => Some(redundant.spread.solve(&column(wanted))?.column(0).into_owned()),
        }
    }
}

fn column(numbers: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(numbers.len(), 1, numbers.as_slice())
}
