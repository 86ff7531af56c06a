//! Errors of this crate. Every message contains the value, the rule it breaks and a remedy.

/// Why an impact problem was refused or a law has no solution.
///
/// Every message contains the value, the rule it breaks and a remedy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImpactError {
    /// A range whose ends are not in ascending order, or NaN.
    #[error("the range of {what} is {low} to {high}: give the lower number first, and no NaN")]
    Range {
        /// Which coefficient.
        what: &'static str,
        /// Lower end given.
        low: f64,
        /// Upper end given.
        high: f64,
    },

    /// A user-defined law, for which this crate has no derivative.
    #[error("{law} has no derivative: only the laws of this crate can be evaluated with dual numbers ({known})")]
    NotDifferentiable {
        /// Name of the law.
        law: &'static str,
        /// Names of the laws that have a derivative.
        known: String,
    },

    /// A user-defined law has failed.
    #[error("the law {law} has failed: {reason}")]
    UsersLaw {
        /// Name of the law.
        law: &'static str,
        /// Its reason.
        reason: String,
    },

    /// The outcome of a law fails a check: it is not given.
    #[error(
        "the outcome of the law {law} is refused: {check} is {found:e}, not {expected:e} within {allowed:e}; of a law of your own, check \
         the impulse; of a law of carom, leave the singular pose or change its coefficients, and report the matrix and the velocity"
    )]
    Outcome {
        /// Name of the law.
        law: &'static str,
        /// What does not hold, and the number that shows it.
        check: &'static str,
        /// The number found.
        found: f64,
        /// The number that it should be, or its bound.
        expected: f64,
        /// The difference that rounding and iterations may leave.
        allowed: f64,
    },

    /// A NaN or an infinity in the input.
    #[error(
        "{entry} is {value}: every number of an impact problem must be finite; \
         check the pose, the velocity and the inertias it was built from"
    )]
    NotFinite {
        /// The entry, as `delassus[row][column]` or `u_minus[row]`.
        entry: String,
        /// The value found.
        value: f64,
    },

    /// A Delassus matrix that no mass distribution has: not square, not symmetric, or with a negative eigenvalue.
    #[error("{0}")]
    Matrix(String),

    /// Sizes of matrices, vectors and lists that do not agree.
    #[error("{0}")]
    Sizes(String),

    /// An order of sequential impacts that leaves out a constraint or names one that is not there.
    #[error("the order {0}")]
    Order(String),

    /// A coefficient of a law is out of its range.
    #[error("{what} {value} {rule}")]
    Coefficient {
        /// The coefficient: `restitution`, `tangential restitution`, `impulse ratio`, `friction`, or the `bound` of dry friction.
        what: &'static str,
        /// The value given.
        value: f64,
        /// The rule it breaks and a remedy.
        rule: &'static str,
    },

    /// The normal direction is singular (`H_nn = 0`): the impulse would be infinite.
    #[error(
        "the normal direction is singular: H_nn = {inverse_mass} 1/kg is zero within rounding, relative to the trace \
         {trace} 1/kg of the Delassus matrix, so the impulse would be infinite; leave the singular pose or model the \
         compliance of the structure"
    )]
    SingularNormal {
        /// `H_nn` (1/kg).
        inverse_mass: f64,
        /// Trace of the Delassus matrix (1/kg), which bounds its largest eigenvalue.
        trace: f64,
    },

    /// The contact wedges: friction makes it stick, and a sticking contact has no inverse mass along its normal, so
    /// that no finite impulse reaches the prescribed end.
    #[error(
        "the contact wedges: friction {friction} makes it stick while it still approaches with \
         u_n = {normal_velocity} m/s, and while it sticks its normal direction is singular \
         (inverse mass {inverse_mass} 1/kg, H_nn = {free_inverse_mass} 1/kg), so no finite \
         impulse ends the impact; lower the friction or leave the singular pose"
    )]
    Wedged {
        /// Coefficient of friction.
        friction: f64,
        /// Normal velocity at which the contact sticks (m/s).
        normal_velocity: f64,
        /// Inverse mass along the normal of the sticking contact (1/kg).
        inverse_mass: f64,
        /// `H_nn` (1/kg).
        free_inverse_mass: f64,
    },

    /// A coefficient of a constraint is out of its range.
    #[error("constraint {index}: {reason}")]
    Constraint {
        /// Index of the constraint, from 0.
        index: usize,
        /// The rule that it breaks.
        reason: Box<ImpactError>,
    },

    /// An impact under the energetic law for several contacts that does not end.
    #[error(
        "the impact has not ended after {steps} steps: contacts on both sides of a body pass it to and fro without loss, or \
         the stiffnesses differ too much; lower the restitution or the ratios of the stiffnesses"
    )]
    Endless {
        /// Steps made.
        steps: usize,
    },

    /// A parameter of a compliant contact is out of its range.
    #[error("{what} is {value}: {rule}")]
    Compliance {
        /// Name of the parameter.
        what: &'static str,
        /// The value given.
        value: f64,
        /// The rule it breaks and a remedy.
        rule: &'static str,
    },

    /// The integration of a compliant impact stopped before the impact ended.
    #[error(
        "the impact has not ended at {time} s, after {steps} steps: the contact wedges, or the equations are too \
         stiff; raise the slip speed below which friction is smoothed, or the bristle's damping, or lower the friction"
    )]
    Unfinished {
        /// Time reached (s).
        time: f64,
        /// Steps made.
        steps: usize,
    },
}
