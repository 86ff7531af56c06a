//! Runs as linear maps.

use crate::array::{Array, Numbers, list};
use crate::error::{exceptions, raise};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// A run as a linear map, from changes of its start and parameters to those of its end and of the times of its events, and its transpose:
/// `jvp` and `vjp`. `Scene.linear_run` makes one.
#[pyclass(frozen, module = "carom")]
pub struct LinearRun {
    run: carom_sim::LinearRun,
    /// The numbers of `names` among those of the run.
    columns: Vec<usize>,
}

impl LinearRun {
    pub fn new(run: carom_sim::LinearRun, columns: Vec<usize>) -> Self {
        Self { run, columns }
    }
}

getters! { LinearRun, self, py {
    /// Names of the numbers by which the run is differentiated, as `Sensitivity.names`.
    names: Vec<&str> = self.columns.iter().map(|&k| self.run.names()[k].as_str()).collect();
} }

#[pymethods]
impl LinearRun {
    /// Time (s), q and qd at the end, of the joints that the plan keeps.
    #[getter]
    fn last<'py>(&self, py: Python<'py>) -> PyResult<(f64, Array<'py>, Array<'py>)> {
        let last = self.run.last();
        Ok((last.time, list(py, &last.q)?, list(py, &last.qd)?))
    }

    /// The times of the events (s), each with the names of what happens.
    #[getter]
    fn events(&self) -> Vec<(f64, Vec<&str>)> {
        self.run.events().map(|(time, kinds)| (time, kinds.to_vec())).collect()
    }

    /// The changes of the final displacement and velocity, shape (2 nv,), and of the times of the events, by a change of the numbers of
    /// `names`, shape (columns,). Changes of times whose digits do not count are nan.
    ///
    /// Raises:
    ///     StateError: a wrong number of changes.
    fn jvp<'py>(&self, py: Python<'py>, change: &Bound<'py, PyAny>) -> PyResult<(Array<'py>, Array<'py>)> {
        let change = Numbers::read("change", change)?;
        let (given, needed) = (change.slice().len(), self.columns.len());
        if given != needed {
            let message = format!("change has {given} numbers: give {needed}, one for each of names");
            return Err(exceptions::StateError::new_err(message));
        }
        let mut whole = vec![0.0; self.run.names().len()];
        self.columns.iter().zip(change.slice()).for_each(|(&k, by)| whole[k] += by);
        let (last, times) = self.run.jvp(&whole).map_err(raise)?;
        Ok((list(py, &last)?, list(py, &times)?))
    }

    /// The gradient of a number by the numbers of `names`, shape (columns,), from its derivatives by the final displacement and
    /// velocity, shape (2 nv,), and by the times of the events, shape (events,).
    ///
    /// Raises:
    ///     SimulationError: a wrong number of derivatives, one by a time whose digits do not count.
    #[pyo3(signature = (last, times=None))]
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        last: &Bound<'py, PyAny>,
        times: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Array<'py>> {
        let last = Numbers::read("last", last)?;
        let times = times.map(|times| Numbers::read("times", times)).transpose()?;
        let times = times.as_ref().map_or(&[][..], Numbers::slice);
        let gradient = self.run.vjp(last.slice(), times).map_err(raise)?;
        list(py, &self.columns.iter().map(|&k| gradient[k]).collect::<Vec<_>>())
    }

    fn __reduce__(&self) -> PyResult<Py<PyAny>> {
        Err(PyTypeError::new_err(
            "a carom.LinearRun cannot be copied or pickled: make another one by linear_run of the scene",
        ))
    }

    fn __repr__(&self) -> String {
        format!("<carom.LinearRun by {} numbers, {} events>", self.columns.len(), self.run.events().count())
    }
}
