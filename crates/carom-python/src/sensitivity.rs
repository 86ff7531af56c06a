//! Derivatives of whole runs.

use crate::array::{Array, array, list};
use crate::pickle::{Parts, Pickled, tuple};
use crate::run::RunEvent;
use crate::scene::Scene;
use carom_sim::{Parameter, Plan, Sampling, Seen, SimError, Simulation};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyList;
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

/// The parameters of a derivative of a run, and the columns that are asked for.
pub struct Chosen {
    pub parameters: Vec<Parameter>,
    /// The columns of the result among those of the whole start and of these parameters.
    pub columns: Vec<usize>,
}

/// What these names mean, all but the keys of the scene if there are no names.
pub fn chosen(py: Python<'_>, scene: &Scene, plan: &Plan, wrt: Option<Vec<String>>) -> PyResult<Chosen> {
    let (start, all) = (plan.simulation.state_names(), Parameter::all(&plan.simulation));
    let Some(wrt) = wrt else {
        let columns = (0..start.len() + all.len()).collect();
        return Ok(Chosen { parameters: all, columns });
    };
    let (mut parameters, mut columns) = (Vec::new(), Vec::new());
    for name in &wrt {
        let part = format!("{name} ");
        let of_start = start.iter().enumerate().filter(|(_, own)| *own == name || own.starts_with(&part));
        let of_start: Vec<usize> = of_start.map(|(k, _)| k).collect();
        if !of_start.is_empty() {
            columns.extend(of_start);
            continue;
        }
        columns.push(start.len() + parameters.len());
        match all.iter().find(|parameter| parameter.name() == name) {
            Some(parameter) => parameters.push(parameter.clone()),
            None if name.contains('.') => parameters.push(of_key(py, scene, name)?),
            None => {
                let known: Vec<&str> =
                    start.iter().map(String::as_str).chain(all.iter().map(Parameter::name)).collect();
                let message = format!(
                    "'{name}' is no number of the scene: wrt has \"q\", \"qd\", {}, and paths of keys like contact.friction",
                    known.join(", ")
                );
                return Err(PyValueError::new_err(message));
            }
        }
    }
    Ok(Chosen { parameters, columns })
}

/// The number at the path of a key as a parameter.
fn of_key(py: Python<'_>, scene: &Scene, path: &str) -> PyResult<Parameter> {
    let (number, _) = scene.with_number(py, path, 0.0)?;
    let scale = if number == 0.0 { 1.0 } else { number.abs() };
    let (_, beside) = scene.with_number(py, path, CHANGE * scale)?;
    let [own, other] = [&scene.scene, &beside.scene].map(|it| (&it.q, &it.qd, it.duration));
    if own != other {
        let message = format!(
            "{path} changes the start or the duration: take the start by \"q\", \"qd\" or a part of it, and the end by `last_by`"
        );
        return Err(PyValueError::new_err(message));
    }
    let (scene, path) = (scene.again(), path.to_owned());
    let name = path.clone();
    Ok(Parameter::try_new(name, scale, move |simulation, delta| {
        let refused = |rule: String| SimError::Scene { file: path.clone(), rule };
        let changed = Python::try_attach(|py| {
            let (_, changed) = scene.with_number(py, &path, delta).map_err(|e| refused(e.value(py).to_string()))?;
            changed.scene.plan()
        });
        let changed = changed.unwrap_or_else(|| Err(refused("the interpreter is shutting down".into())))?;
        *simulation = Simulation { stop: simulation.stop.clone(), ..changed.simulation };
        Ok(())
    }))
}

/// The share of a number by which it is changed to see what depends on it.
const CHANGE: f64 = 1e-5;

/// The derivatives of a planned run, of which these columns are kept, and its events.
pub fn of(
    plan: &Plan,
    duration: f64,
    parameters: &[Parameter],
    columns: &[usize],
) -> Result<(carom_sim::Sensitivity, Vec<RunEvent>), SimError> {
    let mut found = plan.sensitivity(duration, parameters)?;
    found.names = columns.iter().map(|&k| found.names[k].clone()).collect();
    found.last_by = found.last_by.map(|by| by.select_columns(columns));
    for event in &mut found.events {
        event.time_by = columns.iter().map(|&k| event.time_by[k]).collect();
    }
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
