//! Joint drives: motors off, torque tables, PD control, and controllers for impacts.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | J, H | 3×nv, 3×3 | Jacobian of the tip, J M⁻¹ Jᵀ | `jacobian`, `delassus` |
//! | j | nv | normal row nᵀJ | `row` |
//! | u, a | 3 | velocity and desired acceleration of the tip | `u`, `wanted` |
//! | N | nv×nv | I − M⁻¹jᵀj/(j M⁻¹jᵀ): projection onto the velocities that no normal impulse changes; N M⁻¹jᵀ = 0 | – |

use crate::error::SimError;
use crate::state::{Space, View, pseudo_inverse};
use carom_chain::{Chain, ChainError, Reduced, Rows, Spatial, Workspace};
use nalgebra::{DVector, Matrix3, Vector3};

/// The joint forces of the motors. The damping and the dry friction of the joints act in addition.
#[derive(Debug, Clone, PartialEq)]
pub enum Drive {
    /// Motors off.
    Off,
    /// Constant joint forces, length nv; N m or N.
    Constant(Vec<f64>),
    /// Joint forces at given times, interpolated linearly, constant before the first and after the last time.
    Table {
        /// Ascending times, s.
        times: Vec<f64>,
        /// Joint forces at each time, length nv; N m or N.
        forces: Vec<Vec<f64>>,
    },
    /// `kp (target − q) − kd qd`, for chains without floating joints.
    Pd {
        /// Stiffness, N m/rad or N/m.
        kp: f64,
        /// Damping, N m s/rad or N s/m.
        kd: f64,
        /// Target configuration, length nq; rad, m.
        target: Vec<f64>,
    },
    /// The joint forces that balance gravity, on all coordinates, including those of a floating base.
    GravityCompensation,
    /// Transition from free motion to contact (Pagilla & Yu).
    Transition(Transition),
    /// PD feedback that does not react to the velocity jump of a normal impulse (Yang & Posa).
    ImpactInvariant(ImpactInvariant),
}

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
    pub kp: f64,
    /// Damping, N m s/rad or N s/m.
    pub kd: f64,
    /// Target configuration, length nq; rad, m.
    pub target: Vec<f64>,
    /// Desired joint velocities, length nv; rad/s, m/s.
    pub velocity: Vec<f64>,
}

/// The inputs of a drive beside the state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub chain: &'a Chain,
    pub time: f64,
    pub gravity: Vector3<f64>,
    /// Whether an impact has happened.
    pub hit: bool,
}

impl Drive {
    /// Checks that the drive fits a chain.
    ///
    /// # Errors
    /// [`SimError`]: wrong lengths, a controller of joints on a chain with a floating joint, an unknown link, invalid gains,
    /// a torque table whose times do not ascend.
    pub(crate) fn check(&self, chain: &Chain) -> Result<(), SimError> {
        let regulates = |target: &[f64], what| {
            if chain.nq() != chain.nv() {
                let why = format!(
                    "a controller with a target configuration needs q̇ = qd, but '{}' has a floating joint: choose another \
                     controller",
                    chain.name()
                );
                return Err(SimError::from(ChainError::NotReducible(why)));
            }
            Ok(chain.check_v(what, target)?)
        };
        let gain = |what, value: f64| {
            let fine = value >= 0.0 && value.is_finite();
            if fine {
                Ok(())
            } else {
                Err(SimError::Setting { what, value, rule: "it must be finite and not negative" })
            }
        };
        let unit = |normal: &Vector3<f64>| {
            let (value, rule) = (normal.norm(), "it must be 1");
            let fine = (value - 1.0).abs() < 1e-9;
            if fine { Ok(()) } else { Err(SimError::Setting { what: "length of the drive's normal", value, rule }) }
        };
        match self {
            Self::Off | Self::GravityCompensation => Ok(()),
            Self::Constant(forces) => Ok(chain.check_v("torque", forces)?),
            Self::Table { times, forces } => {
                if times.len() != forces.len() || times.is_empty() {
                    let rule = "it must be the number of times, and at least 1";
                    let what = "number of rows of the torque table";
                    return Err(SimError::Setting { what, value: forces.len() as f64, rule });
                }
                if let Some(pair) =
                    times.windows(2).find(|pair| pair[0].partial_cmp(&pair[1]) != Some(std::cmp::Ordering::Less))
                {
                    let rule = "the times of a torque table must ascend";
                    return Err(SimError::Setting { what: "time in the torque table", value: pair[1], rule });
                }
                forces.iter().try_for_each(|row| Ok(chain.check_v("tau", row)?))
            }
            Self::Pd { kp, kd, target } => {
                gain("kp", *kp)?;
                gain("kd", *kd)?;
                regulates(target, "target")
            }
            Self::Transition(transition) => {
                chain.frame(&transition.tip)?;
                gain("gain", transition.gain)?;
                gain("press", transition.press)?;
                unit(&transition.normal)
            }
            Self::ImpactInvariant(invariant) => {
                chain.frame(&invariant.tip)?;
                gain("kp", invariant.kp)?;
                gain("kd", invariant.kd)?;
                regulates(&invariant.target, "target")?;
                regulates(&invariant.velocity, "velocity")?;
                unit(&invariant.normal)
            }
        }
    }

    /// The drive of a reduced chain.
    pub(crate) fn reduced(&self, less: &Reduced<Spatial<f64>>) -> Self {
        let pick = |numbers: &[f64], indices: &[usize]| indices.iter().map(|&k| numbers[k]).collect::<Vec<_>>();
        let mut drive = self.clone();
        match &mut drive {
            Self::Constant(forces) => *forces = pick(forces, &less.v),
            Self::Table { forces, .. } => forces.iter_mut().for_each(|row| *row = pick(row, &less.v)),
            Self::Pd { target, .. } => *target = pick(target, &less.q),
            Self::ImpactInvariant(invariant) => {
                invariant.target = pick(&invariant.target, &less.q);
                invariant.velocity = pick(&invariant.velocity, &less.v);
            }
            Self::Off | Self::GravityCompensation | Self::Transition(_) => {}
        }
        drive
    }

    /// Whether the joint forces do not depend on time explicitly.
    pub(crate) fn is_steady(&self) -> bool {
        !matches!(self, Self::Table { .. })
    }

    /// Stiffness and damping at every joint.
    pub(crate) fn gains(&self) -> (f64, f64) {
        match self {
            Self::Pd { kp, kd, .. } => (*kp, *kd),
            Self::ImpactInvariant(invariant) => (invariant.kp, invariant.kd),
            _ => (0.0, 0.0),
        }
    }

    /// The next time at which the forces have a kink.
    pub(crate) fn next_kink(&self, time: f64) -> Option<f64> {
        match self {
            Self::Table { times, .. } => times.iter().copied().find(|&kink| kink > time),
            _ => None,
        }
    }

    /// Adds the joint forces of the motors to `tau`; returns their power.
    pub(crate) fn push<A: Space>(
        &self,
        asked: Asked,
        (model, workspace): (&A::Model, &mut Workspace<A>),
        (q, qd): (&[f64], &[f64]),
        tau: &mut [f64],
    ) -> Result<f64, SimError> {
        let mut power = 0.0;
        let mut add = |i: usize, force: f64| {
            tau[i] += force;
            power += force * qd[i];
        };
        match self {
            Self::Off => {}
            Self::Constant(forces) => forces.iter().enumerate().for_each(|(i, force)| add(i, *force)),
            Self::Table { times, forces } => {
                let (before, after, share) = between(times, asked.time);
                let (before, after) = (&forces[before], &forces[after]);
                (0..qd.len()).for_each(|i| add(i, before[i] + (after[i] - before[i]) * share));
            }
            Self::Pd { kp, kd, target } => {
                (0..qd.len()).for_each(|i| add(i, kp * (target[i] - q[i]) - kd * qd[i]));
            }
            Self::GravityCompensation => {
                let forces = View::<A>::new(model, workspace, q)?.gravity_force(asked.gravity);
                forces.iter().enumerate().for_each(|(i, force)| add(i, *force));
            }
            Self::Transition(transition) => {
                let forces = transition.forces(asked, &mut View::<A>::new(model, workspace, q)?, qd)?;
                forces.into_iter().enumerate().for_each(|(i, force)| add(i, force));
            }
            Self::ImpactInvariant(invariant) => {
                let forces = invariant.forces(asked, &mut View::<A>::new(model, workspace, q)?, q, qd)?;
                forces.into_iter().enumerate().for_each(|(i, force)| add(i, force));
            }
        }
        Ok(power)
    }
}

/// The rows of a table before and after a time, and the interpolation weight of the later one; outside the table twice the
/// first or last row.
fn between(times: &[f64], time: f64) -> (usize, usize, f64) {
    let after = times.partition_point(|&t| t <= time);
    if after == 0 || after == times.len() {
        let row = after.min(times.len() - 1);
        return (row, row, 0.0);
    }
    (after - 1, after, (time - times[after - 1]) / (times[after] - times[after - 1]))
}

impl Transition {
    fn forces<A: Space>(&self, asked: Asked, view: &mut View<A>, qd: &[f64]) -> Result<Vec<f64>, SimError> {
        let n = self.normal;
        let frame = asked.chain.frame(&self.tip)?;
        let point = view.point(frame, view.pose(frame).translation);
        let (u, drift) = (view.velocity(point, qd)?, view.drift(point, qd)?);
        let jacobian = view.jacobian(point);
        let response = view.responses(&jacobian)?;
        let delassus: Matrix3<f64> = (&jacobian * &response).fixed_view::<3, 3>(0, 0).into_owned();

        let along = |v: Vector3<f64>| v - n * n.dot(&v);
        let wanted = if asked.hit {
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
        Ok((view.bias(qd, asked.gravity)? + force).as_slice().to_vec())
    }
}

impl ImpactInvariant {
    fn forces<A: Space>(&self, asked: Asked, view: &mut View<A>, q: &[f64], qd: &[f64]) -> Result<Vec<f64>, SimError> {
        let frame = asked.chain.frame(&self.tip)?;
        let (mut rows, mut responses) = (Rows::new(qd.len()), Rows::default());
        view.add_row(view.point(frame, view.pose(frame).translation), self.normal, rows.add())?;
        view.kin.respond(&rows, &mut responses)?;
        let [row, response] = [&rows, &responses].map(|rows| DVector::from_column_slice(rows.row(0)));
        let error = DVector::from_fn(qd.len(), |i, _| self.velocity[i] - qd[i]);
        let seen = &error - &response * (row.dot(&error) / row.dot(&response));
        let hold = view.gravity_force(asked.gravity);
        Ok((0..qd.len()).map(|i| hold[i] + self.kp * (self.target[i] - q[i]) + self.kd * seen[i]).collect())
    }
}
