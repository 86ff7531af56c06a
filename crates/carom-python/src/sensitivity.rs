//! Derivatives of whole runs.

use crate::array::{Array, list};
use crate::impact::matrix;
use crate::pickle::{Parts, Pickled, tuple};
use crate::run::RunEvent;
use crate::scene::Scene;
use carom_sim::{Columns, Parameter, Plan, Sampling, Seen, SimError};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString};
use pythonize::pythonize;

/// The derivatives of a whole run: of its final state and of the times of its events. `Scene.sensitivity` makes one.
///
/// The columns are numbers of the start (a displacement of q, qd) and parameters, in the order of `names`.
#[pyclass(frozen, module = "carom")]
pub struct Sensitivity {
    found: carom_sim::Sensitivity,
    /// Names of the rows of `last_by`.
    rows: Vec<String>,
    /// The events of the run.
    happened: Vec<Py<RunEvent>>,
}

/// By its numbers and its events.
impl Pickled for Sensitivity {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let events: Vec<Array> = self.happened.iter().map(|event| event.get().write(py)).collect::<PyResult<_>>()?;
        tuple(py, [self.found.write(py)?, self.rows.write(py)?, PyList::new(py, events)?.into_any()])
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut parts = Parts::of(from)?;
        let (found, rows): (carom_sim::Sensitivity, Vec<String>) = (parts.next()?, parts.next()?);
        Self::new(from.py(), (found, rows), parts.next()?)
    }
}

impl Sensitivity {
    pub fn new(
        py: Python<'_>,
        (found, rows): (carom_sim::Sensitivity, Vec<String>),
        events: Vec<RunEvent>,
    ) -> PyResult<Self> {
        let happened = events.into_iter().map(|event| Py::new(py, event)).collect::<PyResult<_>>()?;
        Ok(Self { found, rows, happened })
    }
}

/// The names of `wrt`.
pub fn names(wrt: &Bound<'_, PyAny>) -> PyResult<Option<Vec<String>>> {
    if let Ok(text) = wrt.cast::<PyString>() {
        return Err(PyTypeError::new_err(format!("wrt is the text '{text}': give a list of names, [\"{text}\"]")));
    }
    wrt.extract()
}

/// What these names mean, all but the keys of the scene if there are no names.
pub fn chosen(py: Python<'_>, scene: &Scene, plan: &Plan, wrt: Option<Vec<String>>) -> PyResult<Columns> {
    let Some(wrt) = wrt else { return Ok(Columns::all(plan)) };
    Columns::of(plan, &wrt, |path| of_key(py, scene, path), PyValueError::new_err)
}

/// The number at the path of a key as a parameter, of the scene with its functions.
fn of_key(py: Python<'_>, scene: &Scene, path: &str) -> PyResult<Parameter> {
    scene.with_number(py, path, 0.0)?;
    let own = scene.clone();
    let with_number = move |_: &carom_sim::Scene, path: &str, change: f64| {
        let refused = |rule: String| SimError::Scene { file: path.to_owned(), rule };
        let changed = Python::try_attach(|py| {
            let (size, changed) = own.with_number(py, path, change).map_err(|e| refused(e.value(py).to_string()))?;
            Ok((size, carom_sim::Scene::clone(&changed.scene)))
        });
        changed.unwrap_or_else(|| Err(refused("the interpreter is shutting down".into())))
    };
    scene.scene.parameter_by(path, with_number).map_err(|e| PyValueError::new_err(e.to_string()))
}

/// The derivatives of a planned run by these quantities, and its events.
pub fn of(plan: &Plan, duration: f64, chosen: &Columns) -> Result<(carom_sim::Sensitivity, Vec<RunEvent>), SimError> {
    let found = chosen.of_all(plan.sensitivity(duration, &chosen.parameters)?);
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
    /// number, "q base 3".
    names: Vec<&str> = self.found.names.iter().map(String::as_str).collect();
    /// Names of the rows of `last_by`: "q shoulder", "qd shoulder".
    rows: Vec<&str> = self.rows.iter().map(String::as_str).collect();
    /// Where and why the derivatives end: a dict of time (s) and reason; None if they reach the end.
    broken: Option<Bound<'py, PyAny>>, "dict[str, Any] | None" = self.found.broken.as_ref().map(|broken| pythonize(py, broken)).transpose()?;
} }

#[pymethods]
impl Sensitivity {
    /// Time (s), q and qd at the end, of the joints that the plan keeps.
    #[getter]
    fn last<'py>(&self, py: Python<'py>) -> PyResult<(f64, Array<'py>, Array<'py>)> {
        let last = &self.found.last;
        Ok((last.time, list(py, &last.q)?, list(py, &last.qd)?))
    }

    /// Derivatives of the final displacement and velocity, shape (2 nv, columns); of a floating joint the displacement is along
    /// and about the axes of its link. None if the derivatives end before.
    #[getter]
    fn last_by<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.found.last_by.as_ref().map(|by| matrix(py, by)).transpose()
    }

    /// The rate of the final displacement and velocity, (qd, acceleration), shape (2 nv,); of a run that ends with an event that after it.
    #[getter]
    fn rate<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        list(py, &self.found.rate)
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
