//! The keys of a scene file: the effect of each, and the messages of refusals.

use crate::command_line::desk::*;
use serde_json::Value;

/// planar2 starts at 0.2 m/s a few micrometres before the wall. Tests replace the comments by further keys.
const SCENE: &str = r#"[robot]
urdf = "planar2.urdf"
q = [0.7854, -1.5708]
qd = [-0.444444, 0.444444]
[[surface]]
shape = { halfspace = { point = [0.6364, 0, 0], normal = [-1, 0, 0] } }
#surface
[contact]
law = "energetic"
restitution = 0.35
#contact
[run]
duration = 0.1
#run
"#;

/// A box in flight.
const FREE: &str = "[robot]\nurdf = \"box.urdf\"\nfloating = true\nq = [0, 0, 1, 0, 0, 0, 1]\nqd = [0, 0, 0, 0, 0, 0]\n\
                    [run]\nduration = 0.1\n";

impl Desk {
    /// The answer of a command to a scene, and its standard error.
    #[track_caller]
    fn told(&self, command: &str, scene: &str) -> (Value, String) {
        self.write("s.toml", scene);
        let ran = self.run(&format!("{command} s.toml --json"));
        assert_eq!(ran.code, Some(0), "{}", ran.err);
        (serde_json::from_str(&ran.out).unwrap(), ran.err)
    }

    /// Checks for exit status 1, this message, no answer and no new file.
    #[track_caller]
    fn refuses(&self, scene: &str, message: &str) {
        self.write("s.toml", scene);
        let before = self.files("");
        refused(self.run("simulate s.toml --json --csv x.csv"), &format!("s.toml: {message}"));
        assert_eq!(self.files(""), before, "nothing is written");
    }

    /// Checks the message of each change of the scene at `mark`.
    #[track_caller]
    fn refuses_all(&self, mark: &str, cases: &[(&str, &str)]) {
        for (change, message) in cases {
            self.refuses(&at(mark, change), message);
        }
    }
}

/// The scene with lines in the place of a mark.
fn at(mark: &str, lines: &str) -> String {
    assert!(SCENE.contains(mark));
    SCENE.replace(mark, lines)
}

/// The scene with another shape for the wall.
fn shaped(shape: &str) -> String {
    SCENE.replace("halfspace = { point = [0.6364, 0, 0], normal = [-1, 0, 0] }", shape)
}

/// The limits of a joint have their own restitution: the elbow rebounds with e times its velocity.
#[test]
fn a_pair_may_be_the_limits_of_a_joint() {
    let desk = Desk::new();
    let pair = "[[contact.pair]]\njoint = \"elbow\"\nrestitution = 0.6";
    let scene = at("#contact", pair).replace("-1.5708]", "-3.09]").replace("[-0.444444, 0.444444]", "[0, -0.5]");
    let (run, _) = desk.told("simulate", &scene);
    let event = &run["events"][0];
    assert_eq!((event["kind"].as_str(), event["contact"].as_str()), (Some("limit"), Some("elbow")));
    let rate = |key: &str| event[key][1].as_f64().unwrap();
    assert!((rate("qd_plus") + 0.6 * rate("qd_minus")).abs() < 1e-14, "{event}");
}

#[test]
fn invalid_contact_rules_are_refused() {
    let desk = Desk::new();
    desk.refuses_all(
        "#surface",
        &cases(r#"
            contact = { restituton = 0.9 }
                line 7: unknown field `restituton`, expected one of `law`, `restitution`, `tangential_restitution`, `friction`, `latch`, `compliance`, `relative_stiffness`; did you mean `restitution`?
            contact = { restitution = 2 }
                [[surface]] 'surface 1': restitution is 2: a coefficient of restitution lies between 0 and 1
            contact = { friction = -1 }
                [[surface]] 'surface 1': friction is -1: a coefficient of friction is finite and not negative
            contact = { latch = 1 }
                line 7, contact = { latch = 1 }: invalid type: integer `1`, expected a boolean
            motion = { amplitude = [0.001, 0, 0], frequenzy = 2 }
                line 7: unknown field `frequenzy`, expected one of `amplitude`, `frequency`, `phase`, `velocity`, `file`; did you mean `frequency`?
            motion = { amplitude = [0.001, 0, 0] }
                [[surface]] 'surface 1': motion needs the key frequency (or else velocity, or file)
            motion = { amplitude = [nan, 0, 0], frequency = 2 }
                [[surface]] 'surface 1': every number of motion must be finite
            motion = { amplitude = [0, 0], frequency = 2 }
                line 7, motion = { amplitude = [0, 0], frequency = 2 }: 2 numbers, 3 are needed
            [[surface]]\nname = "surface 1"\nshape = { sphere = { centre = [9, 0, 0], radius = 1 } }
                [[surface]] name = "surface 1": two surfaces have this name, rename one
        "#),
    );
    desk.refuses_all(
        "#contact",
        &cases(r#"
            several = "newton"
                line 11, several = "newton": unknown variant `newton`, expected one of `moreau`, `poisson`, `sequential`, `energetic`
            links = [["tip", "base"]]
                [contact] links = ["tip", "base"]: link 'base' has no collision shape: give it one in the URDF
            links = [["tip", "lnk2"]]
                [contact] links = ["tip", "lnk2"]: no link is named 'lnk2'; did you mean 'link2'?
            [[contact.pair]]\nrestitution = 0.8
                [[contact.pair]] needs link, surface or both, or else joint (for its limits)
            [[contact.pair]]\njoint = "elbow"\nlink = "tip"
                [[contact.pair]] needs link, surface or both, or else joint (for its limits)
            [[contact.pair]]\nlink = "tipp"
                [[contact.pair]] no link is named 'tipp'; did you mean 'tip'?
            [[contact.pair]]\nsurface = "wall"
                [[contact.pair]] surface = "wall": the surfaces are surface 1
            [[contact.pair]]\njoint = "elbw"
                [[contact.pair]] no joint is named 'elbw'; did you mean 'elbow'?
            [[contact.pair]]\nlink = "tip"\nrestitution = 7
                [[contact.pair]] tip on surface 1: restitution is 7: a coefficient of restitution lies between 0 and 1
            [[contact.pair]]\nlink = "tip"\nlach = true
                line 13: unknown field `lach`, expected one of `link`, `surface`, `joint`, `disabled`, `closes_while`, `law`, `restitution`, `tangential_restitution`, `friction`, `latch`, `compliance`, `relative_stiffness`; did you mean `latch`?
        "#),
    );
    for (old, new, message) in [
        (
            "restitution = 0.35",
            "restitution = -0.1",
            "[contact]: restitution is -0.1: a coefficient of restitution lies between 0 and 1",
        ),
        ("q = [0.7854, -1.5708]", "q = [0.7854]", "q has 1 numbers, 2 are needed (shoulder, elbow)"),
        (
            "normal = [-1, 0, 0]",
            "normal = [0, 0, 0]",
            "[[surface]] 'surface 1': obstacle: normal is (0, 0, 0): a direction must not be zero",
        ),
        (
            "restitution =",
            "restituton =",
            "line 10: unknown field `restituton`, expected one of `law`, `restitution`, `tangential_restitution`, `friction`, \
             `latch`, `compliance`, `relative_stiffness`, `limit_restitution`, `several`, `several_exponent`, `links`, \
             `between_robots`, `pair`; did you mean `restitution`?",
        ),
    ] {
        desk.refuses(&SCENE.replace(old, new), message);
    }
}

/// A pair that cannot touch is a warning, not an error.
#[test]
fn a_pair_that_cannot_touch_is_a_warning() {
    let desk = Desk::new();
    for (named, shown) in [("link = \"base\"", "link = \"base\""), ("joint = \"probe\"", "joint = \"probe\"")] {
        let scene = at("#contact", &format!("[[contact.pair]]\n{named}\nrestitution = 0.5"));
        let (_, said) = desk.told("simulate", &scene);
        assert_eq!(said, format!("warning: s.toml: [[contact.pair]] {shown}: applies to no contact of this scene\n"));
    }
}

#[test]
fn controllers_without_their_parameters_are_refused() {
    let desk = Desk::new();
    let gains = "kd = 1\ntarget = [0, 0]";
    let known = "expected one of `off`, `pd`, `constant`, `gravity-compensation`, `transition`, `impact-invariant`, \
                 `torque-file`, `tracking`, `feedback`";
    desk.refuses_all(
        "#run",
        &[
            (
                "controller = \"tranzition\"",
                &format!(
                    "line 14, controller = \"tranzition\": unknown variant `tranzition`, {known}; did you mean \
                     `transition`?"
                ),
            ),
            ("controller = \"transition\"\ngain = -10", "gain is -10: it must be finite and not negative"),
            ("controller = \"transition\"\ngain = 9\npress = nan", "press is NaN: it must be finite and not negative"),
            (
                "controller = \"transition\"\ngain = 9\ncompensate = \"yes\"",
                "line 16, compensate = \"yes\": invalid type: string \"yes\", expected a boolean",
            ),
            ("controller = \"constant\"\ntorque = [1, 2, 3]", "torque has 3 numbers, 2 are needed (shoulder, elbow)"),
            (
                "controller = \"pd\"\nkp = 1\nkd = 1\ntarget = [0]",
                "[run] target has 1 numbers, 2 are needed (shoulder, elbow)",
            ),
            ("kp = 1", "[run] kp is not read by the chosen controller: remove it or set controller = \"pd\""),
            (
                "torque_file = \"x.csv\"",
                "[run] torque_file is not read by the chosen controller: remove it or set controller = \"torque-file\"",
            ),
            (
                "press = 1",
                "[run] press is not read by the chosen controller: remove it or set controller = \"transition\"",
            ),
        ],
    );
    let boxed = shaped("box = { centre = [1.1364, 0, 0], size = [1, 1, 1] }");
    for (name, keys) in [("transition", "gain = 60".to_owned()), ("impact-invariant", format!("kp = 1\n{gains}"))] {
        let scene = boxed.replace("#run", &format!("controller = \"{name}\"\n{keys}"));
        let why = "refers to the first surface, which must be a halfspace";
        desk.refuses(&scene, &format!("[run] controller = \"{name}\" {why}"));
    }
}

#[test]
fn invalid_torque_files_are_refused_with_their_line() {
    let desk = Desk::new();
    let cells = "every cell must be a finite number, separated by commas";
    let scene = at("#run", "controller = \"torque-file\"\ntorque_file = \"t.csv\"");
    desk.refuses(&scene, "[run] torque_file t.csv: No such file or directory (os error 2)");
    for (text, why) in [
        ("", "it has no row of numbers: give the time and one joint force for each column"),
        ("time,elbow,shoulder\n", "it has no row of numbers: give the time and one joint force for each column"),
        ("time,elbow,shoulder\n0,0,0\n1,x,1\n", &format!("line 3: {cells}")),
        (
            "time,elbow,sholder\n0,0,0\n",
            "column sholder is not known: the columns are time, shoulder, elbow (did you mean shoulder?); remove it or correct \
             its name",
        ),
        ("elbow,shoulder\n0,0\n", "column time is missing: add it, in s"),
        ("time\n0\n1\n", "it has no column beside time: add some of shoulder, elbow"),
        ("time,elbow\n0,0\n", "column shoulder is missing: add it (the columns are time, shoulder, elbow)"),
        ("time,elbow,time,shoulder\n0,0,0,0\n", "column time occurs twice: remove one"),
        ("0,x,0\n1,0,0\n", &format!("line 1: {cells}")),
        ("0,0,0\n1,nan,0\n", &format!("line 2: {cells}")),
        ("0,0\n1,1\n", "line 1: 2 columns, but 3 are needed: the time and 2 joint forces"),
        ("0,0,0\n1,1,1,1\n", "line 2: 4 columns, but 3 are needed: the time and 2 joint forces"),
        (
            "0,0,0\n1,0,0\n1,1,0\n1,2,0\n",
            "line 4: time 1 is that of both previous rows: a jump has two, before and after it, remove one",
        ),
        ("0,0,0\n2,0,0\n1,0,0\n", "line 3: time 1 is below that of the previous row: times must ascend"),
    ] {
        desk.write("t.csv", text);
        desk.refuses(&scene, &format!("[run] torque_file t.csv: {why}"));
    }
}

#[test]
fn invalid_settings_are_refused() {
    let desk = Desk::new();
    desk.refuses_all(
        "#run",
        &cases(r#"
            model = "ful"
                line 14, model = "ful": unknown variant `ful`, expected `auto` or `full`; did you mean `full`?
            model = 1
                line 14, model = 1: wanted string or table
            method = "step"
                line 14, method = "step": unknown variant `step`, expected `events` or `steps`; did you mean `steps`?
            method = "steps"\n[contact.compliance]\nstiffness = 1e5
                link2 on surface 1, corner 1: compliance stiffness is 100000: time stepping supports rigid contacts only: remove the compliance or use method = "events"
            neglect = 0
                [run] neglect = 0: it must be above 0 and below 1
            neglect = 1.5
                [run] neglect = 1.5: it must be above 0 and below 1
            neglect = nan
                [run] neglect = NaN: it must be above 0 and below 1
            neglect = "a"
                line 14, neglect = "a": invalid type: string "a", expected a number
            tolerance = 0
                tolerance is 0: it must be positive and finite
            tolerance = -1e-9
                tolerance is -1e-9: it must be positive and finite
            contact_step = 0
                contact step is 0: it must be positive and finite
            contact_step = nan
                contact step is NaN: it must be positive and finite
            sample = 0
                [run] sample = 0: it must be positive and finite
            max_step = 1e-11
                longest step is 1e-11: the duration is more than 1e10 times as long: shorten the duration, or lengthen this
            tolerance = 1e-16
                tolerance is 1e-16: no integration reaches it: numbers are rounded to 2.2e-16 of their size
            gravity = [0, nan, 0]
                gravity is NaN: every component must be finite
            contact_stp = 1
                line 14: unknown field `contact_stp`, expected one of `duration`, `tolerance`, `accuracy`, `gravity`, `sample`, `max_step`, `zeno_time`, `contact_step`, `max_events`, `method`, `model`, `neglect`, `effort_limits`, `perturb`, `controller`, `after_impact`, `target`, `kp`, `kd`, `torque`, `torque_file`, `feedback_file`, `reference`, `feed_forward`, `gain`, `press`, `compensate`; did you mean `contact_step`?
        "#),
    );
    let inside = SCENE.replace("0.6364, 0, 0", "0.63, 0, 0");
    desk.refuses(
        &inside,
        "at the start tip on surface 1 overlaps by 0.006396 m: choose a start without overlap, or turn a \
                           normal that points away from the robot",
    );
    let start = |tip: &str| SCENE.replace("qd = [-0.444444, 0.444444]", &format!("tip_velocity = {{ {tip} }}"));
    desk.refuses(
        &start("speed = 0.2, angle_deg = 45, along = [1, 0, 0]"),
        "[robot] tip_velocity: along = [1, 0, 0] is normal to the surface: give a direction along the surface",
    );
    desk.refuses(
        &start("speed = nan, angle_deg = 45, along = [0, 1, 0]"),
        "[robot] tip_velocity: speed NaN and angle_deg 45 must be finite",
    );
}

#[test]
fn invalid_shapes_are_refused() {
    let desk = Desk::new();
    desk.write("empty.stl", "solid nothing\nendsolid nothing\n");
    desk.write("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    let nothing = |file: &str, count: u8| {
        format!(
            "mesh '{file}' has no triangle of non-zero area ({count} triangles in the file): give a mesh with \
             triangles, or a box"
        )
    };
    for (shape, why) in [
        ("mesh = { file = \"empty.stl\" }", nothing("empty.stl", 0)),
        ("mesh = { file = \"line.obj\" }", nothing("line.obj", 1)),
        ("mesh = { file = \"no.stl\" }", "mesh 'no.stl' cannot be read: No such file or directory (os error 2)".into()),
        (
            "mesh = { file = \"m.ply\" }",
            "mesh 'm.ply' has the file type 'ply', which is not supported: give an stl, dae or obj file".into(),
        ),
        (
            "mesh = { file = \"line.obj\", scale = [0, 1, 1] }",
            "mesh 'line.obj' has the scale (0, 1, 1): each factor must be finite and not zero".into(),
        ),
        ("sphere = { centre = [2, 0, 0], radius = -1 }", "radius is -1: it must be positive and finite".into()),
        ("box = { centre = [2, 0, 0], size = [0, 1, 1] }", "size x is 0: it must be positive and finite".into()),
    ] {
        desk.refuses(&shaped(shape), &format!("[[surface]] 'surface 1': obstacle: {why}"));
    }
    desk.refuses(
        &shaped("msh = { file = \"m.stl\" }"),
        "line 6, shape = { msh = { file = \"m.stl\" } }: unknown variant `msh`, expected one of `halfspace`, `box`, \
         `sphere`, `cylinder`, `capsule`, `mesh`; did you mean `mesh`?",
    );
}

fn choices<'a>(plan: &'a Value, section: &str, what: &str) -> Vec<&'a str> {
    let lines = plan[section].as_array().unwrap().iter().filter(|line| line["what"] == what);
    lines.map(|line| line["choice"].as_str().unwrap()).collect()
}

#[test]
fn a_plan_has_the_documented_keys() {
    let desk = Desk::new();
    let scene = at("#run", "neglect = 0.5").replace("#contact", "friction = 0.001");
    let (plan, said) = desk.told("plan", &scene);
    assert_eq!(said, "");
    assert_eq!(keys(&plan), ["bounded", "joints", "kept", "left_out"]);
    assert_eq!(plan["joints"], serde_json::json!(["shoulder", "elbow"]));
    for (section, expected) in [
        ("kept", ["choice", "what", "why"].as_slice()),
        ("left_out", ["choice", "what", "why"].as_slice()),
        ("bounded", ["bound", "choice", "of", "what"].as_slice()),
    ] {
        let lines = plan[section].as_array().unwrap();
        assert!(!lines.is_empty(), "{section}");
        lines.iter().for_each(|line| assert_eq!(keys(line), expected, "{section}"));
    }
    assert_eq!(choices(&plan, "kept", "space"), ["the plane with the normal (0, 0, 1)"]);
    // The full model leaves nothing out.
    let (full, _) = desk.told("plan", &scene.replace("neglect = 0.5", "model = \"full\""));
    assert_eq!(choices(&full, "kept", "model"), ["everything, in space"]);
    assert!(choices(&full, "left_out", "space").is_empty() && full["bounded"].as_array().unwrap().is_empty());
}

/// Longer lists than a vector has numbers, and settings of the computation as parameters, are errors.
#[test]
fn wishes_that_have_no_effect_are_refused_with_names() {
    let desk = Desk::with_studies();
    let bounce = desk.read("scenes/bounce.toml").replace("../robots", "robots");
    desk.write("four.toml", bounce.replace("normal = [0, 0, 1]", "normal = [0, 0, 1, 7]"));
    desk.write("noisy.toml", format!("{bounce}perturb = {{ q = 0.01 }}\n"));
    for (args, told) in [
        ("simulate four.toml", "4 numbers, 3 are needed"),
        ("simulate scenes/bounce.toml --sensitivity --wrt run.duration", "duration is no parameter of the motion"),
        ("simulate scenes/bounce.toml --sensitivity --wrt run.tolerance", "a setting of the computation"),
        ("simulate scenes/bounce.toml --sensitivity --out -", "--sensitivity is part of the answer"),
        ("simulate noisy.toml --runs 3 --covariance --out -", "--covariance is part of the answer"),
        ("simulate noisy.toml --runs 1 --covariance", "--covariance: run 0 is without disturbance"),
    ] {
        refused_with(&desk.run(args), told);
    }
}

/// Values that can't act where they stand.
#[test]
fn values_that_exclude_one_another_are_refused() {
    let desk = Desk::new();
    let refused = |scene: &str, told: &str| {
        desk.write("s.toml", scene);
        let ran = desk.run("simulate s.toml");
        refused_with(&ran, told);
        assert!(ran.err.starts_with("error: s.toml: "), "{scene}\n{ran:?}");
    };
    for (place, keys, told) in [
        ("#contact", "latch = true\ncompliance = { stiffness = 1e4 }", "a latch holds a rigid contact point"),
        ("#run", "model = \"full\"\nneglect = 0.1", "[run] neglect leaves out of the model what has a small effect"),
        ("#run", "perturb = { seed = 3 }", "[run] perturb disturbs nothing"),
        ("#run", "perturb = { q = 0, numbers = { \"contact.restitution\" = 0.0 } }", "[run] perturb disturbs nothing"),
    ] {
        refused(&at(place, keys), told);
    }
    let held = format!("{FREE}controller = \"pd\"\nkp = 10\nkd = 1\ntarget = {{}}\n");
    refused(&held, "controller = \"pd\" acts on joints with one coordinate, and the robot has none");
}

/// Values that nothing in the scene uses.
#[test]
fn values_that_nothing_uses_are_warned_of() {
    let desk = Desk::new();
    for (place, keys, told) in [
        (
            "#contact",
            "[[contact.pair]]\nlink = \"tip\"",
            "[[contact.pair]] link = \"tip\": gives its contacts no value",
        ),
        (
            "#contact",
            "relative_stiffness = 2",
            "relative_stiffness: only the law of several contacts \"energetic\" uses it",
        ),
        (
            "#run",
            "method = \"steps\"\nmax_step = 0.1",
            "[run] max_step: method = \"steps\" has steps of contact_step only",
        ),
        (
            "#run",
            "method = \"steps\"\ntolerance = 1e-4",
            "[run] tolerance: method = \"steps\" has steps of contact_step only",
        ),
        (
            "#run",
            "[[force]]\nlink = \"tip\"\nfile = \"late.csv\"",
            "[[force]] 1: the table of tip is zero at all times of the run, 0 to ",
        ),
        (
            "#run",
            "[[force]]\nlink = \"base\"\nforce = [1, 0, 0]",
            "[[force]] 1: base is fixed to the world: no force moves it",
        ),
        ("#run", "effort_limits = true", "effort_limits: limits nothing while the motors are off (controller)"),
        (
            "#surface",
            "contact = { friction = 0, compliance = { stiffness = 1e4, slip_speed = 0.01 } }",
            "compliance slip_speed and bristle: no compliant contact of this scene has friction",
        ),
        (
            "#surface",
            "name = \"belt\"\ncontact = { friction = 0 }\nbelt = { velocity = [0, 1, 0] }",
            "[[surface]] 'belt': belt: no contact of this surface has friction",
        ),
    ] {
        desk.write("late.csv", "time,fx\n5,1\n6,1\n");
        let (_, said) = desk.told("simulate", &at(place, keys));
        assert!(said.contains(told), "{keys}: {said}");
    }
    let (_, said) = desk.told("simulate", &format!("{FREE}[contact]\nlimit_restitution = 0.5\n"));
    assert_eq!(said, "warning: s.toml: limit_restitution: no joint of this scene has limits that act\n");
}
