//! Single impacts of a chain.

use carom_chain::Chain;
use carom_impact::{Brach, ChatterjeeRuina, Energetic, Frictionless, Law, Mode, Newton, Poisson, Smith, Whittaker};
use carom_sim::{ChainImpact, Impacts, JointModel};
use carom_testing::build::{Part, X, Y, Z, chain};
use carom_testing::scenes::users_law;
use nalgebra::{DVector, Vector3};

/// A uniform rod of 1 kg and 1 m that moves in the x–z plane: q = (x, z, angle about y). The frame `end` is at one end.
fn rod() -> Chain {
    let end = Part::new("end", "rod", "fixed", Z, [-0.5, 0.0, 0.0]).massless();
    let rod = Part::hinge("rod", "b", Y).weighing(1.0, [1.0 / 12.0; 3]);
    chain(&[Part::slider("a", "base", X).massless(), Part::slider("b", "a", Z).massless(), rod, end])
}

/// Painlevé's rod at 60°, whose lower end slides at 1 m/s in the direction that jams, with μ = 1.5: besides the motion without
/// impulse there is an impact without collision. With e = 0 it stops the end, by H⁻¹ (1, 0) = (7/16, 3√3/16) N s.
#[test]
fn a_jamming_rod_has_an_impact_without_collision_beside_its_sliding() {
    let chain = rod();
    let (q, qd) = ([0.2, 0.5, -60_f64.to_radians()], [-1.0, 0.0, 0.0]);
    let strike = || chain.impact(&q, &qd).at(chain.frame("end").unwrap()).normal([0.0, 0.0, 1.0]);
    let law = Poisson { restitution: 0.0, friction: 1.5 };
    let all = strike().contact().unwrap().branches(&law).unwrap();
    assert_eq!(all.len(), 2);
    let first = strike().resolve(&law).unwrap();
    assert_eq!((&all[0].qd_plus, all[0].impulse, all[0].mode), (&first.qd_plus, first.impulse, first.mode));
    assert_eq!((all[0].impulse, all[0].mode), (Vector3::zeros(), Mode::Open));
    assert_eq!(all[0].qd_plus, qd);
    let exact = Vector3::new(7.0 / 16.0, 0.0, 3.0 * 3.0_f64.sqrt() / 16.0);
    // Numbers of size one, through the inverse of H with the condition number 5.
    assert!((all[1].impulse - exact).amax() < 1e-14 && all[1].u_plus.amax() < 1e-14, "{:?}", all[1]);
    // M q̇⁺ = M q̇⁻ + Jᵀp with M = diag(1, 1, 1/12) and the lever from the centre to the end.
    let lever = Vector3::new(-0.25, 0.0, -0.25 * 3.0_f64.sqrt());
    let after = [exact.x - 1.0, exact.z, 12.0 * lever.cross(&exact).y];
    let off = DVector::from_column_slice(&all[1].qd_plus) - DVector::from_column_slice(&after);
    assert!(off.amax() < 1e-13, "{:?} against {after:?}", all[1].qd_plus);
    let of_contact = strike().contact().unwrap().branches(&law).unwrap();
    assert_eq!(of_contact.len(), 2);
    assert_eq!(of_contact[1].qd_plus, all[1].qd_plus);
}

#[test]
fn a_point_that_is_not_finite_is_named() {
    let chain = rod();
    let (q, qd) = ([0.2, 0.5, -1.0], [-1.0, 0.0, 0.0]);
    let strike = || chain.impact(&q, &qd).at(chain.frame("end").unwrap()).normal([0.0, 0.0, 1.0]);
    for (point, message) in [
        ([f64::NAN, 0.0, 0.0], "point[0] is NaN: every number must be finite"),
        ([0.0, 0.0, f64::INFINITY], "point[2] is inf: every number must be finite"),
    ] {
        assert_eq!(strike().offset(point).contact().err().map(|e| e.to_string()).as_deref(), Some(message));
    }
}

/// Several laws and joint models at changing states: the same results as by `chain.impact`, and no allocation after the first.
#[test]
fn prepared_strike_equals_a_single_one_and_does_not_allocate() {
    let laws: [&dyn Law<f64, 3>; 3] = [
        &Frictionless { restitution: 0.5 },
        &Energetic { restitution: 0.5, friction: 0.3 },
        &Poisson { restitution: 0.2, friction: 0.8 },
    ];
    for robot in ["planar2", "planar3", "arm7", "humanoid29"] {
        let chain = Chain::from_urdf_file(format!("{}/../../robots/{robot}.urdf", env!("CARGO_MANIFEST_DIR"))).unwrap();
        let tip = chain.frame("tip").unwrap();
        let state = |k: usize| -> (Vec<f64>, Vec<f64>) {
            let draw = |a: f64| (0..chain.nv()).map(|i| (a * (i + 1) as f64 + k as f64).sin()).collect();
            (draw(0.7), draw(1.3))
        };
        let states: Vec<_> = (0..6).map(state).collect();
        let stiffness = vec![200.0; chain.nv()];
        let held = JointModel::Impedance { stiffness: &stiffness, damping: &stiffness, contact_time: 0.01 };
        for joints in [JointModel::Free, held] {
            let describe =
                |q, qd| chain.impact(q, qd).at(tip).offset([0.01, 0.0, 0.02]).normal([-1.0, 0.2, 0.1]).joints(joints);
            let mut prepared = describe(&[], &[]).prepare().unwrap();
            let mut hit = prepared.outcome();
            for (k, (q, qd)) in states.iter().enumerate() {
                for law in laws {
                    let count = allocation_counter::measure(|| prepared.resolve_into(q, qd, law, &mut hit).unwrap());
                    assert!(k == 0 || count.count_total == 0, "{robot}: {count:?}");
                    let single = describe(q, qd).resolve(law).unwrap();
                    let by_contact = describe(q, qd).contact().unwrap().resolve(law).unwrap();
                    assert_eq!((&hit.qd_plus, hit.mode), (&single.qd_plus, single.mode));
                    // ½ p·(u⁻ + u⁺) and the work of the drives are the change of T, from M and q̇ alone.
                    let work = 0.5 * hit.impulse.dot(&(hit.u_minus + hit.u_plus)) + hit.drive_work;
                    let scale = hit.energy_before.max(hit.energy_after).max(1e-3);
                    assert!((hit.energy_after - hit.energy_before - work).abs() < 1e-11 * scale, "{robot} {work}");
                    assert!((by_contact.energy_after - hit.energy_after).abs() < 1e-13 * scale);
                }
            }
        }
    }
}

/// A planar chain struck in its plane is computed in the plane; the contact of the same strike is computed in space. Both are
/// equal for every law, also for one that is not known to the library.
#[test]
fn impacts_of_planar_chains_in_their_plane_equal_those_in_space() {
    let mut rng = fastrand::Rng::with_seed(16);
    let (mut resolved, mut slipped) = (0, 0);
    for case in 0..60 {
        let chain = planar_robot(&mut rng);
        let flat = chain.in_plane().expect("a planar chain");
        let tip = chain.frame("tip").unwrap();
        let turn = rng.f64() * std::f64::consts::TAU;
        let normal = flat.plane.x * turn.cos() + flat.plane.y * turn.sin();
        let mut draw = |scale: f64| (0..chain.nv()).map(|_| scale * (rng.f64() - 0.5)).collect::<Vec<f64>>();
        let damping = draw(1.0).iter().map(|x| x.abs()).collect::<Vec<_>>();
        let held = JointModel::Impedance { stiffness: &damping, damping: &damping, contact_time: 0.01 };
        let (q, mut qd) = (draw(6.0), draw(4.0));
        let offset = [0.1, rng.f64(), -0.2];
        let (restitution, friction) = (rng.f64(), 1.5 * rng.f64());
        let user = users_law("users", |problem| Energetic { restitution, friction }.resolve(problem));
        let laws: [&dyn Law<f64, 3>; 9] = [
            &Frictionless { restitution },
            &Whittaker { restitution, friction },
            &Newton { restitution, friction },
            &Poisson { restitution, friction },
            &Energetic { restitution, friction },
            &ChatterjeeRuina { restitution, tangential_restitution: 0.3, friction },
            &Brach { restitution, impulse_ratio: -friction },
            &Smith { restitution, friction },
            &user,
        ];
        let before = chain.impact(&q, &qd).at(tip).offset(offset).normal(normal).contact().unwrap();
        let leaves = before.problem().u_minus().z > 0.0;
        if leaves {
            qd.iter_mut().for_each(|x| *x = -*x);
        }
        let locked = [chain.joints().iter().find(|j| chain.joint_of_velocity(0) == Some(j)).unwrap().name.as_str()];
        for joints in [JointModel::Free, held, JointModel::Locked(&locked)] {
            // One free joint alone has a singular H, where Smith's iteration has no definite end.
            if chain.nv() == 2 && joints == JointModel::Locked(&locked) {
                continue;
            }
            let describe = |qd| {
                let strike = chain.impact(&q, qd).at(tip).offset(offset).normal(normal);
                strike.joints(joints)
            };
            let mut contact = describe(&qd).contact().unwrap();
            for law in laws {
                let name = law.name();
                let there = contact.resolve(law);
                let here = describe(&qd).resolve(law);
                let (Ok(here), Ok(there)) = (&here, &there) else {
                    assert_eq!(here.is_err(), there.is_err(), "{name}: {here:?} {there:?}");
                    continue;
                };
                resolved += 1;
                slipped += usize::from(here.mode == Mode::Slip || here.mode == Mode::ReverseSlip);
                assert_eq!(
                    (here.mode, here.flags, here.contact.slip_end),
                    (there.mode, there.flags, there.contact.slip_end)
                );
                // Numbers of their own size: both routes have rounding errors of 1e-16 times the condition number of M.
                let near = |a: &[f64], b: &[f64], what: &str| {
                    let size = b.iter().fold(1e-3_f64, |m, x| m.max(x.abs()));
                    let off = a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
                    assert!(off <= 1e-12 * size, "case {case} {name} {what}: {a:?} {b:?}");
                };
                let (c, d) = (&here.contact, &there.contact);
                near(&here.qd_plus, &there.qd_plus, "qd_plus");
                // That of a locked joint is a difference of terms of the size of the impulse.
                let with = |hit: &ChainImpact| [&hit.drive_impulse[..], &[hit.impulse.norm()]].concat();
                near(&with(here), &with(there), "drive_impulse");
                for (a, b) in [
                    (here.impulse, there.impulse),
                    (here.u_minus, there.u_minus),
                    (here.u_plus, there.u_plus),
                    (c.impulse, d.impulse),
                    (c.u_minus, d.u_minus),
                    (c.u_plus, d.u_plus),
                ] {
                    near(a.as_slice(), b.as_slice(), "vector");
                }
                near(&[here.energy_before, here.energy_after], &[there.energy_before, there.energy_after], "energy");
                near(
                    &[c.energy_before, c.energy_after, c.energy_change],
                    &[d.energy_before, d.energy_after, d.energy_change],
                    "T",
                );
                near(
                    &[c.normal_work, c.friction_work, here.drive_work],
                    &[d.normal_work, d.friction_work, there.drive_work],
                    "work",
                );
                for (a, b) in [
                    (c.newton, d.newton),
                    (c.poisson, d.poisson),
                    (c.energetic, d.energetic),
                    (c.slip_stop, d.slip_stop),
                ] {
                    assert_eq!(a.is_some(), b.is_some());
                    near(&[a.unwrap_or(0.0)], &[b.unwrap_or(0.0)], "coefficient");
                }
            }
        }
    }
    assert!(resolved > 1000 && slipped > 300, "{resolved} {slipped}");
}

/// A random row of two to six hinges and sliders in a plane of random direction.
fn planar_robot(rng: &mut fastrand::Rng) -> Chain {
    let mut draw = |low: f64, high: f64| low + (high - low) * rng.f64();
    let (roll, pitch) = (draw(-1.0, 1.0), draw(-1.0, 1.0));
    let joints = draw(2.0, 6.99) as usize;
    let turned = Part::new("turned", "base", "fixed", Z, [0.3, -0.2, 0.5]).turned([roll, pitch, 0.0]).massless();
    let mut parts = vec![turned];
    let mut parent = "turned".to_owned();
    for k in 0..joints {
        let child = if k + 1 == joints { "tip".to_owned() } else { format!("link{k}") };
        let slides = k > 0 && draw(0.0, 1.0) < 0.25;
        let (kind, axis) =
            if slides { ("prismatic", X) } else { ("continuous", if k % 2 == 0 { Y } else { [0.0, -1.0, 0.0] }) };
        let [x, y, z, angle, mass, i] =
            [draw(0.2, 1.0), draw(-0.2, 0.2), draw(-0.5, 0.5), draw(-1.0, 1.0), draw(0.2, 3.0), draw(0.01, 0.2)];
        let [a, b, c] = [draw(-0.3, 0.3), draw(-0.1, 0.1), draw(-0.3, 0.3)];
        let part = Part::new(&child, &parent, kind, axis, [x, y, z]).turned([0.0, angle, 0.0]).com([a, b, c]);
        parts.push(part.weighing(mass, [i; 3]));
        parent = child;
    }
    chain(&parts)
}
