//! Errors of this crate: of a file, of a chain, or of the arguments of a call.

use crate::input::{MESSAGE, shortened, shown};
use std::path::PathBuf;

/// Errors of this crate. Each message names the element, its value, the rule that it breaks and what to do about it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ChainError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {reason}", shown(&path.to_string_lossy()))]
    Unreadable {
        /// The file asked for.
        path: PathBuf,
        /// Message of the operating system.
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
        /// The value, the rule that it breaks, and what to do.
        rule: String,
    },
    /// The file is xacro, from which a program of ROS makes URDF; `file` is the path or `<string>`.
    #[error(
        "{file}:{line}: {element}: the file is xacro, not URDF: expand it with `pip install xacro` and `xacro {} -o {}`",
        quoted(&xacro_names(file)[0]), quoted(&xacro_names(file)[1])
    )]
    Xacro {
        /// Path of the file, or `<string>`.
        file: String,
        /// Line of the element, counted from 1.
        line: u32,
        /// The element, with its name.
        element: String,
    },
    /// A name of a robot that cannot be used in a chain of several robots.
    #[error("robot name '{}' {problem}", shown(name))]
    RobotName {
        /// The name.
        name: String,
        /// The rule that it breaks, and what to do.
        problem: &'static str,
    },
    /// A mesh file is not found.
    #[error("mesh '{}' is not found; {tried}", shown(name))]
    MeshNotFound {
        /// Its name: a path, `file://…` or `package://…`.
        name: String,
        /// The paths that were tried, or why none was.
        tried: String,
    },
    /// A package is not found.
    #[error("there is no package '{}' {searched}", shown(name))]
    PackageNotFound {
        /// Its name.
        name: String,
        /// Where it was searched for.
        searched: String,
    },
    /// Links move without mass and inertia, so the mass matrix is singular at every configuration.
    #[error(
        "'{chain}' has no dynamics, because nothing that these links carry has mass: {}. Give them an <inertial>, load the \
         robot with --repair (LoadOptions::repair), which welds them to the links that carry them, or lock their joints",
        shortened(&links.join(", "), MESSAGE)
    )]
    Massless {
        /// Name of the chain.
        chain: String,
        /// The links, in the order of the file.
        links: Vec<String>,
    },
    /// The chain has no link of that name.
    #[error("no link is named '{}'; {hint}", shown(name))]
    UnknownFrame {
        /// The name asked for.
        name: String,
        /// The nearest name, or the list of names.
        hint: String,
    },
    /// A link that cannot be divided into segments.
    #[error("link '{link}' as a beam: {problem}")]
    Beam {
        /// The link.
        link: String,
        /// The value, the rule that it breaks, and what to do.
        problem: String,
    },
    /// The chain has no joint of that name.
    #[error("no joint is named '{}'; {hint}", shown(name))]
    UnknownJoint {
        /// The name asked for.
        name: String,
        /// The nearest name, or the list of names.
        hint: String,
    },
    /// A vector has the wrong length.
    #[error("{what} has {got} numbers, {expected} are needed ({layout})")]
    WrongLength {
        /// Name of the vector, for example `q`, `qd`, `tau` or `qdd`.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The length that is needed.
        expected: usize,
        /// Names of the joints in the order of the entries.
        layout: String,
    },
    /// A number is NaN or infinite.
    #[error("{what}[{index}] is {value}: every number must be finite")]
    NotFinite {
        /// Name of the vector.
        what: &'static str,
        /// Index of the entry.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// The quaternion of a floating joint is not a unit quaternion.
    #[error("joint '{joint}': quaternion (qx qy qz qw) has norm {norm}, not 1: normalise it")]
    NotUnitQuaternion {
        /// Name of the floating joint.
        joint: String,
        /// Norm of its quaternion.
        norm: f64,
    },
    /// The mass matrix is singular, because a joint moves no inertia.
    #[error(
        "joint '{joint}' moves no inertia at this pose, so its acceleration is not determined: give the links below it mass and inertia, or lock it"
    )]
    NoInertia {
        /// The joint.
        joint: String,
    },
    /// The numbers of a pose are so large that the mass matrix has no digits for the inertia of a joint.
    #[error("joint '{joint}': {problem}")]
    TooLarge {
        /// The joint.
        joint: String,
        /// What is too large, and what to do.
        problem: String,
    },
    /// With all joints locked, the robot has no rotational inertia about an axis about which an impulse at the point would
    /// rotate it.
    #[error(
        "with all joints locked, the robot has no rotational inertia about an axis about which an impulse at this point \
         would rotate it: give its links rotational inertia, or choose a point on that axis"
    )]
    NoLockedInertia,
    /// The chain has mimic joints, which the O(n) recursion and the probe do not support.
    #[error(
        "'{chain}' has mimic joints, so several bodies share one coordinate, and the O(n) recursion does not support them: \
         use the mass matrix (Kinematics::mass_matrix, Kinematics::contact_inertia)"
    )]
    Coupled {
        /// Name of the chain.
        chain: String,
    },
    /// The point belongs to the world, which no joint moves.
    #[error("the point belongs to the fixed base of '{chain}', which no joint moves: choose a point of a moving link")]
    FixedPoint {
        /// Name of the chain.
        chain: String,
    },
    /// No joint velocities give a point of a link a velocity.
    #[error(
        "at this pose no joint velocities give the link '{link}' the velocity ({}, {}, {}) m/s{how}: change q or the velocity",
        velocity[0], velocity[1], velocity[2]
    )]
    NoVelocity {
        /// Name of the link.
        link: String,
        /// The velocity, world axes, m/s.
        velocity: [f64; 3],
        /// What else was asked for.
        how: &'static str,
    },
    /// A number is outside its range.
    #[error("{what} is {value}: {rule}")]
    OutOfRange {
        /// Name of the quantity, and of the link or joint that it belongs to.
        what: String,
        /// Its value.
        value: f64,
        /// The rule that it breaks.
        rule: &'static str,
    },
    /// A direction is zero or not finite, so that it cannot be normalised.
    #[error("direction {given:?} has length {length}: a direction needs a finite, non-zero length")]
    NoDirection {
        /// The vector as it was given.
        given: Vec<f64>,
        /// Its length.
        length: f64,
    },
    /// A reduction does not apply to this chain.
    #[error("{0}")]
    NotReducible(String),
}

impl ChainError {
    /// The error with another name of the file that it is about.
    #[must_use]
    pub fn in_file(mut self, name: String) -> Self {
        if let Self::Urdf { file, .. } | Self::Xacro { file, .. } = &mut self {
            *file = name;
        }
        self
    }
}

/// The names of a xacro file and of its expansion.
fn xacro_names(file: &str) -> [String; 2] {
    if file == "<string>" {
        return ["FILE.xacro".into(), "FILE.urdf".into()];
    }
    let stem = file.strip_suffix(".xacro").or_else(|| file.strip_suffix(".urdf")).unwrap_or(file);
    let stem = stem.strip_suffix(".urdf").unwrap_or(stem);
    let expanded = format!("{stem}.urdf");
    [file.into(), if expanded == file { format!("{stem}.expanded.urdf") } else { expanded }]
}

/// A file name as one word of a command.
fn quoted(name: &str) -> String {
    let plain = |letter: char| letter.is_alphanumeric() || "._-/+".contains(letter);
    if name.chars().all(plain) { name.into() } else { format!("'{}'", name.replace('\'', r"'\''")) }
}

#[cfg(test)]
mod tests {
    use super::{quoted, xacro_names};

    #[test]
    fn commands_for_xacro_write_another_file() {
        let cases = [
            ("a/arm.urdf.xacro", "a/arm.urdf"),
            ("arm.xacro", "arm.urdf"),
            ("arm.urdf", "arm.expanded.urdf"),
            ("arm", "arm.urdf"),
            ("<string>", "FILE.urdf"),
        ];
        for (file, expanded) in cases {
            let [own, other] = xacro_names(file);
            assert_eq!(other, expanded);
            assert_ne!(own, other);
        }
        assert_eq!(["my arm.xacro", "it's.xacro"].map(quoted), [r"'my arm.xacro'", r"'it'\''s.xacro'"]);
    }
}
