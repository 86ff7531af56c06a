//! Joint drives: the list of controllers.

use super::control_law::{Add, Asked, Body, ControlLaw, Driven, Number, Part, State};
use super::controller::{Controller, UserController};
use super::feedback::Feedback;
use super::gains::{Gains, Motor, motors};
use super::impact_controllers::{ImpactInvariant, Transition};
use super::pd::Pd;
use super::torques::{GravityCompensation, Off, TorqueTable};
use super::tracking::Tracking;
use crate::error::{SimError, require};
use crate::state::Space;
use carom_chain::{Chain, Member};
use std::ops::Range;
use std::sync::Arc;

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
    /// Joint forces at given times.
    Table(TorqueTable),
    /// PD feedback to a configuration.
    Pd(Pd),
    /// Tracking of a reference trajectory.
    Tracking(Tracking),
    /// Feedback with gains over time along a motion, through its impacts.
    Feedback(Feedback),
    /// The joint forces that balance gravity. A floating base is not held: it falls unless contacts carry it.
    GravityCompensation,
    /// Transition from free motion to contact (Pagilla & Yu).
    Transition(Transition),
    /// PD feedback that does not react to the velocity jump of a normal impulse (Yang & Posa).
    ImpactInvariant(ImpactInvariant),
    /// A user's own [`Controller`]: see [`Drive::user`]. [`Scene::plan`](crate::Scene::plan) keeps all joints for it.
    User(UserController),
    /// A drive for each robot of a chain that [`Chain::join`] has made, also from its own first impact on, which is here the first
    /// one of any of its links and joint limits. Robots that are not named have none.
    Robots(Vec<RobotDrive>),
}

/// Evaluates `$call` for the controller `$own` of a drive: the table of the controllers.
macro_rules! of_controller {
    ($drive:expr, $own:ident => $call:expr) => {
        match $drive {
            Drive::Off => {
                let $own = Box::leak(Box::new(Off)); // a value without memory
                $call
            }
            Drive::Constant($own) => $call,
            Drive::Table($own) => $call,
            Drive::Pd($own) => $call,
            Drive::Tracking($own) => $call,
            Drive::Feedback($own) => $call,
            Drive::GravityCompensation => {
                let $own = Box::leak(Box::new(GravityCompensation));
                $call
            }
            Drive::Transition($own) => $call,
            Drive::ImpactInvariant($own) => $call,
            Drive::User($own) => $call,
            Drive::Robots($own) => $call,
        }
    };
}

impl Drive {
    /// The drive of a user's own controller.
    pub fn user(controller: impl Controller + 'static) -> Self {
        Self::User(UserController(Arc::new(controller)))
    }

    /// Its name in scene files; for a user's controller its own.
    pub fn name(&self) -> &str {
        match self {
            Self::Off => "off",
            Self::Constant(_) => "constant",
            Self::Table(_) => "torque-file",
            Self::Pd(_) => "pd",
            Self::Tracking(_) => "tracking",
            Self::Feedback(_) => "feedback",
            Self::GravityCompensation => "gravity-compensation",
            Self::Transition(_) => "transition",
            Self::ImpactInvariant(_) => "impact-invariant",
            Self::User(own) => own.0.name(),
            Self::Robots(_) => "one for each robot",
        }
    }

    /// Whether the joint forces do not depend on time explicitly.
    pub(crate) fn is_steady(&self) -> bool {
        self.each_robot().all(|(_, own)| match own {
            Self::Tracking(_) => false,
            Self::Table(own) => own.is_steady(),
            Self::Feedback(own) => own.is_steady(),
            Self::User(own) => own.0.is_steady(),
            _ => true,
        })
    }

    /// Whether a formula of it is that of a tree, without loops.
    pub(crate) fn is_of_trees(&self) -> bool {
        self.each_robot().any(|(_, own)| matches!(own, Self::Transition(_) | Self::ImpactInvariant(_)))
    }

    /// The rate of its feedback beside the gains of joints, 1/s.
    pub(crate) fn rate(&self) -> f64 {
        let rate = |own: &Self| if let Self::Transition(own) = own { own.gain } else { 0.0 };
        self.each_robot().map(|(_, own)| rate(own)).fold(0.0, f64::max)
    }

    /// The next time at which the forces have a kink; infinite without one.
    pub(crate) fn next_kink(&self, time: f64) -> f64 {
        self.each_robot().filter_map(|(_, own)| own.law().next_kink(time)).fold(f64::INFINITY, f64::min)
    }

    /// Its controller.
    pub(crate) fn law(&self) -> &dyn ControlLaw {
        of_controller!(self, own => own)
    }

    /// Its name, or those of each robot's drives.
    pub(crate) fn description(&self) -> String {
        let Self::Robots(robots) = self else { return self.name().to_owned() };
        robots.iter().map(RobotDrive::description).collect::<Vec<_>>().join(", ")
    }

    /// The drives of the robots, each with the robot's name; for one robot its drive without a name.
    pub(crate) fn each_robot(&self) -> impl Iterator<Item = (Option<&str>, &Self)> {
        let (robots, own) = match self {
            Self::Robots(robots) => (robots.as_slice(), None),
            own => (&[][..], Some((None, own))),
        };
        let named = robots.iter().flat_map(|it| it.drives().map(|drive| (Some(it.robot.as_str()), drive)));
        named.chain(own)
    }

    fn parts(&mut self) -> Vec<(&'static str, Part<'_>)> {
        of_controller!(self, own => own.parts())
    }

    /// The numbers at a joint by which a run can be differentiated, beside the points of a reference. `nv`: number of velocities of
    /// the chain.
    pub(super) fn parameters(&mut self, joint: &Motor, nv: usize) -> Vec<(Number, &mut f64)> {
        match self {
            Self::Constant(_) | Self::Pd(_) | Self::Tracking(_) | Self::Table(_) => {}
            Self::Robots(robots) => {
                let own = robots.iter_mut().filter(|it| it.v.contains(&joint.v));
                return own.flat_map(|it| it.drive.parameters(joint, nv)).collect();
            }
            _ => return Vec::new(),
        }
        let table = matches!(self, Self::Table(_));
        let number = |(row, (name, part))| {
            let number = Number { name, row: table.then_some(row) };
            match part {
                Part::Q(numbers) => Some((number, &mut numbers[joint.q])),
                Part::V(numbers) => Some((number, &mut numbers[joint.v])),
                Part::Gains(gains) => Some((number, &mut gains.each(nv)[joint.v])),
                Part::Link(_) => None,
            }
        };
        self.parts().into_iter().enumerate().filter_map(number).collect()
    }

    /// The tracking that drives a joint, and the number of the joint in its reference. `motors`: those of the chain.
    pub(super) fn tracking(&mut self, joint: &Motor, motors: &[Motor]) -> Option<(&mut Tracking, usize)> {
        match self {
            Self::Tracking(own) => Some((own, motors.iter().position(|motor| motor == joint)?)),
            Self::Robots(robots) => {
                let own = robots.iter_mut().find(|it| it.v.contains(&joint.v))?;
                let first = motors.partition_point(|motor| motor.v < own.v.start);
                own.drive.tracking(joint, &motors[first..])
            }
            _ => None,
        }
    }

    /// The first and the last time at which a number of a joint acts.
    pub(crate) fn span(&self, number: Number, joint: &Motor) -> [f64; 2] {
        match self {
            Self::Robots(robots) => {
                let own = robots.iter().find(|it| it.v.contains(&joint.v));
                own.map_or([f64::INFINITY; 2], |it| it.drive.span(number, joint))
            }
            own => number.row.map_or([f64::NEG_INFINITY, f64::INFINITY], |row| own.law().span(row)),
        }
    }

    /// The drive of one robot as a drive of the joined chain: its numbers at the robot's entries, zeros elsewhere.
    pub(crate) fn of_member(mut self, member: &Member, (nq, nv): (usize, usize)) -> Self {
        let spread = |own: &mut Vec<f64>, at: &Range<usize>, n: usize| {
            let mut all = vec![0.0; n];
            all[at.clone()].copy_from_slice(own);
            *own = all;
        };
        for (_, part) in self.parts() {
            match part {
                Part::Q(own) => spread(own, &member.q, nq),
                Part::V(own) | Part::Gains(Gains::Each(own)) => spread(own, &member.v, nv),
                Part::Gains(Gains::Same(_)) => {}
                Part::Link(name) => *name = format!("{}/{name}", member.name),
            }
        }
        self
    }

    /// Checks that the drive fits a chain.
    ///
    /// # Errors
    /// [`SimError`]: wrong lengths, impact-invariant control of a chain with a floating joint, an unknown link, invalid
    /// gains, a torque table whose times do not ascend.
    pub(crate) fn check(&self, chain: &Chain) -> Result<(), SimError> {
        self.check_on(&Driven { chain, motors: &motors(chain), v: 0..chain.nv() })
    }

    /// [`Self::check`] for one robot.
    pub(super) fn check_on(&self, robot: &Driven) -> Result<(), SimError> {
        let chain = robot.chain;
        for (what, part) in self.clone().parts() {
            match part {
                Part::Q(numbers) if chain.nq() == chain.nv() => chain.check_v(what, numbers)?,
                Part::Q(numbers) => {
                    let rule = "it must be nq, as that of q; the numbers of floating joints are not used";
                    require(numbers.len() == chain.nq(), "length of the target", numbers.len() as f64, rule)?;
                }
                Part::V(numbers) => chain.check_v(what, numbers)?,
                Part::Gains(gains) => gains.check(what, chain)?,
                Part::Link(name) => drop(chain.frame(name)?),
            }
        }
        self.law().check(robot)
    }

    /// Adds the joint forces of the motors to `tau`; returns their power.
    pub(crate) fn push<A: Space>(
        &self,
        asked: &Asked,
        body: Body<A>,
        (q, qd): State,
        tau: &mut [f64],
    ) -> Result<f64, SimError> {
        let mut power = 0.0;
        let mut act = |i: usize, force: f64| {
            tau[i] += force;
            power += force * qd[i];
        };
        if asked.limits.is_empty() {
            self.each::<A>(asked, body, (q, qd), &mut act)?;
        } else {
            let mut own = vec![0.0; qd.len()];
            self.each::<A>(asked, body, (q, qd), &mut |i, force| own[i] += force)?;
            let limited = own.into_iter().zip(asked.limits).map(|(force, limit)| force.clamp(-limit, *limit));
            limited.enumerate().for_each(|(i, force)| act(i, force));
        }
        Ok(power)
    }

    /// [`ControlLaw::drive`].
    pub(super) fn each<A: Space>(&self, asked: &Asked, body: Body<A>, state: State, add: Add) -> Result<(), SimError> {
        of_controller!(self, own => own.drive::<A>(asked, body, state, add))
    }
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
    pub(crate) fn drives(&self) -> impl Iterator<Item = &Drive> {
        std::iter::once(&self.drive).chain(&self.after_impact)
    }

    /// The name of the robot and those of its drives.
    pub(super) fn description(&self) -> String {
        let after = self.after_impact.as_ref().map(|after| format!(" ({} from its first impact on)", after.name()));
        format!("{}: {}{}", self.robot, self.drive.name(), after.unwrap_or_default())
    }

    /// The motors of the robot.
    fn motors<'m>(&self, motors: &'m [Motor]) -> &'m [Motor] {
        let before = |end: usize| motors.partition_point(|motor| motor.v < end);
        &motors[before(self.v.start)..before(self.v.end)]
    }
}

impl ControlLaw for Vec<RobotDrive> {
    fn check(&self, &Driven { chain, motors, .. }: &Driven) -> Result<(), SimError> {
        self.iter().try_for_each(|it| {
            let rule = "the entries of a robot's drive must be entries of qd";
            require(it.v.end <= chain.nv(), "end of a robot's entries", it.v.end as f64, rule)?;
            let divided = it.drives().any(|drive| matches!(drive, Drive::Robots(_)));
            let rule = "the drive of one robot must not be divided among robots again";
            require(!divided, "number of robots of a drive", 0.0, rule)?;
            let robot = Driven { chain, motors: it.motors(motors), v: it.v.clone() };
            it.drives().try_for_each(|drive| drive.check_on(&robot))
        })
    }

    fn gains(&self, v: usize) -> (f64, f64) {
        let own = self.iter().filter(|it| it.v.contains(&v)).flat_map(RobotDrive::drives);
        own.map(|drive| drive.law().gains(v)).fold((0.0, 0.0), |(p, d), (p2, d2)| (p.max(p2), d.max(d2)))
    }

    fn force_by(&self, number: Number, joint: &Motor, asked: &Asked, state: State) -> f64 {
        let Some(it) = self.iter().find(|it| it.v.contains(&joint.v)) else { return 0.0 };
        let hit = asked.hit.get(it.v.clone()).unwrap_or_default();
        let own = Asked { motors: it.motors(asked.motors), hit, ..*asked };
        let changed = it.after_impact.is_some() && own.was_hit();
        if changed { 0.0 } else { it.drive.law().force_by(number, joint, &own, state) }
    }

    fn is_decoupled(&self) -> bool {
        self.iter().all(|it| it.after_impact.is_none() && it.drive.law().is_decoupled())
    }

    fn drive<A: Space>(
        &self,
        asked: &Asked,
        (model, workspace): Body<A>,
        state: State,
        add: Add,
    ) -> Result<(), SimError> {
        self.iter().try_for_each(|it| {
            let hit = asked.hit.get(it.v.clone()).unwrap_or_default();
            let own = Asked { motors: it.motors(asked.motors), hit, ..*asked };
            let after = it.after_impact.as_ref().filter(|_| own.was_hit());
            after.unwrap_or(&it.drive).each::<A>(&own, (model, &mut *workspace), state, &mut |v, force| {
                if it.v.contains(&v) {
                    add(v, force);
                }
            })
        })
    }
}
