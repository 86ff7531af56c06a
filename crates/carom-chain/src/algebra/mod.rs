//! Motion, force and inertia, in the plane and in space.
//!
//! One source of every algorithm serves both: it is written against [`Algebra`], which [`Planar`] (the group SE(2),
//! 3-vectors) and [`Spatial`] (SE(3), 6-vectors) implement, over any real scalar: `f64`, `f32`, SIMD lanes, dual
//! numbers. The kernels are free of branches on numbers, so lanes and duals pass through them unharmed.
//!
//! **Frames.** Every quantity of body *i* is written in *world axes* about *the body's own origin*. Going from a body
//! to its parent is then a pure shift by the offset `r` between the two origins: no rotation, and no cancellation
//! however far the chain is from the world's origin.
//!
//! | symbol | size (plane, space) | meaning | our name |
//! | --- | --- | --- | --- |
//! | v = (ω, v) | 3, 6 | velocity: angular, and linear at the origin | [`Motion`] |
//! | f = (n, f) | 3, 6 | force: moment about the origin, and force | [`Force`] |
//! | s | 3, 6 | one column of a joint's motion subspace | [`Axis`] |
//! | I = (m, h, I) | – | mass, first moment m·c, rotational inertia about the origin | [`Inertia`] |
//! | Iᴬ | 3×3, 6×6 | articulated-body inertia | [`Algebra::Articulated`] |
//! | r | 2, 3 | from the parent's origin to the body's own | `offset` |
//!
//! Six-vectors put the angular part first wherever they are exported as one array.
//! Source: R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), chapters 2 and 4–7.

mod planar;
mod spatial;
mod symmetric;

pub use planar::{Planar, PlanarArticulated, PlanarJoint, Turn};
pub use spatial::{Spatial, SpatialArticulated, SpatialJoint, z_onto};
pub use symmetric::Symmetric3;

use nalgebra::{RealField, SimdRealField};
use num_traits::Zero;
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A real scalar that the kernels run on: `f64`, `f32`, SIMD lanes of them, dual numbers.
pub trait Real: SimdRealField + Copy {}
impl<T: SimdRealField + Copy> Real for T {}

/// Elements of a vector space over `T`.
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
impl<T, V> Linear<T> for V where
    V: Copy
        + Debug
        + PartialEq
        + Send
        + Sync
        + Zero
        + Sub<Output = V>
        + Neg<Output = V>
        + Mul<T, Output = V>
        + AddAssign
        + SubAssign
        + 'static
{
}

mod sealed {
    pub trait Sealed {}
}

/// The geometry that the algorithms need of the plane or of space. Sealed: [`Planar`] and [`Spatial`] are all there is.
pub trait Algebra: sealed::Sealed + Copy + Debug + PartialEq + Send + Sync + 'static {
    /// The scalar.
    type Scalar: Real;
    /// Points, linear velocities, forces: 2 or 3 numbers.
    type Vector: Linear<Self::Scalar>;
    /// Angular velocities and moments: 1 or 3 numbers.
    type Angular: Linear<Self::Scalar>;
    /// Rotational inertia: 1 number or a symmetric 3×3 matrix.
    type Rotational: Linear<Self::Scalar>;
    /// A rotation.
    type Rotation: Copy + Debug + PartialEq + Send + Sync + 'static;
    /// The kinds of joint; each moves along one [`Axis`].
    type Joint: Copy + Debug + PartialEq + Send + Sync + 'static;
    /// Symmetric matrix of articulated inertia.
    type Articulated: Articulated<Self>;
    /// The same algebra over another scalar.
    type Cast<U: Real>: Algebra<Scalar = U, Joint = Self::Joint>;

    /// Dimension of angular quantities.
    const ANGULAR: usize;
    /// Dimension of linear quantities.
    const LINEAR: usize;

    /// Component `i` of a vector.
    fn linear_part(v: Self::Vector, i: usize) -> Self::Scalar;
    /// Component `i` of an angular quantity.
    fn angular_part(w: Self::Angular, i: usize) -> Self::Scalar;
    /// The vector of zeros: said here because nalgebra's own costs a lane kernel of two links half its time.
    fn zero() -> Self::Vector;
    /// No turning.
    fn zero_angular() -> Self::Angular;
    /// The vector with components `f(i)`.
    fn vector(f: impl Fn(usize) -> Self::Scalar) -> Self::Vector;

    /// a + b. This and the next two are written out here because in lanes the compiler leaves nalgebra's as functions of
    /// their own, without the vectors of the processor, and because they take a third of the instructions of its loops.
    fn plus(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a − b
    fn minus(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a k
    fn times(a: Self::Vector, k: Self::Scalar) -> Self::Vector;
    /// a · b
    fn dot(a: Self::Vector, b: Self::Vector) -> Self::Scalar;
    /// a · b of angular quantities.
    fn dot_angular(a: Self::Angular, b: Self::Angular) -> Self::Scalar;
    /// r × f, the moment of a force at r.
    fn moment(r: Self::Vector, f: Self::Vector) -> Self::Angular;
    /// ω × r, the velocity at r.
    fn swing(w: Self::Angular, r: Self::Vector) -> Self::Vector;
    /// ω × ω′ (zero in the plane).
    fn cross_angular(a: Self::Angular, b: Self::Angular) -> Self::Angular;

    /// The rotation that turns nothing.
    fn no_rotation() -> Self::Rotation;
    /// First `b`, then `a`.
    fn compose(a: Self::Rotation, b: Self::Rotation) -> Self::Rotation;
    /// The rotation backwards.
    fn inverse(a: Self::Rotation) -> Self::Rotation;
    /// R v
    fn rotate(a: Self::Rotation, v: Self::Vector) -> Self::Vector;
    /// R I Rᵀ
    fn rotate_inertia(a: Self::Rotation, i: Self::Rotational) -> Self::Rotational;
    /// I ω
    fn apply_inertia(i: Self::Rotational, w: Self::Angular) -> Self::Angular;
    /// The sum of the principal moments: the size of a rotational inertia.
    fn trace(i: Self::Rotational) -> Self::Scalar;
    /// I⁻¹ n. A thin rod has no inertia about its own axis: what n has along such an axis counts only if it is more than
    /// rounding, and then there is no answer.
    fn solve_inertia(i: Self::Rotational, n: Self::Angular) -> Option<Self::Angular>
    where
        Self::Scalar: RealField;
    /// The growth of rotational inertia when the reference moves by −r: `−(r× h× + (h + m r)× r×)` for first moment h,
    /// given `twice` = 2h + m r, the sum of the first moments before and after.
    fn parallel_axis(twice: Self::Vector, r: Self::Vector) -> Self::Rotational;

    /// A hinge's rotation: first the angle of this sine and cosine about the hinge, then `placed`.
    fn turn(placed: Self::Rotation, sin: Self::Scalar, cos: Self::Scalar) -> Self::Rotation;
    /// The axis of a hinge in world axes, for the child's rotation. In the plane a hinge may turn backwards, `sense` −1.
    fn hinge(rotation: Self::Rotation, sense: Self::Scalar) -> Self::Angular;
    /// A rotation as turns about z, x and z again, the last one first: R = R_z(a) R_x(b) R_z(c). In the plane c is all.
    fn euler_angles(rotation: Self::Rotation) -> [Self::Scalar; 3]
    where
        Self::Scalar: RealField;
    /// First a turn about x by the angle of this sine and cosine, then `placed`; in the plane nothing.
    fn tilt(placed: Self::Rotation, sin: Self::Scalar, cos: Self::Scalar) -> Self::Rotation;
    /// What a hinge's turning does not change of the inertia that it carries: its mass on the axis, and a rotational
    /// inertia that is the same about all axes across it.
    fn unturned(inertia: Inertia<Self>) -> Inertia<Self>;
    /// First moment and rotational inertia in rotated axes, of a body that has nothing left of its [`Algebra::unturned`].
    fn rotate_turning(a: Self::Rotation, h: Self::Vector, i: Self::Rotational) -> (Self::Vector, Self::Rotational);
    /// Whether the joint is a hinge.
    fn turns(joint: Self::Joint) -> bool;
    /// Moves a joint: from the pose of its frame before the motion (`placed`, world axes) to the rotation of the child
    /// and the displacement of its origin. `q` starts at the joint's own coordinates; 1-dof joints are at
    /// `ratio · q[0] + shift`.
    fn move_joint(
        joint: Self::Joint,
        placed: Self::Rotation,
        ratio: Self::Scalar,
        shift: Self::Scalar,
        q: &[Self::Scalar],
    ) -> (Self::Rotation, Self::Vector);
    /// The joint's axis in world axes, for the child's rotation.
    fn axis(joint: Self::Joint, rotation: Self::Rotation) -> Axis<Self>;
    /// Whether the joint's axis is carried by the same body as the previous one's (axes 2 to 6 of a floating joint).
    fn rides_along(joint: Self::Joint) -> bool;

    /// The same vector over another scalar.
    fn cast_vector<U: Real>(v: Self::Vector) -> <Self::Cast<U> as Algebra>::Vector;
    /// The same rotation over another scalar.
    fn cast_rotation<U: Real>(a: Self::Rotation) -> <Self::Cast<U> as Algebra>::Rotation;
    /// The same rotational inertia over another scalar.
    fn cast_inertia<U: Real>(i: Self::Rotational) -> <Self::Cast<U> as Algebra>::Rotational;
}

/// What the articulated-body recursion asks of its symmetric matrices.
pub trait Articulated<A: Algebra>: Copy + Debug + Send + Sync + AddAssign + 'static {
    /// A rigid body's inertia.
    fn from_rigid(inertia: &Inertia<A>) -> Self;
    /// Iᴬ s
    fn along(&self, s: Axis<A>) -> Force<A>;
    /// Iᴬ a
    fn apply(&self, a: Motion<A>) -> Force<A>;
    /// Iᴬ − U Uᵀ / D, given 1/D
    fn without(&self, u: Force<A>, inverse_d: A::Scalar) -> Self;
    /// The same inertia about a point at −r.
    fn shifted(&self, r: A::Vector) -> Self;
}

/// A velocity or acceleration: rad/s and m/s, or their rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion<A: Algebra> {
    /// Angular part.
    pub angular: A::Angular,
    /// Linear part, at the origin.
    pub linear: A::Vector,
}

/// A force or impulse: N m and N, or N m s and N s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Force<A: Algebra> {
    /// Moment about the origin.
    pub moment: A::Angular,
    /// Force.
    pub force: A::Vector,
}

/// One column of a joint's motion subspace, about the joint's own origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Axis<A: Algebra> {
    /// Turns about this direction (times the coupling ratio of a mimic joint).
    Turn(A::Angular),
    /// Slides along this direction.
    Slide(A::Vector),
}

/// A rigid body's inertia about a reference point.
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
    /// Rotation into the outer axes.
    pub rotation: A::Rotation,
    /// Position of the inner origin, m.
    pub translation: A::Vector,
}

impl<A: Algebra> Pose<A> {
    /// The pose that changes nothing.
    #[inline(always)]
    pub fn identity() -> Self {
        Self { rotation: A::no_rotation(), translation: A::zero() }
    }

    /// First `inner`, then `self`.
    #[inline(always)]
    pub fn then(&self, inner: &Self) -> Self {
        Self { rotation: A::compose(self.rotation, inner.rotation), translation: self.point(inner.translation) }
    }

    /// The outer coordinates of a point given in inner ones.
    #[inline(always)]
    pub fn point(&self, p: A::Vector) -> A::Vector {
        self.translation + A::rotate(self.rotation, p)
    }

    /// The pose backwards.
    #[inline(always)]
    pub fn inverse(&self) -> Self {
        let back = A::inverse(self.rotation);
        Self { rotation: back, translation: -A::rotate(back, self.translation) }
    }
}

impl<A: Algebra> Motion<A> {
    /// At rest.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { angular: A::zero_angular(), linear: A::zero() }
    }

    /// The same motion seen at the point `r` away: v + ω × r.
    #[inline(always)]
    pub fn shifted(self, r: A::Vector) -> Self {
        Self { angular: self.angular, linear: self.linear + A::swing(self.angular, r) }
    }

    /// v × s q̇: how the axis `s`, carried along by this motion, changes. (Featherstone eq. 2.31.)
    #[inline(always)]
    pub fn carry(self, s: Motion<A>) -> Self {
        Self {
            angular: A::cross_angular(self.angular, s.angular),
            linear: A::swing(self.angular, s.linear) - A::swing(s.angular, self.linear),
        }
    }

    /// v ×* f: the rate of a momentum that is carried along by this motion. (Featherstone eq. 2.32.)
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
    /// No force.
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
    /// s · f: the part of a force that the joint feels.
    #[inline(always)]
    pub fn dot(self, f: Force<A>) -> A::Scalar {
        match self {
            Self::Turn(z) => A::dot_angular(z, f.moment),
            Self::Slide(z) => A::dot(z, f.force),
        }
    }

    /// s q̇
    #[inline(always)]
    pub fn at_rate(self, rate: A::Scalar) -> Motion<A> {
        match self {
            Self::Turn(z) => Motion { angular: z * rate, linear: A::zero() },
            Self::Slide(z) => Motion { angular: A::zero_angular(), linear: z * rate },
        }
    }

    /// The velocity that unit rate gives to the point `r` away from the joint's origin.
    #[inline(always)]
    pub fn point_velocity(self, r: A::Vector) -> A::Vector {
        match self {
            Self::Turn(z) => A::swing(z, r),
            Self::Slide(z) => z,
        }
    }

    /// The axis times a coupling ratio.
    #[inline(always)]
    pub fn scaled(self, ratio: A::Scalar) -> Self {
        match self {
            Self::Turn(z) => Self::Turn(z * ratio),
            Self::Slide(z) => Self::Slide(z * ratio),
        }
    }
}

impl<A: Algebra> Inertia<A> {
    /// No inertia.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { mass: A::Scalar::zero(), first_moment: A::zero(), rotational: A::Rotational::zero() }
    }

    /// Nothing left of its [`Algebra::unturned`], in rotated axes.
    #[inline(always)]
    pub(crate) fn rotated_turning(&self, rotation: A::Rotation) -> Self {
        let (first_moment, rotational) = A::rotate_turning(rotation, self.first_moment, self.rotational);
        Self { mass: A::Scalar::zero(), first_moment, rotational }
    }

    /// From mass, centre of mass and the rotational inertia about it.
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

    /// I v
    #[inline(always)]
    pub fn apply(&self, v: Motion<A>) -> Force<A> {
        Force {
            moment: A::apply_inertia(self.rotational, v.angular) + A::moment(self.first_moment, v.linear),
            force: v.linear * self.mass + A::swing(v.angular, self.first_moment),
        }
    }

    /// I s
    #[inline(always)]
    pub fn along(&self, s: Axis<A>) -> Force<A> {
        match s {
            Axis::Turn(z) => {
                Force { moment: A::apply_inertia(self.rotational, z), force: A::swing(z, self.first_moment) }
            }
            Axis::Slide(z) => Force { moment: A::moment(self.first_moment, z), force: z * self.mass },
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

    /// The same where there is no mass.
    #[inline(always)]
    pub(crate) fn shifted_massless(&self, r: A::Vector) -> Self {
        let h = self.first_moment;
        Self { rotational: self.rotational + A::parallel_axis(h + h, r), ..*self }
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

    /// The body of a child frame, in the frame that `pose` puts it in.
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
