//! Pairs of links that an SRDF disables, and messages about such files.

use carom_chain::Chain;
use carom_chain::urdf::{self, LoadOptions};
use std::path::PathBuf;

const ROBOT: &str = "<robot name='r'><link name='a'/><link name='b'/><link name='c'/>
    <joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint>
    <joint name='k' type='fixed'><parent link='b'/><child link='c'/></joint></robot>";

/// The SRDF of this text, in a file of its own.
fn file(name: &str, text: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("carom-srdf-{name}-{}.srdf", std::process::id()));
    std::fs::write(&path, text).unwrap();
    path
}

fn load(name: &str, text: &str) -> Result<urdf::Robot, String> {
    let path = file(name, text);
    let options = LoadOptions { srdf: Some(path.clone()), strict: true, ..Default::default() };
    let robot = urdf::read_str(ROBOT, None, &options);
    std::fs::remove_file(&path).unwrap();
    robot.map_err(|e| e.to_string().replace(&path.display().to_string(), "FILE"))
}

fn pairs(name: &str, inner: &str) -> Vec<[String; 2]> {
    load(name, &format!("<robot name='r'>{inner}</robot>")).unwrap().disabled_pairs
}

#[test]
fn disabled_pairs_are_those_named_and_those_of_default_without_the_enabled() {
    let disable = |a: &str, b: &str| format!("<disable_collisions link1='{a}' link2='{b}' reason='Never'/>");
    let pair = |a: &str, b: &str| [a.to_owned(), b.to_owned()];
    assert_eq!(pairs("none", "<group name='g'><link name='a'/></group>"), Vec::<[String; 2]>::new());
    // Either order, and twice, is one pair, in the order of the URDF.
    assert_eq!(pairs("two", &(disable("c", "a") + &disable("a", "c"))), [pair("a", "c")]);
    assert_eq!(pairs("default", "<disable_default_collisions link='b'/>"), [pair("a", "b"), pair("b", "c")]);
    let back = "<disable_default_collisions link='b'/><enable_collisions link1='c' link2='b'/>";
    assert_eq!(pairs("enabled", back), [pair("a", "b")]);
    let path = file("chain", &format!("<robot name='r'>{}</robot>", disable("b", "c")));
    let options = LoadOptions { srdf: Some(path.clone()), ..Default::default() };
    assert_eq!(Chain::from_urdf_str(ROBOT, &options).unwrap().disabled_pairs(), [pair("b", "c")]);
    std::fs::remove_file(path).unwrap();
}

/// An SRDF is often shared by variants of a robot: links that this one lacks are a note, also with `strict`.
#[test]
fn links_that_the_robot_does_not_have_are_noted() {
    let text = "<robot name='r'><disable_collisions link1='a' link2='gripper'/></robot>";
    let robot = load("unknown", text).unwrap();
    assert!(robot.disabled_pairs.is_empty());
    let [note] = robot.report.unused.as_slice() else { panic!("{:?}", robot.report) };
    assert!(note.ends_with("names links that the robot does not have: 'gripper'"), "{note}");
}

#[test]
fn faulty_srdf_files_are_refused_with_file_and_line() {
    for (name, text, said) in [
        (
            "attribute",
            "<robot>\n<disable_collisions link1='a'/>\n</robot>",
            "FILE:2: <disable_collisions link2>: is missing: give the name of a link",
        ),
        ("root", "<sdf/>", "FILE:1: <sdf>: is not an SRDF: its root must be <robot>"),
        ("xml", "<robot>", "FILE:1: XML: is not well-formed:"),
    ] {
        let refused = load(name, text).unwrap_err();
        assert!(refused.starts_with(said), "{refused}");
    }
    let options = LoadOptions { srdf: Some("no/such.srdf".into()), ..Default::default() };
    let refused = urdf::read_str(ROBOT, None, &options).unwrap_err().to_string();
    assert!(refused.starts_with("no/such.srdf: cannot be read: "), "{refused}");
}

/// The states of all groups under one name are one pose, with all numbers of a joint, as files of other programs have them; joints of another variant of the robot are a note, and numbers that are none are
/// refused.
#[test]
fn poses_are_those_of_all_groups_of_a_name() {
    let state = |name: &str, group: &str, joints: &str| {
        format!("<group_state name='{name}' group='{group}'>{joints}</group_state>")
    };
    let text = state("home", "arm", "<joint name='j' value=' 0.5 '/>")
        + &state("rest", "arm", "")
        + &state("home", "hand", "<joint name='k' value=' -1e-3  2'/><joint name='finger' value='1'/>");
    let robot = load("poses", &format!("<robot name='r'>{text}</robot>")).unwrap();
    let found: Vec<_> = robot.poses.iter().map(|pose| (pose.name.as_str(), pose.positions.clone())).collect();
    assert_eq!(
        found,
        [("home", vec![("j".to_owned(), vec![0.5]), ("k".to_owned(), vec![-1e-3, 2.0])]), ("rest", vec![])]
    );
    assert!(
        robot.report.unused[0].ends_with("names joints that the robot does not have: 'finger'"),
        "{:?}",
        robot.report
    );
    for (joint, words) in [
        ("<joint name='j' value='1 two'/>", "is no list of finite numbers"),
        ("<joint name='j' value=' '/>", "is no list of finite numbers"),
        ("<joint name='j'/>", "value"),
        ("<joint value='1'/>", "name"),
    ] {
        let refused = load("faulty", &format!("<robot name='r'>\n{}</robot>", state("x", "g", joint))).unwrap_err();
        assert!(refused.starts_with("FILE:2") && refused.contains(words), "{refused}");
    }
}
