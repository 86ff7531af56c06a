//! A row of hinges, with the quantities that do not depend on the configuration precomputed.
//!
//! Frames: the axes of a body may be rotated about its own hinge. They are chosen so that of every placement R = R_z(a)
//! R_x(b) R_z(c) only the tilt b remains; the rotations about z are added to the joint angles. Craig, *Introduction to
//! Robotics* (1989), section 3.5, gives each link such axes. The origins remain those of the file; Craig's go to infinity
//! for nearly parallel axes.
//!
//! Inertia: the [`base_parameters`] in these axes, which have no mass.

use super::fused::{BodyAt, Shape, Topology};
use crate::algebra::{Algebra, Pose, Real};
use crate::base_parameters::base_parameters;
use crate::chain::Body;
use crate::moves::{Hinge, Turning};
use crate::turned::{Angle, Turned};
use nalgebra::convert;
use std::ops::Range;

/// A row of hinges, one after another in the order of their coordinates.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct HingeRow<A: Algebra> {
    /// R_z(a) R_x(b) of the first.
    pub base: A::Rotation,
    /// The bodies, from the world outward.
    pub bodies: Vec<Hinged<A>>,
}

/// One body of a row of hinges and its parent hinge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hinged<A: Algebra> {
    /// Sine and cosine of the tilt b relative to the parent body.
    pub tilt: (A::Scalar, A::Scalar),
    /// The joint's origin relative to the previous one, in parent axes, m.
    pub offset: A::Vector,
    /// Angle of the joint = `sense` · q + `shift`.
    pub sense: A::Scalar,
    /// See `sense`.
    pub shift: A::Scalar,
    /// Inertia without mass, in body axes.
    pub turning: Turning<A>,
}

impl<A: Algebra> Hinged<A> {
    /// The angle of the row's joint `i`.
    #[inline(always)]
    pub fn angle(&self, i: usize) -> Angle<A::Scalar> {
        Angle { coordinate: i, sense: self.sense, shift: self.shift }
    }
}

impl<A: Algebra> HingeRow<A> {
    /// `None` for a chain that is not such a row.
    pub fn of(all: &[Body<A>]) -> Option<Self>
    where
        A: Algebra<Scalar = f64>,
    {
        let follows = |(i, b): (usize, &Body<A>)| {
            let forwards = b.ratio == 1.0 || A::ANGULAR == 1;
            A::turns(b.joint) && forwards && b.parent == i.checked_sub(1) && b.v_index == i && b.q_index == i
        };
        if all.is_empty() || !all.iter().enumerate().all(follows) {
            return None;
        }
        let about_z = |angle: f64| A::turn(A::no_rotation(), angle.sin(), angle.cos());
        let angles: Vec<[f64; 3]> = all.iter().map(|b| A::euler_angles(b.placement.rotation)).collect();
        // Each body's axes are rotated by the a of the next.
        let beyond = |i: usize| angles.get(i + 1).map_or(0.0, |[a, ..]| *a);
        let mut turned = Vec::with_capacity(angles.len());
        for (i, (body, [a, b, _])) in all.iter().zip(&angles).enumerate() {
            let offset = body.placement.translation;
            let placement = Pose {
                rotation: A::tilt(A::no_rotation(), b.sin(), b.cos()),
                translation: if i == 0 { offset } else { A::rotate(about_z(-a), offset) },
            };
            turned.push(Body { inertia: body.inertia.rotated(about_z(-beyond(i))), placement, ..*body });
        }
        let mut bodies = Vec::with_capacity(angles.len());
        for (i, (body, inertia)) in turned.iter().zip(base_parameters(&turned)).enumerate() {
            let [_, b, c] = angles[i];
            bodies.push(Hinged {
                tilt: b.sin_cos(),
                offset: body.placement.translation,
                sense: body.ratio,
                shift: body.shift + c + beyond(i),
                turning: Turning { first_moment: inertia.first_moment, rotational: inertia.rotational },
            });
        }
        let base = angles.first().map_or(A::no_rotation(), |[a, b, _]| A::tilt(about_z(*a), b.sin(), b.cos()));
        Some(Self { base, bodies })
    }

    /// The same row over another scalar.
    pub fn cast<U: Real>(&self) -> HingeRow<A::Cast<U>>
    where
        A: Algebra<Scalar = f64>,
    {
        let body = |b: &Hinged<A>| Hinged {
            tilt: (convert(b.tilt.0), convert(b.tilt.1)),
            offset: A::cast_vector(b.offset),
            sense: convert(b.sense),
            shift: convert(b.shift),
            turning: Turning {
                first_moment: A::cast_vector(b.turning.first_moment),
                rotational: A::cast_inertia(b.turning.rotational),
            },
        };
        HingeRow { base: A::cast_rotation(self.base), bodies: self.bodies.iter().map(body).collect() }
    }
}

/// The point is on the last body.
impl<A: Algebra> Topology for &HingeRow<A> {
    #[inline(always)]
    fn runs(self, i: usize) -> impl Iterator<Item = Range<usize>> {
        std::iter::once(0..i)
    }
    #[inline(always)]
    fn parent(self, i: usize) -> Option<usize> {
        i.checked_sub(1)
    }
    #[inline(always)]
    fn depth(self, i: usize) -> usize {
        i
    }
    #[inline(always)]
    fn coordinate(self, i: usize) -> usize {
        i
    }
    #[inline(always)]
    fn point(self, n: usize) -> usize {
        n - 1
    }
    #[inline(always)]
    fn moved(self, n: usize) -> Range<usize> {
        0..n
    }
}

impl<A: Algebra> Shape<A> for &HingeRow<A> {
    type Axis = Hinge<A>;
    #[inline(always)]
    fn place(
        self,
        i: usize,
        outer: Option<A::Rotation>,
        _: &[A::Scalar],
        turned: &impl Turned<A>,
    ) -> BodyAt<A, Hinge<A>> {
        let body = &self.bodies[i];
        let (placed, offset) = match outer {
            None => (self.base, body.offset),
            Some(outer) => (A::tilt(outer, body.tilt.0, body.tilt.1), A::rotate(outer, body.offset)),
        };
        let (sin, cos) = turned.sin_cos(i, body.angle(i));
        let rotation = A::turn(placed, sin, cos);
        BodyAt::at(rotation, offset, Hinge(A::hinge(rotation, body.sense)), body.turning.rotated(rotation))
    }
    #[inline(always)]
    fn shifted(self, _: usize, inertia: &Turning<A>, r: A::Vector) -> Turning<A> {
        inertia.shifted(r)
    }
}
