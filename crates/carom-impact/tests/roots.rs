//! Roots of functions of one number (`roots.rs`).

use carom_impact::roots::descent;

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
        assert!(values <= 128, "{name}: {values}");
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
