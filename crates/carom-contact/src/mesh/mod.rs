//! Triangle meshes, read from STL, COLLADA (`.dae`) and Wavefront (`.obj`) files.

mod dae;
mod obj;
mod polygon;
mod soup;

use crate::error::ContactError;
use carom_chain::input::{MESSAGE, read_bytes, read_text, shortened};
use nalgebra::Vector3;
use soup::Soup;
use std::collections::HashMap;
use std::io::Cursor;
use std::path::Path;

/// Largest mesh file, MiB: five million triangles of a binary STL, which need some 2 GB.
const MOST_MIB: u64 = 256;

/// A triangle mesh in its own axes, with at least one triangle of non-zero area and finite coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
    closed: bool,
}

/// Stands for the file of a mesh that has none.
pub(crate) const TRIANGLES: &str = "<triangles>";

/// What is wrong with a mesh without a triangle of non-zero area.
pub(crate) fn no_triangles(count: usize) -> String {
    format!("has no triangle of non-zero area ({count} triangles in the file): give a mesh with triangles, or a box")
}

impl Mesh {
    /// Reads a mesh from an STL, DAE or OBJ file. `scale` multiplies the coordinates along x, y and z, and so converts the
    /// file's unit to m. A `.dae` is first converted to m with z upwards, by the unit and the upward axis that it states (by
    /// default m and y). `owner` is named in errors: `link 'palm'`, `obstacle`.
    ///
    /// # Errors
    /// [`ContactError::Mesh`].
    pub fn read(file: &Path, scale: Vector3<f64>, owner: &str) -> Result<Self, ContactError> {
        let refuse = |fault| ContactError::Mesh { owner: owner.into(), file: file.into(), fault };
        let read = || {
            let kind = file.extension().and_then(|kind| kind.to_str()).unwrap_or_default().to_lowercase();
            let refused = |why: String| format!("cannot be read: {}", shortened(&why, MESSAGE));
            let unreadable = |error: std::io::Error| refused(error.to_string());
            let soup = match kind.as_str() {
                "stl" => stl(&read_bytes(file, MOST_MIB).map_err(unreadable)?).map_err(unreadable)?,
                "dae" => dae::read(&read_text(file, MOST_MIB).map_err(unreadable)?).map_err(refused)?,
                "obj" => obj::read(&read_text(file, MOST_MIB).map_err(unreadable)?).map_err(refused)?,
                _ => {
                    let rule = "which is not supported: give an stl, dae or obj file";
                    return Err(format!("has the file type '{kind}', {rule}"));
                }
            };
            Self::check(soup, scale)
        };
        read().map_err(refuse)
    }

    /// A mesh from vertices (m) and triangles (indices of their vertices, from 0).
    ///
    /// # Errors
    /// [`ContactError::Mesh`]: no triangle of non-zero area, a vertex that is not finite, an index out of range.
    pub fn from_triangles(vertices: Vec<Vector3<f64>>, triangles: Vec<[u32; 3]>) -> Result<Self, ContactError> {
        let refuse = |fault| ContactError::Mesh { owner: "from_triangles".into(), file: TRIANGLES.into(), fault };
        Self::check(Soup { vertices, triangles }, Vector3::repeat(1.0)).map_err(refuse)
    }

    fn check(soup: Soup, scale: Vector3<f64>) -> Result<Self, String> {
        if scale.iter().any(|s| *s == 0.0 || !s.is_finite()) {
            let [x, y, z]: [f64; 3] = scale.into();
            return Err(format!("has the scale ({x}, {y}, {z}): each factor must be finite and not zero"));
        }
        let scaled: Vec<_> = soup.vertices.iter().map(|v| v.component_mul(&scale)).collect();
        if let Some(index) = scaled.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
            let [x, y, z]: [f64; 3] = scaled[index].into();
            return Err(format!(
                "has a vertex ({x}, {y}, {z}) after scaling (vertex {index}, counted from 0): every coordinate must be finite"
            ));
        }
        let count = scaled.len();
        if let Some(bad) = soup.triangles.iter().flatten().find(|k| **k as usize >= count) {
            return Err(format!(
                "cannot be read: a triangle has the vertex {bad} (counted from 0), but there are {count} vertices"
            ));
        }
        let mut weld = Weld::default();
        let mut triangles = Vec::with_capacity(soup.triangles.len());
        for triangle in &soup.triangles {
            let [a, b, c] = triangle.map(|k| scaled[k as usize]);
            if (b - a).cross(&(c - a)).norm_squared() > 0.0 {
                triangles.push([a, b, c].map(|v| weld.index(v)));
            }
        }
        if triangles.is_empty() {
            return Err(no_triangles(soup.triangles.len()));
        }
        let mut mesh = Self { vertices: weld.vertices, triangles, closed: false };
        mesh.closed = mesh.is_watertight();
        if mesh.closed && mesh.volume() < 0.0 {
            mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        Ok(mesh)
    }

    /// The vertices, m; each position occurs once.
    pub fn vertices(&self) -> &[Vector3<f64>] {
        &self.vertices
    }

    /// The triangles: indices of three vertices each, counter-clockwise seen from outside if the mesh is closed.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Whether the mesh bounds a volume: every edge belongs to exactly two triangles, of the same orientation.
    #[doc(hidden)]
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    pub(crate) fn bounds(&self) -> (Vector3<f64>, Vector3<f64>) {
        let first = (self.vertices[0], self.vertices[0]);
        self.vertices.iter().fold(first, |(lower, upper), v| (lower.inf(v), upper.sup(v)))
    }

    fn is_watertight(&self) -> bool {
        let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
        for [a, b, c] in &self.triangles {
            for edge in [(*a, *b), (*b, *c), (*c, *a)] {
                *edges.entry(edge).or_default() += 1;
            }
        }
        edges.iter().all(|((a, b), count)| *count == 1 && edges.get(&(*b, *a)) == Some(&1))
    }

    /// Six times the enclosed volume.
    fn volume(&self) -> f64 {
        let at = |k: u32| self.vertices[k as usize];
        self.triangles.iter().map(|[a, b, c]| at(*a).dot(&at(*b).cross(&at(*c)))).sum()
    }
}

/// Merges vertices of equal position.
#[derive(Default)]
struct Weld {
    vertices: Vec<Vector3<f64>>,
    places: HashMap<[u64; 3], u32>,
}

impl Weld {
    fn index(&mut self, v: Vector3<f64>) -> u32 {
        // + 0.0 maps −0 to 0.
        let place: [u64; 3] = v.map(|x| (x + 0.0).to_bits()).into();
        *self.places.entry(place).or_insert_with(|| {
            self.vertices.push(v);
            self.vertices.len() as u32 - 1
        })
    }
}

fn stl(bytes: &[u8]) -> std::io::Result<Soup> {
    let mesh = stl_io::read_stl(&mut Cursor::new(bytes))?;
    let vertices = mesh.vertices.iter().map(|v| Vector3::from(v.0.map(f64::from))).collect();
    let triangles = mesh.faces.iter().map(|face| face.vertices.map(|k| k as u32)).collect();
    Ok(Soup { vertices, triangles })
}
