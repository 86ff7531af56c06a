use nalgebra::RealField;

use super::OnPath;
use crate::plane::Routh;
use crate::routh::Ending;

/// Routh's method with Newton's coefficient: friction follows the slip, and restitution ends at a prescribed ratio of
/// velocities,
///
/// ```text
/// u_n⁺ = -e u_n⁻
/// ```
///
/// While the contact slips, friction acts against the slip of each instant; when the slip stops, the contact sticks if
/// friction is large enough (`μ >= μ_stick`), otherwise it slips back (Coulomb). [`Poisson`](crate::Poisson),
/// [`Energetic`](crate::Energetic) and this law share this path and differ in its end; they give the same outcome if
/// the slip does not stop.
///
/// **Parameters.** `restitution` e, kinematic, in \[0, 1\]; `friction` μ >= 0.
///
/// **Guarantee.** One solution for every regular H; `u_n⁺ = -e u_n⁻`; `friction_work <= 0`, because friction acts
/// against the slip at each instant.
///
/// **Fails** to be passive: it can gain energy. If the slip stops, the prescribed velocity can require more normal work
/// in restitution than compression absorbed. Such an outcome has the flag `energy-gain`. If friction makes the contact
/// stick, the impulse grows without bound as det H -> 0; at det H = 0 the contact stays at `u_n = 0` instead.
///
/// **In space** the slip turns while it lasts. It is integrated by power series to rounding. If the slip stays in one
/// plane through the normal, the problem is reduced to that plane exactly.
///
/// **Source.** Keller, J. Appl. Mech. 53 (1986) 1, on Routh's method, ended by Newton's coefficient; compare Wang and
/// Mason, J. Appl. Mech. 59 (1992) 635.
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

impl<T: RealField + Copy> OnPath for Newton<T> {
    type Scalar = T;

    fn path(&self) -> Routh<T> {
        let Self { restitution, friction } = *self;
        Routh { law: Self::NAME, restitution, friction, ending: Ending::Velocity }
    }
}
