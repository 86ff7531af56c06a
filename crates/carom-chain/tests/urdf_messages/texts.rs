//! URDF texts with one thing in them, and what is said of them.

use carom_chain::ChainError;
use carom_chain::urdf::{self, LoadOptions, Robot};

pub const INERTIAL: &str =
    r#"<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"#;

/// A robot on one line, so that everything is on line 1.
pub fn robot(inside: &str) -> String {
    format!(r#"<robot name="r">{inside}</robot>"#)
}

/// Links `a` (root, without inertia) and `b`, and what joins them.
pub fn joined(joint: &str) -> String {
    robot(&format!(r#"<link name="a"/><link name="b">{INERTIAL}</link>{joint}"#))
}

/// Joint `j` of type `kind` from `a` to `b`, with more elements in it.
pub fn joint(kind: &str, inside: &str) -> String {
    joined(&format!(r#"<joint name="j" type="{kind}"><parent link="a"/><child link="b"/>{inside}</joint>"#))
}

/// Joints `j0`, `j1`, ... with children `b0`, `b1`, ...: type and what is in it.
pub fn star(joints: &[(&str, &str)]) -> String {
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
pub fn moving(mass: &str, inertia: &str) -> String {
    on_b(&inertial(mass, inertia), "continuous")
}

pub fn on_b(inside: &str, kind: &str) -> String {
    robot(&format!(
        r#"<link name="a"/><link name="b">{inside}</link><joint name="j" type="{kind}"><parent link="a"/><child link="b"/></joint>"#
    ))
}

pub fn inertial(mass: &str, inertia: &str) -> String {
    let i: Vec<&str> = inertia.split(' ').collect();
    format!(
        r#"<inertial><mass value="{mass}"/><inertia ixx="{}" iyy="{}" izz="{}" ixy="{}" ixz="0" iyz="0"/></inertial>"#,
        i[0], i[1], i[2], i[3]
    )
}

/// A link with a collision.
pub fn shape(shape: &str) -> String {
    robot(&format!(r#"<link name="a"><collision><geometry>{shape}</geometry></collision></link>"#))
}

pub fn read(text: &str) -> Result<Robot, ChainError> {
    urdf::read_str(text, None, &LoadOptions::default())
}

#[track_caller]
pub fn refused(cases: &[(String, &str)]) {
    for (text, message) in cases {
        match read(text) {
            Err(error) => assert_eq!(error.to_string(), *message, "\n{text:.2000}"),
            Ok(_) => panic!("accepted, expected: {message}\n{text:.2000}"),
        }
    }
}

#[track_caller]
pub fn warned(cases: &[(String, &[&str])]) {
    for (text, warnings) in cases {
        assert_eq!(read(text).unwrap().warnings, *warnings, "\n{text}");
    }
}
