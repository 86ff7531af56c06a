//! What a drive is asked.

use super::gains::Motor;
use super::spring::SpringAt;
use carom_chain::Chain;
use nalgebra::Vector3;

/// The inputs of a drive beside the state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub chain: &'a Chain,
    pub time: f64,
    pub gravity: Vector3<f64>,
    /// For each number of qd whether an impact has hit its robot.
    pub hit: &'a [bool],
    /// The joints that motors can drive.
    pub motors: &'a [Motor],
    /// Largest force of each number of qd; empty: no limits.
    pub limits: &'a [f64],
    /// Damping of each number of qd, and springs: the passive joint forces.
    pub damping: &'a [f64],
    pub springs: &'a [SpringAt],
}

impl Asked<'_> {
    /// Whether an impact has hit the robot, or one of several robots with one drive.
    pub fn was_hit(&self) -> bool {
        self.hit.contains(&true)
    }
}
