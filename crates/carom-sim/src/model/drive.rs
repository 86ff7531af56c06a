//! Joint drives: motors off, torque tables, PD control, tracking, controllers for impacts and users' own.

use super::asked::Asked;
use super::controller::{Controller, Observed, UserController};
use super::gains::{Gains, Motor, motors, not_negative};
use super::impact_controllers::{ImpactInvariant, Transition};
use super::tracking::Tracking;
use crate::error::SimError;
use crate::state::{Space, View, between, next_of};
use carom_chain::{Chain, ChainError, Reduced, Spatial, Workspace};
use nalgebra::Vector3;

/// The joint forces of the motors. Damping, dry friction and springs of the joints act in addition.
///
/// Controllers drive the joints with one coordinate; nothing drives a floating or planar joint. [`Drive::Constant`],
/// [`Drive::Table`] and [`Drive::Transition`] give forces for all numbers of qd.
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
    /// `kp (target − q) − kd qd`.
    Pd {
        /// Stiffness, N m/rad or N/m.
        kp: Gains,
        /// Damping, N m s/rad or N s/m.
        kd: Gains,
        /// Target configuration, length nq; rad, m. The numbers of floating and planar joints are not used.
        target: Vec<f64>,
    },
    /// Tracking of a reference trajectory.
    Tracking(Tracking),
    /// The joint forces that balance gravity. A floating base is not held: it falls unless contacts carry it.
    GravityCompensation,
    /// Transition from free motion to contact (Pagilla & Yu).
    Transition(Transition),
    /// PD feedback that does not react to the velocity jump of a normal impulse (Yang & Posa).
    ImpactInvariant(ImpactInvariant),
    /// A user's own [`Controller`]. [`Scene::plan`](crate::Scene::plan) keeps all joints for it.
    User(UserController),
}

impl Drive {
    /// The drive of a user's own controller.
    pub fn user(controller: impl Controller + 'static) -> Self {
        Self::User(UserController::new(controller))
    }

    /// Its name in scene files; for a user's controller its own.
    pub fn name(&self) -> &str {
        match self {
            Self::Off => "off",
            Self::Constant(_) => "constant",
            Self::Table { .. } => "torque-file",
            Self::Pd { .. } => "pd",
            Self::Tracking(_) => "tracking",
            Self::GravityCompensation => "gravity-compensation",
            Self::Transition(_) => "transition",
            Self::ImpactInvariant(_) => "impact-invariant",
            Self::User(controller) => controller.name(),
        }
    }

    /// Checks that the drive fits a chain.
    ///
    /// # Errors
    /// [`SimError`]: wrong lengths, impact-invariant control of a chain with a floating joint, an unknown link, invalid
    /// gains, a torque table whose times do not ascend.
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
        let unit = |normal: &Vector3<f64>| {
            let (value, rule) = (normal.norm(), "it must be 1");
            let fine = (value - 1.0).abs() < 1e-9;
            if fine { Ok(()) } else { Err(SimError::Setting { what: "length of the drive's normal", value, rule }) }
        };
        match self {
            Self::Off | Self::GravityCompensation | Self::User(_) => Ok(()),
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
                kp.check("kp", chain)?;
                kd.check("kd", chain)?;
                if chain.nq() == chain.nv() {
                    return Ok(chain.check_v("target", target)?);
                }
                let refuse = |what, value, rule| Err(SimError::Setting { what, value, rule });
                if target.len() != chain.nq() {
                    let rule = "it must be nq, as that of q; the numbers of floating joints are not used";
                    return refuse("length of the target", target.len() as f64, rule);
                }
                match motors(chain).iter().map(|motor| target[motor.q]).find(|x| !x.is_finite()) {
                    Some(value) => refuse("number of the target", value, "it must be finite"),
                    None => Ok(()),
                }
            }
            Self::Tracking(tracking) => tracking.check(chain, &motors(chain)),
            Self::Transition(transition) => {
                chain.frame(&transition.tip)?;
                not_negative("gain", transition.gain)?;
                not_negative("press", transition.press)?;
                unit(&transition.normal)
            }
            Self::ImpactInvariant(invariant) => {
                chain.frame(&invariant.tip)?;
                invariant.kp.check("kp", chain)?;
                invariant.kd.check("kd", chain)?;
                regulates(&invariant.target, "target")?;
                regulates(&invariant.velocity, "velocity")?;
                unit(&invariant.normal)
            }
        }
    }

    /// The drive of a reduced chain; `whole` is the chain before.
    pub(crate) fn reduced(&self, whole: &Chain, less: &Reduced<Spatial<f64>>) -> Self {
        let pick = |numbers: &[f64], indices: &[usize]| indices.iter().map(|&k| numbers[k]).collect::<Vec<_>>();
        let mut drive = self.clone();
        match &mut drive {
            Self::Constant(forces) => *forces = pick(forces, &less.v),
            Self::Table { forces, .. } => forces.iter_mut().for_each(|row| *row = pick(row, &less.v)),
            Self::Pd { kp, kd, target } => {
                [kp, kd].into_iter().for_each(|gains| gains.pick(&less.v));
                *target = pick(target, &less.q);
            }
            Self::Tracking(tracking) => tracking.reduced(&motors(whole), &less.v),
            Self::ImpactInvariant(invariant) => {
                [&mut invariant.kp, &mut invariant.kd].into_iter().for_each(|gains| gains.pick(&less.v));
                invariant.target = pick(&invariant.target, &less.q);
                invariant.velocity = pick(&invariant.velocity, &less.v);
            }
            Self::Off | Self::GravityCompensation | Self::Transition(_) | Self::User(_) => {}
        }
        drive
    }

    /// Whether the joint forces do not depend on time explicitly.
    pub(crate) fn is_steady(&self) -> bool {
        match self {
            Self::Table { .. } | Self::Tracking(_) => false,
            Self::User(controller) => controller.is_steady(),
            _ => true,
        }
    }

    /// Stiffness and damping of a joint with one coordinate, by its number of qd.
    pub(crate) fn gains(&self, v: usize) -> (f64, f64) {
        match self {
            Self::Pd { kp, kd, .. } => (kp.at(v), kd.at(v)),
            Self::Tracking(tracking) => (tracking.kp.at(v), tracking.kd.at(v)),
            Self::ImpactInvariant(invariant) => (invariant.kp.at(v), invariant.kd.at(v)),
            _ => (0.0, 0.0),
        }
    }

    /// The next time at which the forces have a kink.
    pub(crate) fn next_kink(&self, time: f64) -> Option<f64> {
        match self {
            Self::Table { times, .. } => next_of(times, time),
            Self::Tracking(tracking) => tracking.reference.next_kink(time),
            Self::User(controller) => controller.next_kink(time).filter(|kink| *kink > time),
            _ => None,
        }
    }

    /// Adds the joint forces of the motors to `tau`; returns their power.
    pub(crate) fn push<A: Space>(
        &self,
        asked: &Asked,
        (model, workspace): (&A::Model, &mut Workspace<A>),
        (q, qd): (&[f64], &[f64]),
        tau: &mut [f64],
    ) -> Result<f64, SimError> {
        if asked.limits.is_empty() {
            let mut power = 0.0;
            let add = |i: usize, force: f64| {
                tau[i] += force;
                power += force * qd[i];
            };
            self.each(asked, (model, workspace), (q, qd), add)?;
            return Ok(power);
        }
        let mut own = vec![0.0; qd.len()];
        self.each(asked, (model, workspace), (q, qd), |i, force| own[i] += force)?;
        let mut power = 0.0;
        for (i, (force, limit)) in own.into_iter().zip(asked.limits).enumerate() {
            let force = force.clamp(-limit, *limit);
            tau[i] += force;
            power += force * qd[i];
        }
        Ok(power)
    }

    /// Passes the forces to `add`, by number of qd; several for one number add up.
    fn each<A: Space>(
        &self,
        asked: &Asked,
        (model, workspace): (&A::Model, &mut Workspace<A>),
        (q, qd): (&[f64], &[f64]),
        mut add: impl FnMut(usize, f64),
    ) -> Result<(), SimError> {
        match self {
            Self::Off => {}
            Self::Constant(forces) => forces.iter().enumerate().for_each(|(i, force)| add(i, *force)),
            Self::Table { times, forces } => {
                let (before, after, share) = between(times, asked.time);
                let (before, after) = (&forces[before], &forces[after]);
                (0..qd.len()).for_each(|i| add(i, before[i] + (after[i] - before[i]) * share));
            }
            Self::Pd { kp, kd, target } => {
                for &Motor { q: at, v, .. } in asked.motors {
                    add(v, kp.at(v) * (target[at] - q[at]) - kd.at(v) * qd[v]);
                }
            }
            Self::Tracking(tracking) => tracking.push(asked, (model, workspace), (q, qd), add)?,
            Self::GravityCompensation => {
                let forces = View::<A>::new(model, workspace, q)?.gravity_force(asked.gravity);
                asked.motors.iter().for_each(|motor| add(motor.v, forces[motor.v]));
            }
            Self::Transition(transition) => {
                let forces = transition.forces(asked, &mut View::<A>::new(model, workspace, q)?, qd)?;
                forces.into_iter().enumerate().for_each(|(i, force)| add(i, force));
            }
            Self::ImpactInvariant(invariant) => {
                let forces = invariant.forces(asked, &mut View::<A>::new(model, workspace, q)?, q, qd)?;
                forces.into_iter().enumerate().for_each(|(i, force)| add(i, force));
            }
            Self::User(controller) => {
                let mut forces = vec![0.0; qd.len()];
                let Asked { chain, time, gravity, hit, .. } = *asked;
                controller.forces(&Observed { chain, time, q, qd, gravity, hit }, &mut forces)?;
                if let Some(v) = forces.iter().position(|force| !force.is_finite()) {
                    let joint = chain.joint_of_velocity(v).map_or_else(String::new, |joint| joint.name.clone());
                    let problem = format!("gets the force {} from controller '{}'", forces[v], controller.name());
                    return Err(SimError::Joint { joint, problem });
                }
                asked.motors.iter().for_each(|motor| add(motor.v, forces[motor.v]));
            }
        }
        Ok(())
    }
}
