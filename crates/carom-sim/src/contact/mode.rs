//! The contact modes of a chain, in each of which its motion is smooth.

use serde::{Serialize, Serializer};

/// The mode of one lasting contact, or of the whole chain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContactMode {
    /// No lasting contact.
    Free,
    /// A lasting contact that slides.
    Sliding {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
    },
    /// A lasting contact that sticks.
    Sticking {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
    },
    /// A contact held by a latch.
    Latched {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
    },
    /// A compliant contact with a positive penetration.
    Pressing {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
        /// Damping of its normal force, from the approach velocity: a in s/m for Hunt & Crossley, c in N s/m for Kelvin &
        /// Voigt, 0 for Walton & Braun.
        damping: f64,
    },
    /// Several lasting contacts.
    Several,
    /// Time steps: no consistent mode was found, or the scene asks for them.
    Stepping,
}

impl ContactMode {
    /// Name of the mode: `free`, `sliding`, `sticking`, `latched`, `pressing`, `several` or `stepping`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Sliding { .. } => "sliding",
            Self::Sticking { .. } => "sticking",
            Self::Latched { .. } => "latched",
            Self::Pressing { .. } => "pressing",
            Self::Several => "several",
            Self::Stepping => "stepping",
        }
    }

    /// Index of the active contact, if exactly one.
    pub fn touch(self) -> Option<usize> {
        match self {
            Self::Free | Self::Several | Self::Stepping => None,
            Self::Sliding { touch }
            | Self::Sticking { touch }
            | Self::Latched { touch }
            | Self::Pressing { touch, .. } => Some(touch),
        }
    }
}

/// By its name.
impl Serialize for ContactMode {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name())
    }
}
