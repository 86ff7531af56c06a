//! Slip that turns in space: reference digits, invariances, and properties that every law must have.

use crate::common::{Spatial, any_spatial, close, rough};
use carom_impact::{
    Energetic, Flags, ImpactError, ImpactOutcome, ImpactProblem, LAW_NAMES, Law, Mode, Newton, Phase, Poisson,
    Whittaker, law_by_name,
};
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Rotation3, Vector2, Vector3, matrix, vector};
use num_dual::Dual64;

const H: Matrix3<f64> = matrix![2.0, 0.3, 0.5; 0.3, 1.5, -0.4; 0.5, -0.4, 1.2];

const FOLLOWING: [&str; 3] = ["newton", "poisson", "energetic"];

fn resolve(law: &str, case: &Spatial) -> ImpactOutcome<f64, 3> {
    law_by_name(law, rough(case.restitution, case.friction)).unwrap().resolve(&case.problem()).unwrap()
}

fn reference(u: Vector3<f64>) -> Spatial {
    Spatial { delassus: H, u, restitution: 0.6, friction: 0.3 }
}

#[test]
fn reference_digits() {
    let case = reference(vector![0.6, -0.2, -1.0]);
    close("mu_stick", case.problem().mu_stick(), 0.44267251, 5e-9);
    let newton = resolve("newton", &case);
    close("newton", (newton.u_plus - vector![0.6731374581, -0.5702621474, 0.6]).amax(), 0.0, 1e-10);
    close("P", (newton.impulse - vector![-0.3977242309, 0.2551286539, 1.5840946475]).amax(), 0.0, 1e-10);
    close("T+/T-", newton.energy_ratio(), 0.3045713979, 1e-10);
    let poisson = resolve("poisson", &case);
    close("poisson", (poisson.u_plus - vector![0.6729391004, -0.5699106031, 0.5980073074]).amax(), 0.0, 1e-10);
    close("pc", poisson.impulse[2] / 1.6, 0.988823584, 5e-10);
    let energetic = resolve("energetic", &case);
    close("energetic", (energetic.u_plus - vector![0.6729867884, -0.569995154, 0.59848651]).amax(), 0.0, 1e-9);
    close("P_n", energetic.impulse[2], 1.5825931423, 1e-10);
    // With e = 0 Poisson's law ends at the end of compression.
    let plastic = resolve("poisson", &Spatial { restitution: 0.0, ..case });
    close("at pc", (plastic.u_plus - vector![0.621485216, -0.457081188, 0.0]).amax(), 0.0, 5e-10);
    for hit in [newton, poisson, energetic] {
        assert_eq!((hit.mode, hit.slip_end, hit.flags), (Mode::Slip, None, Flags::NONE));
    }
}

/// Along an invariant direction slip is straight. Slip along the direction of decreasing slip stops, and continues
/// along the direction of growing slip.
#[test]
fn slip_along_an_invariant_direction_stays_on_it() {
    for law in FOLLOWING {
        let out = (-45.30081_f64).to_radians();
        let hit = resolve(law, &reference(vector![out.cos(), out.sin(), -1.0]));
        close(law, hit.u_plus.y.atan2(hit.u_plus.x), out, 1e-7);
        let inwards = 151.39478_f64.to_radians();
        let slow = resolve(law, &reference(vector![0.01 * inwards.cos(), 0.01 * inwards.sin(), -1.0]));
        close(law, slow.u_plus.y.atan2(slow.u_plus.x), out, 1e-5);
        let fast = resolve(law, &reference(vector![9.0 * inwards.cos(), 9.0 * inwards.sin(), -1.0]));
        close(law, fast.u_plus.y.atan2(fast.u_plus.x), inwards, 1e-7);
        // No slip before: exactly along the direction of growing slip.
        let hit = resolve(law, &reference(vector![0.0, 0.0, -1.0]));
        close(law, hit.u_plus.y.atan2(hit.u_plus.x), out, 1e-7);
        assert_eq!((hit.mode, hit.slip_end), (Mode::Slip, None));
    }
}

#[test]
fn rotating_the_tangents_rotates_the_outcome() {
    let mut rng = fastrand::Rng::with_seed(41);
    for _ in 0..2_000 {
        let case = any_spatial(&mut rng, 0.1);
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::TAU * rng.f64());
        let delassus = turn * case.delassus * turn.inverse();
        let turned = Spatial { delassus: (delassus + delassus.transpose()) * 0.5, u: turn * case.u, ..case };
        for law in LAW_NAMES {
            let (one, other) = (resolve(law, &case), resolve(law, &turned));
            // Rounding of H, amplified by its condition number and by the fast turning of slow slip.
            let off = (turn * one.u_plus - other.u_plus).norm() / one.u_plus.norm().max(1.0);
            assert!(off < 1e-10, "{law} {off:e} {case:?}");
            close(law, one.energy_change, other.energy_change, 1e-10 * one.impulse.norm().max(1.0));
        }
    }
}

#[test]
fn doubling_speeds_or_masses_scales_every_number() {
    let mut rng = fastrand::Rng::with_seed(42);
    for i in 0..1_000 {
        let case = any_spatial(&mut rng, 0.1);
        let (faster, lighter) = (2.0_f64.powi(i % 60 - 40), 2.0_f64.powi(20 - i % 37));
        let scaled = Spatial { delassus: case.delassus * lighter, u: case.u * faster, ..case };
        for law in LAW_NAMES {
            let (one, other) = (resolve(law, &case), resolve(law, &scaled));
            let size = 1e-11 * one.u_plus.norm().max(1.0);
            close(law, (one.u_plus - other.u_plus / faster).norm(), 0.0, size);
            close(law, (one.impulse - other.impulse * (lighter / faster)).norm(), 0.0, 1e-11 * one.impulse.norm());
            assert_eq!((one.mode, one.slip_end, one.flags), (other.mode, other.slip_end, other.flags), "{law}");
        }
    }
}

/// 10 000 random impacts: properties of all laws, and which laws gain energy.
#[test]
fn general_properties_in_10_000_random_impacts() {
    let mut rng = fastrand::Rng::with_seed(43);
    let (mut gains, mut jams, mut faster) = ([0; LAW_NAMES.len()], 0, 0);
    let mut ends = [0; 4];
    for _ in 0..10_000 {
        let case = any_spatial(&mut rng, 0.05);
        for (law, gains) in LAW_NAMES.into_iter().zip(&mut gains) {
            let hit = resolve(law, &case);
            let (p_t, p_n) = (hit.impulse.xy().norm(), hit.impulse.z);
            assert!(p_n > 0.0 && hit.u_plus.z >= 0.0, "{law} {case:?} {hit:?}");
            let slack = 64.0 * 400.0 * f64::EPSILON * (1.0 + case.friction) * p_n;
            assert!(p_t <= case.friction * p_n + slack, "{law} {case:?} {hit:?}");
            let off = (hit.u_minus + case.delassus * hit.impulse - hit.u_plus).amax();
            assert!(
                off <= 1e-13 * (1.0 + case.friction).min(10.0) * (1.0 + hit.impulse.amax()),
                "{law} {off:e} {case:?}"
            );
            let passed = hit.energy_before + 0.5 * hit.impulse.abs().dot(&(hit.u_minus.abs() + hit.u_plus.abs()));
            close(law, hit.normal_work + hit.friction_work, hit.energy_change, 1e-12 * passed);
            close(law, hit.energy_after - hit.energy_before, hit.energy_change, 1e-11 * passed);
            let gained = hit.energy_change > 64.0 * f64::EPSILON * passed;
            assert_eq!(hit.flags.contains(Flags::ENERGY_GAIN), gained, "{law} {case:?}");
            *gains += usize::from(gained);
            if FOLLOWING.contains(&law) {
                assert!(hit.friction_work <= 0.0, "{law} {case:?}");
                jams += usize::from(hit.flags.contains(Flags::JAM));
                ends[match (hit.slip_end, hit.mode) {
                    (None, _) => 0,
                    (Some(Phase::Compression), Mode::Stick) => 1,
                    (Some(Phase::Restitution), Mode::Stick) => 2,
                    _ => 3,
                }] += 1;
            }
        }
        let e = case.restitution;
        close("newton", resolve("newton", &case).newton.unwrap(), e, 1e-13);
        close("poisson", resolve("poisson", &case).poisson.unwrap(), e, 1e-13);
        close("energetic", resolve("energetic", &case).energetic.unwrap(), e, 1e-12);
        faster += usize::from(e < 1.0 && resolve("energetic", &case).newton.unwrap() > 1.0);
    }
    println!("gains {gains:?} jams {jams} ends {ends:?} faster {faster}");
    for (law, gains) in LAW_NAMES.into_iter().zip(gains) {
        assert_eq!(gains > 0, ["whittaker", "newton"].contains(&law), "{law} gained {gains} times");
    }
    assert!(jams > 100 && ends.iter().all(|&n| n > 100), "{jams} {ends:?}");
}

/// A contact without inertial coupling (`H_tn = 0`) stops where its slip would cross zero.
#[test]
fn sphere_and_ellipsoid_have_their_closed_forms() {
    let sphere = Matrix3::from_diagonal(&vector![3.5, 3.5, 1.0]);
    for law in ["newton", "poisson", "energetic", "whittaker", "chatterjee-ruina", "smith"] {
        for direction in [vector![1.0, 0.0], vector![0.6, -0.8]] {
            let u = vector![direction.x, direction.y, -1.0];
            let hit = resolve(law, &Spatial { delassus: sphere, u, restitution: 0.8, friction: 0.1 });
            close(law, (hit.u_plus - vector![0.37 * direction.x, 0.37 * direction.y, 0.8]).norm(), 0.0, 1e-15);
        }
    }
    // An ellipsoid struck on its axis: balanced, but the tangents differ, and slip turns towards the lighter one.
    let delassus = Matrix3::from_diagonal(&vector![4.0, 2.0, 1.0]);
    for law in FOLLOWING {
        let hit = resolve(law, &Spatial { delassus, u: vector![1.0, 1.0, -1.0], restitution: 0.5, friction: 0.1 });
        // dv_x/dv_y = 2 v_x/v_y along the flow: v_x/v_y² does not change.
        close(law, hit.u_plus.x, hit.u_plus.y * hit.u_plus.y, 1e-15);
        close(law, hit.u_plus.z, 0.5, 1e-15);
        let stuck = resolve(law, &Spatial { delassus, u: vector![1.0, 1.0, -1.0], restitution: 0.5, friction: 2.0 });
        assert_eq!((stuck.u_plus.x, stuck.u_plus.y, stuck.mode), (0.0, 0.0, Mode::Stick));
        close(law, (stuck.impulse - vector![-0.25, -0.5, 1.5]).norm(), 0.0, 1e-14);
    }
}

/// Friction beyond `C/|h·u|` jams, whether slip starts in such a direction or turns into it.
#[test]
fn jam_in_space_is_flagged() {
    let delassus = matrix![2.4, 0.1, 1.5; 0.1, 1.9, 0.2; 1.5, 0.2, 1.0];
    for (u, jams) in [
        (vector![0.3, 0.05, -0.13], true),
        (vector![0.05, 0.5, -0.13], true),
        (vector![-0.01, 0.9, -0.5], true),
        (vector![-3.0, 0.1, -0.1], false),
    ] {
        for law in FOLLOWING {
            let hit = resolve(law, &Spatial { delassus, u, restitution: 0.5, friction: 0.9 });
            assert!(hit.u_plus.z > 0.0 && hit.friction_work < 0.0);
            assert!(hit.energy_change < 0.0 || law == "newton", "{law} {u:?} {hit:?}");
            assert_eq!(hit.flags.contains(Flags::JAM), jams, "{law} {u:?} {hit:?}");
        }
    }
}

/// Slip stops in compression or in restitution, and then sticks or leaves in another direction: the velocity is
/// continuous in the friction across the change from one to the other.
#[test]
fn velocity_is_continuous_in_friction_across_a_stop() {
    for law in FOLLOWING {
        let at = |friction: f64| {
            resolve(law, &Spatial { friction, restitution: 0.6, delassus: H, u: vector![0.1, 0.15, -1.0] })
        };
        let mut last = at(0.0);
        let mut modes = vec![];
        for i in 1..4000 {
            let hit = at(i as f64 * 5e-4);
            assert!((hit.u_plus - last.u_plus).norm() < 5e-3, "{law} {i} {hit:?} {last:?}");
            if modes.last() != Some(&(hit.mode, hit.slip_end)) {
                modes.push((hit.mode, hit.slip_end));
            }
            last = hit;
        }
        assert!(modes.len() >= 3, "{law}: {modes:?}");
        assert_eq!(modes.last(), Some(&(Mode::Stick, Some(Phase::Compression))));
    }
}

/// A planar arm in space with slip across its plane: this slip does not change, so the total slip never stops, and
/// turns until the arm sticks in its plane.
#[test]
fn planar_arm_keeps_the_slip_across_its_plane() {
    let arm = matrix![0.8, 0.3; 0.0, 0.0; -0.2, 0.9];
    let h = arm * arm.transpose();
    for law in LAW_NAMES {
        for friction in [0.1, 0.6, 3.0] {
            for across in [0.0, 1e-9, 0.5] {
                let u = arm * vector![-0.4, -1.1] + vector![0.0, across, 0.0];
                let hit = resolve(law, &Spatial { delassus: h, u, restitution: 0.5, friction });
                assert!((hit.u_plus.y - across).abs() < 1e-15 && hit.u_plus.z > 0.0, "{law} {hit:?}");
                assert!(hit.energy_change < 0.0 || ["newton", "whittaker"].contains(&law), "{law} {hit:?}");
            }
        }
    }
}

/// Two joints in space whose null direction of H has components along all axes: every law has an outcome within its
/// guarantees or refuses with `Wedged`.
///
/// Only Whittaker's law refuses, and only where friction jams (`μ |H_tn| >= H_nn`), which leaves the cone unbounded:
/// the prescribed rebound then may need an infinite impulse. A scan of the slip directions finds no solution in these
/// cases either, except where it finds a pair of solutions that the search for one root misses (18 of 502 refusals).
#[test]
fn rank_deficient_matrices_are_answered_or_refused_as_wedged() {
    let mut rng = fastrand::Rng::with_seed(44);
    let (mut refusals, mut jams, mut missed) = ([0; LAW_NAMES.len()], 0, 0);
    for _ in 0..2_000 {
        let j = nalgebra::Matrix3x2::from_fn(|_, _| 2.0 * rng.f64() - 1.0);
        let mut qd = vector![rng.f64() - 0.5, rng.f64() - 0.5];
        if (j * qd).z > 0.0 {
            qd = -qd;
        }
        let u = j * qd;
        let case = Spatial { delassus: j * j.transpose(), u, restitution: rng.f64(), friction: 2.0 * rng.f64() };
        let unbounded = case.friction * case.delassus.fixed_view::<2, 1>(0, 2).norm() >= case.delassus[(2, 2)];
        jams += usize::from(unbounded);
        for (law, refused) in LAW_NAMES.into_iter().zip(&mut refusals) {
            match law_by_name(law, rough(case.restitution, case.friction)).unwrap().resolve(&case.problem()) {
                Ok(hit) => {
                    assert!(hit.u_plus.iter().chain(hit.impulse.iter()).all(|x| x.is_finite()), "{law} {case:?}");
                    assert!(hit.u_plus.z >= 0.0 && hit.impulse.z > 0.0, "{law} {case:?} {hit:?}");
                    let gain = hit.flags.contains(Flags::ENERGY_GAIN);
                    assert!(!gain || ["newton", "whittaker"].contains(&law), "{law} {case:?} {hit:?}");
                    if law == "whittaker" {
                        // With e > 0 the contact cannot stick: friction of size μ P_n against the slip.
                        let (p_t, slip) = (hit.impulse.xy(), hit.u_plus.xy());
                        let most = case.friction * hit.impulse.z;
                        let off = (p_t * slip.norm() + slip * most).norm();
                        close("against the slip", off, 0.0, 1e-9 * most * slip.norm());
                    }
                }
                Err(why) => {
                    assert!(law == "whittaker" && unbounded, "{law} {why} {case:?}");
                    assert!(matches!(why, ImpactError::Wedged { .. }), "{why} {case:?}");
                    missed += usize::from(whittaker_slip_exists(&j, &qd, case.restitution, case.friction));
                    *refused += 1;
                }
            }
        }
    }
    println!("refusals {refusals:?} of {jams} that jam, {missed} of them with a solution in the scan");
    // Measured: 502 of 856 that jam, 18 with a solution.
    let whittaker = LAW_NAMES.iter().position(|&law| law == "whittaker").unwrap();
    assert!((400..600).contains(&refusals[whittaker]) && missed <= 25, "{refusals:?} {missed}");
}

/// Whether some slip direction satisfies Whittaker's law for `H = J Jᵀ` of rank 2 and e > 0, where the contact cannot
/// stick: friction `-μ P_n d` leaves a slip along d. Scans the circle.
fn whittaker_slip_exists(j: &Matrix3x2<f64>, qd: &Vector2<f64>, e: f64, mu: f64) -> bool {
    let n = 10_000;
    let end = |i: i32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(n)).sin_cos();
        let push = j.transpose() * vector![-mu * cos, -mu * sin, 1.0];
        let rate = (j * push).z;
        let after = j * (qd - push * ((1.0 + e) * (j * qd).z / rate));
        (rate > 0.0).then_some((cos * after.y - sin * after.x, cos * after.x + sin * after.y))
    };
    (0..n).any(|i| match (end(i), end(i + 1)) {
        (Some((across, along)), Some((next, next_along))) => across * next <= 0.0 && along > 0.0 && next_along > 0.0,
        _ => false,
    })
}

/// Dual numbers through the power series give the derivative of the outcome.
#[test]
fn dual_numbers_give_the_derivative_of_the_flow() {
    let mut rng = fastrand::Rng::with_seed(45);
    let mut checked = 0;
    for _ in 0..500 {
        let mut case = any_spatial(&mut rng, 0.3);
        case.restitution = case.restitution.clamp(0.05, 0.95);
        case.friction = case.friction.clamp(0.05, 2.0);
        let tangents = Matrix2::from_fn(|_, _| rng.f64() - 0.5);
        let dh = Matrix3::from_fn(|i, j| if i < 2 && j < 2 { tangents[(i.min(j), i.max(j))] } else { 0.1 });
        let du = vector![rng.f64() - 0.5, rng.f64() - 0.5, 0.0];
        let moved = |x: f64| Spatial {
            delassus: case.delassus + dh * x,
            u: case.u + du * x,
            restitution: case.restitution + 0.3 * x,
            friction: case.friction + 0.7 * x,
        };
        let dual = Matrix3::from_fn(|i, j| Dual64::new(case.delassus[(i, j)], dh[(i, j)]));
        let u = Vector3::from_fn(|i, _| Dual64::new(case.u[i], du[i]));
        let problem = ImpactProblem::new(dual, u).unwrap();
        let (restitution, friction) = (Dual64::new(case.restitution, 0.3), Dual64::new(case.friction, 0.7));
        let duals = [
            Newton { restitution, friction }.resolve(&problem).unwrap(),
            Poisson { restitution, friction }.resolve(&problem).unwrap(),
            Energetic { restitution, friction }.resolve(&problem).unwrap(),
            Whittaker { restitution, friction }.resolve(&problem).unwrap(),
        ];
        for (dual, law) in duals.iter().zip(["newton", "poisson", "energetic", "whittaker"]) {
            let (here, ahead, behind) = (resolve(law, &case), resolve(law, &moved(1e-6)), resolve(law, &moved(-1e-6)));
            close(law, (dual.u_plus.map(|x| x.re) - here.u_plus).norm(), 0.0, 1e-11 * here.u_plus.norm().max(1.0));
            let (forward, backward) = (ahead.u_plus - here.u_plus, here.u_plus - behind.u_plus);
            if (forward - backward).norm() > 1e-9 {
                continue; // a boundary between two classes, or a large curvature
            }
            let difference = (forward + backward) / 2e-6;
            let off = (dual.u_plus.map(|x| x.eps) - difference).norm() / difference.norm().max(1.0);
            assert!(off < 1e-4, "{law} {off:e} {case:?}");
            checked += 1;
        }
    }
    assert!(checked > 1_200, "{checked}");
}

#[test]
fn single_precision_agrees_with_double() {
    let mut rng = fastrand::Rng::with_seed(46);
    let mut worse = 0;
    for _ in 0..1_000 {
        let case = any_spatial(&mut rng, 0.3);
        let problem = ImpactProblem::new(case.delassus.map(|x| x as f32), case.u.map(|x| x as f32)).unwrap();
        let law = Energetic { restitution: case.restitution as f32, friction: case.friction as f32 };
        let off = (law.resolve(&problem).unwrap().u_plus.map(f64::from) - resolve("energetic", &case).u_plus).norm();
        assert!(off < 1e-2, "{off} {case:?}");
        worse += usize::from(off > 1e-5);
    }
    assert!(worse < 40, "{worse}");
}

/// Whittaker's law in space: slip opposed to the friction, or stick within the cone. If there is more than one
/// solution, which a scan of the slips finds as well, the outcome is flagged.
#[test]
fn whittaker_s_outcome_in_space_satisfies_the_law() {
    let mut rng = fastrand::Rng::with_seed(47);
    let (mut several, mut smooth) = (0, 0);
    for _ in 0..20_000 {
        let case = any_spatial(&mut rng, 0.05);
        if case.friction == 0.0 {
            smooth += 1;
            continue;
        }
        let (h, mu) = (case.delassus, case.friction);
        let hit = resolve("whittaker", &case);
        let (p_t, p_n, slip) = (hit.impulse.xy(), hit.impulse.z, hit.u_plus.xy());
        let size = p_t.norm() + mu * p_n;
        if hit.mode == Mode::Stick {
            assert!(p_t.norm() <= mu * p_n);
        } else {
            assert!((p_t.norm() - mu * p_n).abs() < 1e-13 * size && p_t.dot(&slip) < 0.0, "{case:?}");
            assert!(p_t.perp(&slip).abs() < 1e-14 * size * slip.norm());
        }
        close("u+", (case.u + h * hit.impulse - hit.u_plus).norm(), 0.0, 1e-12 * hit.impulse.norm().max(1.0));

        // Signs of the excess |P_t| - μ P_n over the slips -s P_t.
        let k = h.fixed_view::<2, 1>(0, 2).into_owned() / h[(2, 2)];
        let s = h.fixed_view::<2, 2>(0, 0).into_owned() - k * k.transpose() * h[(2, 2)];
        let gain = -(1.0 + case.restitution) * case.u.z;
        let b = case.u.xy() + k * gain;
        let excess = |t: f64| {
            let m = s + Matrix2::identity() * t;
            let x = vector![m[(0, 1)] * b.y - m[(1, 1)] * b.x, m[(0, 1)] * b.x - m[(0, 0)] * b.y] / m.determinant();
            x.norm() - mu * (gain / h[(2, 2)] - k.dot(&x))
        };
        let mut answers = usize::from(excess(0.0) <= 0.0);
        let mut last = excess(0.0);
        for i in 0..600 {
            let now = excess(10.0_f64.powf(-8.0 + 0.025 * i as f64));
            answers += usize::from((now > 0.0) != (last > 0.0));
            last = now;
        }
        // The scan may miss a close pair.
        let flagged = hit.flags.contains(Flags::NON_UNIQUE);
        assert!(flagged || answers <= 1, "{answers} {case:?}");
        several += usize::from(flagged);
        if flagged && answers > 1 {
            assert_eq!(hit.mode == Mode::Stick, excess(0.0) <= 0.0);
        }
    }
    // One draw in eight has no friction; about 1 in 1000 of the others has three solutions.
    assert!((5..40).contains(&several) && smooth < 3_000, "{several} {smooth}");
}

/// Numbers near the ends of the range: a finite outcome, or a refusal because a number overflows on the way
/// (`NotFinite`) or an inverse mass along the normal is lost in rounding (`Wedged`). An impulse that loses its digits, because it
/// underflows or friction is 1e308, is refused by the check of outcomes (`Outcome`). Without friction nothing overflows. With
/// a friction of 1e308 the rates of slip overflow, and an impulse may round to 0.
#[test]
fn numbers_near_overflow_are_answered_or_refused() {
    let (mut refusals, mut vanished, mut lost) = ([0; LAW_NAMES.len()], 0, 0);
    for friction in [1e-300, 1e150, 1e308] {
        for (lighter, faster) in
            [(1.0, 1.0), (1e-150, 1.0), (1e150, 1e-3), (1.0, 1e-150), (1e-100, 1e100), (1e300, 1e-10)]
        {
            for (u, restitution) in [(vector![0.6, -0.2, -1.0], 0.5), (vector![1e-12, 0.3, -1.0], 1.0)] {
                let problem = ImpactProblem::new(H * lighter, u * faster).unwrap();
                for (law, refused) in LAW_NAMES.into_iter().zip(&mut refusals) {
                    match law_by_name(law, rough(restitution, friction)).unwrap().resolve(&problem) {
                        Ok(hit) => {
                            let finite = hit.impulse.iter().chain(hit.u_plus.iter()).all(|x| x.is_finite());
                            assert!(finite, "{law} {friction} {lighter} {faster} {hit:?}");
                            assert!(hit.impulse.z > 0.0 || friction == 1e308, "{law} {lighter} {faster} {hit:?}");
                            vanished += usize::from(hit.impulse.z == 0.0);
                        }
                        Err(ImpactError::NotFinite { .. } | ImpactError::Wedged { .. }) => *refused += 1,
                        Err(ImpactError::Outcome { .. }) if lighter == 1e300 || friction == 1e308 => lost += 1,
                        Err(why) => panic!("{law} {friction} {lighter} {faster}: {why}"),
                    }
                }
            }
        }
    }
    println!("refusals {refusals:?} of 36 each, {vanished} impulses round to 0, {lost} lose their digits");
    assert!(refusals[0] == 0 && refusals.iter().all(|&n| n <= 14) && lost <= 9, "{refusals:?} {lost}");
}

/// Not proved for Poisson's law in space.
#[test]
fn poisson_never_gains_energy_in_200_000_impacts_in_space() {
    let mut rng = fastrand::Rng::with_seed(48);
    let (mut stopped, mut jammed) = (0, 0);
    for _ in 0..200_000 {
        let case = any_spatial(&mut rng, 0.05);
        let hit = resolve("poisson", &case);
        assert!(!hit.flags.contains(Flags::ENERGY_GAIN), "{case:?} {hit:?}");
        stopped += usize::from(hit.slip_end.is_some());
        jammed += usize::from(hit.flags.contains(Flags::JAM));
    }
    println!("{stopped} {jammed}");
    // The cases in which energy could be gained occur: slip stops, friction jams.
    assert!(stopped > 20_000 && jammed > 2_000, "{stopped} {jammed}");
}

/// Smith's iteration converges, and its outcome satisfies the law: `P_t = -μ P_n w`, with w as the law defines it.
#[test]
fn smith_answers_100_000_impacts_in_space() {
    smith_answers(49, 100_000, 0.05);
}

/// The same where H has condition numbers up to 40 000, and Newton's method from the usual starts stalls more often.
#[test]
fn smith_answers_60_000_nearly_singular_impacts_in_space() {
    smith_answers(7, 60_000, 0.005);
}

fn smith_answers(seed: u64, count: usize, flat: f64) {
    let mut rng = fastrand::Rng::with_seed(seed);
    for _ in 0..count {
        let case = any_spatial(&mut rng, flat);
        let hit = resolve("smith", &case);
        assert!(!hit.flags.contains(Flags::ENERGY_GAIN), "{case:?} {hit:?}");
        let (v, y) = (case.u.xy(), hit.u_plus.xy());
        let w = (v * v.norm() + y * y.norm()) / (v.norm_squared() + y.norm_squared());
        let off = (hit.impulse.xy() + w * (case.friction * hit.impulse.z)).norm();
        let rounding = 1e-13 / v.norm() + 1e-12;
        assert!(off <= rounding * (1.0 + case.friction) * (1.0 + hit.impulse.norm()), "{off:e} {case:?}");
    }
}
