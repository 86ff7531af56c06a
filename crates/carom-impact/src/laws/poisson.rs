use nalgebra::RealField;

use super::{AnyLaw, Kind, Law};
use crate::plane::Routh;
use crate::routh::Ending;
use crate::{ImpactError, ImpactOutcome, ImpactProblem};

/// Routh's walk, ended by the ratio of impulses: with `pc` the normal impulse at which compression
/// ends (`u_n = 0`), restitution is over when
///
/// ```text
/// P_n = (1 + e) pc
/// ```
///
/// **Parameters.** `restitution` e, kinetic, in \[0, 1\]; `friction` μ >= 0.
///
/// **Guarantee.** One answer for every regular H; `friction_work <= 0`; never gains energy in the plane. In space that
/// is not proved here, but none of 200 000 random impacts did. The rebound may be faster than the approach
/// (`newton > 1`) all the same.
///
/// **Fails** at e = 1 to be lossless: when slip stops, the normal work of the two phases differs.
///
/// **In space** slip turns while it lasts, and is followed by power series to rounding; where it stays in one plane
/// through the normal, the problem is reduced to that plane exactly.
///
/// **Source.** Poisson (1811); Routh (1860); Wang and Mason, J. Appl. Mech. 59 (1992) 635.
///
/// ```
/// # use carom_impact::{ImpactProblem, Law, Poisson};
/// # use nalgebra::{matrix, vector};
/// // A rod at 45° strikes obliquely: slip stops in restitution, then the end sticks.
/// let problem = ImpactProblem::new(matrix![2.5, -1.5; -1.5, 2.5], vector![1.0_f64, -1.0])?;
/// let hit = Poisson { restitution: 0.5, friction: 0.6 }.resolve(&problem)?;
/// assert!((hit.u_plus[1] - 0.305882).abs() < 1e-6);
/// assert!((hit.poisson.unwrap() - 0.5).abs() < 1e-15);
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Poisson<T = f64> {
    /// Kinetic coefficient of restitution, 0 to 1.
    pub restitution: T,
    /// Coulomb coefficient of friction, 0 or more.
    pub friction: T,
}

impl<T: RealField + Copy, const D: usize> Law<T, D> for Poisson<T> {
    fn name(&self) -> &'static str {
        "poisson"
    }

    fn resolve(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        Ok(self.path().answers(problem)?.first)
    }

    fn branches(&self, problem: &ImpactProblem<T, D>) -> Result<Vec<ImpactOutcome<T, D>>, ImpactError> {
        Ok(self.path().answers(problem)?.all())
    }

    fn known(&self) -> Option<AnyLaw<T>> {
        Some(AnyLaw(Kind::Poisson(*self)))
    }
}

impl<T: RealField + Copy> Poisson<T> {
    fn path(&self) -> Routh<T> {
        let Self { restitution, friction } = *self;
        Routh { law: "poisson", restitution, friction, ending: Ending::Impulse }
    }
}
