//! The iteration: sweeps over the constraints find the modes, Newton steps converge to the solution.
//!
//! A sweep (block Gauss–Seidel) solves each constraint exactly with the current impulses of the others. It is robust,
//! but converges linearly, and very slowly for ill-conditioned or redundant contacts. At intervals Newton's method is
//! therefore tried from the current impulses, with least-squares steps of least norm, because redundant contacts make
//! F' singular. Its result is kept only if it is better.

use nalgebra::{DVector, Vector3};

use super::natural_map::NaturalMap;
use super::{Accuracy, Constraint, SeveralProblem};
use crate::least_norm::least_norm;

/// Sweeps before the first attempt of Newton's method; doubled after each failure.
const FIRST_SWEEPS: usize = 8;

/// Newton steps in one attempt.
const NEWTON_STEPS: usize = 24;

/// Pivots below this share of the largest count as zero.
const RANK: f64 = 1e-12;

/// Impulses with their residual.
pub(super) struct Found {
    pub impulse: DVector<f64>,
    pub residual: f64,
    pub iterations: usize,
}

pub(super) fn solve(problem: &SeveralProblem, accuracy: &Accuracy, warm_start: Option<&DVector<f64>>) -> Found {
    let map = NaturalMap::new(problem);
    let start = map.admissible(warm_start.cloned().unwrap_or_else(|| DVector::zeros(map.offset.len())));
    let mut search = Search { best: start.clone(), residual: f64::INFINITY, left: accuracy.max_iterations, accuracy };
    search.keep(&map, &start);
    let mut p = start;
    let mut sweeps = FIRST_SWEEPS;
    while search.goes_on() {
        for _ in 0..sweeps {
            if !search.goes_on() || !search.step() {
                break;
            }
            sweep(&map, &mut p);
            search.keep(&map, &p);
        }
        search.newton(&map, &map, &mut p.clone());
        search.proximal(&map, &p);
        sweeps *= 2;
    }
    Found { impulse: search.best, residual: search.residual, iterations: accuracy.max_iterations - search.left }
}

/// The best impulses so far, and how many iterations are left.
struct Search<'a> {
    best: DVector<f64>,
    residual: f64,
    left: usize,
    accuracy: &'a Accuracy,
}

impl Search<'_> {
    fn goes_on(&self) -> bool {
        self.residual > self.accuracy.tolerance && self.left > 0
    }

    /// Counts one iteration; false if none was left.
    fn step(&mut self) -> bool {
        let any = self.left > 0;
        self.left -= usize::from(any);
        any
    }

    /// Stores `p`, projected on the cones, if it is the best so far.
    fn keep(&mut self, map: &NaturalMap, p: &DVector<f64>) {
        let p = map.admissible(p.clone());
        let residual = map.residual(&map.value(&p));
        // Impulses that overflow are not a solution.
        if residual < self.residual && p.iter().all(|p| p.is_finite()) {
            self.best = p;
            self.residual = residual;
        }
    }

    /// Newton's method with step halving on `near`, which is `map` or a regularised form of it; changes `p`.
    fn newton(&mut self, map: &NaturalMap, near: &NaturalMap, p: &mut DVector<f64>) {
        let mut f = near.value(p);
        for _ in 0..NEWTON_STEPS {
            if !self.goes_on() || f.norm() == 0.0 || !self.step() {
                return;
            }
            let step = least_norm(&near.derivative(p), &f, RANK);
            let shares = (0..12).map(|halvings| 0.5_f64.powi(halvings));
            let next = shares.map(|share| (share, &*p - &step * share)).find_map(|(share, next)| {
                let f_next = near.value(&next);
                (f_next.norm() < f.norm() * (1.0 - 1e-4 * share)).then_some((next, f_next))
            });
            let Some(next) = next else { return };
            (*p, f) = next;
            self.keep(map, p);
        }
    }

    /// A sequence of regularised problems, each started at the solution of the previous one, with decreasing
    /// regularisation.
    fn proximal(&mut self, map: &NaturalMap, start: &DVector<f64>) {
        let mut p = start.clone();
        for decade in 1..=8 {
            let near = map.regularised(0.1_f64.powi(decade), &p);
            for _ in 0..3 {
                if !self.goes_on() || !self.step() {
                    return;
                }
                sweep(&near, &mut p);
            }
            self.newton(map, &near, &mut p);
            self.newton(map, map, &mut p.clone());
        }
    }
}

/// Solves every constraint once, with the current impulses of the others.
fn sweep(map: &NaturalMap, p: &mut DVector<f64>) {
    let without = |p: &DVector<f64>, row: usize| map.offset[row] + map.delassus.row(row).tr_dot(p);
    let size = |p: &DVector<f64>, row: usize| {
        map.delassus.row(row).iter().zip(p.iter()).fold(map.offset[row].abs(), |sum, (h, p)| sum + (h * p).abs())
    };
    for block in &map.blocks {
        let i = block.row;
        if let Constraint::Contact { friction, .. } = block.constraint {
            p.fixed_rows_mut::<3>(i).fill(0.0);
            let c = Vector3::new(without(p, i), without(p, i + 1), without(p, i + 2));
            let size = size(p, i).max(size(p, i + 1)).max(size(p, i + 2));
            p.fixed_rows_mut::<3>(i).copy_from(&block.solve_contact(friction, c, size));
        } else {
            p[i] = 0.0;
            p[i] = block.solve_one(without(p, i));
        }
    }
}
