//! The text of a file, positions of elements in it, and their names in messages.

use crate::error::ChainError;
use crate::input::{self, MESSAGE, shortened, shown};
use roxmltree::{Document, Node};
use std::path::Path;

/// A parsed document, with the data that messages about it need.
pub(super) struct Source<'a> {
    /// The path, or `<string>`.
    pub file: &'a str,
    /// The outermost element.
    pub root: Node<'a, 'a>,
    /// Byte offset of the start of each line.
    line_starts: Vec<usize>,
}

impl<'a> Source<'a> {
    pub fn new(file: &'a str, document: &'a Document<'a>) -> Self {
        let ends = document.input_text().match_indices('\n');
        let line_starts = std::iter::once(0).chain(ends.map(|(end, _)| end + 1)).collect();
        Self { file, root: document.root_element(), line_starts }
    }

    /// The `<link>` elements, in the order of the file.
    pub fn links(&self) -> Vec<Node<'a, 'a>> {
        own_children(self.root, "link").collect()
    }

    /// The `<joint>` elements, in the order of the file.
    pub fn joints(&self) -> Vec<Node<'a, 'a>> {
        own_children(self.root, "joint").collect()
    }

    /// The line of a node, counted from 1.
    pub fn line(&self, node: Node) -> u32 {
        let line = self.line_starts.partition_point(|start| *start <= node.range().start);
        u32::try_from(line).unwrap_or(u32::MAX)
    }

    /// The error for a `node`, or an attribute of it, that breaks `rule`.
    pub fn error(&self, node: Node, attribute: Option<&str>, rule: impl Into<String>) -> ChainError {
        ChainError::Urdf {
            file: self.file.into(),
            line: self.line(node),
            element: self.describe(node, attribute),
            rule: shortened(&rule.into(), MESSAGE).into_owned(),
        }
    }

    /// The error for a `node`, or an attribute of it, that only xacro knows.
    pub fn xacro(&self, node: Node, attribute: Option<&str>) -> ChainError {
        ChainError::Xacro { file: self.file.into(), line: self.line(node), element: self.describe(node, attribute) }
    }

    /// `link 'upper_arm'`, `joint 'elbow' <origin xyz>`: the link or joint a node belongs to, then the node.
    pub fn describe(&self, node: Node, attribute: Option<&str>) -> String {
        let above = node.ancestors().find(|above| ["link", "joint", "robot"].contains(&above.tag_name().name()));
        let attribute = attribute.map_or(String::new(), |name| format!(" {}", shown(name)));
        let part = format!("<{}{attribute}>", shown(node.tag_name().name()));
        let owner = above.unwrap_or(self.root);
        match owner.attribute("name") {
            None | Some("") => part,
            Some(name) if owner == node => format!("{} '{}'", owner.tag_name().name(), shown(name)),
            Some(name) => format!("{} '{}' {part}", owner.tag_name().name(), shown(name)),
        }
    }

    /// The error for a joint type that is not supported.
    pub fn unsupported_type(&self, joint: Node, name: &str) -> ChainError {
        let rule = format!(
            "type \"{}\" is not supported: use revolute, continuous, prismatic, fixed, floating or planar",
            shown(name)
        );
        self.error(joint, None, rule)
    }
}

/// The elements in `node` with this tag and in the same namespace.
pub(super) fn own_children<'a>(node: Node<'a, 'a>, tag: &str) -> impl Iterator<Item = Node<'a, 'a>> {
    let namespace = node.tag_name().namespace();
    node.children().filter(move |child| {
        child.is_element() && child.tag_name().name() == tag && child.tag_name().namespace() == namespace
    })
}

/// The first element in `node` with this tag, or `node` itself if there is none: the position for a message.
pub(super) fn own_child<'a>(node: Node<'a, 'a>, tag: &str) -> Node<'a, 'a> {
    own_children(node, tag).next().unwrap_or(node)
}

pub(super) fn read_text(path: &Path) -> Result<String, ChainError> {
    let unreadable = |error: std::io::Error| ChainError::Unreadable { path: path.into(), reason: error.to_string() };
    input::read_text(path, input::MOST_MIB).map_err(unreadable)
}

pub(super) fn check_limits(file: &str, text: &str) -> Result<(), ChainError> {
    let refuse = |(line, rule)| ChainError::Urdf { file: file.into(), line, element: "XML".into(), rule };
    input::check_xml(text).map_err(refuse)
}

pub(super) fn not_xml(file: &str, error: &roxmltree::Error) -> ChainError {
    let of_xacro =
        r#"declare it in <robot>, xmlns:xacro="http://www.ros.org/wiki/xacro", and expand the file with xacro"#;
    let hint = if error.to_string().contains("'xacro'") { of_xacro } else { "correct the file" };
    // The parser's messages hold names of the file.
    let rule = format!("is not well-formed: {}; {hint}", input::shown(&error.to_string()));
    ChainError::Urdf { file: file.into(), line: error.pos().row, element: "XML".into(), rule }
}
