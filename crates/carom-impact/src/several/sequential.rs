//! Sequences of single impacts: one constraint after another, each by the law for one contact.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector, SymmetricEigen, Vector3};

use super::block::{Block, nothing};
use super::{Accuracy, Constraint, SeveralOutcome, SeveralProblem};
use crate::rounding::{RANK, SOLVED};
use crate::{Flags, ImpactError};

/// The rule that selects the next constraint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Order {
    /// The constraints take turns in the listed order, repeatedly; one that is already satisfied is skipped. The list
    /// contains indices of constraints, each one that is not `Held` at least once (repetitions are allowed); `Held`
    /// ones may be left out.
    Cycle(Vec<usize>),
    /// The constraint with the largest approach velocity, in the unit of its row; the first of those that are equal up to rounding,
    /// with [`Flags::NON_UNIQUE`] if one of these changes the velocity of another.
    MostApproaching,
}

impl SeveralProblem {
    /// Resolves one constraint at a time, as a sub-impact, until no contact approaches.
    ///
    /// | Symbol | Meaning |
    /// |---|---|
    /// | p | accumulated impulses (N s) |
    /// | u, w | current velocities (m/s): `u_free + H p`, `u⁻ + H p`; equal in an impact without forces |
    /// | Δp | impulse of the sub-impact at one constraint (N s), which changes u to u' |
    ///
    /// ```text
    /// turn if   u_n < -tolerance · max(|u⁻|, |u_free|)
    /// stop      u' = -e min(w, 0)
    /// contact   u_n' = -e min(w_n, 0);  |Δp_t| ≤ μ Δp_n, against u_t'
    /// dry       the p within ± bound for which |u'| is smallest
    /// held      u = 0 throughout: its impulse is part of each sub-impact of the others
    /// ```
    ///
    /// **Parameters.** e and μ of each constraint, e as the ratio of velocities in each of its sub-impacts; the order;
    /// `accuracy.tolerance`, and in `accuracy.max_iterations` the largest number of sub-impacts.
    ///
    /// **Guarantee.** Total impulses are in their cones or within their bounds, up to rounding. Without friction no
    /// sub-impact gains energy in an impact without forces, for any e and order; with friction none does with e = 0.
    /// With e = 1 the last ball of Newton's cradle of equal balls leaves alone.
    ///
    /// **Fails** to have one outcome: it depends on the order ([`all_orders`](Self::all_orders)), and a symmetric
    /// problem may have asymmetric outcomes. The sequence may be infinite: for a rod on both ends with e = 0 each
    /// sub-impact halves the approach velocity, and obstacles on both sides of the robot with e = 1 never end. Then
    /// [`SeveralOutcome::is_solved`] is false, and `residual` is the remaining violation. With friction and e > 0 a sub-impact may gain
    /// energy, as under [`Whittaker`](crate::Whittaker) ([`Flags::ENERGY_GAIN`]).
    ///
    /// **Source.** A. P. Ivanov, *On multiple impact*, J. Appl. Math. Mech. 59 (1995) 887, for sequences of single
    /// impacts; the single one is Moreau's. The rules for dry friction, locked directions and forces are ours.
    ///
    /// # Errors
    ///
    /// [`ImpactError::Order`].
    ///
    /// ```
    /// use carom_impact::{Accuracy, Constraint, Order, SeveralProblem};
    /// use nalgebra::{dmatrix, dvector};
    ///
    /// // Newton's cradle: three balls of 1 kg, the first strikes at 1 m/s, the others touch at rest.
    /// let between = Constraint::Stop { restitution: 1.0 };
    /// let cradle = SeveralProblem::new(dmatrix![2.0, -1.0; -1.0, 2.0], dvector![-1.0, 0.0], vec![between; 2])?;
    /// let hit = cradle.sequential(&Order::MostApproaching, &Accuracy::default())?;
    /// assert_eq!(hit.impulse, dvector![1.0, 1.0]); // the first ball stops, the last one leaves
    /// assert_eq!((hit.iterations, hit.residual), (2, 0.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn sequential(&self, order: &Order, accuracy: &Accuracy) -> Result<SeveralOutcome, ImpactError> {
        if let Order::Cycle(list) = order {
            let count = self.constraints.len();
            if let Some(&index) = list.iter().find(|&&index| index >= count) {
                let problem = format!("contains constraint {index}, but there are {count}, counted from 0");
                return Err(ImpactError::Order(problem));
            }
            let listed: BTreeSet<_> = list.iter().copied().collect();
            let left_out = |&k: &usize| self.constraints[k] != Constraint::Held && !listed.contains(&k);
            if let Some(index) = (0..count).find(left_out) {
                let problem = format!("does not contain constraint {index}: list every constraint that is not held");
                return Err(ImpactError::Order(problem));
            }
        }
        Ok(self.sequence(&Reduced::new(self), order, accuracy))
    }

    /// Requires a valid `order`.
    pub(super) fn sequence(&self, reduced: &Reduced, order: &Order, accuracy: &Accuracy) -> SeveralOutcome {
        let speed = self.u_minus.amax().max(self.u_free.amax());
        let enough = accuracy.tolerance * speed;
        let mut state = State { reduced, impulse: DVector::zeros(self.u_minus.len()), u: reduced.u_free.clone() };
        let (mut sub_impacts, mut idle, mut turn, mut open) = (0, 0, 0, false);
        let mut left = Vec::with_capacity(reduced.blocks.len());
        while sub_impacts < accuracy.max_iterations {
            let next = match order {
                Order::Cycle(list) if idle < list.len() => {
                    turn += 1;
                    Some(list[(turn - 1) % list.len()])
                }
                Order::Cycle(_) => None,
                Order::MostApproaching => {
                    left.clear();
                    left.extend((0..reduced.blocks.len()).map(|k| if reduced.mobile[k] { state.left(k) } else { 0.0 }));
                    let most = left.iter().fold(0.0_f64, |most, left| most.max(*left));
                    let mut equal = (0..left.len()).filter(|&k| most > enough && left[k] >= (1.0 - SOLVED) * most);
                    let first = equal.next();
                    open |= first.is_some_and(|first| equal.any(|k| reduced.are_coupled(first, k)));
                    first
                }
            };
            let Some(k) = next else { break };
            if state.left(k) > enough && reduced.mobile[k] {
                state.strike(k);
                (sub_impacts, idle) = (sub_impacts + 1, 0);
            } else {
                idle += 1;
            }
        }
        let left = (0..reduced.blocks.len()).fold(0.0_f64, |worst, k| worst.max(state.left(k)));
        let impulse = reduced.with_held(state.impulse);
        let u_plus = &self.u_free + &self.delassus * &impulse;
        let held = self.rows().filter(|(_, constraint)| **constraint == Constraint::Held);
        let worst = held.fold(left, |worst, (row, _)| worst.max(u_plus[row].abs()));
        let residual = if worst == 0.0 { 0.0 } else { worst / speed };
        let (energy_change, mut flags) = self.energy(&impulse, &u_plus, residual);
        if open {
            flags |= Flags::NON_UNIQUE;
        }
        SeveralOutcome { impulse, u_plus, iterations: sub_impacts, residual, energy_change, flags }
    }
}

/// The problem with the `Held` constraints eliminated: their rows remain, and are zero.
pub(super) struct Reduced {
    pub delassus: DMatrix<f64>,
    pub u_free: DVector<f64>,
    /// Difference `u⁻ - u_free` (m/s), with the `Held` constraints eliminated.
    before: DVector<f64>,
    blocks: Vec<Block>,
    /// Whether the constraint has a non-zero inverse mass.
    mobile: Vec<bool>,
    /// Rows of the `Held` constraints, `-H_hh⁺ H_hr` and `-H_hh⁺ u_h`.
    held: Vec<usize>,
    response: DMatrix<f64>,
    at_once: DVector<f64>,
}

impl Reduced {
    /// Whether an impulse at one constraint changes the velocity of the other.
    fn are_coupled(&self, one: usize, other: usize) -> bool {
        let (one, other) = (&self.blocks[one], &self.blocks[other]);
        let sizes = (one.constraint.rows(), other.constraint.rows());
        self.delassus.view((one.row, other.row), sizes).amax() > RANK * (one.scale * other.scale).sqrt()
    }

    pub fn new(problem: &SeveralProblem) -> Self {
        let h = &problem.delassus;
        let held: Vec<usize> = problem.rows().filter(|(_, c)| **c == Constraint::Held).map(|(row, _)| row).collect();
        let rows = h.select_rows(&held);
        let inverse = pseudo_inverse(rows.select_columns(&held));
        let at_once = -&inverse * problem.u_free.select_rows(&held);
        let response = -inverse * &rows;
        let mut delassus = h + rows.tr_mul(&response);
        let mut u_free = &problem.u_free + rows.tr_mul(&at_once);
        let difference = &problem.u_minus - &problem.u_free;
        let mut before = &difference + response.tr_mul(&difference.select_rows(&held));
        for i in 0..h.nrows() {
            let is_held = held.binary_search(&i).is_ok();
            // With the `Held` constraints eliminated the inverse mass of this row is rounding.
            if is_held || delassus[(i, i)] <= RANK * h[(i, i)] {
                delassus.row_mut(i).fill(0.0);
                delassus.column_mut(i).fill(0.0);
            }
            if is_held {
                (u_free[i], before[i]) = (0.0, 0.0);
            }
        }
        let nothing = nothing(&delassus);
        let blocks: Vec<_> = problem.rows().map(|(row, c)| Block::new(*c, row, &delassus, nothing)).collect();
        let mobile = blocks
            .iter()
            .map(|block| match block.constraint {
                Constraint::Contact { .. } | Constraint::Stop { .. } => block.solve_one(-1.0) > 0.0,
                Constraint::Dry { .. } => delassus[(block.row, block.row)] > 0.0,
                Constraint::Held => false,
            })
            .collect();
        Self { delassus, u_free, before, blocks, mobile, held, response, at_once }
    }

    /// The impulses, with those of the `Held` constraints added.
    pub fn with_held(&self, mut impulse: DVector<f64>) -> DVector<f64> {
        let own = &self.at_once + &self.response * &impulse;
        for (&row, value) in self.held.iter().zip(own.iter()) {
            impulse[row] = *value;
        }
        impulse
    }
}

/// Pseudo-inverse of a positive semidefinite matrix; zero if the eigenvalues do not converge, near overflow.
fn pseudo_inverse(h: DMatrix<f64>) -> DMatrix<f64> {
    let n = h.nrows();
    if n == 0 {
        return h;
    }
    let Some(eigen) = SymmetricEigen::try_new(h, f64::EPSILON, 100 * n) else { return DMatrix::zeros(n, n) };
    let floor = eigen.eigenvalues.amax() * RANK;
    let inverse = eigen.eigenvalues.map(|value| if value > floor { 1.0 / value } else { 0.0 });
    &eigen.eigenvectors * DMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

struct State<'a> {
    reduced: &'a Reduced,
    /// Accumulated impulses; zero for `Held` constraints.
    impulse: DVector<f64>,
    /// `u_free + H p`, with the `Held` constraints eliminated.
    u: DVector<f64>,
}

impl State<'_> {
    /// Velocity of constraint k that its turn would change (m/s).
    fn left(&self, k: usize) -> f64 {
        let block = &self.reduced.blocks[k];
        let last = block.row + block.constraint.rows() - 1;
        match block.constraint {
            Constraint::Contact { .. } | Constraint::Stop { .. } => -self.u[last].min(0.0),
            Constraint::Dry { .. } => (self.dry(k) - self.impulse[last]).abs() * self.reduced.delassus[(last, last)],
            Constraint::Held => 0.0,
        }
    }

    /// The total impulse of dry friction k after its turn.
    fn dry(&self, k: usize) -> f64 {
        let block = &self.reduced.blocks[k];
        let own = self.reduced.delassus[(block.row, block.row)];
        block.solve_one(self.u[block.row] - own * self.impulse[block.row])
    }

    /// The sub-impact at constraint k.
    fn strike(&mut self, k: usize) {
        let block = &self.reduced.blocks[k];
        let i = block.row;
        let last = i + block.constraint.rows() - 1;
        let rebound = block.constraint.restitution() * (self.u[last] + self.reduced.before[last]).min(0.0);
        match block.constraint {
            Constraint::Contact { friction, .. } => {
                let c = Vector3::new(self.u[i], self.u[i + 1], self.u[last] + rebound);
                let terms = |row: usize| {
                    let column = self.reduced.delassus.column(row);
                    column.iter().zip(&self.impulse).fold(self.u[row].abs(), |sum, (h, p)| sum + (h * p).abs())
                };
                let size = || terms(i).max(terms(i + 1)).max(terms(last));
                let more = block.solve_contact(friction, c, size);
                let mut own = self.impulse.fixed_rows_mut::<3>(i);
                own += more;
            }
            Constraint::Dry { .. } => self.impulse[i] = self.dry(k),
            Constraint::Stop { .. } => self.impulse[i] += block.solve_one(self.u[i] + rebound),
            Constraint::Held => {}
        }
        self.u = &self.reduced.u_free + &self.reduced.delassus * &self.impulse;
    }
}
