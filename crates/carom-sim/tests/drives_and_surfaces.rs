//! Closed forms for dry friction, damping, torque tables, latches, moving surfaces and controllers, and the energy balance
//! of each.

use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_impact::Newton;
use carom_sim::{
    ContactLaw, ContactMode, ContactRule, Drive, EventKind, ImpactInvariant, Oscillation, RestitutionBySpeed,
    Simulation, Surface, Touch, Transition,
};
use carom_testing::build::{self, O, Part, Y, Z, ball, chain, rooted, shape};
use carom_testing::files::robot;
use carom_testing::scenes::{self, DOWN, G, half_space, level, newton, scene, surface, towards_wall};
use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};

/// A ball of 2 kg on a vertical slider, with more elements of the joint.
fn slider(dynamics: &str) -> Chain {
    let ball = Part::slider("ball", "base", Z).limits(-1000.0, 1000.0, 0.0).joint(dynamics);
    chain(&[ball.weighing(2.0, [0.008; 3]).shaped(&build::ball(0.1))])
}

fn free(chain: Chain) -> Simulation {
    Simulation { tolerance: 1e-11, ..Simulation::new(chain, Vec::new()) }
}

fn assert_energy_balance(run: &carom_sim::Trajectory) {
    let balance = run.summary.energy;
    let scale = balance.start.abs().max(balance.end.abs()).max(balance.impacts.abs()).max(1e-3);
    assert!(balance.error().abs() < 1e-8 * scale, "{balance:?}, error {}", balance.error());
}

/// ½ m v² = f s: a slider with dry friction stops after m v/f seconds and stays at rest.
#[test]
fn dry_friction_stops_a_slider_at_the_closed_form_time_and_place() {
    let sim = free(slider(r#"<dynamics friction="3"/>"#));
    let run = sim.run(&[0.0], &[1.5], 3.0).unwrap();
    let stops = &run.events[0];
    assert!(matches!(&stops.kind, EventKind::Joint { joint, holds: true } if joint == "jball"), "{stops:?}");
    assert!((stops.time - 2.0 * 1.5 / 3.0).abs() < 1e-9);
    assert!((run.summary.last.q[0] - 0.5 * 2.0 * 1.5 * 1.5 / 3.0).abs() < 1e-9);
    assert_eq!(run.summary.last.qd[0], 0.0);
    assert_energy_balance(&run);
}

/// A joint at rest begins to slip when a ramp of torque exceeds its dry friction; then m ẍ = τ − f.
#[test]
fn a_joint_begins_to_slip_when_the_torque_exceeds_its_dry_friction() {
    let mut sim = free(slider(r#"<dynamics friction="3"/>"#));
    sim.drive = Drive::Table(carom_sim::TorqueTable {
        times: vec![0.0, 2.0, 3.0],
        forces: vec![vec![0.0], vec![6.0], vec![6.0]],
    });
    let run = sim.run(&[0.0], &[0.0], 3.0).unwrap();
    let loose = &run.events[0];
    assert!(
        matches!(loose.kind, EventKind::Joint { holds: false, .. }) && (loose.time - 1.0).abs() < 1e-9,
        "{loose:?}"
    );
    // v(2) = ∫₁² (3t − 3)/2 dt = ¾; then ẍ = 3/2 for a second.
    let v = 0.75 + 1.5;
    assert!((run.summary.last.qd[0] - v).abs() < 1e-8, "{}", run.summary.last.qd[0]);
    let x = 0.25 + 0.75 + 0.75;
    assert!((run.summary.last.q[0] - x).abs() < 1e-8, "{}", run.summary.last.q[0]);
    assert_energy_balance(&run);
}

/// m ẍ = −d ẋ
#[test]
fn a_damped_velocity_decays_exponentially() {
    let sim = free(slider(r#"<dynamics damping="4"/>"#));
    let run = sim.run(&[0.0], &[1.0], 2.0).unwrap();
    assert!((run.summary.last.qd[0] - (-4.0_f64).exp()).abs() < 1e-10);
    assert_energy_balance(&run);
    // The implicit integrator gives the same result.
    let stiff = Simulation { integrator: carom_sim::Integrator::Radau, tolerance: 1e-8, ..sim };
    let other = stiff.run(&[0.0], &[1.0], 2.0).unwrap();
    assert!((other.summary.last.qd[0] - run.summary.last.qd[0]).abs() < 1e-8);
}

fn touching(chain: &Chain, obstacle: Obstacle, contact: ContactRule, motion: Option<Oscillation>) -> Vec<Touch> {
    scenes::touching(chain, &[Surface { motion: motion.map(Into::into), ..surface("surface", obstacle, contact) }])
}

/// A latch sets the velocity of the tip to zero by an impulse along M⁻¹Jᵀ and holds the tip from then on. With two joints
/// and two held directions the arm is at rest.
#[test]
fn a_latch_holds_the_tip_at_rest() {
    let chain = robot("planar2");
    let wall = half_space([0.64, 0.0, 0.0], -Vector3::x());
    let rule = ContactRule { latch: true, ..ContactRule::default() };
    let touches = touching(&chain, wall, rule, None);
    let touches = touches.into_iter().filter(|touch| touch.link() == Some("tip")).collect();
    let mut sim = Simulation { tolerance: 1e-11, ..Simulation::new(chain, touches) };
    sim.gravity = Vector3::new(0.0, -G, 0.0);
    let run = sim.run(&[0.78, -1.57], &[0.2, 0.9], 1.0).unwrap();
    let latch = &run.events[0];
    assert_eq!(latch.kind.name(), "latch");
    assert!(matches!(run.summary.mode, ContactMode::Latched { .. }));
    // The loss is the whole kinetic energy, ½ qd⁻ᵀ M qd⁻ = ½ uᵀH⁻¹u.
    let mut ws = sim.chain.workspace();
    let kinetic = ws.update(&sim.chain, &latch.q).unwrap().kinetic_energy(&latch.qd_minus).unwrap();
    assert!((run.summary.energy.impacts / kinetic - 1.0).abs() < 1e-12, "{:?} {kinetic}", run.summary.energy);
    assert!(latch.qd_plus.iter().all(|v| v.abs() < 1e-12), "{:?}", latch.qd_plus);
    assert!(run.summary.last.qd.iter().all(|v| v.abs() < 1e-9));
    assert_energy_balance(&run);
}

/// B13: the ball on a vibrating table. Its period doubles at Γ* = √((2(1+e²)/(1+e)²)² + (π(1−e)/(1+e))²): below, the orbit
/// with one bounce in each period is stable; above, bounces alternate.
#[test]
fn a_ball_on_a_vibrating_table_doubles_its_period_at_the_closed_form_amplitude() {
    for (e, doubling) in [(0.5, 1.526823701), (0.8, 1.070836468)] {
        let omega = TAU * 10.0;
        for (share, doubled) in [(0.99, false), (1.01, true)] {
            let gamma: f64 = doubling * share;
            let amplitude = gamma * G / (omega * omega);
            let chain = slider("");
            let motion = Oscillation { amplitude: Vector3::z() * amplitude, frequency: omega, phase: 0.0 };
            let rule = newton(e, 0.0);
            let touches = touching(&chain, level(), rule.clone(), Some(motion));
            let mut sim = Simulation { tolerance: 1e-11, zeno_time: 1e-7, ..Simulation::new(chain, touches) };
            sim.gravity = DOWN;
            // The orbit of period one: relative velocity U after the bounce, flight of one period, v⁺ = g T/2, and
            // v⁺ − s' = −e(−v⁺ − s') gives s' = A ω cos φ = (1−e)/(1+e) g T/2.
            let period = TAU / omega;
            let v = G * period / 2.0;
            let cos = v * (1.0 - e) / (1.0 + e) / (amplitude * omega);
            let phase = cos.acos();
            // The start is just after a bounce, with a relative disturbance of 1e-4.
            let mut shifted = sim.clone();
            shifted.touches = touching(&sim.chain, level(), rule, Some(Oscillation { phase, ..motion }));
            let start = amplitude * phase.sin() + 0.1;
            let run = shifted.run(&[start], &[v * (1.0 + 1e-4)], 400.0 * period).unwrap();
            let hits: Vec<f64> = run.events.iter().filter(|e| e.kind.name() == "impact").map(|e| e.time).collect();
            assert!(hits.len() > 390, "e {e}, Γ {gamma}: {} impacts", hits.len());
            let last = &hits[hits.len() - 3..];
            let uneven = ((last[2] - last[1]) - (last[1] - last[0])).abs() / period;
            assert_eq!(uneven > 1e-3, doubled, "e {e}, Γ {gamma}: uneven by {uneven}");
        }
    }
}

fn wall_arm(drive: Drive) -> (Simulation, [f64; 2], [f64; 2]) {
    let chain = robot("planar2");
    let wall = half_space([0.6464, 0.0, 0.0], -Vector3::x());
    let touches =
        touching(&chain, wall, newton(0.35, 0.0), None).into_iter().filter(|t| t.link() == Some("tip")).collect();
    let (q, qd) = towards_wall(&chain, 0.2);
    let sim = Simulation { tolerance: 1e-10, drive, ..Simulation::new(chain, touches) };
    (sim, q, qd)
}

fn transition(compensate: bool) -> Drive {
    Drive::Transition(Transition {
        tip: "tip".into(),
        normal: -Vector3::x(),
        velocity: Vector3::new(0.2, -0.2, 0.0) * 0.5_f64.sqrt(),
        gain: 60.0,
        press: 0.5,
        compensate,
        restitution: 0.35,
    })
}

/// The transition controller brings the tip to rest at the wall. With compensation of the jump that eq. (15) predicts, the
/// tip leaves its first impact with the desired tangential velocity.
#[test]
fn a_compensated_transition_leaves_the_impact_with_the_desired_velocity() {
    let wanted = -0.2 * 0.5_f64.sqrt();
    let mut off = Vec::new();
    for compensate in [false, true] {
        let (sim, q, qd) = wall_arm(transition(compensate));
        let run = sim.run(&q, &qd, 2.0).unwrap();
        let EventKind::Impact { hit, .. } = &run.events[0].kind else { panic!("{:?}", run.events[0]) };
        off.push((hit.u_plus.y - wanted).abs());
        assert!(run.events.iter().any(|e| e.kind.name() == "zeno"), "the tip does not come to rest on the wall");
        assert_eq!(run.summary.mode.name(), "sliding");
        assert_energy_balance(&run);
    }
    // The controller follows the compensated velocity with a lag of 1/gain: a few per cent of the jump remain.
    assert!(off[1] < 0.05 * off[0], "{off:?}");
}

/// N M⁻¹jᵀ = 0: the joint forces of impact-invariant feedback do not jump at an impact.
#[test]
fn impact_invariant_feedback_is_continuous_at_an_impact() {
    let controller = ImpactInvariant {
        tip: "tip".into(),
        normal: -Vector3::x(),
        kp: 0.0.into(),
        kd: 0.3.into(),
        target: vec![PI / 4.0, -PI / 2.0],
        velocity: vec![0.0, 0.0],
    };
    let pd = Drive::Pd(carom_sim::Pd { kp: 0.0.into(), kd: 0.3.into(), target: controller.target.clone() });
    // The jump of the joint forces, Δτ = (M q̈ + bias)⁺ − (M q̈ + bias)⁻, with q̈ from differences of the dense output.
    let jump = |drive: Drive| {
        let (sim, q, qd) = wall_arm(drive);
        let run = sim.run(&q, &qd, 0.2).unwrap();
        let event = run.events.iter().find(|e| e.kind.name() == "impact").unwrap();
        let chain = &sim.chain;
        let slope = |time: f64, h: f64| {
            let [a, b] = [run.at(chain, time), run.at(chain, time + h)].map(|m| m.qd);
            [(b[0] - a[0]) / h, (b[1] - a[1]) / h]
        };
        let (before, after) = (slope(event.time - 2e-6, 1e-6), slope(event.time + 1e-6, 1e-6));
        let mut ws = chain.workspace();
        let mut kin = ws.update(chain, &event.q).unwrap();
        let m = kin.mass_matrix();
        let bias = |qd: &[f64], kin: &mut carom_chain::Kinematics<carom_chain::Spatial<f64>>| {
            kin.bias(qd, Vector3::zeros()).unwrap()
        };
        let (c_minus, c_plus) = (bias(&event.qd_minus, &mut kin), bias(&event.qd_plus, &mut kin));
        let tau = |slope: [f64; 2], c: &nalgebra::DVector<f64>| &m * nalgebra::DVector::from_column_slice(&slope) + c;
        (tau(after, &c_plus) - tau(before, &c_minus)).norm()
    };
    let (invariant, ordinary) = (jump(Drive::ImpactInvariant(controller)), jump(pd));
    assert!(ordinary > 1e-2 && invariant < 1e-3 * ordinary, "{invariant} against {ordinary} N m");
}

/// Damping, dry friction and limits of a joint that follows another one with the ratio −1.7 act as those of the other one with the
/// damping 1.7² d, the friction 1.7 f and the limits at the same places.
#[test]
fn damping_friction_and_limits_of_a_mimic_joint_act() {
    let link = |name: &str, parent: &str, joint: &str| {
        let link = Part::new(name, parent, "revolute", [0.0, -1.0, 0.0], O).com([0.25, 0.0, 0.02]);
        link.weighing(0.9, [0.02; 3]).joint(joint)
    };
    let chain = |own: &str, follower: &str| {
        let follower = format!("<mimic joint='ja' multiplier='-1.7' offset='0.2'/>{follower}");
        chain(&[link("a", "base", own), link("b", "a", &follower).at([0.5, 0.0, 0.0])])
    };
    let wide = "<limit lower='-50' upper='50' effort='9' velocity='9'/>";
    // k in [-2, 0.5] is j in [(0.5 - 0.2)/-1.7, (-2 - 0.2)/-1.7].
    let narrow = format!("<limit lower='{}' upper='{}' effort='9' velocity='9'/>", 0.3 / -1.7, 2.2 / 1.7);
    let cases = [
        (format!("{wide}<dynamics damping='0.3'/>"), format!("{wide}<dynamics damping='{}'/>", 0.3 * 1.7 * 1.7), 0),
        (format!("{wide}<dynamics friction='0.3'/>"), format!("{wide}<dynamics friction='{}'/>", 0.3 * 1.7), 1),
        ("<limit lower='-2' upper='0.5' effort='9' velocity='9'/>".to_owned(), narrow, 1),
    ];
    for (follower, leader, least) in cases {
        let run = |chain: Chain| {
            let touches = Touch::all(&chain, &[], 0.4).unwrap().touches;
            let gravity = DOWN;
            let sim = Simulation { gravity, tolerance: 1e-10, ..Simulation::new(chain, touches) };
            sim.run(&[0.4], &[2.0], 2.0).unwrap()
        };
        let (own, other) = (run(chain(wide, &follower)), run(chain(&leader, wide)));
        assert_energy_balance(&own);
        assert!(own.events.len() >= least, "{} events", own.events.len());
        assert_eq!(own.events.len(), other.events.len());
        let (a, b) = (&own.summary.last, &other.summary.last);
        assert!((a.q[0] - b.q[0]).abs() < 1e-8 && (a.qd[0] - b.qd[0]).abs() < 1e-8, "{follower}: {a:?} {b:?}");
    }
}

/// A slider follows a hinge at 0.1 m/rad, and its limit stops both: it bears (5 N m − g · 0.1 m · 1 kg)/0.1 m beside its weight, its impulse acts on
/// the slider, and a restitution that depends on the approach speed is that at the speed of the slider.
#[test]
fn a_limit_of_a_mimic_joint_acts_in_the_coordinate_of_the_joint() {
    let hinge = Part::new("hinge", "base", "continuous", Z, O).weighing(1.0, [0.1; 3]);
    let follower = "<mimic joint='jhinge' multiplier='0.1'/><limit lower='-9' upper='0.05' effort='9' velocity='9'/>";
    let slider = Part::new("slider", "base", "prismatic", Z, O).weighing(1.0, [0.1; 3]).joint(follower);
    let chain = chain(&[hinge, slider]);
    let touches = Touch::all(&chain, &[], 0.0).unwrap().touches;
    assert_eq!(touches.len(), 2);
    let drive = Drive::Constant(vec![5.0]);
    let mut sim = Simulation { gravity: DOWN, drive, ..Simulation::new(chain, touches) };
    let run = sim.run(&[0.0], &[1.0], 1.0).unwrap();
    let limit = run.events.iter().find_map(|event| match event.kind {
        EventKind::Limit { impulse, .. } => Some((event.qd_minus[0], impulse)),
        _ => None,
    });
    let (speed, impulse) = limit.unwrap();
    let inertia = 0.1 + 1.0 * 0.1 * 0.1;
    assert!((impulse - inertia * speed / 0.1).abs() < 1e-9 * impulse, "{impulse}");
    let contacts = &run.summary.contacts;
    let bears = (5.0 - 0.1 * -DOWN.z) / 0.1;
    assert!(contacts.len() == 1 && (contacts[0].normal_force - bears).abs() < 1e-9 * bears, "{contacts:?}");
    // 20 rad/s are 2 m/s.
    let table = RestitutionBySpeed::Table(vec![[1.0, 0.9], [2.0, 0.1]]);
    let law = ContactLaw::by_speed(Newton { restitution: 0.0, friction: 0.0 }, table);
    (sim.drive, sim.gravity) = (Drive::Off, Vector3::zeros());
    sim.touches.iter_mut().for_each(|touch| touch.contact.law = law.clone());
    let run = sim.run(&[0.0], &[20.0], 0.04).unwrap();
    assert!((run.summary.last.qd[0] + 2.0).abs() < 1e-12, "{:?}", run.summary.last.qd);
}

/// A joint is pushed against its limit, and a motor with a falling force takes it off: the limit bears no pull, and dry friction no more
/// than its bound, although both act along one coordinate. The joint leaves where the force is minus the friction.
#[test]
fn a_joint_with_dry_friction_leaves_its_limit_where_no_admissible_force_holds_it() {
    for at_limit in [false, true] {
        let chain = slider(r#"<dynamics friction="3"/>"#);
        let mut sim = free(chain);
        let floor = surface("floor", half_space([0.0, 0.0, -0.1], Vector3::z()), newton(0.0, 0.0));
        sim.touches = Touch::all(&sim.chain, &[floor], 0.0).unwrap().touches;
        // At its upper limit the joint is pushed up, on the floor it is pressed down.
        let (q, sign) = if at_limit { (1000.0, 1.0) } else { (0.0, -1.0) };
        sim.drive = Drive::Table(carom_sim::TorqueTable {
            times: vec![0.0, 1.0],
            forces: vec![vec![6.0 * sign], vec![-6.0 * sign]],
        });
        let run = sim.run(&[q], &[0.0], 1.0).unwrap();
        let leaves = run.events.iter().find(|event| event.kind.name() == "lift-off").expect("it leaves");
        // It leaves where its acceleration, 6 (t − ¾), is above 1e-8 of that without constraint, 1.5 m/s².
        assert!((leaves.time - 0.75).abs() < 1.1e-8 * 1.5 / 6.0, "{leaves:?}");
        // m v̇ = 12 (t − ¾) away from the stop, with m = 2 kg: v = 3 (t − ¾)², and its integral (t − ¾)³.
        let (moved, v) = (run.summary.last.q[0] - q, run.summary.last.qd[0]);
        assert!((moved + sign * 0.25_f64.powi(3)).abs() < 1e-9, "{moved}");
        assert!((v + sign * 3.0 * 0.25_f64.powi(2)).abs() < 1e-9, "{v}");
    }
}

/// A light finger, damped 1e6 times as fast as its base falls, bounces with it: after each impact the equations of the first implicit step have no
/// solution by Newton's method, and shorter steps are taken. A second route: steps of 0.2 ms at most from the start.
#[test]
fn a_damped_light_link_bounces_with_its_base() {
    let base = "<link name=\"palm\"><inertial><mass value=\"0.05\"/><inertia ixx=\"5e-5\" ixy=\"0\" ixz=\"0\" iyy=\"5e-5\" iyz=\"0\" izz=\"5e-5\"/>\
        </inertial><collision><geometry><sphere radius=\"0.03\"/></geometry></collision></link>";
    let finger = Part::new("finger", "palm", "revolute", Y, [0.05, 0.0, 0.0])
        .weighing(6.13446e-4, [6.13446e-7; 3])
        .com([0.02, 0.0, 0.0])
        .with(shape(&ball(0.01), [0.05, 0.0, 0.0], O))
        .limits(-2.0, 2.0, 10.0)
        .joint("<dynamics damping='3.06883'/>");
    let text = "[robot]\nurdf = \"hand.urdf\"\nfloating = true\n\
        q = [0, 0, 0, -0.9212737499, -0.2513464304, 0.2922360254, 0.0517470290, 0.4695340777]\n\
        [[surface]]\nshape = { halfspace = { point = [0, 0, -0.3], normal = [0, 0, 1] } }\n\
        [contact]\nrestitution = 0.4\n[run]\nduration = 0.4\ngravity = [0, 0, -9.81]\n";
    let plan = scene(&[("hand.urdf", &*rooted(base, &[finger]))], text).unwrap().plan().unwrap();
    let end = |max_step: f64| {
        let sim = Simulation { max_step, ..plan.simulation.clone() };
        let run = sim.run(&plan.q, &plan.qd, 0.4).unwrap();
        assert!(run.summary.energy.error().abs() < 1e-9, "{:?}", run.summary.energy);
        (run.events.len(), run.summary.last)
    };
    let ((events, own), (of_short, short)) = (end(plan.simulation.max_step), end(2e-4));
    assert_eq!(events, of_short);
    for (a, b) in own.q.iter().chain(&own.qd).zip(short.q.iter().chain(&short.qd)) {
        assert!((a - b).abs() < 1e-6, "{a} and {b}: {own:?} {short:?}");
    }
}
