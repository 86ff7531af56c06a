use nalgebra::RealField;

use super::{AnyLaw, Kind, Law};
use crate::plane::Routh;
use crate::routh::Ending;
use crate::{ImpactError, ImpactOutcome, ImpactProblem};

/// Routh's walk, ended by the ratio of velocities: restitution is over when
///
/// ```text
/// u_n⁺ = -e u_n⁻
/// ```
///
/// The walk itself (slip, then stick or slip back, by Coulomb's law at every instant) is shared with
/// [`Poisson`](crate::Poisson) and [`Energetic`](crate::Energetic); the three agree while slip never
/// stops.
///
/// **Parameters.** `restitution` e, kinematic, in \[0, 1\]; `friction` μ >= 0.
///
/// **Guarantee.** One answer for every regular H. Friction works against the slip at every instant,
/// so `friction_work <= 0`.
///
/// **Fails** to keep the energy books: when slip stops, the prescribed velocity can take more normal
/// work out of restitution than compression put in. Such an outcome carries the flag `energy-gain`.
/// With friction that holds a contact and det H -> 0 the impulse grows without bound; at det H = 0
/// the contact stays at `u_n = 0` instead.
///
/// **In space** slip turns while it lasts, and is followed by power series to rounding; where it stays in one plane
/// through the normal, the problem is reduced to that plane exactly.
///
/// **Source.** Keller, J. Appl. Mech. 53 (1986) 1, on Routh's method, with Newton's coefficient as the
/// end; compare Wang and Mason, J. Appl. Mech. 59 (1992) 635.
///
/// ```
/// # use carom_impact::{ImpactProblem, Law, Newton};
/// # use nalgebra::{matrix, vector};
/// // A rod at 45° strikes obliquely: slip stops in restitution, then the end sticks.
/// let problem = ImpactProblem::new(matrix![2.5, -1.5; -1.5, 2.5], vector![1.0_f64, -1.0])?;
/// let hit = Newton { restitution: 0.5, friction: 0.6 }.resolve(&problem)?;
/// assert!((hit.u_plus[1] - 0.5).abs() < 1e-15);
/// assert!((hit.newton.unwrap() - 0.5).abs() < 1e-15);
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Newton<T = f64> {
    /// Kinematic coefficient of restitution, 0 to 1.
    pub restitution: T,
    /// Coulomb coefficient of friction, 0 or more.
    pub friction: T,
}

impl<T: RealField + Copy, const D: usize> Law<T, D> for Newton<T> {
    fn name(&self) -> &'static str {
        "newton"
    }

    fn resolve(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        Ok(self.path().answers(problem)?.first)
    }

    fn branches(&self, problem: &ImpactProblem<T, D>) -> Result<Vec<ImpactOutcome<T, D>>, ImpactError> {
        Ok(self.path().answers(problem)?.all())
    }

    fn known(&self) -> Option<AnyLaw<T>> {
        Some(AnyLaw(Kind::Newton(*self)))
    }
}

impl<T: RealField + Copy> Newton<T> {
    fn path(&self) -> Routh<T> {
        let Self { restitution, friction } = *self;
        Routh { law: "newton", restitution, friction, ending: Ending::Velocity }
    }
}
