//! The convex hull of a mesh.
//!
//! The furthest corner along a direction is looked for among leaves, groups of near corners: those whose sphere does not reach as far as a corner
//! that was found are left out. So of n corners only the n/16 spheres and the corners of few leaves are examined.

use crate::mesh::Mesh;
use crate::parry;
use nalgebra::Vector3;

/// The convex hull of a mesh, by its corners. Its gap to a half-space is exactly that of the mesh; for other obstacles it
/// fills the concavities of the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Hull {
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
    leaves: Vec<Leaf>,
    centre: Vector3<f64>,
    radius: f64,
}

/// Near corners with their indices, and a sphere around them.
#[derive(Debug, Clone, PartialEq)]
struct Leaf {
    centre: Vector3<f64>,
    radius: f64,
    corners: Vec<(Vector3<f64>, usize)>,
}

/// Corners of a leaf at most: of some hundred corners as many as there are spheres, so that neither costs much more than the other.
const LEAF: usize = 16;

impl Leaf {
    /// Adds the leaves of these corners: halves along their longest extent.
    fn divide(mut corners: Vec<(Vector3<f64>, usize)>, leaves: &mut Vec<Self>) {
        let Some((first, _)) = corners.first() else { return };
        let (lower, upper) =
            corners.iter().fold((*first, *first), |(lower, upper), (v, _)| (lower.inf(v), upper.sup(v)));
        if corners.len() > LEAF {
            let along = (upper - lower).imax();
            corners.sort_by(|(a, _), (b, _)| a[along].total_cmp(&b[along]));
            let rest = corners.split_off(corners.len() / 2);
            Self::divide(corners, leaves);
            return Self::divide(rest, leaves);
        }
        let centre = (lower + upper) / 2.0;
        let radius = corners.iter().map(|(v, _)| (v - centre).norm()).fold(0.0, f64::max);
        // With the rounding of the heights that are compared.
        let radius = radius + 8.0 * f64::EPSILON * (centre.norm() + radius);
        leaves.push(Self { centre, radius, corners });
    }
}

impl Hull {
    /// The hull of a mesh. A flat mesh, which has no volume, keeps all its vertices.
    pub fn of(mesh: &Mesh) -> Self {
        let (vertices, triangles) =
            parry::convex_hull(mesh.vertices()).unwrap_or_else(|| (mesh.vertices().to_vec(), Vec::new()));
        let (lower, upper) = mesh.bounds();
        Self::with(vertices, triangles, (lower + upper) / 2.0)
    }

    fn with(vertices: Vec<Vector3<f64>>, triangles: Vec<[u32; 3]>, centre: Vector3<f64>) -> Self {
        let radius = vertices.iter().map(|v| (v - centre).norm()).fold(0.0, f64::max);
        let mut leaves = Vec::new();
        Leaf::divide(vertices.iter().copied().zip(0..).collect(), &mut leaves);
        Self { vertices, triangles, leaves, centre, radius }
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

    /// The corner furthest along `d` (any length), of several ones the first.
    pub(crate) fn support(&self, d: Vector3<f64>) -> Vector3<f64> {
        let size = d.norm();
        let reach = |leaf: &Leaf| d.dot(&leaf.centre) + size * leaf.radius;
        let (mut furthest, mut most) = (0, f64::NEG_INFINITY);
        for (k, leaf) in self.leaves.iter().enumerate() {
            let reach = reach(leaf);
            if reach > most {
                (furthest, most) = (k, reach);
            }
        }
        let (mut best, mut height, mut index) = (Vector3::zeros(), f64::NEG_INFINITY, usize::MAX);
        let mut look = |leaf: &Leaf| {
            for (corner, k) in &leaf.corners {
                let own = d.dot(corner);
                if own > height || own == height && *k < index {
                    (best, height, index) = (*corner, own, *k);
                }
            }
            height
        };
        let Some(first) = self.leaves.get(furthest) else { return best };
        let mut least = look(first);
        for (k, leaf) in self.leaves.iter().enumerate() {
            if k != furthest && reach(leaf) >= least {
                least = look(leaf);
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The furthest corner is that of all corners, bit by bit: of grids, whose corners are equally far along axes, and of points on a
    /// sphere; along axes, diagonals and other directions of any length.
    #[test]
    fn the_furthest_corner_is_that_of_all_corners() {
        let along = |k: usize| {
            let x = k as f64;
            Vector3::new((1.3 * x).sin(), (2.1 * x + 0.4).cos(), (0.7 * x + 2.0).sin())
        };
        let grid = |n: usize| {
            (0..n.pow(3)).map(move |k| Vector3::new(k % n, k / n % n, k / (n * n)).map(|x: usize| x as f64 - 2.0))
        };
        let sphere = |n: usize| (0..n).map(move |k| along(k).normalize() * 0.3 + Vector3::new(1e3, 0.0, -5.0));
        let bodies: Vec<Vec<Vector3<f64>>> =
            vec![grid(2).collect(), grid(5).collect(), grid(9).collect(), sphere(17).collect(), sphere(1000).collect()];
        let axes = [-1.0, 0.0, 1.0].map(|x| [-1.0, 0.0, 1.0].map(|y| [-1.0, 0.0, 1.0].map(|z| Vector3::new(x, y, z))));
        for vertices in bodies {
            let hull = Hull::with(vertices.clone(), Vec::new(), Vector3::zeros());
            let directions = axes.as_flattened().as_flattened().iter().copied();
            for d in directions.chain((0..300).map(|k| along(7 * k + 1) * 10_f64.powi(k as i32 % 9 - 4))) {
                let mut first = (f64::NEG_INFINITY, Vector3::zeros());
                vertices.iter().for_each(|v| {
                    if d.dot(v) > first.0 {
                        first = (d.dot(v), *v)
                    }
                });
                assert_eq!(hull.support(d), first.1, "{d} of {} corners", vertices.len());
            }
        }
    }
}
