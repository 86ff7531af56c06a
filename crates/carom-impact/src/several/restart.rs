//! Further starts of the iteration if it does not converge.
//!
//! In inelastic problems with few degrees of freedom and large friction, about one in a thousand makes sweeps and
//! Newton steps alternate between two modes, while they converge from another start. The first start therefore gets a
//! fifth of the iterations, and the rest go to other starts: the impulses without friction, ten times the best so far,
//! and random ones of its size, drawn with a fixed seed.

use nalgebra::DVector;

use super::solve::{Found, solve};
use super::{Accuracy, Constraint, SeveralProblem};

/// One start gets the iterations divided by this number.
const SHARE: usize = 5;

/// Solves, from several starts if needed; returns the best result, with all iterations counted.
pub(super) fn solve_patiently(problem: &SeveralProblem, accuracy: &Accuracy, start: Option<&DVector<f64>>) -> Found {
    let each = (accuracy.max_iterations / SHARE).max(1);
    let mut left = accuracy.max_iterations;
    let mut run = |problem: &SeveralProblem, start: Option<&DVector<f64>>| {
        let found = solve(problem, &Accuracy { max_iterations: each.min(left), ..*accuracy }, start);
        // At least one is counted, so that the loop ends.
        left -= found.iterations.max(1).min(left);
        (found, left)
    };
    let (mut best, mut left) = run(problem, start);
    let mut draw = fastrand::Rng::with_seed(0);
    for attempt in 0_u64.. {
        if best.residual <= accuracy.tolerance || left == 0 {
            break;
        }
        let size = best.impulse.amax();
        let start = match attempt {
            0 => run(&problem.without_friction(), None).0.impulse,
            1 => &best.impulse * 10.0,
            _ => DVector::from_fn(best.impulse.len(), |_, _| size * (2.0 * draw.f64() - 1.0)),
        };
        let found;
        (found, left) = run(problem, Some(&start));
        if found.residual < best.residual {
            best = found;
        }
    }
    Found { iterations: accuracy.max_iterations - left, ..best }
}

impl SeveralProblem {
    fn without_friction(&self) -> Self {
        let constraints = self.constraints.iter().map(|constraint| match *constraint {
            Constraint::Contact { restitution, .. } => Constraint::Contact { restitution, friction: 0.0 },
            other => other,
        });
        Self { constraints: constraints.collect(), ..self.clone() }
    }
}
