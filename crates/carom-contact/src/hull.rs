//! The convex hull of a mesh.

use crate::mesh::Mesh;
use crate::parry;
use nalgebra::Vector3;

/// The convex hull of a mesh, by its corners. Its gap to a half-space is exactly that of the mesh; for other obstacles it
/// fills the concavities of the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Hull {
    vertices: Vec<Vector3<f64>>,
    centre: Vector3<f64>,
    radius: f64,
}

impl Hull {
    /// The hull of a mesh. A flat mesh, which has no volume, keeps all its vertices.
    pub fn of(mesh: &Mesh) -> Self {
        let vertices = parry::hull_vertices(mesh.vertices()).unwrap_or_else(|| mesh.vertices().to_vec());
        let (lower, upper) = mesh.bounds();
        let centre = (lower + upper) / 2.0;
        let radius = vertices.iter().map(|v| (v - centre).norm()).fold(0.0, f64::max);
        Self { vertices, centre, radius }
    }

    /// Its corners, in the mesh's axes, m.
    pub fn vertices(&self) -> &[Vector3<f64>] {
        &self.vertices
    }

    pub(crate) fn bounding_sphere(&self) -> (Vector3<f64>, f64) {
        (self.centre, self.radius)
    }
}
