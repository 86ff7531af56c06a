//! Roll-outs of measured tosses: each toss is simulated from its first free sample to its last one and compared with the
//! measured poses.
//!
//! A folder of tosses contains a URDF and a table `tosses.csv` with these columns: `toss`; `t`, s; position `px, py, pz` (m) and
//! rotation `qw, qx, qy, qz` of the root link in the world frame; its linear velocity `vx, vy, vz` (m/s, world frame) and
//! angular velocity `wx, wy, wz` (rad/s, axes of the link); and `theta, dtheta` (rad, rad/s) if the robot has a joint besides
//! its floating base. Other columns are ignored. The floor is z = 0. The tosses of ContactNets (S. Pfrommer, M. Halm, M. Posa
//! 2020) and of the elbow (B. Bianchini, M. Halm, M. Posa 2023) can be converted to this format.

use carom_chain::urdf::LoadOptions;
use carom_chain::{Chain, ChainError};
use carom_contact::Obstacle;
use carom_sim::{ContactRule, Moment, Sampling, Seen, SimError, Simulation, Surface, Touch};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Tosses of one robot.
#[derive(Debug, Clone)]
pub struct Tosses {
    /// The robot, with a floating base.
    pub chain: Chain,
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

/// Comparison of a roll-out with the measured toss.
#[derive(Debug, Clone)]
pub struct RollOut {
    /// Number of the toss.
    pub number: i64,
    /// Number of samples from the first free one to the last.
    pub samples: usize,
    /// Error at the last sample.
    pub last: PoseError,
    /// Mean error over the samples.
    pub mean: PoseError,
    /// Mean of the squared errors over the samples: m², rad², rad².
    pub mean_square: PoseError,
    /// Speed of the root link at the end of the roll-out, m/s.
    pub final_speed: f64,
    /// Greatest penetration of the floor at a sample of the roll-out, m; 0 if there is none.
    pub deepest: f64,
    /// Number of events of the roll-out.
    pub events: usize,
}

/// Difference between two poses.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PoseError {
    /// Distance between the origins of the root link, m.
    pub position: f64,
    /// Angle between the rotations of the root link, rad.
    pub rotation: f64,
    /// Largest difference of a joint angle, rad, wrapped to ±π; 0 without joints.
    pub joint: f64,
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
        let urdf = match robot {
            Some(name) => folder.join(name),
            None => only_urdf(folder).map_err(|reason| refuse(folder, reason))?,
        };
        let options = LoadOptions { floating_base: true, ..options.clone() };
        let chain = Chain::from_urdf_file_with(&urdf, &options)?;
        chain.check_dynamics().map_err(|e| refuse(&urdf, e.to_string()))?;
        let table = folder.join("tosses.csv");
        let tosses = read_table(&table, &chain).map_err(|reason| refuse(&table, reason))?;
        Ok(Self { chain, tosses })
    }

    /// Simulates all tosses in parallel, with contact rule `contact`, relative tolerance `tolerance`, and time step `step` (s)
    /// while several contacts are closed. Results are in the order of the tosses.
    pub fn roll_out(&self, contact: &ContactRule, tolerance: f64, step: f64) -> Vec<Result<RollOut, TossError>> {
        self.tosses.par_iter().map(|toss| toss.roll_out(&self.chain, contact, tolerance, step)).collect()
    }

    /// Gap between the lowest point of the robot and the floor at each sample of a toss, m.
    pub(crate) fn gaps(&self, toss: &Toss) -> Result<Vec<f64>, TossError> {
        let refuse = |reason| TossError::Simulation { number: toss.number, reason };
        let simulation = on_floor(&self.chain, &ContactRule::default()).map_err(refuse)?;
        toss.samples.iter().map(|sample| simulation.smallest_gap(&sample.q).map_err(refuse)).collect()
    }
}

/// Simulation of a chain above the floor z = 0.
fn on_floor(chain: &Chain, contact: &ContactRule) -> Result<Simulation, SimError> {
    let floor = Obstacle::half_space(Vector3::zeros(), Vector3::z())?;
    let surface = Surface { name: "floor".into(), obstacle: floor, contact: contact.clone(), motion: None };
    let touches = Touch::all(chain, &[surface], 0.0)?.touches;
    Ok(Simulation { gravity: Vector3::new(0.0, 0.0, -9.81), ..Simulation::new(chain.clone(), touches) })
}

impl Toss {
    /// Simulates this toss from its first free sample to its last.
    pub(crate) fn roll_out(
        &self,
        chain: &Chain,
        contact: &ContactRule,
        tolerance: f64,
        step: f64,
    ) -> Result<RollOut, TossError> {
        let number = self.number;
        let refuse = |reason: SimError| TossError::Simulation { number, reason };
        let simulation = Simulation { tolerance, contact_step: step, ..on_floor(chain, contact).map_err(refuse)? };
        let lowest = |sample: &Moment| simulation.smallest_gap(&sample.q);
        let mut first = 0;
        while first < self.samples.len() && lowest(&self.samples[first]).map_err(refuse)? <= 0.0 {
            first += 1;
        }
        let Some(start) = self.samples.get(first) else {
            let (what, rule) =
                ("number of free samples", "a toss needs at least one sample without contact with the floor");
            return Err(refuse(SimError::Setting { what, value: 0.0, rule }));
        };
        let measured = &self.samples[first..];
        // sampled at the spacing of the measured samples
        let end = measured[measured.len() - 1].time - start.time;
        let every = end / (measured.len() - 1).max(1) as f64;
        let mut rolled: Vec<Moment> = Vec::new();
        let sampling = Sampling { every: Some(every), dense: false };
        let summary = simulation.stream(&start.q, &start.qd, end, sampling, &mut |seen| {
            if let Seen::Moment(moment) = seen {
                rolled.push(moment.clone());
            }
        });
        let summary = summary.map_err(refuse)?;
        if rolled.len() < measured.len() {
            rolled.push(summary.last.clone()); // by rounding, the last sample may lie beyond the end
        }
        let errors: Vec<PoseError> = rolled.iter().zip(measured).map(|(a, b)| PoseError::between(a, b)).collect();
        let mut deepest = 0.0_f64;
        for moment in &rolled {
            deepest = deepest.max(-lowest(moment).map_err(refuse)?);
        }
        let count = errors.len() as f64;
        let mean = |part: &dyn Fn(&PoseError) -> f64| errors.iter().map(part).sum::<f64>() / count;
        Ok(RollOut {
            number,
            samples: errors.len(),
            last: PoseError::between(&summary.last, &measured[measured.len() - 1]),
            mean: PoseError {
                position: mean(&|e| e.position),
                rotation: mean(&|e| e.rotation),
                joint: mean(&|e| e.joint),
            },
            mean_square: PoseError {
                position: mean(&|e| e.position.powi(2)),
                rotation: mean(&|e| e.rotation.powi(2)),
                joint: mean(&|e| e.joint.powi(2)),
            },
            final_speed: Vector3::from_column_slice(&summary.last.qd[..3]).norm(),
            deepest,
            events: summary.events,
        })
    }
}

impl RollOut {
    /// Error measure of B. Acosta, W. Yang, M. Posa (IEEE RA-L 7, 2022) over the samples of the roll-out: mean of |Δp|²
    /// divided by `length` (m), plus mean of Δθ² (rad²), plus the mean of the squared joint error, if there is a joint. For
    /// their cube they use half its width, 0.0524 m. As in the paper, the terms have different units: |Δp|²/`length` is a
    /// length.
    pub fn pose_error(&self, length: f64) -> f64 {
        let PoseError { position, rotation, joint } = self.mean_square;
        position / length + rotation + joint
    }
}

impl PoseError {
    fn between(a: &Moment, b: &Moment) -> Self {
        let place = |m: &Moment| Vector3::from_column_slice(&m.q[..3]);
        let turn = |m: &Moment| UnitQuaternion::from_quaternion(Quaternion::new(m.q[6], m.q[3], m.q[4], m.q[5]));
        let wrapped = |x: f64| (x + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        let joints = a.q[7..].iter().zip(&b.q[7..]);
        Self {
            position: (place(a) - place(b)).norm(),
            rotation: turn(a).angle_to(&turn(b)),
            joint: joints.map(|(a, b)| wrapped(a - b).abs()).fold(0.0, f64::max),
        }
    }
}

fn only_urdf(folder: &Path) -> Result<PathBuf, String> {
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
        let cell = |column: usize| {
            let text = record.get(column).unwrap_or("").trim();
            let number = text.parse::<f64>().ok().filter(|x| x.is_finite());
            number.ok_or_else(|| format!("line {line}, column {}: '{text}' is not a finite number", &header[column]))
        };
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
