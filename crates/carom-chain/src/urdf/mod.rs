//! Reading URDF: **a file in, a [`Robot`] that is one tree of sound bodies out, or a message that says what to
//! correct**.
//!
//! 1. `xml` holds the document against the table in `schema`: structure, and every attribute as text.
//! 2. urdf-rs gives the links and joints their types. It reads what step 1 let through, because on its own it takes
//!    NaN, cannot tell a missing `<inertial>` from a massless one, and names no element in its messages.
//! 3. `tree`, `joint`, `link` and `collision` check what the values mean: one root and no loops, axes, limits,
//!    followers, inertias a body can have, mass on everything that moves, meshes that exist.
//!
//! **What is not here.** xacro, SDF and MJCF; visual geometry, materials, transmissions and other extensions. What is
//! not used is listed in [`Robot::warnings`].

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

/// What to do where the file leaves a choice.
#[derive(Debug, Clone, Copy, Default)]
pub struct LoadOptions {
    /// The root link moves freely, so its inertia counts and must be sound. Otherwise it is fixed to the world.
    pub floating_base: bool,
    /// What to do about collision meshes that are missing.
    pub meshes: Meshes,
}

/// What to do about collision meshes that are missing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Meshes {
    /// They are an error.
    #[default]
    Required,
    /// They are left out, each with a warning.
    Ignored,
}

/// Reads a URDF file. Relative mesh paths start at its folder; packages are looked for in the folders above it and in
/// those of `ROS_PACKAGE_PATH`.
///
/// # Errors
/// [`ChainError::Unreadable`], or [`ChainError::Urdf`] with file, line, element, value and rule.
pub fn read_file(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Robot, ChainError> {
    let path = path.as_ref();
    let unreadable = |error: std::io::Error| ChainError::Unreadable { path: path.into(), reason: error.to_string() };
    let text = std::fs::read_to_string(path).map_err(unreadable)?;
    read(&text, &path.display().to_string(), path.parent(), options)
}

/// Reads a URDF from memory. Relative mesh paths and packages start at `base_dir`; without one they are not found.
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
        .map_err(|error| source.error(source.root, None, format!("urdf-rs can't read it: {error}")))?;

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
    let rule = format!("not well-formed: {error}; {hint}");
    ChainError::Urdf { file: file.into(), line: error.pos().row, element: "XML".into(), rule }
}
