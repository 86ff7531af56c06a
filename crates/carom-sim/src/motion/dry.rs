//! Dry friction of joints.

/// A joint with dry friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DryJoint {
    pub v: usize,
    /// N m or N.
    pub friction: f64,
    pub state: Dry,
}

/// The state of the dry friction of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Dry {
    /// The joint sticks.
    Holds,
    /// The joint slips in this direction (1 or −1), with the friction against it.
    Brakes(f64),
}
