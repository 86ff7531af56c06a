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
const NEWTON_STEPS: usize = 24;

/// A Newton step has to make F shorter than the longest of this number of steps before, so that F may grow where a
/// constraint changes its mode.
const RECENT: usize = 3;

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
pub(super) fn solve(map: &NaturalMap, accuracy: &Accuracy, start: Option<&DVector<f64>>) -> Found {
    let mut search = Search::new(map, accuracy);
    if let Some(start) = start {
        search.kept.p.copy_from(start);
    }
    search.keep(map, None);
    let mut p = search.best.clone();
    if start.is_some() {
        search.newton(map, &mut p.clone());
    }
    let mut sweeps = FIRST_SWEEPS;
    while search.goes_on() {
        for _ in 0..sweeps {
            if !search.goes_on() || !search.step() {
                break;
            }
            search.sweep(map, &mut p);
            search.keep(map, Some(&p));
        }
        search.newton(map, &mut p.clone());
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
    kept: Point,
    here: Point,
    next: Point,
    newton: Newton,
    /// Reduced impulses during a sweep, and the sum of the sizes of their parts.
    w: DVector<f64>,
    sizes: DVector<f64>,
}

impl<'a> Search<'a> {
    fn new(map: &NaturalMap, accuracy: &'a Accuracy) -> Self {
        let point = Point::new(map);
        let w = DVector::zeros(map.response.rank());
        Self {
            best: point.p.clone(),
            residual: f64::INFINITY,
            cost: f64::INFINITY,
            left: accuracy.max_iterations,
            accuracy,
            kept: point.clone(),
            here: point.clone(),
            next: point,
            newton: Newton::new(map),
            sizes: w.clone(),
            w,
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

    /// Stores `p`, or the impulses in `kept`, projected on the cones, if it is the best so far.
    fn keep(&mut self, map: &NaturalMap, p: Option<&DVector<f64>>) {
        let kept = &mut self.kept;
        if let Some(p) = p {
            kept.p.copy_from(p);
        }
        map.admissible(&mut kept.p);
        map.evaluate(kept);
        let residual = map.residual(&kept.f);
        let cost = map.cost(residual, &kept.p);
        let better = if residual <= self.accuracy.tolerance { residual < self.residual } else { cost < self.cost };
        // Impulses that overflow are not a solution.
        if better && kept.p.iter().all(|p| p.is_finite()) {
            self.best.copy_from(&kept.p);
            (self.residual, self.cost) = (residual, cost);
        }
    }

    /// Newton's method with step halving; changes `p`. F gets shorter than the longest of the [`RECENT`] last ones.
    fn newton(&mut self, map: &NaturalMap, p: &mut DVector<f64>) {
        self.here.p.copy_from(p);
        map.evaluate(&mut self.here);
        let mut sizes = [0.0_f64; RECENT];
        for step in 0..NEWTON_STEPS {
            let size = self.here.f.norm();
            if !self.goes_on() || size == 0.0 || !self.step() {
                return;
            }
            sizes[step % RECENT] = size;
            let longest = sizes.iter().fold(0.0_f64, |most, size| most.max(*size));
            if !SHARES.into_iter().any(|share| self.shorter(map, longest, share)) {
                return;
            }
            std::mem::swap(&mut self.here, &mut self.next);
            // Without the rounding of the larger numbers before.
            map.evaluate(&mut self.here);
            p.copy_from(&self.here.p);
            self.keep(map, Some(p));
        }
    }

    /// A Newton step with step halving from `here` to `next`, where F is shorter than `size`; false if there is none.
    fn shorter(&mut self, map: &NaturalMap, size: f64, regularisation: f64) -> bool {
        let most = if regularisation < LARGEST { 0.5 * size } else { f64::INFINITY };
        self.newton.solve(map, &self.here, regularisation).is_some_and(|left| left <= most)
            && (0..12).map(|halvings| 0.5_f64.powi(halvings)).any(|share| {
                let (here, next) = (&self.here, &mut self.next);
                next.p.copy_from(&here.p);
                next.p.axpy(-share, &self.newton.step, 1.0);
                next.y.copy_from(&here.y);
                next.y.axpy(-share, &self.newton.moved, 1.0);
                map.value(&next.p, &next.y, &mut next.f);
                next.f.norm() < size * (1.0 - 1e-4 * share)
            })
    }

    /// Solves every constraint once, with the current impulses of the others.
    fn sweep(&mut self, map: &NaturalMap, p: &mut DVector<f64>) {
        let (response, w, sizes) = (map.response, &mut self.w, &mut self.sizes);
        response.reduce(p, w);
        sizes.fill(0.0);
        for (i, p) in p.iter().enumerate() {
            response.add_size(i, *p, sizes);
        }
        for block in &map.blocks {
            let i = block.row;
            let rows = i..i + block.constraint.rows();
            for k in rows.clone() {
                response.add(k, -p[k], w);
            }
            let without = |k: usize| map.offset[k] + response.velocity(k, w);
            if let Constraint::Contact { friction, .. } = block.constraint {
                let c = Vector3::new(without(i), without(i + 1), without(i + 2));
                let size = |k: usize| map.offset[k].abs() + response.size(k, sizes);
                let size = size(i).max(size(i + 1)).max(size(i + 2));
                p.fixed_rows_mut::<3>(i).copy_from(&block.solve_contact(friction, c, size));
            } else {
                p[i] = block.solve_one(without(i));
            }
            for k in rows {
                response.add(k, p[k], w);
                response.add_size(k, p[k], sizes);
            }
        }
    }
}
