//! Checks the document against the table of [`schema`](super::schema), before its values are parsed.

use super::schema::{Attribute, Element, Occurs, ROBOT, Range, Value};
use super::source::{Source, own_children};
use super::warnings::Warnings;
use crate::error::ChainError;
use roxmltree::Node;

/// Largest magnitude of a number: products of a few larger ones overflow.
const LARGEST: f64 = 1e100;

/// Checks that every element and attribute in use occurs as often as it must, and that every number is valid. Adds what is
/// not used to `warnings`.
///
/// # Errors
/// The first violation in the order of the file.
pub(super) fn check(source: &Source, warnings: &mut Warnings) -> Result<(), ChainError> {
    let root = source.root;
    check_format(source)?;
    check_element(source, root, &ROBOT, warnings)?;
    if !own_children(root, "link").any(|_| true) {
        return Err(source.error(root, None, "has no link: a robot needs at least one <link name=\"...\">"));
    }
    if root.attribute("name").is_none_or(str::is_empty) {
        warnings.odd(source, root, "has no name; 'unnamed' is used");
    }
    Ok(())
}

/// Refuses other robot formats and xacro sources, and says how to convert them.
fn check_format(source: &Source) -> Result<(), ChainError> {
    let root = source.root;
    let other = match root.tag_name().name() {
        "robot" => None,
        "sdf" => Some("the file is SDF, not URDF: convert it to URDF first"),
        "mujoco" => Some("the file is MJCF, the format of MuJoCo, not URDF: convert it to URDF first"),
        _ => Some("the outermost element of a URDF is <robot>: give a URDF file"),
    };
    if let Some(rule) = other {
        return Err(source.error(root, None, rule));
    }
    for node in root.descendants().filter(Node::is_element) {
        let macros = node.tag_name().namespace().is_some_and(|name| name.contains("xacro"));
        let mut values = node.attributes().map(|attribute| attribute.value());
        if macros || values.any(|value| ["${", "$(find ", "$(arg "].iter().any(|mark| value.contains(mark))) {
            return Err(source.error(node, None, "the file is xacro, not URDF: expand it with xacro first"));
        }
    }
    Ok(())
}

/// Checks one element and those in it. The depth of the recursion is that of the table, not of the file.
fn check_element(source: &Source, node: Node, rule: &Element, warnings: &mut Warnings) -> Result<(), ChainError> {
    for attribute in rule.attributes {
        match node.attribute(attribute.name) {
            Some(text) => check_value(source, node, attribute, text)?,
            None if attribute.required => {
                return Err(source.error(node, None, format!("the attribute {} is missing: add it", attribute.name)));
            }
            None => {}
        }
    }
    for attribute in node.attributes() {
        if attribute.name() == "quat_xyzw" && rule.tag == "origin" {
            // Most readers ignore it, which silently gives a different robot.
            let rule = "quaternions are not supported: give the rotation as rpy";
            return Err(source.error(node, Some("quat_xyzw"), rule));
        }
        if attribute.namespace().is_some() || rule.attributes.iter().all(|known| known.name != attribute.name()) {
            warnings.unused(source, node, format!("<{} {}>", rule.tag, attribute.name()));
        }
    }
    check_occurrences(source, node, rule)?;
    for child in node.children().filter(Node::is_element) {
        let own = child.tag_name().namespace() == node.tag_name().namespace();
        let name = child.tag_name().name();
        match rule.children.iter().find(|known| own && known.tag == name) {
            Some(known) => check_element(source, child, known, warnings)?,
            None => {
                let prefix = child.tag_name().namespace().filter(|_| !own).and_then(|space| child.lookup_prefix(space));
                let prefix = prefix.map_or(String::new(), |prefix| format!("{prefix}:"));
                warnings.unused(source, child, format!("<{prefix}{name}>"));
            }
        }
    }
    Ok(())
}

fn check_occurrences(source: &Source, node: Node, rule: &Element) -> Result<(), ChainError> {
    for child in rule.children.iter().filter(|child| matches!(child.occurs, Occurs::Once | Occurs::AtMostOnce)) {
        let tag = child.tag;
        match own_children(node, tag).count() {
            0 if child.occurs == Occurs::Once => {
                return Err(source.error(node, None, format!("<{tag}> is missing: add it")));
            }
            0 | 1 => {}
            n => {
                return Err(source.error(
                    node,
                    None,
                    format!("has {n} <{tag}>, at most one is allowed: remove the others"),
                ));
            }
        }
    }
    let choices: Vec<&str> = rule.children.iter().filter(|c| c.occurs == Occurs::OneOf).map(|c| c.tag).collect();
    let chosen: usize = choices.iter().map(|tag| own_children(node, tag).count()).sum();
    if !choices.is_empty() && chosen != 1 {
        let rule = format!("contains {chosen} shapes, exactly one is needed: <{}>", choices.join(">, <"));
        return Err(source.error(node, None, rule));
    }
    Ok(())
}

fn check_value(source: &Source, node: Node, attribute: &Attribute, text: &str) -> Result<(), ChainError> {
    let problem = match &attribute.value {
        Value::Text => None,
        Value::Name => text.is_empty().then(|| "is empty: a name is needed".into()),
        Value::JointType => {
            // urdf-rs supports `spherical`; `joint::kinds` refuses it.
            let known = ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical"];
            if !known.contains(&text) {
                return Err(source.unsupported_type(node, text));
            }
            None
        }
        Value::Numbers(count, range) => numbers_problem(text, *count, range, node.has_tag_name("limit")),
    };
    problem.map_or(Ok(()), |problem| Err(source.error(node, Some(attribute.name), format!("\"{text}\" {problem}"))))
}

/// Checks a list of numbers; returns a text that says what is wrong.
fn numbers_problem(text: &str, count: usize, range: &Range, limit: bool) -> Option<String> {
    let words: Vec<&str> = text.split_whitespace().collect();
    for word in &words {
        let Ok(number) = word.parse::<f64>() else {
            return Some(format!(
                "is wrong: '{word}' is not a number; write numbers with a decimal point, separated by spaces"
            ));
        };
        if number.is_nan() || number.abs() > LARGEST {
            let hint = if limit { "; for no limit, omit the attribute" } else { "" };
            return Some(format!("is wrong: '{word}' is not a finite number up to {LARGEST:e}{hint}"));
        }
        let broken = match range {
            Range::Any => None,
            Range::NotZero => (number == 0.0).then_some("must not be zero"),
            Range::NotNegative => (number < 0.0).then_some("must not be negative"),
            Range::Positive => (number <= 0.0).then_some("must be greater than zero"),
        };
        if let Some(broken) = broken {
            return Some(format!("is wrong: {word} {broken}"));
        }
    }
    let is_are = if count == 1 { "1 is" } else { "3 are" };
    let s = if words.len() == 1 { "" } else { "s" };
    (words.len() != count).then(|| format!("contains {} number{s}, {is_are} needed", words.len()))
}

/// The document for urdf-rs: only the elements and attributes of the table, so that what is not used cannot make it fail
/// (its XML reader panics at prefixes, and a `<material>` without a name is an error).
pub(super) fn canonical(source: &Source) -> String {
    let mut text = String::new();
    write_element(source.root, &ROBOT, &mut text);
    text
}

fn write_element(node: Node, rule: &Element, text: &mut String) {
    text.push('<');
    text.push_str(rule.tag);
    for attribute in rule.attributes {
        if let Some(value) = node.attribute(attribute.name) {
            let value = value.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
            text.push_str(&format!(" {}=\"{value}\"", attribute.name));
        }
    }
    text.push('>');
    for child in node.children().filter(Node::is_element) {
        let own = child.tag_name().namespace() == node.tag_name().namespace();
        let known = rule.children.iter().find(|known| own && child.tag_name().name() == known.tag);
        // urdf-rs requires a velocity in <limit> and reads absent attributes as zero: limits are read from the document.
        if let Some(known) = known.filter(|known| known.tag != "limit") {
            write_element(child, known, text);
        }
    }
    text.push_str(&format!("</{}>", rule.tag));
}
