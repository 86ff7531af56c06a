//! Further starts of the iteration if it does not converge.
//!
//! Problems of many contacts with a singular H have solutions that sweeps and Newton steps hardly find from zero. The proximal
//! point method (Rockafellar 1976) leads there: a problem whose H has a share of each constraint's h added to it, around the
//! solution of the one before. The share decreases after each problem that is solved, and increases after each that is not.
//!
//! In inelastic problems with few degrees of freedom and large friction, about one in a thousand makes sweeps and
//! Newton steps alternate between two modes, while they converge from another start. The last iterations go to other
//! starts: the impulses without friction, ten times the best so far, and random ones of one to a thousand times its size,
//! drawn with a fixed seed.

use nalgebra::DVector;

use super::natural_map::{NaturalMap, Point};
use super::response::Response;
use super::solve::{Found, solve, sweep};
use super::{Accuracy, SeveralProblem};
use crate::rounding::SOLVED;

/// The first start, and each problem of the proximal point method, gets the iterations divided by this number.
const SHORT: usize = 40;

/// Each other start gets the iterations divided by this number.
const SHARE: usize = 7;

/// Iterations on the problem itself after each of the proximal point method.
const STEPS: usize = 4;

/// The first share that is added to H: of 10, 1, 0.3, ... 0.001 the one with which hard problems of the set of `benches/peers/problems` took
/// the least time.
const FIRST_SHARE: f64 = 0.01;

/// Factors of the share that is added to H: after a problem that is solved, and after one that is not.
const FACTORS: [f64; 2] = [0.3, 3.0];

/// The largest share.
const MOST: f64 = 100.0;

/// Solves, from several starts if needed; returns the best result, with all iterations counted.
pub(super) fn solve_patiently(problem: &SeveralProblem, accuracy: &Accuracy, start: Option<&DVector<f64>>) -> Found {
    let whole = Response::whole(&problem.delassus, problem.gram);
    let mut map = NaturalMap::new(problem, &whole);
    let mut at = map.at(start);
    let mut left = accuracy.max_iterations;
    // One sweep solves constraints that hardly act on each other, before anything is factored.
    if start.is_none() && map.residual(&at.f) > accuracy.tolerance && left > 0 {
        sweep(&map, &mut at);
        left -= 1;
    }
    let done = |left| accuracy.max_iterations - left;
    let residual = map.residual(&at.f);
    if residual <= accuracy.tolerance {
        return Found { impulse: at.p, residual, iterations: done(left) };
    }
    let rest = |left| Accuracy { max_iterations: left, ..*accuracy };
    let thin = if problem.gram { Response::thin(&problem.delassus) } else { None };
    if let Some(thin) = &thin {
        map.response = thin;
        let found = from_starts(&map, &rest(left), map.at(Some(&at.p)));
        left -= found.iterations;
        // The law holds for H itself, not for its factors.
        map.response = &whole;
        at = map.at(Some(&found.impulse));
        let residual = map.residual(&at.f);
        if found.residual > accuracy.tolerance || residual <= accuracy.tolerance {
            return Found { impulse: at.p, residual, iterations: done(left) };
        }
    }
    let found = from_starts(&map, &rest(left), at);
    Found { iterations: done(left - found.iterations), ..found }
}

fn from_starts(map: &NaturalMap, accuracy: &Accuracy, start: Point) -> Found {
    let whole = accuracy.max_iterations;
    let mut left = whole;
    let mut run = |map: &NaturalMap, start: Point, most: usize| {
        let found = solve(map, &Accuracy { max_iterations: most.max(1).min(left), ..*accuracy }, start);
        // At least one is counted, so that the loops end.
        left -= found.iterations.max(1).min(left);
        (found, left)
    };
    let (mut best, mut left) = run(map, start, whole / SHORT);
    let better = |found: &Found, best: &Found| {
        found.residual <= accuracy.tolerance
            || map.cost(found.residual, &found.impulse) < map.cost(best.residual, &best.impulse)
    };
    let (mut p, mut share) = (DVector::zeros(best.impulse.len()), FIRST_SHARE);
    while best.residual > accuracy.tolerance && left > whole / SHARE && share <= MOST {
        let mut found;
        let near = map.regularised(share, &p);
        (found, left) = run(&near, near.at(Some(&p)), whole / SHORT);
        let is_solved = found.residual <= accuracy.tolerance.max(SOLVED);
        share *= FACTORS[usize::from(!is_solved)];
        if is_solved {
            p = found.impulse;
            (found, left) = run(map, map.at(Some(&p)), STEPS);
            if better(&found, &best) {
                best = found;
            }
        }
    }
    let mut draw = fastrand::Rng::with_seed(0);
    for attempt in 0_u64.. {
        if best.residual <= accuracy.tolerance || left == 0 {
            break;
        }
        let size = best.impulse.amax();
        let start = match attempt {
            0 => {
                let smooth = map.with_friction(0.0);
                run(&smooth, smooth.at(None), whole / SHARE).0.impulse
            }
            1 => &best.impulse * 10.0,
            _ => {
                let size = size * 10.0_f64.powi((attempt % 4) as i32);
                DVector::from_fn(best.impulse.len(), |_, _| size * (2.0 * draw.f64() - 1.0))
            }
        };
        let found;
        (found, left) = run(map, map.at(Some(&start)), whole / SHARE);
        if better(&found, &best) {
            best = found;
        }
    }
    Found { iterations: whole - left, ..best }
}
