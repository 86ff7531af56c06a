//! Every message of the URDF reader, quoted whole next to a file that provokes it, and what a good file reads as.

use carom_chain::ChainError;
use carom_chain::urdf::{self, JointType, LoadOptions, Meshes, Robot, Shape};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};

const INERTIAL: &str =
    r#"<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"#;

/// A robot on one line, so that everything is on line 1.
fn robot(inside: &str) -> String {
    format!(r#"<robot name="r">{inside}</robot>"#)
}

/// Links `a` (root, without inertia) and `b`, and what joins them.
fn joined(joint: &str) -> String {
    robot(&format!(r#"<link name="a"/><link name="b">{INERTIAL}</link>{joint}"#))
}

/// Joint `j` of type `kind` from `a` to `b`, with more elements in it.
fn joint(kind: &str, inside: &str) -> String {
    joined(&format!(r#"<joint name="j" type="{kind}"><parent link="a"/><child link="b"/>{inside}</joint>"#))
}

/// Joints `j0`, `j1`, ... with children `b0`, `b1`, ...: type and what is in it.
fn star(joints: &[(&str, &str)]) -> String {
    let mut inside = String::from(r#"<link name="a"/>"#);
    for (i, (kind, more)) in joints.iter().enumerate() {
        inside += &format!(
            r#"<link name="b{i}">{INERTIAL}</link>
            <joint name="j{i}" type="{kind}"><parent link="a"/><child link="b{i}"/>{more}</joint>"#
        );
    }
    robot(&inside)
}

/// Link `b` moves and holds this `<inertial>`.
fn moving(mass: &str, inertia: &str) -> String {
    on_b(&inertial(mass, inertia), "continuous")
}

fn on_b(inside: &str, kind: &str) -> String {
    robot(&format!(
        r#"<link name="a"/><link name="b">{inside}</link><joint name="j" type="{kind}"><parent link="a"/><child link="b"/></joint>"#
    ))
}

fn inertial(mass: &str, inertia: &str) -> String {
    let i: Vec<&str> = inertia.split(' ').collect();
    format!(
        r#"<inertial><mass value="{mass}"/><inertia ixx="{}" iyy="{}" izz="{}" ixy="{}" ixz="0" iyz="0"/></inertial>"#,
        i[0], i[1], i[2], i[3]
    )
}

/// A link with a collision.
fn shape(shape: &str) -> String {
    robot(&format!(r#"<link name="a"><collision><geometry>{shape}</geometry></collision></link>"#))
}

fn read(text: &str) -> Result<Robot, ChainError> {
    urdf::read_str(text, None, &LoadOptions::default())
}

#[track_caller]
fn refused(cases: &[(String, &str)]) {
    for (text, message) in cases {
        match read(text) {
            Err(error) => assert_eq!(error.to_string(), *message, "\n{text:.2000}"),
            Ok(_) => panic!("accepted, expected: {message}\n{text:.2000}"),
        }
    }
}

#[track_caller]
fn warned(cases: &[(String, &[&str])]) {
    for (text, warnings) in cases {
        assert_eq!(read(text).unwrap().warnings, *warnings, "\n{text}");
    }
}

#[test]
fn what_is_no_urdf() {
    refused(&[
        ("<robot".into(), "<string>:1: XML: not well-formed: the document does not have a root node; correct the file"),
        ("".into(), "<string>:1: XML: not well-formed: the document does not have a root node; correct the file"),
        (
            "<robot name='r'>\n<link name='a'>\n</robot>".into(),
            "<string>:3: XML: not well-formed: expected 'link' tag, not 'robot' at 3:1; correct the file",
        ),
        ("<sdf/>".into(), "<string>:1: <sdf>: this is SDF: convert it to URDF first"),
        ("<mujoco/>".into(), "<string>:1: <mujoco>: this is MJCF, the format of MuJoCo: convert it to URDF first"),
        ("<html/>".into(), "<string>:1: <html>: a URDF has <robot> as its outermost element"),
        (
            r#"<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:macro name="m"/></robot>"#.into(),
            "<string>:1: robot 'r' <macro>: this is xacro, not yet URDF: expand it with xacro first",
        ),
        (
            r#"<robot name="r"><xacro:macro name="m"/></robot>"#.into(),
            "<string>:1: XML: not well-formed: an unknown namespace prefix 'xacro' at 1:18; expand it with xacro first",
        ),
        (
            robot(r#"<link name="${side}_arm"/>"#),
            "<string>:1: link '${side}_arm': this is xacro, not yet URDF: expand it with xacro first",
        ),
        (robot(""), r#"<string>:1: robot 'r': has no link: a robot needs at least one <link name="...">"#),
    ]);
}

#[test]
fn names_and_structure() {
    refused(&[
        (robot("<link/>"), "<string>:1: <link>: the attribute name is missing: add it"),
        (robot(r#"<link name=""/>"#), r#"<string>:1: <link name>: "" is empty: a name is needed"#),
        (
            robot("<link name='a'/>\n<link name='a'/>"),
            "<string>:2: link 'a': the name is already taken on line 1: names must differ, rename one",
        ),
        (
            joined("<joint type='fixed'><parent link='a'/><child link='b'/></joint>"),
            "<string>:1: <joint>: the attribute name is missing: add it",
        ),
        (
            joined("<joint name='j'><parent link='a'/><child link='b'/></joint>"),
            "<string>:1: joint 'j': the attribute type is missing: add it",
        ),
        (
            joined("<joint name='j' type='fixed'><child link='b'/></joint>"),
            "<string>:1: joint 'j': <parent> is missing: add it",
        ),
        (
            joined("<joint name='j' type='fixed'><parent link='a'/></joint>"),
            "<string>:1: joint 'j': <child> is missing: add it",
        ),
        (
            joined("<joint name='j' type='fixed'><parent/><child link='b'/></joint>"),
            "<string>:1: joint 'j' <parent>: the attribute link is missing: add it",
        ),
        (
            joint("fixed", "<child link='b'/>"),
            "<string>:1: joint 'j': has 2 <child>, one is allowed: remove the others",
        ),
        (
            joint("hinge", ""),
            r#"<string>:1: joint 'j': type "hinge" is not supported: use revolute, continuous, prismatic, fixed, floating or planar"#,
        ),
        (
            joint("spherical", ""),
            r#"<string>:1: joint 'j': type "spherical" is not supported: use revolute, continuous, prismatic, fixed, floating or planar"#,
        ),
        (
            robot("<link name='a'><inertial><mass value='1'/></inertial></link>"),
            "<string>:1: link 'a' <inertial>: <inertia> is missing: add it",
        ),
        (robot("<link name='a'><inertial/></link>"), "<string>:1: link 'a' <inertial>: <mass> is missing: add it"),
        (
            robot("<link name='a'><collision/></link>"),
            "<string>:1: link 'a' <collision>: <geometry> is missing: add it",
        ),
    ]);
}

#[test]
fn one_tree() {
    let join = |name, parent, child| {
        format!("<joint name='{name}' type='fixed'><parent link='{parent}'/><child link='{child}'/></joint>\n")
    };
    let links = |names: &[&str]| names.iter().map(|name| format!("<link name='{name}'/>\n")).collect::<String>();
    refused(&[
        (
            robot(&(links(&["upper_arm", "hand"]) + &join("j", "uper_arm", "hand"))),
            "<string>:3: joint 'j' <parent link>: no link is named 'uper_arm': did you mean 'upper_arm'?",
        ),
        (
            robot(&(links(&["upper_arm", "hand"]) + &join("j", "upper_arm", "claw"))),
            "<string>:3: joint 'j' <child link>: no link is named 'claw': there are 'upper_arm' and 'hand'",
        ),
        (
            robot(&(links(&["a", "b", "c"]) + &join("j", "a", "b") + &join("j", "b", "c"))),
            "<string>:5: joint 'j': the name is already taken on line 4: names must differ, rename one",
        ),
        (
            robot(&(links(&["a", "b"]) + &join("j", "b", "b"))),
            "<string>:3: joint 'j': joins link 'b' to itself: parent and child must differ",
        ),
        (
            robot(&(links(&["a", "b", "c"]) + &join("j", "a", "c") + &join("k", "b", "c"))),
            "<string>:5: joint 'k': link 'c' is already the child of joint 'j' (line 4): a link hangs on one joint, and a closed loop can't be written in URDF; remove one of the two",
        ),
        (
            robot(&(links(&["a", "b", "c", "d"]) + &join("j", "a", "c"))),
            "<string>:2: link 'b': links 'a', 'b' and 'd' hang on no joint, and a robot has one root: join them, by fixed joints if nothing moves there",
        ),
        (
            robot(&links(&["a", "b", "c", "d", "e", "f", "g"])),
            "<string>:2: link 'b': links 'a', 'b', 'c', 'd', 'e' and 2 more hang on no joint, and a robot has one root: join them, by fixed joints if nothing moves there",
        ),
        (
            robot(&(links(&["a", "b"]) + &join("j", "a", "b") + &join("k", "b", "a"))),
            "<string>:1: link 'a': links 'a' and 'b' form a loop, each the child of the next: one of them must hang on the rest of the robot",
        ),
        (
            robot(
                &(links(&["root", "x", "a", "b", "c"])
                    + &join("i", "c", "x")
                    + &join("j", "c", "a")
                    + &join("k", "a", "b")
                    + &join("l", "b", "c")),
            ),
            "<string>:3: link 'a': links 'a', 'b' and 'c' form a loop, each the child of the next: one of them must hang on the rest of the robot",
        ),
    ]);
}

#[test]
fn numbers() {
    let origin = |text: &str| joint("fixed", &format!("<origin {text}/>"));
    refused(&[
        (origin("xyz='0 0'"), r#"<string>:1: joint 'j' <origin xyz>: "0 0" holds 2 numbers, 3 are needed"#),
        (origin("xyz=''"), r#"<string>:1: joint 'j' <origin xyz>: "" holds 0 numbers, 3 are needed"#),
        (
            origin("xyz='0 0 1,5'"),
            r#"<string>:1: joint 'j' <origin xyz>: "0 0 1,5" is wrong: '1,5' is not a number; write numbers with a decimal point, separated by spaces"#,
        ),
        (
            origin("rpy='0 nan 0'"),
            r#"<string>:1: joint 'j' <origin rpy>: "0 nan 0" is wrong: 'nan' is not a finite number up to 1e100"#,
        ),
        (
            origin("rpy='0 0 1e300'"),
            r#"<string>:1: joint 'j' <origin rpy>: "0 0 1e300" is wrong: '1e300' is not a finite number up to 1e100"#,
        ),
        (
            origin("quat_xyzw='0 0 0 1'"),
            "<string>:1: joint 'j' <origin quat_xyzw>: quaternions are not read: give the rotation as rpy",
        ),
        (
            joint("revolute", "<axis xyz='0 0 1 0'/>"),
            r#"<string>:1: joint 'j' <axis xyz>: "0 0 1 0" holds 4 numbers, 3 are needed"#,
        ),
        (joint("revolute", "<axis/>"), "<string>:1: joint 'j' <axis>: the attribute xyz is missing: add it"),
        (
            moving("heavy", "1 1 1 0"),
            r#"<string>:1: link 'b' <mass value>: "heavy" is wrong: 'heavy' is not a number; write numbers with a decimal point, separated by spaces"#,
        ),
        (
            moving("inf", "1 1 1 0"),
            r#"<string>:1: link 'b' <mass value>: "inf" is wrong: 'inf' is not a finite number up to 1e100"#,
        ),
        (
            moving("1", "1 x 1 0"),
            r#"<string>:1: link 'b' <inertia iyy>: "x" is wrong: 'x' is not a number; write numbers with a decimal point, separated by spaces"#,
        ),
        (
            moving("1", "1 1 1 NaN"),
            r#"<string>:1: link 'b' <inertia ixy>: "NaN" is wrong: 'NaN' is not a finite number up to 1e100"#,
        ),
        (
            joint("revolute", "<limit lower='-pi'/>"),
            r#"<string>:1: joint 'j' <limit lower>: "-pi" is wrong: '-pi' is not a number; write numbers with a decimal point, separated by spaces"#,
        ),
        (
            joint("revolute", "<limit upper='inf'/>"),
            r#"<string>:1: joint 'j' <limit upper>: "inf" is wrong: 'inf' is not a finite number up to 1e100; where there is no limit, leave the attribute out"#,
        ),
        (
            joint("revolute", "<limit effort='-1'/>"),
            r#"<string>:1: joint 'j' <limit effort>: "-1" is wrong: -1 must not be negative"#,
        ),
        (
            joint("revolute", "<limit velocity='-0.5'/>"),
            r#"<string>:1: joint 'j' <limit velocity>: "-0.5" is wrong: -0.5 must not be negative"#,
        ),
        (
            joint("revolute", "<dynamics damping='-0.1'/>"),
            r#"<string>:1: joint 'j' <dynamics damping>: "-0.1" is wrong: -0.1 must not be negative"#,
        ),
        (
            joint("revolute", "<dynamics friction='-2'/>"),
            r#"<string>:1: joint 'j' <dynamics friction>: "-2" is wrong: -2 must not be negative"#,
        ),
        (
            joint("revolute", "<mimic joint='k' multiplier='two'/>"),
            r#"<string>:1: joint 'j' <mimic multiplier>: "two" is wrong: 'two' is not a number; write numbers with a decimal point, separated by spaces"#,
        ),
        (
            joint("revolute", "<mimic joint='k' offset='1 2'/>"),
            r#"<string>:1: joint 'j' <mimic offset>: "1 2" holds 2 numbers, 1 is needed"#,
        ),
        (
            shape("<box size='1 0 1'/>"),
            r#"<string>:1: link 'a' <box size>: "1 0 1" is wrong: 0 must be greater than zero"#,
        ),
        (shape("<box/>"), "<string>:1: link 'a' <box>: the attribute size is missing: add it"),
        (
            shape("<sphere radius='-1'/>"),
            r#"<string>:1: link 'a' <sphere radius>: "-1" is wrong: -1 must be greater than zero"#,
        ),
        (
            shape("<cylinder radius='1' length='0'/>"),
            r#"<string>:1: link 'a' <cylinder length>: "0" is wrong: 0 must be greater than zero"#,
        ),
        (
            shape("<capsule radius='0' length='1'/>"),
            r#"<string>:1: link 'a' <capsule radius>: "0" is wrong: 0 must be greater than zero"#,
        ),
        (
            shape("<mesh filename='m.stl' scale='1 1 0'/>"),
            r#"<string>:1: link 'a' <mesh scale>: "1 1 0" is wrong: 0 must not be zero"#,
        ),
        (
            shape(""),
            "<string>:1: link 'a' <geometry>: holds 0 shapes: it needs exactly one <box>, <sphere>, <cylinder>, <capsule>, <mesh>",
        ),
        (
            shape("<sphere radius='1'/><sphere radius='1'/>"),
            "<string>:1: link 'a' <geometry>: holds 2 shapes: it needs exactly one <box>, <sphere>, <cylinder>, <capsule>, <mesh>",
        ),
    ]);
}

#[test]
fn axes_and_limits() {
    refused(&[
        (
            joint("continuous", "<axis xyz='0 0 0'/>"),
            "<string>:1: joint 'j' <axis xyz>: has length 0 and so no direction: a continuous joint needs a unit vector",
        ),
        (
            joint("planar", "<axis xyz='0 0 0'/>"),
            "<string>:1: joint 'j' <axis xyz>: has length 0 and so no direction: a planar joint needs a unit vector",
        ),
        (
            joint("prismatic", "<limit lower='2' upper='-2'/>"),
            "<string>:1: joint 'j' <limit>: lower 2 is greater than upper -2: exchange or correct them",
        ),
        (
            joint("prismatic", "<limit upper='-2'/>"),
            "<string>:1: joint 'j' <limit>: lower 0 is greater than upper -2: exchange or correct them",
        ),
    ]);
    warned(&[
        (joint("continuous", "<axis xyz='0 3 4'/>"), &["joint 'j' <axis> (line 1): has length 5, scaled to 1"]),
        (joint("continuous", "<axis xyz='0 0.6000001 0.8'/>"), &[]),
        (
            joint("revolute", ""),
            &["joint 'j' (line 1): a revolute joint should have a <limit>, read as without limits"],
        ),
        (
            joint("revolute", "<limit effort='1' velocity='1'/>"),
            &["joint 'j' <limit> (line 1): lower and upper are missing, read as without position limits"],
        ),
        (
            joint("prismatic", "<limit upper='2'/>"),
            &["joint 'j' <limit> (line 1): lower is missing, read as 0 by the rule of URDF"],
        ),
        (
            joint("prismatic", "<limit lower='-2'/>"),
            &["joint 'j' <limit> (line 1): upper is missing, read as 0 by the rule of URDF"],
        ),
        (
            joint("continuous", "<limit lower='1' upper='-1' velocity='3'/>"),
            &["position <limit> of a continuous joint (line 1) is not used"],
        ),
        (
            joint("fixed", "<axis xyz='0 0 0'/><limit lower='1' upper='-1'/><dynamics damping='1'/>"),
            &[
                "<axis> of a fixed joint (line 1) is not used",
                "<dynamics> of a fixed joint (line 1) is not used",
                "<limit> of a fixed joint (line 1) is not used",
            ],
        ),
        (
            star(&[("fixed", "<axis xyz='1 0 0'/>"), ("fixed", "<axis xyz='1 0 0'/>")]),
            &["<axis> of a fixed joint (2 times, first on line 2) is not used"],
        ),
    ]);
}

#[test]
fn limits_read_as_written() {
    let limits = |kind, inside| {
        let limits = read(&joint(kind, inside)).unwrap().joints[0].limits;
        [limits.lower, limits.upper, limits.velocity, limits.effort]
    };
    let all = "<limit lower='-1' upper=' 2 ' velocity='3' effort='4'/>";
    assert_eq!(limits("revolute", all), [Some(-1.0), Some(2.0), Some(3.0), Some(4.0)]);
    assert_eq!(limits("continuous", all), [None, None, Some(3.0), Some(4.0)]);
    assert_eq!(limits("fixed", all), [None; 4]);
    assert_eq!(limits("floating", all), [None; 4]);
    assert_eq!(limits("revolute", ""), [None; 4]);
    assert_eq!(limits("revolute", "<limit lower='-1' upper='2'/>"), [Some(-1.0), Some(2.0), None, None]);
    assert_eq!(limits("revolute", "<limit upper='2'/>"), [Some(0.0), Some(2.0), None, None]);
    // since version 1.2 what is missing is no limit
    let open = joint("revolute", "<limit upper='-2'/>").replace("<robot", "<robot version='1.2'");
    assert_eq!(read(&open).unwrap().joints[0].limits.lower, None);
}

#[test]
fn inertias() {
    refused(&[
        (moving("-1", "1 1 1 0"), "<string>:1: link 'b' <mass value>: -1 kg is negative: give the mass of the body"),
        (
            moving("0", "1 1 1 0"),
            "<string>:1: link 'b' <mass value>: 0 kg, but <inertia> is not zero: give the mass of the body, or remove <inertial>",
        ),
        (
            moving("1", "1 1 1 2"),
            "<string>:1: link 'b' <inertia>: principal moments -1, 1 and 3 kg m²: none may be negative; check signs and the terms ixy, ixz, iyz",
        ),
        (
            moving("1", "-1 -1 -1 0"),
            "<string>:1: link 'b' <inertia>: principal moments -1, -1 and -1 kg m²: none may be negative; check signs and the terms ixy, ixz, iyz",
        ),
        (
            moving("1", "0.1 0.2 0.4 0"),
            "<string>:1: link 'b' <inertia>: principal moments 0.1, 0.2 and 0.4 kg m²: 0.1 + 0.2 = 0.3 is less than 0.4, and no body has a principal moment greater than the sum of the other two; compute the inertia again, about the centre of mass",
        ),
    ]);
    warned(&[
        (moving("1", "0.1 0.2 0.3 0"), &[]),
        (
            moving("1", "0.1 0.2 0.30001 0"),
            &[
                "link 'b' <inertial> (line 1): principal moments 0.1, 0.2 and 0.30001 kg m²: the greatest exceeds the sum of the other two by 3.3e-5 of itself; rounded?",
            ],
        ),
        (
            on_b(&inertial("0", "0 0 0 0"), "fixed"),
            &["link 'b' <inertial> (line 1): mass and inertia are zero, read as if there were no <inertial>"],
        ),
        (
            on_b(&inertial("-1", "1 1 1 0"), "fixed"),
            &[
                "link 'b' <mass> (line 1): -1 kg is negative: give the mass of the body; not used, since the link never moves",
            ],
        ),
        (
            on_b(&inertial("1", "1 2 4 0"), "fixed"),
            &[
                "link 'b' <inertia> (line 1): principal moments 1, 2 and 4 kg m²: 1 + 2 = 3 is less than 4, and no body has a principal moment greater than the sum of the other two; compute the inertia again, about the centre of mass; not used, since the link never moves",
            ],
        ),
    ]);
    let robot = read(&on_b(&inertial("-1", "1 1 1 0"), "fixed")).unwrap();
    assert_eq!(robot.links[1].inertial, None);
    let floating = LoadOptions { floating_base: true, ..Default::default() };
    let error = urdf::read_str(&on_b(&inertial("-1", "1 1 1 0"), "fixed"), None, &floating).unwrap_err();
    assert_eq!(error.to_string(), "<string>:1: link 'b' <mass value>: -1 kg is negative: give the mass of the body");
}

#[test]
fn what_moves_has_mass() {
    let chain = |kind: &str, tip: &str| {
        robot(&format!(
            "<link name='a'/><link name='b'/><link name='c'>{tip}</link>
            <joint name='j' type='{kind}'><parent link='a'/><child link='b'/></joint>
            <joint name='k' type='fixed'><parent link='b'/><child link='c'/></joint>"
        ))
    };
    for kind in ["continuous", "planar", "floating"] {
        assert!(read(&chain(kind, INERTIAL)).is_ok(), "mass further out counts");
    }
    assert!(read(&chain("fixed", "")).is_ok());
    refused(&[
        (
            chain("continuous", ""),
            "<string>:2: joint 'j': moves link 'b', and neither it nor any link below it has mass: give link 'b' an <inertial>, or make the joint fixed",
        ),
        (
            chain("floating", ""),
            "<string>:2: joint 'j': moves link 'b', and neither it nor any link below it has mass: give link 'b' an <inertial>, or make the joint fixed",
        ),
        (
            chain("planar", &inertial("0", "0 0 0 0")),
            "<string>:2: joint 'j': moves link 'b', and neither it nor any link below it has mass: give link 'b' an <inertial>, or make the joint fixed",
        ),
    ]);
    let floating = LoadOptions { floating_base: true, ..Default::default() };
    let error = urdf::read_str(&chain("fixed", ""), None, &floating).unwrap_err();
    assert_eq!(
        error.to_string(),
        "<string>:1: robot 'r': no link has mass, and a floating base must move some: give link 'a' an <inertial>"
    );
    assert!(urdf::read_str(&chain("fixed", INERTIAL), None, &floating).is_ok());
}

#[test]
fn followers() {
    let follow = |joint: &str| format!("<mimic joint='{joint}'/>");
    refused(&[
        (
            star(&[("continuous", ""), ("continuous", &follow("j00"))]),
            "<string>:3: joint 'j1' <mimic joint>: no joint is named 'j00': did you mean 'j0'?",
        ),
        (
            star(&[("continuous", ""), ("continuous", &follow("elbow"))]),
            "<string>:3: joint 'j1' <mimic joint>: no joint is named 'elbow': there are 'j0' and 'j1'",
        ),
        (
            star(&[("continuous", &follow("j0"))]),
            "<string>:2: joint 'j0' <mimic joint>: a joint can't follow itself: name another joint, or remove <mimic>",
        ),
        (
            star(&[("continuous", &follow("j1")), ("continuous", &follow("j2")), ("continuous", &follow("j1"))]),
            "<string>:3: joint 'j1' <mimic joint>: joints 'j1' and 'j2' follow each other in a ring: one of them must lead",
        ),
        (
            star(&[("fixed", ""), ("continuous", &follow("j0"))]),
            "<string>:3: joint 'j1' <mimic joint>: joint 'j0' is fixed and can't lead: only revolute, continuous and prismatic joints can",
        ),
        (
            star(&[("continuous", ""), ("planar", &follow("j0"))]),
            "<string>:3: joint 'j1' <mimic joint>: joint 'j1' is planar and can't follow: only revolute, continuous and prismatic joints can",
        ),
        (
            star(&[("continuous", ""), ("continuous", "<mimic/>")]),
            "<string>:3: joint 'j1' <mimic>: the attribute joint is missing: add it",
        ),
        (
            star(&[("continuous", ""), ("continuous", "<mimic joint='j0' multiplier='0'/>")]),
            "<string>:3: joint 'j1' <mimic multiplier>: 0, so the joint never moves: make it fixed",
        ),
        (
            star(&[
                ("continuous", ""),
                ("continuous", "<mimic joint='j0' multiplier='1e-90'/>"),
                ("continuous", "<mimic joint='j1' multiplier='1e-90'/>"),
                ("continuous", "<mimic joint='j2' multiplier='1e-90'/>"),
                ("continuous", "<mimic joint='j3' multiplier='1e-90'/>"),
            ]),
            "<string>:6: joint 'j4' <mimic>: with the joints it follows, multiplier 0 and offset 0 result: choose ratios of sensible size",
        ),
    ]);

    let robot = read(&star(&[
        ("continuous", "<mimic joint='j1' multiplier='2' offset='1'/>"),
        ("continuous", "<mimic joint='j2' multiplier='-3' offset='5'/>"),
        ("continuous", ""),
        ("continuous", &follow("j2")),
    ]))
    .unwrap();
    let mimics = robot.joints.iter().map(|joint| joint.mimic.map(|m| (m.joint, m.multiplier, m.offset)));
    assert_eq!(
        mimics.collect::<Vec<_>>(),
        [Some((2, -6.0, 11.0)), Some((2, -3.0, 5.0)), None, Some((2, 1.0, 0.0))],
        "2 (-3 x + 5) + 1 = -6 x + 11"
    );
}

#[test]
fn what_is_not_used() {
    warned(&[
        ("<robot><link name='a'/></robot>".into(), &["<robot> (line 1): has no name and is called 'unnamed'"]),
        (
            "<robot name='r' xmlns:x='x'>
              <link name='a'>
                <visual><geometry/></visual><visual/>
                <collision><origin xzy='1 0 0'/><geometry><sphere radius='1'/></geometry><verbose/></collision>
              </link>
              <material/>
              <transmission name='t'><joint name='j'/></transmission>
              <transmission/>
              <transmission/>
              <gazebo><x:link x:name='b'/></gazebo>
              <x:link name='b'/>
            </robot>"
                .into(),
            &[
                "<gazebo> (line 10) is not used",
                "<material> (line 6) is not used",
                "<origin xzy> (line 4) is not used",
                "<transmission> (3 times, first on line 7) is not used",
                "<verbose> (line 4) is not used",
                "<visual> (2 times, first on line 3) is not used",
                "<x:link> (line 11) is not used",
            ],
        ),
        (
            joint("continuous", "<safety_controller/><calibration/><limit jerk='1'/>"),
            &[
                "<calibration> (line 1) is not used",
                "<limit jerk> (line 1) is not used",
                "<safety_controller> (line 1) is not used",
            ],
        ),
    ]);
}

/// A folder that goes when the test ends.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("carom-urdf-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    fn write(&self, file: &str, text: &str) -> PathBuf {
        let file = self.0.join(file);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(&file, text).unwrap();
        file
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn mesh(name: &str) -> String {
    shape(&format!("<mesh filename='{name}' scale='1 2 3'/>"))
}

#[test]
fn meshes_are_found() {
    let folder = Folder::new("found");
    let urdf = folder.write("arm_description/urdf/arm.urdf", "");
    let part = folder.write("arm_description/meshes/part one.stl", "");
    let other = folder.write("tools/gripper/x.stl", "");
    let beside = folder.write("arm_description/urdf/y.stl", "");
    let base = urdf.parent().unwrap();
    for (name, file) in [
        ("y.stl".to_string(), beside.clone()),
        ("../meshes/part one.stl".into(), base.join("../meshes/part one.stl")),
        (part.display().to_string(), part.clone()),
        (format!("file://{}", part.display()), part.clone()),
        ("package://arm_description/meshes/part one.stl".into(), part.clone()),
        ("model://tools/gripper/x.stl".into(), other),
    ] {
        std::fs::write(&urdf, mesh(&name)).unwrap();
        let robot = urdf::read_file(&urdf, &LoadOptions::default()).unwrap();
        let scale = Vector3::new(1.0, 2.0, 3.0);
        assert_eq!(robot.links[0].collisions[0].shape, Shape::Mesh { file, scale }, "{name}");
    }
}

#[test]
fn meshes_are_missing() {
    let folder = Folder::new("missing");
    let urdf = folder.write("arm/arm.urdf", "");
    let base = urdf.parent().unwrap().display().to_string();
    let end = "Correct the path, or go without it: --no-meshes (LoadOptions::meshes)";
    for (name, tried) in [
        ("x.stl", format!("tried '{base}/x.stl'")),
        ("file:///nowhere/x.stl", "tried '/nowhere/x.stl'".to_string()),
        ("package://arm/x.stl", format!("tried '{base}/x.stl'")),
        (
            "package://carom_no_such_package/x.stl",
            format!("there is no folder 'carom_no_such_package' in or above '{base}' or in ROS_PACKAGE_PATH"),
        ),
        ("http://host/x.stl", "only file://, package:// and model:// are known".into()),
    ] {
        std::fs::write(&urdf, mesh(name)).unwrap();
        let error = urdf::read_file(&urdf, &LoadOptions::default()).unwrap_err();
        let file = urdf.display();
        assert_eq!(
            error.to_string(),
            format!("{file}:1: link 'a' <collision>: mesh '{name}' is not found; {tried}. {end}")
        );
    }
    refused(&[
        (
            mesh("x.stl"),
            "<string>:1: link 'a' <collision>: mesh 'x.stl' is not found; the path is relative, but to no folder. Correct the path, or go without it: --no-meshes (LoadOptions::meshes)",
        ),
        (mesh(""), r#"<string>:1: link 'a' <mesh filename>: "" is empty: a name is needed"#),
    ]);

    let options = LoadOptions { meshes: Meshes::Ignored, ..Default::default() };
    let robot = urdf::read_str(&mesh("x.stl"), None, &options).unwrap();
    assert!(robot.links[0].collisions.is_empty());
    assert_eq!(robot.warnings, ["link 'a' <collision> (line 1): mesh 'x.stl' is not found, left out"]);
}

#[test]
fn unreadable_file() {
    let error = urdf::read_file("no/such/robot.urdf", &LoadOptions::default()).unwrap_err();
    assert!(matches!(&error, ChainError::Unreadable { path, .. } if path == Path::new("no/such/robot.urdf")));
    assert!(error.to_string().starts_with("no/such/robot.urdf: cannot be read: "), "{error}");
}

#[test]
fn a_good_robot_reads_as_written() {
    let robot = read(
        r#"<?xml version="1.0"?>
        <robot name="arm &amp; hand">
          <joint name="elbow" type="revolute">
            <axis xyz="0 0 1"/>
            <child link="hand"/>
            <parent link="arm"/>
            <origin xyz="1 2 3" rpy="0.1 0.2 0.3"/>
            <limit lower="-1" upper="2" effort="3" velocity="4"/>
            <dynamics damping="0.5" friction="0.25"/>
          </joint>
          <link name="hand">
            <collision name="palm">
              <geometry><capsule radius="0.1" length="0.2"/></geometry>
              <origin xyz="0 0 0.5"/>
            </collision>
            <inertial>
              <mass value="2"/>
              <inertia ixx="1" ixy="0.1" ixz="0.2" iyy="1.5" iyz="0.3" izz="2"/>
              <origin xyz="0.1 0.2 0.3"/>
            </inertial>
            <collision><geometry><box size="1 2 3"/></geometry></collision>
          </link>
          <link name="arm"/>
          <link name="tip"/>
          <joint name="a_tip" type="fixed"><parent link="hand"/><child link="tip"/></joint>
        </robot>"#,
    )
    .unwrap();
    assert_eq!(robot.warnings, ["<dynamics> with damping or friction (line 9) is not used"]);
    assert_eq!(robot.name, "arm & hand");
    assert_eq!(robot.links.iter().map(|link| link.name.as_str()).collect::<Vec<_>>(), ["hand", "arm", "tip"]);
    assert_eq!(robot.joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>(), ["elbow", "a_tip"]);
    assert_eq!(robot.root, 1);

    let elbow = &robot.joints[0];
    assert_eq!((elbow.kind, elbow.parent, elbow.child), (JointType::Revolute, 1, 0));
    assert_eq!((elbow.damping, elbow.friction, elbow.mimic), (0.5, 0.25, None));
    assert_eq!(elbow.axis, Vector3::z_axis());
    assert_eq!(elbow.origin.translation.vector, Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(robot.joints[1].origin, nalgebra::Isometry3::identity());
    assert_eq!(robot.joints[1].axis, Vector3::x_axis());

    let hand = &robot.links[0];
    let inertial = hand.inertial.unwrap();
    assert_eq!((inertial.mass, inertial.com), (2.0, Vector3::new(0.1, 0.2, 0.3)));
    assert_eq!(inertial.inertia_at_com, Matrix3::new(1.0, 0.1, 0.2, 0.1, 1.5, 0.3, 0.2, 0.3, 2.0));
    assert_eq!(hand.collisions[0].name.as_deref(), Some("palm"));
    assert_eq!(hand.collisions[0].shape, Shape::Capsule { radius: 0.1, length: 0.2 });
    assert_eq!(hand.collisions[0].origin.translation.vector, Vector3::new(0.0, 0.0, 0.5));
    assert_eq!(hand.collisions[1].shape, Shape::Box { size: Vector3::new(1.0, 2.0, 3.0) });
    assert_eq!((robot.links[1].inertial, robot.links[1].collisions.len()), (None, 0));
}

#[test]
fn angles_turn_about_fixed_axes_in_the_order_x_y_z() {
    let (r, p, y) = (0.3, -0.7, 1.9);
    let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
    let by_hand = about(Vector3::z_axis(), y) * about(Vector3::y_axis(), p) * about(Vector3::x_axis(), r);
    let read_one = |inside: &str| read(&joint("fixed", inside)).unwrap();
    let origin = read_one(&format!("<origin rpy='{r} {p} {y}'/>")).joints[0].origin;
    assert!(origin.rotation.angle_to(&UnitQuaternion::from_rotation_matrix(&by_hand)) < 1e-14);

    let principal = Vector3::new(1.0, 2.0, 2.5);
    let text = on_b(
        &inertial("1", "1 2 2.5 0").replace("<mass", &format!("<origin rpy='{r} {p} {y}' xyz='1 0 0'/><mass")),
        "continuous",
    );
    let inertial = read(&text).unwrap().links[1].inertial.unwrap();
    let expected = by_hand * Matrix3::from_diagonal(&principal) * by_hand.transpose();
    assert!((inertial.inertia_at_com - expected).amax() < 1e-14);
    assert_eq!(inertial.inertia_at_com, inertial.inertia_at_com.transpose());
    assert_eq!(inertial.com, Vector3::x(), "the centre of mass is given in link axes");
}

#[test]
fn a_namespace_of_the_whole_document_is_no_obstacle() {
    let text = joint("continuous", "<axis xyz='0 0 1'/>");
    let plain = read(&text).unwrap();
    assert_eq!(
        read(&text.replace("<robot", "<robot xmlns='http://example.org' xmlns:x='y' x:z='1'")).unwrap().joints,
        plain.joints
    );
    assert_eq!(read(&format!("\u{feff}{text}")).unwrap(), plain, "a byte order mark");
}

#[test]
fn long_chains_and_deep_documents() {
    let mut inside = String::from("<link name='l0'/>");
    for i in 1..=3000 {
        inside += &format!(
            "<link name='l{i}'>{INERTIAL}</link>
            <joint name='j{i}' type='continuous'><parent link='l{}'/><child link='l{i}'/></joint>",
            i - 1
        );
    }
    let start = std::time::Instant::now();
    assert_eq!(read(&robot(&inside)).unwrap().joints.len(), 3000);
    let took = start.elapsed();
    assert!(took.as_secs_f64() < 3.0, "{took:?}: half a second without optimisation, far less with it");

    // the same, closed to a loop
    inside += "<joint name='j0' type='fixed'><parent link='l3000'/><child link='l0'/></joint>";
    refused(&[(
        robot(&inside),
        "<string>:1: link 'l0': links 'l0', 'l1', 'l2', 'l3', 'l4' and 2996 more form a loop, each the child of the next: one of them must hang on the rest of the robot",
    )]);

    let deep = 100_000;
    let nested = format!("<link name='a'/>{}{}", "<x>".repeat(deep), "</x>".repeat(deep));
    assert_eq!(read(&robot(&nested)).unwrap().warnings, ["<x> (line 1) is not used"]);
}
