//! Touches: the possible contacts of a chain. A touch is a pair of a link's shape and a surface, a pair of shapes of two
//! links, or a joint limit. The event loop treats all of them as a gap and a row whose product with qd is its rate.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | g, ġ | 1 | gap (> 0 open) and its rate | `gap`, `rate` |
//! | j | nv | ġ = j·qd − n·ṡ | `row` |
//! | s | 3 | displacement of a moving surface | [`Oscillation`] |
//! | u | 3 | velocity of the contact point relative to the surface, J qd − ṡ | `u` |
//! | J | 3×nv | Jacobian of the contact point; between two links, that of the first minus that of the second | `jacobian` |

use super::rule::ContactRule;
use crate::error::SimError;
use crate::motion::smooth::responses;
use crate::state::space::{Felt, Space, View};
use carom_chain::{Chain, Coordinates, FrameId, Point};
use carom_contact::{
    LeftOut, LinkShape, Obstacle, Solid, Surface as Form, gap, gap_between, gap_points, link_shapes, reachable_pairs,
};
use carom_impact::Frictionless;
use nalgebra::{DMatrix, DVector, Vector3};

/// Harmonic motion of a surface: the displacement `amplitude · sin(ω t + phase)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillation {
    /// Direction and size, world axes, m.
    pub amplitude: Vector3<f64>,
    /// Angular frequency ω, rad/s.
    pub frequency: f64,
    /// Phase, rad.
    pub phase: f64,
}

impl Oscillation {
    /// Displacement (m), velocity (m/s) and acceleration (m/s²) at a time (s), world axes.
    pub fn at(&self, time: f64) -> [Vector3<f64>; 3] {
        let Self { amplitude, frequency, phase } = *self;
        let (sin, cos) = (frequency * time + phase).sin_cos();
        [amplitude * sin, amplitude * (frequency * cos), amplitude * (-frequency * frequency * sin)]
    }
}

/// A surface of the environment.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Its name.
    pub name: String,
    /// Its shape and pose.
    pub obstacle: Obstacle,
    /// Law and coefficients of contacts with it.
    pub contact: ContactRule,
    /// Its motion; `None`: at rest.
    pub motion: Option<Oscillation>,
}

/// A possible contact: a pair of shapes, or a joint limit.
#[derive(Debug, Clone)]
pub struct Touch {
    /// Its name, for instance `tip on surface 1` or `upper limit of elbow`.
    pub name: String,
    /// Its law and coefficients.
    pub contact: ContactRule,
    pub(crate) kind: TouchKind,
    /// Name of the surface, or of the other link; `None` for a limit.
    pub(crate) surface: Option<String>,
    pub(crate) motion: Option<Oscillation>,
}

#[derive(Debug, Clone)]
pub(crate) enum TouchKind {
    /// A ball on a link (a corner is a ball of radius 0), and a half-space.
    Ball { shape: Box<LinkShape>, centre: Vector3<f64>, radius: f64, point: Vector3<f64>, normal: Vector3<f64> },
    /// Any other pair of a shape and an obstacle, at its nearest points.
    Pair { shape: Box<LinkShape>, obstacle: Box<Obstacle> },
    /// Shapes of two links, at their nearest points.
    Links { shape: Box<LinkShape>, other: Box<LinkShape> },
    /// A joint limit.
    Limit { joint: String, q: usize, v: usize, bound: f64, upper: bool },
}

/// For hulls with more vertices than this only the vertex nearest to a half-space is a contact.
const MANY_CORNERS: usize = 32;

/// The possible contacts, and the pairs that cannot touch, each with its reason.
#[derive(Debug, Clone, Default)]
pub struct Touches {
    /// The possible contacts.
    pub touches: Vec<Touch>,
    /// The pairs that cannot touch: name and reason.
    pub left_out: Vec<(String, LeftOut)>,
}

/// A touch at one state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct At<A: Space> {
    pub gap: f64,
    /// Contact point on the robot, and unit normal from the environment to the robot, world; `None` for joint limits.
    pub surface: Option<Place<A>>,
}

/// Contact point and normal of a touch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place<A: Space> {
    pub point: Point<A>,
    /// The contact point of the second link of a pair.
    pub against: Option<Point<A>>,
    pub position: Vector3<f64>,
    pub normal: Vector3<f64>,
}

impl<A: Space> Place<A> {
    /// nᵀJ.
    pub fn row(&self, view: &View<A>, n: Vector3<f64>) -> Result<DVector<f64>, SimError> {
        let own = view.row(self.point, n)?;
        Ok(match self.against {
            Some(other) => own - view.row(other, n)?,
            None => own,
        })
    }

    /// J: 3×nv, world axes.
    pub fn jacobian(&self, view: &View<A>) -> DMatrix<f64> {
        let own = view.jacobian(self.point);
        match self.against {
            Some(other) => own - view.jacobian(other),
            None => own,
        }
    }

    /// J qd, m/s.
    pub fn velocity(&self, view: &View<A>, qd: &[f64]) -> Result<Vector3<f64>, SimError> {
        let own = view.velocity(self.point, qd)?;
        Ok(match self.against {
            Some(other) => own - view.velocity(other, qd)?,
            None => own,
        })
    }

    /// Delassus matrix and response; `None` if no joint moves the contact point along the normal.
    pub fn inertia(&self, view: &mut View<A>) -> Result<Option<Felt>, SimError> {
        if self.against.is_none() {
            return view.inertia(self.point, self.normal);
        }
        let jacobian = self.jacobian(view);
        let response = responses(view, &jacobian)?;
        let delassus = (&jacobian * &response).fixed_view::<3, 3>(0, 0).into_owned();
        let response = response.fixed_columns::<3>(0).into_owned();
        // Each row of J is a difference, in which common parts cancel up to rounding.
        let apart = view.jacobian(self.point);
        let most = (&apart * responses(view, &apart)?).trace();
        let along = self.normal.dot(&(delassus * self.normal));
        Ok((along > STUCK * most.max(delassus.trace())).then_some((delassus, response)))
    }
}

/// A ball and a half-space with precomputed constants: g = n·x + h − r − n·s for the centre x. The contact point is the one
/// below the centre; ω × its arm has no component along n, so ġ = n·(ẋ − ṡ).
#[derive(Debug, Clone, Copy)]
pub(crate) struct BallOnPlane<A: Space> {
    /// The centre.
    centre: Point<A>,
    /// n in the algebra of the chain.
    normal: A::Vector,
    /// h: the constant part of the height of the centre over the plane.
    height: f64,
    /// r: stored apart from h, so that it is not rounded with h.
    radius: f64,
}

/// An inverse mass below this share of the largest is rounding.
const STUCK: f64 = 1e-13;

impl Touch {
    /// The pairs of every collision shape of one link with every one of another link.
    ///
    /// Contacts between links are not created automatically, as neighbouring links often overlap at their joint.
    ///
    /// # Errors
    /// [`SimError::Chain`] for an unknown link; [`SimError::LinkPair`] for a link without collision shape or a link paired with
    /// itself; [`SimError::Shape`] for an invalid mesh.
    pub fn between(chain: &Chain, link: &str, other: &str, contact: &ContactRule) -> Result<Vec<Self>, SimError> {
        let shapes = link_shapes(chain)?;
        let of = |name: &str| {
            chain.frame(name)?;
            let own: Vec<&LinkShape> = shapes.iter().filter(|shape| shape.link() == name).collect();
            let problem = if link == other {
                "is paired with itself: name two links"
            } else {
                "has no collision shape: give it one in the URDF"
            };
            if own.is_empty() || link == other {
                return Err(SimError::LinkPair { link: name.to_owned(), problem });
            }
            Ok(own)
        };
        let (own, others) = (of(link)?, of(other)?);
        let pairs = own.iter().flat_map(|shape| others.iter().map(move |other| (*shape, *other)));
        let touch = |(shape, other): (&LinkShape, &LinkShape)| Self {
            name: format!("{} on {}", shape.link(), other.link()),
            contact: contact.clone(),
            surface: Some(other.link().to_owned()),
            kind: TouchKind::Links { shape: Box::new(shape.clone()), other: Box::new(other.clone()) },
            motion: None,
        };
        Ok(pairs.map(touch).collect())
    }

    /// The pairs of every collision shape with every surface that it can reach at some configuration, and all joint limits,
    /// with Newton's coefficient of restitution `limit_restitution`. Pairs that are out of reach at every configuration are
    /// left out, which does not change the motion. Moving surfaces are always included.
    ///
    /// With a half-space, each corner, ball and capsule end is a touch of its own.
    ///
    /// # Errors
    /// [`SimError::Shape`] for an invalid mesh.
    pub fn all(chain: &Chain, surfaces: &[Surface], limit_restitution: f64) -> Result<Touches, SimError> {
        let shapes = link_shapes(chain)?;
        // The reach of moving surfaces is not computed.
        let (moving, still): (Vec<_>, Vec<_>) = surfaces.iter().partition(|surface| surface.motion.is_some());
        let obstacles: Vec<Obstacle> = still.iter().map(|surface| surface.obstacle.clone()).collect();
        let found = reachable_pairs(chain, &shapes, &obstacles);
        let name = |shape: &LinkShape, surface: &Surface| format!("{} on {}", shape.link(), surface.name);
        let left_out = found.left_out.iter();
        let left_out = left_out.map(|(pair, why)| (name(&shapes[pair.shape], still[pair.obstacle]), *why)).collect();
        let mut touches = Vec::new();
        for pair in &found.pairs {
            Self::add(&mut touches, &shapes[pair.shape], still[pair.obstacle]);
        }
        for surface in moving {
            shapes.iter().for_each(|shape| Self::add(&mut touches, shape, surface));
        }
        touches.extend(Self::limits(chain, limit_restitution));
        Ok(Touches { touches, left_out })
    }

    /// The pairs of every collision shape with every surface, including those out of reach, and all joint limits.
    ///
    /// # Errors
    /// [`SimError::Shape`] for an invalid mesh.
    pub fn every(chain: &Chain, surfaces: &[Surface], limit_restitution: f64) -> Result<Vec<Self>, SimError> {
        let mut touches = Vec::new();
        for shape in &link_shapes(chain)? {
            surfaces.iter().for_each(|surface| Self::add(&mut touches, shape, surface));
        }
        touches.extend(Self::limits(chain, limit_restitution));
        Ok(touches)
    }

    fn add(touches: &mut Vec<Self>, shape: &LinkShape, surface: &Surface) {
        let Surface { name, obstacle, contact, motion } = surface;
        let surface = Some(name.clone());
        let mut push = |name, kind| {
            touches.push(Self { name, contact: contact.clone(), kind, surface: surface.clone(), motion: *motion });
        };
        let name = format!("{} on {name}", shape.link());
        let corners = shape.corners();
        match obstacle.surface() {
            Form::HalfSpace { point, normal }
                if corners.len() <= MANY_CORNERS && !matches!(shape.solid(), Solid::Cylinder { .. }) =>
            {
                for (k, corner) in corners.iter().enumerate() {
                    let name = if corners.len() == 1 { name.clone() } else { format!("{name}, corner {}", k + 1) };
                    let (shape, centre, radius) = (Box::new(shape.clone()), corner.position, corner.radius);
                    push(name, TouchKind::Ball { shape, centre, radius, point: *point, normal: *normal });
                }
            }
            _ => {
                push(name, TouchKind::Pair { shape: Box::new(shape.clone()), obstacle: Box::new(obstacle.clone()) });
            }
        }
    }

    fn limits(chain: &Chain, restitution: f64) -> Vec<Self> {
        let mut touches = Vec::new();
        for joint in chain.joints() {
            let Coordinates::Own { q, v } = &joint.coordinates else { continue };
            for (bound, upper, side) in [(joint.limits.lower, false, "lower"), (joint.limits.upper, true, "upper")] {
                let Some(bound) = bound else { continue };
                let kind = TouchKind::Limit { joint: joint.name.clone(), q: q.start, v: v.start, bound, upper };
                let contact = ContactRule::new(Frictionless { restitution });
                let name = format!("{side} limit of {}", joint.name);
                touches.push(Self { name, contact, kind, surface: None, motion: None });
            }
        }
        touches
    }

    /// Name of the link; `None` for a limit.
    pub fn link(&self) -> Option<&str> {
        match &self.kind {
            TouchKind::Ball { shape, .. } | TouchKind::Pair { shape, .. } | TouchKind::Links { shape, .. } => {
                Some(shape.link())
            }
            TouchKind::Limit { .. } => None,
        }
    }

    /// Name of the second link of a pair of links.
    pub fn other_link(&self) -> Option<&str> {
        match &self.kind {
            TouchKind::Links { other, .. } => Some(other.link()),
            _ => None,
        }
    }

    /// Name of the surface, or of the second link of a pair of links; `None` for a limit.
    pub fn surface(&self) -> Option<&str> {
        self.surface.as_deref()
    }

    /// Name of the joint of a joint limit.
    pub fn limit_of(&self) -> Option<&str> {
        match &self.kind {
            TouchKind::Limit { joint, .. } => Some(joint),
            _ => None,
        }
    }

    /// Whether this pair can touch at one point only. Pairs with faces or edges can touch at several points.
    pub(crate) fn is_point(&self) -> bool {
        let round = |solid: &Solid| matches!(solid, Solid::Sphere { .. });
        match &self.kind {
            TouchKind::Links { shape, other } => round(shape.solid()) || round(other.solid()),
            TouchKind::Pair { shape, obstacle } => {
                round(shape.solid()) || matches!(obstacle.surface(), Form::Solid { solid, .. } if round(solid))
            }
            _ => true,
        }
    }

    /// Displacement, velocity and acceleration of the surface.
    pub(crate) fn shift(&self, time: f64) -> [Vector3<f64>; 3] {
        self.motion.map_or([Vector3::zeros(); 3], |motion| motion.at(time))
    }

    /// The pose of a link frame relative to the displaced surface.
    fn seen<A: Space>(
        &self,
        view: &View<A>,
        frame: FrameId,
        shift: Vector3<f64>,
    ) -> carom_chain::algebra::Pose<carom_chain::Spatial<f64>> {
        let mut pose = view.pose(frame);
        pose.translation -= shift;
        pose
    }

    /// Gap, contact point and normal at a state.
    pub(crate) fn at<A: Space>(&self, view: &View<A>, q: &[f64], time: f64) -> At<A> {
        let [shift, ..] = self.shift(time);
        match &self.kind {
            TouchKind::Ball { shape, centre, radius, point, normal } => {
                let centre = self.seen(view, shape.frame(), shift).point(*centre);
                let height = normal.dot(&(centre - point));
                let position = centre - normal * *radius + shift;
                let place =
                    Place { point: view.point(shape.frame(), position), against: None, position, normal: *normal };
                At { gap: height - radius, surface: Some(place) }
            }
            TouchKind::Pair { shape, obstacle } => {
                let found = gap(shape, &self.seen(view, shape.frame(), shift), obstacle);
                let position = found.on_robot + shift;
                let place =
                    Place { point: view.point(shape.frame(), position), against: None, position, normal: found.normal };
                At { gap: found.distance, surface: Some(place) }
            }
            TouchKind::Links { shape, other } => {
                let [a, b] = [shape, other].map(|shape| view.pose(shape.frame()));
                let found = gap_between((shape, &a), (other, &b));
                let place = Place {
                    point: view.point(shape.frame(), found.on_robot),
                    against: Some(view.point(other.frame(), found.on_environment)),
                    position: found.on_robot,
                    normal: found.normal,
                };
                At { gap: found.distance, surface: Some(place) }
            }
            TouchKind::Limit { q: at, bound, upper, .. } => {
                At { gap: if *upper { bound - q[*at] } else { q[*at] - bound }, surface: None }
            }
        }
    }

    /// The precomputed constants for [`Touch::look`]; `None` for other pairs than a ball and a half-space.
    pub(crate) fn ball_on_plane<A: Space>(&self, model: &A::Model) -> Option<BallOnPlane<A>> {
        let TouchKind::Ball { shape, centre, radius, point, normal } = &self.kind else { return None };
        let (centre, beside) = A::material_point(model, shape.frame(), *centre);
        let height = normal.dot(&(beside - point));
        Some(BallOnPlane { centre, normal: A::project(model, *normal), height, radius: *radius })
    }

    /// g and ġ.
    pub(crate) fn look<A: Space>(
        &self,
        ball: Option<&BallOnPlane<A>>,
        view: &View<A>,
        (q, qd): (&[f64], &[f64]),
        time: f64,
    ) -> Result<(f64, f64), SimError> {
        match (ball, &self.kind) {
            (Some(ball), TouchKind::Ball { normal, .. }) => {
                let [shift, velocity, _] = self.shift(time);
                let height = A::dot(ball.normal, view.kin.position(ball.centre)) + ball.height;
                let gap = height - ball.radius - normal.dot(&shift);
                let rate = A::dot(ball.normal, view.kin.point_velocity(ball.centre, qd)?) - normal.dot(&velocity);
                Ok((gap, rate))
            }
            _ => {
                let at = self.at(view, q, time);
                Ok((at.gap, self.rate(&at, view, qd, time)?))
            }
        }
    }

    /// All points of the pair with gaps of at most `within`.
    pub(crate) fn points<A: Space>(&self, view: &View<A>, q: &[f64], time: f64, within: f64) -> Vec<At<A>> {
        let mut points = match &self.kind {
            TouchKind::Pair { shape, obstacle } if !self.is_point() => {
                let [shift, ..] = self.shift(time);
                let corners = gap_points(shape, &self.seen(view, shape.frame(), shift), obstacle, f64::INFINITY);
                let place = |found: carom_contact::Gap| {
                    let position = found.on_robot + shift;
                    let place = Place {
                        point: view.point(shape.frame(), position),
                        against: None,
                        position,
                        normal: found.normal,
                    };
                    At { gap: found.distance, surface: Some(place) }
                };
                let mut points: Vec<At<A>> = corners.into_iter().map(place).collect();
                points.push(self.at(view, q, time));
                points
            }
            _ => vec![self.at(view, q, time)],
        };
        points.retain(|at| at.gap <= within);
        points
    }

    /// ġ.
    pub(crate) fn rate<A: Space>(&self, at: &At<A>, view: &View<A>, qd: &[f64], time: f64) -> Result<f64, SimError> {
        match (&self.kind, at.surface) {
            (TouchKind::Limit { v, upper, .. }, _) => Ok(if *upper { -qd[*v] } else { qd[*v] }),
            (_, Some(place)) => Ok(place.normal.dot(&self.u(&place, view, qd, time)?)),
            (_, None) => Ok(0.0),
        }
    }

    /// u.
    pub(crate) fn u<A: Space>(
        &self,
        place: &Place<A>,
        view: &View<A>,
        qd: &[f64],
        time: f64,
    ) -> Result<Vector3<f64>, SimError> {
        Ok(place.velocity(view, qd)? - self.shift(time)[1])
    }

    /// The row j.
    pub(crate) fn row<A: Space>(&self, at: &At<A>, view: &View<A>) -> Result<DVector<f64>, SimError> {
        match (&self.kind, at.surface) {
            (TouchKind::Limit { v, upper, .. }, _) => {
                let mut row = DVector::zeros(view.kin.chain().nv());
                row[*v] = if *upper { -1.0 } else { 1.0 };
                Ok(row)
            }
            (_, Some(place)) => place.row(view, place.normal),
            (_, None) => Ok(DVector::zeros(view.kin.chain().nv())),
        }
    }

    /// (g̈, u̇) at q̈ = 0 in closed form; `None` for pairs that need finite differences.
    ///
    /// For a ball on a plane with centre c, g̈ = n·(c̈ − s̈). The contact point stays below the centre, so u̇ is without the
    /// term ω × (ω × r) of the material point, r = −n radius.
    pub(crate) fn drift<A: Space>(
        &self,
        at: &At<A>,
        view: &mut View<A>,
        qd: &[f64],
        time: f64,
    ) -> Option<Result<(f64, Vector3<f64>), SimError>> {
        match (&self.kind, at.surface) {
            (TouchKind::Limit { .. }, _) => Some(Ok((0.0, Vector3::zeros()))),
            (TouchKind::Ball { shape, radius, normal, .. }, Some(place)) => {
                let mut closed = || {
                    let turning = view.angular_velocity(shape.frame(), qd)?;
                    let arm = -normal * *radius;
                    let u = view.drift(place.point, qd)? - turning.cross(&turning.cross(&arm)) - self.shift(time)[2];
                    Ok((normal.dot(&u), u))
                };
                Some(closed())
            }
            _ => None,
        }
    }
}
