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

    /// The Delassus matrix differs from its transpose.
    #[error(
        "delassus[{row}][{column}] = {upper} but delassus[{column}][{row}] = {lower}: the matrix \
         must be symmetric within {allowed} (1e-8 of its largest entry); build it as J M^-1 J^T"
    )]
    NotSymmetric {
        /// Row of the entry above the diagonal.
        row: usize,
        /// Column of the entry above the diagonal.
        column: usize,
        /// Entry above the diagonal (1/kg).
        upper: f64,
        /// The entry below the diagonal (1/kg).
        lower: f64,
        /// Largest difference allowed (1/kg).
        allowed: f64,
    },

    /// The Delassus matrix has a negative eigenvalue, which no mass distribution has.
    #[error(
        "the Delassus matrix is not positive semidefinite: eliminated from the normal upwards, \
         its pivot at [{row}][{row}] is {pivot}, below -{allowed} (rounding); \
         no mass distribution has it, check the mass matrix and the order of the contact axes"
    )]
    NotPositive {
        /// Row of the negative pivot.
        row: usize,
        /// The pivot (1/kg).
        pivot: f64,
        /// How far below zero rounding may put a pivot (1/kg).
        allowed: f64,
    },

    /// A coefficient of restitution outside [0, 1].
    #[error("restitution {value} is outside [0, 1]: 0 is no rebound, 1 a full rebound")]
    Restitution {
        /// The value given.
        value: f64,
    },

    /// A coefficient of tangential restitution outside [-1, 1].
    #[error(
        "tangential restitution {value} is outside [-1, 1]: -1 is no tangential impulse, 0 one that stops the slip, \
         1 one that reverses it"
    )]
    TangentialRestitution {
        /// The value given.
        value: f64,
    },

    /// An impulse ratio that is NaN or infinite.
    #[error("impulse ratio {value} is not finite: give tangential over normal impulse, negative against the slip")]
    ImpulseRatio {
        /// The value given.
        value: f64,
    },

    /// A coefficient of friction that is negative, infinite or NaN.
    #[error("friction {value} is not a finite number >= 0: give the Coulomb coefficient, 0 for none")]
    Friction {
        /// The value given.
        value: f64,
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

    /// Sizes of an impact at several contacts that do not agree.
    #[error(
        "{what} has {found} rows, but the constraints have {expected}: a contact has three (tangents first, normal \
         last), every other constraint one"
    )]
    Sizes {
        /// What has the wrong size: `delassus`, `u_minus`, `u_free`, `warm_start`.
        what: &'static str,
        /// Rows of all constraints together.
        expected: usize,
        /// Rows found.
        found: usize,
    },

    /// A Delassus matrix that is not square.
    #[error("delassus is {rows} x {columns}: it must be square; build it as J M^-1 J^T")]
    NotSquare {
        /// Rows found.
        rows: usize,
        /// Columns found.
        columns: usize,
    },

    /// A coefficient of a constraint is out of its range.
    #[error("constraint {index}: {reason}")]
    Constraint {
        /// Index of the constraint, from 0.
        index: usize,
        /// The rule that it breaks.
        reason: Box<ImpactError>,
    },

    /// A bound of dry friction that is negative, infinite or NaN.
    #[error(
        "bound {value} is not a finite number >= 0: give the largest impulse of dry friction, which is the joint's \
         friction force times the time it acts; 0 for an instantaneous impact; for no bound use `Held`"
    )]
    Bound {
        /// The value given (N s or N m s).
        value: f64,
    },

    /// A contact with friction under a law that has none.
    #[error(
        "friction {value} has no part in the energetic law for several contacts: give 0, or choose the law of Moreau, \
         of Glocker and Pfeiffer, or sequential impacts"
    )]
    WithoutFriction {
        /// The coefficient given.
        value: f64,
    },

    /// The number of stiffnesses does not fit the number of constraints.
    #[error("{found} stiffnesses for {constraints} constraints: give one for each, or none if all are equal")]
    Stiffnesses {
        /// Stiffnesses given.
        found: usize,
        /// Number of constraints.
        constraints: usize,
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

    /// The number of rows does not fit the number of compliant contacts.
    #[error(
        "{what} has {found} rows for {contacts} compliant contacts: each has one (its normal), two (in the plane) or \
         three (in space), tangents first, normal last"
    )]
    CompliantSizes {
        /// What has the wrong size: `delassus`, `u_minus`.
        what: &'static str,
        /// Rows found.
        found: usize,
        /// Number of contacts.
        contacts: usize,
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
