//! Checks the document against the table of [`schema`](super::schema), before its values are parsed.

use super::schema::{Attribute, DRAWN, Element, GEOMETRY, Occurs, Presence, ROBOT, Range, UNUSED, Value};
use super::source::{Source, own_children};
use super::transmission::has_rotor;
use super::warnings::Warnings;
use crate::error::ChainError;
use crate::input::{LONGEST_NAME, shown};
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
    // Definitions alone add no links and joints; what calls them, includes files or decides does.
    let definitions = ["arg", "macro", "property"];
    let of_xacro = |node: &Node| node.tag_name().namespace().is_some_and(|name| name.contains("xacro"));
    let has_links = own_children(root, "link").next().is_some();
    // Nodes are in the order of the text, so that what a definition contains ends where it ends.
    let mut defined = 0;
    let mut calls = |node: &Node| {
        let here = of_xacro(node) && (!has_links || node.range().start >= defined);
        let defines = has_links && definitions.contains(&node.tag_name().name());
        if here && defines {
            defined = node.range().end;
        }
        here && !defines
    };
    match root.descendants().find(|node| calls(node)) {
        Some(node) => Err(source.xacro(node, None)),
        None => Ok(()),
    }
}

/// Checks one element and those in it. The depth of the recursion is that of the table, not of the file.
fn check_element(source: &Source, node: Node, rule: &Element, warnings: &mut Warnings) -> Result<(), ChainError> {
    for attribute in rule.attributes {
        let name = attribute.name;
        match (node.attribute(name), attribute.presence) {
            (Some(text), _) => check_value(source, node, attribute, text, warnings)?,
            (None, Presence::Required) => {
                return Err(source.error(node, None, format!("the attribute {name} is missing: add it")));
            }
            (None, Presence::Assumed(value)) => {
                warnings.assumed(source, node, format!("<{}> without {name}", rule.tag), value);
            }
            (None, Presence::Optional | Presence::Default(_)) => {}
        }
    }
    for attribute in node.attributes() {
        if attribute.name() == "quat_xyzw" && rule.tag == "origin" {
            // Most readers ignore it, which silently gives a different robot.
            let rule = "quaternions are not supported: give the rotation as rpy";
            return Err(source.error(node, Some("quat_xyzw"), rule));
        }
        if attribute.namespace().is_some() || rule.attributes.iter().all(|known| known.name != attribute.name()) {
            let kind = format!("<{} {}>", rule.tag, attribute.name());
            match attribute.namespace() {
                Some(_) => warnings.unused(source, node, kind),
                None => warnings.unknown(source, node, kind),
            }
        }
    }
    check_occurrences(source, node, rule, warnings)?;
    if rule.tag == "collision" && !has_shape(node) {
        warnings.odd(source, node, "the collision is left out, since it has no shape that is supported");
    }
    for child in node.children().filter(Node::is_element) {
        let own = child.tag_name().namespace() == node.tag_name().namespace();
        let name = child.tag_name().name();
        match rule.children.iter().find(|known| own && known.tag == name) {
            Some(known) => check_element(source, child, known, warnings)?,
            None if own && DRAWN.contains(&name) => {}
            None if own && name == "transmission" && has_rotor(child) => {}
            None => {
                let prefix = child.tag_name().namespace().filter(|_| !own).and_then(|space| child.lookup_prefix(space));
                let prefix = prefix.map_or(String::new(), |prefix| format!("{prefix}:"));
                let kind = format!("<{prefix}{name}>");
                if own && !UNUSED.contains(&name) {
                    warnings.unknown(source, child, kind);
                } else {
                    warnings.unused(source, child, kind);
                }
            }
        }
    }
    Ok(())
}

fn check_occurrences(source: &Source, node: Node, rule: &Element, warnings: &mut Warnings) -> Result<(), ChainError> {
    for child in rule.children.iter().filter(|child| !matches!(child.occurs, Occurs::Often | Occurs::OneOf)) {
        let tag = child.tag;
        match (own_children(node, tag).count(), &child.occurs) {
            (0, Occurs::Once) => {
                return Err(source.error(node, None, format!("<{tag}> is missing: add it")));
            }
            (0, Occurs::Expected(value)) => {
                warnings.assumed(source, node, format!("<{}> without <{tag}>", rule.tag), value);
            }
            (0 | 1, _) => {}
            (n, _) => {
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
    if !choices.is_empty() && chosen > 1 {
        let rule = format!("contains {chosen} shapes, at most one is allowed: <{}>", choices.join(">, <"));
        return Err(source.error(node, None, rule));
    }
    Ok(())
}

fn check_value(
    source: &Source,
    node: Node,
    attribute: &Attribute,
    text: &str,
    warnings: &mut Warnings,
) -> Result<(), ChainError> {
    if ["${", "$(find ", "$(arg "].iter().any(|mark| text.contains(mark)) {
        return Err(source.xacro(node, Some(attribute.name)));
    }
    let problem = match &attribute.value {
        Value::Name if text.is_empty() => Some("is empty: a name is needed".into()),
        Value::Text | Value::Name => {
            let count = text.chars().count();
            let long = || format!("has {count} characters, at most {LONGEST_NAME} are allowed: give a shorter text");
            (count > LONGEST_NAME).then(long)
        }
        Value::JointType => {
            // urdf-rs supports `spherical`; `joint::kinds` refuses it.
            let known = ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical"];
            if !known.contains(&text) {
                return Err(source.unsupported_type(node, text));
            }
            None
        }
        Value::Numbers(count, range) => {
            let problem = numbers_problem(text, range, node.has_tag_name("limit"));
            match (problem, miscounted(text, *count), attribute.replacement()) {
                (None, Some(miscounted), Some(value)) => {
                    let text = format!("\"{}\" {miscounted}; read as {value}", shown(text));
                    warnings.odd_attribute(source, node, attribute.name, &text);
                    None
                }
                (problem, miscounted, _) => problem.or(miscounted),
            }
        }
    };
    let text = shown(text);
    problem.map_or(Ok(()), |problem| Err(source.error(node, Some(attribute.name), format!("\"{text}\" {problem}"))))
}

/// Checks the numbers of a list, not how many there are; returns a text that says what is wrong.
fn numbers_problem(text: &str, range: &Range, limit: bool) -> Option<String> {
    for word in text.split_whitespace() {
        let number = word.parse::<f64>();
        let word = shown(word);
        let Ok(number) = number else {
            return Some(format!(
                "is wrong: '{word}' is not a number; write numbers with a decimal point, separated by spaces"
            ));
        };
        if number.is_nan() || number.abs() > LARGEST {
            let hint = if limit {
                "; for no limit, omit the attribute (lower and upper together: one alone has the other at 0)"
            } else {
                ""
            };
            return Some(format!("is wrong: '{word}' is not a finite number up to {LARGEST:e}{hint}"));
        }
        let broken = match range {
            Range::Any => None,
            Range::NotNegative => (number < 0.0).then_some("must not be negative"),
        };
        if let Some(broken) = broken {
            return Some(format!("is wrong: {word} {broken}"));
        }
    }
    None
}

/// A text that says how many numbers a list contains, if it is not `count`.
fn miscounted(text: &str, count: usize) -> Option<String> {
    let given = text.split_whitespace().count();
    let is_are = if count == 1 { "1 is" } else { "3 are" };
    let s = if given == 1 { "" } else { "s" };
    (given != count).then(|| format!("contains {given} number{s}, {is_are} needed"))
}

impl Attribute {
    /// The value that replaces a wrong count of numbers.
    fn replacement(&self) -> Option<&'static str> {
        match self.presence {
            Presence::Default(value) | Presence::Assumed(value) => Some(value),
            Presence::Required | Presence::Optional => None,
        }
    }

    /// The text that is used for this attribute of an element that has been checked.
    fn text<'a>(&self, node: Node<'a, 'a>) -> Option<&'a str> {
        match (node.attribute(self.name), &self.value, self.presence) {
            (Some(text), Value::Numbers(count, _), _) if miscounted(text, *count).is_some() => self.replacement(),
            (None, _, Presence::Assumed(value)) => Some(value),
            (text, _, _) => text,
        }
    }
}

/// The collisions of a link that have a supported shape, in the order of the file.
pub(super) fn collisions<'a>(link: Node<'a, 'a>) -> impl Iterator<Item = Node<'a, 'a>> {
    own_children(link, "collision").filter(|node| has_shape(*node))
}

/// Whether the `<geometry>` of a `<collision>` contains a supported shape.
fn has_shape(collision: Node) -> bool {
    let supported = |tag: &str| GEOMETRY.children.iter().any(|shape| shape.tag == tag);
    own_children(collision, "geometry")
        .any(|geometry| geometry.children().any(|shape| shape.is_element() && supported(shape.tag_name().name())))
}

/// The document for urdf-rs: only the elements and attributes of the table, so that what is not used cannot make it fail
/// (its XML reader panics at prefixes, and a `<material>` without a name is an error).
pub(super) fn canonical(source: &Source) -> String {
    let mut text = String::new();
    write_element(source.root, &ROBOT, &mut text);
    text
}

fn write_element<'a>(node: Node<'a, 'a>, rule: &Element, text: &mut String) {
    text.push('<');
    text.push_str(rule.tag);
    for attribute in rule.attributes {
        if let Some(value) = attribute.text(node) {
            let value = value.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
            text.push_str(&format!(" {}=\"{value}\"", attribute.name));
        }
    }
    text.push('>');
    for child in node.children().filter(Node::is_element) {
        let own = child.tag_name().namespace() == node.tag_name().namespace();
        let known = rule.children.iter().find(|known| own && child.tag_name().name() == known.tag);
        // urdf-rs requires a velocity in <limit> and reads absent attributes as zero: limits are read from the document.
        if let Some(known) =
            known.filter(|known| known.tag != "limit" && (known.tag != "collision" || has_shape(child)))
        {
            write_element(child, known, text);
        }
    }
    for missing in rule.children.iter().filter(|child| matches!(child.occurs, Occurs::Expected(_))) {
        if own_children(node, missing.tag).next().is_none() {
            let zeros: Vec<String> = missing.attributes.iter().map(|it| format!("{}=\"0\"", it.name)).collect();
            text.push_str(&format!("<{} {}/>", missing.tag, zeros.join(" ")));
        }
    }
    text.push_str(&format!("</{}>", rule.tag));
}
