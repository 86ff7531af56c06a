//! Truncated power series, and roots in a bracket.

use nalgebra::{RealField, convert};

use crate::problem::rounding;

/// Highest power. The cost of a step grows with its square; the length of a step hardly grows any more.
pub(super) const ORDER: usize = 24;

/// `Σ c_k x^k` up to [`ORDER`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Series<T>(pub [T; ORDER + 1]);

impl<T: RealField + Copy> Series<T> {
    pub fn starting(first: T) -> Self {
        let mut c = [T::zero(); ORDER + 1];
        c[0] = first;
        Self(c)
    }

    pub fn at(&self, x: T) -> T {
        self.0.iter().rev().fold(T::zero(), |sum, &c| sum * x + c)
    }

    /// Value and derivative.
    pub fn with_slope(&self, x: T) -> (T, T) {
        let mut slope = T::zero();
        let mut value = T::zero();
        for &c in self.0.iter().rev() {
            slope = slope * x + value;
            value = value * x + c;
        }
        (value, slope)
    }

    /// Coefficient k of the product with `other` (Cauchy).
    pub fn product(&self, other: &Self, k: usize) -> T {
        // Two sums, so that additions do not wait for each other.
        let (ours, theirs) = (&self.0, &other.0);
        let (mut even, mut odd) = (T::zero(), T::zero());
        let mut i = 0;
        while i < k {
            even += ours[i] * theirs[k - i];
            odd += ours[i + 1] * theirs[k - i - 1];
            i += 2;
        }
        if i == k {
            even += ours[k] * theirs[0];
        }
        even + odd
    }
}

/// The root in `[low, high]` of a function that is not negative at `high` and negative before the root: Newton's method
/// within the bracket. One step more than the value needs gives the root its derivative if T is a dual number.
pub(super) fn root<T: RealField + Copy>(low: T, high: T, f: impl Fn(T) -> (T, T)) -> T {
    let half: T = convert(0.5);
    let (mut left, mut right, mut x) = (low, high, high);
    for _ in 0..200 {
        let (value, slope) = f(x);
        if value >= T::zero() {
            right = x
        } else {
            left = x
        }
        let newton = x - value / slope;
        let next = if newton >= left && newton <= right { newton } else { left + (right - left) * half };
        let moved = (next - x).abs();
        x = next;
        if moved <= right * rounding(2.0) {
            break;
        }
    }
    let (value, slope) = f(x);
    let polished = x - value / slope;
    if polished >= low && polished <= high { polished } else { x }
}
