//! What can be wrong with an impact of a chain.

use carom_chain::ChainError;
use carom_impact::ImpactError;

/// Every way in which this crate refuses its input.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// The chain refuses.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// The impact law refuses.
    #[error(transparent)]
    Impact(#[from] ImpactError),
    /// Nothing was said about where the chain is hit.
    #[error("no contact {missing} was given: say {say}")]
    Incomplete {
        /// `point` or `normal`.
        missing: &'static str,
        /// The call that is missing.
        say: &'static str,
    },
    /// The point does not move at all: it belongs to the base.
    #[error("link '{link}' is fixed to the world: no impact can move it, choose a link that a joint moves")]
    FixedPoint {
        /// The link.
        link: String,
    },
    /// The normal direction is singular: no joint motion moves the point along it.
    #[error(
        "at this pose no joint moves '{link}' along the normal {normal:?} (singular direction): the structure would take \
         the impact, and the impulse of any rigid law would be infinite; change the pose or the normal"
    )]
    SingularNormal {
        /// The link.
        link: String,
        /// The unit normal.
        normal: [f64; 3],
    },
    /// With these joints locked nothing moves the point along the normal.
    #[error(
        "with its joints locked nothing moves '{link}' along the normal {normal:?}: the inverse inertia there is zero, and the \
         impulse of any rigid law would be infinite; leave a joint free that moves it, let the base float (the robot is then one \
         rigid body), or give the joints a finite stiffness and a contact time"
    )]
    Locked {
        /// The link.
        link: String,
        /// The unit normal.
        normal: [f64; 3],
    },
    /// The motion can't be integrated.
    #[error("from t = {time} s the motion can't be integrated: {reason}")]
    Integration {
        /// Start of the leg, s.
        time: f64,
        /// What the integrator said.
        reason: String,
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
    /// The pose leaves a tip without freedom.
    #[error(
        "at q = {q:?} '{link}' can't move in all directions of the plane (stretched or folded): choose another pose"
    )]
    SingularPose {
        /// The link.
        link: String,
        /// The pose.
        q: Vec<f64>,
    },
    /// Given lengths are not those of the chain.
    #[error(
        "with links of {lengths:?} m the tip of '{chain}' should be at {target:?}, and is at {found:?}: give the chain's lengths"
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
    /// The chain starts inside something.
    #[error("at the start {touch} overlaps by {} m: move the start apart", four_digits(*depth))]
    Overlap {
        /// What touches.
        touch: String,
        /// How deep, m.
        depth: f64,
    },
    /// The rule of a contact can't be followed.
    #[error("{touch}: {what} is {value}: {rule}")]
    Contact {
        /// What touches.
        touch: String,
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The rule.
        rule: &'static str,
    },
    /// Two links that can't be a pair.
    #[error("link '{link}' {problem}")]
    LinkPair {
        /// The link.
        link: String,
        /// What is wrong, and what to do.
        problem: &'static str,
    },
    /// A rigid contact has impulses, not forces.
    #[error("{touch} is rigid: only a contact with a compliance presses with a force while it is hit")]
    Rigid {
        /// What touches.
        touch: String,
    },
    /// A force that depends on what happened before.
    #[error(
        "{touch}: its force has a memory (where it was turned back, or a bristle's deflection), which a single moment does \
         not hold; choose the Hunt-Crossley or Kelvin-Voigt force and smoothed friction to ask for forces afterwards"
    )]
    Memory {
        /// What touches.
        touch: String,
    },
    /// Rigid sliding has no consistent acceleration (Painlevé).
    #[error(
        "at t = {time} s {touch} slides into a jam: with friction {friction} no rigid acceleration is consistent (Painlevé); \
         lower the friction"
    )]
    Jam {
        /// Time, s.
        time: f64,
        /// What touches.
        touch: String,
        /// Coefficient of friction.
        friction: f64,
    },
    /// Derivatives know joints that are free only.
    #[error("an impact with held joints has no derivative here: ask for it with the joints free")]
    DerivativeOfHeldJoints,
    /// No law of that name.
    #[error("no law is named '{name}': the laws are {known}")]
    UnknownLaw {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// The scene file breaks a rule.
    #[error("{file}: {rule}")]
    Scene {
        /// The file.
        file: String,
        /// Key, value, rule, and what to do.
        rule: String,
    },
    /// A shape can't be made.
    #[error(transparent)]
    Shape(#[from] carom_contact::ContactError),
}

/// What is beyond is rounding of the pose.
fn four_digits(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}
