//! Space: SE(3). Angular quantities and vectors are three numbers.

use super::planar::cast;
use super::{Algebra, Articulated, Axis, Force, Inertia, Motion, Real, sealed::Sealed};
use nalgebra::{Matrix3, RealField, Vector3};
use std::marker::PhantomData;
use std::ops::AddAssign;

/// The algebra of space over the scalar `T`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spatial<T>(PhantomData<T>);

/// Joints in space, in frames whose z axis is the joint's axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpatialJoint {
    /// Turns about z.
    Revolute,
    /// Slides along z.
    Prismatic,
    /// One of the six axes of a floating joint: 0–2 slide along, 3–5 turn about the child's own x, y, z. The first
    /// owns all seven coordinates (x, y, z, qx, qy, qz, qw) and makes the whole motion.
    Floating(u8),
}

impl<T: Real> Sealed for Spatial<T> {}

fn column<T: Real>(m: &Matrix3<T>, j: usize) -> Vector3<T> {
    Vector3::new(m[(0, j)], m[(1, j)], m[(2, j)])
}

fn outer<T: Real>(a: Vector3<T>, b: Vector3<T>) -> Matrix3<T> {
    a * b.transpose()
}

/// The matrix of a×.
fn skew<T: Real>(a: Vector3<T>) -> Matrix3<T> {
    let o = T::zero();
    Matrix3::new(o, -a.z, a.y, a.z, o, -a.x, -a.y, a.x, o)
}

/// The rotation of a quaternion (x, y, z, w) of any non-zero length.
fn from_quaternion<T: Real>(x: T, y: T, z: T, w: T) -> Matrix3<T> {
    let one = T::one();
    let two = one + one;
    let k = two / (x * x + y * y + z * z + w * w);
    Matrix3::new(
        one - k * (y * y + z * z),
        k * (x * y - z * w),
        k * (x * z + y * w),
        k * (x * y + z * w),
        one - k * (x * x + z * z),
        k * (y * z - x * w),
        k * (x * z - y * w),
        k * (y * z + x * w),
        one - k * (x * x + y * y),
    )
}

/// A rotation that takes z to the unit vector `a`; x to x and y to y for a = z, and exact for all coordinate axes.
/// (Duff et al., *Building an Orthonormal Basis, Revisited*, JCGT 6 (2017), listing 3.)
pub fn z_onto(a: Vector3<f64>) -> Matrix3<f64> {
    let sign = 1.0_f64.copysign(a.z);
    let k = -1.0 / (sign + a.z);
    let b = a.x * a.y * k;
    let x = Vector3::new(1.0 + sign * a.x * a.x * k, sign * b, -sign * a.x);
    let y = Vector3::new(b, sign + a.y * a.y * k, -a.y);
    Matrix3::from_columns(&[x, y, a])
}

impl<T: Real> Algebra for Spatial<T> {
    type Scalar = T;
    type Vector = Vector3<T>;
    type Angular = Vector3<T>;
    type Rotational = Matrix3<T>;
    type Rotation = Matrix3<T>;
    type Joint = SpatialJoint;
    type Articulated = SpatialArticulated<T>;
    type Cast<U: Real> = Spatial<U>;

    const ANGULAR: usize = 3;
    const LINEAR: usize = 3;

    fn linear_part(v: Vector3<T>, i: usize) -> T {
        v[i]
    }
    fn angular_part(w: Vector3<T>, i: usize) -> T {
        w[i]
    }
    fn vector(f: impl Fn(usize) -> T) -> Vector3<T> {
        Vector3::new(f(0), f(1), f(2))
    }

    #[inline]
    fn dot(a: Vector3<T>, b: Vector3<T>) -> T {
        a.x * b.x + a.y * b.y + a.z * b.z
    }
    #[inline]
    fn dot_angular(a: Vector3<T>, b: Vector3<T>) -> T {
        Self::dot(a, b)
    }
    #[inline]
    fn moment(r: Vector3<T>, f: Vector3<T>) -> Vector3<T> {
        Vector3::new(r.y * f.z - r.z * f.y, r.z * f.x - r.x * f.z, r.x * f.y - r.y * f.x)
    }
    #[inline]
    fn swing(w: Vector3<T>, r: Vector3<T>) -> Vector3<T> {
        Self::moment(w, r)
    }
    #[inline]
    fn cross_angular(a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
        Self::moment(a, b)
    }

    #[inline]
    fn no_rotation() -> Matrix3<T> {
        Matrix3::identity()
    }
    #[inline]
    fn compose(a: Matrix3<T>, b: Matrix3<T>) -> Matrix3<T> {
        a * b
    }
    #[inline]
    fn inverse(a: Matrix3<T>) -> Matrix3<T> {
        a.transpose()
    }
    #[inline]
    fn rotate(a: Matrix3<T>, v: Vector3<T>) -> Vector3<T> {
        a * v
    }
    #[inline]
    fn rotate_inertia(a: Matrix3<T>, i: Matrix3<T>) -> Matrix3<T> {
        a * i * a.transpose()
    }
    #[inline]
    fn apply_inertia(i: Matrix3<T>, w: Vector3<T>) -> Vector3<T> {
        i * w
    }
    #[inline]
    fn trace(i: Matrix3<T>) -> T {
        i[(0, 0)] + i[(1, 1)] + i[(2, 2)]
    }
    fn solve_inertia(i: Matrix3<T>, n: Vector3<T>) -> Option<Vector3<T>>
    where
        T: RealField,
    {
        let principal = i.symmetric_eigen();
        let rounding: T = nalgebra::convert::<f64, T>(64.0) * T::default_epsilon();
        let mut w = Vector3::zeros();
        for k in 0..3 {
            let axis = column(&principal.eigenvectors, k);
            let (inertia, part) = (principal.eigenvalues[k], Self::dot(axis, n));
            if inertia > principal.eigenvalues.amax() * rounding {
                w += axis * (part / inertia);
            } else if part.abs() > n.norm() * rounding {
                return None;
            }
        }
        Some(w)
    }
    #[inline]
    fn parallel_axis(mass: T, h: Vector3<T>, r: Vector3<T>) -> Matrix3<T> {
        // −r×h× = (r·h)E − h rᵀ, so the sum is r·(h + h′) E − h rᵀ − r h′ᵀ with h′ = h + m r.
        let moved = h + r * mass;
        Matrix3::from_diagonal_element(Self::dot(r, h + moved)) - outer(h, r) - outer(r, moved)
    }

    #[inline]
    fn move_joint(joint: SpatialJoint, placed: Matrix3<T>, ratio: T, shift: T, q: &[T]) -> (Matrix3<T>, Vector3<T>) {
        match joint {
            SpatialJoint::Revolute => {
                let (sin, cos) = (ratio * q[0] + shift).simd_sin_cos();
                let (x, y, z) = (column(&placed, 0), column(&placed, 1), column(&placed, 2));
                (Matrix3::from_columns(&[x * cos + y * sin, y * cos - x * sin, z]), Vector3::zeros())
            }
            SpatialJoint::Prismatic => (placed, column(&placed, 2) * (ratio * q[0] + shift)),
            SpatialJoint::Floating(0) => {
                let turned = placed * from_quaternion(q[3], q[4], q[5], q[6]);
                (turned, placed * Vector3::new(q[0], q[1], q[2]))
            }
            SpatialJoint::Floating(_) => (placed, Vector3::zeros()),
        }
    }
    #[inline]
    fn axis(joint: SpatialJoint, rotation: Matrix3<T>) -> Axis<Self> {
        match joint {
            SpatialJoint::Revolute => Axis::Turn(column(&rotation, 2)),
            SpatialJoint::Prismatic => Axis::Slide(column(&rotation, 2)),
            SpatialJoint::Floating(k @ 0..3) => Axis::Slide(column(&rotation, k.into())),
            SpatialJoint::Floating(k) => Axis::Turn(column(&rotation, usize::from(k) - 3)),
        }
    }
    #[inline]
    fn rides_along(joint: SpatialJoint) -> bool {
        matches!(joint, SpatialJoint::Floating(1..))
    }

    fn cast_vector<U: Real>(v: Vector3<T>) -> Vector3<U> {
        v.map(cast)
    }
    fn cast_rotation<U: Real>(a: Matrix3<T>) -> Matrix3<U> {
        a.map(cast)
    }
    fn cast_inertia<U: Real>(i: Matrix3<T>) -> Matrix3<U> {
        i.map(cast)
    }
}

/// `[Iᵣ H; Hᵀ M]`: rotational, coupling and linear 3×3 blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpatialArticulated<T> {
    rotational: Matrix3<T>,
    coupling: Matrix3<T>,
    linear: Matrix3<T>,
}

impl<T: Real> AddAssign for SpatialArticulated<T> {
    fn add_assign(&mut self, other: Self) {
        self.rotational += other.rotational;
        self.coupling += other.coupling;
        self.linear += other.linear;
    }
}

impl<T: Real> Articulated<Spatial<T>> for SpatialArticulated<T> {
    fn from_rigid(inertia: &Inertia<Spatial<T>>) -> Self {
        Self {
            rotational: inertia.rotational,
            coupling: skew(inertia.first_moment),
            linear: Matrix3::from_diagonal_element(inertia.mass),
        }
    }

    fn along(&self, s: Axis<Spatial<T>>) -> Force<Spatial<T>> {
        match s {
            Axis::Turn(z) => Force { moment: self.rotational * z, force: self.coupling.tr_mul(&z) },
            Axis::Slide(z) => Force { moment: self.coupling * z, force: self.linear * z },
        }
    }

    fn apply(&self, a: Motion<Spatial<T>>) -> Force<Spatial<T>> {
        Force {
            moment: self.rotational * a.angular + self.coupling * a.linear,
            force: self.coupling.tr_mul(&a.angular) + self.linear * a.linear,
        }
    }

    fn without(&self, u: Force<Spatial<T>>, inverse_d: T) -> Self {
        let (moment, force) = (u.moment * inverse_d, u.force * inverse_d);
        Self {
            rotational: self.rotational - outer(moment, u.moment),
            coupling: self.coupling - outer(moment, u.force),
            linear: self.linear - outer(force, u.force),
        }
    }

    fn shifted(&self, r: Vector3<T>) -> Self {
        // v = v′ + ω × r, so H′ = H + r×M and I′ = I + r×Hᵀ − H′r×.
        let cross = skew(r);
        let coupling = self.coupling + cross * self.linear;
        Self {
            rotational: self.rotational + cross * self.coupling.transpose() - coupling * cross,
            coupling,
            linear: self.linear,
        }
    }
}
