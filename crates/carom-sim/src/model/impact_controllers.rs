//! Controllers for impacts, at a tip that touches a surface.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | J, H | 3×nv, 3×3 | Jacobian of the tip, J M⁻¹ Jᵀ | `jacobian`, `delassus` |
//! | j | nv | normal row nᵀJ | `row` |
//! | u, a | 3 | velocity and desired acceleration of the tip | `u`, `wanted` |
//! | N | nv×nv | I − M⁻¹jᵀj/(j M⁻¹jᵀ): projection onto the velocities that no normal impulse changes; N M⁻¹jᵀ = 0 | – |

use super::control_law::{Add, Asked, Body, ControlLaw, Driven, Part, State};
use super::gains::{Gains, Motor, not_negative};
use crate::error::{SimError, require};
use crate::state::{EQUAL, Space, View, pseudo_inverse};
use carom_chain::urdf::JointType;
use carom_chain::{ChainError, Rows};
use nalgebra::{DVector, Matrix3, Vector3};

/// The transition controller: before the first impact the tip follows a desired velocity to the surface; afterwards its
/// normal velocity is controlled to zero with an acceleration `press` towards the surface, and its tangential velocity to
/// the desired one.
///
/// Computed torque at the tip, `τ = bias + Jᵀ H⁺ (a − J̇ q̇)`, with `a = gain (desired velocity − u)` and, after the impact, the
/// additional normal acceleration `−press`. P. R. Pagilla, B. Yu (2004) control the normal velocity to zero and leave the
/// jump of the tangential velocity to future work. `compensate` adds this: before the impact the desired tangential
/// velocity is reduced by the jump that their eq. (15) predicts, `−(1+e) uₙ H_tn/H_nn`, so that the tip has the desired
/// velocity *after* the impact.
#[derive(Debug, Clone, PartialEq)]
pub struct Transition {
    /// Link whose frame's origin is the tip.
    pub tip: String,
    /// Unit normal of the surface, from the environment to the robot, world axes.
    pub normal: Vector3<f64>,
    /// Desired velocity of the tip before the impact, world axes, m/s. After the impact its tangential part is desired.
    pub velocity: Vector3<f64>,
    /// Feedback gain of the velocity, 1/s.
    pub gain: f64,
    /// Acceleration towards the surface after the first impact, m/s².
    pub press: f64,
    /// Whether to compensate the predicted jump of the tangential velocity.
    pub compensate: bool,
    /// Coefficient of restitution of the prediction.
    pub restitution: f64,
}

/// Impact-invariant feedback (W. Yang, M. Posa, *Impact-invariant control*, 2021): the velocity error is projected by N, so
/// that the joint forces do not depend on the velocity jump of a normal impulse:
/// `τ = gravity force + kp (target − q) + kd N (velocity − q̇)`.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpactInvariant {
    /// Link whose frame's origin is the tip.
    pub tip: String,
    /// Unit normal of the surface, from the environment to the robot, world axes.
    pub normal: Vector3<f64>,
    /// Stiffness, N m/rad or N/m.
    pub kp: Gains,
    /// Damping, N m s/rad or N s/m.
    pub kd: Gains,
    /// Target configuration, length nq; rad, m.
    pub target: Vec<f64>,
    /// Desired joint velocities, length nv; rad/s, m/s.
    pub velocity: Vec<f64>,
}

/// # Errors
/// [`SimError::Setting`] for a normal whose length is not 1.
fn check_unit(normal: &Vector3<f64>) -> Result<(), SimError> {
    let length = normal.norm();
    require((length - 1.0).abs() < EQUAL, "length of the drive's normal", length, "it must be 1")
}

impl ControlLaw for Transition {
    fn parts(&mut self) -> Vec<(&'static str, Part<'_>)> {
        vec![("tip", Part::Link(&mut self.tip))]
    }

    fn check(&self, _: &Driven) -> Result<(), SimError> {
        not_negative("gain", self.gain)?;
        not_negative("press", self.press)?;
        check_unit(&self.normal)
    }

    fn drive<A: Space>(&self, asked: &Asked, body: Body<A>, (q, qd): State, add: Add) -> Result<(), SimError> {
        let mut view = View::<A>::new(body.0, body.1, q)?;
        let n = self.normal;
        let frame = asked.chain.frame(&self.tip)?;
        let point = view.point(frame, view.pose(frame).translation);
        let (u, drift) = (view.velocity(point, qd)?, view.drift(point, qd)?);
        let jacobian = view.jacobian(point);
        let response = view.responses(&jacobian)?;
        let delassus: Matrix3<f64> = (&jacobian * &response).fixed_view::<3, 3>(0, 0).into_owned();

        let along = |v: Vector3<f64>| v - n * n.dot(&v);
        let wanted = if asked.was_hit() {
            (along(self.velocity) - u) * self.gain - n * self.press
        } else {
            // The predicted jump is that of an impact with the desired velocity at the present pose.
            let jump =
                along(delassus * n) * (-(1.0 + self.restitution) * n.dot(&self.velocity) / n.dot(&(delassus * n)));
            let aim = if self.compensate { self.velocity - jump } else { self.velocity };
            (aim - u) * self.gain
        };
        let force = pseudo_inverse(delassus) * (wanted - drift);
        let force = jacobian.transpose() * DVector::from_column_slice(force.as_slice());
        (view.bias(qd, asked.gravity)? + force).iter().enumerate().for_each(|(i, force)| add(i, *force));
        Ok(())
    }
}

impl ControlLaw for ImpactInvariant {
    fn parts(&mut self) -> Vec<(&'static str, Part<'_>)> {
        let Self { tip, kp, kd, target, velocity, .. } = self;
        let gains = [("kp", Part::Gains(kp)), ("kd", Part::Gains(kd))];
        let state = [("target", Part::Q(target)), ("velocity", Part::V(velocity)), ("tip", Part::Link(tip))];
        gains.into_iter().chain(state).collect()
    }

    fn check(&self, &Driven { chain, ref v, .. }: &Driven) -> Result<(), SimError> {
        let floating = |v| chain.joint_of_velocity(v).filter(|it| it.kind == JointType::Floating);
        if let Some(base) = v.clone().find_map(floating) {
            let why = format!(
                "a controller with a target configuration needs q̇ = qd, but '{}' has the floating joint '{}': choose \
                 another controller",
                chain.name(),
                base.name
            );
            return Err(ChainError::NotReducible(why).into());
        }
        check_unit(&self.normal)
    }

    fn gains(&self, v: usize) -> (f64, f64) {
        (self.kp.at(v), self.kd.at(v))
    }

    fn drive<A: Space>(&self, asked: &Asked, body: Body<A>, (q, qd): State, add: Add) -> Result<(), SimError> {
        let mut view = View::<A>::new(body.0, body.1, q)?;
        let frame = asked.chain.frame(&self.tip)?;
        let (mut rows, mut responses) = (Rows::new(qd.len()), Rows::default());
        view.add_row(view.point(frame, view.pose(frame).translation), self.normal, rows.add())?;
        view.kin.respond(&rows, &mut responses)?;
        let [row, response] = [&rows, &responses].map(|rows| DVector::from_column_slice(rows.row(0)));
        let error = DVector::from_fn(qd.len(), |i, _| self.velocity[i] - qd[i]);
        // No normal impulse moves a tip whose joints move along the surface only.
        let moved = row.dot(&response);
        let share = if moved > 0.0 { row.dot(&error) / moved } else { 0.0 };
        let seen = &error - &response * share;
        let hold = view.gravity_force(asked.gravity);
        for &Motor { q: at, v, .. } in asked.motors {
            add(v, hold[v] + self.kp.at(v) * (self.target[at] - q[at]) + self.kd.at(v) * seen[v]);
        }
        Ok(())
    }
}
