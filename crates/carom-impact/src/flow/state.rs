//! The state of the contact on the path of the impulse, and the end of restitution.

use nalgebra::{RealField, Vector2};

use crate::contact::{Contact, length};

/// The state of the contact, with impulse and works since the last change of phase; of a piece of the path those since its start.
#[derive(Debug, Clone, Copy)]
pub(super) struct State<T> {
    pub p: T,
    pub p_t: Vector2<T>,
    /// Unit vector of slip; any where r = 0.
    pub heading: Vector2<T>,
    /// Speed of slip.
    pub r: T,
    pub v_n: T,
    pub normal_work: T,
    pub friction_work: T,
}

impl<T: RealField + Copy> State<T> {
    pub fn start(contact: &Contact<T>) -> Self {
        let zero = T::zero();
        let r = length(&contact.slip);
        let heading = if r > zero { contact.slip / r } else { contact.slip };
        Self { p: zero, p_t: Vector2::zeros(), heading, r, v_n: contact.v_n, normal_work: zero, friction_work: zero }
    }

    /// This state with impulse and works zero: added to the work of compression, a small work of restitution would be
    /// lost.
    pub fn turn(&self) -> Self {
        let zero = T::zero();
        Self { p: zero, p_t: Vector2::zeros(), normal_work: zero, friction_work: zero, ..*self }
    }

    /// This state with the impulse and works of `before` added.
    pub fn added_to(mut self, before: &Self) -> Self {
        self.p += before.p;
        self.p_t += before.p_t;
        self.normal_work += before.normal_work;
        self.friction_work += before.friction_work;
        self
    }
}

/// The end of restitution within a piece.
pub(super) enum Return<T> {
    /// Restitution ends here.
    Ends(T),
    /// The contact is back at `v_n = 0` here.
    Falls(T),
    Not,
}
