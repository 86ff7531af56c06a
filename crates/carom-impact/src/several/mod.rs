//! Impacts at several constraints at once: contacts, joint limits, dry joint friction, locked directions.
//!
//! All impulses act on all velocities through one Delassus matrix. The law relates impulses and velocities:
//!
//! | Law | Constraints act | Restitution is | Energy without friction |
//! |---|---|---|---|
//! | [`simultaneous`](SeveralProblem::simultaneous), Moreau | at once | a ratio of velocities | **can gain**, if a separating contact gets an impulse |
//! | [`poisson`](SeveralProblem::poisson), Glocker & Pfeiffer | at once, in two phases | a ratio of impulses | never gains |
//! | [`sequential`](SeveralProblem::sequential) | one after another | a ratio of velocities, in each sub-impact | never gains |
//! | [`energetic`](SeveralProblem::energetic), Liu, Zhao & Brogliato | in the ratios of their forces, along the impact | a ratio of works | never gains |
//!
//! The outcome of `sequential` depends on the order; [`all_orders`](SeveralProblem::all_orders) returns the outcomes of
//! all orders. That of `energetic` depends on the ratios of the [`Stiffnesses`]. Friction is Coulomb's with the circular cone, not a
//! pyramid. Symbols, and Moreau's law:
//!
//! | Symbol | Size | Meaning | Our name |
//! |---|---|---|---|
//! | H | n × n | Delassus matrix: inverse inertia between all rows, `J M⁻¹ Jᵀ` (1/kg) | `delassus` |
//! | u⁻ | n | velocities before (m/s) | `u_minus` |
//! | u_free | n | velocities after without any impulse (m/s) | `u_free` |
//! | p | n | impulses (N s); `u⁺ = u_free + H p` | `impulse` |
//! | u⁺ | n | velocities after (m/s) | `u_plus` |
//! | y | 1 | `u_n⁺ + e min(u_n⁻, 0)`, normal velocity minus its target (m/s) | `y` |
//! | h | 1 | mean diagonal entry of H in the constraint's rows (1/kg) | `scale` |
//!
//! ```text
//! contact   0 ≤ p_n ⟂ y ≥ 0;  |p_t| ≤ μ p_n;  p_t = -μ p_n u_t⁺/|u_t⁺| where u_t⁺ ≠ 0
//! stop      0 ≤ p ⟂ y ≥ 0
//! dry       |p| ≤ bound;  p = -bound sign u⁺ where u⁺ ≠ 0
//! held      u⁺ = 0
//! ```
//!
//! Rows of a prismatic joint are in m and N, rows of a revolute joint in rad and N m.
//!
//! **Source.** J. J. Moreau, *Unilateral contact and dry friction in finite freedom dynamics* (1988). The solution for
//! one constraint is in `block.rs`, the iteration in `solve.rs`.
//!
//! ```
//! use carom_impact::{Accuracy, Constraint, SeveralProblem};
//! use nalgebra::{dmatrix, dvector};
//!
//! // Newton's cradle: three balls of 1 kg, the first strikes at 1 m/s, the others touch at rest.
//! let between = Constraint::Stop { restitution: 1.0 };
//! let cradle = SeveralProblem::new(dmatrix![2.0, -1.0; -1.0, 2.0], dvector![-1.0, 0.0], vec![between; 2])?;
//! let hit = cradle.simultaneous(&Accuracy::default(), None)?;
//!
//! // Under Moreau's law the last ball does not leave alone: the first ball rebounds.
//! let first_ball = 1.0 - hit.impulse[0];
//! assert!((first_ball + 1.0 / 3.0).abs() < 1e-12);
//! assert!(hit.residual <= 1e-12 && hit.energy_change.abs() < 1e-12);
//! # Ok::<(), carom_impact::ImpactError>(())
//! ```

mod block;
mod elimination;
mod energetic;
mod natural_map;
mod newton;
mod orders;
mod poisson;
mod response;
mod restart;
mod sequential;
mod simultaneous;
mod solve;
mod unique;

use nalgebra::{DMatrix, DVector};

pub use energetic::{EnergeticOutcome, Stiffnesses};
pub use orders::{OrderOutcome, OrderSet};
pub use poisson::PoissonOutcome;
pub use sequential::Order;
pub use unique::undetermined;

use crate::laws::{check_friction, check_restitution, refuse};
use crate::problem::{check_delassus, check_square, check_velocity};
use crate::rounding::{CANCELLED, RANK, SOLVED};
use crate::{Flags, ImpactError};

/// One constraint of an impact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Constraint {
    /// A unilateral contact with Coulomb friction: three rows, tangents first, normal last. For a contact in the plane
    /// the second tangent's row and column are zero.
    Contact {
        /// Coefficient of restitution, 0 to 1, in the sense of the law.
        restitution: f64,
        /// Coulomb's coefficient of friction, at least 0.
        friction: f64,
    },
    /// A unilateral constraint without tangents (a joint limit, a frictionless contact): one row.
    Stop {
        /// Coefficient of restitution, 0 to 1, in the sense of the law.
        restitution: f64,
    },
    /// Dry friction of a joint: one row.
    Dry {
        /// Largest impulse (N s or N m s), at least 0.
        bound: f64,
    },
    /// A bilateral constraint, such as a locked joint: one row.
    Held,
}

impl Constraint {
    /// Number of rows: 3 for a contact, otherwise 1.
    #[doc(hidden)]
    pub const fn rows(&self) -> usize {
        match self {
            Self::Contact { .. } => 3,
            Self::Stop { .. } | Self::Dry { .. } | Self::Held => 1,
        }
    }

    /// Newton's coefficient e; 0 for constraints without one.
    const fn restitution(&self) -> f64 {
        match *self {
            Self::Contact { restitution, .. } | Self::Stop { restitution } => restitution,
            Self::Dry { .. } | Self::Held => 0.0,
        }
    }

    fn check(&self) -> Result<(), ImpactError> {
        match *self {
            Self::Contact { restitution, friction } => {
                check_restitution(restitution)?;
                check_friction(friction)
            }
            Self::Stop { restitution } => check_restitution(restitution),
            // Written so that NaN fails.
            Self::Dry { bound } if bound >= 0.0 && bound.is_finite() => Ok(()),
            Self::Dry { bound } => {
                let rule = "is not a finite number >= 0: give the largest impulse of dry friction, which is the joint's \
                            friction force times the time it acts; 0 for an instantaneous impact; for no bound use `Held`";
                refuse("bound", bound, rule)
            }
            Self::Held => Ok(()),
        }
    }
}

/// When the iteration stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// Residual, relative to the largest velocity, below which a solution is accepted.
    pub tolerance: f64,
    /// Largest number of sweeps and Newton steps together; for `poisson` in each phase. For `sequential` the largest
    /// number of sub-impacts.
    pub max_iterations: usize,
}

impl Default for Accuracy {
    /// Tolerance 1e-12, some digits above rounding, and 2000 iterations.
    fn default() -> Self {
        Self { tolerance: 1e-12, max_iterations: 2000 }
    }
}

/// An impact with several constraints.
#[derive(Debug, Clone, PartialEq)]
pub struct SeveralProblem {
    delassus: DMatrix<f64>,
    u_minus: DVector<f64>,
    u_free: DVector<f64>,
    constraints: Vec<Constraint>,
    /// Whether H is symmetric and positive semidefinite.
    gram: bool,
}

impl SeveralProblem {
    /// Checks and stores `delassus` (1/kg), `u_minus` (m/s) and the constraints, whose rows follow one another in the
    /// order of the list. The matrix may be singular: more rows than the robot has degrees of freedom.
    ///
    /// # Errors
    ///
    /// - [`ImpactError::Sizes`]: sizes that do not agree.
    /// - [`ImpactError::Matrix`]: the matrix is not square, symmetric (within 1e-8 of the largest entry) and positive semidefinite
    ///   (within rounding).
    /// - [`ImpactError::NotFinite`]: an entry of the matrix or of the velocity.
    /// - [`ImpactError::Constraint`]: a coefficient is out of its range.
    pub fn new(
        mut delassus: DMatrix<f64>,
        u_minus: DVector<f64>,
        constraints: Vec<Constraint>,
    ) -> Result<Self, ImpactError> {
        check_rows(&delassus, &u_minus, &constraints)?;
        check_delassus(&mut delassus)?;
        Self::from_gram(delassus, u_minus, constraints)
    }

    /// The problem of a matrix that is symmetric and positive semidefinite by construction, as [`ImpactProblem::from_gram`]: of R M⁻¹Rᵀ
    /// of a mechanism with loops, whose entries are small differences of those of the open chain, and have their rounding.
    ///
    /// [`ImpactProblem::from_gram`]: crate::ImpactProblem::from_gram
    ///
    /// # Errors
    ///
    /// As [`SeveralProblem::new`], without those of a matrix that is not symmetric or not positive semidefinite.
    pub fn from_gram(
        delassus: DMatrix<f64>,
        u_minus: DVector<f64>,
        constraints: Vec<Constraint>,
    ) -> Result<Self, ImpactError> {
        check_rows(&delassus, &u_minus, &constraints)?;
        check_velocity("delassus", delassus.as_slice())?;
        check_velocity("u_minus", u_minus.as_slice())?;
        Ok(Self { delassus, u_free: u_minus.clone(), u_minus, constraints, gram: true })
    }

    /// The problem of accelerations of lasting contacts: `delassus` = R M⁻¹ Fᵀ, with the rows R of the accelerations and the
    /// rows F along which the forces act; they differ for a contact that slides, which is a [`Constraint::Stop`] whose
    /// force acts along n − μ d. The matrix then is not symmetric. `free` are the accelerations without forces (m/s²). In
    /// the outcome of [`simultaneous`](Self::simultaneous) impulses are forces (N) and velocities are accelerations.
    ///
    /// # Errors
    ///
    /// As [`SeveralProblem::new`], except that the matrix may be any square one with finite entries.
    pub fn of_accelerations(
        delassus: DMatrix<f64>,
        free: DVector<f64>,
        constraints: Vec<Constraint>,
    ) -> Result<Self, ImpactError> {
        check_rows(&delassus, &free, &constraints)?;
        check_velocity("delassus", delassus.as_slice())?;
        check_velocity("free", free.as_slice())?;
        Ok(Self { delassus, u_minus: DVector::zeros(free.len()), u_free: free, constraints, gram: false })
    }

    /// The same problem with the velocities after without any impulse (m/s): in a time step, forces have changed them.
    /// Restitution still refers to `u_minus`.
    ///
    /// # Errors
    ///
    /// [`ImpactError::Sizes`], [`ImpactError::NotFinite`].
    pub fn with_free_velocity(self, u_free: DVector<f64>) -> Result<Self, ImpactError> {
        check_size("u_free", self.u_minus.len(), u_free.len())?;
        check_velocity("u_free", u_free.as_slice())?;
        Ok(Self { u_free, ..self })
    }

    /// Delassus matrix: inverse inertia between all rows, symmetric (1/kg).
    pub fn delassus(&self) -> &DMatrix<f64> {
        &self.delassus
    }

    /// Velocities before the impact (m/s).
    pub fn u_minus(&self) -> &DVector<f64> {
        &self.u_minus
    }

    /// Velocities after without any impulse (m/s).
    pub fn u_free(&self) -> &DVector<f64> {
        &self.u_free
    }

    /// The constraints, in the order of their rows.
    pub fn constraints(&self) -> &[Constraint] {
        &self.constraints
    }

    /// `½ pᵀ(u⁻ + u⁺)` (J), and the flags that follow from it.
    fn energy(&self, impulse: &DVector<f64>, u_plus: &DVector<f64>, residual: f64) -> (f64, Flags) {
        let energy_change = 0.5 * impulse.dot(&(&self.u_minus + u_plus));
        let passed = 0.5 * impulse.abs().dot(&(self.u_minus.abs() + u_plus.abs()));
        // A gain within the residual is not one of the law.
        let gains = energy_change > passed * (CANCELLED * f64::EPSILON).max(residual);
        // Where no solution was found, zero impulses do not mean that none is needed.
        let open = impulse.amax() == 0.0 && residual <= SOLVED;
        (energy_change, Flags::ENERGY_GAIN.when(gains) | Flags::NO_APPROACH.when(open))
    }

    /// The rounding error of the velocities that these impulses give, relative to the largest velocity before, as
    /// [`SeveralOutcome::residual`] is: no smaller residual means anything. It is large where impulses cancel that are many orders
    /// of magnitude above those that the velocities before need, as in a sequence of sub-impacts that gains energy without end.
    #[doc(hidden)]
    pub fn rounding(&self, impulse: &DVector<f64>) -> f64 {
        let speed = self.u_minus.amax().max(self.u_free.amax());
        let passed = (self.delassus.abs() * impulse.abs()).amax();
        if passed == 0.0 { 0.0 } else { passed / speed * f64::EPSILON }
    }

    /// The same problem with all coefficients of restitution zero.
    #[doc(hidden)]
    pub fn without_restitution(&self) -> Self {
        self.inelastic(1.0)
    }

    /// The same problem without restitution, with the bounds of dry friction multiplied by `share`.
    fn inelastic(&self, share: f64) -> Self {
        let constraints = self.constraints.iter().map(|constraint| match *constraint {
            Constraint::Contact { friction, .. } => Constraint::Contact { restitution: 0.0, friction },
            Constraint::Stop { .. } => Constraint::Stop { restitution: 0.0 },
            Constraint::Dry { bound } => Constraint::Dry { bound: bound * share },
            Constraint::Held => Constraint::Held,
        });
        Self { constraints: constraints.collect(), ..self.clone() }
    }

    /// Each constraint with its first row.
    fn rows(&self) -> impl Iterator<Item = (usize, &Constraint)> {
        self.constraints.iter().scan(0, |next, constraint| {
            let row = *next;
            *next += constraint.rows();
            Some((row, constraint))
        })
    }
}

/// Outcome of a [`SeveralProblem`].
#[derive(Debug, Clone, PartialEq)]
pub struct SeveralOutcome {
    /// Impulses on the robot (N s), each within its cone or bound.
    pub impulse: DVector<f64>,
    /// Velocities after (m/s): `u_free + H p`.
    pub u_plus: DVector<f64>,
    /// Violation of the law, relative to the largest entry of `u_minus` and `u_free`; exactly zero at a solution. It is
    /// the largest value over the constraints of
    ///
    /// ```text
    /// stop      |h p - max(0, h p - y)|
    /// dry       |h p - clamp(h p - u, ±h bound)|
    /// held      |u|
    /// contact   |(h p_t - P(h p_t - u_t),  h p_n - max(0, h p_n - y))|
    /// ```
    ///
    /// with P the projection on the disc of radius `μ max(0, h p_n - y)`, u the velocity after, and h the constraint's
    /// mean inverse inertia, which converts impulses to velocities. It measures in one number a normal velocity below
    /// its target, an impulse at a separating contact, and friction that is not opposed to the slip or not maximal.
    ///
    /// Of a [sequence](SeveralProblem::sequential) it is the largest of the approach velocities of contacts and stops, the velocities
    /// that dry friction could still change, and the velocities of `Held` constraints.
    pub residual: f64,
    /// Number of sweeps over the constraints and Newton steps together; of a sequence the number of sub-impacts.
    pub iterations: usize,
    /// Work of the impulses at the mean velocity, `½ pᵀ(u⁻ + u⁺)` (J). In an impact without forces (`u_free = u_minus`)
    /// it is the change of kinetic energy; in a time step the work of the forces has to be added.
    pub energy_change: f64,
    /// `energy-gain` if the impulses did positive work; `no-approach` if all impulses are zero and satisfy the law;
    /// `non-unique` if other impulses in the same modes satisfy the law of Moreau, or of Poisson, and give other velocities, or if
    /// equal approach velocities left the order of a sequence open.
    pub flags: Flags,
}

impl SeveralOutcome {
    /// Whether the law is satisfied within the tolerance, or the sequence has ended.
    pub fn is_solved(&self, accuracy: &Accuracy) -> bool {
        self.residual <= accuracy.tolerance.max(RANK)
    }
}

fn check_rows(delassus: &DMatrix<f64>, u: &DVector<f64>, constraints: &[Constraint]) -> Result<(), ImpactError> {
    check_square(delassus)?;
    let expected = constraints.iter().map(Constraint::rows).sum();
    check_size("delassus", expected, delassus.nrows())?;
    check_size("u_minus", expected, u.len())?;
    for (index, constraint) in constraints.iter().enumerate() {
        constraint.check().map_err(|reason| ImpactError::Constraint { index, reason: Box::new(reason) })?;
    }
    Ok(())
}

fn check_size(what: &'static str, expected: usize, found: usize) -> Result<(), ImpactError> {
    if found == expected {
        return Ok(());
    }
    Err(ImpactError::Sizes(format!(
        "{what} has {found} rows, but the constraints have {expected}: a contact has three (tangents first, normal last), every other \
         constraint one"
    )))
}
