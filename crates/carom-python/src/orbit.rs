//! Periodic orbits: `carom.orbit`, `carom.cycles`.

use crate::array::{Array, array};
use crate::error::raise;
use crate::text::toml_text;
use crate::threads::left_behind;
use carom_study::orbit::{OrbitError, Problem, State};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use pythonize::pythonize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A problem as it is given.
pub(crate) enum Given {
    File(PathBuf),
    Text(String, PathBuf),
}

impl Given {
    pub(crate) fn of(problem: &Bound<'_, PyAny>, folder: PathBuf) -> PyResult<Self> {
        if problem.is_instance_of::<PyMapping>() {
            return Ok(Self::Text(toml_text(problem)?, folder));
        }
        match problem.extract::<PathBuf>() {
            Ok(path) => Ok(Self::File(path)),
            Err(_) => Err(PyTypeError::new_err("problem is neither a path nor a dict")),
        }
    }

    fn read(self, stop: &Arc<AtomicBool>) -> Result<Problem, OrbitError> {
        let mut problem = match self {
            Self::File(path) => Problem::from_file(path)?,
            Self::Text(text, folder) => Problem::from_toml(&text, folder)?,
        };
        problem.scene.simulation.stop = Some(stop.clone());
        Ok(problem)
    }
}

/// Finds a periodic orbit of a scene, and follows it over a parameter.
///
/// Args:
///     problem: path of a problem file, or its keys as a dict; the page "Find periodic orbits" of the manual lists them.
///     branch: follow the orbit over the parameter of ``vary``.
///     folder: to which the file names in a dict are relative.
///
/// Returns:
///     A dict with the JSON keys of ``carom orbit --help``: start (q and qd, on the section), period (s), events, multipliers (complex
///     numbers as pairs), stability, residual, iterations. With ``branch`` of parameter, points (a list of such dicts, each with its
///     parameter), special (folds, flips, Neimark-Sacker points, changes of the events) and end (why the branch ends).
///
/// Raises:
///     StudyError: a problem that cannot be read; a motion that does not return to the section; no orbit near the start.
///     SimulationError: an invalid scene, or a run that fails.
#[pyfunction]
#[pyo3(signature = (problem, *, branch=false, folder=PathBuf::from(".")))]
pub fn orbit<'py>(py: Python<'py>, problem: &Bound<'py, PyAny>, branch: bool, folder: PathBuf) -> PyResult<Array<'py>> {
    let given = Given::of(problem, folder)?;
    if branch {
        let found = left_behind(py, move |stop| given.read(stop)?.branch())?;
        return Ok(pythonize(py, &found.map_err(raise)?)?);
    }
    let found = left_behind(py, move |stop| given.read(stop)?.find())?;
    Ok(pythonize(py, &found.map_err(raise)?)?)
}

/// The states on the section that follow one another, by runs alone: a second route to an orbit, and bifurcation diagrams.
///
/// Args:
///     problem: as for ``carom.orbit``.
///     cycles: number of states.
///     skip: number of cycles before the first of them.
///     value: of the parameter of ``vary``; by default its first value.
///     start: (q, qd); by default that of the scene.
///     folder: to which the file names in a dict are relative.
///
/// Returns:
///     A dict of q and qd, arrays of shape (cycles, nq) and (cycles, nv).
///
/// Raises:
///     StudyError: as ``carom.orbit``.
///     SimulationError: as ``carom.orbit``.
#[pyfunction]
#[pyo3(signature = (problem, cycles, *, skip=0, value=None, start=None, folder=PathBuf::from(".")))]
pub fn cycles<'py>(
    py: Python<'py>,
    problem: &Bound<'py, PyAny>,
    cycles: usize,
    skip: usize,
    value: Option<f64>,
    start: Option<(Vec<f64>, Vec<f64>)>,
    folder: PathBuf,
) -> PyResult<Bound<'py, PyDict>> {
    let given = Given::of(problem, folder)?;
    let start = start.map(|(q, qd)| State { q, qd });
    let found = left_behind(py, move |stop| {
        let problem = given.read(stop)?;
        let own = State { q: problem.scene.q.clone(), qd: problem.scene.qd.clone() };
        let value = value.or(problem.range().map(|[from, _]| from)).unwrap_or(0.0);
        problem.cycle(value, start.unwrap_or(own))?.skip(skip).take(cycles).collect::<Result<Vec<State>, OrbitError>>()
    })?;
    let found = found.map_err(raise)?;
    let rows = |of: fn(&State) -> &Vec<f64>| {
        let width = found.first().map_or(0, |state| of(state).len());
        array(py, found.iter().flat_map(of).copied().collect(), &[found.len(), width])
    };
    Ok(dict! { py, "q": rows(|it| &it.q)?, "qd": rows(|it| &it.qd)? })
}
