//! A piece of the flow on which slip turns, for any scalar: [`Turn`] is in plain numbers; dual numbers get derivatives of
//! first order.

use std::cell::Cell;

use nalgebra::{RealField, Vector2, convert};

use super::state::{Return, State};
use super::turn::{CHANGES, Quantity, Turn};
use crate::contact::Contact;
use crate::problem::plain;
use crate::routh::{End, Ending};
use crate::scalar::{has_derivatives, rest};

/// One step.
pub(super) struct Curve<'a, T> {
    contact: &'a Contact<T>,
    mu: T,
    state: State<T>,
    turn: &'a Turn,
    /// τ from which impulses and works are counted: 0, or the end of compression.
    from: f64,
    /// The step up to there.
    before: Option<State<T>>,
    /// The step to an event, without what its derivative moves, and its τ.
    event: Cell<Option<(f64, State<T>)>>,
}

/// A step whose series serves restitution, too.
pub(super) struct Resume<T> {
    /// The state at its start.
    state: State<T>,
    /// τ at the end of compression.
    from: f64,
    /// The step up to there.
    before: State<T>,
}

impl<'a, T: RealField + Copy> Curve<'a, T> {
    #[inline]
    pub fn new(contact: &'a Contact<T>, mu: T, state: &State<T>, turn: &'a mut Turn) -> Self {
        turn.begin(state.heading.map(plain), plain(state.r), plain(state.v_n));
        Self { contact, mu, state: *state, turn, from: 0.0, before: None, event: Cell::new(None) }
    }

    /// A step after its end of compression.
    pub fn resumed(contact: &'a Contact<T>, mu: T, rest: &Resume<T>, turn: &'a Turn) -> Self {
        let Resume { state, from, before } = *rest;
        Self { contact, mu, state, turn, from, before: Some(before), event: Cell::new(None) }
    }

    /// The rest of this step after its end of compression at τ = t, up to which it has advanced by `before`.
    pub fn resume(&self, t: T, before: State<T>) -> Resume<T> {
        Resume { state: self.state, from: plain(t), before }
    }

    /// The end of the step. Where slip has grown it is moved so that p has no derivative: a change of ln r(0) lengthens all of
    /// the path at the same τ, but hardly changes it at the same p, and their difference would be rounding over r(0).
    pub fn end(&self) -> T {
        let end = self.turn.end();
        if has_derivatives::<T>() && self.turn.grows(end) {
            self.moved(end, Quantity::Impulse, |step| step.p)
        } else {
            convert(end)
        }
    }

    /// The τ at which `v_n = 0` is reached from below, if it lies within the step.
    pub fn rises(&self) -> Option<T> {
        Some(self.moved(self.turn.rises()?, Quantity::Velocity, |step| step.v_n))
    }

    /// The τ at which the normal impulse has grown by `dp`, if it lies within the step.
    pub fn reaches(&self, dp: T) -> Option<T> {
        self.turn.reaches(plain(dp)).map(convert)
    }

    pub fn returns(&self, state: &State<T>, end: &End<T>) -> Return<T> {
        let (quantity, aim) = match end.ending {
            Ending::Impulse => (Quantity::Impulse, end.e * end.pc - state.p),
            Ending::Velocity => (Quantity::Velocity, -end.e * end.v_n_minus),
            Ending::Work => (Quantity::Work, -end.e * end.e * end.work - state.normal_work),
        };
        let of = |step: &State<T>| match quantity {
            Quantity::Impulse => step.p,
            Quantity::Velocity => step.v_n,
            Quantity::Work => step.normal_work,
        };
        // From the end of compression v_n is counted from zero.
        let aim = match &self.before {
            Some(before) if quantity != Quantity::Velocity => aim + of(before),
            _ => aim,
        };
        match self.turn.returns(quantity, plain(aim), self.from) {
            Return::Ends(_) if quantity == Quantity::Work && end.e == T::zero() => {
                // W_n is quadratic at v_n = 0; this is its root to first order in e, at e = 0.
                let bend = self.turn.bend();
                Return::Ends(if bend > 0.0 { end.e * (-end.work * convert(1.0 / bend)).sqrt() } else { T::zero() })
            }
            Return::Ends(t) => Return::Ends(self.moved(t, quantity, |step| of(step) - aim)),
            Return::Falls(t) => Return::Falls(self.moved(t, Quantity::Velocity, |step| step.v_n)),
            Return::Not => Return::Not,
        }
    }

    /// The root t of a function of the step with the slope of this quantity, with its derivative.
    fn moved(&self, t: f64, slope: Quantity, of: impl Fn(&State<T>) -> T) -> T {
        let t_0 = convert(t);
        if !has_derivatives::<T>() {
            return t_0;
        }
        let slope = self.turn.quantity(slope, t).1;
        if slope == 0.0 {
            return t_0;
        }
        let step = self.to(t);
        self.event.set(Some((t, step)));
        t_0 - rest(of(&step)) / convert(slope)
    }

    fn whole(&self, t: T) -> State<T> {
        let x = plain(t);
        if !has_derivatives::<T>() {
            return self.to(x);
        }
        let step = self.event.get().filter(|(event, _)| *event == x).map_or_else(|| self.to(x), |(_, step)| step);
        self.later(step, rest(t) * convert(self.turn.by_scale()))
    }

    /// The step to τ = t, without what lies before the end of compression.
    pub fn at(&self, t: T) -> State<T> {
        let step = self.whole(t);
        self.before.as_ref().map_or(step, |before| State {
            p: step.p - before.p,
            p_t: step.p_t - before.p_t,
            normal_work: step.normal_work - before.normal_work,
            friction_work: step.friction_work - before.friction_work,
            ..step
        })
    }

    /// The step to τ.
    fn to(&self, t: f64) -> State<T> {
        let Self { contact, mu, state, turn, .. } = self;
        let sums = turn.sums(t);
        let c = convert::<f64, T>;
        let (mut p, mut p_t, mut heading, mut r) = (c(sums.p), sums.p_t.map(c), sums.heading.map(c), c(sums.r));
        let (mut normal_work, mut friction_work) = (c(sums.normal_work), c(sums.friction_work));
        if has_derivatives::<T>() {
            let response = turn.response(t);
            let (u, u_0) = (sums.heading, state.heading.map(plain));
            let (h, mu_0) = (contact.coupling.map(plain), plain(*mu));
            let hold = contact.tangents * *mu;
            let changes = [
                state.heading.y * c(u_0.x) - state.heading.x * c(u_0.y),
                state.r / c(plain(state.r)),
                contact.coupling.x,
                contact.coupling.y,
                hold[(0, 0)],
                hold[(0, 1)],
                hold[(1, 1)],
            ]
            .map(rest);
            let sum = |of: &[f64; CHANGES]| {
                changes.iter().zip(of).fold(T::zero(), |sum, (&change, &of)| sum + change * c(of))
            };
            let rougher = rest(*mu);
            p += sum(&response.p);
            p_t += Vector2::new(sum(&response.p_t[0]), sum(&response.p_t[1])) + sums.p_t.map(|x| rougher * c(x / mu_0));
            let turned = sum(&response.phi);
            heading += Vector2::new(turned * c(-u.y), turned * c(u.x));
            r += sum(&response.log_r) * c(sums.r);
            // δv_n from its start and from C, h and μ at the same slip.
            let drawn = changes[2] * c(response.lever_t.x) + changes[3] * c(response.lever_t.y);
            normal_work +=
                sum(&response.normal_work) + rest(state.v_n) * c(sums.p) + rest(contact.normal) * c(response.lever)
                    - drawn * c(mu_0)
                    - rougher * c(h.dot(&response.lever_t));
            friction_work += sum(&response.friction_work) + rougher * c(sums.friction_work / mu_0);
        }
        let v_n = state.v_n + contact.normal * p + contact.coupling.dot(&p_t);
        State { p, p_t, heading, r, v_n, normal_work, friction_work }
    }

    /// The step with its end moved by `dτ/κ` of value zero.
    fn later(&self, step: State<T>, by: T) -> State<T> {
        let c = convert::<f64, T>;
        let (u, r, v_n) = (step.heading.map(plain), plain(step.r), plain(step.v_n));
        let mu = plain(self.mu);
        let (h, hold) = (self.contact.coupling.map(plain), self.contact.tangents.map(plain) * u * mu);
        let (rate, p) = (h - hold, by * c(r));
        let turned = by * c(u.perp(&rate));
        State {
            p: step.p + p,
            p_t: step.p_t + u.map(|x| p * c(-mu * x)),
            heading: step.heading + Vector2::new(turned * c(-u.y), turned * c(u.x)),
            r: step.r + p * c(u.dot(&rate)),
            v_n: step.v_n + p * c(plain(self.contact.normal) - mu * h.dot(&u)),
            normal_work: step.normal_work + p * c(v_n),
            friction_work: step.friction_work - p * c(mu * r),
        }
    }

    /// Whether v_n decreases anywhere up to t.
    pub fn jams(&self, t: T) -> bool {
        self.turn.jams(plain(t))
    }
}
