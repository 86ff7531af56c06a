//! The algebra of space, SE(3): angular quantities and vectors are three numbers.

use super::planar::cast;
use super::symmetric::Symmetric3;
use super::{Articulated, Axis, Force, Geometry, Inertia, Pose, Real, sealed::Sealed};
use nalgebra::{Isometry3, Matrix3, RealField, Vector3};
use std::marker::PhantomData;
use std::ops::AddAssign;

/// The algebra of space over the scalar `T`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spatial<T>(PhantomData<T>);

/// Joint types in space. The z axis of a hinge's or slider's frame is the joint's axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpatialJoint {
    /// Hinge about z.
    Revolute,
    /// Slider along z.
    Prismatic,
    /// One of the six axes of a floating joint: 0–2 are translations along, 3–5 rotations about the child's x, y and z axes.
    /// The transform of axis 0 is the whole motion by all seven coordinates (x, y, z, qx, qy, qz, qw); those of the others
    /// are the identity.
    Floating(u8),
}

impl<T: Real> Sealed for Spatial<T> {}

impl From<Isometry3<f64>> for Pose<Spatial<f64>> {
    fn from(isometry: Isometry3<f64>) -> Self {
        Self { rotation: isometry.rotation.to_rotation_matrix().into_inner(), translation: isometry.translation.vector }
    }
}

#[inline(always)]
fn column<T: Real>(m: &Matrix3<T>, j: usize) -> Vector3<T> {
    Vector3::new(m[(0, j)], m[(1, j)], m[(2, j)])
}

#[inline(always)]
pub(super) fn row<T: Real>(m: &Matrix3<T>, i: usize) -> Vector3<T> {
    Vector3::new(m[(i, 0)], m[(i, 1)], m[(i, 2)])
}

/// The product by components: the diagonal of a bᵀ.
#[inline(always)]
fn by_parts<T: Real>(a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
    Vector3::new(a.x * b.x, a.y * b.y, a.z * b.z)
}

/// The off-diagonal elements (2,3), (3,1) and (1,2) of a bᵀ + b aᵀ.
#[inline(always)]
fn crosswise<T: Real>(a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
    Vector3::new(a.y * b.z + b.y * a.z, a.z * b.x + b.z * a.x, a.x * b.y + b.x * a.y)
}

/// A v
#[inline(always)]
fn apply<T: Real>(m: &Matrix3<T>, v: Vector3<T>) -> Vector3<T> {
    Vector3::new(Spatial::dot(row(m, 0), v), Spatial::dot(row(m, 1), v), Spatial::dot(row(m, 2), v))
}

/// Aᵀ v
#[inline(always)]
fn apply_transposed<T: Real>(m: &Matrix3<T>, v: Vector3<T>) -> Vector3<T> {
    Vector3::new(Spatial::dot(column(m, 0), v), Spatial::dot(column(m, 1), v), Spatial::dot(column(m, 2), v))
}

/// The matrix of these columns.
#[inline(always)]
fn columns<T: Real>(x: Vector3<T>, y: Vector3<T>, z: Vector3<T>) -> Matrix3<T> {
    Matrix3::new(x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z)
}

/// The matrix of a×.
fn skew<T: Real>(a: Vector3<T>) -> Matrix3<T> {
    let o = T::zero();
    Matrix3::new(o, -a.z, a.y, a.z, o, -a.x, -a.y, a.x, o)
}

/// The rotation of a quaternion (x, y, z, w) of any non-zero length.
#[inline(always)]
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

/// A rotation that maps z to the unit vector `a`. It is the identity for a = z, and exact for all coordinate axes. (Duff et
/// al., *Building an Orthonormal Basis, Revisited*, JCGT 6 (2017), listing 3.)
pub fn z_onto(a: Vector3<f64>) -> Matrix3<f64> {
    let sign = 1.0_f64.copysign(a.z);
    let k = -1.0 / (sign + a.z);
    let b = a.x * a.y * k;
    let x = Vector3::new(1.0 + sign * a.x * a.x * k, sign * b, -sign * a.x);
    let y = Vector3::new(b, sign + a.y * a.y * k, -a.y);
    Matrix3::from_columns(&[x, y, a])
}

impl<T: Real> Geometry for Spatial<T> {
    type Scalar = T;
    type Vector = Vector3<T>;
    type Angular = Vector3<T>;
    type Rotational = Symmetric3<T>;
    type Rotation = Matrix3<T>;
    type Joint = SpatialJoint;
    type Articulated = SpatialArticulated<T>;
    type Cast<U: Real> = Spatial<U>;

    const ANGULAR: usize = 3;
    const LINEAR: usize = 3;

    #[inline(always)]
    fn linear_part(v: Vector3<T>, i: usize) -> T {
        v[i]
    }
    #[inline(always)]
    fn angular_part(w: Vector3<T>, i: usize) -> T {
        w[i]
    }
    #[inline(always)]
    fn zero() -> Vector3<T> {
        Vector3::new(T::zero(), T::zero(), T::zero())
    }
    #[inline(always)]
    fn zero_angular() -> Vector3<T> {
        Self::zero()
    }
    #[inline(always)]
    fn vector(f: impl Fn(usize) -> T) -> Vector3<T> {
        Vector3::new(f(0), f(1), f(2))
    }

    #[inline(always)]
    fn plus(a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
        Vector3::new(a.x + b.x, a.y + b.y, a.z + b.z)
    }
    #[inline(always)]
    fn minus(a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
        Vector3::new(a.x - b.x, a.y - b.y, a.z - b.z)
    }
    #[inline(always)]
    fn times(a: Vector3<T>, k: T) -> Vector3<T> {
        Vector3::new(a.x * k, a.y * k, a.z * k)
    }
    #[inline(always)]
    fn dot(a: Vector3<T>, b: Vector3<T>) -> T {
        a.x * b.x + a.y * b.y + a.z * b.z
    }
    #[inline(always)]
    fn dot_angular(a: Vector3<T>, b: Vector3<T>) -> T {
        Self::dot(a, b)
    }
    #[inline(always)]
    fn moment(r: Vector3<T>, f: Vector3<T>) -> Vector3<T> {
        Vector3::new(r.y * f.z - r.z * f.y, r.z * f.x - r.x * f.z, r.x * f.y - r.y * f.x)
    }
    #[inline(always)]
    fn swing(w: Vector3<T>, r: Vector3<T>) -> Vector3<T> {
        Self::moment(w, r)
    }
    #[inline(always)]
    fn cross_angular(a: Vector3<T>, b: Vector3<T>) -> Vector3<T> {
        Self::moment(a, b)
    }

    #[inline(always)]
    fn no_rotation() -> Matrix3<T> {
        let (o, i) = (T::zero(), T::one());
        Matrix3::new(i, o, o, o, i, o, o, o, i)
    }
    #[inline(always)]
    fn compose(a: Matrix3<T>, b: Matrix3<T>) -> Matrix3<T> {
        columns(apply(&a, column(&b, 0)), apply(&a, column(&b, 1)), apply(&a, column(&b, 2)))
    }
    #[inline(always)]
    fn inverse(a: Matrix3<T>) -> Matrix3<T> {
        a.transpose()
    }
    #[inline(always)]
    fn rotate(a: Matrix3<T>, v: Vector3<T>) -> Vector3<T> {
        apply(&a, v)
    }
    #[inline(always)]
    fn rotate_inertia(a: Matrix3<T>, i: Symmetric3<T>) -> Symmetric3<T> {
        i.rotated(&a)
    }
    #[inline(always)]
    fn apply_inertia(i: Symmetric3<T>, w: Vector3<T>) -> Vector3<T> {
        i * w
    }
    #[inline(always)]
    fn inertia_rate(i: Symmetric3<T>, w: Vector3<T>) -> Symmetric3<T> {
        let m = i.matrix();
        let turned =
            columns(Self::moment(w, column(&m, 0)), Self::moment(w, column(&m, 1)), Self::moment(w, column(&m, 2)));
        Symmetric3::of(&turned) * nalgebra::convert::<f64, T>(2.0)
    }
    #[inline(always)]
    fn trace(i: Symmetric3<T>) -> T {
        i.diagonal.x + i.diagonal.y + i.diagonal.z
    }
    fn solve_inertia(i: Symmetric3<T>, n: Vector3<T>) -> Option<Vector3<T>>
    where
        T: RealField,
    {
        let principal = i.matrix().symmetric_eigen();
        let rounding: T = nalgebra::convert::<f64, T>(64.0) * T::default_epsilon();
        let mut w = Self::zero();
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
    #[inline(always)]
    fn parallel_axis(twice: Vector3<T>, r: Vector3<T>) -> Symmetric3<T> {
        // −r×h× = (r·h)E − h rᵀ, so the sum is r·(h + h′) E − h rᵀ − r h′ᵀ with h′ = h + m r: with 2k = h + h′ it is
        // symmetric, 2 r·k E − k rᵀ − r kᵀ, and w = 2k serves.
        let w = twice;
        let s = by_parts(r, w);
        let half: T = nalgebra::convert(-0.5);
        Symmetric3 {
            diagonal: Vector3::new(s.y + s.z, s.z + s.x, s.x + s.y),
            beside: Spatial::times(crosswise(r, w), half),
        }
    }
    #[inline(always)]
    fn turn(placed: Matrix3<T>, sin: T, cos: T) -> Matrix3<T> {
        let (x, y, z) = (column(&placed, 0), column(&placed, 1), column(&placed, 2));
        columns(
            Spatial::plus(Spatial::times(x, cos), Spatial::times(y, sin)),
            Spatial::plus(Spatial::times(y, cos), Spatial::times(x, -sin)),
            z,
        )
    }
    #[inline(always)]
    fn hinge(rotation: Matrix3<T>, _: T) -> Vector3<T> {
        column(&rotation, 2)
    }
    fn euler_angles(rotation: Matrix3<T>) -> [T; 3]
    where
        T: RealField,
    {
        // R maps z to (sin a sin b, −cos a sin b, cos b). If that is z, a is arbitrary. Otherwise, for b of any size, c is
        // found in the first row of R_z(−a) R, and the errors of a and c cancel.
        let z = column(&rotation, 2);
        let a = if z.x == T::zero() && z.y == T::zero() { T::zero() } else { z.x.atan2(-z.y) };
        let rest = Self::compose(Self::turn(Self::no_rotation(), -a.sin(), a.cos()), rotation);
        [a, (-rest[(1, 2)]).atan2(rest[(2, 2)]), (-rest[(0, 1)]).atan2(rest[(0, 0)])]
    }
    #[inline(always)]
    fn tilt(placed: Matrix3<T>, sin: T, cos: T) -> Matrix3<T> {
        let (x, y, z) = (column(&placed, 0), column(&placed, 1), column(&placed, 2));
        columns(
            x,
            Spatial::plus(Spatial::times(y, cos), Spatial::times(z, sin)),
            Spatial::plus(Spatial::times(z, cos), Spatial::times(y, -sin)),
        )
    }
    fn unturned(inertia: Inertia<Self>) -> Inertia<Self> {
        let (o, across) = (T::zero(), inertia.rotational.diagonal.y);
        Inertia {
            mass: inertia.mass,
            first_moment: Vector3::new(o, o, inertia.first_moment.z),
            rotational: Symmetric3 { diagonal: Vector3::new(across, across, o), beside: Vector3::new(o, o, o) },
        }
    }
    #[inline(always)]
    fn rotate_turning(a: Matrix3<T>, h: Vector3<T>, i: Symmetric3<T>) -> (Vector3<T>, Symmetric3<T>) {
        // With axes x, y, z: I = p xᵀ + x pᵀ + r zᵀ + z rᵀ for p = I₁₁/2 x + I₁₂ y + I₁₃ z, r = I₃₃/2 z + I₂₃ y.
        let (x, y, z) = (column(&a, 0), column(&a, 1), column(&a, 2));
        let half: T = nalgebra::convert(0.5);
        let (d, b) = (i.diagonal, i.beside);
        let p =
            Spatial::plus(Spatial::plus(Spatial::times(x, d.x * half), Spatial::times(y, b.z)), Spatial::times(z, b.y));
        let r = Spatial::plus(Spatial::times(z, d.z * half), Spatial::times(y, b.x));
        // No closures: for SIMD lanes the compiler does not inline some of them, and compiles them without AVX instructions.
        let (px, rz) = (by_parts(p, x), by_parts(r, z));
        let turned = Symmetric3 {
            diagonal: Spatial::times(Spatial::plus(px, rz), nalgebra::convert(2.0)),
            beside: Spatial::plus(crosswise(p, x), crosswise(r, z)),
        };
        (Spatial::plus(Spatial::times(x, h.x), Spatial::times(y, h.y)), turned)
    }
    #[inline(always)]
    fn turns(joint: SpatialJoint) -> bool {
        joint == SpatialJoint::Revolute
    }
    #[inline(always)]
    fn move_joint(joint: SpatialJoint, placed: Matrix3<T>, ratio: T, shift: T, q: &[T]) -> (Matrix3<T>, Vector3<T>) {
        match joint {
            SpatialJoint::Revolute => {
                let (sin, cos) = (ratio * q[0] + shift).simd_sin_cos();
                (Self::turn(placed, sin, cos), Self::zero())
            }
            SpatialJoint::Prismatic => (placed, column(&placed, 2) * (ratio * q[0] + shift)),
            SpatialJoint::Floating(0) => {
                let turned = placed * from_quaternion(q[3], q[4], q[5], q[6]);
                (turned, placed * Vector3::new(q[0], q[1], q[2]))
            }
            SpatialJoint::Floating(_) => (placed, Self::zero()),
        }
    }
    #[inline(always)]
    fn axis(joint: SpatialJoint, rotation: Matrix3<T>) -> Axis<Self> {
        match joint {
            SpatialJoint::Revolute => Axis::Turn(column(&rotation, 2)),
            SpatialJoint::Prismatic => Axis::Slide(column(&rotation, 2)),
            SpatialJoint::Floating(k @ 0..3) => Axis::Slide(column(&rotation, k.into())),
            SpatialJoint::Floating(k) => Axis::Turn(column(&rotation, usize::from(k) - 3)),
        }
    }
    #[inline(always)]
    fn rides_along(joint: SpatialJoint) -> bool {
        matches!(joint, SpatialJoint::Floating(1..))
    }

    fn cast_vector<U: Real>(v: Vector3<T>) -> Vector3<U> {
        v.map(cast)
    }
    fn cast_rotation<U: Real>(a: Matrix3<T>) -> Matrix3<U> {
        a.map(cast)
    }
    fn cast_inertia<U: Real>(i: Symmetric3<T>) -> Symmetric3<U> {
        i.map(cast)
    }
}

/// Articulated inertia in space, `[Iᵣ H; Hᵀ M]`: rotational, coupling and linear 3×3 blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpatialArticulated<T> {
    rotational: Symmetric3<T>,
    coupling: Matrix3<T>,
    linear: Symmetric3<T>,
}

impl<T: Real> AddAssign for SpatialArticulated<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.rotational += other.rotational;
        self.coupling += other.coupling;
        self.linear += other.linear;
    }
}

impl<T: Real> Articulated<Spatial<T>> for SpatialArticulated<T> {
    #[inline(always)]
    fn from_rigid(inertia: &Inertia<Spatial<T>>) -> Self {
        Self {
            rotational: inertia.rotational,
            coupling: skew(inertia.first_moment),
            linear: Symmetric3::from_diagonal_element(inertia.mass),
        }
    }

    #[inline(always)]
    fn along(&self, s: Axis<Spatial<T>>) -> Force<Spatial<T>> {
        match s {
            Axis::Turn(z) => Force { moment: self.rotational * z, force: apply_transposed(&self.coupling, z) },
            Axis::Slide(z) => Force { moment: apply(&self.coupling, z), force: self.linear * z },
        }
    }

    #[inline(always)]
    fn without(&self, u: Force<Spatial<T>>, inverse_d: T) -> Self {
        let Force { moment, force } = u;
        let scaled = Spatial::times(moment, -inverse_d);
        let column = |j: usize| Spatial::plus(column(&self.coupling, j), Spatial::times(scaled, force[j]));
        Self {
            rotational: self.rotational + Symmetric3::square(moment, -inverse_d),
            coupling: columns(column(0), column(1), column(2)),
            linear: self.linear + Symmetric3::square(force, -inverse_d),
        }
    }

    #[inline(always)]
    fn shifted(&self, r: Vector3<T>) -> Self {
        // v = v′ + ω × r, so H′ = H + r×M and I′ = I + r×Hᵀ − H′r×. In columns and rows: (r×M)eⱼ = r × Meⱼ, and row i
        // of −H′r× is r × (row i of H′). The sum is symmetric: six of its elements are computed.
        let cross = Spatial::moment;
        let m = self.linear.matrix();
        let moved = |j: usize| Spatial::plus(column(&self.coupling, j), cross(r, column(&m, j)));
        let coupling = columns(moved(0), moved(1), moved(2));
        let (x, y, z) = (row(&self.coupling, 0), row(&self.coupling, 1), row(&self.coupling, 2));
        let (x1, y1, z1) = (row(&coupling, 0), row(&coupling, 1), row(&coupling, 2));
        // r×Hᵀ: its column j is r × (row j of H), so the sum's entry (i, j) is (r × Hⱼ)ᵢ + (r × H′ᵢ)ⱼ.
        let Symmetric3 { diagonal: d, beside: b } = self.rotational;
        let rotational = Symmetric3 {
            diagonal: Vector3::new(
                d.x + r.y * (x.z + x1.z) - r.z * (x.y + x1.y),
                d.y + r.z * (y.x + y1.x) - r.x * (y.z + y1.z),
                d.z + r.x * (z.y + z1.y) - r.y * (z.x + z1.x),
            ),
            beside: Vector3::new(
                b.x + (r.z * z.x - r.x * z.z) + (r.x * y1.y - r.y * y1.x),
                b.y + (r.x * x.y - r.y * x.x) + (r.y * z1.z - r.z * z1.y),
                b.z + (r.y * y.z - r.z * y.y) + (r.z * x1.x - r.x * x1.z),
            ),
        };
        Self { rotational, coupling, linear: self.linear }
    }
}
