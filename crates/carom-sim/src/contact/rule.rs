//! The rule of a contact: its impact law as a value, and what holds while the contact lasts.

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
        let refuse = |what, value, rule| Err(SimError::Contact { touch: touch.into(), what, value, rule });
        let Coefficients { restitution, tangential_restitution, friction } = self.law.coefficients;
        if !(0.0..=1.0).contains(&restitution) {
            return refuse("restitution", restitution, "a coefficient of restitution lies between 0 and 1");
        }
        if !(-1.0..=1.0).contains(&tangential_restitution) {
            let rule = "a coefficient of tangential restitution lies between -1 and 1";
            return refuse("tangential_restitution", tangential_restitution, rule);
        }
        if !(friction >= 0.0 && friction.is_finite()) {
            return refuse("friction", friction, "a coefficient of friction is finite and not negative");
        }
        let stiffness = self.relative_stiffness;
        if !(stiffness > 0.0 && stiffness.is_finite()) {
            return refuse(
                "relative_stiffness",
                stiffness,
                "it is a positive and finite ratio: 1 if all contacts are alike",
            );
        }
        if let Some(own) = self.law.known().map(|law| law.coefficients()) {
            if own.restitution != restitution {
                return refuse("restitution", restitution, "the impact law has another one: give both the same value");
            }
            if own.friction != 0.0 && own.friction != friction {
                return refuse("friction", friction, "the impact law has another one: give both the same value");
            }
        }
        self.compliance.map_or(Ok(()), |compliance| compliance.check(&self.law, touch))
    }
}
