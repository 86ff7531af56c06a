//! The convex hull of a mesh.

use crate::mesh::Mesh;
use crate::parry;
use nalgebra::Vector3;

/// The convex hull of a mesh, by its corners. Its gap to a half-space is exactly that of the mesh; for other obstacles it
/// fills the concavities of the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Hull {
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
    centre: Vector3<f64>,
    radius: f64,
}

impl Hull {
    /// The hull of a mesh. A flat mesh, which has no volume, keeps all its vertices.
    pub fn of(mesh: &Mesh) -> Self {
        let (vertices, triangles) =
            parry::convex_hull(mesh.vertices()).unwrap_or_else(|| (mesh.vertices().to_vec(), Vec::new()));
        let (lower, upper) = mesh.bounds();
        let centre = (lower + upper) / 2.0;
        let radius = vertices.iter().map(|v| (v - centre).norm()).fold(0.0, f64::max);
        Self { vertices, triangles, centre, radius }
    }

    /// Its corners, in the mesh's axes, m.
    pub fn vertices(&self) -> &[Vector3<f64>] {
        &self.vertices
    }

    /// Its triangles, by their corners, anticlockwise from outside; none for a flat mesh.
    pub(crate) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    pub(crate) fn bounding_sphere(&self) -> (Vector3<f64>, f64) {
        (self.centre, self.radius)
    }
}
