//! Angles of hinges, and the source of their sines and cosines.

use crate::algebra::{Algebra, Real};

/// The angle of a hinge: `sense · q[coordinate] + shift`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Angle<T> {
    /// Its index in q.
    pub coordinate: usize,
    /// 1; −1 in the plane for a hinge whose axis is opposite to the plane's normal; the ratio of a mimic joint.
    pub sense: T,
    /// Constant part of the angle, rad: the angle about the axis between the frames that it connects.
    pub shift: T,
}

impl<T: Real> Angle<T> {
    /// The angle at q.
    #[inline(always)]
    pub(crate) fn at(&self, q: &[T]) -> T {
        self.sense * q[self.coordinate] + self.shift
    }
}

/// Source of the sines and cosines of joint angles. It is a trait because, as for [`crate::Visit`], inlining of a closure
/// cannot be forced: in SIMD lanes the call of a closure cost more than the sines.
pub trait HingeAngles<A: Algebra> {
    /// (sin, cos) of the angle of body `i`, whose joint is a hinge.
    fn sin_cos(&self, i: usize, angle: Angle<A::Scalar>) -> (A::Scalar, A::Scalar);
}

/// Precomputed sines and cosines, indexed by body.
pub(crate) struct ByBody<'a, T> {
    pub sines: &'a [T],
    pub cosines: &'a [T],
}

impl<A: Algebra> HingeAngles<A> for ByBody<'_, A::Scalar> {
    #[inline(always)]
    fn sin_cos(&self, i: usize, _: Angle<A::Scalar>) -> (A::Scalar, A::Scalar) {
        (self.sines[i], self.cosines[i])
    }
}
