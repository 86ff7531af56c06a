//! The path of an impact and the invariant directions of slip, each compared with a second computation.

use crate::common::{Case, FOLLOWING, TURNING as H, any_case, any_spatial, close, rough};
use carom_impact::{Energetic, ImpactError, ImpactProblem, ImpulsePath, Law, Mode, PathPoint, law_by_name};
use nalgebra::{Matrix3, Vector2, Vector3, matrix, vector};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

fn reference(u: Vector3<f64>) -> ImpactProblem<f64, 3> {
    ImpactProblem::new(H, u).unwrap()
}

fn last<const D: usize>(path: &ImpulsePath<D>) -> &PathPoint<D> {
    path.points.last().unwrap()
}

/// In the plane and in space. Recompression moves the end of compression of the outcome, not the path.
fn ends_with<const D: usize>(problem: &ImpactProblem<f64, D>, e: f64, mu: f64) -> usize {
    let mut stops = 0;
    for law in FOLLOWING {
        let hit = law_by_name::<D>(law, rough(e, mu)).unwrap().resolve(problem).unwrap();
        let path = problem.impulse_path(mu, hit.impulse[D - 1]).unwrap();
        // Rounding of some dozens of pieces, amplified by the condition number of H, up to 400.
        let within = 1e-11 * (1.0 + mu).min(10.0);
        close(law, (last(&path).impulse - hit.impulse).norm(), 0.0, within * hit.impulse.norm().max(1.0));
        close(law, (last(&path).velocity - hit.u_plus).norm(), 0.0, within * hit.u_plus.norm().max(1.0));
        if mu > 0.0 {
            assert_eq!(path.slip_end.is_some(), hit.slip_end.is_some(), "{law} {problem:?} {e} {mu}");
        }
        assert_eq!(path.points[path.compression_end].velocity[D - 1], 0.0);
        stops += usize::from(path.slip_end.is_some());
    }
    stops
}

#[test]
fn path_ends_at_the_outcome_of_the_laws_that_follow_it() {
    let mut rng = fastrand::Rng::with_seed(61);
    let mut stops = 0;
    for _ in 0..1_000 {
        let case = any_spatial(&mut rng, 0.05);
        stops += ends_with(&case.problem(), case.restitution, case.friction);
        let case = any_case(&mut rng, 0.05);
        stops += ends_with(&case.problem(), case.restitution, case.friction);
    }
    assert!(stops > 1_000 && stops < 5_000, "{stops}");
}

/// Along the whole path: u = u⁻ + H P, the cone, friction that never does positive work, and the sign of u_n: negative
/// before the end of compression, 0 there, and after it positive and growing except where friction jams
/// (`μ h·t >= C` for slip along t), which lowers u_n and may bring it back below 0.
#[test]
fn every_point_of_the_path_obeys_momentum_cone_and_phase() {
    let mut rng = fastrand::Rng::with_seed(62);
    let (mut opening, mut pressed) = (0, 0);
    for _ in 0..1_000 {
        let Case { delassus, u, friction, .. } = any_spatial(&mut rng, 0.1);
        let problem = ImpactProblem::new(delassus, u).unwrap();
        let path = problem.impulse_path(friction, 3.0).unwrap();
        assert!(last(&path).impulse.z >= 3.0);
        let coupling = problem.delassus().fixed_view::<2, 1>(0, 2).into_owned();
        // A contact at rest sticks or is about to slip: its rate is that of the chord's other end.
        let jams = |point: &PathPoint<3>| {
            let slip = point.velocity.xy();
            friction * coupling.dot(&slip) >= problem.delassus()[(2, 2)] * slip.norm() && slip.norm() > 0.0
        };
        for (k, point) in path.points.iter().enumerate() {
            let off = (u + problem.delassus() * point.impulse - point.velocity).norm();
            close("momentum", off, 0.0, 1e-12 * (1.0 + point.impulse.norm()));
            let slack = 1e-12 * (1.0 + friction) * point.impulse.z;
            assert!(point.impulse.xy().norm() <= friction * point.impulse.z + slack);
            let next = path.points.get(k + 1).unwrap_or(point);
            let (dp, mean) = (next.impulse - point.impulse, (next.velocity + point.velocity) / 2.0);
            assert!(dp.z >= 0.0);
            // The chord's work, ½ ΔP·(u + u'), is exact: momentum is linear in P.
            assert!(dp.xy().dot(&mean.xy()) <= 1e-12, "{point:?} {next:?}");
            if k < path.compression_end {
                assert!(point.velocity.z < 0.0, "{k} of {}: {point:?}", path.compression_end);
                continue;
            }
            if k == path.compression_end {
                assert_eq!(point.velocity.z, 0.0);
            }
            if jams(point) || jams(next) {
                pressed += usize::from(next.velocity.z < point.velocity.z);
            } else if dp.z > 1e-9 {
                // C - μ h·t > 0 at both ends, and the direction t turns by less than a right angle between them.
                assert!(next.velocity.z > point.velocity.z, "{point:?} {next:?}");
                opening += 1;
            }
        }
    }
    assert!(opening > 2_000 && pressed > 100, "{opening} open, {pressed} are pressed back");
}

/// The classical Runge–Kutta method, which uses neither series nor pieces, from point to point of the path.
#[test]
fn runge_kutta_integration_follows_the_path() {
    let mut rng = fastrand::Rng::with_seed(63);
    let (mut compared, mut worst) = (0, 0.0_f64);
    let cases =
        (0..200).map(|_| any_spatial(&mut rng, 0.3)).map(|case| (case.delassus, case.u, case.friction.min(2.0)));
    for (h, u, mu) in cases.chain([(H, vector![0.6, -0.2, -1.0], 0.3)]) {
        let problem = ImpactProblem::new(h, u).unwrap();
        let path = problem.impulse_path(mu, 2.0).unwrap();
        let rate = |v: &Vector3<f64>| {
            let slip = v.xy().normalize() * -mu;
            h * vector![slip.x, slip.y, 1.0]
        };
        let mut v = u;
        for ends in path.points.windows(2).take(path.slip_end.unwrap_or(usize::MAX)) {
            // Slip that is about to stop turns within a step.
            if ends[1].velocity.xy().norm() < 0.05 {
                break;
            }
            let span = ends[1].impulse.z - ends[0].impulse.z;
            let steps = (span / 2e-3).ceil().max(1.0);
            let dp = span / steps;
            for _ in 0..steps as usize {
                let k1 = rate(&v);
                let k2 = rate(&(v + k1 * (dp / 2.0)));
                let k3 = rate(&(v + k2 * (dp / 2.0)));
                let k4 = rate(&(v + k3 * dp));
                v += (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (dp / 6.0);
            }
            worst = worst.max((v - ends[1].velocity).norm());
            compared += 1;
        }
    }
    // Fourth order: (2e-3/0.05)⁴ of the speed where slip is slowest, much less elsewhere.
    assert!(worst < 1e-7 && compared > 3_000, "{worst:e} {compared}");
}

/// After a stop the rates are constant: stick, or slip straight along the invariant direction of growing slip.
#[test]
fn stopped_slip_sticks_or_leaves_along_an_invariant_direction() {
    let mut rng = fastrand::Rng::with_seed(64);
    let (mut held, mut gone) = (0, 0);
    for _ in 0..2_000 {
        let Case { delassus, u, friction, .. } = any_spatial(&mut rng, 0.1);
        let problem = ImpactProblem::new(delassus, u).unwrap();
        let path = problem.impulse_path(friction, 4.0).unwrap();
        let Some(stop) = path.slip_end.filter(|&stop| path.points[stop].impulse.z < 3.9) else { continue };
        assert_eq!(path.points[stop].velocity.xy(), Vector2::zeros());
        let slip = last(&path).velocity.xy();
        let out: Vec<_> =
            problem.invariant_directions(friction).unwrap().into_iter().filter(|way| way.slip_rate > 0.0).collect();
        if friction >= problem.mu_stick() {
            assert!(slip == Vector2::zeros() && out.is_empty(), "{slip} {out:?}");
            held += 1;
        } else {
            assert_eq!(out.len(), 1, "Bhatt and Koechling: exactly one direction of growing slip");
            let expected = Vector2::new(out[0].angle.cos(), out[0].angle.sin()) * out[0].slip_rate;
            let rate = slip / (last(&path).impulse.z - path.points[stop].impulse.z);
            close("rate", (rate - expected).norm(), 0.0, 1e-9);
            gone += 1;
        }
    }
    assert!(held > 100 && gone > 20, "{held} {gone}");
}

/// Zeros of k_φ for this H, computed independently of this crate in double precision, to the digits given.
#[test]
fn reference_invariant_directions() {
    let found = reference(vector![0.6, -0.2, -1.0]).invariant_directions(0.3).unwrap();
    assert_eq!(found.len(), 2);
    close("out", found[0].angle.to_degrees(), -45.30081, 5e-6);
    close("in", found[1].angle.to_degrees(), 151.39478, 5e-6);
    assert!(found[0].slip_rate > 0.0 && found[1].slip_rate < 0.0);
}

/// The turning rate k_φ = u⊥·(h - μ A u) changes sign on a fine circle at the invariant directions and nowhere else.
#[test]
fn invariant_directions_are_all_zeros_of_the_turning_rate() {
    let mut rng = fastrand::Rng::with_seed(65);
    let (mut counts, mut merging) = ([0; 5], 0);
    for _ in 0..3_000 {
        let Case { delassus: h, u, friction: mu, .. } = any_spatial(&mut rng, 0.1);
        let turning = |angle: f64| {
            let v = h * vector![-mu * angle.cos(), -mu * angle.sin(), 1.0];
            v.y * angle.cos() - v.x * angle.sin()
        };
        let found = ImpactProblem::new(h, u).unwrap().invariant_directions(mu).unwrap();
        let size = h.fixed_view::<2, 1>(0, 2).norm() + mu;
        for way in &found {
            close("k_φ", turning(way.angle), 0.0, 1e-13 * size);
            let rate = h * vector![-mu * way.angle.cos(), -mu * way.angle.sin(), 1.0];
            close("k_r", rate.x * way.angle.cos() + rate.y * way.angle.sin(), way.slip_rate, 1e-13 * size);
        }
        let n = 4_000;
        let at = |i: i32| turning(TAU * (f64::from(i) + 0.5) / f64::from(n));
        let changes = (0..n).filter(|&i| (at(i) > 0.0) != (at(i + 1) > 0.0)).count();
        // Two of four that nearly coincide may lie between neighbouring points of the circle.
        let nearest = found.windows(2).map(|pair| pair[1].angle - pair[0].angle).fold(TAU, f64::min);
        if nearest > 2.0 * TAU / f64::from(n) {
            assert_eq!(changes, found.len(), "{found:?} {h} {mu}");
        } else {
            merging += 1;
        }
        counts[found.len()] += 1;
    }
    assert!(merging < 10, "{merging} could not be counted");
    assert!(counts[2] > 300 && counts[4] > 300 && counts[2] + counts[4] == 3_000, "{counts:?}");
}

/// Slip never turns across an invariant direction: k_φ keeps its sign along a path.
#[test]
fn path_stays_between_invariant_directions() {
    let mut rng = fastrand::Rng::with_seed(66);
    let (mut between, mut reached, mut slowed) = (0, 0, 0);
    for _ in 0..500 {
        let Case { delassus, u, friction, .. } = any_spatial(&mut rng, 0.1);
        let problem = ImpactProblem::new(delassus, u).unwrap();
        let path = problem.impulse_path(friction, 3.0).unwrap();
        let ways = problem.invariant_directions(friction).unwrap();
        let slipping = &path.points[..path.slip_end.unwrap_or(path.points.len())];
        let n = ways.len();
        let sector = |v: &Vector3<f64>| ways.iter().filter(|way| way.angle < v.y.atan2(v.x)).count() % n;
        let near = |v: &Vector3<f64>| {
            let along = |way: f64| Vector2::new(way.cos(), way.sin()).dot(&v.xy()) > 0.0;
            let away = |way: f64| (v.y.atan2(v.x) - way).sin().abs();
            ways.iter().position(|way| along(way.angle) && away(way.angle) < 1e-9)
        };
        let slow = |v: &Vector3<f64>| v.xy().norm() < 1e-9;
        let start = sector(&u);
        for point in slipping {
            if slow(&point.velocity) {
                slowed += 1; // its direction is rounding
            } else if let Some(way) = near(&point.velocity) {
                // The slip has turned into one of the two directions next to its sector.
                assert!([(start + n - 1) % n, start % n].contains(&way), "{way} {point:?} {ways:?}");
                reached += 1;
            } else {
                assert_eq!(sector(&point.velocity), start, "{point:?} {ways:?}");
                between += 1;
            }
        }
    }
    assert!(between > 50_000 && reached > 1_000 && slowed < 50_000, "{between} {reached} {slowed}");
}

/// Closed forms of special cases: h = 0, equal mobilities, h along an axis, both sides of the astroid.
#[test]
fn invariant_directions_of_symmetric_bodies() {
    let ways = |a1: f64, a2: f64, h1: f64, h2: f64, mu: f64| {
        let delassus = matrix![a1, 0.0, h1; 0.0, a2, h2; h1, h2, 4.0];
        let problem = ImpactProblem::new(delassus, vector![1.0, 0.0, -1.0]).unwrap();
        problem.invariant_directions(mu).unwrap()
    };
    let angles = |found: Vec<carom_impact::InvariantDirection>| found.iter().map(|way| way.angle).collect::<Vec<_>>();
    assert!(ways(3.5, 3.5, 0.0, 0.0, 0.4).is_empty(), "a sphere");
    assert!(ways(3.5, 1.0, 0.0, 0.0, 0.0).is_empty(), "nothing turns slip");
    for (found, expected) in [
        (ways(3.0, 1.0, 0.0, 0.0, 0.4), vec![-FRAC_PI_2, 0.0, FRAC_PI_2, PI]),
        (ways(2.0, 2.0, 0.3, 0.0, 0.4), vec![0.0, PI]),
        (ways(3.0, 1.0, 0.0, 0.5, 0.0), vec![-FRAC_PI_2, FRAC_PI_2]),
        // sin φ = h₂/(μ (A₂ - A₁)): a plane of symmetry, and slip that turns out of it.
        (ways(1.0, 3.0, 0.0, 0.4, 0.4), vec![-FRAC_PI_2, PI / 6.0, FRAC_PI_2, PI - PI / 6.0]),
    ] {
        let mut found = angles(found);
        found.iter_mut().filter(|angle| **angle <= -PI + 1e-12).for_each(|angle| *angle += TAU);
        found.sort_by(f64::total_cmp);
        assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
        assert!(found.iter().zip(&expected).all(|(x, y)| (x - y).abs() < 1e-12), "{found:?} {expected:?}");
    }
    // h₁ = h₂ = c: the astroid is met at c = μ Δ/2^{3/2}.
    let edge = 0.5 * 2.0 / 8.0_f64.sqrt();
    assert_eq!(ways(1.0, 3.0, edge * 1.001, edge * 1.001, 0.5).len(), 2);
    assert_eq!(ways(1.0, 3.0, edge * 0.999, edge * 0.999, 0.5).len(), 4);
}

#[test]
fn path_of_a_separating_or_frictionless_contact() {
    let leaving = reference(vector![0.6, -0.2, 1.0]);
    for mu in [0.0, 0.3] {
        let path = leaving.impulse_path(mu, 0.0).unwrap();
        assert_eq!((path.points.len(), path.compression_end, path.slip_end), (1, 0, None));
        assert_eq!(path.points[0].velocity, *leaving.u_minus());
    }
    let path = reference(vector![0.6, -0.2, -1.0]).impulse_path(0.0, 1.5).unwrap();
    let impulses: Vec<f64> = path.points.iter().map(|point| point.impulse.z).collect();
    assert_eq!((impulses, path.compression_end), (vec![0.0, 1.0 / 1.2, 1.5], 1));
    // No slip before: it sticks with friction 1 and slips with friction 0.3.
    let still = reference(vector![0.0, 0.0, -1.0]);
    for (mu, mode) in [(1.0, Mode::Stick), (0.3, Mode::Slip)] {
        let hit = Energetic { restitution: 0.5, friction: mu }.resolve(&still).unwrap();
        let path = still.impulse_path(mu, hit.impulse.z).unwrap();
        assert_eq!((hit.mode, path.slip_end, path.points.len()), (mode, None, 3));
        close("u⁺", (last(&path).velocity - hit.u_plus).norm(), 0.0, 1e-14);
    }
}

#[test]
fn problems_without_a_path_are_refused() {
    let problem = reference(vector![0.6, -0.2, -1.0]);
    for bad in [f64::NAN, f64::INFINITY, -0.1] {
        assert!(
            matches!(problem.impulse_path(bad, 1.0), Err(ImpactError::Coefficient { what: "friction", .. })),
            "{bad}"
        );
        assert!(
            matches!(problem.invariant_directions(bad), Err(ImpactError::Coefficient { what: "friction", .. })),
            "{bad}"
        );
    }
    for bad in [f64::NAN, f64::INFINITY] {
        assert!(matches!(problem.impulse_path(0.3, bad), Err(ImpactError::NotFinite { .. })), "{bad}");
    }
    let frozen = ImpactProblem::new(Matrix3::from_diagonal(&vector![1.0, 1.0, 0.0]), vector![1.0, 0.0, -1.0]).unwrap();
    assert!(matches!(frozen.impulse_path(0.3, 1.0), Err(ImpactError::SingularNormal { .. })));
    // One joint, sticking while its surface moves.
    let row = vector![0.3, 0.0, 0.7];
    let wedged = ImpactProblem::new(row * row.transpose(), vector![0.5, 0.0, -0.7]).unwrap();
    assert!(matches!(wedged.impulse_path(4.0, 1.0), Err(ImpactError::Wedged { .. })));
    let huge = ImpactProblem::new(H * 1e300, vector![1e300, 0.0, -1e300]).unwrap();
    assert!(matches!(huge.impulse_path(0.3, 1e300), Err(ImpactError::NotFinite { .. })));
}
