//! Derivatives of an impact with respect to H, u⁻, e and μ, computed with dual numbers through the laws; those of slip that
//! turns in space are integrals along its path (`flow/turn.rs`).
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | ∂P/∂u⁻ | D × D | (kg) | `velocity` |
//! | ∂P/∂H_ij | D | with respect to `H_ij` and `H_ji` together (kg² m/s) | [`Direction::delassus`] |
//! | ∂P/∂e, ∂P/∂μ | D | (N s) | `restitution`, `friction` |
//!
//! `u⁺ = u⁻ + H P`, so `δu⁺ = δu⁻ + δH P + H δP`.
//!
//! Derivatives are valid within a contact mode. At a mode boundary an impact is continuous, but has a kink
//! ([`ImpactProblem::boundaries`] returns the distances to the boundaries). There the derivative is that of one side;
//! [`ImpactProblem::one_sided`] returns both.

use nalgebra::{Const, SMatrix, SVector, U1};
use num_dual::DualSVec64;

use crate::flow::Found;
use crate::laws::AnyLaw;
use crate::{Coefficients, Frictionless, ImpactError, ImpactOutcome, ImpactProblem, LAW_NAMES, Law, Mode, Phase};

/// The value that represents a friction of zero from the right; smaller than any rounding error.
const HARDLY_ANY: f64 = 1e-30;

/// A direction in which the inputs of an impact change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction<const D: usize> {
    /// Change of the Delassus matrix, symmetric (1/kg).
    pub delassus: SMatrix<f64, D, D>,
    /// Change of the velocity before the impact (m/s).
    pub u_minus: SVector<f64, D>,
    /// Change of the coefficient of restitution.
    pub restitution: f64,
    /// Change of the coefficient of friction.
    pub friction: f64,
}

impl<const D: usize> Default for Direction<D> {
    fn default() -> Self {
        Self { delassus: SMatrix::zeros(), u_minus: SVector::zeros(), restitution: 0.0, friction: 0.0 }
    }
}

/// An outcome with its derivatives. Contact axes, SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawDerivative<const D: usize> {
    /// The outcome.
    pub outcome: ImpactOutcome<f64, D>,
    /// ∂P/∂u⁻ (kg).
    pub velocity: SMatrix<f64, D, D>,
    /// ∂P/∂e (N s).
    pub restitution: SVector<f64, D>,
    /// ∂P/∂μ (N s); at μ = 0 the derivative from the right.
    pub friction: SVector<f64, D>,
    /// With respect to `H_ij` and `H_ji` together, for i <= j.
    delassus: [[SVector<f64, D>; D]; D],
    matrix: SMatrix<f64, D, D>,
}

impl<const D: usize> LawDerivative<D> {
    /// δP for a change of the inputs (N s).
    pub fn impulse(&self, along: &Direction<D>) -> SVector<f64, D> {
        let mut sum =
            self.velocity * along.u_minus + self.restitution * along.restitution + self.friction * along.friction;
        for i in 0..D {
            for j in i..D {
                sum += self.delassus[i][j] * along.delassus[(i, j)];
            }
        }
        sum
    }

    /// δu⁺ for a change of the inputs (m/s).
    pub fn u_plus(&self, along: &Direction<D>) -> SVector<f64, D> {
        along.u_minus + along.delassus * self.outcome.impulse + self.matrix * self.impulse(along)
    }
}

/// The derivative on one side of a problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Side<const D: usize> {
    /// dP along the direction (N s).
    pub impulse: SVector<f64, D>,
    /// du⁺ along the direction (m/s).
    pub u_plus: SVector<f64, D>,
    /// The mode on this side.
    pub mode: Mode,
    /// The phase in which slip stops on this side.
    pub slip_end: Option<Phase>,
}

/// Derivatives along a direction on both sides of a problem; equal where the impact is smooth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OneSided<const D: usize> {
    /// The derivative on the side opposite to the direction; `None` if there is no outcome on that side (μ < 0, e
    /// outside \[0, 1\], a singular normal direction).
    pub behind: Option<Side<D>>,
    /// The derivative on the side of the direction; `None` as for `behind`.
    pub ahead: Option<Side<D>>,
}

impl<const D: usize> OneSided<D> {
    /// Whether both sides exist and their derivatives of P differ by more than 1e-6 of the larger one.
    pub fn is_kink(&self) -> bool {
        let (Some(behind), Some(ahead)) = (&self.behind, &self.ahead) else { return false };
        let size = behind.impulse.amax().max(ahead.impulse.amax());
        (behind.impulse - ahead.impulse).amax() > 1e-6 * size
    }
}

impl<const D: usize> ImpactProblem<f64, D> {
    /// The outcome under a law with its derivatives with respect to H, u⁻, e and μ.
    ///
    /// On a mode boundary the derivative is that of the mode of the outcome. Without approach impulse and derivative
    /// are zero, even at `u_n = 0`, where the other side is an impact.
    ///
    /// ```
    /// # use carom_impact::{Direction, ImpactProblem, Energetic};
    /// # use nalgebra::{matrix, vector};
    /// let problem = ImpactProblem::new(
    ///     matrix![2.440338045696, 1.521308658011; 1.521308658011, 1.009560290504],
    ///     vector![-0.267174342835, -0.134202014333],
    /// )?;
    /// let derivative = problem.differentiate(&Energetic { restitution: 0.5, friction: 0.5 })?;
    /// let by_restitution = derivative.u_plus(&Direction { restitution: 1.0, ..Direction::default() });
    /// assert!((by_restitution - vector![0.03519218, 0.02908798]).amax() < 1e-8);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`Law::resolve`]; [`ImpactError::NotDifferentiable`] for a user-defined law.
    pub fn differentiate(&self, law: &dyn Law<f64, D>) -> Result<LawDerivative<D>, ImpactError> {
        let law = known(law)?;
        // Entries of H and u, e and μ: one lane each.
        match D {
            1 => self.derive::<4>(&law),
            2 => self.derive::<7>(&law),
            _ => self.derive::<11>(&law),
        }
    }

    /// [`Self::differentiate`] with the number of inputs.
    fn derive<const LANES: usize>(&self, law: &AnyLaw) -> Result<LawDerivative<D>, ImpactError> {
        let Coefficients { restitution, friction, tangential_restitution } = law.coefficients();
        let plain = |x: f64| DualSVec64::<LANES>::from_re(x);
        let mut lane = 0;
        let mut seeded = |x: f64| {
            lane += 1;
            plain(x).derivative(lane - 1)
        };
        let mut delassus = SMatrix::<DualSVec64<LANES>, D, D>::from_element(plain(0.0));
        for i in 0..D {
            for j in i..D {
                let entry = seeded(self.delassus()[(i, j)]);
                (delassus[(i, j)], delassus[(j, i)]) = (entry, entry);
            }
        }
        let mut u = SVector::<DualSVec64<LANES>, D>::from_element(plain(0.0));
        for i in 0..D {
            u[i] = seeded(self.u_minus()[i]);
        }
        let coefficients = Coefficients {
            restitution: seeded(restitution),
            tangential_restitution: plain(tangential_restitution),
            friction: seeded(friction),
        };
        let problem = ImpactProblem::trusted(delassus, u);
        let lanes = |impulse: SVector<DualSVec64<LANES>, D>| {
            let mut rows = SMatrix::<f64, D, LANES>::zeros();
            for i in 0..D {
                rows.set_row(i, &impulse[i].eps.unwrap_generic(Const::<LANES>, U1).transpose());
            }
            rows
        };
        let last = lane - 1;
        let (outcome, by) = if friction == 0.0 {
            // Without friction all laws are the frictionless one, but not their derivative with respect to μ.
            let mut by = lanes(AnyLaw::from(Frictionless { restitution: coefficients.restitution }).impulse(&problem)?);
            let friction = plain(HARDLY_ANY).derivative(last);
            let rougher = law.with(Coefficients { friction, ..coefficients });
            by.set_column(last, &lanes(rougher.impulse(&problem)?).column(last));
            (law.resolve(self)?, by)
        } else if let Some(found) = law.with(coefficients).turning(&problem)? {
            // The outcome is that of the path along which the derivatives are integrated.
            let Found { impulse, u_plus, account } = found.plain();
            let name = Law::<f64, D>::name(law);
            (ImpactOutcome::of(name, self, impulse, u_plus, account, Some(friction))?, lanes(found.impulse))
        } else {
            // Coefficients out of their ranges are errors of `resolve`.
            (law.resolve(self)?, lanes(law.with(coefficients).impulse(&problem)?))
        };
        let (mut entries, mut k) = ([[SVector::zeros(); D]; D], 0);
        for (i, row) in entries.iter_mut().enumerate() {
            for entry in &mut row[i..] {
                *entry = by.column(k).into_owned();
                k += 1;
            }
        }
        Ok(LawDerivative {
            outcome,
            velocity: SMatrix::from_fn(|i, j| by[(i, k + j)]),
            restitution: by.column(last - 1).into_owned(),
            friction: by.column(last).into_owned(),
            delassus: entries,
            matrix: *self.delassus(),
        })
    }

    /// The derivatives along a direction on both sides of this problem. Each is extrapolated from the derivatives
    /// ([`ImpactProblem::differentiate`]) at one and two millionths of the problem's size; a boundary nearer than that
    /// counts as lying at the problem.
    ///
    /// ```
    /// # use carom_impact::{Direction, Energetic, ImpactProblem, Mode};
    /// # use nalgebra::{matrix, vector};
    /// // A rod at 45° dropped vertically: no slip before, and friction is just μ_stick = 0.6.
    /// let problem = ImpactProblem::new(matrix![2.5, -1.5; -1.5, 2.5], vector![0.0, -1.0])?;
    /// let more_friction = Direction { friction: 1.0, ..Direction::default() };
    /// let sides = problem.one_sided(&Energetic { restitution: 0.5, friction: 0.6 }, &more_friction)?;
    /// assert!(sides.is_kink());
    /// assert_eq!(sides.behind.unwrap().mode, Mode::Slip);
    /// assert_eq!(sides.ahead.unwrap().mode, Mode::Stick);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    ///
    /// # Errors
    /// [`ImpactError::NotDifferentiable`] for a user-defined law; the errors of [`Law::resolve`] for this problem;
    /// [`ImpactError::NotFinite`] for a direction that is zero or not finite.
    pub fn one_sided(&self, law: &dyn Law<f64, D>, along: &Direction<D>) -> Result<OneSided<D>, ImpactError> {
        law.resolve(self)?;
        let law = known(law)?;
        let coefficients = law.coefficients();
        let shares = [
            along.delassus.norm() / self.delassus().norm(),
            along.u_minus.norm() / self.u_minus().norm(),
            along.restitution.abs(),
            along.friction.abs() / (1.0 + coefficients.friction),
        ];
        let largest = shares.into_iter().filter(|x| *x != 0.0).fold(0.0, f64::max);
        if !(largest > 0.0 && shares.iter().all(|x| x.is_finite() || x.is_nan())) {
            return Err(ImpactError::NotFinite { entry: "the size of the direction".into(), value: largest });
        }
        let step = 1e-6 / largest;
        let side = |sign: f64| {
            let at = |share: f64| {
                let by = sign * share * step;
                let moved =
                    ImpactProblem::new(self.delassus() + along.delassus * by, self.u_minus() + along.u_minus * by);
                let coefficients = Coefficients {
                    restitution: coefficients.restitution + along.restitution * by,
                    friction: coefficients.friction + along.friction * by,
                    ..coefficients
                };
                moved?.differentiate(&law.with(coefficients))
            };
            // Linear extrapolation to the problem, with an error of second order.
            let (near, far) = (at(1.0).ok()?, at(2.0).ok()?);
            Some(Side {
                impulse: near.impulse(along) * 2.0 - far.impulse(along),
                u_plus: near.u_plus(along) * 2.0 - far.u_plus(along),
                mode: near.outcome.mode,
                slip_end: near.outcome.slip_end,
            })
        };
        Ok(OneSided { behind: side(-1.0), ahead: side(1.0) })
    }
}

/// The law as an [`AnyLaw`].
pub(crate) fn known<const D: usize>(law: &dyn Law<f64, D>) -> Result<AnyLaw, ImpactError> {
    law.known().ok_or_else(|| ImpactError::NotDifferentiable { law: law.name(), known: LAW_NAMES.join(", ") })
}
