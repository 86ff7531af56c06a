//! Reads a problem file: the scene, the unknowns, the conditions and the cost. The book documents the keys: `book/src/task-aims.md`.

use super::function::Function;
use super::segments::Guess;
use super::torque::TorqueKeys;
use super::unknown::{Given, UnknownKeys};
use super::{AimError, Found};
use crate::problem_file;
use carom_sim::{Drive, Plan, Scene, Touch, state_variables};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
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
struct ConditionKeys {
    value: String,
    equals: Option<f64>,
    least: Option<f64>,
    most: Option<f64>,
    contact: Option<String>,
    impact: Option<usize>,
    side: Option<Side>,
    along: Option<bool>,
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
    along: Option<bool>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct SearchKeys {
    tolerance: Option<f64>,
    steps: Option<usize>,
    segments: Option<usize>,
    #[serde(default)]
    guess: BTreeMap<String, String>,
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
#[derive(Clone)]
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
    pub(super) segments: usize,
    /// The states between segments.
    pub(super) guess: Guess,
}

/// Where a function is evaluated.
#[derive(Clone)]
pub(super) enum Place {
    End,
    /// The k-th impact of these touches, k from 0; side 0 before, 1 after it.
    Impact {
        contact: String,
        touches: Vec<usize>,
        k: usize,
        side: usize,
    },
    /// It is integrated over the motion.
    Along,
}

#[derive(Clone)]
pub(super) struct Condition {
    pub name: String,
    /// `None`: that a segment begins where the one before ends.
    pub asked: Option<(Function, Place)>,
    pub bounds: [f64; 2],
}

#[derive(Clone)]
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
        problem_file::read(path.as_ref(), |file, rule| AimError::File { file, rule }, Self::read, |it| &mut it.files)
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
        let scene = problem_file::scene(folder, &file.scene, &file.with, &[])?;
        if scene.simulation.stepping {
            return Err(refuse("scene: its [run] has method = \"steps\", which has no derivatives: remove it".into()));
        }
        let unknowns = file.unknown.iter().enumerate();
        let unknowns = unknowns
            .map(|(k, keys)| keys.read(&scene).map_err(|why| refuse(format!("[[unknown]] {}: {why}", keys.label(k)))));
        let unknowns = unknowns.collect::<Result<Vec<_>, _>>()?;
        if let Some(k) = (0..unknowns.len()).find(|k| unknowns[..*k].iter().any(|it| it.name == unknowns[*k].name)) {
            return Err(refuse(format!("[[unknown]] {} occurs twice: remove one", unknowns[k].name)));
        }
        let numbers: Vec<(&str, &str)> =
            unknowns.iter().flat_map(|own| own.numbers().map(|number| (number, own.name.as_str()))).collect();
        let twin = |k: &usize| numbers[..*k].iter().find(|it| it.0 == numbers[*k].0);
        if let Some((number, first, k)) = (0..numbers.len()).find_map(|k| twin(&k).map(|it| (it.0, it.1, k))) {
            let rule = format!("[[unknown]] {first} and {} both set {number}: remove one", numbers[k].1);
            return Err(refuse(rule));
        }
        let torque =
            file.torque.as_ref().map(|keys| keys.read(&scene).map_err(|why| refuse(format!("[torque] {why}"))));
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
        let states = state_variables(&scene.simulation.chain);
        let states = states.iter().map(|(name, _)| name.as_str()).chain(["time", "impulse", "lost"]);
        if let Some(taken) = states.into_iter().find(|state| names.iter().any(|name| name == state)) {
            let why = "formulas have this name for the motion: choose another name";
            return Err(refuse(format!("[[unknown]] name = \"{taken}\": {why}")));
        }
        if let Some(taken) = names.iter().find(|name| Function::is_of_link(name, sim)) {
            let why = "formulas have this name for a link of the robot: choose another name";
            return Err(refuse(format!("[[unknown]] name = \"{taken}\": {why}")));
        }
        let function = |formula: &str, place: &Place| {
            let read = Function::of(formula, sim, &names, place.is_impact())?;
            if read.is_constant() && !matches!(place, Place::Along) {
                return Err(format!("\"{formula}\" depends on neither the motion nor an unknown"));
            }
            Ok(read)
        };
        let conditions = file.condition.iter().enumerate().map(|(k, keys)| {
            let read = || {
                let place = Place::of(&sim.touches, &keys.contact, (keys.impact, keys.side), keys.along)?;
                let function = function(&keys.value, &place).map_err(|why| format!("value = {why}"))?;
                let (bounds, told) = asked(keys)?;
                let name = format!("{}{} {told}", keys.value, place.text());
                Ok(Condition { name, asked: Some((function, place)), bounds })
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
            if weight < 0.0 && keys.value.is_none() {
                return Err(refuse(format!("weight = {weight}: that of a square must not be negative")));
            }
            let (formula, squared) = match (&keys.value, &keys.square, keys.effort) {
                (Some(formula), None, None) => (formula, false),
                (None, Some(formula), None) => (formula, true),
                (None, None, Some(true)) if torque.is_some() => {
                    let CostKeys { contact, impact, side, along, .. } = keys;
                    if contact.is_some() || impact.is_some() || side.is_some() || *along == Some(false) {
                        let why = "effort is that of the whole motion: remove contact, impact, side and along";
                        return Err(refuse(why.into()));
                    }
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
            let place = Place::of(&sim.touches, &keys.contact, (keys.impact, keys.side), keys.along).map_err(refuse)?;
            // Of the square along a motion the integral, not the square of the integral.
            let (formula, squared) = match (squared, &place) {
                (true, Place::Along) => (format!("({formula})^2"), false),
                _ => (formula.clone(), squared),
            };
            let function = function(&formula, &place).map_err(refuse)?;
            costs.push(Cost { name: format!("{formula}{}", place.text()), function, place, weight, squared });
        }
        let tolerance = file.search.tolerance.unwrap_or(1e-9);
        if !(tolerance > 0.0 && tolerance.is_finite()) {
            return Err(refuse(format!("[search] tolerance = {tolerance}: it must be positive and finite")));
        }
        let segments = file.search.segments.unwrap_or(1);
        let guess = Guess::of(&file.search.guess, sim).map_err(|why| refuse(format!("[search] guess {why}")))?;
        if segments > 0 && (segments > 1) == file.search.guess.is_empty() {
            let why = "segments and guess, formulas of time of the state between them, belong together: give both";
            return Err(refuse(format!("[search] segments = {segments}: {why}")));
        }
        let counts = matches!(scene.simulation.drive, Drive::Feedback(_)) || scene.simulation.after_impact.is_some();
        if segments == 0 || (segments > 1 && counts) {
            let why =
                if counts { "the controller counts impacts from the start: leave it out" } else { "give 1 or more" };
            return Err(refuse(format!("[search] segments = {segments}: {why}")));
        }
        let (files, warnings) = (scene.files.clone(), scene.warnings.clone());
        let steps = file.search.steps.unwrap_or(100);
        let given = Given { scene, unknowns, torque, knots: Vec::new() };
        let problem = Self { files, warnings, given, conditions, costs, effort, tolerance, steps, segments, guess };
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
}

impl Condition {
    /// How far a value is from what is asked.
    pub fn miss(&self, value: f64) -> f64 {
        (self.bounds[0] - value).max(value - self.bounds[1]).max(0.0)
    }
}

impl Place {
    pub fn is_impact(&self) -> bool {
        matches!(self, Self::Impact { .. })
    }

    /// In words, after a formula.
    fn text(&self) -> String {
        match self {
            Self::End => String::new(),
            Self::Along => " along the motion".into(),
            Self::Impact { contact, k, side, .. } => {
                let side = if *side == 0 { "before" } else { "after" };
                format!(" {side} impact {} of {contact}", k + 1)
            }
        }
    }

    fn of(
        touches: &[Touch],
        contact: &Option<String>,
        (impact, side): (Option<usize>, Option<Side>),
        along: Option<bool>,
    ) -> Result<Self, String> {
        let Some(name) = contact else {
            return match (impact, side, along) {
                (None, None, Some(true)) => Ok(Self::Along),
                (None, None, _) => Ok(Self::End),
                _ => Err("impact and side belong to a contact: give its name".into()),
            };
        };
        if along == Some(true) {
            return Err(format!(
                "contact = \"{name}\" and along: an integral is that over the whole motion, remove one"
            ));
        }
        let meant = Touch::named(touches, name)?;
        let k = impact.unwrap_or(1);
        if k == 0 {
            return Err("impact = 0: the first impact is 1".into());
        }
        let side = usize::from(side != Some(Side::Before));
        Ok(Self::Impact { contact: name.clone(), touches: meant, k: k - 1, side })
    }
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
