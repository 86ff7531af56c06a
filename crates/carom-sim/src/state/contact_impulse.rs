//! Impulses of contacts.

use super::written;
use nalgebra::Vector3;
use serde::Serialize;

/// A contact impulse on the robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ContactImpulse {
    /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
    #[serde(skip)]
    pub touch: usize,
    /// Contact point, world axes, m.
    #[serde(serialize_with = "written::vector")]
    pub point: Vector3<f64>,
    /// Impulse on the robot, world axes, N s.
    #[serde(serialize_with = "written::vector")]
    pub impulse: Vector3<f64>,
}
