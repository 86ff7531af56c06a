//! The Hunt–Crossley force, with the damping that rebounds exactly or one of those in use. With e = 1: Hertz.

use super::damping::{Damping, check_restitution, work_share};
use super::{POSITIVE, check_positive};
use crate::ImpactError;

/// Compliant normal contact `F = max(0, k dⁿ (1 + a w))`, with a from [`HuntCrossley::damping`]. Unless another
/// [`Damping`] is chosen, its rebound is e times the approach, exactly, for every mass, stiffness and speed.
///
/// **Exact** for one contact that starts at d = 0, with a constant effective mass and no other force
/// while it lasts. The damping grows as the approach slows down: a contact that is to come to rest
/// needs a floor under the approach speed.
///
/// **Guarantee.** Never pulls, never gains energy; the force starts and ends at zero. With e = 1 and n = 3/2 it is
/// Hertz's contact ([`hertz_stiffness`]).
///
/// **Fails** at e = 0, which no finite damping gives.
///
/// **Source.** The force: Hunt & Crossley, J. Appl. Mech. 42 (1975) 440. Their damping,
/// a v0 = 3(1 − e)/2, is the root's limit for e → 1; at e = 1/2 it is about half of what that rebound
/// needs.
///
/// ```
/// # use carom_impact::HuntCrossley;
/// let contact = HuntCrossley::new(1e7, 1.5, 0.5)?;
/// let damping = contact.damping(0.2);
/// assert!((damping * 0.2 - 1.432751).abs() < 1e-6);
/// assert!(contact.force(1e-4, 0.1, damping) > contact.force(1e-4, -0.1, damping));
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HuntCrossley {
    /// Stiffness k, N/mⁿ, above 0.
    pub stiffness: f64,
    /// Exponent n of the penetration, from 0.1 to 10: 3/2 for round bodies (Hertz), 1 for a spring.
    pub exponent: f64,
    /// Coefficient of restitution e as a ratio of velocities that is asked for, above 0, at most 1.
    pub restitution: f64,
    /// The formula that turns e into damping.
    pub formula: Damping,
}

impl HuntCrossley {
    /// A contact of `stiffness` k (N/mⁿ), `exponent` n and `restitution` e, damped exactly.
    ///
    /// # Errors
    /// [`ImpactError::Compliance`]: a stiffness that is not positive and finite, an exponent outside 0.1 … 10, a
    /// restitution outside (0, 1].
    pub fn new(stiffness: f64, exponent: f64, restitution: f64) -> Result<Self, ImpactError> {
        check_positive("stiffness", stiffness, POSITIVE)?;
        // Beyond, the force is a step at the surface, or none in any depth that a rigid body may sink.
        if !(0.1..=10.0).contains(&exponent) {
            let rule =
                "it lies between 0.1 and 10: 1 for a spring, 1.5 for round bodies (Hertz), 2 for the tip of a cone";
            return Err(ImpactError::Compliance { what: "exponent", value: exponent, rule });
        }
        check_restitution(restitution)?;
        Ok(Self { stiffness, exponent, restitution, formula: Damping::Exact })
    }

    /// The same contact damped by another formula.
    pub const fn damped_after(self, formula: Damping) -> Self {
        Self { formula, ..self }
    }

    /// Damping a (s/m) for a contact first touched at `approach_speed` v0 (m/s, positive); it holds until
    /// lift-off. 0 where nothing approaches; NaN if the fields hold what [`HuntCrossley::new`] refuses.
    pub fn damping(&self, approach_speed: f64) -> f64 {
        if approach_speed <= 0.0 {
            return 0.0;
        }
        // at speeds near the least of all numbers the quotient overflows, and infinity times a rate of 0 is no force
        (self.number() / approach_speed).clamp(0.0, f64::MAX)
    }

    /// Normal force (N) at a `penetration` d (m) that grows at `rate` w (m/s). Never negative: a contact
    /// doesn't pull.
    pub fn force(&self, penetration: f64, rate: f64, damping: f64) -> f64 {
        let factor = 1.0 + damping * rate;
        if penetration <= 0.0 || factor <= 0.0 {
            return 0.0;
        }
        self.stiffness * penetration.powf(self.exponent) * factor
    }

    /// The deepest penetration (m) of an impact at `approach_speed` v0 (m/s) of an `effective_mass` m (kg),
    /// in closed form: `k d^(n+1) = (n+1) m v0² g(x)`, where g(x) is 1/2 without damping. It helps to
    /// choose a stiffness.
    pub fn greatest_penetration(&self, approach_speed: f64, effective_mass: f64) -> f64 {
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

/// A body as Hertz's theory sees it: round near the contact, elastic, isotropic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoundBody {
    /// Radius of curvature at the contact, m; infinite for a flat one, negative for a hollow.
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
/// **Holds** for small, frictionless, elastic contact patches and impacts that are slow beside the speed of sound.
///
/// **Source.** H. Hertz, J. reine angew. Math. 92 (1881) 156.
///
/// # Errors
/// [`ImpactError::Compliance`]: a radius of 0 or without a value, radii that fit nowhere (1/R ≤ 0: flat on flat, a
/// ball in a hollow that is narrower than it), a modulus that is not positive and finite, a Poisson's ratio out of
/// its range.
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
            return refuse("radius", radius, "a round body has a radius: inf for a flat one, negative for a hollow");
        }
        check_positive("modulus", modulus, POSITIVE)?;
        if !(poisson_ratio > -1.0 && poisson_ratio <= 0.5) {
            return refuse("Poisson's ratio", poisson_ratio, "that of an isotropic body is above -1 and at most 0.5");
        }
    }
    let curvature = one.radius.recip() + other.radius.recip();
    if curvature <= 0.0 {
        let rule = "the sum of the curvatures must be positive: two flat bodies, or a ball in a narrower hollow, don't \
                    meet in a point";
        return refuse("1/R", curvature, rule);
    }
    let softness = |body: RoundBody| (1.0 - body.poisson_ratio * body.poisson_ratio) / body.modulus;
    Ok(4.0 / 3.0 / ((softness(one) + softness(other)) * curvature.sqrt()))
}
