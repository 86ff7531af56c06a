use nalgebra::RealField;

use super::{Family, Rule, check_restitution};
use crate::branches::Answers;
use crate::outcome::{Account, Mode};
use crate::{Flags, ImpactError, ImpactOutcome, ImpactProblem};

/// Impact without friction: the impulse acts along the normal, and the tangential velocity changes only by inertial
/// coupling.
///
/// ```text
/// P_n = -(1 + e) u_n⁻ / C,   P_t = 0,   u⁺ = u⁻ + H P,   u_n⁺ = -e u_n⁻
/// T⁻ - T⁺ = ½ (1 - e²) (u_n⁻)² / C
/// ```
///
/// **Parameter.** `restitution` e in \[0, 1\]. Without friction the kinematic (Newton), kinetic (Poisson) and energetic
/// (Stronge) coefficients are equal.
///
/// **Guarantee.** One solution in any dimension; never gains energy.
///
/// **Fails** for a singular normal direction, `C = H_nn = 0`, where the impulse would be infinite
/// ([`ImpactError::SingularNormal`]).
///
/// **Mode.** Without friction a contact does not stick: it slips, or slips back if its final slip is opposite to the
/// initial one. The mode is stick only if there is no slip before and after.
///
/// **Source.** Newton, *Principia* (1687): his law of impact, along the normal.
///
/// ```
/// # use carom_impact::{Frictionless, ImpactProblem, Law};
/// # use nalgebra::{matrix, vector};
/// let problem = ImpactProblem::new(matrix![2.0, 0.5; 0.5, 1.0], vector![1.0, -2.0])?;
/// let hit = Frictionless { restitution: 0.5 }.resolve(&problem)?;
/// assert_eq!(hit.impulse, vector![0.0, 3.0]);
/// assert_eq!(hit.u_plus, vector![2.5, 1.0]);
/// assert_eq!(hit.energy_change, -0.5 * 0.75 * 4.0);
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frictionless<T = f64> {
    /// Coefficient of restitution, 0 to 1.
    pub restitution: T,
}

impl<T: RealField + Copy> Rule<T> for Frictionless<T> {
    fn family<const D: usize>(&self, _: &ImpactProblem<T, D>) -> Family<T> {
        Family::Frictionless
    }

    fn answers<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Answers<T, D>, ImpactError> {
        Ok(Answers { first: self.resolve(problem)?, others: Vec::new() })
    }

    fn resolve<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        check_restitution(self.restitution)?;
        if problem.approach_speed() <= T::zero() {
            return Ok(ImpactOutcome::none(Self::NAME, problem, Flags::NONE));
        }
        problem.check_normal()?;
        frictionless(Self::NAME, self.restitution, problem)
    }
}

/// The formula of [`Frictionless`], for an approaching contact with `C > 0`.
pub(crate) fn frictionless<T: RealField + Copy, const D: usize>(
    law: &'static str,
    e: T,
    problem: &ImpactProblem<T, D>,
) -> Result<ImpactOutcome<T, D>, ImpactError> {
    let n = D - 1;
    let h = problem.delassus();
    let u = problem.u_minus();

    let p_n = -(T::one() + e) * u[n] / h[(n, n)];
    let mut impulse = u * T::zero();
    impulse[n] = p_n;
    let mut u_plus = u + h.column(n) * p_n;
    u_plus[n] = -e * u[n];

    let slip = |x: &nalgebra::SVector<T, D>| (0..n).any(|i| x[i] != T::zero());
    let mut account = Account::straight(e, &impulse, u, &u_plus);
    if slip(u) && account.mode == Mode::Stick {
        account.mode = Mode::Slip; // without friction it cannot stick
    }
    ImpactOutcome::of(law, problem, impulse, u_plus, account, Some(T::zero()))
}
