//! Reader for URDF files. It returns a [`Robot`], **a checked tree of links and joints, or an error that names what to
//! correct**.
//!
//! 1. `xml` checks the document against the table in `schema`: its structure, and every attribute as text.
//! 2. urdf-rs parses the links and joints. Step 1 comes first because urdf-rs alone accepts NaN, does not distinguish a
//!    missing `<inertial>` from a massless one, and does not name the element in its messages.
//! 3. `tree`, `joint`, `link` and `collision` check the values: exactly one root and no loops, axes, limits, mimic joints,
//!    physically possible inertias, mass on everything that moves, existing mesh files.
//!
//! **Not supported:** xacro, SDF and MJCF. Visual geometry, materials, transmissions and other extensions are not used;
//! [`Robot::warnings`] lists them.

mod collision;
mod joint;
mod link;
mod names;
mod robot;
mod schema;
mod source;
mod tree;
mod warnings;
mod xml;

use crate::error::ChainError;
pub(crate) use names::suggestion;
pub use robot::*;
use roxmltree::Document;
use source::Source;
use std::path::Path;
use tree::Tree;
use warnings::Warnings;

/// Options of the reader.
#[derive(Debug, Clone, Copy, Default)]
pub struct LoadOptions {
    /// Whether the root link moves freely, on a floating joint that is added. Its inertia is then used and must be
    /// physically possible. Otherwise the root link is fixed to the world.
    pub floating_base: bool,
    /// Treatment of missing collision meshes.
    pub meshes: Meshes,
}

/// Treatment of missing collision meshes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Meshes {
    /// A missing mesh is an error.
    #[default]
    Required,
    /// A missing mesh is left out, with a warning.
    Ignored,
}

/// Reads a URDF file. Relative mesh paths are relative to its folder; packages are searched for in that folder, in the
/// folders above it and in those of the environment variable `ROS_PACKAGE_PATH`.
///
/// # Errors
/// [`ChainError::Unreadable`], or [`ChainError::Urdf`] with file, line, element, value and rule.
pub fn read_file(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Robot, ChainError> {
    let path = path.as_ref();
    let unreadable = |error: std::io::Error| ChainError::Unreadable { path: path.into(), reason: error.to_string() };
    let text = std::fs::read_to_string(path).map_err(unreadable)?;
    read(&text, &path.display().to_string(), path.parent(), options)
}

/// Reads a URDF from memory. `base_dir` is used for mesh files like the folder of the file in [`read_file`]. Without it,
/// relative mesh paths are not found, and packages are searched for in `ROS_PACKAGE_PATH` only.
///
/// # Errors
/// [`ChainError::Urdf`] with line, element, value and rule; its file is `<string>`.
pub fn read_str(text: &str, base_dir: Option<&Path>, options: &LoadOptions) -> Result<Robot, ChainError> {
    read(text, "<string>", base_dir, options)
}

fn read(text: &str, file: &str, base_dir: Option<&Path>, options: &LoadOptions) -> Result<Robot, ChainError> {
    let document = Document::parse(text).map_err(|error| not_xml(file, &error))?;
    let source = Source::new(file, &document);
    let mut warnings = Warnings::default();
    xml::check(&source, &mut warnings)?;

    let urdf = urdf_rs::read_from_string(&xml::canonical(&source))
        .map_err(|error| source.error(source.root, None, format!("urdf-rs cannot read the file: {error}")))?;

    let tree = Tree::new(&source, &urdf)?;
    if options.floating_base {
        joint::check_floating_base(&source, &urdf)?;
    }
    let kinds = joint::kinds(&source, &urdf)?;
    let moves = link::moving(&tree, &kinds, options.floating_base);
    let inertials = link::inertials(&source, &urdf, &moves, &mut warnings)?;
    let joints = joint::joints(&source, &urdf, &tree, &kinds, &mut warnings)?;
    let collisions = collision::collisions(&source, &urdf, base_dir, options, &mut warnings)?;
    let parts = urdf.links.into_iter().zip(inertials).zip(collisions);
    let links: Vec<Link> =
        parts.map(|((link, inertial), collisions)| Link { name: link.name, inertial, collisions }).collect();
    link::check_massless(&source, &tree, &links, &joints, options.floating_base)?;

    let name = if urdf.name.is_empty() { "unnamed".into() } else { urdf.name };
    Ok(Robot { name, links, joints, root: tree.root, warnings: warnings.sentences() })
}

fn not_xml(file: &str, error: &roxmltree::Error) -> ChainError {
    let hint = if error.to_string().contains("'xacro'") { "expand it with xacro first" } else { "correct the file" };
    let rule = format!("is not well-formed: {error}; {hint}");
    ChainError::Urdf { file: file.into(), line: error.pos().row, element: "XML".into(), rule }
}
