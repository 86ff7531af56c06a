//! Truncated power series, and their roots.

use pulp::Simd;

use crate::roots::{Function, newton};

/// Number of terms, a multiple of the number of SIMD lanes. Longer series hardly make a step longer.
pub(super) const TERMS: usize = 32;

/// A step below this share of the root is small: the next one is its square.
const SMALL: f64 = 1e-7;

/// Greatest number of SIMD lanes.
pub(super) const MOST_LANES: usize = 8;

/// Coefficients `c_k` of `Σ c_k x^k`.
pub(super) type Series = [f64; TERMS];

/// A point at which series are evaluated. Powers that differ by the number of SIMD lanes are summed apart, so that the sums do
/// not wait for each other.
#[derive(Clone, Copy)]
pub(super) struct At<S: Simd> {
    simd: S,
    /// `x^n` with the number n of lanes.
    step: S::f64s,
    /// `x^i`, and their derivatives, for the lanes.
    powers: S::f64s,
    slopes: S::f64s,
    /// `n x^(n-1)`.
    rate: f64,
}

impl<S: Simd> At<S> {
    #[inline(always)]
    pub fn new(simd: S, x: f64) -> Self {
        let (two, four) = (x * x, (x * x) * (x * x));
        let powers = [1.0, x, two, two * x, four, four * x, four * two, four * two * x, four * four];
        let slopes = [0.0, 1.0, 2.0 * x, 3.0 * two, 4.0 * powers[3], 5.0 * four, 6.0 * powers[5], 7.0 * powers[6]];
        let n = S::F64_LANES;
        let rate = n as f64 * powers[n - 1];
        Self { simd, step: simd.splat_f64s(powers[n]), powers: first::<S>(&powers), slopes: first::<S>(&slopes), rate }
    }

    #[inline(always)]
    pub fn value(&self, series: &Series) -> f64 {
        let (simd, (blocks, _)) = (self.simd, S::as_simd_f64s(series));
        let mut sum = blocks[blocks.len() - 1];
        for block in blocks[..blocks.len() - 1].iter().rev() {
            sum = simd.mul_add_e_f64s(sum, self.step, *block);
        }
        simd.reduce_sum_f64s(simd.mul_f64s(sum, self.powers))
    }

    /// The value and its derivative.
    #[inline(always)]
    pub fn with_slope(&self, series: &Series) -> (f64, f64) {
        let (simd, (blocks, _)) = (self.simd, S::as_simd_f64s(series));
        let mut sum = blocks[blocks.len() - 1];
        let mut slope = simd.splat_f64s(0.0);
        for block in blocks[..blocks.len() - 1].iter().rev() {
            slope = simd.mul_add_e_f64s(slope, self.step, sum);
            sum = simd.mul_add_e_f64s(sum, self.step, *block);
        }
        let inner = simd.mul_f64s(sum, self.slopes);
        let outer = simd.mul_f64s(simd.mul_f64s(slope, self.powers), simd.splat_f64s(self.rate));
        (simd.reduce_sum_f64s(simd.mul_f64s(sum, self.powers)), simd.reduce_sum_f64s(simd.add_f64s(inner, outer)))
    }
}

/// The first numbers as lanes.
#[inline(always)]
pub(super) fn first<S: Simd>(of: &[f64]) -> S::f64s {
    S::as_simd_f64s(&of[..S::F64_LANES]).0[0]
}

/// `a b + c`, rounded once by processors whose vectors are used: they have such an instruction.
#[inline(always)]
pub(super) fn mul_add<S: Simd>(_: S, a: f64, b: f64, c: f64) -> f64 {
    if S::F64_LANES > 1 { a.mul_add(b, c) } else { a * b + c }
}

/// A first guess for [`root`]: where the cubic that has these values and slopes at both ends, read as a function of the
/// value, is zero.
#[inline(always)]
pub(super) fn guess((low, (f_0, d_0)): (f64, (f64, f64)), (high, (f_1, d_1)): (f64, (f64, f64))) -> f64 {
    let (span, share) = (f_1 - f_0, -f_0 / (f_1 - f_0));
    let (rest, by) = (1.0 - share, high - low);
    low + share * share * (3.0 - 2.0 * share) * by + share * rest * span * (rest / d_0 - share / d_1)
}

/// [`newton`] to rounding: one step after a small one.
#[inline(always)]
pub(super) fn root(low: f64, high: f64, guess: f64, f: &impl Function) -> f64 {
    let x = newton(low, high, guess, SMALL, f);
    let (value, slope) = f.at(x);
    let polished = x - value / slope;
    // Rounding may move a root at an end of the bracket out of it.
    if polished.is_finite() { polished.clamp(low, high) } else { x }
}
