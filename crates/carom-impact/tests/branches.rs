//! Problems with more than one solution, or where the outcome is discontinuous: the branches, and the limits that lead
//! to them.

use crate::common::{FOLLOWING, any_case, any_spatial, close, rough};
use carom_impact::{Flags, ImpactOutcome, ImpactProblem, LAW_NAMES, Law, Mode, Whittaker, law_by_name};
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3, vector};
use num_dual::Dual64;

fn branches<const D: usize>(
    law: &str,
    h: SMatrix<f64, D, D>,
    u: SVector<f64, D>,
    e: f64,
    mu: f64,
) -> Vec<ImpactOutcome<f64, D>> {
    let (law, problem) = (law_by_name(law, rough(e, mu)).unwrap(), ImpactProblem::new(h, u).unwrap());
    let all = law.branches(&problem).unwrap();
    assert_eq!(all[0], law.resolve(&problem).unwrap(), "the first is the outcome of the law");
    let flagged = |hit: &ImpactOutcome<f64, D>| hit.flags.contains(Flags::NON_UNIQUE);
    assert!(all.iter().all(|hit| flagged(hit) == (all.len() > 1)), "flagged where there are several, {all:?}");
    all
}

/// The rod of `falling_rod.rs` at 60°, m = L = 1, its lower end sliding in the direction that jams: A = 13/4, B =
/// -3√3/4, C = 7/4, det H = 4.
fn rod() -> Matrix2<f64> {
    let b = -0.75 * 3.0_f64.sqrt();
    Matrix2::new(3.25, b, b, 1.75)
}

/// Impact without collision (Painlevé): friction 1.5 at u = (-1, 0). Closed forms from the impulse that stops the end,
/// `P = H⁻¹ (1, 0) = (7/16, 3√3/16)`, and what each law adds to it in restitution.
#[test]
fn painleve_s_rod_has_two_solutions() {
    let (e, mu, held) = (0.5, 1.5, 4.0 / 3.25);
    let stop = vector![7.0 / 16.0, 3.0 * 3.0_f64.sqrt() / 16.0];
    let (b, c) = (rod()[(0, 1)], rod()[(1, 1)]);
    for law in LAW_NAMES {
        let all = branches(law, rod(), vector![-1.0, 0.0], e, mu);
        assert_eq!((all[0].impulse, all[0].u_plus, all[0].mode), (Vector2::zeros(), all[0].u_minus, Mode::Open));
        if law == "frictionless" {
            assert_eq!((all.len(), all[0].flags), (1, Flags::NO_APPROACH));
            continue;
        }
        assert_eq!(all.len(), 2, "{law}");
        assert_eq!(all[0].flags, Flags::NO_APPROACH | Flags::JAM | Flags::NON_UNIQUE);
        assert_eq!(all[1].flags, Flags::JAM | Flags::GRAZING | Flags::NON_UNIQUE, "{law}");
        assert_eq!(all[1].newton, None, "{law}: without approach there is no ratio");
        let restored = match law {
            "poisson" => e * stop[1],
            "energetic" => {
                // Slip stops at p1, where v_n is v1; then the contact sticks, and v_n rises. e² of that work is
                // returned.
                let p1 = 1.0 / (b + mu * rod()[(0, 0)]);
                let v1 = (c + mu * b) * p1;
                let work = 0.5 * v1 * p1 - 0.5 * v1 * v1 / held;
                e * (-2.0 * work / held).sqrt()
            }
            _ => 0.0,
        };
        let mut expected = stop + vector![-b / 3.25, 1.0] * restored;
        let mut u_plus = vector![0.0, held * restored];
        if law == "smith" {
            // C = μ w |B| fixes the mean slip w, which 1 - z² = w (1 + z²) turns into the slip left, reversed.
            let w = c / (mu * b.abs());
            let z = ((1.0 - w) / (1.0 + w)).sqrt();
            let p_n = (1.0 + z) * b.abs() / 4.0;
            (expected, u_plus) = (vector![mu * w * p_n, p_n], vector![z, 0.0]);
        }
        close(law, (all[1].impulse - expected).norm(), 0.0, 1e-14);
        close(law, (all[1].u_plus - u_plus).norm(), 0.0, 1e-14);
        assert_eq!(all[1].mode, if law == "smith" { Mode::ReverseSlip } else { Mode::Stick }, "{law}");
        assert!(all[1].energy_change < 0.0);

        // The outcome is discontinuous on one side only.
        let towards = branches(law, rod(), vector![-1.0, -1e-10], e, mu);
        close(law, (towards[0].impulse - expected).norm(), 0.0, 1e-8);
        let apart = branches(law, rod(), vector![-1.0, 1e-10], e, mu);
        assert_eq!((towards.len(), apart.len(), apart[0].flags), (1, 1, Flags::NO_APPROACH), "{law}");
        assert_eq!(towards[0].flags, Flags::JAM | Flags::GRAZING, "{law}");
        assert!(law != "energetic" || towards[0].mode == Mode::Stick, "{:?}", towards[0]);
        close(law, (apart[0].u_plus - all[0].u_plus).norm(), 0.0, 1e-10);
    }
}

/// At `μ s B = C` v_n stays at 0 while slip lasts: the limit is the end of the slip.
#[test]
fn the_threshold_of_the_jam_counts_as_jam() {
    let h = Matrix2::new(2.0, 1.0, 1.0, 1.0);
    for law in LAW_NAMES.into_iter().filter(|&law| law != "frictionless") {
        let all = branches(law, h, vector![1.0, 0.0], 0.0, 1.0);
        let limit = branches(law, h, vector![1.0, -1e-9], 0.0, 1.0);
        assert!(all[0].flags.contains(Flags::JAM), "{law}");
        if law == "smith" {
            // w = 1 for any slip forwards: a range of solutions from zero on, of which the limit is the other end.
            continue;
        }
        assert_eq!(all.len(), 2, "{law}");
        close(law, (all[1].impulse - vector![-1.0, 1.0]).norm(), 0.0, 1e-15);
        close(law, (limit[0].impulse - all[1].impulse).norm(), 0.0, 1e-4);
    }
}

/// A contact sliding in the plane has two solutions if and only if it jams, under every law; the second is the limit of
/// the outcome as the approach velocity tends to 0.
#[test]
fn in_the_plane_the_limit_is_the_last_branch() {
    let mut rng = fastrand::Rng::with_seed(71);
    let (mut jammed, mut free, mut skipped) = (0, 0, 0);
    for _ in 0..4_000 {
        let case = any_case(&mut rng, 0.2);
        let (h, s) = (case.delassus, if rng.bool() { 1.0 } else { -1.0 });
        let excess = case.friction * s * h[(0, 1)] / h[(1, 1)];
        if (excess - 1.0).abs() < 0.02 {
            skipped += 1;
            continue; // near the threshold the limit needs a slower approach
        }
        for law in LAW_NAMES {
            let jams = excess > 1.0 && law != "frictionless";
            let all = branches(law, h, vector![s, 0.0], case.restitution, case.friction);
            assert_eq!((all.len(), all[0].flags.contains(Flags::JAM)), (1 + usize::from(jams), jams), "{law} {case:?}");
            // Less friction, the other direction, or separation: an ordinary contact that does not approach.
            let apart = branches(law, h, vector![s, 0.1], case.restitution, case.friction);
            assert!(jams || all[0].flags == Flags::NO_APPROACH, "{law} {case:?}");
            assert_eq!((apart.len(), apart[0].flags), (1, Flags::NO_APPROACH), "{law} {case:?}");
            let near = branches(law, h, vector![s, -1e-10], case.restitution, case.friction);
            let last = all.last().unwrap();
            // A share 1e-10/0.02 of the impulse, times the square of the condition (25).
            let within = 1e-5 * (1.0 + last.impulse.norm());
            close(law, (near[0].impulse - last.impulse).norm(), 0.0, within);
            close(law, (near[0].u_plus - last.u_plus).norm(), 0.0, within);
            (jammed, free) = (jammed + usize::from(jams), free + usize::from(!jams));
        }
    }
    assert!(jammed > 1_500 && free > 10_000 && skipped < 50, "{jammed} {free} {skipped}");
}

/// Conditions that every branch must satisfy, for any law.
fn assert_lawful<const D: usize>(law: &str, h: &SMatrix<f64, D, D>, mu: f64, hit: &ImpactOutcome<f64, D>) {
    let n = D - 1;
    let (p_n, p_t) = (hit.impulse[n], hit.impulse.rows(0, n).norm());
    let size = hit.impulse.norm();
    assert!(p_n >= 0.0 && hit.u_plus[n] >= 0.0, "{law} {hit:?}");
    assert!(p_t <= mu * p_n + 1e-11 * (1.0 + mu) * size, "{law} {mu} {hit:?}");
    let off = (hit.u_minus + h * hit.impulse - hit.u_plus).norm();
    close(law, off, 0.0, 1e-11 * (1.0 + size) * (1.0 + mu).min(10.0));
    close(law, hit.normal_work + hit.friction_work, hit.energy_change, 1e-11 * (1.0 + size));
    let gains = hit.flags.contains(Flags::ENERGY_GAIN);
    assert!(!gains || ["newton", "whittaker"].contains(&law), "{law} {hit:?}");
}

/// Slip that turns and jams: the laws that follow it have two solutions exactly then, and the second is the limit of
/// the outcome.
#[test]
fn in_space_the_limit_is_among_the_branches() {
    let mut rng = fastrand::Rng::with_seed(72);
    let mut jammed = [0; LAW_NAMES.len()];
    let (mut turned, mut skipped) = (0, 0);
    for _ in 0..3_000 {
        let case = any_spatial(&mut rng, 0.2);
        let (h, mu) = (case.delassus, case.friction);
        let slip = case.u.xy().normalize();
        let u = vector![slip.x, slip.y, 0.0];
        let drive = h.fixed_view::<2, 1>(0, 2).dot(&slip);
        let excess = mu * drive / h[(2, 2)];
        if (excess - 1.0).abs() < 0.02 {
            skipped += 1;
            continue;
        }
        for (law, jammed) in LAW_NAMES.into_iter().zip(&mut jammed) {
            let all = branches(law, h, u, case.restitution, mu);
            for hit in &all {
                assert_lawful(law, &h, mu, hit);
            }
            *jammed += usize::from(all.len() > 1);
            if FOLLOWING.contains(&law) {
                assert_eq!(all.len(), 1 + usize::from(excess > 1.0), "{law} {case:?}");
                assert!(all.iter().all(|hit| hit.flags.contains(Flags::JAM) == (excess > 1.0)));
                let end = all[all.len() - 1].u_plus.xy();
                turned += usize::from(all.len() > 1 && end.perp(&slip).abs() > 1e-3);
            }
            let near = branches(law, h, u - vector![0.0, 0.0, 1e-10], case.restitution, mu);
            let off = |hit: &ImpactOutcome<f64, 3>| (near[0].impulse - hit.impulse).norm() / (1.0 + hit.impulse.norm());
            let best = all.iter().map(off).fold(f64::INFINITY, f64::min);
            assert!(best < 1e-5, "{law} {best:e} {case:?}\n{near:?}\n{all:?}");
        }
    }
    assert!(skipped < 30, "{skipped} near the threshold");
    assert!(jammed[0] == 0 && jammed[1..].iter().all(|&n| n > 150) && turned > 30, "{jammed:?} {turned}");
}

/// Newton's coefficient and Coulomb's cone on the total impulse.
fn obeys_whittaker(e: f64, mu: f64, hit: &ImpactOutcome<f64, 3>) {
    let (p_t, p_n, slip) = (hit.impulse.xy(), hit.impulse.z, hit.u_plus.xy());
    let size = p_t.norm() + mu * p_n;
    let within = if hit.u_minus.z < 0.0 { 1e-13 } else { 1e-11 };
    close("rebound", hit.u_plus.z, -e * hit.u_minus.z, 0.0);
    if hit.mode == Mode::Stick {
        assert!(slip.norm() == 0.0 && p_t.norm() <= mu * p_n);
    } else if hit.mode != Mode::Open {
        close("cone", p_t.norm(), mu * p_n, within * size);
        close("against the slip", (p_t * slip.norm() + slip * p_t.norm()).norm(), 0.0, within * size * slip.norm());
    }
}

/// Whittaker's law in space: as many branches as a scan over the slips finds, each a solution, and all different.
#[test]
fn whittaker_s_branches_are_all_solutions_of_a_scan() {
    let mut rng = fastrand::Rng::with_seed(73);
    let (mut counts, mut smooth) = ([[0; 4]; 2], 0);
    for i in 0..30_000 {
        let case = any_spatial(&mut rng, 0.05);
        let sliding = i % 2 == 1;
        let (h, mu, e) = (case.delassus, case.friction, case.restitution);
        let u = if sliding { vector![case.u.x, case.u.y, 0.0] } else { case.u };
        if mu == 0.0 {
            smooth += 1;
            continue;
        }
        let all = branches("whittaker", h, u, e, mu);
        for (i, hit) in all.iter().enumerate() {
            obeys_whittaker(e, mu, hit);
            assert_lawful("whittaker", &h, mu, hit);
            assert!(all[..i].iter().all(|other| (other.impulse - hit.impulse).norm() > 1e-9 * hit.impulse.norm()));
        }

        // Signs of the excess |P_t| - μ P_n over the slips -s P_t, from stick to nearly none.
        let k = h.fixed_view::<2, 1>(0, 2).into_owned() / h[(2, 2)];
        let s = h.fixed_view::<2, 2>(0, 0).into_owned() - k * k.transpose() * h[(2, 2)];
        let gain = -(1.0 + e) * u.z;
        let b = u.xy() + k * gain;
        let excess = |t: f64| {
            let m = s + Matrix2::identity() * t;
            let x = vector![m[(0, 1)] * b.y - m[(1, 1)] * b.x, m[(0, 1)] * b.x - m[(0, 0)] * b.y] / m.determinant();
            x.norm() - mu * (gain / h[(2, 2)] - k.dot(&x))
        };
        let (mut scanned, mut last) = (usize::from(sliding) + usize::from(excess(0.0) <= 0.0), excess(0.0));
        for i in 0..600 {
            let now = excess(10.0_f64.powf(-8.0 + 0.025 * i as f64));
            scanned += usize::from((now > 0.0) != (last > 0.0));
            last = now;
        }
        assert_eq!(all.len(), scanned, "{case:?}");
        counts[usize::from(sliding)][all.len() - 1] += 1;
        // The zero impulse of a sliding contact is a solution too, and there is an odd number of others if it jams.
        let jams = sliding && all[0].flags.contains(Flags::JAM);
        assert_eq!(all.len() % 2 == 0, jams, "{case:?}\n{all:?}");
    }
    assert!(smooth < 4_500, "one draw in eight: {smooth}");
    assert!(counts[0][2] > 2 && counts[1][1] > 500 && counts[1][2] + counts[1][3] > 10, "{counts:?}");
}

/// An approaching contact has one solution, except under Whittaker's law in space; a frictionless contact always has
/// one.
#[test]
fn approaching_contacts_have_one_branch() {
    let mut rng = fastrand::Rng::with_seed(74);
    for i in 0..3_000 {
        let (flat, case) = (any_case(&mut rng, 0.1), any_spatial(&mut rng, 0.1));
        for law in LAW_NAMES {
            let all = branches(law, flat.delassus, flat.u, flat.restitution, flat.friction);
            assert_eq!(all.len(), 1, "{law} {flat:?}");
            let all = branches(law, case.delassus, case.u, case.restitution, case.friction);
            assert!(all.len() == 1 || law == "whittaker", "{law} {case:?}");
            let still = if i % 2 == 0 { 0.0 } else { rng.f64() };
            for height in [0.0, still, -case.u.z] {
                let u = vector![case.u.x, case.u.y, height];
                let smooth = branches(law, case.delassus, u, case.restitution, 0.0);
                assert_eq!((smooth.len(), smooth[0].flags), (1, Flags::NO_APPROACH), "{law}");
            }
        }
    }
}

/// A single joint sticking at a wall: under Whittaker's law with e = 0 a range of impulses stops it, and its ends are
/// the branches.
#[test]
fn a_range_of_impulses_is_given_by_its_ends() {
    let j = vector![0.3, 0.7];
    let (h, u, mu) = (j * j.transpose(), -j, 1.0);
    let all = branches("whittaker", h, u, 0.0, mu);
    assert_eq!(all.len(), 2);
    for (hit, side) in all.iter().zip([1.0, -1.0]) {
        close("edge of the cone", hit.impulse[0], side * mu * hit.impulse[1], 1e-14);
        close("stopped", hit.u_plus.norm(), 0.0, 1e-14);
        close("j·P", j.dot(&hit.impulse), 1.0, 1e-14);
    }
}

/// A singular normal direction, and a contact that wedges, have no second solution.
#[test]
fn refused_second_solution_is_not_a_branch() {
    let frozen = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0));
    let j = vector![0.3, 0.7];
    for law in LAW_NAMES {
        let all = branches(law, frozen, vector![1.0, 0.0, 0.0], 0.5, 3.0);
        assert_eq!((all.len(), all[0].flags), (1, Flags::NO_APPROACH), "{law}");
        // Sliding along the null direction of a single joint: it would stick before v_n is back at 0, and wedge.
        let all = branches(law, j * j.transpose(), vector![1.0, 0.0], 0.5, 3.0);
        let flags = Flags::NO_APPROACH | if law == "frictionless" { Flags::NONE } else { Flags::JAM };
        assert_eq!((all.len(), all[0].flags), (1, flags), "{law}");
        assert_eq!((all[0].impulse, all[0].u_plus), (Vector2::zeros(), vector![1.0, 0.0]), "{law}");
    }
}

/// Each branch of Whittaker's law in space is a smooth function of the friction, and dual numbers give its derivative.
#[test]
fn derivative_of_each_branch_agrees_with_central_differences() {
    let mut rng = fastrand::Rng::with_seed(75);
    let mut compared = 0;
    for _ in 0..6_000 {
        let case = any_spatial(&mut rng, 0.2);
        let (h, u, mu) = (case.delassus, vector![case.u.x, case.u.y, 0.0], case.friction);
        let [behind, here, ahead] =
            [mu - 1e-6, mu, mu + 1e-6].map(|mu| branches("whittaker", h, u, case.restitution, mu.max(0.0)));
        if here.len() < 2 || behind.len() != here.len() || ahead.len() != here.len() {
            continue;
        }
        let dual = ImpactProblem::new(h.map(Dual64::from_re), u.map(Dual64::from_re)).unwrap();
        let law = Whittaker { restitution: case.restitution.into(), friction: Dual64::new(mu, 1.0) };
        let all = law.branches(&dual).unwrap();
        assert_eq!(all.len(), here.len());
        for (k, hit) in all.iter().enumerate() {
            let size = 1.0 + here[k].impulse.norm();
            close("value", (hit.impulse.map(|x| x.re) - here[k].impulse).norm(), 0.0, 1e-11 * size);
            let (forward, backward) = (ahead[k].impulse - here[k].impulse, here[k].impulse - behind[k].impulse);
            if (forward - backward).norm() > 1e-8 * size {
                continue; // a change from stick to slip, or a large curvature
            }
            let difference = (forward + backward) / 2e-6;
            let off = (hit.impulse.map(|x| x.eps) - difference).norm() / (size + difference.norm());
            assert!(off < 1e-4, "{off:e} {case:?}");
            compared += usize::from(k > 0 && hit.mode != Mode::Stick);
        }
    }
    assert!(compared > 50, "{compared}");
}
