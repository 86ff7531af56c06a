//! Compliant contacts: they have a force, a duration and a penetration, where a rigid contact has an impulse.
//!
//! | normal force | its coefficient | rebound | fails |
//! |---|---|---|---|
//! | [`HuntCrossley`] `k dⁿ (1 + a w)` | a ratio of velocities | exact, at every speed | damping is set by the approach velocity at first touch |
//! | [`KelvinVoigt`] `k d + c w` | a ratio of velocities | exact, for the mass at first touch | the force jumps |
//! | [`WaltonBraun`] `k d`, then steeper | **energetic** | exact, with any other forces | does not damp a resting contact |
//!
//! | tangential force | sticks | memory |
//! |---|---|---|
//! | [`SmoothedCoulomb`] | no: it creeps | none |
//! | [`Bristle`] | yes, after a small elastic displacement | its deflection |
//!
//! All forces are passive, each by itself: friction for any history of the normal force. [`compliant_impact`]
//! integrates an impact in a fixed configuration with them.

mod blow;
mod damping;
mod friction;
mod hunt_crossley;
mod kelvin_voigt;
mod walton_braun;

pub use blow::{CompliantOutcome, Pressed, compliant_impact};
pub use damping::{Damping, restitution_obtained};
pub use friction::{Bristle, SmoothedCoulomb};
pub use hunt_crossley::{HuntCrossley, RoundBody, hertz_stiffness};
pub use kelvin_voigt::KelvinVoigt;
pub use walton_braun::WaltonBraun;

use nalgebra::SVector;

use crate::ImpactError;

/// One of the normal forces.
///
/// During a contact the damping is constant, set at first touch. The force may depend on a memory, the penetration at
/// which the closing velocity last became zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NormalForce {
    /// The force of Hunt & Crossley; with e = 1 that of Hertz.
    HuntCrossley(HuntCrossley),
    /// A spring and a dashpot in parallel.
    KelvinVoigt(KelvinVoigt),
    /// A spring that unloads along a steeper line.
    WaltonBraun(WaltonBraun),
}

impl NormalForce {
    /// Names that [`NormalForce::name`] returns.
    pub const NAMES: [&str; 3] = ["hunt-crossley", "kelvin-voigt", "walton-braun"];

    /// Kebab-case name.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::HuntCrossley(_) => Self::NAMES[0],
            Self::KelvinVoigt(_) => Self::NAMES[1],
            Self::WaltonBraun(_) => Self::NAMES[2],
        }
    }

    /// The damping of a contact that first touches at `approach_speed` (m/s) with an `effective_mass` (kg): s/m for
    /// [`HuntCrossley`], N s/m for [`KelvinVoigt`], 0 for [`WaltonBraun`].
    pub fn damping(&self, approach_speed: f64, effective_mass: f64) -> f64 {
        match self {
            Self::HuntCrossley(law) => law.damping(approach_speed),
            Self::KelvinVoigt(law) => law.damping(effective_mass),
            Self::WaltonBraun(_) => 0.0,
        }
    }

    /// Whether the force depends on `deepest`.
    pub const fn has_memory(&self) -> bool {
        matches!(self, Self::WaltonBraun(_))
    }

    /// Normal force (N) at a `penetration` (m) that grows at `rate` (m/s), with the `damping` of this contact and the
    /// penetration `deepest` (m) at which it last turned back; 0 if it never did.
    pub fn force(&self, penetration: f64, rate: f64, damping: f64, deepest: f64) -> f64 {
        match self {
            Self::HuntCrossley(law) => law.force(penetration, rate, damping),
            Self::KelvinVoigt(law) => law.force(penetration, rate, damping),
            Self::WaltonBraun(law) => law.force(penetration, deepest),
        }
    }

    /// Largest penetration (m) of an impact at `approach_speed` (m/s) of an `effective_mass` (kg), in closed form.
    pub fn greatest_penetration(&self, approach_speed: f64, effective_mass: f64) -> f64 {
        match self {
            Self::HuntCrossley(law) => law.greatest_penetration(approach_speed, effective_mass),
            Self::KelvinVoigt(law) => law.greatest_penetration(approach_speed, effective_mass),
            Self::WaltonBraun(law) => law.greatest_penetration(approach_speed, effective_mass),
        }
    }
}

/// One of the tangential forces. Vectors are tangential, in any axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TangentialForce {
    /// No friction.
    Frictionless,
    /// Coulomb's friction, smoothed at small slip.
    Smoothed(SmoothedCoulomb),
    /// A bristle that bends, sticks and slides.
    Bristle(Bristle),
}

impl TangentialForce {
    /// Force on the robot (N) at a `slip` velocity (m/s), with the bristle's `deflection` (m; not used by the others).
    pub fn force<const N: usize>(
        &self,
        deflection: &SVector<f64, N>,
        slip: &SVector<f64, N>,
        normal_force: f64,
    ) -> SVector<f64, N> {
        match self {
            Self::Frictionless => SVector::zeros(),
            Self::Smoothed(law) => law.force(slip, normal_force),
            Self::Bristle(law) => law.force(deflection, slip, normal_force),
        }
    }

    /// Rate of the deflection (m/s); zero for forces without one.
    pub fn rate<const N: usize>(
        &self,
        deflection: &SVector<f64, N>,
        slip: &SVector<f64, N>,
        normal_force: f64,
    ) -> SVector<f64, N> {
        match self {
            Self::Frictionless | Self::Smoothed(_) => SVector::zeros(),
            Self::Bristle(law) => law.rate(deflection, slip, normal_force),
        }
    }
}

/// The rule of most parameters.
const POSITIVE: &str = "it must be finite and above 0";

fn check_positive(what: &'static str, value: f64, rule: &'static str) -> Result<(), ImpactError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(ImpactError::Compliance { what, value, rule }) }
}
