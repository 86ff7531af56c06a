//! Truncated power series, and roots in a bracket.

/// Highest power, an even number. The cost of a step grows with its square; the length of a step hardly grows any more.
pub(super) const ORDER: usize = 28;

/// A step below this share of the root is small: the next one is its square.
const SMALL: f64 = 1e-8;

/// `1/k`; the first entry is unused.
const INVERSE: [f64; ORDER + 2] = {
    let mut inverse = [0.0; ORDER + 2];
    let mut k = 1;
    while k < inverse.len() {
        inverse[k] = 1.0 / k as f64;
        k += 1;
    }
    inverse
};

/// `1/k`, which the integral of power `k - 1` contains; k is at most `ORDER + 1`.
pub(super) fn inverse(k: usize) -> f64 {
    INVERSE[k]
}

/// `Σ c_k x^k` up to [`ORDER`].
pub(super) type Series<T> = [T; ORDER + 1];

/// The value of a series and its derivative at x. Even and odd powers are summed apart, so that the sums do not wait for
/// each other.
pub(super) fn with_slope(series: impl Fn(usize) -> f64, x: f64) -> (f64, f64) {
    let square = x * x;
    let (mut even, mut odd, mut even_slope, mut odd_slope) = (series(ORDER), 0.0, 0.0, 0.0);
    for k in (0..ORDER / 2).rev() {
        odd_slope = odd_slope * square + odd;
        odd = odd * square + series(2 * k + 1);
        even_slope = even_slope * square + even;
        even = even * square + series(2 * k);
    }
    (even + x * odd, 2.0 * x * (even_slope + x * odd_slope) + odd)
}

/// The root in `[low, high]` of a function that is not negative at `high` and negative before the root: Newton's method
/// within the bracket. The convergence is quadratic, so that one step after a small one is at rounding.
pub(super) fn root(low: f64, high: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut left, mut right, mut x) = (low, high, high);
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
        if moved <= right * SMALL {
            break;
        }
    }
    let (value, slope) = f(x);
    let polished = x - value / slope;
    // Rounding may move a root at an end of the bracket out of it.
    if polished.is_finite() { polished.clamp(low, high) } else { x }
}
