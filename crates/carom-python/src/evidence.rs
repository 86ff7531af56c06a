//! Comparisons of laws and of methods: `carom.compare`, `carom.tosses`, `carom.chart`.

use crate::array::{Array, Given, count};
use crate::error::{exceptions, raise};
use crate::fit::{measured, word_of};
use crate::laws::GivenLaw;
use crate::scene::Scene;
use crate::threads::{halt, left_behind};
use carom_chain::urdf::LoadOptions;
use carom_evidence::chart::{Chart, StiffnessChart};
use carom_evidence::compare::{CompareOptions, Comparison, DataSet, compare, data_sets, markdown, svg};
use carom_sim::ContactRule;
use carom_study::{Horizon, RollOutOptions, Start, Tosses};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::pythonize;
use std::path::PathBuf;
use std::time::Duration;

/// Options of a comparison as keywords.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Options {
    #[pyo3(from_py_with = count)]
    folds: usize,
    #[pyo3(from_py_with = count)]
    seed: u64,
    max_friction: f64,
    #[pyo3(from_py_with = count)]
    trials: usize,
    #[pyo3(from_py_with = count)]
    fitted: usize,
    horizon: String,
    judge: String,
    tolerance: f64,
    contact_step: f64,
    length: f64,
}

impl Options {
    fn all(self) -> PyResult<CompareOptions> {
        let Self { folds, seed, max_friction, trials, fitted: tosses, tolerance, contact_step, length, .. } = self;
        let part = |what, word: &str| word_of(what, word, &Horizon::ALL, Horizon::name);
        let (horizon, judged) = (part("horizon", &self.horizon)?, part("judge", &self.judge)?);
        Ok(CompareOptions {
            folds,
            seed,
            max_friction,
            trials,
            tosses,
            horizon,
            judged,
            tolerance,
            contact_step,
            length,
        })
    }
}

/// Compares all laws on measured data: see `carom.compare`.
#[pyfunction]
#[pyo3(name = "compare")]
pub fn compare_laws<'py>(
    py: Python<'py>,
    name: String,
    data: &Bound<'_, PyDict>,
    paths: Vec<PathBuf>,
    options: &Bound<'_, PyDict>,
) -> PyResult<Bound<'py, PyDict>> {
    let options: CompareOptions = options.extract::<Options>()?.all()?;
    let own = if data.is_empty() { None } else { Some(measured(data)?.0) };
    let (folds, seed) = (options.folds, options.seed);
    let compared = left_behind(py, move |stop| {
        let mut sets = Vec::new();
        if let Some(impacts) = own {
            sets.push(DataSet::of_impacts(name, (0..impacts.len() as i64).collect(), impacts));
        }
        for path in paths {
            sets.extend(data_sets(&path, &LoadOptions::default())?);
        }
        let one = |set: &DataSet| -> Result<_, carom_evidence::EvidenceError> {
            let all = compare(set, &options, &|_, _| halt(stop))?;
            let (page, picture) = (markdown(&all), svg(&all)?);
            Ok((set.name.clone(), all, page, picture))
        };
        sets.iter().map(one).collect::<Result<Vec<_>, _>>()
    })?;
    let compared = compared.map_err(|e| exceptions::FitError::new_err(e.to_string()))?;
    let (pictures, mut page) = (PyDict::new(py), String::new());
    let mut comparisons: Vec<Comparison> = Vec::new();
    for (set, all, own, picture) in compared {
        pictures.set_item(set, picture)?;
        page += &own;
        comparisons.extend(all);
    }
    let comparisons: Array = pythonize(py, &comparisons)?;
    Ok(dict! { py, "seed": seed, "folds": folds, "comparisons": comparisons, "markdown": page, "svg": pictures })
}

/// Simulates measured tosses, and compares the poses.
///
/// Args:
///     folder: with tosses.csv and a URDF, as for `carom tosses`.
///     law: the impact law of all contacts, such as carom.Whittaker(0.0, 0.3).
///     robot: name of the URDF; by default the only one.
///     start: "fitted" to the flight before the first impact, or "given" by the first free sample.
///     length: L of the pose error, m: mean |Δp|²/L + mean Δθ² over the samples.
///     tolerance: of the integration, relative.
///     contact_step: length of a time step, where time steps are computed, s.
///
/// Returns:
///     A dict of tosses, failures, start, fitted_starts, at_rest, deepest_overlap (m), last and mean (errors of position (m), rotation and
///     joint (rad): mean and median over the tosses), whole and early (pose error: count, mean, median, below_half), each (a list of dicts).
///
/// Raises:
///     FitError: a folder that cannot be read, or none of whose tosses can be simulated; an option out of its range.
#[pyfunction]
#[pyo3(signature = (folder, law, *, robot=None, start="fitted", length=0.0524, tolerance=1e-9, contact_step=5e-4))]
pub fn tosses<'py>(
    py: Python<'py>,
    folder: PathBuf,
    law: Given<'_, 'py>,
    robot: Option<String>,
    start: &str,
    length: f64,
    tolerance: f64,
    contact_step: f64,
) -> PyResult<Array<'py>> {
    let law = GivenLaw::read(law)?;
    for (what, x) in [("length", length), ("tolerance", tolerance), ("contact_step", contact_step)] {
        if !(x > 0.0 && x.is_finite()) {
            return Err(exceptions::FitError::new_err(format!("{what} is {x}: it must be positive and finite")));
        }
    }
    let start = word_of("start", start, &Start::ALL, Start::name)?;
    let roll = RollOutOptions { tolerance, contact_step, length, start, ..RollOutOptions::default() };
    let rule = ContactRule::new(law.of_contact());
    let report = left_behind(py, move |_| {
        Tosses::read(&folder, robot.as_deref(), &LoadOptions::default())?.report(&rule, &roll)
    })?;
    if let Some(raised) = law.raised() {
        return Err(raised);
    }
    Ok(pythonize(py, &report.map_err(raise)?)?)
}

/// The error of every method that can run a scene, against its run time: event-driven integrators over their tolerance, time steps over
/// their length, compliant contacts over their stiffness.
///
/// Args:
///     scene: a Scene.
///     budget: longest run time of a single run, s.
///     stiffness: instead, the errors of the scene's compliant contacts against rigid ones, over a factor of all stiffnesses.
///     title: of the picture; by default the name of the robot.
///
/// Returns:
///     A dict of law, runs (method, law, knob, value, wall_time (s), after_impact, at_end, estimated_at_end), absent (method, reason),
///     doubt_after_impact and doubt_at_end (errors of the reference solution), csv and svg (texts); with stiffness of runs (factor,
///     after_impact, at_end), order_after_impact, order_at_end, theory, csv, svg.
///
/// Raises:
///     SimulationError: of the reference solution.
///     ValueError: a budget that is not positive, a scene with laws or a controller in Python; `stiffness` of a scene without compliant
///         contacts.
#[pyfunction]
#[pyo3(signature = (scene, *, budget=10.0, stiffness=false, title=None))]
pub fn chart(scene: &Bound<Scene>, budget: f64, stiffness: bool, title: Option<String>) -> PyResult<Py<PyDict>> {
    let (py, scene) = (scene.py(), scene.get());
    if !scene.functions.is_empty() {
        return Err(PyValueError::new_err("a scene with laws or a controller in Python has no chart: leave them out"));
    }
    let Some(budget) = Duration::try_from_secs_f64(budget).ok().filter(|budget| !budget.is_zero()) else {
        return Err(PyValueError::new_err(format!("budget is {budget}: give a number of seconds above 0")));
    };
    let title = title.unwrap_or_else(|| scene.scene.simulation.chain.name().to_owned());
    let scene = scene.scene.clone();
    let (found, csv, svg) = if stiffness {
        let chart = left_behind(py, move |stop| StiffnessChart::of(&scene, budget, &mut || halt(stop)))?;
        let chart = chart.map_err(raise)?.ok_or_else(|| {
            PyValueError::new_err(
                "the scene has no compliant contact: give [contact], a surface or a pair the key compliance",
            )
        })?;
        (pythonize(py, &chart)?, chart.csv(), chart.svg(&title))
    } else {
        let chart = left_behind(py, move |stop| Chart::of(&scene, budget, &mut |_| halt(stop)))?.map_err(raise)?;
        (pythonize(py, &chart)?, chart.csv(), chart.svg(&title))
    };
    let found: Bound<'_, PyDict> = found.cast_into()?;
    found.set_item("csv", csv)?;
    found.set_item("svg", svg)?;
    Ok(found.unbind())
}
