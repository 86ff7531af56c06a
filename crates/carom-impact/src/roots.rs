//! Roots of functions of one number, in a bracket.
//!
//! | function | needs | used where |
//! | --- | --- | --- |
//! | [`descent`] | values | they are smooth, or expensive |
//! | [`newton`] | values and slopes | there is a derivative |
//! | [`bisect`] | a condition | there is no value, or its sign at the ends is rounding |
//!
//! Two roots are found by code of their own: that of `cone.rs`, whose variable spans many orders of magnitude and has derivatives of
//! its own, and the events of `several/energetic/motion.rs`, where each evaluation is a step of an integration that yields several
//! events.

use nalgebra::{RealField, convert};

/// A number, mostly a time, and the value there.
pub type Sample = (f64, f64);

/// Bisection reaches the rounding of the times in about 60 evaluations; interpolation of a discontinuous function can double
/// this.
const MOST_VALUES: usize = 128;

/// A time at which `value` changes from positive to not positive, where it is positive at `above` and not at `below`. The
/// result is exact to the rounding of the times, and `value` is not positive there. If there are several such times, one of
/// them is returned.
///
/// **Method.** Inverse quadratic interpolation through the last three points if its criterion for monotonicity holds, otherwise
/// bisection. A smooth function needs some eight evaluations for a root to double precision, bisection fifty; a discontinuous
/// function needs little more than bisection.
///
/// **Source.** T. R. Chandrupatla (1997), *A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function
/// without using derivatives*, Advances in Engineering Software 28.
pub fn descent(mut above: Sample, mut below: Sample, mut value: impl FnMut(f64) -> f64) -> f64 {
    let grain = 2.0 * f64::EPSILON * above.0.abs().max(below.0.abs());
    // Start with linear interpolation, or bisection from an infinite value.
    let mut share = if above.1.is_finite() { above.1 / (above.1 - below.1) } else { 0.5 };
    for _ in 0..MOST_VALUES {
        let span = below.0 - above.0;
        let least = (grain / span.abs()).min(0.5);
        let time = above.0 + span * f64::clamp(share, least, 1.0 - least);
        if span.abs() <= grain || time == above.0 || time == below.0 {
            break;
        }
        let new = (time, value(time));
        // `kept` and `new` are the new ends, `gone` the one that was left behind.
        let (kept, gone) = if new.1 > 0.0 {
            (below, std::mem::replace(&mut above, new))
        } else {
            (above, std::mem::replace(&mut below, new))
        };
        share = if below.1 == 0.0 {
            // The value is exactly zero, so interpolation has no information: test whether the zeros begin here.
            let span = (below.0 - above.0).abs();
            if gone.1 == 0.0 { 0.5 } else { 1.0 - grain / span }
        } else {
            parabola(above, below, (new, kept, gone))
        };
    }
    below.0
}

/// The root by inverse quadratic interpolation through three points, as a share of the interval from `above` to `below`; 0.5
/// if the criterion for monotonicity fails.
fn parabola(above: Sample, below: Sample, (new, kept, gone): (Sample, Sample, Sample)) -> f64 {
    let xi = (new.0 - kept.0) / (gone.0 - kept.0);
    let phi = (new.1 - kept.1) / (gone.1 - kept.1);
    let monotone = phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi;
    if !monotone {
        return 0.5;
    }
    // The Lagrange polynomial of time as a function of the value, at value zero.
    let toward_kept = new.1 / (kept.1 - new.1) * (gone.1 / (kept.1 - gone.1));
    let toward_gone = new.1 / (gone.1 - new.1) * (kept.1 / (gone.1 - kept.1));
    let time = new.0 + (kept.0 - new.0) * toward_kept + (gone.0 - new.0) * toward_gone;
    (time - above.0) / (below.0 - above.0)
}

/// A function with its derivative. A trait, because inlining of a closure cannot be forced, and code that is not inlined is compiled
/// without vector instructions.
pub trait Function {
    /// Value and derivative.
    fn at(&self, x: f64) -> (f64, f64);
}

impl<F: Fn(f64) -> (f64, f64)> Function for F {
    fn at(&self, x: f64) -> (f64, f64) {
        self(x)
    }
}

/// The root in `[low, high]` of a function that is not negative at `high` and negative before the root: Newton's method
/// within the bracket from a first guess, until a step is below this share of the root. The convergence is quadratic, so that the
/// error is then of the order of the square of the share.
#[inline(always)]
pub fn newton(low: f64, high: f64, guess: f64, share: f64, f: &impl Function) -> f64 {
    let (mut left, mut right) = (low, high);
    let mut x = if guess >= low && guess <= high { guess } else { high };
    for _ in 0..MOST_STEPS {
        let (value, slope) = f.at(x);
        if value >= 0.0 {
            right = x
        } else {
            left = x
        }
        let newton = x - value / slope;
        let next = if newton >= left && newton <= right { newton } else { left + (right - left) / 2.0 };
        let moved = (next - x).abs();
        x = next;
        if moved <= x.abs() * share {
            break;
        }
    }
    x
}

/// The end of a bracket in which a condition holds at `inside` and not at `outside`, after it has been halved `most` times, or to the
/// rounding of its ends: the place from which the condition holds. The condition is not evaluated at the ends.
pub fn bisect<T: RealField + Copy>(mut outside: T, mut inside: T, most: usize, mut holds: impl FnMut(T) -> bool) -> T {
    for _ in 0..most {
        let middle = outside + (inside - outside) * convert(0.5);
        if middle == outside || middle == inside {
            break;
        }
        if holds(middle) { inside = middle } else { outside = middle }
    }
    inside
}

/// Halvings after which no bracket has more digits, unless its root is zero.
pub const MOST_STEPS: usize = 200;
