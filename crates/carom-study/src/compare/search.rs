//! The search for the parameters of a model on tosses.
//!
//! The error of a roll-out is piecewise smooth with jumps, so no derivatives are used. A law with constant coefficients starts
//! from a grid; a model with effects starts from the optimum of the model without its last effect, so that its training error is
//! never above that one's. Then one parameter after another is moved; a step grows after a success, turns and shrinks after a
//! failure (R. Hooke, T. A. Jeeves 1961; H. H. Rosenbrock 1960).

use crate::fit::Region;

/// The first step of the search, and the step at which it ends, as shares of the range.
const FIRST_STEP: f64 = 0.08;
const FINEST: f64 = 0.005;

/// A point that was tried, with the error of each measurement.
#[derive(Debug, Clone)]
pub(super) struct Trial {
    pub x: Vec<f64>,
    pub errors: Vec<f64>,
}

impl Trial {
    fn cost(&self) -> f64 {
        self.errors.iter().sum()
    }
}

/// Minimises the sum of errors from the best of the points `starts`, with at most `budget` trials of further points.
pub(super) fn descend(
    region: &Region,
    starts: Vec<Vec<f64>>,
    budget: usize,
    errors: &dyn Fn(&[f64]) -> Vec<f64>,
) -> Option<Trial> {
    let trial = |x: Vec<f64>| Trial { errors: errors(&x), x };
    let mut best = starts.into_iter().map(trial).min_by(|a, b| a.cost().total_cmp(&b.cost()))?;
    let mut steps = vec![FIRST_STEP; best.x.len()];
    let mut tried = 0;
    while steps.iter().any(|step: &f64| step.abs() >= FINEST) {
        // the parameters of the last effect, which have been moved least, first
        for k in (0..steps.len()).rev() {
            let (low, high) = region.bounds[k];
            let mut better = false;
            for turn in [1.0, -1.0] {
                let mut x = best.x.clone();
                x[k] = (x[k] + turn * steps[k] * (high - low)).clamp(low, high);
                if steps[k].abs() < FINEST || x == best.x {
                    continue;
                }
                if tried == budget {
                    return Some(best);
                }
                tried += 1;
                let next = trial(x);
                if next.cost() < best.cost() {
                    best = next;
                    steps[k] *= turn * GROWTH;
                    better = true;
                    break;
                }
            }
            if !better {
                steps[k] *= 0.5;
            }
        }
    }
    Some(best)
}

/// Growth of a step after a success.
const GROWTH: f64 = 1.5;

#[cfg(test)]
mod tests {
    use super::*;

    /// Two valleys at an angle to the axes and a jump: the search finds the minimum of the valley from which it starts, within
    /// its last step, and does not exceed its budget.
    #[test]
    fn the_search_finds_a_minimum_within_its_budget() {
        let region = Region { bounds: vec![(-1.0, 1.0), (0.0, 10.0)], grid: vec![vec![0.0], vec![5.0]] };
        let count = std::cell::Cell::new(0);
        let errors = |x: &[f64]| {
            count.set(count.get() + 1);
            let (a, b) = (x[0] - 0.31, (x[1] - 7.2) / 10.0);
            vec![a * a + 0.5 * a * b, b * b, if x[0] < -0.5 { 1.0 } else { 0.0 }]
        };
        let found = descend(&region, vec![vec![0.0, 5.0], vec![-1.0, 0.0]], 200, &errors).unwrap();
        assert!((found.x[0] - 0.31).abs() < 0.02 && (found.x[1] - 7.2).abs() < 0.1, "{found:?}");
        count.set(0);
        descend(&region, vec![vec![0.0, 5.0]], 7, &errors).unwrap();
        assert_eq!(count.get(), 8, "one start and seven trials");
    }
}
