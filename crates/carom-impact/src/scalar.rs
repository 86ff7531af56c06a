//! The parts of a scalar, which may be a dual number: its value without the derivative, and its derivative alone.

use std::any::TypeId;

use nalgebra::{RealField, convert};

use crate::problem::plain;

/// x without its derivative.
pub(crate) fn value<T: RealField + Copy>(x: T) -> T {
    convert(plain(x))
}

/// Zero, with the derivative of x.
pub(crate) fn rest<T: RealField + Copy>(x: T) -> T {
    x - value(x)
}

/// Whether `T` carries derivatives (is not `f64` or `f32`). For plain numbers all components across the plane are zero.
pub(crate) fn has_derivatives<T: 'static>() -> bool {
    let this = TypeId::of::<T>();
    this != TypeId::of::<f64>() && this != TypeId::of::<f32>()
}
