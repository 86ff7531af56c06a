//! The errors of this crate.

use carom_chain::ChainError;
use carom_chain::input::{MESSAGE, shortened};
use carom_impact::ImpactError;
use ivp::status::Status;
use nalgebra::Vector3;

/// The errors of impacts, scenes and simulations of a chain.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// An error of the chain: state, frame, URDF file.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// An error of the impact law.
    #[error(transparent)]
    Impact(#[from] ImpactError),
    /// The contact point or the normal of an impact is missing.
    #[error("missing contact {missing}: call {say}")]
    Incomplete {
        /// `point` or `normal`.
        missing: &'static str,
        /// The call to add.
        say: &'static str,
    },
    /// The contact point belongs to a link that is fixed to the world.
    #[error("link '{link}' is fixed to the world: no impact can move it, choose a link that a joint moves")]
    FixedPoint {
        /// The link.
        link: String,
    },
    /// The outcome of a run is not differentiable.
    #[error(
        "the run has no derivative: at {time} s {reason}; shorten the duration to before that time, or change the start, a coefficient or \
         the method (`method = \"events\"`)"
    )]
    NoDerivative {
        /// Time, s.
        time: f64,
        /// Why.
        reason: String,
    },
    /// The wish of an accuracy cannot be fulfilled.
    #[error("[run] accuracy = {accuracy:e}: {why}")]
    Accuracy {
        /// The error that the numbers of the run may have.
        accuracy: f64,
        /// Why not, and what to do.
        why: String,
    },
    /// The normal direction is singular (nᵀHn = 0): no joint moves the contact point along it.
    #[error(
        "at this pose no joint moves '{link}' along the normal {n:?} (singular direction): the load would pass into \
         the structure, and the impulse of any rigid law would be infinite; change the pose or the normal",
        n = .normal.as_slice()
    )]
    SingularNormal {
        /// The link.
        link: String,
        /// The unit normal, world axes.
        normal: Vector3<f64>,
    },
    /// With these joints locked no joint moves the contact point along the normal.
    #[error(
        "with its joints locked nothing moves '{link}' along the normal {n:?}: the inverse inertia there is zero, and the \
         impulse of any rigid law would be infinite; leave a joint free that moves it, let the base float (the robot is then one \
         rigid body), or give the joints a finite stiffness and a contact time",
        n = .normal.as_slice()
    )]
    Locked {
        /// The link.
        link: String,
        /// The unit normal, world axes.
        normal: Vector3<f64>,
    },
    /// No impulses at several points were found that satisfy the law.
    #[error(
        "no impulses at {points} satisfy the law {law}: they miss it by {:e} of the largest velocity of a point with the \
         coefficients of restitution given, and by {:e} without restitution, where 1e-9 is a solution; lower the friction, take \
         another law of several points, or leave out a point that others replace",
        .residuals[0], .residuals[1]
    )]
    Together {
        /// Name of the law.
        law: &'static str,
        /// The links of the points.
        points: String,
        /// Violation of the law with the coefficients given, and without restitution.
        residuals: [f64; 2],
    },
    /// The kinetic energy of the chain does not change by the work of the impulse.
    #[error(
        "the impact of '{link}' is refused: the kinetic energy of the chain changes by {found:e} J, but the impulse and the drives do \
         a work of {expected:e} J, and rounding explains {allowed:e} J; the mass matrix or the contact is nearly singular at this \
         pose: change the pose or the normal"
    )]
    Unbalanced {
        /// The link that is struck.
        link: String,
        /// Change of the kinetic energy, J.
        found: f64,
        /// Work of the impulse and of the drives, J.
        expected: f64,
        /// Difference that rounding may leave, J.
        allowed: f64,
    },
    /// The integrator failed.
    #[error("from t = {} s the motion can't be integrated: {reason}", short(*time))]
    Integration {
        /// Start of the integration, s.
        time: f64,
        /// Why the integrator ended, and what to do.
        reason: String,
    },
    /// An invalid number.
    #[error("{what} is {}: {rule}", short(*value))]
    Setting {
        /// Name of the number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The rule that it breaks.
        rule: &'static str,
    },
    /// The Jacobian of the tip is singular at this pose.
    #[error("at q = {q:?} the Jacobian of '{link}' is singular (arm stretched or folded): choose another pose")]
    SingularPose {
        /// The link.
        link: String,
        /// The pose.
        q: Vec<f64>,
    },
    /// The given link lengths are not those of the chain.
    #[error(
        "with links of {lengths:?} m the tip of '{chain}' should be at {target:?}, but is at {found:?}: give the chain's lengths"
    )]
    Lengths {
        /// The chain.
        chain: String,
        /// The lengths given, m.
        lengths: Vec<f64>,
        /// Where the tip should be, m.
        target: [f64; 2],
        /// Where it is, m.
        found: [f64; 2],
    },
    /// At the start the chain overlaps a surface, another link or a joint limit.
    #[error(
        "at the start {touch} overlaps by {} {unit}: choose a start without overlap{}", four_digits(*depth),
        if *unit == "rad" { " (angles of joints are in rad)" } else if touch.contains(" limit of ") { "" } else { ", or turn a normal that points away from the robot" }
    )]
    Overlap {
        /// Name of the touch.
        touch: String,
        /// Depth of the overlap, in `unit`.
        depth: f64,
        /// `m`, or `rad` at the limit of a revolute joint.
        unit: &'static str,
    },
    /// A touch that may close from now on overlaps.
    #[error(
        "at {time} s closes_while of {touch} becomes true, and the contact overlaps by {} {unit}: choose a condition that becomes true \
         while it is open", four_digits(*depth)
    )]
    ClosesInside {
        /// Time, s.
        time: f64,
        /// Name of the touch.
        touch: String,
        /// Depth of the overlap, in `unit`.
        depth: f64,
        /// `m`, or `rad` at the limit of a revolute joint.
        unit: &'static str,
    },
    /// Velocities of time steps have grown beyond all numbers.
    #[error(
        "at t = {time} s the numbers of a time step exceed the range of f64: check the units of forces, gains and masses; where the time \
         steps before gain energy, give a shorter contact_step or another law of several contacts"
    )]
    Diverged {
        /// Start of the step, s.
        time: f64,
    },
    /// The flag [`Simulation::stop`](crate::Simulation::stop) was set.
    #[error("the simulation was stopped at t = {time} s")]
    Stopped {
        /// Time, s.
        time: f64,
    },
    /// A loop of the mechanism cannot be closed near the start.
    #[error(
        "loop '{name}' stays open by ({}, {}, {}) m, world axes, however the joints move from this start: correct its frames, or \
         choose a start near a closed configuration", four_digits(gap[0]), four_digits(gap[1]), four_digits(gap[2])
    )]
    Loop {
        /// The loop.
        name: String,
        /// From the second of two points that it should keep together to the first, m, world axes.
        gap: [f64; 3],
    },
    /// A mechanism with loops is at a pose at which it could branch and does not pass it.
    #[error(
        "at t = {time} s the mechanism is at a pose at which it could branch (the constraints of its loops depend on each other \
         there), and its further motion is not determined: it is followed through such a pose only if it does not start, stop, \
         turn back or touch anything there. Choose another start, or let a joint limit keep it away from this pose"
    )]
    Branch {
        /// Time, s.
        time: f64,
    },
    /// An invalid coefficient of a contact.
    #[error("{touch}: {what} is {}: {rule}", short(*value))]
    Contact {
        /// Name of the touch.
        touch: String,
        /// Name of the coefficient.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The rule that it breaks.
        rule: &'static str,
    },
    /// An invalid request about a link, a joint, a loop or a parameter.
    #[error("{what} '{name}' {problem}")]
    Named {
        /// `link`, `joint`, `loop` or `parameter`.
        what: &'static str,
        /// Its name.
        name: String,
        /// The problem and what to do.
        problem: String,
    },
    /// A user's own [`Controller`](crate::Controller) has failed.
    #[error("controller '{controller}': {reason}")]
    UsersController {
        /// Name of the controller.
        controller: String,
        /// What it says.
        reason: String,
    },
    /// A force of a contact was requested that a single moment does not give: of a rigid contact, or of one whose force depends on
    /// its history.
    #[error("{touch}{why}")]
    NoForce {
        /// Name of the touch.
        touch: String,
        /// The reason, and what to do.
        why: &'static str,
    },
    /// Rigid sliding has no consistent acceleration (Painlevé).
    #[error(
        "at t = {time} s {touch} slides into a jam: with friction {friction} no rigid acceleration is consistent (Painlevé); \
         lower the friction"
    )]
    Jam {
        /// Time, s.
        time: f64,
        /// Name of the touch.
        touch: String,
        /// Coefficient of friction.
        friction: f64,
    },
    /// No velocity of the robot keeps surfaces that move from penetrating it.
    #[error(
        "at t = {time} s {touches} squeeze the robot: no motion of it keeps them all from penetrating, and they still approach at {speed} \
         m/s (or rad/s); change the motion of the surface, or make a contact compliant"
    )]
    Squeezed {
        /// Time, s.
        time: f64,
        /// Names of the touches.
        touches: String,
        /// The fastest approach that is left, m/s or rad/s.
        speed: f64,
    },
    /// Derivatives of impacts with locked or impedance-weighted joints, and saltation matrices, which contain them, are not implemented.
    #[error(
        "derivatives and saltation matrices of an impact with locked or impedance-weighted joints are not implemented: leave the joints \
         free"
    )]
    DerivativeOfHeldJoints,
    /// A motion or a robot to which no feedback can be added; the text says why.
    #[error("feedback: {0}")]
    Feedback(String),
    /// An invalid scene file.
    #[error("{file}: {}", shortened(rule, MESSAGE))]
    Scene {
        /// The file.
        file: String,
        /// Key, value, the rule that is broken, and what to do.
        rule: String,
    },
    /// An invalid collision shape or mesh.
    #[error(transparent)]
    Shape(#[from] carom_contact::ContactError),
}

/// # Errors
/// [`SimError::Setting`] unless the number is `fine`.
pub(crate) fn require(fine: bool, what: &'static str, value: f64, rule: &'static str) -> Result<(), SimError> {
    if fine { Ok(()) } else { Err(SimError::Setting { what, value, rule }) }
}

/// [`SimError::Named`].
pub(crate) fn named(what: &'static str, name: &str, problem: impl Into<String>) -> SimError {
    SimError::Named { what, name: name.to_owned(), problem: problem.into() }
}

/// Rounds to four significant digits; the others are rounding errors of the pose.
fn four_digits(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

/// Why an integrator ended, and what to do.
pub(crate) fn ended(status: Status) -> &'static str {
    match status {
        Status::StepSizeTooSmall => {
            "its steps become shorter than the rounding of the time: the motion is too fast for numbers of 16 digits. Check \
             the units of forces, gains, stiffness and masses"
        }
        Status::NeedLargerNMax => "it takes too many steps: give a larger tolerance or a shorter duration",
        Status::ProbablyStiff => "it is stiff: lower the gains or the stiffness",
        Status::SingularMatrix | Status::PoorConvergence => {
            "Newton's method does not solve the equations of an implicit step: give a smaller max_step"
        }
        Status::Success | Status::UserInterrupt => "it was interrupted",
    }
}

/// A number of a message: with an exponent where it would have many zeros.
fn short(value: f64) -> String {
    let decimal = value == 0.0 || !value.is_finite() || (1e-6..1e12).contains(&value.abs());
    if decimal { value.to_string() } else { format!("{value:e}") }
}
