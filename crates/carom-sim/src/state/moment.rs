//! The state of a chain at one time.

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
