//! Derivatives of whole runs.

use crate::array::{array, list};
use crate::pickle::fields;
use carom_sim::{Parameter, Plan, SimError};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::pythonize;

/// The derivatives of a whole run: of its final state and of the times of its events. `Scene.sensitivity` makes one.
///
/// The columns are the numbers of the start (a displacement of q, then qd) and the parameters, in the order of `names`.
#[pyclass(frozen, module = "carom")]
pub struct Sensitivity {
    found: carom_sim::Sensitivity,
}

fields! { Sensitivity { found } }

impl From<carom_sim::Sensitivity> for Sensitivity {
    fn from(found: carom_sim::Sensitivity) -> Self {
        Self { found }
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

/// The derivatives of a planned run.
pub fn of(plan: &Plan, duration: f64, parameters: &[Parameter]) -> Result<Sensitivity, SimError> {
    plan.sensitivity(duration, parameters).map(Sensitivity::from)
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

    /// The events with derivatives: dicts of time (s), kinds (names) and time_by, shape (columns,).
    #[getter]
    fn events<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let event = |event: &carom_sim::EventTime| -> PyResult<_> {
            Ok(dict! { py,
                "time": event.time,
                "kinds": &event.kinds,
                "time_by": list(py, &event.time_by)?,
            })
        };
        self.found.events.iter().map(event).collect()
    }

    fn __repr__(&self) -> String {
        let (columns, events) = (self.found.names.len(), self.found.events.len());
        match &self.found.broken {
            None => format!("<carom.Sensitivity by {columns} numbers, {events} events>"),
            Some(broken) => format!("<carom.Sensitivity by {columns} numbers until {} s>", broken.time),
        }
    }
}
