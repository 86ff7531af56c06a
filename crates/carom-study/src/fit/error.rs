//! What a fit is refused for.

use carom_chain::ChainError;
use carom_impact::ImpactError;
use carom_sim::SimError;

/// Why coefficients can't be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// No law of that name.
    #[error("no law is named '{name}': the laws are {known}")]
    UnknownLaw {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// The law knows no friction.
    #[error("the law '{name}' knows no friction, so there is none to fit: choose one of {known}")]
    NoFriction {
        /// The law.
        name: String,
        /// Laws with friction.
        known: String,
    },
    /// A number breaks its rule.
    #[error("{what} is {value}: {rule}")]
    Setting {
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The rule.
        rule: &'static str,
    },
    /// Too few measurements.
    #[error(
        "{found} of {all} {of} are there to fit {parameters} coefficients, and at least {needed} are needed: record more, \
         or fit on a larger share of them"
    )]
    TooFew {
        /// Measurements to fit on.
        found: usize,
        /// Measurements in all.
        all: usize,
        /// What they are.
        of: &'static str,
        /// How many coefficients.
        parameters: usize,
        /// How many measurements are needed.
        needed: usize,
    },
    /// A jump is no impact.
    #[error(
        "the contact does not approach: its normal velocity before is {normal_velocity} m/s, and in an impact it is \
         negative; leave this one out, or check the normal (from the environment to the robot)"
    )]
    NoApproach {
        /// u_n⁻, m/s.
        normal_velocity: f64,
    },
    /// Vectors of one measurement do not fit one another.
    #[error("{what}: {found} where {needed} are needed")]
    Sizes {
        /// What has the wrong size.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        needed: usize,
    },
    /// A number that is not one.
    #[error("{what} holds {value}: every number must be finite")]
    NotFinite {
        /// Where.
        what: &'static str,
        /// The value.
        value: f64,
    },
    /// The times of a flight are out of order.
    #[error("the times of the flight {which} the impact do not ascend: {time} s follows {before} s")]
    Times {
        /// `before` or `after`.
        which: &'static str,
        /// The time that comes too early, s.
        time: f64,
        /// The time before it, s.
        before: f64,
    },
    /// The flight after begins before the flight before ends.
    #[error(
        "the flight before the impact ends at {end} s, and the one after it begins at {start} s: it must begin later"
    )]
    Overlap {
        /// Last sample before, s.
        end: f64,
        /// First sample after, s.
        start: f64,
    },
    /// Two flights that don't meet.
    #[error(
        "no impact joins the two flights: the fit of pose, velocities and time ended after {steps} steps at {rest} m"
    )]
    NotJoined {
        /// Steps taken.
        steps: usize,
        /// Root mean square of what is left, m.
        rest: f64,
    },
    /// A robot without shapes, and no point said.
    #[error("the robot has no collision shape to find the touching point by: say which point touches")]
    NoShape,
    /// Nothing carries the inertia that is to be scaled.
    #[error(
        "the scale of inertia can't be fitted to plain numbers: a Delassus matrix is all there is, give a robot and q"
    )]
    NoInertia,
    /// Every set of coefficients was refused.
    #[error("the law refuses these impacts at every trial: {0}")]
    Refused(String),
    /// Something about the robot or its states.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// What the law refuses.
    #[error(transparent)]
    Impact(#[from] ImpactError),
    /// What the simulation refuses.
    #[error(transparent)]
    Simulation(#[from] SimError),
}
