//! Scenes: reads robots, the surfaces around them, contact laws and run settings from a TOML file. The book
//! documents the keys: `book/src/reference-scene.md`.

mod by_key;
mod contact;
mod drive;
mod file;
mod force;
#[doc(hidden)] // shared with study files
pub mod keys;
#[doc(hidden)] // shared with the Python package
pub mod path;
mod perturb;
mod robots;
mod surface;
mod table;
mod toml;

pub use perturb::{Distribution, Disturbed, Perturbation};
#[doc(hidden)]
pub use robots::Body;
#[doc(hidden)]
pub use toml::from_toml;

use crate::contact::{ContactRule, Surface, Touch, Touches};
use crate::error::SimError;
use crate::model::{Drive, Simulation, TOLERANCE};
use crate::state::{EQUAL, View};
use carom_chain::Spatial;
use carom_chain::input;
use carom_contact::LeftOut;
use contact::{apply, between_links, overridden, several};
use drive::{per_joint, targets_outside};
use file::{File, Method, Model, Shape};
use force::{closure, wrench};
use keys::Table;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use surface::{Places, idle_belts, surface};

/// A scene: a robot or several, the surfaces around them, contact laws and run settings, read from a TOML file
/// ([`Scene::from_file`]).
///
/// ```toml
/// [robot]
/// urdf = "robots/planar2.urdf"        # relative to the scene file
/// q = [0.7854, -1.5708]
/// tip_velocity = { speed = 0.2, angle_deg = 45, along = [0, -1, 0] }   # or qd = [..]
///
/// [[surface]]
/// shape = { halfspace = { point = [0.6364, 0, 0], normal = [-1, 0, 0] } }
///
/// [contact]
/// law = "energetic"
/// restitution = 0.35
/// friction = 0.0
///
/// [run]
/// duration = 0.5
/// ```
///
/// The book has all keys with their units and defaults: its page "Scene files", `book/src/reference-scene.md`.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The simulation of the whole chain; [`Scene::plan`] reduces it.
    pub simulation: Simulation,
    /// Configuration at the start, length nq; rad, m, quaternion.
    pub q: Vec<f64>,
    /// Joint velocities at the start, length nv; rad/s, m/s.
    pub qd: Vec<f64>,
    /// Duration, s.
    pub duration: f64,
    /// The error that the numbers of the run may have; `None` if the file gives a tolerance, or nothing. See [`Scene::to_accuracy`].
    pub accuracy: Option<f64>,
    /// Interval between samples, s; `None` if the file has no `sample`.
    pub sample: Option<f64>,
    /// Random disturbances of the start; `None` if the file has no `perturb`.
    pub perturbation: Option<Perturbation>,
    /// The surfaces, in the order of the file.
    pub surfaces: Vec<Surface>,
    /// The link that is the tip; `None` if the file names none and the robot has no link `tip`.
    pub tip: Option<String>,
    /// Pairs of a link and a surface that can't touch, each with its reason.
    pub out_of_reach: Vec<(String, LeftOut)>,
    /// `model = "full"`: [`Scene::plan`] makes no reductions.
    pub full: bool,
    /// The text of the scene file.
    pub text: String,
    /// The folder to which file names in the text are relative.
    pub folder: PathBuf,
    /// Every file that was read: scene, robot, meshes of robot and surfaces, tables.
    pub files: Vec<PathBuf>,
    /// Warnings: a start outside joint limits, a `[[contact.pair]]` that applies to no contact. Those about the robot are in
    /// [`Chain::report`](carom_chain::Chain::report).
    pub warnings: Vec<String>,
    /// The robots as they are read from their files, for scenes with other values of other keys.
    #[doc(hidden)]
    pub bodies: Arc<Vec<Body>>,
}

impl Scene {
    /// Interval between the samples of tables and recordings where neither the file nor the caller gives one, s: that of Pagilla and Yu (2004).
    pub const SAMPLE: f64 = 0.004;

    /// Reads a scene file, its robot and its meshes.
    ///
    /// # Errors
    /// [`SimError::Scene`] with file, key, value and rule; [`SimError::Chain`] for an invalid robot or start state.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, SimError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let text = input::read_text(path, input::MOST_MIB)
            .map_err(|e| SimError::Scene { file: name.clone(), rule: format!("cannot be read: {e}") })?;
        let mut scene =
            Self::read(&text, path.parent().unwrap_or(Path::new(".")), None).map_err(|e| in_file(name, e))?;
        scene.files.insert(0, path.to_owned());
        Ok(scene)
    }

    /// Reads a scene from the text of a scene file. File names in it are relative to `folder`.
    ///
    /// # Errors
    /// As [`Scene::from_file`]; the file of the messages is `<scene>`.
    pub fn from_toml(text: &str, folder: impl AsRef<Path>) -> Result<Self, SimError> {
        Self::read(text, folder.as_ref(), None).map_err(|e| in_file("<scene>".into(), e))
    }

    /// With `bodies` the robots are these, and their files are not read.
    fn read(text: &str, folder: &Path, bodies: Option<&Arc<Vec<Body>>>) -> Result<Self, SimError> {
        let file: File = from_toml(text).map_err(refuse)?;

        let in_folder = |names: Vec<&PathBuf>| names.into_iter().map(|name| folder.join(name)).collect::<Vec<_>>();
        let (files, package_dirs) = (in_folder(file.tables()), in_folder(file.package_dirs()));
        let places = Places { folder, package_dirs: &package_dirs };
        let robots = file.robot.load(folder, bodies.map(|all| all.as_slice()))?;
        let chain = robots.chain.clone();
        let (Table((given, contact)), Table((run, control))) = (&file.contact, &file.run);
        robots.check_efforts(run.effort_limits).map_err(refuse)?;
        let rule = overridden(&ContactRule::default(), given).map_err(|why| refuse(format!("[contact] {why}")))?;
        rule.check("[contact]").map_err(|e| refuse(e.to_string()))?;
        let surfaces = file.surface.iter().enumerate();
        let surfaces = surfaces.map(|(k, it)| surface(places, k, it, &rule).map_err(refuse));
        let surfaces: Vec<Surface> = surfaces.collect::<Result<_, _>>()?;
        let mut names = HashSet::new();
        if let Some(twin) = surfaces.iter().find(|it| !names.insert(it.name.as_str())) {
            return Err(refuse(format!(
                "[[surface]] name = \"{}\": two surfaces have this name, rename one",
                twin.name
            )));
        }
        let mut q = robots.q.clone();
        let mut qd = robots.velocities(&surfaces, !file.loops.is_empty())?;

        let mut warnings: Vec<String> = chain.outside_limits(&q).into_iter().map(|(_, why)| why).collect();
        let full = run.model == Model::Full;
        let limits = contact.limit_restitution;
        let Touches { mut touches, mut left_out } = Touch::of(&chain, &surfaces, limits, !full)?;
        let linked = between_links(contact, &chain, &rule)?;
        touches.extend(linked.touches);
        left_out.extend(linked.left_out);
        for Table((pair, own)) in &contact.pair {
            let met = apply((pair, own), &chain, &surfaces, &mut touches);
            let met = met.map_err(|why| refuse(format!("[[contact.pair]] {why}")))?;
            let idle = own.given.is_empty() && pair.closes_while.is_none() && !pair.disabled;
            let why = if met { "gives its contacts no value" } else { "applies to no contact of this scene" };
            if idle || !met {
                let named = [("link", &pair.link), ("surface", &pair.surface), ("joint", &pair.joint)];
                let named = named.iter().filter_map(|(key, name)| Some(format!("{key} = \"{}\"", name.as_ref()?)));
                let named: Vec<String> = named.collect();
                warnings.push(format!("[[contact.pair]] {}: {why}", named.join(", ")));
            }
        }
        let touches = Touch::divided(touches);
        warnings.extend(contact::warnings(&file.contact, &file.surface, &touches));
        warnings.extend(idle_belts(&file.surface, &surfaces, &touches));
        let (drive, after_impact) = robots.drives(folder, control, &surfaces, &qd).map_err(refuse)?;
        let own = file.spring.iter().enumerate().map(|(k, it)| (format!("[[spring]] {}", k + 1), it));
        let springs = own.chain(robots.springs().map(|it| ("[[robot.beam]]".to_owned(), it)));
        let springs = springs.map(|(table, it)| match it.on(&chain) {
            Ok(_) => Ok(it.clone()),
            Err(why) => Err(refuse(format!("{table}: {why}"))),
        });
        let springs = springs.collect::<Result<_, _>>()?;
        let wrenches = file.force.iter().enumerate().map(|(k, it)| wrench(folder, &chain, k, it));
        let wrenches = wrenches.collect::<Result<Vec<_>, _>>().map_err(refuse)?;
        let idle = wrenches.iter().enumerate().filter_map(|(k, it)| Some((k, force::idle(it, &chain, run.duration)?)));
        warnings.extend(idle.map(|(k, why)| format!("[[force]] {}: {why}", k + 1)));
        if run.effort_limits && matches!(drive, Drive::Off) {
            warnings.push("effort_limits: limits nothing while the motors are off (controller)".into());
        }
        let loops = file.loops.iter().enumerate().map(|(k, it)| closure(&chain, k, it));
        let loops = loops.collect::<Result<Vec<_>, _>>().map_err(refuse)?;
        let perturbation = run.perturb.as_ref().map(|given| {
            let size = |key: &str, given: &Option<file::PerJoint>| match given {
                Some(file::PerJoint::Same(size)) => Ok(vec![*size; chain.nv()]),
                Some(given) => per_joint(key, given, &chain),
                None => Ok(vec![0.0; chain.nv()]),
            };
            let (q, qd) = (size("perturb.q", &given.q)?, size("perturb.qd", &given.qd)?);
            let own = |path: &str| given.distributions.get(path).copied().unwrap_or(given.distribution);
            let numbers = given.numbers.iter();
            let numbers: Vec<Disturbed> = numbers
                .map(|(path, size)| Disturbed { path: path.clone(), size: *size, distribution: own(path) })
                .collect();
            if let Some(path) = given.distributions.keys().find(|path| !given.numbers.contains_key(*path)) {
                return Err(format!(
                    "perturb.distributions has {path}, which is not among perturb.numbers: add its size"
                ));
            }
            let runs = |path: &&String| path.starts_with("run.perturb") || *path == "run.max_events";
            if let Some(path) = given.numbers.keys().find(runs) {
                return Err(format!("perturb.numbers has {path}, which is no number of the motion: remove it"));
            }
            if i64::try_from(given.seed).is_err() {
                return Err(format!("perturb.seed is {}: give a whole number from 0 to {}", given.seed, i64::MAX));
            }
            let mut sizes = q.iter().chain(&qd).chain(numbers.iter().map(|own| &own.size));
            match sizes.clone().find(|x| !(x.is_finite() && **x >= 0.0)) {
                Some(x) => Err(format!("perturb has the size {x}: it must be finite and not negative")),
                None if sizes.all(|size| *size == 0.0) => {
                    Err("perturb disturbs nothing: give q, qd or numbers sizes above 0, or remove it".into())
                }
                None => Ok(Perturbation { q, qd, numbers, seed: given.seed, distribution: given.distribution }),
            }
        });
        let perturbation = perturbation.transpose().map_err(|why| refuse(format!("[run] {why}")))?;
        if run.neglect.is_some_and(|share| !(share > 0.0 && share < 1.0)) {
            let share = run.neglect.unwrap_or_default();
            return Err(refuse(format!("[run] neglect = {share}: it must be above 0 and below 1")));
        }
        if full && run.neglect.is_some() {
            let why = "[run] neglect leaves out of the model what has a small effect, and model = \"full\" keeps all: give one of them";
            return Err(refuse(why.into()));
        }
        if run.method == Method::Steps {
            let idle = [("max_step", run.max_step), ("zeno_time", run.zeno_time), ("tolerance", run.tolerance)];
            let idle = idle.iter().filter(|(_, given)| given.is_some());
            warnings
                .extend(idle.map(|(key, _)| format!("[run] {key}: method = \"steps\" has steps of contact_step only")));
        }
        let tip = robots.tip().map_err(refuse)?;
        if let Some(sample) = run.sample.filter(|sample| !(*sample > 0.0 && sample.is_finite())) {
            return Err(refuse(format!("[run] sample = {sample}: it must be positive and finite")));
        }
        let tolerance = match (run.tolerance, run.accuracy) {
            (Some(_), Some(_)) => {
                return Err(refuse("[run] accuracy chooses the tolerance: give one of tolerance and accuracy".into()));
            }
            (_, Some(_)) if run.zeno_time.is_some() => {
                return Err(refuse("[run] accuracy chooses the Zeno time, too: remove zeno_time".into()));
            }
            (_, Some(accuracy)) if !(accuracy > 0.0 && accuracy.is_finite()) => {
                return Err(refuse(format!("[run] accuracy = {accuracy}: it must be positive and finite")));
            }
            (tolerance, _) => tolerance.unwrap_or(TOLERANCE),
        };
        let simulation = Simulation {
            gravity: run.gravity.into(),
            drive,
            after_impact,
            springs,
            wrenches,
            loops,
            effort_limits: run.effort_limits,
            tolerance,
            max_step: run.max_step.unwrap_or(0.1),
            zeno_time: run.zeno_time.unwrap_or_else(|| Simulation::zeno_time_for(tolerance)),
            contact_step: run.contact_step,
            several: several(contact).map_err(|why| refuse(format!("[contact] {why}")))?,
            stepping: run.method == Method::Steps,
            max_events: run.max_events,
            planar: !full,
            neglect: if full { None } else { run.neglect },
            ..Simulation::new(chain, touches)
        };
        warnings.extend(robots.falling(&simulation));
        warnings.extend(simulation.drives().flat_map(|drive| targets_outside(drive, &simulation.chain, &q)));
        let (start, change) = simulation.close_loops(&q, &qd).map_err(|e| refuse(e.to_string()))?;
        if change > EQUAL {
            let new = format!("q = {:?}, qd = {:?}", start.q, start.qd);
            warnings.push(format!("[robot] the start does not close the loops: moved by up to {change:.3e} to {new}"));
        }
        (q, qd) = (start.q, start.qd);
        warnings.extend(closed_at_start(&simulation, &q)?);
        let obstacles = file.surface.iter().filter_map(|it| match &it.shape {
            Shape::Mesh { file, .. } => places.mesh(file).ok(),
            _ => None,
        });
        let collisions = simulation.chain.links().iter().flat_map(|link| &link.collisions).map(|it| &it.shape);
        let visuals = simulation.chain.links().iter().flat_map(|link| &link.visuals).map(|it| &it.shape);
        let meshes = collisions.chain(visuals).filter_map(|shape| match shape {
            carom_chain::urdf::Shape::Mesh { file, .. } => Some(file.clone()),
            _ => None,
        });
        let files = files.into_iter().chain(obstacles).chain(meshes).collect();
        let (duration, sample) = (run.duration, run.sample);
        Ok(Self {
            simulation,
            q,
            qd,
            duration,
            accuracy: run.accuracy,
            sample,
            perturbation,
            surfaces,
            tip,
            out_of_reach: left_out,
            full,
            text: text.to_owned(),
            folder: folder.to_owned(),
            files,
            warnings,
            bodies: bodies.cloned().unwrap_or_else(|| Arc::new(robots.bodies())),
        })
    }
}

/// A refusal of the scene, without the name of its file.
fn refuse(rule: String) -> SimError {
    SimError::Scene { file: String::new(), rule }
}

/// An error of the scene in this file.
fn in_file(file: String, error: SimError) -> SimError {
    match error {
        SimError::Scene { rule, .. } => SimError::Scene { file, rule },
        other => other,
    }
}

/// What a user may not expect of the contacts that are closed at the start: those without a row, and compliant ones that are pressed.
fn closed_at_start(simulation: &Simulation, q: &[f64]) -> Result<Vec<String>, SimError> {
    let (chain, time) = (&simulation.chain, simulation.start_time);
    let (couplings, mut workspace) = (simulation.couplings::<Spatial<f64>>(chain), chain.workspace());
    let mut view = View::closed_by(chain, &mut workspace, q, &couplings)?;
    let mut warnings = Vec::new();
    for touch in simulation.touches.iter().filter(|touch| touch.link().is_some() && touch.is_covered()) {
        let at = touch.at(&view, q, time);
        if at.gap > EQUAL || !at.counts() {
            continue;
        }
        if !touch.moves(&at, &mut view)? {
            let pair = format!("{} on {}", touch.link().unwrap_or_default(), touch.surface().unwrap_or_default());
            let warning = format!(
                "[robot] {pair} is closed at the start, and no joint moves the contact along its normal: it has neither force nor \
                 friction"
            );
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
        if let Some(compliance) = touch.contact.compliance.filter(|_| at.gap < -EQUAL) {
            warnings.push(format!(
                "[robot] {} starts {} m deep in its compliance ({compliance}): the energy stored in it comes in as work of the contact, \
                 start with an open gap unless this is meant",
                touch.name, -at.gap
            ));
        }
    }
    Ok(warnings)
}
