use nalgebra::RealField;

use super::OnPath;
use crate::plane::Routh;
use crate::routh::Ending;

/// Routh's method with Poisson's coefficient: friction follows the slip, and restitution ends at a prescribed ratio of
/// impulses. With `pc` the normal impulse at which compression ends (`u_n = 0`),
///
/// ```text
/// P_n = (1 + e) pc
/// ```
///
/// While the contact slips, friction acts against the slip of each instant; when the slip stops, the contact sticks if
/// friction is large enough (`μ >= μ_stick`), otherwise it slips back (Coulomb). [`Newton`](crate::Newton),
/// [`Energetic`](crate::Energetic) and this law share this path and differ in its end; they give the same outcome if
/// the slip does not stop.
///
/// **Parameters.** `restitution` e, kinetic, in \[0, 1\]; `friction` μ >= 0.
///
/// **Guarantee.** One solution for every regular H; `friction_work <= 0`; never gains energy in the plane. In space
/// this is not proved; no energy is gained in 200 000 random impacts (test
/// `poisson_never_gains_energy_in_200_000_impacts_in_space`). The contact may nevertheless separate faster than it
/// approached (`newton > 1`).
///
/// **Fails** to conserve the kinetic energy at e = 1: if the slip stops, the normal works of the two phases differ.
///
/// **In space** the slip turns while it lasts. It is integrated by power series to rounding. If the slip stays in one
/// plane through the normal, the problem is reduced to that plane exactly.
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

impl<T: RealField + Copy> OnPath for Poisson<T> {
    type Scalar = T;

    fn path(&self) -> Routh<T> {
        let Self { restitution, friction } = *self;
        Routh { law: Self::NAME, restitution, friction, ending: Ending::Impulse }
    }
}
