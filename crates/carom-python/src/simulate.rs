//! Methods of `Scene` that run it.

use crate::array;
use crate::error::warn;
use crate::linear_run::LinearRun;
use crate::run::{Run, Told};
use crate::scene::Scene;
use crate::sensitivity::{self, Sensitivity, names};
use crate::session::Session;
use crate::table::Table;
use crate::threads::{LOOK, interruptible, left_behind};
use carom_sim::{Columns, Sampling, Seen};
use carom_study::{Ensemble, NumberedRows, SCENE_KEY};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

#[pymethods]
impl Scene {
    /// Simulates the scene from event to event. The GIL is released, except while a function in Python is called.
    ///
    /// Args:
    ///     sample: time between samples, s; by default that of the scene, or 0.004 s.
    ///     loads: computes the forces of the motors at each sample (`Run.motors`), and the loads on the joints at each impact
    ///         (`Run.loads`, `Event.loads`).
    ///     error: estimates the errors of the samples, of the end and of the times of events, by one or two more runs with tighter tolerances
    ///         (`Run.error`, `Run.q_error`, `Run.qd_error`, `Event.time_error`).
    ///
    /// Raises:
    ///     SimulationError: an overlap at the start, a motion that cannot be continued, an `accuracy` that no tolerance meets. Exceptions of a
    ///         law or a controller in Python are passed on as they are.
    ///     ValueError: `error` or an `accuracy` with a controller with a rate.
    #[pyo3(signature = (*, sample=None, loads=false, error=false))]
    fn simulate(&self, py: Python<'_>, sample: Option<f64>, loads: bool, error: bool) -> PyResult<Run> {
        let (scene, plan) = self.planned(py)?;
        let every = sample.or(self.scene.sample).unwrap_or(carom_sim::Scene::SAMPLE);
        let sampling = Sampling { every: Some(every), dense: every > LOOK, loads };
        let rated = self.functions.controller.as_ref().and_then(|it| Some((it, it.rate()?)));
        if error {
            self.functions.refuse_rate("error")?;
        }
        let duration = self.scene.duration;
        let done = interruptible(py, |look| {
            let mut seen = Vec::new();
            let watch = &mut |it: Seen| {
                look();
                seen.extend(Told::of(&it));
            };
            let summary = match rated {
                Some((controller, rate)) => controller.run((&plan, rate), duration, sampling, watch)?,
                None => plan.stream(duration, sampling, watch)?,
            };
            Ok((seen, summary))
        });
        let (seen, summary) = self.functions.pass(done?)?;
        let error = error.then(|| {
            let (mut plan, told, end) = (plan.clone(), Told::events_and_moments(&seen), summary.clone());
            left_behind(py, move |stop| {
                plan.simulation.stop = Some(stop.clone());
                plan.error_of((duration, Some(every)), (&told.0, &told.1, &end))
            })
        });
        let error = error.transpose()?.map(|error| self.functions.pass(error)).transpose()?;
        let run = Run::new(scene, plan, seen, summary, (loads, error));
        for warning in run.all_warnings() {
            warn(py, warning)?;
        }
        Ok(run)
    }

    /// Starts a Session: a simulation that a loop of one's own advances.
    ///
    /// Raises:
    ///     SimulationError: an overlap at the start.
    ///     ValueError: the scene has a controller with a rate.
    fn session(&self, py: Python<'_>) -> PyResult<Session> {
        if self.functions.rate().is_some() {
            return Err(PyValueError::new_err(
                "the scene has a controller with a rate, but in a session your loop samples: start the session of the scene \
                 without it, and set the joint forces with set_forces",
            ));
        }
        let (scene, plan) = self.planned(py)?;
        let session = py.detach(|| plan.start());
        Ok(Session::new(self.functions.pass(session)?, &scene, self.functions.clone()))
    }

    /// The derivatives of the whole run: of the final state and of the times of events, by the start and by parameters.
    /// The GIL is released, except while a law in Python is called.
    ///
    /// Args:
    ///     wrt: by what, in the order of the columns. "q" and "qd" are the whole start, "q elbow" a part of it; parameters are "restitution"
    ///         and "friction" of all contacts together, "kp elbow", "kd elbow", "target elbow" or "torque elbow" of each joint under PD
    ///         control or constant forces, and any number of the scene by the path of its key, as in `with_keys`: "contact.friction",
    ///         "run.gravity[2]", "surface[0].contact.restitution". Rows of tables have numbers: "torque elbow 3", "reference elbow 3". A name stands
    ///         for all that begin with it: "kp", "torque elbow". By default all but the keys.
    ///
    /// Raises:
    ///     ValueError: a name that the scene does not have; a key that is no number, or that changes the start or the duration; a controller
    ///         with a rate.
    ///     SimulationError: as `simulate`; a key that changes the joints or the possible contacts. A run that is not differentiable is no
    ///         error: see `Sensitivity.broken`.
    #[pyo3(signature = (wrt=None))]
    fn sensitivity(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = names)] wrt: Option<Vec<String>>,
    ) -> PyResult<Sensitivity> {
        self.functions.refuse_rate("sensitivity")?;
        let (scene, mut plan) = self.planned(py)?;
        let chosen = sensitivity::chosen(py, &scene, &plan, wrt)?;
        let (duration, rows) = (self.scene.duration, plan.simulation.state_names());
        let found = left_behind(py, move |stop| {
            plan.simulation.stop = Some(stop.clone());
            sensitivity::of(&plan, duration, &chosen)
        })?;
        let (found, events) = self.functions.pass(found)?;
        Sensitivity::new(py, (found, rows), events)
    }

    /// The whole run as a linear map, whose transpose gives the gradient of a number by the start and by parameters.
    /// The GIL is released, except while a law in Python is called.
    ///
    /// Args:
    ///     wrt: as of `sensitivity`.
    ///
    /// Raises:
    ///     ValueError: as `sensitivity`.
    ///     SimulationError: as `sensitivity`; a run that is not differentiable, with time and reason.
    #[pyo3(signature = (wrt=None))]
    fn linear_run(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = names)] wrt: Option<Vec<String>>,
    ) -> PyResult<LinearRun> {
        self.functions.refuse_rate("linear_run")?;
        let (scene, mut plan) = self.planned(py)?;
        let Columns { parameters, columns } = sensitivity::chosen(py, &scene, &plan, wrt)?;
        let duration = self.scene.duration;
        let run = left_behind(py, move |stop| {
            plan.simulation.stop = Some(stop.clone());
            plan.linear_run(duration, &parameters)
        })?;
        Ok(LinearRun::new(self.functions.pass(run)?, columns))
    }

    /// Runs the scene `count` times with the disturbances of `[run] perturb` of the scene, on all cores.
    ///
    /// Args:
    ///     count: number of runs.
    ///     shard: (part, parts), counted from 1: computes this part of the runs only. A row depends on its number only, so that the parts in
    ///         order are the whole table, wherever they are computed.
    ///
    /// Returns:
    ///     A Table with a row for each run: run (0 has no disturbance), outcome ("duration", "events", "refused"), impacts,
    ///     first_impact (s), events, same_events (1 if they are those of run 0); the disturbed numbers of the scene; start.q.<joint>,
    ///     start.qd.<joint>; end.time, end.q.<joint>, end.qd.<joint>; energy_start, energy_end, lost_in_impacts, energy_error (J).
    ///
    /// Raises:
    ///     SimulationError: the scene has no disturbance, or one of a key that it does not have.
    ///     ValueError: the scene has a controller with a rate; no such part.
    #[pyo3(signature = (count, *, shard=None))]
    fn runs(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = array::count)] count: u64,
        #[pyo3(from_py_with = array::count)] shard: Option<(u64, u64)>,
    ) -> PyResult<Table> {
        if self.functions.rate().is_some() {
            return Err(PyValueError::new_err("the scene has a controller with a rate: simulate each start by itself"));
        }
        let disturbed = self.scene.perturbation.as_ref().is_some_and(|it| !it.numbers.is_empty());
        if disturbed && !self.functions.is_empty() {
            return Err(PyValueError::new_err(
                "the scene has a law or a controller in Python, and its perturb disturbs numbers of its keys: simulate each scene by itself",
            ));
        }
        let (scene, mut plan) = self.planned(py)?;
        let scene = scene.scene.clone();
        let own = scene.clone();
        let done = left_behind(py, move |stop| {
            plan.simulation.stop = Some(stop.clone());
            let ensemble = Ensemble::new(&own, &plan, count)?;
            let part = shard.map(|(part, parts)| ensemble.shard(part, parts));
            let Some(range) = part.unwrap_or(Some(0..count)) else { return Ok(None) };
            let mut rows = Vec::new();
            ensemble.for_each(range, stop, |row| rows.extend(row));
            Ok(Some((ensemble.columns().to_vec(), rows)))
        })?;
        let Some((columns, rows)) = self.functions.pass(done)? else {
            return Err(PyValueError::new_err("shard: give (part, parts) with 1 ≤ part ≤ parts"));
        };
        Ok(Table::of_rows(columns, &rows).with_text(SCENE_KEY, &scene.text))
    }
}
