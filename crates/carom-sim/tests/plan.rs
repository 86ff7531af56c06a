//! The reductions of a plan: exact reductions change results by rounding only; the others stay within their bound.

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use carom_sim::{ContactMode, Moment, Oscillation, Scene, Simulation, Surface, Touch};
use carom_testing::build::{O, Part, X, Z, arm_with_hand, ball, chain, shape, two_arms, urdf};
use carom_testing::scenes::{self, half_space, rule, surface, touching};
use nalgebra::Vector3;

/// Loads a scene from its text, together with the text of its robot.
fn scene(robot: &str, text: &str) -> Scene {
    scenes::scene(&[("robot.urdf", robot)], text).unwrap()
}

fn planar2() -> String {
    carom_testing::files::text("robots/planar2.urdf")
}

/// Without a key it is that of the Earth; a scene that says so has none.
#[test]
fn a_plan_states_its_gravity() {
    for (key, choice) in
        [("", "(0, 0, -9.81) m/s²"), ("gravity = [0, 0, 0]", "none"), ("gravity = [0, 0, -1.62]", "(0, 0, -1.62) m/s²")]
    {
        let text = format!(
            "[robot]\nurdf = \"robot.urdf\"\nfloating = true\nq = [0, 0, 1, 0, 0, 0, 1]\n[run]\nduration = 0.1\n{key}"
        );
        let plan = scene(&carom_testing::files::text("robots/ball.urdf"), &text).plan().unwrap();
        let stated: Vec<&str> =
            plan.kept.iter().filter(|it| it.what == "gravity").map(|it| it.choice.as_str()).collect();
        assert_eq!(stated, [choice]);
    }
}

/// Runs the plan of a scene and of the same scene with `model = "full"`, and compares events and motion of the joints
/// `kept` (indices in the full q) to 1e-11 of the largest number. At least `least` events have to be compared.
fn same_motion(name: &str, robot: &str, text: &str, kept: &[usize], least: usize) -> [Simulation; 2] {
    let auto = scene(robot, text);
    let full = scene(robot, &text.replace("[run]", "[run]\nmodel = \"full\""));
    let (less, all) = (auto.plan().unwrap(), full.plan().unwrap());
    assert!(less.bounded.is_empty() && !less.left_out.is_empty());
    let a = less.simulation.run(&less.q, &less.qd, auto.duration).unwrap();
    let b = all.simulation.run(&all.q, &all.qd, full.duration).unwrap();
    let pick = |numbers: &[f64]| kept.iter().map(|&k| numbers[k]).collect::<Vec<_>>();
    let close = |a: &[f64], b: &[f64], what: &str| {
        assert_eq!(a.len(), b.len(), "{name}, {what}");
        let scale = b.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() <= 1e-11 * scale, "{name}, {what}: {a} against {b}");
        }
    };
    let of_kept: Vec<_> = b.events.iter().filter(|e| less_touches(&less.simulation, &all.simulation, e)).collect();
    assert_eq!(a.events.len(), of_kept.len(), "{name}");
    assert!(a.events.len() >= least, "{name}: {} events compared, {least} expected", a.events.len());
    for (a, b) in a.events.iter().zip(&of_kept) {
        let kind = match (name, a.kind.name()) {
            ("corners", "impact") => "several",
            ("corners", "several") => panic!("the corners are one in the plane: {a:?}"),
            (_, kind) => kind,
        };
        assert_eq!(kind, b.kind.name(), "{name}");
        close(&[a.time], &[b.time], "time of an event");
        close(&a.q, &pick(&b.q), "q at an event");
        close(&a.qd_plus, &pick(&b.qd_plus), "qd after an event");
    }
    for k in 0..=200 {
        let time = auto.duration * f64::from(k) / 200.0;
        let (a, b): (Moment, Moment) = (a.at(&less.simulation.chain, time), b.at(&all.simulation.chain, time));
        close(&a.q, &pick(&b.q), &format!("q at {time} s"));
        close(&a.qd, &pick(&b.qd), &format!("qd at {time} s"));
    }
    [less.simulation, all.simulation]
}

/// Whether the reduced model also has the touch of an event of the full model.
fn less_touches(less: &Simulation, all: &Simulation, event: &carom_sim::Event) -> bool {
    event.kind.touch().is_none_or(|k| less.touches.iter().any(|touch| touch.name == all.touches[k].name))
}

const WALL: &str = r#"
[robot]
urdf = "robot.urdf"
q = [0.7854, -1.5708]
qd = [0.3, -0.9]
[[surface]]
shape = { halfspace = { point = [0.65, 0, 0], normal = [-1, 0, 0] } }
[contact]
law = "energetic"
restitution = 0.5
friction = 0.2
[run]
duration = 1.5
tolerance = 1e-12
gravity = [0, -9.81, 0]
"#;

#[test]
fn planar_reduction_gives_the_motion_of_the_spatial_model() {
    let [less, all] = same_motion("plane", &planar2(), WALL, &[0, 1], 4);
    assert!(less.planar && !all.planar);
}

#[test]
fn frictionless_contact_without_tangential_rows_gives_the_same_motion() {
    same_motion("frictionless", &planar2(), &WALL.replace("friction = 0.2", "friction = 0"), &[0, 1], 4);
}

#[test]
fn removing_unreachable_surfaces_gives_the_same_motion() {
    let far = r#"
[[surface]]
name = "far wall"
shape = { halfspace = { point = [-3, 0, 0], normal = [1, 0, 0] } }
[[surface]]
name = "ball overhead"
shape = { sphere = { centre = [0, 0, 2], radius = 0.5 } }
[contact]"#;
    let [less, all] = same_motion("reach", &planar2(), &WALL.replace("[contact]", far), &[0, 1], 4);
    let pairs = |sim: &Simulation| sim.touches.iter().filter(|touch| touch.link().is_some()).count();
    assert!(pairs(&less) < pairs(&all));

    // Without any other surface the plan says that there is no contact; nothing is warned of.
    let scene = scene(&planar2(), &WALL.replace("0.65, 0, 0", "2, 0, 0"));
    let (plan, warnings) = (scene.plan().unwrap(), &scene.warnings);
    assert!(warnings.is_empty(), "{warnings:?}");
    let stated = |decisions: &[carom_sim::Decision], what: &str, choice: &str| {
        decisions.iter().any(|it| it.what == what && it.choice == choice)
    };
    assert!(stated(&plan.kept, "surface", "no contact with a surface"), "{plan:?}");
    assert!(stated(&plan.left_out, "pair", "tip on surface 1"), "{plan:?}");
    let run = plan.run(0.1).unwrap();
    assert_eq!((run.events.len(), run.summary.mode, run.summary.stop.name()), (0, ContactMode::Free, "duration"));
}

/// Two arms on one base; only one of them can touch the wall.
#[test]
fn a_branch_without_contacts_is_in_the_answer() {
    let text = r#"
[robot]
urdf = "robot.urdf"
q = [0.3, 0.4, 0.9, -1.2]
qd = [1, 0, -0.5, 0.2]
[[surface]]
shape = { halfspace = { point = [0.71, 0, 0], normal = [-1, 0, 0] } }
[contact]
law = "poisson"
restitution = 0.6
friction = 0.1
[run]
duration = 1.0
tolerance = 1e-12
gravity = [0, -9.81, 0]
"#;
    let [less, all] = same_motion("branch", &two_arms(), text, &[0, 1, 2, 3], 2);
    assert_eq!((less.chain.nv(), all.chain.nv()), (4, 4));
}

/// An arm whose hand is a box: in space two corners hit at the same time, in the plane one.
#[test]
fn corners_with_the_same_planar_position_are_merged() {
    let robot = arm_with_hand();
    let text = r#"
[robot]
urdf = "robot.urdf"
q = [0.5, -0.7]
qd = [-0.6, 0.3]
[[surface]]
shape = { halfspace = { point = [0, -0.1, 0], normal = [0, 1, 0] } }
[contact]
law = "newton"
restitution = 0.6
[run]
duration = 1.2
tolerance = 1e-12
"#;
    // In space the two corners are a problem of several contacts, in the plane a single contact. Without friction both
    // have the same solution.
    let [less, all] = same_motion("corners", &robot, text, &[0, 1], 2);
    assert_eq!((less.touches.len(), all.touches.len()), (4, 8));
}

/// The error of an impact whose friction was neglected is below the bound that the run reports, over poses, speeds, laws
/// and coefficients.
#[test]
fn error_of_neglected_friction_is_within_the_reported_bound() {
    let mut rng = fastrand::Rng::with_seed(7);
    let mut worst = 0.0_f64;
    let (mut neglected, mut solved, mut missed) = (0, 0, 0);
    for case in 0..60 {
        let mu = 10_f64.powf(-4.0 + 3.0 * rng.f64());
        let e = rng.f64();
        let law = ["newton", "poisson", "energetic"][case % 3];
        let (q, qd) = ([0.3 + rng.f64(), -2.4 + 1.8 * rng.f64()], [rng.f64() - 0.5, rng.f64() - 0.5]);
        let chain = Chain::from_urdf_str(&planar2(), &LoadOptions::default()).unwrap();
        let tip = chain.frame("tip").unwrap();
        let mut ws = chain.workspace();
        let kin = ws.update(&chain, &q).unwrap();
        let place = kin.position(chain.point(tip, Vector3::zeros()));
        let u = kin.point_velocity(chain.point(tip, Vector3::zeros()), &qd).unwrap();
        // The wall is 1 mm ahead of the tip in the direction of its motion along x.
        let toward = if u.x > 0.0 { 1.0 } else { -1.0 };
        let wall = half_space(place + Vector3::x() * toward * 1e-3, -Vector3::x() * toward);
        let wall = surface("wall", wall, rule(law, e, mu));
        let touches = Touch::all(&chain, &[wall], 0.0).unwrap().touches;
        let touches = touches.into_iter().filter(|touch| touch.link() == Some("tip")).collect();
        let exact = Simulation { max_events: 1, ..Simulation::new(chain, touches) };
        let less = Simulation { neglect: Some(0.5), ..exact.clone() };
        let run = |sim: &Simulation| sim.run(&q, &qd, 2.0).unwrap_or_else(|error| panic!("case {case}: {error}"));
        let (a, b) = (run(&less), run(&exact));
        let (Some(a_hit), Some(b_hit)) = (a.events.first(), b.events.first()) else {
            // The tip turns back before the wall.
            assert!(a.events.is_empty() && b.events.is_empty(), "case {case}: {:?} {:?}", a.events, b.events);
            missed += 1;
            continue;
        };
        let [a_hit, b_hit] = [a_hit, b_hit].map(|event| match &event.kind {
            carom_sim::EventKind::Impact { hit, .. } => hit.clone(),
            other => panic!("{other:?}"),
        });
        let change = (a_hit.u_plus - b_hit.u_plus).norm() / b_hit.u_minus.norm();
        if a.summary.statistics.neglected_frictions > 0 {
            let bound = a.summary.statistics.neglected_bound;
            assert!(change <= bound * (1.0 + 1e-9), "case {case}: {change} above its bound {bound}");
            worst = worst.max(change / bound);
            neglected += 1;
        } else {
            assert_eq!(change, 0.0);
            solved += 1;
        }
    }
    assert_eq!((neglected, solved, missed), (53, 3, 4), "cases with friction neglected, solved, and without an impact");
    assert!(worst > 0.1, "the largest error is only {worst} of its bound");
}

/// A chain whose axes are tilted by δ (for instance by writing 1.5708 for π/2): the planar chain displaces points by at most
/// 2 δ Σ reach.
#[test]
fn straightening_axes_displaces_no_point_beyond_the_bound() {
    let robot = |tilt: f64| {
        let b = Part::hinge("two", "one", [tilt.sin(), 0.0, tilt.cos()]).at([0.5, 0.0, 0.0]);
        let tip = Part::new("tip", "two", "fixed", Z, [0.4, 0.0, 0.0]).massless();
        chain(&[Part::hinge("one", "base", Z).weighing(1.0, [1.0; 3]), b.weighing(1.0, [1.0; 3]), tip])
    };
    for tilt in [4e-6, 1e-3, 0.1] {
        let chain = robot(tilt);
        assert!(chain.to_planar().is_err());
        assert!(chain.to_planar_within(tilt * 0.9).is_err());
        let flat = chain.to_planar_within(tilt * 1.1).unwrap();
        assert!((flat.tilt - tilt).abs() < 1e-9 + tilt * 1e-6, "{} {tilt}", flat.tilt);
        let bound = 2.0 * tilt * (0.9 + 0.4);
        let tip = chain.frame("tip").unwrap();
        let mut worst = 0.0_f64;
        for k in 0..50 {
            let q = [0.3 * f64::from(k), 1.0 - 0.17 * f64::from(k)];
            let (mut ws, mut flat_ws) = (chain.workspace(), flat.chain.workspace());
            let exact = ws.update(&chain, &q).unwrap().pose(tip).translation;
            let shadow = flat_ws.update(&flat.chain, &q).unwrap().pose(tip);
            let straight = flat.lift_pose(tip, &shadow).translation;
            worst = worst.max((exact - straight).norm());
        }
        assert!(worst <= bound && worst > bound * 0.1, "{tilt}: {worst} against {bound}");
    }
}

/// Whether a surface can be reached is decided for surfaces at rest only.
#[test]
fn moving_surfaces_are_never_excluded_as_unreachable() {
    let chain = Chain::from_urdf_str(&planar2(), &LoadOptions::default()).unwrap();
    let obstacle = half_space([2.0, 0.0, 0.0], -Vector3::x());
    let motion = Some(Oscillation { amplitude: Vector3::x() * 2.0, frequency: 1.0, phase: 0.0 }.into());
    let piston = surface("piston", obstacle, Default::default());
    let count = |motion| touching(&chain, &[Surface { motion, ..piston.clone() }]).len();
    assert_eq!(count(None), 0);
    assert!(count(motion) > 0);
}

/// A scene with a stiff controller is integrated by Radau's method, with the result of the closed form.
#[test]
fn a_stiff_controller_selects_the_implicit_integrator() {
    let stiff =
        WALL.replace("duration = 1.5", "duration = 1.0\ncontroller = \"pd\"\nkp = 2e6\nkd = 2e6\ntarget = [0.8, -1.6]");
    let stiff = stiff
        .replace("tolerance = 1e-12", "tolerance = 1e-7")
        .replace("qd = [0.3, -0.9]", "")
        .replace("q = [0.7854, -1.5708]", "q = [0.78, -1.57]");
    let scene = scene(&planar2(), &stiff);
    let plan = scene.plan().unwrap();
    assert_eq!(plan.simulation.integrator, carom_sim::Integrator::Radau, "{:?}", plan.kept);
    let run = plan.simulation.run(&plan.q, &plan.qd, 1.0).unwrap();
    assert!(run.summary.statistics.steps < 2000, "{:?}", run.summary.statistics);
    // kd q̇ = kp (target − q): q − target decays as exp(−t), except for the sag under gravity (1e-5 of it).
    let share = (-1.0_f64).exp();
    for (q, (start, target)) in run.summary.last.q.iter().zip([(0.78, 0.8), (-1.57, -1.6)]) {
        assert!((q - (target + (start - target) * share)).abs() < 1e-3 * 0.03, "{q}");
    }
}

/// A planar robot whose tip sticks to the floor, or is latched to it, moves in space as in its plane: the row of the contact across the
/// plane, which no joint moves, is rounding. As the robot turns about the point of its tip, its work is that of its weight.
#[test]
fn a_planar_robot_sticks_in_space_as_in_its_plane() {
    let link = |name: &str, parent: &str, x: f64| {
        Part::hinge(name, parent, [0.0, -1.0, 0.0]).at([x, 0.0, 0.0]).com([0.2, 0.0, 0.0]).weighing(0.8, [0.02; 3])
    };
    let cart = Part { joint: "prismatic", axis: X, at: [0.0, 0.0, 0.6], ..link("a", "base", 0.0) };
    let tip = shape(&ball(0.03), [0.4, 0.0, 0.0], O);
    let robot = urdf(&[cart, link("b", "a", 0.0), link("c", "b", 0.4).with(tip)]);
    // The tip's lowest point is on the floor: 0.6 − 0.4 sin(a) − 0.4 sin(a + b) = 0.03.
    let first = -0.46288903843013474_f64;
    let second = -((0.57 + 0.4 * first.sin()) / 0.4).asin() - first;
    for (friction, latch) in [(2.0, false), (0.0, true)] {
        let text = |model: &str| {
            format!(
                "[robot]\nurdf = 'robot.urdf'\nq = [0, {first}, {second}]\nqd = [0, 0, 0]\n[[surface]]\nname = 'floor'\n\
                 shape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n[contact]\nlaw = 'newton'\nrestitution = 0\n\
                 friction = {friction}\nlatch = {latch}\n[run]\nduration = 0.15\ngravity = [0, 0, -9.81]\ntolerance = 1e-10\n{model}"
            )
        };
        let run = |model: &str| {
            let scene = scene(&robot, &text(model));
            let plan = scene.plan().unwrap();
            let mut forces = Vec::new();
            let sampling = carom_sim::Sampling { every: Some(0.01), ..Default::default() };
            let mut see = |seen: carom_sim::Seen| {
                if let carom_sim::Seen::Contacts(_, contacts) = seen {
                    forces.extend(contacts.iter().map(|contact| contact.force));
                }
            };
            (plan.stream(scene.duration, sampling, &mut see).unwrap().last, forces)
        };
        let ((flat, pushed), (space, also)) = (run(""), run("model = 'full'"));
        assert!(pushed.len() >= 10 && pushed.len() == also.len(), "{} {}", pushed.len(), also.len());
        let moved = (flat.q[2] - second).abs();
        assert!(moved > 0.01, "moved by {moved} rad");
        for (a, b) in flat.q.iter().chain(&flat.qd).zip(space.q.iter().chain(&space.qd)) {
            assert!((a - b).abs() < 1e-9, "{flat:?} {space:?}");
        }
        for (a, b) in pushed.iter().zip(&also) {
            assert!((a - b).norm() < 1e-7 * a.norm(), "{a} {b}");
        }
    }
}
