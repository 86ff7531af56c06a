//! The Hunt–Crossley force with exact or published damping. With e = 1: Hertz's contact.

use super::damping::{Damping, check_restitution, work_share};
use super::{POSITIVE, check_positive};
use crate::ImpactError;

/// Compliant normal contact `F = max(0, k dⁿ (1 + a w))`, with a from [`HuntCrossley::damping`]. With the default
/// [`Damping`] its rebound velocity is e times the approach velocity, exactly, for every mass, stiffness and speed.
///
/// **Parameters.** `stiffness` k > 0 (N/mⁿ); `exponent` n from 0.1 to 10; `restitution` e, kinematic, in (0, 1\].
///
/// **Exact** for one contact that starts at d = 0, with a constant effective mass and no other force. The damping is
/// inversely proportional to the approach velocity: for a contact that comes to rest the approach velocity needs a
/// lower bound.
///
/// **Guarantee.** Never pulls, never gains energy; the force starts and ends at zero. With e = 1 and n = 3/2 it is
/// Hertz's contact ([`hertz_stiffness`]).
///
/// **Fails** at e = 0, which needs an infinite damping.
///
/// **Source.** The force: Hunt & Crossley, J. Appl. Mech. 42 (1975) 440. Their damping, a v0 = 3(1 − e)/2, is the
/// first-order limit of the root for e → 1; at e = 1/2 it is about half of the exact value.
///
/// ```
/// # use carom_impact::{HuntCrossley, NormalForce};
/// let contact = HuntCrossley::new(1e7, 1.5, 0.5)?;
/// let damping = contact.damping(0.2);
/// assert!((damping * 0.2 - 1.432751).abs() < 1e-6);
/// let contact = NormalForce::HuntCrossley(contact);
/// assert!(contact.force(1e-4, 0.1, damping, 0.0) > contact.force(1e-4, -0.1, damping, 0.0));
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HuntCrossley {
    /// Stiffness k, N/mⁿ, above 0.
    pub stiffness: f64,
    /// Exponent n of the penetration, from 0.1 to 10: 3/2 for round bodies (Hertz), 1 for a spring.
    pub exponent: f64,
    /// Coefficient of restitution e as a ratio of velocities, above 0, at most 1.
    pub restitution: f64,
    /// The formula that gives the damping for e.
    pub formula: Damping,
}

impl HuntCrossley {
    /// A contact of `stiffness` k (N/mⁿ), `exponent` n and `restitution` e, with exact damping.
    ///
    /// # Errors
    /// [`ImpactError::Compliance`]: a stiffness that is not positive and finite, an exponent outside 0.1 … 10, a
    /// restitution outside (0, 1].
    pub fn new(stiffness: f64, exponent: f64, restitution: f64) -> Result<Self, ImpactError> {
        check_positive("stiffness", stiffness, POSITIVE)?;
        // Outside this range the force is nearly a step at the surface, or nearly zero at small penetrations.
        if !(0.1..=10.0).contains(&exponent) {
            let rule =
                "it must be between 0.1 and 10: 1 for a spring, 1.5 for round bodies (Hertz), 2 for the tip of a cone";
            return Err(ImpactError::Compliance { what: "exponent", value: exponent, rule });
        }
        check_restitution(restitution)?;
        Ok(Self { stiffness, exponent, restitution, formula: Damping::Exact })
    }

    /// Damping a (s/m) for a contact that first touches at `approach_speed` v0 (m/s, positive); it is valid until
    /// separation. 0 for `approach_speed <= 0`; NaN if the fields hold values that [`HuntCrossley::new`] refuses.
    pub fn damping(&self, approach_speed: f64) -> f64 {
        if approach_speed <= 0.0 {
            return 0.0;
        }
        // at the smallest speeds the quotient overflows, and infinity times a rate of 0 is NaN
        (self.number() / approach_speed).clamp(0.0, f64::MAX)
    }

    /// Normal force (N) at a `penetration` d (m) that grows at `rate` w (m/s). Never negative.
    pub(super) fn force(&self, penetration: f64, rate: f64, damping: f64) -> f64 {
        let factor = 1.0 + damping * rate;
        if penetration <= 0.0 || factor <= 0.0 {
            return 0.0;
        }
        self.stiffness * penetration.powf(self.exponent) * factor
    }

    /// Largest penetration (m) of an impact at `approach_speed` v0 (m/s) of an `effective_mass` m (kg), in closed form:
    /// `k d^(n+1) = (n+1) m v0² g(x)`, where g(x) is 1/2 without damping. Useful to choose a stiffness.
    pub(super) fn greatest_penetration(&self, approach_speed: f64, effective_mass: f64) -> f64 {
        if approach_speed <= 0.0 {
            return 0.0;
        }
        let work = effective_mass * approach_speed * approach_speed * work_share(self.number());
        let power = self.exponent + 1.0;
        (power * work / self.stiffness).powf(power.recip())
    }

    fn number(&self) -> f64 {
        self.formula.number(self.restitution).unwrap_or(f64::NAN)
    }
}

/// A body in Hertz's theory: round near the contact, elastic, isotropic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoundBody {
    /// Radius of curvature at the contact, m; infinite for a flat body, negative for a concave one.
    pub radius: f64,
    /// Young's modulus, Pa.
    pub modulus: f64,
    /// Poisson's ratio, above −1 and at most 1/2.
    pub poisson_ratio: f64,
}

/// Stiffness k (N/m^(3/2)) of the contact of two round bodies, for a [`HuntCrossley`] force with the exponent 3/2:
///
/// ```text
/// k = 4/3 E* √R,   1/R = 1/R1 + 1/R2,   1/E* = (1 - ν1²)/E1 + (1 - ν2²)/E2
/// ```
///
/// **Valid** for small, frictionless, elastic contact areas and impacts that are slow compared with the speed of sound.
///
/// **Source.** H. Hertz, J. reine angew. Math. 92 (1881) 156.
///
/// # Errors
/// [`ImpactError::Compliance`]: a radius of 0 or NaN, a sum of curvatures 1/R ≤ 0 (flat on flat, or a ball in a concave
/// body of smaller radius), a modulus that is not positive and finite, a Poisson's ratio out of its range.
///
/// ```
/// # use carom_impact::{HuntCrossley, RoundBody, hertz_stiffness};
/// // A steel ball of 10 mm on a steel plate.
/// let steel = RoundBody { radius: 0.01, modulus: 210e9, poisson_ratio: 0.3 };
/// let plate = RoundBody { radius: f64::INFINITY, ..steel };
/// let stiffness = hertz_stiffness(steel, plate)?;
/// assert!((stiffness / 1.5385e10 - 1.0).abs() < 1e-4);
/// let contact = HuntCrossley::new(stiffness, 1.5, 1.0)?;
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
pub fn hertz_stiffness(one: RoundBody, other: RoundBody) -> Result<f64, ImpactError> {
    let refuse = |what, value, rule| Err(ImpactError::Compliance { what, value, rule });
    for RoundBody { radius, modulus, poisson_ratio } in [one, other] {
        if radius.is_nan() || radius == 0.0 {
            return refuse(
                "radius",
                radius,
                "it must not be 0 or NaN: give inf for a flat body, a negative radius for a concave one",
            );
        }
        check_positive("modulus", modulus, POSITIVE)?;
        if !(poisson_ratio > -1.0 && poisson_ratio <= 0.5) {
            return refuse("Poisson's ratio", poisson_ratio, "that of an isotropic body is above -1 and at most 0.5");
        }
    }
    let curvature = one.radius.recip() + other.radius.recip();
    if curvature <= 0.0 {
        let rule = "the sum of the curvatures must be positive: two flat bodies, or a ball in a concave body of \
                    smaller radius, do not touch in a point";
        return refuse("1/R", curvature, rule);
    }
    let softness = |body: RoundBody| (1.0 - body.poisson_ratio * body.poisson_ratio) / body.modulus;
    Ok(4.0 / 3.0 / ((softness(one) + softness(other)) * curvature.sqrt()))
}
