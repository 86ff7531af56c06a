//! Outcome of an impact: impulse, velocities, mode, energy balance, realised coefficients.

use std::fmt;
use std::ops::{Deref, DerefMut};

use nalgebra::{RealField, SVector, Vector2, Vector3, convert};

use crate::check::{check, is_clear};
use crate::problem::plain;
use crate::rounding::{CANCELLED, rounding};
use crate::{Flags, ImpactError, ImpactProblem};

/// An approach slower than this share of the contact speed is flagged as grazing.
const GRAZING: f64 = 1e-9;

/// Outcome of one law for one [`ImpactProblem`]. Contact axes, SI units, impulse on the robot. It dereferences to its
/// [`Account`], so that `hit.mode` is `hit.account.mode`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImpactOutcome<T, const D: usize> {
    /// Name of the law.
    pub law: &'static str,
    /// Impulse on the robot (N s).
    pub impulse: SVector<T, D>,
    /// Contact velocity before (m/s).
    pub u_minus: SVector<T, D>,
    /// Contact velocity after (m/s): `u⁻ + H P`. A component that the law drives to zero is exactly zero.
    pub u_plus: SVector<T, D>,
    /// Kinetic energy in contact space before (J), see [`ImpactProblem::kinetic_energy`].
    pub energy_before: T,
    /// Kinetic energy in contact space after (J).
    pub energy_after: T,
    /// Work of the impulse, `½ P·(u⁻ + u⁺)` (J); negative is a loss.
    pub energy_change: T,
    /// Mode, works, realised coefficients and flags.
    pub account: Account<T>,
}

/// What a law reports beside impulse and velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Account<T> {
    /// Tangential motion at the end of the impact.
    pub mode: Mode,
    /// `∫ v_n dp_n` over the whole impact (J).
    pub normal_work: T,
    /// `∫ v_t·dp_t` over the whole impact (J).
    pub friction_work: T,
    /// Realised kinematic coefficient `-v_n⁺/v_n⁻`; `None` without an impact or without approach.
    pub newton: Option<T>,
    /// Realised kinetic coefficient: impulse of restitution divided by impulse of compression. `None` without an
    /// impact, and without approach for a law that has no path in time.
    pub poisson: Option<T>,
    /// Realised energetic coefficient: square root of the normal work returned in restitution divided by that absorbed
    /// in compression. `None` as for `poisson`.
    pub energetic: Option<T>,
    /// Phase in which the initial slip stopped; `None` if there was none or it did not stop.
    /// [`Frictionless`](crate::Frictionless) and the algebraic laws have no path in time and always return `None`.
    pub slip_end: Option<Phase>,
    /// Normal impulse at which the initial slip stopped (N s).
    pub slip_stop: Option<T>,
    /// Warnings.
    pub flags: Flags,
}

impl<T, const D: usize> Deref for ImpactOutcome<T, D> {
    type Target = Account<T>;

    fn deref(&self) -> &Account<T> {
        &self.account
    }
}

impl<T, const D: usize> DerefMut for ImpactOutcome<T, D> {
    fn deref_mut(&mut self) -> &mut Account<T> {
        &mut self.account
    }
}

/// No law and no motion.
impl<T: RealField + Copy, const D: usize> Default for ImpactOutcome<T, D> {
    fn default() -> Self {
        let (none, zero) = (SVector::zeros(), T::zero());
        Self {
            law: "",
            impulse: none,
            u_minus: none,
            u_plus: none,
            energy_before: zero,
            energy_after: zero,
            energy_change: zero,
            account: Account::default(),
        }
    }
}

/// No impact.
impl<T: RealField + Copy> Default for Account<T> {
    fn default() -> Self {
        Self {
            mode: Mode::Open,
            normal_work: T::zero(),
            friction_work: T::zero(),
            newton: None,
            poisson: None,
            energetic: None,
            slip_end: None,
            slip_stop: None,
            flags: Flags::NONE,
        }
    }
}

impl<T: RealField + Copy> ImpactOutcome<T, 2> {
    /// The same outcome in contact axes of space, in which `tangent` has the components of the tangent of the plane (unit).
    #[inline(always)]
    pub fn in_space(&self, tangent: Vector2<T>) -> ImpactOutcome<T, 3> {
        let lift = |x: &Vector2<T>| Vector3::new(tangent.x * x.x, tangent.y * x.x, x.y);
        let Self { law, impulse, u_minus, u_plus, energy_before, energy_after, energy_change, account } = self;
        ImpactOutcome {
            law,
            impulse: lift(impulse),
            u_minus: lift(u_minus),
            u_plus: lift(u_plus),
            energy_before: *energy_before,
            energy_after: *energy_after,
            energy_change: *energy_change,
            account: *account,
        }
    }
}

impl<T: RealField + Copy, const D: usize> ImpactOutcome<T, D> {
    /// `T⁺/T⁻` of the kinetic energies in contact space; 1 if `T⁻ = 0`.
    pub fn energy_ratio(&self) -> T {
        if self.energy_before == T::zero() { T::one() } else { self.energy_after / self.energy_before }
    }

    /// The outcome of a user's own law that returns an impulse: velocity after, energies, mode and flags follow from it. The
    /// works and the realised coefficients are those of the straight path of the velocity from u⁻ to u⁺.
    ///
    /// ```
    /// use carom_impact::{ImpactError, ImpactOutcome, ImpactProblem, Law, Mode};
    /// use nalgebra::{matrix, vector};
    ///
    /// /// The contact stops: u⁺ = 0.
    /// struct Sticky;
    /// impl Law<f64, 2> for Sticky {
    ///     fn name(&self) -> &'static str {
    ///         "sticky"
    ///     }
    ///     fn resolve(&self, problem: &ImpactProblem<f64, 2>) -> Result<ImpactOutcome<f64, 2>, ImpactError> {
    ///         let inverse = problem.delassus().try_inverse().unwrap_or_default();
    ///         ImpactOutcome::of_impulse(self.name(), problem, -inverse * problem.u_minus())
    ///     }
    /// }
    ///
    /// let problem = ImpactProblem::new(matrix![2.0, 0.0; 0.0, 1.0], vector![1.0_f64, -2.0])?;
    /// let hit = Sticky.resolve(&problem)?;
    /// assert_eq!((hit.mode, hit.energy_after), (Mode::Stick, 0.0));
    /// assert_eq!((hit.normal_work, hit.friction_work), (-2.0, -0.25));
    /// # Ok::<(), ImpactError>(())
    /// ```
    ///
    /// # Errors
    /// [`ImpactError::NotFinite`]: the impulse, or the velocity after it, is not finite. [`ImpactError::Outcome`]: the contact
    /// still approaches after the impulse.
    pub fn of_impulse(
        law: &'static str,
        problem: &ImpactProblem<T, D>,
        impulse: SVector<T, D>,
    ) -> Result<Self, ImpactError> {
        let (n, u_minus) = (D - 1, *problem.u_minus());
        if impulse.iter().all(|p| *p == T::zero()) && problem.approach_speed() <= T::zero() {
            return Ok(Self::none(law, problem, Flags::NONE));
        }
        let u_plus = u_minus + problem.delassus() * impulse;
        let account = Account::straight(-u_plus[n] / u_minus[n], &impulse, &u_minus, &u_plus);
        Self::of(law, problem, impulse, u_plus, account, None)
    }

    /// The outcome without an impact: the contact does not approach.
    pub(crate) fn none(law: &'static str, problem: &ImpactProblem<T, D>, flags: Flags) -> Self {
        let u = *problem.u_minus();
        let energy = problem.kinetic_energy(&u);
        let account = Account { flags: flags | Flags::NO_APPROACH, ..Account::default() };
        Self { law, u_minus: u, u_plus: u, energy_before: energy, energy_after: energy, account, ..Self::default() }
    }

    /// Completes the result of a law with the energies and the flags that follow from them, and checks it (`check.rs`), with
    /// the coefficient of friction in whose `cone` the impulse is. It also fails if the impulse, the velocity after or an energy is
    /// not finite: where energies overflow, so do the works by which a law decides.
    #[inline(always)]
    pub(crate) fn of(
        law: &'static str,
        problem: &ImpactProblem<T, D>,
        impulse: SVector<T, D>,
        u_plus: SVector<T, D>,
        account: Account<T>,
        cone: Option<T>,
    ) -> Result<Self, ImpactError> {
        let energies = problem.kinetic_energies([*problem.u_minus(), u_plus]);
        Self::with_energies(law, problem, (impulse, u_plus), energies, account, cone)
    }

    /// [`Self::of`] with the kinetic energies before and after.
    #[inline(always)]
    pub(crate) fn with_energies(
        law: &'static str,
        problem: &ImpactProblem<T, D>,
        (impulse, u_plus): (SVector<T, D>, SVector<T, D>),
        [energy_before, energy_after]: [T; 2],
        mut account: Account<T>,
        cone: Option<T>,
    ) -> Result<Self, ImpactError> {
        let u_minus = *problem.u_minus();
        let half: T = convert(0.5);
        let energy_change = impulse.dot(&(u_minus + u_plus)) * half;
        // ½ P·(u⁻ + u⁺) may be a small difference of large terms, which determine its rounding error.
        let passed = || impulse.abs().dot(&(u_minus.abs() + u_plus.abs())) * half;
        let gains = energy_change > T::zero() && energy_change > (energy_before + passed()) * rounding(CANCELLED);
        let v_n = problem.approach_speed();
        let grazes = v_n * v_n < u_minus.norm_squared() * convert(GRAZING * GRAZING);
        account.flags |= Flags::ENERGY_GAIN.when(gains)
            | Flags::GRAZING.when(grazes)
            | Flags::SINGULAR.when(problem.normal_is_doubtful());
        let hit = Self { law, impulse, u_minus, u_plus, energy_before, energy_after, energy_change, account };
        if !is_clear(problem, &hit, cone) {
            check(problem, &hit, cone)?;
        }
        Ok(hit)
    }
}

/// Fails if a number is not finite: at speeds of 1e150 m/s works overflow, and with them the choices of a law.
#[inline(always)]
pub(crate) fn finite<'a, T: RealField + Copy>(
    entry: &'static str,
    numbers: impl IntoIterator<Item = &'a T>,
) -> Result<(), ImpactError> {
    match numbers.into_iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(ImpactError::NotFinite { entry: entry.into(), value: plain(value) }),
        None => Ok(()),
    }
}

impl<T: RealField + Copy> Account<T> {
    /// Without derivatives.
    pub(crate) fn plain(&self) -> Account<f64> {
        Account {
            normal_work: plain(self.normal_work),
            friction_work: plain(self.friction_work),
            newton: self.newton.map(plain),
            poisson: self.poisson.map(plain),
            energetic: self.energetic.map(plain),
            mode: self.mode,
            slip_end: self.slip_end,
            slip_stop: self.slip_stop.map(plain),
            flags: self.flags,
        }
    }

    /// For a law without a path in time: works and coefficients of the straight path from u⁻ to u⁺, on which all three
    /// realised coefficients are `e = -u_n⁺/u_n⁻`; without approach they are `None`.
    pub(crate) fn straight<const D: usize>(
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
            ..Self::default()
        }
    }
}

/// Tangential motion of the contact at the end of the impact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Mode {
    /// No impact took place.
    Open,
    /// No slip.
    Stick,
    /// Slip in the initial direction; in space, at most a right angle from it.
    Slip,
    /// Slip opposite to the initial direction; in space, more than a right angle from it.
    ReverseSlip,
}

impl Mode {
    /// All modes, in the order of their numbers, `mode as usize`.
    pub const ALL: [Self; 4] = [Self::Open, Self::Stick, Self::Slip, Self::ReverseSlip];

    /// The mode that follows from the slips before and after.
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

/// The two phases of an impact, separated by the instant at which `v_n = 0`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Phase {
    /// The contact approaches, `v_n < 0`.
    Compression,
    /// The contact separates, `v_n > 0`.
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
