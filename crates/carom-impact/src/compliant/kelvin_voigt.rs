//! The Kelvin–Voigt force: a linear spring and a linear dashpot in parallel.

use super::{POSITIVE, check_positive};
use crate::ImpactError;
use crate::roots::{MOST_STEPS, bisect};

/// Compliant normal contact of a linear spring and a linear dashpot in parallel, `F = k d + c w`. The force is either
/// limited to F ≥ 0, or pulls until d = 0.
///
/// **Parameters.** `stiffness` k > 0 (N/m); `restitution` e, kinematic, in (0, 1\]; `pulls`.
///
/// With ζ = c/(2 √(k m)) the rebound is
///
/// ```text
/// pulls, to d = 0      e = exp(-π ζ/√(1 - ζ²))              for ζ < 1; none beyond
/// never pulls, F ≥ 0   e = exp(-2 ζ acos ζ/√(1 - ζ²))       for ζ < 1, e⁻² at ζ = 1,
///                      e = exp(-2 ζ acosh ζ/√(ζ² - 1))      beyond
/// ```
///
/// With s = √(1 − ζ²) the motion is d ∝ exp(−ζ ω t) sin(s ω t). It returns to d = 0 at s ω t = π. The force, −m ẇ, is
/// zero before that, at tan(s ω t) = −2 ζ s/(1 − 2 ζ²), that is s ω t = 2 acos ζ, where the rate is exp(−ζ ω t) v0. A
/// damping chosen for one of these ends and integrated to the other gives a different e.
///
/// **Guarantee.** Never gains energy; e is exact for one contact of constant effective mass and no other force. The law
/// is linear: the rebound does not depend on the speed, and a contact at rest is damped.
///
/// **Fails** to have one c for one e if the effective mass varies, as along a robot's motion: c is computed at each
/// first touch ([`KelvinVoigt::damping`]). The force jumps to c v0 at first touch; if it pulls, it jumps at the end
/// too, and a resting contact can adhere.
///
/// **Source.** The two ends: T. Schwager, T. Pöschel, Granular Matter 9 (2007) 465.
///
/// ```
/// # use carom_impact::{KelvinVoigt, NormalForce};
/// let contact = KelvinVoigt::new(1e5, 0.5)?;
/// let damping = contact.damping(2.0);
/// assert!((contact.rebound(damping, 2.0) - 0.5).abs() < 1e-15);
/// assert!(NormalForce::KelvinVoigt(contact).force(0.0, 1.0, damping, 0.0) > 0.0); // the jump
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KelvinVoigt {
    /// Stiffness k, N/m, above 0.
    pub stiffness: f64,
    /// Coefficient of restitution e as a ratio of velocities, above 0, at most 1.
    pub restitution: f64,
    /// Whether the force may pull during separation, until d = 0. If `false`, it is limited to F ≥ 0.
    pub pulls: bool,
}

impl KelvinVoigt {
    /// A contact of `stiffness` k (N/m) and `restitution` e that never pulls.
    ///
    /// # Errors
    /// [`ImpactError::Compliance`]: a stiffness that is not positive and finite, a restitution outside (0, 1].
    pub fn new(stiffness: f64, restitution: f64) -> Result<Self, ImpactError> {
        check_positive("stiffness", stiffness, POSITIVE)?;
        super::damping::check_restitution(restitution)?;
        Ok(Self { stiffness, restitution, pulls: false })
    }

    /// Damping c (N s/m) with which an `effective_mass` m (kg) rebounds with e.
    pub fn damping(&self, effective_mass: f64) -> f64 {
        2.0 * self.damping_ratio() * (self.stiffness * effective_mass).sqrt()
    }

    /// Damping ratio ζ, relative to critical damping, that rebounds with e; NaN if the fields hold values that
    /// [`KelvinVoigt::new`] refuses.
    pub fn damping_ratio(&self) -> f64 {
        let loss = -self.restitution.ln(); // decrease of ln |w|
        if self.pulls {
            return loss / std::f64::consts::PI.hypot(loss);
        }
        if !(loss > 0.0 && loss < f64::INFINITY) {
            return if loss == 0.0 { 0.0 } else { f64::NAN };
        }
        // The loss grows with ζ, as π ζ for small ζ and below 2 ζ acosh ζ/(ζ - 1) for large ζ: bisection.
        let (mut low, mut high) = (loss / std::f64::consts::PI, 1.0);
        while clipped_loss(high) < loss {
            (low, high) = (high, 2.0 * high);
            if !high.is_finite() {
                break;
            }
        }
        bisect(low, high, MOST_STEPS, |ratio| clipped_loss(ratio) >= loss)
    }

    /// Coefficient of restitution e of an `effective_mass` m (kg) with a `damping` c (N s/m), in closed form: the
    /// inverse of [`KelvinVoigt::damping`].
    pub fn rebound(&self, damping: f64, effective_mass: f64) -> f64 {
        let ratio = damping / (2.0 * (self.stiffness * effective_mass).sqrt());
        if !self.pulls {
            return (-clipped_loss(ratio)).exp();
        }
        if ratio < 1.0 { (-std::f64::consts::PI * ratio / ((1.0 - ratio) * (1.0 + ratio)).sqrt()).exp() } else { 0.0 }
    }

    /// Normal force (N) at a `penetration` d (m) that grows at `rate` w (m/s).
    pub(super) fn force(&self, penetration: f64, rate: f64, damping: f64) -> f64 {
        if penetration < 0.0 || (penetration == 0.0 && rate <= 0.0) {
            return 0.0;
        }
        let force = self.stiffness * penetration + damping * rate;
        if self.pulls || force.is_nan() { force } else { force.max(0.0) }
    }

    /// Largest penetration (m) of an impact at `approach_speed` v0 (m/s) of an `effective_mass` m (kg), in closed form:
    /// `v0 √(m/k) exp(-ζ acos ζ/√(1 - ζ²))`.
    pub(super) fn greatest_penetration(&self, approach_speed: f64, effective_mass: f64) -> f64 {
        let loss = clipped_loss(self.damping_ratio()); // w = 0 at half the phase at which F = 0
        approach_speed.max(0.0) * (effective_mass / self.stiffness).sqrt() * (-0.5 * loss).exp()
    }
}

/// −ln e of a contact that never pulls: 2 ζ acos ζ/√(1 − ζ²), and its continuation from ζ = 1 on.
fn clipped_loss(ratio: f64) -> f64 {
    let z = ratio;
    // about z = 1, with c = 1 − z: acos z/√(1 − z²) = 1 + c/3 + 2c²/15 + …, where the closed forms are 0/0
    let c = 1.0 - z;
    let quotient = if c.abs() < 1e-3 {
        1.0 + c * (1.0 / 3.0 + c * (2.0 / 15.0 + c * (2.0 / 35.0 + c * (8.0 / 315.0 + c * 8.0 / 693.0))))
    } else if z < 1.0 {
        z.acos() / (c * (1.0 + z)).sqrt()
    } else {
        z.acosh() / (-c * (1.0 + z)).sqrt()
    };
    2.0 * z * quotient
}
