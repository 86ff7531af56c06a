//! Sine and cosine of one angle or of many, computed together and without branches.
//!
//! The sine and cosine of the standard library cost 10 to 20 ns and are computed one angle at a time; they took a third of
//! the time of an impact of a two-link arm. These take 86 instructions for one angle, or for two or four side by side
//! (`docs/performance.md`). The angle is reduced by multiples of π/2 in three parts (Cody & Waite,
//! 1980, *Software Manual for the Elementary Functions*, chapter 8) with the rounding error of each subtraction added back.
//! Two minimax polynomials on ±π/4 follow, with the coefficients of Sun's fdlibm (`k_sin.c`, `k_cos.c`, 1993). No fused
//! multiply-add is used, so that the result is the same on every processor and for every number of lanes. It differs from
//! the standard library's by at most one unit in the last place (`tests/sine.rs`), except for the sign of sin(−0).

/// Largest angle for the reduction in three parts, rad: multiples below 2²⁰ times a part of 33 bits are exact.
const FAR: f64 = 1e6;

/// 1.5 · 2⁵²: adding it rounds to the nearest integer, whose last bits are those of the sum; subtracting it gives that
/// integer.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

// π/2 in three parts, of which the first two have 33 bits each.
const PART_1: f64 = f64::from_bits(0x3FF9_21FB_5440_0000);
const PART_2: f64 = f64::from_bits(0x3DD0_B461_1A60_0000);
const PART_3: f64 = f64::from_bits(0x3BA3_198A_2E03_7073);

const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// (sin, cos) of an angle of any size, rad; NaN for NaN and infinity.
#[inline(always)]
pub fn sin_cos(angle: f64) -> (f64, f64) {
    if angle.abs() <= FAR { near(angle) } else { far(angle) }
}

/// (sin, cos) of many angles, rad.
///
/// # Panics
/// If the slices differ in length.
#[inline(always)]
pub fn sin_cos_into(angles: &[f64], sin: &mut [f64], cos: &mut [f64]) {
    assert!(
        angles.len() == sin.len() && angles.len() == cos.len(),
        "angles, sines and cosines must have the same length"
    );
    let mut all_near = true;
    for ((angle, sin), cos) in angles.iter().zip(sin.iter_mut()).zip(cos.iter_mut()) {
        (*sin, *cos) = near(*angle);
        all_near &= angle.abs() <= FAR;
    }
    if !all_near {
        for ((angle, sin), cos) in angles.iter().zip(sin).zip(cos) {
            (*sin, *cos) = sin_cos(*angle);
        }
    }
}

/// The same by pairs, for few angles: a loop over full SIMD vectors would leave most of them to its remainder loop.
///
/// # Panics
/// If the slices differ in length.
#[inline(never)]
pub(crate) fn sin_cos_by_pairs(angles: &[f64], sin: &mut [f64], cos: &mut [f64]) {
    assert!(
        angles.len() == sin.len() && angles.len() == cos.len(),
        "angles, sines and cosines must have the same length"
    );
    let (angles, last) = angles.as_chunks::<2>();
    let ((sin, last_sin), (cos, last_cos)) = (sin.as_chunks_mut::<2>(), cos.as_chunks_mut::<2>());
    for ((&[a, b], sin), cos) in angles.iter().zip(sin).zip(cos) {
        pair(a, b, sin, cos);
    }
    for ((angle, sin), cos) in last.iter().zip(last_sin).zip(last_cos) {
        (*sin, *cos) = sin_cos(*angle);
    }
}

/// Sines and cosines of two angles. Not inlined, because the compiler vectorises the pair only if it is stored to memory
/// together; not returned, because the caller would copy parts of both pairs at once, for which a processor waits.
#[inline(never)]
pub(crate) fn sin_cos_of_two(a: f64, b: f64, sin: &mut [f64; 2], cos: &mut [f64; 2]) {
    pair(a, b, sin, cos);
}

#[inline(always)]
fn pair(a: f64, b: f64, sin: &mut [f64; 2], cos: &mut [f64; 2]) {
    let ((sin_a, cos_a), (sin_b, cos_b)) = (near(a), near(b));
    (*sin, *cos) = ([sin_a, sin_b], [cos_a, cos_b]);
    if a.abs().max(b.abs()) > FAR {
        (sin[0], cos[0]) = sin_cos(a);
        (sin[1], cos[1]) = sin_cos(b);
    }
}

#[cold]
#[inline(never)]
fn far(angle: f64) -> (f64, f64) {
    angle.sin_cos()
}

/// For angles up to [`FAR`].
#[inline(always)]
fn near(angle: f64) -> (f64, f64) {
    let rounded = angle * std::f64::consts::FRAC_2_PI + ROUNDER;
    let quarter = rounded.to_bits();
    let k = rounded - ROUNDER;
    // angle − k π/2 = x + rest. All operations are exact except x, whose rounding error is in `rest`, and the last product.
    let first = angle - k * PART_1;
    let second = k * PART_2;
    let x = first - second;
    let back = first - x;
    let lost = (first - (x + back)) + (back - second);
    let rest = lost - k * PART_3;

    // Polynomials by pairs (Estrin's scheme): a shorter dependency chain than Horner's.
    let (z, half_z) = (x * x, 0.5 * (x * x));
    let zz = z * z;
    let by_pairs = |c: [f64; 6]| (c[0] + z * c[1]) + zz * ((c[2] + z * c[3]) + zz * (c[4] + z * c[5]));
    // sin(x + rest) = x + (S x³ + rest cos x), cos(x + rest) = 1 − x²/2 + (C x⁴ − rest x); the rounding of 1 − x²/2 is exact.
    let sine = x + ((z * x) * by_pairs(SIN) + (rest - half_z * rest));
    let one_less = 1.0 - half_z;
    let cosine = one_less + (((1.0 - one_less) - half_z) + (zz * by_pairs(COS) - x * rest));

    // Odd quarters exchange sine and cosine; bit 1 of the quarter, and of the next, is the sign.
    let swap = 0_u64.wrapping_sub(quarter & 1);
    let (s, c) = (sine.to_bits(), cosine.to_bits());
    let changed = (s ^ c) & swap;
    let sign = |quarter: u64| (quarter & 2) << 62;
    (f64::from_bits(s ^ changed ^ sign(quarter)), f64::from_bits(c ^ changed ^ sign(quarter.wrapping_add(1))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bit for bit, at every position in a list, for near, far and non-finite angles.
    #[test]
    fn sines_by_pairs_equal_those_of_single_angles() {
        let angles = [0.3, -2.0, 1e7, 1.5, -0.0, 1e300, f64::NAN, 0.1, f64::INFINITY, 4.0, FAR, -FAR, 8.0];
        let bits = |x: &[f64]| -> Vec<u64> { x.iter().map(|x| x.to_bits()).collect() };
        for length in 0..=angles.len() {
            let angles = &angles[..length];
            let (mut sin, mut cos) = (vec![9.0; length], vec![9.0; length]);
            sin_cos_by_pairs(angles, &mut sin, &mut cos);
            let (one_sin, one_cos): (Vec<f64>, Vec<f64>) = angles.iter().map(|&angle| sin_cos(angle)).unzip();
            let number = |x: &f64| !x.is_nan();
            let numbers = |x: &[f64]| bits(&x.iter().copied().filter(number).collect::<Vec<_>>());
            assert_eq!((numbers(&sin), numbers(&cos)), (numbers(&one_sin), numbers(&one_cos)));
            assert!(sin.iter().zip(&one_sin).all(|(a, b)| a.is_nan() == b.is_nan()));
            for pair in angles.chunks_exact(2) {
                let (mut sin, mut cos) = ([0.0; 2], [0.0; 2]);
                sin_cos_of_two(pair[0], pair[1], &mut sin, &mut cos);
                for (k, &angle) in pair.iter().enumerate().filter(|(_, angle)| angle.is_finite()) {
                    assert_eq!(bits(&[sin[k], cos[k]]), bits(&[sin_cos(angle).0, sin_cos(angle).1]));
                }
            }
        }
    }
}
