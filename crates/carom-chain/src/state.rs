//! States as plain slices: their validation, integration of configurations, and differences between them.
//!
//! A floating joint has q = (x, y, z, qx, qy, qz, qw): position in the parent's joint frame and unit quaternion; its
//! qd = (linear, angular) velocity of the child *in child axes*. [`Chain::integrate`] moves it along the exact screw motion
//! of a constant qd. A planar joint has q = (x, y, angle) and qd = q̇. All others have q̇ = qd.
//!
//! URDF does not define the directions x and y of a planar joint. In this crate they are, in the joint's frame, the first
//! two columns of [`z_onto`](crate::algebra::z_onto)`(axis)`:
//!
//! | axis | x | y |
//! | --- | --- | --- |
//! | (0, 0, 1) | (1, 0, 0) | (0, 1, 0) |
//! | (1, 0, 0), URDF's default | (0, 0, −1) | (0, 1, 0) |
//! | (0, 1, 0) | (1, 0, 0) | (0, 0, −1) |
//!
//! ```
//! # use carom_chain::algebra::z_onto;
//! # use nalgebra::Vector3;
//! for (axis, x, y) in [
//!     (Vector3::z(), Vector3::x(), Vector3::y()),
//!     (Vector3::x(), -Vector3::z(), Vector3::y()),
//!     (Vector3::y(), Vector3::x(), -Vector3::z()),
//! ] {
//!     assert_eq!((z_onto(axis).column(0).into_owned(), z_onto(axis).column(1).into_owned()), (x, y));
//! }
//! ```

use crate::about::{Coordinates, JointInfo};
use crate::algebra::{Algebra, SpatialJoint};
use crate::chain::Chain;
use crate::error::ChainError;
use crate::urdf::JointType;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

impl<A: Algebra> Chain<A> {
    /// Checks `q` and `qd`: lengths, finite numbers, unit quaternions.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`], [`ChainError::NotFinite`], [`ChainError::NotUnitQuaternion`] (norm off by more than
    /// 1e-3; smaller deviations are accepted as rounding of the input, because the recursions normalise).
    pub fn check_state(&self, q: &[f64], qd: &[f64]) -> Result<(), ChainError> {
        self.check_q(q)?;
        self.check_v("qd", qd)
    }

    /// Checks a configuration as [`Chain::check_state`] does.
    ///
    /// # Errors
    /// As [`Chain::check_state`].
    #[doc(hidden)]
    pub fn check_q(&self, q: &[f64]) -> Result<(), ChainError> {
        self.check_nq(q.len())?;
        check_finite("q", q)?;
        for (joint, at) in self.floating_joints() {
            let norm = q[at + 3..at + 7].iter().map(|x| x * x).sum::<f64>().sqrt();
            if (norm - 1.0).abs() > 1e-3 {
                return Err(ChainError::NotUnitQuaternion { joint: joint.name.clone(), norm });
            }
        }
        Ok(())
    }

    /// Checks a vector of length nv: its length and finite numbers. `what` is its name in the error (qd, tau, qdd).
    ///
    /// # Errors
    /// [`ChainError::WrongLength`], [`ChainError::NotFinite`].
    #[doc(hidden)]
    pub fn check_v(&self, what: &'static str, numbers: &[f64]) -> Result<(), ChainError> {
        self.check_nv(what, numbers.len())?;
        check_finite(what, numbers)
    }

    /// The joints of one degree of freedom, mimic joints included, whose position at `q` is outside their limits by more than 1e-12 (rad, m, or
    /// of the limit), the rounding of a computed state: their names, each with a sentence.
    pub fn outside_limits(&self, q: &[f64]) -> Vec<(&str, String)> {
        let rounding = |limit: f64| 1e-12 * limit.abs().max(1.0);
        let mut outside = Vec::new();
        for joint in self.joints() {
            let Some(own) = self.coordinate_of(joint) else { continue };
            let Some(position) = q.get(own.q).map(|x| own.multiplier * x + own.offset) else { continue };
            let limit = match (joint.limits.lower, joint.limits.upper) {
                (Some(lower), _) if position < lower - rounding(lower) => lower,
                (_, Some(upper)) if position > upper + rounding(upper) => upper,
                _ => continue,
            };
            let unit = if joint.kind == JointType::Prismatic { "m" } else { "rad" };
            let (name, side) = (joint.name.as_str(), if position < limit { "below" } else { "above" });
            let hint = if unit == "rad" && position.abs() > TAU { " (angles of joints are in rad)" } else { "" };
            outside
                .push((name, format!("joint '{name}' is at {position} {unit}, {side} its limit {limit} {unit}{hint}")));
        }
        outside
    }

    /// The limits (lower, upper; rad or m) of entry `index` of q, of a hinge or slider: those of its joint and of the joints that mimic
    /// it; `None` without one. Where they leave no position the lower is above the upper.
    #[doc(hidden)]
    pub fn limits_of(&self, index: usize) -> [Option<f64>; 2] {
        let mut ends: [Option<f64>; 2] = [None; 2];
        for joint in self.joints() {
            let Some(own) = self.coordinate_of(joint).filter(|own| own.q == index && own.multiplier != 0.0) else {
                continue;
            };
            let mut limits =
                [joint.limits.lower, joint.limits.upper].map(|end| end.map(|end| (end - own.offset) / own.multiplier));
            if own.multiplier < 0.0 {
                limits.reverse();
            }
            let [lower, upper] = limits;
            ends[0] = [ends[0], lower].into_iter().flatten().reduce(f64::max);
            ends[1] = [ends[1], upper].into_iter().flatten().reduce(f64::min);
        }
        ends
    }

    /// The configuration in which all coordinates are zero and the quaternions of floating joints are the identity.
    pub fn zero_configuration(&self) -> Vec<f64> {
        let mut q = vec![0.0; self.nq()];
        for (_, at) in self.floating_joints() {
            q[at + 6] = 1.0;
        }
        q
    }

    fn floating_joints(&self) -> impl Iterator<Item = (&JointInfo, usize)> {
        self.joints().iter().filter_map(|joint| match &joint.coordinates {
            Coordinates::Own { q, .. } if joint.kind == JointType::Floating => Some((joint, q.start)),
            _ => None,
        })
    }
}

impl Chain {
    /// The configuration after moving from `q` with the constant velocity `qd` for `dt` seconds. Quaternions stay unit.
    ///
    /// # Errors
    /// As [`Chain::check_state`].
    pub fn integrate(&self, q: &[f64], qd: &[f64], dt: f64) -> Result<Vec<f64>, ChainError> {
        self.check_state(q, qd)?;
        let mut out = q.to_vec();
        for body in self.bodies() {
            let (at, v) = (body.q_index, body.v_index);
            match body.joint {
                SpatialJoint::Revolute | SpatialJoint::Prismatic => out[at] = q[at] + qd[v] * dt,
                SpatialJoint::Floating(0) => {
                    let (linear, angular) = (vector(&qd[v..]) * dt, vector(&qd[v + 3..]) * dt);
                    let turn = quaternion(&q[at + 3..]);
                    let position = vector(&q[at..]) + turn * (screw(angular) * linear);
                    let turned = (turn * UnitQuaternion::from_scaled_axis(angular)).into_inner().normalize();
                    out[at..at + 3].copy_from_slice(position.as_slice());
                    out[at + 3..at + 7].copy_from_slice(turned.coords.as_slice());
                }
                SpatialJoint::Floating(_) => {}
            }
        }
        Ok(out)
    }

    /// Writes q̇ for the joint velocities qd into `rate`: the derivative of [`Chain::integrate`] with respect to `dt` at 0.
    /// The slices have length nq, nv and nq.
    ///
    /// q̇ = qd except for floating joints: ṗ = R v and, with the quaternion ξ of R, ξ̇ = ½ ξ ∘ (ω, 0).
    ///
    /// # Panics
    /// If a slice is too short.
    #[doc(hidden)]
    pub fn q_rate_into(&self, q: &[f64], qd: &[f64], rate: &mut [f64]) {
        for body in self.bodies() {
            let (at, v) = (body.q_index, body.v_index);
            match body.joint {
                SpatialJoint::Revolute | SpatialJoint::Prismatic => rate[at] = qd[v],
                SpatialJoint::Floating(0) => {
                    let turn = Quaternion::new(q[at + 6], q[at + 3], q[at + 4], q[at + 5]);
                    let linear = UnitQuaternion::from_quaternion(turn) * vector(&qd[v..]);
                    let spin = turn * Quaternion::from_imag(vector(&qd[v + 3..])) * 0.5;
                    rate[at..at + 3].copy_from_slice(linear.as_slice());
                    rate[at + 3..at + 7].copy_from_slice(spin.coords.as_slice());
                }
                SpatialJoint::Floating(_) => {}
            }
        }
    }

    /// The constant velocity (length nv) that moves the chain from `from` to `to` in one second:
    /// `integrate(from, difference, 1) = to`. Of the two rotations between quaternions it is the one by at most half a turn;
    /// a quaternion and its negative are the same rotation.
    ///
    /// # Errors
    /// As [`Chain::check_state`].
    pub fn difference(&self, from: &[f64], to: &[f64]) -> Result<Vec<f64>, ChainError> {
        let mut out = vec![0.0; self.nv()];
        self.check_state(from, &out)?;
        self.check_state(to, &out)?;
        for body in self.bodies() {
            let (at, v) = (body.q_index, body.v_index);
            match body.joint {
                SpatialJoint::Revolute | SpatialJoint::Prismatic => out[v] = to[at] - from[at],
                SpatialJoint::Floating(0) => {
                    let (turn, turned) = (quaternion(&from[at + 3..]), quaternion(&to[at + 3..]));
                    let angular = shorter(turn.inverse() * turned).scaled_axis();
                    let way = turn.inverse() * (vector(&to[at..]) - vector(&from[at..]));
                    let linear = screw(angular).try_inverse().map_or(way, |inverse| inverse * way);
                    out[v..v + 3].copy_from_slice(linear.as_slice());
                    out[v + 3..v + 6].copy_from_slice(angular.as_slice());
                }
                SpatialJoint::Floating(_) => {}
            }
        }
        Ok(out)
    }
}

fn check_finite(what: &'static str, numbers: &[f64]) -> Result<(), ChainError> {
    match numbers.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(ChainError::NotFinite { what, index, value: numbers[index] }),
        None => Ok(()),
    }
}

fn vector(x: &[f64]) -> Vector3<f64> {
    Vector3::new(x[0], x[1], x[2])
}

fn quaternion(x: &[f64]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(x[3], x[0], x[1], x[2]))
}

fn shorter(turn: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    if turn.w < 0.0 { UnitQuaternion::new_unchecked(-turn.into_inner()) } else { turn }
}

/// ∫₀¹ exp(s φ×) ds, the left Jacobian of SO(3): `1 + (1−cos θ)/θ² φ× + (θ−sin θ)/θ³ φ×²`, the coefficients by their
/// series below θ = 0.1.
fn screw(phi: Vector3<f64>) -> nalgebra::Matrix3<f64> {
    let t2 = phi.norm_squared();
    let (a, b) = if t2 < 0.01 {
        // The next terms are below 1e-17 of the first.
        (
            0.5 - t2 / 24.0 * (1.0 - t2 / 30.0 * (1.0 - t2 / 56.0 * (1.0 - t2 / 90.0))),
            1.0 / 6.0 - t2 / 120.0 * (1.0 - t2 / 42.0 * (1.0 - t2 / 72.0 * (1.0 - t2 / 110.0))),
        )
    } else {
        let t = t2.sqrt();
        let half = (t / 2.0).sin();
        (2.0 * half * half / t2, (t - t.sin()) / (t2 * t))
    };
    let cross = phi.cross_matrix();
    nalgebra::Matrix3::identity() + cross * a + cross * cross * b
}
