//! Truncated power series, and roots in a bracket.

/// Number of terms, a multiple of [`LANES`]. Longer series hardly make a step longer.
pub(super) const TERMS: usize = 32;

/// Number of sums that are computed side by side.
const LANES: usize = 4;

/// A step below this share of the root is small: the next one is its square.
const SMALL: f64 = 1e-7;

/// `1/k`; the first entry is unused.
const INVERSE: [f64; TERMS + 1] = {
    let mut inverse = [0.0; TERMS + 1];
    let mut k = 1;
    while k < inverse.len() {
        inverse[k] = 1.0 / k as f64;
        k += 1;
    }
    inverse
};

/// `1/k`, which the integral of power `k - 1` contains; k is at most [`TERMS`].
#[inline(always)]
pub(super) fn inverse(k: usize) -> f64 {
    INVERSE[k]
}

/// Coefficients `c_k` of `Σ c_k x^k`.
pub(super) type Series = [f64; TERMS];

/// The value of a series at x. Powers that differ by [`LANES`] are summed apart, so that the sums do not wait for each
/// other.
#[inline(always)]
pub(super) fn value(series: impl Fn(usize) -> f64, x: f64) -> f64 {
    let square = x * x;
    let step = square * square;
    let mut sums: [f64; LANES] = std::array::from_fn(|i| series(TERMS - LANES + i));
    for from in (0..TERMS / LANES - 1).rev() {
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum = *sum * step + series(LANES * from + i);
        }
    }
    join(&sums, x, square)
}

/// The value of a series and its derivative at x.
#[inline(always)]
pub(super) fn with_slope(series: impl Fn(usize) -> f64, x: f64) -> (f64, f64) {
    let square = x * x;
    let step = square * square;
    let mut sums: [f64; LANES] = std::array::from_fn(|i| series(TERMS - LANES + i));
    let mut slopes = [0.0; LANES];
    for from in (0..TERMS / LANES - 1).rev() {
        for (i, (sum, slope)) in sums.iter_mut().zip(&mut slopes).enumerate() {
            *slope = *slope * step + *sum;
            *sum = *sum * step + series(LANES * from + i);
        }
    }
    let inner = sums[1] + x * (2.0 * sums[2] + 3.0 * x * sums[3]);
    (join(&sums, x, square), inner + 4.0 * square * x * join(&slopes, x, square))
}

/// `Σ s_i x^i`.
#[inline(always)]
fn join(sums: &[f64; LANES], x: f64, square: f64) -> f64 {
    (sums[0] + x * sums[1]) + square * (sums[2] + x * sums[3])
}

/// A first guess for [`root`]: where the cubic that has these values and slopes at both ends, read as a function of the
/// value, is zero.
pub(super) fn guess((low, (f_0, d_0)): (f64, (f64, f64)), (high, (f_1, d_1)): (f64, (f64, f64))) -> f64 {
    let (span, share) = (f_1 - f_0, -f_0 / (f_1 - f_0));
    let (rest, by) = (1.0 - share, high - low);
    low + share * share * (3.0 - 2.0 * share) * by + share * rest * span * (rest / d_0 - share / d_1)
}

/// The root in `[low, high]` of a function that is not negative at `high` and negative before the root: Newton's method
/// within the bracket from a first guess. The convergence is quadratic, so that one step after a small one is at
/// rounding.
#[inline(always)]
pub(super) fn root(low: f64, high: f64, guess: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut left, mut right) = (low, high);
    let mut x = if guess >= low && guess <= high { guess } else { high };
    for _ in 0..200 {
        let (value, slope) = f(x);
        if value >= 0.0 {
            right = x
        } else {
            left = x
        }
        let newton = x - value / slope;
        let next = if newton >= left && newton <= right { newton } else { left + (right - left) / 2.0 };
        let moved = (next - x).abs();
        x = next;
        if moved <= x.abs() * SMALL {
            break;
        }
    }
    let (value, slope) = f(x);
    let polished = x - value / slope;
    // Rounding may move a root at an end of the bracket out of it.
    if polished.is_finite() { polished.clamp(low, high) } else { x }
}
