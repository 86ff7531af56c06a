//! The root of a function of time where it changes from positive to not positive.
//!
//! T. R. Chandrupatla (1997), *A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function
//! without using derivatives*, Advances in Engineering Software 28: inverse quadratic interpolation through the last three
//! points if its criterion for monotonicity holds, otherwise bisection. A smooth function needs some eight evaluations for
//! a root to double precision, bisection fifty; a discontinuous function needs little more than bisection.

/// A time and the value there.
pub(crate) type Sample = (f64, f64);

/// Bisection reaches the rounding of the times in about 60 evaluations; interpolation of a discontinuous function can double
/// this.
const MOST_VALUES: usize = 128;

/// A time at which `value` changes from positive to not positive, where it is positive at `above` and not at `below`. The
/// result is exact to the rounding of the times, and `value` is not positive there. If there are several such times, one of
/// them is returned.
pub(crate) fn descent(mut above: Sample, mut below: Sample, mut value: impl FnMut(f64) -> f64) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;

    type Function = fn(f64) -> f64;

    /// The root and the number of evaluations.
    fn find(from: f64, to: f64, f: impl Fn(f64) -> f64) -> (f64, usize) {
        let mut values = 0;
        let root = descent((from, f(from)), (to, f(to)), |t| {
            values += 1;
            f(t)
        });
        (root, values)
    }

    #[test]
    fn smooth_roots_are_exact_to_rounding_in_at_most_14_evaluations() {
        let straight: Function = |t| 0.3 - t;
        let cases = [
            (0.0, 1.0, straight, 0.3),
            (0.0, 2.0, |t| 2.0 - t * t, std::f64::consts::SQRT_2),
            (0.0, 1.5, |t| t.cos() - t, 0.739_085_133_215_160_6),
            (1.0, 100.0, |t| 1.0 / t - 0.02, 50.0),
            (3.0, 4.0, f64::sin, std::f64::consts::PI),
        ];
        for (from, to, f, exact) in cases {
            let (root, values) = find(from, to, f);
            // Rounding of terms below 2, over slopes of at least 1; for 1/t the rounding of the value itself.
            let rounding = 4.0 * f64::EPSILON * exact.max(1.0);
            assert!((root - exact).abs() <= rounding.max(grain_of(exact)), "{root} for {exact}");
            assert!(values <= 14, "{values} values for {exact}");
        }
    }

    fn grain_of(t: f64) -> f64 {
        8.0 * f64::EPSILON * t
    }

    #[test]
    fn roots_of_discontinuous_flat_and_high_order_functions_are_found() {
        let third = 1.0 / 3.0;
        let jump: Function = |t| if t < 1.0 / 3.0 { 1.0 } else { -1e-3 };
        let cases = [
            ("a jump", jump, third),
            ("a jump to zero", |t| if t < 1.0 / 3.0 { 1.0 } else { 0.0 }, third),
            ("a fall, then zero", |t| if t < 0.7 { 1.0 / 3.0 - t } else { 0.0 }, third),
            ("an inflection", |t| (1.0 / 3.0 - t).powi(9), third),
            ("a cliff", |t| -((t - 1.0 / 3.0) * 1e9).tanh(), third),
        ];
        for (name, f, exact) in cases {
            let (root, values) = find(0.0, 1.0, f);
            // (x − a)⁹ underflows within 1e-34 of a, which is below the rounding of the times.
            assert!((root - exact).abs() <= 4.0 * f64::EPSILON, "{name}: {root}");
            assert!(f(root) <= 0.0, "{name}: on the wrong side");
            assert!(values <= MOST_VALUES, "{name}: {values}");
        }
    }

    #[test]
    fn a_root_near_the_start_of_the_interval_is_found_in_few_evaluations() {
        let noisy = |t: f64| 1e-5 - t + 1e-17 * (t * 1e19).sin();
        let (root, values) = find(0.0, 1.0, noisy);
        assert!((root - 1e-5).abs() < 4.0 * f64::EPSILON && values < 10, "{root} after {values}");
    }

    #[test]
    fn an_interval_of_two_adjacent_numbers_returns_its_end() {
        let (from, to) = (1.0, 1.0 + f64::EPSILON);
        assert_eq!(find(from, to, |t| 1.0 + f64::EPSILON / 2.0 - t).0, to);
    }
}
