//! A piece of the flow on which slip turns: power series in τ, with `dp = r dτ/κ`.
//!
//! In τ the flow is regular down to r = 0, which it reaches only as τ -> ∞:
//!
//! ```text
//! κ v_t' = h r - μ A v_t,   r² = v_t·v_t
//! κ p' = r,  κ p_t' = -μ v_t,  κ W_n' = r v_n,  κ W_t' = -μ r²,  v_n = v_n(0) + C p + h·p_t
//! ```
//!
//! Each coefficient follows from those before it (Taylor's method); κ = |h| + μ |A| makes the rates at most about 1. A
//! step ends where the last terms are at rounding relative to r itself, because a small r may grow again.

use nalgebra::{RealField, Vector2, convert};

use super::series::{ORDER, Series, inverse, root, with_slope};
use super::{Rates, Return, State, Step};
use crate::contact::{Contact, length};
use crate::problem::plain;
use crate::routh::{End, Ending};

/// Truncation allowed in a step. In single precision too: r falls within a step, which may not be much longer.
const FINE: f64 = f64::EPSILON / 16.0;

/// One step of Taylor's method.
pub(super) struct Curve<'a, T> {
    contact: &'a Contact<T>,
    mu: T,
    /// `1/κ`.
    by_scale: T,
    /// v_t.
    slip: Series<Vector2<T>>,
    /// r and v_n.
    speeds: Series<Vector2<T>>,
    /// `r²` and `r v_n`.
    squares: Series<Vector2<T>>,
    /// Ends of the intervals on which v_n is monotone; the last is the end of the step.
    cuts: [T; 4],
    intervals: usize,
}

impl<'a, T: RealField + Copy> Curve<'a, T> {
    #[inline]
    pub fn new(contact: &'a Contact<T>, mu: T, rates: &Rates<T>, state: &State<T>) -> Self {
        let (zero, none, by_scale) = (T::zero(), Vector2::zeros(), T::one() / rates.scale);
        let Contact { tangents, coupling, normal, .. } = contact;
        let (drive, hold, rise) = (coupling * by_scale, tangents * (mu * by_scale), *normal * by_scale);
        let State { r: r_0, v_n: v_0, .. } = *state;
        let mut slip = [none; ORDER + 1];
        let mut speeds = [none; ORDER + 1];
        let mut squares = [none; ORDER + 1];
        slip[0] = state.heading * r_0;
        speeds[0] = Vector2::new(r_0, v_0);
        squares[0] = speeds[0] * r_0;
        let by_twice = T::one() / (r_0 + r_0);
        for k in 1..=ORDER {
            let (v, r, by) = (slip[k - 1], speeds[k - 1].x, inverse::<T>(k));
            let v_t = (drive * r - hold.column(0) * v.x - hold.column(1) * v.y) * by;
            let v_n = (rise * r - mu * drive.dot(&v)) * by;
            // Coefficient k of the products (Cauchy), from the middle outwards: the newest coefficients enter last.
            // `half` contains half the terms of v_t·v_t, `ours` and `theirs` those of (r², r v_n) without r₀ r_k.
            let (mut half, mut ours, mut theirs) = (none, none, none);
            for i in (1..k.div_ceil(2)).rev() {
                let j = k - i;
                half += slip[i].component_mul(&slip[j]);
                ours += speeds[i] * speeds[j].x;
                theirs += speeds[j] * speeds[i].x;
            }
            half += slip[0].component_mul(&v_t);
            let (mut whole, mut rest) = (half + half, ours + theirs);
            if k % 2 == 0 {
                let i = k / 2;
                whole += slip[i].component_mul(&slip[i]);
                rest += speeds[i] * speeds[i].x;
            }
            let square = whole.x + whole.y;
            let r = (square - rest.x) * by_twice;
            slip[k] = v_t;
            speeds[k] = Vector2::new(r, v_n);
            squares[k] = Vector2::new(square, rest.y + r_0 * v_n + r * v_0);
        }
        let mut curve = Self { contact, mu, by_scale, slip, speeds, squares, cuts: [zero; 4], intervals: 1 };
        curve.cuts[0] = curve.length();
        if mu * length(coupling) > *normal {
            curve.cut();
        }
        curve
    }

    /// The τ at which the last two terms of v_t, r and r² (in the works) are at rounding.
    fn length(&self) -> T {
        let first = plain(self.speeds[0].x);
        // A smaller coefficient may have underflowed, which single precision does.
        let least = T::max_value().map_or(0.0, |largest| 8.0 / plain(largest));
        let reach = |k: usize| {
            let turn = plain(self.slip[k].amax());
            let work = plain(self.squares[k].x) / (first * k as f64);
            let size = turn.max(plain(self.speeds[k].x).abs()).max(work.abs()).max(least) / first;
            (FINE / size).powf(1.0 / k as f64)
        };
        // The length needs no derivative: the flow does not depend on it.
        convert(reach(ORDER).min(reach(ORDER - 1)).min(1e3))
    }

    fn v_n(&self, t: T) -> (T, T) {
        with_slope(|k| self.speeds[k].y, t)
    }

    /// `κ dv_n/dτ = C r - μ h·v_t` changes sign at most once on either side of the direction of h, where it is least.
    fn cut(&mut self) {
        let (zero, end) = (T::zero(), self.cuts[0]);
        let (h, c) = (self.contact.coupling, self.contact.normal);
        let across = |t: T| with_slope(|k| self.slip[k].perp(&h), t);
        let rate = |t: T| with_slope(|k| c * self.speeds[k].x - self.mu * self.slip[k].dot(&h), t);
        // A zero between the ends, of either sign change.
        let crossing = |f: &dyn Fn(T) -> (T, T), from: T, to: T| {
            let (first, last) = (f(from).0, f(to).0);
            let sign = if last >= zero { T::one() } else { -T::one() };
            (first * sign < zero).then(|| {
                root(from, to, |t| {
                    let (value, slope) = f(t);
                    (value * sign, slope * sign)
                })
            })
        };
        let mut cuts = [end; 4];
        let mut n = 0;
        let mut from = zero;
        let least = crossing(&across, zero, end);
        for to in [least.unwrap_or(end), end] {
            if let Some(t) = crossing(&rate, from, to) {
                cuts[n] = t;
                n += 1;
            }
            if to < end {
                cuts[n] = to;
                n += 1;
            }
            from = to;
        }
        (self.cuts, self.intervals) = (cuts, n + 1);
    }

    fn intervals(&self) -> impl Iterator<Item = (T, T)> {
        let start = |i: usize| if i == 0 { T::zero() } else { self.cuts[i - 1] };
        (0..self.intervals).map(move |i| (start(i), self.cuts[i]))
    }

    pub fn end(&self) -> T {
        self.cuts[self.intervals - 1]
    }

    /// The τ at which `v_n = 0` is reached from below, if it lies within the step.
    pub fn rises(&self) -> Option<T> {
        let (from, to) = self.intervals().find(|&(_, to)| self.v_n(to).0 >= T::zero())?;
        Some(root(from, to, |t| self.v_n(t)))
    }

    /// The τ at which the normal impulse has grown by `dp`, if it lies within the step.
    pub fn reaches(&self, dp: T) -> Option<T> {
        let end = self.end();
        (self.p(end).0 >= dp).then(|| root(T::zero(), end, |t| shifted(self.p(t), -dp)))
    }

    pub fn returns(&self, state: &State<T>, end: &End<T>) -> Return<T> {
        let zero = T::zero();
        let over = |t: T| match end.ending {
            Ending::Impulse => shifted(self.p(t), state.p - end.e * end.pc),
            Ending::Velocity => shifted(self.v_n(t), end.e * end.v_n_minus),
            Ending::Work => shifted(self.normal_work(t), state.normal_work + end.e * end.e * end.work),
        };
        for (from, to) in self.intervals() {
            let falls = self.v_n(to).0 < zero;
            let last = if falls {
                root(from, to, |t| {
                    let (v_n, slope) = self.v_n(t);
                    (-v_n, -slope)
                })
            } else {
                to
            };
            if over(last).0 >= zero {
                // W_n is quadratic at v_n = 0; this is its root to first order in e, at e = 0.
                let flat = end.ending == Ending::Work && end.e == zero;
                let bend = self.squares[1].y * self.by_scale * convert(0.5);
                return Return::Ends(if flat && bend > zero {
                    end.e * (-end.work / bend).sqrt()
                } else if flat {
                    zero
                } else {
                    root(from, last, over)
                });
            }
            if falls {
                return Return::Falls(last);
            }
        }
        Return::Not
    }

    pub fn at(&self, t: T) -> Step<T> {
        let none = Vector2::zeros();
        // The slip, and the integrals of slip, r and works divided by t.
        let (mut slip, mut path, mut impulse, mut works) = (none, none, T::zero(), none);
        for k in (0..=ORDER).rev() {
            let by = inverse::<T>(k + 1);
            slip = slip * t + self.slip[k];
            path = path * t + self.slip[k] * by;
            impulse = impulse * t + self.speeds[k].x * by;
            works = works * t + self.squares[k] * by;
        }
        let (r, by) = (length(&slip), t * self.by_scale);
        let (p, p_t) = (impulse * by, path * (-self.mu * by));
        let v_n = self.speeds[0].y + self.contact.normal * p + self.contact.coupling.dot(&p_t);
        let (normal_work, friction_work) = (works.y * by, -self.mu * works.x * by);
        Step { p, p_t, heading: slip / r, r, v_n, normal_work, friction_work }
    }

    /// The integral over `dτ/κ` of a series, with its slope.
    fn sum(&self, of: impl Fn(usize) -> T, t: T) -> (T, T) {
        with_slope(|k| if k == 0 { T::zero() } else { of(k - 1) * (self.by_scale * inverse(k)) }, t)
    }

    fn p(&self, t: T) -> (T, T) {
        self.sum(|k| self.speeds[k].x, t)
    }

    fn normal_work(&self, t: T) -> (T, T) {
        self.sum(|k| self.squares[k].y, t)
    }

    /// Whether v_n decreases anywhere up to t.
    pub fn jams(&self, t: T) -> bool {
        let passed = self.cuts[..self.intervals - 1].iter().filter(|&&cut| cut < t);
        self.speeds[1].y <= T::zero() || self.intervals > 1 && passed.chain([&t]).any(|&t| self.v_n(t).1 < T::zero())
    }
}

fn shifted<T: RealField + Copy>((value, slope): (T, T), by: T) -> (T, T) {
    (value + by, slope)
}
