//! The laws, one small type each, and their names.

mod brach;
mod chatterjee_ruina;
mod energetic;
mod frictionless;
mod newton;
mod poisson;
mod smith;
mod whittaker;

use nalgebra::RealField;

pub use brach::Brach;
use brach::BrachTowardsRest;
pub use chatterjee_ruina::ChatterjeeRuina;
pub use energetic::Energetic;
pub use frictionless::Frictionless;
pub(crate) use frictionless::frictionless;
pub use newton::Newton;
pub use poisson::Poisson;
pub use smith::Smith;
pub use whittaker::Whittaker;

use crate::problem::plain;
use crate::{ImpactError, ImpactOutcome, ImpactProblem};

/// A rule that turns an impact problem into an impulse.
pub trait Law<T: RealField + Copy, const D: usize> {
    /// The name the law goes by, one of [`LAW_NAMES`] for the laws of this crate.
    fn name(&self) -> &'static str;

    /// Resolves the impact.
    ///
    /// A contact that does not approach is no error: the outcome is
    /// [`Mode::Open`](crate::Mode::Open), with zero impulse and the flag `no-approach`.
    ///
    /// # Errors
    ///
    /// A coefficient out of its range; a normal without mobility
    /// ([`ImpactError::SingularNormal`]); a held contact that wedges ([`ImpactError::Wedged`]).
    fn resolve(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError>;

    /// Every outcome that satisfies the law, that of [`resolve`](Self::resolve) first: one, unless the outcome is
    /// flagged `non-unique`.
    ///
    /// - A contact that slides at `u_n = 0` and whose friction jams: no impulse, then the finite one, to which the
    ///   outcome tends as the approach fades (impact without collision, Painlevé).
    /// - [`Whittaker`]'s several answers: stick, then slips in the order of falling impulse; where H is singular in
    ///   the plane, the ends of the range of impulses; where it is singular in space, those that are found.
    ///
    /// A law that does not say has one.
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
}

/// Names [`law_by_name`] knows.
pub const LAW_NAMES: [&str; 8] =
    ["frictionless", "whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"];

/// What a law may ask for beside the problem; each takes what it knows.
///
/// ```
/// use carom_impact::Coefficients;
/// let rubber = Coefficients { restitution: 0.8, friction: 0.9, ..Coefficients::default() };
/// assert_eq!(rubber.tangential_restitution, 0.0);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Coefficients {
    /// Coefficient of restitution, 0 to 1, in the law's own sense.
    pub restitution: f64,
    /// Coefficient of tangential restitution, -1 to 1; only `chatterjee-ruina` has one.
    pub tangential_restitution: f64,
    /// Coulomb coefficient of friction, 0 or more; `brach` takes it for an impulse ratio towards rest.
    pub friction: f64,
}

/// The law called `name`, or `None` if there is none. The coefficients are checked when the law
/// resolves its first problem, those that it does not know are ignored.
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
    let Coefficients { restitution, tangential_restitution, friction } = coefficients;
    Some(match name {
        "frictionless" => Box::new(Frictionless { restitution }),
        "whittaker" => Box::new(Whittaker { restitution, friction }),
        "newton" => Box::new(Newton { restitution, friction }),
        "poisson" => Box::new(Poisson { restitution, friction }),
        "energetic" => Box::new(Energetic { restitution, friction }),
        "chatterjee-ruina" => Box::new(ChatterjeeRuina { restitution, tangential_restitution, friction }),
        "brach" => Box::new(BrachTowardsRest { restitution, friction }),
        "smith" => Box::new(Smith { restitution, friction }),
        _ => return None,
    })
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
    if mu >= T::zero() && mu.is_finite() {
        return Ok(());
    }
    Err(ImpactError::Friction { value: plain(mu) })
}
