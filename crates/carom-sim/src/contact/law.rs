//! The impact law of a contact as a value.

use super::by_speed::{BySpeed, RestitutionBySpeed};
use carom_impact::{AnyLaw, Coefficients, Law};
use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

/// The impact law of a contact as a value: a law of `carom-impact` or a user's own [`Law`]. It dereferences to the law.
///
/// | value | used for |
/// | --- | --- |
/// | the law itself | impacts of this contact alone |
/// | [`restitution`](Self::restitution) | impacts of several contacts ([`SeveralLaw`](crate::SeveralLaw)), time steps, compliant contacts, joint limits |
/// | [`friction`](Self::friction) | lasting contacts, impacts of several contacts, time steps, compliant contacts |
///
/// The two numbers of a law of `carom-impact` are its own coefficients. A user's law states them when the value is made.
///
/// ```
/// use carom_impact::{ImpactError, ImpactOutcome, ImpactProblem, Law, Newton};
/// use carom_sim::{ContactLaw, ContactRule};
///
/// /// Newton's law with a restitution that decreases with the approach speed.
/// struct Slowing;
/// impl Law<f64, 3> for Slowing {
///     fn name(&self) -> &'static str {
///         "slowing"
///     }
///     fn resolve(&self, problem: &ImpactProblem<f64, 3>) -> Result<ImpactOutcome<f64, 3>, ImpactError> {
///         let restitution = 1.0 / (1.0 + problem.approach_speed()); // speed in m/s
///         let hit = Newton { restitution, friction: 0.2 }.resolve(problem)?;
///         Ok(ImpactOutcome { law: self.name(), ..hit })
///     }
/// }
///
/// let own = ContactRule::new(ContactLaw::new(Slowing, 0.5, 0.2));
/// assert_eq!(own.law.name(), "slowing");
/// let named = ContactRule::new(Newton { restitution: 0.5, friction: 0.2 });
/// assert_eq!((named.law.restitution(), named.law.friction()), (0.5, 0.2));
/// ```
#[derive(Clone)]
pub struct ContactLaw {
    law: Arc<dyn Law<f64, 3> + Send + Sync>,
    /// `tangential_restitution` is read only where a scene replaces single values of a rule.
    pub(crate) coefficients: Coefficients,
    /// Replaces the coefficient of restitution.
    pub(crate) by_speed: Option<Arc<RestitutionBySpeed>>,
}

impl ContactLaw {
    /// A user's own law, with the coefficient of restitution (0 to 1) and Coulomb's coefficient of friction (0 or more)
    /// that hold where the law is not used: see the table of [`ContactLaw`].
    ///
    /// A law of `carom-impact` is converted with `From`. If it is given here, `restitution` must be its own, and `friction`
    /// its own unless the law has none.
    pub fn new(law: impl Law<f64, 3> + Send + Sync + 'static, restitution: f64, friction: f64) -> Self {
        let coefficients = Coefficients { restitution, friction, ..Coefficients::default() };
        Self { law: Arc::new(law), coefficients, by_speed: None }
    }

    /// A law of `carom-impact` whose coefficient of restitution depends on the approach speed. Joint limits can have it, too;
    /// impacts of several contacts only under [`SeveralLaw::Moreau`](crate::SeveralLaw::Moreau), where each contact has the
    /// coefficient of its own approach speed; compliant contacts not.
    pub fn by_speed(law: impl Into<AnyLaw>, restitution: RestitutionBySpeed) -> Self {
        let law = law.into();
        Self::known_law(law, law.coefficients(), Some(Arc::new(restitution)))
    }

    fn known_law(law: AnyLaw, coefficients: Coefficients, by_speed: Option<Arc<RestitutionBySpeed>>) -> Self {
        let restitution = by_speed.as_ref().map_or(coefficients.restitution, |by| by.largest());
        let own: Arc<dyn Law<f64, 3> + Send + Sync> = match &by_speed {
            Some(by) => Arc::new(BySpeed { law, restitution: by.clone() }),
            None => Arc::new(law),
        };
        Self { law: own, coefficients: Coefficients { restitution, ..coefficients }, by_speed }
    }

    /// A law of `carom-impact` with other coefficients, of which the restitution is not used where it depends on the approach
    /// speed. `None`: a user's own law.
    pub(crate) fn with(&self, coefficients: Coefficients) -> Option<Self> {
        if self.is_users() {
            return None;
        }
        Self::of(self.name(), coefficients, self.by_speed.clone())
    }

    /// The law called `name` ([`carom_impact::LAW_NAMES`]), or `None` if there is none. Under the name `frictionless`,
    /// `friction` does not act in impacts of this contact alone.
    pub fn named(name: &str, coefficients: Coefficients) -> Option<Self> {
        Self::of(name, coefficients, None)
    }

    pub(crate) fn of(
        name: &str,
        coefficients: Coefficients,
        by_speed: Option<Arc<RestitutionBySpeed>>,
    ) -> Option<Self> {
        Some(Self::known_law(AnyLaw::named(name, coefficients)?, coefficients, by_speed))
    }

    /// Coefficient of restitution of everything but impacts of this contact alone; the largest one, where it depends on the
    /// approach speed.
    pub fn restitution(&self) -> f64 {
        self.coefficients.restitution
    }

    /// The same at an approach speed, m/s.
    pub(crate) fn restitution_at(&self, speed: f64) -> f64 {
        self.by_speed.as_ref().map_or(self.coefficients.restitution, |by| by.at(speed))
    }

    /// Coulomb's coefficient of friction of everything but impacts of this contact alone.
    pub fn friction(&self) -> f64 {
        self.coefficients.friction
    }

    /// Whether this is a user's own law.
    pub(crate) fn is_users(&self) -> bool {
        self.known().is_none() && self.by_speed.is_none()
    }
}

impl Deref for ContactLaw {
    type Target = dyn Law<f64, 3> + Send + Sync;

    fn deref(&self) -> &Self::Target {
        &*self.law
    }
}

impl<L: Into<AnyLaw>> From<L> for ContactLaw {
    fn from(law: L) -> Self {
        let law = law.into();
        Self::known_law(law, law.coefficients(), None)
    }
}

/// Laws of `carom-impact` are equal by value; a user's law equals its clones only.
impl PartialEq for ContactLaw {
    fn eq(&self, other: &Self) -> bool {
        let same = match (self.known(), other.known()) {
            (None, None) if self.by_speed.is_some() => {
                self.name() == other.name() && self.coefficients == other.coefficients
            }
            (None, None) => Arc::ptr_eq(&self.law, &other.law),
            (one, another) => one == another,
        };
        let same = same && self.by_speed == other.by_speed;
        same && self.restitution() == other.restitution() && self.friction() == other.friction()
    }
}

impl fmt::Debug for ContactLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let friction = self.friction();
        let mut shown = f.debug_struct("ContactLaw");
        match self.known() {
            Some(law) => shown.field("law", &law),
            None => shown.field("law", &self.name()),
        };
        match &self.by_speed {
            Some(by) => shown.field("restitution", by),
            None => shown.field("restitution", &self.restitution()),
        };
        shown.field("friction", &friction).finish()
    }
}
