//! A pair of a link's shape and an obstacle or another link's shape: the geometry that its touches share.

use super::rule::ContactRule;
use crate::error::SimError;
use crate::state::{EXACT, Space, View};
use carom_chain::algebra::Pose;
use carom_chain::{FrameId, Spatial};
use carom_contact::{
    Gap, LinkShape, Meeting, Met, Obstacle, Part, Parts, Separation, Slide, Solid, Surface, gap, gap_between,
    gap_points,
};
use nalgebra::Vector3;

/// See the head of this module.
#[derive(Debug, Clone)]
pub(crate) struct Pair {
    pub shape: LinkShape,
    pub against: Against,
    /// Whether it is not divided on request.
    pub whole: bool,
    /// The parts of both bodies, if their contacts are divided into those of parts.
    parts: Option<(Parts, Parts)>,
    /// Whether the contacts of the parts are all contacts of the pair.
    complete: bool,
}

/// Both bodies of a pair at one state: poses relative to the displaced surface, and velocities.
pub(crate) struct Placed {
    poses: [Pose<Spatial<f64>>; 2],
    /// Velocity of the origin, and angular velocity.
    own: [Vector3<f64>; 2],
    other: [Vector3<f64>; 2],
    /// For a half-space: its normal in the axes of the first body, and the height of their origin.
    plane: Option<(Vector3<f64>, f64)>,
}

/// How two bodies move past each other at one state: velocity of the first relative to the second at its centre, m/s, angular
/// velocity, rad/s, and radius about the centre, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Passing {
    velocity: Vector3<f64>,
    turning: Vector3<f64>,
    size: f64,
}

impl Passing {
    /// Relative angular speed, rad/s.
    pub fn turning(&self) -> f64 {
        self.turning.norm()
    }

    /// Bounds of the rate and of the curvature of the gap between two states of this distance in time, m/s and m/s². The velocities in
    /// between are at most twice as large as at both ends.
    pub fn bounds(&self, other: &Self, span: f64) -> [f64; 2] {
        let most = |of: fn(&Self) -> f64| 2.0 * of(self).max(of(other));
        let turning = most(|it| it.turning.norm());
        let change = (self.velocity - other.velocity).norm() / span;
        [most(|it| it.velocity.norm()) + turning * self.size, 2.0 * change + turning * turning * self.size]
    }
}

/// The second body of a pair.
#[derive(Debug, Clone)]
pub(crate) enum Against {
    Obstacle(Box<Obstacle>),
    Link(Box<LinkShape>),
}

/// The gap of parts that do not face each other, and its rate.
pub(crate) const APART: (f64, f64) = (f64::INFINITY, 0.0);
/// Pairs with more contacts of parts than this are not divided.
const MANY: usize = 2000;
/// Share of a body's size: bodies that are separated by more are open. Their gap is given by its lower bound, and their contacts are not
/// examined one by one.
pub(crate) const FAR: f64 = 0.02;

impl Pair {
    /// A pair with the contacts of its parts; none if it touches at one point, or where it is not divided.
    pub fn new(shape: &LinkShape, against: Against, rule: &ContactRule) -> (Self, Vec<Meeting>) {
        let mut pair = Self { shape: shape.clone(), against, whole: false, parts: None, complete: false };
        pair.whole = pair.is_whole_under(rule);
        if pair.whole || pair.is_point() {
            return (pair, Vec::new());
        }
        let own = if pair.is_on_plane() { Some(Parts::corners_of_shape(shape)) } else { Parts::of_shape(shape) };
        let other = match &pair.against {
            Against::Obstacle(obstacle) => Parts::of_obstacle(obstacle),
            Against::Link(other) => Parts::of_shape(other),
        };
        let Some((own, other)) = own.zip(other) else { return (pair, Vec::new()) };
        let meetings = Meeting::all(&own, &other);
        if meetings.len() > MANY && !pair.is_on_plane() {
            return (pair, Vec::new());
        }
        pair.complete = Meeting::are_complete(&own, &other);
        pair.parts = Some((own, other));
        (pair, meetings)
    }

    /// Whether it can touch at one point only.
    pub fn is_point(&self) -> bool {
        let other = match &self.against {
            Against::Link(other) => Some(other.solid()),
            Against::Obstacle(obstacle) => match obstacle.surface() {
                Surface::Solid { solid, .. } => Some(solid),
                _ => None,
            },
        };
        [Some(self.shape.solid()), other].iter().any(|solid| matches!(solid, Some(Solid::Sphere { .. })))
    }

    /// The shape of the second body, if it is a link's.
    pub fn other(&self) -> Option<&LinkShape> {
        match &self.against {
            Against::Link(other) => Some(other),
            Against::Obstacle(_) => None,
        }
    }

    /// A point and the normal of the second body, if it is a half-space.
    fn plane(&self) -> Option<(&Vector3<f64>, &Vector3<f64>)> {
        match &self.against {
            Against::Obstacle(obstacle) => match obstacle.surface() {
                Surface::HalfSpace { point, normal } => Some((point, normal)),
                _ => None,
            },
            Against::Link(_) => None,
        }
    }

    /// Whether the second body is a half-space.
    pub fn is_on_plane(&self) -> bool {
        self.plane().is_some()
    }

    /// Whether it is not divided under a rule: the penetration of parts is defined on half-spaces only.
    pub fn is_whole_under(&self, rule: &ContactRule) -> bool {
        rule.compliance.is_some() && !self.is_on_plane()
    }

    /// Whether the contacts of its parts are all of its contacts.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// Whether a contact of parts can leave their faces and edges.
    pub fn ends(&self, meeting: Meeting) -> bool {
        let rimless = |(own, _): &(Parts, Parts)| !own.has_rims();
        !(self.is_on_plane() && matches!(meeting.own(), Part::Corner(_)) && self.parts.as_ref().is_some_and(rimless))
    }

    /// Poses of the axes in which the parts are given, relative to the displaced surface.
    fn poses<A: Space>(&self, view: &View<A>, shift: Vector3<f64>) -> [Pose<Spatial<f64>>; 2] {
        let mut own = view.pose(self.shape.frame());
        let Some(other) = self.other() else {
            own.translation -= shift;
            return [own, Pose::identity()];
        };
        [own, view.pose(other.frame())]
    }

    /// Both bodies at a state.
    pub fn placed<A: Space>(
        &self,
        view: &View<A>,
        [shift, speed, _]: [Vector3<f64>; 3],
        qd: &[f64],
    ) -> Result<Placed, SimError> {
        let twist = |frame: FrameId| {
            let origin = view.point(frame, view.pose(frame).translation);
            Ok::<_, SimError>([view.velocity(origin, qd)?, view.angular_velocity(frame, qd)?])
        };
        let other = self.other().map_or(Ok([speed, Vector3::zeros()]), |other| twist(other.frame()))?;
        let poses = self.poses(view, shift);
        let over = |(point, normal): (&Vector3<f64>, &Vector3<f64>)| {
            (poses[0].rotation.tr_mul(normal), normal.dot(&(poses[0].translation - point)))
        };
        let plane = self.plane().map(over);
        Ok(Placed { poses, own: twist(self.shape.frame())?, other, plane })
    }

    /// The parts of both bodies with their poses; `None` if it is not divided.
    fn bodies<'a>(&'a self, placed: &'a Placed) -> Option<[carom_contact::Placed<'a>; 2]> {
        let ((one, two), [own, other]) = (self.parts.as_ref()?, &placed.poses);
        Some([(one, own), (two, other)])
    }

    /// Gap and gap rate of a contact of parts, as [`Touch::look`](super::Touch).
    pub fn look(&self, meeting: Meeting, placed: &Placed) -> (f64, f64) {
        let Some([own, other]) = self.bodies(placed) else { return APART };
        let met = meeting.at(own, other);
        if met.counts() { (met.gap.distance, met.gap.normal.dot(&placed.slip(&met.gap))) } else { APART }
    }

    /// The gap of a corner over a half-space without its rate; `None` for other parts.
    pub fn height(&self, meeting: Meeting, placed: &Placed) -> Option<f64> {
        let (down, height) = placed.plane.as_ref()?;
        meeting.over_plane(&self.parts.as_ref()?.0, down, *height)
    }

    /// A lower bound of the gap with its rate: see [`Separation`]. `None` if the pair is not divided or has no face.
    pub fn separation(&self, placed: &Placed) -> Option<(f64, f64)> {
        let [own, other] = self.bodies(placed)?;
        let Separation { gap, is_own } = Separation::of(own, other)?;
        let turning = if is_own { placed.own[1] } else { placed.other[1] };
        let turned = turning.cross(&gap.normal).dot(&(gap.on_robot - gap.on_environment));
        Some((gap.distance, gap.normal.dot(&placed.slip(&gap)) + turned))
    }

    /// Whether the gap of a contact of parts is that of the bodies: the separation along its normal is as large.
    pub fn is_nearest(&self, meeting: Meeting, placed: &Placed) -> bool {
        let Some([own, other]) = self.bodies(placed) else { return false };
        let met = meeting.at(own, other);
        // A contact beyond the ends of its faces and edges is none, whatever its gap.
        met.counts()
            && met.gap.distance - Separation::along(met.gap.normal, own, other)
                <= EXACT * (self.size() + placed.poses[0].translation.norm())
    }

    /// The separation of the bodies along the normal of a contact of parts, m.
    pub fn along(&self, meeting: Meeting, placed: &Placed) -> Option<f64> {
        let [own, other] = self.bodies(placed)?;
        Some(Separation::along(meeting.at(own, other).gap.normal, own, other))
    }

    /// How the bodies move past each other.
    pub fn passing(&self, placed: &Placed) -> Passing {
        let (centre, size) = self.shape.solid().bounding_sphere();
        let centre = placed.poses[0].point(self.shape.origin().point(centre));
        Passing { velocity: placed.relative(centre, centre), turning: placed.own[1] - placed.other[1], size }
    }

    /// Radius of a sphere about the first body, m.
    pub fn size(&self) -> f64 {
        self.shape.solid().bounding_sphere().1
    }

    /// The nearest points of the two bodies.
    pub fn nearest<A: Space>(&self, view: &View<A>, shift: Vector3<f64>) -> Gap {
        let [own, other] = self.poses(view, shift);
        match &self.against {
            Against::Obstacle(obstacle) => moved(gap(&self.shape, &own, obstacle), shift),
            Against::Link(link) => gap_between((&self.shape, &own), (link, &other)),
        }
    }

    /// All corners of the first body, and the nearest points.
    pub fn points<A: Space>(&self, view: &View<A>, shift: Vector3<f64>) -> Vec<Gap> {
        let mut points = Vec::new();
        if let Against::Obstacle(obstacle) = &self.against
            && !self.is_point()
        {
            let [own, _] = self.poses(view, shift);
            points = gap_points(&self.shape, &own, obstacle, f64::INFINITY);
            points.iter_mut().for_each(|found| *found = moved(*found, shift));
        }
        points.push(self.nearest(view, shift));
        points
    }

    /// A contact of parts.
    pub fn met<A: Space>(&self, meeting: Meeting, view: &View<A>, shift: Vector3<f64>) -> Met {
        let [own, other] = self.poses(view, shift);
        match &self.parts {
            Some((one, two)) => {
                let met = meeting.at((one, &own), (two, &other));
                Met { gap: moved(met.gap, shift), ..met }
            }
            None => Met { gap: self.nearest(view, shift), margin: f64::INFINITY },
        }
    }

    /// Angular velocities of both bodies.
    pub fn turning<A: Space>(&self, view: &View<A>, qd: &[f64]) -> Result<[Vector3<f64>; 2], SimError> {
        let other = self.other().map_or(Ok(Vector3::zeros()), |other| view.angular_velocity(other.frame(), qd))?;
        Ok([view.angular_velocity(self.shape.frame(), qd)?, other])
    }

    /// The rates of a contact of parts whose gap is closed; `None` for the nearest points of the bodies.
    pub fn slide<A: Space>(
        &self,
        meeting: Meeting,
        view: &View<A>,
        shift: Vector3<f64>,
        [turning, other_turning]: [Vector3<f64>; 2],
        u: Vector3<f64>,
    ) -> Option<Slide> {
        let [own, other] = self.poses(view, shift);
        let (one, two) = self.parts.as_ref()?;
        Some(meeting.slide(((one, &own), turning), ((two, &other), other_turning), u))
    }

    /// A lower bound of the gap from bounding spheres with its rate, where the bodies are far apart.
    pub fn clearance<A: Space>(
        &self,
        view: &View<A>,
        [shift, speed, _]: [Vector3<f64>; 3],
        qd: &[f64],
    ) -> Result<Option<(f64, f64)>, SimError> {
        let [own, other] = self.poses(view, shift);
        let sphere = |shape: &LinkShape, pose: &Pose<Spatial<f64>>| {
            let (centre, radius) = shape.solid().bounding_sphere();
            (pose.point(shape.origin().point(centre)), radius)
        };
        let (centre, radius) = sphere(&self.shape, &own);
        let between = |(there, size): (Vector3<f64>, f64)| {
            let apart = centre - there;
            (apart.norm() - radius - size, apart.try_normalize(0.0).unwrap_or(Vector3::z()), radius)
        };
        let (distance, normal, far) = match &self.against {
            Against::Link(link) => {
                let there = sphere(link, &other);
                let (distance, normal, _) = between(there);
                (distance, normal, radius.max(there.1))
            }
            Against::Obstacle(obstacle) => match obstacle.surface() {
                Surface::HalfSpace { point, normal } => (normal.dot(&(centre - point)) - radius, *normal, radius),
                Surface::Solid { solid, pose } => {
                    let (middle, size) = solid.bounding_sphere();
                    between(((pose * nalgebra::Point3::from(middle)).coords, size))
                }
                Surface::Mesh { .. } => return Ok(None),
            },
        };
        if distance <= FAR * far {
            return Ok(None);
        }
        let mut velocity = view.velocity(view.point(self.shape.frame(), centre + shift), qd)? - speed;
        if let Some(link) = self.other() {
            velocity -= view.velocity(view.point(link.frame(), centre), qd)?;
        }
        Ok(Some((distance, normal.dot(&velocity))))
    }
}

impl Placed {
    /// Velocity of the first body relative to the second at their points of a gap.
    fn slip(&self, gap: &Gap) -> Vector3<f64> {
        self.relative(gap.on_robot, gap.on_environment)
    }

    /// Velocity of a place of the first body relative to one of the second.
    fn relative(&self, own: Vector3<f64>, other: Vector3<f64>) -> Vector3<f64> {
        let at = |[v, w]: [Vector3<f64>; 2], pose: &Pose<Spatial<f64>>, p: Vector3<f64>| {
            v + w.cross(&(p - pose.translation))
        };
        at(self.own, &self.poses[0], own) - at(self.other, &self.poses[1], other)
    }
}

fn moved(mut gap: Gap, shift: Vector3<f64>) -> Gap {
    gap.on_robot += shift;
    gap.on_environment += shift;
    gap
}
