//! Errors of a fit.

use carom_chain::ChainError;
use carom_impact::ImpactError;
use carom_sim::SimError;

/// Reason why coefficients cannot be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// There is no law of that name.
    #[error("no law is named '{name}': the laws are {known}")]
    UnknownLaw {
        /// The name given.
        name: String,
        /// The known names, separated by commas.
        known: String,
    },
    /// The law has no coefficient of friction.
    #[error("the law '{name}' has no coefficient of friction to fit: choose one of {known}")]
    NoFriction {
        /// The law.
        name: String,
        /// The laws with a coefficient of friction, separated by commas.
        known: String,
    },
    /// An option is out of its range.
    #[error("{what} is {value}: {rule}")]
    Setting {
        /// The option.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The rule that the value breaks.
        rule: &'static str,
    },
    /// Too few measurements.
    #[error(
        "{found} of {all} {of} are selected to fit {parameters} coefficients, but at least {needed} are needed: record \
         more, or train on a larger share of them"
    )]
    TooFew {
        /// Number of measurements to fit to.
        found: usize,
        /// Number of all measurements.
        all: usize,
        /// What the measurements are: `impacts` or `tosses`.
        of: &'static str,
        /// Number of coefficients.
        parameters: usize,
        /// Number of measurements that are needed.
        needed: usize,
    },
    /// The contact point does not approach the surface.
    #[error(
        "the contact does not approach: its normal velocity before the impact is {normal_velocity} m/s and must be \
         negative; leave this measurement out, or check the normal (from the environment to the robot)"
    )]
    NoApproach {
        /// u_n⁻, m/s.
        normal_velocity: f64,
    },
    /// The vectors of one measurement have different lengths.
    #[error("{what}: {found}, but {needed} are needed")]
    Sizes {
        /// What has the wrong length.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The required length.
        needed: usize,
    },
    /// A number is NaN or infinite.
    #[error("{what} contains {value}: every number must be finite")]
    NotFinite {
        /// The vector.
        what: &'static str,
        /// The value.
        value: f64,
    },
    /// The times of a flight are not ascending.
    #[error("the times of the flight {which} the impact must ascend: {time} s follows {before} s")]
    Times {
        /// `before` or `after`.
        which: &'static str,
        /// The time that is not later than its predecessor, s.
        time: f64,
        /// The preceding time, s.
        before: f64,
    },
    /// The flight after the impact begins before the flight before it ends.
    #[error(
        "the flight before the impact ends at {end} s and the flight after it begins at {start} s: it must begin later"
    )]
    Overlap {
        /// Last sample before the impact, s.
        end: f64,
        /// First sample after the impact, s.
        start: f64,
    },
    /// The fit of one flight did not converge.
    #[error("the fit of the flight did not converge in {steps} steps; its residual is {rest} m")]
    NotFlown {
        /// Number of steps.
        steps: usize,
        /// Root mean square of the residual, m.
        rest: f64,
    },
    /// The fit of the two flights did not converge.
    #[error(
        "no impact joins the two flights: the fit of pose, velocities and time did not converge in {steps} steps; its \
         residual is {rest} m"
    )]
    NotJoined {
        /// Number of steps.
        steps: usize,
        /// Root mean square of the residual, m.
        rest: f64,
    },
    /// The robot has no collision shape, and no contact point is given.
    #[error("the robot has no collision shape to compute the contact point from: give the contact point")]
    NoShape,
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
