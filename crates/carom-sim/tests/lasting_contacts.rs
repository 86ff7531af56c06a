//! Beginning and end of lasting contacts, and time steps while several last.

use carom_chain::Chain;
use carom_contact::{Mesh, Obstacle};
use carom_impact::Energetic;
use carom_sim::{ContactMode, ContactRule, Drive, EventKind, Simulation, Summary};
use carom_testing::build::{O, Part, X, ball, chain, free, shape, stl, urdf};
use carom_testing::files::Folder;
use carom_testing::scenes::{DOWN, G, among, kinds, level, newton, on_floor, scene, shipped, surface};
use carom_testing::tables::numbers;
use nalgebra::{Isometry3, Vector3};

fn over(chain: Chain, obstacle: Obstacle, restitution: f64) -> Simulation {
    let ground = surface("ground", obstacle, newton(restitution, 0.0));
    Simulation { gravity: Vector3::zeros(), ..among(chain, &[ground]) }
}

/// A free body of 1 kg with a collision shape.
fn body(element: &str) -> Chain {
    free(1.0, [0.004; 3], &shape(element, O, O))
}

/// A ball of radius r on top of a sphere of radius R leaves it at once if v² > g (R + r), and slides at first if not.
#[test]
fn a_fast_ball_leaves_the_top_of_a_sphere_at_once() {
    let (post, own) = (0.5, 0.1);
    let mut sim = over(body(r#"<sphere radius="0.1"/>"#), Obstacle::sphere(Vector3::zeros(), post).unwrap(), 0.0);
    sim.gravity = DOWN;
    let q = [0.0, 0.0, post + own, 0.0, 0.0, 0.0, 1.0];
    for (share, leaves) in [(0.99, false), (1.01, true)] {
        let v = f64::sqrt(share * G * (post + own));
        let run = sim.run(&q, &[v, 0.0, 0.0, 0.0, 0.0, 0.0], 0.1).unwrap();
        if leaves {
            assert!(run.events.is_empty(), "{:?}", kinds(&run));
            // A parabola, on which the tolerance of 1e-9 applies to some steps.
            let exact = [v * 0.1, 0.0, post + own - G * 0.005];
            let off = run.summary.last.q.iter().zip(exact).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()));
            assert!(off < 1e-8, "{:?} against {exact:?}", run.summary.last.q);
        } else {
            assert_eq!(kinds(&run), ["sliding", "lift-off"]);
        }
    }
}

/// A box that starts in the instant of its flat impact on a table rebounds with e, without rotation: the impact is at all
/// its corners, not at one nearest point.
#[test]
fn a_box_that_starts_with_a_flat_impact_rebounds_without_rotation() {
    let table = Isometry3::translation(0.1, -0.2, -0.05);
    let table = Obstacle::cuboid(table, Vector3::new(1.0, 1.0, 0.1)).unwrap();
    let sim = over(body(r#"<box size="0.2 0.2 0.2"/>"#), table, 0.5);
    let run = sim.run(&[0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0], &[0.0, 0.0, -1.0, 0.0, 0.0, 0.0], 0.1).unwrap();
    let last = &run.summary.last;
    assert!(last.qd[3..].iter().all(|w| w.abs() < 1e-9), "{last:?}");
    assert!((last.qd[2] - 0.5).abs() < 1e-9, "{last:?}");
    assert_eq!(kinds(&run), ["several"]);
}

/// A tetrahedron with a horizontal face through the origin: faces on a mesh take time steps.
fn plateau() -> Obstacle {
    let corners = [[-3.0, -3.0, 0.0], [3.0, -3.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, -2.0]].map(Vector3::from);
    let solid = Mesh::from_triangles(corners.to_vec(), vec![[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 3]]).unwrap();
    Obstacle::mesh(solid, Isometry3::identity()).unwrap()
}

/// A square of two triangles without a volume has no inside: a box rests on it however the triangles are oriented.
#[test]
fn a_box_rests_on_an_open_mesh_of_either_orientation() {
    let corners = [[-3.0, -3.0, 0.0], [3.0, -3.0, 0.0], [3.0, 4.0, 0.0], [-3.0, 4.0, 0.0]].map(Vector3::from);
    for triangles in [[[0, 1, 2], [0, 2, 3]], [[0, 2, 1], [0, 3, 2]]] {
        let square = Mesh::from_triangles(corners.to_vec(), triangles.to_vec()).unwrap();
        let ground = Obstacle::mesh(square, Isometry3::identity()).unwrap();
        let mut sim = over(body(r#"<box size="0.2 0.2 0.1"/>"#), ground, 0.3);
        sim.gravity = DOWN;
        let run = sim.run(&[0.3, 0.1, 0.05, 0.0, 0.0, 0.0, 1.0], &[0.0; 6], 0.3).unwrap();
        assert_eq!(kinds(&run), ["stepping", "rest"]);
        assert!((run.summary.last.q[2] - 0.05).abs() < 1e-12, "{:?}", run.summary.last);
    }
}

/// After the last closed contact the time of ten steps of full length passes before the motion is event-driven again. The impact is
/// in the first step, which is the shortest: an impact within a step has an error in proportion to the step.
#[test]
fn free_motion_begins_ten_full_time_steps_after_the_last_contact() {
    let mut sim = over(body(r#"<box size="0.2 0.2 0.2"/>"#), plateau(), 0.5);
    sim.contact_step = 2.0_f64.powi(-10);
    let run = sim.run(&[0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0], &[0.0, 0.0, -1.0, 0.0, 0.0, 0.0], 0.1).unwrap();
    assert_eq!(kinds(&run), ["stepping", "free"]);
    assert!(matches!(run.events[1].kind, EventKind::Mode { mode: ContactMode::Free }));
    let steps = (run.events[1].time - run.events[0].time) / sim.contact_step;
    assert!((9.5..11.0).contains(&steps), "{steps}");
    assert!((run.summary.last.qd[2] - 0.5).abs() < 1e-9, "{:?}", run.summary.last);
    // It leaves the table at the end of the first step, of half the shortest length, with 0.5 m/s.
    let late = 0.1 + 0.5 * 0.1 - run.summary.last.q[2];
    let first = sim.contact_step / 256.0 / 2.0;
    assert!((late - 0.5 * first).abs() < 1e-12, "{late:e}");
    assert!((run.summary.statistics.step_error / late - 1.0).abs() < 1e-6, "{:?}", run.summary.statistics);
}

/// A step of half the rounding of times moves none on: what is left of a run after its last step may be as short.
#[test]
fn time_steps_end_one_rounding_before_the_end_of_the_run() {
    let mut sim = over(body(r#"<box size="0.2 0.2 0.02"/>"#), plateau(), 0.0);
    sim.gravity = DOWN;
    sim.contact_step = 2.0_f64.powi(-10);
    let end = 2.0_f64.powi(-7).next_up();
    let run = sim.run(&[-1.0, -1.5, 0.01, 0.0, 0.0, 0.0, 1.0], &[0.8, 0.0, 0.0, 0.0, 0.0, 0.0], end).unwrap();
    assert_eq!(run.summary.last.time, end);
    assert_eq!(run.summary.statistics.contact_steps, 16);
}

/// A box that slides on a mesh stops after v²/(2 μ g), within the estimated error of the time steps, which falls with the square
/// root of the tolerance.
#[test]
fn the_estimated_error_of_time_steps_holds_the_distance_of_a_stop() {
    let (mu, v) = (0.3, 0.8);
    let mut sim = over(body(r#"<box size="0.2 0.2 0.02"/>"#), plateau(), 0.0);
    sim.touches.iter_mut().for_each(|touch| touch.contact = newton(0.0, mu));
    sim.gravity = DOWN;
    let mut last = f64::INFINITY;
    for tolerance in [1e-8, 1e-11, 1e-13] {
        let sim = Simulation { tolerance, ..sim.clone() };
        let run = sim.run(&[-1.0, -1.5, 0.01, 0.0, 0.0, 0.0, 1.0], &[v, 0.0, 0.0, 0.0, 0.0, 0.0], 0.4).unwrap();
        let estimate = run.summary.statistics.step_error;
        let off = run.summary.last.q[0] + 1.0 - v * v / (2.0 * mu * G);
        assert!(run.summary.statistics.contact_steps > 100);
        assert!(off.abs() <= estimate + 1e-12, "{off:e} with the estimate {estimate:e} at {tolerance:e}");
        assert!(estimate < last, "{estimate:e} at {tolerance:e}");
        last = 0.5 * estimate;
    }
}

/// One mass on a spring and a damper in time steps: their force is that of the state at the end of each step,
/// m (v⁺ − v)/h = k (target − x⁺) − d v⁺, which is stable for any stiffness. Without them the velocity stays.
#[test]
fn time_steps_are_implicit_in_the_controller() {
    let chain = chain(&[Part::slider("mass", "base", X).weighing(2.0, [1.0; 3])]);
    let (mass, target, h) = (2.0, 0.3, 2.0_f64.powi(-7));
    for (kp, kd) in [(0.0, 0.0), (50.0, 0.0), (50.0, 4.0), (1e7, 3.0)] {
        let drive = Drive::Pd(carom_sim::Pd { kp: kp.into(), kd: kd.into(), target: vec![target] });
        let sim = Simulation { drive, stepping: true, contact_step: h, ..Simulation::new(chain.clone(), Vec::new()) };
        let (mut x, mut v) = (0.1_f64, 1.5_f64);
        for steps in 1..=8 {
            let last = sim.run(&[0.1], &[1.5], f64::from(steps) * h).unwrap().summary.last;
            let (after, force) = (last.qd[0], kp * (target - last.q[0]) - kd * last.qd[0]);
            // Both sides are sums of terms of this size.
            let size = mass * (v.abs() + after.abs()) + h * kp * (x.abs() + target) + h * kd * v.abs();
            assert!((mass * (after - v) - h * force).abs() < 1e-14 * size, "kp {kp}, kd {kd}, step {steps}: {last:?}");
            assert!((last.q[0] - x - h / 2.0 * (v + after)).abs() < 1e-15);
            (x, v) = (last.q[0], after);
        }
        assert!(kp > 0.0 || v == 1.5);
    }
}

/// A ball bounces to rest on a floor while it slides. At rest its momentum from gravity has passed through the floor, by whatever
/// impacts, and the friction of these and of the lasting contact is μ of it: v = v₀ − μ g t. The jump over the last impacts
/// must not change that, however long it is.
#[test]
fn an_accumulation_has_the_friction_of_all_its_impacts() {
    let (mu, e, v, drop, end) = (0.3, 0.5, 5.0, 0.05, 0.4);
    for zeno_time in [1e-5, 1e-4, 1e-3_f64] {
        let contact = ContactRule::new(Energetic { restitution: e, friction: mu });
        let sim = on_floor(body(&ball(0.1)), contact);
        let sim = Simulation { tolerance: 1e-12, zeno_time, ..sim };
        let run = sim.run(&[0.0, 0.0, 0.1 + drop, 0.0, 0.0, 0.0, 1.0], &[v, 0.0, 0.0, 0.0, 0.0, 0.0], end).unwrap();
        let kinds = kinds(&run);
        assert_eq!(kinds[kinds.len() - 2..], ["zeno", "sliding"], "{kinds:?}");
        // The ball has turned, and q̇ is in its axes.
        let speed = Vector3::from_column_slice(&run.summary.last.qd[..3]).norm();
        let off = speed - (v - mu * G * end);
        // Some dozens of steps with a tolerance of 1e-12; and of the jump by the midpoint rule, while the ball turns by
        // 20 rad/s, v (ω T)³.
        let most = 1e-10 + v * (20.0 * zeno_time).powi(3);
        assert!(off.abs() < most, "{off:e} at a Zeno time of {zeno_time}");
    }
}

/// An arm whose PD controllers press its last link on a table is stiff: its rates are 1e3 /s while it stands. The implicit integrator
/// takes over, each time for longer. The end does not depend on the tolerance, and the arm stands.
#[test]
fn an_arm_that_presses_on_a_table_comes_to_rest_in_few_evaluations() {
    let scene = shipped("pressed");
    let plan = scene.plan().unwrap();
    let ends: Vec<Summary> = [1e-9, 1e-11]
        .iter()
        .map(|tolerance| {
            let sim = Simulation { tolerance: *tolerance, ..plan.simulation.clone() };
            sim.run(&plan.q, &plan.qd, 1.0).unwrap().summary
        })
        .collect();
    // The times of the bounces differ by their tolerance; the motion after them forgets it.
    let off = ends[0].last.q.iter().zip(&ends[1].last.q).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    assert!(off < 1e-8, "{off:e}");
    assert!(ends.iter().all(|end| end.last.qd.iter().all(|rate| rate.abs() < 1e-4)));
    // 177 000 if the explicit integrator is tried again every 10 ms.
    let cost = &ends[0].statistics;
    assert!(cost.evaluations < 60_000 && cost.contact_steps == 0, "{cost:?}");
}

/// A prism over a regular polygon of 20 corners, of height 0.25 m: a hull of 40 corners, whose contacts with a plane are watched together.
/// Its base falls flat on the floor: at t = √(2h/g), on all 20 corners at once, and it stays.
#[test]
fn a_hull_of_many_corners_lands_flat_and_rests() {
    let corner = |k: usize, z: f64| {
        let angle = std::f64::consts::TAU * (k % 20) as f64 / 20.0;
        [0.1 * angle.cos(), 0.1 * angle.sin(), z]
    };
    let sides = (0..20).flat_map(|k| {
        [
            [[0.0, 0.0, 0.125], corner(k, 0.125), corner(k + 1, 0.125)],
            [[0.0, 0.0, -0.125], corner(k + 1, -0.125), corner(k, -0.125)],
            [corner(k, -0.125), corner(k + 1, -0.125), corner(k, 0.125)],
            [corner(k + 1, -0.125), corner(k + 1, 0.125), corner(k, 0.125)],
        ]
    });
    let folder = Folder::new();
    let file = folder.write("prism.stl", stl(sides));
    let mut sim = over(body(&format!(r#"<mesh filename="{}"/>"#, file.display())), level(), 0.0);
    sim.gravity = DOWN;
    let height = 0.05;
    let run = sim.run(&[0.0, 0.0, 0.125 + height, 0.0, 0.0, 0.0, 1.0], &[0.0; 6], 0.5).unwrap();
    let hit = run.events.first().unwrap();
    let exact = f64::sqrt(2.0 * height / G);
    assert!((hit.time - exact).abs() < 1e-9, "{} for {exact}", hit.time);
    assert!(matches!(&hit.kind, EventKind::Several { touches, .. } if touches.len() == 20), "{:?}", hit.kind);
    assert!(!run.events.iter().any(|event| matches!(event.kind, EventKind::Steps { .. })));
    // Gaps are closed to 1e-9, and single precision has the height of the corners exactly.
    assert!((run.summary.last.q[2] - 0.125).abs() < 1e-8, "{:?}", run.summary.last.q);
}

/// Number of time steps in a run of a scene of the repository from this state.
fn time_steps(scene: &str, q: &str, qd: &str, duration: f64) -> usize {
    let simulation = shipped(scene).plan().unwrap().simulation;
    simulation.run(&numbers(q), &numbers(qd), duration).unwrap().summary.statistics.contact_steps
}

/// Slip that stays slow after it began, of a foot of a quadruped that falls tilted: a stiff equation, which the implicit integrator does not
/// follow beyond a kink. The explicit one does with more steps, and no time steps are needed.
#[test]
fn slow_slip_that_the_implicit_integrator_does_not_follow_takes_no_time_steps() {
    let q = "-0.03356946104196515 0.018720311594836538 0.4567796438430465 0.14154446188702502 0.07181361113006499 -0.0710085037169554 0.9847668571623699 0.2994967395006248 0.429203983339598 -1.3031097072378772 -0.1446217412266666 0.4268997664273185 -1.6196173089764183 -0.21285385652991384 0.9266428098480659 -1.3096139268933142 0.18845329267556024 0.8730129438512846 -1.1967173671794986";
    let qd = "0.20453249359533932 0.16680742441743746 -0.11216966787406035 -0.09816210792877955 -0.9293711919589503 -0.7198387506247635 0.8310612048782484 0.40939245603937047 -0.9499171004169229 -0.46529500870503604 0.5361128194987816 -0.4102416009237033 -0.0593427802196731 0.22787514350279414 -0.8435360001431319 -0.6378755041552109 -0.41585794107336727 0.8291163984669598";
    assert_eq!(time_steps("quadruped", q, qd, 0.5), 0);
}

/// A probe that slides over the border of a table's face, whose gap has another curvature on either side. With the mean of both for its
/// acceleration it opened, and closed by the motion every 6e-8 s, until time steps were taken.
#[test]
fn a_probe_that_slides_over_the_border_of_a_face_takes_no_time_steps() {
    let q = "-0.255450273531467 0.7253344719666563 0.2532613232406475 0.802944542789956 -0.005468107454990889 0.65205574235964 -0.15459553461385286";
    let qd = "-0.40809898112556975 -0.20775739240410018 -0.003306518425865157 -0.43594539589391434 0.4377400651292773 -0.3450594681704363 -0.39526114786828126";
    assert_eq!(time_steps("table", q, qd, 0.8), 0);
}

/// A slider that a constant force presses against its elastic limit bounces for ever, unless its bounces are lower than the tolerance
/// times the reach: these are as many as the time of the run is long, and end in one event.
#[test]
fn elastic_bounces_end_only_below_the_tolerance() {
    let arm = Part::hinge("arm", "base", X).limits(-1.0, 1.0, 9.0);
    let rod = Part::slider("rod", "arm", X).at([0.0, 0.0, 1.0]).limits(-1.0, 0.5, 9.0).weighing(1.0, [0.01; 3]);
    let text = "[robot]\nurdf = \"robot.urdf\"\nq = [0, 0]\n[contact]\nlimit_restitution = 1\n\
                [run]\nduration = 1\ntolerance = 1e-7\ngravity = [0, 0, 0]\ncontroller = \"constant\"\ntorque = [0, 8]\n";
    let sim = scene(&[("robot.urdf", &urdf(&[arm, rod]))], text).unwrap().plan().unwrap().simulation;
    let height = 1e-3;
    let fall = (2.0 * height / 8.0_f64).sqrt();
    let run = sim.run(&[0.0, 0.5 - height], &[0.0; 2], 20.0 * fall).unwrap();
    assert_eq!(run.events.iter().filter(|event| event.kind.name() == "limit").count(), 10);
    let run = sim.run(&[0.0, 0.5 - 1e-9], &[0.0; 2], 1.0).unwrap();
    let kinds = kinds(&run);
    assert_eq!((kinds[0], run.summary.statistics.contact_steps), ("limit", 0), "{kinds:?}");
    let last = run.summary.last.q[1];
    assert!(kinds.len() < 5 && (last - 0.5).abs() < 1e-12, "{kinds:?} {last}");
}
