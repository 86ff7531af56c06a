//! A spring that gives back less than it took: two straight lines.

use super::damping::check_restitution;
use super::{POSITIVE, check_positive};
use crate::ImpactError;

/// Compliant normal contact that is loaded along one straight line and unloaded along a steeper one,
///
/// ```text
/// F = k d                         while d is the deepest so far, D
/// F = k/e² (d - (1 - e²) D) ≥ 0   else
/// ```
///
/// so that it ends with the dent (1 − e²) D. Loading takes k D²/2 and unloading gives e² of it back: e is the
/// **energetic** coefficient of restitution, exactly, whatever else acts meanwhile (if d rises and falls once).
///
/// **Guarantee.** Never pulls, never gains energy, no force jumps; and the energetic coefficient makes it the bridge to
/// the rigid laws: in a fixed configuration, with Coulomb friction, its impact *is* [`Energetic`](crate::Energetic)'s
/// (Stronge), for every stiffness.
///
/// **Fails** to damp small motion of a contact that rests: inside the steeper line it is elastic. The force has a memory,
/// D, which is gone when the bodies part.
///
/// **Source.** O. R. Walton, R. L. Braun, J. Rheol. 30 (1986) 949.
///
/// ```
/// # use carom_impact::WaltonBraun;
/// let contact = WaltonBraun::new(1e5, 0.5)?;
/// assert_eq!(contact.force(1e-3, 0.0), 1e5 * 1e-3);
/// assert!((contact.force(0.8e-3, 1e-3) - 4e5 * 0.05e-3).abs() < 1e-9);
/// assert_eq!(contact.force(0.7e-3, 1e-3), 0.0);
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
    /// line of unloading would be upright).
    pub fn new(stiffness: f64, restitution: f64) -> Result<Self, ImpactError> {
        check_positive("stiffness", stiffness, POSITIVE)?;
        check_restitution(restitution)?;
        Ok(Self { stiffness, restitution })
    }

    /// Normal force (N) at a `penetration` d (m), where the contact was turned back from `deepest` (m) before; 0 if
    /// it never was. Beyond that depth it is loaded anew.
    pub fn force(&self, penetration: f64, deepest: f64) -> f64 {
        let (k, square) = (self.stiffness, self.restitution * self.restitution);
        if penetration >= deepest {
            return k * penetration.max(0.0);
        }
        (k / square * (penetration - (1.0 - square) * deepest)).max(0.0)
    }

    /// The deepest penetration (m) of an impact at `approach_speed` v0 (m/s) of an `effective_mass` m (kg): v0 √(m/k).
    pub fn greatest_penetration(&self, approach_speed: f64, effective_mass: f64) -> f64 {
        approach_speed.max(0.0) * (effective_mass / self.stiffness).sqrt()
    }
}
