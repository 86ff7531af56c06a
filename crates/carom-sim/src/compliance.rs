//! Contacts that give way: which forces, and what they remember while they last.

use carom_impact::{
    Bristle, Damping, HuntCrossley, ImpactError, KelvinVoigt, NormalForce, SmoothedCoulomb, TangentialForce,
    WaltonBraun,
};
use nalgebra::Vector3;

use crate::error::SimError;
use crate::touch::ContactRule;

/// A contact that gives way: stiffness, and what the forces do with it. Restitution and friction are those of the
/// [`ContactRule`].
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
    /// [`HuntCrossley`]: k dⁿ (1 + a ḋ). Its rebound is `restitution` times the approach, exactly, if damped so.
    HuntCrossley {
        /// n: 1.5 for round bodies, 1 for flat ones.
        exponent: f64,
        /// How a follows from the restitution.
        damping: Damping,
    },
    /// [`KelvinVoigt`]: k d + c ḋ, with the c that gives the mass at first touch its restitution.
    KelvinVoigt {
        /// Whether it pulls while the bodies part.
        pulls: bool,
    },
    /// [`WaltonBraun`]: k d, and back along a steeper line; the restitution is energetic.
    WaltonBraun,
}

/// The tangential force of a compliant contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Holding {
    /// [`SmoothedCoulomb`]: −μ Fₙ tanh(|v|/v_s) v/|v|. It creeps.
    Smoothed {
        /// v_s, m/s.
        slip_speed: f64,
    },
    /// [`Bristle`]: it sticks. Its deflection is integrated with the motion, in world axes, and follows the plane of
    /// contact by projection.
    Bristle {
        /// N/m.
        stiffness: f64,
        /// N s/m.
        damping: f64,
    },
}

/// What a touch that presses remembers.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Memory {
    /// Of this touch: see [`NormalForce::damping`].
    pub damping: f64,
    /// Where it was last turned back, m.
    pub deepest: f64,
    /// Of the bristle, world, m.
    pub deflection: Vector3<f64>,
}

/// Force of a touch that presses, and rate of the bristle's deflection; world.
pub(crate) struct Pressed {
    pub force: Vector3<f64>,
    pub bends: Vector3<f64>,
}

impl Compliance {
    /// Approaches slower than this are damped as at this speed, m/s: Hunt & Crossley's damping grows as 1/speed.
    pub(crate) const SLOWEST: f64 = 1e-3;

    /// A contact of round bodies: Hunt & Crossley's force with n = 1.5, damped exactly, and friction smoothed below
    /// 1 mm/s.
    pub const fn new(stiffness: f64) -> Self {
        let normal = Yielding::HuntCrossley { exponent: 1.5, damping: Damping::Exact };
        Self { stiffness, normal, tangential: Holding::Smoothed { slip_speed: 1e-3 } }
    }

    /// Whether its force depends on more than the state of motion.
    pub(crate) fn has_memory(&self) -> bool {
        self.turns() || self.has_bristle()
    }

    /// Whether it remembers where it was turned back.
    pub(crate) fn turns(&self) -> bool {
        self.normal == Yielding::WaltonBraun
    }

    pub(crate) fn has_bristle(&self) -> bool {
        matches!(self.tangential, Holding::Bristle { .. })
    }

    /// The normal force for a restitution.
    pub(crate) fn normal(&self, restitution: f64) -> Result<NormalForce, ImpactError> {
        let k = self.stiffness;
        Ok(match self.normal {
            Yielding::HuntCrossley { exponent, damping } => {
                NormalForce::HuntCrossley(HuntCrossley::new(k, exponent, restitution)?.damped_after(damping))
            }
            Yielding::KelvinVoigt { pulls } => {
                NormalForce::KelvinVoigt(KelvinVoigt { pulls, ..KelvinVoigt::new(k, restitution)? })
            }
            Yielding::WaltonBraun => NormalForce::WaltonBraun(WaltonBraun::new(k, restitution)?),
        })
    }

    /// The tangential force for a friction.
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
    pub(crate) fn check(&self, rule: &ContactRule, touch: &str) -> Result<(), SimError> {
        let named = |error| match error {
            ImpactError::Compliance { what, value, rule } => {
                SimError::Contact { touch: touch.into(), what, value, rule }
            }
            other => other.into(),
        };
        self.normal(rule.restitution).map_err(named)?;
        self.tangential(rule.friction).map(drop).map_err(named)
    }

    /// The force on the robot for a gap, its rate, and the velocity `u` over the surface.
    pub(crate) fn press(
        &self,
        rule: &ContactRule,
        memory: &Memory,
        (gap, rate): (f64, f64),
        normal: &Vector3<f64>,
        u: &Vector3<f64>,
    ) -> Result<Pressed, SimError> {
        let along = |v: &Vector3<f64>| v - normal * normal.dot(v);
        let size = self.normal(rule.restitution)?.force(-gap, -rate, memory.damping, memory.deepest);
        let (law, slip, deflection) = (self.tangential(rule.friction)?, along(u), along(&memory.deflection));
        let force = normal * size + law.force(&deflection, &slip, size);
        Ok(Pressed { force, bends: law.rate(&deflection, &slip, size) })
    }
}
