//! Minimises a cost over a box: a grid, then the Nelder–Mead method from the best grid points.
//!
//! The cost is piecewise smooth in the coefficients, with kinks where an impact changes from slip to stick and, in roll-outs,
//! discontinuities. A method without derivatives is robust against both. The Nelder–Mead implementation is that of argmin.

use argmin::core::{CostFunction, Error, Executor, State};
use argmin::solver::neldermead::NelderMead;

/// The box that is searched, and the grid of starting points.
#[doc(hidden)] // for carom-evidence
#[derive(Debug, Clone)]
pub struct Region {
    /// Lowest and highest value of each coefficient.
    pub bounds: Vec<(f64, f64)>,
    /// Values of each coefficient on the grid.
    pub grid: Vec<Vec<f64>>,
}

impl Region {
    /// The nearest point of the box.
    pub fn clamp(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.bounds).map(|(x, &(low, high))| x.clamp(low, high)).collect()
    }

    /// The region without coefficient `k`.
    pub fn without(&self, k: usize) -> Self {
        let mut rest = self.clone();
        rest.bounds.remove(k);
        rest.grid.remove(k);
        rest
    }

    /// All points of the grid; the first coefficient varies slowest.
    pub fn points(&self) -> Vec<Vec<f64>> {
        let mut points = vec![Vec::new()];
        for values in &self.grid {
            points = points.iter().flat_map(|p| values.iter().map(move |&v| [p.as_slice(), &[v]].concat())).collect();
        }
        points
    }

    /// Minimises `cost` from `start` by the Nelder–Mead method. The edges of the first simplex are `share` of the sides of the
    /// box. The search ends when the standard deviation of the costs of the simplex is below `spread` times the cost at
    /// `start`, or after `steps` iterations. Returns the best point and its cost.
    pub fn descend(
        &self,
        start: &[f64],
        share: f64,
        spread: f64,
        steps: u64,
        cost: &dyn Fn(&[f64]) -> f64,
    ) -> (Vec<f64>, f64) {
        let first = cost(start);
        if start.is_empty() {
            return (Vec::new(), first); // nothing is left to search: the other coefficient of two is fixed
        }
        let scale = if first > 0.0 { first } else { 1.0 };
        let mut simplex = vec![start.to_vec()];
        for (k, &(low, high)) in self.bounds.iter().enumerate() {
            let mut corner = start.to_vec();
            let edge = (high - low) * share;
            corner[k] += if corner[k] + edge <= high { edge } else { -edge };
            simplex.push(corner);
        }
        let inside = Inside { all: self, scale, cost };
        let search = NelderMead::new(simplex).with_sd_tolerance(spread);
        let ran =
            search.and_then(|search| Executor::new(inside, search).configure(|state| state.max_iters(steps)).run());
        // no error occurs: the cost returns none, and the settings are valid
        let best = ran.ok().and_then(|done| done.state().get_best_param().cloned());
        let best = best.map(|x| self.clamp(&x)).map(|x| (cost(&x), x));
        match best {
            Some((value, x)) if value < first => (x, value),
            _ => (start.to_vec(), first),
        }
    }
}

/// The cost at the nearest point of the box, with a penalty that grows with the distance to the box.
struct Inside<'a> {
    all: &'a Region,
    scale: f64,
    cost: &'a dyn Fn(&[f64]) -> f64,
}

impl CostFunction for Inside<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Error> {
        let near = self.all.clamp(x);
        let sides = self.all.bounds.iter().map(|(low, high)| high - low);
        let away: f64 = x.iter().zip(&near).zip(sides).map(|((a, b), side)| ((a - b) / side).powi(2)).sum();
        Ok((self.cost)(&near) / self.scale * (1.0 + away) + away)
    }
}
