//! Roll-outs of measured tosses: each toss is simulated from its first free sample and compared with the measured poses.
//!
//! `launch.rs` determines the state at the start and the time of the first impact, `roll_out.rs` simulates and compares,
//! `errors.rs` predicts the mean over the errors of the start.
//!
//! A folder of tosses contains a URDF and a table `tosses.csv` with these columns: `toss`; `t`, s; position `px, py, pz` (m) and
//! rotation `qw, qx, qy, qz` of the root link in the world frame; its linear velocity `vx, vy, vz` (m/s, world frame) and
//! angular velocity `wx, wy, wz` (rad/s, axes of the link); and `theta, dtheta` (rad, rad/s) if the robot has a joint besides
//! its floating base. Other columns are ignored. The floor is z = 0. The tosses of ContactNets (S. Pfrommer, M. Halm, M. Posa
//! 2020) and of the elbow (B. Bianchini, M. Halm, M. Posa 2023) can be converted to this format.

use carom_chain::urdf::LoadOptions;
use carom_chain::{Chain, ChainError};
use carom_contact::Obstacle;
use carom_sim::{ContactRule, Moment, SimError, Simulation, Surface, Touch};
use csv::StringRecord;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

mod errors;
mod launch;
mod report;
mod roll_out;

pub use launch::{Fitted, Launch, Start};
pub use report::{TossErrors, TossMeasure, TossReport, TossSpread};
pub use roll_out::{Horizon, PoseError, RollOut, RollOutOptions};

/// Tosses of one robot.
#[derive(Debug, Clone)]
pub struct Tosses {
    /// The robot, with a floating base.
    pub chain: Chain,
    /// The file of the robot.
    pub urdf: PathBuf,
    /// The tosses, in the order of the table.
    pub tosses: Vec<Toss>,
}

/// One measured toss.
#[derive(Debug, Clone)]
pub struct Toss {
    /// Number in the table.
    pub number: i64,
    /// The samples, ascending in time.
    pub samples: Vec<Moment>,
}

/// Reason why tosses cannot be read or simulated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TossError {
    /// Error in the folder or one of its files.
    #[error("{}: {reason}", file.display())]
    File {
        /// The file or folder.
        file: PathBuf,
        /// The rule that is broken.
        reason: String,
    },
    /// Error of the robot.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// Error of a roll-out.
    #[error("toss {number}: {reason}")]
    Simulation {
        /// Number of the toss.
        number: i64,
        /// Error of the simulation.
        reason: SimError,
    },
}

impl Tosses {
    /// Reads `folder/tosses.csv` and the URDF `folder/robot`; without `robot`, the only URDF of the folder. The base floats,
    /// whatever `options` says.
    ///
    /// # Errors
    /// [`TossError::File`] with file, line and column; [`TossError::Chain`] for an invalid URDF.
    pub fn read(folder: &Path, robot: Option<&str>, options: &LoadOptions) -> Result<Self, TossError> {
        let refuse = |file: &Path, reason: String| TossError::File { file: file.to_owned(), reason };
        let urdf = urdf_of(folder, robot)?;
        let options = LoadOptions { floating_base: true, ..options.clone() };
        let chain = Chain::from_urdf_file_with(&urdf, &options)?;
        chain.check_dynamics().map_err(|e| refuse(&urdf, e.to_string()))?;
        let table = folder.join("tosses.csv");
        let tosses = read_table(&table, &chain).map_err(|reason| refuse(&table, reason))?;
        Ok(Self { chain, urdf, tosses })
    }

    /// The robot above the floor z = 0.
    pub(crate) fn scene(&self) -> Scene {
        Scene { chain: self.chain.clone(), floor: 0.0, errors: 0.0 }
    }

    /// Gap between the lowest point of the robot and the floor at each sample of a toss, m.
    pub(crate) fn gaps(&self, toss: &Toss) -> Result<Vec<f64>, TossError> {
        let refuse = |reason| TossError::Simulation { number: toss.number, reason };
        let simulation = on_floor(&self.scene(), &ContactRule::default()).map_err(refuse)?;
        toss.samples.iter().map(|sample| simulation.smallest_gap(&sample.q).map_err(refuse)).collect()
    }
}

/// Gravity of all tosses, m/s².
#[doc(hidden)] // for carom-evidence
pub const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// A robot above a horizontal floor, and how it is measured.
#[doc(hidden)] // for carom-evidence
#[derive(Debug, Clone)]
pub struct Scene {
    /// The robot.
    pub chain: Chain,
    /// Height of the floor, m.
    pub floor: f64,
    /// Standard deviation of the errors of the measured angles, rad.
    pub errors: f64,
}

/// Simulation of a robot above the floor.
fn on_floor(Scene { chain, floor, .. }: &Scene, contact: &ContactRule) -> Result<Simulation, SimError> {
    let floor = Obstacle::half_space(Vector3::new(0.0, 0.0, *floor), Vector3::z())?;
    let surface = Surface { name: "floor".into(), obstacle: floor, contact: contact.clone(), motion: None };
    let touches = Touch::all(chain, &[surface], 0.0)?.touches;
    Ok(Simulation { gravity: GRAVITY, ..Simulation::new(chain.clone(), touches) })
}

/// The file of the robot in a folder of tosses: `robot`, or the only URDF.
#[doc(hidden)] // for carom-evidence
pub fn urdf_of(folder: &Path, robot: Option<&str>) -> Result<PathBuf, TossError> {
    let refuse = |reason: String| TossError::File { file: folder.to_owned(), reason };
    robot.map_or_else(|| only_urdf(folder).map_err(refuse), |name| Ok(folder.join(name)))
}

fn only_urdf(folder: &Path) -> Result<PathBuf, String> {
    if folder.is_file() {
        return Err("this is a file: give the folder of tosses.csv and the URDF".into());
    }
    let entries = std::fs::read_dir(folder).map_err(|e| format!("cannot be read: {e}"))?;
    let mut found: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    found.retain(|path| path.extension().is_some_and(|end| end == "urdf"));
    found.sort();
    match found.as_slice() {
        [one] => Ok(one.clone()),
        [] => Err("it contains no URDF".into()),
        several => {
            let names: Vec<_> = several.iter().filter_map(|p| Some(p.file_name()?.to_string_lossy())).collect();
            Err(format!("it contains several URDF files, {}: select one with --robot", names.join(", ")))
        }
    }
}

/// The number in a column of a record of a table.
#[doc(hidden)] // for carom-evidence
pub fn finite(record: &StringRecord, header: &StringRecord, line: usize, column: usize) -> Result<f64, String> {
    let text = record.get(column).unwrap_or("").trim();
    let number = text.parse::<f64>().ok().filter(|x| x.is_finite());
    number.ok_or_else(|| format!("line {line}, column {}: '{text}' is not a finite number", &header[column]))
}

fn read_table(path: &Path, chain: &Chain) -> Result<Vec<Toss>, String> {
    let mut reader = csv::Reader::from_path(path).map_err(|e| e.to_string())?;
    let header = reader.headers().map_err(|e| e.to_string())?.clone();
    let columns: HashMap<&str, usize> = header.iter().enumerate().map(|(k, name)| (name.trim(), k)).collect();
    let own = chain.nv() - 6;
    let joints: &[&str] = match own {
        0 => &[],
        1 => &["theta", "dtheta"],
        _ => return Err(format!("the robot has {own} joints, but the table has columns for one (theta, dtheta) only")),
    };
    const ROOT: [&str; 15] =
        ["toss", "t", "px", "py", "pz", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz"];
    let at: Vec<usize> = ROOT
        .iter()
        .chain(joints)
        .map(|&name| columns.get(name).copied().ok_or_else(|| format!("column '{name}' is missing")))
        .collect::<Result<_, _>>()?;
    let mut tosses: Vec<Toss> = Vec::new();
    for (k, record) in reader.records().enumerate() {
        let line = k + 2;
        let record = record.map_err(|e| e.to_string())?;
        let cell = |column: usize| finite(&record, &header, line, column);
        let x: Vec<f64> = at.iter().map(|&column| cell(column)).collect::<Result<_, _>>()?;
        let quaternion = Quaternion::new(x[5], x[6], x[7], x[8]);
        let norm = quaternion.norm();
        if (norm - 1.0).abs() > 1e-2 {
            return Err(format!("line {line}: the norm of the quaternion is {norm}, but must be 1 within 0.01"));
        }
        let turn = UnitQuaternion::from_quaternion(quaternion);
        let v = turn.inverse_transform_vector(&Vector3::new(x[9], x[10], x[11]));
        let mut q = vec![x[2], x[3], x[4], turn.i, turn.j, turn.k, turn.w];
        let mut qd = vec![v.x, v.y, v.z, x[12], x[13], x[14]];
        if own == 1 {
            q.push(x[15]);
            qd.push(x[16]);
        }
        let number = x[0] as i64;
        if tosses.last().is_none_or(|toss| toss.number != number) {
            tosses.push(Toss { number, samples: Vec::new() });
        }
        if let Some(toss) = tosses.last_mut() {
            if toss.samples.last().is_some_and(|sample| sample.time >= x[1]) {
                return Err(format!("line {line}: the times of toss {number} must ascend"));
            }
            toss.samples.push(Moment { time: x[1], q, qd });
        }
    }
    if let Some(toss) = tosses.iter().find(|toss| toss.samples.len() < 2) {
        return Err(format!("toss {} has only one sample: at least 2 are needed", toss.number));
    }
    if tosses.is_empty() { Err("it contains no samples".into()) } else { Ok(tosses) }
}
