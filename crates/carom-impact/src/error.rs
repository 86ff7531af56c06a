//! What is refused, with the numbers that made it so.

/// Why an impact problem was refused or a law has no answer.
///
/// Every message names the value, the rule it breaks, and what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImpactError {
    /// A range whose ends are not in order.
    #[error("the range of {what} is {low} to {high}: give the lower number first, and no NaN")]
    Range {
        /// Of what.
        what: &'static str,
        /// First end.
        low: f64,
        /// Last end.
        high: f64,
    },

    /// A law that is not one of this crate's.
    #[error("{law} has no derivative: only the laws of this crate can be carried over to dual numbers ({known})")]
    NotDifferentiable {
        /// Its name.
        law: &'static str,
        /// The laws that have one.
        known: String,
    },

    /// A NaN or an infinity in the input.
    #[error(
        "{entry} is {value}: every number of an impact problem must be finite; \
         check the pose, the velocity and the inertias it was built from"
    )]
    NotFinite {
        /// Where it stands, as `delassus[row][column]` or `u_minus[row]`.
        entry: String,
        /// The number found.
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
        /// Its mirror image (1/kg).
        lower: f64,
        /// Largest difference allowed (1/kg).
        allowed: f64,
    },

    /// The Delassus matrix has a negative eigenvalue: no mass has it.
    #[error(
        "the Delassus matrix is not positive semidefinite: eliminated from the normal upwards, \
         its pivot at [{row}][{row}] is {pivot}, below -{allowed} (rounding); \
         no mass distribution has it, check the mass matrix and the order of the contact axes"
    )]
    NotPositive {
        /// Row of the offending pivot.
        row: usize,
        /// The pivot (1/kg).
        pivot: f64,
        /// How far below zero rounding may push it (1/kg).
        allowed: f64,
    },

    /// A coefficient of restitution outside [0, 1].
    #[error("restitution {value} is outside [0, 1]: 0 is a dead stop, 1 a full rebound")]
    Restitution {
        /// The value given.
        value: f64,
    },

    /// A coefficient of tangential restitution outside [-1, 1].
    #[error(
        "tangential restitution {value} is outside [-1, 1]: -1 is no tangential blow, 0 one that stops the slip, \
         1 one that turns it round"
    )]
    TangentialRestitution {
        /// The value given.
        value: f64,
    },

    /// An impulse ratio that is not a number, or infinite.
    #[error("impulse ratio {value} is not finite: give tangential over normal impulse, negative against the slip")]
    ImpulseRatio {
        /// The value given.
        value: f64,
    },

    /// A negative or infinite coefficient of friction.
    #[error("friction {value} is not a finite number >= 0: give the Coulomb coefficient, 0 for none")]
    Friction {
        /// The value given.
        value: f64,
    },

    /// The contact cannot move along its normal: the impulse would be infinite.
    #[error(
        "the contact cannot move along its normal: H_nn = {inverse_mass} 1/kg is nothing beside \
         the trace {trace} 1/kg of the Delassus matrix, so the impulse would be infinite; \
         the structure takes such a blow: leave the singular pose or model what gives way"
    )]
    SingularNormal {
        /// `H_nn` (1/kg).
        inverse_mass: f64,
        /// Trace of the Delassus matrix (1/kg), which bounds its largest eigenvalue.
        trace: f64,
    },

    /// Friction locks a contact that has no mobility left while it still approaches.
    #[error(
        "the contact wedges: friction {friction} holds it while it still approaches with \
         u_n = {normal_velocity} m/s, and held so it cannot move along its normal \
         (inverse mass {inverse_mass} 1/kg beside H_nn = {free_inverse_mass} 1/kg), so no finite \
         impulse ends the impact; lower the friction or leave the singular pose"
    )]
    Wedged {
        /// Coefficient of friction.
        friction: f64,
        /// Normal velocity at which the contact is held (m/s).
        normal_velocity: f64,
        /// Inverse mass along the normal of the held contact (1/kg).
        inverse_mass: f64,
        /// `H_nn` (1/kg).
        free_inverse_mass: f64,
    },

    /// The parts of an impact at several places do not fit one another.
    #[error(
        "{what} has {found} rows, but the constraints take {expected}: a contact takes three (tangents first, normal \
         last), every other constraint one"
    )]
    Sizes {
        /// What has the wrong size: `delassus`, `u_minus`, `u_free`, `warm_start`.
        what: &'static str,
        /// Rows that the constraints take together.
        expected: usize,
        /// Rows found.
        found: usize,
    },

    /// A matrix that is not square.
    #[error("delassus is {rows} x {columns}: it must be square; build it as J M^-1 J^T")]
    NotSquare {
        /// Rows found.
        rows: usize,
        /// Columns found.
        columns: usize,
    },

    /// A constraint's coefficient is out of its range.
    #[error("constraint {index}: {reason}")]
    Constraint {
        /// Its place in the list.
        index: usize,
        /// What is wrong with it.
        reason: Box<ImpactError>,
    },

    /// A negative or infinite bound of dry friction.
    #[error(
        "bound {value} is not a finite number >= 0: give the largest impulse of dry friction, the joint's \
         friction force times the time it acts; 0 for an impact in no time, `Held` for one without a bound"
    )]
    Bound {
        /// The value given (N s or N m s).
        value: f64,
    },

    /// A parameter of a compliant contact breaks its rule.
    #[error("{what} is {value}: {rule}")]
    Compliance {
        /// Which parameter.
        what: &'static str,
        /// The value given.
        value: f64,
        /// The rule, and what to do.
        rule: &'static str,
    },

    /// Compliant contacts and the rows of their problem do not fit.
    #[error(
        "{what} has {found} rows for {contacts} compliant contacts: each takes one (its normal), two (in the plane) or \
         three (in space), tangents first, normal last"
    )]
    CompliantSizes {
        /// What has the wrong size: `delassus`, `u_minus`.
        what: &'static str,
        /// Rows found.
        found: usize,
        /// How many contacts there are.
        contacts: usize,
    },

    /// An impact through compliant contacts could not be followed to its end.
    #[error(
        "the impact has not ended at {time} s, after {steps} steps: friction wedges it, or its equations are too stiff; \
         raise the slip speed below which friction is smoothed, or the bristle's damping, or lower the friction"
    )]
    Unfinished {
        /// Time reached (s).
        time: f64,
        /// Steps made.
        steps: usize,
    },
}
