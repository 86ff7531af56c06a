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

use super::series::{ORDER, Series, root};
use super::{Rates, Return, State, Step};
use crate::contact::{Contact, length};
use crate::problem::plain;
use crate::routh::{End, Ending};

/// Truncation allowed in a step, as a multiple of ε.
const FINE: f64 = 1.0 / 16.0;

/// One step of Taylor's method.
#[derive(Debug, Clone, Copy)]
pub(super) struct Curve<T> {
    /// v_t.
    x: Series<T>,
    y: Series<T>,
    r: Series<T>,
    v_n: Series<T>,
    p: Series<T>,
    p_x: Series<T>,
    p_y: Series<T>,
    normal_work: Series<T>,
    friction_work: Series<T>,
    /// Ends of the intervals on which v_n is monotone; the last is the end of the step.
    cuts: [T; 4],
    intervals: usize,
}

impl<T: RealField + Copy> Curve<T> {
    pub fn new(contact: &Contact<T>, mu: T, rates: &Rates<T>, state: &State<T>) -> Self {
        let (zero, h, kappa) = (T::zero(), &contact.coupling, rates.scale);
        let start = state.heading * state.r;
        let empty = Series::starting(zero);
        let mut curve = Self {
            x: Series::starting(start.x),
            y: Series::starting(start.y),
            r: Series::starting(length(&start)),
            v_n: Series::starting(state.v_n),
            p: empty,
            p_x: empty,
            p_y: empty,
            normal_work: empty,
            friction_work: empty,
            cuts: [zero; 4],
            intervals: 1,
        };
        let (m, drive) = (contact.tangents * (mu / kappa), h / kappa);
        let mut square = start.norm_squared(); // coefficient k of r²
        for k in 0..ORDER {
            let Self { x, y, r, v_n, p, p_x, p_y, normal_work, friction_work, .. } = &mut curve;
            let by: T = T::one() / convert::<f64, T>((k + 1) as f64);
            let by_scale = by / kappa;
            p.0[k + 1] = r.0[k] * by_scale;
            p_x.0[k + 1] = -mu * x.0[k] * by_scale;
            p_y.0[k + 1] = -mu * y.0[k] * by_scale;
            v_n.0[k + 1] = contact.normal * p.0[k + 1] + h.x * p_x.0[k + 1] + h.y * p_y.0[k + 1];
            normal_work.0[k + 1] = r.product(v_n, k) * by_scale;
            friction_work.0[k + 1] = -mu * square * by_scale;
            x.0[k + 1] = (drive.x * r.0[k] - m[(0, 0)] * x.0[k] - m[(0, 1)] * y.0[k]) * by;
            y.0[k + 1] = (drive.y * r.0[k] - m[(1, 0)] * x.0[k] - m[(1, 1)] * y.0[k]) * by;
            square = x.product(x, k + 1) + y.product(y, k + 1);
            // With the coefficient sought still zero, the product holds the other terms of r².
            r.0[k + 1] = (square - r.product(r, k + 1)) / (r.0[0] + r.0[0]);
        }
        curve.cuts[0] = curve.length();
        if mu * h.norm() > contact.normal {
            curve.cut(contact, mu);
        }
        curve
    }

    /// The τ at which the last two terms of v_t, r and r² (in the works) are at rounding.
    fn length(&self) -> T {
        let allowed = FINE * plain(T::default_epsilon());
        let first = plain(self.r.0[0]);
        let reach = |k: usize| {
            let turn = plain(self.x.0[k]).hypot(plain(self.y.0[k]));
            let work = plain(self.friction_work.0[k]) / plain(self.friction_work.0[1]);
            let size = (turn / first).max((plain(self.r.0[k]) / first).abs()).max(work.abs());
            (allowed / size).powf(1.0 / k as f64)
        };
        // The length needs no derivative: the flow does not depend on it.
        convert(reach(ORDER).min(reach(ORDER - 1)).min(1e3))
    }

    /// `κ dv_n/dτ = C r - μ h·v_t` changes sign at most once on either side of the direction of h, where it is least.
    fn cut(&mut self, contact: &Contact<T>, mu: T) {
        let (zero, end) = (T::zero(), self.cuts[0]);
        let h = contact.coupling;
        let across = |t: T| {
            let ((x, dx), (y, dy)) = (self.x.with_slope(t), self.y.with_slope(t));
            (x * h.y - y * h.x, dx * h.y - dy * h.x)
        };
        let rate = |t: T| {
            let ((x, dx), (y, dy), (r, dr)) = (self.x.with_slope(t), self.y.with_slope(t), self.r.with_slope(t));
            (contact.normal * r - mu * (h.x * x + h.y * y), contact.normal * dr - mu * (h.x * dx + h.y * dy))
        };
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
        let (from, to) = self.intervals().find(|&(_, to)| self.v_n.at(to) >= T::zero())?;
        Some(root(from, to, |t| self.v_n.with_slope(t)))
    }

    /// The τ at which the normal impulse has grown by `dp`, if it lies within the step.
    pub fn reaches(&self, dp: T) -> Option<T> {
        let end = self.end();
        (self.p.at(end) >= dp).then(|| root(T::zero(), end, |t| shifted(self.p.with_slope(t), -dp)))
    }

    pub fn returns(&self, state: &State<T>, end: &End<T>) -> Return<T> {
        let zero = T::zero();
        let over = |t: T| match end.ending {
            Ending::Impulse => shifted(self.p.with_slope(t), state.p - end.e * end.pc),
            Ending::Velocity => shifted(self.v_n.with_slope(t), end.e * end.v_n_minus),
            Ending::Work => shifted(self.normal_work.with_slope(t), state.normal_work + end.e * end.e * end.work),
        };
        for (from, to) in self.intervals() {
            let falls = self.v_n.at(to) < zero;
            let last = if falls {
                root(from, to, |t| {
                    let (v_n, slope) = self.v_n.with_slope(t);
                    (-v_n, -slope)
                })
            } else {
                to
            };
            if over(last).0 >= zero {
                // W_n is quadratic at v_n = 0; this is its root to first order in e, at e = 0.
                let flat = end.ending == Ending::Work && end.e == zero;
                return Return::Ends(if flat && self.normal_work.0[2] > zero {
                    end.e * (-end.work / self.normal_work.0[2]).sqrt()
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
        let slip = Vector2::new(self.x.at(t), self.y.at(t));
        let r = length(&slip);
        Step {
            p: self.p.at(t),
            p_t: Vector2::new(self.p_x.at(t), self.p_y.at(t)),
            heading: slip / r,
            r,
            v_n: self.v_n.at(t),
            normal_work: self.normal_work.at(t),
            friction_work: self.friction_work.at(t),
        }
    }

    /// Whether v_n decreases anywhere in the step.
    pub fn jams(&self) -> bool {
        self.intervals > 1 || self.v_n.0[1] <= T::zero()
    }
}

fn shifted<T: RealField + Copy>((value, slope): (T, T), by: T) -> (T, T) {
    (value + by, slope)
}
