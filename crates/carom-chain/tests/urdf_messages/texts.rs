//! URDF texts for the tests, and checks of the messages about them.

use carom_chain::ChainError;
use carom_chain::urdf::{self, LoadOptions, Robot};
use carom_testing::tables::{blocks, cases};

pub const INERTIAL: &str =
    r#"<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"#;

/// A robot on one line, so that every message names line 1.
pub fn robot(inside: &str) -> String {
    format!(r#"<robot name="r">{inside}</robot>"#)
}

/// Links `a` (root, without inertia) and `b`, and the joint between them.
pub fn joined(joint: &str) -> String {
    robot(&format!(r#"<link name="a"/><link name="b">{INERTIAL}</link>{joint}"#))
}

/// Joint `j` of type `kind` from `a` to `b`, containing `inside`, about x unless that has an axis.
pub fn joint(kind: &str, inside: &str) -> String {
    let axis = axis(kind, inside);
    joined(&format!(r#"<joint name="j" type="{kind}"><parent link="a"/><child link="b"/>{axis}{inside}</joint>"#))
}

/// The axis that a joint needs.
fn axis(kind: &str, inside: &str) -> &'static str {
    let needed = !matches!(kind, "fixed" | "floating") && !inside.contains("<axis");
    if needed { r#"<axis xyz="1 0 0"/>"# } else { "" }
}

/// Joints `j0`, `j1`, ... from `a` to `b0`, `b1`, ..., each by its type and its contents.
pub fn star(joints: &[(&str, &str)]) -> String {
    let mut inside = String::from(r#"<link name="a"/>"#);
    for (i, (kind, more)) in joints.iter().enumerate() {
        let axis = axis(kind, more);
        inside += &format!(
            r#"<link name="b{i}">{INERTIAL}</link>
            <joint name="j{i}" type="{kind}"><parent link="a"/><child link="b{i}"/>{axis}{more}</joint>"#
        );
    }
    robot(&inside)
}

/// Link `b` with this `<inertial>`, on a moving joint.
pub fn moving(mass: &str, inertia: &str) -> String {
    on_b(&inertial(mass, inertia), "continuous")
}

pub fn on_b(inside: &str, kind: &str) -> String {
    let axis = axis(kind, "");
    robot(&format!(
        r#"<link name="a"/><link name="b">{inside}</link><joint name="j" type="{kind}"><parent link="a"/><child link="b"/>{axis}</joint>"#
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

/// The text of a case of a table: that of the function which its line names, as in `joint KIND: INSIDE`, or the line itself.
fn built(line: &str) -> String {
    let (head, rest) = line.split_once(':').map_or((line, ""), |(head, rest)| (head, rest.trim_start()));
    match head.split_once(' ').unwrap_or((head, "")) {
        ("moving", mass) => moving(mass, rest),
        ("fixed", mass) => on_b(&inertial(mass, rest), "fixed"),
        ("joint", kind) => joint(kind, rest),
        ("joined", "") => joined(rest),
        ("robot", "") => robot(rest),
        ("shape", "") => shape(rest),
        ("star", "") => {
            star(&rest.split(" | ").map(|one| one.split_once(' ').unwrap_or((one, ""))).collect::<Vec<_>>())
        }
        _ => line.to_owned(),
    }
}

/// Checks the messages of a table of texts.
#[track_caller]
pub fn refused(table: &str) {
    cases(table).into_iter().for_each(|(text, message)| refused_texts(&[(built(text), message)]));
}

/// Checks the warnings of a table of texts, or that there are none.
#[track_caller]
pub fn warned(table: &str) {
    blocks(table).into_iter().for_each(|(text, warnings)| warned_texts(&[(built(text), &warnings)]));
}

/// [`strictly_refused_texts`] of a table.
#[track_caller]
pub fn strictly_refused(table: &str) {
    blocks(table).into_iter().for_each(|(text, warnings)| strictly_refused_texts(&[(built(text), &warnings)]));
}

#[track_caller]
pub fn refused_texts(cases: &[(String, &str)]) {
    for (text, message) in cases {
        match read(text) {
            Err(error) => assert_eq!(error.to_string(), *message, "\n{text:.2000}"),
            Ok(_) => panic!("accepted, expected: {message}\n{text:.2000}"),
        }
    }
}

#[track_caller]
pub fn warned_texts(cases: &[(String, &[&str])]) {
    for (text, warnings) in cases {
        let report = read(text).unwrap().report;
        assert_eq!([report.warnings, report.unused].concat(), *warnings, "\n{text}");
        assert!(report.repairs.is_empty(), "{:?}", report.repairs);
    }
}

/// Texts that load with exactly these warnings, and that `strict` refuses with the first of them.
#[track_caller]
pub fn strictly_refused_texts(cases: &[(String, &[&str])]) {
    for (text, warnings) in cases {
        let report = read(text).unwrap_or_else(|e| panic!("{e}\n{text}")).report;
        assert_eq!(report.warnings, *warnings, "\n{text}");
        let strict = LoadOptions { strict: true, ..Default::default() };
        let error = urdf::read_str(text, None, &strict).unwrap_err().to_string();
        let rule = warnings[0].split_once(' ').unwrap().1;
        let rule = &rule[rule.find(") ").or(rule.find("): ")).unwrap() + 2..].trim_start();
        assert!(error.starts_with("<string>:") && error.contains(rule), "{error}\n{rule}");
        let end = "correct it, or load the robot without --strict (LoadOptions::strict)";
        assert!(error.ends_with(end), "{error}");
        let count = format!("(the first of {} warnings)", warnings.len());
        assert_eq!(error.contains(&count), warnings.len() > 1, "{error}");
    }
}
