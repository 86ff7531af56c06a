//! Derivatives of whole runs against differences of runs, and where there are none.

use crate::closed_gradients::ball;
use carom_chain::Chain;
use carom_impact::{Damping, Newton};
use carom_sim::{
    Belt, Compliance, ContactRule, Drive, Loop, LoopFrame, LoopJoint, Parameter, Plan, Profile, Scene, Sensitivity,
    Simulation, Surface, SurfaceMotion, TorqueTable, Touch, Yielding,
};
use carom_testing::build::{self, Part, X, Y, Z, along, chain};
use carom_testing::mechanisms::{self, Rod};
use carom_testing::scenes::{DOWN, among, changed, half_space, level, newton, on_floor, surface, with_robots};
use nalgebra::{DMatrix, DVector, Rotation3, Vector3};

/// The final state as displacement from `last` and velocity.
fn end(sim: &Simulation, last: &[f64], q: &[f64], qd: &[f64], duration: f64) -> DVector<f64> {
    let run = sim.run(q, qd, duration).unwrap();
    let apart = sim.chain.difference(last, &run.summary.last.q).unwrap();
    DVector::from_iterator(2 * apart.len(), apart.iter().copied().chain(run.summary.last.qd.iter().copied()))
}

/// The derivatives by these columns, by differences of fourth order with the step `h` of runs at a tolerance of 1e-12.
fn differences(
    sim: &Simulation,
    (q, qd): (&[f64], &[f64]),
    duration: f64,
    parameters: &[Parameter],
    (columns, h): (&[usize], f64),
) -> DMatrix<f64> {
    let fine = Simulation { tolerance: 1e-12, ..sim.clone() };
    let last = fine.run(q, qd, duration).unwrap().summary.last;
    let nv = sim.chain.nv();
    let by = columns.iter().map(|&j| {
        let at = |times: f64| {
            let delta = times * h;
            let mut unit = vec![0.0; nv];
            let (mut q, mut qd, mut sim) = (q.to_vec(), qd.to_vec(), fine.clone());
            if j < nv {
                unit[j] = 1.0;
                q = sim.chain.integrate(&q, &unit, delta).unwrap();
            } else if j < 2 * nv {
                qd[j - nv] += delta;
            } else {
                sim = parameters[j - 2 * nv].apply(&sim, delta).unwrap();
            }
            end(&sim, &last.q, &q, &qd, duration)
        };
        (at(1.0) - at(-1.0)) * (8.0 / 12.0 / h) - (at(2.0) - at(-2.0)) * (1.0 / 12.0 / h)
    });
    DMatrix::from_columns(&by.collect::<Vec<_>>())
}

/// Compares all columns, or some, to 1e-6 of the largest derivative, and to 1e-4 of the largest of their column: runs at two
/// tolerances, and differences of runs, agree to that.
fn check(name: &str, scene: &Scene, duration: f64, some: Option<&[usize]>, h: f64) -> Sensitivity {
    let plan = scene.plan().unwrap();
    check_by(name, (&plan, &Parameter::all(&plan.simulation)), duration, some, h)
}

/// The same by these parameters.
fn check_by(
    name: &str,
    (plan, parameters): (&Plan, &[Parameter]),
    duration: f64,
    some: Option<&[usize]>,
    h: f64,
) -> Sensitivity {
    let sim = &plan.simulation;
    let found = plan.sensitivity(duration, parameters).unwrap();
    assert_eq!(found.broken, None, "{name}");
    let all: Vec<usize> = (0..found.names.len()).collect();
    let columns = some.unwrap_or(&all);
    let own = found.last_by.as_ref().unwrap().select_columns(columns);
    let other = differences(sim, (&plan.q, &plan.qd), duration, parameters, (columns, h));
    let size = other.amax();
    for (k, &j) in columns.iter().enumerate() {
        let (column, apart) = (other.column(k).amax(), (own.column(k) - other.column(k)).amax());
        let fine = apart <= 1e-6 * size && apart <= 1e-4 * column.max(3e-4 * size);
        assert!(fine, "{name}: {}: apart by {apart:e} of {column:e} and {size:e}", found.names[j]);
    }
    found
}

/// Impacts with and without friction, reversal of slip, accumulation of bounces, sliding, lift-off, constant torques, free motion.
#[test]
fn sensitivities_equal_differences_of_runs() {
    for (name, h) in [
        ("bounce", 1e-4),
        ("planar2", 5e-6),
        ("planar3", 5e-6),
        ("kane", 2e-7),
        ("strike7", 1e-5),
        ("ball", 1e-5),
        ("chain10", 1e-4),
    ] {
        let own = changed(name, &[]);
        check(name, &own, own.duration, None, h);
    }
}

/// A box tumbles until its third corner and on: accumulations of impacts of one and of two corners, edges that slide, stop, and
/// are lifted by the impact of the other edge.
#[test]
fn sensitivities_of_a_tumbling_box_equal_differences_of_runs() {
    let found = check("box", &changed("box", &[]), 0.6, None, 1e-7);
    let zeno = found.events.iter().filter(|event| event.kinds.contains(&"zeno")).count();
    assert_eq!(zeno, 3);
}

/// Feet land in five impacts, the later ones beside those that stand, and slide and stop.
#[test]
fn sensitivities_of_a_quadruped_that_lands_tilted_equal_differences_of_runs() {
    let (x, y) = (0.06, 0.05);
    let start = format!("q = [0, 0, 0.40, {x}, {y}, 0.0, {}, ", (1.0_f64 - x * x - y * y).sqrt());
    let own = [("q = [0, 0, 0.376, 0, 0, 0, 1, ", start.as_str()), ("effort_limits = true\n", ""), ("1e-8", "1e-9")];
    let found = check("quadruped", &changed("quadruped", &own), 0.15, Some(&[2, 3, 6, 10, 20, 24, 36, 37]), 1e-7);
    let kinds = || found.events.iter().map(|event| &event.kinds);
    assert_eq!(kinds().filter(|kinds| ["impact", "several"].contains(&kinds[0])).count(), 5, "{:?}", found.events);
    assert!(kinds().filter(|kinds| kinds.contains(&"sticking")).count() >= 3, "{:?}", found.events);
}

/// A four-bar linkage whose coupler strikes a stop three times. (It comes to rest later, wherever it started.)
#[test]
fn sensitivities_of_a_four_bar_that_strikes_a_stop_equal_differences_of_runs() {
    let found = check("four_bar", &changed("four_bar", &[]), 0.41, None, 1e-6);
    let kinds: Vec<&str> = found.events.iter().flat_map(|event| event.kinds.iter().copied()).collect();
    assert_eq!(kinds, ["impact"; 3]);
}

/// Six links on parallel hinges, turned in space, hang between two places: the second one holds by three rows of rank two, whose forces are
/// the shortest of many.
#[test]
fn sensitivities_of_a_hanging_chain_in_space_equal_differences_of_runs() {
    let (names, length) = (["a", "b", "c", "d", "e", "f"], 0.2);
    let mut parent = "base";
    let parts = names.map(|name| {
        let (of, place) = (parent, if parent == "base" { 0.0 } else { length });
        parent = name;
        Part::hinge(name, of, Y).at([place, 0.0, 0.0]).com([length / 2.0, 0.0, 0.0])
    });
    let (q, qd) = ([0.3, 0.5, 0.7, 0.9, 1.1, 1.3], [0.0; 6]);
    let mut angle = 0.0;
    let links = q.map(|turn| {
        angle += turn;
        Vector3::new(f64::cos(angle), 0.0, -f64::sin(angle)) * length
    });
    for rpy in [[1.41, -1.67, 0.16], [-1.23, -1.8, -0.21]] {
        let [r, p, y] = rpy;
        let tip = Rotation3::from_euler_angles(r, p, y) * links.iter().sum::<Vector3<f64>>();
        let mut parts = parts.clone();
        parts[0].rpy = rpy;
        let frames = [LoopFrame::new(Some("f"), [length, 0.0, 0.0], [0.0; 3]), LoopFrame::new(None, tip, [0.0; 3])];
        let held = Loop { name: "held".into(), joint: LoopJoint::Point, frames };
        let free = Simulation::new(chain(&parts), Vec::new());
        let sim = Simulation { loops: vec![held], planar: false, gravity: DOWN, tolerance: 1e-10, ..free };
        let own = sim.sensitivity(&q, &qd, 0.5, &[]).unwrap().last_by.unwrap();
        let columns: Vec<usize> = (0..12).collect();
        let other = differences(&sim, (&q, &qd), 0.5, &[], (&columns, 1e-5));
        let (apart, size) = ((&own - &other).amax(), other.amax());
        assert!(apart < 1e-6 * size, "apart by {apart:e} of {size:e}");
    }
}

/// A PD-controlled arm strikes a wall that is in front of its target, bounces, slides, and stays pressed on it.
#[test]
fn sensitivities_of_an_arm_that_comes_to_press_on_a_wall_equal_differences_of_runs() {
    let pd = "controller = \"pd\"\nkp = { shoulder = 40, elbow = 10 }\nkd = { shoulder = 6, elbow = 1.5 }\ntarget = [0.85, -1.5]";
    let own =
        [("controller = \"off\"", pd), ("friction = 0.0", "friction = 0.3"), ("duration = 0.5", "duration = 1.5")];
    let found = check("pressed", &changed("planar2", &own), 1.5, None, 4e-6);
    let kinds: Vec<&str> = found.events.iter().flat_map(|event| event.kinds.iter().copied()).collect();
    assert!(kinds.contains(&"impact") && kinds.contains(&"zeno"), "{kinds:?}");
    assert_eq!(found.names.len(), 4 + 2 + 6, "{:?}", found.names);
}

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
        let found = check_by(name, (&plan, &parameters), scene.duration, None, h);
        let kinds: Vec<&str> = found.events.iter().flat_map(|event| event.kinds.iter().copied()).collect();
        assert!(kinds.contains(&"zeno"), "{name}: {kinds:?}");
        // In reverse: large parts of the maps cancel to rounding.
        let forward = found.last_by.unwrap();
        let run = plan.linear_run(scene.duration, &parameters).unwrap();
        for i in 0..forward.nrows() {
            let unit: Vec<f64> = (0..forward.nrows()).map(|k| if k == i { 1.0 } else { 0.0 }).collect();
            let reverse = DVector::from_vec(run.vjp(&unit, &[]).unwrap()).transpose();
            let apart = (reverse - forward.row(i)).amax();
            assert!(apart <= 1e-9 * forward.amax(), "{name}: {apart:e}");
        }
    }
}

/// A bristle holds, slips and swings: its deflection is among what is differentiated.
#[test]
fn sensitivities_through_a_contact_with_a_bristle_equal_differences_of_runs() {
    let bristle =
        "friction = 0.4\ncompliance = { stiffness = 1e8, exponent = 3.0, bristle = { stiffness = 1e4, damping = 50 } }";
    let found = check("bristle", &changed("planar2", &[("friction = 0.0", bristle)]), 0.5, None, 1e-6);
    let kinds: Vec<&str> = found.events.iter().flat_map(|event| event.kinds.iter().copied()).collect();
    assert_eq!(kinds, ["pressing", "lift-off"]);
}

/// A floating ball of 60 g bounces once with slip on compliant floors, each of its sliders begins and ceases to slip several times: near the
/// closing and the opening the deflection is as small as the steps of differences were.
#[test]
fn sensitivities_through_bristles_of_every_stiffness_equal_differences_of_runs() {
    for force in ["\"hunt-crossley\"", "\"kelvin-voigt\"", "\"walton-braun\"", "\"kelvin-voigt\", pulls = true"] {
        for (stiffness, damping, slip) in [(1e3, 1.0, 1.0), (1e4, 1.0, 1.0), (1e4, 100.0, 0.1), (1e5, 10.0, 1.0)] {
            // Its steps are those of the bristle, and the run is the more accurate.
            let text = format!(
                "[robot]\nurdf = \"../robots/ball.urdf\"\nfloating = true\ntip = \"ball\"\nq = [0, 0, 0.3, 0, 0, 0, 1]\n\
                 qd = [{slip}, 0, 0, 0, 0, 0]\n[[surface]]\nname = \"floor\"\nshape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n\
                 [contact]\nrestitution = 0.6\nfriction = 0.2\n\
                 compliance = {{ stiffness = 1e4, force = {force}, bristle = {{ stiffness = {stiffness}, damping = {damping} }} }}\n\
                 [run]\nduration = 0.3\ngravity = [0, 0, -9.81]\ntolerance = 1e-10\n"
            );
            let scene = with_robots(&text).unwrap();
            let plan = scene.plan().unwrap();
            let sim = &plan.simulation;
            let found = plan.sensitivity(0.3, &[]).unwrap();
            let own = found.last_by.unwrap_or_else(|| panic!("{force} {stiffness} {damping}: {:?}", found.broken));
            let columns = [2, 6];
            let other = differences(sim, (&plan.q, &plan.qd), 0.3, &[], (&columns, 1e-5));
            let apart = (own.select_columns(&columns) - &other).amax();
            assert!(apart < 1e-4 * other.amax(), "{force} {stiffness} {damping}: {apart:e} of {:e}", other.amax());
        }
    }
}

/// Five bars with two freedoms, of which a coupler strikes a ceiling: where it does depends on the start, and the tangent of the loop with it.
#[test]
fn sensitivities_of_a_struck_five_bar_equal_differences_of_runs() {
    let rods = [
        Rod::new("left", "ground", 0.0, 0.4),
        Rod { shapes: mechanisms::ball(0.9, 0.05), ..Rod::new("coupler", "left", 0.4, 0.9) },
        Rod::new("right", "ground", 0.7, 0.4),
        Rod::new("rod", "right", 0.4, 0.9),
    ];
    let loops = vec![mechanisms::closure(mechanisms::pin(), ("coupler", 0.9), (Some("rod"), 0.9))];
    for friction in [0.0, 0.2] {
        let ceiling = surface("ceiling", half_space([0.0, 1.1, 0.0], [0.0, -1.0, 0.0]), newton(0.6, friction));
        let sim = Simulation { loops: loops.clone(), tolerance: 1e-10, ..among(mechanisms::chain(&rods), &[ceiling]) };
        let (q, qd) = ([2.2, -1.337, 0.9416, 1.337], [-2.5, 0.3, 1.0, 0.2]);
        let start = sim.run(&q, &qd, 1e-3).unwrap().summary.last;
        let found = sim.sensitivity(&start.q, &start.qd, 0.2, &[]).unwrap();
        let kinds: Vec<&str> = found.events.iter().flat_map(|event| event.kinds.iter().copied()).collect();
        assert_eq!(kinds, ["impact"], "{:?}", found.broken);
        let columns: Vec<usize> = (0..8).collect();
        let own = found.last_by.unwrap_or_else(|| panic!("{:?}", found.broken));
        let other = differences(&sim, (&start.q, &start.qd), 0.2, &[], (&columns, 1e-4));
        let apart = (&own - &other).amax();
        assert!(apart < 1e-7 * other.amax(), "{friction}: {apart:e} of {:e}", other.amax());
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

/// A ball that does not roll slides over the floor z = 0, and a force turns its slip by more than 90° before an event ends the leg.
#[test]
fn sensitivities_of_slip_that_turns_back_equal_differences_of_runs() {
    let ball = along(&[X, Y, Z], 1.0, [0.004; 3], &build::ball(0.1));
    let gravity = Vector3::new(-5.0, 0.0, -10.0);
    let sim = Simulation { gravity, tolerance: 1e-10, ..on_floor(ball, newton(0.0, 0.3)) };
    let parameters = [Parameter::friction()];
    for (start, duration) in [([1.0, 1.0, 0.0], 0.5), ([1.0, 0.03, 0.0], 1.0)] {
        let found = sim.sensitivity(&[0.0, 0.0, 0.1], &start, duration, &parameters).unwrap();
        let end = &found.last.qd;
        assert!(end[0] * start[0] + end[1] * start[1] < 0.0 && found.events.is_empty(), "{end:?} {:?}", found.events);
        let columns = [0, 1, 3, 4, 6];
        let own = found.last_by.unwrap().select_columns(&columns);
        let other = differences(&sim, (&[0.0, 0.0, 0.1], &start), duration, &parameters, (&columns, 1e-5));
        assert!((&own - &other).amax() < 1e-6 * other.amax(), "{own} against {other}");
    }
}

/// A ball that does not roll slides up a slope that is too steep to stick, and down again, through rest or past it at some 1e-5 m/s: its slip turns
/// within microseconds. A belt that moves by the step of the differences moves the slip by more than it has left.
#[test]
fn sensitivities_of_slip_that_turns_at_once_equal_differences_of_runs() {
    let ball = along(&[X, Y, Z], 1.0, [0.004; 3], &build::ball(0.1));
    let floor = |chain: &Chain, speed: f64| {
        let velocity = Profile::constant([0.0, speed, 0.0, 0.0, 0.0, 0.0]);
        let motion = Some(SurfaceMotion::Belt(Belt { velocity, centre: Vector3::zeros() }));
        let floor = Surface { motion, ..surface("floor", level(), newton(0.0, 0.3)) };
        Touch::all(chain, &[floor], 0.0).unwrap().touches
    };
    let touches = floor(&ball, 0.0);
    let sim =
        Simulation { gravity: Vector3::new(-5.0, 0.0, -10.0), tolerance: 1e-10, ..Simulation::new(ball, touches) };
    let belt = [Parameter::new("belt", 1.0, move |sim, delta| sim.touches = floor(&sim.chain, delta))];
    for (across, events) in [(5e-4, 0), (0.0, 1)] {
        let (q, qd) = ([0.0, 0.0, 0.1], [1.0, across, 0.0]);
        let found = sim.sensitivity(&q, &qd, 0.2, &belt).unwrap();
        assert!(found.last.qd[0] < 0.0 && found.events.len() == events, "{:?}", found.events);
        let columns = [3, 4, 6];
        let own = found.last_by.unwrap().select_columns(&columns);
        let other = differences(&sim, (&q, &qd), 0.2, &belt, (&columns, 1e-7));
        assert!((&own - &other).amax() < 1e-5 * other.amax(), "{own} against {other}");
    }
}

/// A wheel rolls at 30 m/s, and is driven more and more until it slips. While the slip is slow its direction changes within a turn of the
/// heading by slip/(30 m/s). A turn of the start, heading and velocity together, is one of the whole motion.
#[test]
fn a_wheel_that_begins_to_slip_turns_with_its_start() {
    let (radius, speed) = (0.1, 30.0);
    let part = |name: &str, parent: &str, axis| Part::slider(name, parent, axis).weighing(0.2, [1e-3; 3]);
    let parts = [
        Part::slider("along", "base", X).massless(),
        part("across", "along", Y),
        part("up", "across", Z),
        Part::hinge("heading", "up", Z).weighing(0.2, [1e-3; 3]),
        Part::hinge("wheel", "heading", Y).weighing(1.0, [4e-3; 3]).shaped(&build::ball(radius)),
    ];
    let forces = vec![vec![0.0; 5], vec![0.0, 0.0, 0.0, 0.0, 2.0]];
    let drive = Drive::Table(TorqueTable { times: vec![0.0, 0.2], forces });
    let sim = Simulation { tolerance: 1e-11, drive, ..on_floor(chain(&parts), newton(0.0, 0.5)) };
    let (q, qd) = ([0.0, 0.0, radius, 0.0, 0.0], [speed, 0.0, 0.0, 0.0, speed / radius]);
    let found = sim.sensitivity(&q, &qd, 0.2, &[]).unwrap();
    let kinds: Vec<&str> = found.events.iter().flat_map(|event| event.kinds.iter().copied()).collect();
    assert_eq!(kinds, ["sliding"]);
    let by = found.last_by.unwrap();
    let own = by.column(3) + by.column(6) * speed;
    let (q, qd) = (&found.last.q, &found.last.qd);
    let turned = DVector::from_vec(vec![-q[1], q[0], 0.0, 1.0, 0.0, -qd[1], qd[0], 0.0, 0.0, 0.0]);
    assert!((&own - &turned).amax() < 1e-6 * turned.amax(), "{own} against {turned}");
}

/// The damping of a compliant contact follows from the approach speed, and is among what is differentiated.
#[test]
fn sensitivities_through_a_compliant_contact_equal_differences_of_runs() {
    // The slope of the force has a kink of d^0.5 where the contact begins with n = 1.5, which costs the integration of S digits.
    for (exponent, tolerance) in [(1.5, 1e-5), (3.0, 1e-6)] {
        let normal = Yielding::HuntCrossley { exponent, damping: Damping::Exact };
        let contact = ContactRule {
            compliance: Some(Compliance { normal, ..Compliance::new(2e4) }),
            ..ContactRule::new(Newton { restitution: 0.6, friction: 0.0 })
        };
        let sim = ball(contact);
        let parameters = Parameter::all(&sim);
        let found = sim.sensitivity(&[0.3], &[-0.5], 0.35, &parameters).unwrap();
        assert_eq!(found.broken, None);
        let own = found.last_by.unwrap();
        let other = differences(&sim, (&[0.3], &[-0.5]), 0.35, &parameters, (&[0, 1, 2], 1e-5));
        assert!((&own - &other).amax() < tolerance * other.amax(), "{exponent}: {own} against {other}");
    }
}

/// A ball that starts within the depth of a contact: its damping follows from the approach at the start and from the coefficients, and a start
/// on the way out unloads from its own depth.
#[test]
fn sensitivities_of_a_start_within_a_contact_equal_differences_of_runs() {
    let hunt = Yielding::HuntCrossley { exponent: 1.5, damping: Damping::Exact };
    for normal in [hunt, Yielding::KelvinVoigt { pulls: true }, Yielding::WaltonBraun] {
        for speed in [-0.7, 0.4] {
            let contact = ContactRule {
                compliance: Some(Compliance { normal, ..Compliance::new(2e4) }),
                ..ContactRule::new(Newton { restitution: 0.6, friction: 0.0 })
            };
            let sim = Simulation { tolerance: 1e-11, ..ball(contact) };
            let parameters = Parameter::all(&sim);
            let start = ([0.09], [speed]);
            for duration in [0.01, 0.2] {
                let found = sim.sensitivity(&start.0, &start.1, duration, &parameters).unwrap();
                assert_eq!(found.broken, None);
                let own = found.last_by.unwrap();
                let other = differences(&sim, (&start.0, &start.1), duration, &parameters, (&[0, 1, 2], 1e-5));
                let apart = (&own - &other).amax();
                assert!(apart < 1e-6 * other.amax(), "{normal:?}, {speed}: {own} against {other}");
            }
        }
    }
}

/// A ball rolls over a compliant floor at 20 m/s: its friction changes within a slip of 1 mm/s, which steps of differences must not pass. The ball
/// comes to stick, and has as much of its spin in the end at any speed.
#[test]
fn sensitivities_of_smoothed_friction_do_not_depend_on_the_speed_of_rolling() {
    let spin = |speed: f64| {
        let text = format!(
            "[robot]\nurdf = \"../robots/ball.urdf\"\nfloating = true\ntip = \"ball\"\nq = [0, 0, 0.07, 0, 0, 0, 1]\nqd = [{speed}, 0, -1, 0, {}, 0]\n\
             [[surface]]\nname = \"floor\"\nshape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n[contact]\nrestitution = 0.6\nfriction = 0.5\n\
             compliance = {{ stiffness = 1e5 }}\n[run]\nduration = 0.1\ngravity = [0, 0, -9.81]\ntolerance = 1e-11\n",
            speed / 0.05
        );
        let plan = with_robots(&text).unwrap().plan().unwrap();
        let found = plan.sensitivity(0.1, &[]).unwrap();
        found.last_by.unwrap_or_else(|| panic!("{:?}", found.broken))[(10, 10)]
    };
    let slow = spin(0.5);
    assert!((spin(20.0) - slow).abs() < 1e-6, "{} {slow}", spin(20.0));
}

/// To raise the only surface is to lower the robot, through impacts, slip and lift-offs, and on a compliant floor.
#[test]
fn sensitivities_by_the_height_of_a_floor_are_those_by_the_height_of_the_robot() {
    let shaken = "motion = { amplitude = [0, 0, 0.02], frequency = 5 }\n[contact]\n";
    let compliant = "[contact]\ncompliance = { stiffness = 1e4, force = \"kelvin-voigt\", pulls = true }\n";
    for contact in [shaken, compliant] {
        let text = format!(
            "[robot]\nurdf = \"../robots/ball.urdf\"\nfloating = true\ntip = \"ball\"\nq = [0, 0, 0.15, 0, 0, 0, 1]\nqd = [0.7, 0.2, 0, 1, -3, 2]\n\
             [[surface]]\nname = \"floor\"\nshape = {{ halfspace = {{ point = [0, 0, 0], normal = [0.1, 0, 1] }} }}\n{contact}law = \"newton\"\n\
             restitution = 0.1\nfriction = 0.2\n[run]\nduration = 0.5\ngravity = [0, 0, -9.81]\ntolerance = 1e-11\n"
        );
        let scene = with_robots(&text).unwrap();
        let height = scene.parameter("surface[0].shape.halfspace.point[2]").unwrap();
        let found = scene.plan().unwrap().sensitivity(0.5, &[height]).unwrap();
        let kinds: Vec<&str> = found.events.iter().flat_map(|event| event.kinds.iter().copied()).collect();
        assert!(kinds.contains(&"lift-off"), "{kinds:?}");
        let by = found.last_by.unwrap_or_else(|| panic!("{:?}", found.broken));
        // Both together move the end by as much, and change neither turn nor velocity.
        let apart = (3..12).map(|row| (by[(row, 12)] + by[(row, 2)]).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-6 * by.amax(), "{contact}: {apart:e} of {:e}", by.amax());
    }
}

/// Grazing, impacts of independent contacts at the same time, an impact at the start, and time steps are named.
#[test]
fn where_there_is_no_derivative_the_reason_is_told() {
    let cradle = changed("cradle", &[("several = \"sequential\"", "several = \"moreau\"")]).plan().unwrap();
    let sim = &cradle.simulation;
    // The first and the last ball strike the middle one at the same time.
    let found = sim.sensitivity(&[0.5, 0.0, -0.5], &[0.0; 3], 1.0, &[]).unwrap();
    let broken = found.broken.unwrap();
    assert!(found.last_by.is_none() && broken.reason.contains("neighbouring"), "{broken:?}");

    let steps = Simulation { stepping: true, ..ball(ContactRule::default()) };
    let broken = steps.sensitivity(&[0.3], &[0.0], 0.1, &[]).unwrap().broken.unwrap();
    assert!(broken.reason.contains("time steps"), "{broken:?}");

    let touching = ball(ContactRule::default());
    let broken = touching.sensitivity(&[0.1], &[-1.0], 0.1, &[]).unwrap().broken.unwrap();
    assert!(broken.time == 0.0 && broken.reason.contains("begins with an impact"), "{broken:?}");

    // It turns at its lowest point 1e-17 m above the floor's surface, and touches it.
    let grazing = Simulation { gravity: Vector3::zeros(), ..ball(ContactRule::default()) };
    let pull = Simulation { gravity: Vector3::new(0.0, 0.0, 2.0), ..grazing };
    let found = pull.sensitivity(&[0.1 + 0.25], &[-1.0], 1.0, &[]).unwrap();
    if let Some(broken) = found.broken {
        assert!(broken.reason.contains("graz") || broken.reason.contains("neighbouring"), "{broken:?}");
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
        assert_eq!(found.broken, None, "{name}");
        let columns = [2 * sim.chain.nv(), 2 * sim.chain.nv() + 1];
        let own = found.last_by.as_ref().unwrap().select_columns(&columns);
        let other = differences(&sim, (&plan.q, &plan.qd), duration, &parameters, (&columns, h));
        assert!(other.column(0).amax() > 1e-3 && (&own - &other).amax() < 1e-6 * other.amax(), "{name}: {own} {other}");
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

/// A robot without a moving joint has no derivatives, and no error.
#[test]
fn a_robot_that_cannot_move_has_empty_derivatives() {
    let sim = Simulation::new(chain(&[Part::new("post", "base", "fixed", Z, [0.0; 3])]), vec![]);
    let found = sim.sensitivity(&[], &[], 0.1, &[Parameter::friction()]).unwrap();
    assert_eq!(found.last_by.unwrap().shape(), (0, 1));
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
        let plan = scene.plan().unwrap();
        let run = plan.linear_run(1.0, &Parameter::all(&plan.simulation)).unwrap();
        for i in 0..by.nrows() {
            let mut weights = vec![0.0; by.nrows()];
            weights[i] = 1.0;
            let gradient = run.vjp(&weights, &[]).unwrap();
            let apart = gradient.iter().zip(&by.row(i)).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
            assert!(apart <= 1e-11 * by.amax(), "{name}: {apart:e}");
        }
    }
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
        assert_eq!(found.broken, None, "{name}");
        let sim = &plan.simulation;
        let first = 2 * sim.chain.nv();
        for (k, key) in keys.iter().enumerate() {
            // A step in proportion to the number.
            let step = if key.contains("inertia") { h * 1e-3 } else { h };
            let own = found.last_by.as_ref().unwrap().select_columns(&[first + k]);
            let other = differences(sim, (&plan.q, &plan.qd), duration, &parameters, (&[first + k], step));
            let apart = (&own - &other).amax();
            assert!(
                other.amax() > 0.0 && apart < 1e-5 * other.amax(),
                "{name}, {key}: {apart:e} of {:e}",
                other.amax()
            );
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
