//! The Walton–Braun force: a spring with a loading line and a steeper unloading line.

use super::damping::check_restitution;
use super::{POSITIVE, check_positive};
use crate::ImpactError;

/// Compliant normal contact that is loaded along a straight line and unloaded along a steeper one,
///
/// ```text
/// F = k d                         while d is the deepest so far, D
/// F = k/e² (d - (1 - e²) D) ≥ 0   else
/// ```
///
/// so that the contact separates at the residual penetration (1 − e²) D. Loading absorbs k D²/2 and unloading returns
/// e² of it: e is the **energetic** coefficient of restitution, exactly, with any other forces (if d rises and falls
/// once).
///
/// **Parameters.** `stiffness` k > 0 (N/m); `restitution` e, energetic, in (0, 1\].
///
/// **Guarantee.** Never pulls, never gains energy, no jump of the force. In a fixed configuration with Coulomb friction
/// its impact is that of [`Energetic`](crate::Energetic) (Stronge), for every stiffness.
///
/// **Fails** to damp small motions of a resting contact: on the unloading line it is elastic. The force has a memory,
/// D, which is reset when the contact separates.
///
/// **Source.** O. R. Walton, R. L. Braun, J. Rheol. 30 (1986) 949.
///
/// ```
/// # use carom_impact::{NormalForce, WaltonBraun};
/// let contact = NormalForce::WaltonBraun(WaltonBraun::new(1e5, 0.5)?);
/// let force = |penetration, deepest| contact.force(penetration, 0.0, 0.0, deepest);
/// assert_eq!(force(1e-3, 0.0), 1e5 * 1e-3);
/// assert!((force(0.8e-3, 1e-3) - 4e5 * 0.05e-3).abs() < 1e-9);
/// assert_eq!(force(0.7e-3, 1e-3), 0.0);
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WaltonBraun {
    /// Stiffness k of the first loading, N/m, above 0.
    pub stiffness: f64,
    /// Energetic coefficient of restitution e, above 0, at most 1.
    pub restitution: f64,
}

impl WaltonBraun {
    /// A contact of `stiffness` k (N/m) and energetic `restitution` e.
    ///
    /// # Errors
    /// [`ImpactError::Compliance`]: a stiffness that is not positive and finite, a restitution outside (0, 1] (at 0 the
    /// unloading line would be vertical).
    pub fn new(stiffness: f64, restitution: f64) -> Result<Self, ImpactError> {
        check_positive("stiffness", stiffness, POSITIVE)?;
        check_restitution(restitution)?;
        Ok(Self { stiffness, restitution })
    }

    /// Normal force (N) at a `penetration` d (m), where the contact last turned back at the penetration `deepest` (m);
    /// 0 if it never did. Beyond `deepest` it is on the loading line.
    pub(super) fn force(&self, penetration: f64, deepest: f64) -> f64 {
        let (k, square) = (self.stiffness, self.restitution * self.restitution);
        if penetration >= deepest {
            return k * penetration.max(0.0);
        }
        (k / square * (penetration - (1.0 - square) * deepest)).max(0.0)
    }

    /// Largest penetration (m) of an impact at `approach_speed` v0 (m/s) of an `effective_mass` m (kg): v0 √(m/k).
    pub(super) fn greatest_penetration(&self, approach_speed: f64, effective_mass: f64) -> f64 {
        approach_speed.max(0.0) * (effective_mass / self.stiffness).sqrt()
    }
}
