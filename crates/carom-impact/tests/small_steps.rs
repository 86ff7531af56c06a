//! The flow in space against an independent integration without series and invariant directions: the classical
//! Runge–Kutta method with equal small steps of the normal impulse, and a stop of slip wherever it is nearer than a
//! step.

use crate::common::{Case, any_spatial, rough};
use carom_impact::{Flags, law_by_name};
use nalgebra::{Vector2, Vector3};

/// Velocity, and the normal work in the last entry.
type State = nalgebra::Vector4<f64>;

/// Rates per unit of normal impulse while the contact slips.
fn rate(case: &Case<3>, x: &State) -> State {
    let slip = Vector2::new(x[0], x[1]).normalize() * -case.friction;
    let du = case.delassus * Vector3::new(slip.x, slip.y, 1.0);
    State::new(du.x, du.y, du.z, x[2])
}

/// Rates after slip has stopped: constant friction that makes the contact stick, or that is opposed to the slip it
/// causes, found by scanning the circle.
fn rate_from_rest(case: &Case<3>) -> Vector3<f64> {
    let h = &case.delassus;
    let hold = -h.fixed_view::<2, 2>(0, 0).try_inverse().unwrap() * h.fixed_view::<2, 1>(0, 2);
    if hold.norm() <= case.friction {
        return h * Vector3::new(hold.x, hold.y, 1.0);
    }
    let at = |angle: f64| h * Vector3::new(-case.friction * angle.cos(), -case.friction * angle.sin(), 1.0);
    let turning = |angle: f64| at(angle).y * angle.cos() - at(angle).x * angle.sin();
    let n = 10_000;
    for i in 0..n {
        let angle = |i: f64| std::f64::consts::TAU * i / n as f64;
        let (mut low, mut high) = (angle(i as f64), angle(i as f64 + 1.0));
        if turning(low) * turning(high) <= 0.0 {
            let sign = turning(low);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if turning(middle) * sign > 0.0 { low = middle } else { high = middle }
            }
            let du = at(low);
            if du.x * low.cos() + du.y * low.sin() > 0.0 {
                return du;
            }
        }
    }
    panic!("no direction of growing slip: {case:?}");
}

fn step(case: &Case<3>, x: &State, rest: &Option<Vector3<f64>>, dp: f64) -> State {
    if let Some(du) = rest {
        let du = State::new(du.x, du.y, du.z, x[2] + 0.5 * du.z * dp);
        return x + du * dp;
    }
    let k1 = rate(case, x);
    let k2 = rate(case, &(x + k1 * (0.5 * dp)));
    let k3 = rate(case, &(x + k2 * (0.5 * dp)));
    let k4 = rate(case, &(x + k3 * dp));
    x + (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (dp / 6.0)
}

/// Velocity after, and the least slip speed.
fn integrate(law: &str, case: &Case<3>, steps: f64) -> (Vector3<f64>, f64) {
    let e = case.restitution;
    let dp = -case.u.z / (case.delassus[(2, 2)] * steps);
    let mut x = State::new(case.u.x, case.u.y, case.u.z, 0.0);
    let mut rest = None;
    let mut slowest = f64::INFINITY;
    let (mut p, mut pc, mut work) = (0.0, None, 0.0);
    loop {
        // A stop within this step?
        let du = if rest.is_none() { rate(case, &x) } else { State::zeros() };
        let slip = Vector2::new(x[0], x[1]);
        slowest = slip.norm().min(slowest);
        let closing = -slip.normalize().dot(&du.xy());
        if rest.is_none() && slip.norm() <= closing * dp {
            let left = slip.norm() / closing;
            x = x + State::new(0.0, 0.0, du.z, x[2]) * left;
            (x[0], x[1]) = (0.0, 0.0);
            p += left;
            rest = Some(rate_from_rest(case));
            slowest = 0.0;
        }
        let next = step(case, &x, &rest, dp);
        // The fraction of the step at which `over` turns from negative.
        let fraction = |over: &dyn Fn(&State, f64) -> f64| {
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if over(&step(case, &x, &rest, dp * middle), p + dp * middle) < 0.0 {
                    low = middle
                } else {
                    high = middle
                }
            }
            high
        };
        let Some(end) = pc else {
            if next[2] >= 0.0 {
                let share = fraction(&|x, _| x[2]);
                x = step(case, &x, &rest, dp * share);
                p += dp * share;
                (pc, work) = (Some(p), x[3]);
                x[2] = 0.0;
            } else {
                (x, p) = (next, p + dp);
            }
            continue;
        };
        let over = |x: &State, p: f64| match law {
            "newton" => x[2] + e * case.u.z,
            "poisson" => p - (1.0 + e) * end,
            _ => x[3] - (1.0 - e * e) * work,
        };
        if over(&next, p + dp) >= 0.0 {
            x = step(case, &x, &rest, dp * fraction(&over));
            return (Vector3::new(x[0], x[1], x[2]), slowest);
        }
        if next[2] < 0.0 {
            pc = None; // back at v_n = 0: compression goes on
        }
        (x, p) = (next, p + dp);
    }
}

fn off(law: &str, case: &Case<3>, steps: f64) -> (f64, f64) {
    let hit = law_by_name(law, rough(case.restitution, case.friction)).unwrap().resolve(&case.problem()).unwrap();
    let (u_plus, slowest) = integrate(law, case, steps);
    ((hit.u_plus - u_plus).norm() / hit.u_plus.norm().max(1.0), slowest)
}

#[test]
fn small_steps_converge_to_the_flow() {
    let mut rng = fastrand::Rng::with_seed(51);
    let mut drawn = Vec::new();
    while drawn.len() < 150 {
        let case = any_spatial(&mut rng, 0.3);
        // Very slow slip needs smaller steps.
        if case.friction > 0.02 && case.friction < 3.0 && case.u.xy().norm() > 0.1 && case.u.z < -0.1 {
            drawn.push(case);
        }
    }
    let (mut kept, mut stops) = (0, 0);
    let mut sums = [0.0; 3];
    for case in &drawn {
        for law in ["newton", "poisson", "energetic"] {
            let (fine, slowest) = off(law, case, 2000.0);
            if slowest < 0.05 {
                // First order at a stop: the last part of the turning happens within a step.
                assert!(fine < 2e-2, "{law} {fine:e} {case:?}");
                for (sum, steps) in sums.iter_mut().zip([500.0, 2000.0, 8000.0]) {
                    *sum += off(law, case, steps).0;
                }
                stops += 1;
            } else {
                assert!(fine < 1e-9, "{law} {fine:e} {case:?}");
                kept += 1;
            }
        }
    }
    assert!(kept > 100 && stops > 100, "{kept} {stops}");
    assert!(sums[1] < 0.4 * sums[0] && sums[2] < 0.4 * sums[1], "{sums:?}");
}

/// With a slow approach, slip that turns into a jam brings the contact back to `v_n = 0` before restitution is over.
#[test]
fn recompression_continues_the_compression() {
    let mut rng = fastrand::Rng::with_seed(52);
    let (mut found, mut checked) = (0, 0);
    for _ in 0..20_000 {
        let mut case = any_spatial(&mut rng, 0.2);
        case.u.z = -0.02 - 0.1 * case.u.z.abs();
        case.friction = 0.5 + 2.0 * rng.f64();
        let law = law_by_name("energetic", rough(case.restitution, case.friction)).unwrap();
        let hit = law.resolve(&case.problem()).unwrap();
        let plastic = law_by_name("energetic", rough(0.0, case.friction)).unwrap().resolve(&case.problem()).unwrap();
        // The first end of compression is that of e = 0; a later one has more impulse before it.
        let pc = hit.impulse.z / (1.0 + hit.poisson.unwrap());
        if case.restitution > 0.0 && pc > plastic.impulse.z * (1.0 + 1e-6) {
            found += 1;
            assert!(hit.flags.contains(Flags::JAM) && hit.energy_change < 0.0, "{case:?}");
            if checked < 20 {
                let (coarse, fine) = (off("energetic", &case, 500.0).0, off("energetic", &case, 8000.0).0);
                assert!(fine < 1e-2 && fine < 0.5 * coarse + 1e-9, "{coarse:e} {fine:e} {case:?}");
                checked += 1;
            }
        }
    }
    assert!(found > 5, "{found}");
}
