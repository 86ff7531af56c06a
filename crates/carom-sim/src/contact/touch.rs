//! Touches: the possible contacts of a chain. A touch is a pair of a link's shape and a surface, a pair of shapes of two
//! links, or a joint limit. The event loop treats all of them as a gap and a row whose product with qd is its rate.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | g, ġ | 1 | gap (> 0 open) and its rate | `gap`, `rate` |
//! | j | nv | ġ = j·qd − n·ṡ | `row` |
//! | s | 3 | displacement of a moving surface | [`SurfaceMotion`](super::SurfaceMotion) |
//! | u | 3 | velocity of the contact point relative to the surface, J qd − ṡ | `u` |
//! | J | 3×nv | Jacobian of the contact point; between two links, that of the first minus that of the second | `jacobian` |

use super::condition::ClosesWhile;
use super::pair::{Against, Pair};
use super::rule::ContactRule;
use super::surface::{Moving, Surface, SurfaceMotion};
use crate::error::{SimError, named};
use crate::state::MANY;
use carom_chain::{Chain, JointCoordinate};
use carom_contact::{LeftOut, LinkShape, Meeting, Solid, Surface as Form, link_shapes, out_of_reach, shapes_of_link};
use carom_impact::Frictionless;
use nalgebra::Vector3;
use std::sync::Arc;

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
    pub(crate) motion: Option<Moving>,
    pub(crate) closes_while: Option<ClosesWhile>,
}

#[derive(Debug, Clone)]
pub(crate) enum TouchKind {
    /// A ball on a link (a corner is a ball of radius 0), and a half-space.
    Ball { shape: Box<LinkShape>, centre: Vector3<f64>, radius: f64, point: Vector3<f64>, normal: Vector3<f64> },
    /// Any other pair of bodies: a contact of two of their parts, or (`None`) their nearest points. A pair that is divided
    /// has touches of both kinds; its nearest points then are a contact only where no contact of parts is as near.
    Pair { pair: Arc<Pair>, part: Option<Meeting> },
    /// A limit of a joint, at `bound` of the coordinate q that it has or follows: its gap is `slope` · (q − bound), in the unit of the joint. A
    /// joint that follows has its multiplier as the size of the slope.
    Limit { joint: String, q: usize, v: usize, bound: f64, slope: f64 },
}

/// The possible contacts, and the pairs that cannot touch, each with its reason.
#[derive(Debug, Clone, Default)]
pub struct Touches {
    /// The possible contacts.
    pub touches: Vec<Touch>,
    /// The pairs that cannot touch: name and reason.
    pub left_out: Vec<(String, LeftOut)>,
}

impl Touch {
    /// The pairs of every collision shape of one link with every one of another link.
    ///
    /// [`Touch::within_robots`] and [`Touch::between_robots`] choose the pairs by a rule.
    ///
    /// # Errors
    /// [`SimError::Chain`] for an unknown link; [`SimError::Named`] for a link without collision shape or a link paired with
    /// itself; [`SimError::Shape`] for an invalid mesh.
    pub fn between(chain: &Chain, link: &str, other: &str, contact: &ContactRule) -> Result<Vec<Self>, SimError> {
        let of = |name: &str| {
            chain.frame(name)?;
            let own = shapes_of_link(chain, name)?;
            let problem = if link == other {
                "is paired with itself: name two links"
            } else {
                "has no collision shape: give it one in the URDF"
            };
            if own.is_empty() || link == other {
                return Err(named("link", name, problem));
            }
            Ok(own)
        };
        let (own, others) = (of(link)?, of(other)?);
        let pairs = own.iter().flat_map(|shape| others.iter().map(move |other| (shape, other)));
        let mut touches = Vec::new();
        pairs.for_each(|(shape, other)| Self::add_links(&mut touches, shape, other, contact));
        Ok(touches)
    }

    /// The contacts of two shapes of links.
    pub(super) fn add_links(touches: &mut Vec<Self>, shape: &LinkShape, other: &LinkShape, contact: &ContactRule) {
        let pair = Pair::new(shape, Against::Link(Box::new(other.clone())), contact);
        Self::add_pair(touches, pair, other.link(), contact, None);
    }

    /// The pairs of every collision shape with every surface that it can reach at some configuration, and all joint limits,
    /// with Newton's coefficient of restitution `limit_restitution`. Pairs that are out of reach at every configuration are
    /// left out, which does not change the motion. Surfaces whose shape moves are always included.
    ///
    /// Each contact of a corner, edge, face or rim of the shape with a part of the surface is a touch of its own.
    ///
    /// # Errors
    /// [`SimError::Shape`] for an invalid mesh.
    pub fn all(chain: &Chain, surfaces: &[Surface], limit_restitution: f64) -> Result<Touches, SimError> {
        Self::of(chain, surfaces, limit_restitution, true)
    }

    /// The pairs of every collision shape with every surface, including those out of reach, and all joint limits.
    ///
    /// # Errors
    /// [`SimError::Shape`] for an invalid mesh.
    #[doc(hidden)]
    pub fn every(chain: &Chain, surfaces: &[Surface], limit_restitution: f64) -> Result<Vec<Self>, SimError> {
        Ok(Self::of(chain, surfaces, limit_restitution, false)?.touches)
    }

    /// [`Touch::all`], with the pairs out of reach unless they are to be `left_out`.
    pub(crate) fn of(
        chain: &Chain,
        surfaces: &[Surface],
        limit_restitution: f64,
        left_out: bool,
    ) -> Result<Touches, SimError> {
        // Without surfaces no shape is needed, and no mesh is read.
        let shapes = if surfaces.is_empty() { Vec::new() } else { link_shapes(chain)? };
        let mut found = Touches::default();
        // The reach of moving surfaces is not computed.
        let moves = |surface: &Surface| surface.motion.as_ref().is_some_and(SurfaceMotion::moves_shape);
        let (moving, still): (Vec<_>, Vec<_>) = surfaces.iter().partition(|surface| left_out && moves(surface));
        for shape in &shapes {
            for surface in &still {
                match left_out.then(|| out_of_reach(chain, shape, &surface.obstacle)).flatten() {
                    Some(why) => found.left_out.push((format!("{} on {}", shape.link(), surface.name), why)),
                    None => Self::add(&mut found.touches, shape, surface),
                }
            }
        }
        for surface in moving {
            shapes.iter().for_each(|shape| Self::add(&mut found.touches, shape, surface));
        }
        found.touches.extend(Self::limits(chain, limit_restitution));
        Ok(found)
    }

    fn add(touches: &mut Vec<Self>, shape: &LinkShape, surface: &Surface) {
        let Surface { name, obstacle, contact, motion } = surface;
        let corners = shape.corners();
        match obstacle.surface() {
            Form::HalfSpace { point, normal }
                if corners.len() <= MANY && !matches!(shape.solid(), Solid::Cylinder { .. }) =>
            {
                let (surface, name) = (Some(name.clone()), format!("{} on {name}", shape.link()));
                for (k, corner) in corners.iter().enumerate() {
                    let name = if corners.len() == 1 { name.clone() } else { format!("{name}, corner {}", k + 1) };
                    let (shape, centre, radius) = (Box::new(shape.clone()), corner.position, corner.radius);
                    let kind = TouchKind::Ball { shape, centre, radius, point: *point, normal: *normal };
                    let (contact, surface) = (contact.clone(), surface.clone());
                    let motion = motion.clone().map(Moving::Given);
                    touches.push(Self { name, contact, kind, surface, motion, closes_while: None });
                }
            }
            _ => {
                let pair = Pair::new(shape, Against::Obstacle(Box::new(obstacle.clone())), contact);
                Self::add_pair(touches, pair, name, contact, motion.clone().map(Moving::Given));
            }
        }
    }

    /// The contacts of the parts of a pair, and its nearest points.
    fn add_pair(
        touches: &mut Vec<Self>,
        (pair, meetings): (Pair, Vec<Meeting>),
        surface: &str,
        contact: &ContactRule,
        motion: Option<Moving>,
    ) {
        let pair = Arc::new(pair);
        let whole = format!("{} on {surface}", pair.shape.link());
        for part in meetings.into_iter().map(Some).chain([None]) {
            let name = part.map_or_else(|| whole.clone(), |part| format!("{whole}, {part}"));
            let kind = TouchKind::Pair { pair: pair.clone(), part };
            let (contact, surface, motion) = (contact.clone(), Some(surface.to_owned()), motion.clone());
            touches.push(Self { name, contact, kind, surface, motion, closes_while: None });
        }
    }

    /// The touches with each pair of bodies divided into contacts of parts where its contact is rigid or on a half-space, and undivided
    /// where it is compliant. For touches whose [`ContactRule::compliance`] was changed after they were made.
    #[doc(hidden)]
    pub fn divided(touches: Vec<Self>) -> Vec<Self> {
        let mut divided = Vec::new();
        for touch in touches {
            let whole = |pair: &Pair| pair.is_whole_under(&touch.contact);
            match &touch.kind {
                TouchKind::Pair { pair, part: Some(_) } if whole(pair) => {}
                TouchKind::Pair { pair, part: None } if pair.whole != whole(pair) => {
                    let made = Pair::new(&pair.shape, pair.against.clone(), &touch.contact);
                    let (surface, before) = (touch.surface().unwrap_or_default().to_owned(), divided.len());
                    Self::add_pair(&mut divided, made, &surface, &touch.contact, touch.motion.clone());
                    divided[before..].iter_mut().for_each(|new| new.closes_while.clone_from(&touch.closes_while));
                }
                _ => divided.push(touch),
            }
        }
        divided
    }

    /// The limits of every coordinate: its own and those of the joints that follow it, of which the nearer one counts.
    fn limits(chain: &Chain, restitution: f64) -> Vec<Self> {
        let mut touches: Vec<Self> = Vec::new();
        for joint in chain.joints() {
            let Some(JointCoordinate { q, v, multiplier, offset }) = chain.coordinate_of(joint) else { continue };
            if multiplier == 0.0 {
                continue;
            }
            for (bound, side) in [(joint.limits.lower, "lower"), (joint.limits.upper, "upper")] {
                let Some(bound) = bound.map(|bound| (bound - offset) / multiplier) else { continue };
                let upper = (side == "upper") == (multiplier > 0.0);
                let slope = if upper { -multiplier.abs() } else { multiplier.abs() };
                let kind = TouchKind::Limit { joint: joint.name.clone(), q, v, bound, slope };
                let name = format!("{side} limit of {}", joint.name);
                let contact = ContactRule::new(Frictionless { restitution });
                let new = Self { name, contact, kind, surface: None, motion: None, closes_while: None };
                let known = touches.iter_mut().find_map(|touch| match touch.kind {
                    TouchKind::Limit { q: own, slope: other, bound, .. } if own == q && (other < 0.0) == upper => {
                        Some((touch, bound))
                    }
                    _ => None,
                });
                match known {
                    Some((touch, known)) if (upper && bound < known) || (!upper && bound > known) => *touch = new,
                    Some(_) => {}
                    None => touches.push(new),
                }
            }
        }
        touches
    }

    /// The indices of those touches that a name means: that of a contact, of a link, or of a joint with limits.
    ///
    /// # Errors
    /// A name that means none, with those that there are.
    #[doc(hidden)] // for problem files
    pub fn named(touches: &[Self], name: &str) -> Result<Vec<usize>, String> {
        let links = |touch: &Self| touch.link() == Some(name) || touch.shapes().any(|shape| shape.link() == name);
        let meant = |touch: &Self| touch.name == name || links(touch) || touch.limit_of() == Some(name);
        let found: Vec<usize> = (0..touches.len()).filter(|k| meant(&touches[*k])).collect();
        if found.is_empty() {
            let known: Vec<&str> = touches.iter().map(|touch| touch.name.as_str()).collect();
            return Err(format!(
                "contact = \"{name}\" is no contact, link or joint with limits: the contacts are {}",
                known.join(", ")
            ));
        }
        Ok(found)
    }

    /// The shape of its link and that of the second link of a pair of links; none for a limit.
    pub(crate) fn shapes(&self) -> impl Iterator<Item = &LinkShape> {
        let (own, other) = match &self.kind {
            TouchKind::Ball { shape, .. } => (Some(&**shape), None),
            TouchKind::Pair { pair, .. } => (Some(&pair.shape), pair.other()),
            TouchKind::Limit { .. } => (None, None),
        };
        own.into_iter().chain(other)
    }

    /// Name of the link; `None` for a limit.
    pub fn link(&self) -> Option<&str> {
        self.shapes().next().map(LinkShape::link)
    }

    /// Name of the second link of a pair of links.
    pub fn other_link(&self) -> Option<&str> {
        self.shapes().nth(1).map(LinkShape::link)
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

    /// The coordinate of qd that a joint limit stops, and the derivative of its gap by it: the force on the coordinate for a unit of its own.
    pub(crate) fn stops(&self) -> Option<(usize, f64)> {
        match &self.kind {
            TouchKind::Limit { v, slope, .. } => Some((*v, *slope)),
            _ => None,
        }
    }

    /// Its links, with the greatest distance of a point of their shapes from their frames, m.
    pub(crate) fn extents(&self) -> impl Iterator<Item = (&str, f64)> {
        self.shapes().map(|shape| {
            let (centre, radius) = shape.solid().bounding_sphere();
            (shape.link(), shape.origin().translation.norm() + centre.norm() + radius)
        })
    }

    /// Whether both are contacts of the same pair, of its bodies or of their parts.
    pub(crate) fn is_of_the_same_pair(&self, other: &Self) -> bool {
        match (&self.kind, &other.kind) {
            (TouchKind::Pair { pair, .. }, TouchKind::Pair { pair: other, .. }) => Arc::ptr_eq(pair, other),
            _ => false,
        }
    }

    /// Whether it may close at a state (q, qd) of a motion of this pace.
    pub(crate) fn may_close(&self, state: &[f64], pace: f64) -> bool {
        self.closes_while.as_ref().is_none_or(|condition| condition.holds(state, pace))
    }

    /// Radius of a sphere about the body of its link, m; 0 for a limit.
    pub(crate) fn size(&self) -> f64 {
        self.shapes().next().map_or(0.0, |shape| shape.solid().bounding_sphere().1)
    }

    /// Whether it has a force during a finite time.
    pub(crate) fn is_compliant(&self) -> bool {
        self.contact.compliance.is_some()
    }

    /// Whether it is a contact of two parts (corners, edges, faces, rims) of bodies, for which there is also the touch of their
    /// nearest points. Compliant contacts have parts on half-spaces only.
    #[doc(hidden)]
    pub fn is_part(&self) -> bool {
        matches!(self.kind, TouchKind::Pair { part: Some(_), .. })
    }

    /// The pair, where it is the contact of two bodies and not of their parts.
    fn whole(&self) -> Option<&Pair> {
        match &self.kind {
            TouchKind::Pair { pair, part: None } => Some(pair),
            _ => None,
        }
    }

    /// Whether it is the contact of two bodies, and not of their parts.
    pub(crate) fn is_whole(&self) -> bool {
        self.whole().is_some()
    }

    /// Whether every contact of its bodies is a contact at one point, or is divided into such contacts.
    pub(crate) fn is_covered(&self) -> bool {
        self.whole().is_none_or(|pair| pair.is_point() || pair.is_complete())
    }

    /// Whether it is a contact at one point: bodies with faces or edges can touch at several.
    pub(crate) fn is_point(&self) -> bool {
        self.whole().is_none_or(Pair::is_point)
    }
}
