//! Scenes with several robots: an arm catches a ball, two arms collide; impulses and energies by formulas of their own, robots
//! that do not touch move as each alone, and what a scene refuses.

use carom_sim::{Drive, Event, EventKind, Plan, Scene, Simulation, Trajectory};
use carom_testing::build::{Part, Z, ball, planar2_mass, rooted};
use carom_testing::files::{Folder, ROOT};
use carom_testing::scenes::G;
use nalgebra::{Matrix2, Vector2, Vector3};

fn shipped(name: &str) -> (Scene, Plan, Trajectory) {
    let scene = Scene::from_file(format!("{ROOT}/scenes/{name}.toml")).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let plan = scene.plan().unwrap();
    let run = plan.run(scene.duration).unwrap();
    (scene, plan, run)
}

fn of_text(text: &str) -> Result<Scene, String> {
    Scene::from_toml(text, format!("{ROOT}/scenes")).map_err(|e| e.to_string())
}

fn run(text: &str) -> (Plan, Trajectory) {
    let scene = of_text(text).unwrap();
    let plan = scene.plan().unwrap();
    let run = plan.run(scene.duration).unwrap();
    (plan, run)
}

/// Position of a point of planar2's forearm, given in the axes of the forearm, and the columns of its Jacobian, in the arm's
/// plane.
fn forearm(q: [f64; 2], own: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
    let turn = |a: f64, v: Vector2<f64>| Vector2::new(a.cos() * v.x - a.sin() * v.y, a.sin() * v.x + a.cos() * v.y);
    let elbow = turn(q[0], Vector2::new(0.45, 0.0));
    let arm = turn(q[0] + q[1], own);
    let across = |v: Vector2<f64>| Vector2::new(-v.y, v.x);
    (elbow + arm, Matrix2::from_columns(&[across(elbow + arm), across(arm)]))
}

fn two(numbers: &[f64]) -> [f64; 2] {
    numbers.try_into().unwrap()
}

fn first_impact(run: &Trajectory) -> &Event {
    run.events.iter().find(|event| matches!(event.kind, EventKind::Impact { .. })).unwrap()
}

fn impulse(event: &Event) -> Vector3<f64> {
    let EventKind::Impact { hit, .. } = &event.kind else { panic!("{event:?}") };
    hit.impulse
}

/// The bounce: the ball falls by the height of its start over the forearm, its impulse is its change of momentum, the arm
/// takes the opposite one, M Δq̇ = −Jᵀp, and the normal velocity is reversed to the share e. In the end the forearm carries it.
#[test]
fn an_arm_catches_a_ball_that_bounces_off_its_forearm() {
    let (_, plan, run) = shipped("catch");
    let sim = &plan.simulation;
    let event = first_impact(&run);
    let touch = &sim.touches[event.kind.touch().unwrap()];
    assert_eq!((touch.link(), touch.other_link()), (Some("arm/link2"), Some("ball/ball")));
    // The forearm sinks by some millimetres before, under its own weight.
    let drop = 0.7 - 0.05 - 0.03 - 0.45 * 0.8_f64.sin();
    assert!((event.time - (2.0 * drop / G).sqrt()).abs() < 5e-3, "{}", event.time);

    let (mass, inertia, e) = (0.06, 1e-4, 0.5);
    let jump =
        |range: std::ops::Range<usize>| -> Vec<f64> { range.map(|v| event.qd_plus[v] - event.qd_minus[v]).collect() };
    // The ball has not turned before: the axes of its body are those of the world.
    let (arm, linear, angular) = (jump(0..2), Vector3::from_vec(jump(2..5)), Vector3::from_vec(jump(5..8)));
    let momentum = linear * mass;
    let onto_arm = impulse(event);
    assert!((onto_arm + momentum).norm() < 1e-12, "{onto_arm} {momentum}");
    let q = two(&event.q[..2]);
    let centre = Vector3::new(event.q[2], event.q[3], event.q[4]);
    let level = q[0] + q[1];
    let normal = Vector3::new(-level.sin(), 0.0, level.cos());
    let lever = -normal * 0.05;
    assert!((angular * inertia - lever.cross(&momentum)).norm() < 1e-12, "{angular}");
    // The point of the contact in the axes of the forearm: 3 cm over its middle.
    let elbow = Vector3::new(0.45 * q[0].cos(), 0.0, 0.45 * q[0].sin());
    let along = Vector3::new(level.cos(), 0.0, level.sin()).dot(&(centre - elbow));
    let (point, jacobian) = forearm(q, Vector2::new(along, 0.03));
    assert!((Vector3::new(point.x, 0.0, point.y) - (centre + lever)).norm() < 1e-9, "{point}");
    let found = planar2_mass(q[1]) * Vector2::new(arm[0], arm[1]);
    let wanted = jacobian.transpose() * Vector2::new(onto_arm.x, onto_arm.z);
    assert!((found - wanted).norm() < 1e-10, "{found} {wanted}");
    // Newton's restitution of the normal velocity between the two.
    let approach = |qd: &[f64]| {
        let arm = jacobian * Vector2::new(qd[0], qd[1]);
        normal.dot(&(Vector3::new(qd[2], qd[3], qd[4]) - Vector3::new(arm.x, 0.0, arm.y)))
    };
    let (before, after) = (approach(&event.qd_minus), approach(&event.qd_plus));
    assert!((before + (2.0 * G * drop).sqrt()).abs() < 0.05 && (after + e * before).abs() < 1e-10, "{before} {after}");

    // In the end it rests on the forearm, which carries its weight.
    let last = &run.summary.contacts;
    let [contact] = last.as_slice() else { panic!("{last:?}") };
    assert!((contact.normal_force - mass * G).abs() < 0.02 * mass * G, "{contact:?}");
    assert!(contact.gap.abs() < 1e-9);
    assert!(run.summary.energy.error().abs() < 1e-7, "{:?}", run.summary.energy);
}

/// The impulse by the change of the momenta of either arm, with M and J by their own formulas, is one and the same; the kinetic
/// energy by these formulas falls, and the normal part of the work is restituted to the share e².
#[test]
fn two_arms_collide_with_opposite_impulses() {
    let (_, plan, run) = shipped("two_arms");
    let sim = &plan.simulation;
    assert!(plan.flat.is_some(), "both move in one plane");
    let event = first_impact(&run);
    let touch = &sim.touches[event.kind.touch().unwrap()];
    assert_eq!((touch.link(), touch.other_link()), (Some("left/tip"), Some("right/link2")));
    let [left, right] = [0, 2].map(|k| two(&event.q[k..k + 2]));
    let jumps = [0, 2].map(|k| Vector2::from_fn(|i, _| event.qd_plus[k + i] - event.qd_minus[k + i]));
    let (point, of_left) = forearm(left, Vector2::new(0.45, 0.0));
    // The right arm stands at x = 1.3 m and is turned by half a turn.
    let mirrored = Vector2::new(1.3 - point.x, -point.y);
    let elbow = Vector2::new(0.45 * right[0].cos(), 0.45 * right[0].sin());
    let (s, c) = (right[0] + right[1]).sin_cos();
    let own = Vector2::new(
        c * (mirrored - elbow).x + s * (mirrored - elbow).y,
        c * (mirrored - elbow).y - s * (mirrored - elbow).x,
    );
    assert!((own.y.abs() - 0.03).abs() < 1e-5 && (0.0..0.38).contains(&own.x), "on the face of the forearm: {own}");
    let (_, of_right) = forearm(right, own);
    let of_right = -of_right;
    let momenta = [left, right].map(|q| planar2_mass(q[1]));
    let impulses = [
        of_left.transpose().try_inverse().unwrap() * momenta[0] * jumps[0],
        of_right.transpose().try_inverse().unwrap() * momenta[1] * jumps[1],
    ];
    let size = impulses[0].norm();
    assert!(size > 0.1 && (impulses[0] + impulses[1]).norm() < 1e-5 * size, "{impulses:?}");
    let energy = |qd: &[f64]| {
        let of = |k: usize| {
            let v = Vector2::new(qd[2 * k], qd[2 * k + 1]);
            0.5 * v.dot(&(momenta[k] * v))
        };
        of(0) + of(1)
    };
    let EventKind::Impact { hit, .. } = &event.kind else { unreachable!() };
    let (before, after) = (energy(&event.qd_minus), energy(&event.qd_plus));
    assert!((hit.energy_before - before).abs() < 1e-10 && (hit.energy_after - after).abs() < 1e-10, "{hit:?}");
    assert!(after < before, "{before} {after}");
    // A run that ends with this impact has lost as much.
    let number = run.events.iter().position(|it| it.time == event.time).unwrap();
    let ended = Simulation { max_events: number + 1, ..sim.clone() }.run(&plan.q, &plan.qd, event.time + 1.0).unwrap();
    let booked = ended.summary.energy.impacts;
    assert!((booked - (before - after)).abs() < 1e-9, "{booked} of {before} {after}");
    // Out of the forearm, towards the tip of the left arm.
    let n = -Vector2::new(-s, c) * own.y.signum();
    let relative = |qd: &[f64]| of_left * Vector2::new(qd[0], qd[1]) - of_right * Vector2::new(qd[2], qd[3]);
    assert!(n.dot(&relative(&event.qd_minus)) < 0.0 && n.dot(&relative(&event.qd_plus)) > 0.0);
    assert!(run.summary.energy.error().abs() < 1e-8, "{:?}", run.summary.energy);
}

/// Two free balls without friction: total momentum is conserved, the masses exchange (1+e) m₁m₂/(m₁+m₂) u along the line of
/// their centres, and the loss is ½ (1−e²) m₁m₂/(m₁+m₂) u².
#[test]
fn two_free_balls_exchange_the_impulse_of_the_formula() {
    let ball = |name: &str, x: f64, y: f64, v: f64| {
        format!(
            "[[robot]]\nname = \"{name}\"\nurdf = \"../robots/ball.urdf\"\nfloating = true\nposition = [{x}, {y}, 0]\n\
             qd = [{v}, 0, 0, 0, 0, 0]\n"
        )
    };
    let text = format!(
        "{}{}[contact]\nlaw = \"newton\"\nrestitution = 0.7\n[run]\nduration = 0.5\n",
        ball("a", 0.0, 0.0, 2.0),
        ball("b", 0.5, 0.06, -1.0)
    );
    let (_, run) = run(&text);
    let [event] = run.events.as_slice() else { panic!("{:?}", run.events) };
    let normal = Vector3::new(-0.08, -0.06, 0.0) / 0.1; // from b to a: 0.06 apart in y, 0.1 in all
    let velocity = |qd: &[f64], k: usize| Vector3::new(qd[k], qd[k + 1], qd[k + 2]);
    let (m, e, approach) = (0.06, 0.7, 3.0 * 0.8);
    let exchanged = normal * (m / 2.0 * (1.0 + e) * approach);
    for (k, sign) in [(0, 1.0), (6, -1.0)] {
        let jump = (velocity(&event.qd_plus, k) - velocity(&event.qd_minus, k)) * m;
        assert!((jump - exchanged * sign).norm() < 1e-9, "{jump} {exchanged}");
    }
    let loss = 0.25 * m * (1.0 - e * e) * approach * approach;
    assert!((run.summary.energy.impacts.abs() - loss).abs() < 1e-9, "{:?}", run.summary.energy);
    assert!((event.time - (0.5 - 0.08) / 3.0).abs() < 1e-9, "{}", event.time);
}

const BALL: &str = "urdf = \"../robots/ball.urdf\"\nfloating = true\n";
const FLOOR: &str =
    "[[surface]]\nname = \"floor\"\nshape = { halfspace = { point = [0, 0, 0], normal = [0, 0, 1] } }\n";
const RUN: &str = "[contact]\nlaw = \"newton\"\nrestitution = 0.6\n[run]\nduration = 0.8\ngravity = [0, 0, -9.81]\n";

/// A bouncing ball and an arm under PD, apart: the motion of each is that of its own scene, its events included.
#[test]
fn robots_that_do_not_touch_move_as_each_alone() {
    let pd = "controller = \"pd\"\nkp = 30\nkd = 2\ntarget = [0.5, 0.4]\n";
    let arm = "urdf = \"../robots/planar2.urdf\"\nq = [0.1, 0.2]\nqd = [0.4, -1]\n";
    let both = format!(
        "[[robot]]\nname = \"arm\"\nposition = [3, 0, 2]\n{arm}{pd}[[robot]]\nname = \"ball\"\n{BALL}position = [0, 0, 1]\n\
         qd = [0.3, 0, 0, 0, 0, 0]\n{FLOOR}{}",
        RUN.replace("[run]", "between_robots = false\n[run]")
    );
    let (plan, together) = run(&both);
    let (_, ball) = run(&format!("[robot]\n{BALL}q = [0, 0, 1, 0, 0, 0, 1]\nqd = [0.3, 0, 0, 0, 0, 0]\n{FLOOR}{RUN}"));
    let (_, arm) = run(&format!("[robot]\n{arm}{RUN}{pd}"));
    let times = |run: &Trajectory| run.events.iter().map(|event| event.time).collect::<Vec<_>>();
    assert_eq!(together.events.len(), ball.events.len());
    for (a, b) in times(&together).iter().zip(times(&ball)) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    // The steps of the integration differ, and with them its error: tolerance 1e-9 over some tens of steps.
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-7);
    let last = &together.summary.last;
    assert!(near(&last.q[..2], &arm.summary.last.q) && near(&last.qd[..2], &arm.summary.last.qd), "{last:?}");
    assert!(near(&last.q[2..], &ball.summary.last.q) && near(&last.qd[2..], &ball.summary.last.qd), "{last:?}");
    // Only the ball can reach the floor; the arm, which touches nothing but its limits, is kept all the same.
    assert!(plan.simulation.touches.iter().all(|touch| touch.link().is_none_or(|link| link == "ball/ball")));
    assert_eq!(plan.simulation.chain.nv(), 8);
    assert!(plan.left_out.iter().all(|it| it.what != "joints" || it.choice.contains("fixed")), "{:?}", plan.left_out);
}

/// Each controller acts on its own robot only, in any order of the robots, and after the first impact too.
#[test]
fn every_robot_obeys_its_own_controller() {
    let arm = "urdf = \"../robots/planar2.urdf\"\nq = [0.1, 0.2]\n";
    // The ball, not this arm, has an impact: it keeps its controller.
    let constant = "controller = \"constant\"\ntorque = [1.5, -0.5]\nafter_impact = \"off\"\n";
    let held = "controller = \"gravity-compensation\"\nrpy = [1.5707963267948966, 0, 0]\n";
    let invariant = "controller = \"impact-invariant\"\nkp = 20\nkd = 3\ntarget = [0.3, 0.1]\n";
    let upright = &format!("{invariant}rpy = [1.5707963267948966, 0, 0]\n");
    let transition = "controller = \"transition\"\ngain = 5\nqd = [0.3, -0.4]\nrpy = [1.5707963267948966, 0, 0]\n";
    let text = |robots: &[(&str, &str)]| {
        let robots = robots.iter().map(|(name, keys)| {
            let body = if *name == "ball" { BALL } else { arm };
            let place = ["ball", "a", "b", "c", "d", "e"].iter().position(|it| it == name).unwrap() * 5;
            format!("[[robot]]\nname = \"{name}\"\nposition = [{place}, 0, 3]\n{body}{keys}")
        });
        format!("{}{FLOOR}{RUN}", robots.collect::<String>())
    };
    let all = text(&[("ball", ""), ("a", constant), ("b", held), ("c", upright), ("d", invariant), ("e", transition)]);
    let (plan, together) = run(&all);
    assert!(matches!(&plan.simulation.drive, Drive::Robots(robots) if robots.len() == 6));
    for (name, keys) in
        [("a", constant), ("b", held), ("c", upright), ("d", invariant), ("e", transition), ("ball", "")]
    {
        let (_, alone) = run(&text(&[(name, keys)]));
        let member = plan.simulation.chain.members().iter().find(|member| member.name == name).unwrap();
        let own = &together.summary.last.q[member.q.clone()];
        let near = own.iter().zip(&alone.summary.last.q).all(|(a, b)| (a - b).abs() < 1e-7);
        assert!(near, "{name}: {own:?} {:?}", alone.summary.last.q);
        if name == "b" {
            assert!(own.iter().zip([0.1, 0.2]).all(|(a, b)| (a - b).abs() < 1e-9), "held against gravity: {own:?}");
        } else {
            let start = if name == "ball" { 0.0 } else { 0.1 };
            let moved = own.iter().take(3).any(|x| (x - start).abs() > 0.01);
            assert!(moved, "{name} moves: {own:?}");
        }
    }
}

/// What wins: a surface or `[[contact.pair]]` over `[contact]`, a later pair over an earlier one; links of a pair have no order,
/// and the name of a robot means all its links.
#[test]
fn the_last_pair_that_sets_a_value_wins() {
    let text = |pairs: &str| {
        let robots: String = ["a", "b", "c"]
            .map(|name| format!("[[robot]]\nname = \"{name}\"\n{BALL}position = [0, 0, {}]\n", name.len()))
            .concat();
        let robots = robots.replacen("[0, 0, 1]", "[1, 0, 1]", 1).replacen("[0, 0, 1]", "[2, 0, 1]", 1);
        format!("{robots}{FLOOR}contact = {{ restitution = 0.7, friction = 0.3 }}\n{RUN}{pairs}")
    };
    let found = |pairs: &str, name: &str| {
        let text = text("").replace("[run]", &format!("{pairs}[run]"));
        let scene = of_text(&text).unwrap();
        let touch = scene.simulation.touches.iter().find(|touch| touch.name == name);
        let touch = touch.unwrap_or_else(|| panic!("{:?}", scene.simulation.touches));
        (touch.contact.law.restitution(), touch.contact.law.friction())
    };
    let pair = |keys: &str| format!("[[contact.pair]]\n{keys}\n");
    assert_eq!(found("", "a/ball on b/ball"), (0.6, 0.0));
    assert_eq!(found("", "a/ball on floor"), (0.7, 0.3));
    let turned = pair("link = \"b/ball\"\nsurface = \"a/ball\"\nrestitution = 0.2");
    assert_eq!(found(&turned, "a/ball on b/ball"), (0.2, 0.0));
    assert_eq!(found(&turned, "a/ball on c/ball"), (0.6, 0.0));
    let robot = pair("link = \"b\"\nfriction = 0.9");
    assert_eq!(found(&(turned.clone() + &robot), "a/ball on b/ball"), (0.2, 0.9));
    assert_eq!(found(&robot, "b/ball on floor"), (0.7, 0.9));
    assert_eq!(found(&robot, "a/ball on floor"), (0.7, 0.3));
    let ground = pair("link = \"a/ball\"\nsurface = \"floor\"\nrestitution = 0.5");
    assert_eq!(found(&ground, "a/ball on floor"), (0.5, 0.3));
    let later = pair("surface = \"a\"\nlink = \"b\"\nrestitution = 0.4");
    assert_eq!(found(&(turned + &robot + &later), "a/ball on b/ball"), (0.4, 0.9));
}

/// Two arms of reach 0.9 m: within 1.8 m every shape may touch every other, beyond no pair can, and the plan says why.
#[test]
fn robots_out_of_each_others_reach_make_no_pairs() {
    let arms = |x: f64| {
        let arm = "urdf = \"../robots/planar2.urdf\"\n";
        let text = format!("[[robot]]\nname = \"a\"\n{arm}[[robot]]\nname = \"b\"\n{arm}position = [{x}, 0, 0]\n{RUN}");
        let scene = of_text(&text).unwrap();
        let names = scene.simulation.touches.iter().filter(|touch| touch.link().is_some() && !touch.is_part());
        let names: Vec<String> = names.map(|touch| touch.name.clone()).collect();
        (names, scene.out_of_reach, of_text(&text).unwrap().plan().unwrap())
    };
    let (near, left_out, _) = arms(0.8);
    assert_eq!((near.len(), left_out.len()), (9, 0), "{near:?}");
    // Tip and tip reach 0.9 m each.
    assert!(arms(1.79).0.contains(&"a/tip on b/tip".to_owned()));
    let (far, left_out, plan) = arms(1.81);
    assert!(!far.contains(&"a/tip on b/tip".to_owned()));
    let (_, why) = left_out.iter().find(|(pair, _)| pair == "a/tip on b/tip").unwrap();
    assert_eq!(why.to_string(), "their reaches add up to 1.800002 m, their first joints are 1.810000 m apart");
    assert!(plan.left_out.iter().any(|it| it.choice == "a/tip on b/tip"), "{:?}", plan.left_out);
    assert!(arms(3.0).0.is_empty());
}

#[test]
fn refusals_name_the_robot_and_the_remedy() {
    let arm = "urdf = \"../robots/planar2.urdf\"\n";
    let two = |first: &str, second: &str| {
        format!(
            "[[robot]]\nname = \"a\"\n{arm}{first}[[robot]]\nname = \"b\"\nposition = [3, 0, 0]\n{arm}{second}{RUN}"
        )
    };
    for (text, said) in [
        (two("q = [1]\n", ""), "[[robot]] 'a' q has 1 numbers, 2 are needed (shoulder, elbow)"),
        (two("", "qd = [0, 0, 0]\n"), "[[robot]] 'b' qd has 3 numbers, 2 are needed (shoulder, elbow)"),
        (two("", "controller = \"pd\"\n"), "[[robot]] 'b' controller = \"pd\" needs the key kp"),
        (two("", "kp = 3\n"), "[[robot]] 'b' kp is not read by the chosen controller"),
        (two("controller = \"constant\"\ntorque = [1]\n", ""), "[[robot]] 'a' torque has 1 numbers, 2 are needed"),
        (two("", "tip = \"hand\"\n"), "[[robot]] 'b' tip = \"hand\": no link is named 'hand'"),
        (two("", "position = [1, 0, 0]\n"), "duplicate key"),
        (two("", "").replace("\"b\"", "\"a\""), "[[robot]] robot name 'a' is used for two robots: rename one"),
        (
            two("controller = \"constant\"\ntorque = [1, 1]\n", "")
                + "controller = \"constant\"\ntorque = [1, 1, 1, 1]\n",
            "[run] has keys of a controller, and so has a [[robot]]: give each robot its own",
        ),
        (two("", "") + "controller = \"transition\"\ngain = 3\n", "is for one robot: give it in its [[robot]]"),
        (
            two("", "").replace("[run]", "links = [[\"a/tip\", \"b/tip\"]]\n[run]"),
            "links of different robots may touch without being listed: remove the pair, or set between_robots = false",
        ),
        (
            format!("[[robot]]\nname = \"a\"\n{BALL}position = [0, 0, 1]\nq = [0, 0, 1, 0, 0, 0, 1]\n{RUN}"),
            "[[robot]] 'a' q has 7 numbers, of which the first seven are the pose of the floating base",
        ),
        (
            format!("[robot]\n{arm}q = [0, 0]\n{RUN}").replace("[run]", "between_robots = false\n[run]"),
            "[contact] between_robots is for scenes with several robots ([[robot]]): remove it",
        ),
        (format!("robot = []\n{RUN}"), "[[robot]] is empty: give one table for each robot"),
        (format!("robot = 3\n{RUN}"), "a table [robot], or a table [[robot]] for each robot"),
    ] {
        let refused = of_text(&text).map(|_| ()).unwrap_err();
        assert!(refused.contains(said), "{text}\n{refused}\nwithout {said}");
    }
    let none = two("", "").replace("[run]", "between_robots = false\nlinks = [[\"a/tip\", \"b/tip\"]]\n[run]");
    assert_eq!(of_text(&none).unwrap().simulation.touches.iter().filter(|touch| touch.limit_of().is_none()).count(), 1);
    // Links that overlap at the start are named.
    let over = two("", "").replace("[3, 0, 0]", "[0.1, 0, 0]");
    let scene = of_text(&over).unwrap();
    let refused = scene.plan().unwrap().run(0.1).unwrap_err().to_string();
    assert!(refused.contains("a/link1") && refused.contains("b/link1") && refused.contains("overlap"), "{refused}");
}

/// With an SRDF, `links = "all"` are the pairs of one robot that it does not disable and that are not neighbours.
#[test]
fn all_links_but_those_that_the_srdf_disables_may_touch() {
    let folder = Folder::new();
    let part = |k: usize| {
        let parent = k.checked_sub(1).map_or(String::new(), |p| format!("l{p}"));
        Part::hinge(&format!("l{k}"), &parent, Z).at([1.0, 0.0, 0.0]).weighing(1.0, [1.0; 3]).shaped(&ball(0.1))
    };
    folder.write("row.urdf", rooted(&part(0).link(), &[1, 2, 3].map(part)));
    folder.write(
        "row.srdf",
        "<robot name=\"r\"><group name=\"g\"/><disable_collisions link1=\"l3\" link2=\"l0\" reason=\"Never\"/></robot>",
    );
    let scene = |robot: &str, links: &str| {
        let text = format!(
            "[robot]\nurdf = \"row.urdf\"\nq = [0, 0, 0]\n{robot}\n[contact]\nlinks = {links}\n[run]\nduration = 1\n"
        );
        Scene::from_toml(&text, &*folder)
    };
    let names = |robot: &str| {
        let scene = scene(robot, "\"all\"").unwrap();
        scene.simulation.touches.iter().map(|touch| touch.name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(names(""), ["l0 on l2", "l0 on l3", "l1 on l3"]);
    assert_eq!(names("srdf = \"row.srdf\""), ["l0 on l2", "l1 on l3"]);
    let refused = scene("srdf = \"row.srdf\"", "[[\"l0\", \"l3\"]]").unwrap_err().to_string();
    assert!(refused.contains("[\"l0\", \"l3\"]: the SRDF disables this pair: remove it here or there"), "{refused}");
}
