//! Impacts at several places at once: contacts, joint limits, dry joints, held directions.
//!
//! The impulses and the velocities they cause depend on one another through one matrix. Which impulses
//! belong to which velocities is the law's affair:
//!
//! | Law | Constraints act | Restitution is | Energy without friction |
//! |---|---|---|---|
//! | [`simultaneous`](SeveralProblem::simultaneous), Moreau | at once | a ratio of velocities | **can gain**, if a receding contact is pushed |
//! | [`poisson`](SeveralProblem::poisson), Glocker & Pfeiffer | at once, in two phases | a ratio of impulses | never gains |
//! | [`sequential`](SeveralProblem::sequential) | one after another | a ratio of velocities, each time | never gains |
//!
//! The third depends on the order; [`all_orders`](SeveralProblem::all_orders) says how much. Friction is Coulomb's,
//! with the round cone as it is. The symbols, and Moreau's law:
//!
//! | Symbol | Size | Meaning | Our name |
//! |---|---|---|---|
//! | H | n × n | inverse inertia between all rows, `J M⁻¹ Jᵀ` (1/kg) | `delassus` |
//! | u⁻ | n | velocities before (m/s) | `u_minus` |
//! | u_free | n | velocities after, were there no impulse (m/s) | `u_free` |
//! | p | n | impulses (N s); `u⁺ = u_free + H p` | `impulse` |
//! | u⁺ | n | velocities after (m/s) | `u_plus` |
//! | y | 1 | `u_n⁺ + e min(u_n⁻, 0)`, what the normal velocity exceeds its target by (m/s) | `y` |
//! | h | 1 | mean diagonal entry of H in the constraint's rows (1/kg) | `scale` |
//!
//! ```text
//! contact   0 ≤ p_n ⟂ y ≥ 0;  |p_t| ≤ μ p_n;  p_t = -μ p_n u_t⁺/|u_t⁺| where u_t⁺ ≠ 0
//! stop      0 ≤ p ⟂ y ≥ 0
//! dry       |p| ≤ bound;  p = -bound sign u⁺ where u⁺ ≠ 0
//! held      u⁺ = 0
//! ```
//!
//! A row of a prismatic joint is in m and N, one of a hinge in rad and N m.
//!
//! **Source.** J. J. Moreau, *Unilateral contact and dry friction in finite freedom dynamics* (1988). The local
//! solution is in `block.rs`, the iteration in `solve.rs`.
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
//! // Moreau's law does not send the last ball away alone: the first turns back.
//! let first_ball = 1.0 - hit.impulse[0];
//! assert!((first_ball + 1.0 / 3.0).abs() < 1e-12);
//! assert!(hit.residual <= 1e-12 && hit.energy_change.abs() < 1e-12);
//! # Ok::<(), carom_impact::ImpactError>(())
//! ```

mod block;
mod natural_map;
mod orders;
mod poisson;
mod restart;
mod sequential;
mod solve;

use nalgebra::{DMatrix, DVector};

pub use orders::{OrderOutcome, OrderSet};
pub use poisson::PoissonOutcome;
pub use sequential::{Order, OrderError, SequentialOutcome};

use solve::Found;

use crate::laws::{check_friction, check_restitution};
use crate::problem::{check_delassus, check_velocity};
use crate::{Flags, ImpactError};

/// Energy gain below this multiple of ε, beside the energies that passed, is rounding.
const GAIN: f64 = 64.0;

/// One constraint of an impact at several places.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Constraint {
    /// Pushes and never pulls, with Coulomb friction: three rows, tangents first, normal last. A contact in the
    /// plane leaves its second tangent's row zero.
    Contact {
        /// Newton's coefficient of restitution, 0 to 1.
        restitution: f64,
        /// Coulomb's coefficient of friction, at least 0.
        friction: f64,
    },
    /// Pushes and never pulls, without tangents (a joint limit, a smooth contact): one row.
    Stop {
        /// Newton's coefficient of restitution, 0 to 1.
        restitution: f64,
    },
    /// Dry friction of a joint: one row.
    Dry {
        /// Largest impulse (N s or N m s), at least 0.
        bound: f64,
    },
    /// Held in both directions: one row.
    Held,
}

impl Constraint {
    /// How many rows of the problem it takes: 3 for a contact, else 1.
    pub const fn rows(&self) -> usize {
        match self {
            Self::Contact { .. } => 3,
            Self::Stop { .. } | Self::Dry { .. } | Self::Held => 1,
        }
    }

    /// Newton's coefficient e, if it rebounds at all.
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
            Self::Dry { bound } => Err(ImpactError::Bound { value: bound }),
            Self::Held => Ok(()),
        }
    }
}

/// When to stop iterating.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// Residual, relative to the largest velocity, at which the answer is good enough.
    pub tolerance: f64,
    /// Most sweeps and Newton steps together; under `poisson` in each phase. Under `sequential`, most sub-impacts.
    pub max_iterations: usize,
}

impl Default for Accuracy {
    /// 1e-12, some digits above rounding, within 1000 iterations.
    fn default() -> Self {
        Self { tolerance: 1e-12, max_iterations: 1000 }
    }
}

/// Several constraints at the instant of impact.
#[derive(Debug, Clone, PartialEq)]
pub struct SeveralProblem {
    delassus: DMatrix<f64>,
    u_minus: DVector<f64>,
    u_free: DVector<f64>,
    constraints: Vec<Constraint>,
}

impl SeveralProblem {
    /// Checks and stores `delassus` (1/kg), `u_minus` (m/s) and the constraints, whose rows follow one another in
    /// the order of the list. The matrix may be singular: more contacts than the body has freedoms.
    ///
    /// # Errors
    ///
    /// Sizes that do not fit; an entry that is not finite; a matrix that is not symmetric within 1e-8 of its largest
    /// entry or not positive semidefinite within rounding; a coefficient out of its range.
    pub fn new(
        mut delassus: DMatrix<f64>,
        u_minus: DVector<f64>,
        constraints: Vec<Constraint>,
    ) -> Result<Self, ImpactError> {
        let (rows, columns) = delassus.shape();
        if rows != columns {
            return Err(ImpactError::NotSquare { rows, columns });
        }
        let expected = constraints.iter().map(Constraint::rows).sum();
        check_size("delassus", expected, rows)?;
        check_size("u_minus", expected, u_minus.len())?;
        for (index, constraint) in constraints.iter().enumerate() {
            constraint.check().map_err(|reason| ImpactError::Constraint { index, reason: Box::new(reason) })?;
        }
        check_delassus(&mut delassus)?;
        check_velocity("u_minus", u_minus.as_slice())?;
        Ok(Self { delassus, u_free: u_minus.clone(), u_minus, constraints })
    }

    /// The same with other velocities after, were there no impulse (m/s): in a time step the forces have changed
    /// them. Restitution still looks at `u_minus`.
    ///
    /// # Errors
    ///
    /// A size that does not fit; an entry that is not finite.
    pub fn with_free_velocity(self, u_free: DVector<f64>) -> Result<Self, ImpactError> {
        check_size("u_free", self.u_minus.len(), u_free.len())?;
        check_velocity("u_free", u_free.as_slice())?;
        Ok(Self { u_free, ..self })
    }

    /// Inverse inertia between all rows, symmetric (1/kg).
    pub fn delassus(&self) -> &DMatrix<f64> {
        &self.delassus
    }

    /// Velocities before the impact (m/s).
    pub fn u_minus(&self) -> &DVector<f64> {
        &self.u_minus
    }

    /// Velocities after, were there no impulse (m/s).
    pub fn u_free(&self) -> &DVector<f64> {
        &self.u_free
    }

    /// The constraints, in the order of their rows.
    pub fn constraints(&self) -> &[Constraint] {
        &self.constraints
    }

    /// Moreau's law: all constraints at once, Newton's restitution, Coulomb's cone.
    ///
    /// `warm_start` is a guess of the impulses, those of the step before, say.
    ///
    /// **Guarantee.** Every impulse is in its cone or within its bound. With e = 0 no energy is gained, beyond
    /// the residual; nor is it among smooth contacts if each that pushes was approaching, whatever their e: its
    /// share of the change is `-½ (1 - e) p |u⁻|`. Else it may be ([`Flags::ENERGY_GAIN`]): with friction as under
    /// [`Whittaker`](crate::Whittaker); without it by a contact that recedes and is pushed back to rest, whose
    /// share is `½ p u⁻`, even with one e for all. [`poisson`](Self::poisson) has no such gain. Where contacts are
    /// redundant there are many sets of impulses; without friction all of them give the same `u_plus`.
    ///
    /// **Fails** where no impulses satisfy the law, which takes e > 0 and a singular H: friction wedges what
    /// restitution drives apart, or obstacles grip the robot from both sides, where the contact that recedes
    /// (target 0, not -e u⁻) forbids the rebound from the other. It fails rarely where the iteration finds none.
    /// Neither is an error here: `residual` says so.
    ///
    /// # Errors
    ///
    /// A warm start of the wrong size or with an entry that is not finite.
    pub fn simultaneous(
        &self,
        accuracy: &Accuracy,
        warm_start: Option<&DVector<f64>>,
    ) -> Result<SeveralOutcome, ImpactError> {
        if let Some(guess) = warm_start {
            check_size("warm_start", self.u_minus.len(), guess.len())?;
            check_velocity("warm_start", guess.as_slice())?;
        }
        Ok(self.outcome(restart::solve_patiently(self, accuracy, warm_start)))
    }

    /// The books of impulses found.
    fn outcome(&self, found: Found) -> SeveralOutcome {
        let u_plus = &self.u_free + &self.delassus * &found.impulse;
        let (energy_change, flags) = self.energy(&found.impulse, &u_plus, found.residual);
        SeveralOutcome {
            u_plus,
            energy_change,
            flags,
            residual: found.residual,
            iterations: found.iterations,
            impulse: found.impulse,
        }
    }

    /// `½ pᵀ(u⁻ + u⁺)` (J), and whether that is a gain.
    fn energy(&self, impulse: &DVector<f64>, u_plus: &DVector<f64>, residual: f64) -> (f64, Flags) {
        let energy_change = 0.5 * impulse.dot(&(&self.u_minus + u_plus));
        let passed = 0.5 * impulse.abs().dot(&(self.u_minus.abs() + u_plus.abs()));
        // What the residual leaves open is no gain of the law's.
        let gains = energy_change > passed * (GAIN * f64::EPSILON).max(residual);
        (energy_change, Flags::ENERGY_GAIN.when(gains) | Flags::NO_APPROACH.when(impulse.amax() == 0.0))
    }

    /// The same without restitution, bounds of dry friction at a share of theirs.
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

/// The answer to one [`SeveralProblem`].
#[derive(Debug, Clone, PartialEq)]
pub struct SeveralOutcome {
    /// Impulses on the robot (N s), each within its cone or bound.
    pub impulse: DVector<f64>,
    /// Velocities after (m/s): `u_free + H p`.
    pub u_plus: DVector<f64>,
    /// By how much the law is violated, relative to the largest entry of `u_minus` and `u_free`; zero exactly at a
    /// solution. It is the largest over the constraints of
    ///
    /// ```text
    /// stop      |h p - max(0, h p - y)|
    /// dry       |h p - clamp(h p - u, ±h bound)|
    /// held      |u|
    /// contact   |(h p_t - P(h p_t - u_t),  h p_n - max(0, h p_n - y))|
    /// ```
    ///
    /// with P the projection on the disc of radius `μ max(0, h p_n - y)`, u the velocity after, and h the
    /// constraint's mean inverse inertia, which turns impulses into velocities. So it measures in one number a
    /// normal velocity below its target, an impulse where there should be none, and friction that is not the
    /// one which dissipates most.
    pub residual: f64,
    /// Sweeps over the constraints and Newton steps made, together.
    pub iterations: usize,
    /// `½ pᵀ(u⁻ + u⁺)` (J): the work of the impulses at the mean velocity. In a pure impact (`u_free = u_minus`)
    /// it is the change of kinetic energy; in a time step the forces' work comes on top.
    pub energy_change: f64,
    /// `energy-gain` if the impulses brought energy; `no-approach` if there are none.
    pub flags: Flags,
}

fn check_size(what: &'static str, expected: usize, found: usize) -> Result<(), ImpactError> {
    if found == expected { Ok(()) } else { Err(ImpactError::Sizes { what, expected, found }) }
}
