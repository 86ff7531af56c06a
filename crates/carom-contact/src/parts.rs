//! The corners, edges, faces and rims of a convex body: the parts at which two bodies touch.
//!
//! A polyhedron touches with corners, edges and faces; a capsule with its two balls and its round side, an edge with a radius; a
//! cylinder with its rims, its round side and its caps.

use crate::hull::Hull;
use crate::obstacle::{Obstacle, Surface};
use crate::shape::LinkShape;
use crate::solid::{Solid, rim};
use carom_chain::Spatial;
use carom_chain::algebra::Pose;
use nalgebra::Vector3;

/// Polyhedra with more edges than this are not divided: their pairs with other bodies than half-spaces have too many parts.
const MANY_EDGES: usize = 64;
/// Triangles of a hull whose unit normals differ by at most this are one face: the rounding of files in single precision.
const COPLANAR: f64 = 1e-6;

/// The parts of a convex body, in the axes of its link, or of the world for an obstacle.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Parts {
    pub(crate) corners: Vec<CornerPart>,
    pub(crate) edges: Vec<EdgePart>,
    pub(crate) faces: Vec<FacePart>,
    pub(crate) rims: Vec<RimPart>,
    /// Position and radius of every corner that is not of a rim, together in memory for the search of the lowest one.
    pub(crate) outline: Vec<(Vector3<f64>, f64)>,
    /// The largest distance of a corner from the middle of all, m; 0 without corners.
    pub(crate) size: f64,
}

/// A corner, or the ball at the end of a capsule.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CornerPart {
    pub position: Vector3<f64>,
    pub radius: f64,
    pub kind: CornerKind,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum CornerKind {
    /// A ball: it touches in every direction.
    Ball,
    /// The unit directions of the edges that end in it.
    Sharp(Vec<Vector3<f64>>),
    /// A fixed point of a rim, with the outward axis of its cap: it touches where the cap lies on a face.
    OfRim(Vector3<f64>),
}

/// An edge of a polyhedron, or the axis of a round side.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct EdgePart {
    pub middle: Vector3<f64>,
    /// Unit vector.
    pub along: Vector3<f64>,
    pub half_length: f64,
    pub radius: f64,
    /// The two faces that meet in a sharp edge.
    pub beside: Option<[Beside; 2]>,
}

/// A face beside an edge: its outward unit normal, and the unit direction in it that points away from the edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Beside {
    pub normal: Vector3<f64>,
    pub inward: Vector3<f64>,
}

/// A face: outward unit normal, a point, and what bounds it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FacePart {
    pub normal: Vector3<f64>,
    pub point: Vector3<f64>,
    pub bounds: Bounds,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Bounds {
    /// A half-space.
    None,
    /// The other faces of a polyhedron: outward normal n and height n · x.
    Planes(Vec<(Vector3<f64>, f64)>),
    /// The cap of a cylinder, centred at the face's point, with the cylinder's length.
    Disc { radius: f64, length: f64 },
}

/// The rim of a cylinder: centre, outward axis of its cap, radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RimPart {
    pub centre: Vector3<f64>,
    pub axis: Vector3<f64>,
    pub radius: f64,
}

/// A part by its kind and index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// A corner, or the ball at an end of a capsule.
    Corner(usize),
    /// An edge, or a round side.
    Edge(usize),
    /// A face, or the cap of a cylinder.
    Face(usize),
    /// A rim of a cylinder.
    Rim(usize),
}

impl std::fmt::Display for Part {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (name, k) = match self {
            Self::Corner(k) => ("corner", k),
            Self::Edge(k) => ("edge", k),
            Self::Face(k) => ("face", k),
            Self::Rim(k) => ("rim", k),
        };
        write!(f, "{name} {}", k + 1)
    }
}

impl Parts {
    /// The parts of a link's shape, in the axes of the link's frame; `None` for a sphere, which touches at one point, and for
    /// hulls with more than 64 edges.
    pub fn of_shape(shape: &LinkShape) -> Option<Self> {
        Some(Self::of_solid(shape.solid())?.moved(shape.origin()).outlined())
    }

    /// The corners of a link's shape without its edges and faces, in the axes of the link's frame: enough for half-spaces.
    pub fn corners_of_shape(shape: &LinkShape) -> Self {
        if let Some(parts) = Self::of_shape(shape) {
            return parts;
        }
        let corner = |corner: crate::solid::Corner| CornerPart {
            position: corner.position,
            radius: corner.radius,
            kind: CornerKind::Ball,
        };
        Self { corners: shape.corners().into_iter().map(corner).collect(), ..Self::default() }.outlined()
    }

    /// The parts of an obstacle, world axes; `None` for spheres, meshes and hulls with more than 64 edges.
    pub fn of_obstacle(obstacle: &Obstacle) -> Option<Self> {
        match obstacle.surface() {
            Surface::HalfSpace { point, normal } => {
                let face = FacePart { normal: *normal, point: *point, bounds: Bounds::None };
                Some(Self { faces: vec![face], ..Self::default() })
            }
            Surface::Solid { solid, .. } => Some(Self::of_solid(solid)?.moved(obstacle.pose()).outlined()),
            Surface::Mesh { .. } => None,
        }
    }

    fn outlined(mut self) -> Self {
        let corners = self.corners.iter().filter(|corner| !matches!(corner.kind, CornerKind::OfRim(_)));
        self.outline = corners.map(|corner| (corner.position, corner.radius)).collect();
        let middle =
            self.corners.iter().map(|corner| corner.position).sum::<Vector3<f64>>() / self.corners.len() as f64;
        let far = self.corners.iter().map(|corner| (corner.position - middle).norm() + corner.radius);
        self.size = far.fold(0.0, f64::max);
        self
    }

    /// Whether there are rims among them.
    pub fn has_rims(&self) -> bool {
        !self.rims.is_empty()
    }

    fn of_solid(solid: &Solid) -> Option<Self> {
        match solid {
            Solid::Sphere { .. } => None,
            Solid::Capsule { radius, half_length } => {
                let corner =
                    |z| CornerPart { position: Vector3::new(0.0, 0.0, z), radius: *radius, kind: CornerKind::Ball };
                let corners = vec![corner(-half_length), corner(*half_length)];
                Some(Self { corners, edges: vec![round_side(*radius, *half_length)], ..Self::default() })
            }
            Solid::Cylinder { radius, half_length } => Some(Self::of_cylinder(*radius, *half_length)),
            Solid::Box { half } => Some(Self::of_box(*half)),
            Solid::Hull(hull) => Self::of_hull(hull),
        }
    }

    fn of_cylinder(radius: f64, half_length: f64) -> Self {
        let mut parts = Self { edges: vec![round_side(radius, half_length)], ..Self::default() };
        for side in [-1.0, 1.0] {
            let axis = Vector3::z() * side;
            let centre = axis * half_length;
            parts.rims.push(RimPart { centre, axis, radius });
            let bounds = Bounds::Disc { radius, length: 2.0 * half_length };
            parts.faces.push(FacePart { normal: axis, point: centre, bounds });
            let corner = |p| CornerPart { position: centre + p, radius: 0.0, kind: CornerKind::OfRim(axis) };
            parts.corners.extend(rim(radius).map(corner));
        }
        parts
    }

    fn of_box(half: Vector3<f64>) -> Self {
        let axis = |k: usize| Vector3::from_fn(|i, _| if i == k { 1.0 } else { 0.0 });
        let mut parts = Self::default();
        for k in 0..8 {
            let side = Vector3::from_fn(|i, _| if k >> i & 1 == 0 { -1.0 } else { 1.0 });
            let edges = (0..3).map(|i| axis(i) * -side[i]).collect();
            let position = side.component_mul(&half);
            parts.corners.push(CornerPart { position, radius: 0.0, kind: CornerKind::Sharp(edges) });
        }
        let planes: Vec<(Vector3<f64>, f64)> = (0..3).flat_map(|k| [(-axis(k), half[k]), (axis(k), half[k])]).collect();
        parts.faces = faces(&planes);
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
                let (n, m) = (axis(i) * a, axis(j) * b);
                let beside = Some([Beside { normal: n, inward: -m }, Beside { normal: m, inward: -n }]);
                let middle = n * half[i] + m * half[j];
                parts.edges.push(EdgePart { middle, along: axis(k), half_length: half[k], radius: 0.0, beside });
            }
        }
        parts
    }

    /// Triangles in one plane are one face; an edge is a side of two triangles of different faces.
    fn of_hull(hull: &Hull) -> Option<Self> {
        let vertices = hull.vertices();
        let mut planes: Vec<(Vector3<f64>, f64)> = Vec::new();
        let mut sides = std::collections::BTreeMap::<(u32, u32), Vec<usize>>::new();
        for triangle in hull.triangles() {
            // A face has three edges at least, and an edge two faces.
            if planes.len() > MANY_EDGES {
                return None;
            }
            let [a, b, c] = triangle.map(|k| vertices[k as usize]);
            let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
            let known = planes.iter().position(|(n, _)| (n - normal).norm() <= COPLANAR);
            let plane = known.unwrap_or_else(|| {
                planes.push((normal, normal.dot(&a)));
                planes.len() - 1
            });
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let (i, j) = (triangle[i], triangle[j]);
                sides.entry((i.min(j), i.max(j))).or_default().push(plane);
            }
        }
        let sharp = |planes: &Vec<usize>| matches!(planes.as_slice(), [f, g] if f != g);
        let edges: Vec<_> = sides.iter().filter(|(_, planes)| sharp(planes)).collect();
        if edges.is_empty() || edges.len() > MANY_EDGES {
            return None;
        }
        let mut parts = Self { faces: faces(&planes), ..Self::default() };
        let mut ends = vec![Vec::new(); vertices.len()];
        for ((i, j), of) in edges {
            let (a, b) = (vertices[*i as usize], vertices[*j as usize]);
            let along = (b - a).try_normalize(0.0)?;
            ends[*i as usize].push(along);
            ends[*j as usize].push(-along);
            let own = [planes[of[0]].0, planes[of[1]].0];
            // Away from the edge in a face is into the half-space of the other face.
            let inward = |k: usize| {
                let across = own[k].cross(&along);
                if across.dot(&own[1 - k]) > 0.0 { -across } else { across }
            };
            let beside = [0, 1].map(|k| Beside { normal: own[k], inward: inward(k) });
            let (middle, half_length) = ((a + b) / 2.0, (b - a).norm() / 2.0);
            parts.edges.push(EdgePart { middle, along, half_length, radius: 0.0, beside: Some(beside) });
        }
        for (vertex, edges) in vertices.iter().zip(ends).filter(|(_, edges)| !edges.is_empty()) {
            parts.corners.push(CornerPart { position: *vertex, radius: 0.0, kind: CornerKind::Sharp(edges) });
        }
        Some(parts)
    }

    /// The same parts in the axes in which the body's axes have this pose.
    fn moved(mut self, pose: &Pose<Spatial<f64>>) -> Self {
        let turn = |v: &mut Vector3<f64>| *v = pose.rotation * *v;
        let shift = |p: &mut Vector3<f64>| *p = pose.point(*p);
        for corner in &mut self.corners {
            shift(&mut corner.position);
            match &mut corner.kind {
                CornerKind::Ball => {}
                CornerKind::Sharp(edges) => edges.iter_mut().for_each(turn),
                CornerKind::OfRim(axis) => turn(axis),
            }
        }
        for edge in &mut self.edges {
            shift(&mut edge.middle);
            turn(&mut edge.along);
            for face in edge.beside.iter_mut().flatten() {
                turn(&mut face.normal);
                turn(&mut face.inward);
            }
        }
        for face in &mut self.faces {
            turn(&mut face.normal);
            shift(&mut face.point);
            if let Bounds::Planes(planes) = &mut face.bounds {
                for (normal, height) in planes {
                    turn(normal);
                    *height += normal.dot(&pose.translation);
                }
            }
        }
        for rim in &mut self.rims {
            shift(&mut rim.centre);
            turn(&mut rim.axis);
        }
        self
    }
}

fn round_side(radius: f64, half_length: f64) -> EdgePart {
    EdgePart { middle: Vector3::zeros(), along: Vector3::z(), half_length, radius, beside: None }
}

/// The faces of a polyhedron: each is bounded by all others.
fn faces(planes: &[(Vector3<f64>, f64)]) -> Vec<FacePart> {
    let face = |k: usize| {
        let (normal, height) = planes[k];
        let others = planes.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, plane)| *plane).collect();
        FacePart { normal, point: normal * height, bounds: Bounds::Planes(others) }
    };
    (0..planes.len()).map(face).collect()
}
