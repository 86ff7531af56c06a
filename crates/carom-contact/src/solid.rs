//! Convex bodies, each in its own axes.
//!
//! | symbol | size | meaning |
//! | --- | --- | --- |
//! | r | 1 | radius, m |
//! | l | 1 | half length of a cylinder or of a capsule's cylindrical part, m |
//! | h | 3 | half sides of a box, m |
//! | m | 3 | unit direction in the body's axes |
//!
//! Each body is a *core* with a skin of constant thickness: a sphere is a point with the skin r, a capsule a segment with
//! the skin r; the other bodies have no skin. The gap of two bodies is the signed distance of their cores minus the skins.

use crate::hull::Hull;
use nalgebra::Vector3;

/// A convex body, in its own axes: centred at the origin, its axis along z. (A hull is in the axes of its mesh.)
#[derive(Debug, Clone, PartialEq)]
pub enum Solid {
    /// A sphere.
    Sphere {
        /// Radius, m.
        radius: f64,
    },
    /// All points within `radius` of a segment along z.
    Capsule {
        /// Radius, m.
        radius: f64,
        /// Half length of the segment, m.
        half_length: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius, m.
        radius: f64,
        /// Half length, m.
        half_length: f64,
    },
    /// A box along the axes.
    Box {
        /// Half sides, m.
        half: Vector3<f64>,
    },
    /// The convex hull of a mesh, in the mesh's axes.
    Hull(Hull),
}

/// A point on which a body can rest: a corner of a box, an end of a capsule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Position in body axes, m; from [`crate::LinkShape::corners`] in link axes.
    pub position: Vector3<f64>,
    /// Radius of the sphere about it that belongs to the body, m; 0 for sharp corners.
    pub radius: f64,
}

/// Number of points that represent each rim of a cylinder in [`Solid::corners`].
const RIM: usize = 8;

/// The points that represent a rim of a cylinder, about its centre, the first on +x.
pub(crate) fn rim(radius: f64) -> impl Iterator<Item = Vector3<f64>> {
    let angle = |k: usize| k as f64 * std::f64::consts::TAU / RIM as f64;
    (0..RIM).map(angle).map(move |angle| Vector3::new(radius * angle.cos(), radius * angle.sin(), 0.0))
}

#[doc(hidden)]
impl Solid {
    /// The height m · x of the body's lowest point along the unit direction `m`, m, and that point, in body axes. Of several
    /// lowest points it is a fixed one: the corner towards the negative axes, a capsule's or cylinder's end at −z, the point
    /// of a rim on −x, a hull's first vertex.
    ///
    /// | body | height of the lowest point |
    /// | --- | --- |
    /// | sphere | −r |
    /// | capsule | −l \|m_z\| − r |
    /// | cylinder | −l \|m_z\| − r √(m_x² + m_y²) |
    /// | box | −Σ hᵢ \|mᵢ\| |
    /// | hull | min m · vᵢ over its vertices |
    pub fn lowest(&self, m: Vector3<f64>) -> (f64, Vector3<f64>) {
        match self {
            Self::Sphere { radius } => (-radius, -m * *radius),
            Self::Capsule { radius, half_length } => {
                let end = Vector3::new(0.0, 0.0, against(m.z, *half_length));
                (-half_length * m.z.abs() - radius, end - m * *radius)
            }
            _ => {
                let (core, _) = self.core();
                let point = core.support(-m);
                let height = match self {
                    // In one expression, so that the rounding error of the rim point's direction does not affect the height.
                    Self::Cylinder { radius, half_length } => -half_length * m.z.abs() - radius * m.x.hypot(m.y),
                    _ => m.dot(&point),
                };
                (height, point)
            }
        }
    }

    /// Centre (body axes) and radius of a sphere that contains the body, m.
    pub fn bounding_sphere(&self) -> (Vector3<f64>, f64) {
        match self {
            Self::Sphere { radius } => (Vector3::zeros(), *radius),
            Self::Capsule { radius, half_length } => (Vector3::zeros(), half_length + radius),
            Self::Cylinder { radius, half_length } => (Vector3::zeros(), half_length.hypot(*radius)),
            Self::Box { half } => (Vector3::zeros(), half.norm()),
            Self::Hull(hull) => hull.bounding_sphere(),
        }
    }

    /// The points on which the body can rest: a sphere's centre and a capsule's ends (with their radius), the corners of
    /// a box, the vertices of a hull. Eight points represent each rim of a cylinder, the first on +x; [`crate::gap`] computes
    /// the exact lowest point of a rim.
    pub fn corners(&self) -> Vec<Corner> {
        let sharp = |position| Corner { position, radius: 0.0 };
        match self {
            Self::Sphere { radius } => vec![Corner { position: Vector3::zeros(), radius: *radius }],
            Self::Capsule { radius, half_length } => {
                let end = |z| Corner { position: Vector3::new(0.0, 0.0, z), radius: *radius };
                vec![end(-half_length), end(*half_length)]
            }
            Self::Cylinder { radius, half_length } => {
                let at = |z: f64| rim(*radius).map(move |p| sharp(Vector3::new(p.x, p.y, z)));
                [-half_length, *half_length].into_iter().flat_map(at).collect()
            }
            Self::Box { half } => {
                let side = |bit: usize, h: f64| if bit == 0 { -h } else { h };
                let corner = |k: usize| Vector3::new(side(k & 1, half.x), side(k & 2, half.y), side(k & 4, half.z));
                (0..8).map(|k| sharp(corner(k))).collect()
            }
            Self::Hull(hull) => hull.vertices().iter().map(|v| sharp(*v)).collect(),
        }
    }

    /// Core and skin.
    pub(crate) fn core(&self) -> (Core<'_>, f64) {
        match self {
            Self::Sphere { radius } => (Core::Point, *radius),
            Self::Capsule { radius, half_length } => (Core::Segment(*half_length), *radius),
            Self::Cylinder { radius, half_length } => (Core::Cylinder { radius: *radius, half: *half_length }, 0.0),
            Self::Box { half } => (Core::Box(*half), 0.0),
            Self::Hull(hull) => (Core::Hull(hull), 0.0),
        }
    }
}

/// A body without its skin.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Core<'a> {
    /// The origin.
    Point,
    /// A segment along z, by its half length.
    Segment(f64),
    /// A box, by its half sides.
    Box(Vector3<f64>),
    /// A cylinder along z.
    Cylinder { radius: f64, half: f64 },
    /// The convex hull of a mesh.
    Hull(&'a Hull),
    /// The convex hull of some points; at least one.
    Points(&'a [Vector3<f64>]),
}

impl Core<'_> {
    /// The point furthest along `d` (any length). Of several furthest points it is a fixed one, see [`Solid::lowest`].
    pub fn support(&self, d: Vector3<f64>) -> Vector3<f64> {
        match *self {
            Self::Point => Vector3::zeros(),
            Self::Segment(half) => Vector3::new(0.0, 0.0, against(-d.z, half)),
            Self::Box(half) => d.zip_map(&half, |d, h| against(-d, h)),
            Self::Cylinder { radius, half } => {
                let z = against(-d.z, half);
                let across = d.x.hypot(d.y);
                // Parallel to the axis up to rounding: every rim point is equally far.
                if across <= 4.0 * f64::EPSILON * d.z.abs() {
                    return Vector3::new(-radius, 0.0, z);
                }
                Vector3::new(radius * d.x / across, radius * d.y / across, z)
            }
            Self::Hull(hull) => hull.support(d),
            Self::Points(points) => {
                let mut best = (f64::NEG_INFINITY, Vector3::zeros());
                for p in points {
                    let height = d.dot(p);
                    if height > best.0 {
                        best = (height, *p);
                    }
                }
                best.1
            }
        }
    }

    /// Whether the body's axes are normals of its faces, and so likely directions of greatest separation.
    pub fn has_axes(&self) -> bool {
        matches!(self, Self::Box(_) | Self::Cylinder { .. } | Self::Segment(_))
    }
}

/// `size` with the sign opposite to that of `m`; −`size` for zero of either sign.
fn against(m: f64, size: f64) -> f64 {
    if m < 0.0 { size } else { -size }
}
