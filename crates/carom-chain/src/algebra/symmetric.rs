//! Symmetric 3×3 matrices, stored as six numbers.

use super::spatial::row;
use super::{Geometry, Real, Spatial};
use nalgebra::{Matrix3, Vector3};
use num_traits::Zero;
use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A symmetric 3×3 matrix, stored as six numbers: a rotational inertia, or a diagonal block of an articulated inertia.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Symmetric3<T> {
    /// The diagonal.
    pub diagonal: Vector3<T>,
    /// The off-diagonal elements (2,3), (3,1) and (1,2), as components x, y and z.
    pub beside: Vector3<T>,
}

impl<T: Real> Symmetric3<T> {
    /// The matrix with `x` on the diagonal and zero elsewhere.
    #[inline(always)]
    pub fn from_diagonal_element(x: T) -> Self {
        Self { diagonal: Vector3::new(x, x, x), beside: Vector3::new(T::zero(), T::zero(), T::zero()) }
    }

    /// The symmetric part of a matrix.
    #[inline(always)]
    pub fn of(m: &Matrix3<T>) -> Self {
        let half: T = nalgebra::convert(0.5);
        Self {
            diagonal: Vector3::new(m[(0, 0)], m[(1, 1)], m[(2, 2)]),
            beside: Vector3::new(
                (m[(1, 2)] + m[(2, 1)]) * half,
                (m[(2, 0)] + m[(0, 2)]) * half,
                (m[(0, 1)] + m[(1, 0)]) * half,
            ),
        }
    }

    /// The full 3×3 matrix.
    #[inline(always)]
    pub fn matrix(&self) -> Matrix3<T> {
        let (d, b) = (&self.diagonal, &self.beside);
        Matrix3::new(d.x, b.z, b.y, b.z, d.y, b.x, b.y, b.x, d.z)
    }

    /// a aᵀ k
    #[inline(always)]
    pub fn square(a: Vector3<T>, k: T) -> Self {
        let s = Vector3::new(a.x * k, a.y * k, a.z * k);
        Self {
            diagonal: Vector3::new(s.x * a.x, s.y * a.y, s.z * a.z),
            beside: Vector3::new(s.y * a.z, s.z * a.x, s.x * a.y),
        }
    }

    /// R S Rᵀ
    #[inline(always)]
    pub fn rotated(&self, r: &Matrix3<T>) -> Self {
        let (x, y, z) = (row(r, 0), row(r, 1), row(r, 2));
        let (ix, iy, iz) = (*self * x, *self * y, *self * z);
        let dot = Spatial::dot;
        Self {
            diagonal: Vector3::new(dot(x, ix), dot(y, iy), dot(z, iz)),
            beside: Vector3::new(dot(y, iz), dot(z, ix), dot(x, iy)),
        }
    }

    /// The same over another scalar.
    pub fn map<U: Real>(&self, f: impl Fn(T) -> U) -> Symmetric3<U> {
        Symmetric3 { diagonal: self.diagonal.map(&f), beside: self.beside.map(&f) }
    }
}

impl<T: Real> Mul<Vector3<T>> for Symmetric3<T> {
    type Output = Vector3<T>;
    #[inline(always)]
    fn mul(self, v: Vector3<T>) -> Vector3<T> {
        let (d, b) = (self.diagonal, self.beside);
        Vector3::new(
            d.x * v.x + b.z * v.y + b.y * v.z,
            b.z * v.x + d.y * v.y + b.x * v.z,
            b.y * v.x + b.x * v.y + d.z * v.z,
        )
    }
}

impl<T: Real> Mul<T> for Symmetric3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: T) -> Self {
        Self { diagonal: self.diagonal * k, beside: self.beside * k }
    }
}

impl<T: Real> Add for Symmetric3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { diagonal: self.diagonal + other.diagonal, beside: self.beside + other.beside }
    }
}

impl<T: Real> Sub for Symmetric3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { diagonal: self.diagonal - other.diagonal, beside: self.beside - other.beside }
    }
}

impl<T: Real> Neg for Symmetric3<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { diagonal: -self.diagonal, beside: -self.beside }
    }
}

impl<T: Real> AddAssign for Symmetric3<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<T: Real> SubAssign for Symmetric3<T> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<T: Real> Zero for Symmetric3<T> {
    fn zero() -> Self {
        Self::from_diagonal_element(T::zero())
    }
    fn is_zero(&self) -> bool {
        self.diagonal.is_zero() && self.beside.is_zero()
    }
}
