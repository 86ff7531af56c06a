//! Compliant contacts: rebound with the given restitution, a force whose integral is the impulse, and the rigid limit.

use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_impact::{Damping, Energetic, Frictionless};
use carom_sim::{Compliance, ContactMode, ContactRule, Drive, EventKind, Holding, Impacts, Simulation, Yielding};
use carom_testing::build::{X, Z, along, ball, falling_ball};
use carom_testing::files::robot;
use carom_testing::numeric::{rk4, simpson};
use carom_testing::scenes::{self, half_space, kinds, on_floor, surface, with_robots};
use nalgebra::Vector3;

/// The contacts of the links with a surface.
fn touching(chain: &Chain, obstacle: Obstacle, contact: ContactRule) -> Vec<carom_sim::Touch> {
    scenes::touching(chain, &[surface("surface", obstacle, contact)])
}

/// The arm of the paper whose tip is about to strike a wall at 0.6464 m, with this contact.
fn arm(contact: ContactRule) -> Simulation {
    let chain = robot("planar2");
    let touches = touching(&chain, half_space([0.6464, 0.0, 0.0], -Vector3::x()), contact);
    let touches = touches.into_iter().filter(|touch| touch.link() == Some("tip")).collect();
    Simulation { max_events: 2, ..Simulation::new(chain, touches) }
}

fn soft(stiffness: f64, restitution: f64, friction: f64) -> ContactRule {
    let compliance =
        Some(Compliance { tangential: Holding::Smoothed { slip_speed: 1e-4 }, ..Compliance::new(stiffness) });
    ContactRule { compliance, ..ContactRule::new(Energetic { restitution, friction }) }
}

/// For every mass, stiffness and speed: v⁺ = e v⁻, the dissipated energy is ½ m v² (1 − e²), and ∫F dt = m v (1 + e).
#[test]
fn a_compliant_ball_rebounds_with_the_given_restitution() {
    for (mass, stiffness, speed, e) in [(2.0, 1e5, 1.0, 0.35), (0.1, 1e7, 0.05, 0.8), (50.0, 1e6, 3.0, 0.1)] {
        let ball = along(&[Z], mass, [0.008; 3], &ball(0.1));
        let gravity = Vector3::zeros();
        let sim = Simulation { tolerance: 1e-11, gravity, ..on_floor(ball, soft(stiffness, e, 0.0)) };
        let run = sim.run(&[0.1 + 0.01 * speed], &[-speed], 1.0).unwrap();
        let [presses, leaves] = run.events.as_slice() else { panic!("{:?}", run.events) };
        let EventKind::Mode { mode: ContactMode::Pressing { touch, damping } } = presses.kind else {
            panic!("{:?}", presses.kind)
        };
        assert!((leaves.qd_plus[0] / (e * speed) - 1.0).abs() < 1e-8, "{} {}", leaves.qd_plus[0], e * speed);
        let balance = run.summary.energy;
        let lost = 0.5 * mass * speed * speed * (1.0 - e * e);
        assert!((balance.resistance / -lost - 1.0).abs() < 1e-7 && balance.error().abs() < 1e-9 * balance.start);
        let force = |time: f64| {
            let force = sim.pressing_force(touch, damping, &run.at(&sim.chain, time)).unwrap().z;
            assert!(force >= 0.0, "the force is never tensile: {force}");
            force
        };
        let impulse = simpson(force, [presses.time, leaves.time]);
        assert!((impulse / (mass * speed * (1.0 + e)) - 1.0).abs() < 1e-5, "{impulse}");
    }
}

/// The compliant impact of an arm converges to the rigid one with increasing stiffness, with the order of its duration:
/// k^(−2/5) for n = 3/2.
#[test]
fn a_compliant_impact_converges_to_the_rigid_one_with_stiffness() {
    let (q, qd) = ([0.78, -1.57], [0.1, 0.5]);
    let mut errors = Vec::new();
    for stiffness in [1e6, 1e8, 1e10] {
        let sim = Simulation { tolerance: 1e-12, ..arm(soft(stiffness, 0.35, 0.0)) };
        let run = sim.run(&q, &qd, 1.0).unwrap();
        let [presses, leaves] = run.events.as_slice() else { panic!("{:?}", run.events) };
        let law = Energetic { restitution: 0.35, friction: 0.0 };
        let tip = sim.chain.frame("tip").unwrap();
        let rigid =
            sim.chain.impact(&presses.q, &presses.qd_minus).at(tip).normal([-1.0, 0.0, 0.0]).resolve(&law).unwrap();
        let off = leaves.qd_plus.iter().zip(&rigid.qd_plus).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        errors.push(off);
    }
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log10() / 2.0;
        assert!((order - 0.4).abs() < 0.1, "{errors:?}: order {order}");
    }
}

/// The force of a compliant contact with friction is inside the friction cone.
#[test]
fn compliant_friction_force_is_inside_the_friction_cone() {
    let sim = Simulation { tolerance: 1e-10, ..arm(soft(1e7, 0.35, 0.2)) };
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

/// A compliant contact that is treated as rigid: the reported depth is that of the compliant model to 1 %.
#[test]
fn neglected_compliance_reports_the_penetration_depth() {
    let full = Simulation { tolerance: 1e-11, ..arm(soft(1e8, 0.35, 0.0)) };
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
    // The closed form leaves out the centrifugal terms that act during the contact.
    assert!((depth / said - 1.0).abs() < 0.01, "{depth} against {said}");
    // Nothing is neglected if the tolerance is smaller than the depth.
    let strict = Simulation { neglect: Some(depth / 2.0), ..full };
    assert_eq!(strict.run(&q, &qd, 1.0).unwrap().events[0].kind.name(), "pressing");
}

/// A block that slides along a slope and off it, with a ball as its foot.
fn block_on_slope(tangent: f64, compliance: Compliance) -> Simulation {
    let law = Energetic { restitution: 0.2, friction: 0.5 };
    let rule = ContactRule { compliance: Some(compliance), ..ContactRule::new(law) };
    let gravity = Vector3::new(tangent, 0.0, -1.0) * (9.81 / tangent.hypot(1.0));
    Simulation { gravity, tolerance: 1e-10, ..on_floor(along(&[X, Z], 2.0, [0.01; 3], &ball(0.1)), rule) }
}

/// Every normal force rebounds with v⁺ = e v⁻ and a closed energy balance.
#[test]
fn every_normal_force_rebounds_with_the_given_restitution() {
    for normal in [Yielding::KelvinVoigt { pulls: false }, Yielding::KelvinVoigt { pulls: true }, Yielding::WaltonBraun]
    {
        for (stiffness, speed, e) in [(1e5, 1.0, 0.35), (1e7, 0.05, 0.8), (1e4, 2.0, 0.1)] {
            let sim = block_on_slope(0.0, Compliance { normal, ..Compliance::new(stiffness) });
            let mut sim = Simulation { gravity: Vector3::zeros(), max_events: 2, ..sim };
            for touch in &mut sim.touches {
                touch.contact.law = Energetic { restitution: e, friction: touch.contact.law.friction() }.into();
            }
            let run = sim.run(&[0.0, 0.1 + 0.01 * speed], &[0.0, -speed], 1.0).unwrap();
            assert_eq!(kinds(&run), ["pressing", "lift-off"], "{normal:?}");
            let leaves = &run.events[1];
            assert!((leaves.qd_plus[1] / (e * speed) - 1.0).abs() < 1e-6, "{normal:?}: {:?}", leaves.qd_plus);
            assert!(run.summary.energy.error().abs() < 1e-8 * run.summary.energy.start, "{normal:?}");
        }
    }
}

/// A block dropped on a slope below the angle of friction: with a bristle it comes to rest, with smoothed friction it creeps
/// at v_s atanh(tan θ/μ), for both normal forces.
#[test]
fn a_block_on_a_slope_rests_with_a_bristle_and_creeps_with_smoothed_friction() {
    let tangent = 0.4;
    let bristle = Holding::Bristle { stiffness: 1e4, damping: 150.0 };
    for normal in [Compliance::new(1.0).normal, Yielding::KelvinVoigt { pulls: false }] {
        let on = |tangential, duration| {
            let sim = block_on_slope(tangent, Compliance { normal, tangential, ..Compliance::new(1e6) });
            sim.run(&[0.0, 0.1], &[0.0, -0.05], duration).unwrap()
        };
        let run = on(bristle, 2.0);
        assert_eq!(run.summary.mode.name(), "pressing", "{:?}", run.events);
        let [along, off] = [run.summary.last.qd[0], run.summary.last.qd[1]];
        // The remaining velocity is the error of the integration.
        assert!(along.abs() < 1e-8 && off.abs() < 1e-8, "{normal:?}: creeps at {along:e} m/s");
        let energy = &run.summary.energy;
        assert!(
            energy.error().abs() < 1e-7 && energy.resistance < 0.0,
            "{normal:?}: {:e} {energy:?} {:?}",
            energy.error(),
            run.summary.statistics
        );
        let run = on(Holding::Smoothed { slip_speed: 1e-3 }, 2.0);
        let expected = 1e-3 * (tangent / 0.5_f64).atanh();
        let creep = run.summary.last.qd[0];
        assert!((creep / expected - 1.0).abs() < 1e-6, "{normal:?}: {creep} instead of {expected}");
    }
}

/// The force of Walton & Braun vanishes once after its turn, whatever the rounding of that place: there is nothing for time steps.
#[test]
fn a_ball_bounces_on_the_unloading_line_from_every_height() {
    for k in 0..40 {
        let height = 0.2 + 0.005 * f64::from(k);
        let scene = with_robots(&format!(
            "[robot]\nurdf = \"../robots/ball.urdf\"\nfloating = true\ntip = \"ball\"\nq = [0, 0, {height}, 0, 0, 0, 1]\nqd = [1, 0, 0, 0, 0, 0]\n\
             [[surface]]\nshape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n\
             [contact]\nrestitution = 0.6\ncompliance = {{ stiffness = 1e4, force = \"walton-braun\" }}\n\
             [run]\nduration = 0.3\ngravity = [0, 0, -9.81]\n"
        ));
        let run = scene.unwrap().plan().unwrap().run(0.3).unwrap();
        assert_eq!(kinds(&run), ["pressing", "lift-off"], "{height}");
    }
}

/// Above the angle of friction a bristle slides with Coulomb's acceleration.
#[test]
fn a_bristle_slides_with_coulombs_acceleration() {
    let (tangent, mu) = (0.8, 0.5);
    let tangential = Holding::Bristle { stiffness: 1e5, damping: 100.0 };
    let normal = Yielding::KelvinVoigt { pulls: false };
    let sim = block_on_slope(tangent, Compliance { normal, tangential, ..Compliance::new(1e6) });
    let run = sim.run(&[0.0, 0.1], &[0.0, -0.05], 1.0).unwrap();
    let late = |time| run.at(&sim.chain, time).qd[0];
    let acceleration = (late(1.0) - late(0.5)) / 0.5;
    let coulomb = 9.81 / tangent.hypot(1.0) * (tangent - mu);
    assert!((acceleration / coulomb - 1.0).abs() < 1e-6, "{acceleration} instead of {coulomb}");
}

/// A stiff contact with Walton & Braun's force gives the velocities of Stronge's (energetic) law.
#[test]
fn a_stiff_walton_braun_contact_gives_stronges_impact() {
    let tangential = Holding::Smoothed { slip_speed: 1e-5 };
    let compliance = Compliance { normal: Yielding::WaltonBraun, tangential, ..Compliance::new(1e9) };
    let law = Energetic { restitution: 0.5, friction: 0.4 };
    let rule = ContactRule { compliance: Some(compliance), ..ContactRule::new(law) };
    let sim = Simulation { tolerance: 1e-11, ..arm(rule) };
    let run = sim.run(&[0.78, -1.57], &[0.1, 0.5], 1.0).unwrap();
    let [presses, leaves] = run.events.as_slice() else { panic!("{:?}", run.events) };
    let tip = sim.chain.frame("tip").unwrap();
    let rigid = sim.chain.impact(&presses.q, &presses.qd_minus).at(tip).normal([-1.0, 0.0, 0.0]).resolve(&law).unwrap();
    for (a, b) in leaves.qd_plus.iter().zip(&rigid.qd_plus) {
        assert!((a - b).abs() < 1e-3, "{:?} {:?}", leaves.qd_plus, rigid.qd_plus);
    }
    let EventKind::Mode { mode: ContactMode::Pressing { touch, damping } } = presses.kind else { panic!() };
    let refused = sim.pressing_force(touch, damping, &run.summary.last).unwrap_err().to_string();
    assert!(refused.starts_with("tip on surface: its force depends on the history of the contact"), "{refused}");
}

/// The keys of `compliance` in a scene file, and the refusals of invalid ones with key, value and rule.
#[test]
fn compliance_keys_of_a_scene_are_read_and_invalid_ones_refused() {
    let scene = |compliance: &str| {
        with_robots(&format!(
            "[robot]\nurdf = \"planar2.urdf\"\nq = [0.78, -1.57]\nqd = [0.1, 0.5]\n[[surface]]\nshape = {{ halfspace = {{ point = \
             [0.6464, 0, 0], normal = [-1, 0, 0] }} }}\n[contact]\nlaw = \"energetic\"\nrestitution = 0.35\nfriction = \
             0.1\ncompliance = {{ {compliance} }}\n[run]\nduration = 0.3\n"
        ))
    };
    let chosen = |text: &str| scene(text).unwrap().simulation.touches[0].contact.compliance.unwrap();
    assert_eq!(chosen("stiffness = 1e8"), Compliance::new(1e8));
    let flores = Yielding::HuntCrossley { exponent: 1.2, damping: Damping::Flores };
    let said = "stiffness = 1e8, force = \"hunt-crossley\", exponent = 1.2, damping = \"flores\"";
    assert_eq!(chosen(said), Compliance { normal: flores, ..Compliance::new(1e8) });
    let bristle = Holding::Bristle { stiffness: 1e7, damping: 100.0 };
    let said = "stiffness = 1e8, force = \"walton-braun\", bristle = { stiffness = 1e7, damping = 100 }";
    let expected = Compliance { stiffness: 1e8, normal: Yielding::WaltonBraun, tangential: bristle };
    assert_eq!(chosen(said), expected);
    let said = "stiffness = 1e5, force = \"kelvin-voigt\", pulls = true, slip_speed = 0.01";
    let tangential = Holding::Smoothed { slip_speed: 0.01 };
    let expected = Compliance { stiffness: 1e5, normal: Yielding::KelvinVoigt { pulls: true }, tangential };
    assert_eq!(chosen(said), expected);
    for (said, why) in [
        (
            "stiffness = 1, force = \"drake\"",
            "[contact] compliance force = \"drake\": the forces are hunt-crossley, kelvin-voigt, walton-braun",
        ),
        (
            "stiffness = 1, damping = \"best\"",
            "[contact] compliance damping = \"best\": the formulas are exact, hunt-crossley,",
        ),
        (
            "stiffness = 1, force = \"kelvin-voigt\", exponent = 2",
            "[contact] compliance exponent is read with force = \"hunt-crossley\" only",
        ),
        ("stiffness = 1, pulls = true", "[contact] compliance pulls is read with force = \"kelvin-voigt\" only"),
        (
            "stiffness = 1, slip_speed = 1, bristle = { stiffness = 1, damping = 1 }",
            "[contact] compliance has both slip_speed (smoothed friction) and bristle",
        ),
        ("stiffness = -1, force = \"walton-braun\"", "[contact]: stiffness is -1: it must be finite and above 0"),
        ("stiffness = 1, slip_speed = 0", "[contact]: slip speed is 0: it must be finite and above 0"),
        (
            "stiffness = 1, bristle = { stiffness = 1, damping = 0 }",
            "[contact]: bristle's damping is 0: it must be finite and above 0",
        ),
        ("stiffness = 1, bristle = { stiffness = 1 }", "missing field `damping`"),
        ("stifness = 1", "did you mean `stiffness`?"),
    ] {
        let refused = scene(said).unwrap_err().to_string();
        assert!(refused.contains("<scene>") && refused.contains(why), "{refused}\n{why}");
    }
}

/// A joint limit has impulses only: a compliance of it is refused by its name, before the run.
#[test]
fn a_compliance_of_a_joint_limit_is_refused() {
    let chain = robot("arm7");
    let (nq, mut touches) = (chain.nq(), carom_sim::Touch::every(&chain, &[], 0.5).unwrap());
    touches[1].contact.compliance = Some(Compliance::new(1e5));
    let name = touches[1].name.clone();
    let found = Simulation::new(chain, touches).run(&vec![0.1; nq], &vec![0.0; nq], 0.1).unwrap_err().to_string();
    assert!(found.starts_with(&name) && found.contains("joint limits are rigid"), "{found}");
}

/// A ball that starts at the static depth of its compliant contact, k dⁿ = m g, stays there.
#[test]
fn a_ball_rests_at_the_static_depth_of_its_compliant_contact() {
    let law = Frictionless { restitution: 0.5 };
    let contact = ContactRule { compliance: Some(Compliance::new(1e6)), ..ContactRule::new(law) };
    let sim = on_floor(falling_ball(), contact);
    let depth = (2.0 * 9.81 / 1e6_f64).powf(1.0 / 1.5);
    let run = sim.run(&[0.1 - depth], &[0.0], 1.0).unwrap();
    assert!((run.summary.last.q[0] - (0.1 - depth)).abs() < 1e-10, "{:?} {:?}", run.summary.last, run.events);
    assert_eq!(run.summary.mode.name(), "pressing");
    // Started at half that depth, it settles at the same depth.
    let run = sim.run(&[0.1 - 0.5 * depth], &[0.0], 5.0).unwrap();
    assert!((run.summary.last.q[0] - (0.1 - depth)).abs() < 1e-2 * depth, "{:?}", run.summary.last);
}

/// Under a slowly growing load a bouncing Walton–Braun contact turns again and again a little deeper than before: each turn begins a new
/// line of unloading. Against small steps of the equation of motion.
#[test]
fn walton_braun_contacts_remember_every_deeper_turn() {
    let (stiffness, restitution, grows, speed, duration) = (7.2e4, 0.9, 0.078, 0.03, 0.5);
    let compliance = Some(Compliance { normal: Yielding::WaltonBraun, ..Compliance::new(stiffness) });
    let rule = ContactRule { compliance, ..ContactRule::new(Energetic { restitution, friction: 0.0 }) };
    let times = vec![0.0, duration];
    let drive =
        Drive::Table(carom_sim::TorqueTable { times, forces: vec![vec![-9.81], vec![-9.81 - grows * duration]] });
    let ball = along(&[Z], 1.0, [1.0; 3], &ball(0.1));
    let sim = Simulation { tolerance: 1e-10, gravity: Vector3::zeros(), drive, ..on_floor(ball, rule) };
    let run = sim.run(&[0.1], &[-speed], duration).unwrap();

    // d and its rate; a turn is between two steps, within which d changes by less than rounding matters.
    let (mut d, mut v, mut deepest, mut turns) = (0.0_f64, speed, f64::NEG_INFINITY, 0);
    let steps = 1_000_000;
    let h = duration / f64::from(steps);
    let square = restitution * restitution;
    for k in 0..steps {
        let time = f64::from(k) * h;
        let pull = |d: f64, deepest: f64| {
            let yields = if d >= deepest { stiffness * d } else { stiffness / square * (d - (1.0 - square) * deepest) };
            yields.max(0.0)
        };
        let before = v;
        [d, v, _] = rk4(|[d, v, time]| [v, 9.81 + grows * time - pull(d, deepest), 1.0], [d, v, time], h);
        if before > 0.0 && v <= 0.0 && d > deepest {
            deepest = d;
            turns += 1;
        }
    }
    assert!(turns > 15, "{turns} turns");
    let (q, w) = (run.summary.last.q[0] - 0.1, run.summary.last.qd[0]);
    let (size, fast) = (9.81 / stiffness, 9.81 / stiffness.sqrt());
    assert!((q + d).abs() < 1e-5 * size, "{q} for {}", -d);
    assert!((w + v).abs() < 1e-5 * fast, "{w} for {}", -v);
}

/// The depth that may be neglected is a share of the length of the scene: a single body has one, although its reach is zero.
#[test]
fn the_compliance_of_a_single_body_can_be_neglected() {
    let depth = |neglect: &str| {
        let soft = format!("[contact.compliance]\nstiffness = 1e11\n[run]\n{neglect}\n");
        let plan = carom_testing::scenes::changed("bounce", &[("[run]\n", &soft)]).plan().unwrap();
        plan.run(0.6).unwrap().summary.statistics.neglected_depth
    };
    assert_eq!(depth(""), 0.0);
    let neglected = depth("neglect = 0.01");
    // A hundredth of the radius of 0.05 m.
    assert!(neglected > 0.0 && neglected <= 5e-4, "{neglected}");
}
