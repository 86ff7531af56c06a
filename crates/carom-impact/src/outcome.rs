//! What an impact did: impulse, velocities, mode, energy books, realised coefficients.

use std::fmt;

use nalgebra::{RealField, SVector, convert};

use crate::problem::{plain, rounding};
use crate::{Flags, ImpactError, ImpactProblem};

/// Energy gain below this multiple of ε, beside the energies that passed, is rounding.
const GAIN: f64 = 64.0;

/// Grazing: approach slower than this share of the contact speed.
const GRAZING: f64 = 1e-9;

/// The answer of one law to one [`ImpactProblem`]. Contact axes, SI units, impulse on the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImpactOutcome<T, const D: usize> {
    /// Name of the law that answered.
    pub law: &'static str,
    /// Impulse on the robot (N s).
    pub impulse: SVector<T, D>,
    /// Contact velocity before (m/s).
    pub u_minus: SVector<T, D>,
    /// Contact velocity after (m/s): `u⁻ + H P`, but a component the law drives to zero is zero.
    pub u_plus: SVector<T, D>,
    /// How the contact moved when it parted.
    pub mode: Mode,
    /// Contact-space kinetic energy before (J), see [`ImpactProblem::kinetic_energy`].
    pub energy_before: T,
    /// Contact-space kinetic energy after (J).
    pub energy_after: T,
    /// `½ P·(u⁻ + u⁺)` (J): the energy the impulse brought; negative is loss.
    pub energy_change: T,
    /// `∫ v_n dp_n` over the whole impact (J).
    pub normal_work: T,
    /// `∫ v_t·dp_t` over the whole impact (J).
    pub friction_work: T,
    /// Realised kinematic coefficient `-v_n⁺/v_n⁻`; `None` without an impact, or without approach before it.
    pub newton: Option<T>,
    /// Realised kinetic coefficient: impulse of restitution over impulse of compression. `None` without an impact, or
    /// where a law without a path had no approach.
    pub poisson: Option<T>,
    /// Realised energetic coefficient: root of the normal work returned over the work put in. `None` as above.
    pub energetic: Option<T>,
    /// Phase in which the first slip stopped; `None` if it never did or never began. Friction-free
    /// and algebraic laws follow no path in time and leave it `None`.
    pub slip_end: Option<Phase>,
    /// Normal impulse at which that slip stopped (N s).
    pub slip_stop: Option<T>,
    /// Warnings.
    pub flags: Flags,
}

impl<T: RealField + Copy, const D: usize> ImpactOutcome<T, D> {
    /// `T⁺/T⁻` of the contact-space energies; 1 if there was none before.
    pub fn energy_ratio(&self) -> T {
        if self.energy_before == T::zero() { T::one() } else { self.energy_after / self.energy_before }
    }

    /// This outcome, unless numbers too large or too small have spoilt it.
    pub(crate) fn if_finite(self) -> Result<Self, ImpactError> {
        match self.impulse.iter().chain(self.u_plus.iter()).find(|value| !value.is_finite()) {
            Some(&value) => Err(ImpactError::NotFinite { entry: "the impulse".into(), value: plain(value) }),
            None => Ok(self),
        }
    }

    /// Nothing happens: the contact does not approach.
    pub(crate) fn none(law: &'static str, problem: &ImpactProblem<T, D>, flags: Flags) -> Self {
        let u = *problem.u_minus();
        let energy = problem.kinetic_energy(&u);
        Self {
            law,
            impulse: SVector::zeros(),
            u_minus: u,
            u_plus: u,
            mode: Mode::Open,
            energy_before: energy,
            energy_after: energy,
            energy_change: T::zero(),
            normal_work: T::zero(),
            friction_work: T::zero(),
            newton: None,
            poisson: None,
            energetic: None,
            slip_end: None,
            slip_stop: None,
            flags: flags | Flags::NO_APPROACH,
        }
    }

    /// Adds to an answer what every law reports alike: energies, and the flags they imply.
    pub(crate) fn of(
        law: &'static str,
        problem: &ImpactProblem<T, D>,
        impulse: SVector<T, D>,
        u_plus: SVector<T, D>,
        account: &Account<T>,
    ) -> Self {
        let u_minus = *problem.u_minus();
        let half: T = convert(0.5);
        let energy_before = problem.kinetic_energy(&u_minus);
        let energy_change = impulse.dot(&(u_minus + u_plus)) * half;
        // ½ P·(u⁻ + u⁺) may be the small difference of large terms: its rounding is theirs.
        let passed = impulse.abs().dot(&(u_minus.abs() + u_plus.abs())) * half;
        let gains = energy_change > (energy_before + passed) * rounding(GAIN);
        let v_n = problem.approach_speed();
        let grazes = v_n * v_n < u_minus.norm_squared() * convert(GRAZING * GRAZING);
        Self {
            law,
            impulse,
            u_minus,
            u_plus,
            mode: account.mode,
            energy_before,
            energy_after: problem.kinetic_energy(&u_plus),
            energy_change,
            normal_work: account.normal_work,
            friction_work: account.friction_work,
            newton: account.newton,
            poisson: account.poisson,
            energetic: account.energetic,
            slip_end: account.slip_end,
            slip_stop: account.slip_stop,
            flags: account.flags
                | Flags::ENERGY_GAIN.when(gains)
                | Flags::GRAZING.when(grazes)
                | Flags::SINGULAR.when(problem.normal_is_doubtful()),
        }
    }
}

/// What a law tells beside impulse and velocity.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Account<T> {
    pub normal_work: T,
    pub friction_work: T,
    pub newton: Option<T>,
    pub poisson: Option<T>,
    pub energetic: Option<T>,
    pub mode: Mode,
    pub slip_end: Option<Phase>,
    pub slip_stop: Option<T>,
    pub flags: Flags,
}

impl<T: RealField + Copy> Account<T> {
    /// The account of a law without a path in time: that of the straight one from u⁻ to u⁺, on which all three
    /// realised coefficients are `e = -u_n⁺/u_n⁻`; without approach there are none.
    pub fn straight<const D: usize>(
        e: T,
        impulse: &SVector<T, D>,
        u_minus: &SVector<T, D>,
        u_plus: &SVector<T, D>,
    ) -> Self {
        let n = D - 1;
        let half: T = convert(0.5);
        let mean = (u_minus + u_plus) * half;
        let normal_work = impulse[n] * mean[n];
        let e = (u_minus[n] != T::zero()).then_some(e);
        Self {
            normal_work,
            friction_work: impulse.dot(&mean) - normal_work,
            newton: e,
            poisson: e,
            energetic: e,
            mode: Mode::between(u_minus, u_plus),
            slip_end: None,
            slip_stop: None,
            flags: Flags::NONE,
        }
    }
}

/// How the contact moved along its tangent when it parted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Mode {
    /// No impact took place.
    Open,
    /// No slip.
    Stick,
    /// Slip in the first direction; in space, not more than a right angle from it.
    Slip,
    /// Slip against the first direction; in space, more than a right angle from it.
    ReverseSlip,
}

impl Mode {
    /// As the slips before and after tell it.
    pub(crate) fn between<T: RealField + Copy, const D: usize>(
        u_minus: &SVector<T, D>,
        u_plus: &SVector<T, D>,
    ) -> Self {
        let n = D - 1;
        let slips = |u: &SVector<T, D>| (0..n).any(|i| u[i] != T::zero());
        let dot = (0..n).fold(T::zero(), |sum, i| sum + u_minus[i] * u_plus[i]);
        if !slips(u_plus) {
            Self::Stick
        } else if dot < T::zero() {
            Self::ReverseSlip
        } else {
            Self::Slip
        }
    }

    /// Kebab-case name.
    ///
    /// ```
    /// # use carom_impact::Mode;
    /// assert_eq!(Mode::ReverseSlip.name(), "reverse-slip");
    /// ```
    pub const fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Stick => "stick",
            Self::Slip => "slip",
            Self::ReverseSlip => "reverse-slip",
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The two halves of an impact, parted by the instant at which `v_n = 0`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Phase {
    /// The bodies still approach.
    Compression,
    /// The bodies part.
    Restitution,
}

impl Phase {
    /// Lower-case name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Compression => "compression",
            Self::Restitution => "restitution",
        }
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
