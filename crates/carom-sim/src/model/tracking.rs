//! Tracking of a reference trajectory.
//!
//! | symbol | size | meaning |
//! | --- | --- | --- |
//! | r, ṙ, r̈ | nv | reference |
//! | τ_p | nv | passive joint forces: damping and springs |

use super::control_law::{Add, Asked, Body, ControlLaw, Driven, Number, Part, State};
use super::gains::{Gains, Motor};
use super::reference::Reference;
use crate::error::{SimError, require};
use crate::state::{Space, View};

/// Feedback and feed-forward along a reference: `τ = τ_r + kp (r − q) + kd (ṙ − q̇)` at the joints with one coordinate.
///
/// The feed-forward τ_r is the inverse dynamics of the reference, `M(r) r̈ + c(r, ṙ) − τ_p(r, ṙ)`: without contacts, dry
/// friction and effort limits a robot that starts on the reference stays on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracking {
    /// The positions of the joints with one coordinate, in the order of qd.
    pub reference: Reference,
    /// Stiffness, N m/rad or N/m.
    pub kp: Gains,
    /// Damping, N m s/rad or N s/m.
    pub kd: Gains,
    /// Whether to add τ_r. It needs a motor at every number of qd: not with floating or planar joints.
    pub feed_forward: bool,
}

impl ControlLaw for Tracking {
    fn parts(&mut self) -> Vec<(&'static str, Part<'_>)> {
        vec![("kp", Part::Gains(&mut self.kp)), ("kd", Part::Gains(&mut self.kd))]
    }

    fn check(&self, &Driven { motors, ref v, .. }: &Driven) -> Result<(), SimError> {
        let (joints, rule) = (self.reference.joints(), "it must be the number of joints with one coordinate");
        require(joints == motors.len(), "number of joints of the reference", joints as f64, rule)?;
        let fed = !self.feed_forward || motors.len() == v.len();
        let rule = "feed-forward needs a motor at each of them: set feed_forward = false for robots with a floating or \
                    planar joint";
        require(fed, "number of velocities of the robot", v.len() as f64, rule)
    }

    fn gains(&self, v: usize) -> (f64, f64) {
        (self.kp.at(v), self.kd.at(v))
    }

    fn is_decoupled(&self) -> bool {
        true
    }

    fn force_by(&self, number: Number, joint: &Motor, asked: &Asked, (q, qd): State) -> f64 {
        let Some(k) = asked.motors.iter().position(|motor| motor.v == joint.v) else { return 0.0 };
        let [r, rate, _] = self.reference.at(k, asked.time);
        match number.name {
            "kp" => r - q[joint.q],
            "kd" => rate - qd[joint.v],
            _ => 0.0,
        }
    }

    fn next_kink(&self, time: f64) -> Option<f64> {
        self.reference.next_kink(time)
    }

    fn drive<A: Space>(&self, asked: &Asked, body: Body<A>, (q, qd): State, add: Add) -> Result<(), SimError> {
        let (model, workspace) = body;
        let wanted = |k: usize| self.reference.at(k, asked.time);
        for (k, motor) in asked.motors.iter().enumerate() {
            let [r, rate, _] = wanted(k);
            let (p, d) = (self.kp.at(motor.v), self.kd.at(motor.v));
            add(motor.v, p * (r - q[motor.q]) + d * (rate - qd[motor.v]));
        }
        if !self.feed_forward {
            return Ok(());
        }
        let (mut r, mut rate, mut acceleration) = (q.to_vec(), vec![0.0; qd.len()], vec![0.0; qd.len()]);
        for (k, motor) in asked.motors.iter().enumerate() {
            [r[motor.q], rate[motor.v], acceleration[motor.v]] = wanted(k);
        }
        let mut view = View::<A>::new(model, workspace, &r)?;
        let mut forces = view.inverse_dynamics(&rate, &acceleration, asked.gravity)?;
        for (v, damping) in asked.damping.iter().enumerate() {
            forces[v] += damping * rate[v];
        }
        for spring in asked.springs {
            forces[spring.v] -= spring.force(r[spring.q], rate[spring.v]);
        }
        forces.iter().enumerate().for_each(|(v, force)| add(v, *force));
        Ok(())
    }
}
