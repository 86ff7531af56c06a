//! Impacts at several points at the same moment, against a dense projection and the conditions of the law.

use carom_chain::{Chain, Coordinates, FramePoint};
use carom_impact::{Flags, Frictionless};
use carom_sim::{Grip, Impacts, JointModel, SeveralImpact, SeveralLaw, SimError, StruckPoint};
use carom_testing::build::{Part, chain};
use carom_testing::files::robot_with;
use nalgebra::{DMatrix, DVector, Vector3};

/// The quadruped of the repository on a floating base: 18 velocities.
fn quadruped() -> Chain {
    robot_with("quadruped", true)
}

/// A configuration that is not symmetric, with the body turned, and a motion downwards.
fn state(chain: &Chain, seed: f64) -> (Vec<f64>, Vec<f64>) {
    let wave = |k: usize| (seed + 1.7 * k as f64).sin();
    let mut q: Vec<f64> = (0..chain.nq()).map(|k| 0.4 * wave(k)).collect();
    let turn = nalgebra::UnitQuaternion::from_euler_angles(0.1 * seed, -0.2, 0.3);
    q[3..7].copy_from_slice(turn.coords.as_slice());
    let mut qd: Vec<f64> = (0..chain.nv()).map(|k| wave(k + 40)).collect();
    qd[2] -= 3.0;
    (q, qd)
}

/// Points of a link.
fn points(chain: &Chain, frame: &str, offsets: &[[f64; 3]], grip: Grip) -> Vec<StruckPoint> {
    let frame = chain.frame(frame).unwrap();
    let normal = Vector3::new(0.1, -0.2, 1.5);
    let at = |offset: &[f64; 3]| StruckPoint {
        point: FramePoint::new(frame, *offset),
        normal,
        grip,
        relative_stiffness: 1.0,
    };
    offsets.iter().map(at).collect()
}

/// M, and the rows of the world Jacobians of the points.
fn dense(chain: &Chain, q: &[f64], points: &[StruckPoint]) -> (DMatrix<f64>, DMatrix<f64>) {
    let mut workspace = chain.workspace();
    let mut at = workspace.update(chain, q).unwrap();
    let m = at.mass_matrix();
    let mut rows = DMatrix::zeros(3 * points.len(), chain.nv());
    for (k, point) in points.iter().enumerate() {
        let jacobian = at.point_jacobian(chain.point(point.point.frame, point.point.offset));
        rows.view_mut((3 * k, 0), (3, chain.nv())).copy_from(&jacobian);
    }
    (m, rows)
}

/// −L⁻ᵀ (J L⁻ᵀ)⁺ u with M = L Lᵀ: the jump that stops the points, whose velocities are u. The singular values are the roots of those
/// of H; those below 1e-7 of the largest are the redundant rows.
fn jump(m: &DMatrix<f64>, rows: &DMatrix<f64>, u: &DVector<f64>) -> DVector<f64> {
    let l = m.clone().cholesky().unwrap().l();
    let thin = l.solve_lower_triangular(&rows.transpose()).unwrap().transpose();
    let bound = 1e-7 * thin.norm();
    -l.tr_solve_lower_triangular(&(thin.pseudo_inverse(bound).unwrap() * u)).unwrap()
}

fn close(what: &str, found: &[f64], expected: &[f64], tolerance: f64) {
    let size = expected.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
    let off = found.iter().zip(expected).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    assert!(off <= tolerance * size, "{what}: {off:e} of {size}");
}

/// One point, a toe line (5 of 6 rows are independent), a face (6 of 9) and two feet, all sticking: the impact is the projection of
/// q̇ onto the motions that leave the points at rest, and loses ½ Δq̇ᵀ M Δq̇ (Carnot). Tolerance: rounding times the condition
/// number of H, up to 2e5 for two feet.
#[test]
fn points_that_stick_project_the_velocity_and_lose_the_energy_of_the_jump() {
    let chain = quadruped();
    let corners = [[0.1, 0.05, -0.02], [0.1, -0.05, -0.02], [-0.1, 0.05, -0.02], [-0.1, -0.05, -0.02]];
    let feet: Vec<String> = chain.links().iter().map(|l| l.name.clone()).filter(|name| name.contains("foot")).collect();
    let mut cases: Vec<Vec<StruckPoint>> =
        [1, 2, 3, 4].iter().map(|n| points(&chain, &feet[0], &corners[..*n], Grip::Sticks)).collect();
    cases.push(feet.iter().take(2).flat_map(|foot| points(&chain, foot, &corners[..2], Grip::Sticks)).collect());
    for (k, case) in cases.iter().enumerate() {
        let (q, qd) = state(&chain, k as f64);
        let (m, rows) = dense(&chain, &q, case);
        let rates = DVector::from_column_slice(&qd);
        let jump = jump(&m, &rows, &(&rows * &rates));
        let expected = &rates + &jump;
        for law in SeveralLaw::ALL.into_iter().take(2) {
            let hit = chain.impact_at_points(&q, &qd, case, JointModel::Free, law).unwrap();
            assert!(hit.residual < 1e-10, "{k}: {}", hit.residual);
            close("q̇⁺", &hit.qd_plus, expected.as_slice(), 1e-10);
            let lost = 0.5 * jump.dot(&(&m * &jump));
            close("loss", &[hit.energy_before - hit.energy_after], &[lost], 1e-10);
            close("balance", momentum(&rows, &hit).as_slice(), (&m * &jump).as_slice(), 1e-10);
            assert!(hit.u_plus.iter().all(|u| u.amax() < 1e-9) && hit.u_minus.len() == case.len());
        }
    }
}

/// Σ Jᵢᵀ pᵢ.
fn momentum(rows: &DMatrix<f64>, hit: &SeveralImpact) -> DVector<f64> {
    let impulses = hit.impulses.iter().flat_map(|p| p.iter().copied());
    rows.tr_mul(&DVector::from_iterator(3 * hit.impulses.len(), impulses))
}

/// Contacts with friction: momentum, Coulomb's cone, friction against the slip, Newton's restitution where there is an impulse,
/// and at least it where there is none.
#[test]
fn several_contacts_satisfy_the_law_at_every_point() {
    let chain = quadruped();
    let (restitution, friction) = (0.3, 0.6);
    let grip = Grip::Contact { restitution, friction };
    let feet: Vec<String> = chain.links().iter().map(|l| l.name.clone()).filter(|name| name.contains("foot")).collect();
    let mut slipping = 0;
    for seed in 0..12 {
        let case: Vec<StruckPoint> =
            feet.iter().take(3).flat_map(|foot| points(&chain, foot, &[[0.0, 0.0, -0.02]], grip)).collect();
        let (q, qd) = state(&chain, f64::from(seed));
        let (m, rows) = dense(&chain, &q, &case);
        let hit = chain.impact_at_points(&q, &qd, &case, JointModel::Free, SeveralLaw::Moreau).unwrap();
        assert!(hit.residual < 1e-10);
        let jump = DVector::from_column_slice(&hit.qd_plus) - DVector::from_column_slice(&qd);
        close("balance", momentum(&rows, &hit).as_slice(), (&m * jump).as_slice(), 1e-10);
        let normal = case[0].normal.normalize();
        for k in 0..case.len() {
            let (p, before, after) = (hit.impulses[k], hit.u_minus[k], hit.u_plus[k]);
            let pressed = p.dot(&normal);
            let (tangential, slip) = (p - normal * pressed, after - normal * after.dot(&normal));
            let target = -restitution * before.dot(&normal).min(0.0);
            assert!(pressed >= 0.0 && after.dot(&normal) >= target - 1e-9);
            assert!(pressed * (after.dot(&normal) - target).abs() < 1e-9);
            assert!(tangential.norm() <= friction * pressed + 1e-9);
            if slip.norm() > 1e-6 && pressed > 0.0 {
                slipping += 1;
                assert!((tangential + slip.normalize() * friction * pressed).norm() < 1e-8);
            }
        }
    }
    assert!(slipping > 5, "{slipping} points slip");
}

/// One frictionless point is a single impact; locked joints keep their velocities, and the rest moves as if M had no rows of them.
#[test]
fn one_point_is_a_single_impact_and_locked_joints_keep_their_velocity() {
    let chain = quadruped();
    let foot = chain.links().iter().find(|l| l.name.contains("foot")).unwrap().name.clone();
    let (q, qd) = state(&chain, 2.0);
    let one = points(&chain, &foot, &[[0.0, 0.01, -0.02]], Grip::Contact { restitution: 0.4, friction: 0.0 });
    let hit = chain.impact_at_points(&q, &qd, &one, JointModel::Free, SeveralLaw::Moreau).unwrap();
    let strike = chain.impact(&q, &qd).at(one[0].point).normal(one[0].normal);
    let single = strike.resolve(&Frictionless { restitution: 0.4 }).unwrap();
    close("q̇⁺", &hit.qd_plus, &single.qd_plus, 1e-12);
    close("p", hit.impulses[0].as_slice(), single.impulse.as_slice(), 1e-12);
    close("T", &[hit.energy_before, hit.energy_after], &[single.energy_before, single.energy_after], 1e-12);

    let names = ["fl_pitch", "fl_knee"].map(|part| {
        let joint = chain.joints().iter().find(|j| j.name.contains(part) && j.coordinates != Coordinates::None);
        joint.unwrap_or_else(|| panic!("no joint {part}")).name.as_str()
    });
    let held: Vec<usize> = names
        .iter()
        .map(|name| match &chain.joint(name).unwrap().coordinates {
            Coordinates::Own { v, .. } => v.start,
            other => panic!("{other:?}"),
        })
        .collect();
    let line = points(&chain, &foot, &[[0.0, 0.05, -0.02], [0.0, -0.05, -0.02]], Grip::Sticks);
    let hit = chain.impact_at_points(&q, &qd, &line, JointModel::Locked(&names), SeveralLaw::Moreau).unwrap();
    let (m, rows) = dense(&chain, &q, &line);
    // u⁻ contains the motion of the locked joints, which stays.
    let free: Vec<usize> = (0..chain.nv()).filter(|k| !held.contains(k)).collect();
    let (m, part) = (m.select_rows(&free).select_columns(&free), rows.select_columns(&free));
    let jump = jump(&m, &part, &(&rows * DVector::from_column_slice(&qd)));
    let mut expected = qd.clone();
    free.iter().zip(jump.iter()).for_each(|(k, jump)| expected[*k] += jump);
    close("locked q̇⁺", &hit.qd_plus, &expected, 1e-10);
    assert!(held.iter().all(|k| hit.qd_plus[*k] == qd[*k]));
}

#[test]
fn wrong_points_are_refused_with_the_reason() {
    let chain = quadruped();
    let (q, qd) = state(&chain, 0.0);
    let refused = |points: &[StruckPoint]| {
        let error = chain.impact_at_points(&q, &qd, points, JointModel::Free, SeveralLaw::Moreau).unwrap_err();
        let source = std::error::Error::source(&error).map_or(String::new(), |why| format!(": {why}"));
        format!("{error}{source}")
    };
    let foot = chain.links().iter().find(|l| l.name.contains("foot")).unwrap().name.clone();
    let good = points(&chain, &foot, &[[0.0; 3]], Grip::Sticks)[0];
    assert!(refused(&[]).contains("StruckPoint"), "{}", refused(&[]));
    let flat = StruckPoint { normal: Vector3::zeros(), ..good };
    assert!(refused(&[good, flat]).contains("length"), "{}", refused(&[good, flat]));
    let hot = StruckPoint { grip: Grip::Contact { restitution: 2.0, friction: 0.1 }, ..good };
    assert!(refused(&[hot]).contains("restitution 2 is outside"), "{}", refused(&[hot]));
}

/// Under the energetic law two struck points share the impulse by their stiffnesses: only the ratio counts, points may be listed in any
/// order with theirs, and another ratio is another impact. Tolerance: that of the law's integration.
#[test]
fn struck_points_share_the_energetic_impulse_by_the_ratio_of_their_stiffnesses() {
    let chain = quadruped();
    let (q, qd) = state(&chain, 0.4);
    let grip = Grip::Contact { restitution: 0.6, friction: 0.0 };
    let two = points(&chain, "trunk", &[[0.2, 0.1, -0.1], [-0.2, -0.1, -0.1]], grip);
    let after = |stiffnesses: [f64; 2], swapped: bool| {
        let mut struck: Vec<StruckPoint> = two.clone();
        struck.iter_mut().zip(stiffnesses).for_each(|(point, ratio)| point.relative_stiffness = ratio);
        if swapped {
            struck.reverse();
        }
        let law = SeveralLaw::Energetic { exponent: 1.5 };
        chain.impact_at_points(&q, &qd, &struck, JointModel::Free, law).unwrap().qd_plus
    };
    let uneven = after([10.0, 1.0], false);
    close("scale", &after([25.0, 2.5], false), &uneven, 1e-9);
    close("order", &after([10.0, 1.0], true), &uneven, 1e-9);
    let even = after([1.0, 1.0], false);
    let off = even.iter().zip(&uneven).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    assert!(off > 1e-3, "{off}");
}

/// A row of five hinges, turned at random.
fn five_hinges(rng: &mut fastrand::Rng) -> Chain {
    let mut unit = || 2.0 * rng.f64() - 1.0;
    let mut three = |aside: f64| [unit() * 0.3, unit() * 0.3 + aside, unit() * 0.3];
    let parts = (0..5_usize).map(|k| {
        let parent = k.checked_sub(1).map_or("base".into(), |p| format!("l{p}"));
        let (com, place, turned, axis) = (three(0.0), three(0.0), three(2.0), three(0.0));
        let part = Part::new(&format!("l{k}"), &parent, "continuous", axis, place).turned(turned).com(com);
        part.weighing(1.0, [0.02, 0.03, 0.04])
    });
    chain(&parts.collect::<Vec<_>>())
}

/// Rough points of a chain that approach a corner together: the law holds to 1e-9 with the coefficients of restitution given, or it
/// holds without restitution, which is said, or there is an error; never velocities of another order of magnitude. `no-approach`
/// means that no point approaches.
#[test]
fn points_that_wedge_are_resolved_without_restitution_or_refused() {
    let mut rng = fastrand::Rng::with_seed(11);
    let (mut plain, mut inelastic, mut refused, mut open) = (0, 0, 0, 0);
    for _ in 0..160 {
        let chain = five_hinges(&mut rng);
        let q: Vec<f64> = (0..5).map(|_| rng.f64()).collect();
        let qd: Vec<f64> = (0..5).map(|_| 2.0 * rng.f64() - 1.0).collect();
        let (restitution, friction) = (rng.f64(), 5.0 * rng.f64());
        let parts = rng.usize(0..8) == 0;
        let mut struck = Vec::new();
        for _ in 0..2 + rng.usize(0..3) {
            let frame = chain.frame(&format!("l{}", rng.usize(2..5))).unwrap();
            let offset = Vector3::from_fn(|_, _| rng.f64() - 0.5);
            let mut workspace = chain.workspace();
            let kin = workspace.update(&chain, &q).unwrap();
            let velocity = kin.point_velocity(chain.point(frame, offset), &qd).unwrap();
            // Most normals are against the velocity of their point; of some cases all are along it.
            let mut normal = Vector3::from_fn(|_, _| rng.f64() - 0.5);
            if (parts || rng.usize(0..8) > 0) && (normal.dot(&velocity) > 0.0) != parts {
                normal = -normal;
            }
            let grip = Grip::Contact { restitution, friction };
            struck.push(StruckPoint { point: FramePoint::new(frame, offset), normal, grip, relative_stiffness: 1.0 });
        }
        for law in [SeveralLaw::Moreau, SeveralLaw::Sequential, SeveralLaw::Poisson] {
            let hit = match chain.impact_at_points(&q, &qd, &struck, JointModel::Free, law) {
                Err(SimError::Together { residuals, .. }) => {
                    assert!(residuals.iter().all(|residual| *residual > 1e-9), "{residuals:?}");
                    refused += 1;
                    continue;
                }
                other => other.unwrap(),
            };
            assert!(hit.residual <= 1e-9, "{law:?} {hit:?}");
            let inelastically = hit.flags.contains(Flags::WITHOUT_RESTITUTION);
            if inelastically {
                inelastic += 1
            } else {
                plain += 1
            }
            let speed = hit.u_minus.iter().fold(0.0_f64, |most, u| most.max(u.norm()));
            let mut approaches = false;
            for (point, (before, (after, impulse))) in
                struck.iter().zip(hit.u_minus.iter().zip(hit.u_plus.iter().zip(&hit.impulses)))
            {
                let n = point.normal.normalize();
                assert!(after.dot(&n) >= -1e-8 * speed, "{law:?} {hit:?}");
                assert!(impulse.dot(&n) >= 0.0 && after.norm() < 1e5 * speed, "{law:?} {hit:?}");
                approaches |= before.dot(&n) < -1e-9 * speed;
            }
            assert_eq!(hit.flags.contains(Flags::NO_APPROACH), !approaches, "{law:?} {hit:?}");
            open += usize::from(!approaches);
            if inelastically && law != SeveralLaw::Poisson {
                assert!(hit.energy_after <= hit.energy_before * (1.0 + 1e-8), "{law:?} {hit:?}");
            }
        }
    }
    println!("{plain} by the law, {inelastic} without restitution, {refused} refused, {open} without approach");
    assert!(plain > 300 && inelastic > 20 && open > 20 && refused < 10, "{plain} {inelastic} {refused} {open}");
}
