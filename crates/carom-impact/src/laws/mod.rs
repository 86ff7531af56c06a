//! The laws, one small type each, and their names.

mod energetic;
mod frictionless;
mod newton;
mod poisson;
mod whittaker;

use nalgebra::RealField;

pub use energetic::Energetic;
pub use frictionless::Frictionless;
pub(crate) use frictionless::frictionless;
pub use newton::Newton;
pub use poisson::Poisson;
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
    /// ([`ImpactError::SingularNormal`]); a held contact that wedges ([`ImpactError::Wedged`]); in
    /// space, for a law with friction, slip that leaves its plane
    /// ([`ImpactError::NotInOnePlane`]).
    fn resolve(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError>;
}

/// Names [`law_by_name`] knows.
pub const LAW_NAMES: [&str; 5] = ["frictionless", "whittaker", "newton", "poisson", "energetic"];

/// The law called `name`, or `None` if there is none. The coefficients are checked when the law
/// resolves its first problem; `frictionless` ignores `friction`.
///
/// ```
/// use carom_impact::{LAW_NAMES, law_by_name};
/// for name in LAW_NAMES {
///     assert_eq!(law_by_name::<3>(name, 0.5, 0.2).unwrap().name(), name);
/// }
/// assert!(law_by_name::<2>("hertz", 0.5, 0.2).is_none());
/// ```
pub fn law_by_name<const D: usize>(
    name: &str,
    restitution: f64,
    friction: f64,
) -> Option<Box<dyn Law<f64, D> + Send + Sync>> {
    Some(match name {
        "frictionless" => Box::new(Frictionless { restitution }),
        "whittaker" => Box::new(Whittaker { restitution, friction }),
        "newton" => Box::new(Newton { restitution, friction }),
        "poisson" => Box::new(Poisson { restitution, friction }),
        "energetic" => Box::new(Energetic { restitution, friction }),
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

pub(crate) fn check_friction<T: RealField + Copy>(mu: T) -> Result<(), ImpactError> {
    if mu >= T::zero() && mu.is_finite() {
        return Ok(());
    }
    Err(ImpactError::Friction { value: plain(mu) })
}
