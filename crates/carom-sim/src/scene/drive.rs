//! The controllers in a scene file, and the keys that each of them reads.

use super::file::{Control, Controller, PerJoint, Target};
use super::surface::half_space;
use super::table::Columns;
use crate::contact::Surface;
use crate::model::{Drive, Gains, ImpactInvariant, Pd, Reference, TorqueTable, Tracking, Transition, motors};
use carom_chain::{Chain, ChainError, Coordinates};
use nalgebra::Vector3;
use std::path::Path;

/// What the controllers of a robot are made from.
pub(crate) struct Drives<'a> {
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
        let drive = self.drive("controller", self.control.controller)?;
        let after = self.control.after_impact.map(|controller| self.drive("after_impact", controller)).transpose()?;
        self.check_unused()?;
        Ok((drive, after))
    }

    /// The drive of a controller; `asks` is the key that chose it.
    fn drive(&self, asks: &str, controller: Controller) -> Result<Drive, String> {
        let (run, table) = (self.control, self.table);
        let needs = |key: &str| format!("{table} {asks} = \"{}\" needs the key {key}", controller.name());
        let tip = |link: Option<&'_ str>| {
            let why =
                || format!("{table} {asks} = \"{}\" is for one robot: give it in its [[robot]]", controller.name());
            link.map(str::to_owned).ok_or_else(why)
        };
        let number = |key: &str, given: Option<f64>| given.ok_or_else(|| needs(key));
        let gains = |key: &str, given: &Option<PerJoint>| match given {
            None => Err(needs(key)),
            Some(PerJoint::Same(gain)) => Ok(Gains::Same(*gain)),
            Some(given) => per_joint(key, given, self.chain).map(Gains::Each).map_err(|why| format!("{table} {why}")),
        };
        let wanted = || {
            let given = run.target.as_ref().ok_or_else(|| needs("target: {} keeps the positions at the start"))?;
            positions("target", given, self.chain, self.q).map_err(|why| format!("{table} {why}"))
        };
        Ok(match controller {
            Controller::Off => Drive::Off,
            Controller::GravityCompensation => Drive::GravityCompensation,
            Controller::Constant => Drive::Constant(run.torque.clone().ok_or_else(|| needs("torque"))?),
            Controller::TorqueFile => {
                let file = run.torque_file.as_ref().ok_or_else(|| needs("torque_file"))?;
                torque_table(&self.folder.join(file), self.chain).map_err(|why| format!("{table} torque_file {why}"))?
            }
            Controller::Pd => Drive::Pd(Pd { kp: gains("kp", &run.kp)?, kd: gains("kd", &run.kd)?, target: wanted()? }),
            Controller::Tracking => {
                let file = run.reference.as_ref().ok_or_else(|| needs("reference"))?;
                let driven = motors(self.chain).len() == self.chain.nv();
                Drive::Tracking(Tracking {
                    kp: gains("kp", &run.kp)?,
                    kd: gains("kd", &run.kd)?,
                    reference: reference(&self.folder.join(file), self.chain)
                        .map_err(|why| format!("{table} reference {why}"))?,
                    feed_forward: run.feed_forward.unwrap_or(driven),
                })
            }
            Controller::ImpactInvariant => Drive::ImpactInvariant(ImpactInvariant {
                tip: tip(self.tip)?,
                normal: self.normal("impact-invariant")?,
                kp: gains("kp", &run.kp)?,
                kd: gains("kd", &run.kd)?,
                target: wanted()?,
                velocity: vec![0.0; self.chain.nv()],
            }),
            Controller::Transition => Drive::Transition(Transition {
                tip: tip(self.tip)?,
                normal: self.normal("transition")?,
                velocity: self.world.velocity(&tip(self.tip_in_world)?).map_err(|e| format!("{table} {e}"))?,
                gain: number("gain", run.gain)?,
                press: run.press.unwrap_or(0.0),
                compensate: run.compensate.unwrap_or(true),
                restitution: self.surfaces.first().map_or(0.0, |surface| surface.contact.law.restitution()),
            }),
        })
    }

    /// Refuses keys that no chosen controller reads.
    fn check_unused(&self) -> Result<(), String> {
        let run = self.control;
        use Controller::{Constant, ImpactInvariant, Pd, TorqueFile, Tracking, Transition};
        let readers: [(&str, bool, &[Controller], &str); 10] = [
            ("target", run.target.is_some(), &[Pd, ImpactInvariant], "pd"),
            ("kp", run.kp.is_some(), &[Pd, Tracking, ImpactInvariant], "pd"),
            ("kd", run.kd.is_some(), &[Pd, Tracking, ImpactInvariant], "pd"),
            ("reference", run.reference.is_some(), &[Tracking], "tracking"),
            ("feed_forward", run.feed_forward.is_some(), &[Tracking], "tracking"),
            ("torque", run.torque.is_some(), &[Constant], "constant"),
            ("torque_file", run.torque_file.is_some(), &[TorqueFile], "torque-file"),
            ("gain", run.gain.is_some(), &[Transition], "transition"),
            ("press", run.press.is_some(), &[Transition], "transition"),
            ("compensate", run.compensate.is_some(), &[Transition], "transition"),
        ];
        for (key, given, controllers, name) in readers {
            let read = controllers.iter().any(|&c| run.controller == c || run.after_impact == Some(c));
            if given && !read {
                return Err(format!(
                    "{} {key} is not read by the chosen controller: remove it or set controller = \"{name}\"",
                    self.table
                ));
            }
        }
        Ok(())
    }

    fn normal(&self, controller: &str) -> Result<Vector3<f64>, String> {
        half_space(self.surfaces.first()).ok_or_else(|| {
            let table = self.table;
            format!("{table} controller = \"{controller}\" refers to the first surface, which must be a halfspace")
        })
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

/// Joint forces over time: by joint name, or without names in the order of qd.
fn torque_table(path: &Path, chain: &Chain) -> Result<Drive, String> {
    let read = || {
        let table = Columns::read(path)?;
        let hinges = hinges(chain);
        let names: Vec<String> = hinges.iter().map(|(name, ..)| name.clone()).collect();
        if !table.has_names() {
            let wanted: Vec<String> = (0..chain.nv()).map(|v| v.to_string()).collect();
            return table.pick(&wanted, false, "joint force");
        }
        let (times, rows) = table.pick(&names, false, "joint force")?;
        let spread = |row: Vec<f64>| {
            let mut all = vec![0.0; chain.nv()];
            hinges.iter().zip(row).for_each(|((_, _, v), force)| all[*v] = force);
            all
        };
        Ok((times, rows.into_iter().map(spread).collect()))
    };
    let done: Result<(Vec<f64>, Vec<Vec<f64>>), String> = read();
    let (times, forces) = done.and_then(ascending).map_err(|why| format!("{}: {why}", path.display()))?;
    Ok(Drive::Table(TorqueTable { times, forces }))
}

/// Refuses rows of the same time.
fn ascending<T>((times, rows): (Vec<f64>, T)) -> Result<(Vec<f64>, T), String> {
    match times.windows(2).position(|pair| pair[1] <= pair[0]) {
        Some(k) => Err(format!(
            "row {}: time {} is not above that of the previous row: times must ascend",
            k + 2,
            times[k + 1]
        )),
        None => Ok((times, rows)),
    }
}

/// Positions over time, by joint name.
fn reference(path: &Path, chain: &Chain) -> Result<Reference, String> {
    let read = || {
        let table = Columns::read(path)?;
        let names: Vec<String> = hinges(chain).into_iter().map(|(name, ..)| name).collect();
        if !table.has_names() {
            return Err(format!("the first line must name the columns: time, {}", names.join(", ")));
        }
        let (times, rows) = ascending(table.pick(&names, false, "position")?)?;
        Reference::new(times, &rows).map_err(|e| e.to_string())
    };
    read().map_err(|why| format!("{}: {why}", path.display()))
}
