//! The shipped scenes: each has the events and the final state that its first lines describe.

use carom_sim::{Scene, Trajectory};
use carom_testing::scenes::{kinds, shipped, with_robots};

fn run(name: &str) -> (Scene, Trajectory) {
    let scene = shipped(name);
    let plan = scene.plan().unwrap();
    let run = plan.simulation.run(&plan.q, &plan.qd, scene.duration).unwrap();
    // No shape penetrates a surface by more than the overlap of a time step.
    let deepest = (0..=1000)
        .map(|k| run.at(&plan.simulation.chain, scene.duration * f64::from(k) / 1000.0))
        .map(|moment| plan.simulation.smallest_gap(&moment.q).unwrap())
        .fold(f64::INFINITY, f64::min);
    let fastest = run.events.iter().flat_map(|event| &event.qd_minus).fold(0.0_f64, |m, v| m.max(v.abs()));
    assert!(deepest > -2.0 * fastest * plan.simulation.contact_step, "{name}: overlap {deepest}");
    let balance = run.summary.energy;
    assert!(balance.error().abs() < 1e-6 * balance.start.abs().max(balance.impacts.abs()), "{name}: {balance:?}");
    (scene, run)
}

/// The events of a run contain these kinds in this order.
fn happens(scene: &str, run: &Trajectory, expected: &[&str]) {
    let all = kinds(run);
    let mut events = all.iter();
    for kind in expected {
        assert!(events.any(|name| name == kind), "{scene}: '{kind}' is missing or out of order in {all:?}");
    }
}

/// Kinds of events that happen in this order, or all of them.
#[test]
fn shipped_scenes_have_the_events_that_they_describe() {
    for (name, all, expected) in [
        ("planar3", false, &["impact", "zeno", "sliding", "lift-off"][..]),
        ("rod", false, &["impact", "impact", "rest"]),
        ("box", false, &["impact", "zeno", "sliding", "several", "sticking", "rest"]),
        ("table", false, &["impact", "sliding", "rest"]),
        ("planar2", true, &["impact"]),
        ("strike7", true, &["impact"]),
        ("bounce", true, &["impact"; 6]),
        ("kane", true, &["impact"]),
        ("chain10", true, &[]),
        ("cradle", false, &["several", "several"]),
    ] {
        let (scene, run) = run(name);
        happens(name, &run, expected);
        assert!(!all || run.events.len() == expected.len(), "{name}: {} events", run.events.len());
        let (last, statistics) = (&run.summary.last, &run.summary.statistics);
        let fastest = last.qd.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        match name {
            "rod" => assert!(statistics.contact_steps == 0 && (last.q[2] - 0.01).abs() < 1e-9, "{name}: {last:?}"),
            "box" => {
                let on_a_face = [0.06, 0.04, 0.025].iter().any(|half| (last.q[2] - half).abs() < 1e-9);
                assert!(statistics.contact_steps == 0 && on_a_face, "{name}: {last:?}");
            }
            "chain10" => assert!(fastest > 1.0, "it falls: {fastest} rad/s"),
            // Only the last ball swings up.
            "cradle" => {
                let swings = run.at(&scene.simulation.chain, 0.5).q;
                assert!(swings[2] < -0.4 && swings[0].abs() < 1e-9 && swings[1].abs() < 1e-9, "{swings:?}");
            }
            _ => {}
        }
    }
}

#[test]
fn a_thrown_ball_bounces_off_floor_and_box() {
    let (scene, run) = run("ball");
    let names: Vec<&str> =
        run.events.iter().filter_map(|event| scene.simulation.touches[event.kind.touch()?].surface()).collect();
    assert!(names.starts_with(&["floor", "box"]), "{names:?}");
}

#[test]
fn a_dropped_ball_bounces_six_times_to_e_squared_of_the_previous_height() {
    let (_, run) = run("bounce");
    // From h = 1 m with e = 0.8: the k-th flight lasts 2 e^k sqrt(2 h / g), and v_k = e^k sqrt(2 g h).
    let first = (2.0_f64 / 9.81).sqrt();
    for (k, event) in run.events.iter().enumerate() {
        let waited = (1..=k).map(|flight| 2.0 * 0.8_f64.powi(flight as i32)).sum::<f64>();
        assert!((event.time - first * (1.0 + waited)).abs() < 1e-12 * f64::from(1 << k) + 1e-11, "{k}: {}", event.time);
        let height = event.qd_plus[2].powi(2) / (2.0 * 9.81);
        assert!((height / 0.64_f64.powi(k as i32 + 1) - 1.0).abs() < 1e-11, "{k}: {height}");
    }
}

#[test]
fn kane_and_levinsons_tip_slides_back_after_the_impact() {
    // Reference digits of Stronge's law at the pose of contact. The floor of the scene is 2e-6 m lower, which changes the
    // pose and the velocities by about that much.
    let (_, run) = run("kane");
    let [event] = &run.events[..] else { panic!("{} events", run.events.len()) };
    for (found, wanted) in event.qd_plus.iter().zip([-0.198932335971, 0.223136785377 + 0.198932335971]) {
        assert!((found - wanted).abs() < 4e-6, "{found} for {wanted}");
    }
}

/// The crank turns back and strikes again; the loop is closed at every event.
#[test]
fn a_four_bar_linkage_strikes_a_stop() {
    let (scene, run) = run("four_bar");
    happens("four_bar", &run, &["impact", "impact"]);
    for event in &run.events {
        let (again, most) = scene.simulation.close_loops(&event.q, &event.qd_plus).unwrap();
        assert!(most < 1e-10, "{again:?}");
    }
}

/// Energy of the start, through the flat pose, at all samples.
#[test]
fn an_n_four_bar_falls_through_its_flat_pose() {
    let (scene, run) = run("n_four_bar");
    assert!(run.events.is_empty());
    let balance = run.summary.energy;
    assert!((balance.end - balance.start).abs() < 1e-9 * balance.start, "{balance:?}");
    let turned = (0..=100).map(|k| run.at(&scene.simulation.chain, 0.1 * f64::from(k)).q[0]).fold(0.0, f64::min);
    assert!(turned < -3.0, "{turned} rad: it passes the flat pose twice in a turn");
}

/// The platform strikes the ground beside its centre and tilts; it keeps the directions that its legs prevent.
#[test]
fn a_delta_mechanism_strikes_the_ground_and_tilts() {
    let (scene, run) = run("delta");
    happens("delta", &run, &["impact"]);
    let tilts = |time: f64| {
        let q = run.at(&scene.simulation.chain, time).q;
        (2.0 * (q[6] * q[4] - q[5] * q[3])).asin()
    };
    assert!(tilts(0.05).abs() < 1e-9 && (0..60).any(|k| tilts(0.01 * f64::from(k)).abs() > 0.05));
    // The mechanism and the stroke are symmetric about the x–z plane: no motion across it.
    for k in 0..=60 {
        let q = run.at(&scene.simulation.chain, 0.01 * f64::from(k)).q;
        assert!(q[1].abs() < 1e-9 && q[5].abs() < 1e-9, "{q:?}");
    }
}

/// The tip starts with the velocity that is given, whichever joint velocities are taken; without rotation its link does not turn.
#[test]
fn a_tip_starts_with_its_velocity_in_the_motion_asked_for() {
    let given = |keys: &str| {
        with_robots(&format!(
            "robot = {{ urdf = \"arm7.urdf\", q = [0, 0.5, 0.2, -1, 0, 1, 0], tip_velocity = {{ {keys} }} }}\nrun = {{ duration = 1 }}\n"
        ))
    };
    let u = nalgebra::Vector3::new(0.1, -0.2, -0.5);
    for (motion, turns) in [("least-energy", true), ("least-norm", true), ("without-rotation", false)] {
        let scene = given(&format!("velocity = [0.1, -0.2, -0.5], motion = \"{motion}\"")).unwrap();
        let (chain, mut workspace) = (&scene.simulation.chain, scene.simulation.chain.workspace());
        let at = workspace.update(chain, &scene.q).unwrap();
        let tip = chain.frame("tip").unwrap();
        let reached = at.point_velocity(chain.point(tip, nalgebra::Vector3::zeros()), &scene.qd).unwrap();
        assert!((reached - u).norm() < 1e-12, "{motion}: {reached}");
        let spin = at.angular_velocity(tip, &scene.qd).unwrap().norm();
        assert_eq!(spin > 1e-3, turns, "{motion}: {spin} rad/s");
    }
    for (keys, words) in [
        ("velocity = [0.1, 0, 0], motion = \"fast\"", "'fast' is none of least-energy, least-norm, without-rotation"),
        ("velocity = [0.1, 0, 0], speed = 1", "give one of both"),
        ("speed = 1, angle_deg = 45, along = [1, 0, 0]", "tip_velocity.velocity or qd instead"),
    ] {
        let refused = given(keys).unwrap_err().to_string();
        assert!(refused.contains(words), "{refused}");
    }
}

const TWO_LINKS: &str = r#"<robot name='two'><link name='base'/>
  <link name='upper'><inertial><mass value='1'/><inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/></inertial></link>
  <link name='lower'><inertial><mass value='1'/><inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/></inertial>
    <collision><geometry><sphere radius='0.1'/></geometry></collision></link>
  <joint name='lift' type='prismatic'><parent link='base'/><child link='upper'/><axis xyz='0 0 1'/>
    <limit lower='-0.5' upper='3' effort='100' velocity='9'/></joint>
  <link name='plate'/><joint name='hold' type='fixed'><parent link='upper'/><child link='plate'/></joint>
  <joint name='turn' type='revolute'><parent link='upper'/><child link='lower'/><axis xyz='0 1 0'/>
    <limit lower='-3' upper='3' effort='100' velocity='9'/></joint></robot>"#;
const POSES: &str =
    "<robot name='two'><group_state name='up' group='arm'><joint name='lift' value='1.5'/></group_state>
  <group_state name='up' group='hand'><joint name='turn' value='-0.4'/><joint name='finger' value='1'/></group_state>
  <group_state name='ball' group='arm'><joint name='turn' value='0 1'/></group_state></robot>";

fn two_links(text: &str) -> Result<Scene, carom_sim::SimError> {
    carom_testing::scenes::scene(&[("two.urdf", TWO_LINKS), ("two.srdf", POSES)], text)
}

/// Joints by name, the others at zero; a pose by name has the positions of all its groups, and is the target of a controller, too.
#[test]
fn positions_are_read_by_joint_names_and_by_the_poses_of_the_srdf() {
    let start = |q: &str| {
        two_links(&format!("robot = {{ urdf = 'two.urdf', srdf = 'two.srdf', q = {q} }}\nrun = {{ duration = 1 }}"))
    };
    assert_eq!(start("{ turn = 0.3 }").unwrap().q, [0.0, 0.3]);
    assert_eq!(start("'up'").unwrap().q, [1.5, -0.4]);
    let text = "robot = { urdf = 'two.urdf', srdf = 'two.srdf', q = [1, 0] }\n[run]\nduration = 3\ncontroller = 'pd'\ntarget = 'up'\nkp = 400\nkd = 40\ngravity = [0, 0, 0]";
    let scene = two_links(text).unwrap();
    let run = scene.simulation.run(&scene.q, &scene.qd, scene.duration).unwrap();
    let last = run.summary.last.q;
    assert!((last[0] - 1.5).abs() < 1e-6 && (last[1] + 0.4).abs() < 1e-6, "{last:?}");
    for (q, words) in [
        ("'down'", "q = \"down\": the poses of the SRDF are up, ball"),
        (
            "'ball'",
            "q = \"ball\": the SRDF gives joint 'turn' 2 numbers, where a hinge or slider has one: give q by joint names",
        ),
        ("{ tun = 1 }", "q names the joint 'tun': the joints with one coordinate are lift, turn"),
    ] {
        let refused = start(q).unwrap_err().to_string();
        assert!(refused.contains(words), "{refused}");
    }
}

/// A motor gives no more than its effort limit, that of the scene before that of the URDF: with 30 N it lifts 2 kg at 30/2 − 9.81 m/s².
#[test]
fn effort_limits_of_a_scene_replace_those_of_the_urdf() {
    let text = |effort: &str, limited: bool| {
        format!(
            "robot = {{ urdf = 'two.urdf', q = [0, 0], {effort} }}\n[run]\nduration = 0.2\ncontroller = 'constant'\ntorque = [80, 0]\neffort_limits = {limited}"
        )
    };
    let height = |text: &str| {
        let scene = two_links(text).unwrap();
        scene.simulation.run(&scene.q, &scene.qd, scene.duration).unwrap().summary.last.q[0]
    };
    for (effort, force) in [("effort = { lift = 30 }", 30.0), ("", 80.0)] {
        let expected = 0.5 * (force / 2.0 - 9.81) * 0.04;
        assert!((height(&text(effort, true)) - expected).abs() < 1e-9, "{effort}");
    }
    for (text, words) in [
        (text("effort = { lift = 30 }", false), "[robot] effort is read with [run] effort_limits = true only"),
        (text("effort = { lfit = 30 }", true), "effort: no joint is named 'lfit'"),
        (text("effort = { hold = 1 }", true), "an effort limit belongs to a joint with one coordinate of its own"),
        (text("effort = { lift = -1 }", true), "effort: effort limit of lift is -1: it must not be negative"),
    ] {
        let refused = two_links(&text).unwrap_err().to_string();
        assert!(refused.contains(words), "{refused}");
    }
}

/// A contact that is switched off does not act: the ball falls through one floor onto the next, and a joint passes its limit.
#[test]
fn contacts_that_are_disabled_do_not_act() {
    let text = |pairs: &str| {
        format!(
            "robot = {{ urdf = 'two.urdf', q = [1, 0] }}\nrun = {{ duration = 1 }}
             [[surface]]\nname = 'upper floor'\nshape = {{ halfspace = {{ point = [0, 0, 0.5], normal = [0, 0, 1] }} }}
             [[surface]]\nname = 'floor'\nshape = {{ halfspace = {{ point = [0, 0, -0.3], normal = [0, 0, 1] }} }}
             [contact]\nlaw = 'newton'\nrestitution = 0\n{pairs}"
        )
    };
    let end = |pairs: &str| {
        let scene = two_links(&text(pairs)).unwrap();
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        scene.simulation.run(&scene.q, &scene.qd, scene.duration).unwrap().summary.last.q[0]
    };
    let off = |what: &str| format!("[[contact.pair]]\n{what}\ndisabled = true\n");
    let upper = off("link = 'lower'\nsurface = 'upper floor'");
    assert!((end("") - 0.6).abs() < 1e-9, "the ball rests on the upper floor");
    assert!((end(&upper) + 0.2).abs() < 1e-9, "the ball rests on the floor");
    assert!((end(&(upper.clone() + &off("surface = 'floor'"))) + 0.5).abs() < 1e-9, "the slider rests on its limit");
    let all = upper + &off("surface = 'floor'") + &off("joint = 'lift'");
    assert!((end(&all) - (1.0 - 0.5 * 9.81)).abs() < 1e-9, "nothing stops it");
    let refused = two_links(&text(&(off("link = 'lower'") + "friction = 1\n"))).unwrap_err().to_string();
    assert!(refused.contains("[[contact.pair]] has disabled = true, and values of a contact"), "{refused}");
}
