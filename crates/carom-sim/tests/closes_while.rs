//! Touches that close under a condition.

use carom_sim::{Drive, EventKind, Scene, SimError, Simulation, Trajectory};
use carom_testing::files::Folder;
use carom_testing::scenes::kinds;

/// A point that slides along x and falls along z onto a floor at z = 0, which it may strike only where `condition` is positive. It starts at
/// (x, z) with the velocity (1, vz).
fn scene(condition: &str, start: [f64; 3], contact: &str) -> Result<Scene, SimError> {
    scene_by("", condition, start, contact)
}

/// With these keys of `[run]`.
fn scene_by(run: &str, condition: &str, [x, z, vz]: [f64; 3], contact: &str) -> Result<Scene, SimError> {
    let folder = Folder::new();
    let urdf = r#"<robot name="point"><link name="ground"/><link name="rail"/>
      <joint name="x" type="prismatic"><parent link="ground"/><child link="rail"/><axis xyz="1 0 0"/>
        <limit effort="0" velocity="100"/></joint>
      <link name="ball"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
        <collision><geometry><sphere radius="1e-12"/></geometry></collision></link>
      <joint name="z" type="prismatic"><parent link="rail"/><child link="ball"/><axis xyz="0 0 1"/>
        <limit effort="0" velocity="100"/></joint></robot>"#;
    std::fs::write(folder.0.join("point.urdf"), urdf).unwrap();
    let text = format!(
        "[robot]\nurdf = \"point.urdf\"\ntip = \"ball\"\nq = [{x}, {z}]\nqd = [1, {vz}]\n[[surface]]\nname = \"floor\"\n\
         shape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n[contact]\n{contact}\n\
         [[contact.pair]]\nlink = \"ball\"\n{condition}\n[run]\n{run}\nduration = 1\ngravity = [0, 0, -10]"
    );
    Scene::from_toml(&text, &folder.0)
}

fn run(scene: &Scene) -> Result<Trajectory, SimError> {
    let plan = scene.plan()?;
    plan.run(scene.duration)
}

const BOUNCE: &str = "law = \"newton\"\nrestitution = 0.5";

#[test]
fn a_touch_whose_condition_holds_strikes_as_one_without() {
    let start = [0.1, 0.2, 0.0];
    let (free, own) = (scene("", start, BOUNCE).unwrap(), scene("closes_while = \"x\"", start, BOUNCE).unwrap());
    let (free, own) = (run(&free).unwrap(), run(&own).unwrap());
    let times = |run: &Trajectory| run.events.iter().map(|event| event.time.to_bits()).collect::<Vec<_>>();
    assert!(!free.events.is_empty());
    assert_eq!(times(&free), times(&own));
    assert_eq!(free.summary.last, own.summary.last);
}

#[test]
fn a_touch_whose_condition_fails_does_not_strike() {
    let scene = scene("closes_while = \"x - 2\"", [0.1, 0.2, 0.0], BOUNCE).unwrap();
    let plan = scene.plan().unwrap();
    let told = plan
        .kept
        .iter()
        .find(|it| it.what == "contacts" && it.choice == "ball on floor" && it.why.contains("x - 2 > 0"));
    assert!(told.is_some(), "{:?}", plan.kept);
    let run = run(&scene).unwrap();
    assert!(run.events.is_empty(), "{:?}", kinds(&run));
    let last = run.summary.last;
    assert!((last.q[1] - (0.2 - 5.0)).abs() < 1e-9 && (last.qd[1] + 10.0).abs() < 1e-9, "{last:?}");
}

#[test]
fn a_condition_that_begins_to_hold_in_flight_lets_the_next_closing_strike() {
    // It is thrown up from below the floor, passes it
    // upwards at x < 0, and strikes it on the way down at x > 0.
    let scene = scene("closes_while = \"x\"", [-0.2, -0.2, 3.0], BOUNCE).unwrap();
    let run = run(&scene).unwrap();
    // −0.2 + 3t − 5t² = 0 at t = (3 + √5)/10.
    let time = (3.0 + 5.0_f64.sqrt()) / 10.0;
    let first = &run.events[0];
    assert!(matches!(first.kind, EventKind::Impact { .. }), "{}", first.kind.name());
    assert!((first.time - time).abs() < 1e-12, "{} {time}", first.time);
}

#[test]
fn a_condition_that_begins_to_hold_inside_the_floor_is_refused_with_touch_time_and_depth() {
    let scene = scene("closes_while = \"x\"", [-0.5, 0.2, 0.0], BOUNCE).unwrap();
    let Err(SimError::ClosesInside { time, touch, depth, .. }) = run(&scene) else { panic!("it was not refused") };
    assert!((time - 0.5).abs() < 1e-12 && touch == "ball on floor", "{time} {touch}");
    assert!((depth - (5.0 * 0.25 - 0.2)).abs() < 1e-9, "{depth}");
}

#[test]
fn a_contact_that_lasts_goes_on_where_its_condition_fails() {
    let scene = scene("closes_while = \"0.5 - x\"", [0.1, 0.0, 0.0], "restitution = 0").unwrap();
    let run = run(&scene).unwrap();
    let last = run.summary.last;
    assert!((last.q[0] - 1.1).abs() < 1e-12 && last.q[1].abs() < 1e-11, "{last:?}");
    assert_eq!(run.summary.contacts.len(), 1);
}

/// Closed form: the impact is at T = (v + √(v² + 2 g z))/g, and T' by z is 1/√(v² + 2 g z).
#[test]
fn derivatives_pass_the_begin_of_a_condition() {
    let scene = scene("closes_while = \"x\"", [-0.2, -0.2, 3.0], BOUNCE).unwrap();
    let plan = scene.plan().unwrap();
    let found = plan.sensitivity(1.0, &[]).unwrap();
    assert_eq!(found.broken, None);
    let impact = found.events.iter().find(|event| event.kinds.contains(&"impact")).unwrap();
    let root = 5.0_f64.sqrt();
    for (found, exact) in impact.time_by.iter().zip([0.0, 1.0 / root, 0.0, (3.0 + root) / 10.0 / root]) {
        assert!((found - exact).abs() < 1e-9, "{:?}", impact.time_by);
    }
}

#[test]
fn conditions_that_are_no_functions_of_joints_are_refused_with_key_and_value() {
    for (formula, told) in [
        ("y", "has no variable 'y': there are x, qd x, z, qd z"),
        ("x*z", "is not linear"),
        ("{qd x}", "must be a function of joints with one coordinate"),
        ("1", "must be a function of joints with one coordinate"),
        ("x -", "is no formula"),
    ] {
        let refused = scene(&format!("closes_while = \"{formula}\""), [0.1, 0.2, 0.0], BOUNCE).unwrap_err().to_string();
        assert!(refused.contains("[[contact.pair]] closes_while") && refused.contains(told), "{formula}: {refused}");
    }
}

/// Past the floor, a landing on it, and rest on it after the condition has ceased: as with events.
#[test]
fn time_steps_follow_conditions() {
    let last = |method: &str, condition: &str, start: [f64; 3]| {
        let run_of = scene_by(&format!("method = \"{method}\""), condition, start, "restitution = 0").unwrap();
        run(&run_of).unwrap().summary.last.q
    };
    for (condition, start, height) in [
        ("closes_while = \"x - 2\"", [0.1, 0.2, 0.0], 0.2 - 5.0),
        ("closes_while = \"x\"", [-0.2, -0.2, 3.0], 0.0),
        ("closes_while = \"0.5 - x\"", [0.1, 0.2, 0.0], 0.0),
        ("closes_while = \"0.5 - x\"", [0.1, 0.0, 0.0], 0.0),
        ("closes_while = \"0.5 - x\"", [0.35, 0.2, 0.0], 0.2 - 5.0),
    ] {
        // Steps of 1 ms leave overlaps of twice the fall in one of them.
        for (method, error) in [("events", 1e-9), ("steps", 2.1 * 10.0 * 1e-6)] {
            let q = last(method, condition, start);
            let apart = (q[0] - start[0] - 1.0).abs().max((q[1] - height).abs());
            assert!(apart <= error, "{method} {condition}: {q:?}");
        }
    }
}

#[test]
fn a_condition_that_begins_to_hold_inside_the_floor_is_refused_by_time_steps_too() {
    let steps = scene_by("method = \"steps\"", "closes_while = \"x\"", [-0.5, 0.2, 0.0], BOUNCE).unwrap();
    let Err(SimError::ClosesInside { time, touch, depth, .. }) = run(&steps) else { panic!("it was not refused") };
    // Within a time step of 1 ms, in which it falls 5 mm.
    assert!((time - 0.5).abs() <= 1.001e-3 && touch == "ball on floor", "{time} {touch}");
    assert!((depth - (5.0 * 0.25 - 0.2)).abs() < 6e-3, "{depth}");
}

/// Impacts are counted by time steps, too: the controller after the first impact pushes the body up.
#[test]
fn time_steps_switch_the_controller_after_an_impact() {
    let scene = scene("", [0.1, 0.05, 0.0], "law = \"newton\"\nrestitution = 0").unwrap();
    let sim = scene.plan().unwrap().simulation;
    let rise = |stepping: bool| {
        let after_impact = Some(Drive::Constant(vec![0.0, 12.0]));
        let sim = Simulation { stepping, after_impact, ..sim.clone() };
        sim.run(&scene.q, &scene.qd, 1.0).unwrap().summary.last.q[1]
    };
    // It falls for 0.1 s, and then rises with 2 m/s².
    let exact = (1.0 - 0.1_f64).powi(2);
    assert!((rise(false) - exact).abs() < 1e-8, "{}", rise(false));
    assert!((rise(true) - exact).abs() < 0.01, "{}", rise(true));
}

/// A scene that has friction and chooses no law is told that an impact of one contact has none; one that chooses this law is not.
#[test]
fn friction_under_the_law_by_default_is_told() {
    let told = |contact: &str| {
        let warnings = scene("", [0.1, 0.2, 0.0], contact).unwrap().warnings;
        warnings.iter().filter(|it| it.contains("by default: ball on floor has friction 0.3")).count()
    };
    assert_eq!(["friction = 0.3", "law = \"frictionless\"\nfriction = 0.3", "restitution = 0.3"].map(told), [1, 0, 0]);
}
