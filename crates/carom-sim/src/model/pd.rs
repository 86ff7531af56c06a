//! PD control.

use super::control_law::{Add, Asked, Body, ControlLaw, Driven, Number, Part, State};
use super::gains::{Gains, Motor};
use crate::error::{SimError, require};
use crate::state::Space;

/// `kp (target − q) − kd qd`.
#[derive(Debug, Clone, PartialEq)]
pub struct Pd {
    /// Stiffness, N m/rad or N/m.
    pub kp: Gains,
    /// Damping, N m s/rad or N s/m.
    pub kd: Gains,
    /// Target configuration, length nq; rad, m. The numbers of floating and planar joints are not used.
    pub target: Vec<f64>,
}

impl ControlLaw for Pd {
    fn parts(&mut self) -> Vec<(&'static str, Part<'_>)> {
        let Self { kp, kd, target } = self;
        vec![("kp", Part::Gains(kp)), ("kd", Part::Gains(kd)), ("target", Part::Q(target))]
    }

    fn check(&self, robot: &Driven) -> Result<(), SimError> {
        let mut used = robot.motors.iter().map(|motor| self.target[motor.q]);
        used.try_for_each(|x| require(x.is_finite(), "number of the target", x, "it must be finite"))
    }

    fn gains(&self, v: usize) -> (f64, f64) {
        (self.kp.at(v), self.kd.at(v))
    }

    fn is_decoupled(&self) -> bool {
        true
    }

    fn force_by(&self, number: Number, joint: &Motor, _: &Asked, (q, qd): State) -> f64 {
        match number.name {
            "kp" => self.target[joint.q] - q[joint.q],
            "kd" => -qd[joint.v],
            "target" => self.kp.at(joint.v),
            _ => 0.0,
        }
    }

    fn drive<A: Space>(&self, asked: &Asked, _: Body<A>, (q, qd): State, add: Add) -> Result<(), SimError> {
        for &Motor { q: at, v, .. } in asked.motors {
            add(v, self.kp.at(v) * (self.target[at] - q[at]) - self.kd.at(v) * qd[v]);
        }
        Ok(())
    }
}
