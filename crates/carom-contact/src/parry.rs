//! Wrapper of parry; no other module uses parry or its vectors.
//!
//! parry is used for convex hulls, for the bounding-volume hierarchy of a mesh's triangles, for whether a point is inside a
//! closed mesh, and for the first guess of the direction that separates overlapping bodies. Its distances are not used.
//! They are exact to rounding between polyhedra, but its search stops at a relative 5e-8: measured errors of the gaps of
//! cylinders are up to 2e-6 m, and of their normals up to 2e-3 (`tests/against_parry.rs`).

use nalgebra::Vector3;
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::query::details::contact_support_map_support_map;
use parry3d_f64::query::gjk::ConstantOrigin;
use parry3d_f64::shape::{SupportMap, TriMesh, TriMeshFlags};
use parry3d_f64::transformation::try_convex_hull;

fn out(v: Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

fn back(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

/// The corners of a body, and its triangles by them.
type Corners = (Vec<Vector3<f64>>, Vec<[u32; 3]>);

/// The corners and triangles of the convex hull; `None` if the points are (nearly) coplanar.
pub(crate) fn convex_hull(points: &[Vector3<f64>]) -> Option<Corners> {
    let points: Vec<Vector> = points.iter().map(|p| out(*p)).collect();
    let (vertices, triangles) = try_convex_hull(&points).ok()?;
    Some((vertices.into_iter().map(back).collect(), triangles))
}

/// The approximate direction, from B to A, of the shortest translation that separates A from B, by the expanding-polytope
/// algorithm. `furthest` returns the furthest point of A − B along a direction.
pub(crate) fn way_out_of(furthest: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Option<Vector3<f64>> {
    struct Difference<F>(F);
    impl<F: Fn(Vector3<f64>) -> Vector3<f64>> SupportMap for Difference<F> {
        fn local_support_point(&self, direction: Vector) -> Vector {
            out((self.0)(back(direction)))
        }
    }
    let contact = contact_support_map_support_map(&Pose::IDENTITY, &Difference(furthest), &ConstantOrigin, f64::MAX)?;
    Some(-back(contact.normal1))
}

/// An axis-aligned box.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    pub lower: Vector3<f64>,
    pub upper: Vector3<f64>,
}

impl Bounds {
    /// Distance of two boxes; 0 if they overlap.
    pub fn distance(&self, other: &Self) -> f64 {
        let between = (self.lower - other.upper).sup(&(other.lower - self.upper));
        between.sup(&Vector3::zeros()).norm()
    }
}

/// The triangles of a mesh, with a bounding-volume hierarchy.
#[derive(Debug, Clone)]
pub(crate) struct Triangles {
    mesh: TriMesh,
    closed: bool,
}

impl Triangles {
    /// `closed`: the triangles bound a volume and are oriented outwards. `None` if parry refuses them.
    pub fn new(vertices: &[Vector3<f64>], triangles: &[[u32; 3]], closed: bool) -> Option<Self> {
        let flags = if closed { TriMeshFlags::ORIENTED } else { TriMeshFlags::empty() };
        let vertices = vertices.iter().map(|v| out(*v)).collect();
        Some(Self { mesh: TriMesh::with_flags(vertices, triangles.to_vec(), flags).ok()?, closed })
    }

    /// The smallest value of `gap` over all triangles, with the data returned for it. `bound` is a lower bound of `gap` for
    /// all triangles in a box.
    pub fn least<T>(
        &self,
        bound: impl Fn(&Bounds) -> f64,
        gap: impl Fn([Vector3<f64>; 3]) -> (f64, T),
    ) -> Option<(f64, T)> {
        let lower = |aabb: parry3d_f64::bounding_volume::Aabb| {
            bound(&Bounds { lower: back(aabb.mins), upper: back(aabb.maxs) })
        };
        let found = self.mesh.bvh().find_best(
            f64::MAX,
            |node, _| lower(node.aabb()),
            |triangle, _| {
                let t = self.mesh.triangle(triangle);
                Some(gap([back(t.a), back(t.b), back(t.c)]))
            },
        );
        found.map(|(_, least)| least)
    }

    /// Whether the triangles bound a volume.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// The nearest point of a closed mesh's surface, and the corners of its triangle, if `point` is inside.
    pub fn way_out(&self, point: Vector3<f64>) -> Option<(Vector3<f64>, [Vector3<f64>; 3])> {
        if !self.closed {
            return None;
        }
        let (nearest, (triangle, _)) = self.mesh.project_local_point_and_get_location(out(point), false);
        let t = self.mesh.triangle(triangle);
        nearest.is_inside.then(|| (back(nearest.point), [t.a, t.b, t.c].map(back)))
    }
}
