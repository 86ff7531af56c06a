//! COLLADA: geometries, the nodes of the scene that place them, the unit and the upward axis.
//!
//! The position of a geometry's point x is U·s·T₁·…·Tₖ x, with the transforms T of its nodes from the outermost inwards, the
//! unit s in m, and the rotation U that maps the file's upward axis to z. (COLLADA 1.4 specification, `<node>`, `<asset>`.)

use super::soup::Soup;
use carom_chain::input::{check_xml, shown};
use nalgebra::{Matrix3, Matrix4, Unit, Vector3};
use roxmltree::{Document, Node};
use std::cell::Cell;
use std::collections::HashMap;

/// Greatest depth of nested nodes: ends the recursion in files whose nodes refer to each other in a loop.
const DEEPEST: usize = 100;

/// Most vertices of a scene: with the search for equal ones they need some 2 GB.
const VERTICES: usize = 10_000_000;

/// Most elements of nodes that are visited, each as often as it is instantiated: some hundred times those of a large assembly.
const VISITED: usize = 1_000_000;

/// Most bytes of geometries and their numbers that are read, each as often as it is instantiated, MiB: twice two readings of the
/// largest file, some 10 s.
const READ_MIB: usize = 1024;

/// Reads the text of a file.
///
/// # Errors
/// A text that names the element and what is wrong with it.
pub(super) fn read(text: &str) -> Result<Soup, String> {
    check_xml(text).map_err(|(line, rule)| format!("line {line}: {rule}"))?;
    let document = Document::parse(text).map_err(|error| error.to_string())?;
    let mut ids = HashMap::new();
    for node in document.root_element().descendants() {
        if let Some(id) = node.attribute("id") {
            ids.entry(id).or_insert(node);
        }
    }
    let file = File { root: document.root_element(), ids, visited: Cell::new(0), read: Cell::new(0) };
    let mut soup = Soup::default();
    let to_metres = file.to_metres()?;
    match file.scene()? {
        Some(scene) => file.add_nodes(scene, to_metres, 0, &mut soup)?,
        // A library without a scene: all geometries, without transforms.
        None => {
            for geometry in file.root.descendants().filter(|node| node.has_tag_name_of("geometry")) {
                file.add_geometry(geometry, &to_metres, &mut soup)?;
            }
        }
    }
    Ok(soup)
}

struct File<'a> {
    root: Node<'a, 'a>,
    /// The first element with each id.
    ids: HashMap<&'a str, Node<'a, 'a>>,
    /// Number of elements visited: see [`VISITED`].
    visited: Cell<usize>,
    /// Bytes of geometries read: see [`READ_MIB`].
    read: Cell<usize>,
}

impl<'a> File<'a> {
    /// The element with the id of the reference `#id`.
    fn target(&self, url: Option<&str>) -> Result<Node<'a, 'a>, String> {
        let url = url.ok_or("a reference has no url or source")?;
        let id = url.strip_prefix('#').unwrap_or(url);
        self.ids.get(id).copied().ok_or_else(|| format!("no element has the id '{}'", shown(id)))
    }

    /// Counts an element that is visited.
    fn visit(&self) -> Result<(), String> {
        self.visited.set(self.visited.get() + 1);
        if self.visited.get() <= VISITED {
            return Ok(());
        }
        let limit = format!("more than {VISITED} elements would be visited, the limit");
        Err(format!("its nodes are instantiated too often: {limit}"))
    }

    /// Counts bytes of a geometry that are read.
    fn count(&self, bytes: usize) -> Result<(), String> {
        self.read.set(self.read.get() + bytes);
        if self.read.get() >> 20 < READ_MIB {
            return Ok(());
        }
        let limit = format!("more than {READ_MIB} MiB of them would be read, the limit");
        Err(format!("its geometries are instantiated too often: {limit}"))
    }

    /// The numbers in an element's text.
    fn numbers<T: std::str::FromStr>(&self, node: Node) -> Result<Vec<T>, String> {
        self.count(node.text().map_or(0, str::len))?;
        numbers(node)
    }

    /// The transform U·s from the unit and the upward axis.
    fn to_metres(&self) -> Result<Matrix4<f64>, String> {
        let asset = self.root.child("asset");
        let unit = asset.and_then(|asset| asset.child("unit")).and_then(|unit| unit.attribute("meter"));
        let unit: f64 =
            unit.map_or(Ok(1.0), |word| word.parse().map_err(|_| format!("<unit meter=\"{word}\">: not a number")))?;
        let upward = asset.and_then(|asset| asset.child("up_axis")).and_then(|node| node.text());
        let turn = match upward.map_or("Y_UP", str::trim) {
            "Z_UP" => Matrix3::identity(),
            "Y_UP" => Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0),
            // X_UP: −y is to the right, x is up, z is towards the viewer.
            "X_UP" => Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0),
            other => return Err(format!("<up_axis>{other}</up_axis>: only X_UP, Y_UP and Z_UP are supported")),
        };
        Ok((turn * unit).to_homogeneous())
    }

    fn scene(&self) -> Result<Option<Node<'a, 'a>>, String> {
        let instance = self.root.child("scene").and_then(|scene| scene.child("instance_visual_scene"));
        instance.map(|instance| self.target(instance.attribute("url"))).transpose()
    }

    /// Adds the geometries of a scene or node, which has the transform `outer`.
    fn add_nodes(&self, node: Node<'a, 'a>, outer: Matrix4<f64>, depth: usize, soup: &mut Soup) -> Result<(), String> {
        if depth > DEEPEST {
            return Err(format!("nodes are nested more than {DEEPEST} deep; does a node refer to itself?"));
        }
        let mut here = outer;
        for child in node.children() {
            self.visit()?;
            match child.tag_name().name() {
                name @ ("matrix" | "translate" | "rotate" | "scale" | "lookat" | "skew") => {
                    here *= transform(name, child)?;
                }
                "node" => self.add_nodes(child, here, depth + 1, soup)?,
                "instance_node" => {
                    self.add_nodes(self.target(child.attribute("url"))?, here, depth + 1, soup)?;
                }
                "instance_geometry" => self.add_geometry(self.target(child.attribute("url"))?, &here, soup)?,
                _ => {}
            }
        }
        Ok(())
    }

    fn add_geometry(&self, geometry: Node<'a, 'a>, place: &Matrix4<f64>, soup: &mut Soup) -> Result<(), String> {
        let Some(mesh) = geometry.child("mesh") else { return Ok(()) };
        self.count(geometry.range().len())?;
        for part in mesh.children().filter(Node::is_element) {
            let kind = part.tag_name().name();
            if !["triangles", "polylist", "polygons", "trifans", "tristrips"].contains(&kind) {
                continue;
            }
            let inputs: Vec<_> = part.children().filter(|node| node.has_tag_name_of("input")).collect();
            let offset = |input: &Node| input.attribute("offset").unwrap_or("0").parse::<usize>();
            let vertex = inputs.iter().find(|input| input.attribute("semantic") == Some("VERTEX"));
            let vertex = vertex.ok_or_else(|| format!("<{kind}> has no <input> with the semantic VERTEX"))?;
            let offsets: Result<Vec<_>, _> = inputs.iter().map(offset).collect();
            let last = offsets.map_err(|error| error.to_string())?.into_iter().max().unwrap_or(0);
            let stride =
                last.checked_add(1).ok_or_else(|| format!("<{kind}> has an <input> with the offset {last}"))?;
            let own = offset(vertex).map_err(|error| error.to_string())?;

            let base = soup.vertices.len() as u32;
            let positions = self.positions(self.target(vertex.attribute("source"))?)?;
            let count = positions.len() as u32;
            if soup.vertices.len() + positions.len() > VERTICES {
                let limit = "each counted as often as it is instantiated, the limit";
                return Err(format!("its geometries have more than {VERTICES} vertices, {limit}"));
            }
            soup.vertices.extend(positions.iter().map(|p| place.transform_point(&(*p).into()).coords));
            for list in part.children().filter(|node| node.has_tag_name_of("p")) {
                let indices: Vec<u32> = self.numbers(list)?;
                let corners: Vec<u32> = indices.chunks_exact(stride).map(|chunk| chunk[own]).collect();
                if let Some(bad) = corners.iter().find(|k| **k >= count) {
                    return Err(format!(
                        "<{kind}> has the vertex {bad} (counted from 0), but there are {count} vertices"
                    ));
                }
                let corners: Vec<u32> = corners.into_iter().map(|k| base + k).collect();
                match kind {
                    "triangles" => corners.chunks_exact(3).for_each(|corners| soup.add_polygon(corners)),
                    "polylist" => {
                        let mut rest = corners.as_slice();
                        for size in self.numbers::<usize>(part.child("vcount").ok_or("<polylist> has no <vcount>")?)? {
                            let polygon = rest
                                .split_at_checked(size)
                                .ok_or("<polylist> has fewer indices in <p> than <vcount> needs")?;
                            soup.add_polygon(polygon.0);
                            rest = polygon.1;
                        }
                    }
                    "tristrips" => corners.windows(3).enumerate().for_each(|(k, t)| {
                        soup.add_fan(&if k % 2 == 0 { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] });
                    }),
                    "trifans" => soup.add_fan(&corners),
                    _ => soup.add_polygon(&corners),
                }
            }
        }
        Ok(())
    }

    /// The positions of a `<vertices>` element.
    fn positions(&self, vertices: Node<'a, 'a>) -> Result<Vec<Vector3<f64>>, String> {
        let input = vertices.children().find(|node| node.attribute("semantic") == Some("POSITION"));
        let source =
            self.target(input.ok_or("<vertices> has no <input> with the semantic POSITION")?.attribute("source"))?;
        let accessor = source.descendants().find(|node| node.has_tag_name_of("accessor"));
        let stride = accessor.and_then(|accessor| accessor.attribute("stride")).unwrap_or("3");
        let stride: usize =
            stride.parse().map_err(|_| format!("<accessor stride=\"{stride}\">: not a whole number"))?;
        if stride < 3 {
            return Err(format!("<accessor stride=\"{stride}\">: a position needs 3 numbers"));
        }
        let values: Vec<f64> =
            self.numbers(source.child("float_array").ok_or("a <source> of positions has no <float_array>")?)?;
        Ok(values.chunks_exact(stride).map(|p| Vector3::new(p[0], p[1], p[2])).collect())
    }
}

fn transform(name: &str, node: Node) -> Result<Matrix4<f64>, String> {
    let values: Vec<f64> = numbers(node)?;
    match (name, values.as_slice()) {
        ("matrix", values) if values.len() == 16 => Ok(Matrix4::from_row_slice(values)),
        ("translate", [x, y, z]) => Ok(Matrix4::new_translation(&Vector3::new(*x, *y, *z))),
        ("scale", [x, y, z]) => Ok(Matrix4::new_nonuniform_scaling(&Vector3::new(*x, *y, *z))),
        ("rotate", [x, y, z, degrees]) => {
            let axis = Unit::try_new(Vector3::new(*x, *y, *z), 0.0);
            Ok(axis.map_or(Matrix4::identity(), |axis| Matrix4::from_axis_angle(&axis, degrees.to_radians())))
        }
        _ => Err(format!(
            "<{name}> with {} numbers: supported are <matrix> (16 numbers), <translate> (3), <rotate> (4) and <scale> (3)",
            values.len()
        )),
    }
}

fn numbers<T: std::str::FromStr>(node: Node) -> Result<Vec<T>, String> {
    let parse = |word: &str| {
        word.parse().map_err(|_| format!("<{}>: '{}' is not a number", node.tag_name().name(), shown(word)))
    };
    node.text().unwrap_or_default().split_whitespace().map(parse).collect()
}

/// Access to elements by their tag in any namespace: COLLADA has one for each version.
trait ByTag<'a>: Sized {
    fn has_tag_name_of(&self, name: &str) -> bool;
    fn child(&self, name: &str) -> Option<Self>;
}

impl<'a> ByTag<'a> for Node<'a, 'a> {
    fn has_tag_name_of(&self, name: &str) -> bool {
        self.is_element() && self.tag_name().name() == name
    }
    fn child(&self, name: &str) -> Option<Self> {
        self.children().find(|node| node.has_tag_name_of(name))
    }
}
