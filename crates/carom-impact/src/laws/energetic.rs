use nalgebra::RealField;

use super::OnPath;
use crate::plane::Routh;
use crate::routh::Ending;

/// Routh's method with Stronge's coefficient: friction follows the slip, and restitution ends when the normal force has
/// returned e² of the work that it absorbed in compression,
///
/// ```text
/// ∫_pc^P_n u_n dp = -e² ∫_0^pc u_n dp
/// ```
///
/// While the contact slips, friction acts against the slip of each instant; when the slip stops, the contact sticks if
/// friction is large enough (`μ >= μ_stick`), otherwise it slips back (Coulomb). [`Newton`](crate::Newton),
/// [`Poisson`](crate::Poisson) and this law share this path and differ in its end; they give the same outcome if the
/// slip does not stop.
///
/// **Parameters.** `restitution` e, energetic, in \[0, 1\]; `friction` μ >= 0. This e is not the square root of a ratio
/// of kinetic energies.
///
/// **Guarantee.** One solution for every regular H; never gains energy, because the total normal work is `(1 - e²)`
/// times that of compression, hence not positive, and the work of friction is not positive either. At e = 1 the normal
/// work is zero, and all loss is due to friction.
///
/// **Fails** only for singular H, as [`Newton`](crate::Newton) and [`Poisson`](crate::Poisson) do; see
/// [`ImpactError::Wedged`](crate::ImpactError::Wedged).
///
/// **In space** the slip turns while it lasts. It is integrated by power series to rounding. If the slip stays in one
/// plane through the normal, the problem is reduced to that plane exactly.
///
/// **Source.** Stronge, Proc. R. Soc. A 431 (1990) 169.
///
/// ```
/// # use carom_impact::{ImpactProblem, Law, Energetic};
/// # use nalgebra::{matrix, vector};
/// // A rod at 45° strikes obliquely: slip stops in restitution, then the end sticks.
/// let problem = ImpactProblem::new(matrix![2.5, -1.5; -1.5, 2.5], vector![1.0_f64, -1.0])?;
/// let hit = Energetic { restitution: 0.5, friction: 0.6 }.resolve(&problem)?;
/// assert!((hit.u_plus[1] - 0.356453).abs() < 1e-6);
/// assert!((hit.energetic.unwrap() - 0.5).abs() < 1e-15);
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Energetic<T = f64> {
    /// Energetic coefficient of restitution, 0 to 1.
    pub restitution: T,
    /// Coulomb coefficient of friction, 0 or more.
    pub friction: T,
}

impl<T: RealField + Copy> OnPath for Energetic<T> {
    type Scalar = T;

    fn path(&self) -> Routh<T> {
        let Self { restitution, friction } = *self;
        Routh { law: Self::NAME, restitution, friction, ending: Ending::Work }
    }
}
