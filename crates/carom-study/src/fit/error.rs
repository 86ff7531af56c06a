//! Errors of a fit.

use carom_chain::ChainError;
use carom_impact::{ImpactError, LAW_NAMES};
use carom_sim::SimError;

/// Reason why coefficients cannot be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// An option or a measurement breaks a rule; the message names it, its value and the rule.
    #[error("{0}")]
    Input(String),
    /// The contact point does not approach the surface.
    #[error(
        "the contact does not approach: its normal velocity before the impact is {normal_velocity} m/s and must be \
         negative; leave this measurement out, or check the normal (from the environment to the robot)"
    )]
    NoApproach {
        /// u_n⁻, m/s.
        normal_velocity: f64,
    },
    /// The fit of one flight, or of the two beside an impact, did not converge; the message gives the residual.
    #[error("{0}")]
    NotConverged(String),
    /// The scale of inertia needs a robot.
    #[error(
        "the scale of inertia cannot be fitted to impacts given by a Delassus matrix: give a robot and the configurations q"
    )]
    NoInertia,
    /// The law or the simulation returned an error at the fitted coefficients.
    #[error("the law returns an error for these impacts: {0}")]
    Refused(String),
    /// Error of the robot or its state.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// Error of the law.
    #[error(transparent)]
    Impact(#[from] ImpactError),
    /// Error of the simulation.
    #[error(transparent)]
    Simulation(#[from] SimError),
}

impl FitError {
    /// An option or a measure that is out of its range.
    pub(super) fn setting(what: &str, value: f64, rule: &str) -> Self {
        Self::Input(format!("{what} is {value}: {rule}"))
    }

    /// A number that is NaN or infinite.
    pub(super) fn not_finite(what: &str, value: f64) -> Self {
        Self::Input(format!("{what} contains {value}: every number must be finite"))
    }

    /// No law has the name.
    pub(super) fn unknown_law(name: &str) -> Self {
        Self::Input(format!("no law is named '{name}': the laws are {}", LAW_NAMES.join(", ")))
    }
}
