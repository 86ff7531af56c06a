//! Contacts that give way: the rebound that was asked for, a force whose integral is the impulse, and the rigid limit.

use carom::sim::{Compliance, ContactMode, ContactRule, EventKind, Simulation, Surface, Touch};
use carom::{Chain, Energetic, Impacts};
use carom_chain::urdf::LoadOptions;
use carom_contact::Obstacle;
use nalgebra::Vector3;

fn touching(chain: &Chain, obstacle: Obstacle, contact: ContactRule) -> Vec<Touch> {
    let surface = Surface { name: "surface".into(), obstacle, contact, motion: None };
    Touch::all(chain, &[surface], 0.0).unwrap().touches
}

fn soft(stiffness: f64, restitution: f64, friction: f64) -> ContactRule {
    let compliance = Some(Compliance { stiffness, exponent: 1.5, slip_speed: 1e-4 });
    ContactRule { law: "energetic", restitution, friction, compliance, ..ContactRule::default() }
}

/// Whatever mass, stiffness and speed: e in, e out. The dissipated energy is ½ m v² (1 − e²), and ∫F dt = m v (1 + e).
#[test]
fn a_compliant_ball_rebounds_with_the_coefficient_that_was_asked_for() {
    for (mass, stiffness, speed, e) in [(2.0, 1e5, 1.0, 0.35), (0.1, 1e7, 0.05, 0.8), (50.0, 1e6, 3.0, 0.1)] {
        let text = format!(
            r#"<robot name="ball"><link name="world"/>
            <link name="ball"><inertial><mass value="{mass}"/>
              <inertia ixx="0.008" ixy="0" ixz="0" iyy="0.008" iyz="0" izz="0.008"/></inertial>
              <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
            <joint name="fall" type="prismatic"><parent link="world"/><child link="ball"/><axis xyz="0 0 1"/>
              <limit lower="-1000" upper="1000" effort="0" velocity="0"/></joint></robot>"#
        );
        let chain = Chain::from_urdf_str(&text, &LoadOptions::default()).unwrap();
        let floor = Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap();
        let touches = touching(&chain, floor, soft(stiffness, e, 0.0));
        let sim = Simulation { tolerance: 1e-11, ..Simulation::new(chain, touches) };
        let run = sim.run(&[0.1 + 0.01 * speed], &[-speed], 1.0).unwrap();
        let [presses, leaves] = run.events.as_slice() else { panic!("{:?}", run.events) };
        let EventKind::Mode { mode: ContactMode::Pressing { touch, damping } } = presses.kind else {
            panic!("{:?}", presses.kind)
        };
        assert!((leaves.qd_plus[0] / (e * speed) - 1.0).abs() < 1e-8, "{} {}", leaves.qd_plus[0], e * speed);
        let books = run.summary.energy;
        let lost = 0.5 * mass * speed * speed * (1.0 - e * e);
        assert!((books.resistance / -lost - 1.0).abs() < 1e-7 && books.error().abs() < 1e-9 * books.start);
        // Simpson's rule over the dense motion.
        let (a, b, n) = (presses.time, leaves.time, 2000);
        let force = |k: i32| {
            let moment = run.at(&sim.chain, a + (b - a) * f64::from(k) / f64::from(n));
            sim.pressing_force(touch, damping, &moment).unwrap().z
        };
        let weight = |k: i32| {
            if k == 0 || k == n {
                1.0
            } else if k % 2 == 1 {
                4.0
            } else {
                2.0
            }
        };
        let impulse: f64 = (0..=n).map(|k| weight(k) * force(k)).sum::<f64>() * (b - a) / (3.0 * f64::from(n));
        assert!((impulse / (mass * speed * (1.0 + e)) - 1.0).abs() < 1e-5, "{impulse}");
        assert!((0..=n).all(|k| force(k) >= 0.0), "it never pulls");
    }
}

/// Stiffer and stiffer, an arm's compliant impact goes to the rigid one, as its duration does: k^(−2/5) for n = 3/2.
#[test]
fn the_stiff_limit_of_a_compliant_impact_is_the_rigid_one() {
    let chain = Chain::from_urdf_file(concat!(env!("CARGO_MANIFEST_DIR"), "/robots/planar2.urdf")).unwrap();
    let wall = || Obstacle::half_space(Vector3::new(0.6464, 0.0, 0.0), -Vector3::x()).unwrap();
    let (q, qd) = ([0.78, -1.57], [0.1, 0.5]);
    let mut errors = Vec::new();
    for stiffness in [1e6, 1e8, 1e10] {
        let touches = touching(&chain, wall(), soft(stiffness, 0.35, 0.0));
        let touches = touches.into_iter().filter(|touch| touch.link() == Some("tip")).collect();
        let sim = Simulation { tolerance: 1e-12, max_events: 2, ..Simulation::new(chain.clone(), touches) };
        let run = sim.run(&q, &qd, 1.0).unwrap();
        let [presses, leaves] = run.events.as_slice() else { panic!("{:?}", run.events) };
        let law = Energetic { restitution: 0.35, friction: 0.0 };
        let tip = chain.frame("tip").unwrap();
        let rigid = chain.impact(&presses.q, &presses.qd_minus).at(tip).normal([-1.0, 0.0, 0.0]).resolve(&law).unwrap();
        let off = leaves.qd_plus.iter().zip(&rigid.qd_plus).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        errors.push(off);
    }
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log10() / 2.0;
        assert!((order - 0.4).abs() < 0.1, "{errors:?}: order {order}");
    }
}

/// With friction the force stays in the cone, against the slip.
#[test]
fn compliant_friction_stays_in_its_cone() {
    let chain = Chain::from_urdf_file(concat!(env!("CARGO_MANIFEST_DIR"), "/robots/planar2.urdf")).unwrap();
    let wall = Obstacle::half_space(Vector3::new(0.6464, 0.0, 0.0), -Vector3::x()).unwrap();
    let touches = touching(&chain, wall, soft(1e7, 0.35, 0.2));
    let touches = touches.into_iter().filter(|touch| touch.link() == Some("tip")).collect();
    let sim = Simulation { tolerance: 1e-10, max_events: 2, ..Simulation::new(chain, touches) };
    let run = sim.run(&[0.78, -1.57], &[0.1, 0.5], 1.0).unwrap();
    let [presses, leaves] = run.events.as_slice() else { panic!("{:?}", run.events) };
    let EventKind::Mode { mode: ContactMode::Pressing { touch, damping } } = presses.kind else { panic!() };
    let mut pushed = false;
    for k in 1..100 {
        let time = presses.time + (leaves.time - presses.time) * f64::from(k) / 100.0;
        let force = sim.pressing_force(touch, damping, &run.at(&sim.chain, time)).unwrap();
        assert!(force.x <= 0.0 && force.y.abs() <= 0.2 * force.x.abs() * (1.0 + 1e-12), "{force}");
        pushed |= force.y.abs() > 0.1 * force.x.abs();
    }
    assert!(pushed && run.summary.energy.resistance < 0.0);
}

/// Taken for rigid within a tolerance: the depth that is said is the depth that the full model reaches, and never less.
#[test]
fn neglected_compliance_says_how_deep_it_would_have_been() {
    let chain = Chain::from_urdf_file(concat!(env!("CARGO_MANIFEST_DIR"), "/robots/planar2.urdf")).unwrap();
    let wall = Obstacle::half_space(Vector3::new(0.6464, 0.0, 0.0), -Vector3::x()).unwrap();
    let touches = touching(&chain, wall, soft(1e8, 0.35, 0.0));
    let touches = touches.into_iter().filter(|touch| touch.link() == Some("tip")).collect();
    let full = Simulation { tolerance: 1e-11, max_events: 2, ..Simulation::new(chain, touches) };
    let (q, qd) = ([0.78, -1.57], [0.1, 0.5]);
    let run = full.run(&q, &qd, 1.0).unwrap();
    let [a, b] = run.events.as_slice() else { panic!("{:?}", run.events) };
    let depth = (0..=1000)
        .map(|k| run.at(&full.chain, a.time + (b.time - a.time) * f64::from(k) / 1000.0))
        .map(|moment| -full.smallest_gap(&moment.q).unwrap())
        .fold(0.0, f64::max);

    let rigid = Simulation { neglect: Some(0.01), ..full.clone() };
    let run = rigid.run(&q, &qd, 1.0).unwrap();
    assert_eq!(run.events[0].kind.name(), "impact");
    let said = run.summary.statistics.neglected_depth;
    // Beside the force, centrifugal terms act while the contact lasts: they are what the closed form leaves out.
    assert!((depth / said - 1.0).abs() < 0.01, "{depth} against {said}");
    // A tolerance that is smaller than the depth leaves nothing out.
    let strict = Simulation { neglect: Some(depth / 2.0), ..full };
    assert_eq!(strict.run(&q, &qd, 1.0).unwrap().events[0].kind.name(), "pressing");
}
