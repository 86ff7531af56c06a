//! Reads a problem file: the scene, the section, and what is asked. The book documents the keys: `book/src/task-orbits.md`.

use super::OrbitError;
use super::problem::{Grid, GridAxis, Means, Problem, Relabelled, Section, Vary};
use crate::map_study::Axis;
use crate::problem_file::{self, formulas};
use carom_chain::Chain;
use carom_sim::{Drive, Formula, LinearFunction, Plan, Touch};
use serde::Deserialize;
use std::collections::BTreeMap;
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

impl Problem {
    /// Reads a problem file and its scene.
    ///
    /// # Errors
    /// [`OrbitError::File`] with key, value and rule; [`OrbitError::Run`] for an invalid scene.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, OrbitError> {
        problem_file::read(path.as_ref(), |file, rule| OrbitError::File { file, rule }, Self::read, |it| &mut it.files)
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
        let tolerance = "orbits are integrated to the tolerance of [orbit]: give it there";
        let idle = ["run.tolerance", "run.accuracy"].map(|key| (key, tolerance));
        let scene = problem_file::scene(folder, &file.scene, &file.with, &idle)?;
        let plan = scene.plan()?;
        if plan.simulation.stepping {
            return Err(refuse("scene: its [run] has method = \"steps\", and orbits need events: remove it".into()));
        }
        let of_robot = |drive: &Drive| match drive {
            Drive::Robots(all) => all.iter().any(|own| own.after_impact.is_some()),
            _ => false,
        };
        if plan.simulation.after_impact.is_some() || of_robot(&plan.simulation.drive) {
            let why = "scene: its after_impact is for the first impact of a motion, and an orbit has no first one: remove it, and give the \
                       controller that acts in each period";
            return Err(refuse(why.into()));
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
        let varied = file.vary.iter().flat_map(|keys| keys.set.keys().chain([&keys.parameter]));
        let axes = file.basin.iter().flat_map(|keys| keys.set.keys().chain([&keys.x.what, &keys.y.what]));
        let changed: Vec<&String> = varied.chain(axes).collect();
        if let Some(path) = problem_file::given_twice(&file.with, changed.iter().copied()) {
            let why = "[vary] or [basin] replaces this number at each value: remove it here or there";
            return Err(refuse(format!("with: {path}: {why}")));
        }
        let is_duration = file.with.keys().chain(changed).any(|path| path == "run.duration");
        if matches!(section, Section::After(_)) && is_duration {
            let why = "run.duration: a passage lasts as long as the period of [section], whatever the duration: remove it, or give section.period";
            return Err(refuse(why.into()));
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
            doubled: false,
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
            let first = [0, 1].map(|k| grid.axes[k].axis.value(0));
            problem.plan_in(grid, first).map_err(|e| refuse(format!("[basin] at its first values: {e}")))?;
            problem.check_axes(grid)?;
        }
        if let Some(vary) = &problem.vary {
            // A key that leads nowhere, or a value that the scene refuses, is told now.
            for value in [vary.from, vary.to] {
                problem.plan(Some(value)).map_err(|e| refuse(format!("[vary] {} = {value}: {e}", vary.name)))?;
            }
        }
        Ok(problem)
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
    if function.terms.iter().all(|(_, coefficient)| *coefficient == 0.0) {
        return Err(format!("{key} = \"{formula}\" does not depend on the state: it never passes zero"));
    }
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
    let idle = |path: &String| path == "run.duration" || problem_file::is_of_start(path);
    if set.is_empty() && idle(parameter) || !set.is_empty() && set.keys().all(idle) {
        let path = set.keys().next().unwrap_or(parameter);
        return Err(format!(
            "{path}: the start and the duration are no part of an orbit, which is looked for near the start: vary another number"
        ));
    }
    if !set.is_empty() && problem_file::is_path(parameter) {
        return Err(format!(
            "parameter = \"{parameter}\": with set it is the name of a variable, and no key of the scene: choose a name, and give set.\"{parameter}\", \
             too"
        ));
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
        let is_variable =
            |formula: &String| Formula::of(formula, &[]).is_ok_and(|it| it.names().iter().any(|name| name == what));
        let is_parameter = self.vary.as_ref().is_some_and(|vary| vary.name == *what);
        let (means, unit) = match of_state {
            _ if set.values().any(is_variable) && problem_file::is_path(what) => {
                return Err(refuse(format!(
                    "what = \"{what}\": set has it as a variable, and it would be no key of the scene: choose a name, and give set.\"{what}\", too"
                )));
            }
            _ if set.values().any(is_variable) => (Means::Variable, ""),
            Some(_) if is_parameter => {
                return Err(refuse(format!(
                    "what = \"{what}\": it is the parameter of [vary] and a variable of the state: rename the parameter"
                )));
            }
            Some((index, _)) => (Means::State(index), self.state_columns().get(index).map_or("", |column| column.unit)),
            None if is_parameter => (Means::Parameter, ""),
            None if problem_file::is_path(what) => (Means::Key, ""),
            None => {
                let refused = LinearFunction::of(&format!("{{{what}}}"), chain).err().unwrap_or_default();
                let known = refused.split_once("': there are ").map_or("", |(_, known)| known);
                return Err(refuse(format!(
                    "what = \"{what}\": it is no variable of the state ({known}), not the parameter of [vary], no variable of \
                     basin.set, and no path of a key of the scene, as contact.restitution"
                )));
            }
        };
        if *points < 2 {
            return Err(refuse(format!(
                "points = {points}: it must be 2 or more; a number that stays is one of with, or of the start of the scene"
            )));
        }
        let axis = Axis::range(what.clone(), unit, [*from, *to], *points).map_err(refuse)?;
        Ok(GridAxis { axis, means })
    }
}
