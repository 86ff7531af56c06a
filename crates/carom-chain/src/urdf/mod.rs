//! Reader for URDF files. It returns a [`Robot`], **a checked tree of links and joints, or an error that names what to
//! correct**.
//!
//! What a file may contain is decided by one question: is the mathematics sound?
//!
//! - **Warnings** ([`LoadReport::warnings`]), for deviations with which it is: an inertia that breaks the triangle inequality,
//!   missing numbers for which there is a default, shapes of size zero, unknown elements, meshes that are not found.
//!   [`LoadOptions::strict`] turns them into errors.
//! - **Partial service**, for robots with links that move without mass: kinematics and Jacobians; dynamics are refused with
//!   the list of these links ([`Chain::massless_links`](crate::Chain::massless_links)). [`LoadOptions::repair`] welds them.
//! - **Errors**: numbers that are not finite, negative masses and principal moments, wrong names, links that are not one tree,
//!   unknown joint types, XML that is not well-formed.
//!
//! The steps:
//!
//! 1. `xml` checks the document against the table in `schema`: its structure, and every attribute as text.
//! 2. urdf-rs parses the links and joints. Step 1 comes first because urdf-rs alone accepts NaN, does not distinguish a
//!    missing `<inertial>` from a massless one, and does not name the element in its messages.
//! 3. `tree`, `joint`, `link` and `collision` check the values: exactly one root and no loops, axes, limits, mimic joints,
//!    inertias, mesh files (`packages`).
//! 4. `visual` reads what recordings draw; nothing in it is an error.
//! 5. `units` warns of numbers that look like degrees, millimetres or kg mm².
//! 6. `weld` repairs what has no mass, if it is asked to.
//! 7. `transmission` reads the inertia of motors' rotors.
//!
//! **Not supported:** xacro, SDF and MJCF. Textures and other extensions are not used; [`LoadReport::unused`] lists extensions,
//! and visual shapes that cannot be drawn.

mod collision;
mod joint;
mod link;
mod names;
mod options;
mod packages;
mod robot;
mod schema;
mod segment;
mod source;
mod srdf;
mod transmission;
mod tree;
mod units;
mod visual;
mod warnings;
mod weld;
mod xml;

use crate::error::ChainError;
use crate::input;
pub(crate) use names::suggestion;
pub use options::{LoadOptions, Meshes};
pub use packages::{find_mesh, find_package};
pub use robot::*;
use roxmltree::Document;
pub use segment::{Beam, Bend};
use source::{Source, check_limits, not_xml, read_text};
use std::borrow::Cow;
use std::path::Path;
use tree::Tree;
use warnings::Warnings;

/// Reads a URDF file. Mesh paths are resolved as by [`find_mesh`], relative to the folder of the file.
///
/// # Errors
/// [`ChainError::Unreadable`], or [`ChainError::Urdf`] with file, line, element, value and rule.
pub fn read_file(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Robot, ChainError> {
    let path = path.as_ref();
    read(&read_text(path)?, &path.display().to_string(), path.parent(), options)
}

/// Reads a URDF from memory. `base_dir` is used for mesh files like the folder of the file in [`read_file`]. Without it,
/// relative mesh paths are not found.
///
/// # Errors
/// [`ChainError::Urdf`] with line, element, value and rule; its file is `<string>`.
pub fn read_str(text: &str, base_dir: Option<&Path>, options: &LoadOptions) -> Result<Robot, ChainError> {
    read(text, "<string>", base_dir, options)
}

fn read(text: &str, file: &str, base_dir: Option<&Path>, options: &LoadOptions) -> Result<Robot, ChainError> {
    check_limits(file, text)?;
    let mut warnings = Warnings::default();
    let mut text = declared(text, &mut warnings);
    loop {
        let error = match Document::parse(&text) {
            Ok(document) => return read_document(&Source::new(file, &document), base_dir, options, warnings),
            Err(error) => error,
        };
        text = with_prefix(&text, &error, &mut warnings).map(Cow::Owned).ok_or_else(|| not_xml(file, &error))?;
    }
}

fn read_document(
    source: &Source,
    base_dir: Option<&Path>,
    options: &LoadOptions,
    mut warnings: Warnings,
) -> Result<Robot, ChainError> {
    xml::check(source, &mut warnings)?;

    let urdf = urdf_rs::read_from_string(&xml::canonical(source))
        .map_err(|error| source.error(source.root, None, format!("urdf-rs cannot read the file: {error}")))?;

    let tree = Tree::new(source, &urdf)?;
    if options.floating_base {
        joint::check_floating_base(source, &urdf)?;
    }
    let kinds = joint::kinds(source, &urdf)?;
    let moves = tree.moving(&kinds, options.floating_base);
    let reach = tree.reach(&urdf, &moves);
    let inertials = link::inertials(source, &urdf, &tree, &kinds, (&moves, reach), options.repair, &mut warnings)?;
    let mut joints = joint::joints(source, &urdf, &tree, &kinds, &mut warnings)?;
    let collisions = collision::collisions(source, &urdf, base_dir, options, &mut warnings);
    let visuals = visual::visuals(source, base_dir, options, &mut warnings);
    let parts = urdf.links.into_iter().zip(inertials).zip(collisions.into_iter().zip(visuals));
    let link = |((link, inertial), (collisions, visuals)): ((urdf_rs::Link, _), _)| Link {
        name: link.name,
        inertial,
        collisions,
        visuals,
    };
    let mut links: Vec<Link> = parts.map(link).collect();
    link::set_inertials(&mut links, options)?;
    units::check(source, &tree, &links, &joints, (&moves, reach), &mut warnings);
    if options.repair {
        warnings.repairs.extend(weld::weld_massless(&tree, &links, &mut joints, options.floating_base));
    }
    transmission::read_rotors(source, &mut joints, &mut warnings)?;

    let srdf = options.srdf.as_ref().map(|path| srdf::read(path, &links, &joints, &mut warnings)).transpose()?;
    let srdf::Srdf { disabled_pairs, poses } = srdf.unwrap_or_default();
    let name = if urdf.name.is_empty() { "unnamed".into() } else { urdf.name };
    let report = warnings.report(source.file, options.strict)?;
    Ok(Robot { name, links, joints, root: tree.root, disabled_pairs, poses, report })
}

/// The text with `version` in its XML declaration where the file has `verison`, a misspelling in many published files.
/// Positions of errors do not change, because both words have the same length.
fn declared<'a>(text: &'a str, warnings: &mut Warnings) -> Cow<'a, str> {
    let end = text.find("?>").unwrap_or(0);
    match text[..end].find("verison=") {
        Some(at) if text.trim_start_matches('\u{feff}').starts_with("<?xml ") => {
            warnings.odd_at("XML".into(), 1, "\"verison\" in the declaration is read as \"version\"");
            Cow::Owned(format!("{}version{}", &text[..at], &text[at + "verison".len()..]))
        }
        _ => Cow::Borrowed(text),
    }
}

/// The text with a declaration of the namespace prefix that `error` misses, in the root element, which moves no line. Many
/// published files use the prefixes of plugins in `<gazebo>` without declaring them. `None` for other errors, after many
/// prefixes, and for xacro, which changes the robot.
fn with_prefix(text: &str, error: &roxmltree::Error, warnings: &mut Warnings) -> Option<String> {
    const UNDECLARED: &str = "undeclared:";
    // Each prefix costs one more reading of the text.
    const MOST: usize = 10;
    let roxmltree::Error::UnknownNamespace(prefix, place) = error else { return None };
    if prefix == "xacro" || text.matches(UNDECLARED).count() >= MOST {
        return None;
    }
    let at = end_of_root_name(text)?;
    let name = input::shown(prefix);
    let message = format!(
        "the prefix '{name}' is not declared; read as declared: add xmlns:{name}=\"…\" to the outermost element"
    );
    warnings.odd_at("XML".into(), place.row, &message);
    Some(format!("{} xmlns:{prefix}=\"{UNDECLARED}{prefix}\"{}", &text[..at], &text[at..]))
}

/// Where the name of the outermost element ends.
fn end_of_root_name(text: &str) -> Option<usize> {
    let mut at = text.find('<')?;
    loop {
        let rest = &text[at..];
        let end = match rest {
            _ if rest.starts_with("<!--") => "-->",
            _ if rest.starts_with("<?") => "?>",
            _ => return rest.find(|c: char| c.is_whitespace() || c == '/' || c == '>').map(|k| at + k),
        };
        at += rest.find(end)?;
        at += text[at..].find('<')?;
    }
}
