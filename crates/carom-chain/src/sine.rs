//! Sine and cosine together, free of branches, from one source for one number and for many.
//!
//! A library's sine and cosine cost 10 to 20 ns and take one number at a time: measured, they were a third of an impact of
//! a two-link arm. Here the angle is reduced by multiples of π/2 in three parts (Cody & Waite, 1980, *Software Manual for
//! the Elementary Functions*, chapter 8), the rest of each subtraction carried along; then two minimax polynomials on
//! ±π/4 follow, whose coefficients are those of Sun's fdlibm (`k_sin.c`, `k_cos.c`, 1993). There is no fused
//! multiply-add in it, so that every processor and every number of lanes gives the same digits: neighbours of the
//! library's (`tests/sine.rs`), but for the sign of sin(−0).

/// Largest angle for the reduction in three parts, rad: multiples below 2²⁰ times a part of 33 bits are exact.
const FAR: f64 = 1e6;

/// 1.5 · 2⁵²: added and taken away, it rounds to the nearest integer, whose last bits are then those of the sum.
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

/// (sin, cos) of an angle, rad, of any size; NaN for what is not finite.
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
    assert!(angles.len() == sin.len() && angles.len() == cos.len(), "angles, sines and cosines differ in number");
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

/// The same as a function of its own: where the compiler knows how many angles there are, it takes them one by one.
#[inline(never)]
pub(crate) fn sines_and_cosines(angles: &[f64], sin: &mut [f64], cos: &mut [f64]) {
    sin_cos_into(angles, sin, cos);
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
    // angle − k π/2 = x + rest: all is exact but x, whose rounding `rest` takes up, and the last product.
    let first = angle - k * PART_1;
    let second = k * PART_2;
    let x = first - second;
    let back = first - x;
    let lost = (first - (x + back)) + (back - second);
    let rest = lost - k * PART_3;

    // Polynomials by pairs (Estrin): a short chain waits for their last digit, and has nothing else to do.
    let (z, half_z) = (x * x, 0.5 * (x * x));
    let zz = z * z;
    let by_pairs = |c: [f64; 6]| (c[0] + z * c[1]) + zz * ((c[2] + z * c[3]) + zz * (c[4] + z * c[5]));
    // sin(x + rest) = x + (S x³ + rest cos x), cos(x + rest) = 1 − x²/2 + (C x⁴ − rest x); the rounding of 1 − x²/2 is exact.
    let sine = x + ((z * x) * by_pairs(SIN) + (rest - half_z * rest));
    let one_less = 1.0 - half_z;
    let cosine = one_less + (((1.0 - one_less) - half_z) + (zz * by_pairs(COS) - x * rest));

    // Odd quarters change sine and cosine over; bit 1 of the quarter, and of the next, is the sign.
    let swap = 0_u64.wrapping_sub(quarter & 1);
    let (s, c) = (sine.to_bits(), cosine.to_bits());
    let changed = (s ^ c) & swap;
    let sign = |quarter: u64| (quarter & 2) << 62;
    (f64::from_bits(s ^ changed ^ sign(quarter)), f64::from_bits(c ^ changed ^ sign(quarter.wrapping_add(1))))
}
