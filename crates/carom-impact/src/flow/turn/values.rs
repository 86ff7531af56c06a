//! Values of the series of a step, and roots, computed with the vector instructions of the processor.

use nalgebra::Vector2;
use pulp::{Scalar, Simd, WithSimd};

use super::super::series::{At, Series, guess, root};
use super::super::state::Return;
use super::{Quantity, Sums, Turn};
use crate::roots::Function;

/// A series, or minus it.
pub(super) struct Signed<'a> {
    pub of: &'a Series,
    pub sign: f64,
}

impl Function for Signed<'_> {
    #[inline(always)]
    fn at(&self, x: f64) -> (f64, f64) {
        let (value, slope) = At::new(Scalar, x).with_slope(self.of);
        (value * self.sign, slope * self.sign)
    }
}

/// What a quantity is above an aim, or below it.
pub(super) struct Above<'a, S> {
    pub simd: S,
    pub turn: &'a Turn,
    pub of: Quantity,
    pub aim: f64,
    pub sign: f64,
}

impl<S: Simd> Function for Above<'_, S> {
    #[inline(always)]
    fn at(&self, t: f64) -> (f64, f64) {
        let Self { simd, turn, of, aim, sign } = *self;
        let (at, by) = (At::new(simd, t), turn.by_scale * turn.r);
        let (value, slope) = match of {
            Quantity::Velocity => at.with_slope(&turn.v_n),
            Quantity::Impulse => over(at.with_slope(&turn.impulse), t, by),
            Quantity::Work => over(at.with_slope(&turn.work), t, by),
        };
        ((value - aim) * sign, slope * sign)
    }
}

/// `by t` times a mean, and its slope.
#[inline(always)]
fn over((mean, slope): (f64, f64), t: f64, by: f64) -> (f64, f64) {
    (mean * t * by, (mean + t * slope) * by)
}

/// A quantity, computed with the vector instructions of the processor.
pub(super) struct Evaluate<'a>(pub &'a Turn, pub Quantity, pub f64);

impl WithSimd for Evaluate<'_> {
    type Output = (f64, f64);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> (f64, f64) {
        Above { simd, turn: self.0, of: self.1, aim: 0.0, sign: 1.0 }.at(self.2)
    }
}

/// [`Turn::rises`], computed with the vector instructions of the processor.
pub(super) struct FindRise<'a>(pub &'a Turn);

impl WithSimd for FindRise<'_> {
    type Output = Option<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<f64> {
        let v_n = Above { simd, turn: self.0, of: Quantity::Velocity, aim: 0.0, sign: 1.0 };
        for (from, to) in self.0.intervals(0.0) {
            let last = v_n.at(to);
            if last.0 >= 0.0 {
                return Some(root(from, to, guess((from, v_n.at(from)), (to, last)), &v_n));
            }
        }
        None
    }
}

/// [`Turn::returns`], computed with the vector instructions of the processor.
pub(super) struct FindReturn<'a> {
    pub turn: &'a Turn,
    pub of: Quantity,
    pub aim: f64,
    pub from: f64,
}

impl WithSimd for FindReturn<'_> {
    type Output = Return<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Return<f64> {
        let Self { turn, of, aim, from } = self;
        let sought = Above { simd, turn, of, aim, sign: 1.0 };
        let fall = Above { simd, turn, of: Quantity::Velocity, aim: 0.0, sign: -1.0 };
        for (from, to) in turn.intervals(from) {
            let falls = fall.at(to).0 > 0.0;
            let last = if falls { root(from, to, to, &fall) } else { to };
            let beyond = sought.at(last);
            if beyond.0 >= 0.0 {
                let first = sought.at(from);
                let near = if of == Quantity::Work {
                    // W_n grows with the square of the time since v_n = 0.
                    from + (last - from) * (-first.0 / (beyond.0 - first.0)).sqrt()
                } else {
                    guess((from, first), (last, beyond))
                };
                return Return::Ends(root(from, last, near, &sought));
            }
            if falls {
                return Return::Falls(last);
            }
        }
        Return::Not
    }
}

/// [`Turn::sums`], computed with the vector instructions of the processor.
pub(super) struct Sum<'a>(pub &'a Turn, pub f64);

impl WithSimd for Sum<'_> {
    type Output = Sums;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Sums {
        let Self(turn, t) = self;
        let at = At::new(simd, t);
        let slip = Vector2::new(at.value(&turn.slip[0]), at.value(&turn.slip[1]));
        let by = t * turn.by_scale * turn.r;
        let path = Vector2::new(at.value(&turn.path[0]), at.value(&turn.path[1])) * by;
        let (p, normal_work) = (at.value(&turn.impulse) * by, at.value(&turn.work) * by);
        let p_t = path * -turn.mu;
        let rise = turn.normal * p + turn.coupling.dot(&p_t);
        let work = p * (turn.start_v_n + 0.5 * rise) + 0.5 * turn.r * p_t.dot(&(turn.heading + slip));
        // In units of r(0): no square underflows.
        let r = slip.norm();
        Sums { p, p_t, normal_work, friction_work: (work - normal_work).min(0.0), heading: slip / r, r: r * turn.r }
    }
}
