//! The model of one step of the search: a quadratic program.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | u, d | unknowns as shares of their sizes, and the step |
//! | c, J | conditions a ≤ c ≤ b, and their derivatives |
//! | r, R | functions whose squares are costs, and their derivatives |
//! | g, B | derivatives of the other costs, and an approximation of the second derivatives of the Lagrangian: `curvature.rs` |
//! | t | what the linearised conditions miss |
//! | Δ | trust radius |
//! | ν | weight of the conditions in the merit function φ = f + ν Σ miss |
//!
//! The step minimises
//!
//! ```text
//! ½ dᵀBd + gᵀd + Σ w (r + R d)² + ν Σ t   with   a − t ≤ c + J d ≤ b + t,  t ≥ 0,  |dᵢ| ≤ Δ,  bounds of u
//! ```

use super::evaluate::{Slopes, Values};
use super::problem::Problem;
use super::torque::Torque;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, ZeroConeT};
use nalgebra::{DMatrix, DVector};

/// Second derivative along directions in which nothing else bends, as a share of ν without a cost, and of the cost's derivatives: of steps
/// that are equally good the shorter is taken.
const SHORTER: f64 = 1e-8;
/// The distance from a bound, as a share of the size of an unknown, at which the answer of the solver is at the bound.
const INSIDE: f64 = 1e-9;

/// A place of the search.
pub(super) struct Place {
    pub u: Vec<f64>,
    pub values: Values,
    pub slopes: Slopes,
}

/// The quadratic program's answer.
pub(super) struct Solved {
    pub d: DVector<f64>,
    /// The multipliers of the conditions.
    pub multipliers: DVector<f64>,
    /// The linearised misses.
    pub missed: f64,
    /// The decrease of the merit that the model promises.
    pub promised: f64,
}

impl Problem {
    pub(super) fn has_cost(&self) -> bool {
        !self.costs.is_empty() || self.effort > 0.0
    }

    /// The torques over time, if their effort is a cost.
    pub(super) fn costly_torque(&self) -> Option<&Torque> {
        self.given.torque.as_ref().filter(|_| self.effort > 0.0)
    }

    /// f.
    pub(super) fn cost(&self, values: &Values) -> f64 {
        let own = self.costs.iter().zip(&values.costs);
        let sum: f64 = own.map(|(cost, x)| cost.weight * if cost.squared { x * x } else { *x }).sum();
        sum + self.effort * values.effort
    }

    /// ∂f.
    pub(super) fn cost_slope(&self, place: &Place) -> DVector<f64> {
        let mut slope = self.bent_slope(place) + &place.slopes.effort * self.effort;
        for (k, cost) in self.costs.iter().enumerate().filter(|(_, cost)| cost.squared) {
            slope += place.slopes.costs.row(k).transpose() * (2.0 * cost.weight * place.values.costs[k]);
        }
        slope
    }

    /// Of the costs that are no squares.
    pub(super) fn bent_slope(&self, place: &Place) -> DVector<f64> {
        let mut slope = DVector::zeros(place.u.len());
        for (k, cost) in self.costs.iter().enumerate().filter(|(_, cost)| !cost.squared) {
            slope += place.slopes.costs.row(k).transpose() * cost.weight;
        }
        slope
    }

    pub(super) fn misses(&self, values: &Values) -> Vec<f64> {
        self.conditions.iter().zip(&values.conditions).map(|(own, x)| own.miss(*x)).collect()
    }

    pub(super) fn miss(&self, values: &Values) -> f64 {
        self.misses(values).into_iter().fold(0.0, f64::max)
    }

    /// The step of the model, whose conditions have these values at the place; `None` if the solver finds none, where sizes differ by too much.
    pub(super) fn model(
        &self,
        (here, conditions): (&Place, &[f64]),
        (sizes, bounds): (&[f64], &[[f64; 2]]),
        hessian: Option<&DMatrix<f64>>,
        (weight, radius): (f64, f64),
    ) -> Option<Solved> {
        let n = sizes.len();
        let Place { u, values, slopes } = here;
        let squares: Vec<usize> = (0..self.costs.len()).filter(|k| self.costs[*k].squared).collect();
        let (first_r, first_t) = (n, n + squares.len());
        let count = first_t + 2 * self.conditions.len();
        let (mut p, mut q) = (Vec::new(), vec![0.0; count]);
        let of = if self.has_cost() { self.cost_slope(here).amax().max(f64::MIN_POSITIVE) } else { weight };
        let shorter = SHORTER * of;
        p.extend((0..n).map(|i| (i, i, shorter)));
        if let Some(hessian) = hessian {
            p.extend((0..n).flat_map(|j| (0..=j).map(move |i| (i, j, hessian[(i, j)]))));
        }
        if let Some(torque) = self.costly_torque() {
            let first = self.given.unknowns.len();
            for (i, j, x) in torque.effort_twice(values.duration) {
                p.push((first + i, first + j, self.effort * x * sizes[first + i] * sizes[first + j]));
            }
        }
        let linear = self.bent_slope(here) + &slopes.effort * self.effort;
        q[..n].copy_from_slice(linear.as_slice());
        let (mut equal, mut below): (Vec<Row>, Vec<Row>) = Default::default();
        for (i, k) in squares.iter().enumerate() {
            let (w, r) = (self.costs[*k].weight, values.costs[*k]);
            p.push((first_r + i, first_r + i, 2.0 * w));
            q[first_r + i] = 2.0 * w * r;
            let row = (0..n).map(|j| (j, slopes.costs[(*k, j)])).chain([(first_r + i, -1.0)]);
            equal.push((row.collect(), 0.0));
        }
        // Of each condition: where it is an equation its row, else those of its bounds.
        let mut rows_of = Vec::new();
        for (k, condition) in self.conditions.iter().enumerate() {
            let [a, b] = condition.bounds.map(|bound| bound - conditions[k]);
            let t = first_t + 2 * k;
            let row = |sign: f64| (0..n).map(move |j| (j, sign * slopes.conditions[(k, j)]));
            q[t..t + 2].fill(weight);
            if a == b {
                rows_of.push((Some(equal.len()), [None; 2]));
                equal.push((row(1.0).chain([(t, 1.0), (t + 1, -1.0)]).collect(), a));
            } else {
                let mut own = [None; 2];
                if b.is_finite() {
                    own[1] = Some(below.len());
                    below.push((row(1.0).chain([(t + 1, -1.0)]).collect(), b));
                }
                if a.is_finite() {
                    own[0] = Some(below.len());
                    below.push((row(-1.0).chain([(t, -1.0)]).collect(), -a));
                }
                rows_of.push((None, own));
            }
            below.extend([t, t + 1].map(|t| (vec![(t, -1.0)], 0.0)));
        }
        for j in 0..n {
            let [from, to] = bounds[j].map(|bound| (bound - u[j]) / sizes[j]);
            below.push((vec![(j, 1.0)], to.min(radius)));
            below.push((vec![(j, -1.0)], -from.max(-radius)));
        }
        let cones = [ZeroConeT(equal.len()), NonnegativeConeT(below.len())];
        let first_below = equal.len();
        let rows = [equal, below].concat();
        let entries = rows.iter().enumerate().flat_map(|(i, (row, _))| row.iter().map(move |(j, x)| (i, *j, *x)));
        let matrix = sparse((rows.len(), count), entries);
        let right: Vec<f64> = rows.iter().map(|(_, right)| *right).collect();
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .tol_gap_abs(1e-13)
            .tol_gap_rel(1e-13)
            .tol_feas(1e-13)
            .build()
            .unwrap_or_default();
        let solver = DefaultSolver::new(&sparse((count, count), p), &q, &matrix, &right, &cones, settings);
        let mut solver = solver.ok()?;
        solver.solve();
        let solution = &solver.solution;
        // Near a solution its last digits are beyond the solver, which says so; the merit of the run decides.
        let usable = [
            SolverStatus::Solved,
            SolverStatus::AlmostSolved,
            SolverStatus::InsufficientProgress,
            SolverStatus::MaxIterations,
            SolverStatus::NumericalError,
        ];
        if !usable.contains(&solution.status) || solution.x.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let mut d = DVector::from_column_slice(&solution.x[..n]);
        for j in 0..n {
            let [from, to] = bounds[j].map(|bound| (bound - u[j]) / sizes[j]);
            d[j] = d[j].clamp(from.max(-radius), to.min(radius));
            // The solver stays inside the bounds by its tolerance.
            if let Some(bound) =
                [from, to].into_iter().find(|bound| (d[j] - bound).abs() < INSIDE && bound.abs() <= radius)
            {
                d[j] = bound;
            }
        }
        let multipliers = rows_of.iter().map(|(row, bounds)| {
            let of_bound = |side: usize| bounds[side].map_or(0.0, |row| solution.z[first_below + row]);
            row.map_or_else(|| of_bound(1) - of_bound(0), |row| solution.z[row])
        });
        let multipliers = DVector::from_iterator(self.conditions.len(), multipliers);
        let linearised = &slopes.conditions * &d;
        let missed = self.conditions.iter().zip(conditions).zip(linearised.iter());
        let missed: f64 = missed.map(|((own, c), moved)| own.miss(c + moved)).sum();
        let mut promised = weight * (self.misses(values).iter().sum::<f64>() - missed) - linear.dot(&d);
        if let Some(hessian) = hessian {
            promised -= 0.5 * d.dot(&(hessian * &d));
        }
        for k in squares {
            let moved = slopes.costs.row(k).transpose().dot(&d);
            promised -= self.costs[k].weight * moved * (2.0 * values.costs[k] + moved);
        }
        if let Some(torque) = self.costly_torque() {
            let first = self.given.unknowns.len();
            let own: Vec<f64> = (first..n).map(|j| d[j] * sizes[j]).collect();
            promised -= self.effort * torque.effort(&own, values.duration).0;
        }
        Some(Solved { d, multipliers, missed, promised })
    }
}

impl Slopes {
    /// By the unknowns as shares of their sizes.
    pub fn scaled(mut self, sizes: &[f64]) -> Self {
        for (j, size) in sizes.iter().enumerate() {
            self.conditions.column_mut(j).scale_mut(*size);
            self.costs.column_mut(j).scale_mut(*size);
            self.effort[j] *= size;
        }
        self
    }
}

/// The entries of a row of a matrix, and its right side.
type Row = (Vec<(usize, f64)>, f64);

/// The sparse matrix of these entries.
fn sparse((rows, columns): (usize, usize), entries: impl IntoIterator<Item = (usize, usize, f64)>) -> CscMatrix<f64> {
    let entries = entries.into_iter().filter(|(.., x)| *x != 0.0);
    let (i, (j, x)): (Vec<_>, (Vec<_>, Vec<_>)) = entries.map(|(i, j, x)| (i, (j, x))).unzip();
    CscMatrix::new_from_triplets(rows, columns, i, j, x)
}
