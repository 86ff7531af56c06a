//! Comparison of the sine and cosine of `carom_chain::sine` with the standard library's, whose error is at most 0.6 ulp.

use carom_chain::sine::{sin_cos, sin_cos_into};
use std::f64::consts::FRAC_PI_2;

/// Distance of two numbers in units in the last place.
fn apart(a: f64, b: f64) -> u64 {
    let place = |x: f64| {
        let bits = x.to_bits() as i64;
        if bits < 0 { i64::MIN - bits } else { bits }
    };
    place(a).abs_diff(place(b))
}

/// Checks that sine and cosine are within one unit in the last place of the library's.
fn agrees(angle: f64) {
    let ((sin, cos), (s, c)) = (sin_cos(angle), angle.sin_cos());
    assert!(apart(sin, s) <= 1 && apart(cos, c) <= 1, "{angle:e}: {sin:e} {s:e}, {cos:e} {c:e}");
}

#[test]
fn sine_and_cosine_are_within_one_ulp_of_the_librarys() {
    let mut rng = fastrand::Rng::with_seed(1);
    for _ in 0..200_000 {
        let unit = rng.f64() * 2.0 - 1.0;
        agrees(unit * 4.0);
        agrees(unit * 10.0_f64.powi(rng.i32(-12..6)));
    }
}

#[test]
fn sine_and_cosine_near_their_zeros_are_within_one_ulp() {
    // Near a zero the sine equals the reduced angle: all digits of the reduction must be right.
    for k in 0..600_000 {
        agrees(k as f64 * FRAC_PI_2);
        agrees(-(k as f64) * FRAC_PI_2);
    }
}

#[test]
fn large_zero_tiny_and_non_finite_angles_are_handled() {
    for angle in [1e6, 1.0000001e6, 3e7, 1e15, 1e22, -4e300, f64::MAX] {
        agrees(angle);
    }
    assert_eq!(sin_cos(0.0), (0.0, 1.0));
    assert_eq!(sin_cos(-0.0), (0.0, 1.0));
    for odd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let (sin, cos) = sin_cos(odd);
        assert!(sin.is_nan() && cos.is_nan());
    }
    for tiny in [f64::MIN_POSITIVE, 5e-324, -1e-310] {
        assert_eq!(sin_cos(tiny), (tiny, 1.0));
    }
}

#[test]
fn sines_of_many_angles_equal_those_of_each() {
    let mut angles: Vec<f64> = (0..1001).map(|i| 0.01 * f64::from(i * i) - 37.0).collect();
    for odd in [None, Some(1e9), Some(f64::NAN)] {
        if let Some(odd) = odd {
            angles[500] = odd;
        }
        let (mut sin, mut cos) = (vec![0.0; 1001], vec![0.0; 1001]);
        sin_cos_into(&angles, &mut sin, &mut cos);
        for ((angle, sin), cos) in angles.iter().zip(sin).zip(cos) {
            let (s, c) = sin_cos(*angle);
            assert_eq!((sin.to_bits(), cos.to_bits()), (s.to_bits(), c.to_bits()), "{angle}");
        }
    }
}
