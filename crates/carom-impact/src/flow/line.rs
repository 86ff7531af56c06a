//! A piece of the flow with constant rates: slip along an invariant direction, or stick.

use nalgebra::{RealField, Vector2, convert};

use super::state::{Return, State};
use crate::contact::Contact;
use crate::routh::{End, Ending};

/// Rates in the normal impulse p.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line<T> {
    /// Unit vector of slip; zero where the contact sticks.
    pub heading: Vector2<T>,
    /// `dr/dp` (1/kg).
    pub slip_rate: T,
    /// `dv_n/dp` (1/kg).
    pub normal_rate: T,
    /// `dp_t/dp`.
    pub friction_rate: Vector2<T>,
    /// The contact sticks, or slips at constant speed, with no inverse mass along its normal: no impulse changes v_n.
    pub locked: bool,
}

impl<T: RealField + Copy> Line<T> {
    /// Slip in direction `heading`; r changes at `slip_rate`, which has the rounding error `doubt`.
    pub fn slip(contact: &Contact<T>, mu: T, heading: Vector2<T>, slip_rate: T, doubt: T) -> Self {
        let friction_rate = heading * -mu;
        let normal_rate = contact.normal + contact.coupling.dot(&friction_rate);
        let locked = contact.is_locked(normal_rate) && slip_rate >= -doubt;
        Self { heading, slip_rate, normal_rate, friction_rate, locked }
    }

    /// Stick, with the friction `dp_t/dp` that this needs.
    pub fn stick(contact: &Contact<T>, friction_rate: Vector2<T>) -> Self {
        let normal_rate = contact.normal + contact.coupling.dot(&friction_rate);
        let locked = contact.is_locked(normal_rate);
        Self { heading: Vector2::zeros(), slip_rate: T::zero(), normal_rate, friction_rate, locked }
    }

    /// Impulse until slip stops, if it does.
    pub fn end(&self, state: &State<T>) -> Option<T> {
        (self.slip_rate < T::zero()).then(|| -state.r / self.slip_rate)
    }

    /// Impulse until `v_n = 0`, if the piece lasts until then.
    pub fn rises(&self, state: &State<T>) -> Option<T> {
        if self.locked || self.normal_rate <= T::zero() {
            return None;
        }
        self.if_reached(-state.v_n / self.normal_rate, state)
    }

    pub fn returns(&self, state: &State<T>, end: &End<T>) -> Return<T> {
        let (zero, two) = (T::zero(), convert::<f64, T>(2.0));
        let left = || end.left(state.p, state.v_n, state.normal_work, self.normal_rate, self.locked);
        if self.locked || self.normal_rate > zero {
            return self.if_reached(left(), state).map_or(Return::Not, Return::Ends);
        }
        if end.e == zero {
            return Return::Ends(zero);
        }
        // Friction jams: v_n decreases, and may reach zero before restitution is over.
        let done = match end.ending {
            Ending::Velocity => None,
            Ending::Impulse => Some(left()),
            Ending::Work => {
                let work = -end.e * end.e * end.work - state.normal_work;
                let square = state.v_n * state.v_n + two * self.normal_rate * work;
                (square > zero).then(|| two * work / (state.v_n + square.sqrt()))
            }
        };
        let falls = (self.normal_rate < zero).then(|| -state.v_n / self.normal_rate);
        match (done, falls) {
            (Some(x), falls) if falls.is_none_or(|f| x <= f) => {
                self.if_reached(x, state).map_or(Return::Not, Return::Ends)
            }
            (_, Some(f)) => self.if_reached(f, state).map_or(Return::Not, Return::Falls),
            _ => Return::Not,
        }
    }

    fn if_reached(&self, x: T, state: &State<T>) -> Option<T> {
        self.end(state).is_none_or(|end| x <= end).then_some(x)
    }

    /// After an impulse `dp >= 0`. Velocities are linear in p, so the trapezium rule is the exact work.
    pub fn at(&self, state: &State<T>, dp: T) -> State<T> {
        let (dp, half) = (dp.max(T::zero()), convert::<f64, T>(0.5));
        let p_t = self.friction_rate * dp;
        let r = (state.r + self.slip_rate * dp).max(T::zero());
        let v_n = state.v_n + self.normal_rate * dp;
        State {
            p: dp,
            p_t,
            heading: self.heading,
            r,
            v_n,
            normal_work: dp * (state.v_n + v_n) * half,
            friction_work: self.heading.dot(&p_t) * (state.r + r) * half,
        }
    }
}
