//! Visual geometry, which recordings draw. No computation depends on it: an element that cannot be drawn is listed as not used.

use super::options::{LoadOptions, Meshes};
use super::packages::Packages;
use super::robot::{Shape, Visual};
use super::source::{Source, own_children};
use super::warnings::Warnings;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use roxmltree::Node;
use std::collections::BTreeMap;
use std::path::Path;

/// The visual shapes of each link, in the order of the file. A `<visual>` whose numbers are wrong, whose shape is of size zero or
/// whose mesh is not found is left out; with [`Meshes::Ignored`], so is every mesh.
pub(super) fn visuals(
    source: &Source,
    base_dir: Option<&Path>,
    options: &LoadOptions,
    warnings: &mut Warnings,
) -> Vec<Vec<Visual>> {
    let packages = Packages::new(base_dir, &options.package_dirs);
    let mut colours = BTreeMap::new();
    for material in source.root.descendants().filter(|node| node.has_tag_name("material")) {
        if let (Some(name), Some(colour)) = (material.attribute("name"), colour(material)) {
            colours.entry(name).or_insert(colour);
        }
    }
    for material in own_children(source.root, "material").filter(|material| colour(*material).is_none()) {
        warnings.unused(source, material, "<material>".into());
    }
    let mut of_links = Vec::new();
    for link in source.links() {
        let mut visuals = Vec::new();
        for node in own_children(link, "visual") {
            match visual(node, &packages, options.meshes, &colours) {
                Some(visual) => visuals.push(visual),
                None => warnings.unused(source, node, "<visual>".into()),
            }
        }
        of_links.push(visuals);
    }
    of_links
}

fn visual(node: Node, packages: &Packages, meshes: Meshes, colours: &BTreeMap<&str, [f64; 4]>) -> Option<Visual> {
    let geometry = own_children(node, "geometry").next()?;
    let shape = geometry.children().find(Node::is_element)?;
    let size = |name| positive::<1>(shape, name).map(|[x]| x);
    let shape = match shape.tag_name().name() {
        "box" => Shape::Box { size: positive(shape, "size")?.into() },
        "sphere" => Shape::Sphere { radius: size("radius")? },
        "cylinder" => Shape::Cylinder { radius: size("radius")?, length: size("length")? },
        "capsule" => Shape::Capsule { radius: size("radius")?, length: size("length")? },
        "mesh" if meshes == Meshes::WhenUsed => {
            let scale = Vector3::from(numbers(shape, "scale", Some([1.0; 3]))?);
            let file = packages.find(shape.attribute("filename")?).ok()?;
            (!scale.iter().any(|s| *s == 0.0)).then_some(Shape::Mesh { file, scale })?
        }
        _ => return None,
    };
    let origin = match own_children(node, "origin").next() {
        Some(origin) => {
            let [x, y, z] = numbers(origin, "xyz", Some([0.0; 3]))?;
            let [roll, pitch, yaw] = numbers(origin, "rpy", Some([0.0; 3]))?;
            Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
        }
        None => Isometry3::identity(),
    };
    let material = own_children(node, "material").next();
    let named = |material: Node| material.attribute("name").and_then(|name| colours.get(name).copied());
    let colour = material.and_then(|material| colour(material).or_else(|| named(material)));
    Some(Visual { origin, shape, colour })
}

/// The colour of a `<material>`.
fn colour(material: Node) -> Option<[f64; 4]> {
    let colour: [f64; 4] = numbers(own_children(material, "color").next()?, "rgba", None)?;
    colour.iter().all(|part| (0.0..=1.0).contains(part)).then_some(colour)
}

/// The numbers of an attribute, or `otherwise` without it; `None` unless there are N, each within the range of a viewer's numbers.
fn numbers<const N: usize>(node: Node, attribute: &str, otherwise: Option<[f64; N]>) -> Option<[f64; N]> {
    let Some(text) = node.attribute(attribute) else { return otherwise };
    let numbers: Vec<f64> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    let numbers: [f64; N] = numbers.try_into().ok()?;
    numbers.iter().all(|x| (*x as f32).is_finite()).then_some(numbers)
}

fn positive<const N: usize>(node: Node, attribute: &str) -> Option<[f64; N]> {
    numbers(node, attribute, None).filter(|numbers| numbers.iter().all(|x| *x > 0.0))
}
