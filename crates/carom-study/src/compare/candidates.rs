//! The laws that are compared, and the search for their coefficients.

use crate::fit::Region;
use carom_impact::{Coefficients, LAW_NAMES};
use carom_sim::SeveralLaw;

/// A law, and for tosses the law of impacts of several contacts, whose coefficients are fitted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Candidate {
    /// One of [`LAW_NAMES`].
    pub law: &'static str,
    /// The law of impacts of several contacts; irrelevant for single impacts.
    pub several: SeveralLaw,
    /// The coefficients that are fitted.
    pub parameters: Vec<Parameter>,
}

/// A coefficient that is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Parameter {
    /// Coefficient of restitution.
    Restitution,
    /// Coefficient of friction.
    Friction,
    /// Coefficient of tangential restitution.
    Tangential,
}

impl Parameter {
    pub fn name(self) -> &'static str {
        match self {
            Self::Restitution => "restitution",
            Self::Friction => "friction",
            Self::Tangential => "tangential_restitution",
        }
    }

    fn bounds(self, max_friction: f64) -> (f64, f64) {
        match self {
            Self::Restitution => (0.0, 1.0),
            Self::Friction => (0.0, max_friction),
            Self::Tangential => (-1.0, 1.0),
        }
    }

    fn grid(self, max_friction: f64) -> Vec<f64> {
        match self {
            Self::Restitution => vec![0.0, 0.2, 0.4, 0.6, 0.8],
            Self::Friction => [0.05, 0.15, 0.3, 0.6].map(|share| share * max_friction).to_vec(),
            Self::Tangential => vec![0.0],
        }
    }
}

impl Candidate {
    /// Every law of [`LAW_NAMES`] with the coefficients that it has.
    pub fn all() -> Vec<Self> {
        use Parameter::{Friction, Restitution, Tangential};
        let parameters = |law| match law {
            "frictionless" => vec![Restitution],
            "chatterjee-ruina" => vec![Restitution, Friction, Tangential],
            _ => vec![Restitution, Friction],
        };
        let one = |law| Self { law, several: SeveralLaw::default(), parameters: parameters(law) };
        LAW_NAMES.into_iter().map(one).collect()
    }

    /// Every law with the default law of several contacts, and Stronge's law with the others.
    pub fn all_for_tosses() -> Vec<Self> {
        let mut all = Self::all();
        let Some(stronge) = all.iter().find(|one| one.law == "energetic").cloned() else { return all };
        let others = SeveralLaw::ALL.into_iter().filter(|several| *several != SeveralLaw::default());
        all.extend(others.map(|several| Self { several, ..stronge.clone() }));
        all
    }

    /// The box of the coefficients and a grid of starting values.
    pub fn region(&self, max_friction: f64) -> Region {
        Region {
            bounds: self.parameters.iter().map(|parameter| parameter.bounds(max_friction)).collect(),
            grid: self.parameters.iter().map(|parameter| parameter.grid(max_friction)).collect(),
        }
    }

    /// The coefficients as values of the law.
    pub fn coefficients(&self, x: &[f64]) -> Coefficients {
        let mut all = Coefficients::default();
        for (parameter, &x) in self.parameters.iter().zip(x) {
            match parameter {
                Parameter::Restitution => all.restitution = x,
                Parameter::Friction => all.friction = x,
                Parameter::Tangential => all.tangential_restitution = x,
            }
        }
        all
    }
}
