//! The law of several contacts at the same time.

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
}
