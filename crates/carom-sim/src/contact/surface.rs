//! The surfaces of the environment.

use super::rule::ContactRule;
use carom_contact::Obstacle;
use nalgebra::Vector3;
/// Harmonic motion of a surface: the displacement `amplitude · sin(ω t + phase)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillation {
    /// Direction and size, world axes, m.
    pub amplitude: Vector3<f64>,
    /// Angular frequency ω, rad/s.
    pub frequency: f64,
    /// Phase, rad.
    pub phase: f64,
}

impl Oscillation {
    /// Displacement (m), velocity (m/s) and acceleration (m/s²) at a time (s), world axes.
    pub fn at(&self, time: f64) -> [Vector3<f64>; 3] {
        let Self { amplitude, frequency, phase } = *self;
        let (sin, cos) = (frequency * time + phase).sin_cos();
        [amplitude * sin, amplitude * (frequency * cos), amplitude * (-frequency * frequency * sin)]
    }
}

/// A surface of the environment.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Its name.
    pub name: String,
    /// Its shape and pose.
    pub obstacle: Obstacle,
    /// Law and coefficients of contacts with it.
    pub contact: ContactRule,
    /// Its motion; `None`: at rest.
    pub motion: Option<Oscillation>,
}
