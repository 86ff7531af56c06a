//! Derivatives of whole runs.

use crate::array::{Array, array, list};
use crate::pickle::{Parts, Pickled, tuple};
use crate::run::RunEvent;
use carom_sim::{Parameter, Plan, Sampling, Seen, SimError};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyList;
use pythonize::pythonize;

/// The derivatives of a whole run: of its final state and of the times of its events. `Scene.sensitivity` makes one.
///
/// The columns are the numbers of the start (a displacement of q, then qd) and the parameters, in the order of `names`.
#[pyclass(frozen, module = "carom")]
pub struct Sensitivity {
    found: carom_sim::Sensitivity,
    /// The events of the run.
    happened: Vec<Py<RunEvent>>,
}

/// By its numbers and its events.
impl Pickled for Sensitivity {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let events: Vec<Array> = self.happened.iter().map(|event| event.get().write(py)).collect::<PyResult<_>>()?;
        tuple(py, [self.found.write(py)?, PyList::new(py, events)?.into_any()])
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut parts = Parts::of(from)?;
        let (found, events): (carom_sim::Sensitivity, Vec<RunEvent>) = (parts.next()?, parts.next()?);
        Self::new(from.py(), found, events)
    }
}

impl Sensitivity {
    pub fn new(py: Python<'_>, found: carom_sim::Sensitivity, events: Vec<RunEvent>) -> PyResult<Self> {
        let happened = events.into_iter().map(|event| Py::new(py, event)).collect::<PyResult<_>>()?;
        Ok(Self { found, happened })
    }
}

/// The parameters of these names, all if no names are given.
pub fn chosen(plan: &Plan, names: Option<Vec<String>>) -> PyResult<Vec<Parameter>> {
    let all = Parameter::all(&plan.simulation);
    let Some(names) = names else { return Ok(all) };
    let one = |name: &String| {
        all.iter().find(|parameter| parameter.name() == name).cloned().ok_or_else(|| {
            let known: Vec<&str> = all.iter().map(Parameter::name).collect();
            let known = if known.is_empty() { "it has none".into() } else { format!("they are {}", known.join(", ")) };
            PyValueError::new_err(format!("'{name}' is no parameter of the scene: {known}"))
        })
    };
    names.iter().map(one).collect()
}

/// The derivatives of a planned run, and its events.
pub fn of(
    plan: &Plan,
    duration: f64,
    parameters: &[Parameter],
) -> Result<(carom_sim::Sensitivity, Vec<RunEvent>), SimError> {
    let found = plan.sensitivity(duration, parameters)?;
    let mut events = Vec::new();
    plan.stream(duration, Sampling::default(), &mut |seen| {
        if let Seen::Event(event) = seen {
            events.push(RunEvent::of(&plan.simulation, event.clone()).with_derivatives(&found.events));
        }
    })?;
    Ok((found, events))
}

getters! { Sensitivity, self, py {
    /// Names of the columns: "q shoulder", "qd shoulder", "restitution", "kp elbow"; of a joint with several coordinates with a
    /// number, "q base 3". The first 2 nv are also the names of the rows of `last_by`.
    names: Vec<&str> = self.found.names.iter().map(String::as_str).collect();
    /// Where and why the derivatives end: a dict of time (s) and reason; None if they reach the end.
    broken: Option<Bound<'py, PyAny>>, "dict[str, Any] | None" = self.found.broken.as_ref().map(|broken| pythonize(py, broken)).transpose()?;
} }

#[pymethods]
impl Sensitivity {
    /// Time (s), q and qd at the end, of the joints that the plan keeps.
    #[getter]
    fn last<'py>(&self, py: Python<'py>) -> PyResult<(f64, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let last = &self.found.last;
        let numbers = |x: &[f64]| list(py, x);
        Ok((last.time, numbers(&last.q)?, numbers(&last.qd)?))
    }

    /// Derivatives of the final displacement and velocity, shape (2 nv, columns); of a floating joint the displacement is along
    /// and about the axes of its link. None if the derivatives end before.
    #[getter]
    fn last_by<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let by = self.found.last_by.as_ref();
        by.map(|by| array(py, by.transpose().as_slice().to_vec(), &[by.nrows(), by.ncols()])).transpose()
    }

    /// The events of the run in the order of time, a list of Event, with the derivatives of their times: `Event.time_by`.
    #[getter]
    fn events(&self, py: Python<'_>) -> Vec<Py<RunEvent>> {
        self.happened.iter().map(|event| event.clone_ref(py)).collect()
    }

    fn __repr__(&self) -> String {
        let (columns, events) = (self.found.names.len(), self.happened.len());
        match &self.found.broken {
            None => format!("<carom.Sensitivity by {columns} numbers, {events} events>"),
            Some(broken) => format!("<carom.Sensitivity by {columns} numbers until {} s>", broken.time),
        }
    }
}
