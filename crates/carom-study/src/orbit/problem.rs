//! Reads a problem file: the scene, the section, and what is asked. The book documents the keys: `book/src/task-orbits.md`.

use super::{Orbit, OrbitError, State};
use crate::map_study::Axis;
use crate::numbered::checksums;
use crate::problem_file::{self, Formulas, evaluated, formulas};
use carom_chain::Chain;
use carom_sim::{LinearFunction, Oscillation, Parameter, Plan, Scene, Simulation, SurfaceMotion, Touch};
use exmex::prelude::*;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    scene: PathBuf,
    #[serde(default)]
    with: toml::Table,
    section: SectionKeys,
    #[serde(default)]
    orbit: OrbitKeys,
    vary: Option<VaryKeys>,
    basin: Option<BasinKeys>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SectionKeys {
    contact: Option<String>,
    rising: Option<String>,
    falling: Option<String>,
    period: Option<f64>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct OrbitKeys {
    passages: Option<usize>,
    before: Option<usize>,
    #[serde(default)]
    modulo: Vec<String>,
    #[serde(default)]
    relabel: BTreeMap<String, String>,
    tolerance: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct VaryKeys {
    parameter: String,
    from: f64,
    to: f64,
    #[serde(default)]
    set: BTreeMap<String, String>,
    points: Option<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BasinKeys {
    x: AxisKeys,
    y: AxisKeys,
    #[serde(default)]
    set: BTreeMap<String, String>,
    cycles: Option<usize>,
    periods: Option<usize>,
    tolerance: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisKeys {
    what: String,
    from: f64,
    to: f64,
    points: u64,
}

/// A periodic orbit that is looked for: a scene, a section, a relabelling.
///
/// ```
/// use carom_study::orbit::{Problem, Stability};
/// let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../studies/compass.toml");
/// let orbit = Problem::from_file(file)?.find()?;
/// assert_eq!(orbit.stability, Stability::Stable);
/// # Ok::<(), carom_study::orbit::OrbitError>(())
/// ```
#[derive(Clone)]
pub struct Problem {
    /// The scene. Its start is where the search begins; its duration is the longest time of one passage.
    pub scene: Scene,
    /// The files that were read.
    pub files: Vec<PathBuf>,
    /// Warnings about the scene.
    pub warnings: Vec<String>,
    pub(super) section: Section,
    /// By what share of its period a section that is one is later than the start of the scene.
    pub(super) phase: f64,
    /// Numbers of the change of a state that need not return.
    pub(super) modulo: Vec<usize>,
    /// Of each relabelled joint: its numbers in q and qd, and the function of the others that it becomes.
    pub(super) relabel: Vec<Relabelled>,
    /// Number of passages of one period.
    pub(super) passages: usize,
    /// Number of periods before Newton's method begins.
    pub(super) before: usize,
    pub(super) tolerance: f64,
    pub(super) vary: Option<Vary>,
    pub(super) basin: Option<Grid>,
    /// The text of the problem file.
    pub(super) text: String,
    /// The file that messages name.
    pub(super) name: String,
}

/// Where a period begins and ends.
#[derive(Debug, Clone)]
pub(super) enum Section {
    /// Each impact of these contacts.
    Contact { name: String, touches: Vec<usize> },
    /// A linear function passes zero, upwards.
    Rising { formula: String, function: LinearFunction },
    /// After this time, s.
    After(f64),
}

/// A joint whose coordinate after the section is a function of those before.
#[derive(Debug, Clone)]
pub(super) struct Relabelled {
    pub q: usize,
    pub v: usize,
    pub to: LinearFunction,
    /// The terms of the function, by numbers of qd.
    pub rates: Vec<(usize, f64)>,
}

/// A parameter and its range.
#[derive(Debug, Clone)]
pub(super) struct Vary {
    pub name: String,
    pub from: f64,
    pub to: f64,
    pub points: usize,
    /// The keys that follow it.
    set: Formulas,
    /// The period of the section, if it follows it.
    period: Option<FlatEx<f64>>,
}

/// A simulation with its start, and how long a passage may take.
#[derive(Clone)]
pub(super) struct Timed {
    pub plan: Plan,
    /// The period of a section that is a time, otherwise the duration of the scene, s.
    pub longest: f64,
}

impl std::ops::Deref for Timed {
    type Target = Plan;

    fn deref(&self) -> &Plan {
        &self.plan
    }
}

/// The parameter as one by which periods are differentiated.
pub(super) struct ByParameter {
    /// Of the simulation.
    pub parameter: Parameter,
    /// The derivative of the period of the section, s.
    pub period: f64,
}

/// A grid of starts.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    /// The axes; the first varies fastest.
    pub axes: [GridAxis; 2],
    set: Formulas,
    /// Greatest number of cycles.
    pub cycles: usize,
    /// Greatest number of cycles of one period of an attractor.
    pub periods: usize,
    /// To which states of attractors are rounded, in the unit of each number.
    pub tolerance: f64,
}

/// An axis of a grid.
#[derive(Debug, Clone)]
pub(super) struct GridAxis {
    pub axis: Axis,
    means: Means,
}

/// What the number of an axis is.
#[derive(Debug, Clone, PartialEq)]
enum Means {
    /// The number with this index in (q, qd) of the start.
    State(usize),
    /// The parameter of `vary`.
    Parameter,
    /// The number at the path of a key of the scene.
    Key,
    /// A variable of the formulas.
    Variable,
}

impl Problem {
    /// Reads a problem file and its scene.
    ///
    /// # Errors
    /// [`OrbitError::File`] with key, value and rule; [`OrbitError::Run`] for an invalid scene.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, OrbitError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let text = problem_file::text(path).map_err(|rule| OrbitError::File { file: name.clone(), rule })?;
        let mut problem = Self::read(&text, name, path.parent().unwrap_or(Path::new(".")))?;
        problem.files.insert(0, path.to_owned());
        Ok(problem)
    }

    /// Reads a problem from the text of a problem file. File names in it are relative to `folder`.
    ///
    /// # Errors
    /// As [`Problem::from_file`]; the file of the messages is `<problem>`.
    pub fn from_toml(text: &str, folder: impl AsRef<Path>) -> Result<Self, OrbitError> {
        Self::read(text, "<problem>".into(), folder.as_ref())
    }

    fn read(text: &str, name: String, folder: &Path) -> Result<Self, OrbitError> {
        let refuse = |rule: String| OrbitError::File { file: name.clone(), rule };
        let file: File = carom_sim::from_toml(text).map_err(refuse)?;
        let scene = problem_file::scene(folder, &file.scene, &file.with)?;
        let plan = scene.plan()?;
        if plan.simulation.stepping {
            return Err(refuse("scene: its [run] has method = \"steps\", and orbits need events: remove it".into()));
        }
        let chain = &plan.simulation.chain;
        let section = section(&file.section, &plan).map_err(|why| refuse(format!("[section] {why}")))?;
        if plan.simulation.depends_on_time() && !matches!(section, Section::After(_)) {
            let why = "a drive, a force or a surface of the scene depends on time: give its period as period, so that all periods are alike";
            return Err(refuse(format!("[section] {why}")));
        }
        let OrbitKeys { passages, before, modulo, relabel, tolerance } = &file.orbit;
        let of_orbit = |why: String| refuse(format!("[orbit] {why}"));
        let names = plan.simulation.state_names();
        let modulo = modulo.iter().map(|name| {
            let known = names.iter().take(chain.nv()).position(|own| own.strip_prefix("q ") == Some(name));
            known.ok_or_else(|| {
                let all: Vec<&str> = names.iter().filter_map(|own| own.strip_prefix("q ")).collect();
                of_orbit(format!("modulo has '{name}', which is no coordinate: there are {}", all.join(", ")))
            })
        });
        let modulo = modulo.collect::<Result<Vec<_>, _>>()?;
        let relabel = relabel.iter().map(|(joint, formula)| {
            relabelled(chain, joint, formula).map_err(|why| of_orbit(format!("relabel.{joint} = {why}")))
        });
        let relabel = relabel.collect::<Result<Vec<_>, _>>()?;
        let at_least_one = |key: &str, given: Option<usize>, usual: usize| match given.unwrap_or(usual) {
            0 => Err(of_orbit(format!("{key} = 0: it must be 1 or more"))),
            count => Ok(count),
        };
        let tolerance = tolerance.unwrap_or(1e-12);
        if !(f64::EPSILON..1.0).contains(&tolerance) {
            return Err(of_orbit(format!("tolerance = {tolerance}: it must be from 2.3e-16 to below 1")));
        }
        let vary = file.vary.as_ref().map(|keys| vary(keys, &section).map_err(|why| refuse(format!("[vary] {why}"))));
        let problem = Self {
            files: scene.files.clone(),
            warnings: scene.warnings.clone(),
            section,
            phase: 0.0,
            modulo,
            relabel,
            passages: at_least_one("passages", *passages, 1)?,
            before: before.unwrap_or(1),
            tolerance,
            vary: vary.transpose()?,
            basin: None,
            text: text.to_owned(),
            name: name.clone(),
            scene,
        };
        let grid = file.basin.as_ref().map(|keys| problem.grid(keys).map_err(|why| refuse(format!("[basin] {why}"))));
        let problem = Self { basin: grid.transpose()?, ..problem };
        if let Some(grid) = &problem.basin {
            // As below.
            problem.plan_in(grid, [0, 1].map(|k| grid.axes[k].axis.value(0)))?;
            problem.check_axes(grid)?;
        }
        if let Some(vary) = &problem.vary {
            // A key that leads nowhere, or a value that the scene refuses, is told now.
            problem.plan(Some(vary.from))?;
            problem.plan(Some(vary.to))?;
        }
        Ok(problem)
    }

    /// An error of the problem file.
    pub(super) fn refusal(&self, rule: impl Into<String>) -> OrbitError {
        OrbitError::File { file: self.name.clone(), rule: rule.into() }
    }

    /// The start of the scene.
    pub(super) fn start(&self) -> State {
        State { q: self.scene.q.clone(), qd: self.scene.qd.clone() }
    }

    /// What rows of a table are computed from: the files, and options of this name.
    pub(super) fn sources(&self, name: &str, options: String) -> Vec<(String, String)> {
        let mut all = vec![("the problem file".to_owned(), self.text.clone()), (name.to_owned(), options)];
        all.extend(checksums(&self.files));
        all
    }

    /// The simulation at this value of the parameter.
    pub(super) fn plan(&self, parameter: Option<f64>) -> Result<Timed, OrbitError> {
        let (Some(vary), Some(value)) = (&self.vary, parameter) else { return self.plan_with(&[], None) };
        self.plan_with(&vary.values(value), vary.period(value))
    }

    /// The simulation of a place of a grid, with its start.
    pub(super) fn plan_in(&self, grid: &Grid, place: [f64; 2]) -> Result<Timed, OrbitError> {
        let mut timed = self.plan_by_keys(grid, place)?;
        let Plan { q, qd, .. } = &mut timed.plan;
        grid.move_start(place, q, qd);
        Ok(timed)
    }

    /// The same before numbers of its start are set.
    fn plan_by_keys(&self, grid: &Grid, place: [f64; 2]) -> Result<Timed, OrbitError> {
        let (mut values, mut period) = (Vec::new(), None);
        if let Some(vary) = &self.vary {
            let axis = (0..2).find(|k| grid.axes[*k].means == Means::Parameter);
            let value = axis.map_or(vary.from, |k| place[k]);
            values.extend(vary.values(value));
            period = vary.period(value);
        }
        for (GridAxis { axis, means }, value) in grid.axes.iter().zip(place) {
            if *means == Means::Key {
                values.push((axis.name.clone(), value));
            }
        }
        let names = [0, 1].map(|k| (grid.axes[k].axis.name.as_str(), place[k]));
        values.extend(evaluated(&grid.set, &names));
        self.plan_with(&values, period)
    }

    /// # Errors
    /// [`OrbitError::File`] if one axis of a basin sets a number of the start that the other changes by keys of the scene.
    fn check_axes(&self, grid: &Grid) -> Result<(), OrbitError> {
        let ends = |k: usize| [0, grid.axes[k].axis.count() - 1].map(|row| grid.axes[k].axis.value(row));
        for (own, other) in [(0, 1), (1, 0)] {
            let means = |k: usize| &grid.axes[k].means;
            let (Means::State(n), false) = (means(own), matches!(means(other), Means::State(_))) else { continue };
            let mut found = Vec::new();
            for value in ends(other) {
                let mut place = [ends(0)[0], ends(1)[0]];
                place[other] = value;
                let Plan { q, qd, .. } = self.plan_by_keys(grid, place)?.plan;
                found.push(q.into_iter().chain(qd).nth(*n));
            }
            if found[0] != found[1] {
                let [own, other] = [own, other].map(|k| &grid.axes[k].axis.name);
                return Err(self.refusal(format!(
                    "[basin] both axes set one number, {own}: {other} changes it, too. Give each axis a number of its own"
                )));
            }
        }
        Ok(())
    }

    fn plan_with(&self, values: &[(String, f64)], period: Option<f64>) -> Result<Timed, OrbitError> {
        let changed = if values.is_empty() { None } else { Some(self.scene.with_values(values)?) };
        let scene = changed.as_ref().unwrap_or(&self.scene);
        let mut plan = scene.plan()?;
        plan.simulation.tolerance = self.tolerance;
        plan.simulation.stop.clone_from(&self.scene.simulation.stop);
        let longest = match self.section {
            Section::After(given) => period.unwrap_or(given),
            _ => self.scene.duration,
        };
        if !(longest > 0.0 && longest.is_finite()) {
            let rule = "it must be positive and finite over the whole range";
            return Err(self.refusal(format!("[vary] set.\"section.period\" is {longest}: {rule}")));
        }
        self.check_phases(scene, longest)?;
        plan.simulation.start_time += self.phase * longest;
        Ok(Timed { plan, longest })
    }

    /// # Errors
    /// [`OrbitError::File`] if a surface that oscillates has another phase after the period of a section than before it: no motion returns.
    fn check_phases(&self, scene: &Scene, period: f64) -> Result<(), OrbitError> {
        /// A period that is given with six digits is meant as the exact one.
        const DIGITS: f64 = 1e-6;
        // A relabelled state may belong to the mirrored motion, half a period later.
        if !matches!(self.section, Section::After(_)) || !self.relabel.is_empty() {
            return Ok(());
        }
        for surface in &scene.surfaces {
            let Some(SurfaceMotion::Oscillation(Oscillation { amplitude, frequency, .. })) = &surface.motion else {
                continue;
            };
            // In Hz, as in the file: the conversions change its last digits.
            let frequency = (frequency.abs() / TAU * 1e12).round() / 1e12;
            let count = period * frequency;
            let whole = count.round().max(1.0);
            if amplitude.norm() > 0.0 && frequency != 0.0 && (count - whole).abs() > DIGITS * whole {
                return Err(self.refusal(format!(
                    "[section] period = {period}: surface {} moves with {frequency} Hz, {count:.6} times in it, and no motion returns. Give a \
                     whole number of its periods, as {}; where [vary] changes the frequency, give set.\"section.period\" there",
                    surface.name, whole / frequency
                )));
            }
        }
        Ok(())
    }

    /// The simulation that starts on an orbit, at the first value of the parameter.
    ///
    /// # Errors
    /// [`OrbitError`] of the scene.
    pub fn plan_of(&self, orbit: &Orbit) -> Result<Plan, OrbitError> {
        let State { q, qd } = orbit.start.clone();
        let mut plan = self.plan(self.vary.as_ref().map(|vary| vary.from))?.plan;
        plan.simulation.start_time = orbit.start_time;
        Ok(Plan { q, qd, ..plan })
    }

    /// The parameter of the problem at a value, as one by which runs are differentiated.
    pub(super) fn parameter(&self, value: f64) -> Option<ByParameter> {
        let vary = self.vary.clone()?;
        let (scene, tolerance) = (self.scene.clone(), self.tolerance);
        let scale = value.abs().max(1e-3 * (vary.to - vary.from).abs());
        // A central difference of fourth order.
        let (h, at) = (1e-3 * scale, |x: f64| vary.period(x).unwrap_or(0.0));
        let period = (8.0 * (at(value + h) - at(value - h)) - (at(value + 2.0 * h) - at(value - 2.0 * h))) / (12.0 * h);
        let parameter = Parameter::try_new(vary.name.clone(), scale, move |simulation, delta| {
            let changed = scene.with_values(&vary.values(value + delta))?.plan()?.simulation;
            let Simulation { stop, max_events, start_time, .. } = simulation;
            let (stop, max_events, start_time) = (stop.clone(), *max_events, *start_time);
            *simulation = Simulation { stop, max_events, start_time, tolerance, ..changed };
            Ok(())
        });
        Some(ByParameter { parameter, period })
    }
}

impl Vary {
    /// The values of the keys.
    fn values(&self, value: f64) -> Vec<(String, f64)> {
        if self.set.is_empty() && self.period.is_none() {
            return vec![(self.name.clone(), value)];
        }
        evaluated(&self.set, &[(&self.name, value)])
    }

    /// The period of the section, if it follows the parameter.
    fn period(&self, value: f64) -> Option<f64> {
        self.period.as_ref().map(|formula| formula.eval(&[value]).unwrap_or(f64::NAN))
    }
}

impl Grid {
    /// Whether all places have one simulation, and only the start differs.
    pub fn is_of_starts(&self) -> bool {
        self.set.is_empty() && self.axes.iter().all(|axis| matches!(axis.means, Means::State(_)))
    }

    /// Sets the numbers of a start that are those of a place.
    pub fn move_start(&self, place: [f64; 2], q: &mut [f64], qd: &mut [f64]) {
        for (axis, value) in self.axes.iter().zip(place) {
            match axis.means {
                Means::State(k) if k < q.len() => q[k] = value,
                Means::State(k) => qd[k - q.len()] = value,
                _ => {}
            }
        }
    }
}

fn section(keys: &SectionKeys, plan: &Plan) -> Result<Section, String> {
    let SectionKeys { contact, rising, falling, period } = keys;
    let given = [contact.is_some(), rising.is_some(), falling.is_some(), period.is_some()];
    if given.iter().filter(|given| **given).count() != 1 {
        return Err(
            "needs one of contact (an impact), rising or falling (a function that passes zero), period (a time)".into(),
        );
    }
    if let Some(name) = contact {
        let found = Touch::named(&plan.simulation.touches, name)?;
        return Ok(Section::Contact { name: name.clone(), touches: found });
    }
    if let Some(period) = period {
        if !(*period > 0.0 && period.is_finite()) {
            return Err(format!("period = {period}: it must be positive and finite"));
        }
        return Ok(Section::After(*period));
    }
    let (key, formula, sign) = match (rising, falling) {
        (Some(formula), _) => ("rising", formula, 1.0),
        (_, Some(formula)) => ("falling", formula, -1.0),
        _ => return Err("is empty".into()),
    };
    let mut function = LinearFunction::of(formula, &plan.simulation.chain).map_err(|why| format!("{key} = {why}"))?;
    function.constant *= sign;
    function.terms.iter_mut().for_each(|(_, c)| *c *= sign);
    Ok(Section::Rising { formula: format!("{key} {formula}"), function })
}

fn relabelled(chain: &Chain, joint: &str, formula: &str) -> Result<Relabelled, String> {
    let of_one =
        |joint: &str| chain.joints().iter().find(|own| own.name == joint).and_then(|own| chain.coordinate_of(own));
    let Some(own) = of_one(joint) else {
        return Err(format!("\"{formula}\": '{joint}' is no joint with one coordinate"));
    };
    let to = LinearFunction::of(formula, chain)?;
    let v_of = |q: usize| {
        chain.joints().iter().find_map(|joint| chain.coordinate_of(joint).filter(|at| at.q == q)).map(|at| at.v)
    };
    let rates = to.terms.iter().map(|(k, c)| Some((v_of(*k).filter(|_| *k < chain.nq())?, *c)));
    let rates = rates.collect::<Option<Vec<_>>>();
    let rates = rates.ok_or_else(|| format!("\"{formula}\" must be a function of joints with one coordinate"))?;
    Ok(Relabelled { q: own.q, v: own.v, to, rates })
}

fn vary(keys: &VaryKeys, section: &Section) -> Result<Vary, String> {
    let VaryKeys { parameter, from, to, set, points } = keys;
    if !(from.is_finite() && to.is_finite() && from != to) {
        return Err(format!("from = {from}, to = {to}: they must be finite and different"));
    }
    let points = points.unwrap_or(200);
    if points < 2 {
        return Err(format!("points = {points}: it must be 2 or more"));
    }
    let mut set = formulas(set, &[parameter])?;
    let period = set.iter().position(|(key, _)| key == "section.period").map(|k| set.remove(k).1);
    if period.is_some() && !matches!(section, Section::After(_)) {
        return Err("set.\"section.period\": the section is no period: remove it, or give [section] period".into());
    }
    Ok(Vary { name: parameter.clone(), from: *from, to: *to, points, set, period })
}

impl Problem {
    fn grid(&self, keys: &BasinKeys) -> Result<Grid, String> {
        let BasinKeys { x, y, set, cycles, periods, tolerance } = keys;
        let axes = [self.axis("x", x, set)?, self.axis("y", y, set)?];
        let names = [x.what.as_str(), y.what.as_str()];
        if names[0] == names[1] {
            return Err(format!("x.what and y.what are both \"{}\": give two", names[0]));
        }
        let at_least_one = |key: &str, given: Option<usize>, usual: usize| match given.unwrap_or(usual) {
            0 => Err(format!("{key} = 0: it must be 1 or more")),
            count => Ok(count),
        };
        let tolerance = tolerance.unwrap_or(1e-3);
        if !(tolerance > 0.0 && tolerance.is_finite()) {
            return Err(format!("tolerance = {tolerance}: it must be positive and finite"));
        }
        let (cycles, periods) = (at_least_one("cycles", *cycles, 200)?, at_least_one("periods", *periods, 8)?);
        Ok(Grid { axes, set: formulas(set, &names)?, cycles, periods, tolerance })
    }

    fn axis(&self, name: &str, keys: &AxisKeys, set: &BTreeMap<String, String>) -> Result<GridAxis, String> {
        let AxisKeys { what, from, to, points } = keys;
        let refuse = |why: String| format!("{name}.{why}");
        let chain = &self.scene.simulation.chain;
        // A variable in braces is one name, whatever its characters.
        let of_state = LinearFunction::of(&format!("{{{what}}}"), chain).ok().and_then(|it| it.terms.first().copied());
        let is_variable = |formula: &String| {
            FlatEx::<f64>::parse(formula).is_ok_and(|it| it.var_names().iter().any(|variable| variable == what))
        };
        let is_parameter = self.vary.as_ref().is_some_and(|vary| vary.name == *what);
        let (means, unit) = match of_state {
            _ if set.values().any(is_variable) => (Means::Variable, ""),
            Some(_) if is_parameter => {
                return Err(refuse(format!(
                    "what = \"{what}\": it is the parameter of [vary] and a variable of the state: rename the parameter"
                )));
            }
            Some((index, _)) => (Means::State(index), self.state_columns().get(index).map_or("", |column| column.unit)),
            None if is_parameter => (Means::Parameter, ""),
            None if what.contains(['.', '[']) => (Means::Key, ""),
            None => {
                let refused = LinearFunction::of(&format!("{{{what}}}"), chain).err().unwrap_or_default();
                let known = refused.split_once("': there are ").map_or("", |(_, known)| known);
                return Err(refuse(format!(
                    "what = \"{what}\": it is no variable of the state ({known}), not the parameter of [vary], no variable of \
                     basin.set, and no path of a key of the scene, as contact.restitution"
                )));
            }
        };
        let axis = Axis::range(what.clone(), unit, [*from, *to], *points).map_err(refuse)?;
        Ok(GridAxis { axis, means })
    }
}
