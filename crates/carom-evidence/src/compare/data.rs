//! Data sets: what a folder holds, and how it is read.
//!
//! | content | recognised by | source |
//! | --- | --- | --- |
//! | tosses of a robot | `tosses.csv` and a URDF | ContactNets' cube (S. Pfrommer, M. Halm, M. Posa 2020) and the hinge of B. Bianchini, M. Halm, M. Posa (2023) |
//! | impacts of a planar ellipse | a CSV table with `pre_vx, …, d_x, …, n_x, …` | N. Fazeli's planar impacts (MCube Lab, MIT, 2017) |
//! | first impacts of a dropped square | a CSV table with `drop`, `pre_vz, …`, `post_vz, …` | drops of the MCube Lab |
//! | landings of a biped | a CSV table with `log`, `base_qw, …`, `knee_joint_leftdot, …`, beside a URDF | DAIRLab's `cassie_impact_dataset` |
//!
//! The tables of single impacts have no body parameters, so the bodies are constants of this file.

use super::candidates::Effect;
use super::impact::Impact;
use super::landings::{self, Landings};
use super::planar::{GRAVITY, PlanarImpact, SIDE, Sequel, lowest_corner};
use crate::{EvidenceError, halved};
use carom_chain::urdf::{self, LoadOptions, Robot};
use carom_study::fit::{FitError, MeasuredImpact};
use carom_study::tosses::{TossError, Tosses, finite, urdf_of};
use nalgebra::Vector3;
use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

/// Measurements that laws can be compared on.
#[derive(Debug, Clone)]
pub struct DataSet {
    /// Name of the folder, and of the table if the folder has several.
    pub name: String,
    pub(super) data: Data,
}

#[derive(Debug, Clone)]
pub(super) enum Data {
    Impacts(Impacts),
    /// Tosses, and the robot of their URDF.
    Tosses(Tosses, Box<Robot>),
    Landings(Landings),
}

/// Single impacts.
#[derive(Debug, Clone)]
pub(super) struct Impacts {
    pub what: &'static str,
    /// The error, with its metric.
    pub measure: &'static str,
    /// Number of each impact in its table.
    pub numbers: Vec<i64>,
    pub impacts: Vec<Impact>,
    /// The effects that are tried, each in addition to those before it.
    pub effects: &'static [Effect],
    pub left_out: usize,
}

/// The error of a velocity v after an impact, in the metric of the kinetic energy.
const IN_ENERGY: &str = "|v − v⁺|/|v⁻| in the metric of the kinetic energy";

impl DataSet {
    /// Whether it holds whole tosses.
    pub fn is_of_tosses(&self) -> bool {
        matches!(self.data, Data::Tosses(..))
    }

    /// Whether it holds landings.
    pub fn is_of_landings(&self) -> bool {
        matches!(self.data, Data::Landings(_))
    }

    /// Single impacts that were measured at a robot, or by contact velocities: a number for each, such as that of its line.
    /// Laws are compared with constant coefficients and with a restitution that depends on the approach speed.
    pub fn of_impacts(name: String, numbers: Vec<i64>, impacts: Vec<MeasuredImpact>) -> Self {
        let whole = impacts.iter().all(MeasuredImpact::has_robot);
        let measure = if whole { IN_ENERGY } else { "|u − u⁺|/|u⁻| of the contact velocity" };
        let impacts = impacts.into_iter().map(|impact| Impact::Measured(Box::new(impact))).collect();
        let (what, effects) = ("measured impacts", &[Effect::Speed]);
        Self { name, data: Data::Impacts(Impacts { what, measure, numbers, impacts, effects, left_out: 0 }) }
    }
}

/// The error of a data set with too few measurements.
pub(super) fn too_few(set: &str, found: usize, needed: usize, folds: usize) -> EvidenceError {
    let rule = format!("but {needed} are needed for {folds} folds");
    EvidenceError::new(format!("{set}: it has {found} measurements that can be compared, {rule}"))
}

/// The data sets of a folder and of its subfolders, or of one table, in the order of their names.
///
/// # Errors
/// [`EvidenceError`]: nothing is recognised, or a table is invalid.
pub fn data_sets(path: &Path, options: &LoadOptions) -> Result<Vec<DataSet>, EvidenceError> {
    let refuse = |reason: String| EvidenceError::of_file(path, reason);
    let mut found = if path.is_file() { table(path, options)?.into_iter().collect() } else { folder(path, options)? };
    if found.is_empty() && path.is_dir() {
        for inner in entries(path)?.iter().filter(|entry| entry.is_dir()) {
            found.extend(folder(inner, options)?);
        }
    }
    if found.is_empty() {
        let rule = "it holds no data set: a folder needs tosses.csv with a URDF, a CSV table with the columns pre_vx … of \
                    single impacts, or one with the columns log, base_qw, knee_joint_leftdot … of landings";
        return Err(refuse(rule.into()));
    }
    Ok(found)
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, EvidenceError> {
    let refuse = |reason: std::io::Error| EvidenceError::of_file(folder, format!("it cannot be read: {reason}"));
    let read = std::fs::read_dir(folder).map_err(refuse)?;
    let mut all: Vec<PathBuf> = read.filter_map(|entry| Some(entry.ok()?.path())).collect();
    all.sort();
    Ok(all)
}

fn named(path: &Path) -> String {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    whole.file_stem().map_or_else(|| "data".into(), |name| name.to_string_lossy().into_owned())
}

/// The data sets of one folder.
fn folder(path: &Path, options: &LoadOptions) -> Result<Vec<DataSet>, EvidenceError> {
    let name = named(path);
    let entries = entries(path)?;
    if entries.iter().any(|entry| entry.ends_with("tosses.csv")) {
        let robot = nominal(&with_end(&entries, "urdf").collect::<Vec<_>>());
        let tosses = Tosses::read(path, robot.as_deref(), options)?;
        let robot = urdf::read_file(urdf_of(path, robot.as_deref())?, options).map_err(TossError::from)?;
        return Ok(vec![DataSet { name, data: Data::Tosses(tosses, Box::new(robot)) }]);
    }
    let mut tables = Vec::new();
    for file in with_end(&entries, "csv") {
        tables.extend(table(file, options)?);
    }
    let alone = tables.len() == 1;
    for set in &mut tables {
        set.name = if alone { name.clone() } else { format!("{name}-{}", set.name) };
    }
    Ok(tables)
}

/// Of several URDF files the one whose name is the beginning of the names of all others: `elbow.urdf` beside
/// `elbow_bad_init.urdf`.
fn nominal(urdfs: &[&PathBuf]) -> Option<String> {
    let stem = |path: &Path| path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let stems: Vec<String> = urdfs.iter().filter_map(|path| stem(path)).collect();
    let first = stems.iter().find(|one| stems.iter().all(|other| other.starts_with(one.as_str())))?;
    Some(format!("{first}.urdf"))
}

/// The data set of a table of single impacts, or of landings; `None` for a table of another kind.
fn table(path: &Path, options: &LoadOptions) -> Result<Option<DataSet>, EvidenceError> {
    let refuse = |reason: String| EvidenceError::of_file(path, reason);
    let mut reader = csv::Reader::from_path(path).map_err(|e| refuse(e.to_string()))?;
    let header = reader.headers().map_err(|e| refuse(e.to_string()))?.clone();
    let column = |name: &str| header.iter().position(|it| it.trim() == name);
    let Some(kind) = KINDS.iter().find(|kind| kind.columns.iter().all(|name| column(name).is_some())) else {
        let is_log = landings::is_log(&header.iter().map(str::trim).collect::<Vec<_>>());
        return is_log.then(|| landed(path, options)).transpose();
    };
    let at: HashMap<&str, usize> = kind.columns.iter().filter_map(|&name| Some((name, column(name)?))).collect();
    let (mut numbers, mut impacts, mut left_out) = (Vec::new(), Vec::new(), 0);
    for (k, record) in reader.records().enumerate() {
        let line = k + 2;
        let record = record.map_err(|e| refuse(e.to_string()))?;
        let mut row = HashMap::new();
        for (&name, &place) in &at {
            row.insert(name, finite(&record, &header, line, place).map_err(refuse)?);
        }
        match (kind.impact)(&row) {
            // the problem of the impact must be one that laws resolve
            Some(impact) => match impact.measured(1.0) {
                Ok(_) => {
                    numbers.push(row[kind.columns[0]] as i64);
                    impacts.push(Impact::Planar(impact));
                }
                Err(FitError::NoApproach { .. }) => left_out += 1,
                Err(error) => return Err(refuse(format!("line {line}: {error}"))),
            },
            None => left_out += 1,
        }
    }
    let Kind { what, effects, .. } = *kind;
    let data = Data::Impacts(Impacts { what, measure: IN_ENERGY, numbers, impacts, effects, left_out });
    Ok(Some(DataSet { name: named(path), data }))
}

/// The landings of a table, with the robot of the URDF beside it.
fn landed(path: &Path, options: &LoadOptions) -> Result<DataSet, EvidenceError> {
    let beside = path.parent().unwrap_or(Path::new("."));
    let urdfs: Vec<PathBuf> = with_end(&entries(beside)?, "urdf").cloned().collect();
    let urdf = urdf_of(beside, nominal(&urdfs.iter().collect::<Vec<_>>()).as_deref())?;
    let robot = urdf::read_file(&urdf, options).map_err(TossError::from)?;
    Ok(DataSet { name: named(path), data: Data::Landings(Landings::read(path, &urdf, &robot)?) })
}

fn with_end<'a>(entries: &'a [PathBuf], end: &'a str) -> impl Iterator<Item = &'a PathBuf> {
    entries.iter().filter(move |path| path.extension().is_some_and(|e| e == end))
}

/// A kind of table of single impacts.
struct Kind {
    /// Its columns; the first one has the numbers of the impacts.
    columns: &'static [&'static str],
    what: &'static str,
    /// The effects that are tried, each in addition to those before it.
    effects: &'static [Effect],
    /// The impact of a row; `None` if it is not compared.
    impact: fn(&HashMap<&str, f64>) -> Option<PlanarImpact>,
}

static KINDS: [Kind; 2] = [
    Kind {
        columns: &[
            "i", "pre_vx", "pre_vy", "pre_w", "post_vx", "post_vy", "post_w", "d_x", "d_y", "d_th", "n_x", "n_y",
            "n_th",
        ],
        what: "impacts of a planar ellipse",
        effects: &[Effect::Arm, Effect::Speed],
        impact: |row| {
            let rows = [of(row, ["d_x", "d_y", "d_th"]), of(row, ["n_x", "n_y", "n_th"])];
            let before = of(row, ["pre_vx", "pre_vy", "pre_w"]);
            let after = of(row, ["post_vx", "post_vy", "post_w"]);
            let impact = PlanarImpact { body: ELLIPSE_BODY, rows, before, after, sequel: None };
            passive(ELLIPSE_BODY, before, after).then_some(impact)
        },
    },
    Kind {
        columns: &[
            "drop", "n_post", "pre_x", "pre_z", "pre_th", "pre_vx", "pre_vz", "pre_w", "post_vx", "post_vz", "post_w",
        ],
        what: "first impacts of a dropped square, tilted by more than 20°",
        effects: &[Effect::Strikes, Effect::Speed],
        impact: |row| {
            let before = of(row, ["pre_vx", "pre_vz", "pre_w"]);
            let after = of(row, ["post_vx", "post_vz", "post_w"]);
            struck_square(of(row, ["pre_x", "pre_z", "pre_th"]), before, after, row["n_post"])
        },
    },
];

/// Three columns of a row.
fn of(row: &HashMap<&str, f64>, names: [&str; 3]) -> Vector3<f64> {
    Vector3::from(names.map(|name| row[name]))
}

/// Mass (kg) and moment of inertia (kg m²) of the ellipse.
const ELLIPSE_BODY: (f64, f64) = (0.0364, 1.3468e-5);
/// Of the square. Its moment of inertia is m a²/6; its mass does not matter.
const SQUARE_BODY: (f64, f64) = (1.0, SIDE * SIDE / 6.0);
/// Height of the floor of the drops, m: the median height of the centre at rest less half the side.
const FLOOR: f64 = 0.0014;
/// Least tilt from a face, rad: below 20° a second corner strikes within the same samples.
const LEAST_TILT: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// Spacing of the samples of the drops, s.
const SAMPLE: f64 = 1.0 / 250.0;
/// Time of the first sample of the flight after the impact, in spacings after the time of the states: the sample before it,
/// which is next to the impact, is left out.
const FIRST: f64 = 1.5;
/// Most samples that a flight after an impact can have.
const SAMPLES: f64 = 1000.0;

/// Whether the kinetic energy of a body does not increase: a measurement in which it does is mistracked, because no passive
/// contact can do that.
fn passive((mass, inertia): (f64, f64), before: Vector3<f64>, after: Vector3<f64>) -> bool {
    let energy = |v: Vector3<f64>| mass * v.xy().norm_squared() + inertia * v.z * v.z;
    energy(after) <= energy(before)
}

/// The first impact of the square at the instant at which its lowest corner touches the floor. The states of the table are at
/// one time near it: the flight before the impact is followed to the instant, back or forth, and both vertical velocities
/// change by gravity in between. The state after the impact is from `count` samples. `None` for a small tilt, and for a
/// mistracked impact.
fn struck_square(pose: Vector3<f64>, before: Vector3<f64>, after: Vector3<f64>, count: f64) -> Option<PlanarImpact> {
    let at = |t: f64| {
        let (z, angle) = (pose.y + before.y * t - 0.5 * GRAVITY * t * t, pose.z + before.z * t);
        let corner = lowest_corner(angle);
        (z + corner.y - FLOOR, angle, corner)
    };
    // the corner falls at 1 to 3 m/s: the touching instant is within 20 ms, else at the time of the table
    let (early, late) = (-0.02, 0.02);
    let touches = at(early).0 > 0.0 && at(late).0 < 0.0;
    let [_, below] = halved([early, late], 60, |t| at(t).0 > 0.0);
    let time = if touches { below } else { 0.0 };
    let (_, angle, corner) = at(time);
    let turned = angle.rem_euclid(FRAC_PI_2);
    if turned.min(FRAC_PI_2 - turned) <= LEAST_TILT {
        return None;
    }
    let fallen = Vector3::new(0.0, -GRAVITY * time, 0.0);
    let (before, after) = (before + fallen, after + fallen);
    let rows = [Vector3::new(1.0, 0.0, -corner.y), Vector3::new(0.0, 1.0, corner.x)];
    let samples = (0..count.clamp(2.0, SAMPLES) as usize).map(|k| (FIRST + k as f64) * SAMPLE - time).collect();
    let sequel = Some(Sequel { angle, samples });
    passive(SQUARE_BODY, before, after).then_some(PlanarImpact { body: SQUARE_BODY, rows, before, after, sequel })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square that falls on a corner: the table may give its states at any time near the impact.
    #[test]
    fn the_touching_instant_does_not_depend_on_the_time_of_the_states() {
        let (velocity, after) = (Vector3::new(0.3, -2.0, 1.5), Vector3::new(0.1, 0.8, -9.0));
        let corner = lowest_corner(0.6);
        let touching = Vector3::new(0.1, FLOOR - corner.y, 0.6);
        let rows = [Vector3::new(1.0, 0.0, -corner.y), Vector3::new(0.0, 1.0, corner.x)];
        let truth = carom_study::fit::MeasuredImpact::of_planar_body(SQUARE_BODY, rows, velocity, after).unwrap();
        for t in [-0.006, 0.0, 0.004] {
            let pose = touching + velocity * t - Vector3::new(0.0, 0.5 * GRAVITY * t * t, 0.0);
            let fallen = Vector3::new(0.0, -GRAVITY * t, 0.0);
            let found = struck_square(pose, velocity + fallen, after + fallen, 5.0).unwrap().measured(1.0).unwrap();
            for friction in [0.0, 0.3, f64::INFINITY] {
                let (a, b) = (found.least_residual(friction), truth.least_residual(friction));
                assert!((a - b).abs() < 1e-9, "{t} {friction}: {a} {b}");
            }
            assert!((found.speed() - truth.speed()).abs() < 1e-9);
        }
        let flat = Vector3::new(0.0, 0.03, 0.1);
        assert!(struck_square(flat, velocity, after, 5.0).is_none(), "a tilt of 6° is left out");
        assert!(struck_square(touching, velocity, 10.0 * after, 5.0).is_none(), "an impact cannot add energy");
    }

    #[test]
    fn the_nominal_robot_is_the_beginning_of_all_names() {
        let paths = ["elbow_bad_init.urdf", "elbow.urdf"].map(PathBuf::from);
        assert_eq!(nominal(&paths.iter().collect::<Vec<_>>()).as_deref(), Some("elbow.urdf"));
        let other = ["arm.urdf", "box.urdf"].map(PathBuf::from);
        assert_eq!(nominal(&other.iter().collect::<Vec<_>>()), None);
    }
}
