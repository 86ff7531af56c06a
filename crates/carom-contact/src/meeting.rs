//! The contacts between parts of two bodies: gap, normal, contact points, and their rates, in closed form.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | g, n | gap; unit normal from the second body to the first | [`Gap`] |
//! | a, b | contact points of the first and the second body, g = n·(a − b) | |
//! | r, r′ | radii of a ball or round side of the first and the second body | |
//! | ω, ω′ | angular velocities of the bodies | |
//! | u | velocity of the first body's material point at a relative to that of the second at b | |
//! | α, β | velocities of a and b on their bodies | [`Slide`] |
//!
//! Two polyhedra in contact touch at corners on faces and at crossings of edges: these are the corners of the area or line in
//! which they touch. The pairs of parts are
//!
//! | first | second | n | gap |
//! | --- | --- | --- | --- |
//! | corner or ball | face | normal of the face | n·(c − p) − r |
//! | rim | face | normal of the face | n·(c − R m − p), m the unit vector of n − (n·k) k |
//! | edge or round side | edge or round side | e × e′ | n·(x − x′) − r − r′ |
//! | rim | edge, r′ = 0 | t × e′, t the tangent of the rim | n·(c + R m − x′) |
//! | corner or ball | edge or round side, r + r′ > 0 | from the axis to c | distance − r − r′ |
//! | corner or ball | corner or ball, r + r′ > 0 | from c′ to c | distance − r − r′ |
//!
//! with the centre c of the ball or rim, its axis k and radius R, a point p of the face, and points x, x′ of edges with
//! the unit vectors e, e′. Each pair is a contact only within the [margin](Met::margin) of its parts: on the face, between
//! the ends of the edges. The points move on the bodies, and n turns, with rates that follow from ω, ω′ and u where g = 0
//! and ġ = 0: for instance, a point on a face has ṅ = ω′ × n.
//!
//! A rim meets an edge at up to two points, for instance where its cap lies on the edge: they are two contacts. The two rims of a
//! cylinder that lies along an edge touch it at one point each.
//!
//! Not included: a rim against a round side or another rim. [`crate::gap`] sees these, too.

use crate::gap::Gap;
use crate::parts::{Bounds, CornerKind, CornerPart, EdgePart, FacePart, Part, Parts, RimPart};
use carom_chain::Spatial;
use carom_chain::algebra::Pose;
use nalgebra::Vector3;

/// A contact between a part of the robot and a part of the environment (an obstacle or another link).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Meeting {
    own: Part,
    other: Part,
    /// Of a rim and an edge: the crossing with the greater coordinate along the edge.
    upper: bool,
}

/// A [`Meeting`] at one pose of both bodies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Met {
    /// Gap, normal and contact points, as if faces and edges had no end. An infinite gap: there is no such point (parallel edges,
    /// a rim that lies on the face).
    pub gap: Gap,
    /// How far the contact point is inside the faces and edges, as a share of the size of the smaller body; there is no contact where it is
    /// below −[`Met::OUTSIDE`].
    pub margin: f64,
}

/// `rim 1 on edge 2`, and for the upper crossing `rim 1 on edge 2 again`.
impl std::fmt::Display for Meeting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} on {}{}", self.own, self.other, if self.upper { " again" } else { "" })
    }
}

impl Met {
    /// Contact points up to this share of the size of the smaller body outside of a face or edge still count.
    pub const OUTSIDE: f64 = 1e-9;

    /// Whether the parts face each other: otherwise their gap means nothing.
    pub fn counts(&self) -> bool {
        self.margin >= -Self::OUTSIDE
    }
}

/// Velocities of the contact points on their bodies, and rate of the normal; world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slide {
    /// ṅ, 1/s; n from the environment to the robot.
    pub normal_rate: Vector3<f64>,
    /// Velocity of the contact point relative to the robot's material, m/s.
    pub on_robot: Vector3<f64>,
    /// The same relative to the environment's.
    pub on_environment: Vector3<f64>,
}

/// The parts of a body, and its pose.
pub type Placed<'a> = (&'a Parts, &'a Pose<Spatial<f64>>);

/// Sine of the angle by which a part may face away from the other body's normal and still be examined. It excludes parts on
/// other sides of the body; a part that faces away by less has a larger gap than its neighbour.
const AWAY: f64 = 0.1;
/// Sine of the angle between the axis of a cap and the normal of a face up to which the cap lies on it.
const FLAT: f64 = 1e-9;
/// Sine of the angle up to which edges are parallel: they have no crossing.
const PARALLEL: f64 = 1e-6;
/// A point that is below a face by more than this times its distance to another face has come through the other.
const DEEPER: f64 = 10.0;
/// Newton's method for the point of a rim converges in a few steps.
const NEWTON: usize = 30;
/// Its residual, as a share of the radius.
const CLOSE: f64 = 1e-15;
/// A point of a rim further than this from the crossing that it begins at is another one, rad.
const TURNED: f64 = 0.7;
/// The margin of parts that do not face each other.
const NOWHERE: f64 = f64::NEG_INFINITY;

/// A contact in the order of the table in the module's documentation.
struct Local {
    distance: f64,
    normal: Vector3<f64>,
    /// a.
    point: Vector3<f64>,
    margin: f64,
}

impl Meeting {
    /// All contacts between parts of two bodies.
    pub fn all(own: &Parts, other: &Parts) -> Vec<Self> {
        let mut all = Vec::new();
        let corners = |parts: &Parts| (0..parts.corners.len()).map(Part::Corner).collect::<Vec<_>>();
        let edges = |parts: &Parts| (0..parts.edges.len()).map(Part::Edge).collect::<Vec<_>>();
        let faces = |parts: &Parts| (0..parts.faces.len()).map(Part::Face).collect::<Vec<_>>();
        let rims = |parts: &Parts| (0..parts.rims.len()).map(Part::Rim).collect::<Vec<_>>();
        let mut add = |firsts: Vec<Part>, seconds: Vec<Part>| {
            for own in firsts {
                all.extend(seconds.iter().map(|&other| Self { own, other, upper: false }));
            }
        };
        add(corners(own), faces(other));
        add(faces(own), corners(other));
        add(rims(own), faces(other));
        add(faces(own), rims(other));
        add(edges(own), edges(other));
        add(corners(own), edges(other));
        add(edges(own), corners(other));
        add(corners(own), corners(other));
        add(rims(own), edges(other));
        add(edges(own), rims(other));
        let crosses =
            |it: &&Self| matches!((it.own, it.other), (Part::Rim(_), Part::Edge(_)) | (Part::Edge(_), Part::Rim(_)));
        let upper: Vec<Self> = all.iter().filter(crosses).map(|it| Self { upper: true, ..*it }).collect();
        all.extend(upper);
        all.retain(|meeting| meeting.is_possible(own, other));
        all
    }

    /// Whether these contacts include every way in which the two bodies can touch at points.
    pub fn are_complete(own: &Parts, other: &Parts) -> bool {
        let flat = |parts: &Parts| parts.edges.iter().all(|edge| edge.radius == 0.0) && parts.rims.is_empty();
        (own.rims.is_empty() || flat(other)) && (other.rims.is_empty() || flat(own))
    }

    /// Sharp parts do not meet each other, and points of a rim only faces.
    fn is_possible(&self, own: &Parts, other: &Parts) -> bool {
        let radius = |parts: &Parts, part: Part| match part {
            Part::Corner(k) => match parts.corners[k].kind {
                CornerKind::OfRim(_) => None,
                _ => Some(parts.corners[k].radius),
            },
            Part::Edge(k) => Some(parts.edges[k].radius),
            _ => Some(0.0),
        };
        match (self.own, self.other) {
            (Part::Corner(_), Part::Corner(_) | Part::Edge(_)) | (Part::Edge(_), Part::Corner(_)) => {
                radius(own, self.own).zip(radius(other, self.other)).is_some_and(|(r, s)| r + s > 0.0)
            }
            (Part::Rim(_), Part::Edge(_)) => radius(other, self.other) == Some(0.0),
            (Part::Edge(_), Part::Rim(_)) => radius(own, self.own) == Some(0.0),
            _ => true,
        }
    }

    /// The part of the robot.
    pub fn own(&self) -> Part {
        self.own
    }

    /// The part of the environment.
    pub fn other(&self) -> Part {
        self.other
    }

    /// Whether the environment's part is the first in the table of the module's documentation.
    fn swapped(&self) -> bool {
        matches!((self.own, self.other), (Part::Face(_), _) | (Part::Edge(_), Part::Corner(_) | Part::Rim(_)))
    }

    /// Gap, normal and contact points at the poses of both bodies.
    pub fn at(&self, own: Placed, other: Placed) -> Met {
        let (mine, others) = ((self.own, own), (self.other, other));
        let swapped = self.swapped();
        let (first, second) = if swapped { (others, mine) } else { (mine, others) };
        // A half-space has no size.
        let size = match (own.0.size, other.0.size) {
            (size, 0.0) | (0.0, size) => size,
            (one, other) => one.min(other),
        };
        let Local { distance, normal, point, margin } = meet(first, second, self.upper, Met::OUTSIDE * size);
        let beyond = if distance.is_finite() { point - normal * distance } else { point };
        let gap = if swapped {
            Gap { distance, normal: -normal, on_robot: beyond, on_environment: point }
        } else {
            Gap { distance, normal, on_robot: point, on_environment: beyond }
        };
        Met { gap, margin: margin / size }
    }

    /// The gap of a corner and a half-space, for many corners of one body: `down` is the normal of the half-space in the axes of
    /// the parts, `height` that of their origin. `None` for other parts.
    pub fn over_plane(&self, own: &Parts, down: &Vector3<f64>, height: f64) -> Option<f64> {
        match (self.own, self.other) {
            (Part::Corner(k), Part::Face(_)) => match &own.corners[k] {
                CornerPart { kind: CornerKind::OfRim(_), .. } => None,
                corner => Some(height + down.dot(&corner.position) - corner.radius),
            },
            _ => None,
        }
    }

    /// The rates at the poses and angular velocities of both bodies, for a closed gap with ġ = 0. `u`: velocity of the robot's
    /// material point relative to the environment's, m/s.
    pub fn slide(
        &self,
        (own, turning): (Placed, Vector3<f64>),
        (other, other_turning): (Placed, Vector3<f64>),
        u: Vector3<f64>,
    ) -> Slide {
        if self.swapped() {
            let (rate, first) = slide((self.other, other, other_turning), (self.own, own, turning), -u, self.upper);
            Slide { normal_rate: -rate, on_robot: first - u, on_environment: first }
        } else {
            let (rate, first) = slide((self.own, own, turning), (self.other, other, other_turning), u, self.upper);
            // a and b coincide and move together.
            Slide { normal_rate: rate, on_robot: first, on_environment: first + u }
        }
    }
}

/// The margin of a point p at this height over a face: the least of the distances of its foot to the other faces, from inside.
/// Below the face it must itself be inside the body, and not much nearer to another face, through which it came.
fn within(face: &FacePart, pose: &Pose<Spatial<f64>>, p: Vector3<f64>, height: f64, outside: f64) -> f64 {
    let p = p - pose.rotation * face.normal * height.max(0.0);
    let margin = match &face.bounds {
        Bounds::None => f64::INFINITY,
        Bounds::Planes(planes) => {
            let local = pose.rotation.tr_mul(&(p - pose.translation));
            planes.iter().map(|(n, height)| height - n.dot(&local)).fold(f64::INFINITY, f64::min)
        }
        Bounds::Disc { radius, length } => {
            let local = pose.rotation.tr_mul(&(p - pose.translation)) - face.point;
            let height = face.normal.dot(&local);
            let across = (local - face.normal * height).norm();
            (radius - across).min(length + height)
        }
    };
    if came_through(height, margin, outside) { NOWHERE } else { margin }
}

/// Whether a point below a face or a round side with this margin is there because it came through another face.
fn came_through(height: f64, margin: f64, outside: f64) -> bool {
    height < -outside && (margin <= outside || height < -DEEPER * margin)
}

/// Whether no edge of this corner falls towards the other body by more than [`AWAY`]. `n` is in the axes of the parts.
fn faces(corner: &CornerPart, n: Vector3<f64>) -> bool {
    match &corner.kind {
        CornerKind::Ball => true,
        CornerKind::Sharp(edges) => edges.iter().all(|edge| n.dot(edge) >= -AWAY),
        CornerKind::OfRim(axis) => n.dot(axis) < 0.0 && n.cross(axis).norm() <= 2.0 * FLAT,
    }
}

/// Whether an edge of the body to which −n points out is exposed to a contact from there.
fn exposed(edge: &EdgePart, n: Vector3<f64>) -> bool {
    edge.beside.is_none_or(|faces| faces.iter().all(|face| n.dot(&face.inward) >= -AWAY))
}

/// Whether an edge that has passed another one along n is inside its body.
fn is_inside(edge: &EdgePart, n: Vector3<f64>) -> bool {
    edge.beside.is_none_or(|faces| faces.iter().all(|face| n.dot(&face.normal) <= 0.0))
}

fn meet((first, (a, pose)): (Part, Placed), (second, (b, place)): (Part, Placed), upper: bool, outside: f64) -> Local {
    let nowhere = Local { distance: f64::INFINITY, normal: Vector3::z(), point: Vector3::zeros(), margin: NOWHERE };
    match (first, second) {
        (Part::Corner(i), Part::Face(j)) => {
            let (corner, face) = (&a.corners[i], &b.faces[j]);
            let n = place.rotation * face.normal;
            let point = pose.point(corner.position) - n * corner.radius;
            let distance = n.dot(&(point - place.point(face.point)));
            let unbounded = face.bounds == Bounds::None && !matches!(corner.kind, CornerKind::OfRim(_));
            let faced = unbounded || faces(corner, pose.rotation.tr_mul(&n));
            let margin = if faced { within(face, place, point, distance, outside) } else { NOWHERE };
            Local { distance, normal: n, point, margin }
        }
        (Part::Rim(i), Part::Face(j)) => {
            let (rim, face) = (&a.rims[i], &b.faces[j]);
            let n = place.rotation * face.normal;
            let (axis, down) = lowest(rim, pose, n);
            let tilt = down.norm();
            // Flat: its fixed points touch instead. Otherwise of the two rims that which is lower.
            if tilt <= FLAT || n.dot(&axis) > AWAY {
                return Local { normal: n, ..nowhere };
            }
            let point = pose.point(rim.centre) - down * (rim.radius / tilt);
            let distance = n.dot(&(point - place.point(face.point)));
            Local { distance, normal: n, point, margin: within(face, place, point, distance, outside) }
        }
        (Part::Edge(i), Part::Edge(j)) => {
            let (one, two) = (&a.edges[i], &b.edges[j]);
            let Some(crossing) = Crossing::of((one, pose), (two, place)) else { return nowhere };
            let Crossing { n, x, s, t, e, .. } = crossing;
            let distance = n.dot(&crossing.w) - one.radius - two.radius;
            let (own, other) = (pose.rotation.tr_mul(&n), place.rotation.tr_mul(&n));
            let mut margin = (one.half_length - s.abs()).min(two.half_length - t.abs());
            if !(exposed(one, own) && exposed(two, -other)) {
                margin = NOWHERE;
            }
            // Edges that have passed each other overlap only if each is inside the other's body.
            if distance < -outside && !(is_inside(one, own) && is_inside(two, -other)) {
                margin = NOWHERE;
            }
            if distance < -AWAY * one.half_length.max(one.radius).min(two.half_length.max(two.radius)) {
                margin = NOWHERE;
            }
            Local { distance, normal: n, point: x + e * s - n * one.radius, margin }
        }
        (Part::Rim(i), Part::Edge(j)) => {
            let (rim, edge) = (&a.rims[i], &b.edges[j]);
            let Some(crossing) = RimCrossing::of((rim, pose), (edge, place), upper) else { return nowhere };
            let RimCrossing { n, m, s, point, w, to_middle, .. } = crossing;
            let distance = n.dot(&w);
            let axis = pose.rotation * rim.axis;
            // The cylinder is on the side of n, between its cap and its round side.
            let held = n.dot(&axis) <= AWAY && n.dot(&m) <= AWAY;
            let away = -place.rotation.tr_mul(&n);
            let inside = n.dot(&axis) <= 0.0 && n.dot(&m) <= 0.0 && is_inside(edge, away);
            let apart = distance >= -outside || inside;
            let counts = held && apart && exposed(edge, away) && distance >= -AWAY * rim.radius.min(edge.half_length);
            let margin = if counts { to_middle.min(edge.half_length - s.abs()) } else { NOWHERE };
            Local { distance, normal: n, point, margin }
        }
        (Part::Corner(i), Part::Edge(j)) => {
            let (corner, edge) = (&a.corners[i], &b.edges[j]);
            let c = pose.point(corner.position);
            let along = place.rotation * edge.along;
            let d = c - place.point(edge.middle);
            let t = along.dot(&d);
            let across = d - along * t;
            let Some(n) = across.try_normalize(0.0) else { return nowhere };
            let distance = across.norm() - corner.radius - edge.radius;
            let counts = faces(corner, pose.rotation.tr_mul(&n)) && exposed(edge, -place.rotation.tr_mul(&n));
            let margin = edge.half_length - t.abs();
            let margin = if counts && !came_through(distance, margin, outside) { margin } else { NOWHERE };
            Local { distance, normal: n, point: c - n * corner.radius, margin }
        }
        (Part::Corner(i), Part::Corner(j)) => {
            let (one, two) = (&a.corners[i], &b.corners[j]);
            let c = pose.point(one.position);
            let d = c - place.point(two.position);
            let Some(n) = d.try_normalize(0.0) else { return nowhere };
            let counts = faces(one, pose.rotation.tr_mul(&n)) && faces(two, -place.rotation.tr_mul(&n));
            let margin = if counts { f64::INFINITY } else { NOWHERE };
            Local { distance: d.norm() - one.radius - two.radius, normal: n, point: c - n * one.radius, margin }
        }
        _ => nowhere,
    }
}

/// The world axis k of a rim, and n − (n·k) k, which points from its lowest point to its centre.
fn lowest(rim: &RimPart, pose: &Pose<Spatial<f64>>, n: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let axis = pose.rotation * rim.axis;
    // As a cross product it keeps its digits for a small tilt.
    (axis, axis.cross(&n.cross(&axis)))
}

/// The common perpendicular of two edges.
struct Crossing {
    /// Unit normal, from the second to the first.
    n: Vector3<f64>,
    /// n e × e′ without orientation: |e × e′| with its sign.
    sine: f64,
    /// The middle of the first edge, and its vector from that of the second.
    x: Vector3<f64>,
    w: Vector3<f64>,
    e: Vector3<f64>,
    f: Vector3<f64>,
    /// Parameters of the feet of the perpendicular.
    s: f64,
    t: f64,
}

impl Crossing {
    fn of(
        (one, pose): (&EdgePart, &Pose<Spatial<f64>>),
        (two, place): (&EdgePart, &Pose<Spatial<f64>>),
    ) -> Option<Self> {
        let (e, f) = (pose.rotation * one.along, place.rotation * two.along);
        let across = e.cross(&f);
        let sine = across.norm();
        if sine <= PARALLEL {
            return None;
        }
        let x = pose.point(one.middle);
        let w = x - place.point(two.middle);
        // The second body is below its edge along n, or the first above its own.
        let below = match (two.beside, one.beside) {
            (Some([p, q]), _) => -(place.rotation * (p.inward + q.inward)),
            (None, Some([p, q])) => pose.rotation * (p.inward + q.inward),
            (None, None) => w,
        };
        let sine = if across.dot(&below) < 0.0 { -sine } else { sine };
        let n = across / sine;
        // (w + s e − t e′) ⟂ e′ × n and e × n.
        let (across_f, across_e) = (f.cross(&n), e.cross(&n));
        let s = -w.dot(&across_f) / e.dot(&across_f);
        let t = w.dot(&across_e) / f.dot(&across_e);
        Some(Self { n, sine, x, w, e, f, s, t })
    }
}

/// The points of a rim and of an edge that are joined by a common perpendicular.
struct RimCrossing {
    /// Unit normal, from the edge to the rim.
    n: Vector3<f64>,
    /// t × e′ = `sine` n.
    sine: f64,
    /// Unit vector from the centre of the rim to its point, and the tangent there.
    m: Vector3<f64>,
    t: Vector3<f64>,
    e: Vector3<f64>,
    /// The point of the rim, and its vector from that of the edge, which has the parameter s.
    point: Vector3<f64>,
    w: Vector3<f64>,
    s: f64,
    /// Distance, along the edge's projection, to the point of the rim where both crossings merge; negative beyond it.
    to_middle: f64,
}

impl RimCrossing {
    /// The perpendicular near the lower or upper point at which the rim and the projection of the edge onto its plane cross.
    fn of(
        (rim, pose): (&RimPart, &Pose<Spatial<f64>>),
        (edge, place): (&EdgePart, &Pose<Spatial<f64>>),
        upper: bool,
    ) -> Option<Self> {
        let (axis, e) = (pose.rotation * rim.axis, place.rotation * edge.along);
        let (centre, middle) = (pose.point(rim.centre), place.point(edge.middle));
        let flat = |v: Vector3<f64>| v - axis * axis.dot(&v);
        let (along, from) = (flat(e), flat(middle - centre));
        let square = along.norm_squared();
        // An edge along the axis has one crossing.
        let perpendicular = square.sqrt() <= PARALLEL;
        let toward = if perpendicular {
            Some(from).filter(|_| !upper)?
        } else {
            let half = along.dot(&from) / square;
            let beside = from - along * half;
            // Where the projection misses the rim, the crossings have merged.
            let root = ((rim.radius * rim.radius - beside.norm_squared()) / square).max(0.0).sqrt();
            from + along * if upper { root - half } else { -root - half }
        };
        let start = toward.try_normalize(0.0)?;
        let side = axis.cross(&start);
        // The distance of the rim's point from the edge is stationary: w ⟂ t, with w ⟂ e′ by the choice of s.
        let mut angle = 0.0_f64;
        for _ in 0..NEWTON {
            let (sin, cos) = angle.sin_cos();
            let (m, t) = (start * cos + side * sin, side * cos - start * sin);
            let point = centre + m * rim.radius;
            let s = e.dot(&(point - middle));
            let w = point - middle - e * s;
            let rise = w.dot(&t);
            let (across, out) = (t.cross(&e), w.dot(&m));
            let sharp = rim.radius * across.norm_squared();
            // Further away the rim's point depends on the gap too much to be that of a contact.
            if out.abs() > 0.5 * sharp || angle.abs() > TURNED {
                return None;
            }
            if rise.abs() <= CLOSE * rim.radius {
                let sine = across.norm();
                let below = edge.beside.map_or(w, |[p, q]| -(place.rotation * (p.inward + q.inward)));
                let sine = if across.dot(&below) < 0.0 { -sine } else { sine };
                let beyond = if upper { point - centre } else { centre - point };
                let to_middle = if perpendicular { rim.radius } else { beyond.dot(&along) / square.sqrt() };
                return (sine.abs() > PARALLEL).then(|| Self {
                    n: across / sine,
                    sine,
                    m,
                    t,
                    e,
                    point,
                    w,
                    s,
                    to_middle,
                });
            }
            angle -= rise / (sharp - out);
        }
        None
    }
}

/// ṅ and α.
fn slide(
    (first, (a, pose), turning): (Part, Placed, Vector3<f64>),
    (second, (b, place), other_turning): (Part, Placed, Vector3<f64>),
    u: Vector3<f64>,
    upper: bool,
) -> (Vector3<f64>, Vector3<f64>) {
    let zero = Vector3::zeros();
    // The contact point of a ball with centre fixed to the first body: a = c − r n.
    let of_ball = |radius: f64, n: Vector3<f64>, rate: Vector3<f64>| (rate - turning.cross(&n)) * -radius;
    match (first, second) {
        (Part::Corner(i), Part::Face(j)) => {
            let n = place.rotation * b.faces[j].normal;
            let rate = other_turning.cross(&n);
            (rate, of_ball(a.corners[i].radius, n, rate))
        }
        (Part::Rim(i), Part::Face(j)) => {
            let (rim, n) = (&a.rims[i], place.rotation * b.faces[j].normal);
            let rate = other_turning.cross(&n);
            let (axis, down) = lowest(rim, pose, n);
            let tilt = down.norm();
            if tilt == 0.0 {
                return (rate, zero);
            }
            // m = w/|w| with w = n − (n·k) k, seen from the body: ẇ there is that of n there.
            let seen = rate - turning.cross(&n);
            let change = seen - axis * axis.dot(&seen);
            let m = down / tilt;
            (rate, (change - m * m.dot(&change)) * (-rim.radius / tilt))
        }
        (Part::Edge(i), Part::Edge(j)) => {
            let (one, two) = (&a.edges[i], &b.edges[j]);
            let Some(Crossing { n, sine, e, f, .. }) = Crossing::of((one, pose), (two, place)) else {
                return (zero, zero);
            };
            let turned = turning.cross(&e).cross(&f) + e.cross(&other_turning.cross(&f));
            let rate = (turned - n * n.dot(&turned)) / sine;
            // The feet x + s e and x′ + t e′ stay apart by (r + r′) n.
            let (r, other) = (one.radius, two.radius);
            let apart = u + turning.cross(&n) * r + other_turning.cross(&n) * other;
            let across = f.cross(&n);
            let s = (rate * (r + other) - apart).dot(&across) / e.dot(&across);
            (rate, e * s + of_ball(r, n, rate))
        }
        (Part::Rim(i), Part::Edge(j)) => {
            let (rim, edge) = (&a.rims[i], &b.edges[j]);
            let Some(RimCrossing { n, sine, m, t, e, .. }) = RimCrossing::of((rim, pose), (edge, place), upper) else {
                return (zero, zero);
            };
            // Both points move together: u + φ̇ R t is along e′. The tangent turns by ω and by φ̇ on the rim.
            let across = e.cross(&n);
            let turn = -u.dot(&across) / (rim.radius * t.dot(&across));
            let tangent = turning.cross(&t) - m * turn;
            let turned = tangent.cross(&e) + t.cross(&other_turning.cross(&e));
            ((turned - n * n.dot(&turned)) / sine, t * (turn * rim.radius))
        }
        (Part::Corner(i), Part::Edge(j)) => {
            let (corner, edge) = (&a.corners[i], &b.edges[j]);
            let along = place.rotation * edge.along;
            let d = pose.point(corner.position) - place.point(edge.middle);
            let across = d - along * along.dot(&d);
            let distance = across.norm();
            if distance == 0.0 {
                return (zero, zero);
            }
            let n = across / distance;
            let t = along.cross(&n);
            let apart = u + turning.cross(&n) * corner.radius + other_turning.cross(&n) * edge.radius;
            let rate = t * (apart.dot(&t) / distance) - along * n.dot(&other_turning.cross(&along));
            (rate, of_ball(corner.radius, n, rate))
        }
        (Part::Corner(i), Part::Corner(j)) => {
            let (one, two) = (&a.corners[i], &b.corners[j]);
            let d = pose.point(one.position) - place.point(two.position);
            let distance = d.norm();
            if distance == 0.0 {
                return (zero, zero);
            }
            let n = d / distance;
            let apart = u + turning.cross(&n) * one.radius + other_turning.cross(&n) * two.radius;
            let rate = (apart - n * n.dot(&apart)) / distance;
            (rate, of_ball(one.radius, n, rate))
        }
        _ => (zero, zero),
    }
}
