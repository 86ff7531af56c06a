//! The iteration: sweeps over the constraints find the modes, Newton steps converge to the solution.
//!
//! A sweep (block Gauss–Seidel) solves each constraint exactly with the current impulses of the others. It is robust,
//! but converges linearly, and very slowly for ill-conditioned or redundant contacts. Newton's method is therefore
//! tried from the given impulses, whose modes are often those of the solution, after the first sweep, and then at
//! intervals. Its result is kept only if it is better.

use nalgebra::{DVector, Vector3};

use super::natural_map::{NaturalMap, Point};
use super::newton::Newton;
use super::{Accuracy, Constraint};

/// Sweeps before the first attempt of Newton's method; doubled after each failure.
const FIRST_SWEEPS: usize = 1;

/// Newton steps in one attempt.
const NEWTON_STEPS: usize = 36;

/// A Newton step has to make F shorter than the longest of this number of steps before, so that F may grow where a
/// constraint changes its mode: of 3, 5, 8 and 20, with 5 and 8 `benches/peers/problems` took the least time.
const RECENT: usize = 8;

/// Regularisations of a Newton step, each tried if the one before fails, as shares of each constraint's h. The first is
/// as small as the cancellation in the step allows: its rounding is ε over the share, relative to the velocities.
const SHARES: [f64; 3] = [1e-10, 1e-4, LARGEST];

/// With a smaller regularisation a step that leaves more than half of F is refused: the linear equations have no
/// solution, and the step would grow without bound along the null directions of H.
const LARGEST: f64 = 0.1;

/// Impulses with their residual.
pub(super) struct Found {
    pub impulse: DVector<f64>,
    pub residual: f64,
    pub iterations: usize,
}

/// From one start.
pub(super) fn solve(map: &NaturalMap, accuracy: &Accuracy, mut at: Point) -> Found {
    let mut search = Search::new(map, accuracy);
    search.keep(map, &at);
    search.newton(map, &at);
    let mut sweeps = FIRST_SWEEPS;
    while search.goes_on() {
        for _ in 0..sweeps {
            if !search.goes_on() || !search.step() {
                break;
            }
            sweep(map, &mut at);
            search.keep(map, &at);
        }
        search.newton(map, &at);
        sweeps *= 2;
    }
    Found { impulse: search.best, residual: search.residual, iterations: accuracy.max_iterations - search.left }
}

/// The best impulses so far, how many iterations are left, and memory for them.
struct Search<'a> {
    best: DVector<f64>,
    residual: f64,
    cost: f64,
    left: usize,
    accuracy: &'a Accuracy,
    /// Since its first attempt.
    newton: Option<Attempt>,
}

/// Where Newton's method is, and where it goes.
struct Attempt {
    here: Point,
    next: Point,
    newton: Newton,
    /// H d of the step d.
    moved: DVector<f64>,
}

impl<'a> Search<'a> {
    fn new(map: &NaturalMap, accuracy: &'a Accuracy) -> Self {
        Self {
            best: DVector::zeros(map.offset.len()),
            residual: f64::INFINITY,
            cost: f64::INFINITY,
            left: accuracy.max_iterations,
            accuracy,
            newton: None,
        }
    }

    fn goes_on(&self) -> bool {
        self.residual > self.accuracy.tolerance && self.left > 0
    }

    /// Counts one iteration; false if none was left.
    fn step(&mut self) -> bool {
        let any = self.left > 0;
        self.left -= usize::from(any);
        any
    }

    /// Stores these admissible impulses if they are the best so far.
    fn keep(&mut self, map: &NaturalMap, at: &Point) {
        let residual = map.residual(&at.f);
        let cost = map.cost(residual, &at.p);
        let better = if residual <= self.accuracy.tolerance { residual < self.residual } else { cost < self.cost };
        // Impulses that overflow are not a solution.
        if better && at.p.iter().all(|p| p.is_finite()) {
            self.best.copy_from(&at.p);
            (self.residual, self.cost) = (residual, cost);
        }
    }

    /// Newton's method with step halving. F gets shorter than the longest of the [`RECENT`] last ones.
    fn newton(&mut self, map: &NaturalMap, at: &Point) {
        if !self.goes_on() {
            return;
        }
        let mut attempt = match self.newton.take() {
            Some(mut attempt) => {
                attempt.here.clone_from(at);
                attempt
            }
            None => Attempt { here: at.clone(), next: Point::new(map), newton: Newton::new(map), moved: at.y.clone() },
        };
        let mut sizes = [0.0_f64; RECENT];
        for step in 0..NEWTON_STEPS {
            let size = attempt.here.f.norm();
            if !self.goes_on() || size == 0.0 || !self.step() {
                break;
            }
            sizes[step % RECENT] = size;
            let longest = sizes.iter().fold(0.0_f64, |most, size| most.max(*size));
            if !SHARES.into_iter().any(|share| attempt.shorter(map, longest, share)) {
                break;
            }
            let Attempt { here, next, .. } = &mut attempt;
            std::mem::swap(here, next);
            next.p.copy_from(&here.p);
            if map.admissible(&mut next.p) {
                map.evaluate(next);
                self.keep(map, next);
            } else {
                self.keep(map, here);
            }
        }
        self.newton = Some(attempt);
    }
}

impl Attempt {
    /// A Newton step with step halving from `here` to `next`, where F is shorter than `size`; false if there is none.
    fn shorter(&mut self, map: &NaturalMap, size: f64, regularisation: f64) -> bool {
        let most = if regularisation < LARGEST { 0.5 * size } else { f64::INFINITY };
        if !self.newton.solve(map, &self.here, regularisation).is_some_and(|left| left <= most) {
            return false;
        }
        let (here, next, step, moved) = (&self.here, &mut self.next, &self.newton.step, &mut self.moved);
        let is_shorter = |next: &Point, share: f64| next.f.norm() < size * (1.0 - 1e-4 * share);
        next.p.copy_from(&here.p);
        next.p -= step;
        map.evaluate(next);
        if is_shorter(next, 1.0) {
            return true;
        }
        moved.copy_from(&here.y);
        *moved -= &next.y;
        let found = (1..12).map(|halvings| 0.5_f64.powi(halvings)).any(|share| {
            next.p.copy_from(&here.p);
            next.p.axpy(-share, step, 1.0);
            next.y.copy_from(&here.y);
            next.y.axpy(-share, moved, 1.0);
            map.value(&next.p, &next.y, &mut next.f);
            is_shorter(next, share)
        });
        if found {
            // Without the rounding of the larger numbers before.
            map.evaluate(next);
        }
        found
    }
}

/// Solves every constraint once, with the current impulses of the others.
pub(super) fn sweep(map: &NaturalMap, at: &mut Point) {
    let Point { p, w, .. } = at;
    let response = map.response;
    response.reduce(p, w);
    for block in &map.blocks {
        let i = block.row;
        let rows = i..i + block.constraint.rows();
        for k in rows.clone().filter(|&k| p[k] != 0.0) {
            response.add(k, -p[k], w);
        }
        let without = |k: usize| map.offset[k] + response.velocity(k, w);
        if let Constraint::Contact { friction, .. } = block.constraint {
            let c = Vector3::new(without(i), without(i + 1), without(i + 2));
            let size = |k: usize| map.offset[k].abs() + response.size(k, p);
            let size = || size(i).max(size(i + 1)).max(size(i + 2));
            let solved = block.solve_contact(friction, c, size);
            p.fixed_rows_mut::<3>(i).copy_from(&solved);
        } else {
            p[i] = block.solve_one(without(i));
        }
        for k in rows.filter(|&k| p[k] != 0.0) {
            response.add(k, p[k], w);
        }
    }
    map.admissible(p);
    map.evaluate(at);
}
