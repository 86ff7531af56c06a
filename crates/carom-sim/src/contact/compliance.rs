//! Compliant contacts of a simulation: their force laws, and the state that some of these need beside q and qd.

use super::law::ContactLaw;
use crate::error::SimError;
use crate::state::EQUAL;
use carom_impact::{
    Bristle, Damping, HuntCrossley, ImpactError, KelvinVoigt, NormalForce, SmoothedCoulomb, TangentialForce,
    WaltonBraun,
};
use nalgebra::Vector3;

/// The parameters of a compliant contact. Restitution and friction are those of its
/// [`ContactLaw`](crate::ContactLaw).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compliance {
    /// k, N/m; N/mⁿ under [`Yielding::HuntCrossley`].
    pub stiffness: f64,
    /// The normal force.
    pub normal: Yielding,
    /// The tangential force.
    pub tangential: Holding,
}

/// The normal force of a compliant contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Yielding {
    /// [`HuntCrossley`]: k dⁿ (1 + a ḋ) over the penetration d. With [`Damping::Exact`] the rebound velocity is exactly
    /// `restitution` times the approach velocity.
    HuntCrossley {
        /// n, from 0.1 to 10: 1.5 for round bodies, 1 for flat ones.
        exponent: f64,
        /// The formula for a from the restitution.
        damping: Damping,
    },
    /// [`KelvinVoigt`]: k d + c ḋ, with c from the restitution and the effective mass at the beginning of the contact.
    KelvinVoigt {
        /// Whether the force may be tensile while the bodies separate.
        pulls: bool,
    },
    /// [`WaltonBraun`]: k d in loading, a steeper line in unloading. The restitution is energetic (Stronge's).
    WaltonBraun,
}

/// The tangential force of a compliant contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Holding {
    /// [`SmoothedCoulomb`]: −μ Fₙ tanh(|v|/v_s) v/|v|. It creeps under a constant load.
    Smoothed {
        /// v_s, m/s.
        slip_speed: f64,
    },
    /// [`Bristle`]: a spring and a damper in series with a Coulomb slider; it sticks. Its deflection is integrated with the
    /// motion, in world axes, and projected onto the contact plane.
    Bristle {
        /// Stiffness, N/m.
        stiffness: f64,
        /// Damping, N s/m.
        damping: f64,
    },
}

impl std::fmt::Display for Compliance {
    /// Its forces with their parameters, as in a plan.
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let k = self.stiffness;
        match self.normal {
            Yielding::HuntCrossley { exponent, damping } => {
                let unit = if exponent == 1.0 { "N/m".to_owned() } else { format!("N/m^{exponent}") };
                write!(f, "hunt-crossley {k:e} {unit}, damping {}", damping.name())?;
            }
            Yielding::KelvinVoigt { pulls } => {
                write!(f, "kelvin-voigt {k:e} N/m{}", if pulls { ", may pull" } else { "" })?;
            }
            Yielding::WaltonBraun => write!(f, "walton-braun {k:e} N/m")?,
        }
        match self.tangential {
            Holding::Smoothed { slip_speed } => write!(f, "; friction smoothed below {slip_speed} m/s"),
            Holding::Bristle { stiffness, damping } => write!(f, "; bristle {stiffness:e} N/m, {damping} N s/m"),
        }
    }
}

/// The state of a compliant contact beside q and qd.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Memory {
    /// Damping of this contact: see [`NormalForce::damping`].
    pub damping: f64,
    /// Penetration at which it last changed from loading to unloading, m.
    pub deepest: f64,
    /// Deflection of the bristle, world, m.
    pub deflection: Vector3<f64>,
}

/// How far a compliant contact is from where its normal force vanishes: see [`Compliance::slack`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Slack {
    /// As a penetration, m.
    Depth(f64),
    /// As a velocity, m/s.
    Speed(f64),
}

impl Slack {
    pub fn value(self) -> f64 {
        let (Self::Depth(value) | Self::Speed(value)) = self;
        value
    }
}

/// What the slider of a bristle carries.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grip {
    /// The force at which the whole slip would bend the bristle, N, world.
    pub force: Vector3<f64>,
    /// The limit of friction, N, beyond which the slider slips.
    pub limit: f64,
}

impl Grip {
    /// What is left to the limit, N; negative where the slider slips.
    pub fn margin(&self) -> f64 {
        self.limit - self.force.norm()
    }

    /// The rounding of what is left, N.
    pub fn rounding(&self) -> f64 {
        EQUAL * (self.limit + self.force.norm())
    }

    /// The direction in which the slider slips, a unit vector, world; `None` where it holds.
    pub fn slips(&self) -> Option<Vector3<f64>> {
        self.force.try_normalize(self.limit)
    }
}

/// Force of a compliant contact, N, and rate of the bristle's deflection, m/s; world.
pub(crate) struct Pressed {
    pub force: Vector3<f64>,
    pub bends: Vector3<f64>,
}

impl Compliance {
    /// Hunt & Crossley's force with n = 1.5 and [`Damping::Exact`], and smoothed friction with v_s = 1 mm/s. `stiffness` is in
    /// N/m^1.5.
    pub const fn new(stiffness: f64) -> Self {
        let normal = Yielding::HuntCrossley { exponent: 1.5, damping: Damping::Exact };
        Self { stiffness, normal, tangential: Holding::Smoothed { slip_speed: 1e-3 } }
    }

    /// Whether its force depends on more than q, qd and the damping.
    pub(crate) fn has_memory(&self) -> bool {
        self.turns() || self.has_bristle()
    }

    /// Whether its force depends on the largest penetration.
    pub(crate) fn turns(&self) -> bool {
        self.normal == Yielding::WaltonBraun
    }

    /// Whether its normal force is no linear function of the penetration.
    pub(crate) fn is_curved(&self) -> bool {
        matches!(self.normal, Yielding::HuntCrossley { exponent, .. } if exponent != 1.0)
    }

    /// The slip speed, m/s, over which smoothed friction changes.
    pub(crate) fn slip_speed(&self) -> Option<f64> {
        if let Holding::Smoothed { slip_speed } = self.tangential { Some(slip_speed) } else { None }
    }

    pub(crate) fn has_bristle(&self) -> bool {
        matches!(self.tangential, Holding::Bristle { .. })
    }

    /// How far the contact is from where its normal force vanishes although it is not open, negative where it has vanished; `None` where that
    /// cannot be.
    ///
    /// | law | it vanishes at |
    /// | --- | --- |
    /// | Hunt & Crossley, a > 0 | ġ = 1/a: only if others pull the bodies apart |
    /// | Kelvin & Voigt, c > 0 | ġ = k d/c; with pull it changes its sign there, and friction ceases |
    /// | Walton & Braun, once unloaded, e < 1 | d = (1 − e²) D, the residual penetration |
    pub(crate) fn slack(&self, law: &ContactLaw, memory: &Memory, (gap, rate): (f64, f64)) -> Option<Slack> {
        let Memory { damping, deepest, .. } = *memory;
        match self.normal {
            Yielding::HuntCrossley { .. } if damping > 0.0 => Some(Slack::Speed(damping.recip() - rate)),
            Yielding::KelvinVoigt { pulls } if damping > 0.0 && (!pulls || law.friction() > 0.0) => {
                Some(Slack::Speed(-gap * self.stiffness / damping - rate))
            }
            Yielding::WaltonBraun if deepest.is_finite() && law.restitution() < 1.0 => {
                Some(Slack::Depth(-gap - (1.0 - law.restitution().powi(2)) * deepest))
            }
            _ => None,
        }
    }

    /// What the slider of the bristle carries; `None` without friction by a bristle.
    pub(crate) fn grip(
        &self,
        law: &ContactLaw,
        memory: &Memory,
        (gap, rate): (f64, f64),
        normal: &Vector3<f64>,
        u: &Vector3<f64>,
    ) -> Result<Option<Grip>, SimError> {
        let Holding::Bristle { stiffness, damping } = self.tangential else { return Ok(None) };
        if law.friction() == 0.0 {
            return Ok(None);
        }
        let size = self.size(law, memory, (gap, rate))?;
        let bent = memory.deflection * stiffness + u * damping;
        Ok(Some(Grip { force: bent - normal * normal.dot(&bent), limit: law.friction() * size.max(0.0) }))
    }

    /// The normal force law for a restitution.
    pub(crate) fn normal(&self, restitution: f64) -> Result<NormalForce, ImpactError> {
        let k = self.stiffness;
        Ok(match self.normal {
            Yielding::HuntCrossley { exponent, damping } => NormalForce::HuntCrossley(HuntCrossley {
                formula: damping,
                ..HuntCrossley::new(k, exponent, restitution)?
            }),
            Yielding::KelvinVoigt { pulls } => {
                NormalForce::KelvinVoigt(KelvinVoigt { pulls, ..KelvinVoigt::new(k, restitution)? })
            }
            Yielding::WaltonBraun => NormalForce::WaltonBraun(WaltonBraun::new(k, restitution)?),
        })
    }

    /// The tangential force law for a coefficient of friction.
    pub(crate) fn tangential(&self, friction: f64) -> Result<TangentialForce, ImpactError> {
        Ok(match self.tangential {
            Holding::Smoothed { slip_speed } => TangentialForce::Smoothed(SmoothedCoulomb::new(friction, slip_speed)?),
            Holding::Bristle { stiffness, damping } => {
                TangentialForce::Bristle(Bristle::new(friction, stiffness, damping)?)
            }
        })
    }

    /// # Errors
    /// [`SimError::Contact`] with the touch's name.
    pub(crate) fn check(&self, law: &ContactLaw, touch: &str) -> Result<(), SimError> {
        let named = |error| match error {
            ImpactError::Compliance { what, value, rule } => {
                SimError::Contact { touch: touch.into(), what, value, rule }
            }
            other => other.into(),
        };
        self.normal(law.restitution()).map_err(named)?;
        self.tangential(law.friction()).map(drop).map_err(named)
    }

    /// The normal force, N.
    fn size(&self, law: &ContactLaw, memory: &Memory, (gap, rate): (f64, f64)) -> Result<f64, SimError> {
        // Rounding and the last step of a contact reach beyond d = 0: without a jump of the dashpot's force there.
        let penetration = (-gap).max(f64::MIN_POSITIVE);
        let force = self.normal(law.restitution())?;
        let at = |depth: f64| force.force(depth, -rate, memory.damping, memory.deepest);
        // Until the event that ends it, an unloading goes on along its line, also beyond where it began.
        let beyond = penetration - memory.deepest;
        let unloads = self.turns() && memory.deepest.is_finite() && beyond > 0.0;
        Ok(if unloads { 2.0 * at(memory.deepest) - at(memory.deepest - beyond) } else { at(penetration) })
    }

    /// The force on the robot for a gap, its rate, and the velocity `u` relative to the surface.
    pub(crate) fn press(
        &self,
        law: &ContactLaw,
        memory: &Memory,
        (gap, rate): (f64, f64),
        normal: &Vector3<f64>,
        u: &Vector3<f64>,
    ) -> Result<Pressed, SimError> {
        let along = |v: &Vector3<f64>| v - normal * normal.dot(v);
        let size = self.size(law, memory, (gap, rate))?;
        let (law, slip, deflection) = (self.tangential(law.friction())?, along(u), along(&memory.deflection));
        let force = normal * size + law.force(&deflection, &slip, size);
        Ok(Pressed { force, bends: law.rate(&deflection, &slip, size) })
    }
}
