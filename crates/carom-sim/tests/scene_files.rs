//! Scene files: units and bounds of their numbers, messages about refused values, and the bound of a plan.

use carom_chain::ChainError;
use carom_sim::{Drive, Scene, SeveralLaw, SimError, Transition};
use carom_testing::build::{O, Part, X, Y, Z, shape, stl, urdf};
use carom_testing::files::{self, Folder};
use carom_testing::scenes;
use std::path::PathBuf;

/// Reads a scene with the arm `planar2.urdf`.
fn read(text: &str) -> Result<Scene, SimError> {
    scenes::scene(&[("arm.urdf", &files::text("robots/planar2.urdf"))], text)
}

fn rule(text: &str) -> String {
    match read(text) {
        Err(SimError::Scene { rule, .. }) => rule,
        other => panic!("{text}\n{other:?}"),
    }
}

const ARM: &str = "[robot]\nurdf = \"arm.urdf\"\nq = [0.7854, -1.5708]\n";
const WALL: &str = "[[surface]]\nshape = { halfspace = { point = [0.65, 0, 0], normal = [-1, 0, 0] } }\n";

#[test]
fn laws_of_several_contacts_are_read_by_the_names_of_their_authors_too() {
    let energetic = SeveralLaw::Energetic { exponent: 1.5 };
    for (name, law) in [("glocker-pfeiffer", SeveralLaw::Poisson), ("liu-zhao-brogliato", energetic)] {
        let scene = read(&format!("{ARM}{WALL}[contact]\nseveral = \"{name}\"\n[run]\nduration = 1\n")).unwrap();
        assert_eq!(scene.simulation.several, law);
    }
}

/// The displacement of a surface with the frequency f in Hz is amplitude · sin(2π f t + phase).
#[test]
fn the_frequency_of_a_moving_surface_is_in_hertz() {
    let motion = "motion = { amplitude = [0.02, 0, 0], frequency = 2.5, phase = 0.3 }\n";
    let scene = read(&format!("{ARM}{WALL}{motion}[run]\nduration = 1\n")).unwrap();
    let motion = scene.surfaces[0].motion.as_ref().unwrap();
    let mut largest = 0.0_f64;
    for time in [0.0, 0.05, 0.1, 0.33] {
        let angle = 2.0 * std::f64::consts::PI * 2.5 * time + 0.3;
        let [place, velocity, _] = motion.at(time);
        // An angle of some radians is rounded to 1e-15.
        assert!((place.x - 0.02 * angle.sin()).abs() < 1e-15, "{place} at {time} s");
        assert!((velocity.x - 0.02 * 5.0 * std::f64::consts::PI * angle.cos()).abs() < 1e-15, "{velocity} at {time} s");
        largest = largest.max(place.x.abs());
    }
    assert!(largest > 0.01);
}

#[test]
fn latches_and_controllers_are_read_with_their_keys() {
    let of = |more: &str| read(&format!("{ARM}qd = [-0.4, 0.4]\n{WALL}{more}")).unwrap().simulation;
    for latch in ["contact = { latch = true }\n", "[contact]\nlatch = true\n"] {
        let mut touches = of(&format!("{latch}[run]\nduration = 1\n")).touches;
        touches.retain(|touch| touch.link().is_some());
        assert!(!touches.is_empty() && touches.iter().all(|touch| touch.contact.latch), "{latch}: {touches:?}");
    }
    let transition = "[run]\nduration = 1\ncontroller = \"transition\"\ngain = 60\n";
    for (keys, press, compensate) in [("press = 0.5\n", 0.5, true), ("compensate = false\n", 0.0, false)] {
        let Drive::Transition(found) = of(&format!("{transition}{keys}")).drive else { panic!("{keys}") };
        let Transition { gain, .. } = found;
        assert_eq!((gain, found.press, found.compensate), (60.0, press, compensate), "{keys}");
    }
    let changes = "[run]\nduration = 1\ncontroller = \"gravity-compensation\"\nafter_impact = \"pd\"\nkp = 10\nkd = 1\ntarget = [0.7, -1.5]\n";
    let sim = of(changes);
    assert!(matches!((&sim.drive, &sim.after_impact), (Drive::GravityCompensation, Some(Drive::Pd(_)))), "{sim:?}");
}

#[test]
fn a_controller_without_its_keys_is_refused_by_name() {
    for (controller, key) in [
        ("pd", "kp"),
        ("constant", "torque"),
        ("torque-file", "torque_file"),
        ("transition", "gain"),
        ("impact-invariant", "kp"),
    ] {
        for asks in ["controller", "after_impact"] {
            let said = rule(&format!("{ARM}{WALL}[run]\nduration = 1\n{asks} = \"{controller}\"\n"));
            assert_eq!(said, format!("[run] {asks} = \"{controller}\" needs the key {key}"));
        }
    }
}

/// A folder with an arm whose link `b` has the mesh `package://parts/cube.stl`, and a link `c` without mass below it.
struct Desk(Folder);

impl Desk {
    fn new() -> Self {
        let folder = Folder::new();
        let mesh = shape("<mesh filename='package://parts/cube.stl'/>", O, O);
        let parts = [Part::hinge("b", "base", X).with(mesh), Part::hinge("c", "b", X).massless()];
        std::fs::create_dir_all(folder.join("packages/parts")).unwrap();
        folder.write("r.urdf", urdf(&parts));
        Self(folder)
    }

    /// A tetrahedron, as the mesh of the package.
    fn write_mesh(&self) -> PathBuf {
        let corners = [O, X, Y, Z];
        let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        self.0.write("packages/parts/cube.stl", stl(faces.map(|face: [usize; 3]| face.map(|k| corners[k]))))
    }

    fn scene(&self, robot: &str, surfaces: &str) -> Result<Scene, SimError> {
        let text = format!("[robot]\nurdf = \"../r.urdf\"\n{robot}\n{surfaces}\n[run]\nduration = 1\n");
        Scene::from_file(self.0.write("scenes/scene.toml", text))
    }
}

const FLOOR: &str = "[[surface]]\nshape = { halfspace = { point = [0, 0, 0], normal = [0, 0, 1] } }";

#[test]
fn scenes_repair_robots_and_refuse_those_without_dynamics() {
    let desk = Desk::new();
    let error = desk.scene("q = [0, 0]", "").unwrap_err();
    assert!(matches!(&error, SimError::Chain(ChainError::Massless { links, .. }) if *links == ["'c'"]), "{error}");
    let scene = desk.scene("q = [0]\nrepair = true", "").unwrap();
    assert_eq!(scene.simulation.chain.report().repairs.len(), 1);
    let error = desk.scene("q = [0]\nrepair = true\nstrict = true", "").unwrap_err().to_string();
    assert!(error.contains("r.urdf:3: link 'b' <collision>: mesh 'package://parts/cube.stl' is not found"), "{error}");
}

#[test]
fn missing_meshes_are_refused_only_by_scenes_that_need_them() {
    let desk = Desk::new();
    let robot = "q = [0]\nrepair = true";
    let chain = desk.scene(robot, "").unwrap().simulation.chain;
    assert_eq!(chain.report().warnings.len(), 1);
    for surfaces in [FLOOR, "[contact]\nlinks = [[\"b\", \"c\"]]"] {
        let error = desk.scene(robot, surfaces).unwrap_err().to_string();
        assert!(
            error.contains("link 'b': mesh 'package://parts/cube.stl' is not found; there is no folder"),
            "{error}"
        );
        assert!(error.contains("name the folder of its package: --package-dir, in scenes package_dirs"), "{error}");
    }
    let file = desk.write_mesh();
    let scene = desk.scene(&format!("{robot}\nstrict = true\npackage_dirs = [\"../packages\"]"), FLOOR).unwrap();
    assert!(scene.files.iter().any(|it| it.ends_with("packages/parts/cube.stl") && it.is_file()), "{:?}", scene.files);
    assert!(!scene.simulation.touches.is_empty() && file.is_file());
}

#[test]
fn an_empty_path_is_named() {
    let (one, several) = ("[robot]\nq = []", "[[robot]]\nname = \"arm\"");
    for (robot, keys, message) in [
        (one, "urdf = \"\"", "<scene>: [robot] urdf is empty: give the path of the file"),
        (one, "urdf = \"r.urdf\"\nsrdf = \"\"", "<scene>: [robot] srdf is empty: give the path of the file"),
        (several, "urdf = \"\"", "<scene>: [[robot]] 'arm' urdf is empty: give the path of the file"),
    ] {
        let error = Scene::from_toml(&format!("{robot}\n{keys}\n[run]\nduration = 1\n"), "folder").err();
        assert_eq!(error.map(|e| e.to_string()).as_deref(), Some(message));
    }
}

/// The same mesh by a path, by `file://` and by its package.
#[test]
fn meshes_of_surfaces_are_found_like_those_of_robots() {
    let desk = Desk::new();
    let file = desk.write_mesh();
    let robot = "q = [0]\nrepair = true\npackage_dirs = [\"../packages\"]";
    let surface = |name: &str| format!("[[surface]]\nshape = {{ mesh = {{ file = \"{name}\" }} }}");
    let whole = format!("file://{}", file.display());
    for name in ["../packages/parts/cube.stl", "package://parts/cube.stl", &whole] {
        let scene = desk.scene(robot, &surface(name)).unwrap();
        let found = |it: &PathBuf| it.is_file() && it.canonicalize().unwrap() == file.canonicalize().unwrap();
        assert_eq!(
            scene.files.iter().filter(|it| found(it)).count(),
            2,
            "{name}: robot and surface, {:?}",
            scene.files
        );
    }
    let error = desk.scene(robot, &surface("package://parts/no.stl")).unwrap_err().to_string();
    assert!(error.contains("[[surface]] 'surface 1': mesh 'package://parts/no.stl' is not found; tried '"), "{error}");
}

/// A second pair of the same links would count their contact twice. A link paired with itself is refused for that reason.
#[test]
fn a_pair_of_links_that_is_listed_twice_is_refused() {
    let said = |links: &str| rule(&format!("{ARM}{WALL}[contact]\nlinks = [{links}]\n[run]\nduration = 1\n"));
    assert_eq!(
        said(r#"["link1", "tip"], ["link1", "tip"]"#),
        r#"[contact] links = ["link1", "tip"]: the pair is listed twice, remove one"#
    );
    assert_eq!(
        said(r#"["link1", "tip"], ["link1", "link2"], ["tip", "link1"]"#),
        r#"[contact] links = ["tip", "link1"]: the pair is listed twice, remove one"#
    );
    let itself = r#"[contact] links = ["tip", "tip"]: link 'tip' is paired with itself: name two links"#;
    assert_eq!(said(r#"["tip", "tip"]"#), itself);
    let all = format!("{ARM}[contact]\nlinks = [[\"link1\", \"tip\"], [\"link1\", \"link2\"]]\n[run]\nduration = 1\n");
    let touches = read(&all).unwrap().simulation.touches;
    let pairs: std::collections::BTreeSet<_> =
        touches.iter().filter_map(|it| Some((it.link()?, it.other_link()?))).collect();
    assert_eq!(pairs.len(), 2);
}

/// The plan's bound on neglected friction is that for an impact at the start pose and velocity: with the wall 2 nm ahead of the
/// tip, the run reports the same bound.
#[test]
fn the_plan_bounds_neglected_friction_as_the_run_does() {
    let text = |friction: f64| {
        format!(
            "[robot]\nurdf = \"arm.urdf\"\nq = [0.7, -1.3]\nqd = [0.3, 1.1]\n\
             [[surface]]\nshape = {{ halfspace = {{ point = [{}, 0, 0], normal = [-1, 0, 0] }} }}\n\
             [contact]\nlaw = \"energetic\"\nrestitution = 0.35\nfriction = {friction}\n\
             [run]\nduration = 1e-3\nneglect = 0.9\nmax_events = 1\n",
            // Both links are 0.45 m long; the tip is a ball of 1 µm.
            0.45 * (0.7_f64.cos() + (0.7_f64 - 1.3).cos()) + 1e-6 + 2e-9
        )
    };
    for friction in [0.0, 0.01, 0.1] {
        let plan = read(&text(friction)).unwrap().plan().unwrap();
        let run = plan.simulation.run(&plan.q, &plan.qd, 1e-3).unwrap();
        let statistics = run.summary.statistics;
        assert_eq!((run.events.len(), run.events[0].kind.name()), (1, "impact"));
        let bounds: Vec<f64> = plan.bounded.iter().filter(|it| it.what == "friction").map(|it| it.bound).collect();
        if friction == 0.0 {
            assert!(bounds.is_empty() && statistics.neglected_frictions == 0, "{bounds:?}");
            continue;
        }
        assert_eq!((bounds.len(), statistics.neglected_frictions), (1, 1));
        // The arm turns by some nanoradians between the start and the impact.
        let off = bounds[0] / statistics.neglected_bound - 1.0;
        assert!(bounds[0] > 0.1 * friction && off.abs() < 1e-7, "{bounds:?} {statistics:?}");
    }
}

/// The text of a scene file gives the scene of the file; its name in messages is `<scene>`.
#[test]
fn a_scene_from_text_is_that_of_its_file() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes");
    let path = format!("{folder}/planar2.toml");
    let file = Scene::from_file(&path).unwrap();
    let own = Scene::from_toml(&std::fs::read_to_string(&path).unwrap(), folder).unwrap();
    assert_eq!((&file.q, &file.qd, file.duration), (&own.q, &own.qd, own.duration));
    assert_eq!(file.files[0], PathBuf::from(path));
    assert_eq!(file.files[1..], own.files[..]);
    let (file, own) = [&file, &own].map(|scene| scene.plan().unwrap().run(scene.duration).unwrap()).into();
    assert_eq!(file.segments, own.segments);
    let refused = Scene::from_toml("[robot]\nurdf = 3", folder).unwrap_err().to_string();
    assert!(refused.starts_with("<scene>: line 2, urdf = 3: "), "{refused}");
}

/// What users give first and wrongly: a URDF for a scene, a value in degrees, a number as text, a table without a key.
#[test]
fn the_commonest_wrong_inputs_are_told_with_their_remedy() {
    assert_eq!(
        rule("<?xml version=\"1.0\"?>\n<robot name=\"r\"/>"),
        "line 1: the file is XML; give a TOML file, in which the key urdf names the robot's URDF"
    );
    assert_eq!(
        rule(&format!("{ARM}[run]\nduration = \"1 s\"\n")),
        "line 5, duration = \"1 s\": invalid type: string \"1 s\", expected a number"
    );
    let shape = "shape = { cylinder = { radius = 1, centre = [9, 0, 0] } }";
    assert_eq!(
        rule(&format!("{ARM}[[surface]]\n{shape}\n[run]\nduration = 1\n")),
        format!("line 5, {shape}: missing field `length`: add it")
    );
    let gains = "kp = 10\nkd = 1\n";
    assert_eq!(
        rule(&format!("{ARM}[run]\nduration = 1\ncontroller = \"pd\"\n{gains}")),
        "[run] controller = \"pd\" needs the key target: {} keeps the positions at the start"
    );
    let still = read(&format!("{ARM}[run]\nduration = 1\ncontroller = \"pd\"\n{gains}target = {{}}\n")).unwrap();
    assert!(
        matches!(&still.simulation.drive, Drive::Pd(carom_sim::Pd { target, .. }) if *target == still.q),
        "{:?}",
        still.simulation.drive
    );
    let capital = rule(&format!("{ARM}[run]\nduration = 1\ncontroller = \"PD\"\n{gains}"));
    assert!(capital.contains("unknown variant `PD`") && capital.ends_with("did you mean `pd`?"), "{capital}");
    assert_eq!(
        rule("[robot]\nurdf = \"arm.urdf\"\nq = [0, 0, 1, 0, 0, 0, 1, 0, 0]\n[run]\nduration = 1\n"),
        "[robot] q has 9 numbers, 2 are needed (shoulder, elbow); a floating base, which has seven of them, needs floating = true"
    );
    let twice = "[[robot]]\nurdf = \"arm.urdf\"\n[[robot]]\nurdf = \"arm.urdf\"\n[run]\nduration = 1\n";
    assert_eq!(rule(twice), "line 1, [[robot]]: missing field `name`: add it");
    let degrees = read("[robot]\nurdf = \"arm.urdf\"\nq = [45, -90]\n[run]\nduration = 1\n").unwrap();
    let said = degrees.plan().and_then(|plan| plan.run(1.0)).unwrap_err().to_string();
    assert_eq!(
        said,
        "at the start upper limit of shoulder overlaps by 41.9 rad: choose a start without overlap (angles of joints are in rad)"
    );
}

/// Numbers of messages have an exponent where they would have many zeros, and the end of an integration has its reason and a
/// remedy: a torque of 1e160 N m turns the arm once in 1e-80 s.
#[test]
fn motions_beyond_the_digits_of_numbers_are_refused_with_the_reason() {
    let scene = |torque: &str, rest: &str| {
        let text = format!("{ARM}[run]\nduration = 5\ncontroller = \"constant\"\ntorque = [{torque}, 0]\n{rest}");
        read(&text).and_then(|scene| scene.plan()?.run(scene.duration).map(|_| ())).unwrap_err().to_string()
    };
    let fast = scene("1e160", "");
    assert!(fast.contains("shorter than the rounding of the time") && fast.contains("Check the units"), "{fast}");
    let long = scene("1", "tolerance = 1e-300");
    assert!(long.contains("tolerance is 1e-300: no integration reaches it"), "{long}");
}

/// A target of a controller outside joint limits is a warning, as a start there is, unless the joint starts there.
#[test]
fn a_target_outside_joint_limits_is_a_warning() {
    let pd = |target: &str| format!("controller = \"pd\"\nkp = 1\nkd = 1\ntarget = {target}");
    let warnings = |target: &str| {
        carom_testing::scenes::changed("planar2", &[("controller = \"off\"", pd(target).as_str())]).warnings
    };
    assert_eq!(warnings("{ elbow = 1 }"), Vec::<String>::new());
    let told = warnings("{ elbow = 90 }");
    let [only] = told.as_slice() else { panic!("{told:?}") };
    assert!(only.starts_with("[run] target: joint 'elbow' is at 90 rad, above its limit"), "{only}");
    assert!(only.ends_with(" (angles of joints are in rad)"), "{only}");
}
