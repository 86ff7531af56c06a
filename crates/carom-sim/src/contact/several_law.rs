//! The law of several contacts at the same time.

use carom_impact::{Accuracy, Flags, ImpactError, Order, SeveralProblem};
use nalgebra::DVector;

/// The law of several contacts at the same time, in impacts and in time steps. Each contact keeps its own coefficients; its
/// own law applies to impacts of this contact alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SeveralLaw {
    /// Newton's restitution at all contacts simultaneously: see
    /// [`SeveralProblem::simultaneous`](carom_impact::SeveralProblem::simultaneous).
    #[default]
    Moreau,
    /// Compression of all contacts, then restitution of all: see
    /// [`SeveralProblem::poisson`](carom_impact::SeveralProblem::poisson).
    Poisson,
    /// One impact after another, always at the contact with the highest approach velocity: see
    /// [`SeveralProblem::sequential`](carom_impact::SeveralProblem::sequential).
    Sequential,
}

impl SeveralLaw {
    /// All laws.
    pub const ALL: [Self; 3] = [Self::Moreau, Self::Poisson, Self::Sequential];

    /// Name in scene files: `moreau`, `poisson` or `sequential`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Moreau => "moreau",
            Self::Poisson => "poisson",
            Self::Sequential => "sequential",
        }
    }

    /// Solves a problem by this law.
    ///
    /// # Errors
    /// None for a problem that could be made; the types of the laws allow them.
    pub(crate) fn solve(self, problem: &SeveralProblem, accuracy: &Accuracy) -> Result<Solved, ImpactError> {
        let (impulse, residual, flags) = match self {
            Self::Moreau => {
                let found = problem.simultaneous(accuracy, None)?;
                (found.impulse, found.residual, found.flags)
            }
            Self::Poisson => {
                let found = problem.poisson(accuracy).total;
                (found.impulse, found.residual, found.flags)
            }
            Self::Sequential => {
                let found = problem.sequential(&Order::MostApproaching, accuracy);
                let found = found.unwrap_or_else(|_| unreachable!("this order has no indices that could be invalid"));
                (found.impulse, found.residual, found.flags)
            }
        };
        Ok(Solved { impulse, residual, flags })
    }
}

/// A solution of the law.
pub(crate) struct Solved {
    /// Impulses of all constraints, by row.
    pub impulse: DVector<f64>,
    /// Violation of the law.
    pub residual: f64,
    /// Notes about the solution.
    pub flags: Flags,
}
