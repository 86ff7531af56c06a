//! The pairs of shapes and obstacles that cannot touch at any configuration.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | c | origin of the first joint between world and shape, at q = 0 |
//! | R | sum of the offsets from c to the shape's centre, the strokes of the sliders, and the shape's radius, m |
//! | a | common direction of all hinge axes between world and shape, if they are parallel |
//! | [lo, hi] | range of the heights along a that the shape can reach, m |
//!
//! The shape stays in the ball (c, R). If all hinge axes are parallel to a (a planar arm), its heights along a change only by
//! the strokes of sliders, so it also stays in the slab [lo, hi]. Hinges are assumed to reach all angles and sliders all
//! positions within their limits. With a slider without limits, a planar joint or a floating base, R is infinite. If
//! sliders stay within their limits, no pair that can touch is left out.

use crate::gap::solid_gap;
use crate::obstacle::{Obstacle, Surface};
use crate::shape::LinkShape;
use crate::solid::Solid;
use carom_chain::algebra::{Pose, SpatialJoint};
use carom_chain::{Chain, Spatial};
use nalgebra::Vector3;
use std::fmt;

/// The reason why a pair cannot touch.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum LeftOut {
    /// No joint moves the link: it is fixed to the world.
    Fixed,
    /// Two links are out of each other's reach.
    Apart {
        /// Sum of the greatest distances of a point of each shape from the origin of the first joint between world and
        /// shape, m.
        reach: f64,
        /// Distance between these origins, m.
        distance: f64,
    },
    /// The obstacle is out of the shape's reach.
    OutOfReach {
        /// Greatest distance of a point of the shape from the origin c of the first joint, m.
        reach: f64,
        /// Distance of the obstacle from c, m.
        distance: f64,
    },
    /// The chain moves in parallel planes, and the obstacle does not intersect those of this shape.
    BesidePlane {
        /// Distance between them along the planes' normal, m; for a half-space, from the reachable region to the
        /// half-space.
        room: f64,
    },
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed => write!(f, "the link is fixed to the world"),
            Self::Apart { reach, distance } => {
                write!(f, "their reaches add up to {reach:.6} m, their first joints are {distance:.6} m apart")
            }
            Self::OutOfReach { reach, distance } => {
                write!(f, "its reach is {reach:.6} m, the obstacle is {distance:.6} m away")
            }
            Self::BesidePlane { room } => {
                write!(f, "it moves in parallel planes, the obstacle is {room:.6} m away from them")
            }
        }
    }
}

/// Why a shape cannot touch an obstacle at any q; `None` if it may.
pub fn out_of_reach(chain: &Chain, shape: &LinkShape, obstacle: &Obstacle) -> Option<LeftOut> {
    Region::of(chain, shape).map_or(Some(LeftOut::Fixed), |region| region.misses(obstacle))
}

/// Why the shapes of two links cannot touch at any q; `None` if they may.
pub fn apart(chain: &Chain, first: &LinkShape, second: &LinkShape) -> Option<LeftOut> {
    let (own, other) = match [first, second].map(|shape| Region::of(chain, shape)) {
        [None, None] => return Some(LeftOut::Fixed),
        [Some(own), Some(other)] => (own, other),
        [Some(own), None] => (own, Region::fixed(chain, second)?),
        [None, Some(other)] => (Region::fixed(chain, first)?, other),
    };
    let (reach, distance) = (own.reach + other.reach, (own.centre - other.centre).norm());
    (distance > reach).then_some(LeftOut::Apart { reach, distance })
}

/// A region that contains the shape at every configuration.
struct Region {
    centre: Vector3<f64>,
    reach: f64,
    slab: Option<Slab>,
}

struct Slab {
    axis: Vector3<f64>,
    low: f64,
    high: f64,
}

impl Region {
    /// `None` if the shape does not move.
    fn of(chain: &Chain, shape: &LinkShape) -> Option<Self> {
        let frame = chain.frames().iter().find(|frame| frame.name == shape.link())?;
        let last = frame.body?;
        let mut way: Vec<usize> = std::iter::successors(Some(last), |i| chain.bodies()[*i].parent).collect();
        way.reverse();
        let bodies = || way.iter().map(|i| (*i, &chain.bodies()[*i]));

        // At q = 0: position of c, and directions of the axes.
        let mut pose = Pose::<Spatial<f64>>::identity();
        let mut axes = Vec::with_capacity(way.len());
        let mut reach = 0.0;
        let mut strokes = Vec::new();
        for (i, body) in bodies() {
            pose = pose.then(&body.placement);
            let axis: Vector3<f64> = pose.rotation.column(2).into();
            let turns = matches!(body.joint, SpatialJoint::Revolute);
            axes.push((turns, axis));
            if i != way[0] {
                reach += body.placement.translation.norm();
            }
            if !turns {
                let stroke = stroke(chain, i);
                reach += stroke;
                strokes.push((axis, stroke));
            }
        }
        let centre = chain.bodies()[way[0]].placement.translation;
        let in_body = frame.pose.then(shape.origin());
        let (middle, radius) = shape.solid().bounding_sphere();
        reach += in_body.point(middle).norm() + radius;

        let floats = bodies().any(|(_, body)| matches!(body.joint, SpatialJoint::Floating(_)));
        let common = axes.iter().find(|(turns, _)| *turns && !floats).map(|(_, axis)| *axis);
        let axis = common.filter(|a| axes.iter().all(|(turns, b)| !turns || a.cross(b).norm() <= 1e-12));
        let slab = axis.map(|axis| {
            let place = pose.then(&in_body);
            let own = place.rotation.tr_mul(&axis);
            let height = axis.dot(&place.translation);
            let slide: f64 = strokes.iter().map(|(along, stroke)| slide(*stroke, axis.dot(along))).sum();
            let (low, high) = (shape.solid().lowest(own).0, -shape.solid().lowest(-own).0);
            Slab { axis, low: height + low - slide, high: height + high + slide }
        });
        // Enlarged by the rounding error of the sums.
        Some(Self { centre, reach: reach * (1.0 + 1e-12), slab })
    }

    /// That of a shape that does not move.
    fn fixed(chain: &Chain, shape: &LinkShape) -> Option<Self> {
        let frame = chain.frames().iter().find(|frame| frame.name == shape.link())?;
        let (middle, radius) = shape.solid().bounding_sphere();
        let centre = frame.pose.then(shape.origin()).point(middle);
        Some(Self { centre, reach: radius * (1.0 + 1e-12), slab: None })
    }

    fn misses(&self, obstacle: &Obstacle) -> Option<LeftOut> {
        let ball = Solid::Sphere { radius: 0.0 };
        let at = Pose { translation: self.centre, ..Pose::identity() };
        let distance = solid_gap(&ball, &at, obstacle).distance;
        if distance > self.reach {
            return Some(LeftOut::OutOfReach { reach: self.reach, distance });
        }
        let slab = self.slab.as_ref()?;
        let rounding = 1e-12 * (slab.low.abs() + slab.high.abs() + self.reach);
        let room = match obstacle.surface() {
            // The lowest point along n: its axial part is limited by the slab, the rest by the ball.
            Surface::HalfSpace { point, normal } => {
                let along = normal.dot(&slab.axis);
                let across = (normal - slab.axis * along).norm();
                let axial = (along * slab.low).min(along * slab.high);
                let centre = normal.dot(&self.centre) - along * slab.axis.dot(&self.centre);
                axial + centre - slide(self.reach, across) - normal.dot(point)
            }
            other => {
                let (low, high) = extent(other, obstacle.pose(), slab.axis);
                (low - slab.high).max(slab.low - high)
            }
        };
        (room > rounding).then_some(LeftOut::BesidePlane { room })
    }
}

/// Greatest distance of a slider from zero, m; infinite without limits and for joints that are not sliders.
fn stroke(chain: &Chain, index: usize) -> f64 {
    let body = &chain.bodies()[index];
    if !matches!(body.joint, SpatialJoint::Prismatic) {
        return f64::INFINITY;
    }
    // Joints of several coordinates have no limits.
    match chain.joint_of_velocity(body.v_index).map(|j| (j.limits.lower, j.limits.upper)) {
        Some((Some(lower), Some(upper))) => {
            let at = |q: f64| (body.ratio * q + body.shift).abs();
            at(lower).max(at(upper))
        }
        _ => f64::INFINITY,
    }
}

/// The projection of a stroke on an axis; zero for a perpendicular stroke, even an infinite one.
fn slide(stroke: f64, along: f64) -> f64 {
    if along.abs() <= 1e-12 { 0.0 } else { stroke * along.abs() }
}

/// The lowest and the highest coordinate of an obstacle along a unit vector.
fn extent(surface: &Surface, pose: &Pose<Spatial<f64>>, axis: Vector3<f64>) -> (f64, f64) {
    match surface {
        Surface::HalfSpace { .. } => (f64::NEG_INFINITY, f64::INFINITY),
        Surface::Solid { solid, .. } => {
            let (own, height) = (pose.rotation.tr_mul(&axis), axis.dot(&pose.translation));
            (height + solid.lowest(own).0, height - solid.lowest(-own).0)
        }
        Surface::Mesh { mesh, .. } => {
            let heights = mesh.vertices().iter().map(|v| axis.dot(&pose.point(*v)));
            heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| (low.min(h), high.max(h)))
        }
    }
}
