//! The state of a chain at one time, and impulses at its contacts.

use nalgebra::Vector3;

/// The state of the chain at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Time, s.
    pub time: f64,
    /// Configuration, length nq; rad, m, quaternion (x, y, z, w).
    pub q: Vec<f64>,
    /// Joint velocities, length nv; rad/s, m/s.
    pub qd: Vec<f64>,
}

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
