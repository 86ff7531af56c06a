//! Where a function of time comes down to zero.
//!
//! T. R. Chandrupatla (1997), *A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function
//! without using derivatives*, Advances in Engineering Software 28: the parabola through the last three points (time as a
//! function of the value) where its criterion says that it is monotone between the ends, else halving. A smooth function
//! takes some eight values for all digits of its root, where halving takes fifty; one that jumps takes little more than
//! halving.

/// A time and the value there.
pub(crate) type Sample = (f64, f64);

/// Halvings exhaust the digits of any interval in 60 values; the parabolas of one that jumps can double that.
const MOST_VALUES: usize = 128;

/// The time from which on `value` is not above zero: it is above at `above`, and not at `below`. Of several such times, one
/// of them. Within the grain of the interval's own times, and on the side of `below`.
pub(crate) fn descent(mut above: Sample, mut below: Sample, mut value: impl FnMut(f64) -> f64) -> f64 {
    let grain = 2.0 * f64::EPSILON * above.0.abs().max(below.0.abs());
    // Most functions are nearly straight.
    let mut share = above.1 / (above.1 - below.1);
    for _ in 0..MOST_VALUES {
        let span = below.0 - above.0;
        let least = (grain / span.abs()).min(0.5);
        let time = above.0 + span * f64::clamp(share, least, 1.0 - least);
        if span.abs() <= grain || time == above.0 || time == below.0 {
            break;
        }
        let new = (time, value(time));
        // `kept` and `new` are the new ends, `gone` the one that was left behind.
        let (kept, gone) = if new.1 > 0.0 { (below, above) } else { (above, below) };
        if new.1 > 0.0 {
            above = new;
        } else {
            below = new;
        }
        share = if below.1 == 0.0 {
            // No more can be learnt from a value that is zero: is it where the zeros begin?
            let span = (below.0 - above.0).abs();
            if gone.1 == 0.0 { 0.5 } else { 1.0 - grain / span }
        } else {
            parabola(above, below, (new, kept, gone))
        };
    }
    below.0
}

/// Where the parabola through three points has its zero, as a share of the way from `above` to `below`; the middle where
/// the parabola can't be trusted.
fn parabola(above: Sample, below: Sample, (new, kept, gone): (Sample, Sample, Sample)) -> f64 {
    let xi = (new.0 - kept.0) / (gone.0 - kept.0);
    let phi = (new.1 - kept.1) / (gone.1 - kept.1);
    let monotone = phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi;
    if !monotone {
        return 0.5;
    }
    // Lagrange's polynomial of time over the value, at value zero.
    let toward_kept = new.1 / (kept.1 - new.1) * (gone.1 / (kept.1 - gone.1));
    let toward_gone = new.1 / (gone.1 - new.1) * (kept.1 / (gone.1 - kept.1));
    let time = new.0 + (kept.0 - new.0) * toward_kept + (gone.0 - new.0) * toward_gone;
    (time - above.0) / (below.0 - above.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    type Function = fn(f64) -> f64;

    /// The root, and how many values it took.
    fn find(from: f64, to: f64, f: impl Fn(f64) -> f64) -> (f64, usize) {
        let mut values = 0;
        let root = descent((from, f(from)), (to, f(to)), |t| {
            values += 1;
            f(t)
        });
        (root, values)
    }

    #[test]
    fn smooth_roots_come_to_the_last_digit_in_a_dozen_values() {
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
            // The root of a value with the rounding of its terms, here below 2, over slopes of 1 and more; of 1/t its own.
            let rounding = 4.0 * f64::EPSILON * exact.max(1.0);
            assert!((root - exact).abs() <= rounding.max(grain_of(exact)), "{root} for {exact}");
            assert!(values <= 14, "{values} values for {exact}");
        }
    }

    fn grain_of(t: f64) -> f64 {
        8.0 * f64::EPSILON * t
    }

    #[test]
    fn jumps_flats_and_high_orders_are_found_too() {
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
            // (x − a)⁹ is zero in double precision within 1e-34 of a: nowhere else but at its grain.
            assert!((root - exact).abs() <= 4.0 * f64::EPSILON, "{name}: {root}");
            assert!(f(root) <= 0.0, "{name}: on the wrong side");
            assert!(values <= MOST_VALUES, "{name}: {values}");
        }
    }

    #[test]
    fn a_root_at_the_start_of_a_step_is_found_in_a_few_values() {
        let noisy = |t: f64| 1e-5 - t + 1e-17 * (t * 1e19).sin();
        let (root, values) = find(0.0, 1.0, noisy);
        assert!((root - 1e-5).abs() < 4.0 * f64::EPSILON && values < 10, "{root} after {values}");
    }

    #[test]
    fn an_interval_of_two_neighbours_has_its_root_at_its_end() {
        let (from, to) = (1.0, 1.0 + f64::EPSILON);
        assert_eq!(find(from, to, |t| 1.0 + f64::EPSILON / 2.0 - t).0, to);
    }
}
