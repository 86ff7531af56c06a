//! Whether redundant forces determine the motion.
//!
//! | Symbol | Size | Meaning | Our name |
//! |---|---|---|---|
//! | R, F | m × nv | rows that the constraints hold; directions along which their forces act | – |
//! | K | m × m | R M⁻¹ Fᵀ | `delassus` |
//! | G | m × m | F M⁻¹ Fᵀ | `gram` |
//! | ν | m | a change of the forces that changes no constraint's acceleration: K ν = 0 | – |
//!
//! With the forces λ, λ + ν satisfies the constraints as well. The motion is the same if Fᵀν = 0, that is νᵀGν = 0. For F = R this
//! holds for every ν: the forces of a box on four corners are not determined, its motion is. A contact that slides has
//! F = n − μ d. Of a box that slides without turning the rows F have the rank of R, and its motion is determined. Where its contacts
//! slide in different directions, or with different coefficients of friction, F has a larger rank.

use nalgebra::{DMatrix, DVector};

use super::response::thin_factor;
use super::{Constraint, SeveralProblem};
use crate::rounding::SOLVED;

/// Changes of forces whose effect on the motion is below this share of that of the largest single force count as without effect:
/// directions of slip have an error of 1e-6.
const EFFECT: f64 = 1e-5;
/// Slip below this share of the velocities has no direction.
const SLIPS: f64 = 1e-6;

/// For each of the forces of contacts that last, whether it takes part in a change of forces that keeps all constraints and changes
/// the motion. If it is `false` for all, the motion is unique although forces may not be.
///
/// `delassus` is K = R M⁻¹ Fᵀ, with the rows R that the constraints hold and the directions F of their forces, n − μ d for a contact
/// that slides; `gram` is F M⁻¹ Fᵀ. All forces are taken as changeable in both directions: contacts without load and joints whose
/// dry friction is exhausted are left out.
///
/// ```
/// use carom_impact::undetermined;
/// use nalgebra::dmatrix;
///
/// // A block of 1 kg between two walls, sliding down: R = ±x, F = ±x + μ y. A squeeze brakes it.
/// let mu = 0.5;
/// let k = dmatrix![1.0, -1.0; -1.0, 1.0];
/// let gram = dmatrix![1.0 + mu * mu, -1.0 + mu * mu; -1.0 + mu * mu, 1.0 + mu * mu];
/// assert_eq!(undetermined(&k, &gram), [true, true]);
/// // Without friction it does not.
/// assert_eq!(undetermined(&k, &k), [false, false]);
/// ```
pub fn undetermined(delassus: &DMatrix<f64>, gram: &DMatrix<f64>) -> Vec<bool> {
    let m = gram.nrows();
    let mut found = vec![false; m];
    let size = |j: usize| if gram[(j, j)] > 0.0 { gram[(j, j)].sqrt().recip() } else { 0.0 };
    let sizes = DVector::from_fn(m, |j, _| size(j));
    let mut scaled = DMatrix::from_fn(m, m, |i, j| delassus[(i, j)] * sizes[j]);
    for mut row in scaled.row_iter_mut() {
        let most = row.amax();
        if most > 0.0 {
            row /= most;
        }
    }
    let gram = DMatrix::from_fn(m, m, |i, j| gram[(i, j)] * sizes[i] * sizes[j]);
    // Changes that K does not see are across its rows: the last columns of Q in Kᵀ P = Q R, with column pivoting. nalgebra's SVD is wrong for
    // some matrices of dependent rows: see `least_norm`.
    let factors = scaled.transpose().col_piv_qr();
    let upper = factors.r();
    let rank = (0..m).take_while(|&k| upper[(k, k)].abs() > SOLVED * upper[(0, 0)].abs()).count();
    if rank == m {
        return found;
    }
    let unseen = factors.q().columns(rank, m - rank).into_owned();
    // Of these, those with an effect on the motion, and across them those without: of forces that have no part in the former, none is named.
    let effects = unseen.tr_mul(&(gram * &unseen)).symmetric_eigen();
    for (effect, along) in effects.eigenvalues.iter().zip(effects.eigenvectors.column_iter()) {
        if *effect > EFFECT * EFFECT {
            let change = &unseen * along;
            found.iter_mut().zip(&change).for_each(|(found, x)| *found |= x.abs() > EFFECT);
        }
    }
    found
}

impl SeveralProblem {
    /// Whether other impulses satisfy the law as well, in the modes of these, and give other velocities.
    pub(super) fn has_others(&self, impulse: &DVector<f64>, u_plus: &DVector<f64>) -> bool {
        let loads = SOLVED * impulse.amax();
        let slips = SLIPS * self.u_minus.amax().max(self.u_free.amax());
        // The rows that are held; the columns of the directions of impulses.
        let slip = |row: usize| u_plus[row].hypot(u_plus[row + 1]);
        let slides = |row: usize, friction: f64| impulse[row + 2] > loads && friction > 0.0 && slip(row) > slips;
        let any = |(row, constraint): (usize, &Constraint)| match *constraint {
            Constraint::Contact { friction, .. } => slides(row, friction),
            _ => false,
        };
        if !self.rows().any(any) {
            return false;
        }
        let n = impulse.len();
        let (mut held, mut along) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for (row, constraint) in self.rows() {
            let unit = |k: usize| [(k, 1.0), (k, 0.0), (k, 0.0)];
            match *constraint {
                Constraint::Contact { friction, .. } if impulse[row + 2] > loads => {
                    held.push(row + 2);
                    if slides(row, friction) {
                        let [x, y] = [row, row + 1].map(|k| (k, -friction * u_plus[k] / slip(row)));
                        along.push([(row + 2, 1.0), x, y]);
                    } else {
                        along.push(unit(row + 2));
                        if friction > 0.0 {
                            held.extend([row, row + 1]);
                            along.extend([unit(row), unit(row + 1)]);
                        }
                    }
                }
                Constraint::Stop { .. } if impulse[row] > loads => {
                    held.push(row);
                    along.push(unit(row));
                }
                Constraint::Held => {
                    held.push(row);
                    along.push(unit(row));
                }
                Constraint::Dry { bound } if impulse[row].abs() < bound => {
                    held.push(row);
                    along.push(unit(row));
                }
                _ => {}
            }
        }
        let m = held.len();
        if m < 2 {
            return false;
        }
        let h = &self.delassus;
        let own = DMatrix::from_fn(m, m, |i, j| h[(held[i], held[j])]);
        if thin_factor(&own, m - 1).is_none() {
            return false; // independent rows
        }
        let k = DMatrix::from_fn(m, m, |i, j| along[j].iter().map(|(row, share)| h[(held[i], *row)] * share).sum());
        let gram = DMatrix::from_fn(m, m, |i, j| {
            let of = |row: usize| along[j].iter().map(|(column, share)| h[(row, *column)] * share).sum::<f64>();
            along[i].iter().map(|(row, share)| of(*row) * share).sum()
        });
        undetermined(&k, &gram).contains(&true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks that slide down between two walls, whose motion depends on how they are squeezed, beside tables on as many legs as their
    /// motion does not need, in any order of the forces: those of the blocks are named, those of the tables are not.
    #[test]
    fn forces_that_do_not_change_the_motion_are_not_named_beside_others() {
        let rng = &mut fastrand::Rng::with_seed(1);
        for _ in 0..2000 {
            let (blocks, legs) = (rng.usize(0..3), rng.usize(3..7));
            let m = 2 * blocks + legs;
            // F M⁻¹ᐟ² and R M⁻¹ᐟ²: of each block along x and y, and of the table's height and tilt.
            let mut order: Vec<usize> = (0..m).collect();
            rng.shuffle(&mut order);
            let (mut rows, mut along) = (DMatrix::zeros(m, 2 * blocks + 2), DMatrix::zeros(m, 2 * blocks + 2));
            for (k, &i) in order.iter().enumerate() {
                if k < 2 * blocks {
                    let (block, wall) = (k / 2, if k % 2 == 0 { 1.0 } else { -1.0 });
                    rows[(i, 2 * block)] = wall;
                    along[(i, 2 * block)] = wall;
                    along[(i, 2 * block + 1)] = 0.5;
                } else {
                    let place = rng.f64() - 0.5;
                    rows[(i, 2 * blocks)] = 1.0;
                    rows[(i, 2 * blocks + 1)] = place;
                    along.row_mut(i).copy_from(&rows.row(i));
                }
            }
            let found = undetermined(&(&rows * along.transpose()), &(&along * along.transpose()));
            let expected: Vec<bool> = (0..m).map(|i| order[..2 * blocks].contains(&i)).collect();
            assert_eq!(found, expected);
        }
    }
}
