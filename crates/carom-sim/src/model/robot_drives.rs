//! A drive for each of several robots.

use super::control_law::{Add, Asked, Body, ControlLaw, Driven, State};
use super::drive::Drive;
use super::gains::Motor;
use crate::error::{SimError, require};
use crate::state::Space;
use std::ops::Range;

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
    pub(super) fn drives(&self) -> impl Iterator<Item = &Drive> {
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
    fn name(&self) -> &str {
        "one for each robot"
    }

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
