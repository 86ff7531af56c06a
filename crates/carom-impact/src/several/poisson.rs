//! Poisson's law for several contacts: compression, then expansion that returns a share of each normal impulse.

use nalgebra::{DMatrix, DVector};

use super::natural_map::admissible;
use super::restart::solve_patiently;
use super::solve::Found;
use super::{Accuracy, Constraint, SeveralOutcome, SeveralProblem};
use crate::Flags;

/// Outcome of [`SeveralProblem::poisson`].
#[derive(Debug, Clone, PartialEq)]
pub struct PoissonOutcome {
    /// Both phases together: the sum of their impulses and iterations, the larger of their residuals.
    pub total: SeveralOutcome,
    /// Impulses of compression, λ_c (N s).
    pub compression: DVector<f64>,
    /// Impulses of expansion, λ_e (N s).
    pub expansion: DVector<f64>,
    /// Velocities between the phases, `u⁻ + H λ_c` (m/s).
    pub u_compressed: DVector<f64>,
}

impl SeveralProblem {
    /// Poisson's law for several contacts: in expansion the normal impulse of each contact is at least e times that of
    /// compression.
    ///
    /// | Symbol | Meaning | Our name |
    /// |---|---|---|
    /// | λ_c, λ_e | impulses of the two phases (N s), `p = λ_c + λ_e` | `compression`, `expansion` |
    /// | u_c | velocities between them (m/s) | `u_compressed` |
    /// | σ | largest e of all constraints | `largest` |
    ///
    /// ```text
    /// compression  u_c = u⁻ + H λ_c
    ///   contact    0 ≤ λ_cn ⟂ u_cn ≥ 0;  |λ_ct| ≤ μ λ_cn, against u_ct
    ///   dry        |λ_c| ≤ bound/(1 + σ), against u_c
    /// expansion    u⁺ = u_free + H (λ_c + λ_e)
    ///   contact    0 ≤ λ_en - e λ_cn ⟂ u_n⁺ ≥ 0;  |λ_et| ≤ μ λ_en, against u_t⁺
    ///   dry        |λ_e| ≤ bound - |λ_c|, against u⁺
    /// both         held: u_c = 0 and u⁺ = 0;  a stop is a contact with μ = 0
    /// ```
    ///
    /// "Against" means Coulomb's law: at rest any impulse within the bound, in motion the whole bound opposed to the
    /// velocity. The friction of expansion is bounded by the normal impulse of expansion alone, including its excess
    /// over `e λ_cn`; friction has no restitution of its own. The normal impulse exceeds `e λ_cn` only where the
    /// contact would otherwise approach. Dry friction acts in both phases: they share its bound as 1 to σ, and
    /// expansion may use what compression left. Forces (`u_free - u_minus`) act in the second phase, so that a contact
    /// at rest under its weight does not rebound.
    ///
    /// **Parameters.** e and μ of each constraint, e as the ratio of normal impulses of the two phases.
    ///
    /// **Guarantee.** Every total impulse is in its cone or within its bound; with e = 0 the velocities are those of
    /// [`simultaneous`](Self::simultaneous). In an impact without forces (`u_free = u_minus`) energy is never gained,
    /// beyond the residual, if (a) no contact has friction, for any e, or (b) all contacts with friction have the same
    /// e, and no other constraint a larger one. Proof: λ_e minimises `J(λ) = ½ λᵀH λ + u_cᵀλ`, the work of expansion,
    /// over the impulses with `λ_n ≥ e λ_cn`, `|λ_t| ≤ μ λ_en` and the bounds of dry friction. `σ λ_c` is among them,
    /// and since `u_cᵀλ_c ≤ 0`,
    ///
    /// ```text
    /// J(λ_e) ≤ J(σ λ_c) = ½ σ² λ_cᵀH λ_c + σ u_cᵀλ_c ≤ ½ λ_cᵀH λ_c - u_cᵀλ_c = -(work of compression)
    /// ```
    ///
    /// **Fails** to be passive otherwise: beside a contact with friction and a smaller e, an elastic
    /// contact may gain several times the initial energy, though rarely
    /// ([`Flags::ENERGY_GAIN`](crate::Flags::ENERGY_GAIN)). Still more rarely the iteration misses a solution;
    /// `residual` is then above the tolerance. If contacts are redundant, λ_c is one of many solutions, and with
    /// different e `u_plus` may depend on which. The outer balls of Newton's cradle separate as under Moreau's law: an
    /// impact in two phases does not reproduce the wave through the balls.
    ///
    /// **Source.** C. Glocker, F. Pfeiffer, *Multiple impacts with friction in rigid multibody systems*, Nonlinear
    /// Dynamics 7 (1995) 471, without its tangential restitution and with the circular cone. The rules for dry friction
    /// and for forces, and the proof, are ours; compare C. Glocker, *Energetic consistency conditions for standard
    /// impacts, Part II* (2013), doi 10.1007/s11044-013-9387-2, where a related law gains energy with two contacts with
    /// friction.
    ///
    /// ```
    /// use carom_impact::{Accuracy, Constraint, SeveralProblem};
    /// use nalgebra::{dmatrix, dvector};
    ///
    /// // A rod falls flat on an end with e = 1 and one with e = 0; the latter does not approach after the impact.
    /// let ends = vec![Constraint::Stop { restitution: 1.0 }, Constraint::Stop { restitution: 0.0 }];
    /// let rod = SeveralProblem::new(dmatrix![4.0, -2.0; -2.0, 4.0], dvector![-1.0, -1.0], ends)?;
    /// let hit = rod.poisson(&Accuracy::default());
    /// assert!((&hit.compression - dvector![0.5, 0.5]).amax() < 1e-12);
    /// assert!((&hit.expansion - dvector![0.5, 0.25]).amax() < 1e-12); // 0.25, not 0: it would approach
    /// assert!((&hit.total.u_plus - dvector![1.5, 0.0]).amax() < 1e-12);
    /// assert!(hit.total.energy_change < 0.0);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    pub fn poisson(&self, accuracy: &Accuracy) -> PoissonOutcome {
        let largest = self.constraints.iter().map(Constraint::restitution).fold(0.0, f64::max);
        let first = Self { u_free: self.u_minus.clone(), ..self.inelastic(1.0 / (1.0 + largest)) };
        let Found { impulse: compression, residual, iterations } = solve_patiently(&first, accuracy, None);
        let expanded = self.expand(&compression, accuracy);
        // The sum of two impulses in a cone is in the cone, but for rounding.
        let mut sum = &compression + &expanded.impulse;
        admissible(self.rows(), &mut sum);
        let u_compressed = &self.u_minus + &self.delassus * &compression;
        let mut total = self.outcome(Found {
            residual: residual.max(expanded.residual),
            iterations: iterations + expanded.iterations,
            impulse: sum,
        });
        let others = first.has_others(&compression, &u_compressed) || self.has_others(&total.impulse, &total.u_plus);
        total.flags |= Flags::NON_UNIQUE.when(others);
        PoissonOutcome { expansion: &total.impulse - &compression, u_compressed, compression, total }
    }

    /// Expansion as an inelastic problem for the excess over `f = e λ_cn`. The friction that f allows, a disc of fixed
    /// radius μ f, is that of a second contact on the same tangents. Its normal is a separate mass, driven at the speed
    /// that the impulse f stops.
    fn expand(&self, compression: &DVector<f64>, accuracy: &Accuracy) -> Found {
        let n = self.u_minus.len();
        let mut problem = self.inelastic(1.0);
        let mut floor = DVector::zeros(n);
        let mut discs = Vec::new();
        for ((row, constraint), rigid) in self.rows().zip(&mut problem.constraints) {
            let normal = row + constraint.rows() - 1;
            floor[normal] = constraint.restitution() * compression[normal];
            match rigid {
                Constraint::Contact { friction, .. } if *friction > 0.0 && floor[normal] > 0.0 => {
                    discs.push((row, *friction, constraint.restitution()));
                }
                // Not negative but for rounding: compression used at most its share.
                Constraint::Dry { bound } => *bound = (*bound - compression[row].abs()).max(0.0),
                _ => {}
            }
        }
        problem.u_free += &self.delassus * (compression + &floor);
        let speed = self.u_minus.amax().max(self.u_free.amax());

        let source = |i: usize| if i < n { i } else { discs[(i - n) / 3].0 + (i - n) % 3 };
        let virtual_normal = |i: usize| i >= n && (i - n) % 3 == 2;
        let rows = n + 3 * discs.len();
        let mut delassus = DMatrix::from_fn(rows, rows, |i, j| {
            if virtual_normal(i) || virtual_normal(j) { 0.0 } else { self.delassus[(source(i), source(j))] }
        });
        let mut u_free = DVector::from_fn(rows, |i, _| problem.u_free[source(i)]);
        let mut start = DVector::zeros(rows);
        for (k, &(row, friction, e)) in discs.iter().enumerate() {
            let (own, f) = (n + 3 * k, floor[row + 2]);
            // The contact's own scale, unless the speed would then be the largest and change the scale of the residual.
            let inverse_mass = (self.delassus.view((row, row), (3, 3)).trace() / 3.0).min(speed / f);
            delassus[(own + 2, own + 2)] = inverse_mass;
            u_free[own + 2] = -inverse_mass * f;
            start.rows_mut(own, 2).copy_from(&(compression.rows(row, 2) * e));
            start[own + 2] = f;
            problem.constraints.push(Constraint::Contact { restitution: 0.0, friction });
        }
        let u_minus = self.u_minus.clone().resize_vertically(rows, 0.0);
        let problem = Self { delassus, u_minus, u_free, constraints: problem.constraints, gram: self.gram };
        let found = solve_patiently(&problem, accuracy, Some(&start));
        let mut impulse = floor + found.impulse.rows(0, n);
        for (k, &(row, ..)) in discs.iter().enumerate() {
            let mut tangents = impulse.rows_mut(row, 2);
            tangents += found.impulse.rows(n + 3 * k, 2);
        }
        Found { impulse, ..found }
    }
}
