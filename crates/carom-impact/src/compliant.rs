//! A contact that gives way: the Hunt–Crossley force, with the damping that rebounds exactly.
//!
//! | Symbol | Meaning | Our name |
//! |---|---|---|
//! | d, w | penetration (m) and its rate ḋ (m/s) | `penetration`, `rate` |
//! | k, n | stiffness (N/mⁿ) and exponent: 3/2 after Hertz, 1 for a spring | `stiffness`, `exponent` |
//! | a | damping (s/m) | `damping` |
//! | v0 | rate at first touch (m/s) | `approach_speed` |
//! | m | effective mass along the normal, `1/H_nn` (kg) | `effective_mass` |
//! | e | ratio of the rates at lift-off and first touch | `restitution` |
//! | x | a v0, a function of e alone | local `x` |
//! | F | normal force (N) | `force` |
//!
//! # The root
//!
//! While they touch, m ẇ = −F = −k dⁿ (1 + a w). Penetration, not time, is the handy variable: with
//! ẇ = w dw/dd the rates part from the penetrations,
//!
//! ```text
//! m w dw / (1 + a w) = -k dⁿ dd
//! ```
//!
//! From first touch (d = 0, w = v0) to lift-off (d = 0, w = −e v0) the right side adds up to nothing,
//! whatever k and n are, so the left does too, whatever m is: ∫ w dw/(1 + a w) from v0 to −e v0 is zero.
//! Its antiderivative is G(a w)/a² with G(y) = y − ln(1 + y), hence G(x) = G(−e x), or
//!
//! ```text
//! ln[(1 + x) / (1 - e x)] = x (1 + e)
//! ```
//!
//! which x = 0 solves for every e. Divided by x² it does not: with g(y) = G(y)/y², which falls from
//! g(0) = 1/2 for y > 0 and grows without bound towards y = −1,
//!
//! ```text
//! h(x) = g(x) - e² g(-e x) = 0,   h(0) = (1 - e²)/2,   h(1/e) = -∞
//! ```
//!
//! falls all the way and has one root, x < 1/e. So 1 + a w stays positive until lift-off, and the
//! force fades out just there: cutting off its pull changes nothing. Up to the greatest d, where
//! w = 0, the same integral gives m v0² g(x) = k d^(n+1)/(n+1).

use crate::ImpactError;

/// Compliant normal contact whose rebound is e times the approach, exactly, for every mass, stiffness
/// and speed: `F = max(0, k dⁿ (1 + a w))`, with a from [`HuntCrossley::damping`].
///
/// **Exact** for one contact that starts at d = 0, with a constant effective mass and no other force
/// while it lasts. The damping grows as the approach slows down: a contact that is to come to rest
/// needs a floor under the approach speed.
///
/// **Source.** The force: Hunt & Crossley, J. Appl. Mech. 42 (1975) 440. Their damping,
/// a v0 = 3(1 − e)/2, is the root's limit for e → 1; at e = 1/2 it is about half of what that rebound
/// needs.
///
/// ```
/// # use carom_impact::HuntCrossley;
/// let contact = HuntCrossley::new(1e7, 1.5, 0.5)?;
/// let damping = contact.damping(0.2);
/// assert!((damping * 0.2 - 1.432751).abs() < 1e-6);
/// assert!(contact.force(1e-4, 0.1, damping) > contact.force(1e-4, -0.1, damping));
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HuntCrossley {
    /// Stiffness k, N/mⁿ, above 0.
    pub stiffness: f64,
    /// Exponent n of the penetration, above 0: 3/2 for round bodies (Hertz), 1 for a spring.
    pub exponent: f64,
    /// Coefficient of restitution e as a ratio of velocities, above 0, at most 1.
    pub restitution: f64,
}

impl HuntCrossley {
    /// A contact of `stiffness` k (N/mⁿ), `exponent` n and `restitution` e.
    ///
    /// # Errors
    /// [`ImpactError::Compliance`]: a stiffness or an exponent that is not positive and finite, a
    /// restitution outside (0, 1].
    pub fn new(stiffness: f64, exponent: f64, restitution: f64) -> Result<Self, ImpactError> {
        let positive = |value: f64| value > 0.0 && value.is_finite();
        let refuse = |what, value, rule| Err(ImpactError::Compliance { what, value, rule });
        if !positive(stiffness) {
            return refuse("stiffness", stiffness, "it must be finite and above 0");
        }
        if !positive(exponent) {
            return refuse("exponent", exponent, "it must be finite and above 0: 1.5 for round bodies, 1 for a spring");
        }
        if damping_root(restitution).is_none() {
            let rule = "a compliant contact rebounds with more than 0 and at most 1, since without any rebound its \
                        damping would be infinite: take a small one such as 0.01, or a rigid law";
            return refuse("restitution", restitution, rule);
        }
        Ok(Self { stiffness, exponent, restitution })
    }

    /// Damping a (s/m) for a contact first touched at `approach_speed` v0 (m/s, positive); it holds until
    /// lift-off. 0 where nothing approaches; NaN if the fields hold what [`HuntCrossley::new`] refuses.
    pub fn damping(&self, approach_speed: f64) -> f64 {
        if approach_speed <= 0.0 {
            return 0.0;
        }
        // at speeds near the least of all numbers the quotient overflows, and infinity times a rate of 0 is no force
        (self.root() / approach_speed).clamp(0.0, f64::MAX)
    }

    /// Normal force (N) at a `penetration` d (m) that grows at `rate` w (m/s). Never negative: a contact
    /// doesn't pull.
    pub fn force(&self, penetration: f64, rate: f64, damping: f64) -> f64 {
        let factor = 1.0 + damping * rate;
        if penetration <= 0.0 || factor <= 0.0 {
            return 0.0;
        }
        self.stiffness * penetration.powf(self.exponent) * factor
    }

    /// The deepest penetration (m) of an impact at `approach_speed` v0 (m/s) of an `effective_mass` m (kg),
    /// in closed form: `k d^(n+1) = (n+1) m v0² g(x)`, where g(x) is 1/2 without damping. It helps to
    /// choose a stiffness.
    pub fn greatest_penetration(&self, approach_speed: f64, effective_mass: f64) -> f64 {
        if approach_speed <= 0.0 {
            return 0.0;
        }
        let work = effective_mass * approach_speed * approach_speed * work_share(self.root());
        let power = self.exponent + 1.0;
        (power * work / self.stiffness).powf(power.recip())
    }

    fn root(&self) -> f64 {
        damping_root(self.restitution).unwrap_or(f64::NAN)
    }
}

/// The positive root x of `ln[(1 + x)/(1 − e x)] = x (1 + e)` for a `restitution` e in (0, 1], to the
/// last digits: damping times approach speed of a [`HuntCrossley`] contact that rebounds with e.
///
/// It falls from x ≈ 1/e for small e (below e = 0.02 the same to all digits) to 0 at e = 1, which it
/// reaches as 3(1 − e)/2. `None` outside (0, 1]: at e = 0 there is no finite root.
pub fn damping_root(restitution: f64) -> Option<f64> {
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
    let (mut low, mut high) = (0.0, e.recip());
    // h's tangent at 0 starts Newton's iteration, and halving the bracket takes over where it leaves it
    let mut x = (3.0 * start / (1.0 + cube)).min(0.5 * high);
    for _ in 0..HALVINGS {
        let (ahead, back) = (defect(x), defect(-e * x));
        // h with g(y) = 1/2 − y r(y), so that nothing cancels near e = 1
        let h = start - x * (ahead + cube * back);
        if h > 0.0 {
            low = x;
        } else {
            high = x;
        }
        let slope = (2.0 * ahead - 1.0 / (1.0 + x)) + cube * (2.0 * back - 1.0 / (1.0 - e * x));
        let newton = x - h / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - x).abs() <= f64::EPSILON * x {
            return Some(next);
        }
        x = next;
    }
    Some(x)
}

/// Steps after which even halving alone has found the root: more than the digits of a double.
const HALVINGS: usize = 100;

/// g(y) = (y − ln(1 + y))/y²: the share of m v0² that is left for the spring, 1/2 at y = 0.
fn work_share(y: f64) -> f64 {
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
