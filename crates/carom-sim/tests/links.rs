//! Contacts between two links of a chain.

use carom_chain::Chain;
use carom_impact::Frictionless;
use carom_impact::{Coefficients, Energetic};
use carom_sim::{ContactLaw, ContactRule, Event, EventKind, SeveralLaw, Simulation, Touch, Trajectory};
use carom_testing::build::{O, Part, X, Z, ball, brick, chain};
use carom_testing::scenes::shipped;
use nalgebra::Vector3;

const RADIUS: f64 = 0.1;

/// Balls of 1 kg on a common line, each with a slider of its own along it.
fn row(count: usize) -> Chain {
    let slider = |k: usize| Part::slider(&format!("ball{k}"), "base", X).limits(-100.0, 100.0, 0.0);
    let balls = (1..=count).map(|k| slider(k).weighing(1.0, [0.004; 3]).shaped(&ball(RADIUS)));
    chain(&balls.collect::<Vec<_>>())
}

/// A simulation in which neighbouring balls may touch.
fn neighbours(chain: Chain, contact: ContactRule) -> Simulation {
    let pairs = 1..chain.nv();
    let touches =
        pairs.flat_map(|k| Touch::between(&chain, &format!("ball{k}"), &format!("ball{}", k + 1), &contact).unwrap());
    Simulation::new(chain.clone(), touches.collect())
}

/// A run in which the first ball strikes the others, which touch each other at rest, with 1 m/s after 0.3 s.
fn struck(sim: &Simulation) -> Trajectory {
    let count = sim.chain.nv();
    let mut q: Vec<f64> = (0..count).map(|k| 2.0 * RADIUS * k as f64).collect();
    q[0] = -0.3;
    let mut qd = vec![0.0; count];
    qd[0] = 1.0;
    sim.run(&q, &qd, 0.5).unwrap()
}

/// B14: two balls of 1 kg, the first at 1 m/s, e = 1: they exchange their velocities, and the second ends at x₁ + v₀T + 2r.
#[test]
fn an_elastic_pair_exchanges_velocities() {
    let sim = neighbours(row(2), ContactRule::new(Frictionless { restitution: 1.0 }));
    let run = sim.run(&[0.0, 0.52], &[1.0, 0.0], 1.0).unwrap();
    let end = &run.summary.last;
    assert!((end.q[1] - 1.2).abs() < 1e-13, "{:?}", end.q);
    assert!((end.q[0] - 0.32).abs() < 1e-13, "{:?}", end.q);
    assert!((end.qd[0]).abs() < 1e-14 && (end.qd[1] - 1.0).abs() < 1e-14, "{:?}", end.qd);
    assert!((run.events[0].time - 0.32).abs() < 1e-14);
}

/// The contacts of a link are those in which it is the first, and those in which it is the second.
#[test]
fn a_link_names_its_contacts_on_both_sides() {
    let sim = neighbours(row(3), ContactRule::new(Frictionless { restitution: 1.0 }));
    let of = |name| Touch::named(&sim.touches, name).unwrap();
    assert_eq!([of("ball1"), of("ball2"), of("ball3")], [vec![0], vec![0, 1], vec![1]]);
}

/// B8: the first ball strikes two (or four) balls at rest that touch each other. The laws are those of carom-impact, whose tests have more rows.
#[test]
fn each_law_of_several_contacts_gives_its_cradle_velocities() {
    let (third, alike) = (1.0 / 3.0, [1.0; 4]);
    let energetic = SeveralLaw::Energetic { exponent: 1.5 };
    type Case<'v> = (f64, SeveralLaw, &'v [f64], &'v [f64], f64);
    let cases: [Case; 4] = [
        (0.5, SeveralLaw::Moreau, &alike[..2], &[0.0, 0.5, 0.5], 1e-11),
        (1.0, SeveralLaw::Poisson, &alike[..2], &[-third, 2.0 * third, 2.0 * third], 1e-11),
        (1.0, SeveralLaw::Sequential, &alike, &[0.0, 0.0, 0.0, 0.0, 1.0], 1e-11),
        // As many digits as are known.
        (1.0, energetic, &[10.0, 1.0], &[-0.006184, 0.006222, 0.999962], 1e-6),
    ];
    for (restitution, several, stiffnesses, after, within) in cases {
        let mut sim = neighbours(row(after.len()), ContactRule::new(Frictionless { restitution }));
        sim.several = several;
        sim.touches.iter_mut().zip(stiffnesses).for_each(|(touch, k)| touch.contact.relative_stiffness = *k);
        let run = struck(&sim);
        let hit = &run.events[0];
        assert!((hit.time - 0.3).abs() < 1e-14, "{several:?} {}", hit.time);
        for (found, expected) in hit.qd_plus.iter().zip(after) {
            assert!((found - expected).abs() < within, "{several:?} e = {restitution}: {:?}", hit.qd_plus);
        }
        let momentum: f64 = run.summary.last.qd.iter().sum();
        assert!((momentum - 1.0).abs() < 1e-11);
        let energy: f64 = run.summary.last.qd.iter().map(|v| v * v).sum();
        assert!(restitution < 1.0 || (energy - 1.0).abs() < 1e-10, "{several:?} {energy}");
    }
}

/// An oblique collision of two free bodies with friction conserves linear and angular momentum and loses energy.
#[test]
fn a_collision_of_free_bodies_conserves_momentum() {
    let body = |name: &str, mass: f64, inertia: f64, element: &str| {
        Part::new(name, "base", "floating", Z, O).weighing(mass, [inertia; 3]).shaped(element)
    };
    let chain = chain(&[body("ball", 2.0, 0.02, &ball(0.1)), body("box", 3.0, 0.05, &brick([0.4; 3]))]);
    let momenta = |q: &[f64], qd: &[f64]| {
        let (mut linear, mut angular) = (Vector3::zeros(), Vector3::zeros());
        for (k, (mass, inertia)) in [(2.0, 0.02), (3.0, 0.05)].into_iter().enumerate() {
            let (place, pace) = (&q[7 * k..7 * k + 7], &qd[6 * k..6 * k + 6]);
            let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
                place[6], place[3], place[4], place[5],
            ));
            let v = turn * Vector3::new(pace[0], pace[1], pace[2]) * mass;
            linear += v;
            angular += Vector3::new(place[0], place[1], place[2]).cross(&v);
            angular += turn * Vector3::new(pace[3], pace[4], pace[5]) * inertia;
        }
        (linear, angular)
    };
    for law in ["energetic", "poisson", "chatterjee-ruina"] {
        let coefficients = Coefficients { restitution: 0.6, friction: 0.4, ..Coefficients::default() };
        let contact = ContactRule::new(ContactLaw::named(law, coefficients).unwrap());
        let touches = Touch::between(&chain, "ball", "box", &contact).unwrap();
        let sim = Simulation::new(chain.clone(), touches);
        let q = [-1.0, 0.05, -0.02, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        let qd = [2.0, 0.1, 0.2, 0.0, 5.0, -3.0, -1.0, 0.0, 0.0, 0.3, -0.2, 0.4];
        let run = sim.run(&q, &qd, 1.0).unwrap();
        let EventKind::Impact { hit, .. } = &run.events[0].kind else { panic!("{:?}", run.events[0].kind) };
        assert!(hit.energy_after < hit.energy_before);
        let (before, after) = (momenta(&q, &qd), momenta(&run.summary.last.q, &run.summary.last.qd));
        // The flight is integrated with a tolerance of 1e-9 for each step.
        assert!((before.0 - after.0).norm() < 1e-8, "{law}: {:?} {:?}", before.0, after.0);
        assert!((before.1 - after.1).norm() < 1e-8, "{law}: {:?} {:?}", before.1, after.1);
    }
}

/// Newton's cradle as shipped: the impacts are equally spaced in time and the energy is conserved.
#[test]
fn a_cradle_keeps_its_period_and_energy() {
    let scene = shipped("cradle");
    let plan = scene.plan().unwrap();
    let run = plan.simulation.run(&plan.q, &plan.qd, 6.0).unwrap();
    let energy = &run.summary.energy;
    assert!((energy.start - energy.end).abs() < 1e-7 * energy.start.abs(), "{energy:?}");
    // Rounding of the time of an impact displaces a ball by some 1e-13 rad, after which it swings against its neighbour at
    // some 1e-12 rad/s. So every change of velocity is either that of the swing or of that size.
    let change = |e: &Event| e.qd_minus.iter().zip(&e.qd_plus).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    let (mass, length) = (0.26, 0.3);
    let inertia: f64 = mass * length * length + 4.16e-5;
    let none = 1e-11;
    let all = (2.0 * mass * 9.81 * length * (1.0 - 0.5_f64.cos()) / inertia).sqrt();
    for event in &run.events {
        let change = change(event);
        assert!((change - all).abs() < 1e-8 * all || change < none, "{event:?}");
    }
    let mut strikes: Vec<f64> = run.events.iter().filter(|e| change(e) > none).map(|e| e.time).collect();
    // Balls at rest are apart by a rounding error: the impacts of one strike differ in time by that much.
    strikes.dedup_by(|later, time| *later - *time < 1e-12);
    let half = (strikes[1] - strikes[0]).abs();
    assert!(strikes.len() > 9, "{strikes:?}");
    for pair in strikes.windows(2) {
        assert!((pair[1] - pair[0] - half).abs() < 1e-6, "{strikes:?}");
    }
}

/// A contact with friction is refused before the run, as are a stiffness and an exponent out of range.
#[test]
fn energetic_law_refuses_friction_and_invalid_stiffnesses() {
    let energetic = SeveralLaw::Energetic { exponent: 1.5 };
    let refused = |several, contact| {
        let sim = Simulation { several, ..neighbours(row(3), contact) };
        sim.run(&[-0.3, 0.2, 0.4], &[1.0, 0.0, 0.0], 0.5).unwrap_err().to_string()
    };
    let smooth = ContactRule::new(Frictionless { restitution: 1.0 });
    let rough = ContactRule::new(Energetic { restitution: 0.5, friction: 0.2 });
    assert!(
        refused(energetic, rough).contains("friction is 0.2: the energetic law for several contacts has no friction")
    );
    let soft = ContactRule { relative_stiffness: 0.0, ..smooth.clone() };
    assert!(refused(energetic, soft).contains("relative_stiffness is 0: "));
    assert!(refused(SeveralLaw::Energetic { exponent: 0.5 }, smooth).contains("0.5"));
}
