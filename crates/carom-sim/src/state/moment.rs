//! The state of a chain at one time, and impulses at its contacts.

use super::written;
use nalgebra::Vector3;
use serde::Serialize;

/// The state of the chain at one time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moment {
    /// Time, s.
    pub time: f64,
    /// Configuration, length nq; rad, m, quaternion (x, y, z, w).
    pub q: Vec<f64>,
    /// Joint velocities, length nv; rad/s, m/s.
    pub qd: Vec<f64>,
}

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
