//! What lasts between two events: the closed contacts with their modes, and the joints with dry friction.

use crate::contact::Touch;
use nalgebra::Vector3;

/// A closed contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lasting {
    pub touch: usize,
    pub hold: Hold,
}

/// How a closed contact enters the equations of motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Hold {
    /// It slides. The direction of slip, a unit vector, holds while the slip is too small to define it; it is zero without
    /// friction and at joint limits.
    Slides { toward: Vector3<f64> },
    /// It slides from rest, still slowly, in this direction: see `starting.rs`.
    Starts { toward: Vector3<f64> },
    /// It sticks.
    Sticks,
    /// A latch: it sticks whatever the force.
    Latched,
    /// A compliant contact with this damping: a force without a constraint. `deepest` is the penetration, m, at which it
    /// last changed from loading to unloading; −∞ if it did not, or has become deeper.
    Presses { damping: f64, deepest: f64 },
}

impl Lasting {
    /// A rigid contact that slips in this direction, or rests.
    pub fn of(touch: usize, of: &Touch, slip: Option<Vector3<f64>>) -> Self {
        let rough = of.contact.law.friction() > 0.0 && of.link().is_some();
        let hold = match slip {
            _ if of.contact.latch => Hold::Latched,
            _ if !rough => Hold::Slides { toward: Vector3::zeros() },
            Some(toward) => Hold::Slides { toward },
            None => Hold::Sticks,
        };
        Self { touch, hold }
    }

    /// Whether it is a constraint.
    pub fn is_rigid(&self) -> bool {
        !matches!(self.hold, Hold::Presses { .. })
    }
}

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
