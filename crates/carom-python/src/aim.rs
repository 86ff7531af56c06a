//! Aims: `carom.aim`.

use crate::array::{Array, count};
use crate::error::raise;
use crate::orbit::Given;
use crate::threads::left_behind;
use carom_study::aim::{AimError, Problem};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pythonize::pythonize;
use std::path::{Path, PathBuf};

/// Chooses numbers of a scene such that its motion meets conditions, at least cost.
///
/// Args:
///     problem: path of a problem file, or its keys as a dict; the page "Reach an aim" of the manual lists them.
///     starts: search so many times, each from the nearest to the aim of 20 random draws between the bounds, and keep the least cost; without
///         a cost the first that meets the conditions.
///     seed: of the random values of starts; by default 0.
///     folder: to which the file names in a dict are relative; by default the working folder.
///
/// Returns:
///     A dict with the JSON keys of ``carom aim --help``: unknowns, conditions, cost, events, steps, runs, differentiated, end, with ``starts`` also starts; and
///     scene, the text of a scene file with what was found, for the folder of the scene of the problem; and torques, the text of its table of
///     torques ``torques.csv``, or None.
///
/// Raises:
///     StudyError: a problem that cannot be read; a condition that is not met; a motion without an impact of a condition.
///     SimulationError: an invalid scene, or a first run that fails or has no derivative.
#[pyfunction]
#[pyo3(signature = (problem, *, starts=None, seed=None, folder=None))]
pub fn aim<'py>(
    py: Python<'py>,
    problem: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = count)] starts: Option<u64>,
    #[pyo3(from_py_with = count)] seed: Option<u64>,
    folder: Option<PathBuf>,
) -> PyResult<Array<'py>> {
    let given = Given::of(problem, folder)?;
    if seed.is_some() && starts.is_none() {
        return Err(PyValueError::new_err(
            "seed: one search begins at the first values and draws nothing: give starts, too",
        ));
    }
    let found = left_behind(py, move |stop| {
        let mut problem = match given {
            Given::File(path) => Problem::from_file(path)?,
            Given::Text(text, folder) => Problem::from_toml(&text, folder)?,
        };
        problem.stop_by(stop.clone());
        let (found, starts) = match starts {
            None => (problem.solve()?, None),
            Some(number) => {
                let (found, starts) = problem.solve_from_many(number, seed.unwrap_or(0), &|| {})?;
                (found, Some(starts))
            }
        };
        let folder = problem.scene().folder.clone();
        let (scene, torques) = problem.scene_of(&found, Path::new(&folder), "torques.csv")?;
        Ok::<_, AimError>((found, starts, scene, torques))
    })?;
    let (found, starts, scene, torques) = found.map_err(raise)?;
    let answer = pythonize(py, &found)?;
    if let Some(starts) = starts {
        answer.set_item("starts", pythonize(py, &starts)?)?;
    }
    answer.set_item("scene", scene)?;
    answer.set_item("torques", torques)?;
    Ok(answer)
}
