//! Passive springs of joints.

use super::gains::not_negative;
use crate::error::{SimError, named, require};
use carom_chain::{Chain, Coordinates};
use serde::Deserialize;

/// A passive spring and damper of a joint: the joint force −k (q − rest) − d q̇. Its elastic energy is part of the potential
/// energy of a run. It acts in addition to the damping of the URDF and whatever the controller.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    /// Name of the joint, which has one coordinate.
    pub joint: String,
    /// Position at which it has no force, rad or m.
    #[serde(default)]
    pub rest: f64,
    /// Stiffness k, N m/rad or N/m, not negative.
    pub stiffness: f64,
    /// Damping d, N m s/rad or N s/m, not negative.
    #[serde(default)]
    pub damping: f64,
}

/// A spring at its numbers of q and qd.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SpringAt {
    pub q: usize,
    pub v: usize,
    pub rest: f64,
    pub stiffness: f64,
    pub damping: f64,
}

impl Spring {
    /// The spring on a chain.
    ///
    /// # Errors
    /// [`SimError`]: an unknown joint, a joint without a coordinate of its own or with several, a negative stiffness or
    /// damping, numbers that are not finite.
    pub(crate) fn on(&self, chain: &Chain) -> Result<SpringAt, SimError> {
        let Self { ref joint, rest, stiffness, damping } = *self;
        not_negative("stiffness of a spring", stiffness)?;
        not_negative("damping of a spring", damping)?;
        require(rest.is_finite(), "rest position of a spring", rest, "it must be finite")?;
        match &chain.joint(joint)?.coordinates {
            Coordinates::Own { q, v } if v.len() == 1 => {
                Ok(SpringAt { q: q.start, v: v.start, rest, stiffness, damping })
            }
            Coordinates::Own { .. } => {
                Err(named("joint", joint, "has several coordinates: springs act on hinges and sliders"))
            }
            Coordinates::Follows { joint: leader, .. } => {
                Err(named("joint", joint, format!("mimics '{leader}': give the spring to that joint")))
            }
            Coordinates::None => Err(named("joint", joint, "does not move: remove the spring")),
        }
    }
}

impl SpringAt {
    /// The joint force at a position and a velocity, N m or N.
    pub fn force(&self, q: f64, qd: f64) -> f64 {
        self.stiffness * (self.rest - q) - self.damping * qd
    }

    /// The elastic energy, J.
    pub fn energy(&self, q: f64) -> f64 {
        0.5 * self.stiffness * (q - self.rest).powi(2)
    }
}
