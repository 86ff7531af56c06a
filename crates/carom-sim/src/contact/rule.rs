//! The rule of a contact: its impact law, and what holds while the contact lasts.

use super::compliance::Compliance;
use super::law::ContactLaw;
use crate::error::SimError;
use carom_impact::{Coefficients, Frictionless};

/// What happens at a contact.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactRule {
    /// The impact law with its coefficients.
    pub law: ContactLaw,
    /// A latch: the first contact stops the contact point, and holds it from then on.
    pub latch: bool,
    /// The parameters of a compliant contact, which has a force during a finite time. `None`: a rigid contact.
    pub compliance: Option<Compliance>,
    /// Stiffness relative to the other contacts, > 0, which decides how they share an impact under
    /// [`SeveralLaw::Energetic`](crate::SeveralLaw::Energetic); no other law uses it.
    pub relative_stiffness: f64,
}

impl Default for ContactRule {
    /// A rigid frictionless contact with zero restitution.
    fn default() -> Self {
        Self::new(Frictionless { restitution: 0.0 })
    }
}

impl ContactRule {
    /// A rigid contact with an impact law.
    pub fn new(law: impl Into<ContactLaw>) -> Self {
        Self { law: law.into(), latch: false, compliance: None, relative_stiffness: 1.0 }
    }

    /// # Errors
    /// [`SimError::Contact`].
    pub(crate) fn check(&self, touch: &str) -> Result<(), SimError> {
        let check = |fine, what, value, rule| {
            if fine { Ok(()) } else { Err(SimError::Contact { touch: touch.into(), what, value, rule }) }
        };
        let Coefficients { restitution: e, tangential_restitution: tangential, friction } = self.law.coefficients;
        check((0.0..=1.0).contains(&e), "restitution", e, "a coefficient of restitution lies between 0 and 1")?;
        let rule = "a coefficient of tangential restitution lies between -1 and 1";
        check((-1.0..=1.0).contains(&tangential), "tangential_restitution", tangential, rule)?;
        let rule = "a coefficient of friction is finite and not negative";
        check(friction >= 0.0 && friction.is_finite(), "friction", friction, rule)?;
        let (ratio, rule) = (self.relative_stiffness, "it is a positive and finite ratio: 1 if all contacts are alike");
        check(ratio > 0.0 && ratio.is_finite(), "relative_stiffness", ratio, rule)?;
        if let Some(own) = self.law.known().map(|law| law.coefficients()) {
            let rule = "the impact law has another one: give both the same value";
            check(own.restitution == e, "restitution", e, rule)?;
            check(own.friction == 0.0 || own.friction == friction, "friction", friction, rule)?;
        }
        if let Some(by) = &self.law.by_speed {
            by.check(touch)?;
            let rule = "compliant contacts have one coefficient for all approach speeds: give a number, or compliance = \"rigid\"";
            check(self.compliance.is_none(), "restitution by speed, at most", e, rule)?;
        }
        let rule = "a latch holds a rigid contact point, and this contact is compliant: leave out latch, or set compliance = \"rigid\"";
        check(!self.latch || self.compliance.is_none(), "latch", 1.0, rule)?;
        self.compliance.map_or(Ok(()), |compliance| compliance.check(&self.law, touch))
    }
}
