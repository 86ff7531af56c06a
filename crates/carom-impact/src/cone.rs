//! Coulomb's cone, imposed on the total impulse of one contact that ends at a prescribed normal velocity.
//!
//! Let c be the velocity at zero impulse minus the prescribed normal velocity. The impulse λ is
//!
//! ```text
//! stick   λ_t = -S⁺ b,          if that is in the cone
//! slip    λ_t = -(S + s 1)⁻¹ b, with s > 0 such that |λ_t| = μ λ_n
//! where   λ_n = -(c_n + hᵀ λ_t)/C,  S = A - h hᵀ/C,  b = c_t - h c_n/C
//! ```
//!
//! The slip follows from `u_t⁺ = S λ_t + b = -s λ_t`: friction is opposed to the slip after the impact. `|λ_t| - μ λ_n`
//! is positive at s = 0, where sticking is outside the cone, and negative for large s, so there is a root between
//! (unless S is singular, b is not in its range, and friction jams: then there may be none, or a pair).
//!
//! In the plane there is one solution. In space there may be three: the slips are the roots of a quartic in s. If
//! sticking is among the solutions, it is taken first.
//!
//! Symbols as in `contact.rs`; λ in N s, s in 1/kg.

use nalgebra::{Matrix2, RealField, Vector2, convert};

use crate::contact::{Contact, Mobility, length};
use crate::roots::bisect;
use crate::rounding::{NULL_PIVOT, rounding};

/// One contact, prepared for any velocity.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cone<T> {
    /// S.
    mobility: Mobility<T>,
    /// `h/C`.
    tilt: Vector2<T>,
    /// C.
    normal: T,
}

/// An impulse in the cone.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Touch<T> {
    pub tangent: Vector2<T>,
    pub normal: T,
    /// s: the slip after the impact is `-s λ_t`; 0 if the contact sticks.
    pub slip: T,
}

impl<T: RealField + Copy> Cone<T> {
    /// For a contact whose normal direction is regular.
    pub fn of(contact: &Contact<T>) -> Self {
        Self::new(contact.tangents, contact.coupling, contact.normal)
    }

    /// From `A`, `h` and `C > 0`.
    pub fn new(tangents: Matrix2<T>, coupling: Vector2<T>, normal: T) -> Self {
        let reduced = tangents - coupling * (coupling / normal).transpose();
        let floor = tangents.amax() * rounding(NULL_PIVOT);
        Self { mobility: Mobility::new(reduced, floor), tilt: coupling / normal, normal }
    }

    /// The impulse for `c_n < 0`, where c is a sum of terms of the given size (m/s). `None` if none is found.
    pub fn solve(&self, mu: T, c_t: &Vector2<T>, c_n: T, size: impl FnOnce() -> T) -> Option<Touch<T>> {
        let smooth = -c_n / self.normal;
        if mu == T::zero() {
            return Some(Touch { tangent: Vector2::zeros(), normal: smooth, slip: T::zero() });
        }
        let mut b = c_t - self.tilt * c_n;
        if let Some(moved) = self.moved(&b, size) {
            b = moved;
            if let Some(touch) = self.stick(mu, &b, smooth) {
                return Some(touch);
            }
        }
        let slip = shift(&self.mobility, &b, mu, smooth, &self.tilt)?;
        Some(self.slip(mu, &b, smooth, slip))
    }

    /// The part of `b` in the range of S, if the rest is rounding: along a null direction of S a velocity that is
    /// rounding of the other terms counts as zero.
    fn moved(&self, b: &Vector2<T>, size: impl FnOnce() -> T) -> Option<Vector2<T>> {
        let moved = self.mobility.moved(b);
        let rest = length(&(b - moved));
        let is_rounding = rest == T::zero() || rest <= size() * rounding(NULL_PIVOT) * (T::one() + self.tilt.amax());
        is_rounding.then_some(moved)
    }

    /// The impulse that sticks, if it is in the cone.
    fn stick(&self, mu: T, b: &Vector2<T>, smooth: T) -> Option<Touch<T>> {
        let tangent = -self.mobility.least_solution(b);
        let normal = smooth - self.tilt.dot(&tangent);
        (length(&tangent) <= mu * normal).then_some(Touch { tangent, normal, slip: T::zero() })
    }

    /// The impulse of a root s.
    fn slip(&self, mu: T, b: &Vector2<T>, smooth: T, slip: T) -> Touch<T> {
        let tangent = -self.mobility.shifted_solution(slip, b);
        // Two equal expressions: the first has the smaller rounding error if friction is large.
        let normal = if mu > T::one() { length(&tangent) / mu } else { smooth - self.tilt.dot(&tangent) };
        Touch { tangent, normal, slip }
    }

    /// Every impulse but zero that satisfies the law, for `c_n <= 0` and `μ > 0`: sticking first, then by ascending s.
    /// If S is singular only sticking is considered.
    pub fn all(&self, mu: T, c_t: &Vector2<T>, c_n: T) -> Vec<Touch<T>> {
        let smooth = -c_n / self.normal;
        let b = c_t - self.tilt * c_n;
        let mut all = Vec::new();
        if let Some(moved) = self.moved(&b, || length(c_t) - c_n) {
            all.extend(self.stick(mu, &moved, smooth));
        }
        let Some((quartic, l)) = self.quartic(mu, c_t, c_n) else {
            return all;
        };
        let roots = positive_roots(&quartic).into_iter().filter(|&s| value(&l, s) > T::zero());
        let excess = excess(&self.mobility, &b, mu, smooth, &self.tilt);
        // The roots of the polynomial are rough: refined on the equation itself.
        let polished = |mut s: T| {
            for _ in 0..8 {
                let (_, next) = excess(s);
                let near = (next - s).abs() < s * convert(0.1);
                s = if near { next } else { s };
            }
            s
        };
        all.extend(roots.map(|s| self.slip(mu, &b, smooth, polished(s))));
        all
    }

    /// Number of impulses that satisfy the law, for `c_n < 0` and `μ > 0`; 1 if S is singular, without counting.
    pub fn answers(&self, mu: T, c_t: &Vector2<T>, c_n: T) -> usize {
        let zero = T::zero();
        let Some((quartic, l)) = self.quartic(mu, c_t, c_n) else {
            return 1;
        };
        let sticks = usize::from(quartic[0] <= zero && l[0] >= zero);
        // Descartes: no more positive roots than changes of sign.
        let changes = quartic.windows(2).filter(|pair| pair[0] * pair[1] < zero).count();
        if sticks + changes <= 1 {
            return 1;
        }
        let slips = positive_roots(&quartic).into_iter().filter(|&s| value(&l, s) > zero).count();
        (sticks + slips).max(1)
    }

    /// The quartic whose positive roots with l > 0 are the slips s, and the polynomial l; `None` if S is singular.
    fn quartic(&self, mu: T, c_t: &Vector2<T>, c_n: T) -> Option<([T; 5], [T; 3])> {
        let smooth = -c_n / self.normal;
        let ([y0, y1], det) = self.mobility.polynomials(&(c_t - self.tilt * c_n))?;
        // With λ_t = -y/det and l = det λ_n: |y|² = μ² l², where l >= 0.
        let l = [smooth * det[0] + self.tilt.dot(&y0), smooth * det[1] + self.tilt.dot(&y1), smooth];
        let two: T = convert(2.0);
        let squares = mu * mu;
        let quartic = [
            y0.norm_squared() - squares * l[0] * l[0],
            two * (y0.dot(&y1) - squares * l[0] * l[1]),
            y1.norm_squared() - squares * (l[1] * l[1] + two * l[0] * l[2]),
            -two * squares * l[1] * l[2],
            -squares * l[2] * l[2],
        ];
        Some((quartic, l))
    }
}

/// `Σ c_k s^k`.
fn value<T: RealField + Copy>(c: &[T], s: T) -> T {
    c.iter().rev().fold(T::zero(), |sum, &c| sum * s + c)
}

/// The positive roots of a polynomial, each bracketed by two of its derivative's; rough, for counting.
fn positive_roots<T: RealField + Copy>(c: &[T]) -> Vec<T> {
    // Without approach the highest powers are missing.
    let degree = c.iter().rposition(|&c| c != T::zero()).unwrap_or(0);
    let c = &c[..=degree];
    let Some(last) = c.last().filter(|_| degree > 0) else {
        return Vec::new();
    };
    let derivative: Vec<T> = c.iter().enumerate().skip(1).map(|(k, &c)| c * convert(k as f64)).collect();
    let bound = c.iter().fold(T::one(), |most, c| most.max((*c / *last).abs())) + T::one();
    let mut points = vec![T::zero()];
    points.extend(positive_roots(&derivative));
    points.push(bound);
    let mut roots = Vec::new();
    for pair in points.windows(2) {
        let sign = value(c, pair[0]);
        if sign * value(c, pair[1]) < T::zero() {
            roots.push(bisect(pair[0], pair[1], 100, |s| value(c, s) * sign <= T::zero()));
        }
    }
    roots
}

/// An `s > 0` with `|x| = μ (normal - tiltᵀ x)`, where `x = -(M + s 1)⁻¹ b`; requires `normal > 0` and a left side that
/// is the greater one at s = 0.
pub(crate) fn shift<T: RealField + Copy>(
    mobility: &Mobility<T>,
    b: &Vector2<T>,
    mu: T,
    normal: T,
    tilt: &Vector2<T>,
) -> Option<T> {
    let excess = excess(mobility, b, mu, normal, tilt);
    // Without coupling and M the root would be here.
    let mut high = length(b) / (mu * normal);
    for _ in 0..300 {
        if excess(high).0 <= T::zero() {
            break;
        }
        high *= convert(16.0);
    }
    root(high, excess)
}

/// `|x| - R` with `R = μ (normal - tiltᵀ x)` as a function of s, and the next s by Newton's method: for `R/|x| = 1`, whose left side is
/// nearly linear in s (Moré & Sorensen 1983, for the same equation with a constant R). Where friction may jam there may be two roots near
/// each other, which steps for `|x| - R = 0` find more often.
fn excess<T: RealField + Copy>(
    mobility: &Mobility<T>,
    b: &Vector2<T>,
    mu: T,
    normal: T,
    tilt: &Vector2<T>,
) -> impl Fn(T) -> (T, T) {
    let jams = mu * length(tilt) >= T::one();
    move |s: T| {
        let x = -mobility.shifted_solution(s, b);
        let fall = mobility.shifted_solution(s, &x); // -dx/ds
        let (size, radius) = (length(&x), mu * (normal - tilt.dot(&x)));
        let (shrinks, grows) = (-x.dot(&fall) / size, mu * tilt.dot(&fall));
        let value = size - radius;
        let share = if jams { T::one() } else { radius / size };
        (value, s + value / (grows - share * shrinks))
    }
}

/// The root of a function that is positive near 0 and not positive at `high`, to full precision, from its values and the next s of
/// Newton's method: this within the bracket, which every fourth step halves (by its geometric mean, because s spans many orders of
/// magnitude). `None` if no positive value is found.
fn root<T: RealField + Copy>(mut high: T, f: impl Fn(T) -> (T, T)) -> Option<T> {
    let least: T = convert(f64::MIN_POSITIVE);
    let fine: T = rounding(2.0);
    let mut low = T::zero();
    let mut s = high;
    for step in 1..400 {
        let (value, newton) = f(s);
        if value > T::zero() {
            low = s
        } else {
            high = s
        }
        let halved = if low > T::zero() { (low * high).sqrt() } else { high * convert(1.0 / 1024.0) };
        let next = if step % 4 != 0 && newton > low && newton < high { newton } else { halved };
        let moved = (next - s).abs();
        s = next;
        if moved <= fine * s || high - low <= fine * high || s < least {
            break;
        }
    }
    // No positive value down to zero: there is no root, or it is subnormal.
    if !(s.is_finite() && s >= least) {
        return None;
    }
    // One more step, so that s has its derivative if T is a dual number.
    let (_, polished) = f(s);
    Some(if polished >= low && polished <= high { polished } else { s })
}
