//! Collision geometry: shapes, and paths of mesh files.

use super::joint::pose;
use super::options::{LoadOptions, Meshes};
use super::packages::Packages;
use super::robot::{Collision, Shape};
use super::source::Source;
use super::warnings::Warnings;
use super::xml;
use nalgebra::Vector3;
use roxmltree::Node;
use std::path::Path;

/// The shapes of each link. Shapes of size zero are left out, with a warning. A missing mesh is a
/// [`Shape::MissingMesh`] with a warning; with [`Meshes::Ignored`] it is left out.
pub(super) fn collisions(
    source: &Source,
    urdf: &urdf_rs::Robot,
    base_dir: Option<&Path>,
    options: &LoadOptions,
    warnings: &mut Warnings,
) -> Vec<Vec<Collision>> {
    let packages = Packages::new(base_dir, &options.package_dirs);
    let mut of_links = Vec::new();
    for (link, link_node) in urdf.links.iter().zip(source.links()) {
        let mut collisions = Vec::new();
        for (collision, node) in link.collision.iter().zip(xml::collisions(link_node)) {
            if let Some(zero) = zero_size(&collision.geometry) {
                warnings.odd(source, node, &format!("the shape is left out, since its {zero} is 0"));
            } else if let Some(shape) = shape(&collision.geometry, &packages, options.meshes, source, node, warnings) {
                collisions.push(Collision { name: collision.name.clone(), origin: pose(&collision.origin), shape });
            }
        }
        of_links.push(collisions);
    }
    of_links
}

/// Name of the size that is zero.
fn zero_size(geometry: &urdf_rs::Geometry) -> Option<&'static str> {
    let sizes = match geometry {
        urdf_rs::Geometry::Box { size } => vec![("size", size.0.contains(&0.0))],
        urdf_rs::Geometry::Sphere { radius } => vec![("radius", *radius == 0.0)],
        urdf_rs::Geometry::Cylinder { radius, length } | urdf_rs::Geometry::Capsule { radius, length } => {
            vec![("radius", *radius == 0.0), ("length", *length == 0.0)]
        }
        urdf_rs::Geometry::Mesh { scale, .. } => vec![("scale", scale.is_some_and(|scale| scale.0.contains(&0.0)))],
    };
    sizes.into_iter().find_map(|(name, zero)| zero.then_some(name))
}

fn shape(
    geometry: &urdf_rs::Geometry,
    packages: &Packages,
    meshes: Meshes,
    source: &Source,
    node: Node,
    warnings: &mut Warnings,
) -> Option<Shape> {
    Some(match geometry {
        urdf_rs::Geometry::Box { size } => Shape::Box { size: size.0.into() },
        urdf_rs::Geometry::Sphere { radius } => Shape::Sphere { radius: *radius },
        urdf_rs::Geometry::Cylinder { radius, length } => Shape::Cylinder { radius: *radius, length: *length },
        urdf_rs::Geometry::Capsule { radius, length } => Shape::Capsule { radius: *radius, length: *length },
        urdf_rs::Geometry::Mesh { filename, scale } => match (packages.find(filename), meshes) {
            (Ok(file), _) => Shape::Mesh { file, scale: scale.map_or(Vector3::repeat(1.0), |scale| scale.0.into()) },
            (Err(tried), Meshes::WhenUsed) => {
                let text = format!("mesh '{filename}' is not found; {tried}. The shape cannot be used in contacts");
                warnings.odd(source, node, &text);
                Shape::MissingMesh { name: filename.clone(), tried }
            }
            (Err(_), Meshes::Ignored) => {
                warnings.note(source, node, &format!("mesh '{filename}' is not found, left out"));
                return None;
            }
        },
    })
}
