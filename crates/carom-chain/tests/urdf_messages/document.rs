//! Messages about the document: format, elements, names, the tree, and what is not used.

use crate::urdf_messages::texts::*;

#[test]
fn documents_that_are_not_urdf_are_refused() {
    refused(
        r#"
        <robot
            <string>:1: XML: is not well-formed: the document does not have a root node; correct the file
        <robot name='r'>\n<link name='a'>\n</robot>
            <string>:3: XML: is not well-formed: expected 'link' tag, not 'robot' at 3:1; correct the file
        <sdf/>
            <string>:1: <sdf>: the file is SDF, not URDF: convert it to URDF first
        <mujoco/>
            <string>:1: <mujoco>: the file is MJCF, the format of MuJoCo, not URDF: convert it to URDF first
        <html/>
            <string>:1: <html>: the outermost element of a URDF is <robot>: give a URDF file
        <robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:macro name="m"/></robot>
            <string>:1: robot 'r' <macro>: the file is xacro, not URDF: expand it with `pip install xacro` and `xacro FILE.xacro -o FILE.urdf`
        <robot name="r"><xacro:macro name="m"/></robot>
            <string>:1: XML: is not well-formed: an unknown namespace prefix 'xacro' at 1:18; declare it in <robot>, xmlns:xacro="http://www.ros.org/wiki/xacro", and expand the file with xacro
        robot: <link name="${side}_arm"/>
            <string>:1: link '${side}_arm': the file is xacro, not URDF: expand it with `pip install xacro` and `xacro FILE.xacro -o FILE.urdf`
        robot:
            <string>:1: robot 'r': has no link: a robot needs at least one <link name="...">
    "#,
    );
    refused_texts(&[
        ("".into(), "<string>:1: XML: is not well-formed: the document does not have a root node; correct the file"),
        (
            robot(r#"<link name="a"/>"#).replace("</", "<x:arm xmlns:x='http://ros.org/wiki/xacro'/></"),
            "<string>:1: robot 'r' <arm>: the file is xacro, not URDF: expand it with `pip install xacro` and `xacro FILE.xacro -o FILE.urdf`",
        ),
    ]);
}

#[test]
fn missing_and_repeated_names_and_elements_are_refused() {
    refused(
        r#"
        robot: <link/>
            <string>:1: <link>: the attribute name is missing: add it
        robot: <link name=""/>
            <string>:1: <link name>: "" is empty: a name is needed
        robot: <link name='a'/>\n<link name='a'/>
            <string>:2: link 'a': the name is already used on line 1: names must be unique; rename one of the two
        joined: <joint type='fixed'><parent link='a'/><child link='b'/></joint>
            <string>:1: <joint>: the attribute name is missing: add it
        joined: <joint name='j'><parent link='a'/><child link='b'/></joint>
            <string>:1: joint 'j': the attribute type is missing: add it
        joined: <joint name='j' type='fixed'><child link='b'/></joint>
            <string>:1: joint 'j': <parent> is missing: add it
        joined: <joint name='j' type='fixed'><parent link='a'/></joint>
            <string>:1: joint 'j': <child> is missing: add it
        joined: <joint name='j' type='fixed'><parent/><child link='b'/></joint>
            <string>:1: joint 'j' <parent>: the attribute link is missing: add it
        joint fixed: <child link='b'/>
            <string>:1: joint 'j': has 2 <child>, at most one is allowed: remove the others
        joint hinge:
            <string>:1: joint 'j': type "hinge" is not supported: use revolute, continuous, prismatic, fixed, floating or planar
        joint spherical:
            <string>:1: joint 'j': type "spherical" is not supported: use revolute, continuous, prismatic, fixed, floating or planar
        robot: <link name='a'><inertial><inertia/></inertial></link>
            <string>:1: link 'a' <inertial>: <mass> is missing: add it
        robot: <link name='a'><inertial/></link>
            <string>:1: link 'a' <inertial>: <mass> is missing: add it
        robot: <link name='a'><collision/></link>
            <string>:1: link 'a' <collision>: <geometry> is missing: add it
    "#,
    );
}

#[test]
fn links_that_do_not_form_one_tree_are_refused() {
    let join = |name, parent, child| {
        format!("<joint name='{name}' type='fixed'><parent link='{parent}'/><child link='{child}'/></joint>\n")
    };
    let links = |names: &[&str]| names.iter().map(|name| format!("<link name='{name}'/>\n")).collect::<String>();
    refused_texts(&[
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
            "<string>:5: joint 'j': the name is already used on line 4: names must be unique; rename one of the two",
        ),
        (
            robot(&(links(&["a", "b"]) + &join("j", "b", "b"))),
            "<string>:3: joint 'j': connects link 'b' to itself: parent and child must differ",
        ),
        (
            robot(&(links(&["a", "b", "c"]) + &join("j", "a", "c") + &join("k", "b", "c"))),
            "<string>:5: joint 'k': link 'c' is already the child of joint 'j' (line 4): a link is the child of at most one joint, because URDF cannot describe closed loops; remove one of the two joints",
        ),
        (
            robot(&(links(&["a", "b", "c", "d"]) + &join("j", "a", "c"))),
            "<string>:2: link 'b': links 'a', 'b' and 'd' are the child of no joint, but a robot has exactly one root link: connect them by joints, for example fixed ones",
        ),
        (
            robot(&links(&["a", "b", "c", "d", "e", "f", "g"])),
            "<string>:2: link 'b': links 'a', 'b', 'c', 'd', 'e' and 2 more are the child of no joint, but a robot has exactly one root link: connect them by joints, for example fixed ones",
        ),
        (
            robot(&(links(&["a", "b"]) + &join("j", "a", "b") + &join("k", "b", "a"))),
            "<string>:1: link 'a': links 'a' and 'b' form a loop: a robot is a tree, so make one of them the child of another link, or the root",
        ),
        (
            robot(
                &(links(&["root", "x", "a", "b", "c"])
                    + &join("i", "c", "x")
                    + &join("j", "c", "a")
                    + &join("k", "a", "b")
                    + &join("l", "b", "c")),
            ),
            "<string>:3: link 'a': links 'a', 'b' and 'c' form a loop: a robot is a tree, so make one of them the child of another link, or the root",
        ),
    ]);
}

#[test]
fn unused_elements_and_attributes_are_listed_in_warnings() {
    warned(
        r"
        <robot><link name='a'/></robot>
            <robot> (line 1): has no name; 'unnamed' is used
        joint continuous: <safety_controller/><calibration/><limit jerk='1'/>
            <limit jerk> (line 1) is not used: it is unknown
            <calibration> (line 1) is not used
            <safety_controller> (line 1) is not used
    ",
    );
    warned_texts(&[(
        "<robot name='r' xmlns:x='x'>
              <link name='a'>
                <visual><geometry/></visual><visual/>
                <collision><origin xzy='1 0 0'/><geometry><sphere radius='1'/></geometry><verbose/></collision><self_collision_checking/>
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
            "<origin xzy> (line 4) is not used: it is unknown",
            "<self_collision_checking> (line 4) is not used: it is unknown",
            "<gazebo> (line 10) is not used",
            "<material> (line 6) is not used",
            "<transmission> (3 times, first on line 7) is not used",
            "<verbose> (line 4) is not used",
            "<visual> (2 times, first on line 3) is not used",
            "<x:link> (line 11) is not used",
        ],
    )]);
}

#[test]
fn default_namespace_and_byte_order_mark_are_accepted() {
    let text = joint("continuous", "<axis xyz='0 0 1'/>");
    let plain = read(&text).unwrap();
    assert_eq!(
        read(&text.replace("<robot", "<robot xmlns='http://example.org' xmlns:x='y' x:z='1'")).unwrap().joints,
        plain.joints
    );
    assert_eq!(read(&format!("\u{feff}{text}")).unwrap(), plain, "a byte order mark");
}

#[test]
fn long_chains_and_deeply_nested_documents_are_read() {
    let mut inside = String::from("<link name='l0'/>");
    for i in 1..=3000 {
        inside += &format!(
            "<link name='l{i}'>{INERTIAL}</link>
            <joint name='j{i}' type='continuous'><parent link='l{}'/><child link='l{i}'/></joint>",
            i - 1
        );
    }
    let long = read(&robot(&inside)).unwrap();
    assert_eq!((long.links.len(), long.joints.len()), (3001, 3000));
    for (i, joint) in long.joints.iter().enumerate() {
        let ends = [joint.parent, joint.child].map(|link| long.links[link].name.clone());
        assert_eq!((joint.name.clone(), ends), (format!("j{}", i + 1), [format!("l{i}"), format!("l{}", i + 1)]));
    }

    // the same chain, closed to a loop
    inside += "<joint name='j0' type='fixed'><parent link='l3000'/><child link='l0'/></joint>";
    refused_texts(&[(
        robot(&inside),
        "<string>:1: link 'l0': links 'l0', 'l1', 'l2', 'l3', 'l4' and 2996 more form a loop: a robot is a tree, so make one of them the child of another link, or the root",
    )]);

    let deep = 100_000;
    let nested = format!("<link name='a'/>{}{}", "<x>".repeat(deep), "</x>".repeat(deep));
    assert_eq!(read(&robot(&nested)).unwrap().report.warnings, ["<x> (line 1) is not used: it is unknown"]);
}
