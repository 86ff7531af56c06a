//! Invalid robots, and robots with warnings.

use crate::desk::*;
use serde_json::json;

#[test]
fn invalid_robots_are_refused_by_every_command_with_the_same_message() {
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
        (String::new(), "r.urdf:1: XML: is not well-formed: the document does not have a root node; correct the file"),
        ("<sdf/>".into(), "r.urdf:1: <sdf>: the file is SDF, not URDF: convert it to URDF first"),
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
            "r.urdf:1: joint 'j' <axis xyz>: has length 0: the axis of a continuous joint must be a unit vector",
        ),
        (
            inertial("-2", "1 1 1 0"),
            "r.urdf:1: link 'b' <mass value>: -2 kg is negative: the mass of a body must be positive",
        ),
        (
            inertial("0", "1 1 1 0"),
            "r.urdf:1: link 'b' <mass value>: is 0 kg, but <inertia> is not zero: give the mass of the body, or remove <inertial>",
        ),
        (
            inertial("1", "1 1 1 2"),
            "r.urdf:1: link 'b' <inertia>: principal moments -1, 1 and 3 kg m²: none may be negative; check signs and the terms ixy, ixz, iyz",
        ),
        (
            inertial("1", "0.1 0.2 0.4 0"),
            "r.urdf:1: link 'b' <inertia>: principal moments 0.1, 0.2 and 0.4 kg m²: 0.1 + 0.2 = 0.3 is less than 0.4, but no principal moment of a body exceeds the sum of the other two; compute the inertia again, about the centre of mass",
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
            "r.urdf:1: link 'a': the name is already used on line 1: names must be unique; rename one of the two",
        ),
        (
            robot(&(links(&["a", "b", "c"]) + &weld("j", "a", "b") + &weld("j", "b", "c"))),
            "r.urdf:1: joint 'j': the name is already used on line 1: names must be unique; rename one of the two",
        ),
        (
            robot(&(links(&["a", "b", "c"]) + &weld("j", "a", "c") + &weld("k", "b", "c"))),
            "r.urdf:1: joint 'k': link 'c' is already the child of joint 'j' (line 1): a link is the child of at most one joint, because URDF cannot describe closed loops; remove one of the two joints",
        ),
        (
            robot(&(links(&["a", "b"]) + &weld("j", "a", "b") + &weld("k", "b", "a"))),
            "r.urdf:1: link 'a': links 'a' and 'b' form a loop: a robot is a tree, so make one of them the child of another link, or the root",
        ),
        (
            robot(&(links(&["a", "b", "c"]) + &weld("j", "a", "c"))),
            "r.urdf:1: link 'b': links 'a' and 'b' are the child of no joint, but a robot has exactly one root link: connect them by joints, for example fixed ones",
        ),
        (
            hinged(INERTIAL).replace("continuous", "hinge"),
            r#"r.urdf:1: joint 'j': type "hinge" is not supported: use revolute, continuous, prismatic, fixed, floating or planar"#,
        ),
        (
            hinged(INERTIAL).replace("</joint>", "<mimic joint='j'/></joint>"),
            "r.urdf:1: joint 'j' <mimic joint>: a joint cannot mimic itself: name another joint, or remove <mimic>",
        ),
        (
            robot("<link name='a'><collision><geometry><mesh filename='meshes/a.stl'/></geometry></collision></link>"),
            "r.urdf:1: link 'a' <collision>: mesh 'meshes/a.stl' is not found; tried './meshes/a.stl'. Correct the path, or load the robot without missing meshes: --no-meshes (LoadOptions::meshes)",
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
fn invalid_inertia_is_a_warning_on_a_fixed_link_and_refused_on_a_moving_one() {
    let desk = Desk::new("still");
    let bad = INERTIAL.replace(r#"<mass value="1"/>"#, r#"<mass value="-1"/>"#);
    desk.write("r.urdf", robot(&format!(r#"<link name="a">{bad}</link>"#)));
    let report = &desk.answers("inspect r.urdf --json", "")[0];
    assert_eq!(
        texts(&report["warnings"]),
        [
            "link 'a' <mass> (line 1): -1 kg is negative: the mass of a body must be positive; not used, since the link never moves"
        ]
    );
    refused(
        desk.run("inspect r.urdf --floating"),
        "r.urdf:1: link 'a' <mass value>: -1 kg is negative: the mass of a body must be positive",
    );
}

#[test]
fn massless_moving_links_are_accepted_if_a_link_below_has_inertia() {
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
    // Both hinges have the same axis, so the acceleration of each is undetermined.
    desk.write("r.urdf", two("0 0 1"));
    refused(
        desk.feed(args, r#"{"q":[0,0],"qd":[0,0]}"#),
        "<stdin>:1: joint 'j' moves no inertia at this pose, so its acceleration is not determined: give the links below it mass and inertia, or lock it",
    );
}

#[test]
fn no_meshes_turns_missing_meshes_into_warnings() {
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
fn unused_elements_are_listed_as_warnings() {
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
fn unreadable_files_are_named() {
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
