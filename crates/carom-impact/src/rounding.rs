//! What counts as zero, where several files ask it. A multiple of ε allows for the rounding of numbers computed from a pose; a share
//! without ε separates what a solution by iteration, or data, leaves apart. Tolerances of one file stand in it.

use nalgebra::{RealField, convert};

/// `rounding::<T>(k)` returns k ε in the precision of `T`.
pub(crate) fn rounding<T: RealField + Copy>(multiple: f64) -> T {
    convert::<f64, T>(multiple) * T::default_epsilon()
}

/// A sum below this multiple of ε times the terms that cancel in it counts as zero; for the energy that an impact gains these are the
/// energies exchanged.
pub(crate) const CANCELLED: f64 = 64.0;

/// A coupling of H, or a pivot of its factor, below this multiple of ε times the entries it comes from counts as zero.
pub(crate) const COUPLING: f64 = 256.0;

/// A pivot below this multiple of ε times its diagonal entry is treated as zero: H assembled from a pose has errors of
/// a few tens of ε.
pub(crate) const NULL_PIVOT: f64 = 1024.0;

/// Eigenvalues, inverse masses and stiffnesses below this share of the largest count as zero.
pub(crate) const RANK: f64 = 1e-12;

/// Results of an iteration below this share of the largest count as zero, and those that differ by less as equal.
pub(crate) const SOLVED: f64 = 1e-9;
