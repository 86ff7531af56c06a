//! The controllers in a scene file, and the keys that each of them reads.

use super::file::{CONTROLLERS, Control, Controller, PerJoint, Target};
use super::surface::half_space;
use super::table::Columns;
use crate::contact::Surface;
use crate::model::{Drive, Feedback, Gains, ImpactInvariant, Pd, Reference, TorqueTable, Tracking, Transition, motors};
use carom_chain::{Chain, ChainError, Coordinates};
use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// What a controller reads, and how it is made from it.
type Row = (&'static [&'static str], fn(&Drives) -> Result<Drive, String>);

/// The controllers of scene files, in the order of their names.
const ROWS: [Row; CONTROLLERS.len()] = [
    (&[], |_| Ok(Drive::Off)),
    (&["target", "kp", "kd"], |own| own.pd()),
    (&["torque"], |own| Ok(Drive::Constant(own.given("torque", &own.control.torque)?.clone()))),
    (&[], |_| Ok(Drive::GravityCompensation)),
    (&["gain", "press", "compensate"], |own| own.transition()),
    (&["target", "kp", "kd"], |own| own.impact_invariant()),
    (&["torque_file"], |own| own.torque_file()),
    (&["reference", "kp", "kd", "feed_forward"], |own| own.tracking()),
    (&["feedback_file", "torque_file", "torque"], |own| own.feedback()),
];

/// What the controllers of a robot are made from.
#[derive(Clone, Copy)]
pub(crate) struct Drives<'a> {
    /// The key that chooses a controller, and the controller's name.
    pub asks: &'a str,
    pub name: &'a str,
    pub folder: &'a Path,
    /// The table of the file that has the keys.
    pub table: &'a str,
    pub control: &'a Control,
    /// The robot, and its configuration at the start.
    pub chain: &'a Chain,
    pub q: &'a [f64],
    /// Its link that is the tip; `None` for several robots at once.
    pub tip: Option<&'a str>,
    /// The same in the chain of all robots.
    pub tip_in_world: Option<&'a str>,
    pub surfaces: &'a [Surface],
    pub world: World<'a>,
}

/// All robots at the start.
#[derive(Clone, Copy)]
pub(crate) struct World<'a> {
    pub chain: &'a Chain,
    pub q: &'a [f64],
    pub qd: &'a [f64],
}

impl World<'_> {
    /// Velocity of the origin of a link.
    fn velocity(self, link: &str) -> Result<Vector3<f64>, ChainError> {
        let point = self.chain.point(self.chain.frame(link)?, Vector3::zeros());
        self.chain.workspace().update(self.chain, self.q)?.point_velocity(point, self.qd)
    }
}

impl Drives<'_> {
    /// The drive, and that after the first impact.
    pub fn both(&self) -> Result<(Drive, Option<Drive>), String> {
        let Control { controller, after_impact, .. } = self.control;
        let made = |asks, Controller(row): Controller| {
            let (_, make) = ROWS[row];
            make(&Drives { asks, name: CONTROLLERS[row], ..*self })
        };
        let drive = made("controller", *controller)?;
        let after = after_impact.map(|after| made("after_impact", after)).transpose()?;
        self.check_unused()?;
        Ok((drive, after))
    }

    /// Refuses keys that no chosen controller reads.
    fn check_unused(&self) -> Result<(), String> {
        let Control { controller, after_impact, given, .. } = self.control;
        let reads = |row: usize, key: &str| ROWS[row].0.contains(&key);
        for key in given {
            let read = [Some(*controller), *after_impact].into_iter().flatten().any(|Controller(row)| reads(row, key));
            if let Some(row) = (0..ROWS.len()).find(|row| reads(*row, key)).filter(|_| !read) {
                let name = CONTROLLERS[row];
                return Err(format!(
                    "{} {key} is not read by the chosen controller: remove it or set controller = \"{name}\"",
                    self.table
                ));
            }
        }
        Ok(())
    }

    /// A message that begins with what is asked for.
    fn refuse(&self, why: &str) -> String {
        format!("{} {} = \"{}\" {why}", self.table, self.asks, self.name)
    }

    /// The value of a key that it needs.
    fn given<'g, T>(&self, key: &str, value: &'g Option<T>) -> Result<&'g T, String> {
        value.as_ref().ok_or_else(|| self.refuse(&format!("needs the key {key}")))
    }

    fn gains(&self) -> Result<[Gains; 2], String> {
        if motors(self.chain).is_empty() {
            return Err(
                self.refuse("acts on joints with one coordinate, and the robot has none: choose another controller")
            );
        }
        let gains = |key: &str, value| match self.given(key, value)? {
            PerJoint::Same(gain) => Ok(Gains::Same(*gain)),
            each => per_joint(key, each, self.chain).map(Gains::Each).map_err(|why| format!("{} {why}", self.table)),
        };
        Ok([gains("kp", &self.control.kp)?, gains("kd", &self.control.kd)?])
    }

    fn target(&self) -> Result<Vec<f64>, String> {
        let target = self.given("target: {} keeps the positions at the start", &self.control.target)?;
        let refuse = |why: String| format!("{} {why}", self.table);
        let target = positions("target", target, self.chain, self.q).map_err(refuse)?;
        if self.chain.nq() == self.chain.nv() {
            self.chain.check_v("target", &target).map_err(|e| refuse(e.to_string()))?;
        } else if target.len() != self.chain.nq() {
            let (given, needed) = (target.len(), self.chain.nq());
            return Err(refuse(format!("target has {given} numbers, {needed} are needed, as of q")));
        }
        Ok(target)
    }

    fn tip<'t>(&self, link: Option<&'t str>) -> Result<&'t str, String> {
        link.ok_or_else(|| self.refuse("is for one robot: give it in its [[robot]]"))
    }

    fn normal(&self) -> Result<Vector3<f64>, String> {
        let none = || self.refuse("refers to the first surface, which must be a halfspace");
        half_space(self.surfaces.first()).ok_or_else(none)
    }

    /// What a table over time gives, whose file is the value of a key.
    fn table<T>(
        &self,
        key: &str,
        file: &Option<PathBuf>,
        read: impl Fn(&Path, &Chain) -> Result<T, String>,
    ) -> Result<T, String> {
        let path = self.folder.join(self.given(key, file)?);
        read(&path, self.chain).map_err(|why| format!("{} {key} {}: {why}", self.table, path.display()))
    }

    fn pd(&self) -> Result<Drive, String> {
        let [kp, kd] = self.gains()?;
        Ok(Drive::Pd(Pd { kp, kd, target: self.target()? }))
    }

    fn torque_file(&self) -> Result<Drive, String> {
        self.table("torque_file", &self.control.torque_file, torque_table).map(Drive::Table)
    }

    fn feedback(&self) -> Result<Drive, String> {
        let Control { torque, torque_file: file, feedback_file, .. } = self.control;
        if self.chain.nv() != self.world.chain.nv() {
            return Err(self.refuse("is for all joints: give it in [run]"));
        }
        let forces = match (torque, file) {
            (None, None) => None,
            (Some(torque), None) => Some(TorqueTable { times: vec![0.0], forces: vec![torque.clone()] }),
            (None, Some(_)) => Some(self.table("torque_file", file, torque_table)?),
            (Some(_), Some(_)) => return Err(self.refuse("takes torque or torque_file, not both")),
        };
        let rows = self.table("feedback_file", feedback_file, |path, chain| {
            let wanted = Feedback::columns(chain);
            let optional = |name: &str| name == "impacts" || name.starts_with("gain.");
            let (times, rows) = Columns::named(path, &wanted)?.pick(&wanted, optional, "number")?;
            match rows.iter().zip(&times).find(|(row, _)| row[0] < 0.0 || row[0].fract() != 0.0) {
                Some((row, time)) => Err(format!("impacts = {} at the time {time}: it must be a whole number", row[0])),
                // Gains are the last columns; one that is left out is zero.
                None if rows.iter().all(|row| row[1 + chain.nq() + chain.nv()..].iter().all(|gain| *gain == 0.0)) => {
                    Err("has no gain that is not zero: give columns gain.JOINT.q.JOINT, gain.JOINT.qd.JOINT".into())
                }
                None => Ok((times, rows)),
            }
        })?;
        Ok(Drive::Feedback(Feedback::of_table(self.chain, forces, rows)))
    }

    fn tracking(&self) -> Result<Drive, String> {
        let [kp, kd] = self.gains()?;
        let driven = motors(self.chain).len() == self.chain.nv();
        let feed_forward = self.control.feed_forward.unwrap_or(driven);
        let reference = self.table("reference", &self.control.reference, reference)?;
        Ok(Drive::Tracking(Tracking { reference, kp, kd, feed_forward }))
    }

    fn impact_invariant(&self) -> Result<Drive, String> {
        let (tip, normal, [kp, kd]) = (self.tip(self.tip)?.to_owned(), self.normal()?, self.gains()?);
        let (target, velocity) = (self.target()?, vec![0.0; self.chain.nv()]);
        Ok(Drive::ImpactInvariant(ImpactInvariant { tip, normal, kp, kd, target, velocity }))
    }

    /// The coefficient of the first surface, from which a rebound is predicted.
    fn restitution(&self) -> Result<f64, String> {
        let Some(law) = self.surfaces.first().map(|surface| &surface.contact.law) else { return Ok(0.0) };
        if law.by_speed.is_some() {
            return Err(self.refuse(
                "predicts the rebound with one coefficient, and the restitution of the first surface depends on the approach speed: \
                 give a number",
            ));
        }
        Ok(law.restitution())
    }

    fn transition(&self) -> Result<Drive, String> {
        let point = self.tip(self.tip_in_world)?;
        Ok(Drive::Transition(Transition {
            tip: self.tip(self.tip)?.to_owned(),
            normal: self.normal()?,
            velocity: self.world.velocity(point).map_err(|e| format!("{} {e}", self.table))?,
            gain: *self.given("gain", &self.control.gain)?,
            press: self.control.press.unwrap_or(0.0),
            compensate: self.control.compensate.unwrap_or(true),
            restitution: self.restitution()?,
        }))
    }
}

/// The joints with one coordinate: their names and numbers of q and qd, in the order of qd.
fn hinges(chain: &Chain) -> Vec<(String, usize, usize)> {
    let name = |v: usize| chain.joint_of_velocity(v).map_or_else(String::new, |joint| joint.name.clone());
    motors(chain).iter().map(|motor| (name(motor.v), motor.q, motor.v)).collect()
}

/// One number for each number of qd; those of floating and planar joints are zero.
pub(crate) fn per_joint(key: &str, given: &PerJoint, chain: &Chain) -> Result<Vec<f64>, String> {
    let mut each = vec![0.0; chain.nv()];
    let hinges = hinges(chain);
    match given {
        PerJoint::Same(value) => hinges.iter().for_each(|(_, _, v)| each[*v] = *value),
        PerJoint::Each(values) if values.len() == chain.nv() => each.copy_from_slice(values),
        PerJoint::Each(values) if values.len() == hinges.len() => {
            hinges.iter().zip(values).for_each(|((_, _, v), value)| each[*v] = *value);
        }
        PerJoint::Each(values) => {
            let (have, nv, joints) = (values.len(), chain.nv(), hinges.len());
            return Err(format!(
                "{key} has {have} numbers: give one number, {joints} (one for each joint with one coordinate), {nv} (one for \
                 each number of qd), or a table by joint name"
            ));
        }
        PerJoint::Named(values) => {
            for (name, value) in values {
                each[named(key, name, &hinges)?.2] = *value;
            }
        }
    }
    Ok(each)
}

fn named<'h>(
    key: &str,
    name: &str,
    hinges: &'h [(String, usize, usize)],
) -> Result<&'h (String, usize, usize), String> {
    hinges.iter().find(|(own, ..)| own == name).ok_or_else(|| {
        let known: Vec<&str> = hinges.iter().map(|(own, ..)| own.as_str()).collect();
        format!("{key} names the joint '{name}': the joints with one coordinate are {}", known.join(", "))
    })
}

/// The positions that `key` gives; joints that are not named keep those of `start`.
pub(crate) fn positions(key: &str, given: &Target, chain: &Chain, start: &[f64]) -> Result<Vec<f64>, String> {
    let with = |values: &mut dyn Iterator<Item = (&String, f64)>| {
        let (mut target, hinges) = (start.to_vec(), hinges(chain));
        for (name, value) in values {
            target[named(key, name, &hinges)?.1] = value;
        }
        Ok(target)
    };
    match given {
        Target::Each(values) => Ok(values.clone()),
        Target::Named(values) => with(&mut values.iter().map(|(name, value)| (name, *value))),
        Target::Pose(name) => {
            let pose = chain.poses().iter().find(|pose| pose.name == *name).ok_or_else(|| {
                let known: Vec<&str> = chain.poses().iter().map(|pose| pose.name.as_str()).collect();
                let known = if known.is_empty() {
                    "none: give srdf, a file with <group_state>".into()
                } else {
                    known.join(", ")
                };
                format!("{key} = \"{name}\": the poses of the SRDF are {known}")
            })?;
            // A pose of the file may name fixed and mimic joints, too, which have no position of their own.
            let own =
                |joint: &str| chain.joint(joint).is_ok_and(|it| matches!(it.coordinates, Coordinates::Own { .. }));
            let mut found = Vec::new();
            for (joint, numbers) in pose.positions.iter().filter(|(joint, _)| own(joint)) {
                let [x] = numbers[..] else {
                    let count = numbers.len();
                    return Err(format!(
                        "{key} = \"{name}\": the SRDF gives joint '{joint}' {count} numbers, where a hinge or slider has one: give {key} by \
                         joint names"
                    ));
                };
                found.push((joint, x));
            }
            with(&mut found.into_iter())
        }
    }
}

/// The names of the joints with one coordinate, in the order of qd.
fn names(chain: &Chain) -> Vec<String> {
    hinges(chain).into_iter().map(|(name, ..)| name).collect()
}

/// Joint forces over time: by joint name, or without names in the order of qd.
fn torque_table(path: &Path, chain: &Chain) -> Result<TorqueTable, String> {
    let table = Columns::read(path)?;
    if !table.has_names() {
        let wanted: Vec<String> = (0..chain.nv()).map(|v| v.to_string()).collect();
        let (times, forces) = table.pick(&wanted, |_| false, "joint force")?;
        return Ok(TorqueTable { times, forces });
    }
    let (times, rows) = table.pick(&names(chain), |_| false, "joint force")?;
    let spread = |row: Vec<f64>| {
        let mut all = vec![0.0; chain.nv()];
        motors(chain).iter().zip(row).for_each(|(motor, force)| all[motor.v] = force);
        all
    };
    Ok(TorqueTable { times, forces: rows.into_iter().map(spread).collect() })
}

/// Positions over time, by joint name.
fn reference(path: &Path, chain: &Chain) -> Result<Reference, String> {
    let (times, rows) = Columns::named(path, &names(chain))?.pick(&names(chain), |_| false, "position")?;
    Reference::new(times, &rows).map_err(|e| e.to_string())
}

/// The targets of a drive that are outside joint limits, beside those at which the joints start.
pub(crate) fn targets_outside(drive: &Drive, chain: &Chain, start: &[f64]) -> Vec<String> {
    let at_start = chain.outside_limits(start);
    let outside = |target: &[f64], own: &dyn Fn(usize) -> bool| {
        let of_robot = |name: &str| {
            let at = chain.joint(name).ok().map(|joint| &joint.coordinates);
            matches!(at, Some(Coordinates::Own { v, .. }) if own(v.start))
        };
        let found = chain.outside_limits(target).into_iter();
        let new = found.filter(|(name, why)| of_robot(name) && !at_start.contains(&(name, why.clone())));
        new.map(|(_, why)| format!("[run] target: {why}")).collect()
    };
    let target = |drive: &Drive, own: &dyn Fn(usize) -> bool| match drive {
        Drive::Pd(Pd { target, .. }) | Drive::ImpactInvariant(ImpactInvariant { target, .. }) => outside(target, own),
        _ => Vec::new(),
    };
    match drive {
        Drive::Robots(robots) => {
            let drives = robots.iter().flat_map(|it| it.drives().map(move |own| (it, own)));
            drives.flat_map(|(it, own)| target(own, &|v| it.v.contains(&v))).collect()
        }
        own => target(own, &|_| true),
    }
}
