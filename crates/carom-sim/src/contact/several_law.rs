//! The law of several contacts at the same time.

use carom_impact::{Accuracy, ImpactError, Order, SeveralOutcome, SeveralProblem, Stiffnesses};
use nalgebra::DVector;
use serde::de::{Deserialize, Deserializer, Error as _};

/// The law of several contacts at the same time, in impacts and in time steps. Each contact keeps its own coefficients; its
/// own law applies to impacts of this contact alone.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
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
    /// Impulses in the ratios that stiffnesses and stored energies give, without friction: see
    /// [`SeveralProblem::energetic`](carom_impact::SeveralProblem::energetic). Each contact has a
    /// [`relative_stiffness`](crate::ContactRule::relative_stiffness).
    Energetic {
        /// Exponent η of the normal force over the penetration, 1 to 10: 1 for flat contacts, 1.5 for round bodies.
        exponent: f64,
    },
}

impl SeveralLaw {
    /// All laws; [`SeveralLaw::Energetic`] with the exponent 1.5.
    pub const ALL: [Self; 4] = [Self::Moreau, Self::Poisson, Self::Sequential, Self::Energetic { exponent: 1.5 }];

    const NAMES: [&str; 4] = ["moreau", "poisson", "sequential", "energetic"];

    /// Name in scene files: `moreau`, `poisson`, `sequential` or `energetic`. The names of the authors `glocker-pfeiffer` (Poisson's law) and
    /// `liu-zhao-brogliato` (the energetic one) are read too.
    pub fn name(self) -> &'static str {
        let [moreau, poisson, sequential, energetic] = Self::NAMES;
        match self {
            Self::Moreau => moreau,
            Self::Poisson => poisson,
            Self::Sequential => sequential,
            Self::Energetic { .. } => energetic,
        }
    }

    /// Solves a problem by this law; `stiffnesses` are those of the constraints, relative to one another. `start`: a guess of the
    /// impulses, which Moreau's law uses.
    ///
    /// # Errors
    /// [`ImpactError`] of the energetic law; the others have none for a problem that could be made.
    pub fn solve(
        self,
        problem: &SeveralProblem,
        stiffnesses: &[f64],
        accuracy: &Accuracy,
        start: Option<&DVector<f64>>,
    ) -> Result<SeveralOutcome, ImpactError> {
        Ok(match self {
            Self::Moreau => problem.simultaneous(accuracy, start)?,
            Self::Poisson => problem.poisson(accuracy).total,
            Self::Sequential => problem.sequential(&Order::MostApproaching, accuracy)?,
            Self::Energetic { exponent } => {
                problem.energetic(&Stiffnesses { exponent, ratios: stiffnesses }, accuracy)?.total
            }
        })
    }
}

impl<'de> Deserialize<'de> for SeveralLaw {
    fn deserialize<D: Deserializer<'de>>(given: D) -> Result<Self, D::Error> {
        let name = String::deserialize(given)?;
        let name = match name.as_str() {
            "glocker-pfeiffer" => "poisson",
            "liu-zhao-brogliato" => "energetic",
            other => other,
        };
        let known = Self::ALL.into_iter().find(|law| law.name() == name);
        known.ok_or_else(|| D::Error::unknown_variant(name, &Self::NAMES))
    }
}
