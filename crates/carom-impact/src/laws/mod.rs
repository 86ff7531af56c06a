//! The impact laws, one type each, and their names.

mod brach;
mod chatterjee_ruina;
mod energetic;
mod frictionless;
mod newton;
mod poisson;
mod smith;
mod whittaker;

use nalgebra::{RealField, SVector};

pub use brach::Brach;
use brach::{BrachTowardsRest, asked_and_bound};
pub use chatterjee_ruina::ChatterjeeRuina;
pub use energetic::Energetic;
pub use frictionless::Frictionless;
pub(crate) use frictionless::frictionless;
pub use newton::Newton;
pub use poisson::Poisson;
pub use smith::Smith;
pub use whittaker::Whittaker;

use crate::flow::Found;
use crate::problem::plain;
use crate::{ImpactError, ImpactOutcome, ImpactProblem};

/// An impact law: a rule that returns the impulse of an [`ImpactProblem`].
pub trait Law<T: RealField + Copy, const D: usize> {
    /// Name of the law; for the laws of this crate one of [`LAW_NAMES`].
    fn name(&self) -> &'static str;

    /// Resolves the impact.
    ///
    /// A contact that does not approach is not an error: the outcome is [`Mode::Open`](crate::Mode::Open) with zero
    /// impulse and the flag `no-approach`.
    ///
    /// # Errors
    ///
    /// - [`ImpactError::Restitution`], [`ImpactError::Friction`] and others: a coefficient is out of its range.
    /// - [`ImpactError::SingularNormal`]: the contact approaches along a singular normal direction (`H_nn = 0`).
    /// - [`ImpactError::Wedged`]: the contact wedges; only for singular H.
    /// - [`ImpactError::NotFinite`]: the impulse overflows.
    /// - [`ImpactError::Outcome`]: the outcome fails a check, see [`ImpactProblem::resolve`].
    fn resolve(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError>;

    /// All outcomes that satisfy the law, that of [`resolve`](Self::resolve) first. There is one, unless the outcome
    /// has the flag `non-unique`.
    ///
    /// - A contact that slides at `u_n = 0` and whose friction jams: first the zero impulse, then the finite impulse to
    ///   which the outcome tends as `u_n -> 0` from below (impact without collision, Painlevé).
    /// - [`Whittaker`] with several solutions: stick, then slips in the order of decreasing impulse. Where H is
    ///   singular in the plane, the two ends of the range of impulses; where it is singular in space, the solutions
    ///   that were found.
    ///
    /// The default implementation returns the outcome of [`resolve`](Self::resolve) alone.
    ///
    /// # Errors
    ///
    /// As [`resolve`](Self::resolve).
    ///
    /// ```
    /// use carom_impact::{Energetic, Flags, ImpactProblem, Law};
    /// use nalgebra::{matrix, vector};
    ///
    /// // A rod at 60° whose lower end slides on a floor as rough as 1.5.
    /// let h = matrix![3.25, -1.299038105676658; -1.299038105676658, 1.75];
    /// let sliding = ImpactProblem::new(h, vector![-1.0_f64, 0.0])?;
    /// let branches = Energetic { restitution: 0.0, friction: 1.5 }.branches(&sliding)?;
    /// assert_eq!(branches[0].impulse, vector![0.0, 0.0]);
    /// assert!((branches[1].impulse - vector![0.4375, 0.32475953]).norm() < 1e-8);
    /// assert!(branches.iter().all(|b| b.flags.contains(Flags::JAM | Flags::NON_UNIQUE)));
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    fn branches(&self, problem: &ImpactProblem<T, D>) -> Result<Vec<ImpactOutcome<T, D>>, ImpactError> {
        Ok(vec![self.resolve(problem)?])
    }

    /// This law as an [`AnyLaw`], whose scalar type can be changed; derivatives need it. `None`, the default, for a
    /// user-defined law.
    fn known(&self) -> Option<AnyLaw<T>> {
        None
    }
}

impl<T: RealField + Copy, const D: usize> ImpactProblem<T, D> {
    /// The outcome of a law, checked whatever the law: [`Law::resolve`] of the laws of this crate checks its own outcome, that of a
    /// user's law is checked here ([`ImpactOutcome::check`]). What resolves impacts with laws that it does not know calls this.
    ///
    /// ```
    /// # use carom_impact::{ImpactError, ImpactOutcome, ImpactProblem, Law, Newton};
    /// # use nalgebra::{matrix, vector};
    /// /// A law that forgets half of the impulse.
    /// struct Half;
    /// impl Law<f64, 2> for Half {
    ///     fn name(&self) -> &'static str {
    ///         "half"
    ///     }
    ///     fn resolve(&self, problem: &ImpactProblem<f64, 2>) -> Result<ImpactOutcome<f64, 2>, ImpactError> {
    ///         let hit = Newton { restitution: 0.5, friction: 0.2 }.resolve(problem)?;
    ///         Ok(ImpactOutcome { law: self.name(), impulse: hit.impulse * 0.5, ..hit })
    ///     }
    /// }
    ///
    /// let problem = ImpactProblem::new(matrix![2.0, 0.5; 0.5, 1.0], vector![1.0, -2.0])?;
    /// assert!(matches!(problem.resolve(&Half), Err(ImpactError::Outcome { law: "half", .. })));
    /// # Ok::<(), ImpactError>(())
    /// ```
    ///
    /// # Errors
    /// As [`Law::resolve`]; [`ImpactError::Outcome`] or [`ImpactError::NotFinite`] for an outcome that fails a check.
    pub fn resolve(&self, law: &dyn Law<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        let hit = law.resolve(self)?;
        if law.known().is_none() {
            hit.check(self)?;
        }
        Ok(hit)
    }
}

/// Names that [`law_by_name`] accepts.
pub const LAW_NAMES: [&str; 8] =
    ["frictionless", "whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"];

/// Coefficients of a contact. Each law uses those that it has.
///
/// ```
/// use carom_impact::Coefficients;
/// let rubber = Coefficients { restitution: 0.8, friction: 0.9, ..Coefficients::default() };
/// assert_eq!(rubber.tangential_restitution, 0.0);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Coefficients<T = f64> {
    /// Coefficient of restitution, 0 to 1, as the law defines it.
    pub restitution: T,
    /// Coefficient of tangential restitution, -1 to 1; only `chatterjee-ruina` uses it.
    pub tangential_restitution: T,
    /// Coulomb coefficient of friction, 0 or more; `brach` uses it as the size of an impulse ratio towards rest.
    pub friction: T,
}

/// The law called `name`, or `None` if there is none. The coefficients are checked when the law resolves its first
/// problem; coefficients that the law does not have are ignored.
///
/// ```
/// use carom_impact::{Coefficients, LAW_NAMES, law_by_name};
/// let coefficients = Coefficients { restitution: 0.5, friction: 0.2, ..Coefficients::default() };
/// for name in LAW_NAMES {
///     assert_eq!(law_by_name::<3>(name, coefficients).unwrap().name(), name);
/// }
/// assert!(law_by_name::<2>("hertz", coefficients).is_none());
/// ```
pub fn law_by_name<const D: usize>(
    name: &str,
    coefficients: Coefficients,
) -> Option<Box<dyn Law<f64, D> + Send + Sync>> {
    Some(Box::new(AnyLaw::named(name, coefficients)?))
}

/// Any law of this crate with its coefficients, as one type that can be converted to another scalar type.
///
/// ```
/// use carom_impact::{AnyLaw, Coefficients, Energetic, Law};
/// let law: &dyn Law<f64, 2> = &Energetic { restitution: 0.5, friction: 0.2 };
/// let law = law.known().unwrap();
/// assert_eq!(law.coefficients().friction, 0.2);
/// let harder = law.with(Coefficients { restitution: 0.9, ..law.coefficients() });
/// assert_eq!(harder.coefficients().restitution, 0.9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnyLaw<T = f64>(Kind<T>);

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind<T> {
    Frictionless(Frictionless<T>),
    Whittaker(Whittaker<T>),
    Newton(Newton<T>),
    Poisson(Poisson<T>),
    Energetic(Energetic<T>),
    ChatterjeeRuina(ChatterjeeRuina<T>),
    Brach(Brach<T>),
    BrachTowardsRest(BrachTowardsRest<T>),
    Smith(Smith<T>),
}

impl<T: RealField + Copy> AnyLaw<T> {
    /// The law called `name`, or `None` if there is none; see [`law_by_name`].
    pub fn named(name: &str, coefficients: Coefficients<T>) -> Option<Self> {
        let Coefficients { restitution, tangential_restitution, friction } = coefficients;
        Some(Self(match name {
            "frictionless" => Kind::Frictionless(Frictionless { restitution }),
            "whittaker" => Kind::Whittaker(Whittaker { restitution, friction }),
            "newton" => Kind::Newton(Newton { restitution, friction }),
            "poisson" => Kind::Poisson(Poisson { restitution, friction }),
            "energetic" => Kind::Energetic(Energetic { restitution, friction }),
            "chatterjee-ruina" => {
                Kind::ChatterjeeRuina(ChatterjeeRuina { restitution, tangential_restitution, friction })
            }
            "brach" => Kind::BrachTowardsRest(BrachTowardsRest { restitution, friction }),
            "smith" => Kind::Smith(Smith { restitution, friction }),
            _ => return None,
        }))
    }

    pub(crate) fn frictionless(restitution: T) -> Self {
        Self(Kind::Frictionless(Frictionless { restitution }))
    }

    /// The coefficients of the law; zero for those that it does not have. For [`Brach`] `friction` is the absolute
    /// value of the impulse ratio.
    pub fn coefficients(&self) -> Coefficients<T> {
        let zero = T::zero();
        let of = |restitution, friction| Coefficients { restitution, tangential_restitution: zero, friction };
        match self.0 {
            Kind::Frictionless(Frictionless { restitution }) => of(restitution, zero),
            Kind::Whittaker(Whittaker { restitution, friction })
            | Kind::Newton(Newton { restitution, friction })
            | Kind::Poisson(Poisson { restitution, friction })
            | Kind::Energetic(Energetic { restitution, friction })
            | Kind::Smith(Smith { restitution, friction })
            | Kind::BrachTowardsRest(BrachTowardsRest { restitution, friction }) => of(restitution, friction),
            Kind::ChatterjeeRuina(ChatterjeeRuina { restitution, tangential_restitution, friction }) => {
                Coefficients { restitution, tangential_restitution, friction }
            }
            Kind::Brach(Brach { restitution, impulse_ratio }) => of(restitution, impulse_ratio.abs()),
        }
    }

    /// The same law with other coefficients, of any scalar type. [`Brach`] keeps the sign of its impulse ratio.
    pub fn with<U: RealField + Copy>(&self, coefficients: Coefficients<U>) -> AnyLaw<U> {
        let Coefficients { restitution, tangential_restitution, friction } = coefficients;
        AnyLaw(match self.0 {
            Kind::Frictionless(_) => Kind::Frictionless(Frictionless { restitution }),
            Kind::Whittaker(_) => Kind::Whittaker(Whittaker { restitution, friction }),
            Kind::Newton(_) => Kind::Newton(Newton { restitution, friction }),
            Kind::Poisson(_) => Kind::Poisson(Poisson { restitution, friction }),
            Kind::Energetic(_) => Kind::Energetic(Energetic { restitution, friction }),
            Kind::ChatterjeeRuina(_) => {
                Kind::ChatterjeeRuina(ChatterjeeRuina { restitution, tangential_restitution, friction })
            }
            Kind::Brach(Brach { impulse_ratio, .. }) => {
                let impulse_ratio = if impulse_ratio < T::zero() { -friction } else { friction };
                Kind::Brach(Brach { restitution, impulse_ratio })
            }
            Kind::BrachTowardsRest(_) => Kind::BrachTowardsRest(BrachTowardsRest { restitution, friction }),
            Kind::Smith(_) => Kind::Smith(Smith { restitution, friction }),
        })
    }

    /// Whether the law follows the slip in time (Newton, Poisson, Stronge).
    pub(crate) fn follows_slip(&self) -> bool {
        matches!(self.0, Kind::Newton(_) | Kind::Poisson(_) | Kind::Energetic(_))
    }

    /// Whether the law has no friction.
    pub(crate) fn is_frictionless(&self) -> bool {
        matches!(self.0, Kind::Frictionless(_))
    }

    pub(crate) fn is_newton(&self) -> bool {
        matches!(self.0, Kind::Newton(_))
    }

    /// Whether the law is Newton's or Poisson's, whose outcomes contain no square root.
    pub(crate) fn is_rational(&self) -> bool {
        matches!(self.0, Kind::Newton(_) | Kind::Poisson(_))
    }

    /// Whether the law limits one total impulse to the cone: Whittaker's (`Some(None)`), or Chatterjee & Ruina's with
    /// its tangential restitution.
    pub(crate) fn cone(&self) -> Option<Option<T>> {
        match self.0 {
            Kind::Whittaker(_) => Some(None),
            Kind::ChatterjeeRuina(law) => Some(Some(law.tangential_restitution)),
            _ => None,
        }
    }

    /// The path of an impact whose slip turns in space, for a law that follows it in time; `None` for others.
    pub(crate) fn turning<const D: usize>(
        &self,
        problem: &ImpactProblem<T, D>,
    ) -> Result<Option<Found<T, D>>, ImpactError> {
        match &self.0 {
            Kind::Newton(law) => law.path().turning(problem),
            Kind::Poisson(law) => law.path().turning(problem),
            Kind::Energetic(law) => law.path().turning(problem),
            _ => Ok(None),
        }
    }

    /// The impulse alone, without the energies, works and flags of an outcome.
    pub(crate) fn impulse<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<SVector<T, D>, ImpactError> {
        match &self.0 {
            Kind::Newton(law) => law.path().impulse(problem),
            Kind::Poisson(law) => law.path().impulse(problem),
            Kind::Energetic(law) => law.path().impulse(problem),
            _ => Ok(self.resolve(problem)?.impulse),
        }
    }

    fn dynamic<const D: usize>(&self) -> &dyn Law<T, D> {
        match &self.0 {
            Kind::Frictionless(law) => law,
            Kind::Whittaker(law) => law,
            Kind::Newton(law) => law,
            Kind::Poisson(law) => law,
            Kind::Energetic(law) => law,
            Kind::ChatterjeeRuina(law) => law,
            Kind::Brach(law) => law,
            Kind::BrachTowardsRest(law) => law,
            Kind::Smith(law) => law,
        }
    }
}

macro_rules! any_law_from {
    ($($law:ident),*) => {
        $(impl<T> From<$law<T>> for AnyLaw<T> {
            fn from(law: $law<T>) -> Self {
                Self(Kind::$law(law))
            }
        })*
    };
}

any_law_from!(Frictionless, Whittaker, Newton, Poisson, Energetic, ChatterjeeRuina, Brach, Smith);

impl AnyLaw {
    /// For Brach's law, the prescribed impulse ratio and the bound that clips it.
    pub(crate) fn brach_ratios<const D: usize>(&self, problem: &ImpactProblem<f64, D>) -> Option<(f64, f64)> {
        match self.0 {
            Kind::Brach(law) => Some(asked_and_bound(&law, problem)),
            Kind::BrachTowardsRest(law) => Some(asked_and_bound(&law.towards_rest(problem), problem)),
            _ => None,
        }
    }
}

impl<T: RealField + Copy, const D: usize> Law<T, D> for AnyLaw<T> {
    fn name(&self) -> &'static str {
        self.dynamic::<D>().name()
    }

    fn resolve(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        self.dynamic::<D>().resolve(problem)
    }

    fn branches(&self, problem: &ImpactProblem<T, D>) -> Result<Vec<ImpactOutcome<T, D>>, ImpactError> {
        self.dynamic::<D>().branches(problem)
    }

    fn known(&self) -> Option<AnyLaw<T>> {
        Some(*self)
    }
}

pub(crate) fn check_restitution<T: RealField + Copy>(e: T) -> Result<(), ImpactError> {
    // Written so that NaN fails.
    if e >= T::zero() && e <= T::one() {
        return Ok(());
    }
    Err(ImpactError::Restitution { value: plain(e) })
}

pub(crate) fn check_tangential_restitution<T: RealField + Copy>(e_t: T) -> Result<(), ImpactError> {
    if e_t >= -T::one() && e_t <= T::one() {
        return Ok(());
    }
    Err(ImpactError::TangentialRestitution { value: plain(e_t) })
}

pub(crate) fn check_impulse_ratio<T: RealField + Copy>(ratio: T) -> Result<(), ImpactError> {
    if ratio.is_finite() {
        return Ok(());
    }
    Err(ImpactError::ImpulseRatio { value: plain(ratio) })
}

pub(crate) fn check_friction<T: RealField + Copy>(mu: T) -> Result<(), ImpactError> {
    // The product is NaN if the coefficient is infinite.
    if mu >= T::zero() && mu * T::zero() == T::zero() {
        return Ok(());
    }
    Err(ImpactError::Friction { value: plain(mu) })
}
