//! The search for the parameters of a model on tosses.
//!
//! | symbol | size | meaning |
//! | --- | --- | --- |
//! | x | p | parameters, as shares of the ranges of the search |
//! | rᵢ, Jᵢ | m, m×p | residual of toss i, and its differences with respect to x |
//! | C | 1 | Σ \|rᵢ\|², the cost |
//!
//! A law with constant coefficients starts from a grid; a model with effects starts from the optimum of the model without its
//! last effect, so that its training error is never above that one's. First the Levenberg–Marquardt method (D. W. Marquardt
//! 1963) steps by (Σ JᵢᵀJᵢ + λD) d = −Σ Jᵢᵀrᵢ with D the diagonal of the sum. A parameter at a bound stays there while
//! the cost falls beyond it. The residual of a roll-out is piecewise smooth with jumps: a toss that jumps within the step of
//! the differences has no share in d, but a step is accepted by the cost of all tosses. Where no such step lowers the cost
//! further, one parameter after another is moved; a move grows after a success, turns and shrinks after a failure
//! (R. Hooke, T. A. Jeeves 1961; H. H. Rosenbrock 1960).

use super::identify::JUMP;
use carom_study::fit::{Region, median};
use nalgebra::{DMatrix, DVector};

/// Step of the differences.
const STEP: f64 = 0.004;
/// The first damping λ, and the greatest one that is tried.
const DAMPING: (f64, f64) = (1e-2, 1e3);
/// The Levenberg–Marquardt method ends with a step that lowers the cost by less than this share.
const SETTLED: f64 = 2e-3;
/// The first move of one parameter, the move at which the search ends, and the growth after a success.
const FIRST_MOVE: f64 = 0.04;
const FINEST: f64 = 0.005;
const GROWTH: f64 = 1.5;

/// The residual of each toss at parameters; `None` where the model refuses the toss.
pub(super) type Residuals = Vec<Option<DVector<f64>>>;

/// The squared residuals; infinite where there is none.
pub(super) fn squares(residuals: &Residuals) -> Vec<f64> {
    residuals.iter().map(|r| r.as_ref().map_or(f64::INFINITY, DVector::norm_squared)).collect()
}

/// A point that was tried, with the error of each measurement.
#[derive(Debug, Clone)]
pub(super) struct Trial {
    pub x: Vec<f64>,
    pub errors: Vec<f64>,
}

/// Minimises the sum of squared residuals from the best of the points `starts`, with at most `budget` trials of further points.
pub(super) fn descend(
    region: &Region,
    starts: Vec<Vec<f64>>,
    budget: usize,
    residuals: &dyn Fn(&[f64]) -> Residuals,
) -> Option<Trial> {
    let point = |x: Vec<f64>| Point::new(residuals(&x), x);
    let best = starts.into_iter().map(point).min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    let mut search = Search { region, residuals, budget, best };
    if search.step().is_some() {
        search.move_each();
    }
    Some(Trial { errors: squares(&search.best.residuals), x: search.best.x })
}

/// A point, with the residuals and the cost.
struct Point {
    x: Vec<f64>,
    residuals: Residuals,
    cost: f64,
}

impl Point {
    fn new(residuals: Residuals, x: Vec<f64>) -> Self {
        Self { cost: squares(&residuals).iter().sum(), residuals, x }
    }
}

struct Search<'a> {
    region: &'a Region,
    residuals: &'a dyn Fn(&[f64]) -> Residuals,
    /// The trials that are left.
    budget: usize,
    best: Point,
}

impl Search<'_> {
    /// A further point; `None` without budget.
    fn trial(&mut self, x: Vec<f64>) -> Option<Point> {
        self.budget = self.budget.checked_sub(1)?;
        Some(Point::new((self.residuals)(&x), x))
    }

    /// The best point moved by shares of the ranges, inside the region.
    fn moved(&self, shares: &DVector<f64>) -> Vec<f64> {
        let sides = self.region.bounds.iter().map(|(low, high)| high - low);
        let there: Vec<f64> =
            self.best.x.iter().zip(shares.iter()).zip(sides).map(|((x, share), side)| x + share * side).collect();
        self.region.clamp(&there)
    }

    /// The Levenberg–Marquardt method to its end; `None` when the budget ends it.
    fn step(&mut self) -> Option<()> {
        let mut damping = DAMPING.0;
        loop {
            let slopes = self.slopes()?;
            let before = self.best.cost;
            while self.best.cost == before && damping < DAMPING.1 {
                let shares = self.shares(&slopes, damping);
                let next = self.moved(&shares);
                if next == self.best.x {
                    break;
                }
                let next = self.trial(next)?;
                damping *= if next.cost < before { 0.1 } else { 10.0 };
                if next.cost < before {
                    self.best = next;
                }
            }
            let settled = before.is_infinite() || self.best.cost >= before * (1.0 - SETTLED);
            if settled {
                return Some(());
            }
        }
    }

    /// Jᵢ of each toss at the best point; `None` for a toss without residual there or at one of the differences, and for one
    /// whose residual jumps. The outer `None` is the end of the budget.
    fn slopes(&mut self) -> Option<Vec<Option<DMatrix<f64>>>> {
        let p = self.best.x.len();
        let zero = |r: &Option<DVector<f64>>| r.as_ref().map(|r| DMatrix::zeros(r.len(), p));
        let mut slopes: Vec<Option<DMatrix<f64>>> = self.best.residuals.iter().map(zero).collect();
        for k in 0..p {
            let (low, high) = self.region.bounds[k];
            let side = if self.best.x[k] + STEP * (high - low) > high { -STEP } else { STEP };
            let there = self.moved(&DVector::from_fn(p, |row, _| if row == k { side } else { 0.0 }));
            let there = self.trial(there)?;
            for ((slope, r), moved) in slopes.iter_mut().zip(&self.best.residuals).zip(&there.residuals) {
                match (slope.as_mut(), r, moved) {
                    (Some(slope), Some(r), Some(moved)) => slope.set_column(k, &((moved - r) / side)),
                    _ => *slope = None,
                }
            }
        }
        let usual = JUMP * median(slopes.iter().flatten().map(|slope| slope.norm()));
        for slope in &mut slopes {
            *slope = slope.take().filter(|slope| slope.norm() <= usual);
        }
        Some(slopes)
    }

    /// The damped step. A parameter that would leave the region is fixed at its bound, and the step of the others is solved again.
    fn shares(&self, slopes: &[Option<DMatrix<f64>>], damping: f64) -> DVector<f64> {
        let p = self.best.x.len();
        let (mut gram, mut pull) = (DMatrix::zeros(p, p), DVector::zeros(p));
        for (slope, r) in slopes.iter().zip(&self.best.residuals) {
            if let (Some(slope), Some(r)) = (slope, r) {
                gram += slope.transpose() * slope;
                pull += slope.transpose() * r;
            }
        }
        let most = gram.diagonal().max();
        for k in 0..p {
            gram[(k, k)] += damping * gram[(k, k)].max(1e-6 * most).max(f64::MIN_POSITIVE);
        }
        let mut shares = DVector::zeros(p);
        let mut free: Vec<usize> = (0..p).collect();
        loop {
            let fixed: DVector<f64> =
                &gram * DVector::from_fn(p, |k, _| if free.contains(&k) { 0.0 } else { shares[k] });
            let part = DMatrix::from_fn(free.len(), free.len(), |a, b| gram[(free[a], free[b])]);
            let right = DVector::from_fn(free.len(), |a, _| -pull[free[a]] - fixed[free[a]]);
            let Some(factor) = part.cholesky() else { return shares };
            let step = factor.solve(&right);
            for (&k, share) in free.iter().zip(step.iter()) {
                shares[k] = *share;
            }
            let bound = |k: usize| {
                let ((low, high), x) = (self.region.bounds[k], self.best.x[k]);
                shares[k].clamp((low - x) / (high - low), (high - x) / (high - low))
            };
            let (inside, outside): (Vec<usize>, Vec<usize>) = free.iter().partition(|&&k| bound(k) == shares[k]);
            let bounds: Vec<f64> = outside.iter().map(|&k| bound(k)).collect();
            for (&k, bound) in outside.iter().zip(bounds) {
                shares[k] = bound;
            }
            free = inside;
            if outside.is_empty() || free.is_empty() {
                return shares;
            }
        }
    }

    /// Moves one parameter after another until the moves are at their finest or the budget ends.
    fn move_each(&mut self) -> Option<()> {
        let p = self.best.x.len();
        let mut moves = vec![FIRST_MOVE; p];
        while moves.iter().any(|share: &f64| share.abs() >= FINEST) {
            // the parameters of the last effect, which have been moved least, first
            for k in (0..p).rev() {
                let mut better = false;
                for turn in [1.0, -1.0] {
                    let share = turn * moves[k];
                    let next = self.moved(&DVector::from_fn(p, |row, _| if row == k { share } else { 0.0 }));
                    if share.abs() < FINEST || next == self.best.x {
                        continue;
                    }
                    let next = self.trial(next)?;
                    if next.cost < self.best.cost {
                        self.best = next;
                        moves[k] = share * GROWTH;
                        better = true;
                        break;
                    }
                }
                if !better {
                    moves[k] *= 0.5;
                }
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: Vec<f64>) -> Residuals {
        values.into_iter().map(|value| Some(DVector::from_vec(vec![value]))).collect()
    }

    /// Two valleys and a jump: the search finds the minimum of the valley from which it starts, within its last step, and does
    /// not exceed its budget.
    #[test]
    fn the_search_finds_a_minimum_within_its_budget() {
        let region = Region { bounds: vec![(-1.0, 1.0), (0.0, 10.0)], grid: vec![vec![0.0], vec![5.0]] };
        let count = std::cell::Cell::new(0);
        let residuals = |x: &[f64]| {
            count.set(count.get() + 1);
            let (a, b) = (x[0] - 0.31, (x[1] - 7.2) / 10.0);
            of(vec![a + 0.3 * b, b, if x[0] < -0.5 { 1.0 } else { 0.0 }])
        };
        let found = descend(&region, vec![vec![0.0, 5.0], vec![-1.0, 0.0]], 200, &residuals).unwrap();
        assert!((found.x[0] - 0.31).abs() < 0.02 && (found.x[1] - 7.2).abs() < 0.1, "{found:?}");
        count.set(0);
        descend(&region, vec![vec![0.0, 5.0]], 7, &residuals).unwrap();
        assert_eq!(count.get(), 8, "one start and seven trials");
    }

    /// A narrow curved valley (H. H. Rosenbrock 1960), whose minimum moves of one parameter after another do not reach within 150
    /// trials, and one toss that jumps within the step of the differences at the start and says nothing about the minimum. The
    /// third parameter ends at its bound, beyond which the cost would fall: with a = x₁ − 1 the cost there is
    /// a² + (0.5 − 0.3 a)², least for a = 0.15/1.09.
    #[test]
    fn the_search_follows_a_curved_valley_past_a_jump_to_a_bound() {
        let region = Region { bounds: vec![(-2.0, 2.0), (-2.0, 2.0), (0.0, 1.0)], grid: vec![vec![0.0]; 3] };
        let residuals = |x: &[f64]| -> Residuals {
            let valley = vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0], x[2] + 0.3 * (1.0 - x[0]) + 0.5];
            let jumps = vec![if x[0] > -1.2 { 5.0 } else { 0.0 }];
            let tosses = std::iter::repeat_n(valley, 5).chain([jumps]);
            tosses.map(|toss| Some(DVector::from_vec(toss))).collect()
        };
        let found = descend(&region, vec![vec![-1.201, 1.0, 0.7]], 150, &residuals).unwrap();
        let least = 1.0 + 0.15 / 1.09;
        // the search ends with a gain below 0.2 % of the cost
        assert!((found.x[0] - least).abs() < 0.02 && (found.x[1] - least * least).abs() < 0.05, "{found:?}");
        assert_eq!(found.x[2], 0.0);
    }
}
