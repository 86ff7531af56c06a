//! The angles of hinges, and where their sines and cosines come from.

use crate::algebra::{Algebra, Real};

/// The angle of a hinge: `sense · q[coordinate] + shift`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Angle<T> {
    /// Its place in q.
    pub coordinate: usize,
    /// 1; −1 in the plane for a hinge that turns backwards; the ratio of a mimic joint.
    pub sense: T,
    /// What the zeros of its frames lie apart, rad.
    pub shift: T,
}

impl<T: Real> Angle<T> {
    /// The angle at q.
    #[inline(always)]
    pub(crate) fn at(&self, q: &[T]) -> T {
        self.sense * q[self.coordinate] + self.shift
    }
}

/// Where the sines and cosines of joint angles come from. (A trait for the same reason as [`crate::Finish`]: in lanes
/// the call of a closure cost more than the sines.)
pub trait Turned<A: Algebra> {
    /// Of the angle of body `i`, a hinge.
    fn sin_cos(&self, i: usize, angle: Angle<A::Scalar>) -> (A::Scalar, A::Scalar);
}

/// Of each body.
pub(crate) struct ByBody<'a, T> {
    pub sines: &'a [T],
    pub cosines: &'a [T],
}

impl<A: Algebra> Turned<A> for ByBody<'_, A::Scalar> {
    #[inline(always)]
    fn sin_cos(&self, i: usize, _: Angle<A::Scalar>) -> (A::Scalar, A::Scalar) {
        (self.sines[i], self.cosines[i])
    }
}
