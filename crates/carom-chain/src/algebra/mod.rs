//! Motion, force and inertia, in the plane and in space.
//!
//! Every algorithm is written once, over the trait [`Algebra`]. [`Planar`] (the group SE(2), 3-vectors) and [`Spatial`]
//! (SE(3), 6-vectors) implement it over any real scalar: `f64`, `f32`, SIMD lanes, dual numbers. The recursions do not
//! branch on the values of numbers, so they are valid for SIMD lanes and dual numbers.
//!
//! **Frames.** Every quantity of body *i* is expressed in *world axes* about *the body's own origin*. From a body to its
//! parent it is shifted by the offset `r` between the two origins, without a rotation, and without cancellation at any
//! distance of the chain from the world's origin.
//!
//! | symbol | size (plane, space) | meaning | our name |
//! | --- | --- | --- | --- |
//! | v = (ω, v) | 3, 6 | velocity: angular, and linear at the origin | `Motion` |
//! | f = (n, f) | 3, 6 | force: moment about the origin, and force | `Force` |
//! | s | 3, 6 | one column of a joint's motion subspace | `Axis` |
//! | I = (m, h, I) | – | mass, first moment m·c, rotational inertia about the origin | [`Inertia`] |
//! | Iᴬ | 3×3, 6×6 | articulated-body inertia | `Algebra::Articulated` |
//! | r | 2, 3 | from the parent's origin to the body's own | `offset` |
//!
//! Source: R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), chapters 2 and 4–7.

mod planar;
mod spatial;
mod symmetric;

pub use planar::Planar;
pub use spatial::Spatial;
#[doc(hidden)]
pub use {
    planar::{PlanarArticulated, PlanarJoint, Turn},
    spatial::{SpatialArticulated, SpatialJoint, z_onto},
    symmetric::Symmetric3,
};

use nalgebra::{RealField, SimdComplexField, SimdRealField, Vector2, Vector3};
use num_traits::Zero;
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A real scalar type of the recursions: `f64`, `f32`, SIMD lanes of them, dual numbers.
pub trait Real: SimdRealField + Copy {}
impl<T: SimdRealField + Copy> Real for T {}

/// Elements of a vector space over `T`.
#[doc(hidden)]
pub trait Linear<T>:
    Copy
    + Debug
    + PartialEq
    + Send
    + Sync
    + Zero
    + Sub<Output = Self>
    + Neg<Output = Self>
    + Mul<T, Output = Self>
    + AddAssign
    + SubAssign
    + 'static
{
}
impl<T: Real> Linear<T> for T {}
impl<T: Real> Linear<T> for Vector2<T> {}
impl<T: Real> Linear<T> for Vector3<T> {}
impl<T: Real> Linear<T> for Symmetric3<T> {}

mod sealed {
    pub trait Sealed {}
}

/// Geometry of the plane or of space: [`Planar`] or [`Spatial`], which are its only types. Where an interface is written once for
/// both, its quantities have the types
///
/// | type | plane | space |
/// | --- | --- | --- |
/// | `A::Scalar` | T | T |
/// | `A::Vector`: points, linear velocities, forces | 2-vector | 3-vector |
/// | `A::Angular`: angular velocities, moments | T | 3-vector |
/// | `A::Rotational`: rotational inertia | T | symmetric 3×3 matrix |
/// | `A::Rotation` | cosine and sine | 3×3 matrix |
pub trait Algebra: Geometry {}
impl<A: Geometry> Algebra for A {}

/// The types and operations of the algorithms.
#[doc(hidden)]
pub trait Geometry: sealed::Sealed + Copy + Debug + PartialEq + Send + Sync + 'static {
    /// The scalar type.
    type Scalar: Real;
    /// Points, linear velocities, forces: 2 or 3 numbers.
    type Vector: Linear<Self::Scalar>;
    /// Angular velocities and moments: 1 or 3 numbers.
    type Angular: Linear<Self::Scalar>;
    /// Rotational inertia: 1 number or a symmetric 3×3 matrix.
    type Rotational: Linear<Self::Scalar>;
    /// A rotation.
    type Rotation: Copy + Debug + PartialEq + Send + Sync + 'static;
    /// Joint types; each has one [`Axis`].
    type Joint: Copy + Debug + PartialEq + Send + Sync + 'static;
    /// Symmetric matrix of articulated inertia.
    type Articulated: Articulated<Self>;
    /// The same algebra over another scalar.
    type Cast<U: Real>: Algebra<Scalar = U, Joint = Self::Joint>;

    /// Dimension of angular quantities: 1 or 3.
    const ANGULAR: usize;
    /// Dimension of linear quantities: 2 or 3.
    const LINEAR: usize;

    /// Component `i` of a vector.
    fn linear_part(v: Self::Vector, i: usize) -> Self::Scalar;
    /// Component `i` of an angular quantity.
    fn angular_part(w: Self::Angular, i: usize) -> Self::Scalar;
    /// The zero vector. Defined here because nalgebra's took half the time of the kernel for two links in SIMD lanes.
    fn zero() -> Self::Vector;
    /// The zero angular quantity.
    fn zero_angular() -> Self::Angular;
    /// The vector with components `f(i)`.
    fn vector(f: impl Fn(usize) -> Self::Scalar) -> Self::Vector;

    /// a + b. This and the next two are defined here because they need a third of the instructions of nalgebra's loops, and
    /// because the compiler does not inline nalgebra's for SIMD lanes, and compiles them without AVX instructions.
    fn plus(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a − b
    fn minus(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a k
    fn times(a: Self::Vector, k: Self::Scalar) -> Self::Vector;
    /// a · b
    fn dot(a: Self::Vector, b: Self::Vector) -> Self::Scalar;
    /// The sum of the absolute components: a bound of the length, without a root.
    #[inline(always)]
    fn size(a: Self::Vector) -> Self::Scalar {
        let mut sum = Self::linear_part(a, 0).simd_abs();
        for k in 1..Self::LINEAR {
            sum += Self::linear_part(a, k).simd_abs();
        }
        sum
    }
    /// a · b of angular quantities.
    fn dot_angular(a: Self::Angular, b: Self::Angular) -> Self::Scalar;
    /// r × f, the moment of a force at r.
    fn moment(r: Self::Vector, f: Self::Vector) -> Self::Angular;
    /// ω × r, the velocity at r.
    fn swing(w: Self::Angular, r: Self::Vector) -> Self::Vector;
    /// ω × ω′ (zero in the plane).
    fn cross_angular(a: Self::Angular, b: Self::Angular) -> Self::Angular;

    /// The identity rotation.
    fn no_rotation() -> Self::Rotation;
    /// The rotation by `b`, then by `a`.
    fn compose(a: Self::Rotation, b: Self::Rotation) -> Self::Rotation;
    /// The inverse rotation.
    fn inverse(a: Self::Rotation) -> Self::Rotation;
    /// R v
    fn rotate(a: Self::Rotation, v: Self::Vector) -> Self::Vector;
    /// R I Rᵀ
    fn rotate_inertia(a: Self::Rotation, i: Self::Rotational) -> Self::Rotational;
    /// I ω
    fn apply_inertia(i: Self::Rotational, w: Self::Angular) -> Self::Angular;
    /// ω× I + (ω× I)ᵀ: the rate of the rotational inertia of a body that turns (zero in the plane).
    fn inertia_rate(i: Self::Rotational, w: Self::Angular) -> Self::Rotational;
    /// The sum of the principal moments of inertia; in the plane the inertia itself.
    fn trace(i: Self::Rotational) -> Self::Scalar;
    /// I⁻¹ n, also for an inertia that is zero about an axis (a thin rod). `None` if n has a component along such an axis
    /// that exceeds rounding.
    fn solve_inertia(i: Self::Rotational, n: Self::Angular) -> Option<Self::Angular>
    where
        Self::Scalar: RealField;
    /// The increase of the rotational inertia when the reference point moves by −r: `−(r× h× + (h + m r)× r×)` for the first
    /// moment h. `twice` = 2h + m r is the sum of the first moments about the two points.
    fn parallel_axis(twice: Self::Vector, r: Self::Vector) -> Self::Rotational;

    /// `placed` R_z(angle): the rotation of the child of a hinge, for the sine and cosine of the joint angle and the rotation
    /// `placed` of the joint's frame.
    fn turn(placed: Self::Rotation, sin: Self::Scalar, cos: Self::Scalar) -> Self::Rotation;
    /// The axis of a hinge in world axes, for the child's rotation. In the plane it is `sense`: 1, or −1 for an axis opposite
    /// to the plane's normal.
    fn hinge(rotation: Self::Rotation, sense: Self::Scalar) -> Self::Angular;
    /// The angles (a, b, c), rad, of R = R_z(a) R_x(b) R_z(c). In the plane a and b are zero.
    fn euler_angles(rotation: Self::Rotation) -> [Self::Scalar; 3]
    where
        Self::Scalar: RealField;
    /// `placed` R_x(angle), for the sine and cosine of the angle; in the plane `placed`.
    fn tilt(placed: Self::Rotation, sin: Self::Scalar, cos: Self::Scalar) -> Self::Rotation;
    /// The part of a body's inertia that is invariant under rotation about its hinge (its z axis): the mass on the axis, and
    /// a rotational inertia that is equal about all axes perpendicular to it.
    fn unturned(inertia: Inertia<Self>) -> Inertia<Self>;
    /// First moment and rotational inertia in rotated axes, for a body without its invariant part [`unturned`](Self::unturned).
    fn rotate_turning(a: Self::Rotation, h: Self::Vector, i: Self::Rotational) -> (Self::Vector, Self::Rotational);
    /// Whether the joint is a hinge.
    fn turns(joint: Self::Joint) -> bool;
    /// The joint transform: for the rotation `placed` of the joint's frame (world axes), the rotation of the child and the
    /// displacement of its origin, m. `q` starts at the joint's first coordinate; the position of a joint of one degree of
    /// freedom is `ratio · q[0] + shift`.
    fn move_joint(
        joint: Self::Joint,
        placed: Self::Rotation,
        ratio: Self::Scalar,
        shift: Self::Scalar,
        q: &[Self::Scalar],
    ) -> (Self::Rotation, Self::Vector);
    /// The joint's axis in world axes, for the child's rotation.
    fn axis(joint: Self::Joint, rotation: Self::Rotation) -> Axis<Self>;
    /// Whether the joint is one of the axes 2 to 6 of a floating joint, which move with the same body as the first.
    fn rides_along(joint: Self::Joint) -> bool;

    /// The same vector over another scalar.
    fn cast_vector<U: Real>(v: Self::Vector) -> <Self::Cast<U> as Geometry>::Vector;
    /// The same rotation over another scalar.
    fn cast_rotation<U: Real>(a: Self::Rotation) -> <Self::Cast<U> as Geometry>::Rotation;
    /// The same rotational inertia over another scalar.
    fn cast_inertia<U: Real>(i: Self::Rotational) -> <Self::Cast<U> as Geometry>::Rotational;
}

/// A symmetric matrix of articulated inertia: the operations of the articulated-body recursion.
#[doc(hidden)]
pub trait Articulated<A: Algebra>: Copy + Debug + Send + Sync + AddAssign + 'static {
    /// A rigid body's inertia.
    fn from_rigid(inertia: &Inertia<A>) -> Self;
    /// Iᴬ s
    fn along(&self, s: Axis<A>) -> Force<A>;
    /// Iᴬ − U Uᵀ / D, given 1/D
    fn without(&self, u: Force<A>, inverse_d: A::Scalar) -> Self;
    /// The same inertia about the point at −r.
    fn shifted(&self, r: A::Vector) -> Self;
}

/// A velocity or acceleration: rad/s and m/s, or their rates.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion<A: Algebra> {
    /// Angular part.
    pub angular: A::Angular,
    /// Linear part, at the reference point.
    pub linear: A::Vector,
}

/// A force or impulse: N m and N, or N m s and N s.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Force<A: Algebra> {
    /// Moment about the reference point.
    pub moment: A::Angular,
    /// Force.
    pub force: A::Vector,
}

/// One column of a joint's motion subspace, about the joint's own origin.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Axis<A: Algebra> {
    /// Rotation about this direction (unit, times the ratio of a mimic joint).
    Turn(A::Angular),
    /// Translation along this direction (unit, times the ratio of a mimic joint).
    Slide(A::Vector),
}

/// A rigid body's inertia about a reference point.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertia<A: Algebra> {
    /// Mass, kg.
    pub mass: A::Scalar,
    /// First moment: mass times centre of mass, kg m.
    pub first_moment: A::Vector,
    /// Rotational inertia about the reference point, kg m².
    pub rotational: A::Rotational,
}

/// A position and a rotation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose<A: Algebra> {
    /// Rotation from the axes of the inner frame to those of the outer frame.
    pub rotation: A::Rotation,
    /// Position of the inner frame's origin in the outer frame, m.
    pub translation: A::Vector,
}

impl<A: Algebra> Pose<A> {
    /// The identity.
    #[inline(always)]
    pub fn identity() -> Self {
        Self { rotation: A::no_rotation(), translation: A::zero() }
    }

    /// The product `self` · `inner`: the pose of a frame that has the pose `inner` in this one.
    #[inline(always)]
    pub fn then(&self, inner: &Self) -> Self {
        Self { rotation: A::compose(self.rotation, inner.rotation), translation: self.point(inner.translation) }
    }

    /// The coordinates in the outer frame of a point given in the inner frame, m.
    #[inline(always)]
    pub fn point(&self, p: A::Vector) -> A::Vector {
        self.translation + A::rotate(self.rotation, p)
    }

    /// The inverse pose.
    #[inline(always)]
    pub fn inverse(&self) -> Self {
        let back = A::inverse(self.rotation);
        Self { rotation: back, translation: -A::rotate(back, self.translation) }
    }
}

impl<A: Algebra> Motion<A> {
    /// Zero motion.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { angular: A::zero_angular(), linear: A::zero() }
    }

    /// The same motion with the linear part at the point `r` from the reference point: v + ω × r.
    #[inline(always)]
    pub fn shifted(self, r: A::Vector) -> Self {
        Self { angular: self.angular, linear: self.linear + A::swing(self.angular, r) }
    }

    /// The spatial cross product v × s: the rate of change of a motion `s` that moves with a body of velocity v. (Featherstone
    /// eq. 2.31.)
    #[inline(always)]
    pub fn carry(self, s: Motion<A>) -> Self {
        Self {
            angular: A::cross_angular(self.angular, s.angular),
            linear: A::swing(self.angular, s.linear) - A::swing(s.angular, self.linear),
        }
    }

    /// The spatial cross product v ×* f: the rate of change of a momentum `f` that moves with a body of velocity v.
    /// (Featherstone eq. 2.32.)
    #[inline(always)]
    pub fn carry_force(self, f: Force<A>) -> Force<A> {
        Force {
            moment: A::cross_angular(self.angular, f.moment) + A::moment(self.linear, f.force),
            force: A::swing(self.angular, f.force),
        }
    }
}

impl<A: Algebra> Add for Motion<A> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { angular: self.angular + other.angular, linear: self.linear + other.linear }
    }
}

impl<A: Algebra> Force<A> {
    /// Zero force.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { moment: A::zero_angular(), force: A::zero() }
    }

    /// The force `f` acting at `r` from the reference point.
    #[inline(always)]
    pub fn at(r: A::Vector, f: A::Vector) -> Self {
        Self { moment: A::moment(r, f), force: f }
    }

    /// Power v · f.
    #[inline(always)]
    pub fn power(self, v: Motion<A>) -> A::Scalar {
        A::dot_angular(v.angular, self.moment) + A::dot(v.linear, self.force)
    }

    /// The same force about the point at −r: n + r × f.
    #[inline(always)]
    pub fn shifted(self, r: A::Vector) -> Self {
        Self { moment: self.moment + A::moment(r, self.force), force: self.force }
    }
}

impl<A: Algebra> Add for Force<A> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { moment: self.moment + other.moment, force: self.force + other.force }
    }
}

impl<A: Algebra> Sub for Force<A> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { moment: self.moment - other.moment, force: self.force - other.force }
    }
}

impl<A: Algebra> AddAssign for Force<A> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<A: Algebra> Mul<A::Scalar> for Force<A> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: A::Scalar) -> Self {
        Self { moment: self.moment * k, force: self.force * k }
    }
}

impl<A: Algebra> Axis<A> {
    /// s · f: the projection of a force on the axis, that is the joint force.
    #[inline(always)]
    pub fn dot(self, f: Force<A>) -> A::Scalar {
        match self {
            Self::Turn(z) => A::dot_angular(z, f.moment),
            Self::Slide(z) => A::dot(z, f.force),
        }
    }

    /// s q̇, the motion of the joint at this rate.
    #[inline(always)]
    pub fn at_rate(self, rate: A::Scalar) -> Motion<A> {
        match self {
            Self::Turn(z) => Motion { angular: z * rate, linear: A::zero() },
            Self::Slide(z) => Motion { angular: A::zero_angular(), linear: z * rate },
        }
    }

    /// The velocity, at unit joint rate, of the point at `r` from the joint's origin.
    #[inline(always)]
    pub fn point_velocity(self, r: A::Vector) -> A::Vector {
        match self {
            Self::Turn(z) => A::swing(z, r),
            Self::Slide(z) => z,
        }
    }

    /// The axis times the ratio of a mimic joint.
    #[inline(always)]
    pub fn scaled(self, ratio: A::Scalar) -> Self {
        match self {
            Self::Turn(z) => Self::Turn(z * ratio),
            Self::Slide(z) => Self::Slide(z * ratio),
        }
    }
}

impl<A: Algebra> Inertia<A> {
    /// Zero inertia.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { mass: A::Scalar::zero(), first_moment: A::zero(), rotational: A::Rotational::zero() }
    }

    /// The inertia about a reference point, from the mass (kg), the centre of mass relative to that point (m) and the
    /// rotational inertia about the centre of mass (kg m²).
    #[inline(always)]
    pub fn from_com(mass: A::Scalar, com: A::Vector, inertia_at_com: A::Rotational) -> Self {
        let at_com = Self { mass, first_moment: A::zero(), rotational: inertia_at_com };
        at_com.shifted(com)
    }

    /// The same over another scalar.
    pub(crate) fn cast<U: Real>(&self) -> Inertia<A::Cast<U>>
    where
        A: Algebra<Scalar = f64>,
    {
        Inertia {
            mass: nalgebra::convert(self.mass),
            first_moment: A::cast_vector(self.first_moment),
            rotational: A::cast_inertia(self.rotational),
        }
    }

    /// I v, the momentum at velocity v.
    #[inline(always)]
    pub fn apply(&self, v: Motion<A>) -> Force<A> {
        Force {
            moment: A::apply_inertia(self.rotational, v.angular) + A::moment(self.first_moment, v.linear),
            force: v.linear * self.mass + A::swing(v.angular, self.first_moment),
        }
    }

    /// I s, the momentum at unit joint rate.
    #[inline(always)]
    pub fn along(&self, s: Axis<A>) -> Force<A> {
        match s {
            Axis::Turn(z) => {
                Force { moment: A::apply_inertia(self.rotational, z), force: A::swing(z, self.first_moment) }
            }
            Axis::Slide(z) => Force { moment: A::moment(self.first_moment, z), force: z * self.mass },
        }
    }

    /// dI/dt = v×* I − I v× about a fixed point, for a body of velocity v: its mass is zero.
    #[inline(always)]
    pub(crate) fn rate(&self, v: Motion<A>) -> Self {
        let h = self.first_moment;
        Self {
            mass: A::Scalar::zero(),
            first_moment: self.apply(v).force,
            rotational: A::inertia_rate(self.rotational, v.angular) + A::parallel_axis(h + h, v.linear),
        }
    }

    /// The same body about the point at −r.
    #[inline(always)]
    pub fn shifted(&self, r: A::Vector) -> Self {
        let h = self.first_moment;
        Self {
            mass: self.mass,
            first_moment: h + r * self.mass,
            rotational: self.rotational + A::parallel_axis(h + h + r * self.mass, r),
        }
    }

    /// The same body in rotated axes.
    #[inline(always)]
    pub fn rotated(&self, rotation: A::Rotation) -> Self {
        Self {
            mass: self.mass,
            first_moment: A::rotate(rotation, self.first_moment),
            rotational: A::rotate_inertia(rotation, self.rotational),
        }
    }

    /// The same body, given in an inner frame, in the outer frame of `pose`.
    #[inline(always)]
    pub fn placed(&self, pose: &Pose<A>) -> Self {
        self.rotated(pose.rotation).shifted(pose.translation)
    }
}

impl<A: Algebra> AddAssign for Inertia<A> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.mass += other.mass;
        self.first_moment += other.first_moment;
        self.rotational += other.rotational;
    }
}
