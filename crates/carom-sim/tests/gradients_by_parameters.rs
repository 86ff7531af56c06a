//! Derivatives of runs by parameters: places of surfaces, inertias, motors, tables and keys of the scene.

use crate::closed_gradients::ball;
use crate::sensitivity::{agrees, check, check_by, differences, kinds};
use carom_sim::{ContactRule, Parameter, Simulation};
use carom_testing::build::{self, O, Part, X, Y, chain, rooted, shape, urdf};
use carom_testing::scenes::{changed, scene, with_robots};
use nalgebra::{DMatrix, Vector3};

/// The last impacts before an accumulation are slow: moved by itself, a surface changes their times by more than all of them last.
#[test]
fn sensitivities_by_places_of_surfaces_pass_accumulations_of_impacts() {
    let moving = [
        ("controller = \"off\"", "controller = \"pd\"\nkp = 40\nkd = 3\ntarget = [0.85, -1.5]"),
        ("friction = 0.0", "friction = 0.3"),
        (
            "normal = [-1, 0, 0] } }",
            "normal = [-1, 0, 0] } }\nmotion = { amplitude = [-0.002, 0, 0], frequency = 3, phase = 3.5 }",
        ),
    ];
    let motion = ["amplitude[0]", "frequency", "phase"].map(|key| format!("surface[0].motion.{key}"));
    let wall = |k: usize| format!("surface[0].shape.halfspace.point[{k}]");
    let walls = [wall(0)].into_iter().chain(motion).collect();
    for (name, own, paths, h) in [("planar3", &[][..], vec![wall(1)], 1e-6), ("planar2", &moving[..], walls, 1e-6)] {
        let scene = changed(name, own);
        let plan = scene.plan().unwrap();
        let parameters: Vec<Parameter> = paths.iter().map(|path| scene.parameter(path).unwrap()).collect();
        let found = check_by(&format!("{name} by its wall"), (&plan, &parameters), scene.duration, None, h);
        assert!(kinds(&found).contains(&"zeno"), "{name}: {:?}", found.events);
    }
}

/// To raise the only surface is to lower the robot: through an accumulation, slip that stops and begins again, and a lift-off, of a body that a
/// contact beside its centre turns; through the slow lift-off from a compliant floor that pulls; and on bristles, one of which begins to slip
/// within the step of the height.
#[test]
fn sensitivities_by_the_height_of_a_floor_are_those_by_the_height_of_the_robot() {
    let inertia = [0.002, 0.003, 0.004];
    let ball = |x, y| shape(&build::ball(0.05), [x, y, 0.0], O);
    let robot = |other: &str| {
        let root = Part::hinge("b", "", Y).weighing(1.0, inertia).with(ball(0.1, 0.0)).with(other.to_owned());
        rooted(&root.link(), &[Part::hinge("a", "b", Y).com([0.1, 0.0, 0.1]).weighing(0.5, inertia)])
    };
    let pulls = "compliance = { stiffness = 1e4, force = \"kelvin-voigt\", pulls = true }";
    let bristles = "compliance = { stiffness = 8e4, force = \"hunt-crossley\", exponent = 1, bristle = { stiffness = 4e3, damping = 9 } }";
    for (more, qd, contact, duration) in [
        (String::new(), "0.3, 0.1, 0, -1.07, 0.06, 1.81, 1", "restitution = 0.35".to_owned(), 0.9),
        (ball(-0.1, 0.03), "0.16, -0.59, 0.28, 0.89, -0.92, -0.1, -0.29", format!("restitution = 0.2\n{pulls}"), 0.5),
        (ball(-0.1, 0.03), "0.04, 0.61, 0.92, -0.42, 0.53, 0.41, 0.32", format!("restitution = 0.2\n{bristles}"), 0.5),
    ] {
        let text = format!(
            "[robot]\nurdf = \"eccentric.urdf\"\nfloating = true\ntip = \"b\"\nq = [0, 0, 0.2, 0, 0, 0, 1, 0.1]\n\
             qd = [{qd}]\n[[surface]]\nname = \"floor\"\n\
             shape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n[[spring]]\njoint = \"ja\"\nstiffness = 20\ndamping = 0.4\n\
             [contact]\nlaw = \"newton\"\nfriction = 0.4\n{contact}\n\
             [run]\nduration = {duration}\ngravity = [0, 0, -9.81]\ntolerance = 1e-11\n"
        );
        let scene = scene(&[("eccentric.urdf", &robot(&more))], &text).unwrap();
        let height = scene.parameter("surface[0].shape.halfspace.point[2]").unwrap();
        let found = scene.plan().unwrap().sensitivity(scene.duration, &[height]).unwrap();
        assert!(kinds(&found).contains(&"lift-off"), "{:?}, {:?}", found.events, found.broken);
        let by = found.last_by.unwrap_or_else(|| panic!("{:?}", found.broken));
        // Both together move the end by as much, and change neither turn nor velocity.
        let apart = (3..14).map(|row| (by[(row, 14)] + by[(row, 2)]).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-6 * by.amax(), "{contact}: {apart:e} of {:e}", by.amax());
    }
}

/// A number that is as good as zero is differentiated as zero is.
#[test]
fn derivatives_by_numbers_near_zero_are_those_by_zero() {
    let by = |number: &str, key: &str| {
        let text = format!(
            "[robot]\nurdf = \"../robots/ball.urdf\"\nfloating = true\ntip = \"ball\"\nq = [0, 0, 0.3, 0, 0, 0, 1]\n\
             inertia = {{ ball = [1e-4, {number}, 0, 1e-4, 0, 1e-4] }}\n\
             [[surface]]\nshape = {{ halfspace = {{ point = [0, 0, {number}], normal = [0, 0, 1] }} }}\n\
             [contact]\nlaw = \"newton\"\nrestitution = 0.8\n[[force]]\nlink = \"ball\"\nforce = [{number}, 0, {number}]\n\
             [run]\nduration = 0.4\ngravity = [{number}, 0, -9.81]\ntolerance = 1e-11\n"
        );
        let scene = with_robots(&text).unwrap();
        scene.plan().unwrap().sensitivity(0.4, &[scene.parameter(key).unwrap()]).unwrap().last_by.unwrap()
    };
    for key in [
        "force[0].force[0]",
        "force[0].force[2]",
        "run.gravity[0]",
        "surface[0].shape.halfspace.point[2]",
        "robot.inertia.ball[1]",
    ] {
        let zero = by("0.0", key);
        for number in ["1e-7", "1e-10"] {
            let apart = (by(number, key) - &zero).amax();
            assert!(apart < 1e-5 * zero.amax().max(1e-3), "{key} = {number}: {apart:e} of {:e}", zero.amax());
        }
    }
}

/// A parameter that removes possible contacts is refused.
#[test]
fn a_parameter_that_changes_the_contacts_is_refused() {
    let sim = ball(ContactRule::default());
    let bad = Parameter::new("contacts", 1.0, |sim, _| sim.touches.clear());
    let refused = sim.sensitivity(&[0.6], &[0.0], 0.5, &[bad]).unwrap_err().to_string();
    assert!(
        refused.contains("parameter 'contacts' has no derivative: changed by 1e-5 it makes 0 possible contacts of 1"),
        "{refused}"
    );
}

/// Parameters that change inertias, in free motion and through impacts, in the plane and in space.
#[test]
fn sensitivities_by_inertias_equal_differences_of_runs() {
    for (name, h) in [("planar2", 1e-5), ("strike7", 1e-4), ("four_bar", 1e-5)] {
        let scene = changed(name, &[]);
        let plan = scene.plan().unwrap();
        let joint = plan.simulation.chain.joint_of_velocity(0).unwrap().name.clone();
        let with_rotor = |chain: &carom_chain::Chain, own: f64| chain.with_rotor_inertia(&joint, own);
        let sim = Simulation { chain: with_rotor(&plan.simulation.chain, 0.1).unwrap(), ..plan.simulation.clone() };
        let rotor = joint.clone();
        let parameters = [
            Parameter::try_new("rotor", 1.0, move |sim, delta| {
                sim.chain = sim.chain.with_rotor_inertia(&rotor, 0.1 + delta)?;
                Ok(())
            }),
            Parameter::try_new("inertia", 1.0, |sim, delta| {
                sim.chain = sim.chain.with_inertia_scaled(1.0 + delta)?;
                Ok(())
            }),
        ];
        let duration = scene.duration.min(0.4);
        let found = sim.sensitivity(&plan.q, &plan.qd, duration, &parameters).unwrap();
        let columns = [2 * sim.chain.nv(), 2 * sim.chain.nv() + 1];
        let other = agrees(name, &found, (&sim, &plan.q, &plan.qd), duration, &parameters, (&columns, h), 1e-6);
        assert!(other.column(0).amax() > 1e-3, "{name}: {other}");
    }
}

/// Motors at their limits give the same whatever the gains, and beside the state; after it they do not.
#[test]
fn motors_at_their_limit_have_no_slope() {
    let slider = chain(&[Part::slider("cart", "base", X).weighing(2.0, [0.01; 3])]);
    let slider = slider.with_effort_limit("jcart", 3.0).unwrap();
    let drive = carom_sim::Drive::Pd(carom_sim::Pd { kp: 100.0.into(), kd: 5.0.into(), target: vec![1.0] });
    let sim = Simulation { drive, effort_limits: true, gravity: Vector3::zeros(), ..Simulation::new(slider, vec![]) };
    let parameters = Parameter::all(&sim);
    // 3 N all the time: x(0.2 s) = ½ 1.5 t².
    let found = sim.sensitivity(&[0.0], &[0.0], 0.2, &parameters).unwrap();
    let by = found.last_by.unwrap();
    let exact = DMatrix::from_row_slice(2, 5, &[1.0, 0.2, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    assert!((by - exact).amax() < 1e-13);
    // Within the limits from the start on.
    let (q, qd) = ([0.99], [0.0]);
    let found = sim.sensitivity(&q, &qd, 0.2, &parameters).unwrap();
    let columns = [0, 1, 2, 3, 4];
    let other = differences(&sim, (&q, &qd), 0.2, &parameters, (&columns, 1e-3));
    assert!((found.last_by.unwrap() - other).amax() < 1e-9);
}

/// The rows of a table of torques and the points of a reference, in free motion, through impacts and while a contact slides; a row has no effect
/// before the row before it.
#[test]
fn sensitivities_by_rows_of_tables_equal_differences_of_runs() {
    let times: Vec<f64> = (0..8).map(|k| 0.2 * f64::from(k)).collect();
    let table = |joint: usize, time: f64| 0.3 * (4.0 * time + joint as f64).sin();
    let rows = |own: &dyn Fn(usize, f64) -> f64| times.iter().map(|&t| vec![own(0, t), own(1, t)]).collect::<Vec<_>>();
    let forces = carom_sim::TorqueTable { times: times.clone(), forces: rows(&table) };
    let along = |joint: usize, time: f64| [0.785, -1.57][joint] + table(joint, time) * 0.5;
    let reference = carom_sim::Reference::new(times.clone(), &rows(&along)).unwrap();
    let tracking = |feed_forward| carom_sim::Tracking {
        reference: reference.clone(),
        kp: 40.0.into(),
        kd: 6.0.into(),
        feed_forward,
    };
    let presses = [("friction = 0.0", "friction = 0.3")];
    for (name, drive, columns) in [
        ("table", carom_sim::Drive::Table(forces), 4 + 2 + 16),
        ("tracking", carom_sim::Drive::Tracking(tracking(false)), 4 + 2 + 4 + 16),
        ("feed-forward", carom_sim::Drive::Tracking(tracking(true)), 4 + 2 + 4 + 16),
    ] {
        let mut scene = changed("planar2", &presses);
        scene.simulation.drive = drive;
        let found = check(name, &scene, 1.0, None, 4e-6);
        assert_eq!(found.names.len(), columns, "{name}: {:?}", found.names);
        assert!(!found.events.is_empty(), "{name}");
        let by = found.last_by.unwrap();
        let of = |wanted: &str| found.names.iter().position(|name| name == wanted).map(|k| by.column(k).amax());
        let word = if name == "table" { "torque" } else { "reference" };
        assert!(of(&format!("{word} elbow 3")).unwrap() > 1e-4, "{name}: {:?}", found.names);
        if name == "table" {
            assert_eq!(of("torque elbow 8"), Some(0.0));
        }
    }
}

/// A slider on its stop is pulled off by a force F t, against dry friction f as well: at the time f/F, whose derivative is −f/F². Which of stop and
/// friction bears how much before is a convention.
#[test]
fn the_time_at_which_a_joint_leaves_its_stop_against_dry_friction_has_the_derivative_of_its_closed_form() {
    let (friction, pull) = (3.0, 6.0);
    let slider = Part::slider("a", "base", X).limits(0.0, 9.0, 99.0).joint("<dynamics friction='3'/>");
    let robot = urdf(&[slider.weighing(0.7, [0.1; 3])]);
    let text =
        "[robot]\nurdf = \"slider.urdf\"\nq = [0]\n[run]\nduration = 1\ngravity = [0, 0, 0]\ntolerance = 1e-11\n";
    let mut scene = scene(&[("slider.urdf", &robot)], text).unwrap();
    let forces = vec![vec![0.0], vec![pull]];
    scene.simulation.drive = carom_sim::Drive::Table(carom_sim::TorqueTable { times: vec![0.0, 1.0], forces });
    let plan = scene.plan().unwrap();
    let found = plan.sensitivity(1.0, &Parameter::all(&plan.simulation)).unwrap();
    let column =
        found.names.iter().position(|name| name == "torque ja 1").unwrap_or_else(|| panic!("{:?}", found.names));
    let event = found.events.iter().find(|event| event.kinds.contains(&"lift-off")).unwrap();
    assert!((event.time - friction / pull).abs() < 1e-8, "{}", event.time);
    let exact = -friction / (pull * pull);
    let off = (event.time_by[column] / exact - 1.0).abs();
    assert!(off < 1e-6, "{off:e}");
}

/// By keys of the scene: six numbers of an inertia, a mass, gravity, a place of the floor, a gain of one of two robots; those of a key that
/// changes the start, or that is no number, are refused with the key.
#[test]
fn sensitivities_by_keys_of_the_scene_equal_differences_of_runs() {
    let inertia: Vec<String> = (0..6).map(|k| format!("robot.inertia.cube[{k}]")).collect();
    let of_cube = ["run.gravity[2]", "contact.friction", "surface[0].shape.halfspace.point[2]"];
    let of_cube: Vec<&str> = inertia.iter().map(String::as_str).chain(of_cube).collect();
    for (name, keys, duration, h) in [
        ("cube", &of_cube[..], 0.4, 1e-7),
        ("two_arms", &["robot[1].kp", "robot[1].position[0]", "contact.restitution"][..], 0.4, 1e-5),
    ] {
        let scene = changed(name, &[]);
        let plan = scene.plan().unwrap();
        let parameters: Vec<Parameter> = keys.iter().map(|key| scene.parameter(key).unwrap()).collect();
        let found = plan.sensitivity(duration, &parameters).unwrap();
        let sim = &plan.simulation;
        let first = 2 * sim.chain.nv();
        for (k, key) in keys.iter().enumerate() {
            // A step in proportion to the number.
            let step = if key.contains("inertia") { h * 1e-3 } else { h };
            let (own, name) = ((sim, &plan.q[..], &plan.qd[..]), format!("{name}, {key}"));
            let other = agrees(&name, &found, own, duration, &parameters, (&[first + k], step), 1e-5);
            assert!(other.amax() > 0.0, "{name}");
        }
    }
    let by_speed = ("restitution = 0.35", "restitution = { table = [[0.1, 0.9], [1.1, 0.7]] }");
    let scene = changed("planar2", &[by_speed]);
    assert_eq!(scene.number("contact.restitution.table[1][0]").unwrap(), 1.1);
    for (key, why) in [
        ("contact.restitution.table[1][2]", "table[1] has 2 entries, which count from 0"),
        ("contact.restitution.table[1][0][0]", "table[1][0] is no list: leave out [0]"),
    ] {
        let told = scene.number(key).unwrap_err().to_string();
        assert!(told.ends_with(why), "{told}");
    }
    let scene = changed("planar2", &[]);
    for (key, why) in [
        ("robot.q[0]", "robot.q[0]: it changes the start or the duration"),
        ("contact.law", "contact.law: the scene has no number there"),
        ("surface.friction", "surface.friction: surface is a list of 1: write surface[0]"),
    ] {
        let told = scene.parameter(key).unwrap_err().to_string();
        assert!(told.starts_with(why), "{told}");
    }
}
