//! What drives the joints: motors off, tables, regulators, and the controllers of impact.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | J, H | 3×nv, 3×3 | Jacobian of the tip, J M⁻¹ Jᵀ | `jacobian`, `delassus` |
//! | j | nv | normal row nᵀJ | `row` |
//! | u, a | 3 | velocity and wanted acceleration of the tip | `u`, `wanted` |
//! | N | nv×nv | I − M⁻¹jᵀj/(j M⁻¹jᵀ): what no normal impulse changes; N M⁻¹jᵀ = 0 | – |

use crate::error::SimError;
use crate::motion::{pseudo_inverse, responses};
use crate::space::{Space, View};
use carom_chain::{Chain, ChainError, Workspace};
use nalgebra::{DVector, Matrix3, Vector3};

/// What drives the joints.
#[derive(Debug, Clone, PartialEq)]
pub enum Drive {
    /// Motors off.
    Off,
    /// Constant joint forces, N m or N.
    Constant(Vec<f64>),
    /// Joint forces at given times, straight lines between them, constant before and after.
    Table {
        /// Ascending, s.
        times: Vec<f64>,
        /// One row of joint forces for each time, N m or N.
        forces: Vec<Vec<f64>>,
    },
    /// `kp (target − q) − kd qd`, for chains whose q̇ is qd.
    Pd {
        /// Stiffness, N m/rad or N/m.
        kp: f64,
        /// Damping, N m s/rad or N s/m.
        kd: f64,
        /// Target configuration.
        target: Vec<f64>,
    },
    /// Exactly what holds the chain against gravity.
    GravityCompensation,
    /// The transition from free motion to contact after Pagilla & Yu.
    Transition(Transition),
    /// A regulator blind to what a normal impulse does.
    ImpactInvariant(ImpactInvariant),
}

/// The transition controller: the tip follows a wanted velocity to the surface; after the first impact the normal
/// velocity is driven to zero and the tip pressed on gently, while the velocity along the surface goes on.
///
/// Computed torque at the tip, `τ = bias + Jᵀ H⁺ (a − J̇ q̇)`, with `a = gain (wanted − u)`, and after the impact
/// `−press` along the normal besides. P. R. Pagilla, B. Yu (2004) drive the normal velocity to zero and leave the jump
/// of the tangential velocity to future work; `compensate` is that: before the impact the wanted tangential velocity is
/// lowered by the jump that their eq. (15) predicts, `−(1+e) uₙ H_tn/H_nn`, so that the tip *leaves* the impact with the
/// velocity it was wanted to have.
#[derive(Debug, Clone, PartialEq)]
pub struct Transition {
    /// Link whose frame's origin is the tip.
    pub tip: String,
    /// Unit normal of the surface, from the environment to the robot.
    pub normal: Vector3<f64>,
    /// Wanted velocity of the tip on its way to the surface; its tangential part is wanted after the impact too, m/s.
    pub velocity: Vector3<f64>,
    /// How fast velocities are corrected, 1/s.
    pub gain: f64,
    /// Acceleration towards the surface after the first impact, m/s².
    pub press: f64,
    /// Aim so that the velocity *after* the jump is the wanted one.
    pub compensate: bool,
    /// The coefficient of restitution that the compensation expects.
    pub restitution: f64,
}

/// Impact-invariant feedback (W. Yang, M. Posa, *Impact-invariant control*, 2021): velocities are fed back through N, so
/// the jump that a normal impulse leaves in them never enters the motors:
/// `τ = gravity force + kp (target − q) + kd N (velocity − q̇)`.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpactInvariant {
    /// Link whose frame's origin is the tip.
    pub tip: String,
    /// Unit normal of the surface.
    pub normal: Vector3<f64>,
    /// Stiffness, N m/rad or N/m.
    pub kp: f64,
    /// Damping, N m s/rad or N s/m.
    pub kd: f64,
    /// Target configuration.
    pub target: Vec<f64>,
    /// Wanted joint velocities.
    pub velocity: Vec<f64>,
}

/// When a drive is asked.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub chain: &'a Chain,
    pub time: f64,
    pub gravity: Vector3<f64>,
    /// An impact has happened.
    pub hit: bool,
}

impl Drive {
    /// Whether it fits a chain.
    ///
    /// # Errors
    /// [`SimError`]: lengths, a floating chain, an unknown link, a table out of order.
    pub(crate) fn check(&self, chain: &Chain) -> Result<(), SimError> {
        let regulates = |target: &[f64], what| {
            if chain.nq() != chain.nv() {
                let why = format!("a regulator of joints needs joints with q̇ = qd; '{}' floats", chain.name());
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
            let (value, rule) = (normal.norm(), "a unit vector is needed");
            let fine = (value - 1.0).abs() < 1e-9;
            if fine { Ok(()) } else { Err(SimError::Setting { what: "length of the drive's normal", value, rule }) }
        };
        match self {
            Self::Off | Self::GravityCompensation => Ok(()),
            Self::Constant(forces) => Ok(chain.check_v("torque", forces)?),
            Self::Table { times, forces } => {
                if times.len() != forces.len() || times.is_empty() {
                    let rule = "each time needs its joint forces, and there must be one at least";
                    return Err(SimError::Setting { what: "number of rows", value: forces.len() as f64, rule });
                }
                if let Some(pair) =
                    times.windows(2).find(|pair| pair[0].partial_cmp(&pair[1]) != Some(std::cmp::Ordering::Less))
                {
                    let rule = "the times of a torque table ascend";
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

    /// Whether the same state always gets the same forces.
    pub(crate) fn is_steady(&self) -> bool {
        !matches!(self, Self::Table { .. })
    }

    /// Stiffness and damping that it gives every joint.
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

/// The rows of a table before and after a time, and how far it is on the way; the first or last row alone outside.
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
        let response = responses(view, &jacobian)?;
        let delassus: Matrix3<f64> = (&jacobian * &response).fixed_view::<3, 3>(0, 0).into_owned();

        let along = |v: Vector3<f64>| v - n * n.dot(&v);
        let wanted = if asked.hit {
            (along(self.velocity) - u) * self.gain - n * self.press
        } else {
            // The jump comes from the impact that the wanted approach will make at a pose like this one.
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
        let row = view.row(view.point(frame, view.pose(frame).translation), self.normal)?;
        let response = view.kin.solve(row.as_slice())?;
        let error = DVector::from_fn(qd.len(), |i, _| self.velocity[i] - qd[i]);
        let seen = &error - &response * (row.dot(&error) / row.dot(&response));
        let hold = view.gravity_force(asked.gravity);
        Ok((0..qd.len()).map(|i| hold[i] + self.kp * (self.target[i] - q[i]) + self.kd * seen[i]).collect())
    }
}
