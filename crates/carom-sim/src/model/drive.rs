//! Joint drives: motors off, torque tables, PD control, tracking, controllers for impacts and users' own.

use super::asked::Asked;
use super::controller::{Controller, Observed, UserController};
use super::gains::{Gains, Motor, motors, not_negative};
use super::impact_controllers::{ImpactInvariant, Transition};
use super::tracking::Tracking;
use crate::error::SimError;
use crate::state::{Space, View, between, next_of};
use carom_chain::urdf::JointType;
use carom_chain::{Chain, ChainError, Member, Workspace};
use nalgebra::Vector3;
use std::ops::Range;

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
    /// A drive for each robot of a chain that [`Chain::join`] has made, also from its own first impact on, which is here the first
    /// one of any of its links and joint limits. Robots that are not named have none.
    Robots(Vec<RobotDrive>),
}

/// The drive of one robot.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotDrive {
    /// Name of the robot.
    pub robot: String,
    /// Its entries of qd; the drive acts on no others.
    pub v: Range<usize>,
    /// Its drive, with the lengths nq and nv of the joined chain.
    pub drive: Drive,
    /// Its drive from its own first impact on; `None`: `drive` remains.
    pub after_impact: Option<Drive>,
}

impl RobotDrive {
    /// Both drives.
    fn drives(&self) -> impl Iterator<Item = &Drive> {
        std::iter::once(&self.drive).chain(&self.after_impact)
    }

    /// The motors of the robot.
    fn motors<'m>(&self, motors: &'m [Motor]) -> &'m [Motor] {
        let before = |end: usize| motors.partition_point(|motor| motor.v < end);
        &motors[before(self.v.start)..before(self.v.end)]
    }
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
            Self::Robots(_) => "one for each robot",
        }
    }

    /// Its name, or those of each robot's drives.
    pub(crate) fn description(&self) -> String {
        let Self::Robots(robots) = self else { return self.name().to_owned() };
        let told = |it: &RobotDrive| {
            let after = it.after_impact.as_ref().map(|after| format!(" ({} from its first impact on)", after.name()));
            format!("{}: {}{}", it.robot, it.drive.name(), after.unwrap_or_default())
        };
        robots.iter().map(told).collect::<Vec<_>>().join(", ")
    }

    /// The drives of the robots, each with the robot's name; for one robot its drive without a name.
    pub(crate) fn each_robot(&self) -> Vec<(Option<&str>, &Self)> {
        match self {
            Self::Robots(robots) => {
                robots.iter().flat_map(|it| it.drives().map(|drive| (Some(it.robot.as_str()), drive))).collect()
            }
            drive => vec![(None, drive)],
        }
    }

    /// The drive of one robot as a drive of the joined chain: its numbers at the robot's entries, zeros elsewhere.
    pub(crate) fn of_member(mut self, member: &Member, (nq, nv): (usize, usize)) -> Self {
        let spread = |own: &mut Vec<f64>, at: &Range<usize>, n: usize| {
            let mut all = vec![0.0; n];
            all[at.clone()].copy_from_slice(own);
            *own = all;
        };
        let gains = |gains: &mut Gains| {
            if let Gains::Each(own) = gains {
                spread(own, &member.v, nv);
            }
        };
        match &mut self {
            Self::Constant(forces) => spread(forces, &member.v, nv),
            Self::Table { forces, .. } => forces.iter_mut().for_each(|row| spread(row, &member.v, nv)),
            Self::Pd { kp, kd, target } => {
                [kp, kd].into_iter().for_each(gains);
                spread(target, &member.q, nq);
            }
            Self::Tracking(tracking) => [&mut tracking.kp, &mut tracking.kd].into_iter().for_each(gains),
            Self::Transition(transition) => transition.tip = format!("{}/{}", member.name, transition.tip),
            Self::ImpactInvariant(invariant) => {
                [&mut invariant.kp, &mut invariant.kd].into_iter().for_each(gains);
                spread(&mut invariant.target, &member.q, nq);
                spread(&mut invariant.velocity, &member.v, nv);
                invariant.tip = format!("{}/{}", member.name, invariant.tip);
            }
            Self::Off | Self::GravityCompensation | Self::User(_) | Self::Robots(_) => {}
        }
        self
    }

    /// Checks that the drive fits a chain.
    ///
    /// # Errors
    /// [`SimError`]: wrong lengths, impact-invariant control of a chain with a floating joint, an unknown link, invalid
    /// gains, a torque table whose times do not ascend.
    pub(crate) fn check(&self, chain: &Chain) -> Result<(), SimError> {
        let motors = motors(chain);
        if let Self::Robots(robots) = self {
            return robots.iter().try_for_each(|it| {
                let (value, rule) = (it.v.end as f64, "the entries of a robot's drive must be entries of qd");
                if it.v.end > chain.nv() {
                    return Err(SimError::Setting { what: "end of a robot's entries", value, rule });
                }
                it.drives().try_for_each(|drive| drive.check_on(chain, it.motors(&motors), it.v.clone()))
            });
        }
        self.check_on(chain, &motors, 0..chain.nv())
    }

    /// The same for the robot that has these motors and entries of qd.
    fn check_on(&self, chain: &Chain, own: &[Motor], v: Range<usize>) -> Result<(), SimError> {
        let lengths = |target: &[f64]| {
            let (what, value) = ("length of the target", target.len() as f64);
            let rule = "it must be nq, as that of q; the numbers of floating joints are not used";
            if target.len() == chain.nq() { Ok(()) } else { Err(SimError::Setting { what, value, rule }) }
        };
        let floats = v.clone().find_map(|v| chain.joint_of_velocity(v).filter(|it| it.kind == JointType::Floating));
        let unit = |normal: &Vector3<f64>| {
            let (value, rule) = (normal.norm(), "it must be 1");
            let fine = (value - 1.0).abs() < 1e-9;
            if fine { Ok(()) } else { Err(SimError::Setting { what: "length of the drive's normal", value, rule }) }
        };
        match self {
            Self::Off | Self::GravityCompensation | Self::User(_) => Ok(()),
            Self::Robots(_) => {
                let rule = "the drive of one robot must not be divided among robots again";
                Err(SimError::Setting { what: "number of robots of a drive", value: 0.0, rule })
            }
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
                lengths(target)?;
                match own.iter().map(|motor| target[motor.q]).find(|x| !x.is_finite()) {
                    Some(value) => {
                        Err(SimError::Setting { what: "number of the target", value, rule: "it must be finite" })
                    }
                    None => Ok(()),
                }
            }
            Self::Tracking(tracking) => tracking.check(chain, own, v.len()),
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
                if let Some(base) = floats {
                    let why = format!(
                        "a controller with a target configuration needs q̇ = qd, but '{}' has the floating joint '{}': choose \
                         another controller",
                        chain.name(),
                        base.name
                    );
                    return Err(SimError::from(ChainError::NotReducible(why)));
                }
                if chain.nq() == chain.nv() {
                    chain.check_v("target", &invariant.target)?;
                } else {
                    lengths(&invariant.target)?;
                }
                chain.check_v("velocity", &invariant.velocity)?;
                unit(&invariant.normal)
            }
        }
    }

    /// Whether the joint forces do not depend on time explicitly.
    pub(crate) fn is_steady(&self) -> bool {
        match self {
            Self::Table { .. } | Self::Tracking(_) => false,
            Self::User(controller) => controller.is_steady(),
            Self::Robots(robots) => robots.iter().flat_map(RobotDrive::drives).all(Self::is_steady),
            _ => true,
        }
    }

    /// Stiffness and damping of a joint with one coordinate, by its number of qd.
    pub(crate) fn gains(&self, v: usize) -> (f64, f64) {
        match self {
            Self::Pd { kp, kd, .. } => (kp.at(v), kd.at(v)),
            Self::Tracking(tracking) => (tracking.kp.at(v), tracking.kd.at(v)),
            Self::ImpactInvariant(invariant) => (invariant.kp.at(v), invariant.kd.at(v)),
            Self::Robots(robots) => {
                let own = robots.iter().filter(|it| it.v.contains(&v)).flat_map(RobotDrive::drives);
                own.map(|drive| drive.gains(v)).fold((0.0, 0.0), |(p, d), (p2, d2)| (p.max(p2), d.max(d2)))
            }
            _ => (0.0, 0.0),
        }
    }

    /// The next time at which the forces have a kink.
    pub(crate) fn next_kink(&self, time: f64) -> Option<f64> {
        match self {
            Self::Table { times, .. } => next_of(times, time),
            Self::Tracking(tracking) => tracking.reference.next_kink(time),
            Self::User(controller) => controller.next_kink(time).filter(|kink| *kink > time),
            Self::Robots(robots) => {
                let drives = robots.iter().flat_map(RobotDrive::drives);
                drives.filter_map(|drive| drive.next_kink(time)).min_by(f64::total_cmp)
            }
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
        state: (&[f64], &[f64]),
        mut add: impl FnMut(usize, f64),
    ) -> Result<(), SimError> {
        let Self::Robots(robots) = self else { return self.one(asked, (model, workspace), state, add) };
        robots.iter().try_for_each(|it| {
            let hit = asked.hit.get(it.v.clone()).unwrap_or_default();
            let own = Asked { motors: it.motors(asked.motors), hit, ..*asked };
            let after = it.after_impact.as_ref().filter(|_| own.was_hit());
            after.unwrap_or(&it.drive).one(&own, (model, &mut *workspace), state, |v, force| {
                if it.v.contains(&v) {
                    add(v, force);
                }
            })
        })
    }

    /// The same for one robot.
    fn one<A: Space>(
        &self,
        asked: &Asked,
        (model, workspace): (&A::Model, &mut Workspace<A>),
        (q, qd): (&[f64], &[f64]),
        mut add: impl FnMut(usize, f64),
    ) -> Result<(), SimError> {
        match self {
            Self::Off | Self::Robots(_) => {}
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
                invariant.forces(asked, &mut View::<A>::new(model, workspace, q)?, (q, qd), add)?;
            }
            Self::User(controller) => {
                let mut forces = vec![0.0; qd.len()];
                let Asked { chain, time, gravity, .. } = *asked;
                let hit = asked.was_hit();
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
