//! Reads from an SRDF which pairs of links are not checked for collision, and poses by name (`<group_state>`). Groups and end effectors
//! are not used.

use super::names::listed;
use super::robot::{Joint, Link, NamedPose};
use super::source::{Source, check_limits, not_xml, read_text};
use super::warnings::Warnings;
use crate::error::ChainError;
use roxmltree::{Document, Node};
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

/// What this crate reads from an SRDF.
#[derive(Default)]
pub(super) struct Srdf {
    pub disabled_pairs: Vec<[String; 2]>,
    pub poses: Vec<NamedPose>,
}

/// The pairs that `<disable_collisions>` names, and those of `<disable_default_collisions>` that no `<enable_collisions>`
/// enables again, each in the order of the links in the URDF; and the positions of all `<group_state>` of a name, whatever their groups.
///
/// # Errors
/// [`ChainError::Unreadable`]; [`ChainError::Urdf`] with file and line for XML that is not well-formed, another root than
/// `<robot>`, and a missing attribute.
pub(super) fn read(path: &Path, links: &[Link], joints: &[Joint], warnings: &mut Warnings) -> Result<Srdf, ChainError> {
    let text = read_text(path)?;
    let file = path.display().to_string();
    check_limits(&file, &text)?;
    let document = Document::parse(&text).map_err(|error| not_xml(&file, &error))?;
    let source = Source::new(&file, &document);
    if source.root.tag_name().name() != "robot" {
        return Err(source.error(source.root, None, "is not an SRDF: its root must be <robot>"));
    }
    let places: HashMap<&str, usize> = links.iter().enumerate().map(|(k, link)| (link.name.as_str(), k)).collect();
    let (mut unknown, mut unknown_joints) = (BTreeSet::new(), BTreeSet::new());
    let mut poses: Vec<NamedPose> = Vec::new();
    let mut index = |node: Node, attribute: &str| -> Result<Option<usize>, ChainError> {
        let name = node
            .attribute(attribute)
            .ok_or_else(|| source.error(node, Some(attribute), "is missing: give the name of a link"))?;
        let found = places.get(name).copied();
        if found.is_none() {
            unknown.insert(name.to_owned());
        }
        Ok(found)
    };
    let (mut disabled, mut enabled) = (BTreeSet::new(), BTreeSet::new());
    for node in source.root.children().filter(Node::is_element) {
        match node.tag_name().name() {
            tag @ ("disable_collisions" | "enable_collisions") => {
                if let (Some(a), Some(b)) = (index(node, "link1")?, index(node, "link2")?) {
                    let pairs = if tag == "disable_collisions" { &mut disabled } else { &mut enabled };
                    pairs.insert((a.min(b), a.max(b)));
                }
            }
            "disable_default_collisions" => {
                if let Some(a) = index(node, "link")? {
                    disabled.extend((0..links.len()).filter(|b| *b != a).map(|b| (a.min(b), a.max(b))));
                }
            }
            "group_state" => {
                let missing =
                    |node, attribute| source.error(node, Some(attribute), format!("{attribute} is missing: give it"));
                let name = node.attribute("name").ok_or_else(|| missing(node, "name"))?;
                let at = poses.iter().position(|pose| pose.name == name).unwrap_or_else(|| {
                    poses.push(NamedPose { name: name.to_owned(), positions: Vec::new() });
                    poses.len() - 1
                });
                for joint in node.children().filter(|child| child.has_tag_name("joint")) {
                    let own = joint.attribute("name").ok_or_else(|| missing(joint, "name"))?;
                    let value = joint.attribute("value").ok_or_else(|| missing(joint, "value"))?;
                    if !joints.iter().any(|known| known.name == own) {
                        unknown_joints.insert(own.to_owned());
                        continue;
                    }
                    let numbers = value.split_whitespace().map(|x| x.parse::<f64>().ok().filter(|x| x.is_finite()));
                    let rule = "is no list of finite numbers: give the position of the joint, rad or m";
                    let numbers: Option<Vec<f64>> = numbers.collect();
                    let numbers = numbers.filter(|numbers| !numbers.is_empty());
                    let numbers = numbers.ok_or_else(|| source.error(joint, Some("value"), rule))?;
                    poses[at].positions.push((own.to_owned(), numbers));
                }
            }
            _ => {}
        }
    }
    if !unknown.is_empty() {
        let names: Vec<&str> = unknown.iter().map(String::as_str).collect();
        warnings.note_text(format!("{file} names links that the robot does not have: {}", listed(&names)));
    }
    if !unknown_joints.is_empty() {
        let names: Vec<&str> = unknown_joints.iter().map(String::as_str).collect();
        warnings.note_text(format!("{file} names joints that the robot does not have: {}", listed(&names)));
    }
    let name = |k: usize| links[k].name.clone();
    let disabled_pairs = disabled.difference(&enabled).map(|&(a, b)| [name(a), name(b)]).collect();
    Ok(Srdf { disabled_pairs, poses })
}
