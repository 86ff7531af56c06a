//! A joint's motion subspace at one configuration (Featherstone's S, one column) and the inertia that the joint moves, for any
//! joint type or for hinges alone.
//!
//! If all joints are hinges, the joint type is known statically, and no body has mass left (see `base_parameters.rs`). The
//! recursions that become faster by this are generic over [`Subspace`]; which implementation they use is decided when the
//! chain is made. Gain (`docs/performance.md`): kinematics of arm7 1703 → 1521 instructions, the fused pass of humanoid29
//! 33 047 → 29 645. `tests/delassus.rs` compares both with the definitions.

use super::{HingeAngles, PreparedBody};
use crate::algebra::{Algebra, Axis, Force, Inertia};
use crate::scratch::Link;
use nalgebra::SimdComplexField;
use num_traits::Zero;
use std::ops::AddAssign;

/// The axis of a joint, in world axes about the joint's own origin, and the inertia that the joint moves.
pub(crate) trait Subspace<A: Algebra>: Copy {
    type Inertia: Copy + AddAssign;
    /// Whether bodies may share a coordinate.
    const COUPLED: bool;
    /// An axis of length zero.
    fn still() -> Self;
    /// Rotation of body `i` and offset of its origin from the parent's, for the parent's rotation `outer`; `None` is the world.
    fn place(
        body: &PreparedBody<A>,
        i: usize,
        outer: Option<A::Rotation>,
        q: &[A::Scalar],
        turned: &impl HingeAngles<A>,
    ) -> (A::Rotation, A::Vector);
    /// The axis of a body's joint, for the body's rotation.
    fn at_rotation(body: &PreparedBody<A>, rotation: A::Rotation) -> Self;
    /// The axis of a body's joint, for a body whose pose is known.
    fn of(body: &PreparedBody<A>, link: &Link<A>) -> Self;
    /// The axis as [`Axis`].
    fn axis(self) -> Axis<A>;
    /// Zero inertia.
    fn nothing() -> Self::Inertia;
    /// The inertia of a body without its children, in world axes.
    fn own(body: &PreparedBody<A>, rotation: A::Rotation) -> Self::Inertia;
    /// The composite inertia of a body, about the point at −r.
    fn shifted(body: &PreparedBody<A>, inertia: &Self::Inertia, r: A::Vector) -> Self::Inertia;
    /// I s
    fn momentum(self, inertia: &Self::Inertia) -> Force<A>;
    /// s · f
    fn project(self, force: Force<A>) -> A::Scalar;
    /// The velocity, at unit joint rate, of the point at r.
    fn at(self, r: A::Vector) -> A::Vector;
    /// A bound of that velocity at any pose, for lengths whose sum is `reach` between the joint and the point.
    fn lever(self, reach: A::Scalar) -> A::Scalar;
    /// Converts the inertia to [`Inertia`].
    fn whole(inertia: Self::Inertia) -> Inertia<A>;
    /// Converts from [`Inertia`]: the inverse of `whole`.
    fn part(inertia: Inertia<A>) -> Self::Inertia;
}

/// Any joint type.
impl<A: Algebra> Subspace<A> for Axis<A> {
    type Inertia = Inertia<A>;
    const COUPLED: bool = true;
    #[inline(always)]
    fn still() -> Self {
        Self::Turn(A::zero_angular())
    }
    #[inline(always)]
    fn place(
        body: &PreparedBody<A>,
        i: usize,
        outer: Option<A::Rotation>,
        q: &[A::Scalar],
        turned: &impl HingeAngles<A>,
    ) -> (A::Rotation, A::Vector) {
        if A::turns(body.joint) {
            return Hinge::place(body, i, outer, q, turned);
        }
        let (placed, offset) = (body.placing.placed(outer), body.offset(outer));
        let (rotation, moved) = A::move_joint(body.joint, placed, body.ratio, body.shift, &q[body.q_index..]);
        (rotation, A::plus(offset, moved))
    }
    #[inline(always)]
    fn at_rotation(body: &PreparedBody<A>, rotation: A::Rotation) -> Self {
        A::axis(body.joint, rotation).scaled(body.ratio)
    }
    #[inline(always)]
    fn of(_: &PreparedBody<A>, link: &Link<A>) -> Self {
        link.axis
    }
    #[inline(always)]
    fn axis(self) -> Axis<A> {
        self
    }
    #[inline(always)]
    fn nothing() -> Inertia<A> {
        Inertia::zero()
    }
    #[inline(always)]
    fn own(body: &PreparedBody<A>, rotation: A::Rotation) -> Inertia<A> {
        body.turned_inertia(rotation)
    }
    #[inline(always)]
    fn shifted(body: &PreparedBody<A>, inertia: &Inertia<A>, r: A::Vector) -> Inertia<A> {
        if body.massless { Hinge::whole(Hinge::part(*inertia).shifted(r)) } else { inertia.shifted(r) }
    }
    #[inline(always)]
    fn momentum(self, inertia: &Inertia<A>) -> Force<A> {
        inertia.along(self)
    }
    #[inline(always)]
    fn project(self, force: Force<A>) -> A::Scalar {
        self.dot(force)
    }
    #[inline(always)]
    fn at(self, r: A::Vector) -> A::Vector {
        self.point_velocity(r)
    }
    #[inline(always)]
    fn lever(self, reach: A::Scalar) -> A::Scalar {
        match self {
            Self::Turn(z) => {
                let mut length = A::angular_part(z, 0).simd_abs();
                for k in 1..A::ANGULAR {
                    length += A::angular_part(z, k).simd_abs();
                }
                reach * length
            }
            Self::Slide(z) => A::size(z),
        }
    }
    #[inline(always)]
    fn whole(inertia: Inertia<A>) -> Inertia<A> {
        inertia
    }
    #[inline(always)]
    fn part(inertia: Inertia<A>) -> Inertia<A> {
        inertia
    }
}

/// The axis of a hinge whose subtree has only hinges.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hinge<A: Algebra>(pub A::Angular);

/// Base inertial parameters of a hinge: first moment and rotational inertia, without mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Turning<A: Algebra> {
    pub first_moment: A::Vector,
    pub rotational: A::Rotational,
}

impl<A: Algebra> Turning<A> {
    /// The same about the point at −r.
    #[inline(always)]
    pub fn shifted(&self, r: A::Vector) -> Self {
        let h = self.first_moment;
        Self { first_moment: h, rotational: self.rotational + A::parallel_axis(A::plus(h, h), r) }
    }

    /// The same in rotated axes.
    #[inline(always)]
    pub fn rotated(&self, rotation: A::Rotation) -> Self {
        let (first_moment, rotational) = A::rotate_turning(rotation, self.first_moment, self.rotational);
        Self { first_moment, rotational }
    }
}

impl<A: Algebra> AddAssign for Turning<A> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.first_moment = A::plus(self.first_moment, other.first_moment);
        self.rotational += other.rotational;
    }
}

/// Chains of hinges alone.
impl<A: Algebra> Subspace<A> for Hinge<A> {
    type Inertia = Turning<A>;
    const COUPLED: bool = false;
    #[inline(always)]
    fn still() -> Self {
        Self(A::zero_angular())
    }
    #[inline(always)]
    fn place(
        body: &PreparedBody<A>,
        i: usize,
        outer: Option<A::Rotation>,
        _: &[A::Scalar],
        turned: &impl HingeAngles<A>,
    ) -> (A::Rotation, A::Vector) {
        let placed = match outer {
            // In the plane the whole placement of a hinge is in its angle.
            Some(outer) if A::ANGULAR == 1 => outer,
            _ => body.placing.placed(outer),
        };
        let (sin, cos) = turned.sin_cos(i, body.angle());
        (A::turn(placed, sin, cos), body.offset(outer))
    }
    #[inline(always)]
    fn at_rotation(body: &PreparedBody<A>, rotation: A::Rotation) -> Self {
        Self(A::hinge(rotation, body.ratio))
    }
    #[inline(always)]
    fn of(body: &PreparedBody<A>, link: &Link<A>) -> Self {
        Self::at_rotation(body, link.rotation)
    }
    #[inline(always)]
    fn axis(self) -> Axis<A> {
        Axis::Turn(self.0)
    }
    #[inline(always)]
    fn nothing() -> Turning<A> {
        Turning { first_moment: A::zero(), rotational: A::Rotational::zero() }
    }
    #[inline(always)]
    fn own(body: &PreparedBody<A>, rotation: A::Rotation) -> Turning<A> {
        Self::part(body.inertia).rotated(rotation)
    }
    #[inline(always)]
    fn shifted(_: &PreparedBody<A>, inertia: &Turning<A>, r: A::Vector) -> Turning<A> {
        inertia.shifted(r)
    }
    #[inline(always)]
    fn momentum(self, inertia: &Turning<A>) -> Force<A> {
        Force { moment: A::apply_inertia(inertia.rotational, self.0), force: A::swing(self.0, inertia.first_moment) }
    }
    #[inline(always)]
    fn project(self, force: Force<A>) -> A::Scalar {
        A::dot_angular(self.0, force.moment)
    }
    #[inline(always)]
    fn at(self, r: A::Vector) -> A::Vector {
        A::swing(self.0, r)
    }
    #[inline(always)]
    fn lever(self, reach: A::Scalar) -> A::Scalar {
        reach
    }
    #[inline(always)]
    fn whole(Turning { first_moment, rotational }: Turning<A>) -> Inertia<A> {
        Inertia { mass: A::Scalar::zero(), first_moment, rotational }
    }
    #[inline(always)]
    fn part(Inertia { first_moment, rotational, .. }: Inertia<A>) -> Turning<A> {
        Turning { first_moment, rotational }
    }
}
