//! Derivatives of whole runs against differences of runs, and where there are none.

use crate::closed_gradients::ball;
use carom_chain::Chain;
use carom_sim::{
    Belt, ContactRule, Drive, Loop, LoopFrame, LoopJoint, Parameter, Plan, Profile, Scene, Sensitivity, Simulation,
    Surface, SurfaceMotion, TorqueTable, Touch,
};
use carom_testing::build::{self, Part, X, Y, Z, along, chain};
use carom_testing::mechanisms::{self, Rod};
use carom_testing::scenes::{DOWN, among, changed, half_space, level, newton, on_floor, surface};
use nalgebra::{DMatrix, DVector, Rotation3, Vector3};

/// The final state as displacement from `last` and velocity.
fn end(sim: &Simulation, last: &[f64], q: &[f64], qd: &[f64], duration: f64) -> DVector<f64> {
    let run = sim.run(q, qd, duration).unwrap();
    let apart = sim.chain.difference(last, &run.summary.last.q).unwrap();
    DVector::from_iterator(2 * apart.len(), apart.iter().copied().chain(run.summary.last.qd.iter().copied()))
}

/// The derivatives by these columns, by differences of fourth order with the step `h` of runs at a tolerance of 1e-12.
pub fn differences(
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

/// The kinds of the events that have derivatives.
pub fn kinds(found: &Sensitivity) -> Vec<&'static str> {
    found.events.iter().flat_map(|event| event.kinds.iter().copied()).collect()
}

/// Compares these columns with differences, to a share of the largest derivative among them; returns the differences.
#[track_caller]
pub fn agrees(
    name: &str,
    found: &Sensitivity,
    (sim, q, qd): (&Simulation, &[f64], &[f64]),
    duration: f64,
    parameters: &[Parameter],
    (columns, h): (&[usize], f64),
    share: f64,
) -> DMatrix<f64> {
    assert_eq!(found.broken, None, "{name}");
    let own = found.last_by.as_ref().unwrap().select_columns(columns);
    let other = differences(sim, (q, qd), duration, parameters, (columns, h));
    let (apart, size) = ((&own - &other).amax(), other.amax());
    assert!(apart < share * size, "{name}: apart by {apart:e} of {size:e}");
    other
}

/// The linear maps of a run, applied to a change of the start, and their transposes, applied to derivatives by the outcome, are the columns
/// and the rows of its sensitivities: the transposes have the same digits but for the order of sums.
fn check_linear(name: &str, (plan, parameters): (&Plan, &[Parameter]), duration: f64, all: &Sensitivity) {
    // Those of events by differences have coordinates along directions that the motion has contracted: accumulations of impacts,
    // and many events, lose three digits.
    let short = ["planar2", "strike7", "four_bar", "kane", "table", "tracking", "feed-forward"];
    let tolerance = if short.contains(&name) { 1e-11 } else { 1e-9 };
    let run = plan.linear_run(duration, parameters).unwrap();
    assert_eq!((run.names(), run.last()), (&all.names[..], &all.last), "{name}");
    assert!(run.events().map(|(time, _)| time).eq(all.events.iter().map(|it| it.time)), "{name}");
    let by = all.last_by.as_ref().unwrap();
    let counts = |time_by: &[f64]| time_by.iter().all(|x| x.is_finite());
    let size = |time_by: &[f64]| time_by.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
    let close = |what: &str, a: f64, b: f64, size: f64| {
        assert!((a - b).abs() <= tolerance * size, "{name}, {what}: {a} and {b}, {size}");
    };
    let unit = |count: usize, at: usize| (0..count).map(|k| if k == at { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
    for j in 0..by.ncols() {
        let (last, times) = run.jvp(&unit(by.ncols(), j)).unwrap();
        last.iter().zip(&by.column(j)).for_each(|(a, b)| close("column", *a, *b, by.amax()));
        for (time, event) in times.iter().zip(&all.events).filter(|(_, event)| counts(&event.time_by)) {
            close("time", *time, event.time_by[j], size(&event.time_by));
        }
    }
    for i in 0..by.nrows() {
        let gradient = run.vjp(&unit(by.nrows(), i), &[]).unwrap();
        gradient.iter().zip(&by.row(i)).for_each(|(a, b)| close("row", *a, *b, by.amax()));
    }
    for (i, event) in all.events.iter().enumerate() {
        let gradient = run.vjp(&vec![0.0; by.nrows()], &unit(all.events.len(), i));
        if !counts(&event.time_by) {
            let told = gradient.unwrap_err().to_string();
            assert!(told.contains("too slow for digits"), "{told}");
            continue;
        }
        let pairs = gradient.unwrap().into_iter().zip(&event.time_by);
        pairs.for_each(|(a, b)| close("time in reverse", a, *b, size(&event.time_by)));
    }
}

/// Compares all columns, or some, to 1e-6 of the largest derivative, and to 1e-4 of the largest of their column: runs at two
/// tolerances, and differences of runs, agree to that. Columns and rows are those of the linear maps of the run.
pub fn check(name: &str, scene: &Scene, duration: f64, some: Option<&[usize]>, h: f64) -> Sensitivity {
    let plan = scene.plan().unwrap();
    check_by(name, (&plan, &Parameter::all(&plan.simulation)), duration, some, h)
}

/// The same by these parameters.
pub fn check_by(
    name: &str,
    (plan, parameters): (&Plan, &[Parameter]),
    duration: f64,
    some: Option<&[usize]>,
    h: f64,
) -> Sensitivity {
    let sim = &plan.simulation;
    let found = plan.sensitivity(duration, parameters).unwrap();
    let all: Vec<usize> = (0..found.names.len()).collect();
    let columns = some.unwrap_or(&all);
    let other = agrees(name, &found, (sim, &plan.q, &plan.qd), duration, parameters, (columns, h), 1e-6);
    let (own, size) = (found.last_by.as_ref().unwrap().select_columns(columns), other.amax());
    for (k, &j) in columns.iter().enumerate() {
        let (column, apart) = (other.column(k).amax(), (own.column(k) - other.column(k)).amax());
        let fine = apart <= 1e-4 * column.max(3e-4 * size);
        assert!(fine, "{name}: {}: apart by {apart:e} of {column:e} and {size:e}", found.names[j]);
    }
    check_linear(name, (plan, parameters), duration, &found);
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
    assert_eq!(kinds(&found), ["impact"; 3]);
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
        let found = sim.sensitivity(&q, &qd, 0.5, &[]).unwrap();
        let columns: Vec<usize> = (0..12).collect();
        agrees("hanging chain", &found, (&sim, &q, &qd), 0.5, &[], (&columns, 1e-5), 1e-6);
    }
}

/// A PD-controlled arm strikes a wall that is in front of its target, bounces, slides, and stays pressed on it.
#[test]
fn sensitivities_of_an_arm_that_comes_to_press_on_a_wall_equal_differences_of_runs() {
    let pd = "controller = \"pd\"\nkp = { shoulder = 40, elbow = 10 }\nkd = { shoulder = 6, elbow = 1.5 }\ntarget = [0.85, -1.5]";
    let own =
        [("controller = \"off\"", pd), ("friction = 0.0", "friction = 0.3"), ("duration = 0.5", "duration = 1.5")];
    let found = check("pressed", &changed("planar2", &own), 1.5, None, 4e-6);
    let kinds = kinds(&found);
    assert!(kinds.contains(&"impact") && kinds.contains(&"zeno"), "{kinds:?}");
    assert_eq!(found.names.len(), 4 + 2 + 6, "{:?}", found.names);
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
        assert_eq!(kinds(&found), ["impact"], "{:?}", found.broken);
        let columns: Vec<usize> = (0..8).collect();
        agrees("five bars", &found, (&sim, &start.q, &start.qd), 0.2, &[], (&columns, 1e-4), 1e-7);
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
        let (own, columns) = ((&sim, &[0.0, 0.0, 0.1][..], &start[..]), [0, 1, 3, 4, 6]);
        agrees("slip that turns", &found, own, duration, &parameters, (&columns, 1e-5), 1e-6);
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
        agrees("slip that turns at once", &found, (&sim, &q, &qd), 0.2, &belt, (&[3, 4, 6], 1e-7), 1e-5);
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
    assert_eq!(kinds(&found), ["sliding"]);
    let by = found.last_by.unwrap();
    let own = by.column(3) + by.column(6) * speed;
    let (q, qd) = (&found.last.q, &found.last.qd);
    let turned = DVector::from_vec(vec![-q[1], q[0], 0.0, 1.0, 0.0, -qd[1], qd[0], 0.0, 0.0, 0.0]);
    assert!((&own - &turned).amax() < 1e-6 * turned.amax(), "{own} against {turned}");
}

/// Impacts of independent contacts at the same time, an impact at the start, and time steps are named; a touch without an impact is none.
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

    // It turns 1e-17 m above the floor's surface, and moves as without it: it has the derivatives of free motion.
    let grazing = Simulation { gravity: Vector3::zeros(), ..ball(ContactRule::default()) };
    let pull = Simulation { gravity: Vector3::new(0.0, 0.0, 2.0), ..grazing };
    let found = pull.sensitivity(&[0.1 + 0.25], &[-1.0], 1.0, &[]).unwrap();
    let free = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, 1.0]);
    assert!(found.events.is_empty() && (found.last_by.unwrap() - free).amax() < 1e-9, "{:?}", found.broken);
}

/// A robot without a moving joint has no derivatives, and no error.
#[test]
fn a_robot_that_cannot_move_has_empty_derivatives() {
    let sim = Simulation::new(chain(&[Part::new("post", "base", "fixed", Z, [0.0; 3])]), vec![]);
    let found = sim.sensitivity(&[], &[], 0.1, &[Parameter::friction()]).unwrap();
    assert_eq!(found.last_by.unwrap().shape(), (0, 1));
}
