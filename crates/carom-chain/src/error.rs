//! What can be wrong with a chain, its file, or what is asked of it.

use std::path::PathBuf;

/// Every way in which this crate refuses its input. Each message names the element, the value, the rule it breaks
/// and what to do about it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ChainError {
    /// The file can't be read.
    #[error("{}: cannot be read: {reason}", path.display())]
    Unreadable {
        /// The file asked for.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// The URDF breaks a rule; `file` is the path or `<string>`.
    #[error("{file}:{line}: {element}: {rule}")]
    Urdf {
        /// Path of the file, or `<string>`.
        file: String,
        /// Line of the element, counted from 1.
        line: u32,
        /// The element, with its name: `link 'upper_arm'`.
        element: String,
        /// The value, the rule it breaks, and what to do.
        rule: String,
    },
    /// No link of that name.
    #[error("no link is named '{name}'; {hint}")]
    UnknownFrame {
        /// The name asked for.
        name: String,
        /// The nearest name, or the list of names.
        hint: String,
    },
    /// No joint of that name.
    #[error("no joint is named '{name}'; {hint}")]
    UnknownJoint {
        /// The name asked for.
        name: String,
        /// The nearest name, or the list of names.
        hint: String,
    },
    /// A vector has the wrong length.
    #[error("{what} has {got} numbers, {expected} are needed ({layout})")]
    WrongLength {
        /// `q`, `qd`, `tau` or `qdd`.
        what: &'static str,
        /// How many were given.
        got: usize,
        /// How many are needed.
        expected: usize,
        /// The order in which they are read.
        layout: String,
    },
    /// A number is NaN or infinite.
    #[error("{what}[{index}] is {value}: every number must be finite")]
    NotFinite {
        /// Which vector.
        what: &'static str,
        /// Which entry.
        index: usize,
        /// The value.
        value: f64,
    },
    /// The quaternion of a floating joint is not a unit quaternion.
    #[error("joint '{joint}': quaternion (qx qy qz qw) has norm {norm}, not 1: normalise it")]
    NotUnitQuaternion {
        /// The floating joint.
        joint: String,
        /// Its norm.
        norm: f64,
    },
    /// The mass matrix is singular: a joint moves no inertia.
    #[error(
        "joint '{joint}' moves no inertia at this pose, so its acceleration is not determined: give the links below it mass and inertia, or lock it"
    )]
    NoInertia {
        /// The joint.
        joint: String,
    },
    /// With all joints locked a point can be turned away by no effort at all.
    #[error(
        "with its joints locked the robot has no inertia about an axis that an impulse at this point turns it about: give its \
         links inertia, or hit it on that axis"
    )]
    NoLockedInertia,
    /// Mimic joints couple bodies that a recursion takes for free.
    #[error(
        "mimic joints couple several bodies of '{chain}' to one coordinate, and the recursion takes them for free: use the dense way"
    )]
    Coupled {
        /// The chain.
        chain: String,
    },
    /// A point of the world, which no joint moves.
    #[error("the point belongs to the fixed base of '{chain}', which no joint moves: choose a point of a moving link")]
    FixedPoint {
        /// The chain.
        chain: String,
    },
    /// A number breaks its rule.
    #[error("{what} is {value}: {rule}")]
    OutOfRange {
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The rule.
        rule: &'static str,
    },
    /// A direction is not a unit vector and can't be made one.
    #[error("direction {given:?} has length {length}: a direction needs a finite, non-zero length")]
    NoDirection {
        /// As given.
        given: Vec<f64>,
        /// Its length.
        length: f64,
    },
    /// A reduction does not apply to this chain.
    #[error("{0}")]
    NotReducible(String),
}
