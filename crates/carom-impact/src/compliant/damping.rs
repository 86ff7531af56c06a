//! The damping of a Hunt–Crossley contact for a coefficient of restitution e: the exact solution, and published
//! formulas.
//!
//! | Symbol | Meaning | Our name |
//! |---|---|---|
//! | d, w | penetration (m) and its rate ḋ (m/s) | |
//! | k, n, m | stiffness (N/mⁿ), exponent, effective mass (kg) | |
//! | a | damping (s/m) in F = k dⁿ (1 + a w) | |
//! | v0 | rate at first touch (m/s) | |
//! | e | ratio of the rates at separation and first touch | `restitution` |
//! | x | a v0, a function of e alone | `number`, local `x` |
//!
//! # The root
//!
//! During contact, m ẇ = −F = −k dⁿ (1 + a w). With the penetration as the independent variable, ẇ = w dw/dd, the
//! equation separates:
//!
//! ```text
//! m w dw / (1 + a w) = -k dⁿ dd
//! ```
//!
//! From first touch (d = 0, w = v0) to separation (d = 0, w = −e v0) the integral of the right side is zero for every k
//! and n, hence that of the left side for every m: ∫ w dw/(1 + a w) from v0 to −e v0 is zero. Its antiderivative is G(a
//! w)/a² with G(y) = y − ln(1 + y), hence G(x) = G(−e x), or
//!
//! ```text
//! ln[(1 + x) / (1 - e x)] = x (1 + e)
//! ```
//!
//! x = 0 is a solution for every e. Dividing by x² removes it: with g(y) = G(y)/y², which decreases from g(0) = 1/2 for
//! y > 0 and grows without bound towards y = −1,
//!
//! ```text
//! h(x) = g(x) - e² g(-e x) = 0,   h(0) = (1 - e²)/2,   h(1/e) = -∞
//! ```
//!
//! is monotone and has one root, x < 1/e. So 1 + a w is positive until separation, where the force reaches zero:
//! limiting F to non-negative values changes nothing. Up to the largest d, where w = 0, the same integral gives m v0²
//! g(x) = k d^(n+1)/(n+1).
//!
//! Conversely, the equation gives the e that *any* damping obtains: G(−y) = G(x) has one root y = e x in [0, 1),
//! because G(−y) grows from 0 without bound.

use crate::ImpactError;
use crate::roots::newton;

/// The formula that gives a [`HuntCrossley`](crate::HuntCrossley) contact its damping for a coefficient of restitution.
///
/// All but `Exact` are published approximations of a v0 as a function of e. The rebound that each obtains is
/// [`restitution_obtained`] of its [`number`](Self::number); it depends on the formula and on e alone, not on mass,
/// stiffness, exponent or speed. They are useful to reproduce published computations.
///
/// | formula | a v0 | e obtained for e = 0.2 / 0.5 / 0.8 |
/// |---|---|---|
/// | `Exact` | the root of `ln[(1 + x)/(1 − e x)] = x (1 + e)` | 0.200 / 0.500 / 0.800 |
/// | `HuntCrossley` | 3/2 (1 − e) | 0.547 / 0.663 / 0.833 |
/// | `HerbertMcWhannell` | 6 (1 − e)/((2e − 1)² + 3) | 0.501 / 0.594 / 0.807 |
/// | `LeeWang` | 3/4 (1 − e) | 0.712 / 0.799 / 0.909 |
/// | `LankaraniNikravesh` | 3/4 (1 − e²) | 0.672 / 0.725 / 0.847 |
/// | `Gonthier` | (1 − e²)/e | 0.205 / 0.488 / 0.768 |
/// | `ZhiyingQishao` | 3/4 (1 − e²) exp(2 (1 − e)) | 0.266 / 0.483 / 0.787 |
/// | `Flores` | 8 (1 − e)/(5 e) | 0.156 / 0.470 / 0.789 |
/// | `HuGuo` | 3 (1 − e)/(2 e) | 0.166 / 0.488 / 0.799 |
///
/// **Source.** The exact one is derived at the head of this module's source; the others are collected in P. Flores, H.
/// M. Lankarani, *Contact Force Models for Multibody Dynamics*, Springer 2016.
///
/// ```
/// # use carom_impact::{Damping, restitution_obtained};
/// let asked = 0.5;
/// let number = Damping::LankaraniNikravesh.number(asked).unwrap();
/// assert!((restitution_obtained(number) - 0.725).abs() < 5e-4); // far above e = 0.5
/// let number = Damping::Exact.number(asked).unwrap();
/// assert!((restitution_obtained(number) - asked).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Damping {
    /// The damping that rebounds with e exactly.
    #[default]
    Exact,
    /// Hunt & Crossley 1975: the limit of the root for e → 1.
    HuntCrossley,
    /// Herbert & McWhannell 1977.
    HerbertMcWhannell,
    /// Lee & Wang 1983.
    LeeWang,
    /// Lankarani & Nikravesh 1990.
    LankaraniNikravesh,
    /// Gonthier, McPhee, Lange & Piedbœuf 2004, to first order.
    Gonthier,
    /// Zhiying & Qishao 2006.
    ZhiyingQishao,
    /// Flores, Machado, Silva & Martins 2011.
    Flores,
    /// Hu & Guo 2015.
    HuGuo,
}

impl Damping {
    /// All formulas, the exact one first.
    pub const ALL: [Self; 9] = [
        Self::Exact,
        Self::HuntCrossley,
        Self::HerbertMcWhannell,
        Self::LeeWang,
        Self::LankaraniNikravesh,
        Self::Gonthier,
        Self::ZhiyingQishao,
        Self::Flores,
        Self::HuGuo,
    ];

    /// Kebab-case name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::HuntCrossley => "hunt-crossley",
            Self::HerbertMcWhannell => "herbert-mcwhannell",
            Self::LeeWang => "lee-wang",
            Self::LankaraniNikravesh => "lankarani-nikravesh",
            Self::Gonthier => "gonthier",
            Self::ZhiyingQishao => "zhiying-qishao",
            Self::Flores => "flores",
            Self::HuGuo => "hu-guo",
        }
    }

    /// The formula called `name`, or `None` if there is none.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|formula| formula.name() == name)
    }

    /// Damping times approach velocity, a v0, for a `restitution` e; `None` outside (0, 1], where the root and half of
    /// the formulas have no finite value.
    pub fn number(self, restitution: f64) -> Option<f64> {
        let e = restitution;
        // the same range for all formulas
        let exact = damping_root(e)?;
        let x = match self {
            Self::Exact => exact,
            Self::HuntCrossley => 1.5 * (1.0 - e),
            Self::HerbertMcWhannell => 6.0 * (1.0 - e) / ((2.0 * e - 1.0).powi(2) + 3.0),
            Self::LeeWang => 0.75 * (1.0 - e),
            Self::LankaraniNikravesh => 0.75 * (1.0 - e * e),
            Self::Gonthier => (1.0 - e * e) / e,
            Self::ZhiyingQishao => 0.75 * (1.0 - e * e) * (2.0 * (1.0 - e)).exp(),
            Self::Flores => 1.6 * (1.0 - e) / e,
            Self::HuGuo => 1.5 * (1.0 - e) / e,
        };
        // 1.6/e may overflow where 1/e does not
        Some(x.min(f64::MAX))
    }
}

/// The positive root x of `ln[(1 + x)/(1 − e x)] = x (1 + e)` for a `restitution` e in (0, 1], to rounding: damping
/// times approach velocity of a [`HuntCrossley`](crate::HuntCrossley) contact that rebounds with e.
///
/// x decreases from 1/e for small e (equal to 1/e to all digits below e = 0.02) to 0 at e = 1, where it is 3(1 − e)/2
/// to first order. `None` outside (0, 1]: at e = 0 there is no finite root.
fn damping_root(restitution: f64) -> Option<f64> {
    let e = restitution;
    // below the least normal number 1/e overflows
    if !(f64::MIN_POSITIVE..=1.0).contains(&e) {
        return None;
    }
    // here 1 − e x = (1 + x) exp(−x (1 + e)) is less than half a unit in x's last place
    if e < 0.02 {
        return Some(e.recip());
    }
    let cube = e * e * e;
    let start = (1.0 - e) * (1.0 + e) / 2.0; // h(0)
    let minus_h = |x: f64| {
        let (ahead, back) = (defect(x), defect(-e * x));
        // h with g(y) = 1/2 − y r(y), so that nothing cancels near e = 1
        let h = start - x * (ahead + cube * back);
        let slope = (2.0 * ahead - 1.0 / (1.0 + x)) + cube * (2.0 * back - 1.0 / (1.0 - e * x));
        (-h, -slope)
    };
    // from the tangent of h at 0
    let guess = (3.0 * start / (1.0 + cube)).min(0.5 * e.recip());
    Some(newton(0.0, e.recip(), guess, f64::EPSILON, &minus_h))
}

/// The coefficient of restitution of a [`HuntCrossley`](crate::HuntCrossley) contact whose damping times approach
/// velocity, a v0, is `number`: the inverse of the exact [`Damping::number`], to a few roundings.
///
/// It is 1 without damping and below 1/x for every x, so such a contact never separates faster than 1/a, whatever the
/// approach velocity. NaN for a negative `number` (a contact that adds energy) or NaN.
///
/// ```
/// # use carom_impact::{Damping, restitution_obtained};
/// assert_eq!(restitution_obtained(0.0), 1.0);
/// assert!((restitution_obtained(Damping::Exact.number(0.3).unwrap()) - 0.3).abs() < 1e-15);
/// ```
pub fn restitution_obtained(number: f64) -> f64 {
    let x = number;
    if x.is_nan() || x < 0.0 {
        return f64::NAN;
    }
    if x == 0.0 {
        return 1.0;
    }
    if x < SERIES / 2.0 {
        // e² g(−e x) = g(x); the left side grows with a slope of about 1
        let target = work_share(x);
        // d(e² g(−e x))/de = e/(1 − e x)
        let excess = |e: f64| (e * e * work_share(-e * x) - target, e / (1.0 - e * x));
        return newton(0.0, 1.0, 1.0, f64::EPSILON, &excess);
    }
    // G(−y) with y = 1 − exp(−u) is u − 1 + exp(−u): convex in u, so Newton's iteration from above only falls
    let target = x - x.ln_1p();
    let excess = |u: f64| {
        let y = -(-u).exp_m1();
        (u - y - target, y)
    };
    let u = newton(target, target + 1.0, target + 1.0, f64::EPSILON, &excess);
    // an infinite damping has no rebound
    if x.is_infinite() { 0.0 } else { -(-u).exp_m1() / x }
}

/// g(y) = (y − ln(1 + y))/y²: the share of m v0² that the spring stores, 1/2 at y = 0.
pub(super) fn work_share(y: f64) -> f64 {
    if y.abs() < SERIES { 0.5 - y * defect(y) } else { (y - y.ln_1p()) / (y * y) }
}

/// r(y) = (1/2 − g(y))/y = 1/3 − y/4 + y²/5 − …: by the series where the closed form would cancel.
fn defect(y: f64) -> f64 {
    if y.abs() < SERIES {
        (3..45).rev().fold(0.0, |sum, j| 1.0 / f64::from(j) - y * sum)
    } else {
        (0.5 - work_share(y)) / y
    }
}

/// Below this, 42 terms of the series give all digits: 0.4⁴² < 2e-17.
const SERIES: f64 = 0.4;

/// Checks that a restitution has a finite damping.
pub(super) fn check_restitution(value: f64) -> Result<(), ImpactError> {
    let rule = "the restitution of a compliant contact is above 0 and at most 1, because at 0 its damping would be \
                infinite: give a small one such as 0.01, or use a rigid law";
    if (f64::MIN_POSITIVE..=1.0).contains(&value) {
        Ok(())
    } else {
        Err(ImpactError::Compliance { what: "restitution", value, rule })
    }
}
