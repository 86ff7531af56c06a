//! Runs as linear maps.

use crate::array::{Array, Given, Maybe, Numbers, Rows, list, rows, together};
use crate::error::raise;
use carom_sim::ByOutcome;
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

    /// How many numbers the final displacement and velocity have.
    fn numbers(&self) -> usize {
        2 * self.run.last().qd.len()
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
    /// `names`, shape (columns,), or of a batch of B of them, shape (B, columns): then (B, 2 nv) and (B, events). Changes of times whose digits
    /// do not count are nan.
    ///
    /// Raises:
    ///     StateError: a wrong number of changes.
    fn jvp<'py>(&self, py: Python<'py>, change: Given) -> PyResult<(Array<'py>, Array<'py>)> {
        let layout = || "one for each of names".to_owned();
        let changes = Numbers::read("change", change)?.rows("change", self.columns.len(), layout)?;
        let (count, changes) = (changes.count(), changes.plain());
        let (mut last, mut times) = (Vec::new(), Vec::new());
        for k in 0..count.unwrap_or(1) {
            let mut whole = vec![0.0; self.run.names().len()];
            self.columns.iter().zip(changes.row(k)).for_each(|(&k, by)| whole[k] += by);
            let (own, at) = self.run.jvp(&whole).map_err(raise)?;
            last.extend(own);
            times.extend(at);
        }
        Ok((rows(py, last, count, self.numbers())?, rows(py, times, count, self.run.events().count())?))
    }

    /// The gradient of a number by the numbers of `names`, shape (columns,), from its derivatives by the final displacement and
    /// velocity, shape (2 nv,), and by the times of the events, shape (events,); of B numbers at once from (B, 2 nv) and (B, events), shape (B,
    /// columns).
    ///
    /// Raises:
    ///     StateError: a wrong number of derivatives.
    ///     SimulationError: a derivative by a time whose digits do not count.
    #[pyo3(signature = (last, times=None))]
    fn vjp<'py>(&self, py: Python<'py>, last: Given, times: Maybe) -> PyResult<Array<'py>> {
        let layout = || "by the final displacement, then by the final velocity".to_owned();
        let last = Numbers::read("last", last)?.rows("last", self.numbers(), layout)?;
        let events = self.run.events().count();
        let times = times
            .map(|times| Numbers::read("times", times)?.rows("times", events, || "one for each of events".to_owned()));
        let times = times.transpose()?;
        let count = together([("last", &last)].into_iter().chain(times.as_ref().map(|it| ("times", it))))?;
        let (last, times) = (last.plain(), times.as_ref().map(Rows::plain));
        let all: Vec<ByOutcome> = (0..count.unwrap_or(1))
            .map(|k| {
                let times = times.as_ref().map_or(&[][..], |times| times.row(k));
                let times = times.iter().copied().enumerate().filter(|(_, by)| *by != 0.0).collect();
                ByOutcome { last: last.row(k).to_vec(), times, ..ByOutcome::default() }
            })
            .collect();
        let gradients = self.run.gradients(&all).map_err(raise)?;
        let own = gradients.iter().flat_map(|gradient| self.columns.iter().map(|&k| gradient[k])).collect();
        rows(py, own, count, self.columns.len())
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
