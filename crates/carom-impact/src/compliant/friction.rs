//! Friction of a compliant contact: two laws that are ordinary differential equations, which Coulomb's is not.
//!
//! | Symbol | Meaning | Our name |
//! |---|---|---|
//! | v | slip velocity, tangential (m/s) | `slip` |
//! | v_d | slip speed at which friction is 76 % of Coulomb's (m/s) | `slip_speed` |
//! | F_n | normal force (N) | `normal_force` |
//! | μ | coefficient of friction | `friction` |
//! | z | deflection of the bristle, tangential (m) | `deflection` |
//! | k, c | stiffness (N/m) and damping (N s/m) of the bristle | `stiffness`, `damping` |
//! | P | nearest point of the disc of radius μ F_n | local `capped` |
//!
//! Vectors have any number of rows: one or two along contact axes, or three in the world frame.

use nalgebra::SVector;

use super::{POSITIVE, check_positive};
use crate::ImpactError;
use crate::laws::check_friction;

/// Coulomb's friction, smoothed at small slip: `F_t = -μ F_n tanh(|v|/v_d) v/|v|`.
///
/// **Parameters.** `friction` μ >= 0; `slip_speed` v_d > 0 (m/s).
///
/// **Guarantee.** Passive (F_t·v ≤ 0), within the cone, without memory. As v_d → 0 an impact converges to that with
/// Coulomb's friction, at first order in v_d.
///
/// **Fails** to stick: on a slope of angle θ below the friction angle a body creeps at v_d atanh(tan θ/μ). The equation
/// becomes stiff for small v_d: its rate is μ F_n H_tt/v_d.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothedCoulomb {
    /// Coulomb's coefficient μ, at least 0.
    pub friction: f64,
    /// Slip speed v_d, m/s, above 0.
    pub slip_speed: f64,
}

impl SmoothedCoulomb {
    /// Friction μ, smoothed below `slip_speed` (m/s).
    ///
    /// # Errors
    /// [`ImpactError::Coefficient`]; [`ImpactError::Compliance`] for a slip speed that is not positive and finite.
    pub fn new(friction: f64, slip_speed: f64) -> Result<Self, ImpactError> {
        check_friction(friction)?;
        check_positive("slip speed", slip_speed, POSITIVE)?;
        Ok(Self { friction, slip_speed })
    }

    /// Force on the robot (N).
    pub(super) fn force<const N: usize>(&self, slip: &SVector<f64, N>, normal_force: f64) -> SVector<f64, N> {
        let speed = slip.norm();
        let share = if speed > 0.0 { (speed / self.slip_speed).tanh() / speed } else { 0.0 };
        slip * (-self.friction * share * normal_force.max(0.0))
    }
}

/// Friction by a bristle: a spring and a dashpot in parallel, in series with a Coulomb slider. The contact sticks while
/// the bristle bends, and slides when the bristle force reaches the friction limit. With f = k z + c v, the force at
/// which the whole slip deflects the bristle,
///
/// ```text
/// F_t = -P(f),   c ż = P(f) - k z
/// ```
///
/// where P(f) is the point of the disc of radius μ F_n that is nearest to f. While |f| ≤ μ F_n, ż = v: the contact
/// **sticks**, and a body on a slope below the friction angle does not creep. Beyond, the slider slips with v − ż,
/// along the force.
///
/// As c → 0 it is Cundall & Strack's spring with a limited force. The dashpot makes the law one continuous equation
/// without switches or the rate of F_n, and damps the oscillation of the bristle.
///
/// **Parameters.** `friction` μ >= 0; `stiffness` k > 0 (N/m); `damping` c > 0 (N s/m).
///
/// **Guarantee.** Passive for any history of slip and normal force: −F_t·v = d(k|z|²/2)/dt + c|ż|² + P(f)·(v − ż),
/// whose last two terms are never negative. Always within the cone.
///
/// **Fails** to be rigid: the contact moves by F_t/k before it sticks, and in an impact it springs back, a tangential
/// restitution that depends on k and c relative to the normal stiffness.
///
/// **Source.** The spring with a limited force: P. A. Cundall, O. D. L. Strack, Géotechnique 29 (1979) 47.
///
/// ```
/// # use carom_impact::{Bristle, TangentialForce};
/// # use nalgebra::vector;
/// let bristle = TangentialForce::Bristle(Bristle::new(0.5, 1e5, 10.0)?);
/// let (bent, still) = (vector![1e-5], vector![0.0]);
/// assert_eq!(bristle.force(&bent, &still, 10.0), vector![-1.0]); // it sticks
/// assert_eq!(bristle.rate(&bent, &still, 10.0), vector![0.0]);
/// assert_eq!(bristle.force(&bent, &still, 1.0), vector![-0.5]); // with a smaller normal force it slides
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bristle {
    /// Coulomb's coefficient μ, at least 0.
    pub friction: f64,
    /// Stiffness k, N/m, above 0.
    pub stiffness: f64,
    /// Damping c, N s/m, above 0. A bent bristle that is released relaxes in a time of about c/k.
    pub damping: f64,
}

impl Bristle {
    /// A bristle of `friction` μ, `stiffness` k (N/m) and `damping` c (N s/m).
    ///
    /// # Errors
    /// [`ImpactError::Coefficient`]; [`ImpactError::Compliance`] for a stiffness or damping that is not positive and
    /// finite.
    pub fn new(friction: f64, stiffness: f64, damping: f64) -> Result<Self, ImpactError> {
        check_friction(friction)?;
        check_positive("bristle's stiffness", stiffness, POSITIVE)?;
        let rule =
            "it must be finite and above 0, to damp the oscillation of the bristle; 2 √(k m) is critical for a mass m";
        check_positive("bristle's damping", damping, rule)?;
        Ok(Self { friction, stiffness, damping })
    }

    /// Force on the robot (N).
    pub(super) fn force<const N: usize>(
        &self,
        deflection: &SVector<f64, N>,
        slip: &SVector<f64, N>,
        normal_force: f64,
    ) -> SVector<f64, N> {
        -self.carried(deflection, slip, normal_force).0
    }

    /// Rate of the deflection ż (m/s).
    pub(super) fn rate<const N: usize>(
        &self,
        deflection: &SVector<f64, N>,
        slip: &SVector<f64, N>,
        normal_force: f64,
    ) -> SVector<f64, N> {
        match self.carried(deflection, slip, normal_force) {
            (capped, true) => (capped - deflection * self.stiffness) / self.damping,
            (_, false) => *slip,
        }
    }

    /// P(f), and whether the slider slips.
    fn carried<const N: usize>(
        &self,
        deflection: &SVector<f64, N>,
        slip: &SVector<f64, N>,
        normal_force: f64,
    ) -> (SVector<f64, N>, bool) {
        let wanted = deflection * self.stiffness + slip * self.damping;
        let (size, most) = (wanted.norm(), self.friction * normal_force.max(0.0));
        if size <= most { (wanted, false) } else { (wanted * (most / size), true) }
    }
}
