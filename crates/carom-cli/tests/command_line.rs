//! The `carom` command from outside: what it takes, what it answers, what it refuses and in which words.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2, Vector3};
use serde_json::{Value, json};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

const INERTIAL: &str =
    r#"<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"#;

/// Elbow up, tip at rest against a wall whose normal points along -x.
const UP_ELBOW: [f64; 2] = [FRAC_PI_4, -FRAC_PI_2];

// ---------------------------------------------------------------------------------------------------------------------
// A folder to work in, and the command run there
// ---------------------------------------------------------------------------------------------------------------------

/// A folder that goes when the test ends. Commands run in it, so that messages name files without it.
struct Desk(PathBuf);

/// What a run left behind.
#[derive(Debug, PartialEq)]
struct Ran {
    code: Option<i32>,
    out: String,
    err: String,
}

impl Desk {
    /// With the preset robots in it.
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("carom-cli-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for robot in ["planar2.urdf", "planar3.urdf", "arm7.urdf"] {
            let preset = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots").join(robot);
            std::fs::copy(preset, folder.join(robot)).unwrap();
        }
        Self(folder)
    }

    fn write(&self, file: &str, text: impl AsRef<[u8]>) {
        std::fs::write(self.0.join(file), text).unwrap();
    }

    fn command(&self, args: &str) -> Command {
        self.command_of(&args.split_whitespace().collect::<Vec<_>>())
    }

    fn command_of(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_carom"));
        command.args(args).current_dir(&self.0).env_remove("ROS_PACKAGE_PATH");
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Runs with arguments that hold no spaces.
    fn run(&self, args: &str) -> Ran {
        self.feed(args, "")
    }

    /// The same, with text on standard input.
    fn feed(&self, args: &str, input: impl AsRef<[u8]>) -> Ran {
        finish(self.command(args).spawn().unwrap(), input.as_ref())
    }

    /// Answers as JSON. Nothing may be refused.
    fn answers(&self, args: &str, input: &str) -> Vec<Value> {
        let ran = self.feed(args, input);
        assert_eq!(ran.code, Some(0), "{args}: {}", ran.err);
        ran.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// The one answer to one line.
    fn answer(&self, args: &str, input: &Value) -> Value {
        let answers = self.answers(args, &input.to_string());
        assert_eq!(answers.len(), 1, "{args}");
        answers.into_iter().next().unwrap()
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Feeds a run and collects it. Whoever refuses early reads no input, so a broken pipe is no failure here.
fn finish(mut child: Child, input: &[u8]) -> Ran {
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_vec();
    let feeder = std::thread::spawn(move || {
        let _ = stdin.write_all(&input);
    });
    let output = child.wait_with_output().unwrap();
    feeder.join().unwrap();
    Ran {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Refused with exit status 1, nothing on standard output, and this one line on standard error.
#[track_caller]
fn refused(ran: Ran, message: &str) {
    let expected = Ran { code: Some(1), out: String::new(), err: format!("error: {message}\n") };
    assert_eq!(ran, expected);
}

/// Usage: exit status 2, nothing on standard output, these words on standard error.
#[track_caller]
fn usage(ran: Ran, words: &str) {
    assert_eq!((ran.code, ran.out.as_str()), (Some(2), ""), "{}", ran.err);
    assert!(ran.err.contains(words), "{:?} not in {:?}", words, ran.err);
}

/// Done with exit status 0 and nothing on standard error.
#[track_caller]
fn done(ran: &Ran) {
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""));
}

/// Whatever was asked: no panic, an exit status of the contract, one line of refusal, and JSON without holes.
#[track_caller]
fn civil(ran: &Ran, what: &str) {
    assert!(matches!(ran.code, Some(0..=2)), "{what}: {ran:?}");
    assert!(!ran.err.contains("panicked"), "{what}: {ran:?}");
    if ran.code == Some(1) {
        let errors: Vec<&str> = ran.err.lines().filter(|line| !line.starts_with("warning: ")).collect();
        assert_eq!(errors.len(), 1, "{what}: {ran:?}");
        assert!(errors[0].starts_with("error: "), "{what}: {ran:?}");
    }
    for line in ran.out.lines() {
        let value: Value = serde_json::from_str(line).unwrap();
        assert!(has_no_hole(&value), "{what}: {line}");
    }
}

/// JSON has no NaN and no infinity: serde writes `null` for them.
fn has_no_hole(value: &Value) -> bool {
    match value {
        Value::Null => false,
        Value::Array(items) => items.iter().all(has_no_hole),
        Value::Object(items) => items.values().all(has_no_hole),
        _ => true,
    }
}

fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value.as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

fn vector(value: &Value) -> DVector<f64> {
    numbers(value).into()
}

fn matrix(value: &Value) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(numbers).collect();
    DMatrix::from_fn(rows.len(), rows.first().map_or(0, Vec::len), |i, j| rows[i][j])
}

fn texts(value: &Value) -> Vec<&str> {
    value.as_array().unwrap().iter().map(|text| text.as_str().unwrap()).collect()
}

#[track_caller]
fn close(what: &str, got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance, "{what}: {got} against {want}");
}

fn robot(inside: &str) -> String {
    format!(r#"<robot name="r">{inside}</robot>"#)
}

/// Link `a` (root, without inertia), link `b`, and a hinge `j` between them.
fn hinged(b: &str) -> String {
    robot(&format!(
        r#"<link name="a"/><link name="b">{b}</link><joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>"#
    ))
}

/// A link with an inertial, and a joint that hangs it on another link 1 m along x.
fn limb(name: &str, parent: &str, kind: &str, more: &str) -> String {
    format!(
        r#"<link name="{name}">{INERTIAL}</link><joint name="{kind}_{name}" type="{kind}">
        <parent link="{parent}"/><child link="{name}"/><origin xyz="1 0 0"/>{more}</joint>"#
    )
}

/// Joint velocities that move the tip of planar2 as wanted, in the plane.
fn rates(desk: &Desk, q: [f64; 2], tip: [f64; 2]) -> [f64; 2] {
    let still = json!({"q": q, "qd": [0, 0]});
    let jacobian = matrix(&desk.answer("dynamics planar2.urdf --json --tip tip --states -", &still)["jacobian"]);
    let jacobian = Matrix2::from_fn(|i, j| jacobian[(i, j)]);
    (jacobian.try_inverse().unwrap() * Vector2::from(tip)).into()
}

// ---------------------------------------------------------------------------------------------------------------------
// Refused robots
// ---------------------------------------------------------------------------------------------------------------------

#[test]
fn a_robot_with_a_fault_is_refused_by_every_command_in_the_same_words() {
    let desk = Desk::new("fault");
    let inertial = |mass: &str, i: &str| {
        let i: Vec<&str> = i.split(' ').collect();
        hinged(&format!(
            r#"<inertial><mass value="{mass}"/><inertia ixx="{}" iyy="{}" izz="{}" ixy="{}" ixz="0" iyz="0"/></inertial>"#,
            i[0], i[1], i[2], i[3]
        ))
    };
    let links = |names: &[&str]| names.iter().map(|name| format!("<link name='{name}'/>")).collect::<String>();
    let weld = |name: &str, parent: &str, child: &str| {
        format!("<joint name='{name}' type='fixed'><parent link='{parent}'/><child link='{child}'/></joint>")
    };
    let cases = [
        (String::new(), "r.urdf:1: XML: not well-formed: the document does not have a root node; correct the file"),
        ("<sdf/>".into(), "r.urdf:1: <sdf>: this is SDF: convert it to URDF first"),
        (
            inertial("NaN", "1 1 1 0"),
            r#"r.urdf:1: link 'b' <mass value>: "NaN" is wrong: 'NaN' is not a finite number up to 1e100"#,
        ),
        (
            inertial("1", "1 inf 1 0"),
            r#"r.urdf:1: link 'b' <inertia iyy>: "inf" is wrong: 'inf' is not a finite number up to 1e100"#,
        ),
        (
            hinged(INERTIAL).replace("</joint>", "<origin xyz='0 1e999 0'/></joint>"),
            r#"r.urdf:1: joint 'j' <origin xyz>: "0 1e999 0" is wrong: '1e999' is not a finite number up to 1e100"#,
        ),
        (
            hinged(INERTIAL).replace("</joint>", "<axis xyz='0 0 0'/></joint>"),
            "r.urdf:1: joint 'j' <axis xyz>: has length 0 and so no direction: a continuous joint needs a unit vector",
        ),
        (inertial("-2", "1 1 1 0"), "r.urdf:1: link 'b' <mass value>: -2 kg is negative: give the mass of the body"),
        (
            inertial("0", "1 1 1 0"),
            "r.urdf:1: link 'b' <mass value>: 0 kg, but <inertia> is not zero: give the mass of the body, or remove <inertial>",
        ),
        (
            inertial("1", "1 1 1 2"),
            "r.urdf:1: link 'b' <inertia>: principal moments -1, 1 and 3 kg m²: none may be negative; check signs and the terms ixy, ixz, iyz",
        ),
        (
            inertial("1", "0.1 0.2 0.4 0"),
            "r.urdf:1: link 'b' <inertia>: principal moments 0.1, 0.2 and 0.4 kg m²: 0.1 + 0.2 = 0.3 is less than 0.4, and no body has a principal moment greater than the sum of the other two; compute the inertia again, about the centre of mass",
        ),
        (
            hinged(""),
            "r.urdf:1: joint 'j': moves link 'b', and neither it nor any link below it has mass: give link 'b' an <inertial>, or make the joint fixed",
        ),
        (
            robot(&(links(&["upper_arm", "hand"]) + &weld("j", "uper_arm", "hand"))),
            "r.urdf:1: joint 'j' <parent link>: no link is named 'uper_arm': did you mean 'upper_arm'?",
        ),
        (
            robot(&(links(&["upper_arm", "hand"]) + &weld("j", "upper_arm", "claw"))),
            "r.urdf:1: joint 'j' <child link>: no link is named 'claw': there are 'upper_arm' and 'hand'",
        ),
        (
            robot(&links(&["a", "a"])),
            "r.urdf:1: link 'a': the name is already taken on line 1: names must differ, rename one",
        ),
        (
            robot(&(links(&["a", "b", "c"]) + &weld("j", "a", "b") + &weld("j", "b", "c"))),
            "r.urdf:1: joint 'j': the name is already taken on line 1: names must differ, rename one",
        ),
        (
            robot(&(links(&["a", "b", "c"]) + &weld("j", "a", "c") + &weld("k", "b", "c"))),
            "r.urdf:1: joint 'k': link 'c' is already the child of joint 'j' (line 1): a link hangs on one joint, and a closed loop can't be written in URDF; remove one of the two",
        ),
        (
            robot(&(links(&["a", "b"]) + &weld("j", "a", "b") + &weld("k", "b", "a"))),
            "r.urdf:1: link 'a': links 'a' and 'b' form a loop, each the child of the next: one of them must hang on the rest of the robot",
        ),
        (
            robot(&(links(&["a", "b", "c"]) + &weld("j", "a", "c"))),
            "r.urdf:1: link 'b': links 'a' and 'b' hang on no joint, and a robot has one root: join them, by fixed joints if nothing moves there",
        ),
        (
            hinged(INERTIAL).replace("continuous", "hinge"),
            r#"r.urdf:1: joint 'j': type "hinge" is not supported: use revolute, continuous, prismatic, fixed, floating or planar"#,
        ),
        (
            hinged(INERTIAL).replace("</joint>", "<mimic joint='j'/></joint>"),
            "r.urdf:1: joint 'j' <mimic joint>: a joint can't follow itself: name another joint, or remove <mimic>",
        ),
        (
            robot("<link name='a'><collision><geometry><mesh filename='meshes/a.stl'/></geometry></collision></link>"),
            "r.urdf:1: link 'a' <collision>: mesh 'meshes/a.stl' is not found; tried './meshes/a.stl'. Correct the path, or go without it: --no-meshes (LoadOptions::meshes)",
        ),
    ];
    for (text, message) in cases {
        desk.write("r.urdf", text);
        for command in [
            "inspect r.urdf",
            "inspect r.urdf --json",
            "dynamics r.urdf --json --tip b --states -",
            "impact r.urdf --json --tip b --normal 0,0,1 --law all --restitution 0.5 --states -",
        ] {
            refused(desk.run(command), message);
        }
    }
}

#[test]
fn a_fault_on_a_link_that_never_moves_is_a_warning_until_it_moves() {
    let desk = Desk::new("still");
    let bad = INERTIAL.replace(r#"<mass value="1"/>"#, r#"<mass value="-1"/>"#);
    desk.write("r.urdf", robot(&format!(r#"<link name="a">{bad}</link>"#)));
    let report = &desk.answers("inspect r.urdf --json", "")[0];
    assert_eq!(
        texts(&report["warnings"]),
        [
            "link 'a' <mass> (line 1): -1 kg is negative: give the mass of the body; not used, since the link never moves"
        ]
    );
    refused(
        desk.run("inspect r.urdf --floating"),
        "r.urdf:1: link 'a' <mass value>: -1 kg is negative: give the mass of the body",
    );
}

#[test]
fn a_massless_moving_link_is_fine_where_what_hangs_below_it_carries_inertia() {
    let desk = Desk::new("massless");
    let two = |offset: &str| {
        robot(&format!(
            r#"<link name="a"/><link name="b"/><link name="c">{INERTIAL}</link>
            <joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
            <joint name="k" type="continuous"><parent link="b"/><child link="c"/><origin xyz="{offset}"/><axis xyz="0 0 1"/></joint>"#
        ))
    };
    let args = "dynamics r.urdf --json --tip c --states -";
    desk.write("r.urdf", two("1 0 0"));
    let answer = desk.answer(args, &json!({"q": [0, 0], "qd": [0, 0]}));
    assert_eq!(answer["mass_matrix"], json!([[2.0, 1.0], [1.0, 1.0]]));
    // Both hinges on one axis: nothing says how the turn is shared.
    desk.write("r.urdf", two("0 0 1"));
    refused(
        desk.feed(args, r#"{"q":[0,0],"qd":[0,0]}"#),
        "<stdin>:1: joint 'j' moves no inertia at this pose, so its acceleration is not determined: give the links below it mass and inertia, or lock it",
    );
}

#[test]
fn missing_meshes_can_be_left_out_with_a_warning() {
    let desk = Desk::new("meshes");
    let collision = "<collision><geometry><mesh filename='package://nowhere/b.stl'/></geometry></collision>";
    desk.write("r.urdf", hinged(&format!("{INERTIAL}{collision}")));
    let warning = "link 'b' <collision> (line 1): mesh 'package://nowhere/b.stl' is not found, left out";
    let report = &desk.answers("inspect r.urdf --no-meshes --json", "")[0];
    assert_eq!(texts(&report["warnings"]), [warning]);
    let people = desk.run("inspect r.urdf --no-meshes");
    done(&people);
    assert!(people.out.ends_with(&format!("warning: {warning}\n")), "{}", people.out);
    desk.answer("dynamics r.urdf --no-meshes --json --tip b --states -", &json!({"q": [0], "qd": [0]}));
}

#[test]
fn unsupported_elements_are_listed_never_dropped_in_silence() {
    let desk = Desk::new("unsupported");
    let more = "<transmission name='t'/><transmission name='u'/><gazebo/><material name='blue'/>";
    let text = hinged(&format!("{INERTIAL}<visual/><self_collision_checking/>"));
    let text = text.replace("</joint>", "<safety_controller/><limit jerk='1'/></joint>");
    desk.write("r.urdf", text.replace("</robot>", &format!("{more}</robot>")));
    let report = &desk.answers("inspect r.urdf --json", "")[0];
    assert_eq!(
        texts(&report["warnings"]),
        [
            "<gazebo> (line 1) is not used",
            "<limit jerk> (line 1) is not used",
            "<material> (line 1) is not used",
            "<safety_controller> (line 1) is not used",
            "<self_collision_checking> (line 1) is not used",
            "<transmission> (2 times, first on line 1) is not used",
            "<visual> (line 1) is not used",
        ]
    );
}

#[test]
fn what_cannot_be_read_is_named() {
    let desk = Desk::new("unreadable");
    std::fs::create_dir(desk.0.join("folder")).unwrap();
    desk.write("bytes", [0xff, 0xfe, 0x00]);
    for (args, start) in [
        ("inspect no.urdf", "error: no.urdf: cannot be read: "),
        ("inspect folder", "error: folder: cannot be read: "),
        ("inspect bytes", "error: bytes: cannot be read: "),
        ("dynamics planar2.urdf --tip tip --states no.jsonl", "error: no.jsonl: cannot be read: "),
        ("dynamics planar2.urdf --tip tip --states folder", "error: folder: cannot be read: "),
        ("dynamics planar2.urdf --tip tip --states bytes", "error: bytes"),
        ("law --law all --restitution 0.5 --problems no.jsonl", "error: no.jsonl: cannot be read: "),
    ] {
        let ran = desk.run(args);
        assert_eq!((ran.code, ran.out.as_str()), (Some(1), ""), "{args}");
        assert!(ran.err.starts_with(start) && ran.err.lines().count() == 1, "{args}: {}", ran.err);
    }
}

// ---------------------------------------------------------------------------------------------------------------------
// Refused states and problems
// ---------------------------------------------------------------------------------------------------------------------

#[test]
fn a_state_with_a_fault_is_refused_with_its_line() {
    let desk = Desk::new("states");
    for (line, reason) in [
        (r#"{"q":[1e999,0],"qd":[0,0]}"#, "number out of range at column 11"),
        (r#"{"q":[NaN,0],"qd":[0,0]}"#, "expected value at column 7"),
        (r#"{"q":[null,0],"qd":[0,0]}"#, "invalid type: null, expected f64 at column 10"),
        (r#"{"q":[0],"qd":[0,0]}"#, "q has 1 numbers, 2 are needed (shoulder, elbow)"),
        (r#"{"q":[0,0,0],"qd":[0,0]}"#, "q has 3 numbers, 2 are needed (shoulder, elbow)"),
        (r#"{"q":[0,0],"qd":[]}"#, "qd has 0 numbers, 2 are needed (shoulder, elbow)"),
        (r#"{"q":[0,0],"qd":[0,0],"tau":[0]}"#, "tau has 1 numbers, 2 are needed (shoulder, elbow)"),
        (r#"{"q":[0,0],"qd":[0,0],"qdd":[0,0,0]}"#, "qdd has 3 numbers, 2 are needed (shoulder, elbow)"),
        (r#"{"q":[0,0]}"#, "missing field `qd` at column 11"),
        (
            r#"{"q":[0,0],"qd":[0,0],"tua":[0,0]}"#,
            "unknown field `tua`, expected one of `q`, `qd`, `tau`, `qdd` at column 27",
        ),
        (r#"{"q":[0,0],"qd":[0,0]}{}"#, "trailing characters at column 23"),
        ("shoulder 0", "expected value at column 1"),
    ] {
        refused(desk.feed("dynamics planar2.urdf --json --tip tip --states -", line), &format!("<stdin>:1: {reason}"));
    }
    // The impact reads the same lines with the same eyes.
    desk.write("s.jsonl", "\n{\"q\":[0,0,0],\"qd\":[0,0]}\n");
    refused(
        desk.run("impact planar2.urdf --tip tip --normal -1,0,0 --law newton --restitution 0.5 --states s.jsonl"),
        "s.jsonl:2: q has 3 numbers, 2 are needed (shoulder, elbow)",
    );
}

#[test]
fn a_problem_with_a_fault_is_refused_with_its_line() {
    let desk = Desk::new("problems");
    for (line, reason) in [
        (r#"{"delassus":[[1,0],[0,1e999]],"u":[0,-1]}"#, "number out of range at column 27"),
        (
            r#"{"delassus":[[1,0],[0,1]],"u":[-1]}"#,
            "u has 1 numbers: 2 in the plane (t, n) or 3 in space (t1, t2, n) are needed",
        ),
        (
            r#"{"delassus":[[1,0],[0]],"u":[0,-1]}"#,
            "delassus has rows of 2, 1 numbers: u has 2, so 2 rows of 2 are needed",
        ),
        (
            r#"{"delassus":[[1,0],[0,1]],"u":[0,0,-1]}"#,
            "delassus has rows of 2, 2 numbers: u has 3, so 3 rows of 3 are needed",
        ),
        (
            r#"{"delassus":[[1,2],[2,1]],"u":[0,-1]}"#,
            "the Delassus matrix is not positive semidefinite: eliminated from the normal upwards, its pivot at [0][0] is -3, below -0.0000000000004547473508864641 (rounding); no mass distribution has it, check the mass matrix and the order of the contact axes",
        ),
        (
            r#"{"delassus":[[1,0],[0,0]],"u":[0,-1]}"#,
            "the contact cannot move along its normal: H_nn = 0 1/kg is nothing beside the trace 1 1/kg of the Delassus matrix, so the impulse would be infinite; the structure takes such a blow: leave the singular pose or model what gives way",
        ),
        (r#"{"delassus":[[1,0],[0,1]],"v":[0,-1]}"#, "unknown field `v`, expected `delassus` or `u` at column 29"),
    ] {
        refused(
            desk.feed("law --json --law all --restitution 0.5 --problems -", line),
            &format!("<stdin>:1: {reason}"),
        );
    }
}

#[test]
fn a_quaternion_that_is_not_unit_is_refused() {
    let desk = Desk::new("quaternion");
    desk.write("r.urdf", robot(&format!(r#"<link name="a">{INERTIAL}</link>"#)));
    let args = "dynamics r.urdf --floating --json --tip a --states -";
    refused(
        desk.feed(args, r#"{"q":[0,0,0,0,0,0,2],"qd":[0,0,0,0,0,0]}"#),
        "<stdin>:1: joint 'root_joint': quaternion (qx qy qz qw) has norm 2, not 1: normalise it",
    );
    refused(
        desk.feed(args, r#"{"q":[0,0,0,0,0,1],"qd":[0,0,0,0,0,0]}"#),
        "<stdin>:1: q has 6 numbers, 7 are needed (root_joint; a floating joint takes x y z qx qy qz qw)",
    );
}

#[test]
fn lines_before_a_fault_are_answered_and_blank_ones_only_counted() {
    let desk = Desk::new("order");
    let good = r#"{"q":[0,0],"qd":[1,0]}"#;
    desk.write("s.jsonl", format!("\n{good}\r\n   \n\n{good}\noops\n{good}\n"));
    let ran = desk.run("dynamics planar2.urdf --json --tip tip --states s.jsonl");
    assert_eq!(ran.code, Some(1));
    assert_eq!(ran.out.lines().count(), 2);
    assert_eq!(ran.err, "error: s.jsonl:6: expected value at column 1\n");
    let empty = desk.feed("dynamics planar2.urdf --json --tip tip --states -", "\n\n");
    done(&empty);
    assert_eq!(empty.out, "");
}

#[test]
fn a_pose_outside_limits_is_a_warning_said_once_for_each_joint() {
    let desk = Desk::new("limits");
    let lines = "{\"q\":[0,0],\"qd\":[0,1]}\n{\"q\":[3.5,-4],\"qd\":[0,1]}\n{\"q\":[3.5,-4],\"qd\":[0,1]}\n";
    for args in [
        "dynamics planar2.urdf --json --tip tip --states -",
        "impact planar2.urdf --json --tip tip --normal 0,-1,0 --law all --restitution 0.5 --states -",
    ] {
        let ran = desk.feed(args, lines);
        assert_eq!((ran.code, ran.out.lines().count()), (Some(0), 3), "{args}");
        assert_eq!(
            ran.err,
            "warning: <stdin>:2: joint 'shoulder' is at 3.5 rad, above its limit 3.1 rad (said once for this joint)\n\
             warning: <stdin>:2: joint 'elbow' is at -4 rad, below its limit -3.1 rad (said once for this joint)\n"
        );
    }
}

#[test]
fn a_state_that_is_refused_warns_of_no_limits() {
    let desk = Desk::new("limits-refused");
    refused(
        desk.feed("dynamics planar2.urdf --json --tip tip --states -", r#"{"q":[9],"qd":[0,0]}"#),
        "<stdin>:1: q has 1 numbers, 2 are needed (shoulder, elbow)",
    );
}

#[test]
fn every_joint_warns_whatever_its_name() {
    let desk = Desk::new("limits-names");
    let limit = r#"<axis xyz="0 0 1"/><limit lower="-1" upper="1"/>"#;
    let text = limb("b", "a", "revolute", limit) + &limb("c", "b", "revolute", limit);
    let text = text.replace("revolute_b", "left's 1").replace("revolute_c", "left's 2");
    desk.write("r.urdf", robot(&(r#"<link name="a"/>"#.to_owned() + &text)));
    let ran = desk.feed("dynamics r.urdf --json --tip c --states -", r#"{"q":[2,2],"qd":[0,0]}"#);
    assert_eq!(
        ran.err,
        "warning: <stdin>:1: joint 'left's 1' is at 2 rad, above its limit 1 rad (said once for this joint)\n\
         warning: <stdin>:1: joint 'left's 2' is at 2 rad, above its limit 1 rad (said once for this joint)\n"
    );
}

// ---------------------------------------------------------------------------------------------------------------------
// Refused options
// ---------------------------------------------------------------------------------------------------------------------

#[test]
fn coefficients_out_of_range_are_refused() {
    let desk = Desk::new("coefficients");
    for (options, message) in [
        ("--restitution -0.1", "--restitution -0.1: a coefficient of restitution lies between 0 and 1"),
        ("--restitution 1.5", "--restitution 1.5: a coefficient of restitution lies between 0 and 1"),
        ("--restitution NaN", "--restitution NaN: a coefficient of restitution lies between 0 and 1"),
        ("--restitution inf", "--restitution inf: a coefficient of restitution lies between 0 and 1"),
        ("--restitution 1 --friction -0.2", "--friction -0.2: a coefficient of friction is finite and not negative"),
        ("--restitution 0 --friction nan", "--friction NaN: a coefficient of friction is finite and not negative"),
        ("--restitution 0 --friction inf", "--friction inf: a coefficient of friction is finite and not negative"),
    ] {
        for law in ["all", "frictionless", "energetic"] {
            let impact = format!("impact planar2.urdf --tip tip --normal -1,0,0 --law {law} {options} --states -");
            refused(desk.run(&impact), message);
            refused(desk.run(&format!("law --law {law} {options} --problems -")), message);
        }
    }
}

#[test]
fn usage_errors_exit_with_2() {
    let desk = Desk::new("usage");
    let impact = "impact planar2.urdf --tip tip --states - --restitution 0.5";
    let laws = "[possible values: frictionless, whittaker, newton, poisson, energetic, chatterjee-ruina, brach, smith";
    for (args, words) in [
        (String::new(), "Usage: carom <COMMAND>"),
        ("strike".into(), "unrecognized subcommand 'strike'"),
        ("inspect".into(), "<ROBOT.urdf>"),
        ("inspect planar2.urdf --jsn".into(), "unexpected argument '--jsn' found"),
        ("dynamics planar2.urdf --states -".into(), "--tip <LINK>"),
        (
            "dynamics planar2.urdf --tip tip --states - --gravity 0,0".into(),
            "invalid value '0,0' for '--gravity <X,Y,Z>': 2 numbers, three are needed: x,y,z",
        ),
        (format!("{impact} --normal -1,0,0 --law hertz"), "invalid value 'hertz' for '--law <LAW>'"),
        (format!("{impact} --normal -1,0,0 --law hertz"), laws),
        (format!("{impact} --law all"), "--normal <X,Y,Z>"),
        (
            format!("{impact} --law all --normal 1,0"),
            "invalid value '1,0' for '--normal <X,Y,Z>': 2 numbers, three are needed: x,y,z",
        ),
        (
            format!("{impact} --law all --normal 1,0,0,0"),
            "invalid value '1,0,0,0' for '--normal <X,Y,Z>': 4 numbers, three are needed: x,y,z",
        ),
        (
            format!("{impact} --law all --normal 1,x,0"),
            "invalid value '1,x,0' for '--normal <X,Y,Z>': invalid float literal: write three numbers, like 0,0,-9.81",
        ),
        ("law --law all --problems - --restitution half".into(), "invalid value 'half' for '--restitution <E>'"),
        ("law --law all --problems -".into(), "--restitution <E>"),
    ] {
        usage(desk.run(&args), words);
    }
}

#[test]
fn tips_and_joints_that_are_not_there_are_refused_with_names_that_are() {
    let desk = Desk::new("names");
    let with = |options: &str| desk.run(&format!("dynamics planar2.urdf --json --states - {options}"));
    refused(
        with("--tip tool"),
        "planar2.urdf: --tip: no link is named 'tool'; there are 'base', 'link1', 'elbow_stator', 'link2' and 'tip'",
    );
    refused(
        with("--tip tpi"),
        "planar2.urdf: --tip: no link is named 'tpi'; there are 'base', 'link1', 'elbow_stator', 'link2' and 'tip'",
    );
    refused(with("--tip Tip"), "planar2.urdf: --tip: no link is named 'Tip'; did you mean 'tip'?");
    for (joints, why) in [
        ("shoulder,elbo", "no joint is named 'elbo'; did you mean 'elbow'?"),
        ("elbow", "joint 'shoulder' is not in the list: name every moving joint"),
        ("elbow,shoulder,elbow", "joint 'elbow' is named twice"),
        ("elbow,probe,shoulder", "joint 'probe' is fixed: leave it out"),
    ] {
        refused(with(&format!("--tip tip --joints {joints}")), &format!("planar2.urdf: --joints: {why}"));
    }
    let follow = r#"<axis xyz="0 0 1"/><mimic joint="continuous_b" multiplier="-2" offset="0.5"/>"#;
    let text = limb("b", "a", "continuous", r#"<axis xyz="0 0 1"/>"#) + &limb("c", "b", "continuous", follow);
    desk.write("r.urdf", robot(&(r#"<link name="a"/>"#.to_owned() + &text)));
    refused(
        desk.run("dynamics r.urdf --tip c --joints continuous_b,continuous_c --states -"),
        "r.urdf: --joints: joint 'continuous_c' mimics 'continuous_b' and has no number of its own: leave it out",
    );
}

#[test]
fn normals_without_an_impulse_of_finite_size_are_refused() {
    let desk = Desk::new("normals");
    let strike = |tip: &str, normal: &str, q: &str| {
        let args = format!(
            "impact planar2.urdf --json --tip {tip} --normal {normal} --law all --restitution 0.5 --friction 0.3 --states -"
        );
        desk.feed(&args, format!(r#"{{"q":{q},"qd":[1,0]}}"#))
    };
    let zero = strike("tip", "0,0,0", "[0,0]");
    assert_eq!((zero.code, zero.out.as_str()), (Some(1), ""));
    let words = "direction [0.0, 0.0, 0.0] has length 0: a direction needs a finite, non-zero length\n";
    assert!(zero.err.starts_with("error: ") && zero.err.ends_with(words), "{}", zero.err);
    // A straight arm hit along its axis; and across its plane.
    for (normal, unit, q) in [("-1,0,0", "[-1.0, 0.0, 0.0]", "[0,0]"), ("0,0,2", "[0.0, 0.0, 1.0]", "[0.3,1]")] {
        refused(
            strike("tip", normal, q),
            &format!(
                "<stdin>:1: at this pose no joint moves 'tip' along the normal {unit} (singular direction): the structure would take the impact, and the impulse of any rigid law would be infinite; change the pose or the normal"
            ),
        );
    }
    refused(
        strike("base", "-1,0,0", "[0,0]"),
        "<stdin>:1: link 'base' is fixed to the world: no impact can move it, choose a link that a joint moves",
    );
}

#[test]
fn a_normal_of_any_finite_length_is_a_direction() {
    let desk = Desk::new("lengths");
    let state = json!({"q": UP_ELBOW, "qd": [0.1, 0.3]});
    let strike = |normal: &str| {
        let args = format!("impact planar2.urdf --json --tip tip --normal {normal} --law newton --restitution 0.5");
        desk.answer(&format!("{args} --states -"), &state)["qd_plus"].clone()
    };
    let unit = strike("-0.6,-0.8,0");
    for normal in ["-3,-4,0", "-3e150,-4e150,0", "-3e307,-4e307,0", "-3e-150,-4e-150,0", "-3e-300,-4e-300,0"] {
        let scaled = strike(normal);
        for (a, b) in numbers(&scaled).iter().zip(numbers(&unit)) {
            close(normal, *a, b, 1e-14);
        }
    }
}

#[test]
fn a_point_of_the_base_feels_nothing_and_is_no_error_for_dynamics() {
    let desk = Desk::new("base");
    let state = json!({"q": UP_ELBOW, "qd": [1, 2]});
    let answer = desk.answer("dynamics planar2.urdf --json --tip base --point 1,2,3 --states -", &state);
    assert_eq!(answer["jacobian"], json!([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]));
    assert_eq!(answer["delassus"], json!([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]));
}

// ---------------------------------------------------------------------------------------------------------------------
// The contract: keys, orders, lines
// ---------------------------------------------------------------------------------------------------------------------

#[test]
fn every_answer_has_the_keys_of_the_contract() {
    let desk = Desk::new("keys");
    let report = &desk.answers("inspect planar2.urdf --json", "")[0];
    assert_eq!(keys(report), ["dof", "joints", "links", "name", "nq", "nv", "planar", "total_mass", "warnings"]);
    for joint in report["joints"].as_array().unwrap() {
        assert_eq!(keys(joint), ["child", "effort", "lower", "mimic", "name", "parent", "type", "upper", "velocity"]);
    }
    assert_eq!(keys(&report["planar"]), ["is", "normal", "reason"]);

    let args = "dynamics planar2.urdf --json --tip tip --states -";
    let always = [
        "bias",
        "delassus",
        "gravity_force",
        "jacobian",
        "joints",
        "kinetic_energy",
        "mass_matrix",
        "potential_energy",
    ];
    for (more, extra) in
        [(json!({}), None), (json!({"tau": [0, 0]}), Some("qdd")), (json!({"qdd": [0, 0]}), Some("tau"))]
    {
        let mut state = json!({"q": [0, 0], "qd": [0, 0]});
        state.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        let mut expected: Vec<&str> = always.into_iter().chain(extra).collect();
        expected.sort_unstable();
        assert_eq!(keys(&desk.answer(args, &state)), expected);
    }

    let state = json!({"q": UP_ELBOW, "qd": [0.1, 0.3]});
    let impact = "impact planar2.urdf --json --tip tip --normal -1,0,0 --restitution 0.5 --friction 0.2 --states -";
    let impact_keys = [
        "energy_after",
        "energy_before",
        "flags",
        "friction_work",
        "impulse",
        "law",
        "mode",
        "normal_work",
        "qd_plus",
        "u_minus",
        "u_plus",
    ];
    let problem = json!({"delassus": [[2, 0.5], [0.5, 1]], "u": [0.3, -1]});
    let law = "law --json --restitution 0.5 --friction 0.2 --problems -";
    let law_keys = ["energy_ratio", "flags", "friction_work", "impulse", "law", "mode", "normal_work", "u_plus"];
    for (args, input, expected) in [(impact, state, &impact_keys[..]), (law, problem, &law_keys[..])] {
        let all = desk.answer(&format!("{args} --law all"), &input);
        assert_eq!(keys(&all), ["outcomes"], "nothing was refused");
        let outcomes = all["outcomes"].as_array().unwrap();
        assert!(outcomes.len() >= 5);
        for outcome in outcomes {
            assert_eq!(keys(outcome), expected);
            // One law alone gives that outcome itself.
            let name = outcome["law"].as_str().unwrap();
            assert_eq!(desk.answer(&format!("{args} --law {name}"), &input), *outcome);
        }
    }
}

#[test]
fn inspect_says_what_the_file_says() {
    let desk = Desk::new("inspect");
    let report = &desk.answers("inspect planar2.urdf --json", "")[0];
    for (key, value) in [
        ("name", json!("planar2")),
        ("dof", json!(2)),
        ("nq", json!(2)),
        ("nv", json!(2)),
        ("links", json!(["base", "link1", "elbow_stator", "link2", "tip"])),
        ("total_mass", json!(19.689)),
        ("planar", json!({"is": true, "normal": [0.0, 0.0, 1.0], "reason": null})),
        ("warnings", json!([])),
    ] {
        assert_eq!(report[key], value, "{key}");
    }
    assert_eq!(
        report["joints"][2],
        json!({
            "name": "elbow", "type": "revolute", "parent": "link1", "child": "link2",
            "lower": -3.1, "upper": 3.1, "velocity": 18.85, "effort": 40.0, "mimic": null
        })
    );
    let arm = &desk.answers("inspect arm7.urdf --json", "")[0];
    assert_eq!(
        arm["planar"],
        json!({
            "is": false, "normal": null,
            "reason": "joint 'shoulder_pitch' leaves the plane: its axis (0.000000, 1.000000, 0.000000) is not parallel to that of 'shoulder_yaw'"
        })
    );
    let floating = &desk.answers("inspect planar2.urdf --floating --json", "")[0];
    assert_eq!((&floating["dof"], &floating["nq"], &floating["nv"]), (&json!(8), &json!(9), &json!(8)));
    assert_eq!(
        floating["joints"][0],
        json!({
            "name": "root_joint", "type": "floating", "parent": "world", "child": "base",
            "lower": null, "upper": null, "velocity": null, "effort": null, "mimic": null
        })
    );
}

#[test]
fn a_robot_without_mass_weighs_nothing() {
    let desk = Desk::new("weightless");
    desk.write("r.urdf", robot("<link name='a'/>"));
    let ran = desk.run("inspect r.urdf --json");
    done(&ran);
    assert!(ran.out.contains(r#""total_mass":0.0"#), "{}", ran.out);
}

#[test]
fn in_space_every_law_answers() {
    let desk = Desk::new("space");
    let state = json!({"q": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7], "qd": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]});
    let args = "impact arm7.urdf --json --tip tip --normal -1,-0.2,-0.4 --restitution 0.35 --states -";
    let laws = ["frictionless", "whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"];
    for friction in ["0", "0.2", "2"] {
        let all = desk.answer(&format!("{args} --friction {friction} --law all"), &state);
        assert_eq!(keys(&all), ["outcomes"], "nothing was refused");
        let outcomes = all["outcomes"].as_array().unwrap();
        assert_eq!(outcomes.iter().map(|hit| hit["law"].as_str().unwrap()).collect::<Vec<_>>(), laws);
        for hit in outcomes {
            // Asked for alone, it is the same answer.
            let law = hit["law"].as_str().unwrap();
            assert_eq!(*hit, desk.answer(&format!("{args} --friction {friction} --law {law}"), &state));
            let (before, after) = (number(&hit["energy_before"]), number(&hit["energy_after"]));
            let gains = hit["flags"].as_array().unwrap().contains(&json!("energy-gain"));
            assert_eq!(gains, after > before * (1.0 + 1e-12), "{hit}");
        }
    }
}

#[test]
fn tangential_restitution_reaches_the_law_that_has_one() {
    let desk = Desk::new("tangential");
    let sphere = json!({"delassus": [[3.5, 0, 0], [0, 3.5, 0], [0, 0, 1]], "u": [0.6, -0.8, -1]});
    let args = "law --json --restitution 0.8 --friction 0.9 --problems - --law";
    for (options, v_t) in [("", 0.0), (" --tangential-restitution 0.5", -0.5), (" --tangential-restitution -1", 1.0)] {
        let ran = desk.feed(&format!("{args} chatterjee-ruina{options}"), sphere.to_string());
        done(&ran);
        let hit: Value = serde_json::from_str(&ran.out).unwrap();
        let u_plus = numbers(&hit["u_plus"]);
        close("u⁺", (u_plus[0] - 0.6 * v_t).abs() + (u_plus[1] + 0.8 * v_t).abs(), 0.0, 1e-15);
        assert_eq!(ran.err, "", "no warning");
    }
    let ran = desk.feed(&format!("{args} newton --tangential-restitution 0.5"), sphere.to_string());
    assert!(ran.err.contains("--tangential-restitution is not used by newton"), "{}", ran.err);
}

#[test]
fn a_law_that_wedges_does_not_silence_the_others() {
    let desk = Desk::new("wedge");
    let problem = json!({"delassus": [[1, 1], [1, 1]], "u": [-1, -1]});
    let args = "law --json --restitution 0.5 --friction 2 --problems - --law";
    let alone = desk.answer(&format!("{args} frictionless"), &problem);
    let all = desk.answer(&format!("{args} all"), &problem);
    assert_eq!(all["outcomes"][0], alone);
}

#[test]
fn joints_permutes_all_that_comes_in_and_all_that_goes_out() {
    let desk = Desk::new("permuted");
    let (file, asked) = (["shoulder", "elbow", "wrist"], ["wrist", "shoulder", "elbow"]);
    let place: Vec<usize> = asked.iter().map(|name| file.iter().position(|own| own == name).unwrap()).collect();
    let permuted = |x: &[f64]| -> Vec<f64> { place.iter().map(|&i| x[i]).collect() };
    let (q, qd, tau, qdd) = ([0.3, -1.1, 0.7], [0.4, 0.9, -0.2], [1.0, -2.0, 0.5], [3.0, 0.1, -4.0]);

    let dynamics = "dynamics planar3.urdf --json --tip tip --gravity 0,-9.81,0 --states -";
    let plain = desk.answer(dynamics, &json!({"q": q, "qd": qd, "tau": tau, "qdd": qdd}));
    let theirs = desk.answer(
        &format!("{dynamics} --joints {}", asked.join(",")),
        &json!({"q": permuted(&q), "qd": permuted(&qd), "tau": permuted(&tau), "qdd": permuted(&qdd)}),
    );
    assert_eq!(plain["joints"], json!(file));
    assert_eq!(theirs["joints"], json!(asked));
    for key in ["bias", "gravity_force", "qdd", "tau"] {
        assert_eq!(numbers(&theirs[key]), permuted(&numbers(&plain[key])), "{key}");
        assert!(numbers(&plain[key]).iter().all(|x| *x != 0.0), "{key} tells nothing");
    }
    let m = matrix(&plain["mass_matrix"]);
    assert_eq!(matrix(&theirs["mass_matrix"]), DMatrix::from_fn(3, 3, |i, j| m[(place[i], place[j])]));
    let jacobian = matrix(&plain["jacobian"]);
    assert_eq!(matrix(&theirs["jacobian"]), DMatrix::from_fn(3, 3, |i, j| jacobian[(i, place[j])]));
    for key in ["delassus", "kinetic_energy", "potential_energy"] {
        assert_eq!(theirs[key], plain[key], "{key}");
    }

    let impact =
        "impact planar3.urdf --json --tip tip --normal 0,-1,0 --law energetic --restitution 0.5 --friction 0.2";
    let plain = desk.answer(&format!("{impact} --states -"), &json!({"q": q, "qd": qd}));
    let theirs = desk.answer(
        &format!("{impact} --states - --joints {}", asked.join(",")),
        &json!({"q": permuted(&q), "qd": permuted(&qd)}),
    );
    assert_eq!(plain["flags"], json!([]));
    assert_eq!(numbers(&theirs["qd_plus"]), permuted(&numbers(&plain["qd_plus"])));
    assert_eq!(theirs["impulse"], plain["impulse"]);
}

/// A floating body with a hinged arm.
fn floater() -> String {
    let arm = limb("b", "a", "continuous", r#"<axis xyz="0 1 0"/>"#);
    robot(&format!(r#"<link name="a">{INERTIAL}</link>{arm}"#))
}

#[test]
fn floating_puts_root_joint_first_or_where_joints_names_it() {
    let desk = Desk::new("floating");
    desk.write("r.urdf", floater());
    let (base_q, base_qd) = ([0.1, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let args = "dynamics r.urdf --floating --json --tip b --states -";
    let qd = [&base_qd[..], &[-2.0]].concat();
    let first = json!({"q": ([&base_q[..], &[0.7]].concat()), "qd": (qd)});
    let last = json!({"q": ([&[0.7], &base_q[..]].concat()), "qd": ([&[-2.0], &base_qd[..]].concat())});
    let plain = desk.answer(args, &first);
    assert_eq!(plain["joints"], json!(["root_joint", "continuous_b"]));
    assert_eq!(numbers(&plain["bias"]).len(), 7);
    assert_eq!(desk.answer(&format!("{args} --joints continuous_b"), &first), plain, "left out is first");
    assert_eq!(desk.answer(&format!("{args} --joints root_joint,continuous_b"), &first), plain);

    let turned = desk.answer(&format!("{args} --joints continuous_b,root_joint"), &last);
    assert_eq!(turned["joints"], json!(["continuous_b", "root_joint"]));
    let place = |i: usize| (i + 6) % 7;
    let (m, n) = (matrix(&plain["mass_matrix"]), matrix(&turned["mass_matrix"]));
    assert_eq!(n, DMatrix::from_fn(7, 7, |i, j| m[(place(i), place(j))]));
    let bias = numbers(&plain["bias"]);
    assert_eq!(numbers(&turned["bias"]), (0..7).map(|i| bias[place(i)]).collect::<Vec<_>>());
    assert_eq!(turned["delassus"], plain["delassus"]);

    // qd of the root: linear, then angular velocity in its own axes. Here turned by 2 atan(0.6/0.8) about y.
    let own = |v: [f64; 3]| {
        let (c, s) = (0.28, 0.96);
        Vector3::new(c * v[0] + s * v[2], v[1], -s * v[0] + c * v[2])
    };
    let root = desk.answer("dynamics r.urdf --floating --json --tip a --states -", &first);
    let u = matrix(&root["jacobian"]) * DVector::from_vec(qd);
    assert!((u - own([1.0, 2.0, 3.0])).norm() < 1e-14);
}

#[test]
fn floating_does_not_confuse_its_joint_with_one_of_the_file() {
    let desk = Desk::new("namesake");
    desk.write("r.urdf", floater().replace("continuous_b", "root_joint"));
    let args = "dynamics r.urdf --floating --json --tip b --states -";
    let state = json!({"q": [0, 0, 0, 0, 0, 0, 1, 0.5], "qd": [0, 0, 0, 0, 0, 0, 1]}).to_string();
    // To refuse the file would do as well; to answer with fewer degrees of freedom than there are would not.
    for joints in ["", " --joints root_joint"] {
        let ran = desk.feed(&format!("{args}{joints}"), &state);
        civil(&ran, joints);
        for line in ran.out.lines() {
            let answer: Value = serde_json::from_str(line).unwrap();
            assert_eq!(matrix(&answer["mass_matrix"]).nrows(), 7, "{args}{joints}");
        }
    }
}

#[test]
fn only_a_floating_base_may_be_left_out_of_joints() {
    let desk = Desk::new("left-out");
    let arm = limb("b", "a", "continuous", "") + &limb("c", "b", "continuous", "");
    desk.write("r.urdf", robot(&format!(r#"<link name="a"/>{}"#, arm.replace("continuous_c", "root_joint"))));
    refused(
        desk.run("dynamics r.urdf --json --tip c --joints continuous_b --states -"),
        "r.urdf: --joints: joint 'root_joint' is not in the list: name every moving joint",
    );
}

#[test]
fn a_pipe_is_answered_line_by_line() {
    let desk = Desk::new("stream");
    for (args, line) in [
        ("dynamics planar2.urdf --json --tip tip --states -", r#"{"q":[0,1],"qd":[1,0]}"#),
        ("dynamics planar2.urdf --tip tip --states -", r#"{"q":[0,1],"qd":[1,0]}"#),
        (
            "impact planar2.urdf --json --tip tip --normal -1,0,0 --law all --restitution 0.5 --states -",
            r#"{"q":[0,1],"qd":[1,0]}"#,
        ),
        ("law --json --law newton --restitution 0.5 --problems -", r#"{"delassus":[[2,0],[0,1]],"u":[0,-1]}"#),
    ] {
        let mut child = desk.command(args).spawn().unwrap();
        let (mut stdin, stdout) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let (answered, answers) = mpsc::channel();
        let reader = std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines() {
                answered.send(line.unwrap()).unwrap();
            }
        });
        for _ in 0..3 {
            writeln!(stdin, "{line}").unwrap();
            stdin.flush().unwrap();
            // The pipe stays open: whoever waited for its end would never answer.
            let first = answers.recv_timeout(Duration::from_secs(60)).expect(args);
            assert!(!first.is_empty(), "{args}");
            if !args.contains("--json") {
                while !answers.recv_timeout(Duration::from_secs(60)).expect(args).is_empty() {}
            }
        }
        drop(stdin);
        assert!(child.wait().unwrap().success(), "{args}");
        reader.join().unwrap();
        assert!(answers.try_recv().is_err(), "{args}: three lines, three answers");
    }
}

#[test]
fn answers_come_in_the_order_of_the_lines() {
    let desk = Desk::new("sequence");
    let lines: Vec<String> = (0..500).map(|i| json!({"q": [0, 0], "qd": [i, 0]}).to_string()).collect();
    desk.write("s.jsonl", lines.join("\n"));
    let answers = desk.answers("dynamics planar2.urdf --json --tip tip --states s.jsonl", "");
    assert_eq!(answers.len(), 500);
    for (i, answer) in answers.iter().enumerate() {
        let energy = 0.5 * 3.957 * (i * i) as f64; // M₁₁ of the straight arm, kg m²
        close("kinetic energy", number(&answer["kinetic_energy"]), energy, 1e-13 * energy);
    }
}

// ---------------------------------------------------------------------------------------------------------------------
// Numbers
// ---------------------------------------------------------------------------------------------------------------------

/// The answers of `dynamics` and `impact` fit each other: M q̈ + bias = τ, H = J M⁻¹ Jᵀ, M Δq̇ = Jᵀ p.
#[test]
fn dynamics_and_impact_agree() {
    let desk = Desk::new("agree");
    let state = json!({
        "q": [0.3, -1.1, 0.7, 0.5, -0.4, 0.9, 0.2], "qd": [0.4, 0.9, -0.2, 1.0, -0.7, 0.3, 2.0],
        "tau": [1, -2, 3, -4, 5, -6, 7], "qdd": [7, 6, 5, -4, -3, -2, -1]
    });
    let all = desk.answer("dynamics arm7.urdf --json --tip tip --point 0.01,0.02,0.03 --states -", &state);
    let [m, jacobian, delassus] = ["mass_matrix", "jacobian", "delassus"].map(|key| matrix(&all[key]));
    let [q, qd, tau, qdd] = ["q", "qd", "tau", "qdd"].map(|key| vector(&state[key]));
    let [bias, answer_qdd, answer_tau] = ["bias", "qdd", "tau"].map(|key| vector(&all[key]));
    let inverse = m.clone().try_inverse().unwrap();
    assert!((&m * answer_qdd + &bias - tau).norm() < 1e-11);
    assert!((&m * qdd + bias - answer_tau).norm() < 1e-11);
    assert!((&jacobian * &inverse * jacobian.transpose() - &delassus).norm() < 1e-12 * delassus.norm());
    let energy = 0.5 * qd.dot(&(&m * &qd));
    close("kinetic energy", number(&all["kinetic_energy"]), energy, 1e-14 * energy);
    assert_eq!(m, m.transpose(), "all of it is filled, and it is symmetric");

    let still = json!({"q": q.as_slice(), "qd": [0, 0, 0, 0, 0, 0, 0]});
    let still = desk.answer("dynamics arm7.urdf --json --tip tip --states -", &still);
    assert_eq!(vector(&still["bias"]), vector(&all["gravity_force"]), "at rest only gravity acts");

    let u = &jacobian * &qd;
    let normal = -&u;
    let args = format!(
        "impact arm7.urdf --json --tip tip --point 0.01,0.02,0.03 --normal {},{},{} --law frictionless --restitution 0.4",
        normal[0], normal[1], normal[2]
    );
    let state = json!({"q": q.as_slice(), "qd": qd.as_slice()});
    let hit = desk.answer(&format!("{args} --states -"), &state);
    let [impulse, qd_plus, u_minus, u_plus] = ["impulse", "qd_plus", "u_minus", "u_plus"].map(|key| vector(&hit[key]));
    assert!((&u_minus - &u).norm() < 1e-14 * u.norm());
    assert!((&jacobian * &qd_plus - &u_plus).norm() < 1e-12 * u.norm());
    assert!((&m * (qd_plus - qd) - jacobian.transpose() * impulse).norm() < 1e-12);
    close("u_n", u_plus.dot(&normal) / normal.dot(&normal), 0.4, 1e-13);
}

#[test]
fn energy_books_balance_for_every_law() {
    let desk = Desk::new("books");
    let states: String = (0..40)
        .map(|i| {
            let x = f64::from(i);
            let q = [0.3 + 0.1 * x, -1.6 + 0.05 * x, 0.9 * x.sin()];
            let qd = [(1.3 * x).cos(), (2.1 * x + 1.0).sin(), 3.0 * (0.7 * x).cos()];
            json!({"q": q, "qd": qd}).to_string() + "\n"
        })
        .collect();
    let mut impacts = 0;
    for options in ["--restitution 0 --friction 0", "--restitution 0.35 --friction 0.3", "--restitution 1 --friction 2"]
    {
        let args = format!("impact planar3.urdf --json --tip tip --normal -0.8,0.6,0 --law all {options} --states -");
        for all in desk.feed(&args, &states).out.lines() {
            let all: Value = serde_json::from_str(all).unwrap();
            for hit in all["outcomes"].as_array().unwrap() {
                let [p, before, after] = ["impulse", "u_minus", "u_plus"].map(|key| vector(&hit[key]));
                let [t_before, t_after, normal, friction] =
                    ["energy_before", "energy_after", "normal_work", "friction_work"].map(|key| number(&hit[key]));
                // A coarse scale would hide a loss, a fine one would count the rounding of M: the energy before.
                close("½ p·(u⁻ + u⁺)", 0.5 * p.dot(&(&before + &after)), t_after - t_before, 1e-12 * t_before);
                close("work", normal + friction, t_after - t_before, 1e-12 * t_before);
                let gains = hit["flags"].as_array().unwrap().contains(&json!("energy-gain"));
                assert_eq!(gains, t_after > t_before * (1.0 + 1e-9), "{hit}");
                impacts += usize::from(p.norm() > 0.0);
            }
        }
    }
    assert!(impacts > 200, "{impacts}");
}

/// The stand-in arm strikes the wall x = 0.6364 at 0.2 m/s and 45°, sliding down it: the tangential speed more than
/// doubles. Closed form of the arm's 2×2 problem, H_tn/H_nn = -0.887129.
#[test]
fn planar2_with_its_elbow_up_slides_faster_after_the_impact() {
    let desk = Desk::new("planar2");
    let speed = 0.2 / 2.0_f64.sqrt();
    let qd = rates(&desk, UP_ELBOW, [speed, -speed]);
    let args = "impact planar2.urdf --json --tip tip --normal -1,0,0 --law frictionless --restitution 0.35 --states -";
    let hit = desk.answer(args, &json!({"q": UP_ELBOW, "qd": qd}));
    let [u_minus, u_plus, p] = ["u_minus", "u_plus", "impulse"].map(|key| vector(&hit[key]));
    close("u⁻ x", u_minus[0], 0.1414213562373095, 1e-15);
    close("u⁻ y", u_minus[1], -0.1414213562373095, 1e-15);
    close("u⁺ x", u_plus[0], -0.35 * 0.1414213562373095, 1e-15);
    close("u⁺ y", u_plus[1], -0.31079, 5e-6);
    assert_eq!((u_plus[2], hit["flags"].clone()), (0.0, json!([])));
    // H_nn = 0.547479 1/kg
    close("p x", p[0], -1.35 * 0.1414213562373095 / 0.547479, 5e-7);
    close("p y", p[1], 0.0, 1e-15);
    let gained = number(&hit["energy_after"]) - number(&hit["energy_before"]);
    close("½ p·(u⁻ + u⁺)", 0.5 * p.dot(&(u_minus + u_plus)), gained, 1e-12 * number(&hit["energy_before"]));
    close("energy lost", -gained, 16.028e-3, 5e-7);
}

#[test]
fn a_tip_that_leaves_the_surface_is_not_struck() {
    let desk = Desk::new("leaving");
    let qd = rates(&desk, UP_ELBOW, [-0.1, 0.2]);
    let args =
        "impact planar2.urdf --json --tip tip --normal -1,0,0 --law all --restitution 0.5 --friction 0.3 --states -";
    let all = desk.answer(args, &json!({"q": UP_ELBOW, "qd": qd}));
    for hit in all["outcomes"].as_array().unwrap() {
        assert_eq!(hit["flags"], json!(["no-approach"]), "{}", hit["law"]);
        assert_eq!((&hit["mode"], &hit["impulse"]), (&json!("open"), &json!([0.0, 0.0, 0.0])));
        assert_eq!((&hit["qd_plus"], &hit["u_plus"]), (&json!(qd), &hit["u_minus"]));
        assert_eq!(hit["energy_after"], hit["energy_before"]);
    }
    let problem = json!({"delassus": [[2, 0.5], [0.5, 1]], "u": [0.3, 0.1]});
    let all = desk.answer("law --json --law all --restitution 0.5 --friction 0.3 --problems -", &problem);
    for hit in all["outcomes"].as_array().unwrap() {
        assert_eq!((&hit["flags"], &hit["impulse"]), (&json!(["no-approach"]), &json!([0.0, 0.0])), "{}", hit["law"]);
    }
}

/// Kane & Levinson 1985: double pendulum, e = μ = 0.5. Whittaker's algebra gains 59 % of the kinetic energy.
#[test]
fn the_pendulum_of_kane_and_levinson() {
    let desk = Desk::new("pendulum");
    let problem = json!({
        "delassus": [[2.440338045696, 1.521308658011], [1.521308658011, 1.009560290504]],
        "u": [-0.267174342835, -0.134202014333]
    });
    let all = desk.answer("law --json --law all --restitution 0.5 --friction 0.5 --problems -", &problem);
    for (law, u_t, u_n, ratio) in [
        ("frictionless", 0.03616963, 0.06710101, 0.711412702),
        ("whittaker", 0.0, 0.06710101, 1.587494687),
        ("newton", 0.034824903986, 0.067101007166, 0.737153339),
        ("poisson", 0.004896652708, 0.042363910848, 0.545077987),
        ("energetic", 0.006306876507, 0.043529526627, 0.553187985),
        ("chatterjee-ruina", 0.044578, 0.067101, 0.562430),
        ("brach", 0.022397582349, 0.067101007167, 1.0), // as much towards rest as energy allows
        ("smith", 0.044315, 0.067101, 0.566774),
    ] {
        let digits = if ["chatterjee-ruina", "smith"].contains(&law) { 5e-7 } else { 5e-9 };
        let hit = all["outcomes"].as_array().unwrap().iter().find(|hit| hit["law"] == json!(law)).unwrap();
        let u_plus = numbers(&hit["u_plus"]);
        close(law, u_plus[0], u_t, digits);
        close(law, u_plus[1], u_n, digits);
        close(law, number(&hit["energy_ratio"]), ratio, digits);
        let gain: &[&str] = if ratio > 1.0 { &["energy-gain"] } else { &[] };
        assert_eq!(texts(&hit["flags"]), gain, "{law}");
    }
}

#[test]
fn the_routh_diagram_is_drawn_for_planar_problems_and_refused_for_others() {
    let desk = Desk::new("routh");
    let planar = json!({"delassus": [[2.44, 1.52], [1.52, 1.01]], "u": [-0.27, -0.13]});
    desk.answer("law --json --law all --restitution 0.5 --friction 0.5 --svg r.svg --problems -", &planar);
    let svg = std::fs::read_to_string(desk.0.join("r.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("permissible") && svg.contains("chatterjee-ruina"));
    let spatial = "{\"delassus\":[[2,0,0],[0,2,0],[0,0,1]],\"u\":[1,0,-1]}";
    let ran = desk.feed("law --law poisson --restitution 0.5 --friction 0.5 --svg s.svg --problems -", spatial);
    assert_eq!(ran.code, Some(1));
    assert_eq!(ran.err.trim_end(), "error: <stdin>:1: --svg draws planar problems: delassus 2×2, u = [t, n]");
    assert!(!desk.0.join("s.svg").exists());
}

// ---------------------------------------------------------------------------------------------------------------------
// For people
// ---------------------------------------------------------------------------------------------------------------------

#[test]
fn people_get_tables() {
    let desk = Desk::new("people");
    let state = json!({"q": UP_ELBOW, "qd": [0.1, 0.3], "tau": [1, 2], "qdd": [3, 4]}).to_string();
    for (args, input, words) in [
        (
            "inspect planar2.urdf",
            "",
            &[
                "planar2: 2 degrees of freedom (nq 2, nv 2), 19.689 kg in 5 links",
                "moves in a plane, normal (0, 0, 1)",
                "elbow         revolute    link1 → link2         -3.1 … 3.1",
            ][..],
        ),
        (
            "inspect arm7.urdf",
            "",
            &["does not move in one plane: joint 'shoulder_pitch' leaves the plane", "wrist_roll"],
        ),
        (
            "dynamics planar2.urdf --tip tip --states -",
            &state,
            &[
                "shoulder         elbow",
                "mass matrix        3.4730000     0.1960000",
                "Jacobian",
                "Delassus",
                "bias",
                "gravity force",
                "qdd",
                "tau",
                "kinetic energy 0.0320650 J",
            ],
        ),
        (
            "impact planar2.urdf --tip tip --normal -1,0,0 --law all --restitution 0.35 --friction 0.2 --states -",
            &state,
            &[
                "u⁻     0.0954594     0.1590990             0 m/s, kinetic energy 0.0320650 J",
                "qd⁺ in the order shoulder, elbow",
                "frictionless     slip",
                "energetic",
                "N s",
                "friction work -0.0039826 J",
            ],
        ),
        (
            "law --law all --restitution 0.5 --friction 0.5 --problems -",
            r#"{"delassus":[[2.440338045696,1.521308658011],[1.521308658011,1.009560290504]],"u":[-0.267174342835,-0.134202014333]}"#,
            &["whittaker        stick", "T⁺/T⁻ 1.5874947  [energy-gain]", "poisson"],
        ),
    ] {
        let ran = desk.feed(args, input);
        done(&ran);
        for word in words {
            assert!(ran.out.contains(word), "{args}: {word:?} not in\n{}", ran.out);
        }
    }
}

#[test]
fn help_and_version_are_there() {
    let desk = Desk::new("help");
    for (args, words) in [
        ("--help", "Usage: carom <COMMAND>"),
        ("help impact", "--normal <X,Y,Z>"),
        ("inspect --help", "<ROBOT.urdf>"),
        ("dynamics --help", "--joints"),
        ("impact --help", "from the environment to the robot"),
        ("law --help", "tangents first, normal last"),
        ("--version", "carom"),
    ] {
        let ran = desk.run(args);
        done(&ran);
        // Where a line breaks is the terminal's affair.
        let flowing = ran.out.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(flowing.contains(words), "{args}");
    }
}

// ---------------------------------------------------------------------------------------------------------------------
// Rough handling
// ---------------------------------------------------------------------------------------------------------------------

#[test]
fn a_reader_that_leaves_early_is_no_error() {
    let desk = Desk::new("head");
    desk.write("s.jsonl", "{\"q\":[0,1],\"qd\":[1,0]}\n".repeat(5000));
    for args in [
        "dynamics planar2.urdf --json --tip tip --states s.jsonl",
        "dynamics planar2.urdf --tip tip --states s.jsonl",
        "impact planar2.urdf --json --tip tip --normal -1,0,0 --law all --restitution 0.5 --states s.jsonl",
    ] {
        let mut child = desk.command(args).spawn().unwrap();
        let mut first = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut first).unwrap();
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        assert_eq!((child.wait().unwrap().code(), said.as_str()), (Some(0), ""), "{args}");
        assert!(!first.is_empty());
    }
}

#[test]
fn nobody_listening_to_warnings_is_no_panic() {
    let desk = Desk::new("deaf");
    let mut child = desk.command("dynamics planar2.urdf --json --tip tip --states -").spawn().unwrap();
    drop(child.stderr.take());
    child.stdin.take().unwrap().write_all(br#"{"q":[9,0],"qd":[1,0]}"#).unwrap();
    let mut answer = String::new();
    child.stdout.take().unwrap().read_to_string(&mut answer).unwrap();
    assert_eq!((child.wait().unwrap().code(), answer.lines().count()), (Some(0), 1));

    let mut child = desk.command("dynamics planar2.urdf --json --tip tip --states -").spawn().unwrap();
    drop(child.stderr.take());
    child.stdin.take().unwrap().write_all(b"oops").unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1));
}

#[test]
fn numbers_of_any_size_give_numbers_or_a_refusal() {
    let desk = Desk::new("sizes");
    let sizes = ["0", "1", "-1e16", "1e150", "-1e150", "1e300", "1e-300", "1.7976931348623157e308", "5e-324"];
    let mut next = 0;
    let mut any = || {
        next = (next * 5 + 3) % 97; // a walk through the residues of a prime
        sizes[next % sizes.len()]
    };
    for _ in 0..60 {
        let state = format!(r#"{{"q":[{},{}],"qd":[{},{}],"tau":[{},{}]}}"#, any(), any(), any(), any(), any(), any());
        let point = format!("{},{},{}", any(), any(), any());
        let args = format!("dynamics planar2.urdf --json --tip tip --point {point} --gravity 0,0,{} --states -", any());
        civil(&desk.feed(&args, &state), &format!("{args} < {state}"));
        let state = format!(r#"{{"q":[{},{}],"qd":[{},{}]}}"#, any(), any(), any(), any());
        let friction = any().trim_start_matches('-');
        let args = format!(
            "impact planar2.urdf --json --tip tip --normal {},{},0 --law all --restitution 0.5 --friction {friction} --states -",
            any(),
            any()
        );
        civil(&desk.feed(&args, &state), &format!("{args} < {state}"));
        let (a, c) = (any().trim_start_matches('-'), any().trim_start_matches('-'));
        let problem = format!(r#"{{"delassus":[[{a},0],[0,{c}]],"u":[{},{}]}}"#, any(), any());
        let args = format!("law --json --law all --restitution 0.5 --friction {friction} --problems -");
        civil(&desk.feed(&args, &problem), &format!("{args} < {problem}"));
    }
}

#[test]
fn overflow_of_one_number_is_no_hole_in_the_json() {
    let desk = Desk::new("holes");
    let strike = "impact planar2.urdf --json --tip tip --normal -1,0,0 --restitution 0.7 --friction 1.7e308 --states -";
    for law in ["whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith", "all"] {
        let ran = desk.feed(&format!("{strike} --law {law}"), r#"{"q":[0.1,-0.2],"qd":[0,-2.8]}"#);
        civil(&ran, law);
    }
    let problem = r#"{"delassus":[[0,0],[0,1e308]],"u":[-1.7e308,-6e139]}"#;
    for law in ["whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith", "all"] {
        let args = format!("law --json --law {law} --restitution 0.1 --friction 0.1 --problems -");
        civil(&desk.feed(&args, problem), law);
    }
}

/// Half the energy is normal to the surface and 1 - e² of that is lost, whatever the scale. A refusal would do as well.
#[test]
fn energy_ratio_does_not_overflow_or_underflow_in_silence() {
    let desk = Desk::new("ratio");
    for problem in [
        r#"{"delassus":[[1,0],[0,1]],"u":[1,-1]}"#,
        r#"{"delassus":[[1e-308,0],[0,1e-308]],"u":[1,-1]}"#,
        r#"{"delassus":[[1,0],[0,1]],"u":[1e-200,-1e-200]}"#,
    ] {
        let ran = desk.feed("law --json --law frictionless --restitution 0.5 --problems -", problem);
        civil(&ran, problem);
        for line in ran.out.lines() {
            let hit: Value = serde_json::from_str(line).unwrap();
            close(problem, number(&hit["energy_ratio"]), 0.625, 1e-15);
        }
    }
}

#[test]
fn a_refusal_is_one_line_whatever_the_file_holds() {
    let desk = Desk::new("one-line");
    for text in [
        "<robot name='r'>\n<link name='a'/\n></robot>".to_owned(),
        robot("<link name='a&#10;b'/><link name='a&#10;b'/>"),
        robot("<link name='a\u{1b}[31m'/>"),
    ] {
        desk.write("r.urdf", &text);
        let ran = desk.run("inspect r.urdf --json");
        assert!(ran.code == Some(0) || (ran.code == Some(1) && ran.err.lines().count() == 1), "{text:?}: {ran:?}");
    }
}

#[test]
fn rubbish_is_refused_without_a_panic() {
    let desk = Desk::new("rubbish");
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut byte = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u8
    };
    let mut rubbish: Vec<Vec<u8>> = (0..20).map(|_| (0..200).map(|_| byte()).collect()).collect();
    rubbish.extend(
        (0..20).map(|_| (0..200).map(|_| b" \n<>/=\"'{}[],:.0123456789eE+-"[usize::from(byte()) % 29]).collect()),
    );
    rubbish.push(b"[".repeat(100_000));
    rubbish.push(br#"{"q":["#.repeat(50_000));
    rubbish.push(b"<robot name='r'>".repeat(50_000));
    for bytes in rubbish {
        desk.write("r.urdf", &bytes);
        let inspected = desk.run("inspect r.urdf");
        assert_eq!((inspected.code, inspected.err.lines().count()), (Some(1), 1), "{}", inspected.err);
        if bytes.iter().all(u8::is_ascii_whitespace) {
            continue;
        }
        for args in [
            "dynamics planar2.urdf --json --tip tip --states r.urdf",
            "law --json --law all --restitution 0.5 --problems r.urdf",
        ] {
            let ran = desk.run(args);
            civil(&ran, args);
            assert_eq!(ran.code, Some(1), "{args}");
        }
    }
    // Depth costs no stack where it is not used.
    let deep = format!("<link name='a'/>{}{}", "<x>".repeat(50_000), "</x>".repeat(50_000));
    desk.write("r.urdf", robot(&deep));
    let report = &desk.answers("inspect r.urdf --json", "")[0];
    assert_eq!(texts(&report["warnings"]), ["<x> (line 1) is not used"]);
}

#[test]
fn names_may_be_anything_xml_can_hold() {
    let desk = Desk::new("unicode");
    let arm = limb("b", "a", "continuous", r#"<axis xyz="0 0 1"/>"#)
        + &limb("c", "b", "continuous", r#"<axis xyz="0 0 1"/>"#);
    let (elbow, hand) = ("coude d'été \u{1f9be}", "Fußgelenk &\"<");
    let text = arm.replace("continuous_b", elbow).replace(r#""c""#, r#""Fußgelenk &amp;&quot;&lt;""#);
    desk.write("r.urdf", robot(&(r#"<link name="a"/>"#.to_owned() + &text)));
    let report = &desk.answers("inspect r.urdf --json", "")[0];
    assert_eq!((&report["joints"][0]["name"], &report["links"][2]), (&json!(elbow), &json!(hand)));
    let joints = format!("continuous_c,{elbow}");
    let args = ["dynamics", "r.urdf", "--json", "--tip", hand, "--joints", &joints, "--states", "-"];
    let ran = finish(desk.command_of(&args).spawn().unwrap(), br#"{"q":[0,0],"qd":[1,2]}"#);
    done(&ran);
    let answer: Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!(answer["joints"], json!(["continuous_c", elbow]));
}

#[test]
fn followers_planar_and_floating_joints_stand_anywhere_in_a_chain() {
    let desk = Desk::new("kinds");
    let text = [
        r#"<link name="a"/>"#.to_owned(),
        limb("b", "a", "continuous", r#"<axis xyz="0 0 1"/>"#),
        limb("c", "b", "planar", r#"<axis xyz="0 1 0"/>"#),
        limb("d", "c", "floating", ""),
        limb("e", "d", "prismatic", r#"<mimic joint="continuous_b" multiplier="-2" offset="0.1"/>"#),
    ];
    desk.write("r.urdf", robot(&text.concat()));
    let report = &desk.answers("inspect r.urdf --json", "")[0];
    assert_eq!((&report["nq"], &report["nv"]), (&json!(11), &json!(10)));
    assert_eq!(report["joints"][3]["mimic"], json!({"joint": "continuous_b", "multiplier": -2.0, "offset": 0.1}));

    let q = json!([0.4, 0.1, 0.2, 0.3, 0.5, 0.6, 0.7, 0, 0, 0.6, 0.8]);
    let qd = json!([1, 2, 3, 4, 5, 6, 7, 8, 9, 10]);
    let state = json!({"q": q, "qd": qd, "tau": qd, "qdd": qd});
    let answer = desk.answer("dynamics r.urdf --json --tip e --states -", &state);
    assert_eq!(answer["joints"], json!(["continuous_b", "planar_c", "floating_d"]));
    let [m, bias] = [matrix(&answer["mass_matrix"]), DMatrix::from_columns(&[vector(&answer["bias"])])];
    let scale = 1e-12 * bias.norm();
    assert!((&m * vector(&qd) + &bias - vector(&answer["tau"])).norm() < scale);
    assert!((&m * vector(&answer["qdd"]) + &bias - vector(&qd)).norm() < scale);

    let moved = json!({"q": [0, 0, 0, 1, 0.5, 0.6, 0.7, 0.1, 0.2, 0.3, 0.4], "qd": [9, 8, 7, 6, 5, 4, 3, 2, 1, 0]});
    civil(
        &desk.feed(
            "dynamics r.urdf --json --tip e --joints floating_d,planar_c,continuous_b --states -",
            moved.to_string(),
        ),
        "moved",
    );
}

#[test]
fn two_thousand_links_are_one_chain() {
    let desk = Desk::new("long");
    let n = 2000;
    let axis = |i: usize| if i.is_multiple_of(2) { r#"<axis xyz="0 0 1"/>"# } else { r#"<axis xyz="0 1 0"/>"# };
    let limbs: String =
        (1..=n).map(|i| limb(&format!("l{i}"), &format!("l{}", i - 1), "continuous", axis(i))).collect();
    desk.write("r.urdf", robot(&format!(r#"<link name="l0"/>{limbs}"#)));
    assert_eq!(desk.answers("inspect r.urdf --json", "")[0]["dof"], json!(n));
    let q: Vec<f64> = (0..n).map(|i| 0.1 * (i as f64).sin()).collect();
    let qd: Vec<f64> = (0..n).map(|i| 0.1 * (i as f64).cos()).collect();
    let args = "impact r.urdf --json --tip l2000 --normal 0.2,1,0.3 --law frictionless --restitution 0.5 --states -";
    let state = json!({"q": q, "qd": qd});
    let ran = desk.feed(args, state.to_string());
    civil(&ran, args);
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""));
}
