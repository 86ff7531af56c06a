//! Which pairs can touch at all, decided once.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | c | origin of the first joint below the world: it stays (or slides by its limits) |
//! | R | sum of the offsets from c to the shape's centre, the strokes of sliding joints, and the shape's own radius |
//! | a | axis that all turning joints on the way share, if they do |
//! | [lo, hi] | heights along a that the shape takes |
//!
//! The shape stays in the ball (c, R). If all joints turn about parallel axes a (a planar arm), heights along a change by
//! strokes only, so it also stays in the slab [lo, hi]. Turning joints are given all angles, sliding ones their limits;
//! a slider without limits, a planar joint and a floating base reach everything. Nothing that can touch is left out, if
//! sliding joints keep their limits.

use crate::obstacle::{Obstacle, Surface};
use crate::shape::LinkShape;
use crate::solid::Solid;
use crate::{gap::solid_gap, shape::pose_of};
use carom_chain::algebra::{Pose, SpatialJoint};
use carom_chain::{Chain, Coordinates, Spatial};
use nalgebra::Vector3;
use std::fmt;

/// A shape and an obstacle, by their place in the lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Pair {
    /// Index of the shape.
    pub shape: usize,
    /// Index of the obstacle.
    pub obstacle: usize,
}

/// Why a pair can't touch.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum LeftOut {
    /// The link is fixed to the world: no joint moves it.
    Fixed,
    /// The obstacle is beyond the shape's furthest reach.
    OutOfReach {
        /// R, m.
        reach: f64,
        /// From c to the obstacle, m.
        distance: f64,
    },
    /// The chain moves in parallel planes, and the obstacle is beside all those of this shape.
    BesidePlane {
        /// Room between them along the common axis, m.
        room: f64,
    },
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed => write!(f, "the link is fixed to the world"),
            Self::OutOfReach { reach, distance } => {
                write!(f, "it reaches {reach:.6} m, the obstacle is {distance:.6} m away")
            }
            Self::BesidePlane { room } => {
                write!(f, "it moves in planes, the obstacle is {room:.6} m beside them")
            }
        }
    }
}

/// What [`reachable_pairs`] finds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Reachable {
    /// The pairs to watch, by shape, then by obstacle.
    pub pairs: Vec<Pair>,
    /// The others, each with its reason.
    pub left_out: Vec<(Pair, LeftOut)>,
}

/// Sorts all pairs of a shape and an obstacle into those that may touch at some q and those that can't.
pub fn reachable_pairs(chain: &Chain, shapes: &[LinkShape], obstacles: &[Obstacle]) -> Reachable {
    let mut found = Reachable::default();
    for (i, shape) in shapes.iter().enumerate() {
        let region = Region::of(chain, shape);
        for (k, obstacle) in obstacles.iter().enumerate() {
            let pair = Pair { shape: i, obstacle: k };
            match region.as_ref().map_or(Some(LeftOut::Fixed), |region| region.misses(obstacle)) {
                Some(reason) => found.left_out.push((pair, reason)),
                None => found.pairs.push(pair),
            }
        }
    }
    found
}

/// Where a shape can be.
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

        // Everything at zero: where c is, and which way the axes point.
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
        // Rounding of the sums must not decide.
        Some(Self { centre, reach: reach * (1.0 + 1e-12), slab })
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
            // The lowest point along n: axial part in the slab, the rest in the ball.
            Surface::HalfSpace { point, normal } => {
                let along = normal.dot(&slab.axis);
                let across = (normal - slab.axis * along).norm();
                let axial = (along * slab.low).min(along * slab.high);
                let centre = normal.dot(&self.centre) - along * slab.axis.dot(&self.centre);
                axial + centre - slide(self.reach, across) - normal.dot(point)
            }
            other => {
                let (low, high) = extent(other, slab.axis);
                (low - slab.high).max(slab.low - high)
            }
        };
        (room > rounding).then_some(LeftOut::BesidePlane { room })
    }
}

/// How far a sliding joint goes from zero, m; infinite without limits.
fn stroke(chain: &Chain, index: usize) -> f64 {
    let body = &chain.bodies()[index];
    if !matches!(body.joint, SpatialJoint::Prismatic) {
        return f64::INFINITY;
    }
    let own = |v: &std::ops::Range<usize>| v.start == body.v_index && v.len() == 1;
    let joint = chain.joints().iter().find(|j| matches!(&j.coordinates, Coordinates::Own { v, .. } if own(v)));
    match joint.map(|j| (j.limits.lower, j.limits.upper)) {
        Some((Some(lower), Some(upper))) => {
            let at = |q: f64| (body.ratio * q + body.shift).abs();
            at(lower).max(at(upper))
        }
        _ => f64::INFINITY,
    }
}

/// A length's part along an axis; none of a length across it, even an infinite one.
fn slide(stroke: f64, along: f64) -> f64 {
    if along.abs() <= 1e-12 { 0.0 } else { stroke * along.abs() }
}

/// The heights of an obstacle along a unit vector.
fn extent(surface: &Surface, axis: Vector3<f64>) -> (f64, f64) {
    match surface {
        Surface::HalfSpace { .. } => (f64::NEG_INFINITY, f64::INFINITY),
        Surface::Solid { pose, solid } => {
            let pose = pose_of(pose);
            let (own, height) = (pose.rotation.tr_mul(&axis), axis.dot(&pose.translation));
            (height + solid.lowest(own).0, height - solid.lowest(-own).0)
        }
        Surface::Mesh { pose, mesh } => {
            let pose = pose_of(pose);
            let heights = mesh.vertices().iter().map(|v| axis.dot(&pose.point(*v)));
            heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| (low.min(h), high.max(h)))
        }
    }
}
