//! Reads a problem file: the scene, the unknowns, the conditions and the cost. The book documents the keys: `book/src/task-aims.md`.

use super::function::Function;
use super::{AimError, Found};
use carom_chain::{Coordinates, input};
use carom_sim::{Drive, Plan, Scene, SimError, TorqueTable, Touch};
use exmex::prelude::*;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    scene: PathBuf,
    #[serde(default)]
    with: toml::Table,
    #[serde(default)]
    unknown: Vec<UnknownKeys>,
    torque: Option<TorqueKeys>,
    #[serde(default)]
    condition: Vec<ConditionKeys>,
    #[serde(default)]
    cost: Vec<CostKeys>,
    #[serde(default)]
    search: SearchKeys,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UnknownKeys {
    number: Option<String>,
    name: Option<String>,
    #[serde(default)]
    set: BTreeMap<String, String>,
    first: Option<f64>,
    from: Option<f64>,
    to: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TorqueKeys {
    joints: Vec<String>,
    knots: Option<usize>,
    pieces: Option<usize>,
    first: Option<Each>,
    from: Option<Each>,
    to: Option<Each>,
}

/// One number for all joints, or one for each.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a number, or a list of numbers, one for each of joints")]
enum Each {
    Same(f64),
    List(Vec<f64>),
}

impl Each {
    fn of(given: &Option<Self>, key: &str, joint: usize, joints: usize) -> Result<Option<f64>, String> {
        match given {
            None => Ok(None),
            Some(Self::Same(x)) => Ok(Some(*x)),
            Some(Self::List(all)) if all.len() == joints => Ok(Some(all[joint])),
            Some(Self::List(all)) => {
                Err(format!("{key} has {} numbers: give {joints}, one for each of joints", all.len()))
            }
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConditionKeys {
    value: String,
    equals: Option<f64>,
    least: Option<f64>,
    most: Option<f64>,
    contact: Option<String>,
    impact: Option<usize>,
    side: Option<Side>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CostKeys {
    value: Option<String>,
    square: Option<String>,
    effort: Option<bool>,
    weight: Option<f64>,
    contact: Option<String>,
    impact: Option<usize>,
    side: Option<Side>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct SearchKeys {
    tolerance: Option<f64>,
    steps: Option<usize>,
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Side {
    Before,
    After,
}

/// Numbers of a scene that are chosen such that its motion meets conditions, at least cost.
///
/// ```
/// use carom_study::aim::Problem;
/// let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../studies/aims/racket.toml");
/// let found = Problem::from_file(file)?.solve()?;
/// assert!(found.conditions.iter().all(|condition| condition.miss < 1e-9));
/// # Ok::<(), carom_study::aim::AimError>(())
/// ```
pub struct Problem {
    /// The files that were read.
    pub files: Vec<PathBuf>,
    /// Warnings about the scene.
    pub warnings: Vec<String>,
    pub(super) given: Given,
    pub(super) conditions: Vec<Condition>,
    pub(super) costs: Vec<Cost>,
    /// The weight of ∫ |τ|² dt.
    pub(super) effort: f64,
    pub(super) tolerance: f64,
    pub(super) steps: usize,
}

/// A scene as a function of unknowns.
#[derive(Clone)]
pub(super) struct Given {
    pub scene: Scene,
    pub unknowns: Vec<Own>,
    pub torque: Option<Torque>,
}

/// An unknown, with its place in the scene: a number of the file, or formulas of it.
#[derive(Clone)]
pub(super) struct Own {
    pub name: String,
    pub first: f64,
    pub bounds: [f64; 2],
    set: Vec<(String, Option<FlatEx<f64>>)>,
    /// Where it changes the start, and whether only in proportion.
    pub start: Option<FirstState>,
    /// Whether it changes more of the simulation than its start and its duration.
    pub acts: bool,
}

/// What an unknown changes at the start.
#[derive(Clone)]
pub(super) enum FirstState {
    /// The derivatives of displacement and velocity, which are the same everywhere.
    Linear(Vec<f64>),
    /// They must be computed at each place.
    Curved,
}

/// Torques over time.
#[derive(Clone)]
pub(super) struct Torque {
    pub joints: Vec<String>,
    /// Number of unknowns of each joint.
    pub count: usize,
    /// Whether each is constant over a piece of time; otherwise the torque is linear between them.
    pub pieces: bool,
    /// Of each joint.
    pub bounds: Vec<[f64; 2]>,
    pub first: Vec<f64>,
}

/// Where a function is evaluated.
#[derive(Clone)]
pub(super) struct Place {
    /// The k-th impact of these touches, k from 0; `None`: the end.
    pub impact: Option<(String, Vec<usize>, usize)>,
    /// 0 before, 1 after the impact.
    pub side: usize,
}

pub(super) struct Condition {
    pub name: String,
    pub function: Function,
    pub place: Place,
    pub bounds: [f64; 2],
}

pub(super) struct Cost {
    pub name: String,
    pub function: Function,
    pub place: Place,
    pub weight: f64,
    pub squared: bool,
}

impl Problem {
    /// Reads a problem file and its scene.
    ///
    /// # Errors
    /// [`AimError::File`] with key, value and rule; [`AimError::Run`] for an invalid scene.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, AimError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let text = input::read_text(path, input::MOST_MIB)
            .map_err(|e| AimError::File { file: name.clone(), rule: format!("cannot be read: {e}") })?;
        let mut problem = Self::read(&text, name, path.parent().unwrap_or(Path::new(".")))?;
        problem.files.insert(0, path.to_owned());
        Ok(problem)
    }

    /// Reads a problem from the text of a problem file. File names in it are relative to `folder`.
    ///
    /// # Errors
    /// As [`Problem::from_file`]; the file of the messages is `<problem>`.
    pub fn from_toml(text: &str, folder: impl AsRef<Path>) -> Result<Self, AimError> {
        Self::read(text, "<problem>".into(), folder.as_ref())
    }

    fn read(text: &str, name: String, folder: &Path) -> Result<Self, AimError> {
        let refuse = |rule: String| AimError::File { file: name.clone(), rule };
        let file: File = carom_sim::from_toml(text).map_err(refuse)?;
        let mut scene = Scene::from_file(folder.join(&file.scene))?;
        if !file.with.is_empty() {
            let files = std::mem::take(&mut scene.files);
            scene = Scene { files, ..scene.with_entries(&file.with)? };
        }
        if scene.simulation.stepping {
            return Err(refuse("scene: its [run] has method = \"steps\", which has no derivatives: remove it".into()));
        }
        let unknowns = file.unknown.iter().enumerate();
        let unknowns = unknowns
            .map(|(k, keys)| own(&scene, keys).map_err(|why| refuse(format!("[[unknown]] {}: {why}", keys.label(k)))));
        let unknowns = unknowns.collect::<Result<Vec<_>, _>>()?;
        if let Some(k) = (0..unknowns.len()).find(|k| unknowns[..*k].iter().any(|it| it.name == unknowns[*k].name)) {
            return Err(refuse(format!("[[unknown]] {} occurs twice: remove one", unknowns[k].name)));
        }
        let torque =
            file.torque.as_ref().map(|keys| torque(&scene, keys).map_err(|why| refuse(format!("[torque] {why}"))));
        let torque = torque.transpose()?;
        if unknowns.is_empty() && torque.is_none() {
            return Err(refuse(
                "nothing is unknown: give [[unknown]] tables with the numbers that are chosen, or [torque]".into(),
            ));
        }
        if file.condition.is_empty() && file.cost.is_empty() {
            return Err(refuse("nothing is asked: give [[condition]] or [[cost]] tables".into()));
        }
        let names: Vec<String> = unknowns.iter().map(|own| own.name.clone()).collect();
        let plan = scene.plan()?;
        let sim = &plan.simulation;
        let place = |contact: &Option<String>, impact: Option<usize>, side: Option<Side>| {
            place(&sim.touches, contact, impact, side)
        };
        let conditions = file.condition.iter().enumerate().map(|(k, keys)| {
            let read = || {
                let place = place(&keys.contact, keys.impact, keys.side)?;
                let function = Function::of(&keys.value, sim, &names, place.impact.is_some())
                    .map_err(|why| format!("value = {why}"))?;
                let (bounds, asked) = asked(keys)?;
                Ok(Condition { name: format!("{}{} {asked}", keys.value, place.text()), function, place, bounds })
            };
            read().map_err(|why: String| refuse(format!("[[condition]] {}: {why}", k + 1)))
        });
        let conditions = conditions.collect::<Result<Vec<_>, _>>()?;
        let (mut costs, mut effort) = (Vec::new(), 0.0);
        for (k, keys) in file.cost.iter().enumerate() {
            let refuse = |why: String| refuse(format!("[[cost]] {}: {why}", k + 1));
            let weight = keys.weight.unwrap_or(1.0);
            if !weight.is_finite() {
                return Err(refuse(format!("weight = {weight}: it must be finite")));
            }
            let (formula, squared) = match (&keys.value, &keys.square, keys.effort) {
                (Some(formula), None, None) => (formula, false),
                (None, Some(formula), None) => (formula, true),
                (None, None, Some(true)) if torque.is_some() => {
                    effort += weight;
                    continue;
                }
                (None, None, Some(true)) => return Err(refuse("effort is that of [torque]: give this table".into())),
                _ => {
                    return Err(refuse(
                        "needs one of value, square (a formula whose square counts), effort = true".into(),
                    ));
                }
            };
            if (squared || keys.effort.is_some()) && weight < 0.0 {
                return Err(refuse(format!("weight = {weight}: that of a square must not be negative")));
            }
            let place = place(&keys.contact, keys.impact, keys.side).map_err(refuse)?;
            let function = Function::of(formula, sim, &names, place.impact.is_some()).map_err(refuse)?;
            costs.push(Cost { name: format!("{formula}{}", place.text()), function, place, weight, squared });
        }
        let tolerance = file.search.tolerance.unwrap_or(1e-9);
        if !(tolerance > 0.0 && tolerance.is_finite()) {
            return Err(refuse(format!("[search] tolerance = {tolerance}: it must be positive and finite")));
        }
        let (files, warnings) = (scene.files.clone(), scene.warnings.clone());
        let steps = file.search.steps.unwrap_or(100);
        let given = Given { scene, unknowns, torque };
        let problem = Self { files, warnings, given, conditions, costs, effort, tolerance, steps };
        // A key that leads nowhere, or a value that the scene refuses, is told now.
        for (k, own) in problem.given.unknowns.iter().enumerate() {
            for bound in own.bounds.into_iter().filter(|bound| bound.is_finite()) {
                let mut u = problem.given.first();
                u[k] = bound;
                problem.given.plan(&u).map_err(|e| refuse(format!("[[unknown]] {} = {bound}: {e}", own.name)))?;
            }
        }
        Ok(problem)
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.given.scene
    }

    /// Whether torques over time are among the unknowns.
    pub fn has_torques(&self) -> bool {
        self.given.torque.is_some()
    }

    /// Ends the search, with [`SimError::Stopped`](carom_sim::SimError::Stopped), once another thread sets this flag.
    pub fn stop_by(&mut self, flag: Arc<AtomicBool>) {
        self.given.scene.simulation.stop = Some(flag);
    }

    /// The scene with what was found, and its simulation, which has the torques.
    ///
    /// # Errors
    /// [`AimError`] of the scene.
    pub fn plan_of(&self, found: &Found) -> Result<(Scene, Plan), AimError> {
        let u = found.values();
        let (plan, duration) = self.given.plan(&u)?;
        Ok((Scene { duration, ..self.given.scene_at(&u)? }, plan))
    }

    /// The text of a scene file with what was found, for a file in this folder, and with `[torque]` the table of the torques (CSV), to which
    /// the scene gives this name.
    ///
    /// # Errors
    /// [`AimError`] of the scene.
    pub fn scene_of(&self, found: &Found, folder: &Path, torques: &str) -> Result<(String, Option<String>), AimError> {
        let u = found.values();
        let scene = self.given.scene_at(&u)?;
        let mut keys: toml::Table = scene.text.parse().unwrap_or_default();
        if let Some(between) = between(folder, &scene.folder) {
            keys.iter_mut().for_each(|(key, value)| rebase(key, value, &between));
        }
        let run = keys.get_mut("run").and_then(toml::Value::as_table_mut);
        let table = match (&self.given.torque, run) {
            (Some(torque), Some(run)) => {
                run.insert("controller".into(), "torque-file".into());
                run.insert("torque_file".into(), torques.into());
                let joints = names_of_motors(&scene);
                let mut table = format!("time,{}\n", joints.join(","));
                for (time, forces) in torque.rows(&u[self.given.unknowns.len()..], scene.duration) {
                    let own = joints.iter().map(|joint| {
                        let k = torque.joints.iter().position(|own| own == joint);
                        k.map_or("0".to_owned(), |k| forces[k].to_string())
                    });
                    table += &format!("{time},{}\n", own.collect::<Vec<_>>().join(","));
                }
                Some(table)
            }
            _ => None,
        };
        Ok((toml::to_string(&keys).unwrap_or_default(), table))
    }
}

/// The keys of a scene whose values are paths.
const PATHS: [&str; 6] = ["urdf", "srdf", "file", "torque_file", "reference", "package_dirs"];

/// The path from one folder to another; `None` if they are the same or one is not there.
fn between(from: &Path, to: &Path) -> Option<PathBuf> {
    let here = |path: &Path| if path.as_os_str().is_empty() { Path::new(".") } else { path }.canonicalize();
    let (from, to) = (here(from).ok()?, here(to).ok()?);
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(common).map(|_| Component::ParentDir);
    let path: PathBuf = up.chain(to.components().skip(common)).collect();
    Some(path).filter(|path| !path.as_os_str().is_empty())
}

/// Changes relative paths to those from a folder from which theirs is reached by `between`.
fn rebase(key: &str, value: &mut toml::Value, between: &Path) {
    match value {
        toml::Value::String(path) if PATHS.contains(&key) && !path.contains("://") && Path::new(path).is_relative() => {
            let mut whole = PathBuf::new();
            for part in between.join(&*path).components() {
                let ends_in_name = matches!(whole.components().next_back(), Some(Component::Normal(_)));
                if part == Component::ParentDir && ends_in_name {
                    whole.pop();
                } else {
                    whole.push(part);
                }
            }
            *path = whole.to_string_lossy().into_owned();
        }
        toml::Value::Array(all) => all.iter_mut().for_each(|value| rebase(key, value, between)),
        toml::Value::Table(all) => all.iter_mut().for_each(|(key, value)| rebase(key, value, between)),
        _ => {}
    }
}

impl Given {
    /// The unknowns at the start of the search.
    pub fn first(&self) -> Vec<f64> {
        let torques = self.torque.iter().flat_map(|own| own.each(&own.first));
        self.unknowns.iter().map(|own| own.first).chain(torques).collect()
    }

    /// Their names.
    pub fn names(&self) -> Vec<String> {
        let torques = self.torque.iter().flat_map(|own| {
            own.joints.iter().flat_map(|joint| (0..own.count).map(move |k| format!("torque {joint} {}", k + 1)))
        });
        self.unknowns.iter().map(|own| own.name.clone()).chain(torques).collect()
    }

    /// Their bounds.
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        let torques = self.torque.iter().flat_map(|own| own.each(&own.bounds));
        self.unknowns.iter().map(|own| own.bounds).chain(torques).collect()
    }

    /// The scene at these values; its torques are in [`Given::plan`].
    pub fn scene_at(&self, u: &[f64]) -> Result<Scene, SimError> {
        let values: Vec<_> = self.unknowns.iter().zip(u).flat_map(|(own, value)| own.values(*value)).collect();
        if values.is_empty() {
            return Ok(self.scene.clone());
        }
        let duration = self.unknowns.iter().zip(u).find_map(|(own, value)| own.duration(*value));
        let mut scene = self.scene.with_values(&values)?;
        scene.duration = duration.unwrap_or(scene.duration);
        Ok(scene)
    }

    /// The simulation at these values, and its duration.
    pub fn plan(&self, u: &[f64]) -> Result<(Plan, f64), SimError> {
        let scene = self.scene_at(u)?;
        let mut plan = scene.plan()?;
        if let Some(torque) = &self.torque {
            plan.simulation.drive = torque.drive(&u[self.unknowns.len()..], &plan, scene.duration);
        }
        plan.simulation.stop.clone_from(&self.scene.simulation.stop);
        Ok((plan, scene.duration))
    }
}

/// The path of the duration of a run.
const DURATION: &str = "run.duration";

impl Found {
    /// The values of the unknowns.
    pub fn values(&self) -> Vec<f64> {
        self.unknowns.iter().map(|own| own.found).collect()
    }
}

impl Own {
    /// The values of its keys.
    pub fn values(&self, value: f64) -> Vec<(String, f64)> {
        let of = |formula: &Option<FlatEx<f64>>| match formula {
            None => value,
            Some(formula) => formula.eval(&vec![value; formula.var_names().len()]).unwrap_or(f64::NAN),
        };
        self.set.iter().map(|(path, formula)| (path.clone(), of(formula))).collect()
    }

    /// Its size: half of its range, or that of its first value.
    pub fn size(&self) -> f64 {
        size(self.bounds, self.first)
    }

    /// The duration that it gives, s.
    pub fn duration(&self, value: f64) -> Option<f64> {
        self.values(value).into_iter().find_map(|(path, value)| (path == DURATION).then_some(value))
    }

    /// Its key, if it is a number of the file.
    pub fn path(&self) -> Option<&str> {
        match self.set.as_slice() {
            [(path, None)] => Some(path),
            _ => None,
        }
    }
}

impl UnknownKeys {
    /// Its name in messages.
    fn label(&self, k: usize) -> String {
        self.number.as_ref().or(self.name.as_ref()).cloned().unwrap_or_else(|| (k + 1).to_string())
    }
}

impl Torque {
    /// What each joint has, for all of its unknowns.
    fn each<T: Copy>(&self, of_joints: &[T]) -> impl Iterator<Item = T> {
        of_joints.iter().flat_map(|own| std::iter::repeat_n(*own, self.count))
    }

    /// The times of the rows of its table, and the torques of the joints.
    pub fn rows(&self, torques: &[f64], duration: f64) -> Vec<(f64, Vec<f64>)> {
        let row = |time: f64, k: usize| {
            let forces = (0..self.joints.len()).map(|joint| torques[joint * self.count + k]).collect();
            (time, forces)
        };
        if self.pieces {
            let h = duration / self.count as f64;
            return (0..self.count).flat_map(|k| [row(k as f64 * h, k), row((k + 1) as f64 * h, k)]).collect();
        }
        let h = duration / (self.count - 1).max(1) as f64;
        (0..self.count).map(|k| row(k as f64 * h, k)).collect()
    }

    fn drive(&self, torques: &[f64], plan: &Plan, duration: f64) -> Drive {
        let chain = &plan.simulation.chain;
        let places: Vec<Option<usize>> = self
            .joints
            .iter()
            .map(|name| chain.joint(name).ok().and_then(|joint| chain.coordinate_of(joint)).map(|at| at.v))
            .collect();
        let rows = self.rows(torques, duration).into_iter().map(|(time, own)| {
            let mut forces = vec![0.0; chain.nv()];
            places.iter().zip(own).for_each(|(v, force)| {
                if let Some(v) = v {
                    forces[*v] = force;
                }
            });
            (time, forces)
        });
        let (times, forces) = rows.unzip();
        Drive::Table(TorqueTable { times, forces })
    }

    /// ∫ |τ|² dt, and its derivatives.
    pub fn effort(&self, torques: &[f64], duration: f64) -> (f64, Vec<f64>) {
        let (mut sum, mut by) = (0.0, vec![0.0; torques.len()]);
        for joint in 0..self.joints.len() {
            let at = joint * self.count;
            if self.pieces {
                let h = duration / self.count as f64;
                for k in at..at + self.count {
                    sum += h * torques[k] * torques[k];
                    by[k] = 2.0 * h * torques[k];
                }
                continue;
            }
            let h = duration / (self.count - 1).max(1) as f64;
            for k in at..at + self.count - 1 {
                let (a, b) = (torques[k], torques[k + 1]);
                sum += h / 3.0 * (a * a + a * b + b * b);
                by[k] += h / 3.0 * (2.0 * a + b);
                by[k + 1] += h / 3.0 * (a + 2.0 * b);
            }
        }
        (sum, by)
    }

    /// The second derivatives of the effort: row, column, value, of which those above the diagonal stand for both.
    pub fn effort_twice(&self, duration: f64) -> Vec<(usize, usize, f64)> {
        let mut all = Vec::new();
        for at in (0..self.joints.len()).map(|joint| joint * self.count) {
            if self.pieces {
                let h = duration / self.count as f64;
                all.extend((at..at + self.count).map(|k| (k, k, 2.0 * h)));
                continue;
            }
            let h = duration / (self.count - 1).max(1) as f64;
            for k in at..at + self.count {
                let ends = k == at || k + 1 == at + self.count;
                all.push((k, k, if ends { 2.0 } else { 4.0 } * h / 3.0));
                if k + 1 < at + self.count {
                    all.push((k, k + 1, h / 3.0));
                }
            }
        }
        all
    }
}

impl Place {
    /// In words, after a formula.
    fn text(&self) -> String {
        match &self.impact {
            None => String::new(),
            Some((contact, _, k)) => {
                let side = if self.side == 0 { "before" } else { "after" };
                format!(" {side} impact {} of {contact}", k + 1)
            }
        }
    }
}

fn names_of_motors(scene: &Scene) -> Vec<String> {
    let chain = &scene.simulation.chain;
    let is_own =
        |joint: &&carom_chain::JointInfo| matches!(&joint.coordinates, Coordinates::Own { v, .. } if v.len() == 1);
    let own = chain.joints().iter().filter(is_own);
    own.map(|joint| joint.name.clone()).collect()
}

fn place(
    touches: &[Touch],
    contact: &Option<String>,
    impact: Option<usize>,
    side: Option<Side>,
) -> Result<Place, String> {
    let Some(name) = contact else {
        return match (impact, side) {
            (None, None) => Ok(Place { impact: None, side: 1 }),
            _ => Err("impact and side belong to a contact: give its name".into()),
        };
    };
    let meant = Touch::named(touches, name)?;
    let k = impact.unwrap_or(1);
    if k == 0 {
        return Err("impact = 0: the first impact is 1".into());
    }
    let side = usize::from(side != Some(Side::Before));
    Ok(Place { impact: Some((name.clone(), meant, k - 1)), side })
}

/// The bounds of a condition, and how it is written.
fn asked(keys: &ConditionKeys) -> Result<([f64; 2], String), String> {
    let (bounds, text) = match (keys.equals, keys.least, keys.most) {
        (Some(x), None, None) => ([x, x], format!("= {x}")),
        (None, Some(a), None) => ([a, f64::INFINITY], format!(">= {a}")),
        (None, None, Some(b)) => ([f64::NEG_INFINITY, b], format!("<= {b}")),
        (None, Some(a), Some(b)) => ([a, b], format!("from {a} to {b}")),
        _ => return Err("needs equals, or least, most or both".into()),
    };
    match bounds[0] <= bounds[1] && (bounds[0].is_finite() || bounds[1].is_finite()) {
        true => Ok((bounds, text)),
        false => Err(format!("{text}: the bounds must be numbers, least not above most")),
    }
}

fn bounds(from: Option<f64>, to: Option<f64>, first: f64) -> Result<[f64; 2], String> {
    let bounds = [from.unwrap_or(f64::NEG_INFINITY), to.unwrap_or(f64::INFINITY)];
    if bounds[0].partial_cmp(&bounds[1]) != Some(std::cmp::Ordering::Less) {
        return Err(format!("from = {}, to = {}: from must be below to", bounds[0], bounds[1]));
    }
    if !(bounds[0]..=bounds[1]).contains(&first) {
        return Err(format!("its first value, {first}, is not from {} to {}: give first", bounds[0], bounds[1]));
    }
    Ok(bounds)
}

/// The size of a number: half of its range, or that of its first value.
pub(super) fn size([from, to]: [f64; 2], first: f64) -> f64 {
    if (to - from).is_finite() { 0.5 * (to - from) } else { first.abs().max(1.0) }
}

fn own(scene: &Scene, keys: &UnknownKeys) -> Result<Own, String> {
    let (name, set, first) = match (&keys.number, &keys.name) {
        (Some(path), None) if keys.set.is_empty() => {
            let own = scene.number(path).map_err(|e| e.to_string())?;
            (path.clone(), vec![(path.clone(), None)], keys.first.unwrap_or(own))
        }
        (None, Some(name)) if !keys.set.is_empty() => {
            let set = keys.set.iter().map(|(path, formula)| {
                let refuse = |why: String| format!("set.\"{path}\" = \"{formula}\" {why}");
                let parsed = FlatEx::<f64>::parse(formula).map_err(|e| refuse(format!("is no formula: {e}")))?;
                match parsed.var_names().iter().find(|own| *own != name) {
                    Some(own) => Err(refuse(format!("has the variable '{own}': the unknown is '{name}'"))),
                    None => Ok((path.clone(), Some(parsed))),
                }
            });
            let first = keys.first.ok_or("needs first, its value at the start of the search")?;
            (name.clone(), set.collect::<Result<_, String>>()?, first)
        }
        _ => return Err("needs number (the path of a key), or name and set (formulas of it by paths)".into()),
    };
    if !first.is_finite() {
        return Err(format!("first = {first}: it must be finite"));
    }
    let bounds = bounds(keys.from, keys.to, first)?;
    let mut own = Own { name, first, bounds, set, start: None, acts: false };
    // What it changes: from the scene at values beside the first one, inside the bounds.
    let step = 1e-3 * first.abs().max(1.0);
    let step = if first + 2.0 * step <= bounds[1] { step } else { -step };
    let at = |k: f64| scene.with_values(&own.values(first + k * step)).map_err(|e| e.to_string());
    let (a, b, c) = (at(0.0)?, at(1.0)?, at(2.0)?);
    if (&a.q, &a.qd) != (&b.q, &b.qd) {
        let slopes = |from: &Scene, to: &Scene| from_to(from, to, step).map_err(|e| e.to_string());
        let (slopes, next) = (slopes(&a, &b)?, slopes(&b, &c)?);
        let straight = slopes.iter().zip(&next).all(|(a, b)| (a - b).abs() <= STRAIGHT * a.abs().max(1.0));
        own.start = Some(if straight { FirstState::Linear(slopes) } else { FirstState::Curved });
    }
    let of_start = |path: &str| {
        let (table, key) = path.split_once('.').unwrap_or((path, ""));
        let key = key.split(['.', '[']).next().unwrap_or_default();
        table.starts_with("robot") && ["q", "qd", "tip_velocity"].contains(&key)
    };
    let keeps = own.set.iter().all(|(path, _)| path == DURATION || of_start(path));
    // A controller may depend on the velocity at the start.
    let drives = |scene: &Scene| format!("{:?}", (&scene.simulation.drive, &scene.simulation.after_impact));
    own.acts = !keeps || drives(&a) != drives(&b);
    Ok(own)
}

/// Derivatives of a start that are the same up to this are so up to rounding.
const STRAIGHT: f64 = 1e-9;

/// From the start of one scene to that of another, as displacement and change of velocity, for each unit of `step`.
pub(super) fn from_to(from: &Scene, to: &Scene, step: f64) -> Result<Vec<f64>, SimError> {
    let moved = from.simulation.chain.difference(&from.q, &to.q)?;
    let faster = to.qd.iter().zip(&from.qd).map(|(to, from)| to - from);
    Ok(moved.into_iter().chain(faster).map(|change| change / step).collect())
}

fn torque(scene: &Scene, keys: &TorqueKeys) -> Result<Torque, String> {
    let known = names_of_motors(scene);
    if keys.joints.is_empty() {
        return Err(format!("joints is empty: give some of {}", known.join(", ")));
    }
    for (k, joint) in keys.joints.iter().enumerate() {
        if !known.contains(joint) {
            return Err(format!(
                "joints has '{joint}', which is no joint with one coordinate: there are {}",
                known.join(", ")
            ));
        }
        if keys.joints[..k].contains(joint) {
            return Err(format!("joints has '{joint}' twice: remove one"));
        }
    }
    if !matches!(scene.simulation.drive, Drive::Off) || scene.simulation.after_impact.is_some() {
        return Err("takes the place of the controller: the scene must have controller = \"off\"".into());
    }
    let (count, pieces) =
        match (keys.knots, keys.pieces) {
            (Some(knots), None) if knots >= 2 => (knots, false),
            (None, Some(pieces)) if pieces >= 1 => (pieces, true),
            _ => return Err(
                "needs knots (2 or more, with torques linear between them) or pieces (1 or more, of constant torque)"
                    .into(),
            ),
        };
    let (mut firsts, mut all) = (Vec::new(), Vec::new());
    for joint in 0..keys.joints.len() {
        let of = |given, key| Each::of(given, key, joint, keys.joints.len());
        let first = of(&keys.first, "first")?.unwrap_or(0.0);
        if !first.is_finite() {
            return Err(format!("first = {first}: it must be finite"));
        }
        all.push(bounds(of(&keys.from, "from")?, of(&keys.to, "to")?, first)?);
        firsts.push(first);
    }
    Ok(Torque { joints: keys.joints.clone(), count, pieces, bounds: all, first: firsts })
}
