//! What counts as zero beside the numbers that it is computed from.

use nalgebra::{SimdRealField, convert};

/// The rounding error of a number computed from the chain, relative to the terms that cancel in it: pivots, directions, axes, moments.
/// 64 covers the operations of a chain of some dozens of bodies; a chain in regular position is far above it.
pub(crate) const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// [`ROUNDING`] in the precision of `T`.
pub(crate) fn rounding<T: SimdRealField>() -> T {
    convert::<f64, T>(64.0) * T::simd_default_epsilon()
}
