//! Periodic orbits: `carom.orbit`, `carom.cycles`, `carom.basin`.

use crate::array::{Array, array, count};
use crate::error::{raise, warn};
use crate::text::toml_text;
use crate::threads::{left_behind, on_all_cores};
use carom_study::orbit::{OrbitError, Problem, State};
use carom_study::{NumberedRows, RowFile, write_whole};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use pythonize::pythonize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A problem as it is given.
pub(crate) enum Given {
    File(PathBuf),
    Text(String, PathBuf),
}

impl Given {
    /// `folder`: that of the file names in a dict, by default the working folder.
    pub(crate) fn of(problem: &Bound<'_, PyAny>, folder: Option<PathBuf>) -> PyResult<Self> {
        if problem.is_instance_of::<PyMapping>() {
            return Ok(Self::Text(toml_text(problem)?, folder.unwrap_or_else(|| ".".into())));
        }
        match problem.extract::<PathBuf>() {
            Ok(_) if folder.is_some() => Err(PyValueError::new_err(
                "folder: it is for the file names in a dict; those in a problem file are relative to the folder of this file: leave it out",
            )),
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
///     doubled: with ``branch``: follow also the orbits of twice the period that begin at the first flip, so many times in turn.
///     folder: to which the file names in a dict are relative; by default the working folder.
///
/// Returns:
///     A dict with the JSON keys of ``carom orbit --help``: start (q and qd, on the section), start_time and period (s), events, multipliers (complex
///     numbers as pairs), stability, residual, iterations. With ``branch`` of parameter, points (a list of such dicts, each with its
///     parameter), passages (of the section in one period), special (folds, flips, Neimark-Sacker points, changes of the events, moves of the section), ended and
///     end (why the branch ends, in a word and in a sentence), and with ``doubled`` doubled (a list of such dicts).
///
/// Raises:
///     StudyError: a problem that cannot be read; a motion that does not return to the section; no orbit near the start. A branch without
///         a flip, at which doubled ones begin, is a warning.
///     SimulationError: an invalid scene, or a run that fails.
#[pyfunction]
#[pyo3(signature = (problem, *, branch=false, doubled=0, folder=None))]
pub fn orbit<'py>(
    py: Python<'py>,
    problem: &Bound<'py, PyAny>,
    branch: bool,
    #[pyo3(from_py_with = count)] doubled: u8,
    folder: Option<PathBuf>,
) -> PyResult<Array<'py>> {
    let given = Given::of(problem, folder)?;
    if doubled > 0 && !branch {
        return Err(PyValueError::new_err(
            "doubled: orbits of twice the period begin on a branch: give branch=True, too",
        ));
    }
    if branch {
        let found = left_behind(py, move |stop| given.read(stop)?.branches(doubled))?;
        let (branch, all, fewer) = found.map_err(raise)?;
        if let Some(why) = fewer {
            warn(py, format!("doubled = {doubled}: {why}"))?;
        }
        let found = pythonize(py, &branch)?;
        if doubled > 0 {
            found.set_item("doubled", pythonize(py, &all)?)?;
        }
        return Ok(found);
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
///     start: (q, qd), at the time at which the scene starts; by default that of the scene.
///     folder: to which the file names in a dict are relative; by default the working folder.
///
/// Returns:
///     A dict of q and qd, arrays of shape (cycles, nq) and (cycles, nv).
///
/// Raises:
///     StudyError: as ``carom.orbit``.
///     SimulationError: as ``carom.orbit``.
#[pyfunction]
#[pyo3(signature = (problem, cycles, *, skip=0, value=None, start=None, folder=None))]
pub fn cycles<'py>(
    py: Python<'py>,
    problem: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = count)] cycles: usize,
    #[pyo3(from_py_with = count)] skip: usize,
    value: Option<f64>,
    start: Option<(Vec<f64>, Vec<f64>)>,
    folder: Option<PathBuf>,
) -> PyResult<Bound<'py, PyDict>> {
    let given = Given::of(problem, folder)?;
    if cycles == 0 {
        return Err(PyValueError::new_err("cycles = 0: give 1 or more"));
    }
    let start = start.map(|(q, qd)| State { q, qd });
    let found = left_behind(py, move |stop| {
        let problem = given.read(stop)?;
        let own = State { q: problem.scene.q.clone(), qd: problem.scene.qd.clone() };
        if value.is_some() && problem.range().is_none() {
            let rule = "the problem has no [vary], whose parameter it would be: leave it out".into();
            return Err(OrbitError::File { file: "value".into(), rule });
        }
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

/// Tells the attractor of each start of the grid of ``basin``, into a file, in constant memory and on all cores. Ctrl-C or a full disk leaves a
/// partial file, from which resume=True continues.
///
/// Args:
///     problem: as for ``carom.orbit``.
///     out: the table, X.csv or X.parquet: a row for each start.
///     resume: continue from the partial file of an interrupted run, if there is one.
///     svg: a file for a picture, or None.
///     folder: to which the file names in a dict are relative; by default the working folder.
///
/// Returns:
///     A dict of rows, computed (rows that this run has computed), outcomes (a dict of words and numbers of cells) and attractors, a list of
///     dicts of period (cycles), state (q and qd, rounded) and cells.
///
/// Raises:
///     StudyError: as ``carom.orbit``; a file that cannot be written; a partial file that cannot be continued.
///     SimulationError: as ``carom.orbit``.
#[pyfunction]
#[pyo3(signature = (problem, out, *, resume=false, svg=None, folder=None))]
pub fn basin<'py>(
    py: Python<'py>,
    problem: &Bound<'py, PyAny>,
    out: PathBuf,
    resume: bool,
    svg: Option<PathBuf>,
    folder: Option<PathBuf>,
) -> PyResult<Bound<'py, PyDict>> {
    let given = Given::of(problem, folder)?;
    let problem = py.detach(|| given.read(&Arc::new(AtomicBool::new(false)))).map_err(raise)?;
    let basin = problem.basin().map_err(raise)?;
    let file = RowFile { path: out, rows: 0..basin.rows(), resume };
    on_all_cores(py, |stop| basin.write(&file, &|_| {}, stop))?.map_err(raise)?;
    if let Some(path) = svg {
        let text = on_all_cores(py, |stop| basin.picture(&|_| {}, stop))?.map_err(raise)?.unwrap_or_default();
        write_whole(&path, text.as_bytes())?;
    }
    let outcomes = basin.outcomes();
    Ok(dict! { py,
        "rows": basin.rows(),
        "computed": outcomes.iter().map(|(_, cells)| cells).sum::<u64>(),
        "outcomes": outcomes.into_iter().collect::<BTreeMap<_, _>>(),
        "attractors": pythonize(py, &basin.attractors())?,
    })
}
