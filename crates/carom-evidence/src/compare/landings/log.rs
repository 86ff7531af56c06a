//! Reads logs of a biped's landings.
//!
//! | columns | content |
//! | --- | --- |
//! | `log` | name of the log; its samples follow one another |
//! | `t` | time, s: ascending, at intervals of 0.5 ms in the mean |
//! | `base_qw` … `base_qz`, `base_x` … `base_z` | pose of the root link |
//! | `base_wx` … `base_wz`, `base_vx` … `base_vz` | its angular and linear velocity, world axes, rad/s and m/s |
//! | `JOINT_SIDE`, `JOINT_SIDEdot` | angle and velocity of each of [`JOINTS`] on both [`SIDES`], rad and rad/s |
//! | `MOTOR_SIDE_motor` | torque of each of [`MOTORS`], N m |

use carom_chain::urdf::{Joint, JointType, Robot};
use carom_study::tosses::finite;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::path::Path;

/// Names of the sides, which end the names of links and joints.
pub(super) const SIDES: [&str; 2] = ["left", "right"];
/// Names of the joints of a leg: those whose velocities are measured, and the spring of the heel, which has no encoder.
pub(super) const JOINTS: [&str; 8] =
    ["hip_roll", "hip_yaw", "hip_pitch", "knee", "knee_joint", "ankle_joint", "toe", "ankle_spring_joint"];
/// Number of joints of a leg whose velocities are measured.
pub(super) const MEASURED: usize = 7;
/// Places in [`JOINTS`] of the springs of knee and heel.
pub(super) const SPRINGS: [usize; 2] = [4, 7];
/// Places in [`JOINTS`] of the joints with motors.
pub(super) const MOTORS: [usize; 5] = [0, 1, 2, 3, 6];
/// Time between samples, s.
pub(super) const SAMPLE: f64 = 5e-4;

/// The samples of a log.
#[derive(Debug, Clone)]
pub(super) struct Log {
    pub name: String,
    pub samples: Vec<Sample>,
}

/// A sample.
#[derive(Debug, Clone)]
pub(super) struct Sample {
    /// Its line in the table.
    pub line: usize,
    pub time: f64,
    pub position: Vector3<f64>,
    pub turn: UnitQuaternion<f64>,
    /// Linear and angular velocity of the root link, world axes.
    pub velocity: Vector3<f64>,
    pub spin: Vector3<f64>,
    pub legs: [Leg; 2],
}

/// One leg at a sample.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Leg {
    pub angles: [f64; JOINTS.len()],
    pub rates: [f64; JOINTS.len()],
    pub torques: [f64; MOTORS.len()],
}

/// Name of a joint or link of a side.
pub(super) fn of_side(name: &str, side: usize) -> String {
    format!("{name}_{}", SIDES[side])
}

/// Whether a table with these columns holds landings.
pub(in crate::compare) fn is_log(columns: &[&str]) -> bool {
    ["log", "base_qw", "knee_joint_leftdot"].iter().all(|name| columns.contains(name))
}

/// Checks that the joints of a robot are those of the table.
pub(super) fn check_joints(robot: &Robot) -> Result<(), String> {
    let known: Vec<String> = (0..2).flat_map(|side| JOINTS.map(|joint| of_side(joint, side))).collect();
    let moving = || robot.joints.iter().filter(|it| it.kind != JointType::Fixed);
    let hinge = |it: &Joint| matches!(it.kind, JointType::Revolute | JointType::Continuous) && it.mimic.is_none();
    if let Some(missing) = known.iter().find(|name| !moving().any(|it| hinge(it) && it.name == **name)) {
        return Err(format!(
            "it has no hinge '{missing}', which tables of landings measure: add it, or give the joint this name"
        ));
    }
    match moving().find(|it| !known.contains(&it.name)) {
        Some(Joint { name: other, .. }) => Err(format!(
            "its joint '{other}' is not one of those that tables of landings measure: make it fixed, or remove it"
        )),
        None => Ok(()),
    }
}

/// The logs of a table.
pub(super) fn read(path: &Path) -> Result<Vec<Log>, String> {
    let mut reader = csv::Reader::from_path(path).map_err(|e| e.to_string())?;
    let header = reader.headers().map_err(|e| e.to_string())?.clone();
    let column = |name: &str| {
        let at = header.iter().position(|it| it.trim() == name);
        at.ok_or_else(|| format!("column '{name}' is missing: tables of landings need it, add it"))
    };
    let all = |names: &[String]| names.iter().map(|name| column(name)).collect::<Result<Vec<_>, _>>();
    let named = |names: &[&str]| all(&names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
    let (log, time) = (column("log")?, column("t")?);
    let pose = named(&["base_qw", "base_qx", "base_qy", "base_qz", "base_x", "base_y", "base_z"])?;
    let rates = named(&["base_wx", "base_wy", "base_wz", "base_vx", "base_vy", "base_vz"])?;
    let of_leg = |side: usize| -> Result<[Vec<usize>; 3], String> {
        let joints = JOINTS.map(|joint| of_side(joint, side));
        let motors = MOTORS.map(|k| format!("{}_motor", joints[k]));
        Ok([all(&joints)?, all(&joints.each_ref().map(|joint| format!("{joint}dot")))?, all(&motors)?])
    };
    let legs = [of_leg(0)?, of_leg(1)?];
    let mut logs: Vec<Log> = Vec::new();
    for (k, record) in reader.records().enumerate() {
        let line = k + 2;
        let record = record.map_err(|e| e.to_string())?;
        let cell = |column: usize| finite(&record, &header, line, column).map_err(|why| why + ": correct it");
        let cells = |columns: &[usize]| columns.iter().map(|&column| cell(column)).collect::<Result<Vec<_>, _>>();
        let (pose, rates) = (cells(&pose)?, cells(&rates)?);
        let quaternion = Quaternion::new(pose[0], pose[1], pose[2], pose[3]);
        let norm = quaternion.norm();
        if (norm - 1.0).abs() > 1e-2 {
            return Err(format!(
                "line {line}, columns base_qw … base_qz: the norm of the quaternion is {norm}, but must be 1 within 0.01: \
                 correct it"
            ));
        }
        let mut both = [Leg::default(); 2];
        for (leg, [angles, rates, torques]) in both.iter_mut().zip(&legs) {
            leg.angles.copy_from_slice(&cells(angles)?);
            leg.rates.copy_from_slice(&cells(rates)?);
            leg.torques.copy_from_slice(&cells(torques)?);
        }
        let sample = Sample {
            line,
            time: cell(time)?,
            position: Vector3::from_column_slice(&pose[4..]),
            turn: UnitQuaternion::from_quaternion(quaternion),
            velocity: Vector3::from_column_slice(&rates[3..]),
            spin: Vector3::from_column_slice(&rates[..3]),
            legs: both,
        };
        let name = record.get(log).unwrap_or("").trim();
        if logs.last().is_none_or(|last| last.name != name) {
            if logs.iter().any(|other| other.name == name) {
                return Err(format!(
                    "line {line}, column log: log '{name}' has begun before another log: sort the samples by log and time"
                ));
            }
            logs.push(Log { name: name.to_owned(), samples: Vec::new() });
        }
        if let Some(log) = logs.last_mut() {
            log.samples.push(sample);
        }
    }
    if logs.is_empty() {
        return Err("it has no samples below its header: add them, or remove the table".into());
    }
    logs.iter().try_for_each(Log::check_times)?;
    Ok(logs)
}

impl Log {
    /// Whether the times ascend, at intervals of 0.5 ms in the mean: the clock of a recording jitters.
    fn check_times(&self) -> Result<(), String> {
        let Self { name, samples } = self;
        if let Some(pair) = samples.windows(2).find(|pair| pair[1].time <= pair[0].time) {
            return Err(format!("line {}, column t: the times of log '{name}' must ascend: sort them", pair[1].line));
        }
        let (first, last) = (&samples[0], &samples[samples.len() - 1]);
        let every = (last.time - first.time) / (samples.len() - 1).max(1) as f64;
        if samples.len() > 1 && (every / SAMPLE - 1.0).abs() > 0.1 {
            return Err(format!(
                "line {}, column t: the samples of log '{name}' are {:.3} ms apart in the mean, but must be 0.5 ms: sample them \
                 again at 2 kHz",
                last.line,
                1e3 * every
            ));
        }
        Ok(())
    }

    /// The mean of a quantity over the samples from `first` to `last`.
    pub fn mean<const N: usize>(&self, first: usize, last: usize, of: impl Fn(&Sample) -> [f64; N]) -> [f64; N] {
        let samples = &self.samples[first..=last];
        let mut mean = [0.0; N];
        for sample in samples {
            mean.iter_mut().zip(of(sample)).for_each(|(mean, x)| *mean += x / samples.len() as f64);
        }
        mean
    }

    /// The sample at which a side lands: the first at which the mean velocity of the knee's spring over three samples falls by
    /// [`FALL`] within [`WITHIN`] samples.
    pub fn landing(&self, side: usize) -> Option<usize> {
        let spring = |k: usize| self.mean(k - 1, k + 1, |it| [it.legs[side].rates[SPRINGS[0]]])[0];
        let last = self.samples.len().saturating_sub(WITHIN + 1);
        (1..last).find(|&k| spring(k + WITHIN) - spring(k) <= -FALL)
    }
}

/// Fall of the velocity of the knee's spring at a landing, rad/s, and the number of samples within which it falls.
const FALL: f64 = 2.0;
const WITHIN: usize = 5;
