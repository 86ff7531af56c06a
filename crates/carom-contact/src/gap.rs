//! The gap between two bodies: signed distance, normal, nearest points.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | g | signed distance, m; > 0 open, < 0 overlapping | [`Gap::distance`] |
//! | n | unit normal, from the environment to the robot | [`Gap::normal`] |
//! | a, b | nearest points of robot and environment; g = n·(a − b) | [`Gap::on_robot`], [`Gap::on_environment`] |
//!
//! Method for each pair (a sphere is a point, and a capsule a segment, with a skin of constant thickness):
//!
//! | | half-space | point | segment | box | cylinder | hull | mesh |
//! | --- | --- | --- | --- | --- | --- | --- | --- |
//! | point | closed form | closed form | closed form | closed form | closed form | search | search |
//! | segment | closed form | | closed form | closed form | search | search | search |
//! | box, cylinder, hull | closed form | | | search | search | search | search |
//!
//! Closed forms are exact to rounding; the search (`convex.rs`) is accurate to about 1e-14 of the bodies' size. The gap to a
//! mesh is the smallest gap to one of its triangles.

use crate::closed_form::{self, Nearest, Segment};
use crate::convex::{self, Placed};
use crate::obstacle::{Obstacle, Surface};
use crate::parry::{Bounds, Triangles};
use crate::shape::LinkShape;
use crate::solid::{Core, Solid};
use carom_chain::algebra::Pose;
use carom_chain::{ChainError, Kinematics, Point, Spatial};
use nalgebra::Vector3;

/// Signed distance, normal and nearest points of two bodies. World axes, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// Signed distance: > 0 for separate bodies; < 0 for overlapping ones, minus the shortest translation that separates
    /// them.
    pub distance: f64,
    /// Unit normal, from the environment to the robot.
    pub normal: Vector3<f64>,
    /// The robot's point nearest to the environment, or deepest in it.
    pub on_robot: Vector3<f64>,
    /// The environment's point nearest to the robot.
    pub on_environment: Vector3<f64>,
}

/// The gap between a shape of a link, whose frame is at `pose` in the world, and an obstacle.
///
/// d(gap)/dt = n · v, with v the velocity of the robot at [`Gap::on_robot`]; the rate of change of the normal does not occur
/// in it. If a whole edge or face is nearest, the points are a fixed choice on it ([`Solid::lowest`] for half-spaces);
/// [`gap_points`] returns all of its corners.
///
/// An open mesh is a surface with two sides. A closed mesh is solid: a body that lies completely inside has a negative gap,
/// measured from the body's centre.
pub fn gap(shape: &LinkShape, pose: &Pose<Spatial<f64>>, obstacle: &Obstacle) -> Gap {
    solid_gap(shape.solid(), &pose.then(shape.origin()), obstacle)
}

/// The contact point as a material point of the chain: that at [`Gap::on_robot`]. `kin.point_jacobian(point)` is the contact
/// Jacobian (3×nv, world axes), and `kin.add_point_force(point, normal, …)` adds its normal row.
pub fn contact_point(kin: &Kinematics<Spatial<f64>>, shape: &LinkShape, gap: &Gap) -> Point<Spatial<f64>> {
    let in_link = kin.pose(shape.frame).inverse().point(gap.on_robot);
    kin.chain().point(shape.frame, in_link)
}

/// The gap rate d(gap)/dt = n · J qd, m/s, for an obstacle at rest; < 0 for an approach. `qd` has length nv.
///
/// # Errors
/// [`ChainError::WrongLength`].
pub fn gap_rate(kin: &Kinematics<Spatial<f64>>, shape: &LinkShape, gap: &Gap, qd: &[f64]) -> Result<f64, ChainError> {
    Ok(gap.normal.dot(&kin.point_velocity(contact_point(kin, shape, gap), qd)?))
}

/// The gap between two shapes of links, each with the pose of its link's frame in the world. In [`Gap`] the first is the
/// robot and the second the environment: n points from the second to the first, and d(gap)/dt is n · the velocity of the
/// first relative to the second.
pub fn gap_between(shape: (&LinkShape, &Pose<Spatial<f64>>), other: (&LinkShape, &Pose<Spatial<f64>>)) -> Gap {
    let place = |(shape, pose): (&LinkShape, &Pose<Spatial<f64>>)| pose.then(shape.origin());
    solids(shape.0.solid(), &place(shape), other.0.solid(), &place(other))
}

/// The gaps of all corners ([`LinkShape::corners`]) that exceed the smallest of them by at most `tolerance` (m), in the
/// order of the corners. They are the contact points of a body that rests on a face or edge.
///
/// For a cylinder and a half-space, the gap of its exact lowest point comes first. Corners of the *obstacle* on a face of
/// the robot are not included.
pub fn gap_points(shape: &LinkShape, pose: &Pose<Spatial<f64>>, obstacle: &Obstacle, tolerance: f64) -> Vec<Gap> {
    let mut gaps = Vec::new();
    if matches!((shape.solid(), obstacle.surface()), (Solid::Cylinder { .. }, Surface::HalfSpace { .. })) {
        gaps.push(gap(shape, pose, obstacle));
    }
    let (centre, _) = shape.solid().bounding_sphere();
    let centre = pose.then(shape.origin()).point(centre);
    let open = obstacle.triangles().is_some_and(|triangles| !triangles.is_closed());
    for corner in shape.corners() {
        let place = Pose { rotation: pose.rotation, translation: pose.point(corner.position) };
        let mut found = solid_gap(&Solid::Sphere { radius: corner.radius }, &place, obstacle);
        // A point on an open mesh is on the side of its body.
        let on_mesh = open && found.distance.abs() <= ROUNDING * place.translation.amax().max(1.0);
        if on_mesh && found.normal.dot(&(centre - place.translation)) < 0.0 {
            found = Gap { distance: -found.distance, normal: -found.normal, ..found };
        }
        gaps.push(found);
    }
    let least = gaps.iter().map(|gap| gap.distance).fold(f64::INFINITY, f64::min);
    gaps.retain(|gap| gap.distance <= least + tolerance);
    gaps
}

pub(crate) fn solid_gap(solid: &Solid, pose: &Pose<Spatial<f64>>, obstacle: &Obstacle) -> Gap {
    match obstacle.surface() {
        Surface::HalfSpace { point, normal } => above_plane(solid, pose, point, normal),
        Surface::Solid { solid: other, .. } => solids(solid, pose, other, obstacle.pose()),
        Surface::Mesh { .. } => match obstacle.triangles() {
            Some(triangles) => above_mesh(solid, pose, triangles, obstacle.pose()),
            None => unreachable!("a mesh obstacle has triangles"),
        },
    }
}

/// g = n·(x − p) + (height along n of the body's lowest point, in body axes).
fn above_plane(solid: &Solid, pose: &Pose<Spatial<f64>>, point: &Vector3<f64>, normal: &Vector3<f64>) -> Gap {
    let (height, lowest) = solid.lowest(pose.rotation.tr_mul(normal));
    let distance = normal.dot(&(pose.translation - point)) + height;
    let on_robot = pose.point(lowest);
    Gap { distance, normal: *normal, on_robot, on_environment: on_robot - normal * distance }
}

/// The gap of two bodies: the signed distance of their cores minus the skins.
fn solids(a: &Solid, pose_a: &Pose<Spatial<f64>>, b: &Solid, pose_b: &Pose<Spatial<f64>>) -> Gap {
    let ((core_a, skin_a), (core_b, skin_b)) = (a.core(), b.core());
    let nearest = cores(&placed(core_a, a, pose_a), &placed(core_b, b, pose_b));
    with_skins(nearest, skin_a, skin_b)
}

fn with_skins(nearest: Nearest, skin_a: f64, skin_b: f64) -> Gap {
    let Nearest { distance, normal, a, b } = nearest;
    Gap {
        distance: distance - (skin_a + skin_b),
        normal,
        on_robot: a - normal * skin_a,
        on_environment: b + normal * skin_b,
    }
}

fn placed<'a>(core: Core<'a>, solid: &Solid, pose: &Pose<Spatial<f64>>) -> Placed<'a> {
    let (centre, radius) = solid.bounding_sphere();
    Placed { core, pose: *pose, radius: centre.norm() + radius }
}

/// The method of the table in the module's documentation.
fn cores(a: &Placed, b: &Placed) -> Nearest {
    use Core::{Box, Cylinder, Point, Segment as Line};
    let line = |placed: &Placed, half: f64, origin: &Vector3<f64>| Segment {
        middle: placed.pose.translation - origin,
        half: placed.pose.rotation.column(2) * half,
    };
    match (a.core, b.core) {
        (Point, Point) => Nearest::of_points(a.pose.translation, b.pose.translation),
        (Point, Line(half)) => closed_form::point_segment(a.pose.translation, &line(b, half, &Vector3::zeros())),
        (Line(half), Line(other)) => {
            let origin = &b.pose.translation;
            let nearest = closed_form::segment_segment(&line(a, half, origin), &line(b, other, origin));
            Nearest { a: nearest.a + origin, b: nearest.b + origin, ..nearest }
        }
        (Point, Box(half)) => in_axes_of(b, |p| closed_form::point_box(p(a.pose.translation), half)),
        (Point, Cylinder { radius, half }) => {
            in_axes_of(b, |p| closed_form::point_cylinder(p(a.pose.translation), radius, half))
        }
        (Line(length), Box(half)) => in_axes_of(b, |p| {
            let direction = b.pose.rotation.tr_mul(&a.pose.rotation.column(2));
            let segment = Segment { middle: p(a.pose.translation), half: direction * length };
            closed_form::segment_box(&segment, half)
        }),
        (Line(_), Point) | (Box(_) | Cylinder { .. }, Point) | (Box(_), Line(_)) => cores(b, a).swapped(),
        _ => convex::nearest(a, b),
    }
}

/// Calls `work` with the map from world points to the axes of `b`, and transforms the result back to world axes.
fn in_axes_of(b: &Placed, work: impl FnOnce(&dyn Fn(Vector3<f64>) -> Vector3<f64>) -> Nearest) -> Nearest {
    let nearest = work(&|p| b.pose.rotation.tr_mul(&(p - b.pose.translation)));
    Nearest {
        normal: b.pose.rotation * nearest.normal,
        a: b.pose.point(nearest.a),
        b: b.pose.point(nearest.b),
        ..nearest
    }
}

/// Error of a nearest point, relative to the coordinates.
const ROUNDING: f64 = 1e-14;

/// The smallest gap to the triangles of a mesh.
fn above_mesh(solid: &Solid, pose: &Pose<Spatial<f64>>, triangles: &Triangles, place: &Pose<Spatial<f64>>) -> Gap {
    let (core, skin) = solid.core();
    let body = placed(core, solid, &place.inverse().then(pose));
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let reach = |sign: f64| {
        let furthest = |k: usize| {
            let direction = axes[k] * sign;
            let support = body.pose.point(core.support(body.pose.rotation.tr_mul(&direction)));
            support[k] + sign * skin
        };
        Vector3::new(furthest(0), furthest(1), furthest(2))
    };
    let around = Bounds { lower: reach(-1.0), upper: reach(1.0) };
    let deepest = -2.0 * (body.radius + skin);
    let bound = |part: &Bounds| {
        let distance = around.distance(part);
        if distance > 0.0 { distance } else { deepest }
    };
    let least = triangles.least(bound, |corners| {
        let nearest = above_triangle(&body, &corners);
        (nearest.distance - skin, (nearest, corners))
    });
    let (mut nearest, corners) = match least {
        Some((_, found)) => found,
        None => unreachable!("a mesh has a triangle, and coordinates are finite"),
    };
    let (centre, _) = solid.bounding_sphere();
    let centre = body.pose.point(centre);
    if nearest.distance > 0.0
        && let Some((out, corners)) = triangles.way_out(centre)
    {
        let normal = (out - centre).try_normalize(0.0).unwrap_or(nearest.normal);
        let inside = Nearest { distance: -(out - centre).norm(), normal, a: centre, b: out };
        nearest = at_face(inside, &corners);
    } else if matches!(core, Core::Point) {
        nearest = at_face(nearest, &corners);
    }
    let local = with_skins(nearest, skin, 0.0);
    Gap {
        distance: local.distance,
        normal: place.rotation * local.normal,
        on_robot: place.point(local.on_robot),
        on_environment: place.point(local.on_environment),
    }
}

/// The nearest points with the normal of this triangle, if that is their direction up to rounding: near the surface the difference
/// of the points has no digits.
fn at_face(nearest: Nearest, corners: &[Vector3<f64>; 3]) -> Nearest {
    let Nearest { distance, a, b, .. } = nearest;
    let [p, q, r] = corners;
    let Some(face) = (q - p).cross(&(r - p)).try_normalize(0.0) else { return nearest };
    let size = a.amax().max(p.amax()).max(q.amax()).max(r.amax());
    let way = a - b;
    if (way - face * face.dot(&way)).norm() > ROUNDING * size {
        return nearest;
    }
    // Inside a closed mesh n is that of its triangles, which point outwards; outside of any it points to the body.
    let height = face.dot(&(a - p));
    let (distance, normal) = if distance > 0.0 && height < 0.0 { (-height, -face) } else { (height, face) };
    Nearest { distance, normal, a, b: a - normal * distance }
}

/// The distance to one triangle, computed relative to its centroid.
fn above_triangle(body: &Placed, corners: &[Vector3<f64>; 3]) -> Nearest {
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    let corners = corners.map(|corner| corner - middle);
    let radius = corners.iter().map(Vector3::norm).fold(0.0, f64::max);
    let pose = Pose { translation: middle, ..Pose::identity() };
    convex::nearest(body, &Placed { core: Core::Points(&corners), pose, radius })
}
