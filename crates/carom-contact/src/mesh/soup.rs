//! The triangles of a file as they are read, before they are checked.

use super::polygon;
use nalgebra::Vector3;

/// The contents of a file, before they are checked.
#[derive(Debug, Default)]
pub(super) struct Soup {
    pub vertices: Vec<Vector3<f64>>,
    pub triangles: Vec<[u32; 3]>,
}

impl Soup {
    /// The triangles of a polygon, convex or not.
    pub fn add_polygon(&mut self, corners: &[u32]) {
        self.triangles.extend(polygon::triangles(&self.vertices, corners));
    }

    /// A fan of triangles about its first corner.
    pub fn add_fan(&mut self, corners: &[u32]) {
        self.triangles.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
    }
}
