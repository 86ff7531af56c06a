//! Impulses of contacts.

use nalgebra::Vector3;

/// A contact impulse on the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactImpulse {
    /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
    pub touch: usize,
    /// Contact point, world axes, m.
    pub point: Vector3<f64>,
    /// Impulse on the robot, world axes, N s.
    pub impulse: Vector3<f64>,
}
