//! The algebra of the plane, SE(2): angular quantities are one number, vectors two.

use super::{Articulated, Axis, Force, Geometry, Inertia, Real, sealed::Sealed};
use nalgebra::{Matrix2, RealField, Vector2, convert, convert_unchecked};
use std::marker::PhantomData;
use std::ops::AddAssign;

/// The algebra of the plane over the scalar `T`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Planar<T>(PhantomData<T>);

/// Joint types in the plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlanarJoint {
    /// Hinge; positive angles are counter-clockwise.
    Revolute,
    /// Slider along the x axis of its frame.
    Prismatic,
}

/// A rotation in the plane, as (cos, sin) of its angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn<T> {
    /// Cosine of the angle.
    pub cos: T,
    /// Sine of the angle.
    pub sin: T,
}

/// r rotated by π/2: ω × r = ω · perp(r).
#[inline(always)]
fn perp<T: Real>(r: Vector2<T>) -> Vector2<T> {
    Vector2::new(-r.y, r.x)
}

impl<T: Real> Sealed for Planar<T> {}

impl<T: Real> Geometry for Planar<T> {
    type Scalar = T;
    type Vector = Vector2<T>;
    type Angular = T;
    type Rotational = T;
    type Rotation = Turn<T>;
    type Joint = PlanarJoint;
    type Articulated = PlanarArticulated<T>;
    type Cast<U: Real> = Planar<U>;

    const ANGULAR: usize = 1;
    const LINEAR: usize = 2;

    #[inline(always)]
    fn linear_part(v: Vector2<T>, i: usize) -> T {
        v[i]
    }
    #[inline(always)]
    fn angular_part(w: T, _: usize) -> T {
        w
    }
    #[inline(always)]
    fn zero() -> Vector2<T> {
        Vector2::new(T::zero(), T::zero())
    }
    #[inline(always)]
    fn zero_angular() -> T {
        T::zero()
    }
    #[inline(always)]
    fn vector(f: impl Fn(usize) -> T) -> Vector2<T> {
        Vector2::new(f(0), f(1))
    }

    #[inline(always)]
    fn plus(a: Vector2<T>, b: Vector2<T>) -> Vector2<T> {
        Vector2::new(a.x + b.x, a.y + b.y)
    }
    #[inline(always)]
    fn minus(a: Vector2<T>, b: Vector2<T>) -> Vector2<T> {
        Vector2::new(a.x - b.x, a.y - b.y)
    }
    #[inline(always)]
    fn times(a: Vector2<T>, k: T) -> Vector2<T> {
        Vector2::new(a.x * k, a.y * k)
    }
    #[inline(always)]
    fn dot(a: Vector2<T>, b: Vector2<T>) -> T {
        a.x * b.x + a.y * b.y
    }
    #[inline(always)]
    fn dot_angular(a: T, b: T) -> T {
        a * b
    }
    #[inline(always)]
    fn moment(r: Vector2<T>, f: Vector2<T>) -> T {
        r.x * f.y - r.y * f.x
    }
    #[inline(always)]
    fn swing(w: T, r: Vector2<T>) -> Vector2<T> {
        Vector2::new(-r.y * w, r.x * w)
    }
    #[inline(always)]
    fn cross_angular(_: T, _: T) -> T {
        T::zero()
    }

    #[inline(always)]
    fn no_rotation() -> Turn<T> {
        Turn { cos: T::one(), sin: T::zero() }
    }
    #[inline(always)]
    fn compose(a: Turn<T>, b: Turn<T>) -> Turn<T> {
        Turn { cos: a.cos * b.cos - a.sin * b.sin, sin: a.sin * b.cos + a.cos * b.sin }
    }
    #[inline(always)]
    fn inverse(a: Turn<T>) -> Turn<T> {
        Turn { cos: a.cos, sin: -a.sin }
    }
    #[inline(always)]
    fn rotate(a: Turn<T>, v: Vector2<T>) -> Vector2<T> {
        Vector2::new(a.cos * v.x - a.sin * v.y, a.sin * v.x + a.cos * v.y)
    }
    #[inline(always)]
    fn rotate_inertia(_: Turn<T>, i: T) -> T {
        i
    }
    #[inline(always)]
    fn apply_inertia(i: T, w: T) -> T {
        i * w
    }
    #[inline(always)]
    fn inertia_rate(_: T, _: T) -> T {
        T::zero()
    }
    #[inline(always)]
    fn trace(i: T) -> T {
        i
    }
    fn solve_inertia(i: T, n: T) -> Option<T>
    where
        T: RealField,
    {
        if n == T::zero() { Some(n) } else { (i > T::zero()).then(|| n / i) }
    }
    #[inline(always)]
    fn parallel_axis(twice: Vector2<T>, r: Vector2<T>) -> T {
        Self::dot(r, twice)
    }

    #[inline(always)]
    fn turn(placed: Turn<T>, sin: T, cos: T) -> Turn<T> {
        Self::compose(placed, Turn { cos, sin })
    }
    #[inline(always)]
    fn hinge(_: Turn<T>, sense: T) -> T {
        sense
    }
    fn euler_angles(rotation: Turn<T>) -> [T; 3]
    where
        T: RealField,
    {
        [T::zero(), T::zero(), rotation.sin.atan2(rotation.cos)]
    }
    #[inline(always)]
    fn tilt(placed: Turn<T>, _: T, _: T) -> Turn<T> {
        placed
    }
    fn unturned(inertia: Inertia<Self>) -> Inertia<Self> {
        Inertia { mass: inertia.mass, ..Inertia::zero() }
    }
    #[inline(always)]
    fn rotate_turning(a: Turn<T>, h: Vector2<T>, i: T) -> (Vector2<T>, T) {
        (Self::rotate(a, h), i)
    }
    #[inline(always)]
    fn turns(joint: PlanarJoint) -> bool {
        joint == PlanarJoint::Revolute
    }
    #[inline(always)]
    fn move_joint(joint: PlanarJoint, placed: Turn<T>, ratio: T, shift: T, q: &[T]) -> (Turn<T>, Vector2<T>) {
        let position = ratio * q[0] + shift;
        match joint {
            PlanarJoint::Revolute => {
                let (sin, cos) = position.simd_sin_cos();
                (Self::turn(placed, sin, cos), Self::zero())
            }
            PlanarJoint::Prismatic => (placed, Vector2::new(placed.cos, placed.sin) * position),
        }
    }
    #[inline(always)]
    fn axis(joint: PlanarJoint, rotation: Turn<T>) -> Axis<Self> {
        match joint {
            PlanarJoint::Revolute => Axis::Turn(T::one()),
            PlanarJoint::Prismatic => Axis::Slide(Vector2::new(rotation.cos, rotation.sin)),
        }
    }
    #[inline(always)]
    fn rides_along(_: PlanarJoint) -> bool {
        false
    }

    fn cast_vector<U: Real>(v: Vector2<T>) -> Vector2<U> {
        v.map(cast)
    }
    fn cast_rotation<U: Real>(a: Turn<T>) -> Turn<U> {
        Turn { cos: cast(a.cos), sin: cast(a.sin) }
    }
    fn cast_inertia<U: Real>(i: T) -> U {
        cast(i)
    }
}

/// Converts `T` to `U` through `f64`: chains are read in `f64` and cast from there.
pub(super) fn cast<T: Real, U: Real>(x: T) -> U {
    convert(convert_unchecked::<T, f64>(x))
}

/// Articulated inertia in the plane, `[Iᵣ H; Hᵀ M]` with H a row: rotational, coupling and linear part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarArticulated<T> {
    rotational: T,
    coupling: Vector2<T>,
    linear: Matrix2<T>,
}

impl<T: Real> AddAssign for PlanarArticulated<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.rotational += other.rotational;
        self.coupling += other.coupling;
        self.linear += other.linear;
    }
}

impl<T: Real> Articulated<Planar<T>> for PlanarArticulated<T> {
    #[inline(always)]
    fn from_rigid(inertia: &Inertia<Planar<T>>) -> Self {
        // h × v is the row (−h_y, h_x) times v
        Self {
            rotational: inertia.rotational,
            coupling: perp(inertia.first_moment),
            linear: Matrix2::from_diagonal_element(inertia.mass),
        }
    }

    #[inline(always)]
    fn along(&self, s: Axis<Planar<T>>) -> Force<Planar<T>> {
        match s {
            Axis::Turn(z) => Force { moment: self.rotational * z, force: self.coupling * z },
            Axis::Slide(z) => Force { moment: Planar::dot(self.coupling, z), force: self.linear * z },
        }
    }

    #[inline(always)]
    fn without(&self, u: Force<Planar<T>>, inverse_d: T) -> Self {
        let scaled = u.force * inverse_d;
        Self {
            rotational: self.rotational - u.moment * u.moment * inverse_d,
            coupling: self.coupling - scaled * u.moment,
            linear: self.linear - scaled * u.force.transpose(),
        }
    }

    #[inline(always)]
    fn shifted(&self, r: Vector2<T>) -> Self {
        // With ρ = perp(r): v = v′ + ω ρ, so H′ = H + ρᵀM and I′ = I + H ρ + (H ρ)ᵀ + ρᵀM ρ.
        let rho = perp(r);
        let coupling = self.coupling + self.linear * rho;
        Self { rotational: self.rotational + Planar::dot(self.coupling + coupling, rho), coupling, linear: self.linear }
    }
}
