//! The impact laws, one type each. Another law is a file with its type and the trait [`Rule`], and here its `mod`, its `pub use` and
//! its row of the table.

mod any;
mod brach;
mod chatterjee_ruina;
mod energetic;
mod frictionless;
mod newton;
mod poisson;
mod smith;
mod whittaker;

use nalgebra::RealField;

pub use any::{AnyLaw, LAW_NAMES, LAWS, LawInfo, law_by_name};
pub use brach::Brach;
pub use chatterjee_ruina::ChatterjeeRuina;
pub use energetic::Energetic;
pub use frictionless::Frictionless;
pub(crate) use frictionless::frictionless;
pub use newton::Newton;
pub use poisson::Poisson;
pub use smith::Smith;
pub use whittaker::Whittaker;

use crate::branches::Answers;
use crate::plane::Routh;
use crate::problem::plain;
use crate::{ImpactError, ImpactOutcome, ImpactProblem};

/// Calls the macro `$each` with one row for each law of this crate, in the order of [`LAW_NAMES`](crate::LAW_NAMES):
///
/// ```text
/// /// what the law is, for the classes of the Python package
/// "name" | "alias" Type { coefficients } "description in the help of the command line, at most 70 columns";
/// ```
///
/// Aliases are read wherever the name is, and never written. The coefficients are fields of the type and of [`Coefficients`](crate::Coefficients), `restitution` first.
#[doc(hidden)]
#[macro_export]
macro_rules! law_table {
    ($each:ident!) => {
        $each! {
            /// The frictionless law; Newton's, Poisson's and Stronge's coefficients are equal without friction.
            "frictionless" Frictionless { restitution }
                "ratio of velocities (Newton), no friction";

            /// Whittaker's law: the ratio of normal velocities is `restitution`, and Coulomb's friction acts against the slip after the
            /// impact. Can gain energy.
            "whittaker" Whittaker { restitution, friction }
                "ratio of velocities, friction against the last slip; can gain energy";

            /// Newton's law along the path of the slip: the ratio of normal velocities is `restitution`. Can gain energy.
            "newton" Newton { restitution, friction }
                "ratio of velocities, friction at each instant; can gain energy";

            /// Poisson's law along the path of the slip: the ratio of normal impulses is `restitution`.
            "poisson" Poisson { restitution, friction }
                "ratio of impulses (Poisson), friction at each instant";

            /// Stronge's law along the path of the slip: the ratio of normal works is the square of `restitution`. Never gains energy.
            "energetic" | "stronge" Energetic { restitution, friction }
                "ratio of works (Stronge), friction at each instant";

            /// Chatterjee and Ruina's law: an algebraic law with a coefficient of tangential restitution. Never gains energy.
            "chatterjee-ruina" ChatterjeeRuina { restitution, friction, tangential_restitution }
                "formula with normal and tangential restitution";

            /// Brach's law: an impulse ratio, limited so that no energy is gained.
            "brach" BrachTowardsRest { restitution, friction }
                "impulse ratio, limited so that no energy is gained";

            /// Smith's law: friction against a mean of the slips before and after.
            "smith" Smith { restitution, friction }
                "friction against a mean of the first and the last slip";
        }
    };
}

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
    /// - [`ImpactError::Coefficient`]: a coefficient is out of its range.
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

/// How a law forms its impulse: what derivatives, boundaries and bands need of it.
pub(crate) enum Family<T> {
    /// The normal impulse alone.
    Frictionless,
    /// Friction follows the slip in time (Newton, Poisson, Stronge).
    Path(Routh<T>),
    /// One total impulse is limited to the cone; with a coefficient of tangential restitution (Chatterjee & Ruina), or without
    /// (Whittaker).
    Cone(Option<T>),
    /// A prescribed impulse ratio is clipped.
    Ratio(Brach<T>),
    /// Friction against a mean slip.
    Mean,
}

impl<T> Family<T> {
    /// The path of a law that follows the slip in time.
    pub fn path(self) -> Option<Routh<T>> {
        match self {
            Self::Path(path) => Some(path),
            _ => None,
        }
    }
}

/// What the file of a law defines; everything else follows from its row of the table.
pub(crate) trait Rule<T: RealField + Copy> {
    fn family<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Family<T>;

    /// The outcome, and at `u_n = 0` the others that satisfy the law.
    fn answers<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Answers<T, D>, ImpactError>;

    fn resolve<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        Ok(self.answers(problem)?.first)
    }

    fn branches<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Vec<ImpactOutcome<T, D>>, ImpactError> {
        Ok(self.answers(problem)?.all())
    }
}

/// A law that ends a path of the impulse.
pub(crate) trait OnPath {
    type Scalar;

    fn path(&self) -> Routh<Self::Scalar>;
}

impl<T: RealField + Copy, L: OnPath<Scalar = T>> Rule<T> for L {
    fn family<const D: usize>(&self, _: &ImpactProblem<T, D>) -> Family<T> {
        Family::Path(self.path())
    }

    fn answers<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Answers<T, D>, ImpactError> {
        self.path().answers(problem)
    }

    fn resolve<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        self.path().resolve(problem)
    }
}

/// # Errors
/// [`ImpactError::Coefficient`], in any case.
pub(crate) fn refuse<T: RealField + Copy>(what: &'static str, value: T, rule: &'static str) -> Result<(), ImpactError> {
    Err(ImpactError::Coefficient { what, value: plain(value), rule })
}

pub(crate) fn check_restitution<T: RealField + Copy>(e: T) -> Result<(), ImpactError> {
    // Written so that NaN fails.
    if e >= T::zero() && e <= T::one() {
        return Ok(());
    }
    refuse("restitution", e, "is outside [0, 1]: 0 is no rebound, 1 a full rebound")
}

pub(crate) fn check_tangential_restitution<T: RealField + Copy>(e_t: T) -> Result<(), ImpactError> {
    if e_t >= -T::one() && e_t <= T::one() {
        return Ok(());
    }
    let rule = "is outside [-1, 1]: -1 is no tangential impulse, 0 one that stops the slip, 1 one that reverses it";
    refuse("tangential restitution", e_t, rule)
}

pub(crate) fn check_impulse_ratio<T: RealField + Copy>(ratio: T) -> Result<(), ImpactError> {
    if ratio.is_finite() {
        return Ok(());
    }
    refuse("impulse ratio", ratio, "is not finite: give tangential over normal impulse, negative against the slip")
}

pub(crate) fn check_friction<T: RealField + Copy>(mu: T) -> Result<(), ImpactError> {
    // The product is NaN if the coefficient is infinite.
    if mu >= T::zero() && mu * T::zero() == T::zero() {
        return Ok(());
    }
    refuse("friction", mu, "is not a finite number >= 0: give the Coulomb coefficient, 0 for none")
}
