//! Further starts of the iteration if it does not converge.
//!
//! In inelastic problems with few degrees of freedom and large friction, about one in a thousand makes sweeps and
//! Newton steps alternate between two modes, while they converge from another start. The first start therefore gets a
//! seventh of the iterations, and the rest go to other starts: the impulses without friction, ten times the best so far,
//! and random ones of one to a thousand times its size, drawn with a fixed seed. Every second one lets F grow for some
//! steps between regularised problems, since either rule solves problems that the other misses.

use nalgebra::DVector;

use super::natural_map::{NaturalMap, Point};
use super::response::Response;
use super::solve::{Found, RECENT, solve};
use super::{Accuracy, SeveralProblem};

/// One start gets the iterations divided by this number.
const SHARE: usize = 7;

/// Solves, from several starts if needed; returns the best result, with all iterations counted.
pub(super) fn solve_patiently(problem: &SeveralProblem, accuracy: &Accuracy, start: Option<&DVector<f64>>) -> Found {
    let whole = Response::whole(&problem.delassus, problem.gram);
    let mut map = NaturalMap::new(problem, &whole);
    if let Some(start) = start {
        let mut impulse = start.clone();
        let residual = exact_residual(&map, &mut impulse);
        if residual <= accuracy.tolerance {
            return Found { impulse, residual, iterations: 0 };
        }
    }
    let thin = if problem.gram { Response::thin(&problem.delassus) } else { None };
    let Some(thin) = thin else { return from_starts(&map, accuracy, start) };
    map.response = &thin;
    let mut found = from_starts(&map, accuracy, start);
    // The law holds for H itself, not for its factors.
    map.response = &whole;
    let residual = exact_residual(&map, &mut found.impulse);
    if found.residual <= accuracy.tolerance && residual > accuracy.tolerance {
        let left = accuracy.max_iterations - found.iterations;
        let again = from_starts(&map, &Accuracy { max_iterations: left, ..*accuracy }, Some(&found.impulse));
        return Found { iterations: found.iterations + again.iterations, ..again };
    }
    Found { residual, ..found }
}

/// The residual of these impulses, projected on the cones.
fn exact_residual(map: &NaturalMap, impulse: &mut DVector<f64>) -> f64 {
    let mut at = Point::new(map);
    map.admissible(impulse);
    at.p.copy_from(impulse);
    map.evaluate(&mut at);
    map.residual(&at.f)
}

fn from_starts(map: &NaturalMap, accuracy: &Accuracy, start: Option<&DVector<f64>>) -> Found {
    let each = (accuracy.max_iterations / SHARE).max(1);
    let mut left = accuracy.max_iterations;
    let mut run = |map: &NaturalMap, start: Option<&DVector<f64>>, recent: usize| {
        let found = solve(map, &Accuracy { max_iterations: each.min(left), ..*accuracy }, start, recent);
        // At least one is counted, so that the loop ends.
        left -= found.iterations.max(1).min(left);
        (found, left)
    };
    let (mut best, mut left) = run(map, start, 1);
    let mut draw = fastrand::Rng::with_seed(0);
    for attempt in 0_u64.. {
        if best.residual <= accuracy.tolerance || left == 0 {
            break;
        }
        let size = best.impulse.amax();
        let start = match attempt {
            0 => run(&map.with_friction(0.0), None, 1).0.impulse,
            1 => &best.impulse * 10.0,
            _ => {
                let size = size * 10.0_f64.powi((attempt % 4) as i32);
                DVector::from_fn(best.impulse.len(), |_, _| size * (2.0 * draw.f64() - 1.0))
            }
        };
        let found;
        (found, left) = run(map, Some(&start), if attempt % 2 == 0 { RECENT } else { 1 });
        if found.residual <= accuracy.tolerance
            || map.cost(found.residual, &found.impulse) < map.cost(best.residual, &best.impulse)
        {
            best = found;
        }
    }
    Found { iterations: accuracy.max_iterations - left, ..best }
}
